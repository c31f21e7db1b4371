"""The force laws, by physical region."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest
from cases import MATERIALS

import palpate
from palpate import (
    FlatSpectrum,
    GeneralisedHuntCrossley,
    HuntCrossley,
    InvalidParameterError,
    PowerLawRelaxation,
    SingleRelaxation,
)

KV, EKV, HC = MATERIALS["linear"], MATERIALS["quadratic"], MATERIALS["pvc"]
LAWS = {
    "kelvin-voigt": KV,
    "extended-kelvin-voigt": EKV,
    "hunt-crossley": HC,
    "remembering": GeneralisedHuntCrossley(9e3, 1.5, 40.0, 0.5, 4e3, SingleRelaxation(0.1)),
    "flat": GeneralisedHuntCrossley(9e3, 1.5, 40.0, 0.5, 4e3, FlatSpectrum(1e-3, 4.0)),
    "power law": GeneralisedHuntCrossley(
        9e3, 1.5, 40.0, 0.5, 4e3, PowerLawRelaxation(0.3, 1e-3, 4.0)
    ),
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
    (HuntCrossley(2000.0, 0.0, 1.5), "of a Hertzian sphere", 0.04, 0.1, 16.0),
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


def test_a_linear_damper_pulls_on_a_fast_rebound_and_hunt_and_crossleys_not_in_its_range():
    """The Kelvin–Voigt law's flaw, the paper's Fig. 10: F < 0 while still in contact."""
    assert KV.force(1e-4, -0.05) < 0.0
    assert HC.force(0.0, 0.5) == 0.0  # no jump at the surface
    slowest = -HC.stiffness / HC.damping
    assert HC.force(0.01, slowest) == 0.0
    assert HC.force(0.01, 0.99 * slowest) > 0.0


def test_the_force_grows_with_depth_and_with_speed(law):
    depths = np.linspace(1e-3, 20e-3, 50)
    speeds = np.linspace(-0.1, 0.1, 50)
    assert np.all(np.diff(law.force(depths, 0.0)) > 0.0)
    assert np.all(np.diff(law.force(10e-3, speeds)) > 0.0)


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
        ([0.01, -0.02, 0.0], 0.0, "depth must be in .0, 1e.100., not -0.02; value 1 is not"),
        ([0.01, math.nan], 0.0, "depth must be in .*, not nan; value 1 is not"),
        (0.01, [0.0, math.inf], "velocity must be finite, not inf; value 1 is not"),
        ([0.01, 0.02], [0.0, 0.1, 0.2], "depth and velocity must be of shapes that go together"),
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
def test_what_is_not_a_number_is_refused_by_name(law, x, v):
    with pytest.raises(InvalidParameterError, match="penetration and velocity must be numbers"):
        law.force(x, v)


def test_dissipation_is_damping_over_stiffness():
    assert HC.dissipation == 2.0
    assert math.isnan(HuntCrossley(0, 1, 2).dissipation)
    assert [type(value) for value in HuntCrossley(1, 2, 3).as_dict().values()] == [float] * 3
    x, v = 0.007, -0.03
    expected = HC.stiffness * x**HC.exponent * (1.0 + HC.dissipation * v)
    assert HC.force(x, v) == pytest.approx(expected, rel=1e-14)  # a few roundings


def test_a_law_is_a_frozen_value(law):
    with pytest.raises(dataclasses.FrozenInstanceError):
        law.stiffness = 1.0
    with pytest.raises((AttributeError, TypeError)):
        law.colour = "red"
    for again in (
        type(law).from_parameters(law.parameters),
        copy.copy(law),
        copy.deepcopy(law),
        pickle.loads(pickle.dumps(law)),
        eval(repr(law), vars(palpate.force_laws)),
        palpate.force_laws.law_from({"kind": law.kind, **law.as_dict()}),
    ):
        assert again == law
        assert type(again) is type(law)
        assert hash(again) == hash(law)
    assert dataclasses.replace(law, stiffness=law.stiffness + 1.0) != law
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
    name = ["stiffness", "damping", "exponent"][position]
    with pytest.raises(InvalidParameterError, match=f"^{name} must be") as caught:
        HuntCrossley(*values)
    assert repr(bad) in str(caught.value)
