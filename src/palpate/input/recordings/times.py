"""Times in tables: calendar dates, and integers since 1970."""

import re
from collections.abc import Mapping
from datetime import UTC, datetime

import numpy as np

from palpate.validation import Integers, Values

_ISO = re.compile(
    r"(\d{4}[-/]\d\d[-/]\d\d)[T /_](\d\d:\d\d)(?::(\d\d)(?:[.,](\d{1,9})\d*)?)?"
    r"\s*(?:(Z|UTC)|([+-])(\d\d):?(\d\d)?)?",
    re.ASCII,
)
# A time of day, ``14:03:27.250`` or ``2:03:27 PM``; or minutes and seconds, ``03:27.250``. A date
# of another order before it, ``9/5/2023``, does not matter.
_OF_DAY = re.compile(
    r"(?:\d{1,2}[./-]\d{1,2}[./-]\d{2,4},?[ T]+)?"
    r"(?:(\d{1,2}):)?(\d{1,2}):(\d\d)(?:[.,:](\d{1,9}))?(?:\s*([AaPp])\.?[Mm]\.?)?",
    re.ASCII,
)
DAY = 86_400 * 10**9  # ns
_TIMELIKE = re.compile(r"(?:^|[^a-z])(?:time|timestamp|stamp|t|epoch|datetime|clock)(?:[^a-z]|$)")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")
_WHOLE = re.compile(r"\s*\d{17,19}\s*", re.ASCII)  # a float cannot represent it exactly
_SINCE = datetime(1970, 1, 1, tzinfo=UTC)
# From 1990 to 2100 in seconds; no other unit has numbers in that range.
EARLIEST = 631_152_000
LATEST = 4_102_444_800
EPOCHS = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
_PAIRS = {"secs": "nsecs", "sec": "nsec", "seconds": "nanoseconds"}
_LAST = re.compile(r"(.*?)([./_]?)(secs|sec|seconds)$")


def iso_nanoseconds(cell: str) -> int | None:
    """Return the nanoseconds since 1970 of a date with a time; None if the cell is not one.

    A time without an offset counts as UTC, and a time of day as the first of 1970: only differences
    matter.
    """
    date = _ISO.fullmatch(cell.strip())
    if date is None:
        return _since_midnight(cell)
    day, minute, second, fraction, _, sign, hours, minutes = date.groups()
    offset = f"{sign}{hours}:{minutes or '00'}" if sign else "+00:00"
    try:
        moment = f"{day.replace('/', '-')}T{minute}:{second or '00'}{offset}"
        past = datetime.fromisoformat(moment) - _SINCE
    except ValueError:
        return None
    value = (past.days * 86_400 + past.seconds) * 10**9 + int((fraction or "").ljust(9, "0"))
    return value if abs(value) < 2**63 else None


def _since_midnight(cell: str) -> int | None:
    clock = _OF_DAY.fullmatch(cell.strip())
    if clock is None or not (clock[1] or clock[4]):
        return None
    hour, minute, second = (int(digits or 0) for digits in clock.group(1, 2, 3))
    if minute > 59 or second > 59:
        return None
    if clock[5]:
        hour = hour % 12 + 12 * (clock[5] in "Pp")
    return (3600 * hour + 60 * minute + second) * 10**9 + int((clock[4] or "").ljust(9, "0"))


def past_midnight(times: Integers) -> Integers:
    """Times of day, with a day more after each midnight; other times are unchanged."""
    if not times.size or times.max() >= DAY or times.min() < 0:
        return times
    return times + DAY * np.cumsum(np.diff(times, prepend=times[0]) < -DAY // 2)


def is_timelike(name: str) -> bool:
    """Whether the name of a column suggests times: ``time_s``, ``rosbagTimestamp``."""
    return _TIMELIKE.search(_HUMP.sub("_", name).lower()) is not None


def whole_time(cell: str) -> int | None:
    """Return an integer of up to 64 bits; None if the cell is not one."""
    try:
        value = int(cell) if "_" not in cell and len(cell) < 40 else None
    except ValueError:
        return None
    return value if value is not None and abs(value) < 2**63 else None


def is_nanoseconds(cell: str) -> bool:
    """Whether a cell is a time in nanoseconds since 1970, which needs 64 bits."""
    return _WHOLE.fullmatch(cell) is not None and epoch_unit(int(cell)) == "ns"


def epoch_unit(value: float) -> str | None:
    """Return the unit of a time since 1970 from its magnitude; None if it is not one."""
    fitting = (u for u, size in EPOCHS.items() if EARLIEST * size <= value <= LATEST * size)
    return next(fitting, None)


def detect_epoch(values: Values) -> tuple[str, Values] | None:
    """Return the unit of times since 1970, and the times, as integers if all are whole.

    None if they are not such times.
    """
    if values.dtype.kind not in "fi" or not np.isfinite(values).any():
        return None
    unit = epoch_unit(float(np.nanmin(values)))
    if unit is None or epoch_unit(float(np.nanmax(values))) != unit:
        return None
    return unit, values.astype(np.int64) if (values % 1 == 0).all() else values


def join_stamps(channels: Mapping[str, Values]) -> dict[str, Integers]:
    """Join pairs of columns with seconds and nanoseconds, as ROS names them.

    ``header.stamp.secs`` and ``header.stamp.nsecs`` give ``header.stamp``, in integer nanoseconds.
    """
    stamps: dict[str, Integers] = {}
    for name, seconds in channels.items():
        if not (match := _LAST.fullmatch(name)):
            continue
        begin, separator, last = match.groups()
        stamp = begin or "stamp"
        for end in (_PAIRS[last], "nanosec", "nanosecs"):
            nanoseconds = channels.get(f"{begin}{separator}{end}")
            if nanoseconds is None or stamp in channels:
                continue
            if _are_whole_below(seconds, LATEST) and _are_whole_below(nanoseconds, 10**9):
                stamps[stamp] = seconds.astype(np.int64) * 10**9 + nanoseconds.astype(np.int64)
    return stamps


def _are_whole_below(values: Values, limit: float) -> bool:
    if values.dtype.kind not in "fi" or not values.size:
        return False
    with np.errstate(invalid="ignore"):
        return bool(((values >= 0) & (values < limit) & (values % 1 == 0)).all())


# Recognising times by name, unit and size.

# Names of times, most certain first, with or without a unit: time, time_s, Time (ms).
_NAMES = ("time", "times", "timestamps?", "stamps?", "t", "ts", "tout", "clock")
_UNIT = (
    r"([ _]?[(\[]?(?P<unit>s|ms|us|µs|ns|secs?|seconds?|msecs?|usecs?|nsecs?)[)\]]?"
    r"|[ _](stamps?|header|epoch))?"
)
_PATTERNS = [re.compile(name + _UNIT + "$", re.IGNORECASE) for name in _NAMES]

#: Seconds in each unit of time.
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

_SHORT = {
    **{unit: unit for unit in SECONDS},
    **{f"{prefix}sec{s}": f"{prefix}s" for prefix in ("", "m", "u", "n") for s in ("", "s")},
    "second": "s",
    "seconds": "s",
}


def clock_rank(name: str) -> int | None:
    """Return the rank of a name as the name of a clock, 0 the most likely; None for other names.

    The last part of a name with groups or fields counts: ``robot/time``, ``/ft.header.stamp``.
    """
    return next((rank for rank, match in enumerate(_matches(name)) if match), None)


def clock_unit(name: str) -> str | None:
    """Return the unit in the name of a clock: ``"ms"`` of ``time_ms``."""
    match = next(filter(None, _matches(name)), None)
    return _SHORT.get(match["unit"].lower()) if match and match["unit"] else None


def detect_epoch_unit(values: Values) -> str | None:
    """Return the unit of times since 1970 from the first one; None for seconds and other times."""
    finite = values[np.isfinite(values)]
    unit = epoch_unit(float(finite[0])) if finite.size else None
    return None if unit == "s" else unit


def _matches(name: str) -> list[re.Match[str] | None]:
    last = re.split(r"[/.]", name)[-1].strip(" _")  # PlotJuggler writes __time
    return [pattern.match(last) for pattern in _PATTERNS]
