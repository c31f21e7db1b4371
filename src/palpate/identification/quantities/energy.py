"""The energy that a material dissipates, and the passivity of the identified law."""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from palpate.digits import percent, rounded
from palpate.force_laws import ForceLaw
from palpate.identification.diagnosis.outcome import UNKNOWN, Quantity, WorkingDepth
from palpate.input.preparation.gate import choose_gate
from palpate.input.preparation.touch import find_touches
from palpate.method.contact import Contact
from palpate.method.rows import median
from palpate.validation import Floats, Indices, Integers, Mask, Plain, finite_or_none, frozen

# Fraction of the depth's range: a crossing counts if the probe goes this far on both sides.
HYSTERESIS = 0.10
# Fraction of the work's range in a loop: smaller rises and falls are noise of a resting probe.
SMALLEST_STROKE = 0.05


@frozen(eq=False)
class Path:
    """A probe's motion in the material, sample by sample.

    Attributes
    ----------
    time, depth, velocity, force : numpy.ndarray, shape (k,)
        s; below the surface, m; m/s; without the sensor's offset, N. All finite.
    segment : numpy.ndarray of int, shape (k,)
        Segment numbers; work is not integrated from one segment to the next.
    inside : numpy.ndarray of bool, shape (k,)
        The samples that the identification took.
    """

    time: Floats
    depth: Floats
    velocity: Floats
    force: Floats
    segment: Integers
    inside: Mask

    def law_force(self, law: ForceLaw) -> Floats:
        """Force of a law along the motion, N."""
        within = np.diff(self.time)[np.diff(self.segment) == 0]
        usual = median(within) if within.size else 1.0
        return law.force_over(self.time, self.depth, self.velocity, usual)

    def work(self, force: Floats) -> Floats:
        """Work done on the material up to each sample, J: ∫ F dx by trapezoids."""
        steps = 0.5 * (force[1:] + force[:-1]) * np.diff(self.depth)
        steps[np.diff(self.segment) != 0] = 0.0
        return np.concatenate([[0.0], np.cumsum(steps)])

    def variance(self, force_noise: float, depth_noise: float) -> Floats:
        """Variance of the measured work up to each sample, J², from white noise of both channels.

        For a closed loop ∫ F dx = −∫ x dF: each force is weighted by half the distance between its
        neighbours, each depth by half the difference of its neighbours' forces.
        """
        total = np.zeros(len(self.depth))
        for values, noise in ((self.depth, force_noise), (self.force, depth_noise)):
            weights = np.zeros(len(values))
            weights[1:-1] = 0.5 * (values[2:] - values[:-2])
            total += np.cumsum((noise * weights) ** 2)
        return total


@frozen(eq=False)
class Loops:
    """Loops of a path, which begin and end at equal depth."""

    kind: str
    starts: Floats
    stops: Floats

    def __len__(self) -> int:
        return len(self.starts)

    def swings(self, values: Floats) -> Floats:
        """Largest minus smallest value in each loop."""
        ends = zip(self.starts.tolist(), self.stops.tolist(), strict=True)
        return np.array([np.ptp(values[int(a) : int(b) + 2]) for a, b in ends])

    def over(self, values: Floats) -> Floats:
        """Increase of a running sum over each loop."""
        places = np.arange(len(values))
        starts, stops = (np.interp(ends, places, values) for ends in (self.starts, self.stops))
        return stops - starts


def find_loops(contact: Contact, path: Path) -> Loops:
    """Return the whole touches, or the whole cycles if touches cover less than half of the contact.

    A touch begins and ends out of contact, within the recording. A cycle goes from one inward
    passage through the median depth to the next: a spring returns all the energy it stores in such
    a loop, however the depth of the strokes varies.
    """
    touches = _touches(contact, path)
    # A relaxing law also takes shallow samples, and a probe at rest on the surface has many of
    # them.
    firm = path.inside & (path.force > choose_gate(contact).make_force)
    counts = np.concatenate([[0], np.cumsum(firm)])
    held = sum(counts[int(b) + 1] - counts[int(a)] for a, b in touches)
    whole = 2 * held >= counts[-1] > 0
    ends = np.array(touches if whole else _cycles(path), dtype=np.float64).reshape(-1, 2)
    return Loops("touch" if whole else "cycle", *ends.T)


def _touches(contact: Contact, path: Path) -> list[tuple[float, float]]:
    """First and last sample of each touch, extended to where the probe leaves the surface."""
    gate = choose_gate(contact)
    found = []
    for part in contact.segments():
        first, last = _segment_ends(path, int(contact.segment[part.start]))
        time = path.time[first : last + 1]
        cores = []
        for touch in find_touches(contact.taken(part), gate):
            start = first + int(np.searchsorted(time, touch.start))
            stop = first + int(np.searchsorted(time, touch.stop, side="right")) - 1
            if path.inside[start : stop + 1].any():  # a rejected spike is not a touch
                cores.append((start, stop))
        # Two touches are separated at the shallowest sample between them.
        limits = [a + int(np.argmin(path.depth[a : b + 1])) for (_, a), (b, _) in pairwise(cores)]
        limits = [first, *limits, last]
        for (start, stop), (low, high) in zip(cores, pairwise(limits), strict=False):
            if first < start and stop < last:
                found.append(_extend_touch(path.depth, start, stop, low, high))
    return found


def _segment_ends(path: Path, segment: int) -> tuple[int, int]:
    """First and last sample of a segment."""
    first = int(np.searchsorted(path.segment, segment))
    return first, int(np.searchsorted(path.segment, segment, side="right")) - 1


def _extend_touch(depth: Floats, start: int, stop: int, low: int, high: int) -> tuple[float, float]:
    before = depth[low : start + 1] <= 0.0
    after = depth[stop : high + 1] <= 0.0
    begin = low + int(np.flatnonzero(before)[-1]) if before.any() else low
    end = stop + int(np.argmax(after)) if after.any() else high
    return begin, end


def _cycles(path: Path) -> list[tuple[float, float]]:
    """Loops between inward passages through the median depth, with some travel on both sides."""
    taken = path.depth[path.inside]
    if taken.size < 2:
        return []
    low, level, high = np.percentile(taken, [10.0, 50.0, 90.0])
    some = HYSTERESIS * (high - low)
    found = []
    for each in np.unique(path.segment):
        first, last = _segment_ends(path, int(each))
        places = _inward_passages(path.depth[first : last + 1], level - some, level, level + some)
        # A cycle is nearly all in contact; one with a lift-off would be a touch.
        found += [
            (first + a, first + b)
            for a, b in pairwise(places)
            if np.mean(path.inside[int(first + a) : int(first + b) + 1]) > 0.9
        ]
    return found


def _inward_passages(depth: Floats, low: float, level: float, high: float) -> list[float]:
    """Fractional sample indices where the depth rises through a level, from ``low`` to ``high``."""
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
    """Energy put into the material in each loop, J: the sum of the work's rises.

    Rises and falls below 5 % of the work's range count as noise of a resting probe.
    """
    places = np.arange(len(work))
    sums = []
    for start, stop in zip(loops.starts, loops.stops, strict=True):
        ends = np.interp([start, stop], places, work)
        within = work[int(np.ceil(start)) : int(np.floor(stop)) + 1]
        own = np.concatenate([ends[:1], within, ends[1:]])
        rises = np.diff(own[turning_points(own, SMALLEST_STROKE * float(np.ptp(own)))])
        sums.append(float(rises[rises > 0.0].sum()))
    return np.array(sums)


def turning_points(values: Floats, least: float) -> Indices:
    """Indices of the turning points between swings larger than ``least``, and of both ends."""
    moved = np.flatnonzero(np.append(True, np.diff(values) != 0.0))
    rising_step = np.diff(values[moved]) > 0.0
    corners = moved[np.flatnonzero(rising_step[1:] != rising_step[:-1]) + 1]
    turns = [0]
    extreme = 0
    rising = True
    for place in [*corners.tolist(), int(moved[-1])]:
        higher = values[place] - values[extreme]
        if higher > 0.0 if rising else higher < 0.0:
            extreme = place
        elif abs(higher) > least:
            turns.append(extreme)
            extreme = place
            rising = not rising
    return np.array([*turns, extreme])


# The energy that a material dissipates in a loop, measured and by the model.

# Relative difference of loss between law and measurement above which palpate reports it.
UNACCOUNTED = 0.10


@frozen(eq=False)
class EnergyLoss:
    """Energy dissipated in the loops of a recording, J.

    Parameters
    ----------
    kind : str
        ``"touch"``: from out of contact to out of contact. ``"cycle"``: from one inward passage
        through the median depth to the next, in lasting contact. ``"none"``: no loop is complete.
    measured : Quantity
        ∮ F dx, mean of the loops. Statistical: white noise of force and penetration. Systematic:
        errors of the penetration that depend on the position, such as an encoder's, and a delay or
        force-sensor drift that the diagnosis reports.
    predicted : Quantity
        The law's ∮ F dx along the same motion, with the relative standard error of its damping,
        which causes all of a law's loss over a closed loop. The systematic uncertainty of the
        damping is not included; it shows as the difference between the two.
    put_in : float
        Energy put in, mean of the loops.
    fraction : Quantity
        measured/put_in.
    start, stop : numpy.ndarray, shape (m,)
        Start and end of each loop, s.
    lost, predicted_lost, put_in_each : numpy.ndarray, shape (m,)
        Measured loss, predicted loss and energy put in, per loop.
    remarks : tuple of str
        Remarks for the reader.

    Examples
    --------
    >>> import palpate
    >>> energy = palpate.identify("examples/recordings/ball.csv").energy
    >>> energy.kind, len(energy.lost)
    ('cycle', 7)
    >>> print(energy.measured)  # J
    0.004817 ± 0.000032
    """

    kind: str
    measured: Quantity
    predicted: Quantity
    put_in: float
    fraction: Quantity
    start: Floats
    stop: Floats
    lost: Floats
    predicted_lost: Floats
    put_in_each: Floats
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        measured, predicted = (q.combined.format("J") for q in (self.measured, self.predicted))
        loops = f"{len(self.lost)} loops of kind {self.kind}"
        return f"EnergyLoss({measured} measured, {predicted} by the model; {loops})"

    def as_dict(self) -> dict[str, Any]:
        """Return the means as plain numbers and text, with None for undefined values."""
        return {
            "kind": self.kind,
            "loops": len(self.lost),
            "measured": self.measured.as_dict(),
            "predicted": self.predicted.as_dict(),
            "put_in": finite_or_none(self.put_in),
            "fraction": self.fraction.as_dict(),
            "remarks": list(self.remarks),
        }


def compute_energy_loss(
    path: Path,
    loops: Loops,
    law: ForceLaw,
    damping: Quantity,
    *,
    force_noise: float,
    depth_noise: float,
    skewed: bool,
    drifting: bool,
) -> EnergyLoss:
    """Return the energy dissipated in the loops of a path.

    Parameters
    ----------
    path, loops : Path, Loops
        The motion with the force without the sensor's offset, and its loops.
    law : ForceLaw
        The identified law.
    damping : Quantity
        The law's damping at working depth, N·s/m: the predicted loss has its relative error.
    force_noise, depth_noise : float
        Standard deviations of white noise, N and m.
    skewed : bool
        Whether force and penetration may have a delay, which biases the measured loss as it does
        the damping.
    drifting : bool
        Whether the force's zero may drift; the ∮ F dx of a drift is not a loss.
    """
    work = path.work(path.force)
    lost = loops.over(work)
    predicted = loops.over(path.work(path.law_force(law)))
    variance = loops.over(path.variance(force_noise, depth_noise))
    each = put_in(work, loops)
    samples = np.arange(len(path.time))
    start, stop = (np.interp(ends, samples, path.time) for ends in (loops.starts, loops.stops))
    arrays = (start, stop, lost, predicted, each)
    if not len(loops):
        text = "the recording has no complete touch or cycle"
        return EnergyLoss("none", UNKNOWN, UNKNOWN, math.nan, UNKNOWN, *arrays, remarks=(text,))
    # Over a closed loop a law's loss is proportional to its damping.
    by_damping = abs(float(predicted.mean()) / damping.value) if damping.value else math.nan
    noise = float(np.sqrt(variance.sum())) / len(loops)
    moved = by_damping * damping.systematic if skewed else 0.0
    # An encoder's error e depends on the position and repeats in every loop: ∮ e dF, e of one sign.
    steps = depth_noise * float(loops.swings(path.force).mean())
    drifted = _drift_work(path, loops, law) if drifting else 0.0
    measured = Quantity(float(lost.mean()), noise, math.hypot(moved, steps, drifted))
    of_law = Quantity(float(predicted.mean()), by_damping * damping.standard_error, 0.0)
    remarks = _remarks(measured, of_law) or _loop_by_loop(loops.kind, lost, predicted, variance)
    whole = float(each.mean())
    fraction = measured.scaled(1.0 / whole) if whole > 0.0 else UNKNOWN
    return EnergyLoss(
        loops.kind,
        measured,
        of_law,
        whole,
        fraction,
        *arrays,
        remarks=tuple(remarks),
    )


def _drift_work(path: Path, loops: Loops, law: ForceLaw) -> float:
    """Return ∮ ḋ t dx, mean of the loops, J, for a zero that drifts at the residual's rate ḋ."""
    inside = path.inside
    time = path.time[inside] - path.time[inside].mean()
    left = path.force[inside] - path.law_force(law)[inside]
    rate = float(time @ left / (time @ time))
    return abs(rate * float(loops.over(path.work(path.time)).mean()))


def _remarks(measured: Quantity, predicted: Quantity) -> list[str]:
    remarks = []
    if abs(measured.value) < 2.0 * measured.standard_error:
        remarks.append("the dissipated energy is not distinguishable from 0")
    elif measured.value < 0.0:
        remarks.append(
            "the material returns more energy than it takes: the force is late or the surface moves"
        )
    errors = (measured.standard_error, predicted.standard_error)
    known = [error for error in errors if math.isfinite(error)]
    off = abs(measured.value - predicted.value)
    if predicted.value < 0.0:
        remarks.append("the law generates energy: its damping is negative")
    elif measured.value > 0.0 and off > max(UNACCOUNTED * measured.value, 2.0 * math.hypot(*known)):
        part = predicted.value / measured.value
        remarks.append(f"the law accounts for {percent(part)} of the dissipated energy")
    return remarks


def _loop_by_loop(kind: str, lost: Floats, predicted: Floats, variance: Floats) -> list[str]:
    """Report a law's loss that is right on average but not in the single loops."""
    size, off, noise = (
        float(np.sqrt(np.mean(square))) for square in (lost**2, (lost - predicted) ** 2, variance)
    )
    if size == 0.0 or off <= max(UNACCOUNTED * size, 2.0 * noise):
        return []
    return [
        f"the law's loss is off by {percent(off / size)} per {kind}: the material's loss depends "
        "differently on speed or depth"
    ]


# Where a law predicts a negative (adhesive) force, which a contact without adhesion cannot have.

# A recorded force is adhesive this many standard deviations of its noise below 0. White noise
# exceeds that in less than one of 10⁵ samples without force.
PULLS = 5.0


@frozen
class Passivity(Plain):
    """Whether the law's force, and the recorded force, become negative in the recorded motion.

    Parameters
    ----------
    fraction : float
        Fraction of the samples below the surface at which the law's force is negative.
    lowest_force : float
        The law's lowest force, N; 0 if it is never negative.
    lowest_depth, lowest_velocity : float
        Depth and velocity of the lowest force, m and m/s; NaN if it is never negative.
    deepest : float
        Largest depth at which the law's force is negative, m; NaN if it never is.
    measured_there : float
        Mean recorded force where the law's is negative, N; NaN if it never is.
    measured_fraction : float
        Fraction of the samples below the surface at which the recorded force is more than five
        standard deviations of its noise below 0: adhesion, or a wrong force offset.
    limit : float
        Velocity at which the law's force at working depth is 0, −F/C, m/s; for a Hunt–Crossley law
        −K/B at any depth. The force is negative on faster withdrawals. NaN without damping.
    fastest_withdrawal : float
        Fastest withdrawal below the surface, m/s, ≥ 0: the 99.9th percentile.

    Examples
    --------
    >>> import palpate
    >>> passivity = palpate.identify("examples/recordings/ball.csv").passivity
    >>> passivity.fraction, round(passivity.limit, 2)  # m/s
    (0.0, -1.0)
    """

    fraction: float
    lowest_force: float
    lowest_depth: float
    lowest_velocity: float
    deepest: float
    measured_there: float
    measured_fraction: float
    limit: float
    fastest_withdrawal: float

    def __repr__(self) -> str:
        share = f"{percent(self.fraction)} of the samples"
        limit = f"{rounded(self.limit, 3)} m/s"
        return f"Passivity(negative force at {share} by the model; limit {limit})"


def check_passivity(
    path: Path,
    law: ForceLaw,
    there: WorkingDepth,
    force_noise: float,
) -> Passivity:
    """Return where a law's force is negative along a path.

    Parameters
    ----------
    path : Path
        The motion, and the force without the sensor's offset.
    law : ForceLaw
        The identified law.
    there : WorkingDepth
        Its numbers at working depth.
    force_noise : float
        Standard deviation of the force's noise, N.
    """
    below = path.depth > 0.0
    depth = path.depth[below]
    velocity = path.velocity[below]
    measured = path.force[below]
    force = path.law_force(law)[below]
    damping = there.damping.value
    size = force.size
    pulls = force < 0.0
    lowest = int(np.argmin(force)) if pulls.any() else None
    return Passivity(
        fraction=float(np.mean(pulls)) if size else math.nan,
        lowest_force=0.0 if lowest is None else float(force[lowest]),
        lowest_depth=math.nan if lowest is None else float(depth[lowest]),
        lowest_velocity=math.nan if lowest is None else float(velocity[lowest]),
        deepest=float(depth[pulls].max()) if pulls.any() else math.nan,
        measured_there=float(measured[pulls].mean()) if pulls.any() else math.nan,
        measured_fraction=float(np.mean(measured < -PULLS * force_noise)) if size else math.nan,
        limit=-there.force.value / damping if damping > 0.0 else math.nan,
        fastest_withdrawal=fast_approach_speed(-velocity),
    )


def fast_approach_speed(velocity: Floats) -> float:
    """99.9th percentile of the positive velocities, m/s (robust to spikes); 0 without any."""
    inwards = velocity[velocity > 0.0]
    return float(np.percentile(inwards, 99.9)) if inwards.size else 0.0
