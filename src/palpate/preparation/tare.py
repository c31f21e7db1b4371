"""What a tare leaves of the force's offset."""

import math

import numpy as np
from numpy.typing import NDArray

from palpate.validation import Floats

LEAST = 1e-6  # of the largest force: no force sensor is better than 1e-5


def deviation_left(force: Floats, free: NDArray[np.bool_]) -> float:
    """Return the standard deviation of the offset once a mean was taken off, N.

    s² = σ²/N (1 + r)/(1 − r) + δ²,  δ = (Δ/π) exp(−2π²σ²/Δ²)

    the error of a mean of noise whose neighbours correlate by r, and what rounding to steps Δ
    leaves beside it however long it is.

    Parameters
    ----------
    force : numpy.ndarray, shape (k,)
        All of it, N: its smallest step is that of its resolution.
    free : numpy.ndarray of bool, shape (k,)
        The samples that the mean is of, at least one.
    """
    known = force[np.isfinite(force)]
    rest = force[free & np.isfinite(force)]
    rest = rest - rest.mean()
    variance = float(np.mean(rest**2))
    largest = float(np.abs(known).max(initial=0.0))
    if rest.size < 2:
        return max(largest, 1e-30)  # one sample says nothing of its noise
    together = float(np.sum(rest[1:] * rest[:-1]) / max(rest.size * variance, 1e-300))
    correlation = min(max(together, 0.0), 0.999)
    of_mean = variance / rest.size * (1.0 + correlation) / (1.0 - correlation)
    return max(math.hypot(math.sqrt(of_mean), _rounding(known, variance)), LEAST * largest, 1e-30)


def _rounding(force: Floats, variance: float) -> float:
    steps = np.abs(np.diff(force))
    step = float(steps[steps > 0.0].min(initial=np.inf))
    if not math.isfinite(step):
        return 0.0
    before = max(variance / step**2 - 1.0 / 12.0, 0.0)  # what rounding itself adds taken off
    return step / math.pi * math.exp(-2.0 * math.pi**2 * before)
