"""Variable projection: no starting values, no logarithm, an error bar on every number."""

from typing import Any, Literal

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.estimators.contact_estimator import (
    CompiledEstimator,
    Rejection,
    known_exponent,
    loop_settings,
)
from palpate.force_laws import HuntCrossley
from palpate.settings import (
    SAMPLE_TIME,
    ChangeDetector,
    ContactGate,
    Forgetting,
    Scale,
)
from palpate.validation import arguments, instance, number_in, pair_in, shown

_DEFAULTS = _core.defaults["VariableProjection"]
# Where it is not chosen: the probing of a hand-sized robot.
PROBING = Scale(*_DEFAULTS["scale"])


class VariableProjection(CompiledEstimator, _core.VariableProjection):
    """The Hunt–Crossley law by variable projection: exact least squares in the force domain.

    min over (K, B, n, F₀) of Σ (F − K xⁿ − B xⁿ v − F₀)²

    For each exponent of a grid the law is linear in the rest, so a few sums per exponent hold all
    that the samples say; the minimum over n is searched globally and then solved. No logarithm, no
    condition 10, no starting values, and at the Cramér–Rao bound. Accumulating a sample is cheap;
    the solve happens when an estimate is asked for.

    Parameters
    ----------
    noise : float, optional
        Standard deviation of the force, N, > 0. None: estimated from the residual.
    forgetting : ConstantForgetting or FadingForgetting, optional
        None forgets nothing.
    change_detector : ChangeDetector, optional
        Restarts the estimate when another material is touched; None never does.
    outlier_rejection : OutlierRejection or False, optional
        Leaves lost positions and spikes out. None: off, and in :func:`identify` on; False: off.
    offset : bool
        Estimate a constant force offset beside the law: what the removal of the sensor's bias left.
    offset_deviation : float, optional
        What a tare left of that offset, N, > 0: a prior F₀ ~ N(0, offset_deviation²). None: one
        unit of force, and in :func:`identify` the contact's ``tare_deviation`` if it has one. What
        quantisation to steps Δ leaves is (Δ/π) exp(−2π²σ²/Δ²). Free air, ten samples and more of it
        above the surface, says the offset too. A tare that the contact contradicts by three
        deviations is flagged; a prior that it contradicts by five is dropped.
    exponent_range : tuple of float
        Where the exponent is looked for: (lowest, highest), within [0.1, 10], 0.2 to 5 apart.
    exponent : float, optional
        n, in [0.1, 10], where the shape of the tip tells it, as 1.5 for a sphere: it is kept, with
        an error of zero, and ``exponent_range`` does not count. None: it is looked for.
    surface : "estimate", optional
        Search for the position of the surface too, within ``surface_range``, from samples that
        include the free approach; the gate then does not apply. None: the penetration is measured
        from the surface.
    surface_range : tuple of float, optional
        Where the surface is looked for, m, in the coordinate of the penetration: (lowest, highest).
        Forty-one candidates. None: ± a fifth of the unit of penetration, ±2 mm without a ``scale``.
    surface_deviation : float, optional
        How well the position of the surface is known, m, > 0. A surface that is off looks like an
        offset, so what free air or a tare says of that is taken as no better than this depth times
        the stiffness F/x of the ``scale``, which has to be near the largest values. None: it is
        known exactly; in :func:`identify` to twice the noise and rounding of the penetration, as
        the zero of an encoder lies anywhere within its step.
    gate : ContactGate, optional
        Which samples are contact. With a ``make_force`` of 0, as None has it, the estimator chooses
        them itself among those deeper than ``minimum_penetration``: by the force of a sample's
        neighbours and never by its own, which would bias (``docs/variable-projection.md``). A
        ``make_force`` is honoured as it is.
    sample_time : float
        Time between samples where ``update`` is given none, s, in (0, 1e6].
    scale : Scale, optional
        Units of the arithmetic, near the largest values to come. None: 10 mm, 20 mm/s and 1 N, and
        in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.
    """

    __slots__ = ("_settings",)
    method = "variable-projection"
    law_type = HuntCrossley
    chooses_samples = True
    knows_offset = True

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
        gate: ContactGate | None = None,
        sample_time: float = SAMPLE_TIME,
        scale: Scale | None = None,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        loop = loop_settings(self._settings, PROBING)
        unit = (scale or PROBING).penetration
        least, most = _DEFAULTS["surface_range"]
        surfaces = surfaces_in(surface, surface_range, (least * unit, most * unit), 5.0 * unit)
        deviation = positive_or_none("surface_deviation", surface_deviation)
        super().__init__(projection_settings(self._settings), (surfaces, deviation), loop)


def projection_settings(
    settings: dict[str, Any],
) -> tuple[float, tuple[float, float], float, bool, float]:
    """Check what the projection is set by, as the compiled constructors take it; 0 is not given."""
    noise = positive_or_none("noise", settings["noise"])
    exponents = settings["exponent_range"]
    low, high = pair_in("exponent_range", exponents, 0.1, 10.0)
    if not 0.2 <= high - low <= 5.0:
        reason = "nothing" if high <= low else "too little or too much to search"
        raise InvalidParameterError(
            f"exponent_range must be 0.2 to 5 wide, not {shown(exponents)}: it holds {reason}"
        )
    known, offset = known_exponent(settings["exponent"]) or 0.0, settings["offset"]
    instance("offset", offset, bool)
    tare = positive_or_none("offset_deviation", settings["offset_deviation"])
    return noise, (low, high), known, offset, tare


def positive_or_none(name: str, value: float | None) -> float:
    """Check a number above 0, as the compiled constructors take it; 0 is None."""
    return 0.0 if value is None else number_in(name, value, 0.0, 1e30, open_low=True)


def surfaces_in(
    surface: str | None,
    surface_range: tuple[float, float] | None,
    usual: tuple[float, float],
    widest: float,
) -> tuple[float, float] | None:
    """Check where a surface is looked for, m; None: nowhere."""
    if not (surface is None or (isinstance(surface, str) and surface == "estimate")):
        raise InvalidParameterError(f"surface must be 'estimate' or None, not {shown(surface)}")
    if surface is None and surface_range is not None:
        raise InvalidParameterError(
            "surface_range is for surface='estimate'; without it the surface is at 0"
        )
    if surface_range is None:
        return None if surface is None else usual
    low, high = pair_in("surface_range", surface_range, -widest, widest)
    if not high > low:
        raise InvalidParameterError(
            f"surface_range must be (lowest, highest) in m, not {shown(surface_range)}: it holds "
            "nothing"
        )
    return low, high


# A contact whose material changes slowly.

_DRIFT_DEFAULTS = _core.defaults["DriftTracking"]


class DriftTracking(CompiledEstimator, _core.DriftTracking):
    """The Hunt–Crossley law of a material that drifts, by an extended Kalman filter.

    F = k ξⁿ (1 + b v) + F₀,  ξ = x/x_r;  d(ln k), db and dn are random walks.

    It starts itself from variable projection, with its answer, covariance and noise, once the
    exponent is known to 0.05; until then its answer is that of variable projection, and a flag says
    so. Started cold such a filter diverges in about one start of ten, so it cannot be. For a
    material that changes at once, use a :class:`ChangeDetector`.

    Parameters
    ----------
    stiffness_drift : float
        How far ln k walks in a second, 1/√s, ≥ 0. Too large and the walk takes all that makes the
        exponent identifiable; 0.02 follows ±30 % at 0.1 Hz to a few tenths of a percent.
    dissipation_drift : float
        The same of b = B/K, s/m per √s, ≥ 0.
    exponent_drift : float
        The same of n, 1/√s, ≥ 0; 0 where the exponent is known.
    noise, offset, offset_deviation, exponent_range, exponent
        As in :class:`VariableProjection`; but an offset is not estimated unless asked for, since
        beside a drifting stiffness few motions make it identifiable.
    change_detector, outlier_rejection, gate, sample_time, scale
        As in :class:`VariableProjection`.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.
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
                f"exponent_drift must be 0 where the exponent is known, not {exponent_drift!r}"
            )
        loop = loop_settings(self._settings, PROBING)
        super().__init__(projection_settings(self._settings), drift, loop)
