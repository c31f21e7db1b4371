"""Commanded motions of the probe: into the surface, and along it."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError, RecordingError, import_extra
from palpate.lab.design.motion import PAPER_MOTION, Motion
from palpate.validation import Floats, frozen, instance, number_in, signals

# Elementary functions of the C library, over arrays.
#
# NumPy's own functions differ in the last digit between processors. The simulated robot amplifies
# that: between two encoder counts position control has no feedback, and the poking device, pushed
# from behind, diverges from 1e-16 m to a micrometre within half a second. With the C library the
# same seed gives the same file on every processor.


sin = np.vectorize(math.sin, otypes=[np.float64])
cos = np.vectorize(math.cos, otypes=[np.float64])
arccos = np.vectorize(math.acos, otypes=[np.float64])
arctan2 = np.vectorize(math.atan2, otypes=[np.float64])


# Trajectories.


@runtime_checkable
class Trajectory(Protocol):
    """A command over time; ``at`` is called with increasing times from 0 s on."""

    @property
    def pause(self) -> float:
        """Initial time at rest, s, in which the force sensor's bias is measured."""

    def at(self, time: Floats) -> "Command":
        """Return the command at times [s], shape (k,)."""


@frozen(eq=False)
class Command:
    """Commanded position and velocity of the probe.

    Attributes
    ----------
    penetration, velocity : numpy.ndarray, shape (k,)
        m below the surface, and m/s.
    lateral_position, lateral_velocity : numpy.ndarray, shape (k,)
        m along the surface, and m/s.
    """

    penetration: Floats
    velocity: Floats
    lateral_position: Floats
    lateral_velocity: Floats

    @classmethod
    def inward(cls, penetration: Floats, velocity: Floats) -> "Command":
        """A command along the normal of the surface, at the lateral position 0."""
        still = np.zeros_like(penetration)
        return cls(penetration, velocity, still, still)


@frozen
class Probing:
    """A pause above the surface, a smooth approach, then sines in the material.

    x(t) = −c + (x₀ + c + Σ aᵢ sin ωᵢ(t − tₛ)) u(t),   u from 0 to 1 between t₀ and tₛ

    with the pause t₀ = 2 s of section IV. The sines have full amplitude from tₛ = 2.417 s on: the
    paper's three sines coincide 2π s later, where it violates condition (10), at t = 8.7 s.

    Parameters
    ----------
    motion : Motion
        Depth x₀ and sines.
    clearance : float
        c, m above the surface during the pause, in [0, 1].
    pause : float
        t₀, s, in [0, 1e4].
    approach : float
        tₛ − t₀, s, in (0, 1e3].
    """

    motion: Motion = PAPER_MOTION
    clearance: float = 0.5e-3
    pause: float = 2.0
    approach: float = 0.417

    def __post_init__(self) -> None:
        instance("motion", self.motion, Motion)
        number_in("clearance", self.clearance, 0.0, 1.0)
        number_in("pause", self.pause, 0.0, 1e4)
        number_in("approach", self.approach, 0.0, 1e3, open_low=True)

    def at(self, time: Floats) -> Command:
        """Return the command at times [s], shape (k,)."""
        since = time - self.pause
        blend, rate = smooth_step(since / self.approach)
        x, v = self.motion.at(since - self.approach)
        return Command.inward(
            (x + self.clearance) * blend - self.clearance,
            v * blend + (x + self.clearance) * rate / self.approach,
        )


@frozen
class Palpation:
    """Probing at two lateral positions in turn, sliding between them in contact.

    Parameters
    ----------
    probing : Probing
        The motion into the surface, which continues throughout.
    dwell : float
        Time from contact to the middle of the first slide, and between slides, s, in (0, 1e4].
    distance : float
        Distance of the two lateral positions, symmetric about 0, m, in (0, 1].
    shift : float
        Duration of a slide, s, in (0, dwell].
    """

    probing: Probing = Probing()
    dwell: float = 5.0
    distance: float = 0.02
    shift: float = 0.5

    def __post_init__(self) -> None:
        instance("probing", self.probing, Probing)
        number_in("dwell", self.dwell, 0.0, 1e4, open_low=True)
        number_in("distance", self.distance, 0.0, 1.0, open_low=True)
        number_in("shift", self.shift, 0.0, self.dwell, open_low=True)

    @property
    def pause(self) -> float:
        """Initial time at rest, s."""
        return self.probing.pause

    def at(self, time: Floats) -> Command:
        """Return the command at times [s], shape (k,)."""
        since = time - self.pause
        change = np.maximum(np.round(since / self.dwell), 1.0)
        blend, rate = smooth_step((since - change * self.dwell) / self.shift + 0.5)
        sign = np.where(change % 2.0 == 1.0, 1.0, -1.0)
        inward = self.probing.at(time)
        return replace(
            inward,
            lateral_position=sign * self.distance * (blend - 0.5),
            lateral_velocity=sign * self.distance * rate / self.shift,
        )


@frozen
class Tapping:
    """Strokes that leave the material between two touches.

    x(t) = −c + (c + aₖ) sin² π f(t − t₀),   with the depths aₖ in turn

    Parameters
    ----------
    depths : tuple of float
        aₖ, m, each in (0, 1]; different depths identify the exponent better.
    rate : float
        f, strokes per second, in (0, 100].
    clearance : float
        c, m, in [0, 1].
    pause : float
        t₀, s, in [0, 1e4].
    """

    depths: tuple[float, ...] = (12e-3, 8e-3, 10e-3)
    rate: float = 1.4
    clearance: float = 3e-3
    pause: float = 2.0

    def __post_init__(self) -> None:
        if not self.depths:
            raise InvalidParameterError("depths must have at least one depth, m")
        for depth in self.depths:
            number_in("depths", depth, 0.0, 1.0, open_low=True)
        number_in("rate", self.rate, 0.0, 100.0, open_low=True)
        number_in("clearance", self.clearance, 0.0, 1.0)
        number_in("pause", self.pause, 0.0, 1e4)

    def at(self, time: Floats) -> Command:
        """Return the command at times [s], shape (k,)."""
        turns = np.maximum(time - self.pause, 0.0) * self.rate
        stroke = np.array(self.depths)[turns.astype(np.int64) % len(self.depths)] + self.clearance
        return Command.inward(
            stroke * np.square(sin(math.pi * turns)) - self.clearance,
            stroke * math.pi * self.rate * sin(2.0 * math.pi * turns),
        )


class SplineTrajectory:
    """A user-defined motion: a cubic spline through samples, at rest before and after.

    Parameters
    ----------
    time, penetration : array_like, shape (k,)
        s, strictly increasing from 0 or later, and m; at least four samples.
    pause : float
        Initial time at rest in the samples, s, ≥ 0, for the sensor's bias. Default: 0.
    """

    def __init__(self, time: "ArrayLike", penetration: "ArrayLike", *, pause: float = 0.0) -> None:
        interpolate = import_extra(
            "scipy.interpolate",
            "a trajectory from a file or samples",
            "lab",
        )
        t, x = signals(time=time, penetration=penetration)
        if t.size < 4 or not (np.isfinite(t).all() and np.isfinite(x).all()):
            raise InvalidParameterError(
                "time and penetration must have at least four finite samples each"
            )
        if t[0] < 0.0 or (np.diff(t) <= 0.0).any():
            raise InvalidParameterError("time must increase from 0 s or later")
        self.pause = number_in("pause", pause, 0.0, 1e4)
        self._ends = float(t[0]), float(t[-1])
        self._spline = interpolate.CubicSpline(t, x, bc_type="clamped")

    @classmethod
    def read(cls, path: str | Path) -> "SplineTrajectory":
        """Return the motion in a CSV file's columns time_s and penetration_m."""
        from palpate.input.recordings import open_recording

        recording = open_recording(path)
        time = recording.numbers("time_s")
        penetration = recording.numbers("penetration_m")
        moved = np.flatnonzero(penetration != penetration[0])
        pause = float(time[max(moved[0] - 1, 0)]) if moved.size else 0.0
        try:
            return cls(time, penetration, pause=pause)
        except InvalidParameterError as error:
            raise RecordingError(f"{recording.source}: {error}") from None

    def __repr__(self) -> str:
        samples = self._spline.x.size
        (start, stop) = self._ends
        span = f"{samples} samples from {start:g} s to {stop:g} s"
        return f"SplineTrajectory({span}, pause={self.pause:g})"

    def at(self, time: Floats) -> Command:
        """Return the command at times [s], shape (k,)."""
        inside = np.clip(time, *self._ends)
        velocity = np.where(inside == time, self._spline(inside, 1), 0.0)
        return Command.inward(self._spline(inside), velocity)


def smooth_step(u: Floats) -> tuple[Floats, Floats]:
    """A step from 0 to 1 for u from 0 to 1, with continuous acceleration; and its derivative."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u), 30.0 * u * u * (1.0 - u) * (1.0 - u)


THREE_SINES = Probing()
TWO_SINES = Probing(Motion(10e-3, (1.8e-3, 1.8e-3), (11.0, 15.0)))
ONE_SINE = Probing(Motion(10e-3, (1.8e-3,), (11.0,)))
# The three sines reach 4.01 mm to either side: at this depth the probe sometimes leaves the surface
# at speed, where a linear damper gives a negative force (Fig. 10).
NEAR_SURFACE = Probing(Motion(3.8e-3, PAPER_MOTION.amplitudes, PAPER_MOTION.frequencies))
PALPATION = Palpation()
TAPPING = Tapping()

#: The laboratory's trajectories by their names on the command line.
TRAJECTORIES: Mapping[str, Trajectory] = {
    "three-sines": THREE_SINES,
    "two-sines": TWO_SINES,
    "one-sine": ONE_SINE,
    "near-surface": NEAR_SURFACE,
    "palpation": PALPATION,
    "tapping": TAPPING,
}
