"""Drake itself: what it parses from the text, pressed and dropped.

A step of a discrete plant from (x₀, v₀) has the force of its end, (x₀ + h v₁, v₁). With a tip so
heavy that v₁ is v₀, and begun at x − h v, that is the force at (x, v).
"""

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from palpate.exports.errors import Drop
from palpate.exports.implicit import LONGEST, steps_down, time_down
from palpate.exports.motion import Motion
from palpate.validation import Floats

# kg. Of 100 N and a step of 10 ms it takes 10⁻⁹ m/s; 10³ times as heavy gave the same digits.
HEAVY = 1e9
# A continuous plant is looked at so often on the way down, and integrated as well: e to 10⁻⁶.
_LOOKS, _ACCURACY = 50, 1e-8


@dataclass(frozen=True, slots=True)
class Setting:
    """How the plant is set up: what text cannot say.

    Attributes
    ----------
    contact_model : str
        "point" or "hydroelastic".
    approximation : str
        Of the contact in a discrete plant: "lagged", whose law is Hunt and Crossley's; or "sap".
    time_step : float
        s; 0 is a continuous plant.
    """

    contact_model: str
    approximation: str
    time_step: float


class Plant:
    """A tip on a slide, as parsed."""

    def __init__(self, text: str, setting: Setting, kind: str = "sdf") -> None:
        drake = _drake()
        builder = drake.DiagramBuilder()
        configuration = drake.MultibodyPlantConfig(
            time_step=setting.time_step,
            contact_model=setting.contact_model,
            discrete_contact_approximation=setting.approximation,
            # Or the results are those of the step before, and not of the state that is set.
            use_sampled_output_ports=False,
        )
        self.step = setting.time_step
        self.plant, _ = drake.AddMultibodyPlant(configuration, builder)
        drake.Parser(self.plant).AddModelsFromString(text, kind)
        self.plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
        self.plant.Finalize()
        self.simulator = drake.Simulator(builder.Build())
        self.context: Any = self.plant.GetMyMutableContextFromRoot(
            self.simulator.get_mutable_context()
        )

    def weigh(self, mass: float) -> None:
        """Give the tip a mass [kg]."""
        self.plant.GetBodyByName("tip").SetMass(self.context, mass)

    def put(self, penetration: float, velocity: float) -> None:
        """Put the tip somewhere, at a velocity into the surface; m and m/s."""
        self.plant.SetPositionsAndVelocities(self.context, [penetration, velocity])

    def force(self) -> float:
        """All contacts' force on the tip, N: at the end of the step from here."""
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        points = [
            results.point_pair_contact_info(k).contact_force()[2]
            for k in range(results.num_point_pair_contacts())
        ]
        patches = [
            results.hydroelastic_contact_info(k).F_Ac_W().translational()[2]
            for k in range(results.num_hydroelastic_contacts())
        ]
        return float(sum(abs(each) for each in (*points, *patches)))


def forces(plant: Plant, motion: Motion) -> Floats:
    """Return the force at every state of a motion, N."""
    plant.weigh(HEAVY)
    force = np.empty(len(motion))
    for k in range(len(motion)):
        x, v = float(motion.penetration[k]), float(motion.velocity[k])
        plant.put(x - plant.step * v, v)
        force[k] = plant.force()
    return force


def rebound(plant: Plant, drop: Drop) -> float:
    """Restitution of a body of the drop's mass, by steps; 0 of one that stays."""
    plant.weigh(drop.mass)
    plant.put(0.0, drop.speed)
    step = plant.step
    if step == 0.0:
        step = time_down(drop) / _LOOKS
        plant.simulator.get_mutable_integrator().set_target_accuracy(_ACCURACY)
    plant.simulator.Initialize()
    for k in range(1, math.ceil(LONGEST * steps_down(drop, step)) + 10):
        plant.simulator.AdvanceTo(k * step)
        x, v = plant.plant.GetPositionsAndVelocities(plant.context)
        if x <= 0.0 and v < 0.0:
            return float(-v / drop.speed)
        if not math.isfinite(v):
            break
    return 0.0


def _drake() -> ModuleType:
    import pydrake.all as drake

    return drake
