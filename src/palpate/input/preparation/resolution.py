"""How finely a recording resolves force and penetration: noise, dead band, steps, means."""

import math

import numpy as np

import palpate._core as _core
from palpate._core import noise_of as noise_of
from palpate.method.contact import Contact
from palpate.method.rows import count_true, finite_rows
from palpate.validation import Floats, Mask

# samples at the value of the dead band; of these in contact
FEWEST_RESTING = 20
FEWEST_PRESSED = 3
ABOVE_NOISE = 4.0  # σ or steps, from that value to the next


def find_dead_band(contact: Contact) -> float:
    """Return the least force above a dead band, N; 0 without one.

    In a dead band the most common force is the least, and no sample lies within four σ and steps
    above it. The probe is in contact there, but no deeper than at twice that force: otherwise the
    sensor failed.
    """
    finite = finite_rows(contact.force, contact.penetration)
    force = contact.force[finite]
    depth = contact.penetration[finite]
    if count_true(force[1:] == force[:-1]) < FEWEST_RESTING:
        return 0.0
    values, counts = np.unique(force, return_counts=True)
    most = int(np.argmax(counts))
    if counts[most] < FEWEST_RESTING or most + 1 == values.size:
        return 0.0
    least = float(values[most + 1])
    band = least - float(values[most])
    if band <= ABOVE_NOISE * max(noise_of(force), _core.step_of(force)):
        return 0.0
    sensed = np.flatnonzero(force >= least)
    light = sensed[force[sensed] <= least + band]
    if light.size < FEWEST_PRESSED:
        light = sensed[np.argsort(force[sensed])[:FEWEST_PRESSED]]
    pressed = depth[(force == values[most]) & (depth > 0.0)]
    dead = pressed.size >= FEWEST_PRESSED and pressed.max() <= depth[light].max()
    return least if dead else 0.0


def suggest_surface_deviation(contact: Contact) -> float | None:
    """Return the uncertainty of the surface, m: twice the noise and rounding of the penetration.

    None if the penetration has neither.
    """
    [deviation] = estimate_resolutions(contact.penetration[None]).tolist()
    return None if math.isnan(deviation) else deviation


def estimate_resolutions(penetration: Floats, *, threads: int = 1) -> Floats:
    """Return twice the noise and rounding of each row, m; NaN if it has neither.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m.
    threads : int
        Number of threads.
    """
    resolutions = np.empty(len(penetration))
    _core.resolutions(penetration, resolutions, threads)
    return resolutions


# The standard error of a mean of noise that is correlated and rounded.

LEAST_DEVIATION = 1e-6  # over the largest force: no force sensor is more accurate than 1e-5


def deviation_of_mean(force: Floats, free: Mask) -> float:
    """Return the standard deviation of the offset after subtracting a mean, N.

    s² = σ²/N (1 + r)/(1 − r) + δ²,  δ = (Δ/π) exp(−2π²σ²/Δ²)

    It is the ``tare_deviation`` of a contact whose force you tare yourself:
    ``deviation_of_mean(force, time < 2.0)``.

    The first term is the error of the mean of noise whose neighbours correlate by r; the second is
    the error from rounding to steps Δ, which no averaging removes.

    Parameters
    ----------
    force : numpy.ndarray, shape (k,)
        The whole force, N: its smallest step is its resolution.
    free : numpy.ndarray of bool, shape (k,)
        The samples of the mean, at least one.

    Returns
    -------
    float
        Standard deviation s, N.

    Examples
    --------
    >>> import palpate
    >>> contact = palpate.prepare("examples/recordings/ball.csv")
    >>> free = contact.time < 1.9
    >>> round(palpate.deviation_of_mean(contact.force, free), 4)  # N
    0.0018
    """
    finite = force[np.isfinite(force)]
    largest = float(np.abs(finite).max(initial=0.0))
    averaged = force[free & np.isfinite(force)]
    if averaged.size < 2:
        return max(largest, 1e-30)  # one sample does not show the noise
    changes = averaged - averaged.mean()
    variance = float(np.mean(changes**2))
    of_mean = variance / changes.size * float(correlation_inflation(changes))
    deviation = math.hypot(math.sqrt(of_mean), _rounding(finite, variance))
    return max(deviation, LEAST_DEVIATION * largest, 1e-30)


def correlation_inflation(changes: Floats) -> Floats:
    """Return the factor (1 + r)/(1 − r) on a mean's variance if neighbours correlate by r."""
    energy = np.maximum((changes**2).sum(axis=0), 1e-300)
    correlation = np.clip((changes[1:] * changes[:-1]).sum(axis=0) / energy, 0.0, 0.999)
    inflation: Floats = (1.0 + correlation) / (1.0 - correlation)
    return inflation


def _rounding(force: Floats, variance: float) -> float:
    """Return the error of a mean by rounding, N."""
    steps = np.abs(np.diff(force))
    step = float(steps[steps > 0.0].min(initial=np.inf))
    if not math.isfinite(step):
        return 0.0
    unrounded = max(variance / step**2 - 1.0 / 12.0, 0.0)
    return step / math.pi * math.exp(-2.0 * math.pi**2 * unrounded)
