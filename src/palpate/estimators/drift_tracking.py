"""A contact whose material changes slowly."""

from typing import Any

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.estimators.contact_estimator import CompiledEstimator
from palpate.estimators.loop_settings import Rejection, loop_settings
from palpate.estimators.registry import register
from palpate.estimators.variable_projection import PROBING, projection_settings
from palpate.force_laws import HuntCrossley
from palpate.settings import SAMPLE_TIME, ChangeDetector, ContactGate, Scale
from palpate.validation import arguments, number_in

_DEFAULTS = _core.defaults["DriftTracking"]


@register
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
        stiffness_drift: float = _DEFAULTS["stiffness_drift"],
        dissipation_drift: float = _DEFAULTS["dissipation_drift"],
        exponent_drift: float = _DEFAULTS["exponent_drift"],
        noise: float | None = None,
        offset: bool = _DEFAULTS["offset"],
        offset_deviation: float | None = None,
        exponent_range: tuple[float, float] = _DEFAULTS["exponent_range"],
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
        super().__init__(
            *projection_settings(noise, exponent_range, exponent, offset, offset_deviation),
            drift,
            *loop_settings(
                change_detector,
                outlier_rejection,
                gate,
                scale,
                sample_time,
                default_scale=PROBING,
            ),
        )
