"""The force laws: by physical region, with an exponent of the damper, and with memory."""

import copy
import dataclasses
import json
import math
import pickle

import numpy as np
import pytest
from cases import MATERIALS

import palpate
import palpate._core as _core
from palpate import (
    FlatSpectrum,
    GeneralisedHuntCrossley,
    HuntCrossley,
    InvalidParameterError,
    PowerLawRelaxation,
    RelaxationSpectrum,
    SingleRelaxation,
)
from palpate.force_laws import engines, law_from, literature

KV, EKV, HC = MATERIALS["linear"], MATERIALS["quadratic"], MATERIALS["pvc"]
RELAXATIONS = {
    "flat": FlatSpectrum(1e-3, 4.0),
    "single": SingleRelaxation(0.05),
    "power-law": PowerLawRelaxation(0.3, 1e-3, 4.0),
    "spectrum": RelaxationSpectrum((1e-3, 0.03, 1.0), (1e3, 3e3, 1e3)),
}


def law_with(relaxation):
    return GeneralisedHuntCrossley(K=1e4, n=1.5, B=300.0, p=0.5, M=5e3, relaxation=relaxation)


LAWS = {
    "kelvin-voigt": KV,
    "extended-kelvin-voigt": EKV,
    "hunt-crossley": HC,
    **{name: law_with(relaxation) for name, relaxation in RELAXATIONS.items()},
}


@pytest.fixture(params=LAWS.values(), ids=LAWS)
def law(request):
    return request.param


# x [m], v [m/s] and F [N] worked out by hand from eqs. 1, 14 and 2.
VALUES = [
    (KV, "at rest", 0.01, 0.0, 15.0),
    (KV, "penetrating", 0.01, 0.05, 15.4),
    (KV, "withdrawing", 0.01, -0.05, 14.6),
    (KV, "at the surface, penetrating", 0.0, 0.05, 0.4),
    (EKV, "at rest", 0.01, 0.0, 9.0),
    (EKV, "penetrating", 0.01, 0.05, 9.25),
    (EKV, "withdrawing", 0.01, -0.05, 8.75),
    (EKV, "at the surface, penetrating", 0.0, 0.05, 0.25),
    (HC, "at rest", 0.01, 0.0, 10.0),
    (HC, "penetrating", 0.01, 0.05, 11.0),
    (HC, "withdrawing", 0.01, -0.05, 9.0),
    (HC, "at the surface, penetrating", 0.0, 0.05, 0.0),
    (HC, "withdrawing at 1/b", 0.01, -0.5, 0.0),
    (HuntCrossley(K=2000.0, B=0.0, n=1.5), "of a Hertzian sphere", 0.04, 0.1, 16.0),
]


@pytest.mark.parametrize(
    "law, region, x, v, force", VALUES, ids=[f"{v[0].kind} {v[1]}" for v in VALUES]
)
def test_the_force_is_that_of_the_equation(law, region, x, v, force):
    assert law.force(x, v) == pytest.approx(force, rel=1e-14), region  # a few roundings


@pytest.mark.parametrize("x", [-1e-12, -0.01, -math.inf])
@pytest.mark.parametrize("v", [-1.0, 0.0, 1.0])
def test_out_of_contact_there_is_no_force(law, x, v):
    force = law.force(x, v)
    assert force == 0.0
    assert math.copysign(1.0, force) == 1.0


@pytest.mark.parametrize("other", MATERIALS.values(), ids=MATERIALS)
def test_an_array_holds_what_each_of_its_numbers_gives(other):
    rng = np.random.default_rng(0)
    x, v = rng.uniform(-5e-3, 20e-3, 100), rng.uniform(-0.1, 0.1, 100)
    force = other.force(x, v)
    assert force.dtype == np.float64
    each = list(zip(x.tolist(), v.tolist(), strict=True))
    assert force.tolist() == [other.force(*sample) for sample in each]
    felt = other.in_a_loop()
    assert force.tolist() == [felt(*sample) for sample in each]


SHAPES = [
    ((), (), ()),
    ((5,), (), (5,)),
    ((), (5,), (5,)),
    ((3, 1), (4,), (3, 4)),
    ((2, 3, 4), (2, 3, 4), (2, 3, 4)),
    ((0,), (0,), (0,)),
    ((0,), (), (0,)),
]


@pytest.mark.parametrize("depth, speed, result", SHAPES)
def test_shapes_go_together_as_in_numpy(law, depth, speed, result):
    x, v = np.full(depth, 0.01), np.full(speed, 0.02)
    by_base = palpate.ForceLaw.damping_at(law, x)  # of a law of one's own
    damping = law.damping_at(x)
    np.testing.assert_allclose(by_base, damping, rtol=1e-9)  # a difference of forces at 1 mm/s
    slope = (law.force(x + 1e-7, v) - law.force(x - 1e-7, v)) / 2e-7
    np.testing.assert_allclose(law.stiffness_at(x, v), slope, rtol=1e-6)
    for values, shape, one in (
        (law.force(x, v), result, law.force(0.01, 0.02)),
        (law.stiffness_at(x, v), result, law.stiffness_at(0.01, 0.02)),
        (damping, depth, law.damping_at(0.01)),
        (by_base, depth, palpate.ForceLaw.damping_at(law, 0.01)),
    ):
        assert np.shape(values) == shape
        assert np.all(values == one)
        assert isinstance(values, float if shape == () else np.ndarray)


@pytest.mark.parametrize(
    "depth, velocity, words",
    [
        (0.0, 0.0, "depth must be in"),
        ([0.01, -0.02, 0.0], 0.0, "depth must be in .0, 1e.100., not -0.02 .value 1."),
        ([0.01, math.nan], 0.0, "depth must be in .*, not nan .value 1."),
        (0.01, [0.0, math.inf], "velocity must be finite, not inf .value 1."),
        ([0.01, 0.02], [0.0, 0.1, 0.2], "depth and velocity must have shapes that broadcast"),
        ("deep", 0.0, "depth must be a number"),
        (np.ma.masked_equal([1.0, 2.0], 2.0), 0.0, "depth must not be masked"),
    ],
)
def test_a_depth_out_of_contact_has_no_stiffness_and_is_named(law, depth, velocity, words):
    with pytest.raises(InvalidParameterError, match=words):
        law.stiffness_at(depth, velocity)
    if "velocity" not in words:
        with pytest.raises(InvalidParameterError, match="depth must"):
            law.damping_at(depth)


def test_numbers_lists_and_views_of_every_type_are_taken(law):
    for kind in (int, np.int32, np.float32, np.float64):
        force = law.force(kind(1), kind(2))
        assert isinstance(force, float)
        assert force == law.force(1.0, 2.0)
    x = np.linspace(0.0, 0.02, 10)
    assert np.array_equal(law.force(x.tolist(), 0.0), law.force(x, 0.0))
    assert np.array_equal(law.force(x[::-2], 0.0), law.force(x, 0.0)[::-2])
    grid = np.asfortranarray(np.outer(x, [1.0, 0.5]))
    assert np.array_equal(law.force(grid, 0.0), law.force(np.ascontiguousarray(grid), 0.0))
    assert math.isnan(law.force(math.nan, 0.0))  # what is not known
    assert math.isnan(law.force(0.01, math.nan))


@pytest.mark.parametrize(
    "x, v",
    [("deep", 0.0), (0.01, None), (0.01, 1j), ([1.0, 2.0], [1.0, 2.0, 3.0]), ([[1.0], [1, 2]], 0)],
    ids=["text", "nothing", "complex", "shapes that clash", "ragged"],
)
def test_settings_that_are_not_numbers_are_refused_by_name(law, x, v):
    with pytest.raises(
        InvalidParameterError, match=r"^(penetration|velocity) (and velocity )?must (be|have)"
    ):
        law.force(x, v)


def test_a_law_is_a_frozen_value(law):
    with pytest.raises(dataclasses.FrozenInstanceError):
        law.B = 1.0
    with pytest.raises((AttributeError, TypeError)):
        law.colour = "red"
    for again in (
        law.with_parameters(law.parameters),
        copy.copy(law),
        copy.deepcopy(law),
        pickle.loads(pickle.dumps(law)),
        eval(repr(law), vars(palpate.force_laws)),
        palpate.force_laws.law_from(law.description()),
        palpate.force_laws.law_from(json.loads(json.dumps(law.description()))),
    ):
        assert again == law
        assert type(again) is type(law)
        assert hash(again) == hash(law)
    assert dataclasses.replace(law, B=law.B + 1.0) != law
    assert all(law != another for another in LAWS.values() if another is not law)
    assert list(law.as_dict().values()) == law.parameters.tolist()
    assert len(law.symbols) == len(law.units) == law.parameters.size
    assert list(law.as_dict()) == law.names()
    assert palpate.FORCE_LAWS[law.kind] is type(law)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, "stiff", None, 1j, [1.0, 2.0]])
@pytest.mark.parametrize("position", range(3))
def test_a_parameter_that_is_not_a_finite_number_is_refused_by_name(bad, position):
    values = [1.0, 1.0, 1.0]
    values[position] = bad
    name = ["K", "B", "n"][position]
    with pytest.raises(InvalidParameterError, match=f"^{name} must be") as caught:
        HuntCrossley(**dict(zip(HuntCrossley.names(), values, strict=True)))
    assert repr(bad) in str(caught.value)


def test_coefficients_are_passed_by_their_names():
    with pytest.raises(TypeError, match="positional"):
        HuntCrossley(2000.0, 1.5, 2000.0)
    with pytest.raises(TypeError, match="unexpected keyword argument 'stiffness'"):
        HuntCrossley(stiffness=2000.0, damping=2000.0, exponent=1.5)


DEPTHS, SPEEDS = np.array([1e-3, 4e-3, 9e-3]), np.array([0.02, -0.05, 0.0])


@pytest.fixture(params=RELAXATIONS.values(), ids=RELAXATIONS)
def relaxation(request):
    return request.param


def test_a_step_relaxes_from_instantaneous_to_relaxed_stiffness(relaxation):
    law = law_with(relaxation)
    state = law.step(law.rest(), 5e-3, 1e-9)
    # In a nanosecond the quickest branch of 1 ms loses a millionth of its part.
    at_once = law.instantaneous().force(5e-3, 0.0)
    assert law.force(5e-3, 0.0, state) == pytest.approx(at_once, rel=1e-5)
    after = law.step(state, 5e-3, 1e3)
    assert law.force(5e-3, 0.0, after) == pytest.approx(law.relaxed().force(5e-3, 0.0), rel=1e-12)
    assert law.force(5e-3, 0.0) == law.relaxed().force(5e-3, 0.0)


def test_one_branch_under_a_ramp_is_the_closed_form():
    law = GeneralisedHuntCrossley(
        K=0.0, n=1.0, B=0.0, p=0.0, M=100.0, relaxation=SingleRelaxation(0.05)
    )
    uneven, speed = np.sort(np.random.default_rng(3).uniform(0.0, 0.3, 300)), 10e-3
    for time in (np.linspace(0.0, 0.2, 41), np.append(0.0, uneven)):
        v = np.full(time.size, speed)
        force = law.force_along(speed * time, v, np.diff(time, prepend=-1.0))
        expected = 100.0 * speed * 0.05 * (1.0 - np.exp(-time / 0.05))
        np.testing.assert_allclose(force, expected, rtol=1e-10, atol=1e-15)
    assert math.isnan(HuntCrossley(K=0, B=1, n=2).dissipation)
    # Without memory an oscillation feels the gradients.
    plain = GeneralisedHuntCrossley(K=2000.0, n=1.3, B=500.0, p=0.3)
    expected = plain.stiffness_at(5e-3) + 10j * plain.damping_at(5e-3)
    assert plain.dynamic_stiffness(5e-3, 10.0) == pytest.approx(expected, rel=1e-14)


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


def test_a_small_step_relaxes_as_the_stiffness_says(relaxation):
    law = law_with(relaxation)
    depth, step, still = 5e-3, 1e-6, np.zeros(20_000)
    held = np.full(still.size, depth)
    stepped = np.where(np.arange(still.size) < 1000, depth, depth + step)
    risen = law.force_along(stepped, still, 1e-4) - law.force_along(held, still, 1e-4)
    time = 1e-4 * np.array([100, 1000, 19_000 - 1])
    measured = risen[1000 + np.round(time / 1e-4).astype(int)] / step
    # The step is a ramp of 0.1 ms, half of which counts beside the 10 ms of the first time.
    np.testing.assert_allclose(measured, law.stiffness_after(depth, time), rtol=5e-3)
    assert law.stiffness_after(depth, 0.0) == pytest.approx(law.instantaneous().stiffness_at(depth))


def test_the_flat_spectrum_is_fungs():
    """K′ and K″ of the box spectrum in closed form (Fung, 1981)."""
    low, high = 1e-3, 4.0
    law = GeneralisedHuntCrossley(
        K=0.0, n=1.0, B=0.0, p=0.0, M=1.0, relaxation=FlatSpectrum(low, high)
    )
    omega = np.geomspace(1.0, 300.0, 20)
    width = math.log(high / low)
    storage = np.log((1.0 + (omega * high) ** 2) / (1.0 + (omega * low) ** 2)) / (2.0 * width)
    loss = (np.arctan(omega * high) - np.arctan(omega * low)) / width
    # Branches in the middle of half octaves: the ends of the box move it by up to 1e-3.
    np.testing.assert_allclose(law.dynamic_stiffness(1e-3, omega), storage + 1j * loss, rtol=2e-3)


@pytest.mark.parametrize("damping_exponent", [1.5, 0.5])
def test_a_rested_material_gives_back_less_than_it_took(relaxation, damping_exponent):
    law = GeneralisedHuntCrossley(
        K=1e4, n=1.5, B=30.0, p=damping_exponent, M=5e3, relaxation=relaxation
    )
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
    spring = GeneralisedHuntCrossley(K=1e4, n=1.5, B=0.0, p=0.0)
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


def described(**numbers):
    return law_from(
        {**GeneralisedHuntCrossley(K=1.0, n=1.0, B=1.0, p=1.0).description(), **numbers}
    )


def test_one_branch_is_the_law_with_one_relaxation_time():
    spectrum, single = law_with(RelaxationSpectrum([0.05], [5e3])), law_with(SingleRelaxation(0.05))
    rng = np.random.default_rng(2)
    x, v, steps = rng.uniform(-2e-3, 8e-3, 200), rng.uniform(-0.1, 0.1, 200), np.full(200, 2e-3)
    force = single.force_along(x, v, steps)
    np.testing.assert_allclose(spectrum.force_along(x, v, steps), force, rtol=1e-14)
    expected = single.dynamic_stiffness(5e-3, 20.0)
    assert spectrum.dynamic_stiffness(5e-3, 20.0) == pytest.approx(expected, rel=1e-14)
    assert spectrum.relaxation_time == pytest.approx(0.05, rel=1e-14)
    assert spectrum.parameters.tolist() == single.parameters.tolist()


@pytest.mark.parametrize("name", ["flat", "power-law"])
def test_the_branches_of_a_formula_are_the_same_law_as_a_spectrum(name):
    law = law_with(RELAXATIONS[name])
    times, weights = law.branches()
    assert weights.sum() == pytest.approx(1.0, rel=1e-14)
    spectrum = law_with(RelaxationSpectrum(times, 5e3 * weights))
    x, v = DEPTHS.repeat(20), SPEEDS.repeat(20)
    force = law.force_along(x, v, 1e-2)
    np.testing.assert_allclose(spectrum.force_along(x, v, 1e-2), force, rtol=1e-12)
    assert spectrum.relaxation_time is None


def test_the_stiffness_of_a_spectrum_is_its_sum_and_scales_it():
    spectrum = RELAXATIONS["spectrum"]
    law = GeneralisedHuntCrossley(K=1e4, n=1.5, B=300.0, p=0.5, relaxation=spectrum)
    assert law == law_with(spectrum)
    assert law.instantaneous().K == 1.5e4
    assert law.with_parameters([1e4, 1.5, 300.0, 0.5, 1e4]).relaxation.stiffnesses == (
        2e3,
        6e3,
        2e3,
    )
    assert law.with_parameters([1e4, 1.5, 300.0, 0.5, 0.0]).dynamic_stiffness(
        5e-3, 10.0
    ) == pytest.approx(law.relaxed().dynamic_stiffness(5e-3, 10.0))


LADDER = tuple(1e-3 * 2.0**k for k in range(12))


@pytest.mark.parametrize(
    "stiffnesses, time",
    [
        ({4: 1.0}, 0.016),
        ({4: 1.0, 5: 1.0}, 0.016 * math.sqrt(2.0)),
        ({4: 0.97, 11: 0.03}, 0.016),
        ({4: 0.9, 11: 0.1}, None),
        ({4: 1.0, 6: 1.0}, None),  # no neighbours
        (dict.fromkeys(range(12), 1.0), None),
        ({}, None),
    ],
)
def test_one_group_of_neighbouring_times_is_one_relaxation_time(stiffnesses, time):
    spectrum = RelaxationSpectrum(LADDER, [stiffnesses.get(k, 0.0) for k in range(12)])
    assert spectrum.time == (None if time is None else pytest.approx(time))
    assert spectrum.resolution == pytest.approx(0.5 * math.log(2.0))


def test_branches_along_a_motion_sum_to_the_force_of_the_memory():
    law, rng = law_with(RELAXATIONS["spectrum"]), np.random.default_rng(4)
    x, steps = rng.uniform(-1e-3, 8e-3, 100), rng.uniform(1e-4, 1e-2, 100)
    x[50] = math.nan
    times, weights = law.branches()
    states = _core.relaxation_states(law.n, times, steps, x)
    memory = law.force_along(x, np.zeros(100), steps) - law.relaxed().force(x, 0.0)
    inside = x > 0.0
    np.testing.assert_allclose((states @ (5e3 * weights))[inside], memory[inside], atol=1e-12)
    assert np.isnan(states[50]).all()
    assert states.shape == (100, 3)
    assert not states[0].any()  # relaxed at the first penetration


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: FlatSpectrum(1.0, 1.0), "longest must be above shortest"),
        (lambda: described(M=1.0, shortest_time=2.0, longest_time=1.0),
         "longest must be above"),
        (lambda: described(M=1.0), "longest_time must be above 0"),
        (lambda: described(relaxation_times=[1.0]), "must be given together"),
        (lambda: described(relaxation_times=[1.0], relaxation_stiffnesses=[1.0], longest_time=1.0),
         "must be given together"),
        (lambda: RelaxationSpectrum((), ()), "times must be 1 to 128 numbers, not 0"),
        (lambda: RelaxationSpectrum((1.0, 1.0), (1.0, 1.0)), "times must be ascending"),
        (lambda: RelaxationSpectrum((0.0, 1.0), (1.0, 1.0)), "times must be in"),
        (lambda: RelaxationSpectrum((1.0,), (-1.0,)), "stiffnesses must be finite and ≥ 0"),
        (lambda: RelaxationSpectrum((1.0, 2.0), (1.0,)), "arrays must have the same length"),
        (lambda: RelaxationSpectrum("soon", (1.0,)), "times must be an array"),
        (lambda: GeneralisedHuntCrossley(
            K=1.0, n=1.0, B=1.0, p=1.0, M=2.0, relaxation=RelaxationSpectrum((1.0,), (1.0,))),
         "M must be the sum"),
        (lambda: GeneralisedHuntCrossley.from_parameters([1.0, 1.0, 1.0, 1.0, 1.0]),
         "relaxation must be a RelaxationSpectrum"),
        (lambda: FlatSpectrum(0.0, 1.0), "shortest must be in"),
        (lambda: SingleRelaxation(math.nan), "time must be finite"),
        (lambda: SingleRelaxation("soon"), "time must be a number"),
        (lambda: PowerLawRelaxation(3.0, 1e-3, 1.0), "exponent must be in"),
        (lambda: GeneralisedHuntCrossley(K=1.0, n=1.0, B=1.0, p=1.0, M=1.0),
         "relaxation must be a Rel"),
        (lambda: GeneralisedHuntCrossley(K=1.0, n=1.0, B=1.0, p=1.0, M=0.0, relaxation=3.0),
         "relaxation must be a"),
        (lambda: law_with(FlatSpectrum(1e-3, 1.0)).step("rest", 1e-3, 1e-3), "state must be"),
        (lambda: law_with(FlatSpectrum(1e-3, 1.0)).step(
            law_with(SingleRelaxation(1.0)).rest(), 1e-3, 1e-3), "state must have this law"),
        (lambda: law_with(SingleRelaxation(1.0)).force_along([1e-3], [0.0], 0.0), "time_steps"),
        (lambda: law_with(SingleRelaxation(1.0)).dynamic_stiffness(-1.0, 1.0), "depth must be"),
        (lambda: law_with(SingleRelaxation(1.0)).dynamic_stiffness(1.0, -1.0), "frequency must"),
        (lambda: engines.drake_point(stiffness=0.0, dissipation=1.0), "stiffness must be in"),
        (lambda: engines.drake_sap(stiffness=1.0, relaxation_time=-1.0), "relaxation_time must"),
        (lambda: literature.flores(K=3e4, n=1.5, restitution=0.0, speed=0.5),
         "restitution must be in"),
        (lambda: literature.half_space(K=1.0, n=0.5, retardation_time=0.0),
         "n must be in"),
        (lambda: literature.fung(
            instantaneous=1.0, n=1.0, c=0.1, shortest=2.0, longest=1.0), "longest must be"),
        # The positive format: a time constant and a ratio, which go with the time step.
        (lambda: engines.mujoco(
            solref=(0.02, 1.0), solimp=(0.9, 0.9, 0.001, 0.5, 2.0), inverse_mass=1.0), "solref"),
        (lambda: engines.mujoco(
            solref=(-1e3, -1.0), solimp=(0.9, 0.95, 0.001, 0.5, 2.0), inverse_mass=1.0),
         "solimp must be constant"),
    ],
)  # fmt: skip
def test_nonsense_is_refused_in_words(make, words):
    with pytest.raises(InvalidParameterError, match=words):
        make()
