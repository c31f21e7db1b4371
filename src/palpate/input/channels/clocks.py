"""Times as a clock stamped them: restarts, gaps, late samples, coarse clocks and packets."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from palpate.findings import Check, Finding, Severity
from palpate.input.recordings.units import unit_size
from palpate.method.contact import SHORTEST_STEP, run_slices
from palpate.method.rows import count_true, median
from palpate.validation import Floats, Indices, Integers, Mask, Values, frozen

Times: TypeAlias = Integers | Floats

# After a restart of the recorder, time falls back and increases from there. After a single late
# message, the next one is later than all before.
RESTART = 10  # samples in a row
GAP = 10.0  # median steps
MOST_SKIPPED = 0.02  # fraction of the samples; a larger one is a finding with care
MOST_UNTIMED = 0.25
MOST_BACKWARD = 0.1


@frozen(eq=False)
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

    keep: Mask
    part: Integers
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
    time: Times,
    label: Integers | None = None,
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
    t = time[timed]
    labels = np.zeros(t.size, np.int64) if label is None else label[timed]
    keep = np.ones(t.size, dtype=bool)
    parts = np.zeros(t.size, dtype=np.int64)
    restarts: list[int] = []
    repeated = number = 0
    for run in run_slices(labels):
        begins = [run.start + start for start in _find_restarts(t[run])]
        restarts += begins
        for low, high in pairwise([run.start, *begins, run.stop]):
            times = t[low:high]
            latest = np.maximum.accumulate(times)[:-1]
            with np.errstate(over="ignore"):  # huge times
                increases = (times[1:] > latest) & (times[1:] - latest >= SHORTEST_STEP)
            keep[low + 1 : high] = increases
            repeated += count_true(~increases & (times[1:] >= latest))
            parts[low:high] = number
            number += 1
    selected = np.zeros(time.size, dtype=bool)
    part = np.zeros(time.size, dtype=np.int64)
    selected[timed] = keep
    part[timed] = parts
    wrong = [*np.flatnonzero(timed)[restarts[:1]], *np.flatnonzero(~selected)[:1]]
    return Rows(
        selected,
        part,
        len(restarts),
        int(min(wrong, default=-1)),
        untimed=count_true(~timed),
        repeated=repeated,
        late=max(count_true(~keep) - repeated, 0),
    )


def _find_restarts(t: Times) -> list[int]:
    """The samples at which the recorder was restarted: time falls and increases from there."""
    falls = np.flatnonzero(t[1:] < t[:-1]) + 1 if t.size else np.empty(0, dtype=np.int64)
    if falls.size > MOST_BACKWARD * t.size:  # time runs backward; these are not restarts
        return []
    restarts: list[int] = []
    last = 0
    for k in falls.tolist():
        following = t[k : k + RESTART]
        increases = following.size == RESTART and bool((np.diff(following) > 0).all())
        if increases and following[-1] < t[last:k].max():
            restarts.append(k)
            last = k
    return restarts


def gaps(time: Floats, part: Integers) -> Mask:
    """Mask of the samples that follow a gap.

    A gap is longer than ten times the median of the five steps before it and of the five after it,
    so that a change of the rate is not a gap.
    """
    steps = np.diff(time)
    inside = part[1:] == part[:-1]
    follow_gap = np.zeros(time.size, dtype=bool)
    if not inside.any():
        return follow_gap
    long = np.flatnonzero(inside & (steps > GAP * median(steps[inside])))
    for k in long.tolist():
        neighbours = (steps[max(k - 5, 0) : k], steps[k + 1 : k + 6])
        typical = max((median(side) for side in neighbours if side.size), default=0.0)
        follow_gap[k + 1] = steps[k] > GAP * typical > 0.0
    return follow_gap


# Several samples with one time: rows that were written twice, a clock that ticks slowly, or samples
# that arrive in packets.

COARSE = 0.1  # fraction of samples that repeat a time; below it they are skipped one by one
EXACT = 1000  # clock counts per sample; integer times of a finer unit stay integers
PAUSE = 5.0  # least pause between packets, in steps within a packet
LARGEST_PACKET = 64  # samples
FEWEST_PACKETS = 10
OF_ONE_SIZE = 0.9  # least fraction of packets whose size is the median to within half of it


class Settled(NamedTuple):
    """The times of a clock, a mask of the rows to keep, and the findings."""

    time: Times
    keep: Mask
    findings: list[Finding]


def settle_stamps(time: Times, columns: Sequence[Values], unit: str = "s") -> Settled:
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
    """
    keep = np.ones(time.size, dtype=bool)
    milliseconds = unit_size("time", unit) * 1e3
    arrivals = _find_arrivals(time, columns)
    if arrivals is not None:
        times, tick = _spread(arrivals)
        count = time.size / np.unique(arrivals).size
        message = f"samples arrive in packets of about {count:.0f}, every "
        message += f"{tick * milliseconds:.3g} ms: palpate spread them evenly"
        finding = Check.CLOCK.finding(message, "stamp each sample when it is taken")
        return Settled(times, keep, [finding])
    repeats = np.zeros(time.size, dtype=bool)
    repeats[1:] = time[1:] == time[:-1]
    if not repeats.any():
        return Settled(time, keep, [])
    copies = repeats.copy()
    for column in columns:
        unknown = column != column
        same = (column[1:] == column[:-1]) | (unknown[1:] & unknown[:-1])
        copies[1:] &= same.reshape(len(same), -1).all(axis=1)
    count = count_true(copies)
    differing = count_true(repeats) - count
    # At rest, samples with one time of a slow clock are equal too: equal rows are copies only if
    # they outnumber the rows that repeat a time with other values.
    if differing > COARSE * time.size and differing >= count:
        times, tick = _spread(time)
        message = f"the clock ticks every {tick * milliseconds:.3g} ms: palpate spread "
        message += f"{count_true(repeats)} samples evenly within its ticks"
        finding = Check.CLOCK.finding(message, "stamp the samples by a finer clock")
        return Settled(times, keep, [finding])
    if not count:
        return Settled(time, keep, [])
    rows = "1 row that was" if count == 1 else f"{count} rows that were"
    message = f"palpate dropped {rows} written twice, of {time.size}"
    return Settled(time, ~copies, [Check.ROWS.finding(message, "check the recorder")])


def _find_arrivals(time: Times, columns: Sequence[Values]) -> Times | None:
    """Return the time at which the packet of each sample arrived; None without packets.

    Packets have one size and a pause after each, in which the channels move only as far as between
    any two samples. If the motion is proportional to the length of the pause, the samples were
    measured in bursts and their times are right.
    """
    steps = np.diff(time)
    step = float(np.quantile(steps, 0.25)) if steps.size else 0.0  # in pairs half are pauses
    if not step > 0.0:
        return None
    last = np.flatnonzero(steps > PAUSE * step)
    sizes = np.diff(last)
    if sizes.size < FEWEST_PACKETS:
        return None
    size = median(sizes)
    pause = median(steps[last])
    regular = np.abs(sizes - size) <= 0.5 * size
    if not 2.0 <= size <= LARGEST_PACKET or np.mean(regular) < OF_ONE_SIZE:
        return None
    # The share of the motion in the pauses: 1/size in packets, the share of time in bursts. The
    # border is their geometric mean; a channel of noise alone has a share near 0.
    in_packets = 1.0 / size
    in_bursts = pause / (pause + (size - 1.0) * step)
    shares = [_share_of_pauses(axis, last) for column in columns for axis in _finite_axes(column)]
    share = max(shares, default=0.0)
    if not 0.5 * in_packets < share < math.sqrt(in_packets * in_bursts):
        return None
    packet = np.searchsorted(last, np.arange(time.size))
    arrivals: Times = time[np.append(last, time.size - 1)[packet]]
    return arrivals


def _finite_axes(column: Values) -> list[Floats]:
    """The components of a numeric channel whose values are all finite."""
    if column.dtype.kind not in "iuf":
        return []
    axes = np.asarray(column, dtype=np.float64).reshape(len(column), -1).T
    return [values for values in axes if np.isfinite(values).all()]


def _share_of_pauses(values: Floats, last: Indices) -> float:
    """Fraction of the motion during the pauses: its regression on the motion of adjacent packets.

    The two have no sample in common, so noise does not increase the fraction.
    """
    pauses = values[last[1:-1] + 1] - values[last[1:-1]]
    around = 0.5 * (values[last[2:]] - values[last[:-2]])
    return float(pauses @ around / max(float(around @ around), np.finfo(float).tiny))


def _spread(time: Times) -> tuple[Times, float]:
    """Evenly spaced times within the ticks of a clock, and the median tick."""
    origin = time[np.isfinite(time)][0]
    since = np.asarray(time - origin, dtype=np.float64)
    steps = np.diff(since)
    tick = median(steps[steps > 0.0]) if (steps > 0.0).any() else 0.0
    ends = ~((steps >= 0.0) & (steps <= GAP * tick))  # an unknown time also ends a run
    for run in run_slices(np.concatenate([[0], np.cumsum(ends)])):
        since[run] = _spread_run(since[run], tick)
    if time.dtype.kind in "iu" and tick * np.mean(steps > 0.0) > EXACT:
        return np.rint(since).astype(np.int64) + origin, tick
    return since + origin, tick


def _spread_run(stamps: Floats, tick: float) -> Floats:
    """Evenly spaced times within the tick of every stamp, or within each tick if there are none."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(stamps)) + 1])
    if begins.size > 2:  # the first tick may have begun before the recording
        first, last = begins[1], begins[-1]
        step = (stamps[last] - stamps[first]) / (last - first)
        line: Floats = step * np.arange(stamps.size)
        line += np.max(stamps - line)
        if np.max(line - stamps) < tick + step:
            return line
    counts = np.diff(np.append(begins, stamps.size))
    lengths = np.append(np.minimum(np.diff(stamps[begins]), tick), tick)
    place = np.arange(stamps.size) - np.repeat(begins, counts)
    spread: Floats = stamps + place * np.repeat(lengths / counts, counts)
    return spread


# Reports.


def report_excluded(message: str, cause: str, count: int, samples: int) -> Finding:
    """Report excluded samples: with care if they are many."""
    severity: Severity = "with-care" if count > MOST_SKIPPED * samples else "note"
    remedy = f"check {cause}, or pass --strict to fail instead"
    return Check.ROWS.finding(message, remedy, severity=severity)


def report_rows(rows: Rows, what: str) -> Iterable[Finding]:
    """Report the samples without a valid time, and the restarts."""
    count = rows.keep.size
    if rows.skipped:
        counts = {
            "without a time": rows.untimed,
            "with the previous time": rows.repeated,
            "with an earlier time": rows.late,
        }
        listed = ", ".join(f"{number} {reason}" for reason, number in counts.items() if number)
        message = f"palpate skipped {rows.skipped} of {count} {what}: {listed}"
        yield report_excluded(message, "the recorder's clock", rows.skipped, count)
    if rows.untimed > MOST_UNTIMED * count:
        message = f"{rows.untimed} of {count} {what} have no time: the file is damaged"
        yield Check.ROWS.finding(message, "copy it again", severity="with-care", mark="with-care")
    if rows.restarts:
        times = "once" if rows.restarts == 1 else f"{rows.restarts} times"
        yield Check.ROWS.finding(f"the recorder restarted {times}: contacts are separated there")


def report_gaps(steps: Floats) -> Finding:
    """Report gaps of these lengths, s."""
    number = "a gap in time," if steps.size == 1 else f"{steps.size} gaps in time, the longest"
    longest = float(steps.max())
    return Check.ROWS.finding(f"{number} {longest:.3g} s: contacts are separated there")


def report_stated_rate(rate: float) -> Finding:
    """Report that the rate that the file states is used, Hz."""
    message = f"there is no time; palpate uses the rate that the file states, {rate:g} Hz"
    return Check.CLOCK.finding(message, "pass --rate if another is right")


def report_rate_of_motion(rate: float) -> Finding:
    """Report that the rate at which the depth follows its velocity is used, Hz."""
    message = f"there is no time; the depth follows its velocity at {rate:.4g} Hz"
    return Check.CLOCK.finding(message, "pass --rate if another is right")


def report_unmatched(keep: Mask, clock: str | None) -> Finding:
    """Report the samples at which another clock has none."""
    message = f"palpate excluded {count_true(~keep)} of {keep.size} samples of {clock}"
    return Check.CLOCK.finding(f"{message}: the other clock has no sample near them")
