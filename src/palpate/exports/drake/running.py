"""Drake's contacts in discrete time: by formula, and in Drake itself.

For a body on a contact, Drake's discrete plants solve

    m (v₁ − v₀) = −h F(x₁, v₁),  x₁ = x₀ + h v₁,

which adds a damping of h ∂F/∂x to that of the law: K h for a spring. A step from (x₀, v₀) has the
force at its end, (x₀ + h v₁, v₁). With a tip so heavy that v₁ = v₀, a step from x − h v therefore
has the force at (x, v).
"""

import math
from collections.abc import Iterator
from typing import Any

from palpate.exports.motion import Pointwise, ProbeMotion
from palpate.exports.replay_errors import Drop, came_back, drop_restitution, state_by_state
from palpate.validation import Floats, frozen

#: A body that has not returned after this multiple of the time down counts as at rest.
LONGEST = 20.0
# With this many steps down h adds π/20 000 of the critical damping, which lowers e by 0.05 %.
_FINE = 5000
# Steps on the way down for integration in continuous time.
_BY_LAW = 2000
# Most iterations; some six are needed.
_MOST_TRIES = 60


def steps_down(drop: Drop, step: float) -> float:
    """Return the approximate number of steps on the way down; infinite in continuous time."""
    return _time_down(drop) / step if step > 0.0 else math.inf


def _time_down(drop: Drop) -> float:
    """Return the approximate time down, s: a quarter period of a spring, π/2 x/v₀."""
    return 0.5 * math.pi * drop.depth / drop.speed


def restitution_by_steps(force: Pointwise, drop: Drop, step: float) -> float:
    """Return the restitution of a body that enters the surface at x = 0, with time steps [s].

    If the steps are so fine that their damping does not matter, it is that of continuous time.

    Parameters
    ----------
    force : callable
        Force, N, ≥ 0, at a penetration [m] and a velocity [m/s]; must not decrease with either.
    drop : Drop
        The impact.
    step : float
        h, s; 0 for continuous time.
    """
    steps = steps_down(drop, step)
    if steps > _FINE:
        return drop_restitution(force, drop.mass, drop.speed, _time_down(drop) / _BY_LAW)
    x = 0.0
    v = drop.speed
    for _ in range(math.ceil(LONGEST * steps) + 10):
        v = _after(force, drop.mass, step, x, v)
        x += step * v
        if x <= 0.0:
            return -v / drop.speed
    return 0.0


def _after(force: Pointwise, mass: float, step: float, x: float, v: float) -> float:
    """Return v₁, the root of m (v₁ − v₀) + h F(x₀ + h v₁, v₁), by false position.

    The function increases with v₁; v₀ and the explicit step with the force there bracket the root.
    If one end stays twice, its value is halved (the Illinois rule).
    """

    def excess(speed: float) -> float:
        return mass * (speed - v) + step * force(x + step * speed, speed)

    high = v
    above = excess(v)
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
            high = middle
            above = value
            below = 0.5 * below if side > 0 else below
            side = 1
        else:
            low = middle
            below = value
            above = 0.5 * above if side < 0 else above
            side = -1
    return high if above <= 0.0 else low


# Running Drake: the force and restitution of the exported text.

# kg. 100 N over a step of 10 ms change its speed by 10⁻⁹ m/s; 10³ times as much gave equal digits.
HEAVY = 1e9
# States looked at on the way down, and integration accuracy, of a continuous plant: e to 10⁻⁶.
_LOOKS = 50
_ACCURACY = 1e-8


@frozen
class Setting:
    """The settings of the plant that the text cannot contain.

    Attributes
    ----------
    approximation : str
        Of the contact in a discrete plant: "lagged", the Hunt–Crossley law; or "sap".
    time_step : float
        Time step, s; 0 for a continuous plant.
    """

    approximation: str
    time_step: float


class Plant:
    """A tip on a slide, parsed by Drake."""

    def __init__(self, text: str, setting: Setting, kind: str = "sdf") -> None:
        import pydrake.all as drake

        builder = drake.DiagramBuilder()
        configuration = drake.MultibodyPlantConfig(
            time_step=setting.time_step,
            contact_model="point",
            discrete_contact_approximation=setting.approximation,
            # True would return the results of the previous step instead of the present state.
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
        """Set the mass of the tip [kg]."""
        self.plant.GetBodyByName("tip").SetMass(self.context, mass)

    def put(self, penetration: float, velocity: float) -> None:
        """Set the penetration [m] of the tip and its velocity into the surface [m/s]."""
        self.plant.SetPositionsAndVelocities(self.context, [penetration, velocity])

    def force(self) -> float:
        """Return the force of all contacts on the tip, N, at the end of the next step."""
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        return sum(
            abs(float(results.point_pair_contact_info(k).contact_force()[2]))
            for k in range(results.num_point_pair_contacts())
        )


def forces(plant: Plant, motion: ProbeMotion) -> Floats:
    """Return the force at every state of a motion, N."""
    plant.weigh(HEAVY)

    def force(x: float, v: float) -> float:
        plant.put(x - plant.step * v, v)
        return plant.force()

    return state_by_state(motion, force)


def simulate_restitution(plant: Plant, drop: Drop) -> float:
    """Return the restitution of the drop's body in Drake; 0 if it does not rebound."""
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
