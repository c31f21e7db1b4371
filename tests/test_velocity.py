"""Velocity from a recorded position: a centred quadratic Savitzky–Golay filter."""

import math

import numpy as np
import pytest
from cases import THREE_SINES
from scipy.signal import savgol_filter

from palpate import InvalidParameterError
from palpate.preparation.velocity import lost_positions, velocity_of

# Never more than 15 samples, longer than 15 ms or fewer than 5, unless the length is given.
WINDOWS = [(1e4, None, 15), (3e3, None, 15), (1e3, None, 15), (500.0, None, 7), (200.0, None, 5),
           (66.0, None, 5), (10.0, None, 5), (1e3, 7e-3, 7), (1e3, 20e-3, 21), (1e3, 21e-3, 21),
           (1e3, 31e-3, 31), (10.0, 20e-3, 3)]  # fmt: skip


@pytest.mark.parametrize("rate, window, samples", WINDOWS)
def test_on_an_even_clock_it_is_the_classic_filter(rate, window, samples):
    time = np.arange(400) / rate
    x, _ = THREE_SINES.at(time)
    x = x + 1e-5 * np.random.default_rng(0).standard_normal(time.size)
    expected = savgol_filter(x, samples, polyorder=2, deriv=1, delta=1.0 / rate, mode="interp")
    velocity = velocity_of(time, x, window)
    # The clock itself is rounded, at ε t/T = 1e-13 of a step; slopes through zero are absolute.
    assert np.max(np.abs(velocity - expected)) < 1e-9 * np.max(np.abs(expected))


def uneven(samples: int, seed: int = 0) -> np.ndarray:
    """A clock like set C's: event-triggered, steps of 3 to 19 ms."""
    return 6.0 + np.cumsum(np.random.default_rng(seed).uniform(3e-3, 19e-3, samples))


@pytest.mark.parametrize("samples", [3, 4, 5, 6, 15, 200])
@pytest.mark.parametrize("window", [None, 0.05, 0.3])
def test_it_is_exact_on_any_parabola_on_an_uneven_clock(samples, window):
    time = uneven(samples)
    since = time - time[0]
    velocity = velocity_of(time, 5e-3 + 0.03 * since - 0.7 * since**2, window)
    expected = 0.03 - 1.4 * since
    # x is rounded at ε; a slope over a few ms makes 1e3 of it and the ends of a window 1e2 more.
    np.testing.assert_allclose(velocity, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_a_lost_position_does_not_spoil_its_neighbours():
    time = np.arange(2000) * 1e-3
    x, _ = THREE_SINES.at(time)
    x = x + 1e-6 * np.random.default_rng(3).standard_normal(time.size)
    lost = [2, 400, 405, 1200]
    broken = x.copy()
    broken[lost] = 0.0
    assert lost_positions(broken) == len(lost)
    assert lost_positions(x) == 0
    velocity, expected = velocity_of(time, broken), velocity_of(time, x)
    # A window with one sample less has a tenth more noise, of 1 µm: 0.06 mm/s of some 60.
    assert np.abs(velocity - expected).max() < 3e-4
    broken[7] = math.nan  # what is not known is not lost
    assert lost_positions(broken) == len(lost)


def test_samples_that_are_not_known_are_left_out():
    time = uneven(60)
    x, _ = THREE_SINES.at(time)
    holes = [0, 17, 18, 40, 59]
    x[holes] = [math.nan, math.nan, math.inf, -math.inf, math.nan]
    known = np.isfinite(x)
    velocity = velocity_of(time, x)
    assert np.isnan(velocity[holes]).all()
    assert np.array_equal(velocity[known], velocity_of(time[known], x[known]))


@pytest.mark.parametrize(
    "x, expected",
    [([], []), ([1.0], [0.0]), ([1.0, 3.0], [20.0, 20.0]), ([math.nan] * 2, [math.nan] * 2)],
)
def test_of_fewer_than_three_samples_it_is_what_they_say(x, expected):
    time = 0.1 * np.arange(len(x))
    np.testing.assert_allclose(velocity_of(time, np.array(x, dtype=float)), expected, rtol=1e-14)


@pytest.mark.parametrize("window", [0.0, -0.01, math.nan, math.inf, "long"])
def test_a_window_that_is_no_length_of_time_is_refused(window):
    with pytest.raises(InvalidParameterError, match="velocity_window must be") as caught:
        velocity_of(np.arange(10.0), np.arange(10.0), window)
    assert repr(window) in str(caught.value)


@pytest.mark.parametrize("width", [18, 101, 1000])
def test_on_an_uneven_clock_each_window_has_its_own_parabola(width):
    time = uneven(1000)
    x = 0.1 + 5e-3 * np.sin(7.0 * (time - time[0]))
    window = width * float(np.median(np.diff(time)))
    width = round(window / float(np.median(np.diff(time)))) | 1
    velocity = velocity_of(time, x, window)
    for k in (0, 400, 999):
        first = min(max(k - width // 2, 0), max(time.size - width, 0))
        own = slice(first, first + width)
        expected = np.polyfit(time[own] - time[k], x[own], 2)[1]
        # The normal equations of a window square its condition, some 1e3.
        assert velocity[k] == pytest.approx(expected, rel=1e-7, abs=1e-9)


def test_a_wide_window_does_not_see_what_lies_outside_it():
    """A position of 1 km, far away, would spoil sums that run over the whole recording."""
    time = np.arange(20_000) * 1e-3
    x = 1e-3 * np.sin(time)
    expected = velocity_of(time, x, 0.2)[:9_000]
    x[10_000:10_500] = 1e3
    assert np.array_equal(velocity_of(time, x, 0.2)[:9_000], expected)
