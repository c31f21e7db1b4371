"""Velocity from a recorded position; and the single samples that leave their neighbours."""

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate._core import largest_of as largest_of
from palpate._core import step_of as step_of
from palpate.validation import Floats, number_in

Indices = NDArray[np.intp]

# Longer than this and the filter flattens the motion of a probe (methods: B within 0.5 % at 15 ms).
LONGEST_WINDOW = 15e-3  # s
MOST_SAMPLES = 15
FEWEST_SAMPLES = 5
# Steps that differ by less of a step are even: whole nanoseconds of a 1 kHz clock do by 1e-6, and
# the velocity by as much of itself.
EVEN = 2e-6
AT_ONCE = 1 << 18  # samples in windows that are fitted together, 2 MB an array


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
        slope = _slope(t[kept], x[kept], width)
        velocity[known] = slope if kept.all() else np.interp(t, t[kept], slope)
    return velocity


def lost_positions(penetration: Floats) -> int:
    """Count the samples that :func:`velocity_of` leaves out."""
    with np.errstate(over="ignore", invalid="ignore"):
        return int(np.count_nonzero(spiked(penetration[np.isfinite(penetration)])))


def _slope(t: Floats, x: Floats, width: int) -> Floats:
    """Slope at each sample of the parabola through its window.

    On an even clock Σ k x_k / (T Σ k²), which has no part of a curvature; the ends by fits of their
    own.
    """
    steps, half = np.diff(t), width // 2
    step = float(steps.mean())
    if not (width % 2 and np.abs(steps - step).max() <= EVEN * step):
        return _local_slope(t, x, width, np.arange(t.size))
    weights = np.arange(-half, half + 1.0)
    slope = np.empty(t.size)
    inner = np.convolve(x, weights[::-1], "valid")
    slope[half : t.size - half] = inner / (step * (weights @ weights))
    ends = np.r_[:half, t.size - half : t.size]
    slope[ends] = _local_slope(t, x, width, ends)
    return slope


def _local_slope(t: Floats, x: Floats, width: int, at: Indices) -> Floats:
    """Slope at some samples of the parabola through the window of each."""
    first = np.clip(at - width // 2, 0, t.size - width)
    slope = np.empty(at.size)
    step = max(AT_ONCE // width, 1)
    for k in range(0, at.size, step):
        some = slice(k, k + step)
        slope[some] = _fitted(t, x, first[some, None] + np.arange(width), at[some])
    return slope


def _fitted(t: Floats, x: Floats, inside: Indices, at: Indices) -> Floats:
    """Slope at some samples of the parabolas through others, by central moments."""
    times = t[inside] - t[at, None]
    unit = np.abs(times).max(axis=1, keepdims=True)
    s = times / unit
    depth = x[inside] - x[at, None]
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


# Single samples of a channel, and its resolution.


def spiked(values: Floats) -> NDArray[np.bool_]:
    """Say of each sample whether it is a spike.

    Beyond max(8 σ, 2 %, 1.5 steps) of the median of five, and three times farther from it than its
    four neighbours lie from each other.
    """
    found: NDArray[np.bool_] = spikes_of_rows(values[None])[0]
    return found


def spikes_of_rows(
    values: Floats, *, screened: bool = False, threads: int = 1
) -> NDArray[np.bool_]:
    """Say which samples of each row are spikes, among those that are finite.

    Parameters
    ----------
    values : numpy.ndarray, shape (k, m)
        A channel, a row a recording.
    screened : bool
        Whether it is enough to look at rows in which a sample leaves its two neighbours as spikes
        do from white noise.
    threads : int
        That share the rows.
    """
    found = np.zeros(values.shape, dtype=np.uint8)
    _core.mark_spikes(values, screened, found, threads)
    return found.view(np.bool_)
