"""A material, a motion, a probe and its sensors, brought together."""

import json
from dataclasses import dataclass, field, replace

import numpy as np

from palpate.contact import Contact
from palpate.lab.materials import Material
from palpate.lab.probes import Probe, Progress, SimulatedMotion
from palpate.lab.sensors import Sensors, rounded
from palpate.lab.trajectories import Command, Trajectory
from palpate.preparation import prepare
from palpate.preparation.tare import deviation_left
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


def _twin_pantograph() -> Probe:
    from palpate.lab.robot import TwinPantograph

    return TwinPantograph()


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
    probe: Probe = field(default_factory=_twin_pantograph)
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
        return Measurement(
            self._recorded(time, motion, random, seed),
            Contact(
                time,
                penetration=motion.penetration,
                velocity=motion.velocity,
                force=motion.force,
                source="truth",
            ),
            self.trajectory.at(time),
        )

    def _recorded(
        self, time: Floats, motion: SimulatedMotion, random: np.random.Generator, seed: int
    ) -> Contact:
        force = self.sensors.force(motion.force, random)
        resting = time < self.trajectory.pause
        tare = float(force[resting].mean()) if resting.any() else 0.0
        penetration = rounded(motion.recorded_penetration, self.sensors.penetration_resolution)
        contact = prepare(
            time=time,
            penetration=penetration,
            force=force - tare,
            source=f"{self.material.name}, {self.probe.name}, seed {seed}",
            provenance=self._history(tare, int(resting.sum()), seed),
        )
        left = deviation_left(force, resting) if resting.any() else None
        return replace(contact, tare_deviation=left)

    def _history(self, tare: float, samples: int, seed: int) -> dict[str, str]:
        removed = (
            f"force bias of {tare:.6g} N, the mean of {samples} samples of the pause, removed"
            if samples
            else "there is no pause: the force bias is still in"
        )
        return {
            "material": self.material.name,
            "truth": json.dumps(self.material.describe(), ensure_ascii=False),
            "trajectory": repr(self.trajectory),
            "probe": self.probe.name,
            "sensors": self.sensors.describe(),
            "tare": removed,
            "seed": str(seed),
        }
