"""The channels of a contact as signals: in SI units, on one clock."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Finding
from palpate.input.channels.clocks import (
    Times,
    gaps,
    report_gaps,
    report_rate_of_motion,
    report_rows,
    report_stated_rate,
    report_unmatched,
    select_increasing_rows,
    settle_stamps,
)
from palpate.input.channels.frames import interpolate_columns, lie_between_samples
from palpate.input.channels.roles import Roles
from palpate.input.channels.si_numbers import ChannelReader
from palpate.input.recordings import Recording
from palpate.input.recordings.times import is_timelike
from palpate.input.recordings.units import unit_size
from palpate.method.contact import number_runs
from palpate.method.rows import count_true, typical_step
from palpate.validation import Floats, Integers, Mask, frozen, shown

Channels: TypeAlias = dict[str, NDArray[np.generic]]

# s. Later times, as since 1970, are made relative to the first: their floats have steps of 0.2 µs.
SINCE_LONG_AGO = 1e8
# s, three thousand years. A larger float cannot resolve a millisecond, and comes from a bit error.
LATEST = 1e11
# Largest part of the motion that the velocity at an inferred rate may leave unexplained.
MOST_MISFIT = 0.1


@frozen(eq=False)
class Signals:
    """The channels of a contact, in SI units on one clock.

    Attributes
    ----------
    time : numpy.ndarray, shape (k,)
        s, strictly increasing within a part.
    depth : numpy.ndarray, shape (k,) or (k, 3)
        Penetration or position, m.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.
    part : numpy.ndarray of int, shape (k,)
        A number that increases at each gap, restart and change of the segment.
    velocity : numpy.ndarray, shape (k,), optional
        m/s.
    orientation : numpy.ndarray, shape (k, 4), optional
        Quaternion x, y, z, w.
    segment : numpy.ndarray, shape (k,), optional
        Label in the column of segments.
    fresh : numpy.ndarray of bool, shape (k,), optional
        Samples to keep once the velocity is computed. None: all.
    clocks : mapping
        For a probe with an orientation, the times and the values of each role on its own clock.
    made : mapping
        How each channel was obtained, as text.
    findings : tuple of Finding
        Reports of skipped samples and of assumptions.
    stated_units, assumed_units : frozenset of str
        As in :class:`~palpate.Contact`.
    """

    time: Floats
    depth: Floats
    force: Floats
    part: Integers
    velocity: Floats | None = None
    orientation: Floats | None = None
    segment: NDArray[np.generic] | None = None
    fresh: Mask | None = None
    clocks: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)
    made: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    stated_units: frozenset[str] = frozenset()
    assumed_units: frozenset[str] = frozenset()

    def taken(self, keep: Mask | Integers) -> "Signals":
        """Return the selected samples."""
        names = "time", "depth", "force", "part", "velocity", "orientation", "segment", "fresh"
        arrays = {name: getattr(self, name) for name in names}
        return replace(self, **{k: array[keep] for k, array in arrays.items() if array is not None})


# Channels with the times of their clock.


@frozen(eq=False)
class Stream:
    """Channels on one clock, with times in the unit of the clock."""

    clock: str | None
    time: Times
    unit: str
    values: Channels

    def seconds(self, origin: int | float) -> Floats:
        """Times in seconds from an origin, subtracted before conversion to keep the digits."""
        return np.asarray((self.time - origin) * unit_size("time", self.unit), dtype=np.float64)

    def taken(self, keep: Mask) -> "Stream":
        """Return the selected samples."""
        values = {role: channel[keep] for role, channel in self.values.items()}
        return replace(self, time=self.time[keep], values=values)


def stream_of(
    recording: Recording,
    clock: str | None,
    names: Sequence[str],
    units: Mapping[str, str],
    rate: float | None = None,
) -> Stream:
    """Return channels with the times of their clock, as recorded.

    Raises
    ------
    RecordingError
        There is neither a clock nor a rate, or the channels have another length than their clock.
    """
    values: Channels = {name: recording.numbers(name) for name in names}
    return read_stream(ChannelReader(recording, units), clock, values, rate)


def read_stream(
    reader: ChannelReader, clock: str | None, values: Channels, rate: float | None
) -> Stream:
    """Return channels with the times of a clock; without a clock, at a rate."""
    recording = reader.recording
    lengths = {role: len(channel) for role, channel in values.items()}
    if clock is None:
        reader.stated.add("time")  # as a rate in Hz
        stated = recording.settings.get("rate")
        if not rate and stated is not None:
            reader.findings.append(report_stated_rate(stated))
        rate = rate or stated
        if rate is None and (rate := _find_rate_of_motion(values)) is not None:
            reader.findings.append(report_rate_of_motion(rate))
        if rate is None:
            raise RecordingError.of(
                recording.source,
                f"no channel looks like the time{_describe_unread_times(recording)}; name it with "
                "--time, or pass --rate if the samples are evenly spaced and you know the rate; "
                "--no-time gives the stiffness alone",
            )
        remedy = "choose others with --position and --force, or name their clocks with --time"
        reader.check_lengths("channels at one rate", lengths, remedy)
        return Stream(None, np.arange(next(iter(lengths.values()))) / rate, "s", values)
    time = recording.channel(clock)
    dated = time.dtype.kind in "mM"  # for example from pandas: nanoseconds since 1970
    if dated:
        unknown = np.isnat(time)
        time = time.astype("M8[ns]" if time.dtype.kind == "M" else "m8[ns]").view(np.int64)
        time = np.where(unknown, np.nan, time.astype(np.float64)) if unknown.any() else time
    elif time.dtype.kind not in "iu":
        time = recording.numbers(clock, strict=False)
    remedy = "name the right clock with --time"
    reader.check_lengths("channels on one clock", {clock: len(time), **lengths}, remedy)
    if dated:
        reader.stated.add("time")
    unit = "ns" if dated else reader.unit_of_time(clock)
    return Stream(clock, time, unit, values)


def _describe_unread_times(recording: Recording) -> str:
    """Clause on the first channel with the name of a time that holds text; empty without one."""
    for name, values in recording.channels.items():
        if is_timelike(name) and values.dtype.kind in "OUS" and values.size:
            cell = shown(str(values[0]), 40)
            return f": {name!r} holds {cell}, neither a number nor a date such as 2026-01-31T14:03"
    return ""


def _find_rate_of_motion(values: Channels) -> float | None:
    """Return the rate, Hz, at which the depth follows its velocity; None if no rate fits."""
    depth = np.asarray(values.get("depth", 0.0), dtype=np.float64)
    velocity = np.asarray(values.get("velocity", 0.0), dtype=np.float64)
    if not depth.ndim == velocity.ndim == 1:
        return None
    motion = np.array([np.diff(depth), 0.5 * (velocity[1:] + velocity[:-1])])
    steps, means = motion[:, np.isfinite(motion).all(axis=0)]
    with np.errstate(all="ignore"):
        period = float(steps @ means / (means @ means))
        misfit = np.linalg.norm(steps - period * means) / np.linalg.norm(steps)
    return 1.0 / period if period > 0.0 and misfit < MOST_MISFIT else None


class Increasing(NamedTuple):
    """The samples of a stream whose time increases, and their part numbers."""

    stream: Stream
    part: Integers


def select_increasing(reader: ChannelReader, stream: Stream, what: str) -> Increasing:
    """Select the samples of a stream whose time increases, and report the others.

    Raises
    ------
    RecordingError
        No sample has a valid time, or time runs backward; or some are skipped and that is strict.
    """
    if not reader.strict:
        settled = settle_stamps(stream.time, [*stream.values.values()], stream.unit)
        reader.findings += settled.findings
        stream = replace(stream, time=settled.time).taken(settled.keep)
    label = stream.values.get("segment")
    numbers = None if label is None else number_runs(label, label.size)
    largest = LATEST / unit_size("time", stream.unit)
    rows = select_increasing_rows(stream.time, numbers, largest=largest)
    if not rows.keep.any():
        empty = not len(stream.time)
        reason = "the recording has no samples" if empty else "no sample has a valid time"
        raise RecordingError.of(reader.recording.source, reason)
    if reader.strict and (rows.skipped or rows.restarts):
        raise _wrong_time(reader.recording, stream, rows.first_wrong)
    if rows.late > 0.5 * rows.keep.size:
        problem = "the time runs backward; sort the samples by time"
        first = int(np.argmin(rows.keep))
        raise reader.recording.error(stream.clock or "time", problem, first)
    reader.findings += report_rows(rows, what)
    if not rows.skipped:
        return Increasing(stream, rows.part)
    return Increasing(stream.taken(rows.keep), rows.part[rows.keep])


def _wrong_time(recording: Recording, stream: Stream, sample: int) -> RecordingError:
    """The error for a sample whose time does not increase."""
    if stream.clock is not None:
        recording.numbers(stream.clock, strict=True)  # a clearer error for text
    time = stream.time[sample]
    previous = stream.time[max(sample - 1, 0)]
    if not np.isfinite(time):
        what = "is not finite"
    elif sample == 0:
        what = "is not a valid time"
    elif time < previous:
        what = f"runs back from {previous:g} {stream.unit}"
    else:
        what = "repeats the previous time" if time == previous else "is hardly later"
    return recording.error(
        stream.clock or "time",
        f"{time:g} {stream.unit} {what}, but time must increase within a segment; drop --strict to "
        "skip such samples",
        sample,
    )


def origin_of(*streams: Stream) -> int | float:
    """The origin of time: the first time if it is an integer or since 1970, else 0."""
    valid = [s.time[np.abs(s.time) * unit_size("time", s.unit) <= LATEST] for s in streams]
    firsts = [times.min() for times in valid if times.size]
    if not firsts:
        return 0
    first = min(firsts)
    if all(stream.time.dtype.kind in "iu" for stream in streams):
        return int(first)
    seconds = abs(float(first)) * unit_size("time", streams[0].unit)
    return float(first) if seconds > SINCE_LONG_AGO else 0


# The channels of all roles on one clock.


def build_signals(
    recording: Recording,
    roles: Roles,
    units: Mapping[str, str] | None = None,
    *,
    rate: float | None = None,
    strict: bool = False,
    no_time: bool = False,
) -> Signals:
    """Convert the channels of a contact to SI units on one clock.

    If position and force have different clocks, the faster one is interpolated linearly at the
    times of the slower one, but not across gaps.

    Parameters
    ----------
    recording : Recording
        The recording.
    roles : Roles
        The channels to use.
    units : mapping, optional
        Units of ``time``, ``penetration``, ``force`` and ``velocity``. Default: from the recording,
        else from the names of the channels, else SI.
    rate : float, optional
        Sample rate, Hz, of a recording without time.
    strict : bool
        Fail on values that are not numbers and on times that do not increase.
    no_time : bool
        Ignore time and velocity, if there are any, and use the rate.

    Raises
    ------
    RecordingError
        There is no time or it runs backward, a channel holds no numbers, or the clocks of position
        and force do not overlap.
    """
    if no_time:
        roles = replace(roles, time=None, velocity=None)
        recording = replace(recording, clocks={})
    reader = ChannelReader(recording, units or {}, strict)
    by_clock: dict[str | None, Channels] = {}
    for role, channel in reader.read_roles(roles).items():
        clock = roles.time or recording.clocks.get(roles.by_role[role][0])
        by_clock.setdefault(clock, {})[role] = channel
    streams = [read_stream(reader, clock, values, rate) for clock, values in by_clock.items()]
    if len(streams) > 1:
        return _interpolate_streams(reader, streams)
    stream, part = select_increasing(reader, streams[0], "samples")
    timed = Timed(stream.seconds(origin_of(streams[0])), stream.values, stream.clock)
    return _make_signals(reader, timed, part, [timed])


class Timed(NamedTuple):
    """Channels and their times, s, on a clock."""

    time: Floats
    values: Channels
    clock: str | None

    @property
    def step(self) -> float:
        """The median time between samples, s."""
        return typical_step(self.time)


def _interpolate_streams(reader: ChannelReader, streams: list[Stream]) -> Signals:
    """The samples of the slowest clock, with the others interpolated at its times."""
    source = reader.recording.source
    units = {stream.unit for stream in streams}
    if len(units) > 1:
        message = f"the clocks are in {', '.join(sorted(units))}; pass one unit, such as --unit"
        raise RecordingError(f"{source}: {message} time=s")
    origin = origin_of(*streams)
    recorded = [_without_restart(reader, stream, origin) for stream in streams]
    # An orientation changes slowly: its clock never sets the rate.
    slowest_first = sorted(recorded, key=lambda timed: timed.step, reverse=True)
    slowest = next(timed for timed in slowest_first if timed.values.keys() & {"depth", "force"})
    others = [timed for timed in slowest_first if timed is not slowest]
    values = dict(slowest.values)
    keep = np.ones(slowest.time.size, dtype=bool)
    for timed in others:
        keep &= lie_between_samples(slowest.time, timed.time)
        for role, channel in timed.values.items():
            values[role] = _interpolate(slowest.time, timed.time, np.asarray(channel))
            kind = "penetration" if role == "depth" else role
            if kind in reader.made:
                clocks = f"{timed.clock!r} at the times of {slowest.clock!r}"
                reader.made[kind] += f", interpolated from {clocks}"
    if not keep.any():
        message = f"the clocks {slowest.clock!r} and {others[0].clock!r} do not overlap"
        raise RecordingError(f"{source}: {message}; list them with palpate info {source or 'FILE'}")
    if not keep.all():
        reader.findings.append(report_unmatched(keep, slowest.clock))
    values = {role: channel[keep] for role, channel in values.items()}
    part = np.zeros(count_true(keep), dtype=np.int64)
    at_slowest = Timed(slowest.time[keep], values, slowest.clock)
    return _make_signals(reader, at_slowest, part, recorded)


def _without_restart(reader: ChannelReader, stream: Stream, origin: int | float) -> Timed:
    """The samples of a stream whose time increases; refuse a restart of its recorder."""
    increasing, part = select_increasing(reader, stream, f"samples of {stream.clock}")
    if part.size and part.max() > 0:
        problem = "the recorder restarted, so palpate cannot match the clocks; record again, or "
        raise reader.recording.error(stream.clock or "time", f"{problem}cut the file there")
    return Timed(increasing.seconds(origin), increasing.values, stream.clock)


def _interpolate(at: Floats, time: Floats, values: NDArray[np.generic]) -> NDArray[np.generic]:
    if values.dtype.kind not in "fiu":
        raise InvalidParameterError("segment must be on the clock of the position or the force")
    numbers = values.astype(np.float64)
    if numbers.ndim == 1:
        return np.interp(at, time, numbers)
    return interpolate_columns(at, time, numbers)


def _make_signals(
    reader: ChannelReader, timed: Timed, part: Integers, recorded: Sequence[Timed]
) -> Signals:
    """Make signals from values on one clock; separate them at gaps and report these."""
    breaks = gaps(timed.time, part)
    if breaks.any():
        reader.findings.append(report_gaps(np.diff(timed.time)[breaks[1:]]))
    values: dict[str, Any] = {k: array for k, array in timed.values.items() if k != "torque"}
    clocks: dict[str, tuple[Floats, Floats]] = {}
    if "orientation" in values:
        for stream in recorded:
            for role in ("depth", "orientation", "force", "torque"):
                if role in stream.values:
                    clocks[role] = stream.time, np.asarray(stream.values[role], float)
    return Signals(
        timed.time,
        part=part + np.cumsum(breaks),
        clocks=clocks,
        made=reader.made,
        findings=tuple(reader.findings),
        stated_units=frozenset(reader.stated),
        assumed_units=frozenset(reader.assumed),
        **values,
    )
