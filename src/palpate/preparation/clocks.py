"""Channels on one clock, in SI: whose time runs forward, what is skipped, and where it breaks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.contact import SHORTEST_STEP, numbered, slices_of
from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Finding
from palpate.preparation.roles import Roles
from palpate.recordings import Recording
from palpate.recordings.recording import GRAVITY, UNITS, WEIGHTS, plain_unit, size_of, stated_unit
from palpate.validation import Floats

# A recorder that was started again begins at an earlier time, and goes on from there; a late
# message is followed by one that is later than all before it.
RESTART = 10  # samples in a row
GAP = 10.0  # median steps
MOST_SKIPPED = 0.02  # of the samples; more calls for care
MOST_BACKWARD = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Which samples are taken, by their time.

    Attributes
    ----------
    keep : numpy.ndarray of bool, shape (k,)
        Those with a time that is later than all before it since the last start.
    part : numpy.ndarray of int, shape (k,)
        A number that grows where the label changes, or the recording starts again.
    restarts : int
        How often it starts again.
    first_wrong : int
        The first sample that is not taken, or with which it starts again; −1 where there is none.
    untimed, repeated, late : int
        How many have no time, the time of the one before, or an earlier one.
    """

    keep: NDArray[np.bool_]
    part: NDArray[np.int64]
    restarts: int
    first_wrong: int
    untimed: int
    repeated: int
    late: int

    @property
    def skipped(self) -> int:
        """How many are not taken."""
        return self.untimed + self.repeated + self.late


def rows_of(
    time: NDArray[np.int64] | Floats,
    label: NDArray[np.int64] | None = None,
    *,
    largest: float = math.inf,
) -> Rows:
    """Say which samples have a time that increases.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        In any unit; whole numbers stay exact.
    label : numpy.ndarray of int, shape (k,), optional
        Changes where a separate contact begins: time may then be anything.
    largest : float
        What is beyond is no time, in the same unit.
    """
    timed = np.isfinite(time) & (np.abs(time) <= largest)
    t, given = time[timed], np.zeros(time.size, np.int64) if label is None else label
    own = given[timed]
    keep, part = np.ones(t.size, dtype=bool), np.zeros(t.size, dtype=np.int64)
    repeated, number = 0, 0
    again: list[int] = []
    for start, stop in ((run.start, run.stop) for run in slices_of(own)):
        starts = _starts(t[start:stop])
        again += [start + each for each in starts]
        for low, high in pairwise([0, *starts, stop - start]):
            inside = t[start + low : start + high]
            before = np.maximum.accumulate(inside)[:-1]
            with np.errstate(over="ignore"):  # of absurd times
                later = (inside[1:] > before) & (inside[1:] - before >= SHORTEST_STEP)
            keep[start + low + 1 : start + high] = later
            repeated += int(np.count_nonzero(~later & (inside[1:] >= before)))
            part[start + low : start + high] = number
            number += 1
    late = int(np.count_nonzero(~keep)) - repeated
    taken, parts = np.zeros(time.size, dtype=bool), np.zeros(time.size, dtype=np.int64)
    taken[timed], parts[timed] = keep, part
    wrong = [*np.flatnonzero(timed)[again[:1]].tolist(), *np.flatnonzero(~taken)[:1].tolist()]
    untimed = int(np.count_nonzero(~timed))
    return Rows(taken, parts, len(again), min(wrong, default=-1), untimed, repeated, max(late, 0))


def _starts(t: NDArray[np.int64] | Floats) -> list[int]:
    """Where time falls and goes on from there: the recorder was started again."""
    falls = np.flatnonzero(t[1:] < t[:-1]) + 1 if t.size else np.empty(0, dtype=np.int64)
    if falls.size > MOST_BACKWARD * t.size:  # it does not start again, it runs backward
        return []
    found: list[int] = []
    last = 0
    for k in falls.tolist():
        after = t[k : k + RESTART]
        on = after.size == RESTART and bool((np.diff(after) > 0).all())
        if on and after[-1] < t[last:k].max():
            found.append(k)
            last = k
    return found


def gaps(time: Floats, part: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Say of each sample whether a gap lies before it.

    Longer than ten steps, by the median of the five before it and of the five after it, whichever
    is larger: where the rate changes there is no gap.
    """
    steps = np.diff(time)
    inside = part[1:] == part[:-1]
    found = np.zeros(time.size, dtype=bool)
    if not inside.any():
        return found
    far = np.flatnonzero(inside & (steps > GAP * float(np.median(steps[inside]))))
    for k in far.tolist():
        around = [steps[max(k - 5, 0) : k], steps[k + 1 : k + 6]]
        usual = max((float(np.median(each)) for each in around if each.size), default=0.0)
        found[k + 1] = steps[k] > GAP * usual > 0.0
    return found


# The channels that are used, as numbers in SI and on one clock.

#: In SI, beyond which a value is no measurement; units of the arithmetic end there too. Sums of
#: eighth powers are finite below it: of an infinity LAPACK prints words on standard output.
LARGEST = 1e30
# s. Times since 1970 are counted from the first instead: floats of them have steps of 0.2 µs.
SINCE_LONG_AGO = 1e8
# s, three thousand years. Beyond it a millisecond is lost in the digits; a flipped bit leads there.
LATEST = 1e11

Channels: TypeAlias = dict[str, NDArray[np.generic]]
Times: TypeAlias = NDArray[np.int64] | Floats


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """What a contact is made of, on one clock and in SI.

    Attributes
    ----------
    time : numpy.ndarray, shape (k,)
        s, increasing within a part.
    depth : numpy.ndarray, shape (k,) or (k, 3)
        Penetration or position, m.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.
    part : numpy.ndarray of int, shape (k,)
        A number that changes where the recording has a gap, or starts again.
    velocity : numpy.ndarray, shape (k,), optional
        m/s.
    orientation : numpy.ndarray, shape (k, 4), optional
        Quaternion x, y, z, w.
    segment : numpy.ndarray, shape (k,), optional
        The label of the column.
    made : mapping
        How each channel was made, in words.
    findings : tuple of Finding
        What was skipped, or assumed.
    """

    time: Floats
    depth: Floats
    force: Floats
    part: NDArray[np.int64]
    velocity: Floats | None = None
    orientation: Floats | None = None
    segment: NDArray[np.generic] | None = None
    made: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def taken(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> "Signals":
        """Return some of the samples."""
        cut = {
            name: getattr(self, name)[keep]
            for name in ("time", "depth", "force", "part", "velocity", "orientation", "segment")
            if getattr(self, name) is not None
        }
        return replace(self, **cut)


def signals_of(
    recording: Recording,
    roles: Roles,
    units: Mapping[str, str] | None = None,
    *,
    rate: float | None = None,
    strict: bool = False,
) -> Signals:
    """Bring the channels that are used to one clock, and to SI.

    Where position and force have clocks of their own, the faster one is interpolated, by straight
    lines, at the times of the slower one; not over a gap.

    Parameters
    ----------
    recording : Recording
        What was recorded.
    roles : Roles
        Which channels are used.
    units : mapping, optional
        The units of ``time``, ``penetration``, ``force`` and ``velocity``, where they are given;
        else they are those that the recording says, or the names of the channels, or SI.
    rate : float, optional
        Samples a second, where the recording has no time.
    strict : bool
        Refuse what is not a number, and time that does not increase.

    Raises
    ------
    RecordingError
        There is no time, or it runs backward; a channel holds no numbers; or the clocks of position
        and force have no time in common.
    """
    return _Taking(recording, units or {}, strict).signals(roles, rate)


def measurable(values: Floats) -> Floats:
    """Values of which those beyond what anyone can measure are NaN."""
    beyond = np.abs(values) > LARGEST
    return np.where(beyond, np.nan, values) if beyond.any() else values


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Channels on one clock, whose times are in its own unit."""

    clock: str | None
    time: Times
    unit: str
    values: Channels

    def seconds(self, time: Times, origin: int | float) -> Floats:
        """Times in seconds from an origin in their own unit, taken off before digits are lost."""
        return np.asarray((time - origin) * size_of("time", self.unit), dtype=np.float64)


@dataclass(slots=True)
class _Taking:
    """Takes the channels of a recording, and says how each was made and what was skipped."""

    recording: Recording
    units: Mapping[str, str]
    strict: bool
    made: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    def signals(self, roles: Roles, rate: float | None) -> Signals:
        """Take the channels of some roles."""
        by_clock: dict[str | None, Channels] = {}
        for role, channel in self._values(roles).items():
            own = self.recording.clocks.get(roles.by_role[role][0])
            by_clock.setdefault(own if roles.time is None else roles.time, {})[role] = channel
        streams = [self._stream(clock, values, rate) for clock, values in by_clock.items()]
        if len(streams) > 1:
            return self._interpolated(streams)
        [stream] = streams
        time, values, part = self._running(stream, "samples")
        return self._made(stream.seconds(time, _origin_of(stream)), values, part)

    def _values(self, roles: Roles) -> Channels:
        """Each role's channels as one array, in SI."""
        values: Channels = {}
        for role, names in roles.by_role.items():
            if not names or role == "segment":
                continue
            columns = [self._read(name) for name in names]
            kind = "penetration" if role == "depth" else role
            if kind in UNITS:
                given = self.units.get(kind)
                first = given or self._unit_of(names[0], kind)
                own = [given or self._unit_of(name, kind, first) for name in names]
                columns = [c * size_of(kind, unit) for c, unit in zip(columns, own, strict=True)]
                listed = ", ".join(map(repr, names))
                made = f"column {listed}" if len(names) == 1 else f"columns {listed}"
                in_si = own[0] == next(iter(UNITS[kind]))
                self.made[kind] = made if in_si else f"{made}, in {own[0]}"
                if not given and own[0] in WEIGHTS:
                    words = (
                        f"{listed} is in {own[0]}, a mass: palpate takes its weight at {GRAVITY}"
                    )
                    remedy = "--unit force=N, where it is a force in N"
                    self.findings.append(Finding("units", f"{words} m/s²", remedy))
            values[role] = columns[0] if len(columns) == 1 else np.column_stack(columns)
            known = np.isfinite(np.column_stack(columns)).all(axis=1)
            if role in ("depth", "force") and known.size and not known.any():
                raise RecordingError(
                    f"{self.recording.place(names[0])}: no sample holds a number in "
                    f"[-{LARGEST:g}, {LARGEST:g}]; check its unit, or name another column"
                )
        if roles.segment is not None:
            values["segment"] = self.recording.channel(roles.segment)
        return values

    def _read(self, name: str) -> Floats:
        """A channel; say how many samples of it hold no number, for no estimator takes them."""
        recording = self.recording
        before = recording.numbers(name, strict=self.strict)
        column = measurable(before)
        if self.strict and column is not before:
            sample = int(np.nanargmax(np.abs(before)))
            raise RecordingError(
                f"{recording.place(name, sample)}: {before[sample]:g} is no measurement: it is "
                f"beyond {LARGEST:g}"
            )
        if count := int(np.count_nonzero(~np.isfinite(column))):
            first = str(recording.channels[name][int(np.argmin(np.isfinite(column)))])
            text = recording.faults[name].text if name in recording.faults else first
            samples = "1 sample" if count == 1 else f"{count} samples"
            self._say_rows(
                f"{name!r} holds no number in {samples}, first {text.strip()[:40]!r}: left out",
                "look at the recorder; --strict refuses them",
                many=count > MOST_SKIPPED * column.size,
            )
        return column

    def _say_rows(self, words: str, remedy: str, *, many: bool) -> None:
        self.findings.append(Finding("rows", words, remedy, "with-care" if many else "note"))

    def _unit_of(self, name: str, kind: str, usual: str | None = None) -> str:
        """The unit that the recording or a channel's name states; else the usual one, or SI."""
        own = self.recording.units.get(name)
        stated = plain_unit(own) if own else stated_unit(name)
        si = next(iter(UNITS[kind]))
        if stated is None or (kind == "time" and not own and not size_of(kind, stated)):
            return usual or si  # ``time (UTC)`` names a zone
        if not size_of(kind, stated):
            raise RecordingError(
                f"{self.recording.place(name)}: the {kind} is in {stated}, and palpate converts "
                f"{', '.join(UNITS[kind])} only; --unit {kind}={si} states its unit, --unit "
                f"{kind}=0.0098{si} the size of one count"
            )
        return stated

    def _stream(self, clock: str | None, values: Channels, rate: float | None) -> Stream:
        recording, lengths = self.recording, {role: len(each) for role, each in values.items()}
        if clock is None:
            if rate is None:
                raise RecordingError.of(
                    recording.source,
                    "no channel looks like the time; name it with --time, or say --rate 1000 where "
                    "the samples are evenly spaced",
                )
            return Stream(None, np.arange(next(iter(lengths.values()))) / rate, "s", values)
        time = recording.channel(clock)
        dated = time.dtype.kind in "mM"  # of pandas, say: whole nanoseconds since 1970
        if dated:
            known = ~np.isnat(time)
            whole = time.astype("M8[ns]" if time.dtype.kind == "M" else "m8[ns]").view(np.int64)
            time = whole if known.all() else np.where(known, whole.astype(np.float64), np.nan)
        elif time.dtype.kind not in "iu":
            time = recording.numbers(clock, strict=False)
        if any(length != len(time) for length in lengths.values()):
            listed = ", ".join(f"{role} has {length}" for role, length in lengths.items())
            raise RecordingError.of(
                recording.source,
                f"channels of one clock must have the same length: {clock!r} has {len(time)}, "
                f"{listed}; name the right clock with --time",
            )
        unit = "ns" if dated else self.units.get("time") or self._unit_of(clock, "time")
        return Stream(clock, time, unit, values)

    def _running(self, stream: Stream, what: str) -> tuple[Times, Channels, NDArray[np.int64]]:
        """A stream's samples whose time increases, and the part that each is of."""
        recording, label = self.recording, stream.values.get("segment")
        numbers = None if label is None else numbered(label, label.size)
        rows = rows_of(stream.time, numbers, largest=LATEST / size_of("time", stream.unit))
        if not rows.keep.any():
            there = len(stream.time)
            reason = "no sample has a time" if there else "there are columns but no samples"
            raise RecordingError.of(recording.source, reason)
        if self.strict and (rows.skipped or rows.restarts):
            self._refuse(stream, rows.first_wrong)
        if rows.late > 0.5 * rows.keep.size:
            place = recording.place(stream.clock or "time", int(np.argmin(rows.keep)))
            raise RecordingError(
                f"{place}: the time runs backward; give the samples in their order"
            )
        if rows.skipped:
            reasons = {
                "without a time": rows.untimed,
                "with the time of the one before": rows.repeated,
                "with an earlier time": rows.late,
            }
            listed = ", ".join(f"{count} {words}" for words, count in reasons.items() if count)
            self._say_rows(
                f"{rows.skipped} of {rows.keep.size} {what} were skipped: {listed}",
                "look at the recorder's clock; --strict refuses them",
                many=rows.skipped > MOST_SKIPPED * rows.keep.size,
            )
        if rows.restarts:
            times = "once" if rows.restarts == 1 else f"{rows.restarts} times"
            words = f"the time starts again {times}: contacts are kept apart there"
            self.findings.append(Finding("rows", words))
        if not rows.skipped:
            return stream.time, stream.values, rows.part
        taken = {role: channel[rows.keep] for role, channel in stream.values.items()}
        return stream.time[rows.keep], taken, rows.part[rows.keep]

    def _refuse(self, stream: Stream, sample: int) -> None:
        time, clock = stream.time, stream.clock or "time"
        if stream.clock is not None:
            self.recording.numbers(stream.clock, strict=True)  # a cell of text says it better
        before = time[max(sample - 1, 0)]
        what = "repeats the time before it" if time[sample] == before else "is hardly later"
        if not np.isfinite(time[sample]):
            what = "is not finite"
        elif sample == 0:
            what = "is no time"
        elif time[sample] < before:
            what = f"runs back from {before:g} {stream.unit}"
        raise RecordingError(
            f"{self.recording.place(clock, sample)}: {time[sample]:g} {stream.unit} {what}; time "
            "must increase within a segment"
        )

    def _made(self, time: Floats, values: Channels, part: NDArray[np.int64]) -> Signals:
        """Signals of values on one clock; gaps part them, and are said."""
        breaks = gaps(time, part)
        if breaks.any():
            longest, count = float(np.diff(time)[breaks[1:]].max()), np.count_nonzero(breaks)
            many = f"{count} gaps in time, the longest" if count > 1 else "a gap in time,"
            words = f"{many} {longest:.3g} s: contacts are kept apart there"
            self.findings.append(Finding("rows", words))
        known: dict[str, Any] = {"part": part + np.cumsum(breaks), "made": self.made, **values}
        return Signals(time, **known, findings=tuple(self.findings))

    def _interpolated(self, streams: list[Stream]) -> Signals:
        """The samples of the slowest clock, and what the others were at their times."""
        source, units = self.recording.source, {stream.unit for stream in streams}
        if len(units) > 1:
            listed = ", ".join(sorted(units))
            raise RecordingError(
                f"{source}: the clocks are in {listed}; give one unit with --unit time=…"
            )
        origin = _origin_of(*streams)
        on_time = []
        for stream in streams:
            time, values, part = self._running(stream, f"samples of {stream.clock}")
            if part.size and part.max() > 0:
                raise RecordingError(
                    f"{self.recording.place(stream.clock or 'time')}: the time starts again, and "
                    "the clocks cannot be brought together; record anew, or cut the file there"
                )
            on_time.append((stream.seconds(time, origin), values, stream.clock))
        on_time.sort(key=lambda each: _step(each[0]), reverse=True)
        # An orientation changes slowly: it sets no clock.
        first = next(k for k, (_, own, _) in enumerate(on_time) if "depth" in own or "force" in own)
        at, values, clock = on_time.pop(first)
        values, keep = dict(values), np.ones(at.size, dtype=bool)
        for other, own, name in on_time:
            keep &= _covered(at, other)
            for role, channel in own.items():
                values[role] = _at(at, other, np.asarray(channel))
                kind = "penetration" if role == "depth" else role
                if kind in self.made:
                    self.made[kind] += f", interpolated from {name!r} at the times of {clock!r}"
        if not keep.any():
            raise RecordingError(
                f"{source}: the clocks {clock!r} and {on_time[0][2]!r} have no time in common; "
                "look at them with palpate info"
            )
        if not keep.all():
            words = f"{np.count_nonzero(~keep)} of {keep.size} samples of {clock} were left out: "
            self.findings.append(
                Finding("clock", f"{words}the other clock has no sample near them")
            )
        taken = {role: channel[keep] for role, channel in values.items()}
        return self._made(at[keep], taken, np.zeros(int(keep.sum()), dtype=np.int64))


def _origin_of(*streams: Stream) -> int | float:
    """What times are counted from: the first of all where they are whole, or since 1970; else 0."""
    firsts = [s.time[np.abs(s.time) * size_of("time", s.unit) <= LATEST] for s in streams]
    known = [first.min() for first in firsts if first.size]
    if not known:
        return 0
    whole = all(stream.time.dtype.kind in "iu" for stream in streams)
    smallest = min(known)
    far = abs(float(smallest)) * size_of("time", streams[0].unit) > SINCE_LONG_AGO
    return (int(smallest) if whole else float(smallest)) if far or whole else 0


def _step(time: Floats) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else np.inf


def _covered(wanted: Floats, time: Floats) -> NDArray[np.bool_]:
    """Whether each time lies between two samples of a clock that are no gap apart."""
    after = np.searchsorted(time, wanted)
    inside = (after > 0) & (after < time.size)
    exact = (after < time.size) & (time[np.minimum(after, time.size - 1)] == wanted)
    low, high = time[np.maximum(after - 1, 0)], time[np.minimum(after, time.size - 1)]
    covered: NDArray[np.bool_] = (inside & (high - low <= GAP * _step(time))) | exact
    return covered


def _at(wanted: Floats, time: Floats, values: NDArray[np.generic]) -> NDArray[np.generic]:
    if values.dtype.kind not in "fiu":
        raise InvalidParameterError("a segment must be on the clock of the position or the force")
    if values.ndim == 1:
        return np.interp(wanted, time, values.astype(np.float64))
    return np.column_stack([_at(wanted, time, column) for column in values.T])
