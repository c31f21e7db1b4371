"""Velocity from a position: a centred quadratic Savitzky–Golay filter; in real time, delayed."""

import copy
import math
import pickle

import numpy as np
import pytest
from cases import MATERIALS, THREE_SINES
from scipy.signal import savgol_filter

import palpate
from palpate import InvalidParameterError, OnlinePreparation, Status
from palpate.input.preparation.velocity import estimate_velocities, velocity_of, window_samples

T = 1e-3
LATE = 9  # samples: half a window of 15, and the two that tell of a lost position


def measured(seconds=1.0, *, position_noise=2e-6, force_noise=0.05, seed=0, time=None):
    """The ball under the paper's three sines: time, position and force."""
    if time is None:
        time = np.arange(round(seconds / T)) * T
    x, v = THREE_SINES.at(time)
    random = np.random.default_rng(seed)
    force = MATERIALS["ball"].force(x, v) + force_noise * random.standard_normal(time.size)
    return time, x + position_noise * random.standard_normal(time.size), force


def fed(preparation, *columns):
    given = [preparation.update(*row) for row in zip(*map(np.ndarray.tolist, columns), strict=True)]
    return [sample for sample in given if sample is not None]


def pickled(whatever):
    return pickle.loads(pickle.dumps(whatever))


def test_a_loop_gets_position_and_force_as_measured_with_their_velocity():
    time, x, force = measured()
    preparation = OnlinePreparation()
    for k in range(time.size):
        sample = preparation.update(x[k], force[k])
        assert (sample is None) == (k < LATE + 7)
        assert preparation.status is (Status.WAITING if sample is None else Status.UPDATED)
        if sample is None:
            continue
        penetration, velocity, push, dt = sample
        assert (penetration, push, dt) == (x[k - LATE], force[k - LATE], T)
        assert sample.time == pytest.approx(time[k - LATE], rel=1e-15)
        assert (sample.penetration, sample.velocity) == (penetration, velocity)
    assert isinstance(sample, palpate.PreparedSample)
    again = pickled(sample)
    assert (again, again.time) == (sample, sample.time)
    assert preparation.delay == pytest.approx(LATE * T)


CLOCKS = {
    "even": np.arange(3000) * T,
    "even, 500 Hz": np.arange(3000) * 2e-3,
    "jittering": 6.0 + np.cumsum(np.random.default_rng(1).uniform(0.4e-3, 1.6e-3, 3000)),
    "event-triggered": 6.0 + np.cumsum(np.random.default_rng(2).uniform(3e-3, 19e-3, 3000)),
    "epoch": 1.79e9 + np.arange(3000) * T,
}


@pytest.mark.parametrize("window", [None, 0.031, 0.2])
@pytest.mark.parametrize("clock", CLOCKS)
def test_the_velocity_is_the_centred_filter_s(clock, window):
    time, x, force = measured(time=CLOCKS[clock])
    step = float(np.median(np.diff(time)))
    preparation = OnlinePreparation(sample_time=step, velocity_window=window)
    contact = preparation.replay(x, force, time)
    half = window_samples(step, window) // 2
    middle = slice(half, time.size - half - 2)
    # Stamps of the epoch have steps of 0.24 µs, which x − x_m of 1e-4 m in 1e-3 s feels as is; both
    # filters take them as they are, and differ in the roundings of some hundred terms.
    expected = velocity_of(time, x, (2 * half + 1) * step)[middle]
    assert np.abs(contact.velocity - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.array_equal(contact.penetration, x[middle])
    assert np.array_equal(contact.force, force[middle])
    # now − age: the sum of the steps between, in roundings of the window's length.
    np.testing.assert_allclose(contact.time, time[middle], rtol=1e-15, atol=1e-16)


def test_lost_positions_are_left_out_as_offline():
    time, x, force = measured(4.0)
    lost = [900, 1500, 1506, 3000]
    broken = x.copy()
    broken[lost] = 0.0
    contact = OnlinePreparation().replay(broken, force)
    middle = np.arange(7, time.size - LATE)
    kept = middle[~np.isin(middle, lost)]
    assert np.array_equal(contact.penetration, x[kept])
    expected = velocity_of(time, broken, 15e-3)[kept]
    # As above; an even clock and one with a sample left out are summed in other orders.
    assert np.abs(contact.velocity - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.allclose(contact.time, time[kept], rtol=1e-15)

    preparation = OnlinePreparation()
    for k in range(time.size):
        sample = preparation.update(broken[k], force[k])
        assert (preparation.status is Status.REJECTED) == (k - 2 in lost)
        # The estimator is told of the time in between.
        step = 1 if sample is None or round(sample.time / T) - 1 not in lost else 2
        assert sample is None or sample.dt == pytest.approx(step * T)


def identified(penetration, velocity, force):
    estimator = palpate.VariableProjection()
    estimator.replay(penetration, velocity, force)
    estimate = estimator.estimate()
    truth = MATERIALS["ball"].parameters
    return estimate.law.parameters / truth - 1.0, estimate.standard_errors / truth


@pytest.fixture(scope="module")
def biases():
    """Mean errors of K, B and n, and their standard errors, over eight seeds of 10 s each.

    White noise of 0.05 N and 5.5 µm, as of encoders with steps of 19 µm.
    """
    runs = []
    for seed in range(8):
        time, x, force = measured(10.0, position_noise=5.5e-6, seed=seed)
        contact = OnlinePreparation().replay(x, force)
        middle = slice(7, time.size - LATE)
        difference, offline = np.diff(x) / T, velocity_of(time, x, 15e-3)
        mean = np.convolve(difference, np.full(10, 0.1), mode="valid")  # of the latest ten
        arrays = {
            "online": (contact.penetration, contact.velocity, contact.force),
            "offline": (x, offline, force),
            "offline, the same samples": (x[middle], offline[middle], force[middle]),
            "backward difference": (x[1:], difference, force[1:]),
            "causal mean": (x[10:], mean, force[10:]),
        }
        runs.append({name: identified(*given) for name, given in arrays.items()})
    return {name: np.array([run[name] for run in runs]).swapaxes(0, 1) for name in runs[0]}


def test_the_filter_costs_neither_stiffness_nor_damping(biases):
    error, bound = biases["online"]
    # Of eight seeds the rms error over its standard error, which is the Cramér–Rao bound of this
    # noise, has a scatter of a quarter; and the mean error one of 0.35.
    assert np.sqrt(np.mean((error / bound) ** 2, axis=0)).max() < 1.6
    assert np.abs(np.mean(error / bound, axis=0)).max() < 3.0 / math.sqrt(8.0)
    same = biases["offline, the same samples"][0]
    # The velocities differ in roundings, which a least-squares fit of ten thousand does not grow.
    assert np.abs(error - same).max() < 1e-8
    # And the sixteen samples at the ends, of 10 000, are worth less than a tenth of an error.
    assert np.abs((error - biases["offline"][0]) / bound).max() < 0.1


def test_a_causal_velocity_filter_biases_damping_and_stiffness(biases):
    """What the filter is for: the same recordings with what is usually done in a loop.

    A difference has √2/T of the position's noise, 7.8 mm/s beside a speed of some 24: regression
    on it is weakened by σ_v²/(σ_v² + 24²) = 10 %. A mean of ten is half its length late, and the
    force of a damper then appears to be a spring that pulls.
    """
    difference = 100.0 * biases["backward difference"][0].mean(axis=0)
    mean = 100.0 * biases["causal mean"][0].mean(axis=0)
    # Within what eight seeds scatter, 0.7 % a seed, and the half sample that each is late besides.
    assert difference[1] == pytest.approx(-11.0, abs=1.0)
    assert mean[0] == pytest.approx(-6.0, abs=1.0)
    assert np.abs(100.0 * biases["online"][0].mean(axis=0)[:2]).max() < 0.7


def test_replay_is_update_over_arrays():
    time, x, force = measured(0.5)
    x[200] = math.nan
    force[300] = math.inf
    time[400:] += 0.1
    looped, replayed = OnlinePreparation(), OnlinePreparation()
    samples = fed(looped, x, force, time)
    contact = replayed.replay(x, force, time)
    assert looped._state() == replayed._state()
    rows = np.column_stack([contact.penetration, contact.velocity, contact.force])
    assert np.array_equal(rows, np.array([sample[:3] for sample in samples]))
    assert contact.time.tolist() == [sample.time for sample in samples]
    assert [len(contact.time[part]) for part in contact.segments()] == [400 - 2 - 16, 100 - 16]
    assert "quadratic" in contact.provenance["velocity"]


@pytest.mark.parametrize("stop", [3, 12, 100, 155, 402])
@pytest.mark.parametrize("save", [copy.copy, copy.deepcopy, pickled])
def test_continuing_a_restored_preparation_equals_never_having_stopped(save, stop):
    time, x, force = measured(0.6)
    x[150] = 0.5
    time[400:] += 0.1
    settings = {"tare_time": 0.05, "surface": 1e-3, "flip": ("force",)}
    whole, first = OnlinePreparation(**settings), OnlinePreparation(**settings)
    fed(first, x[:stop], force[:stop], time[:stop])
    rest = save(first)
    assert rest.settings == first.settings
    expected = fed(whole, x, force, time)
    fed(rest, x[stop:], force[stop:], time[stop:])
    assert rest._state() == whole._state()
    rest.reset()  # forgets everything but the settings
    assert math.isnan(rest.tare)
    assert fed(rest, x, force, time) == expected
    assert expected


def test_a_state_of_other_settings_or_bytes_is_refused():
    state = OnlinePreparation()._state()
    for preparation, other, words in (
        (OnlinePreparation(surface=1e-3), state, "with the same settings"),
        (OnlinePreparation(), state[:-1] + bytes([state[-1] ^ 1]), "checksum does not match"),
        (OnlinePreparation(), palpate.SingleStageRLS()._state(), "of this version and class"),
    ):
        with pytest.raises(ValueError, match=words):
            preparation._restore(other)


def test_refused_samples_are_left_out_and_their_time_is_not():
    time, x, force = measured()
    known = np.ones(time.size, dtype=bool)
    known[[50, 51, 300, 400]] = False
    broken, pushes = x.copy(), force.copy()
    broken[[50, 51]] = math.nan, math.inf
    pushes[[300, 400]] = math.nan, -math.inf
    preparation = OnlinePreparation()
    contact = preparation.replay(broken, pushes)
    expected = velocity_of(time[known], x[known], 15e-3)
    # As between the clocks above.
    np.testing.assert_allclose(contact.velocity, expected[7:-LATE], rtol=0.0, atol=1e-12)
    assert np.allclose(contact.time, time[known][7:-LATE], rtol=1e-15)
    for values, status in {
        (math.nan, 1.0): Status.NOT_FINITE,
        (0.01, math.inf): Status.NOT_FINITE,
        (1e101, 1.0): Status.OUT_OF_RANGE,
        (0.01, 1.0, math.nan): Status.INVALID_STEP,
    }.items():
        assert preparation.update(*values) is None
        assert preparation.status is status


def test_the_force_of_the_first_seconds_is_taken_off():
    time, x, force = measured(3.0)
    free = time < 1.0
    force = np.where(free, np.random.default_rng(5).normal(0.3, 0.05, time.size), force + 0.3)
    x = np.where(free, -1e-3, x)
    preparation = OnlinePreparation(tare_time=1.0, force_offset=0.1)
    assert math.isnan(preparation.tare)
    samples = fed(preparation, x, force)
    assert preparation.tare == pytest.approx(np.mean(force[free]) - 0.1, rel=1e-12)
    assert samples[0].time == pytest.approx(1.0 - LATE * T)
    assert samples[-1].force == pytest.approx(force[-1 - LATE] - np.mean(force[free]), rel=1e-12)


@pytest.mark.parametrize("as_rows", [list, tuple, np.array])
def test_vectors_count_along_the_direction(as_rows):
    _, x, force = measured(0.1)
    down = np.array([0.0, 3.0, -4.0])
    # A robot 0.4 m away along the normal, whose sensor feels the material push back.
    place = np.outer(x + 0.4, down / 5.0) + np.array([0.2, 0.0, 0.0])
    push = np.outer(-force, down / 5.0) + np.array([7.0, 0.0, 0.0])
    preparation = OnlinePreparation(direction=down, surface=0.4, flip="force")
    expected = OnlinePreparation().replay(x, force)
    turned = OnlinePreparation(flip=["penetration"], surface=-0.3).replay(0.3 - x, force)
    contact = preparation.replay(place, push)
    for found in (contact, turned):
        # A position of 0.4 m is rounded at 6e-17 m; its slope over a millisecond at 6e-14 m/s.
        np.testing.assert_allclose(found.penetration, expected.penetration, rtol=0, atol=1e-15)
        np.testing.assert_allclose(found.velocity, expected.velocity, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.force, expected.force, rtol=1e-14)
    preparation.reset()
    given = [preparation.update(as_rows(p), as_rows(f)) for p, f in zip(place, push, strict=True)]
    assert given[-1].velocity == contact.velocity[-1]
    with pytest.raises(InvalidParameterError, match=r"shape \(k, 3\)"):
        preparation.replay(np.ones((4, 2)), np.ones((4, 3)))
    for position in (0.01, [1.0, 2.0], "xyz", [None, 1.0, 2.0]):
        with pytest.raises(TypeError):
            preparation.update(position, [1.0, 2.0, 3.0])


def test_arrays_that_do_not_belong_together_are_refused():
    for arrays, words in (
        (([1.0, 2.0], [1.0]), "position has 2, force has 1"),
        (([1.0], [1.0], [1.0, 2.0]), "time has 2"),
        (([[1.0]], [1.0]), "position must be one-dimensional"),
        ((["a"], [1.0]), "position must be an array of real numbers"),
    ):
        with pytest.raises(InvalidParameterError, match=words):
            OnlinePreparation().replay(*arrays)


NO_SAMPLES = [(), (0.01,), (0.01, 1.0, 0.0, 5.0), ("deep", 1.0), (0.01, [1.0, 2.0, 3.0])]


def test_update_of_no_sample_at_all_is_a_type_error():
    preparation, by_name = OnlinePreparation(), OnlinePreparation()
    for k in range(20):
        preparation.update(0.01, 1.0, k * T)
        by_name.update(time=k * T, force=1.0, position=0.01)
    before = preparation._state()
    assert by_name._state() == before
    for args in NO_SAMPLES:
        with pytest.raises(TypeError):
            preparation.update(*args)
    for other in ("force", "dt"):
        with pytest.raises(TypeError):
            preparation.update(0.01, 1.0, **{other: 1.0})
    assert preparation._state() == before
    assert "sample_time=0.001" in repr(by_name)


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
    assert window_samples(1.0 / rate, window) == samples
    velocity = velocity_of(time, x, samples / rate)
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
    if window is None and samples > 20:  # a spline bends at its ends, where a quartic replaces it
        assert np.abs(velocity - expected).max() < 1e-3 * np.abs(expected).max()
        return
    # x is rounded at ε; a slope over a few ms makes 1e3 of it and the ends of a window 1e2 more.
    np.testing.assert_allclose(velocity, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_a_lost_position_does_not_spoil_its_neighbours():
    time = np.arange(2000) * 1e-3
    x, _ = THREE_SINES.at(time)
    x = x + 1e-6 * np.random.default_rng(3).standard_normal(time.size)
    lost = [2, 400, 405, 1200]
    broken = x.copy()
    broken[lost] = 0.0
    assert estimate_velocities(time, broken, [slice(None)])[2] == len(lost)
    assert estimate_velocities(time, x, [slice(None)])[2] == 0
    velocity, expected = velocity_of(time, broken), velocity_of(time, x)
    # A window with one sample less has a tenth more noise, of 1 µm: 0.06 mm/s of some 60.
    assert np.abs(velocity - expected).max() < 3e-4
    broken[7] = math.nan  # what is not known is not lost
    assert estimate_velocities(time, broken, [slice(None)])[2] == len(lost)


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
def test_the_velocity_of_two_samples_is_their_slope(x, expected):
    time = 0.1 * np.arange(len(x))
    np.testing.assert_allclose(velocity_of(time, np.array(x, dtype=float)), expected, rtol=1e-14)


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
