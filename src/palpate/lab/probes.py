"""What carries the tip, and what it says of its course."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from palpate.lab.materials import Material
from palpate.lab.trajectories import Trajectory
from palpate.validation import Floats

#: Told now and then how far a run is, in seconds of its own clock.
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What the probe did, and what it felt: the truth, before any force sensor.

    Attributes
    ----------
    penetration, velocity, place, force : numpy.ndarray, shape (k,)
        Of the probe's tip: m, m/s, m and N.
    recorded_penetration : numpy.ndarray, shape (k,)
        m, as worked out from the probe's own sensors.
    """

    penetration: Floats
    velocity: Floats
    place: Floats
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
    ) -> Course:
        """Press ``material`` along ``trajectory``; times are s, evenly spaced, from 0 on."""


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
    ) -> Course:
        """Press ``material`` exactly along ``trajectory``."""
        command = trajectory.at(time)
        x, v = command.penetration, command.velocity
        return Course(x, v, command.place, material.force(time, command.place, x, v), x)
