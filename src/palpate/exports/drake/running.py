"""Drake's contacts as a plant steps them: by formula, and in Drake itself.

Its discrete plants have, of a body on a contact,

    m (v₁ − v₀) = −h F(x₁, v₁),  x₁ = x₀ + h v₁,

which damps by h ∂F/∂x more than the law says: K h for a spring. A step from (x₀, v₀) has the
force of its end, (x₀ + h v₁, v₁): with a tip so heavy that v₁ is v₀, and begun at x − h v, that is
the force at (x, v).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from palpate.exports.engine import (
    Drop,
    Pointwise,
    ProbeMotion,
    came_back,
    drop_restitution,
    state_by_state,
)
from palpate.validation import Floats

#: A body that takes so many times as long as it went down is said to stay.
LONGEST = 20.0
# With as many steps on the way down h adds π/20 000 of the critical damping: e falls by 0.05 %.
_FINE = 5000
# As the law's own drops are integrated.
_BY_LAW = 2000
# Some six are needed.
_MOST_TRIES = 60


def steps_down(drop: Drop, step: float) -> float:
    """How many steps the way down takes, or nearly; without steps it is without bound."""
    return _time_down(drop) / step if step > 0.0 else math.inf


def _time_down(drop: Drop) -> float:
    """How long it takes, s, or nearly: a quarter period, π/2 x/v₀ of a spring."""
    return 0.5 * math.pi * drop.depth / drop.speed


def restitution_by_steps(force: Pointwise, drop: Drop, step: float) -> float:
    """Restitution of a body that enters the surface at x = 0, by steps [s].

    Of steps so fine that what they add does not matter, by the law alone.

    Parameters
    ----------
    force : callable
        N, ≥ 0, at a penetration [m] and a velocity [m/s]; must not fall with either.
    drop : Drop
        What falls, and how fast.
    step : float
        h, s; 0 of an engine without steps.
    """
    steps = steps_down(drop, step)
    if steps > _FINE:
        return drop_restitution(force, drop.mass, drop.speed, _time_down(drop) / _BY_LAW)
    x, v = 0.0, drop.speed
    for _ in range(math.ceil(LONGEST * steps) + 10):
        v = _after(force, drop.mass, step, x, v)
        x += step * v
        if x <= 0.0:
            return -v / drop.speed
    return 0.0


def _after(force: Pointwise, mass: float, step: float, x: float, v: float) -> float:
    """v₁, where m (v₁ − v₀) + h F(x₀ + h v₁, v₁), which rises with v₁, is 0: by false position.

    It is not below 0 at v₀, and not above at what the force there would make of v₀. Of an end that
    stays twice, half of the value is taken (the Illinois rule).
    """

    def excess(speed: float) -> float:
        return mass * (speed - v) + step * force(x + step * speed, speed)

    high, above = v, excess(v)
    low = v - above / mass
    below = excess(low)
    side = 0
    for _ in range(_MOST_TRIES):
        if above <= 0.0 or below >= 0.0 or high - low <= 1e-15 * abs(v):
            break
        middle = low + (high - low) * below / (below - above)
        value = excess(middle)
        if abs(value) <= 1e-14 * mass * abs(v):
            return middle
        if value > 0.0:
            high, above, below = middle, value, 0.5 * below if side > 0 else below
            side = 1
        else:
            low, below, above = middle, value, 0.5 * above if side < 0 else above
            side = -1
    return high if above <= 0.0 else low


# Drake itself: what it parses from the text, pressed and dropped.

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
        import pydrake.all as drake

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


def forces(plant: Plant, motion: ProbeMotion) -> Floats:
    """Return the force at every state of a motion, N."""
    plant.weigh(HEAVY)

    def force(x: float, v: float) -> float:
        plant.put(x - plant.step * v, v)
        return plant.force()

    return state_by_state(motion, force)


def simulated_restitution(plant: Plant, drop: Drop) -> float:
    """Restitution of a body of the drop's mass, by steps; 0 of one that stays."""
    plant.weigh(drop.mass)
    plant.put(0.0, drop.speed)
    step = plant.step
    if step == 0.0:
        step = _time_down(drop) / _LOOKS
        plant.simulator.get_mutable_integrator().set_target_accuracy(_ACCURACY)
    plant.simulator.Initialize()

    def states() -> Iterator[tuple[float, float]]:
        for k in range(1, math.ceil(LONGEST * steps_down(drop, step)) + 10):
            plant.simulator.AdvanceTo(k * step)
            yield plant.plant.GetPositionsAndVelocities(plant.context)

    return float(came_back(states(), drop))
