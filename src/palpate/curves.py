"""Whole curves at once: the Hunt–Crossley law by the minimum of a stated cost, thousands a second.

The same least squares as :class:`VariableProjection`, for contacts that are there as a whole and of
which only the last answer is wanted; ``docs/curves.md`` has the cost and how it is minimised.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.estimate import ADVICE
from palpate.estimators.variable_projection import VariableProjection
from palpate.force_laws import HuntCrossley
from palpate.settings import Scale
from palpate.validation import Floats, real_array, shown

_RANGE: tuple[float, float] = _core.defaults["VariableProjection"]["exponent_range"]
#: By the codes of :attr:`CurveFits.status`.
STATUS_WORDS = ("fitted", "no contact", "did not settle")


@dataclass(frozen=True, eq=False)
class CurveFits:
    """What :func:`fit_curves` found, one row a curve.

    Attributes
    ----------
    stiffness, damping, exponent : numpy.ndarray, shape (k,)
        K, N/mⁿ; B, N·s/mⁿ⁺¹; n. NaN without contact, as all the rest is.
    offset, surface : numpy.ndarray, shape (k,)
        F₀, N, and d, m; 0 where it is not estimated.
    covariance : numpy.ndarray, shape (k, 5, 5)
        Of (K, B, n, F₀, d), SI; zero where one is not estimated.
    noise : numpy.ndarray, shape (k,)
        Standard deviation of the force by the residual, or as it was given, N.
    cost : numpy.ndarray, shape (k,)
        The stated cost at its minimum, N².
    taken : numpy.ndarray of int64, shape (k,)
        Samples that the cost is over.
    flags : numpy.ndarray of uint8, shape (k,)
        Bits of ``IdentifiabilityFlag``; :meth:`flag_words` has them in words.
    status : numpy.ndarray of uint8, shape (k,)
        Codes of :data:`STATUS_WORDS`.
    """

    stiffness: Floats
    damping: Floats
    exponent: Floats
    offset: Floats
    surface: Floats
    covariance: Floats
    noise: Floats
    cost: Floats
    taken: NDArray[np.int64]
    flags: NDArray[np.uint8]
    status: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.status)

    @property
    def standard_errors(self) -> Floats:
        """Of (K, B, n, F₀, d), SI, shape (k, 5)."""
        errors: Floats = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return errors

    @property
    def words(self) -> list[str]:
        """The status of each curve in words."""
        return [STATUS_WORDS[code] for code in self.status.tolist()]

    def law(self, curve: int) -> HuntCrossley:
        """The law of one curve."""
        return HuntCrossley(
            float(self.stiffness[curve]), float(self.damping[curve]), float(self.exponent[curve])
        )

    def flag_words(self, curve: int) -> tuple[str, ...]:
        """What is not identifiable from the motion of one curve, and what motion would help."""
        bits = int(self.flags[curve])
        return tuple(words for bit, words in ADVICE.items() if bits & bit)


def fit_curves(
    penetration: ArrayLike,
    velocity: ArrayLike,
    force: ArrayLike,
    *,
    surface: Literal["estimate"] | None = None,
    surface_range: tuple[float, float] | None = None,
    exponent: float | None = None,
    exponent_range: tuple[float, float] = _RANGE,
    offset: bool = True,
    offset_deviation: float | ArrayLike | None = None,
    surface_deviation: float | ArrayLike | None = None,
    noise: float | None = None,
    scale: Scale | None = None,
    threads: int = 1,
) -> CurveFits:
    """Fit the Hunt–Crossley law to many curves.

    Parameters
    ----------
    penetration, velocity, force : array_like, shape (k, samples) or (samples,)
        m, m/s (positive while penetrating) and N, one row a curve, in the order of time. A sample
        with a NaN is not there.
    """
    x, v, f = (
        np.atleast_2d(real_array(name, values))
        for name, values in (("penetration", penetration), ("velocity", velocity), ("force", force))
    )
    if not x.shape == v.shape == f.shape or x.ndim != 2:
        raise InvalidParameterError(
            "penetration, velocity and force must be of one shape, (curves, samples), not "
            f"{x.shape}, {v.shape} and {f.shape}"
        )
    if exponent is not None:
        raise InvalidParameterError(f"exponent: not yet, {shown(exponent)}, {threads}")
    count = len(x)
    values = np.full((count, 5), np.nan)
    covariance = np.full((count, 5, 5), np.nan)
    taken, flags = np.zeros(count, np.int64), np.zeros(count, np.uint8)
    status = np.ones(count, np.uint8)
    tares = np.broadcast_to(0.0 if offset_deviation is None else offset_deviation, count)
    surfaces = np.broadcast_to(0.0 if surface_deviation is None else surface_deviation, count)
    for k in range(count):
        estimator = VariableProjection(
            noise=noise,
            offset=offset,
            offset_deviation=float(tares[k]) or None,
            surface_deviation=float(surfaces[k]) or None,
            exponent_range=exponent_range,
            surface=surface,
            surface_range=surface_range,
            scale=scale or _scale_of(x[k], v[k], f[k]),
        )
        estimator.replay(x[k], v[k], f[k])
        estimate = estimator.estimate()
        if not estimate.samples:
            continue
        status[k] = 0
        values[k] = (*estimate.parameters, estimate.offset, estimate.surface)
        covariance[k] = 0.0
        covariance[k, :4, :4] = estimate.joint_covariance
        covariance[k, 4, 4] = estimate.surface_standard_error**2
        taken[k], flags[k] = estimate.samples, estimate._value.flags
    unknown = np.full(count, np.nan)
    return CurveFits(*values.T, covariance, unknown, unknown, taken, flags, status)


def _scale_of(x: Floats, v: Floats, f: Floats) -> Scale:
    touching = (x > 0.0) & (f > 0.0)
    if not touching.any():
        return Scale()
    return Scale(*(float(values[touching].max()) or 1.0 for values in (x, np.abs(v), f)))
