"""Channels by the clock that they are on, with times that increase."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.preparation.channels import unit_of
from palpate.preparation.roles import Roles
from palpate.preparation.rows import rows_of
from palpate.recordings import Recording
from palpate.recordings.units import size_of
from palpate.remarks import Remark
from palpate.validation import Floats

# s. Times since 1970 are counted from the first instead: floats of them have steps of 0.2 µs.
SINCE_LONG_AGO = 1e8
# s, three thousand years. Beyond it a millisecond is lost in the digits; a flipped bit leads there.
LATEST = 1e11


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Channels on one clock."""

    clock: str | None
    time: NDArray[np.int64] | Floats  # in its own unit
    unit: str
    values: dict[str, NDArray[np.generic]]


def streams_of(
    recording: Recording,
    roles: Roles,
    values: dict[str, NDArray[np.generic]],
    units: dict[str, str],
    rate: float | None,
) -> list[Stream]:
    """The channels that are used, by the clock that they are on."""
    by_clock: dict[str | None, dict[str, NDArray[np.generic]]] = {}
    for role, channel in values.items():
        names = {"depth": roles.depth, "force": roles.force, "orientation": roles.orientation}
        name = names.get(role, (str(getattr(roles, role, "")),))[0]
        clock = roles.time if roles.time is not None else recording.clocks.get(name)
        by_clock.setdefault(clock, {})[role] = channel
    return [_stream(recording, clock, own, units, rate) for clock, own in by_clock.items()]


def _stream(
    recording: Recording,
    clock: str | None,
    values: dict[str, NDArray[np.generic]],
    units: dict[str, str],
    rate: float | None,
) -> Stream:
    lengths = {role: len(channel) for role, channel in values.items()}
    size = next(iter(lengths.values()))
    where = f"{recording.source}: " if recording.source else ""
    if clock is None:
        if rate is None:
            raise RecordingError(
                f"{where}no channel looks like the time; name it with --time, or say --rate 1000 "
                "where the samples are evenly spaced"
            )
        return Stream(None, np.arange(size) / rate, "s", values)
    time = recording.channel(clock)
    dated = time.dtype.kind in "mM"  # of pandas, say: whole nanoseconds since 1970
    if dated:
        known = ~np.isnat(time)
        time = np.where(
            known, time.astype("M8[ns]" if time.dtype.kind == "M" else "m8[ns]").view(np.int64), 0
        )
        if not known.all():
            time = np.where(known, time.astype(np.float64), np.nan)
    elif time.dtype.kind not in "iu":
        time = recording.numbers(clock, strict=False)
    if any(length != len(time) for length in lengths.values()):
        listed = ", ".join(f"{role} has {length}" for role, length in lengths.items())
        raise RecordingError(
            f"{where}channels of one clock must have the same length: {clock!r} has {len(time)}, "
            f"{listed}; name the right clock with --time"
        )
    unit = "ns" if dated else units.get("time") or unit_of(recording, clock, "time")
    return Stream(clock, time, unit, values)


def running(
    recording: Recording, stream: Stream, what: str, remarks: list[Remark], *, strict: bool
) -> tuple[NDArray[np.int64] | Floats, dict[str, NDArray[np.generic]], NDArray[np.int64]]:
    """A stream's samples whose time increases, and the part that each is of."""
    largest = LATEST / size_of("time", stream.unit)
    rows = rows_of(stream.time, _labels(stream.values.get("segment")), largest=largest)
    if not rows.keep.any():
        where = f"{recording.source}: " if recording.source else ""
        reason = "no sample has a time" if len(stream.time) else "there are columns but no samples"
        raise RecordingError(f"{where}{reason}")
    if strict and (rows.skipped or rows.restarts):
        _refuse(recording, stream, rows.first_wrong)
    if rows.late > 0.5 * rows.keep.size:
        place = recording.place(stream.clock or "time", int(np.argmin(rows.keep)))
        raise RecordingError(f"{place}: the time runs backward; give the samples in their order")
    remarks += rows.remarks(what)
    if not rows.skipped:
        return stream.time, stream.values, rows.part
    taken = {role: channel[rows.keep] for role, channel in stream.values.items()}
    return stream.time[rows.keep], taken, rows.part[rows.keep]


def _labels(segment: NDArray[np.generic] | None) -> NDArray[np.int64] | None:
    """Numbers for the runs of equal labels; missing ones (NaN) are equal too."""
    if segment is None:
        return None
    missing = segment != segment
    other = (segment[1:] != segment[:-1]) & ~(missing[1:] & missing[:-1])
    return np.concatenate([np.zeros(min(segment.size, 1), dtype=np.int64), np.cumsum(other)])


def _refuse(recording: Recording, stream: Stream, sample: int) -> None:
    time, clock = stream.time, stream.clock or "time"
    if stream.clock is not None:
        recording.numbers(stream.clock, strict=True)  # a cell of text says it better
    what = "is not finite"
    if np.isfinite(time[sample]) and sample == 0:
        what = "is no time"
    elif np.isfinite(time[sample]):
        before = time[sample - 1]
        what = f"runs back from {before:g} {stream.unit}"
        if time[sample] >= before:
            same = time[sample] == before
            what = "repeats the time before it" if same else "is hardly later"
    raise RecordingError(
        f"{recording.place(clock, sample)}: {time[sample]:g} {stream.unit} {what}; time must "
        "increase within a segment"
    )


def origin_of(*streams: Stream) -> int | float:
    """What times are counted from: the first of all where they are whole, or since 1970; else 0."""
    firsts = [s.time[np.abs(s.time) * size_of("time", s.unit) <= LATEST] for s in streams]
    known = [first.min() for first in firsts if first.size]
    if not known:
        return 0
    whole = all(stream.time.dtype.kind in "iu" for stream in streams)
    smallest = min(known)
    far = abs(float(smallest)) * size_of("time", streams[0].unit) > SINCE_LONG_AGO
    return (int(smallest) if whole else float(smallest)) if far or whole else 0


def seconds_of(time: NDArray[np.int64] | Floats, unit: str, origin: int | float) -> Floats:
    """Times in seconds from an origin in their own unit, taken off before digits are lost."""
    return np.asarray((time - origin) * size_of("time", unit), dtype=np.float64)
