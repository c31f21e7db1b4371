"""The force out of contact: where it is felt, its mean and its drift."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.preparation.suggestions import noise_of
from palpate.validation import Floats

FEWEST = 50  # samples out of contact
BINS = 64  # of the height
LEAST = 0.05  # of the height's range: less is no free approach, but a turning point
# Of the bins: the lowest of them may be lightly in contact, where that grows as a square.
SURE = 0.7
NOISES = 6.0  # σ of a bin's mean; and what the force may wander by slow drift comes on top
# Of the force's range. A sensor's zero wanders while it warms up; a contact is more than that.
WANDER = 0.01
DRIFTS = 5.0  # standard errors, beyond which a slope in time is taken off


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """The force out of contact.

    Attributes
    ----------
    free : numpy.ndarray of bool, shape (k,)
        Samples out of contact.
    zero : numpy.ndarray, shape (k,) or (k, 3)
        What the sensor shows without a contact, N, at each sample.
    drift : float
        How far that goes over the recording, N; 0 where it is not significant.
    """

    free: NDArray[np.bool_]
    zero: Floats
    drift: float

    @property
    def mean(self) -> Floats:
        """Its mean over the samples out of contact, N."""
        mean: Floats = np.atleast_1d(self.zero[self.free].mean(axis=0))
        return mean


def free_samples(height: Floats, force: Floats) -> NDArray[np.bool_] | None:
    """Find the samples out of contact: the highest ones, as far down as the force stays as it is.

    The range of heights is cut into bins; from the highest down they are free while the mean force
    of each stays within the noise of that of those above it.

    Parameters
    ----------
    height : numpy.ndarray, shape (k,)
        m, larger farther from the material.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.

    Returns
    -------
    numpy.ndarray of bool or None
        None where the probe is never seen out of contact: 50 samples, over 5 % of the heights.
    """
    f = force[:, None] if force.ndim == 1 else force
    known = np.isfinite(height) & np.isfinite(f).all(axis=1)
    h, f = height[known], f[known]
    if h.size < FEWEST:
        return None
    low, high = np.percentile(h, [0.1, 99.9])
    if not high > low:
        return None
    place = np.clip(((high - h) / (high - low) * BINS).astype(np.int64), 0, BINS - 1)
    depth = _free_bins(place, f)
    within = place < SURE * depth
    if depth < LEAST * BINS or depth == BINS or np.count_nonzero(within) < FEWEST:
        return None
    free = np.zeros(known.size, dtype=bool)
    free[known] = within
    return free


def _free_bins(place: NDArray[np.int64], force: Floats) -> int:
    """How many bins from the highest down are free."""
    noise = np.array([noise_of(component) for component in force.T])
    span = np.ptp(np.percentile(force, [1.0, 99.0], axis=0), axis=0).max()
    count = np.bincount(place, minlength=BINS)
    total = np.stack([np.bincount(place, component, BINS) for component in force.T])
    seen, sums = 0, np.zeros(len(total))
    for k in range(BINS):
        if not count[k]:
            continue
        if seen:
            allowed = NOISES * noise * np.sqrt(1.0 / count[k] + 1.0 / seen) + WANDER * span
            if np.any(np.abs(total[:, k] / count[k] - sums / seen) > allowed):
                return k
        seen += int(count[k])
        sums += total[:, k]
    return BINS


def baseline_of(time: Floats, force: Floats, free: NDArray[np.bool_]) -> Baseline:
    """Return the mean of the force out of contact; with a slope in time, where that is significant.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.
    free : numpy.ndarray of bool, shape (k,)
        Samples out of contact.
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
    if energy > 0.0 and spread:  # a short time out of contact says nothing of all the rest
        slope = centred @ (rest - mean) / energy
        left = rest - mean - centred[:, None] * slope
        error = np.sqrt(np.maximum((left**2).mean(axis=0), 1e-300) / energy * _inflation(left))
        if np.any(np.abs(slope) > DRIFTS * error):
            zero = zero + (time - t.mean())[:, None] * slope
            drift = float(np.linalg.norm(slope) * np.ptp(time))
    return Baseline(free, zero[:, 0] if force.ndim == 1 else zero, drift)


def _inflation(left: Floats) -> Floats:
    """By how much neighbours that correlate by r widen a mean's variance: (1 + r)/(1 − r)."""
    energy = np.maximum((left**2).sum(axis=0), 1e-300)
    together = np.clip((left[1:] * left[:-1]).sum(axis=0) / energy, 0.0, 0.999)
    inflation: Floats = (1.0 + together) / (1.0 - together)
    return inflation
