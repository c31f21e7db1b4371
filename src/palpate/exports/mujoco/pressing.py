"""A tip of a compiled model on a surface, moved by inverse dynamics."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.exports.motion import Motion
from palpate.exports.mujoco.texts import Place
from palpate.lab.robot import require_mujoco
from palpate.validation import Floats


def engine_here() -> Any:
    """Return MuJoCo, or say how to install it."""
    return require_mujoco("a model of MuJoCo needs MuJoCo: pip install 'palpate[exports]'")


@dataclass(frozen=True, slots=True, eq=False)
class Pressed:
    """A model in which a geom can be pressed into surfaces.

    Attributes
    ----------
    mujoco : module
        The engine.
    model, data : mujoco.MjModel, mujoco.MjData
        In the pose in which it touches.
    tip : int
        The geom.
    pads : tuple of int
        The surfaces.
    place : Place
        Where they are at first touch.
    surface : int, optional
        The body of the surfaces, by its place among those that are moved by hand (mocap); without
        it they stand in the world, and the first joint moves the tip out of the material.
    """

    mujoco: Any
    model: Any
    data: Any
    tip: int
    pads: tuple[int, ...]
    place: Place
    surface: int | None = None

    def sink(self, penetration: float) -> None:
        """Put the tip by so much below the surface [m]: raise that, or lower the scene's slide."""
        if self.surface is None:
            self.data.qpos[0] = -penetration
            return
        raised = penetration * np.asarray(self.place.normal)
        self.data.mocap_pos[self.surface] = np.asarray(self.place.position) + raised

    def along(self) -> Floats:
        """Velocities of the joints that move the tip by 1 m/s out of the material."""
        across = np.zeros((3, self.model.nv))
        body = self.model.geom_bodyid[self.tip]
        point = np.asarray(self.place.position)
        self.mujoco.mj_jac(self.model, self.data, across, None, point, body)
        row = np.asarray(self.place.normal) @ across
        size = float(row @ row)
        return row / size if size > 0.0 else np.full(self.model.nv, np.nan)

    def mass(self) -> float:
        """Of the model along the normal, kg: 1/(J M⁻¹ Jᵀ)."""
        out = self.along()
        row = np.array([out / float(out @ out)])
        answer = np.zeros_like(row)
        self.mujoco.mj_solveM(self.model, self.data, answer, row)
        return 1.0 / float(row[0] @ answer[0])

    def contacts(self, pad: int) -> list[int]:
        """Places in the data of the contacts between a surface and the tip."""
        both = {pad, self.tip}
        found = self.data.contact
        return [k for k in range(self.data.ncon) if set(found.geom[k].tolist()) == both]

    def force(self) -> float:
        """What the surfaces push with, N, as MuJoCo reports it of its contacts."""
        felt, total = np.zeros(6), 0.0
        for pad in self.pads:
            for k in self.contacts(pad):
                self.mujoco.mj_contactForce(self.model, self.data, k, felt)
                total += float(felt[0])
        return total

    def counts(self, depths: Floats) -> set[int]:
        """How many contacts the tip has with one surface, at depths [m]."""
        seen = set()
        for depth in depths.tolist():
            self.sink(depth)
            self.mujoco.mj_forward(self.model, self.data)
            seen.add(len(self.contacts(self.pads[0])))
        return seen

    def along_motion(self, motion: Motion) -> Floats:
        """Force at every state of a motion, N, by inverse dynamics: no state leads to the next.

        The surface is set to the penetration, and the joints are given the velocity and the
        acceleration that move the tip as the motion has it: what a row is made of.
        """
        out = self.along()
        force = np.zeros(len(motion))
        x, v, a = motion.penetration, motion.velocity, motion.acceleration
        for k in range(len(motion)):
            self.sink(float(x[k]))
            self.data.qvel[:] = -v[k] * out
            self.data.qacc[:] = -a[k] * out
            self.mujoco.mj_inverse(self.model, self.data)
            force[k] = self.force()
        return force
