"""A heavy carriage that carries a probe into a material, whichever engine simulates the contact."""

from typing import Protocol

import numpy as np
from cases import THREE_SINES, Floats

from palpate import Contact

SAMPLE_TIME = 1e-3  # s
SECONDS = 6.0
FREE = 2e-3  # m above the surface, where it starts
DEPTH = THREE_SINES.depth

# Heavy enough for the contact, some 20 N, to push it aside by hundredths of a millimetre only. How
# far does not matter: what is identified from is where the engine says that the probe was.
MASS = 1000.0  # kg
BANDWIDTH = 30.0  # rad/s, of the critically damped control


class Probe(Protocol):
    """One probe on one surface in one engine; every number is the engine's own."""

    engine: str

    def advance(self, time: float, push: float) -> None:
        """Simulate until ``time`` [s] under a constant push [N] into the material."""

    def position(self) -> float:
        """How far the tip is below the surface, m; negative out of contact."""

    def penetration(self) -> float:
        """The same by the engine's own contact geometry, where it sees a contact."""

    def velocity(self) -> float:
        """Into the material, m/s."""

    def force(self) -> float:
        """On the probe, out of the material, N: by the engine's contact model at this instant."""


def probed(probe: Probe) -> Contact:
    """What the engine shows at 1 kHz while the carriage follows the planned motion."""
    time, target, speed, acceleration = planned_motion()
    rows = np.empty((len(time) - 1, 3))
    for k in range(len(rows)):
        error, lag = target[k] - probe.position(), speed[k] - probe.velocity()
        wanted = acceleration[k] + BANDWIDTH**2 * error + 2.0 * BANDWIDTH * lag
        probe.advance(time[k + 1], MASS * wanted)
        rows[k] = probe.penetration(), probe.velocity(), probe.force()
    penetration, velocity, force = rows.T
    return Contact(
        time[1:], penetration=penetration, velocity=velocity, force=force, source=probe.engine
    )


def planned_motion() -> tuple[Floats, Floats, Floats, Floats]:
    """Time, position, speed and acceleration: down from the free in a second, then the sines."""
    time = SAMPLE_TIME * np.arange(round(SECONDS / SAMPLE_TIME) + 1)
    sines = THREE_SINES.at(time - 1.0)[0] - DEPTH
    position = -FREE + (FREE + DEPTH) * _rise(time) + _rise(time - 1.0) * sines
    speed = np.gradient(position, time)
    return time, position, speed, np.gradient(speed, time)


def _rise(time: Floats) -> Floats:
    """From 0 to 1 in a second, with no jump of acceleration."""
    s = np.clip(time, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
