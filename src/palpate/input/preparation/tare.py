"""The tare: free air in a recording, and the force offset and its drift there."""

import math
from dataclasses import replace

import numpy as np

from palpate.digits import rounded
from palpate.errors import RecordingError
from palpate.findings import Check, Finding
from palpate.input.channels.frames import INVERSE, rotate_to_base
from palpate.input.channels.signals import Signals
from palpate.input.preparation.normal import normal_from_motion
from palpate.input.preparation.resolution import correlation_inflation, noise_of
from palpate.input.preparation.settings import Preparation
from palpate.method.contact import add_step
from palpate.method.rows import count_true, finite_rows, norm, row_norms, typical_step
from palpate.validation import Floats, Integers, Mask, frozen

# Samples out of contact: as many as half a second has, within these limits. On 180 simulated
# episodes at 30 Hz 7 % of the stiffnesses were wrong by more than 10 % with 50, and 2 % with 20.
FREE_TIME = 0.5
FEWEST_FREE = 20
ENOUGH_FREE = 50
BINS = 64  # number of bins of the height
LEAST_FREE = 0.05  # fraction of the range of heights; less is a turning point, no free approach
# Used fraction of the free bins: the lowest may be in light contact if the force grows as a square.
SURE = 0.7
NOISES_OF_A_BIN = 6.0  # σ of a bin's mean, in addition to slow drift
# Allowed slow drift over the range of the force: a sensor drifts less while it warms up.
WANDER = 0.01
DRIFTS = 5.0  # standard errors above which a drift is subtracted
WEIGHT_DIRECTION = (0.0, 0.0, -1.0)  # in the frame of the position
NOTHING = 1e-3  # fraction of the largest force: no sensor is more linear than that


@frozen(eq=False)
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

    free: Mask
    zero: Floats
    drift: float
    times: str

    @property
    def mean(self) -> Floats:
        """Mean offset over the samples in free air, N."""
        mean: Floats = np.atleast_1d(self.zero[self.free].mean(axis=0))
        return mean

    def report(self, made: dict[str, str], findings: list[Finding]) -> None:
        """Record that the offset was subtracted, and report its drift."""
        offsets = ", ".join(rounded(value, 3) for value in self.mean.tolist())
        add_step(made, "force", f"minus {offsets} N, its mean {self.times}")
        if self.drift:
            drift = rounded(self.drift, 3)
            findings.append(
                Check.TARE.finding(
                    f"the force offset drifts by {drift} N: palpate subtracted the drift",
                    "let the sensor warm up",
                )
            )
            add_step(made, "force", f"minus its drift of {drift} N")


def describe_free_air(free: Mask) -> str:
    """Describe when the mean offset was measured."""
    return f"over {count_true(free)} samples in free air"


def find_baseline(
    time: Floats,
    height: Floats,
    force: Floats,
    tare: tuple[float, float] | str,
    source: str,
) -> Baseline:
    """Return the force offset between two times, s, or in detected free air.

    Raises
    ------
    RecordingError
        There is no sample between the times, or no free air.
    """
    if not isinstance(tare, str):
        return baseline_between(time, force, tare, source)
    free = find_free_air(time, height, force)
    if free is None:
        raise never_free(source)
    return estimate_baseline(time, force, free)


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
    free = (time >= start) & (time <= stop) & finite_rows(force)
    if not free.any():
        problem = f"there is no sample between {start:g} s and {stop:g} s for --tare"
        raise RecordingError.of(source, problem)
    zero = np.broadcast_to(force[free].mean(axis=0), force.shape)
    return Baseline(free, zero, 0.0, f"from {start:g} s to {stop:g} s")


def never_free(source: str) -> RecordingError:
    """Return the error for a recording without free air."""
    problem = "palpate found no free air to tare the force; pass an interval without contact"
    return RecordingError.of(source, f"{problem}, such as --tare 0:2")


def find_free_air(time: Floats, height: Floats, force: Floats) -> Mask | None:
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
    step = typical_step(time)
    fewest = min(max(FREE_TIME / step if step > 0.0 else math.inf, FEWEST_FREE), ENOUGH_FREE)
    f = force.reshape(len(force), -1)
    finite = finite_rows(height, f)
    h = height[finite]
    if h.size < fewest:
        return None
    low, high = np.percentile(h, [0.1, 99.9])
    if not high > low:
        return None
    place = np.clip(((high - h) / (high - low) * BINS).astype(np.int64), 0, BINS - 1)
    depth = _count_free_bins(place, f[finite])
    within = place < SURE * depth
    if depth < LEAST_FREE * BINS or depth == BINS or count_true(within) < fewest:
        return None
    free = np.zeros(finite.size, dtype=bool)
    free[finite] = within
    return free


def _count_free_bins(place: Integers, force: Floats) -> int:
    """Return the number of free bins, from the highest down."""
    noise = np.array([noise_of(component) for component in force.T])
    span = np.ptp(np.percentile(force, [1.0, 99.0], axis=0), axis=0).max()
    counts = np.bincount(place, minlength=BINS)
    totals = np.stack([np.bincount(place, component, BINS) for component in force.T])
    above = 0  # samples in the bins above
    sums = np.zeros(len(totals))
    for k, count in enumerate(counts.tolist()):
        if not count:
            continue
        if above:
            allowed = NOISES_OF_A_BIN * noise * np.sqrt(1.0 / count + 1.0 / above) + WANDER * span
            if np.any(np.abs(totals[:, k] / count - sums / above) > allowed):
                return k
        above += count
        sums += totals[:, k]
    return BINS


def estimate_baseline(time: Floats, force: Floats, free: Mask) -> Baseline:
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
    f = force.reshape(len(force), -1)
    free = free & finite_rows(f)
    t = time[free]
    mean = f[free].mean(axis=0)
    changes = f[free] - mean
    zero = np.broadcast_to(mean, f.shape).copy()
    drift = 0.0
    centred = t - t.mean()
    energy = float(centred @ centred)
    long_enough = t.size and np.ptp(t) >= 0.5 * np.ptp(time)
    if energy > 0.0 and long_enough:  # a short interval cannot be extrapolated to the recording
        slope = centred @ changes / energy
        residual = changes - centred[:, None] * slope
        variance = np.maximum((residual**2).mean(axis=0), 1e-300)
        error = np.sqrt(variance / energy * correlation_inflation(residual))
        if np.any(np.abs(slope) > DRIFTS * error):
            zero = zero + (time - t.mean())[:, None] * slope
            drift = norm(slope) * float(np.ptp(time))
    return Baseline(free, zero.reshape(force.shape), drift, describe_free_air(free))


# The tare of a force in space.


def tare_force(
    signals: Signals, settings: Preparation, source: str
) -> tuple[Signals, Baseline | None, list[Finding]]:
    """Subtract the tool's weight and the force offset in free air, then rotate the force.

    Free air is a given interval, or detected. With an orientation the offset is constant in the
    axes of the sensor, in which the weight rotates: both are subtracted there, before the force is
    rotated to the frame of the position.
    """
    weight = settings.tool_weight
    down: Floats | None = None
    if signals.orientation is not None:
        down = rotate_to_base(np.array(WEIGHT_DIRECTION), signals.orientation * INVERSE, source)
    elif weight is not None and signals.force.ndim == signals.depth.ndim == 2:
        down = np.broadcast_to(WEIGHT_DIRECTION, signals.force.shape)
    if down is not None:
        signals = replace(signals, force=signals.force - (weight or 0.0) * down)
    baseline = _baseline_in_space(signals, settings, source)
    findings = list[Finding]()
    if baseline is None:
        findings.append(
            Check.NO_TARE.finding(
                "palpate found no free air and did not tare the force",
                "record a second in free air",
            )
        )
    else:
        signals = replace(signals, force=signals.force - baseline.zero)
        if down is not None and weight:
            _refuse_idle_weight(signals.force, down, weight, source)
    if signals.orientation is not None:
        rotated = rotate_to_base(signals.force, signals.orientation, source)
        signals = replace(signals, force=rotated)
    return signals, baseline, findings


def _baseline_in_space(signals: Signals, settings: Preparation, source: str) -> Baseline | None:
    """Return the force offset in free air, in the sensor's axes; None if there is no free air."""
    time = signals.time
    force = signals.force
    if isinstance(settings.tare, tuple):
        return baseline_between(time, force, settings.tare, source)
    if signals.orientation is None:
        free = _find_free_end(signals, force)
    else:
        # A rotating offset hides the contact axis: iterate once, with the offset subtracted.
        tared = force - np.nanmedian(force, axis=0)
        for _ in range(2):
            free = _find_free_end(signals, rotate_to_base(tared, signals.orientation, source))
            if free is not None:
                tared = force - estimate_baseline(time, force, free).mean
    if free is not None:
        return estimate_baseline(time, force, free)
    if settings.tare == "find":
        raise never_free(source)
    return None


def _refuse_idle_weight(force: Floats, down: Floats, weight: float, source: str) -> None:
    """Reject a weight that is constant in the frame of the force, so that the tare removes it."""
    finite = finite_rows(force, down)
    peak = float(np.nanpercentile(row_norms(force), 99.0))
    reach = float(np.linalg.norm(np.ptp(down[finite], axis=0))) if finite.any() else 0.0
    if weight * reach <= NOTHING * peak:
        from palpate.input.wrench.search import idle_weight

        raise idle_weight(weight, source)


def _find_free_end(signals: Signals, force: Floats) -> Mask | None:
    """Find free air at one end of the motion along the normal, where the force is constant.

    It tries both ends, because the sign of the force is not known yet. The normal is found from
    ``force`` in the frame of the position.
    """
    height = signals.depth
    if height.ndim == 2 and force.ndim == 1:
        height = height @ normal_from_motion(height, force, "").vector
    elif height.ndim == 2:  # the direction in which the force varies most, whatever its offset
        finite = force[finite_rows(force)]
        height = height @ np.linalg.svd(finite - finite.mean(axis=0), full_matrices=False)[2][0]
    ends = (find_free_air(signals.time, side * height, signals.force) for side in (1.0, -1.0))
    return max((end for end in ends if end is not None), key=count_true, default=None)
