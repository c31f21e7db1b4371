"""Laws with a damping exponent of their own, and with memory, by what they should do."""

import math

import numpy as np
import pytest

from palpate import (
    FlatSpectrum,
    GeneralisedHuntCrossley,
    HuntCrossley,
    InvalidParameterError,
    KelvinVoigt,
    PowerLawRelaxation,
    SingleRelaxation,
)

RELAXATIONS = {
    "flat": FlatSpectrum(1e-3, 4.0),
    "single": SingleRelaxation(0.05),
    "power-law": PowerLawRelaxation(0.3, 1e-3, 4.0),
}
DEPTHS, SPEEDS = np.array([1e-3, 4e-3, 9e-3]), np.array([0.02, -0.05, 0.0])


@pytest.fixture(params=RELAXATIONS.values(), ids=RELAXATIONS)
def relaxation(request):
    return request.param


def law_with(relaxation, exponent=1.5):
    return GeneralisedHuntCrossley(1e4, exponent, 300.0, exponent - 1.0, 5e3, relaxation)


@pytest.mark.parametrize(
    "law, known",
    [
        (GeneralisedHuntCrossley(2000.0, 1.3, 500.0, 1.3), HuntCrossley(2000.0, 500.0, 1.3)),
        # A punch on a half-space.
        (GeneralisedHuntCrossley(2000.0, 1.0, 50.0, 0.0), KelvinVoigt(2000.0, 50.0)),
    ],
)
def test_with_the_exponents_of_a_known_law_it_is_that_law(law, known):
    # A power of its own for the damper: some roundings.
    expected = known.force(DEPTHS, SPEEDS)
    np.testing.assert_allclose(law.force(DEPTHS, SPEEDS), expected, rtol=1e-14)


def test_a_step_is_felt_with_the_instantaneous_stiffness_and_relaxes_to_the_relaxed_one(relaxation):
    law = law_with(relaxation)
    state = law.step(law.rest(), 5e-3, 1e-9)
    # In a nanosecond the quickest branch of 1 ms loses a millionth of its part.
    at_once = law.instantaneous().force(5e-3, 0.0)
    assert law.force(5e-3, 0.0, state) == pytest.approx(at_once, rel=1e-5)
    after = law.step(state, 5e-3, 1e3)
    assert law.force(5e-3, 0.0, after) == pytest.approx(law.relaxed().force(5e-3, 0.0), rel=1e-12)
    assert law.force(5e-3, 0.0) == law.relaxed().force(5e-3, 0.0)


def test_steps_of_any_length_lead_to_the_same_state_while_the_power_of_depth_grows_evenly(
    relaxation,
):
    law = law_with(relaxation, exponent=1.0)
    uneven = np.sort(np.random.default_rng(3).uniform(0.0, 0.3, 300))
    ends = []
    for times in (np.linspace(0.05, 0.3, 6), np.append(uneven, 0.3)):
        state, before = law.rest(), 0.0
        for now in times:
            state, before = law.step(state, 20e-3 * now, now - before), now
        ends.append(state.branches)
    np.testing.assert_allclose(*ends, rtol=1e-10)  # roundings of 300 steps


def test_one_branch_under_a_ramp_is_the_closed_form():
    law = GeneralisedHuntCrossley(0.0, 1.0, 0.0, 0.0, 100.0, SingleRelaxation(0.05))
    time, speed = np.linspace(0.0, 0.2, 41), 10e-3
    force = law.force_along(speed * time, np.full(41, speed), np.diff(time, prepend=-1.0))
    expected = 100.0 * speed * 0.05 * (1.0 - np.exp(-time / 0.05))
    np.testing.assert_allclose(force, expected, rtol=1e-11, atol=1e-15)


def test_a_motion_is_felt_as_its_samples_are_one_by_one(relaxation):
    law = law_with(relaxation)
    rng = np.random.default_rng(1)
    x, v = rng.uniform(-2e-3, 8e-3, 50), rng.uniform(-0.05, 0.05, 50)
    steps = rng.uniform(1e-4, 1e-2, 50)
    whole = law.force_along(x, v, steps)
    state, one_by_one = law.rest(x[0]), []
    for depth, speed, dt in zip(x, v, steps, strict=True):
        state = law.step(state, depth, dt)
        one_by_one.append(law.force(depth, speed, state))
    # Weights are summed in another order.
    np.testing.assert_allclose(whole, one_by_one, rtol=1e-12, atol=1e-12)
    assert (whole[x <= 0.0] == 0.0).all()


def test_memory_is_carried_through_a_loss_of_contact(relaxation):
    law = law_with(relaxation)
    held = law.step(law.rest(), 5e-3, 0.01)
    away = law.step(held, -1e-3, 0.01)
    back = law.step(away, 5e-3, 0.01)
    fresh = law.step(law.rest(), 5e-3, 0.01)
    assert law.force(-1e-3, 0.0, away) == 0.0
    assert law.force(5e-3, 0.0, back) != law.force(5e-3, 0.0, fresh)
    gone = law.step(away, -1e-3, 1e3)
    again = law.step(gone, 5e-3, 0.01)
    assert law.force(5e-3, 0.0, again) == pytest.approx(law.force(5e-3, 0.0, fresh), rel=1e-12)


def test_a_sample_that_is_not_known_is_passed_over():
    law = law_with(RELAXATIONS["single"])
    x, v = np.linspace(1e-3, 5e-3, 21), np.full(21, 0.02)
    gap = x.copy()
    gap[7] = math.nan
    force, whole = law.force_along(gap, v, 1e-2), law.force_along(x, v, 1e-2)
    assert np.isnan(force[7])
    # From 6 to 8 in one step, along which x¹·⁵ bends by some 1e-3 of itself.
    np.testing.assert_allclose(np.delete(force, 7), np.delete(whole, 7), rtol=1e-3)


@pytest.mark.parametrize("frequency", [3.0, 20.0, 150.0])
def test_a_small_oscillation_feels_the_dynamic_stiffness(relaxation, frequency):
    law = law_with(relaxation)
    time = np.arange(0.0, 30.0, 2e-4)
    amplitude, depth = 1e-6, 5e-3
    x = depth + amplitude * np.sin(frequency * time)
    v = amplitude * frequency * np.cos(frequency * time)
    force = law.force_along(x, v, 2e-4)
    # The last whole turns, when what the start left has relaxed.
    turn = 2.0 * math.pi / frequency
    last = time >= time[-1] - turn * math.floor(8.0 / turn)
    swing = np.exp(-1j * frequency * time[last])
    measured = 2j * np.mean((force[last] - force[last].mean()) * swing) / amplitude
    expected = law.dynamic_stiffness(depth, frequency)
    # Leakage of a turn that ends between two samples, and of the slowest branches: some 1e-3.
    assert measured == pytest.approx(expected, rel=5e-3)


def test_the_flat_spectrum_is_fungs():
    """K′ and K″ of the box spectrum in closed form (Fung, 1981)."""
    low, high = 1e-3, 4.0
    law = GeneralisedHuntCrossley(0.0, 1.0, 0.0, 0.0, 1.0, FlatSpectrum(low, high))
    omega = np.geomspace(1.0, 300.0, 20)
    width = math.log(high / low)
    storage = np.log((1.0 + (omega * high) ** 2) / (1.0 + (omega * low) ** 2)) / (2.0 * width)
    loss = (np.arctan(omega * high) - np.arctan(omega * low)) / width
    # Branches in the middle of half octaves: the ends of the box move it by up to 1e-3.
    np.testing.assert_allclose(law.dynamic_stiffness(1e-3, omega), storage + 1j * loss, rtol=2e-3)


def test_slow_and_fast_oscillations_feel_the_relaxed_and_the_instantaneous_material(relaxation):
    law = law_with(relaxation)
    slow, fast = law.dynamic_stiffness(5e-3, [1e-9, 1e9])
    # ωτ and 1/ωτ of the nearest branch are some 1e-8 there; the damper is apart.
    assert slow.real == pytest.approx(law.relaxed().stiffness_at(5e-3), rel=1e-6)
    assert fast.real == pytest.approx(law.instantaneous().stiffness_at(5e-3), rel=1e-6)
    assert fast.imag == pytest.approx(1e9 * law.damping_at(5e-3), rel=1e-6)
    # Without memory it is that of the gradients.
    plain = GeneralisedHuntCrossley(2000.0, 1.3, 500.0, 0.3)
    expected = plain.stiffness_at(5e-3) + 10j * plain.damping_at(5e-3)
    assert plain.dynamic_stiffness(5e-3, 10.0) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("damping_exponent", [1.5, 0.5])
def test_a_rested_material_gives_back_less_than_it_took(relaxation, damping_exponent):
    law = GeneralisedHuntCrossley(1e4, 1.5, 30.0, damping_exponent, 5e3, relaxation)
    rng = np.random.default_rng(5)
    knots, dt = np.linspace(0.0, 1.0, 12), 1e-4
    time = np.arange(0.0, 1.0, dt)
    for _ in range(5):
        # In and out of contact, at random, and back to where it began, above the surface.
        places = rng.uniform(-3e-3, 9e-3, knots.size)
        places[[0, -1]] = -1e-3
        x = np.interp(time, knots, places)
        v = np.diff(x, prepend=x[0]) / dt
        power = law.force_along(x, v, dt) * v * dt
        spent, taken = np.cumsum(power), np.sum(np.maximum(power, 0.0))
        # The sum takes the force at the end of each step: to first order in the step.
        assert spent.min() > -1e-3 * taken
        assert spent[-1] > 1e-2 * taken
    # Without a damper and memory all is given back.
    spring = GeneralisedHuntCrossley(1e4, 1.5, 0.0, 0.0)
    x = 4e-3 * (1.0 - np.cos(np.linspace(0.0, 2.0 * math.pi, 2001)))
    force = spring.force(x, np.zeros_like(x))
    assert np.diff(x) @ (force[1:] + force[:-1]) == pytest.approx(0.0, abs=1e-12)


def test_depths_and_frequencies_go_together_as_in_numpy(relaxation):
    law, state = law_with(relaxation), law_with(relaxation).rest()
    whole = law.dynamic_stiffness([[1e-3], [5e-3]], [1.0, 10.0, 100.0])
    assert whole.shape == (2, 3)
    assert whole[1, 2] == pytest.approx(law.dynamic_stiffness(5e-3, 100.0), rel=1e-12)
    held = law.step(state, 5e-3, 1e-3)
    assert law.force(DEPTHS[:, None], SPEEDS, held).shape == (3, 3)
    assert law.force([-1e-3, 0.0], 0.1, held).tolist() == [0.0, 0.0]
    assert law.force_along([], [], []).shape == (0,)


def two_times_in_the_wrong_order():
    numbers = law_with(RELAXATIONS["flat"]).parameters
    numbers[6:] = numbers[:5:-1]
    return GeneralisedHuntCrossley.from_parameters(numbers)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: FlatSpectrum(1.0, 1.0), "longest must be above shortest"),
        (two_times_in_the_wrong_order, "longest must be above"),
        (lambda: FlatSpectrum(0.0, 1.0), "shortest must be in"),
        (lambda: SingleRelaxation(math.nan), "time must be finite"),
        (lambda: SingleRelaxation("soon"), "time must be a number"),
        (lambda: PowerLawRelaxation(3.0, 1e-3, 1.0), "exponent must be in"),
        (lambda: GeneralisedHuntCrossley(1.0, 1.0, 1.0, 1.0, 1.0), "relaxation must be a Flat"),
        (lambda: GeneralisedHuntCrossley(1.0, 1.0, 1.0, 1.0, 0.0, 3.0), "relaxation must be a"),
        (lambda: law_with(FlatSpectrum(1e-3, 1.0)).step("rest", 1e-3, 1e-3), "state must be"),
        (lambda: law_with(FlatSpectrum(1e-3, 1.0)).step(
            law_with(SingleRelaxation(1.0)).rest(), 1e-3, 1e-3), "state must be of this law"),
        (lambda: law_with(SingleRelaxation(1.0)).force_along([1e-3], [0.0], 0.0), "time_steps"),
        (lambda: law_with(SingleRelaxation(1.0)).dynamic_stiffness(-1.0, 1.0), "depth must be"),
        (lambda: law_with(SingleRelaxation(1.0)).dynamic_stiffness(1.0, -1.0), "frequency must"),
    ],
)  # fmt: skip
def test_nonsense_is_refused_in_words(make, words):
    with pytest.raises(InvalidParameterError, match=words):
        make()
