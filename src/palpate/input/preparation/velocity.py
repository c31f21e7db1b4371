"""Velocity from a recorded position, the force of inertia, and detection of spikes."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

import palpate._core as _core
from palpate._core import largest_of as largest_of
from palpate._core import step_of as step_of
from palpate.digits import format_quantity
from palpate.method.contact import Contact, VelocityFilter
from palpate.method.rows import median, norm, rms, typical_step
from palpate.validation import Floats, Indices, Mask, number_in

# The default window of a parabola hardly smooths the motion of a probe (B within 0.5 % at 15 ms);
# the window of a spline is at most twice as long.
LONGEST_WINDOW = 15e-3  # s
MOST_SAMPLES = 15
FEWEST_SAMPLES = 5
# A shorter run has too few samples for a spline, because a part of them chooses the penalty.
FEWEST_OF_SPLINE = 20
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
    gain = 3.0 * np.sin(turn) / (turn * c) / (1.0 + 3.0 * used.penalty * bend / c)
    return gain


@cache
def noise_gain(used: VelocityFilter) -> float:
    """Standard deviation of the velocity due to white noise σ of the position, over σ/h."""
    if used.penalty is None:
        return norm(_slope_weights(used.samples, used.degree))
    turn = (np.arange(2048) + 0.5) * np.pi / 2048
    return rms(turn * filter_gain(used, turn))


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

    Returns
    -------
    numpy.ndarray, shape (k,)
        Velocity, m/s, positive while penetrating.

    Examples
    --------
    >>> import numpy as np
    >>> from palpate.input.preparation.velocity import velocity_of
    >>> time = np.arange(0.0, 1.0, 0.001)
    >>> velocity_of(time, 1e-3 * np.sin(3.0 * time))[[0, 500]].round(4).tolist()
    [0.003, 0.0002]
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
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # depths up to ±1e308 m
        finite = [np.arange(time.size)[run][np.isfinite(penetration[run])] for run in runs]
        valid = [indices[~find_spikes(penetration[indices])] for indices in finite]
        steps = [np.diff(time[indices]) for indices in finite]
        joined = np.concatenate([*steps, np.empty(0)])
        step = median(joined) if joined.size else 1e-3
        width = window_samples(step, window)
        velocity_filter = VelocityFilter(width, 2)
        long_runs = [indices for indices in valid if indices.size >= FEWEST_OF_SPLINE]
        if long_runs and window is None and step > 0.0:
            motions = [(time[indices], penetration[indices]) for indices in long_runs]
            velocity_filter = _choose_spline(motions, step)
        for indices, kept_indices in zip(finite, valid, strict=True):
            t = time[kept_indices]
            x = penetration[kept_indices]
            slope = _estimate_slope(t, x, step, width, velocity_filter.penalty)
            if kept_indices.size < indices.size:
                slope = np.interp(time[indices], t, slope)
            velocity[indices] = slope
    dropouts = sum(indices.size for indices in finite) - sum(indices.size for indices in valid)
    return velocity, velocity_filter, dropouts


def _choose_spline(motions: list[tuple[Floats, Floats]], step: float) -> VelocityFilter:
    """Return the spline with one λ for all runs of times and positions."""
    beats = [_core.find_knots(x) for _, x in motions]
    longest = int(np.argmax([t.size for t, _ in motions]))
    beat, _ = beats[longest]
    knots = [
        (t[start::beat].copy(), x[start::beat].copy())
        for (t, x), (beat_of_run, start) in zip(motions, beats, strict=True)
        if beat_of_run == beat
    ]
    sums = np.zeros(2 * _core.SPLINE_PAIRS)
    for t, x in knots:
        _core.add_spline_changes(t, x, beat * step, sums)
    window = _longest_window(window_samples(beat * step), max(t.size for t, _ in knots))
    # With all samples λ is ``beat`` times as large; h³ of the shorter step gives beat³.
    return _spline_filter(_core.choose_spline(sums, window) * beat**4)


def describe_filter(used: VelocityFilter, dropouts: int) -> str:
    """Describe how the velocity was computed."""
    text = "centred quadratic Savitzky–Golay filter"
    if used.penalty is not None:
        text = f"smoothing spline, as noisy as a parabola through {used.samples} samples"
    if dropouts:
        text += f", without {dropouts} dropout{'s' if dropouts > 1 else ''}"
    return text


def subtract_inertia(contact: Contact, mass: float | None) -> Contact:
    """Subtract mass × acceleration from the force, kg; the acceleration is that of the penetration.

    The sensor pushes the mass and the mass the material: F = F_sensor − m dv/dt. None: unknown.
    """
    if mass is None:
        return contact
    force = contact.force.copy()
    for segment in contact.segments():
        if len(force[segment]) > 1:
            velocity = contact.velocity[segment]
            force[segment] -= mass * np.gradient(velocity, contact.time[segment])
    step = f"minus the inertia of {format_quantity(mass, 'kg')} beyond the sensor"
    if "force" in contact.provenance:
        step = f"{contact.provenance['force']}; {step}"
    made = {**contact.provenance, "force": step}
    return replace(contact, force=force, moving_mass=mass, provenance=made)


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
    velocity = np.empty(penetration.shape)
    penalties = np.empty(count)
    compiled: Mask = np.zeros(count, dtype=bool)  # rows for the compiled loop
    step = typical_step(time) if time.ndim == 1 else 0.0
    if step > 0.0 and samples >= FEWEST_OF_SPLINE:
        compiled[:] = np.isfinite(penetration).all(axis=1)
        longest = _longest_window(window_samples(step), samples)
        _core.spline_rows(time, penetration, step, longest, velocity, penalties, threads)
        with np.errstate(over="ignore", invalid="ignore"):
            spikes = spikes_of_rows(penetration[compiled], threads=threads)
        compiled[compiled] = ~spikes.any(axis=1)
        compiled &= np.isfinite(velocity).all(axis=1)
    filters = list[VelocityFilter]()
    for row in range(count):
        velocity_filter = _spline_filter(float(penalties[row])) if compiled[row] else None
        if velocity_filter is None:
            clock = time if time.ndim == 1 else time[row]
            estimate = estimate_velocities(clock, penetration[row], [slice(None)])
            velocity[row], velocity_filter, _ = estimate
        filters.append(velocity_filter)
    return velocity, filters


def _longest_window(width: int, samples: int) -> float:
    """Window of the smoothest parabola that a spline may equal, in samples."""
    return min(2.0 * width, samples / 4.0)


# The slope of a parabola through a window.


def _slope(t: Floats, x: Floats, width: int) -> Floats:
    """Slope at each sample of the parabola through the window around it."""
    samples = np.arange(t.size)
    start = np.clip(samples - width // 2, 0, t.size - width)
    slope = np.empty(t.size)
    size = max(AT_ONCE // width, 1)
    for k in range(0, t.size, size):
        batch = slice(k, k + size)
        windows = start[batch, None] + np.arange(width)
        slope[batch] = _fit_parabolas(t, x, windows, samples[batch])
    return slope


def _fit_parabolas(t: Floats, x: Floats, windows: Indices, samples: Indices) -> Floats:
    """Slope at samples of the parabolas through their windows, by central moments."""
    times = t[windows] - t[samples, None]
    unit = np.abs(times).max(axis=1, keepdims=True)
    s = times / unit
    depth = x[windows] - x[samples, None]
    linear = s - s.mean(axis=1, keepdims=True)
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


def find_spikes(values: Floats) -> Mask:
    """Mask of the spikes.

    A spike differs from the median of five by more than max(8 σ, 2 %, 1.5 steps), one of the two
    samples at an end by twice that, and by more than three times the range of its four neighbours.
    """
    spikes: Mask = spikes_of_rows(values[None])[0]
    return spikes


def spikes_of_rows(values: Floats, *, screened: bool = False, threads: int = 1) -> Mask:
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
    spikes = np.zeros(values.shape, dtype=np.uint8)
    _core.mark_spikes(values, screened, spikes, threads)
    return spikes.view(np.bool_)
