"""Channels on one clock, in SI units: skipped samples, gaps, restarts and interpolation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.contact import SHORTEST_STEP, number_runs, run_slices
from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Check, Finding, Severity
from palpate.preparation.channel_kinds import is_raw
from palpate.preparation.roles import Roles
from palpate.recordings import Recording
from palpate.recordings.poses import align_signs, interpolate_columns, lie_between_samples
from palpate.recordings.units import GRAVITY, TORQUE_UNITS, UNITS, UNSTATED, WEIGHTS, unit_size
from palpate.validation import Floats

# After a restart of the recorder, time falls back and increases from there. After a single late
# message, the next one is later than all before.
RESTART = 10  # samples in a row
GAP = 10.0  # median steps
MOST_SKIPPED = 0.02  # fraction of the samples; a larger one is a finding with care
MOST_UNTIMED = 0.25
MOST_BACKWARD = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Selection of samples by their time.

    Attributes
    ----------
    keep : numpy.ndarray of bool, shape (k,)
        Mask of the samples whose time exceeds all times before it since the last start.
    part : numpy.ndarray of int, shape (k,)
        A number that increases at each change of the label and each restart.
    restarts : int
        Number of restarts.
    first_wrong : int
        Index of the first sample that is skipped or begins a restart; −1 without one.
    untimed, repeated, late : int
        Number of samples without a time, with the previous time, or with an earlier time.
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
        """Number of skipped samples."""
        return self.untimed + self.repeated + self.late


def select_increasing_rows(
    time: NDArray[np.int64] | Floats,
    label: NDArray[np.int64] | None = None,
    *,
    largest: float = math.inf,
) -> Rows:
    """Select the samples whose time increases.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        Times in any unit; integers stay exact.
    label : numpy.ndarray of int, shape (k,), optional
        Label of the contact; time may fall where it changes.
    largest : float
        Largest valid time, in the same unit.
    """
    timed = np.isfinite(time) & (np.abs(time) <= largest)
    t, given = time[timed], np.zeros(time.size, np.int64) if label is None else label
    own = given[timed]
    keep, part = np.ones(t.size, dtype=bool), np.zeros(t.size, dtype=np.int64)
    repeated, number = 0, 0
    again: list[int] = []
    for start, stop in ((run.start, run.stop) for run in run_slices(own)):
        starts = _starts(t[start:stop])
        again += [start + each for each in starts]
        for low, high in pairwise([0, *starts, stop - start]):
            inside = t[start + low : start + high]
            before = np.maximum.accumulate(inside)[:-1]
            with np.errstate(over="ignore"):  # huge times
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
    """The samples at which the recorder was restarted: time falls and increases from there."""
    falls = np.flatnonzero(t[1:] < t[:-1]) + 1 if t.size else np.empty(0, dtype=np.int64)
    if falls.size > MOST_BACKWARD * t.size:  # time runs backward; these are not restarts
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
    """Mask of the samples that follow a gap.

    A gap is longer than ten times the median of the five steps before it and of the five after it,
    so that a change of the rate is not a gap.
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


# Several samples with one time: rows that were written twice, a clock that ticks slowly, or samples
# that arrive in packets.

COARSE = 0.1  # fraction of samples that repeat a time; below it they are skipped one by one
EXACT = 1000  # clock counts per sample; integer times of a finer unit stay integers
PAUSE = 5.0  # least pause between packets, in steps within a packet
LARGEST_PACKET = 64  # samples
FEWEST_PACKETS = 10
OF_ONE_SIZE = 0.9  # least fraction of packets whose size is the median to within half of it


def settle_stamps(
    time: "Times", columns: Sequence[NDArray[Any]], unit: str = "s"
) -> tuple["Times", NDArray[np.bool_], list[Finding]]:
    """Drop the rows that were written twice, and spread the samples of a coarse clock.

    A row is written twice if its time and all its channels repeat the previous row. If more than a
    tenth of the samples repeat a time with other values, the clock ticks more slowly than the
    recorder samples. Each run of samples without a gap then gets evenly spaced times within every
    tick, t ≤ a + b k < t + tick; if there are no such times, evenly spaced times within each single
    tick. Samples that arrive in packets and are stamped on arrival are spread in the same way.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        In any unit.
    columns : sequence of numpy.ndarray, shapes (k,) or (k, m)
        The channels on this clock.
    unit : str
        Unit of the time, for the finding.

    Returns
    -------
    tuple
        The times, a mask of the rows to keep, and the findings.
    """
    keep, again = np.ones(time.size, dtype=bool), np.zeros(time.size, dtype=bool)
    arrivals = _arrivals(time, columns)
    if arrivals is not None:
        times, tick = _spread(arrivals)
        many = time.size / np.unique(arrivals).size
        period = f"{tick * unit_size('time', unit) * 1e3:.3g} ms"
        words = f"samples arrive in packets of about {many:.0f}, every {period}"
        words += ": palpate spread them evenly"
        return times, keep, [Check.CLOCK.finding(words, "stamp each sample when it is taken")]
    again[1:] = time[1:] == time[:-1]
    if not again.any():
        return time, keep, []
    copies = again.copy()
    for column in columns:
        unknown = column != column
        same = (column[1:] == column[:-1]) | (unknown[1:] & unknown[:-1])
        copies[1:] &= same.reshape(len(same), -1).all(axis=1)
    others = int(np.count_nonzero(again & ~copies))
    # At rest, samples with one time of a slow clock are equal too: equal rows are copies only if
    # they outnumber the rows that repeat a time with other values.
    if others > COARSE * time.size and others >= np.count_nonzero(copies):
        times, tick = _spread(time)
        words = f"the clock ticks every {tick * unit_size('time', unit) * 1e3:.3g} ms: palpate "
        words += f"spread {np.count_nonzero(again)} samples evenly within its ticks"
        return times, keep, [Check.CLOCK.finding(words, "stamp the samples by a finer clock")]
    count = int(np.count_nonzero(copies))
    words = f"palpate dropped {count} row{'s' * (count > 1)} that {'were' if count > 1 else 'was'} "
    found = [Check.ROWS.finding(f"{words}written twice, of {time.size}", "check the recorder")]
    return time, ~copies, found if count else []


def _arrivals(time: "Times", columns: Sequence[NDArray[Any]]) -> "Times | None":
    """Return the time at which the packet of each sample arrived; None without packets.

    Packets have one size and a pause after each, in which the channels move only as far as between
    any two samples. If the motion is proportional to the length of the pause, the samples were
    measured in bursts and their times are right.
    """
    steps = np.diff(time)
    usual = float(np.quantile(steps, 0.25)) if steps.size else 0.0  # in pairs half are pauses
    if not usual > 0.0:
        return None
    last = np.flatnonzero(steps > PAUSE * usual)
    sizes = np.diff(last)
    if sizes.size < FEWEST_PACKETS:
        return None
    size, pause = float(np.median(sizes)), float(np.median(steps[last]))
    alike = np.abs(sizes - size) <= 0.5 * size
    if not 2.0 <= size <= LARGEST_PACKET or np.mean(alike) < OF_ONE_SIZE:
        return None
    # The share of the motion in the pauses: 1/size in packets, the share of time in bursts. The
    # border is their geometric mean; a channel of noise alone has a share near 0.
    in_packets, in_bursts = 1.0 / size, pause / (pause + (size - 1.0) * usual)
    border = math.sqrt(in_packets * in_bursts)
    shares = [_share_of_pauses(values, last) for column in columns for values in _moving(column)]
    if max(shares, default=0.0) >= border or max(shares, default=0.0) <= 0.5 * in_packets:
        return None
    packet = np.searchsorted(last, np.arange(time.size))
    arrivals: Times = time[np.append(last, time.size - 1)[packet]]
    return arrivals


def _moving(column: NDArray[Any]) -> list[Floats]:
    """The components of a numeric channel whose values are all finite."""
    if column.dtype.kind not in "iuf":
        return []
    parts = np.asarray(column, dtype=np.float64).reshape(len(column), -1).T
    return [values for values in parts if np.isfinite(values).all()]


def _share_of_pauses(values: Floats, last: NDArray[np.intp]) -> float:
    """Fraction of the motion during the pauses: its regression on the motion of adjacent packets.

    The two have no sample in common, so noise does not increase the fraction.
    """
    pauses = values[last[1:-1] + 1] - values[last[1:-1]]
    around = 0.5 * (values[last[2:]] - values[last[:-2]])
    return float(pauses @ around / max(float(around @ around), np.finfo(float).tiny))


def _spread(time: "Times") -> tuple["Times", float]:
    """Evenly spaced times within the ticks of a clock, and the median tick."""
    known = np.isfinite(time)
    origin = time[known][0]
    since = np.asarray(time - origin, dtype=np.float64)
    steps = np.diff(since)
    tick = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    ends = ~((steps >= 0.0) & (steps <= GAP * tick))  # an unknown time also ends a run
    for part in run_slices(np.concatenate([[0], np.cumsum(ends)])):
        since[part] = _spread_stretch(since[part], tick)
    if time.dtype.kind in "iu" and tick * np.mean(steps > 0.0) > EXACT:
        return np.rint(since).astype(np.int64) + origin, tick
    return since + origin, tick


def _spread_stretch(stamps: Floats, tick: float) -> Floats:
    """Evenly spaced times within the tick of every stamp, or within each tick if there are none."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(stamps)) + 1])
    if begins.size > 2:  # the first tick may have begun before the recording
        index, first, last = np.arange(stamps.size), begins[1], begins[-1]
        step = (stamps[last] - stamps[first]) / (last - first)
        line: Floats = step * index
        line += np.max(stamps - line)
        if np.max(line - stamps) < tick + step:
            return line
    counts = np.diff(np.append(begins, stamps.size))
    lengths = np.append(np.minimum(np.diff(stamps[begins]), tick), tick)
    place = np.arange(stamps.size) - np.repeat(begins, counts)
    spread: Floats = stamps + place * np.repeat(lengths / counts, counts)
    return spread


# The channels of a contact as numbers, in SI units on one clock.

#: Largest plausible value in SI units, also of a :class:`Scale`. Sums of eighth powers stay finite
#: below it: LAPACK prints to standard output when it meets an infinity.
LARGEST = 1e30
# s. Later times, as since 1970, are made relative to the first: their floats have steps of 0.2 µs.
SINCE_LONG_AGO = 1e8
# s, three thousand years. A larger float cannot resolve a millisecond, and comes from a bit error.
LATEST = 1e11

Channels: TypeAlias = dict[str, NDArray[np.generic]]
Times: TypeAlias = NDArray[np.int64] | Floats


@dataclass(frozen=True, slots=True, eq=False)
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
    part: NDArray[np.int64]
    velocity: Floats | None = None
    orientation: Floats | None = None
    segment: NDArray[np.generic] | None = None
    fresh: NDArray[np.bool_] | None = None
    clocks: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)
    made: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    stated_units: frozenset[str] = frozenset()
    assumed_units: frozenset[str] = frozenset()

    def taken(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> "Signals":
        """Return the selected samples."""
        names = "time", "depth", "force", "part", "velocity", "orientation", "segment", "fresh"
        given = {name: getattr(self, name) for name in names}
        return replace(self, **{k: each[keep] for k, each in given.items() if each is not None})


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
    return _Taking(recording, units or {}, strict).signals(roles, rate)


def measurable(values: Floats) -> Floats:
    """Replace implausibly large values by NaN."""
    beyond = np.abs(values) > LARGEST
    return np.where(beyond, np.nan, values) if beyond.any() else values


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Channels on one clock, with times in the unit of the clock."""

    clock: str | None
    time: Times
    unit: str
    values: Channels

    def seconds(self, time: Times, origin: int | float) -> Floats:
        """Times in seconds from an origin, subtracted before conversion to keep the digits."""
        return np.asarray((time - origin) * unit_size("time", self.unit), dtype=np.float64)


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
    return _Taking(recording, units, strict=False)._stream(clock, values, rate)


@dataclass(slots=True)
class _Taking:
    """Converts the channels of a recording and notes each conversion and each skipped sample."""

    recording: Recording
    units: Mapping[str, str]
    strict: bool
    made: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    stated: set[str] = field(default_factory=set)
    assumed: set[str] = field(default_factory=set)

    def signals(self, roles: Roles, rate: float | None) -> Signals:
        """Convert the channels of the roles."""
        by_clock: dict[str | None, Channels] = {}
        for role, channel in self._values(roles).items():
            own = self.recording.clocks.get(roles.by_role[role][0])
            by_clock.setdefault(own if roles.time is None else roles.time, {})[role] = channel
        streams = [self._stream(clock, values, rate) for clock, values in by_clock.items()]
        if len(streams) > 1:
            return self._interpolate_streams(streams)
        [stream] = streams
        time, values, part = self._running(stream, "samples")
        seconds = stream.seconds(time, origin_of(stream))
        return self._make_signals(seconds, values, part, [(seconds, values)])

    def _values(self, roles: Roles) -> Channels:
        """The channels of each role as one array, in SI units."""
        values: Channels = {}
        for role, names in roles.by_role.items():
            if not names or role == "segment":
                continue
            columns = [self._read(name) for name in names]
            kind = "penetration" if role == "depth" else role
            if kind in UNITS:
                given = self.units.get(kind)
                first = given or self._choose_unit(names[0], kind)
                own = [given or self._choose_unit(name, kind, first) for name in names]
                columns = [c * unit_size(kind, unit) for c, unit in zip(columns, own, strict=True)]
                listed = ", ".join(map(repr, names))
                made = f"column {listed}" if len(names) == 1 else f"columns {listed}"
                in_si = own[0] == next(iter(UNITS[kind]))
                self.made[kind] = made if in_si else f"{made}, in {own[0]}"
                if given or not in_si or all(map(self.recording.states_unit, names)):
                    self.stated.add(kind)
                if self.recording.assumes_unit(names[0]):
                    self.assumed.add(kind)
                if not given and own[0] in WEIGHTS:
                    words = f"{listed} is in {own[0]}, a mass: palpate multiplies it by {GRAVITY}"
                    remedy = "pass --unit force=N if the values are forces in N"
                    self.findings.append(Check.UNITS.finding(f"{words} m/s²", remedy))
            elif role == "torque":
                stated = [self.recording.unit_of(name) or "" for name in names]
                sizes = [TORQUE_UNITS.get(unit, 1.0) for unit in stated]
                columns = [c * size for c, size in zip(columns, sizes, strict=True)]
            lengths = {name: column.size for name, column in zip(names, columns, strict=True)}
            option = f"--{'position' if role == 'depth' else role}"
            self._check_lengths("the channels of one vector", lengths, f"choose one with {option}")
            values[role] = columns[0] if len(columns) == 1 else np.column_stack(columns)
            known = np.isfinite(np.column_stack(columns)).all(axis=1)
            if role == "orientation":  # interpolation needs it
                values[role] = align_signs(np.column_stack(columns))
            if role in ("depth", "force") and known.size and not known.any():
                option = "position" if role == "depth" and not roles.is_penetration else kind
                words = f"no sample has a number in [-{LARGEST:g}, {LARGEST:g}]; check its unit, or"
                place = self.recording.place(names[0])
                raise RecordingError(f"{place}: {words} choose another with --{option}")
        if roles.segment is not None:
            values["segment"] = self.recording.channel(roles.segment)
        return values

    def _read(self, name: str) -> Floats:
        """Return a channel as numbers; exclude and report the samples that are not numbers."""
        recording = self.recording
        before = recording.numbers(name, strict=self.strict)
        column = measurable(before)
        if self.strict and column is not before:
            sample = int(np.nanargmax(np.abs(before)))
            what = f"{recording.place(name, sample)}: {before[sample]:g} is beyond {LARGEST:g}"
            raise RecordingError(f"{what}; drop --strict to exclude such values")
        if count := int(np.count_nonzero(~np.isfinite(column))):
            first = str(recording.channels[name][int(np.argmin(np.isfinite(column)))])
            text = recording.faults[name].text if name in recording.faults else first
            samples = "1 sample" if count == 1 else f"{count} samples"
            words = f"palpate excluded {samples} of {name!r} without a usable number"
            words += f": {text.strip()[:40]!r}"
            self._report_excluded(words, "the recorder", count, column.size)
        return column

    def _report_excluded(self, words: str, cause: str, count: int, samples: int) -> None:
        severity: Severity = "with-care" if count > MOST_SKIPPED * samples else "note"
        remedy = f"check {cause}, or pass --strict to fail instead"
        self.findings.append(Check.ROWS.finding(words, remedy, severity=severity))

    def _choose_unit(self, name: str, kind: str, usual: str | None = None) -> str:
        """The unit from the recording or the channel's name; else the usual one, else SI."""
        own, stated = self.recording.units.get(name), self.recording.unit_of(name)
        si = next(iter(UNITS[kind]))
        remedy = f"its unit, such as --unit {kind}={si}, or the size of one count, such as --unit "
        remedy += f"{kind}=0.0098{si}"
        if kind in ("penetration", "force") and is_raw(self.recording, name):
            words = "these are raw counts, by the name"
        elif stated == UNSTATED:
            words = f"the file states no unit of the {kind} ({self.recording.table})"
            remedy = "the units, such as --unit penetration=um,force=mN"
        elif stated is None or (kind == "time" and not own and not unit_size(kind, stated)):
            return usual or si  # ``time (UTC)`` states a time zone, not a unit
        elif not unit_size(kind, stated):
            known = ", ".join(UNITS[kind])
            words = f"palpate cannot convert the unit {stated} of the {kind} (known: {known})"
        else:
            return stated
        raise RecordingError(f"{self.recording.place(name)}: {words}; pass {remedy}")

    def _find_stated_rate(self) -> float | None:
        """The rate that the file states, if any."""
        rate = self.recording.settings.get("rate")
        if rate is not None:
            words = f"there is no time; palpate uses the rate that the file states, {rate:g} Hz"
            self.findings.append(Check.CLOCK.finding(words, "pass --rate if another is right"))
        return rate

    def _stream(self, clock: str | None, values: Channels, rate: float | None) -> Stream:
        recording, lengths = self.recording, {role: len(each) for role, each in values.items()}
        if clock is None:
            self.stated.add("time")  # as a rate in Hz
            rate = rate or self._find_stated_rate()
            if rate is None:
                raise RecordingError.of(
                    recording.source,
                    "no channel looks like the time; name it with --time, or pass --rate if the "
                    "samples are evenly spaced and you know the rate; --no-time gives the "
                    "stiffness alone",
                )
            remedy = "choose others with --position and --force, or name their clocks with --time"
            self._check_lengths("channels at one rate", lengths, remedy)
            return Stream(None, np.arange(next(iter(lengths.values()))) / rate, "s", values)
        time = recording.channel(clock)
        dated = time.dtype.kind in "mM"  # for example from pandas: nanoseconds since 1970
        if dated:
            known = ~np.isnat(time)
            whole = time.astype("M8[ns]" if time.dtype.kind == "M" else "m8[ns]").view(np.int64)
            time = whole if known.all() else np.where(known, whole.astype(np.float64), np.nan)
        elif time.dtype.kind not in "iu":
            time = recording.numbers(clock, strict=False)
        remedy = "name the right clock with --time"
        self._check_lengths("channels on one clock", {clock: len(time), **lengths}, remedy)
        given = "ns" if dated else self.units.get("time")
        unit = given or self._choose_unit(clock, "time")
        if given or unit != next(iter(UNITS["time"])) or self.recording.states_unit(clock):
            self.stated.add("time")
        return Stream(clock, time, unit, values)

    def _check_lengths(self, what: str, lengths: Mapping[str, int], remedy: str) -> None:
        """Refuse channels of different lengths."""
        if len({*lengths.values()}) > 1:
            listed = ", ".join(f"{name!r} has {size}" for name, size in lengths.items())
            words = f"{what} must have the same length: {listed}; {remedy}"
            raise RecordingError.of(self.recording.source, words)

    def _running(self, stream: Stream, what: str) -> tuple[Times, Channels, NDArray[np.int64]]:
        """The samples of a stream whose time increases, and their part numbers."""
        recording = self.recording
        if not self.strict:
            time, keep, found = settle_stamps(stream.time, [*stream.values.values()], stream.unit)
            self.findings += found
            taken = {role: channel[keep] for role, channel in stream.values.items()}
            stream = replace(stream, time=time[keep], values=taken)
        label = stream.values.get("segment")
        numbers = None if label is None else number_runs(label, label.size)
        largest = LATEST / unit_size("time", stream.unit)
        rows = select_increasing_rows(stream.time, numbers, largest=largest)
        if not rows.keep.any():
            there = len(stream.time)
            reason = "no sample has a valid time" if there else "the recording has no samples"
            raise RecordingError.of(recording.source, reason)
        if self.strict and (rows.skipped or rows.restarts):
            self._refuse(stream, rows.first_wrong)
        if rows.late > 0.5 * rows.keep.size:
            place = recording.place(stream.clock or "time", int(np.argmin(rows.keep)))
            raise RecordingError(f"{place}: the time runs backward; sort the samples by time")
        if rows.skipped:
            reasons = "without a time", "with the previous time", "with an earlier time"
            counts = zip((rows.untimed, rows.repeated, rows.late), reasons, strict=True)
            listed = ", ".join(f"{count} {reason}" for count, reason in counts if count)
            words = f"palpate skipped {rows.skipped} of {rows.keep.size} {what}: {listed}"
            self._report_excluded(words, "the recorder's clock", rows.skipped, rows.keep.size)
        if rows.untimed > MOST_UNTIMED * rows.keep.size:
            words = f"{rows.untimed} of {rows.keep.size} {what} have no time: the file is damaged"
            self.findings.append(
                Check.ROWS.finding(words, "copy it again", severity="with-care", mark="with-care")
            )
        if rows.restarts:
            times = "once" if rows.restarts == 1 else f"{rows.restarts} times"
            words = f"the recorder restarted {times}: contacts are separated there"
            self.findings.append(Check.ROWS.finding(words))
        if not rows.skipped:
            return stream.time, stream.values, rows.part
        taken = {role: channel[rows.keep] for role, channel in stream.values.items()}
        return stream.time[rows.keep], taken, rows.part[rows.keep]

    def _refuse(self, stream: Stream, sample: int) -> None:
        time, clock = stream.time, stream.clock or "time"
        if stream.clock is not None:
            self.recording.numbers(stream.clock, strict=True)  # a clearer error for text
        before = time[max(sample - 1, 0)]
        what = "repeats the previous time" if time[sample] == before else "is hardly later"
        if not np.isfinite(time[sample]):
            what = "is not finite"
        elif sample == 0:
            what = "is not a valid time"
        elif time[sample] < before:
            what = f"runs back from {before:g} {stream.unit}"
        words = f"{time[sample]:g} {stream.unit} {what}, but time must increase within a segment"
        place = self.recording.place(clock, sample)
        raise RecordingError(f"{place}: {words}; drop --strict to skip such samples")

    def _make_signals(
        self,
        time: Floats,
        values: Channels,
        part: NDArray[np.int64],
        streams: Sequence[tuple[Floats, Channels]],
    ) -> Signals:
        """Make signals from values on one clock; separate them at gaps and report these."""
        breaks = gaps(time, part)
        if breaks.any():
            longest, count = float(np.diff(time)[breaks[1:]].max()), np.count_nonzero(breaks)
            many = f"{count} gaps in time, the longest" if count > 1 else "a gap in time,"
            words = f"{many} {longest:.3g} s: contacts are separated there"
            self.findings.append(Check.ROWS.finding(words))
        known: dict[str, Any] = {"part": part + np.cumsum(breaks), "made": self.made, **values}
        known.pop("torque", None)
        if "orientation" in values:
            known["clocks"] = {}
            for own, channels in streams:
                for role in ("depth", "orientation", "force", "torque"):
                    if role in channels:
                        known["clocks"][role] = own, np.asarray(channels[role], float)
        return Signals(
            time,
            **known,
            findings=tuple(self.findings),
            stated_units=frozenset(self.stated),
            assumed_units=frozenset(self.assumed),
        )

    def _interpolate_streams(self, streams: list[Stream]) -> Signals:
        """The samples of the slowest clock, with the others interpolated at its times."""
        source, units = self.recording.source, {stream.unit for stream in streams}
        if len(units) > 1:
            listed = ", ".join(sorted(units))
            words = f"the clocks are in {listed}; pass one unit, such as --unit time=s"
            raise RecordingError(f"{source}: {words}")
        origin = origin_of(*streams)
        on_time = []
        for stream in streams:
            time, values, part = self._running(stream, f"samples of {stream.clock}")
            if part.size and part.max() > 0:
                what = "the recorder restarted, so palpate cannot match the clocks"
                place = self.recording.place(stream.clock or "time")
                raise RecordingError(f"{place}: {what}; record again, or cut the file there")
            on_time.append((stream.seconds(time, origin), values, stream.clock))
        recorded = [each[:2] for each in on_time]
        on_time.sort(key=lambda each: _step(each[0]), reverse=True)
        # An orientation changes slowly: its clock never sets the rate.
        first = next(k for k, (_, own, _) in enumerate(on_time) if "depth" in own or "force" in own)
        at, values, clock = on_time.pop(first)
        values, keep = dict(values), np.ones(at.size, dtype=bool)
        for other, own, name in on_time:
            keep &= lie_between_samples(at, other)
            for role, channel in own.items():
                values[role] = _interpolate(at, other, np.asarray(channel))
                kind = "penetration" if role == "depth" else role
                if kind in self.made:
                    self.made[kind] += f", interpolated from {name!r} at the times of {clock!r}"
        if not keep.any():
            what = f"{source}: the clocks {clock!r} and {on_time[0][2]!r} do not overlap"
            raise RecordingError(f"{what}; list them with palpate info {source or 'FILE'}")
        if not keep.all():
            words = f"palpate excluded {np.count_nonzero(~keep)} of {keep.size} samples of {clock}"
            words += ": the other clock has no sample near them"
            self.findings.append(Check.CLOCK.finding(words))
        taken = {role: channel[keep] for role, channel in values.items()}
        part = np.zeros(np.count_nonzero(keep), dtype=np.int64)
        return self._make_signals(at[keep], taken, part, recorded)


def origin_of(*streams: Stream) -> int | float:
    """The origin of time: the first time if it is an integer or since 1970, else 0."""
    firsts = [s.time[np.abs(s.time) * unit_size("time", s.unit) <= LATEST] for s in streams]
    known = [first.min() for first in firsts if first.size]
    if not known:
        return 0
    whole = all(stream.time.dtype.kind in "iu" for stream in streams)
    smallest = min(known)
    far = abs(float(smallest)) * unit_size("time", streams[0].unit) > SINCE_LONG_AGO
    return (int(smallest) if whole else float(smallest)) if far or whole else 0


def _step(time: Floats) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else np.inf


def _interpolate(wanted: Floats, time: Floats, values: NDArray[np.generic]) -> NDArray[np.generic]:
    if values.dtype.kind not in "fiu":
        raise InvalidParameterError("segment must be on the clock of the position or the force")
    numbers = values.astype(np.float64)
    if numbers.ndim == 1:
        return np.interp(wanted, time, numbers)
    return interpolate_columns(wanted, time, numbers)
