"""The velocity by a smoothing spline: its equations, its choice, and what it is worth."""

import numpy as np
import pytest
from scipy.signal import lfilter

import palpate
import palpate._core as core
from palpate import VelocityFilter, prepare
from palpate.input.preparation.velocity import (
    FEWEST_OF_SPLINE,
    estimate_velocities,
    filter_gain,
    noise_gain,
    velocities_of_rows,
    velocity_of,
)

RATE = 1000.0
WHOLE = [slice(None)]


def hat_matrix(time: np.ndarray, penalty: float) -> np.ndarray:
    """Values of the spline at the samples from those of the positions: (I + λ Q R⁻¹ Qᵀ)⁻¹."""
    steps, count = np.diff(time), time.size
    q, r = np.zeros((count, count - 2)), np.zeros((count - 2, count - 2))
    for k in range(count - 2):
        left, right = steps[k], steps[k + 1]
        q[k : k + 3, k] = 1.0 / left, -1.0 / left - 1.0 / right, 1.0 / right
        r[k, k] = (left + right) / 3.0
        if k + 1 < count - 2:
            r[k, k + 1] = r[k + 1, k] = right / 6.0
    return np.linalg.inv(np.eye(count) + penalty * q @ np.linalg.solve(r, q.T))


def slopes(time: np.ndarray, x: np.ndarray, penalty: float) -> np.ndarray:
    velocity = np.empty(time.size)
    core.spline_velocity(time, x, float(np.median(np.diff(time))), penalty, velocity)
    return velocity


@pytest.mark.parametrize("penalty", [0.006, 1.0, 60.0])
def test_the_slope_is_that_of_the_spline_of_the_hat_matrix_on_any_clock(penalty):
    interpolate = pytest.importorskip("scipy.interpolate")
    random = np.random.default_rng(1)
    time = np.cumsum(random.uniform(0.5e-3, 2e-3, 160))
    x = 3e-3 * np.sin(30.0 * time) + random.normal(0.0, 1e-5, time.size)
    step = float(np.median(np.diff(time)))
    values = hat_matrix(time, penalty * step**3) @ x
    expected = interpolate.CubicSpline(time, values, bc_type="natural")(time, 1)
    inside = slice(40, -40)  # at the ends a quartic replaces the spline
    error = slopes(time, x, penalty)[inside] - expected[inside]
    assert np.abs(error).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("used", [VelocityFilter(3, 3, 0.1), VelocityFilter(15, 3, 70.0)])
def test_gain_and_noise_of_the_spline_are_those_of_its_weights(used):
    time = np.arange(401.0)
    sample = np.eye(401)[200]
    weights = slopes(time, sample, used.penalty)[::-1]  # of the slope at the middle
    k = time - 200.0
    for turn in (0.05, 0.3, 1.0, 2.0):
        expected = weights @ np.sin(turn * k) / turn
        assert filter_gain(used, turn) == pytest.approx(expected, abs=1e-6)
    assert noise_gain(used) == pytest.approx(np.linalg.norm(weights), rel=1e-4)
    # 1/(1 + λhω⁴), and the noise of the parabola whose window stands for it.
    assert filter_gain(used, 0.1) == pytest.approx(1.0 / (1.0 + used.penalty * 1e-4), abs=1e-4)
    if used.penalty > 10.0:
        window = core.SPLINE_WINDOW * used.penalty**0.25
        assert noise_gain(used) == pytest.approx(np.sqrt(12.0 / window**3), rel=0.02)


def strokes(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A hand that presses at three rates: position, m, and velocity, m/s."""
    parts = [(2e-3, 4.0), (1e-3, 11.0), (5e-5, 55.0)]
    x = 2e-3 + sum(size * np.sin(rate * time) for size, rate in parts)
    return x, sum(size * rate * np.cos(rate * time) for size, rate in parts)


def taps(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Free flight, and half sines of 15 ms in contact, with a continuous velocity."""
    since = np.mod(time, 0.3)
    flight, bounce = 0.3 - 15e-3, np.pi / 15e-3
    inside = since > flight
    speed = 0.5 * 9.81 * flight
    air = -speed * since + 0.5 * 9.81 * since**2
    x = np.where(inside, speed / bounce * np.sin(bounce * (since - flight)), air)
    v = np.where(inside, speed * np.cos(bounce * (since - flight)), -speed + 9.81 * since)
    return x, v


def noise_of(kind: str, x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """A recorded position: with an error of 4 µm of each kind."""
    white = random.normal(0.0, 4e-6, x.size)
    if kind == "ar9":
        return x + lfilter([np.sqrt(1.0 - 0.81)], [1.0, -0.9], white)
    if kind == "tracker":  # at a quarter of the rate, interpolated
        at = np.arange(0, x.size, 4)
        return np.interp(np.arange(x.size), at, x[at] + white[at])
    if kind == "steps":
        return np.round((x + white) / 12e-6) * 12e-6
    return x + white


@pytest.mark.parametrize("kind", ["white", "jitter", "ar9", "tracker", "steps"])
@pytest.mark.parametrize("motion", [strokes, taps])
def test_no_velocity_is_worse_than_that_of_the_parabola(motion, kind):
    ratios = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        time = np.arange(3000) / RATE
        if kind == "jitter":
            time = time + random.uniform(-0.2, 0.2, time.size) / RATE
        x, v = motion(time)
        recorded = noise_of(kind, x, random)
        errors = [velocity_of(time, recorded, window) - v for window in (None, 15e-3)]
        spline, parabola = (np.sqrt(np.mean(each[x > 0.0] ** 2)) for each in errors)
        ratios.append(spline / parabola)
    # An interpolated sample is off the motion of a tap by more than any filter's error.
    assert np.mean(ratios) < (0.5 if motion is taps and kind != "tracker" else 1.0)


@pytest.mark.parametrize("beat", [4, 10])
def test_an_interpolated_tracker_is_read_at_its_own_samples(beat):
    """A tracker of 62.5 or 25 Hz at 250 Hz, slow press: errors were 1.2 of the parabola's."""
    ratios = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        time = np.arange(2500) / 250.0
        x, v = 3e-3 * (1.0 - np.cos(0.7 * time)), 2.1e-3 * np.sin(0.7 * time)
        at = np.arange(seed, time.size, beat)
        recorded = np.interp(time, time[at], x[at] + random.normal(0.0, 2e-6, at.size))
        assert core.find_knots(recorded) == [beat, seed]
        assert core.find_knots(x + random.normal(0.0, 2e-6, time.size)) == [1, 0]
        errors = [velocity_of(time, recorded, window) - v for window in (None, 20e-3)]
        spline, parabola = (np.sqrt(np.mean(each**2)) for each in errors)
        ratios.append(spline / parabola)
    assert np.mean(ratios) < 0.5


def test_all_segments_of_a_contact_share_one_spline_penalty():
    time = np.arange(1200) / RATE
    x = strokes(time)[0] + np.random.default_rng(0).normal(0.0, 3e-6, time.size)
    segment = np.repeat([0, 1], [1185, 15])
    contact = prepare(time=time, penetration=x, force=1e3 * x, segment=segment)
    used = contact.velocity_filter
    assert used.degree == 3
    assert used.penalty > 0.0
    assert used.samples == pytest.approx(core.SPLINE_WINDOW * used.penalty**0.25, abs=1.0)
    assert "spline" in contact.provenance["velocity"]
    assert segment[segment == 1].size < FEWEST_OF_SPLINE
    last = velocity_of(time[1185:], x[1185:], 15e-3)
    assert np.array_equal(contact.velocity[1185:], last)
    whole = estimate_velocities(time, x, [slice(0, 600), slice(600, 1200)])
    first = slopes(time[:600], x[:600], whole[1].penalty)
    np.testing.assert_allclose(whole[0][:600], first, rtol=1e-12)
    with pytest.raises(palpate.InvalidParameterError, match="penalty"):
        VelocityFilter(15, 3, 0.0)


def test_rows_of_arrays_have_the_velocity_of_one_contact():
    time = np.arange(400) / RATE
    random = np.random.default_rng(5)
    x = np.array([strokes(time + k)[0] for k in range(6)]) + random.normal(0.0, 3e-6, (6, 400))
    x[1, 50] += 1e-2  # a dropout
    x[2, 7] = np.nan
    x[3] = noise_of("tracker", x[3], random)
    clocks = np.tile(time, (6, 1))
    for clock in (time, clocks):
        velocity, filters = velocities_of_rows(clock, x, 2)
        for row, used, own in zip(velocity, filters, x, strict=True):
            expected, known, _ = estimate_velocities(time, own, WHOLE)
            assert np.array_equal(row, expected, equal_nan=True)
            assert used == known


def test_a_probe_at_exact_rest_has_no_velocity_before_it_moves():
    """The tail of the spline there was 1e-146 m/s and rose: each sample seemed an outlier."""
    since = np.maximum(np.arange(600) - 300, 0) / RATE
    velocity = velocity_of(np.arange(600) / RATE, 0.05 * since**3 - 4e-3)
    assert not velocity[:280].any()
    assert velocity[305] == pytest.approx(0.15 * since[305] ** 2, rel=0.05)


def test_absurd_positions_spoil_no_more_than_their_segment():
    time = np.arange(600) / RATE
    x = strokes(time)[0]
    broken = x.copy()
    broken[300:303] = 1e200
    velocity = estimate_velocities(
        time, np.concatenate([broken, x])[:600], [slice(0, 400), slice(400, 600)]
    )
    expected = velocity_of(time[400:], x[400:])
    assert np.abs(velocity[0][400:] - expected).max() < 1e-3


@pytest.mark.slow
def test_fast_taps_of_a_hammer_are_in_their_bars():
    """A mass thrown against the material: exact motion, white noise of force and position."""
    inside = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        law = palpate.HuntCrossley(
            K=10 ** random.uniform(3.5, 4.2), B=random.uniform(2e3, 2e4), n=1.3
        )
        mass, contact = random.uniform(0.2, 0.5), []
        step, x, v = 5e-5, -8e-3, 0.0
        for k in range(50_000):  # leapfrog, with a spring of a hand that swings at 3 Hz
            hand = -3e-3 + 11e-3 * np.sin(18.85 * k * step)
            pull = 300.0 * (hand - x) - 12.0 * v
            v += step * (pull - max(law.force(x, v), 0.0)) / mass
            x += step * v
            if k % 20 == 19:
                contact.append((x, v - 0.5 * step * pull / mass))
        x, v = np.array(contact).T
        force = np.maximum(law.force(x, v), 0.0)
        force += random.normal(0.0, 3e-3 * force.max(), force.size)
        time = np.arange(x.size) / RATE
        result = palpate.identify(
            time=time, penetration=x + random.normal(0.0, 2e-6, x.size), force=force
        )
        error = np.abs(result.law.parameters - law.parameters)
        inside.append(error <= 1.96 * result.standard_errors)
    assert np.mean(inside) > 0.85  # 36 numbers at 95 %: 0.85 is three deviations below
