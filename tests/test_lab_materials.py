"""The laboratory's materials: force laws, relaxing ones, and several beside each other."""

import json

import numpy as np
import pytest

from palpate import HuntCrossley, InvalidParameterError, KelvinVoigt, lab

TIME = np.arange(0.0, 3.0, 1e-3)
DEPTH = 6e-3 + 4e-3 * np.sin(5.0 * TIME)
SPEED = 20e-3 * np.cos(5.0 * TIME)
HERE = np.zeros_like(TIME)


@pytest.mark.parametrize("name", lab.MATERIALS)
def test_a_step_at_a_time_a_material_feels_as_along_the_whole_motion(name):
    material = lab.MATERIALS[name]
    along = material.force(TIME, HERE, DEPTH, SPEED)
    touch = material.touch()
    steps = [touch(*sample) for sample in zip(TIME, HERE, DEPTH, SPEED, strict=True)]
    # A spectrum is summed in another order: some roundings.
    np.testing.assert_allclose(along, steps, rtol=1e-12, atol=1e-12)
    # It says its truth in plain numbers.
    assert json.loads(json.dumps(material.describe())) == material.describe()


# What remembers lags behind a probe that leaves.
@pytest.mark.parametrize("name", sorted(lab.MATERIALS.keys() - {"relaxing-sponge", "tissue"}))
def test_a_material_pushes_where_it_is_touched_and_nowhere_else(name):
    force = lab.MATERIALS[name].force(TIME, HERE, DEPTH - 6e-3, SPEED)
    inside = DEPTH > 6e-3
    assert (force[inside] > 0.0).all()
    assert (force[~inside] == 0.0).all()


def test_a_held_relaxing_material_relaxes_to_its_law_with_its_time_constant():
    material = lab.Relaxing(lab.RELAXING_SPONGE.law, 150.0, 0.5)
    depth = np.full_like(TIME, 0.01)
    force = material.force(TIME[1:], HERE[1:], depth[1:], HERE[1:])
    # It is touched at its first sample, where nothing has stretched the branch yet.
    touch = material.touch()
    touch(0.0, 0.0, 0.0, 0.0)
    pressed = np.array([touch(t, 0.0, 0.01, 0.0) for t in TIME[1:]])
    above = pressed - 300.0 * 0.01
    # Pressed in within the first millisecond, then left alone: exact but for rounding.
    np.testing.assert_allclose(above, above[0] * np.exp(-(TIME[1:] - TIME[1]) / 0.5), rtol=1e-9)
    # Within that millisecond it relaxes already: the mean of e^(−t/τ) over it is left.
    assert above[0] == pytest.approx(150.0 * 0.01 * (1.0 - np.exp(-0.002)) / 0.002, rel=1e-9)
    np.testing.assert_allclose(force, 3.0)


def test_a_relaxing_material_lags_behind_the_leaving_probe_and_never_pulls():
    material = lab.Relaxing(lab.RELAXING_SPONGE.law, 3000.0, 0.1)
    force = material.force(TIME, HERE, DEPTH - 5e-3, SPEED)
    inside = DEPTH > 5e-3
    assert force.min() == 0.0
    assert (force[inside] == 0.0).any()
    assert force.max() > 1.0


def test_the_place_decides_between_zones_and_the_time_between_episodes():
    laws = lab.PVC.law, lab.INCLUSION.law
    parts = tuple(lab.Homogeneous(law) for law in laws)
    soft, hard = (law.force(DEPTH, SPEED) for law in laws)
    lateral_position = 0.01 * np.sin(TIME)
    zones = lab.SpaceVaryingMaterial(parts, (0.002,)).force(TIME, lateral_position, DEPTH, SPEED)
    np.testing.assert_array_equal(zones, np.where(lateral_position < 0.002, soft, hard))
    episodes = lab.TimeVaryingMaterial(parts, (1.5,)).force(TIME, HERE, DEPTH, SPEED)
    np.testing.assert_array_equal(episodes, np.where(TIME < 1.5, soft, hard))


HC = HuntCrossley(1.0, 1.0, 1.0)
TWO, THREE = (lab.BALL, lab.PVC), (lab.BALL, lab.PVC, lab.PVC)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: lab.Homogeneous("ball"), "law must be a ForceLaw"),
        (lambda: lab.Homogeneous(KelvinVoigt(-1.0, 1.0)), "stiffness must be in"),
        (lambda: lab.Homogeneous(HuntCrossley(1.0, -1.0, 1.0)), "damping must be in"),
        (lambda: lab.Homogeneous(HuntCrossley(1.0, 1.0, -2.0)), "exponent must be in"),
        (lambda: lab.Relaxing(KelvinVoigt(1.0, 1.0), 1.0, 1.0), "law must be a HuntCrossley"),
        (lambda: lab.Relaxing(HC, -1.0, 1.0), "branch_stiffness must be"),
        (lambda: lab.Relaxing(HC, 1.0, 0.0), "relaxation_time must be"),
        (lambda: lab.SpaceVaryingMaterial(TWO, ()), "borders must be one fewer"),
        (lambda: lab.SpaceVaryingMaterial(THREE, (1.0, 0.0)), "borders must increase"),
        (lambda: lab.TimeVaryingMaterial((lab.BALL, 3), (1.0,)), "must be a Material, not 3"),
    ],
)
def test_nonsense_is_refused_by_name(make, words):
    with pytest.raises(InvalidParameterError, match=words):
        make()
