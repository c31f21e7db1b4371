"""What every compiled estimator's loop is set by, as the compiled constructors take it."""

from typing import Any, Literal

from palpate.errors import InvalidParameterError
from palpate.settings import ChangeDetector, ContactGate, OutlierRejection, Scale
from palpate.validation import instance, number_in, shown

#: None is off, but in ``identify`` on; False is off there too.
Rejection = OutlierRejection | Literal[False] | None


def loop_settings(
    change_detector: ChangeDetector | None,
    outlier_rejection: Rejection,
    gate: ContactGate | None,
    scale: Scale | None,
    sample_time: float,
    default_scale: Scale,
) -> tuple[Any, ...]:
    """Check them; an absent detector or rejection costs no memory and no time."""
    instance("change_detector", change_detector, (ChangeDetector, type(None)))
    absent = outlier_rejection is None or outlier_rejection is False
    if not absent and not isinstance(outlier_rejection, OutlierRejection):
        raise InvalidParameterError(
            "outlier_rejection must be an OutlierRejection, None or False, not "
            f"{shown(outlier_rejection)}"
        )
    instance("gate", gate, (ContactGate, type(None)))
    instance("scale", scale, (Scale, type(None)))
    return (
        None if change_detector is None else change_detector._plain(),
        outlier_rejection._plain() if outlier_rejection else None,
        (gate or ContactGate())._plain(),
        (scale or default_scale)._plain(),
        number_in("sample_time", sample_time, 0.0, 1e6, open_low=True),
    )


def known_exponent(exponent: float | None) -> float | None:
    """Check an exponent that is not to be identified; None where it is."""
    return None if exponent is None else number_in("exponent", exponent, 0.1, 10.0)
