"""Times by their names, their units and their size."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.times import epoch_unit as unit_since_1970

# Names of times, the surest first, each with or without its unit: time, time_s, Time (ms).
_NAMES = ("time", "times", "timestamps?", "stamps?", "t", "ts", "tout", "clock")
_UNIT = (
    r"([ _]?[(\[]?(?P<unit>s|ms|us|µs|ns|secs?|seconds?|msecs?|usecs?|nsecs?)[)\]]?"
    r"|[ _](stamps?|header|epoch))?"
)
_PATTERNS = [re.compile(name + _UNIT + "$", re.IGNORECASE) for name in _NAMES]

#: Seconds in each unit that times come in.
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

_SHORT = {
    **{unit: unit for unit in SECONDS},
    **{f"{prefix}sec{s}": f"{prefix}s" for prefix in ("", "m", "u", "n") for s in ("", "s")},
    "second": "s",
    "seconds": "s",
}


def clock_rank(name: str) -> int | None:
    """Return how surely a name is that of times, 0 the most; None where it is none.

    Of one with groups or fields, such as ``robot/time`` or ``/ft.header.stamp``, the last counts.
    """
    own = _own(name)
    return next((i for i, form in enumerate(_PATTERNS) if form.match(own)), None)


def clock_unit(name: str) -> str | None:
    """Return the unit in the name of times: ``"ms"`` of ``time_ms``."""
    own = _own(name)
    found = next((match for form in _PATTERNS if (match := form.match(own))), None)
    return _SHORT.get(found["unit"].lower()) if found and found["unit"] else None


def epoch_unit(values: NDArray[Any]) -> str | None:
    """Return the unit of times since 1970, by the first; seconds are SI and need no word."""
    known = values[np.isfinite(values)]
    unit = unit_since_1970(float(known[0])) if known.size else None
    return None if unit == "s" else unit


def _own(name: str) -> str:
    return re.split(r"[/.]", name)[-1].strip()
