"""Checks of the recording itself; each looks at the data once, whatever law is fitted.

To add one: a module here with a function of a :class:`Data`, and its row in ``CHECKS``.
"""

from collections.abc import Callable

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.diagnosis.inputs.coarse import coarse
from palpate.diagnosis.inputs.held import held
from palpate.diagnosis.inputs.preparation import preparation
from palpate.diagnosis.inputs.signs import signs
from palpate.diagnosis.inputs.spikes import spikes
from palpate.diagnosis.inputs.stamps import stamps
from palpate.diagnosis.inputs.units import force_unit, penetration_unit, time_unit
from palpate.diagnosis.inputs.velocity_column import velocity_column

#: Every check of the data, by its name.
CHECKS: dict[str, Callable[[Data], Finding | None]] = {
    "penetration unit": penetration_unit,
    "force unit": force_unit,
    "time unit": time_unit,
    "signs": signs,
    "velocity column": velocity_column,
    "time stamps": stamps,
    "held channel": held,
    "spikes": spikes,
    "coarse steps": coarse,
}

FEWEST = 20  # samples, below which a recording is only short


def input_findings(data: Data) -> list[Finding]:
    """Run every check of the data, beside what its preparation said."""
    said = preparation(data)
    if len(data) < FEWEST:
        return said
    found = (check(data) for check in CHECKS.values())
    return [*(finding for finding in found if finding is not None), *said]


__all__ = ["CHECKS", "input_findings"]
