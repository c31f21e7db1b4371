"""Velocity from a recorded position, on the recording's own time base."""

import numpy as np

from palpate.preparation.spikes import spiked
from palpate.validation import Floats, number_in

# Longer than this and the filter flattens the motion of a probe (methods: B within 0.5 % at 15 ms).
LONGEST_WINDOW = 15e-3  # s
MOST_SAMPLES = 15
FEWEST_SAMPLES = 5


def window_samples(sample_time: float, window: float | None = None) -> int:
    """Odd number of samples in a filter window.

    Unless a window [s] is given: 15 samples, but no longer than 15 ms, and never fewer than 5.
    """
    if window is None:
        samples = min(max(int(LONGEST_WINDOW / sample_time), FEWEST_SAMPLES), MOST_SAMPLES)
    else:
        length = number_in("velocity_window", window, 0.0, 1e6, open_low=True)
        samples = max(round(length / sample_time), 3)
    return samples | 1


def velocity_of(time: Floats, penetration: Floats, window: float | None = None) -> Floats:
    """Velocity [m/s] by a centred quadratic Savitzky–Golay filter on a possibly uneven time base.

    At each sample a parabola is fitted, by least squares, to the samples of the window around it;
    its slope there is the velocity. Near an end the window stays whole and the sample sits off its
    centre. On an even time base this is the classic filter. A lost position is left out, for it
    would spoil the velocity of a whole window; its own is between its neighbours'.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, strictly increasing.
    penetration : numpy.ndarray, shape (k,)
        m; samples that are not finite are left out, and have velocity NaN.
    window : float, optional
        Length of the filter, s; see :func:`window_samples`.
    """
    velocity = np.full(time.shape, np.nan)
    known = np.isfinite(penetration)
    t, x = time[known], penetration[known]
    with np.errstate(over="ignore", invalid="ignore"):  # of absurd depths: ±1e308 m
        if t.size < 3:
            velocity[known] = np.gradient(x, t) if t.size == 2 else 0.0
            return velocity
        kept = ~spiked(x)
        width = min(window_samples(float(np.median(np.diff(t))), window), int(kept.sum()))
        slope = _local_slope(t[kept], x[kept], width)
        velocity[known] = slope if kept.all() else np.interp(t, t[kept], slope)
    return velocity


def lost_positions(penetration: Floats) -> int:
    """Count the samples that :func:`velocity_of` leaves out."""
    with np.errstate(over="ignore", invalid="ignore"):
        return int(np.count_nonzero(spiked(penetration[np.isfinite(penetration)])))


def _local_slope(t: Floats, x: Floats, width: int) -> Floats:
    """Slope at each sample of the parabola through its window, by central moments."""
    first = np.clip(np.arange(t.size) - width // 2, 0, t.size - width)
    inside = first[:, None] + np.arange(width)
    times = t[inside] - t[:, None]
    unit = np.abs(times).max(axis=1, keepdims=True)
    s = times / unit
    depth = x[inside] - x[:, None]
    mean = s.mean(axis=1, keepdims=True)
    linear = s - mean
    variance = (linear**2).sum(axis=1, keepdims=True)
    # The square, made orthogonal to 1 and s; zero where the window has only two distinct times.
    square = s**2 - (s**2).mean(axis=1, keepdims=True)
    skew = (square * linear).sum(axis=1, keepdims=True) / variance
    square = square - skew * linear
    energy = (square**2).sum(axis=1)
    slope = (linear * depth).sum(axis=1) / variance[:, 0]
    curvature = (square * depth).sum(axis=1) / np.where(energy > 0.0, energy, 1.0)
    # At the sample itself, s = 0, the slope of curvature·(s² − skew·s) is −curvature·skew.
    result: Floats = (slope - curvature * skew[:, 0]) / unit[:, 0]
    return result
