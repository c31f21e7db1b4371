"""The law of an engine's own numbers is the force that the engine shows."""

import numpy as np
import pytest

from palpate.force_laws import engines
from peers import drake_probe, opensim_probe
from peers.installed import installed
from peers.reference_simulators import HUNT_CROSSLEY, shown_by

pytestmark = pytest.mark.peers

# Tips as rigid as they are change the law in the tenth (Drake) or the ninth digit (OpenSim).
EXACT = 1e-7


@pytest.mark.parametrize("name", [*HUNT_CROSSLEY, "drake-sap"])
def test_the_law_of_an_engines_own_numbers_is_its_force(name) -> None:
    drake = {"stiffness": drake_probe.STIFFNESS}
    if name == "opensim":
        law = engines.simbody(
            modulus=opensim_probe.MODULUS,
            radius=opensim_probe.RADIUS,
            dissipation=opensim_probe.DISSIPATION,
        )
    elif name == "drake-sap":
        law = engines.drake_sap(**drake, relaxation_time=drake_probe.RELAXATION)
    else:
        law = engines.drake_point(**drake, dissipation=drake_probe.DISSIPATION)
    contact = shown_by(name)
    touching = contact.force > 0.0
    expected = law.force(contact.penetration, contact.velocity)
    assert touching.sum() > 5000
    assert np.abs(contact.force - expected)[touching].max() < EXACT * expected.max()


def test_a_law_of_two_bodies_is_that_of_drakes_pair() -> None:
    """Stiffnesses in series, each dissipation by how much of the way its body gives."""
    probe = drake_probe.DrakeProbe("continuous", tip_stiffness=3.0 * drake_probe.STIFFNESS)
    law = engines.drake_point(
        stiffness=0.75 * drake_probe.STIFFNESS, dissipation=0.75 * drake_probe.DISSIPATION
    )
    for k in range(1, 12):
        probe.advance(1e-3 * k, 1e6)
    assert probe.penetration() > 1e-3
    expected = law.force(probe.penetration(), probe.velocity())
    assert probe.force() == pytest.approx(expected, rel=1e-7)


def test_a_sphere_on_a_hydroelastic_half_space_is_the_power_law_but_for_its_curvature() -> None:
    drake = installed("pydrake.all")
    modulus, thickness, radius, dissipation = 1e5, 0.02, 0.1, 0.5
    law = engines.drake_hydroelastic(
        modulus=modulus, thickness=thickness, radius=radius, dissipation=dissipation
    )
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlant(
        drake.MultibodyPlantConfig(contact_model="hydroelastic", time_step=0.0), builder
    )
    soft, stiff = drake.ProximityProperties(), drake.ProximityProperties()
    for properties in (soft, stiff):
        drake.AddContactMaterial(
            dissipation=dissipation if properties is soft else 0.0,
            friction=drake.CoulombFriction(0.0, 0.0),
            properties=properties,
        )
    drake.AddCompliantHydroelasticPropertiesForHalfSpace(thickness, modulus, soft)
    drake.AddRigidHydroelasticProperties(radius / 40.0, stiff)
    plant.RegisterCollisionGeometry(
        plant.world_body(), drake.RigidTransform(), drake.HalfSpace(), "surface", soft
    )
    body = plant.AddRigidBody("probe", drake.SpatialInertia.SolidSphereWithMass(1.0, radius))
    plant.RegisterCollisionGeometry(
        body, drake.RigidTransform(), drake.Sphere(radius), "tip", stiff
    )
    joint = plant.AddJoint(
        drake.PrismaticJoint("slide", plant.world_frame(), body.body_frame(), [0.0, 0.0, -1.0])
    )
    plant.Finalize()
    diagram = builder.Build()
    context = plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext())
    for x, v in ((5e-3, 0.0), (1e-2, 0.05)):
        joint.set_translation(context, x - radius)
        joint.set_translation_rate(context, v)
        results = plant.get_contact_results_output_port().Eval(context)
        force = abs(results.hydroelastic_contact_info(0).F_Ac_W().translational()[2])
        # A mesh of a fortieth of the radius (seen: -0.4 %); x/3R of curvature is taken out.
        expected = law.force(x, v) * (1.0 - x / (3.0 * radius))
        assert force == pytest.approx(expected, rel=0.01)
