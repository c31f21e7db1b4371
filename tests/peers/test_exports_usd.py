"""An export to USD, read back by the library that Newton's and PhysX's importers read it with."""

import pytest

from palpate import KelvinVoigt, exports
from peers.installed import installed

pytestmark = pytest.mark.peers


@pytest.fixture
def stage(tmp_path):
    usd = installed("pxr.Usd")
    made = exports.export(KelvinVoigt(2000.0, 16.5), "usd", mass=0.7, tip_radius=0.02)
    made.save(tmp_path)
    return usd.Stage.Open(str(tmp_path / "scene.usda"))


@pytest.mark.parametrize("shape", ["ground", "tip"])
def test_both_engines_find_their_numbers_on_the_material_that_both_shapes_are_bound_to(
    stage, shape
):
    # With the ground's alone Newton 1.8.0 mixed in its defaults: 1.450 or 0.049 N for 0.400.
    physics, shade = installed("pxr.UsdPhysics"), installed("pxr.UsdShade")
    bound = stage.GetPrimAtPath(f"/World/{shape}")
    assert bound.HasAPI(shade.MaterialBindingAPI)
    material, _ = shade.MaterialBindingAPI(bound).ComputeBoundMaterial("physics")
    prim = material.GetPrim()
    assert prim.HasAPI(physics.MaterialAPI)
    written = prim.GetMetadata("apiSchemas").GetAddedOrExplicitItems()
    assert {"NewtonMaterialAPI", "PhysxMaterialAPI"} <= set(written)
    for name, value in (
        ("newton:contactStiffness", 2000.0),
        ("newton:contactDamping", 16.5),
        ("physxMaterial:compliantContactStiffness", 2000.0),
        ("physxMaterial:compliantContactDamping", 16.5),
        # True would make both numbers mass-normalised.
        ("physxMaterial:compliantContactAccelerationSpring", False),
        # At 0 Newton's SolverMuJoCo gives NaN: 2/(μ²(1 + μ²)) of the force by a pyramid.
        ("physics:dynamicFriction", 1.0),
    ):
        assert prim.GetAttribute(name).Get() == value, name


def test_the_scene_is_in_metres_and_kilograms_and_its_probe_has_the_mass(stage):
    geometry, physics = installed("pxr.UsdGeom"), installed("pxr.UsdPhysics")
    assert geometry.GetStageMetersPerUnit(stage) == 1.0
    assert physics.GetStageKilogramsPerUnit(stage) == 1.0
    tip = stage.GetPrimAtPath("/World/tip")
    assert physics.MassAPI(tip).GetMassAttr().Get() == pytest.approx(0.7)
    assert geometry.Sphere(tip).GetRadiusAttr().Get() == 0.02
