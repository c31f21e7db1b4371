"""What every compiled estimator's loop is set by, as the compiled constructors take it."""

from typing import Any

from palpate.settings import ChangeDetector, ContactGate, Scale
from palpate.validation import instance, number_in


def loop_settings(
    change_detector: ChangeDetector | None,
    gate: ContactGate | None,
    scale: Scale | None,
    sample_time: float,
    default_scale: Scale,
) -> tuple[Any, ...]:
    """Check them; an absent detector costs no memory and no time."""
    instance("change_detector", change_detector, (ChangeDetector, type(None)))
    instance("gate", gate, (ContactGate, type(None)))
    instance("scale", scale, (Scale, type(None)))
    return (
        None if change_detector is None else change_detector._plain(),
        (gate or ContactGate())._plain(),
        (scale or default_scale)._plain(),
        number_in("sample_time", sample_time, 0.0, 1e6, open_low=True),
    )
