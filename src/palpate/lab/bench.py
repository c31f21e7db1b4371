"""The laboratory bench: a material, a motion, a probe and its sensors."""

import json
from collections.abc import Callable
from dataclasses import field, replace

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.input.preparation import prepare
from palpate.input.preparation.resolution import deviation_of_mean
from palpate.lab.materials import Material, Touch
from palpate.lab.rig import (
    IdealProbe,
    Probe,
    Progress,
    Sensors,
    SimulatedMotion,
    Simulation,
    TwinPantograph,
    quantise,
)
from palpate.lab.trajectories import Command, Trajectory, smooth_step
from palpate.method.contact import Contact
from palpate.stages import log_stage
from palpate.validation import Floats, frozen, instance, number_in


@frozen(eq=False)
class Measurement:
    """Result of a run on the bench.

    Attributes
    ----------
    contact : Contact
        The recorded contact, with the force bias removed; ``provenance`` holds the true parameters.
        Its velocity is computed from the penetration, as for any recording.
    truth : Contact
        The true motion and force, on the same clock.
    command : Command
        The commanded motion.
    """

    contact: Contact
    truth: Contact
    command: Command

    def __repr__(self) -> str:
        return f"<Measurement: {self.contact!r}>"


@frozen
class Bench:
    """A laboratory bench: one material, one motion, one probe, one set of sensors.

    Parameters
    ----------
    material : Material
        The touched material.
    trajectory : Trajectory
        The commanded motion.
    probe : Probe, optional
        Default: the twin pantograph, which needs the extra ``lab``; :class:`IdealProbe` does not.
    sensors : Sensors, optional
        Default: those of the paper.
    """

    material: Material
    trajectory: Trajectory
    probe: Probe = field(default_factory=TwinPantograph)
    sensors: Sensors = field(default_factory=Sensors)

    def __repr__(self) -> str:
        names = self.material.name, self.probe.name, type(self.trajectory).__name__
        return f"<Bench: {', '.join(names)}>"

    def __post_init__(self) -> None:
        instance("material", self.material, Material)
        instance("trajectory", self.trajectory, Trajectory)
        instance("probe", self.probe, Probe)
        instance("sensors", self.sensors, Sensors)

    @log_stage("pressed")
    def run(
        self,
        seed: int = 0,
        *,
        seconds: float = 10.0,
        progress: Progress | None = None,
    ) -> Measurement:
        """Simulate one touch; the same seed gives the same numbers.

        Parameters
        ----------
        seed : int
            Random seed of noise, bias and encoder phases, ≥ 0.
        seconds : float
            Duration of the recording, including the trajectory's pause, s, in (0, 1e5].
        progress : callable, optional
            Called from time to time with the simulated time, s.
        """
        length = number_in("seconds", seconds, 0.0, 1e5, open_low=True)
        seed = int(number_in("seed", seed, 0, 2**63))
        step = self.sensors.sample_time
        time: Floats = step * np.arange(max(round(length / step), 1), dtype=np.float64)
        random = np.random.default_rng(seed)
        motion = self.probe.follow(self.trajectory, self.material, time, random, progress)
        truth = Contact(
            time,
            penetration=motion.penetration,
            velocity=motion.velocity,
            force=motion.force,
            source="truth",
        )
        recorded = self._record_contact(time, motion, random, seed)
        return Measurement(recorded, truth, self.trajectory.at(time))

    def _record_contact(
        self,
        time: Floats,
        motion: SimulatedMotion,
        random: np.random.Generator,
        seed: int,
    ) -> Contact:
        force = self.sensors.force(motion.force, random)
        resting = time < self.trajectory.pause
        tare = float(force[resting].mean()) if resting.any() else 0.0
        removed = "force bias not removed: the trajectory has no pause"
        if samples := int(resting.sum()):
            removed = (
                f"force bias of {tare:.6g} N, the mean of {samples} samples of the pause, removed"
            )
        contact = prepare(
            time=time,
            penetration=quantise(motion.recorded_penetration, self.sensors.penetration_resolution),
            force=force - tare,
            source=f"{self.material.name}, {self.probe.name}, seed {seed}",
            provenance={
                "material": self.material.name,
                "truth": json.dumps(self.material.describe(), ensure_ascii=False),
                "trajectory": repr(self.trajectory),
                "probe": self.probe.name,
                "sensors": self.sensors.describe(),
                "tare": removed,
                "seed": str(seed),
            },
        )
        left = deviation_of_mean(force, resting) if resting.any() else None
        return replace(contact, tare_deviation=left)


# A continuous bench: material and motion can change while it runs.

#: Duration of the transition from one motion to the beginning of another, s.
TRANSITION = 0.5


class OngoingBench:
    """A bench that runs without end, some samples at a time, as :meth:`Bench.run` does.

    Parameters
    ----------
    bench : Bench
        Initial material and motion; the probe is :class:`IdealProbe` or :class:`TwinPantograph`.
    seed : int
        Random seed of noise, bias and encoder phases.

    Attributes
    ----------
    material : Material
        The current material.
    trajectory : Trajectory
        The current motion.
    bias : float
        Bias of the force sensor, N, which a tare should find.
    """

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        self.material = bench.material
        self.trajectory = bench.trajectory
        self._bench = bench
        self._random = np.random.default_rng(seed)
        self._step = bench.sensors.sample_time
        self._count = 0
        self._motion: Callable[[Floats], Command] = bench.trajectory.at
        self._run = self._begin()
        self._touch = bench.material.touch()
        self.bias = bench.sensors.bias(self._random)
        self._transition = -np.inf  # start of the last one, s
        self._moving: Trajectory | None = None  # requested during a transition
        self._placing: Material | None = None  # replaces the material once the probe has left

    @property
    def now(self) -> float:
        """Time of the next sample, s."""
        return self._step * self._count

    def change(self, material: Material) -> None:
        """Replace the material at once, under the probe at its present depth."""
        self.material, self._touch = material, _start_touch(material, self.now)
        self._placing = None

    def place(self, material: Material) -> None:
        """Lift the probe, replace the material, and start the motion again."""
        self._placing = material
        self.move(self.trajectory)

    def move(self, trajectory: Trajectory) -> None:
        """Change to another motion, without a jump in position or speed."""
        if self.now < self._transition + TRANSITION:
            self._moving = trajectory  # the last request counts
            return
        before = self._motion
        after = trajectory.at
        began = self.now

        def blended(time: Floats) -> Command:
            return _blend_commands(before(time), after(time - began), time - began)

        self.trajectory = trajectory
        self._motion = blended
        self._transition = began

    def advance(self, count: int) -> Floats:
        """Advance by ``count`` samples.

        Returns
        -------
        numpy.ndarray, shape (count, 3)
            Time [s], penetration [m] and force [N] as the sensors show them, including the bias.

        Raises
        ------
        InvalidParameterError
            The robot's simulation diverged; it restarts at rest, on the first material.
        """
        self._go_over()
        sensors = self._bench.sensors
        time: Floats = self._step * np.arange(self._count, self._count + count, dtype=np.float64)
        try:
            motion = self._run.simulate(time, self._motion(time), self._touch)
        except InvalidParameterError:
            self._recover()
            raise
        self._count += count
        return np.column_stack(
            (
                time,
                quantise(motion.recorded_penetration, sensors.penetration_resolution),
                sensors.measure_force(motion.force, self.bias, self._random),
            )
        )

    def _go_over(self) -> None:
        """Start what waited for the end of a transition, with the probe at rest above."""
        if self.now < self._transition + TRANSITION:
            return
        if self._transition > -np.inf:
            self._forget_the_motion_before(self._transition)
        if self._moving is not None:
            moving = self._moving
            self._moving = None
            self.move(moving)
        elif self._placing is not None:
            self.change(self._placing)

    def _forget_the_motion_before(self, began: float) -> None:
        after = self.trajectory.at
        self._motion = lambda time: after(time - began)
        self._transition = -np.inf

    def _begin(self) -> IdealProbe | Simulation:
        probe: IdealProbe | TwinPantograph = self._bench.probe  # type: ignore[assignment]
        return probe.start(self._motion(np.array([self.now])), self._step, self._random)

    def _recover(self) -> None:
        self.trajectory = self._bench.trajectory
        self._forget_the_motion_before(self.now)
        self._moving = None
        self.change(self._bench.material)
        self._run = self._begin()


def _start_touch(material: Material, began: float) -> Touch:
    """The force of an untouched material whose time starts at ``began``."""
    touch = material.touch()
    return lambda time, lateral_position, penetration, velocity: touch(
        time - began,
        lateral_position,
        penetration,
        velocity,
    )


def _blend_commands(before: Command, after: Command, since: Floats) -> Command:
    """Blend of two motions: x = x₀ + (x₁ − x₀) u, whose speed includes u̇ (x₁ − x₀)."""
    blend, rate = smooth_step(since / TRANSITION)
    positions = [np.stack([each.penetration, each.lateral_position]) for each in (before, after)]
    speeds = [np.stack([each.velocity, each.lateral_velocity]) for each in (before, after)]
    way = positions[1] - positions[0]
    depth, lateral = positions[0] + way * blend
    inward, sideways = speeds[0] + (speeds[1] - speeds[0]) * blend + way * rate / TRANSITION
    return Command(depth, inward, lateral, sideways)
