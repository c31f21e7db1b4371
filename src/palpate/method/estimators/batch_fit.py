"""Batch fits of whole curves: the Hunt–Crossley law, thousands of curves a second.

The same least squares as :class:`VariableProjection`, for complete contacts that need only the
final estimate; ``docs/reference/curves.md`` defines the cost and explains how it is minimised.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.force_laws import HuntCrossley
from palpate.method.estimators.estimate import flag_findings
from palpate.method.estimators.variable_projection import projection_settings, surfaces_in
from palpate.method.settings import Scale
from palpate.validation import (
    Floats,
    Integers,
    Mask,
    all_good,
    arguments,
    instance,
    real_array,
    whole_in,
)

_SIGNALS = ("penetration", "velocity", "force")
_AT_ONCE = 2_000_000  # samples per call of the core; Ctrl-C takes effect between calls
_RANGE: tuple[float, float] = _core.defaults["VariableProjection"]["exponent_range"]
_MOST_SAMPLES = 1 << 20  # the noise levels of the error bars end at this many
#: Names of the codes in :attr:`CurveFits.status`.
STATUS_WORDS = ("fitted", "no contact", "did not settle", "surface at the edge of its range")


@dataclass(frozen=True, eq=False)
class CurveFits:
    """Result of :func:`fit_curves`, one row per curve; numbers are NaN without contact.

    Parameters
    ----------
    K, B, n : numpy.ndarray, shape (k,)
        N/mⁿ; N·s/mⁿ⁺¹; 1.
    offset, surface : numpy.ndarray, shape (k,)
        F₀, N, and d, m; 0 if not estimated.
    covariance : numpy.ndarray, shape (k, 5, 5)
        Covariance of (K, B, n, F₀, d), SI; zero for parameters that are not estimated.
    noise : numpy.ndarray, shape (k,)
        Standard deviation of the force, N: from the residual, or as specified.
    cost : numpy.ndarray, shape (k,)
        The minimised cost, N².
    taken : numpy.ndarray of int64, shape (k,)
        Number of samples in the cost.
    flags : numpy.ndarray of uint8, shape (k,)
        Bits of ``IdentifiabilityFlag``; :meth:`describe_flags` describes them.
    status : numpy.ndarray of uint8, shape (k,)
        Codes of the status; :attr:`status_names` has its words.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> depth = np.linspace(0.0, 5e-3, 200)
    >>> fits = palpate.fit_curves(depth, np.full(200, 0.01), 1000.0 * depth, exponent=1.0)
    >>> fits.status_names, fits.K.round(3).tolist()
    (['fitted'], [1000.0])
    >>> fits.law(0).n
    1.0
    """

    K: Floats
    B: Floats
    n: Floats
    offset: Floats
    surface: Floats
    covariance: Floats
    noise: Floats
    cost: Floats
    taken: Integers
    flags: NDArray[np.uint8]
    status: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        middle = (f"{name} {np.nanmedian(getattr(self, name)):.4g}" for name in "KBn")
        return f"<CurveFits of {len(self)} curves: in the median {', '.join(middle)}>"

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of (K, B, n, F₀, d), SI, shape (k, 5)."""
        errors: Floats = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return errors

    @property
    def status_names(self) -> list[str]:
        """The name of each curve's status."""
        return [STATUS_WORDS[code] for code in self.status.tolist()]

    def where_status(self, name: str) -> Mask:
        """Mask of the curves with the status of this name, such as ``"no contact"``."""
        curves: Mask = self.status == STATUS_WORDS.index(name)
        return curves

    def law(self, curve: int) -> HuntCrossley:
        """The law of one curve."""
        return HuntCrossley(K=float(self.K[curve]), B=float(self.B[curve]), n=float(self.n[curve]))

    def describe_flags(self, curve: int) -> tuple[str, ...]:
        """Parameters that the motion of one curve does not identify, and a motion that would."""
        return tuple(map(str, flag_findings(int(self.flags[curve]))))


def fit_curves(
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    force: "ArrayLike",
    *,
    surface: Literal["estimate"] | None = None,
    surface_range: tuple[float, float] | None = None,
    exponent: float | None = None,
    exponent_range: tuple[float, float] = _RANGE,
    offset: bool = True,
    offset_deviation: "ArrayLike | None" = None,
    surface_deviation: "ArrayLike | None" = None,
    noise: float | None = None,
    scale: Scale | None = None,
    threads: int = 1,
) -> CurveFits:
    """Fit the Hunt–Crossley law to whole curves, thousands a second.

    min over (K, B, n, F₀, d) of Σ (F − K (x − d)ⁿ − B (x − d)ⁿ v − F₀)² + priors

    The selection of samples, the priors and the error bars are the same as in
    :class:`VariableProjection`. At a known surface, that estimator's sample-by-sample result is
    within a tenth of a standard error of this minimum. Outliers are not rejected.
    ``docs/reference/curves.md`` defines the cost.

    Parameters
    ----------
    penetration, velocity, force : array_like, shape (k, samples) or (samples,)
        m, m/s (positive while penetrating) and N, one row per curve, in the order of time. Samples
        with a non-finite value are ignored: pad shorter curves with NaN.
    surface : "estimate", optional
        Also estimate the surface position, within ``surface_range``. Default: the surface is at 0.
    surface_range : tuple of float, optional
        Range of the surface position, m, in the coordinate of the penetration: (lowest, highest).
        Default: ± a fifth of the unit of penetration. With the default, a curve whose surface lies
        at an edge is fitted again: from one travel of the probe above its highest sample to its
        deepest sample.
    exponent : float, optional
        Known n, in [0.1, 10], from the tip's shape: 1.5 for a sphere. Default: fitted.
    exponent_range : tuple of float
        Range of the fitted exponent: (lowest, highest), within [0.1, 10], 0.2 to 5 apart.
    offset : bool
        Fit a constant force offset together with the law. Default: True.
    offset_deviation : float or array_like, shape (k,), optional
        Standard deviation of the force offset after the tare, N, > 0, for all curves or one per
        curve. Default, and NaN: no tare.
    surface_deviation : float or array_like, shape (k,), optional
        Standard deviation of the surface position, m, > 0, for all curves or one per curve.
        Default, and NaN: the surface is known exactly.
    noise : float, optional
        Standard deviation of the force, N, > 0. Default: from the residual.
    scale : Scale, optional
        Units of the arithmetic and of the priors. Default: the largest penetration, speed and force
        of each curve, as :func:`identify` chooses them.
    threads : int
        Number of threads, 1 to 1024. Default: 1. The interpreter's lock is released: do not change
        the arrays meanwhile.

    Returns
    -------
    CurveFits
        One row per curve; identical for any number of threads.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range, or the arrays differ in shape.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> time = np.linspace(0.0, 1.0, 500)
    >>> depth = 5e-3 - 10e-3 * np.abs(2.0 * time - 1.0)  # to 5 mm below the surface and back
    >>> velocity = np.where(time < 0.5, 20e-3, -20e-3)
    >>> force = palpate.HuntCrossley(K=900.0, B=2000.0, n=1.5).force(depth, velocity)
    >>> fits = palpate.fit_curves([depth, depth], [velocity, velocity], [force, 2.0 * force])
    >>> fits.K.round().tolist(), fits.n.round(3).tolist()
    ([900.0, 1800.0], [1.5, 1.5])
    """
    settings = arguments(locals())
    curves = _check_curves(*(settings.pop(name) for name in _SIGNALS))
    shared = whole_in("threads", settings.pop("threads"), 1, 1024)
    numbers, covariance, taken, codes = _fit_rows(
        curves,
        _check_settings(len(curves[0]), settings),
        shared,
    )
    *law, sigma, cost = numbers[:, :7].T.copy()
    columns: list[Any] = [*law, covariance, sigma, cost, taken, *codes.T.copy()]
    return CurveFits(*columns)


def _fit_rows(
    curves: tuple[Floats, ...],
    settings: tuple[Any, ...],
    threads: int,
    roles: NDArray[np.uint8] | None = None,
) -> tuple[Floats, Floats, Integers, NDArray[np.uint8]]:
    """The core's results, one row per curve: numbers, covariance, samples taken, and codes.

    The numbers are K, B, n, F₀, d, noise, cost, scale (3), prior of F₀ (2) and σ² of the priors;
    the codes are flags and status.
    """
    count, samples = curves[0].shape
    exponents, offset, noise, offset_deviation, surface_deviation, *rest = settings
    numbers = np.empty((count, 13))
    covariance = np.empty((count, 5, 5))
    taken = np.empty(count, np.int64)
    codes = np.empty((count, 2), np.uint8)
    rows = max(1, _AT_ONCE // max(samples, 1)) * threads
    for first in range(0, count, rows):
        block = slice(first, first + rows)
        inputs: list[Any] = [values[block] for values in curves]
        inputs += exponents, offset, noise, offset_deviation[block], surface_deviation[block], *rest
        inputs += [column[block] for column in (numbers, covariance, taken, codes)]
        inputs += [None if roles is None else roles[block], threads]
        _core.fit_curves(*inputs)
    return numbers, covariance, taken, codes


def _check_curves(*channels: "ArrayLike") -> tuple[Floats, ...]:
    arrays = [real_array(name, values) for name, values in zip(_SIGNALS, channels, strict=True)]
    shapes = {array.shape for array in arrays}
    if len(shapes) > 1 or arrays[0].ndim not in (1, 2):
        text = ", ".join(str(array.shape) for array in arrays)
        raise InvalidParameterError(
            f"penetration, velocity and force must all have shape (curves, samples), not {text}"
        )
    if arrays[0].shape[-1] > _MOST_SAMPLES:
        raise InvalidParameterError(
            f"curves must have at most {_MOST_SAMPLES} samples, not {arrays[0].shape[-1]}: "
            "use VariableProjection for longer ones"
        )
    return tuple(np.ascontiguousarray(np.atleast_2d(array)) for array in arrays)


def _check_settings(count: int, settings: dict[str, Any]) -> tuple[Any, ...]:
    """The settings of :func:`fit_curves`, as the core takes them; 0 means not specified."""
    offset = settings["offset"]
    scale = settings["scale"]
    # Each curve has its own offset prior.
    level, exponents, fixed, *_ = projection_settings({**settings, "offset_deviation": None})
    exponents = (fixed, fixed) if fixed else exponents
    instance("scale", scale, (Scale, type(None)))
    deviations = (
        _one_per_curve(name, settings[name], count)
        for name in ("offset_deviation", "surface_deviation")
    )
    # A range of (0, 0) lets the core choose the surface's range.
    surfaces = surfaces_in(settings["surface"], settings["surface_range"], (0.0, 0.0), 1e30)
    units = (0.0, 0.0, 0.0) if scale is None else scale._plain()
    return exponents, offset, level, *deviations, surfaces, units


def _one_per_curve(name: str, value: "ArrayLike | None", count: int) -> Floats:
    """Return one deviation per curve; 0 means none."""
    if value is None:
        return np.zeros(count)
    values = real_array(name, value)
    if values.shape not in ((), (1,), (count,)):
        raise InvalidParameterError(
            f"{name} must be one number, or one for each of {count} curves, not an array of shape "
            f"{values.shape}"
        )
    all_good(name, values, np.isnan(values) | ((values > 0.0) & (values <= 1e30)), "in (0, 1e+30]")
    return np.ascontiguousarray(np.broadcast_to(np.nan_to_num(values, nan=0.0), count))
