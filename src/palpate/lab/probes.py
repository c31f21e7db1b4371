"""What carries the tip, and what it records of its motion."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from palpate.lab.materials import Material, Touch
from palpate.lab.trajectories import Command, Trajectory
from palpate.validation import Floats

#: Called now and then with how far a run is, in seconds of its own clock.
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedMotion:
    """What the probe did, and what it felt: the truth, before any force sensor.

    Attributes
    ----------
    penetration, velocity, lateral_position, force : numpy.ndarray, shape (k,)
        Of the probe's tip: m, m/s, m and N.
    recorded_penetration : numpy.ndarray, shape (k,)
        m, as worked out from the probe's own sensors.
    """

    penetration: Floats
    velocity: Floats
    lateral_position: Floats
    force: Floats
    recorded_penetration: Floats


@runtime_checkable
class Probe(Protocol):
    """What carries the tip along a trajectory."""

    @property
    def name(self) -> str:
        """What a person calls it."""

    def follow(
        self,
        trajectory: Trajectory,
        material: Material,
        time: Floats,
        random: np.random.Generator,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Press ``material`` along ``trajectory``; times are s, evenly spaced, from 0 on."""


class Run(Protocol):
    """A probe that has begun, and goes on as it is told."""

    def simulate(
        self, time: Floats, command: Command, touch: Touch, progress: Progress | None = None
    ) -> SimulatedMotion:
        """Follow a command over its times [s]; the next call continues from where this one ends."""


@dataclass(frozen=True, slots=True)
class IdealProbe:
    """A tip that is where the command says, without a robot: for statistics."""

    name: str = "ideal probe"

    def follow(
        self,
        trajectory: Trajectory,
        material: Material,
        time: Floats,
        random: np.random.Generator,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Press ``material`` exactly along ``trajectory``."""
        command = trajectory.at(time)
        x, v = command.penetration, command.velocity
        return SimulatedMotion(
            x, v, command.lateral_position, material.force(time, command.lateral_position, x, v), x
        )

    def start(
        self, command: Command, sample_time: float, random: np.random.Generator
    ) -> "IdealRun":
        """Return a tip that follows this command, and any that continue it."""
        return IdealRun()


class IdealRun:
    """A tip that is where the command says, a stretch of it at a time."""

    def simulate(
        self, time: Floats, command: Command, touch: Touch, progress: Progress | None = None
    ) -> SimulatedMotion:
        """Follow a command over its times [s]."""
        x, v = command.penetration, command.velocity
        lateral = command.lateral_position
        columns = (each.tolist() for each in (time, lateral, x, v))
        force = np.array([touch(*sample) for sample in zip(*columns, strict=True)])
        return SimulatedMotion(x, v, lateral, force, x)
