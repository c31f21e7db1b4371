"""The same loops in Drake: a multibody plant with one joint, and a system for the rest."""

import math
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from benchmarks.gains.cases import STEP, Case

_FILTER = 2  # states: filtered force and its rate


class Loop(LeafSystem):
    """Contact, force filter and sampled controller; its output is the force on the joint."""

    def __init__(self, case: Case, factor: float) -> None:
        LeafSystem.__init__(self)
        self.case, self.loop, self.factor = case, case.loop, factor
        loop = case.loop
        self.period = 1.0 / loop.sample_rate
        self.corner = 2.0 * math.pi * getattr(loop, "force_filter", 20.0)
        speed = loop.approach_speed
        lag = 2.0 * speed / getattr(loop, "bandwidth", math.inf)
        self.motion = lag + speed * (loop.delay - 0.5 * self.period)
        self.motion_speed, self.sum, self.last = speed, 0.0, -speed * self.period
        self.steady = getattr(loop, "friction", 0.0) * speed
        self.target = self.steady / (factor * getattr(loop, "stiffness", 1.0))
        # Commands with the times from which on they act, the latest first.
        self.commands: list[tuple[float, float]] = []
        self.forces: list[float] = []
        self.plant_state: Any = self.DeclareVectorInputPort("state", 2)
        self.DeclareContinuousState(_FILTER)
        self.DeclareVectorOutputPort("push", 1, self.push)
        self.DeclarePeriodicUnrestrictedUpdateEvent(self.period, 0.0, self.sample)

    def contact(self, x: float, v: float) -> float:
        """Return the force of the material, N."""
        if x <= 0.0:
            return 0.0
        law = self.case.law
        return max(0.0, float(law.K * x**law.n + law.B * x**law.p * v))

    def acting(self, time: float) -> float:
        """Return the command that acts at a time."""
        for begins, command in self.commands:
            if begins <= time + 1e-9:
                return command
        if self.loop.name == "admittance":  # before first touch it moved at the approach speed
            samples = math.floor((time - self.loop.delay) / self.period + 1e-9)
            lag = 2.0 * self.loop.approach_speed / self.loop.bandwidth
            middle = self.loop.delay + (samples + 0.5) * self.period
            return float(lag + self.loop.approach_speed * middle)
        return float(self.steady)

    def joint_force(self, time: float, x: float, v: float) -> float:
        """Return the force on the joint besides its friction, N."""
        loop, command = self.loop, self.acting(time)
        if loop.name == "admittance":
            spring = loop.mass * loop.bandwidth**2 * (command - x)
            command = spring - 2.0 * loop.mass * loop.bandwidth * v
        return command - self.contact(x, v)

    def push(self, context: Any, output: Any) -> None:
        """Compute the output."""
        x, v = map(float, self.plant_state.Eval(context))
        output.SetAtIndex(0, self.joint_force(context.get_time(), x, v))

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:  # noqa: N802 - Drake's
        """Filter the force that the sensor feels."""
        x, v = map(float, self.plant_state.Eval(context))
        friction = getattr(self.loop, "friction", 0.0)
        force = self.joint_force(context.get_time(), x, v) - friction * v
        felt = self.contact(x, v) + self.loop.tool_mass * force / self.loop.mass
        filtered, rate = context.get_continuous_state_vector().CopyToVector()
        pull = self.corner**2 * (felt - filtered) - math.sqrt(2.0) * self.corner * rate
        derivatives.get_mutable_vector().SetFromVector([rate, pull])

    def sample(self, context: Any, state: Any) -> None:
        """Compute the command of a sample."""
        loop, time = self.loop, context.get_time()
        x, v = map(float, self.plant_state.Eval(context))
        filtered = context.get_continuous_state_vector().GetAtIndex(0)
        error = loop.wanted_force - filtered
        speed, self.last = (x - self.last) / self.period, x
        if loop.name == "admittance":
            push = self.factor * error - loop.virtual_damping * self.motion_speed
            self.motion_speed += push / loop.virtual_mass * self.period
            self.motion += self.motion_speed * self.period
            command = self.motion
        elif loop.name == "impedance":
            deep = self.case.depth
            aimed = loop.approach_speed if self.target < deep else 0.0
            spring = loop.stiffness * (self.target - x) + loop.damping * (aimed - speed)
            ahead = loop.wanted_force * min(max(self.target / deep, 0.0), 1.0)
            command = self.factor * spring + ahead
            if aimed:
                self.target = min(self.target + aimed * self.period, deep)
        else:
            self.sum += error * self.period
            control = loop.proportional * error + loop.integral * self.sum
            command = loop.wanted_force + self.factor * control
        self.commands.insert(0, (time + loop.delay, command))
        del self.commands[math.ceil(loop.delay / self.period) + 3 :]
        self.forces.append(self.contact(x, v))


def run(case: Case, factor: float, seconds: float) -> bool:
    """Return whether the loop swings on or bounces at a factor on the gain."""
    builder: Any = DiagramBuilder()
    plant: Any = builder.AddSystem(MultibodyPlant(time_step=0.0))
    zero: Any = np.zeros(3)
    axis: Any = np.array([1.0, 0.0, 0.0])
    inertia = SpatialInertia(case.loop.mass, zero, UnitInertia(1.0, 1.0, 1.0))
    body = plant.AddRigidBody("robot", inertia)
    friction = 0.0 if case.loop.name == "admittance" else case.loop.friction
    joint: Any = plant.AddJoint(
        PrismaticJoint(
            "normal",
            plant.world_frame(),
            body.body_frame(),
            axis,
            damping=friction,
        )
    )
    plant.AddJointActuator("motor", joint)
    plant.mutable_gravity_field().set_gravity_vector(zero)
    plant.Finalize()
    loop: Any = builder.AddSystem(Loop(case, factor))
    builder.Connect(plant.get_state_output_port(), loop.plant_state)
    builder.Connect(loop.get_output_port(0), plant.get_actuation_input_port())
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    joint.set_translation_rate(plant.GetMyMutableContextFromRoot(context), case.loop.approach_speed)
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", STEP)
    simulator.get_mutable_integrator().set_fixed_step_mode(True)
    states = plant.GetMyContextFromRoot(context)
    bounced = False
    for k in range(1, round(seconds / STEP)):
        simulator.AdvanceTo(k * STEP)
        depth = joint.get_translation(states)
        if abs(depth) > 0.3:
            return True
        bounced = bounced or depth <= 0.0
    quarter = len(loop.forces) // 4
    third, last = loop.forces[2 * quarter : 3 * quarter], loop.forces[3 * quarter :]
    swing = max(last) - min(last)
    fades = swing <= 0.8 * (max(third) - min(third)) or swing <= 0.02 * case.loop.wanted_force
    return bounced or not fades
