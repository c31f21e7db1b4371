"""A material, a motion, a probe and its sensors, brought together."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.lab.materials import Material, Touch
from palpate.lab.rig import (
    IdealProbe,
    Probe,
    Progress,
    Sensors,
    SimulatedMotion,
    Simulation,
    TwinPantograph,
    rounded,
)
from palpate.lab.trajectories import Command, Trajectory, smooth_step
from palpate.preparation import prepare
from palpate.preparation.surfaces import deviation_left
from palpate.stages import timed
from palpate.validation import Floats, instance, number_in


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """What a run on the bench gave.

    Attributes
    ----------
    contact : Contact
        As the sensors recorded it, with the bias of the force removed; ``provenance`` holds the
        truth. Its velocity comes from the penetration, as for any recording.
    truth : Contact
        What really happened, on the same clock.
    command : Command
        What should have happened.
    """

    contact: Contact
    truth: Contact
    command: Command


@dataclass(frozen=True, slots=True)
class Bench:
    """A laboratory bench: one material, one motion, one probe, one set of sensors.

    Parameters
    ----------
    material : Material
        What is touched.
    trajectory : Trajectory
        How the probe is commanded to move.
    probe : Probe, optional
        The twin pantograph unless given (needs the extra ``lab``); :class:`IdealProbe` needs none.
    sensors : Sensors, optional
        Those of the paper unless given.
    """

    material: Material
    trajectory: Trajectory
    probe: Probe = field(default_factory=TwinPantograph)
    sensors: Sensors = field(default_factory=Sensors)

    def __post_init__(self) -> None:
        instance("material", self.material, Material)
        instance("trajectory", self.trajectory, Trajectory)
        instance("probe", self.probe, Probe)
        instance("sensors", self.sensors, Sensors)

    @timed("pressed")
    def run(
        self, seed: int = 0, *, seconds: float = 10.0, progress: Progress | None = None
    ) -> Measurement:
        """Press once; the same seed gives the same numbers.

        Parameters
        ----------
        seed : int
            Of noise, bias and encoder phases, ≥ 0.
        seconds : float
            Length of the recording, the trajectory's pause included, s, in (0, 1e5].
        progress : callable, optional
            Called now and then with the time reached, s.
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
        recorded = self._recorded(time, motion, random, seed)
        return Measurement(recorded, truth, self.trajectory.at(time))

    def _recorded(
        self, time: Floats, motion: SimulatedMotion, random: np.random.Generator, seed: int
    ) -> Contact:
        force = self.sensors.force(motion.force, random)
        resting = time < self.trajectory.pause
        tare = float(force[resting].mean()) if resting.any() else 0.0
        removed = "there is no pause: the force bias is still in"
        if samples := int(resting.sum()):
            removed = (
                f"force bias of {tare:.6g} N, the mean of {samples} samples of the pause, removed"
            )
        contact = prepare(
            time=time,
            penetration=rounded(motion.recorded_penetration, self.sensors.penetration_resolution),
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
        left = deviation_left(force, resting) if resting.any() else None
        return replace(contact, tare_deviation=left)


# A bench that goes on: what is touched and how the probe moves can be exchanged meanwhile.

#: s that the probe takes from one motion to the beginning of another.
TRANSITION = 0.5


class OngoingBench:
    """Presses without an end, some samples at a time, by the stepping of :meth:`Bench.run`.

    Parameters
    ----------
    bench : Bench
        What is touched at first, and how; its probe is one of the laboratory's own.
    seed : int
        Of noise, bias and encoder phases.

    Attributes
    ----------
    material : Material
        What is touched now.
    trajectory : Trajectory
        How the probe moves now.
    bias : float
        The force sensor's, N: what a tare should find.
    """

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        self.material, self.trajectory = bench.material, bench.trajectory
        self._bench, self._random = bench, np.random.default_rng(seed)
        self._step, self._count = bench.sensors.sample_time, 0
        self._motion: Callable[[Floats], Command] = bench.trajectory.at
        self._run = self._begin()
        self._touch = bench.material.touch()
        self.bias = bench.sensors.bias(self._random)
        self._transition = -np.inf  # when the last one began, s
        self._moving: Trajectory | None = None  # asked for during a transition
        self._placing: Material | None = None  # to be exchanged when the probe has left

    @property
    def now(self) -> float:
        """Time of the next sample, s."""
        return self._step * self._count

    def change(self, material: Material) -> None:
        """Have another material from now on, under the probe as it is."""
        self.material, self._touch = material, _from(material, self.now)
        self._placing = None

    def place(self, material: Material) -> None:
        """Lift the probe, exchange the material, and begin the motion again."""
        self._placing = material
        self.move(self.trajectory)

    def move(self, trajectory: Trajectory) -> None:
        """Go over to another motion's beginning, without a jump in position or speed."""
        if self.now < self._transition + TRANSITION:
            self._moving = trajectory  # the last one that is asked for
            return
        before, after, began = self._motion, trajectory.at, self.now

        def blended(time: Floats) -> Command:
            return _blended(before(time), after(time - began), time - began)

        self.trajectory, self._motion, self._transition = trajectory, blended, began

    def advance(self, count: int) -> Floats:
        """Go on by so many samples.

        Returns
        -------
        numpy.ndarray, shape (count, 3)
            Time [s], penetration [m] and force [N] as the sensors show them, bias included.

        Raises
        ------
        InvalidParameterError
            The robot's simulation broke down; it is at rest again, on the first material.
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
                rounded(motion.recorded_penetration, sensors.penetration_resolution),
                sensors.biased_force(motion.force, self.bias, self._random),
            )
        )

    def _go_over(self) -> None:
        """Do what waits for the end of a transition, when the probe is at rest above."""
        if self.now < self._transition + TRANSITION:
            return
        if self._transition > -np.inf:
            self._forget_the_motion_before(self._transition)
        if self._moving is not None:
            moving, self._moving = self._moving, None
            self.move(moving)
        elif self._placing is not None:
            self.change(self._placing)

    def _forget_the_motion_before(self, began: float) -> None:
        after = self.trajectory.at
        self._motion, self._transition = (lambda time: after(time - began)), -np.inf

    def _begin(self) -> IdealProbe | Simulation:
        probe: IdealProbe | TwinPantograph = self._bench.probe  # type: ignore[assignment]
        return probe.start(self._motion(np.array([self.now])), self._step, self._random)

    def _recover(self) -> None:
        self.trajectory = self._bench.trajectory
        self._forget_the_motion_before(self.now)
        self._moving = None
        self.change(self._bench.material)
        self._run = self._begin()


def _from(material: Material, began: float) -> Touch:
    """The force of a fresh material, whose time begins now."""
    touch = material.touch()
    return lambda time, lateral_position, penetration, velocity: touch(
        time - began, lateral_position, penetration, velocity
    )


def _blended(before: Command, after: Command, since: Floats) -> Command:
    """From one motion to another: x = x₀ + (x₁ − x₀) u, whose speed has u̇ (x₁ − x₀) in it."""
    blend, rate = smooth_step(since / TRANSITION)
    positions = [np.stack([each.penetration, each.lateral_position]) for each in (before, after)]
    speeds = [np.stack([each.velocity, each.lateral_velocity]) for each in (before, after)]
    way = positions[1] - positions[0]
    depth, lateral = positions[0] + way * blend
    inward, sideways = speeds[0] + (speeds[1] - speeds[0]) * blend + way * rate / TRANSITION
    return Command(depth, inward, lateral, sideways)
