"""Free air with its force offset and drift, the surface of the material, and episodes."""

import heapq
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate.contact import run_slices
from palpate.digits import rounded
from palpate.errors import RecordingError
from palpate.estimators.least_squares import Fitted, robust_covariance
from palpate.findings import Check, Finding
from palpate.force_laws import HuntCrossley
from palpate.preparation.resolution import noise_of
from palpate.validation import Floats

# The force in free air: its samples, its mean and its drift.

# Samples out of contact: as many as half a second has, within these limits. On 180 simulated
# episodes at 30 Hz 7 % of the stiffnesses were wrong by more than 10 % with 50, and 2 % with 20.
FREE_TIME, FEWEST_FREE, ENOUGH_FREE = 0.5, 20, 50
BINS = 64  # number of bins of the height
LEAST_FREE = 0.05  # fraction of the range of heights; less is a turning point, no free approach
# Used fraction of the free bins: the lowest may be in light contact if the force grows as a square.
SURE = 0.7
NOISES_OF_A_BIN = 6.0  # σ of a bin's mean, in addition to slow drift
# Allowed slow drift over the range of the force: a sensor drifts less while it warms up.
WANDER = 0.01
DRIFTS = 5.0  # standard errors above which a drift is subtracted


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """The force offset in free air.

    Attributes
    ----------
    free : numpy.ndarray of bool, shape (k,)
        Samples in free air.
    zero : numpy.ndarray, shape (k,) or (k, 3)
        Force offset at each sample, N.
    drift : float
        Change of the offset over the recording, N; 0 if it is not significant.
    times : str
        When the mean was measured, as text.
    """

    free: NDArray[np.bool_]
    zero: Floats
    drift: float
    times: str

    @property
    def mean(self) -> Floats:
        """Mean offset over the samples in free air, N."""
        mean: Floats = np.atleast_1d(self.zero[self.free].mean(axis=0))
        return mean

    def say(self, made: dict[str, str], findings: list[Finding]) -> None:
        """Record that the offset was subtracted, and report its drift."""
        listed = ", ".join(rounded(value, 3) for value in self.mean.tolist())
        add(made, "force", f"minus {listed} N, its mean {self.times}")
        if self.drift:
            drift = rounded(self.drift, 3)
            words = f"the force offset drifts by {drift} N: palpate subtracted the drift"
            findings.append(Check.TARE.finding(words, "let the sensor warm up"))
            add(made, "force", f"minus its drift of {drift} N")


def add(made: dict[str, str], channel: str, words: str) -> None:
    """Add a step to the description of how a channel was obtained."""
    made[channel] = f"{made[channel]}, {words}" if channel in made else words


def baseline_between(
    time: Floats, force: Floats, times: tuple[float, float], source: str
) -> Baseline:
    """Return the mean force between two times, s.

    Raises
    ------
    RecordingError
        There is no sample between them.
    """
    start, stop = times
    free = (time >= start) & (time <= stop)
    free &= np.isfinite(force).reshape(len(free), -1).all(axis=1)
    words = f"from {start:g} s to {stop:g} s"
    if not free.any():
        between = f"there is no sample between {start:g} s and {stop:g} s for --tare"
        raise RecordingError.of(source, between)
    return Baseline(free, np.broadcast_to(force[free].mean(axis=0), force.shape), 0.0, words)


def never_free(source: str) -> RecordingError:
    """Return the error for a recording without free air."""
    words = "palpate found no free air to tare the force; pass an interval without contact"
    return RecordingError.of(source, f"{words}, such as --tare 0:2")


def free_samples(time: Floats, height: Floats, force: Floats) -> NDArray[np.bool_] | None:
    """Find the samples in free air: from the highest down, while the force stays constant.

    The range of heights is divided into bins. From the highest down, a bin is free if its mean
    force equals the mean force of the bins above within the noise.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s.
    height : numpy.ndarray, shape (k,)
        m, increasing away from the material.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.

    Returns
    -------
    numpy.ndarray of bool or None
        None if there is no free air: half a second, but 20 to 50 samples, over 5 % of the heights.
    """
    step = float(np.median(np.diff(time))) if time.size > 1 else math.inf
    fewest = min(max(FREE_TIME / step if step > 0.0 else math.inf, FEWEST_FREE), ENOUGH_FREE)
    f = force[:, None] if force.ndim == 1 else force
    known = np.isfinite(height) & np.isfinite(f).all(axis=1)
    h, f = height[known], f[known]
    if h.size < fewest:
        return None
    low, high = np.percentile(h, [0.1, 99.9])
    if not high > low:
        return None
    place = np.clip(((high - h) / (high - low) * BINS).astype(np.int64), 0, BINS - 1)
    depth = _free_bins(place, f)
    within = place < SURE * depth
    if depth < LEAST_FREE * BINS or depth == BINS or np.count_nonzero(within) < fewest:
        return None
    free = np.zeros(known.size, dtype=bool)
    free[known] = within
    return free


def _free_bins(place: NDArray[np.int64], force: Floats) -> int:
    """The number of free bins, from the highest down."""
    noise = np.array([noise_of(component) for component in force.T])
    span = np.ptp(np.percentile(force, [1.0, 99.0], axis=0), axis=0).max()
    count = np.bincount(place, minlength=BINS)
    total = np.stack([np.bincount(place, component, BINS) for component in force.T])
    seen, sums = 0, np.zeros(len(total))
    for k in range(BINS):
        if not count[k]:
            continue
        if seen:
            allowed = NOISES_OF_A_BIN * noise * np.sqrt(1.0 / count[k] + 1.0 / seen) + WANDER * span
            if np.any(np.abs(total[:, k] / count[k] - sums / seen) > allowed):
                return k
        seen += int(count[k])
        sums += total[:, k]
    return BINS


def estimate_baseline(time: Floats, force: Floats, free: NDArray[np.bool_]) -> Baseline:
    """Return the mean force in free air, with its drift if that is significant.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.
    free : numpy.ndarray of bool, shape (k,)
        Samples in free air.
    """
    f = force[:, None] if force.ndim == 1 else force
    free = free & np.isfinite(f).all(axis=1)
    t, rest = time[free], f[free]
    mean = rest.mean(axis=0)
    zero = np.broadcast_to(mean, f.shape).copy()
    drift = 0.0
    centred = t - t.mean()
    energy = float(centred @ centred)
    spread = np.ptp(t) >= 0.5 * np.ptp(time) if t.size else False
    if energy > 0.0 and spread:  # a short interval cannot be extrapolated to the recording
        slope = centred @ (rest - mean) / energy
        left = rest - mean - centred[:, None] * slope
        error = np.sqrt(np.maximum((left**2).mean(axis=0), 1e-300) / energy * _inflation(left))
        if np.any(np.abs(slope) > DRIFTS * error):
            zero = zero + (time - t.mean())[:, None] * slope
            drift = float(np.linalg.norm(slope) * np.ptp(time))
    words = f"over {np.count_nonzero(free)} samples in free air"
    return Baseline(free, zero[:, 0] if force.ndim == 1 else zero, drift, words)


def _inflation(left: Floats) -> Floats:
    """The factor (1 + r)/(1 − r) on a mean's variance if neighbours correlate by r."""
    energy = np.maximum((left**2).sum(axis=0), 1e-300)
    together = np.clip((left[1:] * left[:-1]).sum(axis=0) / energy, 0.0, 0.999)
    inflation: Floats = (1.0 + together) / (1.0 - together)
    return inflation


# The uncertainty of the offset after a tare.

LEAST_DEVIATION = 1e-6  # over the largest force: no force sensor is more accurate than 1e-5


def deviation_left(force: Floats, free: NDArray[np.bool_]) -> float:
    """Return the standard deviation of the offset after subtracting a mean, N.

    s² = σ²/N (1 + r)/(1 − r) + δ²,  δ = (Δ/π) exp(−2π²σ²/Δ²)

    The first term is the error of the mean of noise whose neighbours correlate by r; the second is
    the error from rounding to steps Δ, which no averaging removes.

    Parameters
    ----------
    force : numpy.ndarray, shape (k,)
        The whole force, N: its smallest step is its resolution.
    free : numpy.ndarray of bool, shape (k,)
        The samples of the mean, at least one.
    """
    known = force[np.isfinite(force)]
    rest = force[free & np.isfinite(force)]
    rest = rest - rest.mean()
    variance = float(np.mean(rest**2))
    largest = float(np.abs(known).max(initial=0.0))
    if rest.size < 2:
        return max(largest, 1e-30)  # one sample does not show the noise
    of_mean = variance / rest.size * float(_inflation(rest))
    left = math.hypot(math.sqrt(of_mean), _rounding(known, variance))
    return max(left, LEAST_DEVIATION * largest, 1e-30)


def _rounding(force: Floats, variance: float) -> float:
    steps = np.abs(np.diff(force))
    step = float(steps[steps > 0.0].min(initial=np.inf))
    if not math.isfinite(step):
        return 0.0
    before = max(variance / step**2 - 1.0 / 12.0, 0.0)  # without the variance of the rounding
    return step / math.pi * math.exp(-2.0 * math.pi**2 * before)


# The surface of the material: where the force begins, or an assumption without free air.

SurfaceRule = Literal["threshold", "baseline", "fit", "estimate"]
NOISES_OF_CONTACT = 6.0  # σ
# Limits of the light branch, which shows the surface, over the peak force. Drag and drift stay
# below 3 %.
LIGHTEST, HEAVIEST = 0.03, 0.4
FEWEST_LIGHT = 8  # samples of the light branch
# Samples in free air for a search of the surface: 20, in a short recording a tenth, at least 8.
MOST_NEEDED, SHARE_NEEDED, LEAST_NEEDED = 20, 0.1, 8
MOST_FITTED = 4000  # samples
# Standard deviations of the baseline rule; a fit that ends beyond does not fit the light branch.
FARTHEST = 4.0
# A flat punch has 1, a sphere 1.5, a cone 2. An exponent far from these compensates for a wrong
# surface; the light branch alone is then more accurate.
LEAST_EXPONENT, MOST_EXPONENT = 0.7, 2.6
GROWTHS = (1.0, 1.5, 2.0)  # exponents of the force: flat punch or foam, sphere, cone


@dataclass(frozen=True, slots=True)
class Surface:
    """The surface of the material.

    Attributes
    ----------
    position : float
        m, in the coordinate that increases into the material.
    deviation : float or None
        Its standard deviation, m; None if it is assumed.
    text : str
        How it was found.
    """

    position: float
    deviation: float | None
    text: str

    @property
    def assumed(self) -> bool:
        """Whether the position is an assumption."""
        return self.deviation is None

    def say(self, made: dict[str, str], findings: list[Finding]) -> None:
        """Record that the penetration is relative to it, and report an assumption."""
        words = f"relative to {rounded(self.position, 6)} m, {self.text}"
        if self.deviation:
            words += f" (± {rounded(self.deviation, 2)} m)"
        add(made, "penetration", words)
        findings += self.assumption()

    def assumption(self) -> list[Finding]:
        """The finding on an assumed surface; none if it was found."""
        if not self.assumed:
            return []
        return [report_assumed_surface("the recording has no free air")]


def report_assumed_surface(
    reason: str,
    remedy: str = "record from before the touch, or pass the surface, such as --surface 0.7mm",
) -> Finding:
    """Report that the surface is assumed where the shallowest sample is."""
    words = f"{reason}, so the surface position is assumed (the shallowest sample)"
    words += ": K, B and n depend on it, stiffness and damping at working depth do not"
    return Check.SURFACE.finding(words, remedy, severity="with-care")


def find_surface(depth: Floats, velocity: Floats, force: Floats, rule: SurfaceRule) -> Surface:
    """Find the surface of the material.

    *threshold*: the depth at which the force exceeds max(6 σ, 3 % of its peak) on the way in. It is
    too deep by the penetration at which the material gives this force. *baseline*: the depth at
    which a line through the light branch, F^(1/n) over depth, reaches zero for n = 1.5; the results
    for n = 1 and 2 give its uncertainty. *fit*: joint least squares of a Hunt–Crossley law, an
    offset and the surface, started at the baseline's surface. Without free air the surface is
    assumed at the shallowest depth.

    Parameters
    ----------
    depth : numpy.ndarray, shape (k,)
        m, increasing into the material, from an arbitrary origin.
    velocity : numpy.ndarray, shape (k,)
        m/s, positive while penetrating.
    force : numpy.ndarray, shape (k,)
        N, compression positive, tared.
    rule : str
        ``"threshold"``, ``"baseline"``, ``"fit"``, or ``"estimate"``, which is as ``"fit"`` here.
    """
    known = np.isfinite(depth) & np.isfinite(force) & np.isfinite(velocity)
    x, v, f = depth[known], velocity[known], force[known]
    peak = float(np.percentile(f, 99.0)) if f.size else 0.0
    least = max(NOISES_OF_CONTACT * noise_of(f), LIGHTEST * peak)
    free = f < least
    fewest = min(MOST_NEEDED, max(SHARE_NEEDED * x.size, LEAST_NEEDED))
    if np.count_nonzero(free) < fewest or not least < HEAVIEST * peak:
        return _assume_surface(x)
    if rule == "threshold":
        return _crossings(x, f, least) or _assume_surface(x)
    going_in = (v > 0.0) & find_presses(f, least, peak)
    found = _departure(x[going_in], f[going_in], least, peak)
    if found is None or rule == "baseline":
        return found or _assume_surface(x)
    return _fit_surface(x, v, f, found) or found


def _assume_surface(x: Floats) -> Surface:
    words = "the shallowest sample: there is no free air"
    return Surface(float(x.min()) if x.size else 0.0, None, words)


def _crossings(x: Floats, f: Floats, least: float) -> Surface | None:
    """The median depth at which the force exceeds a threshold on the way in."""
    over = f >= least
    entered = np.flatnonzero(over[1:] & ~over[:-1] & (x[1:] >= x[:-1]))
    if not entered.size:
        return None
    fraction = (least - f[entered]) / np.maximum(f[entered + 1] - f[entered], 1e-300)
    at = x[entered] + np.clip(fraction, 0.0, 1.0) * (x[entered + 1] - x[entered])
    position = float(np.median(at))
    # The penetration at this force, from F ∝ x^1.5 through the deepest sample.
    deepest, peak = float(np.percentile(x, 99.0)), float(np.percentile(f, 99.0))
    part = (least / peak) ** (1.0 / 1.5) if peak > least else 0.0
    late = max(deepest - position, 0.0) * part / max(1.0 - part, 1e-3)
    scatter = float(np.std(at)) / math.sqrt(at.size)
    return Surface(position, math.hypot(scatter, late), f"where the force exceeds {least:.2g} N")


def find_presses(f: Floats, least: float, peak: float) -> NDArray[np.bool_]:
    """Find the runs of a force above a least one that reach 40 % of its peak."""
    pressed = f > least
    mask = np.zeros(f.size, dtype=bool)
    for run in run_slices(pressed):
        mask[run] = pressed[run.start] and f[run].max() >= HEAVIEST * peak
    return mask


def _departure(x: Floats, f: Floats, least: float, peak: float) -> Surface | None:
    """The depth at which F^(1/n) over depth reaches zero."""
    light = (f > least) & (f < HEAVIEST * peak)
    if np.count_nonzero(light) < FEWEST_LIGHT:
        return None
    found = [_intercept(x[light], f[light] ** (1.0 / n)) for n in GROWTHS]
    position, error = found[1]
    others = [place for place, _ in (found[0], found[2])]
    if not all(math.isfinite(each) for each in (position, error, *others)):
        return None
    # The standard deviation of a uniform distribution between the two others.
    model = abs(others[0] - others[1]) / math.sqrt(12.0)
    words = "where the force departs from that in free air"
    return Surface(position, math.hypot(error, model), words)


def _intercept(x: Floats, root: Floats) -> tuple[float, float]:
    """The depth at which a line through the root of the force is zero, and its error.

    Samples far from a line of median slope (Theil 1950, Sen 1968) are excluded first.
    """
    order, half = np.argsort(x), x.size // 2
    low, high = order[:half], order[-half:]
    slope = float(np.median((root[high] - root[low]) / np.maximum(x[high] - x[low], 1e-300)))
    left = root - slope * x
    away = np.abs(left - np.median(left))
    near = away <= FARTHEST * 1.4826 * np.median(away)
    x, root = x[near], root[near]
    centre, mean = float(x.mean()), float(root.mean())
    dx, dr = x - centre, root - mean
    # Regress the root on depth: the noise of the position is small.
    slope = float(dx @ dr) / max(float(dx @ dx), 1e-300)
    if slope <= 0.0:
        return math.nan, math.nan
    left = dr - slope * dx
    zero = np.zeros(left.size, dtype=bool)
    of_mean = deviation_left(left, ~zero) if left.size > 1 else math.inf
    lever = (mean / slope) ** 2 / max(float(dx @ dx) / x.size, 1e-300)
    return centre - mean / slope, of_mean / slope * math.sqrt(1.0 + lever)


def _fit_surface(x: Floats, v: Floats, f: Floats, start: Surface) -> Surface | None:
    """Least squares of law, offset and surface; None if it ends far from its start."""
    depth = float(np.percentile(x, 99.0)) - start.position
    speed, size = float(np.sqrt(np.mean(v**2))), float(np.percentile(f, 99.0))
    if not (depth > 0.0 and speed > 0.0 and size > 0.0 and start.deviation):
        return None
    near = x > start.position - depth  # more free air is not needed
    kept = slice(None, None, int(np.count_nonzero(near)) // MOST_FITTED + 1)
    samples = np.array([(x[near] - start.position) / depth, v[near] / speed, f[near]])[:, kept]
    found = fit_surface_position(samples, np.array([(size, 0.0, n, 0.0, 0.0) for n in GROWTHS]))
    away = float(found.parameters[4]) * depth
    error = math.sqrt(robust_covariance(found.jacobian, found.residual)[-1, -1]) * depth
    near_start = abs(away) <= FARTHEST * start.deviation and 0.0 < error < depth
    if not near_start or not LEAST_EXPONENT <= found.parameters[2] <= MOST_EXPONENT:
        return None
    words = "by joint least squares of law and surface"
    return Surface(start.position + away, error, words)


# Joint least squares of a Hunt–Crossley law, an offset and the surface.

EXPONENT_RANGE = (0.2, 6.0)  # wider than for any material; keeps powers finite
SURFACE_RANGE = (-3.0, 0.9)  # working depths


def fit_surface_position(
    samples: Floats, starts: Floats, *, exponent_fixed: bool = False
) -> Fitted:
    """Fit (k, c, n, F₀, d) by least squares from several starts; return the best fit.

    Parameters
    ----------
    samples : numpy.ndarray, shape (3, samples)
        Depth over the working depth, velocity over its rms, and force [N], in contact and free
        approach.
    starts : numpy.ndarray, shape (starts, 5)
        Starting values: N, N, 1, N, and working depths.
    exponent_fixed : bool
        Whether n keeps its starting value.
    """
    exponents = (starts[0, 2],) * 2 if exponent_fixed else EXPONENT_RANGE
    found = _core.fit_samples(np.ascontiguousarray(samples), starts, exponents, SURFACE_RANGE)
    parameters = np.array(found)
    law, (x, v, force) = HuntCrossley.from_parameters(found[:3]), samples
    below = x - parameters[4]
    touching = (below > 0.0)[:, None]
    below = np.where(below > 0.0, below, 1.0)
    rows = [*law.parameter_gradient(below, v).T, -law.penetration_gradient(below, v)]
    jacobian = np.insert(np.array(rows).T * touching, 3, 1.0, axis=1)
    jacobian[:, 2] *= not exponent_fixed
    residual = force - jacobian[:, [0, 1, 3]] @ parameters[[0, 1, 3]]
    return Fitted(parameters, residual, jacobian)


# Episodes of a travelling probe: intervals in which it stays at one place on the material.

RADIUS = 2e-3  # m; as in published recordings that were cut by hand
SHORTEST = 1.0  # s
FEWEST_OF_AN_EPISODE = 60  # samples
STRIDES = 4000  # most starts to try; in a longer recording, every k-th sample


@dataclass(frozen=True, slots=True, eq=False)
class Stay:
    """An interval in which the probe stays at one place.

    Attributes
    ----------
    start, stop : int
        Range of its samples.
    place : numpy.ndarray, shape (3,)
        Median position, m.
    """

    start: int
    stop: int
    place: Floats


def find_episodes(time: Floats, position: Floats, force: Floats, radius: float) -> list[Stay]:
    """Divide a recording into episodes, the longest first, and return them in order of time.

    In an episode the position stays within ``radius`` of its median, across the contact normal of
    the episode: the mean direction of its forces, weighted by their size.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, increasing.
    position, force : numpy.ndarray, shape (k, 3)
        m, and N in the same frame.
    radius : float
        m. An episode lasts at least a second and has at least 60 samples.
    """
    path = _Path(time, position, force, radius)
    waiting = [(-(stop - start), start, stop) for start, stop in path.longest()]
    heapq.heapify(waiting)
    taken = np.zeros(time.size, dtype=bool)
    found = []
    while waiting:
        _, start, stop = heapq.heappop(waiting)
        free = _rest(taken, start, stop)
        if free is None or not path.long_enough(*free):
            continue
        if free != (start, stop):
            heapq.heappush(waiting, (-(free[1] - free[0]), *free))
            continue
        taken[start:stop] = True
        found.append(Stay(start, stop, path.extent(start, stop)[0]))
    return sorted(found, key=lambda episode: episode.start)


def _rest(taken: NDArray[np.bool_], start: int, stop: int) -> tuple[int, int] | None:
    """The longest part of an interval without taken samples."""
    free = [run for run in run_slices(taken[start:stop]) if not taken[start + run.start]]
    longest = max(free, key=lambda run: run.stop - run.start, default=None)
    return None if longest is None else (start + longest.start, start + longest.stop)


class _Path:
    def __init__(self, time: Floats, position: Floats, force: Floats, radius: float) -> None:
        self.time, self.position, self.radius = time, position, radius
        weighted = np.nan_to_num(force) * np.linalg.norm(np.nan_to_num(force), axis=1)[:, None]
        self.weighted = np.concatenate([np.zeros((1, 3)), np.cumsum(weighted, axis=0)])

    def long_enough(self, start: int, stop: int) -> bool:
        """Whether an interval is long enough for an episode."""
        duration = float(self.time[stop - 1] - self.time[start])
        return stop - start >= FEWEST_OF_AN_EPISODE and duration >= SHORTEST

    def extent(self, start: int, stop: int) -> tuple[Floats, float]:
        """The median position of an interval, and the largest distance from it across n."""
        inside = self.position[start:stop]
        total = self.weighted[stop] - self.weighted[start]
        length = float(np.linalg.norm(total))
        # Faster than nanmedian, and equal without NaN.
        median = np.nanmedian if np.isnan(inside).any() else np.median
        place: Floats = median(inside, axis=0)
        away = inside - place
        if length > 0.0:
            n = total / length
            away = away - np.outer(away @ n, n)
        return place, float(np.sqrt(np.nanmax((away**2).sum(axis=1), initial=0.0)))

    def longest(self) -> list[tuple[int, int]]:
        """The longest interval from each start that stays within the radius."""
        size = self.time.size
        stride = max(size // STRIDES, 1)
        a_second = int(np.searchsorted(self.time, self.time[0] + SHORTEST))
        shortest = max(FEWEST_OF_AN_EPISODE, a_second)
        found = []
        stop = 0
        for start in range(0, size, stride):
            stop = max(stop, min(start + shortest, size))
            if not self._within(start, stop):
                stop = start
                continue
            stop = self._reach(start, stop, stride)
            found.append((start, stop))
        return [each for each in found if self.long_enough(*each)]

    def _reach(self, start: int, stop: int, stride: int) -> int:
        """Extend an interval while it stays within the radius, in steps that double, then halve."""
        size, step = self.time.size, stride
        while stop < size and self._within(start, min(stop + step, size)):
            stop = min(stop + step, size)
            step *= 2
        while step > stride:
            step //= 2
            if stop + step <= size and self._within(start, stop + step):
                stop += step
        return stop

    def _within(self, start: int, stop: int) -> bool:
        return self.extent(start, stop)[1] <= self.radius


def travel(position: Floats, force: Floats) -> float:
    """Return the travel of a probe across the contact normal while in contact, m.

    It is the radius around the median position; contact means a force above a tenth of the largest.
    """
    size = np.linalg.norm(np.nan_to_num(force), axis=1)
    touching = size > 0.1 * float(np.percentile(size, 99.0)) if size.size else size > 0.0
    if np.count_nonzero(touching) < 2:
        return 0.0
    path = _Path(np.zeros(touching.sum()), position[touching], force[touching], math.inf)
    return path.extent(0, int(np.count_nonzero(touching)))[1]
