"""Velocity from a recorded position, and detection of spikes."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate._core import largest_of as largest_of
from palpate._core import noise_of
from palpate._core import step_of as step_of
from palpate.validation import Floats, number_in

Indices = NDArray[np.intp]

# A longer filter smooths the motion of a probe (docs/methods: B within 0.5 % at 15 ms).
LONGEST_WINDOW = 15e-3  # s
MOST_SAMPLES = 15
FEWEST_SAMPLES = 5
# Largest relative difference of equal steps: rounding to nanoseconds gives 1e-6 at 1 kHz, and as
# much relative error of the velocity.
EVEN = 2e-6
AT_ONCE = 1 << 18  # samples of the windows fitted at once, 2 MB per array
# Of the velocity: a parabola that loses less changes the damping by less than most error bars.
LOST = 0.005


def window_samples(sample_time: float, window: float | None = None) -> int:
    """Return the odd number of samples in a filter window, whose length is in s.

    Default: 15 samples, but at most 15 ms, and at least 5 samples.
    """
    if window is None:
        samples = min(max(int(LONGEST_WINDOW / sample_time), FEWEST_SAMPLES), MOST_SAMPLES)
    else:
        length = number_in("velocity_window", window, 0.0, 1e6, open_low=True)
        samples = max(round(length / sample_time), 3)
    return samples | 1


def slope_weights(samples: int, degree: int) -> Floats:
    """Weights of the slope at the middle of a window of even steps, of a polynomial, per step."""
    middle: Floats = _slopes_in(samples, degree)[samples // 2]
    return middle


@cache
def _slopes_in(samples: int, degree: int) -> Floats:
    """Weights of the slope at each sample of a window, a row each; the middle one is odd."""
    k = np.arange(-(samples // 2), samples // 2 + 1.0)
    powers = np.arange(degree + 1)
    derivative = powers * k[:, None] ** np.maximum(powers - 1, 0)
    weights: Floats = derivative @ np.linalg.pinv(k[:, None] ** powers)
    weights[samples // 2] = 0.5 * (weights[samples // 2] - weights[samples // 2, ::-1])
    return weights


def filter_gain(samples: int, degree: int, turn: float) -> float:
    """Fraction of a sine's velocity that the filter keeps; ``turn`` is its phase per sample."""
    k = np.arange(-(samples // 2), samples // 2 + 1.0)
    return float(slope_weights(samples, degree) @ np.sin(turn * k)) / turn if turn > 0.0 else 1.0


def velocity_of(time: Floats, penetration: Floats, window: float | None = None) -> Floats:
    """Velocity [m/s] by a centred quadratic Savitzky–Golay filter, also for uneven time steps.

    The velocity of a sample is the slope there of the least-squares parabola through the window
    around it. Near an end the window keeps its length and the sample is off its centre. With even
    time steps this is the classic filter. A dropout is excluded, because it would distort the
    velocity of a whole window; its own velocity is interpolated.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, strictly increasing.
    penetration : numpy.ndarray, shape (k,)
        m. Samples with a non-finite value are ignored and have velocity NaN.
    window : float, optional
        Length of the filter, s. Default: see :func:`window_samples`.
    """
    return _filtered(time, penetration, window, finer=False)[0]


def velocity_and_degree(
    time: Floats, penetration: Floats, window: float | None = None
) -> tuple[Floats, int]:
    """Velocity as :func:`velocity_of`, and the degree of the polynomial of which it is the slope.

    Where the default window is so long against the motion that the parabola loses more of the
    velocity than noise would add to the slope of a quartic, it is that slope, of degree 4. A window
    that is passed is that of parabolas.
    """
    return _filtered(time, penetration, window, finer=window is None)


def _filtered(
    time: Floats, penetration: Floats, window: float | None, *, finer: bool
) -> tuple[Floats, int]:
    velocity = np.full(time.shape, np.nan)
    known = np.isfinite(penetration)
    t, x = time[known], penetration[known]
    with np.errstate(over="ignore", invalid="ignore"):  # depths up to ±1e308 m
        if t.size < 3:
            velocity[known] = np.gradient(x, t) if t.size == 2 else 0.0
            return velocity, 2
        kept = ~spiked(x)
        width = min(window_samples(float(np.median(np.diff(t))), window), int(kept.sum()))
        slope, degree = _slope(t[kept], x[kept], width, finer=finer)
        velocity[known] = slope if kept.all() else np.interp(t, t[kept], slope)
    return velocity, degree


def lost_positions(penetration: Floats) -> int:
    """Count the dropouts that :func:`velocity_of` excludes."""
    with np.errstate(over="ignore", invalid="ignore"):
        return int(np.count_nonzero(spiked(penetration[np.isfinite(penetration)])))


def _slope(t: Floats, x: Floats, width: int, *, finer: bool) -> tuple[Floats, int]:
    """Slope at each sample of the polynomial through its window, and the degree.

    With even time steps it is a convolution; the ends are parabolas, fitted separately.
    """
    steps, half = np.diff(t), width // 2
    step = float(steps.mean())
    if not (width % 2 and np.abs(steps - step).max() <= EVEN * step):
        return _local_slope(t, x, width, np.arange(t.size)), 2
    slope, weights = np.empty(t.size), np.arange(-half, half + 1.0)
    inner = np.convolve(x, weights[::-1], "valid") / (step * (weights @ weights))
    if finer and width >= FEWEST_SAMPLES:
        slopes = _slopes_in(width, 4) / step
        quartic = np.convolve(x, slopes[half, ::-1], "valid")
        # White noise of the two slopes' difference is orthogonal to that of the first.
        lost = float(inner @ (quartic - inner))
        noise = noise_of(x) ** 2 * float(slopes[half] @ slopes[half]) * inner.size
        if lost > max(LOST * float(inner @ inner), noise):
            slope[:half] = slopes[:half] @ x[:width]
            slope[half : t.size - half] = quartic
            slope[t.size - half :] = slopes[half + 1 :] @ x[t.size - width :]
            return slope, 4
    slope[half : t.size - half] = inner
    ends = np.r_[:half, t.size - half : t.size]
    slope[ends] = _local_slope(t, x, width, ends)
    return slope, 2


def _local_slope(t: Floats, x: Floats, width: int, at: Indices) -> Floats:
    """Slope at selected samples of the parabola through the window of each."""
    first = np.clip(at - width // 2, 0, t.size - width)
    slope = np.empty(at.size)
    step = max(AT_ONCE // width, 1)
    for k in range(0, at.size, step):
        some = slice(k, k + step)
        slope[some] = _fitted(t, x, first[some, None] + np.arange(width), at[some])
    return slope


def _fitted(t: Floats, x: Floats, inside: Indices, at: Indices) -> Floats:
    """Slope at samples ``at`` of the parabolas through samples ``inside``, by central moments."""
    times = t[inside] - t[at, None]
    unit = np.abs(times).max(axis=1, keepdims=True)
    s = times / unit
    depth = x[inside] - x[at, None]
    mean = s.mean(axis=1, keepdims=True)
    linear = s - mean
    variance = (linear**2).sum(axis=1, keepdims=True)
    # The square, orthogonal to 1 and s; zero if the window has only two distinct times.
    square = s**2 - (s**2).mean(axis=1, keepdims=True)
    skew = (square * linear).sum(axis=1, keepdims=True) / variance
    square = square - skew * linear
    energy = (square**2).sum(axis=1)
    slope = (linear * depth).sum(axis=1) / variance[:, 0]
    curvature = (square * depth).sum(axis=1) / np.where(energy > 0.0, energy, 1.0)
    # At the sample, s = 0, the slope of curvature·(s² − skew·s) is −curvature·skew.
    result: Floats = (slope - curvature * skew[:, 0]) / unit[:, 0]
    return result


# Spikes of a channel, and its resolution.


def spiked(values: Floats) -> NDArray[np.bool_]:
    """Mask of the spikes.

    A spike differs from the median of five by more than max(8 σ, 2 %, 1.5 steps), and by more than
    three times the range of its four neighbours.
    """
    found: NDArray[np.bool_] = spikes_of_rows(values[None])[0]
    return found


def spikes_of_rows(
    values: Floats, *, screened: bool = False, threads: int = 1
) -> NDArray[np.bool_]:
    """Mask of the spikes in each row, among finite samples.

    Parameters
    ----------
    values : numpy.ndarray, shape (k, m)
        One channel, with one recording per row.
    screened : bool
        Whether to skip rows in which no sample differs from its two neighbours as a spike in white
        noise does.
    threads : int
        Number of threads.
    """
    found = np.zeros(values.shape, dtype=np.uint8)
    _core.mark_spikes(values, screened, found, threads)
    return found.view(np.bool_)
