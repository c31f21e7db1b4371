"""PyBullet itself: what it parses from the text, pressed and dropped."""

import ctypes
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from types import ModuleType

import numpy as np

from palpate.exports.errors import Drop
from palpate.exports.implicit import LONGEST, steps_down
from palpate.exports.motion import Motion
from palpate.validation import Floats
from palpate.writing import temporary_file

# kg. Of 100 N and a step of 10 ms it takes 10⁻⁹ m/s.
HEAVY = 1e9


class Scene:
    """A free tip above a surface, in a simulation of its own; see :func:`scene`."""

    def __init__(self, bullet: ModuleType, client: int, radius: float) -> None:
        self._bullet, self.client, self._radius = bullet, client, radius
        self.surface, self.tip = -1, -1

    def load(self, texts: Mapping[str, str]) -> None:
        """Read surface.urdf and tip.urdf."""
        self.surface = self._read("surface.urdf", texts)
        self.tip = self._read("tip.urdf", texts)
        self._bullet.changeDynamics(
            self.tip, -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=self.client
        )

    def weigh(self, mass: float) -> None:
        """Give the tip a mass [kg]."""
        inertia = 0.4 * mass * self._radius**2
        self._bullet.changeDynamics(
            self.tip,
            -1,
            mass=mass,
            localInertiaDiagonal=[inertia] * 3,
            physicsClientId=self.client,
        )

    def put(self, penetration: float, velocity: float) -> None:
        """Put the tip somewhere, at a velocity into the surface; m and m/s."""
        self._bullet.resetBasePositionAndOrientation(
            self.tip,
            [0.0, 0.0, self._radius - penetration],
            [0.0, 0.0, 0.0, 1.0],
            physicsClientId=self.client,
        )
        self._bullet.resetBaseVelocity(
            self.tip, [0.0, 0.0, -velocity], [0.0] * 3, physicsClientId=self.client
        )

    def step(self) -> float:
        """Take a step, and return the force on the tip in it, N."""
        self._bullet.stepSimulation(physicsClientId=self.client)
        points = self._bullet.getContactPoints(self.tip, self.surface, physicsClientId=self.client)
        return float(sum(point[9] for point in points))

    def state(self) -> tuple[float, float]:
        """Penetration, m, and velocity into the surface, m/s."""
        place = self._bullet.getBasePositionAndOrientation(self.tip, physicsClientId=self.client)
        velocity = self._bullet.getBaseVelocity(self.tip, physicsClientId=self.client)
        return self._radius - place[0][2], -velocity[0][2]

    def _read(self, name: str, texts: Mapping[str, str]) -> int:
        with temporary_file(name, [texts[name].encode()]) as path:
            body: int = self._bullet.loadURDF(
                str(path), useFixedBase=name == "surface.urdf", physicsClientId=self.client
            )
        return body


@contextmanager
def scene(texts: Mapping[str, str], radius: float, time_step: float) -> Iterator[Scene]:
    """A scene of these files, without weight, and gone at the end."""
    pybullet = quiet_pybullet()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        # Files are cached by their names, and a slop of 10⁻⁵ m is taken off the depth unless set.
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=time_step,
            numSubSteps=0,
            contactSlop=0.0,
            enableFileCaching=0,
            physicsClientId=client,
        )
        made = Scene(pybullet, client, radius)
        made.load(texts)
        yield made
    finally:
        pybullet.disconnect(physicsClientId=client)


def forces(texts: Mapping[str, str], radius: float, time_step: float, motion: Motion) -> Floats:
    """Return the force of the step that begins at every state of a motion, N."""
    force = np.empty(len(motion))
    with scene(texts, radius, time_step) as there:
        there.weigh(HEAVY)
        for k in range(len(motion)):
            there.put(float(motion.penetration[k]), float(motion.velocity[k]))
            force[k] = there.step()
    return force


def rebound(texts: Mapping[str, str], radius: float, time_step: float, drop: Drop) -> float:
    """Restitution of a body of the drop's mass, by steps; 0 of one that stays."""
    with scene(texts, radius, time_step) as there:
        there.weigh(drop.mass)
        there.put(0.0, drop.speed)
        for _ in range(math.ceil(LONGEST * steps_down(drop, time_step)) + 10):
            there.step()
            x, v = there.state()
            if x <= 0.0 and v < 0.0:
                return -v / drop.speed
            if not math.isfinite(v):
                break
    return 0.0


def quiet_pybullet() -> ModuleType:
    """PyBullet, which says as it is imported when it was built: here to nobody.

    It does so from C, on standard output or error by its version; a command's output may be JSON,
    and its errors are one line.
    """
    kept = {}
    for descriptor in (1, 2):
        with suppress(OSError):  # there is none
            kept[descriptor] = os.dup(descriptor)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor in kept:
            os.dup2(nowhere, descriptor)
        module = import_module("pybullet")
        # C keeps what is printed until the process ends.
        with suppress(OSError, AttributeError, TypeError):
            ctypes.CDLL(None).fflush(None)
        return module
    finally:
        os.close(nowhere)
        for descriptor, copy in kept.items():
            os.dup2(copy, descriptor)
            os.close(copy)
