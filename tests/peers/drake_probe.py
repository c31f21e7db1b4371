"""A sphere on a half-space in Drake, by its compliant point contact.

Which instant a contact force belongs to, in a discrete plant with sampled output ports (the
default): a step from (x₀, v₀) to (x₁, v₁) finds the contacts, and their depth, at x₀; predicts the
penetration at its end, x₀ + dt v₁, which is x₁ since positions advance by the new velocity; and
solves for the v₁ at which

    F = k x₁ (1 + d v₁)    TAMSI, Lagged, Similar: Hunt–Crossley, d the dissipation
    F = k (x₁ + τ v₁)      SAP: Kelvin–Voigt, τ the relaxation time

So the force that the contact results show belongs to the state *after* the step, which is the
present one, although the depth beside it is that of the state before. A continuous plant computes
all of it at the present state. Penetration here is therefore asked of the geometry at the present
state, and velocity of the joint: what the results call separation speed has the opposite sign in a
continuous plant.
"""

import pytest

from palpate import HuntCrossley, KelvinVoigt
from peers.carriage import FREE, MASS, SAMPLE_TIME
from peers.installed import installed

STIFFNESS = 1000.0  # N/m
DISSIPATION = 2.0  # s/m; not for SAP
RELAXATION = 0.02  # s; for SAP only
HUNT_CROSSLEY = HuntCrossley(K=STIFFNESS, B=STIFFNESS * DISSIPATION, n=1.0)
KELVIN_VOIGT = KelvinVoigt(K=STIFFNESS, B=STIFFNESS * RELAXATION)

# The stiffnesses of the two bodies combine in series: so stiff a tip changes the tenth digit.
RIGID = 1e13  # N/m
RADIUS = 0.02  # m; point contact does not look at it


class DrakeProbe:
    """A probe whose time stepping is "continuous", or one of Drake's discrete approximations."""

    def __init__(
        self,
        stepping: str,
        *,
        tip_stiffness: float = RIGID,
        dissipation: float = DISSIPATION,
        relaxation: float = RELAXATION,
    ) -> None:
        self.engine = f"Drake, {stepping}"
        drake = installed("pydrake.all")
        builder = drake.DiagramBuilder()
        self._plant, _ = drake.AddMultibodyPlant(_configuration(drake, stepping), builder)
        self._joint = _build(
            drake,
            self._plant,
            surface=_material(drake, STIFFNESS, dissipation, relaxation),
            tip=_material(drake, tip_stiffness, 0.0, 0.0),
        )
        self._simulator = drake.Simulator(builder.Build())
        if stepping == "continuous":
            self._simulator.get_mutable_integrator().set_target_accuracy(1e-8)
            self._simulator.get_mutable_integrator().set_maximum_step_size(SAMPLE_TIME)
        self._context = self._plant.GetMyMutableContextFromRoot(
            self._simulator.get_mutable_context()
        )
        self._joint.set_translation(self._context, -FREE)
        self._plant.get_actuation_input_port().FixValue(self._context, [0.0])
        self._simulator.Initialize()

    def advance(self, time: float, push: float) -> None:
        self._plant.get_actuation_input_port().FixValue(self._context, [push])
        self._simulator.AdvanceTo(time)

    def position(self) -> float:
        return self._joint.get_translation(self._context)

    def penetration(self) -> float:
        query = self._plant.get_geometry_query_input_port().Eval(self._context)
        pairs = query.ComputePointPairPenetration()
        return pairs[0].depth if pairs else self.position()

    def velocity(self) -> float:
        return self._joint.get_translation_rate(self._context)

    def force(self) -> float:
        contact = self.contact()
        return abs(contact.contact_force()[2]) if contact else 0.0

    def contact(self):
        """The contact as the engine reports it, or None."""
        results = self._plant.get_contact_results_output_port().Eval(self._context)
        return results.point_pair_contact_info(0) if results.num_point_pair_contacts() else None


def _configuration(drake, stepping: str):
    if stepping == "tamsi" and not hasattr(drake.DiscreteContactApproximation, "kTamsi"):
        # Announced for releases from September 2026 on.
        pytest.skip("this Drake has no TAMSI any more; Lagged and Similar compute the same law")
    configuration = drake.MultibodyPlantConfig(contact_model="point")
    configuration.time_step = 0.0 if stepping == "continuous" else SAMPLE_TIME
    if stepping != "continuous":
        configuration.discrete_contact_approximation = stepping
    return configuration


def _build(drake, plant, surface, tip):
    """The joint that slides the probe down, 0 where the tip touches."""
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.RegisterCollisionGeometry(
        plant.world_body(), drake.RigidTransform(), drake.HalfSpace(), "surface", surface
    )
    probe = plant.AddRigidBody("probe", drake.SpatialInertia.SolidSphereWithMass(MASS, RADIUS))
    plant.RegisterCollisionGeometry(probe, drake.RigidTransform(), drake.Sphere(RADIUS), "tip", tip)
    touching = plant.AddFrame(
        drake.FixedOffsetFrame(
            "touching", plant.world_frame(), drake.RigidTransform([0.0, 0.0, RADIUS])
        )
    )
    joint = plant.AddJoint(
        drake.PrismaticJoint("slide", touching, probe.body_frame(), [0.0, 0.0, -1.0])
    )
    plant.AddJointActuator("drive", joint)
    plant.Finalize()
    return joint


def _material(drake, stiffness: float, dissipation: float, relaxation: float):
    properties = drake.ProximityProperties()
    drake.AddContactMaterial(
        dissipation=dissipation,
        point_stiffness=stiffness,
        friction=drake.CoulombFriction(0.0, 0.0),
        properties=properties,
    )
    # Unless set it is 0.1 s, on either body, and the two add up.
    properties.AddProperty("material", "relaxation_time", relaxation)
    return properties
