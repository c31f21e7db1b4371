"""Variable projection: no starting values, no logarithm, a standard error for every number."""

import math
from typing import Any, Literal, Self

import numpy as np

import palpate._core as _core
from palpate._core import EstimateValue, noise_of
from palpate.errors import InvalidParameterError
from palpate.force_laws import HuntCrossley
from palpate.method.contact import Contact
from palpate.method.estimators.contact_estimator import (
    CompiledEstimator,
    Rejection,
    check_exponent,
    loop_settings,
)
from palpate.method.estimators.estimate import Estimate, Trace
from palpate.method.estimators.law_verdicts import ONE_WAY
from palpate.method.estimators.least_squares import least_squares, robust_covariance
from palpate.method.rows import rms
from palpate.method.settings import (
    SAMPLE_TIME,
    ChangeDetector,
    ContactGate,
    Forgetting,
    Scale,
)
from palpate.validation import Floats, arguments, instance, number_in, pair_in, shown

_DEFAULTS = _core.defaults["VariableProjection"]
# The default scale, for a hand-sized robot.
PROBING = Scale(*_DEFAULTS["scale"])


class VariableProjection(CompiledEstimator, _core.VariableProjection):
    """The Hunt–Crossley law by variable projection: exact least squares in the force domain.

    min over (K, B, n, F₀) of Σ (F − K xⁿ − B xⁿ v − F₀)²

    For each exponent of a grid the law is linear in the other parameters, so that a few sums per
    exponent contain all information of the samples. The minimum over n is searched globally, then
    refined. The method needs no logarithm, no condition 10 and no starting values. It attains the
    Cramér–Rao bound if the noise is white, penetration and velocity are exact, and the law holds.
    Adding a sample is cheap; a call of ``estimate`` solves.

    Parameters
    ----------
    noise : float, optional
        Standard deviation of the force, N, > 0. Default: estimated from the residual.
    forgetting : ConstantForgetting or FadingForgetting, optional
        Forgetting of old samples. Default: none.
    change_detector : ChangeDetector, optional
        Restarts the estimate when the probe touches another material. Default: none.
    outlier_rejection : OutlierRejection or False, optional
        Rejects dropouts and spikes. Default (None): off, but on in :func:`identify`; False: off.
    offset : bool
        Estimate a constant force offset, the sensor's remaining bias. Default: True.
    offset_deviation : float, optional
        Standard deviation of the force offset after the tare, N, > 0: a prior
        F₀ ~ N(0, offset_deviation²). Default: one unit of force; in :func:`identify` the contact's
        ``tare_deviation``, if any. Quantisation in steps Δ leaves (Δ/π) exp(−2π²σ²/Δ²). Ten or more
        samples in free air inform the offset too. If the contact contradicts the tare by three
        standard deviations, it is flagged; if it contradicts a prior by five, the prior is dropped.
    exponent_range : tuple of float
        Range of the exponent: (lowest, highest), within [0.1, 10], 0.2 to 5 apart.
    exponent : float, optional
        Known n, in [0.1, 10], from the tip's shape: 1.5 for a sphere. It stays fixed, with a
        standard error of 0; ``exponent_range`` has no effect. Default: estimated.
    surface : "estimate", optional
        Also estimate the surface position, within ``surface_range``, from samples that include the
        free approach; the gate then does not apply. Default: the penetration is 0 at the surface.
    surface_range : tuple of float, optional
        Range of the surface position, m, in the coordinate of the penetration: (lowest, highest),
        with 41 candidates. Default: ± a fifth of the unit of penetration, ±2 mm without ``scale``.
    surface_deviation : float, optional
        Standard deviation of the surface position, m, > 0. A wrong surface looks like an offset, so
        the offset's prior, from free air or a tare, is no tighter than this depth times the
        stiffness F/x of the ``scale``, which must be near the largest values. Default: 0; in
        :func:`identify` twice the noise and rounding of the penetration, because the zero of an
        encoder lies anywhere within its step.
    weak_prior : bool
        In :func:`identify`, if the probe moves one way at nearly one speed, which does not identify
        n and B: use the least squares with B ≥ 0 and n from 1 to 2, and report it. Default: True.
    gate : ContactGate, optional
        Selects the samples in contact. With a ``make_force`` of 0 (the default) the estimator
        selects among the samples deeper than ``minimum_penetration``, from the force of each
        sample's neighbours; a selection by the sample's own force would bias the law
        (``docs/explain/default-method.md``). A positive ``make_force`` applies as it is.
    sample_time : float
        Time between samples when ``update`` gets no ``dt``, s, in (0, 1e6]. Default: 1 ms.
    scale : Scale, optional
        Units of the arithmetic, near the largest expected values. Default: 10 mm, 20 mm/s and 1 N;
        in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> law = palpate.HuntCrossley(K=900.0, B=2000.0, n=1.5)
    >>> estimator = palpate.VariableProjection(noise=0.01)
    >>> for t in np.arange(0.0, 2.0, 0.001):
    ...     depth, velocity = 5e-3 - 5e-3 * np.cos(7.0 * t), 35e-3 * np.sin(7.0 * t)
    ...     status = estimator.update(depth, velocity, law.force(depth, velocity))
    >>> law = estimator.estimate().law
    >>> round(law.K), round(law.B), round(law.n, 3)
    (900, 2000, 1.5)
    """

    __slots__ = ("_settings",)
    method = "variable-projection"
    law_type = HuntCrossley
    chooses_samples = True
    knows_offset = True
    works_without_time = True

    def __init__(
        self,
        *,
        noise: float | None = None,
        forgetting: Forgetting | None = None,
        change_detector: ChangeDetector | None = None,
        outlier_rejection: Rejection = None,
        offset: bool = _DEFAULTS["offset"],
        offset_deviation: float | None = None,
        exponent_range: tuple[float, float] = _DEFAULTS["exponent_range"],
        exponent: float | None = None,
        surface: Literal["estimate"] | None = None,
        surface_range: tuple[float, float] | None = None,
        surface_deviation: float | None = None,
        weak_prior: bool = True,
        gate: ContactGate | None = None,
        sample_time: float = SAMPLE_TIME,
        scale: Scale | None = None,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        instance("weak_prior", weak_prior, bool)
        loop = loop_settings(self._settings, PROBING)
        unit = (scale or PROBING).penetration
        least, most = _DEFAULTS["surface_range"]
        surfaces = surfaces_in(surface, surface_range, (least * unit, most * unit), 5.0 * unit)
        deviation = positive_or_none("surface_deviation", surface_deviation)
        super().__init__(projection_settings(self._settings), (surfaces, deviation), loop)

    def second_pass(self) -> Self | None:
        """Return a fresh estimator that corrects the sensor's rounding as this one learned it.

        None if the force is not rounded, or if old samples count less, whose correction would then
        differ.
        """
        if self._settings["forgetting"] or self._settings["change_detector"]:
            return None
        fresh = self.replace()
        return fresh if fresh._unround_as(self) else None


def projection_settings(
    settings: dict[str, Any],
) -> tuple[float, tuple[float, float], float, bool, float]:
    """Check the projection's settings for the compiled constructors; 0 means None."""
    noise = positive_or_none("noise", settings["noise"])
    exponents = settings["exponent_range"]
    low, high = pair_in("exponent_range", exponents, 0.1, 10.0)
    if not 0.2 <= high - low <= 5.0:
        raise InvalidParameterError(
            f"exponent_range must be (lowest, highest), 0.2 to 5 apart, not {shown(exponents)}"
        )
    known = check_exponent(settings["exponent"]) or 0.0
    offset = settings["offset"]
    instance("offset", offset, bool)
    tare = positive_or_none("offset_deviation", settings["offset_deviation"])
    return noise, (low, high), known, offset, tare


def positive_or_none(name: str, value: float | None) -> float:
    """Check a number above 0 for the compiled constructors; 0 means None."""
    return 0.0 if value is None else number_in(name, value, 0.0, 1e30, open_low=True)


def surfaces_in(
    surface: str | None,
    surface_range: tuple[float, float] | None,
    default: tuple[float, float],
    widest: float,
) -> tuple[float, float] | None:
    """Check the range of an estimated surface position, m; None: not estimated."""
    if not (surface is None or (isinstance(surface, str) and surface == "estimate")):
        raise InvalidParameterError(f"surface must be 'estimate' or None, not {shown(surface)}")
    if surface is None and surface_range is not None:
        raise InvalidParameterError(
            "surface_range needs surface='estimate'; otherwise the surface is at 0"
        )
    if surface_range is None:
        return None if surface is None else default
    low, high = pair_in("surface_range", surface_range, -widest, widest)
    if not high > low:
        raise InvalidParameterError(
            f"surface_range must be (lowest, highest) in m, not {shown(surface_range)}"
        )
    return low, high


# A contact whose material changes slowly.

_DRIFT_DEFAULTS = _core.defaults["DriftTracking"]


class DriftTracking(CompiledEstimator, _core.DriftTracking):
    """The Hunt–Crossley law of a drifting material, by an extended Kalman filter.

    F = k ξⁿ (1 + b v) + F₀,  ξ = x/x_r;  d(ln k), db and dn are random walks.

    Until the standard error of the exponent is below 0.05, variable projection provides the
    estimate, with a flag; then the filter starts from that estimate, covariance and noise. (From
    arbitrary values such a filter diverges in about one start of ten.) For a material that changes
    abruptly, use a :class:`ChangeDetector`. If nothing drifts, the errors are about three times as
    large as with variable projection. If the errors of the start show that the noise is correlated,
    the standard errors are wider.

    Parameters
    ----------
    stiffness_drift : float
        Random walk of ln k in one second, 1/√s, ≥ 0. If it is too large, the exponent is no longer
        identifiable; 0.02 follows ±30 % at 0.1 Hz to a few tenths of a percent.
    dissipation_drift : float
        Random walk of b = B/K in one second, s/m per √s, ≥ 0.
    exponent_drift : float
        Random walk of n in one second, 1/√s, ≥ 0; 0 for a known exponent.
    noise, offset, offset_deviation, exponent_range, exponent : optional
        As in :class:`VariableProjection`, except that ``offset`` is False by default: few motions
        identify an offset together with a drifting stiffness.
    change_detector, outlier_rejection, gate, sample_time, scale : optional
        As in :class:`VariableProjection`.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.DriftTracking(stiffness_drift=0.01)
    >>> result = palpate.identify("examples/recordings/ball.csv", estimator)
    >>> round(result.law.stiffness_at(5e-3), -2)  # N/m
    2000.0
    """

    __slots__ = ("_settings",)
    method = "drift-tracking"
    law_type = HuntCrossley

    def __init__(
        self,
        *,
        stiffness_drift: float = _DRIFT_DEFAULTS["stiffness_drift"],
        dissipation_drift: float = _DRIFT_DEFAULTS["dissipation_drift"],
        exponent_drift: float = _DRIFT_DEFAULTS["exponent_drift"],
        noise: float | None = None,
        offset: bool = _DRIFT_DEFAULTS["offset"],
        offset_deviation: float | None = None,
        exponent_range: tuple[float, float] = _DRIFT_DEFAULTS["exponent_range"],
        exponent: float | None = None,
        change_detector: ChangeDetector | None = None,
        outlier_rejection: Rejection = None,
        gate: ContactGate | None = None,
        sample_time: float = SAMPLE_TIME,
        scale: Scale | None = None,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        drift = (
            number_in("stiffness_drift", stiffness_drift, 0.0, 100.0),
            number_in("dissipation_drift", dissipation_drift, 0.0, 1e6),
            number_in("exponent_drift", exponent_drift, 0.0, 100.0),
        )
        if exponent is not None and drift[2] > 0.0:
            raise InvalidParameterError(
                f"exponent_drift must be 0 for a known exponent, not {exponent_drift!r}"
            )
        loop = loop_settings(self._settings, PROBING)
        super().__init__(projection_settings(self._settings), drift, loop)


# The least squares in the box B ≥ 0, 1 ≤ n ≤ 2, for a motion that does not identify n and B.
# At one speed v a spring K xⁿ and a damper B v xⁿ are the same function of the depth. A misfit of
# the law then changes B and n: a press alone gave n = 3.6 and B < 0 on a soft sample, and a force
# six times too large for the release. Tips have exponents from 1, a flat punch, to 2, a cone, and
# no passive material has B < 0.

EXPONENTS = (1.0, 2.0)
# Least ratio of the residual's means over a fortieth of the samples to the noise. Below it the law
# describes the force, and its shape determines n, as in a simulation.
MISFIT = 3.0
BLOCKS = 40


class ConstrainedEstimate(Estimate):
    """An estimate under the prior; its covariance ignores the bounds."""

    __slots__ = ()


def solve_in_box(contact: Contact, trace: Trace, estimate: Estimate) -> ConstrainedEstimate | None:
    """Return the least squares in the box, with the same offset; None if the box is not needed.

    Parameters
    ----------
    contact : Contact
        The identified contact.
    trace : Trace
        The trace of the identification, which tells the samples taken.
    estimate : Estimate
        The least squares of a Hunt–Crossley law without bounds.
    """
    law = estimate.law
    taken = trace.taken
    low, high = EXPONENTS
    x = contact.penetration[taken] - estimate.surface
    v = contact.velocity[taken]
    force = contact.force[taken] - estimate.offset
    one_way = abs(float(v.mean())) > ONE_WAY * rms(v)
    if not one_way or (low <= law.n <= high and law.B >= 0.0):
        return None
    width = max(x.size // BLOCKS, 1)
    means = (force - law.force(x, v))[: x.size // width * width].reshape(-1, width).mean(axis=1)
    if not math.sqrt(width * float(np.mean(means**2))) > MISFIT * noise_of(force):
        return None
    deep = float(x.max())
    fast = float(np.abs(v).max())
    local = HuntCrossley(K=float(force.max()), B=0.0, n=float(np.clip(law.n, low, high)))

    def model(p: Floats) -> tuple[Floats, Floats]:
        predicted, slopes = local.force_and_gradient(p, x / deep, v / fast)
        return force - predicted, slopes

    bounds = np.array([-np.inf, 0.0, low]), np.array([np.inf, np.inf, high])
    fit = least_squares(model, local.parameters, bounds)
    law = HuntCrossley.from_parameters(fit.parameters).scaled(1.0 / deep, 1.0 / fast)
    joint = np.zeros((4, 4))
    joint[:3, :3] = robust_covariance(law.parameter_gradient(x, v), fit.residual)
    joint[3, 3] = estimate.offset_standard_error**2
    counts = estimate.status, estimate.samples, 1.0, 0, 0, estimate.rejected
    value = EstimateValue(law.parameters, joint.reshape(-1), *counts, offset=estimate.offset)
    return ConstrainedEstimate(value, HuntCrossley)
