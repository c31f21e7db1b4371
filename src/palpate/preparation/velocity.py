"""Velocity from a recorded position, and detection of spikes."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate._core import largest_of as largest_of
from palpate._core import step_of as step_of
from palpate.contact import VelocityFilter
from palpate.validation import Floats, number_in

Indices = NDArray[np.intp]

# The default window of a parabola hardly smooths the motion of a probe (B within 0.5 % at 15 ms);
# the window of a spline is at most twice as long.
LONGEST_WINDOW = 15e-3  # s
MOST_SAMPLES = 15
FEWEST_SAMPLES = 5
# A shorter run has too few samples for a spline, because a part of them chooses the penalty.
FEWEST_OF_SPLINE = 20
# Largest relative difference of equal steps: rounding to nanoseconds gives 1e-6 at 1 kHz, and as
# much relative error of the velocity.
EVEN = 2e-6
AT_ONCE = 1 << 18  # samples in a batch of windows, 2 MB per array


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


def _slope_weights(samples: int, degree: int) -> Floats:
    """Weights for a polynomial's slope, per step, at the middle of a window of even steps."""
    k = np.arange(-(samples // 2), samples // 2 + 1.0)
    middle: Floats = np.linalg.pinv(k[:, None] ** np.arange(degree + 1))[1]
    return 0.5 * (middle - middle[::-1])


def filter_gain(used: VelocityFilter, turn: "float | Floats") -> Floats:
    """Fraction of a sine's velocity that a filter keeps, at a phase of 0 to π per sample.

    For a spline with even steps h, s² = (2 − 2 cos ωh)² and c = 2 + cos ωh, it is
    3 sin ωh/(ωh c)/(1 + 3 s² λ/(h³ c)): about 1/(1 + λ h ω⁴) (Silverman 1984, Ann. Stat. 12, 898).
    """
    turn = np.maximum(turn, 1e-6)
    if used.penalty is None:
        k = np.arange(-(used.samples // 2), used.samples // 2 + 1.0)
        weights = _slope_weights(used.samples, used.degree)
        gain: Floats = np.sin(np.multiply.outer(turn, k)) @ weights
        return gain / turn
    c = 2.0 + np.cos(turn)
    bend = (2.0 - 2.0 * np.cos(turn)) ** 2
    kept: Floats = 3.0 * np.sin(turn) / (turn * c) / (1.0 + 3.0 * used.penalty * bend / c)
    return kept


@cache
def noise_gain(used: VelocityFilter) -> float:
    """Standard deviation of the velocity due to white noise σ of the position, over σ/h."""
    if used.penalty is None:
        return float(np.linalg.norm(_slope_weights(used.samples, used.degree)))
    turn = (np.arange(2048) + 0.5) * np.pi / 2048
    return float(np.sqrt(np.mean((turn * filter_gain(used, turn)) ** 2)))


def velocity_of(time: Floats, penetration: Floats, window: float | None = None) -> Floats:
    """Velocity [m/s] by :func:`estimate_velocities`, of samples without a break.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, strictly increasing.
    penetration : numpy.ndarray, shape (k,)
        m. Samples with a non-finite value are ignored and have velocity NaN.
    window : float, optional
        Length of a parabola's window, s. Default: a smoothing spline.
    """
    return estimate_velocities(time, penetration, [slice(None)], window)[0]


def estimate_velocities(
    time: Floats, penetration: Floats, runs: Sequence[slice], window: float | None = None
) -> tuple[Floats, VelocityFilter, int]:
    """Velocity [m/s] of each run of samples, the filter, and the number of dropouts excluded.

    By default it is the slope of the cubic smoothing spline, the f with the least
    Σ (xᵢ − f(tᵢ))² + λ ∫ f″² dt (Reinsch 1967, Numerische Mathematik 10, 177), with one λ for all
    runs. λ is chosen from a series of penalties, each four times the previous one: it lies between
    the two neighbours whose velocities differ least, searched from the largest down
    (``choose_spline`` in ``smoothing_spline.hpp``). More smoothing distorts the motion, which
    happens in contact, and less adds noise, white or correlated. If the position was measured at
    every k-th sample only and interpolated linearly between, only the measured samples choose λ.

    For a run of fewer than 20 samples, or if a window is passed, the velocity is the slope of the
    least-squares parabola through the window around the sample, also for uneven time steps; near an
    end the window keeps its length. A dropout is excluded, because it would distort the velocity
    around it; its velocity is interpolated.
    """
    velocity = np.full(time.shape, np.nan)
    samples: list[tuple[Indices, NDArray[np.bool_]]] = []
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # depths up to ±1e308 m
        for run in runs:
            known = np.arange(time.size)[run][np.isfinite(penetration[run])]
            samples.append((known, ~find_spikes(penetration[known])))
        steps = [np.diff(time[known]) for known, _ in samples]
        joined = np.concatenate([*steps, np.empty(0)])
        step = float(np.median(joined)) if joined.size else 1e-3
        width = window_samples(step, window)
        kept = [known[good] for known, good in samples]
        own = [(time[at], penetration[at]) for at in kept if at.size >= FEWEST_OF_SPLINE]
        used = VelocityFilter(width, 2)
        if own and window is None and step > 0.0:
            beats = [_core.find_knots(x) for _, x in own]
            beat = beats[int(np.argmax([t.size for t, _ in own]))][0]
            own = [
                (t[first::beat].copy(), x[first::beat].copy())
                for (t, x), (each, first) in zip(own, beats, strict=True)
                if each == beat
            ]
            sums = np.zeros(2 * _core.SPLINE_PAIRS)
            for t, x in own:
                _core.add_spline_changes(t, x, beat * step, sums)
            longest = _longest(window_samples(beat * step), max(t.size for t, _ in own))
            # With all samples λ is ``beat`` times as large; h³ of the shorter step gives beat³.
            used = _spline_filter(_core.choose_spline(sums, longest) * beat**4)
        for (known, good), at in zip(samples, kept, strict=True):
            slope = _estimate_slope(time[at], penetration[at], step, width, used.penalty)
            velocity[known] = slope if good.all() else np.interp(time[known], time[at], slope)
    return velocity, used, sum(int(np.count_nonzero(~good)) for _, good in samples)


def _estimate_slope(t: Floats, x: Floats, step: float, width: int, penalty: float | None) -> Floats:
    """Slope at each sample of a run without dropouts."""
    if t.size < 3:
        slope: Floats = np.gradient(x, t) if t.size == 2 else np.zeros(t.size)
        return slope
    if penalty is not None and t.size >= FEWEST_OF_SPLINE:
        slope = np.empty(t.size)
        _core.spline_velocity(t, x, step, penalty, slope)
        if np.isfinite(slope).all():
            return slope
    return _slope(t, x, min(width, t.size))


def _spline_filter(penalty: float) -> VelocityFilter:
    window = max(round(_core.SPLINE_WINDOW * penalty**0.25), FEWEST_SAMPLES - 2) | 1
    return VelocityFilter(window, 3, penalty)


def velocities_of_rows(
    time: Floats, penetration: Floats, threads: int
) -> tuple[Floats, list[VelocityFilter]]:
    """Velocity of contacts as rows, each by :func:`estimate_velocities`, and their filters.

    Parameters
    ----------
    time : numpy.ndarray, shape (m,) or (k, m)
        s.
    penetration : numpy.ndarray, shape (k, m)
        m.
    threads : int
        Number of threads.
    """
    count, samples = penetration.shape
    velocity, penalties = np.empty(penetration.shape), np.empty(count)
    whole: NDArray[np.bool_] = np.zeros(count, dtype=bool)  # rows for the compiled loop
    step = float(np.median(np.diff(time))) if time.ndim == 1 and samples > 1 else 0.0
    if step > 0.0 and samples >= FEWEST_OF_SPLINE:
        whole[:] = np.isfinite(penetration).all(axis=1)
        longest = _longest(window_samples(step), samples)
        _core.spline_rows(time, penetration, step, longest, velocity, penalties, threads)
        with np.errstate(over="ignore", invalid="ignore"):
            whole[whole] = ~spikes_of_rows(penetration[whole], threads=threads).any(axis=1)
        whole &= np.isfinite(velocity).all(axis=1)
    filters: list[VelocityFilter] = []
    for row in range(count):
        if whole[row]:
            used = _spline_filter(float(penalties[row]))
        else:
            clock = time if time.ndim == 1 else time[row]
            velocity[row], used, _ = estimate_velocities(clock, penetration[row], [slice(None)])
        filters.append(used)
    return velocity, filters


def _longest(width: int, samples: int) -> float:
    """Window of the smoothest parabola that a spline may equal, in samples."""
    return min(2.0 * width, samples / 4.0)


# The slope of a parabola through a window.


def _slope(t: Floats, x: Floats, width: int) -> Floats:
    """Slope at each sample; with even time steps by a convolution, but for the ends."""
    steps, half = np.diff(t), width // 2
    step = float(steps.mean())
    if not (width % 2 and np.abs(steps - step).max() <= EVEN * step):
        return _local_slope(t, x, width, np.arange(t.size))
    slope, weights = np.empty(t.size), _slope_weights(width, 2)
    slope[half : t.size - half] = np.convolve(x, weights[::-1], "valid") / step
    ends = np.r_[:half, t.size - half : t.size]
    slope[ends] = _local_slope(t, x, width, ends)
    return slope


def _local_slope(t: Floats, x: Floats, width: int, at: Indices) -> Floats:
    """Slope at selected samples of the parabola through the window of each."""
    first = np.clip(at - width // 2, 0, t.size - width)
    slope = np.empty(at.size)
    step = max(AT_ONCE // width, 1)
    for k in range(0, at.size, step):
        some = slice(k, k + step)
        slope[some] = _fit_parabolas(t, x, first[some, None] + np.arange(width), at[some])
    return slope


def _fit_parabolas(t: Floats, x: Floats, inside: Indices, at: Indices) -> Floats:
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


def find_spikes(values: Floats) -> NDArray[np.bool_]:
    """Mask of the spikes.

    A spike differs from the median of five by more than max(8 σ, 2 %, 1.5 steps), one of the two
    samples at an end by twice that, and by more than three times the range of its four neighbours.
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
