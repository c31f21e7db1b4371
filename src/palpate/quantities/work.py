"""The work of a probe along its motion, and the loops in which it can be lost."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.force_laws import ForceLaw, force_over_breaks
from palpate.preparation.suggestions import choose_gate
from palpate.preparation.touches import touches_of
from palpate.validation import Floats

# Of the swing of the depth: a crossing counts when the probe has been so far on either side.
HYSTERESIS = 0.10
# Of the range of the work in a loop: what swings less is noise of a probe that rests.
SMALLEST_STROKE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """What is known of a probe's motion in the material, sample by sample.

    Attributes
    ----------
    time, depth, velocity, force : numpy.ndarray, shape (k,)
        s; below the surface, m; m/s; without the sensor's offset, N. All finite.
    segment : numpy.ndarray of int, shape (k,)
        Work does not go from one to the next.
    inside : numpy.ndarray of bool, shape (k,)
        The samples that the identification took.
    """

    time: Floats
    depth: Floats
    velocity: Floats
    force: Floats
    segment: NDArray[np.int64]
    inside: NDArray[np.bool_]

    def felt(self, law: ForceLaw) -> Floats:
        """Force by a law along the motion, N; one with memory is at rest where a touch begins."""
        steps = np.diff(self.time, prepend=self.time[:1])
        starts = [0, *(np.flatnonzero(np.diff(self.segment)) + 1).tolist()]
        within = np.delete(steps, starts)
        steps[starts] = np.median(within) if within.size else 1.0
        return force_over_breaks(law, self.depth, self.velocity, steps, starts)

    def work(self, force: Floats) -> Floats:
        """Work done on the material up to each sample, J: ∫ F dx by trapezoids."""
        steps = 0.5 * (force[1:] + force[:-1]) * np.diff(self.depth)
        steps[np.diff(self.segment) != 0] = 0.0
        return np.concatenate([[0.0], np.cumsum(steps)])

    def variance(self, force_noise: float, depth_noise: float) -> Floats:
        """Variance of the measured work up to each sample, J², by white noise of both channels.

        ∫ F dx = −∫ x dF of a closed loop: a force counts with half the way between its neighbours,
        a depth with half the difference of its neighbours' forces.
        """
        total = np.zeros(len(self.depth))
        for values, noise in ((self.depth, force_noise), (self.force, depth_noise)):
            weights = np.zeros(len(values))
            weights[1:-1] = 0.5 * (values[2:] - values[:-2])
            total += np.cumsum((noise * weights) ** 2)
        return total


@dataclass(frozen=True, slots=True, eq=False)
class Loops:
    """Stretches of a path at whose ends the probe is equally deep.

    Attributes
    ----------
    kind : str
        ``"touch"`` or ``"cycle"``.
    starts, stops : numpy.ndarray, shape (m,)
        As places between the samples, from 0; whole ones for touches.
    """

    kind: str
    starts: Floats
    stops: Floats

    def __len__(self) -> int:
        return len(self.starts)

    def swings(self, values: Floats) -> Floats:
        """Largest less smallest value in each loop."""
        ends = zip(self.starts.tolist(), self.stops.tolist(), strict=True)
        return np.array([np.ptp(values[int(a) : int(b) + 2]) for a, b in ends])

    def over(self, values: Floats) -> Floats:
        """How much a running sum grows in each loop."""
        places = np.arange(len(values))
        grown: Floats = np.interp(self.stops, places, values) - np.interp(
            self.starts, places, values
        )
        return grown


def loops_of(contact: Contact, path: Path) -> Loops:
    """Return the whole touches; or whole cycles, where these hold less than half of the contact.

    A touch begins and ends out of contact, within the recording. A cycle of a probe that stays in
    contact goes from one passage through the median depth, inwards, to the next: whatever a spring
    takes up in such a loop it gives back, however the depth of the strokes varies.
    """
    touches = _touches(contact, path)
    counts = np.concatenate([[0], np.cumsum(path.inside)])
    held = sum(counts[int(b) + 1] - counts[int(a)] for a, b in touches)
    if 2 * held >= counts[-1] > 0:
        return _loops("touch", touches)
    return _loops("cycle", _cycles(path))


def _loops(kind: str, ends: list[tuple[float, float]]) -> Loops:
    starts, stops = np.array(ends, dtype=np.float64).reshape(-1, 2).T
    return Loops(kind, starts, stops)


def _touches(contact: Contact, path: Path) -> list[tuple[float, float]]:
    """First and last sample of each, outwards as far as the probe is below the surface."""
    gate, found = choose_gate(contact), []
    for part in contact.segments():
        first, last = _ends(path, int(contact.segment[part.start]))
        time, cores = path.time[first : last + 1], []
        for touch in touches_of(contact.taken(part), gate):
            start = first + int(np.searchsorted(time, touch.start))
            stop = first + int(np.searchsorted(time, touch.stop, side="right")) - 1
            if path.inside[start : stop + 1].any():  # a spike that was left out is none
                cores.append((start, stop))
        limits = [first, *(_between(path.depth, a[1], b[0]) for a, b in pairwise(cores)), last]
        for (start, stop), (low, high) in zip(cores, pairwise(limits), strict=False):
            if first < start and stop < last:
                found.append(_outwards(path.depth, start, stop, low, high))
    return found


def _ends(path: Path, segment: int) -> tuple[int, int]:
    """First and last sample of a segment."""
    first = int(np.searchsorted(path.segment, segment))
    return first, int(np.searchsorted(path.segment, segment, side="right")) - 1


def _between(depth: Floats, stop: int, start: int) -> int:
    """The shallowest sample between two touches."""
    return stop + int(np.argmin(depth[stop : start + 1]))


def _outwards(depth: Floats, start: int, stop: int, low: int, high: int) -> tuple[float, float]:
    before, after = depth[low : start + 1] <= 0.0, depth[stop : high + 1] <= 0.0
    begin = low + int(np.flatnonzero(before)[-1]) if before.any() else low
    end = stop + int(np.argmax(after)) if after.any() else high
    return begin, end


def _cycles(path: Path) -> list[tuple[float, float]]:
    """Between passages inwards through the median depth, with some way on either side."""
    taken = path.depth[path.inside]
    if taken.size < 2:
        return []
    low, level, high = np.percentile(taken, [10.0, 50.0, 90.0])
    some = HYSTERESIS * (high - low)
    found: list[tuple[float, float]] = []
    for each in np.unique(path.segment):
        first, last = _ends(path, int(each))
        places = _passages(path.depth[first : last + 1], level - some, level, level + some)
        passed = [first + place for place in places]
        found += [(a, b) for a, b in pairwise(passed) if _inside(path.inside, a, b)]
    return found


def _inside(inside: NDArray[np.bool_], start: float, stop: float) -> bool:
    """Whether nearly all of a cycle was in contact; a lift out of it would be a touch."""
    return bool(np.mean(inside[int(start) : int(stop) + 1]) > 0.9)


def _passages(depth: Floats, low: float, level: float, high: float) -> list[float]:
    """Places where the depth passes a level inwards, from below ``low`` to above ``high``."""
    far = np.flatnonzero((depth < low) | (depth > high))
    if not far.size:
        return []
    deep = depth[far] > high
    entered = np.flatnonzero(deep[1:] & ~deep[:-1])
    places = []
    for before, after in zip(far[entered], far[entered + 1], strict=True):
        part = depth[before : after + 1]
        last = int(np.flatnonzero(part <= level)[-1])  # noise may pass it back and forth
        fraction = (level - part[last]) / (part[last + 1] - part[last])
        places.append(float(before + last + fraction))
    return places


def put_in(work: Floats, loops: Loops) -> Floats:
    """Work that goes into the material in each loop, J: the sum of its rises of more than 5 %.

    Rises and falls of less than a twentieth of the whole range are noise of a probe that rests.
    """
    places, sums = np.arange(len(work)), []
    for start, stop in zip(loops.starts, loops.stops, strict=True):
        ends = np.interp([start, stop], places, work)
        within = work[int(np.ceil(start)) : int(np.floor(stop)) + 1]
        own = np.concatenate([ends[:1], within, ends[1:]])
        rises = np.diff(_turns(own, SMALLEST_STROKE * float(np.ptp(own))))
        sums.append(float(rises[rises > 0.0].sum()))
    return np.array(sums)


def _turns(values: Floats, least: float) -> list[float]:
    """Values at the turning points between swings larger than ``least``, and at both ends."""
    values = values[np.append(True, np.diff(values) != 0.0)]
    steps = np.diff(values)
    kept = np.flatnonzero((steps[1:] > 0.0) != (steps[:-1] > 0.0)) + 1
    turns = [float(values[0])]
    extreme, rising = float(values[0]), True
    for value in [*values[kept].tolist(), float(values[-1])]:
        if (value > extreme) if rising else (value < extreme):
            extreme = value
        elif abs(value - extreme) > least:
            turns.append(extreme)
            extreme, rising = value, not rising
    return [*turns, extreme]
