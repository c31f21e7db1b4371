"""What is exported to MuJoCo: rows, or the law itself as a callback."""

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import MissingExtraError
from palpate.exports.engine import Fragment, Replayed
from palpate.exports.errors import Drop, drop_to
from palpate.exports.motion import Motion
from palpate.exports.mujoco import callback, texts
from palpate.exports.mujoco.pressing import Pressed, engine_here
from palpate.exports.mujoco.rebounding import MOST_STEPS, rebound
from palpate.exports.mujoco.robot import Robot, compiled
from palpate.exports.mujoco.rows import Rows
from palpate.exports.mujoco.texts import PADS, TIP, Place
from palpate.validation import Floats

#: How the real engine was moved, in words.
BY_INVERSE = "by mj_inverse, state by state"


@dataclass(frozen=True, eq=False, kw_only=True)
class _InMuJoCo(Fragment):
    """What both ways have in common: where it touches, and the small scene.

    Attributes
    ----------
    mobility : float
        Â, 1/kg; of the scene's body it is 1/mass.
    robot : Robot, optional
        The user's own model.
    runs : bool
        Whether the installed engine has what it takes.
    """

    mobility: float
    robot: Robot | None = None
    runs: bool = True

    @property
    def tip(self) -> str:
        """What the geom that touches is called."""
        return TIP if self.robot is None else self.robot.geom

    @property
    def place(self) -> Place:
        """Where the surface is."""
        return Place() if self.robot is None else self.robot.place

    def scene(self, speed: float, notes: Sequence[str] = ()) -> str:
        """The smallest scene, of a body that arrives at a speed [m/s]."""
        rows = self.scene_rows()
        depth, step = self.asked.motion.deepest, self.asked.time_step
        return texts.scene(
            rows, mass=1.0 / self.mobility, time_step=step, speed=speed, depth=depth, notes=notes
        )

    @property
    def how(self) -> str:
        """How the real engine is moved, in words."""
        return BY_INVERSE if self.robot is None else f"{BY_INVERSE}, in {self.robot.path.name}"

    def scene_rows(self) -> Rows | None:
        """The rows of the scene, whose tip has one contact."""
        return None

    def pressed(self) -> Pressed:
        """Return the user's model with the fragment in it, or the small scene."""
        raise NotImplementedError

    def installed(self, model: Any) -> AbstractContextManager[Any]:
        """Have in force, meanwhile, what the scene itself does not say."""
        return nullcontext()

    def rebound(self, drop: Drop) -> float | None:
        """Restitution in the small scene, of a body of Â's mass."""
        if not self.runs or not math.isclose(drop.mass * self.mobility, 1.0, rel_tol=1e-6):
            return None
        try:
            mujoco = engine_here()
        except MissingExtraError:
            return None
        model = mujoco.MjModel.from_xml_string(self.scene(drop.speed))
        with self.installed(model):
            return _thrown(mujoco, model)

    def _small(self, count: int) -> Pressed:
        mujoco = engine_here()
        model = mujoco.MjModel.from_xml_string(self.scene(0.0))
        return compiled(mujoco, model, TIP, count, Place())

    def _files(self, first: Mapping[str, str], notes: Sequence[str]) -> Mapping[str, str]:
        law, deepest = self.asked.law, self.asked.motion.deepest
        speed = drop_to(law, 1.0 / self.mobility, deepest).speed if law.stiffness > 0.0 else 0.1
        files = {**first, "scene.xml": self.scene(speed, notes)}
        if self.robot is not None and self.robot.path.suffix == ".xml":
            path, (meshes, textures) = self.robot.path, self.robot.asset_folders
            here = [
                *notes,
                'Load it by mujoco.MjModel.from_xml_path("robot_scene.xml"): it includes '
                f"{path.name} and contact.xml.",
                "Take your own surface out, or let it not collide with the tip: both would push.",
            ]
            files["robot_scene.xml"] = texts.robot(path, meshes, textures, here)
        return files


@dataclass(frozen=True, eq=False, kw_only=True)
class InRows(_InMuJoCo):
    """A law as one contact, or as several at the same place.

    Attributes
    ----------
    rows : Rows
        Their numbers.
    """

    rows: Rows

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the pads and pairs, and scenes that have them."""
        text = texts.fragment(self.rows, self.tip, self.place, notes)
        return self._files({"contact.xml": text}, notes)

    def scene_rows(self) -> Rows:
        """The rows, of one contact."""
        return texts.as_one_contact(self.rows)

    def predicted(self, motion: Motion) -> Floats:
        """Of the rows: the law as fitted, and Σ m_a ẍ."""
        return self.rows.force(motion.penetration, motion.velocity, motion.acceleration)

    def predicted_rebound(self, drop: Drop) -> float:
        """Of the rows, by the time step."""
        return rebound(self.rows, drop, self.asked.time_step)

    def pressed(self) -> Pressed:
        """Return the user's model with the pairs in it, or the small scene."""
        if self.robot is not None:
            return self.robot.pressed(self.rows.rows)
        return self._small(len(self.rows.rows))

    def replay(self, motion: Motion) -> Replayed | None:
        """Force by inverse dynamics, in the user's own model where there is one."""
        if not self.runs:
            return None
        try:
            return Replayed(self.pressed().along_motion(motion), self.how)
        except MissingExtraError:
            return None


@dataclass(frozen=True, eq=False, kw_only=True)
class AsCallback(_InMuJoCo):
    """The law itself, in Python, called at every step."""

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return the module, its numbers and names, and a scene for it."""
        # Names of a model are data: none of them enters the source, not even as a comment.
        source = Path(str(callback.__file__)).read_text(encoding="utf-8")
        numbers = json.dumps({**self._contact(self.tip), "notes": list(notes)}, indent=1)
        files = {"palpate_contact.py": source, "palpate_contact.json": numbers + "\n"}
        if self.robot is not None:
            files["contact.xml"] = texts.fragment(None, self.tip, self.place, notes)
        return self._files(files, notes)

    def _contact(self, tip: str) -> dict[str, Any]:
        names = ("stiffness", "exponent", "damping", "damping_exponent")
        law = self.asked.law
        return {**{name: getattr(law, name) for name in names}, "tip": tip, "pad": PADS[0]}

    def predicted(self, motion: Motion) -> Floats:
        """The law's, at least 0: a contact does not pull."""
        return np.maximum(motion.force_by(self.asked.law), 0.0)

    def pressed(self) -> Pressed:
        """Return the user's model with a surface in it, or the small scene."""
        return self._small(1) if self.robot is None else self.robot.pressed(())

    def replay(self, motion: Motion) -> Replayed | None:
        """Force by inverse dynamics: what the callback adds to the passive forces."""
        try:
            pressed = self.pressed()
        except MissingExtraError:
            return None
        contact = callback.ExactContact(pressed.model, self._contact(self.tip))
        force = np.empty(len(motion))
        out = pressed.along()
        with contact:
            for k in range(len(motion)):
                pressed.sink(float(motion.penetration[k]))
                pressed.data.qvel[:] = -motion.velocity[k] * out
                pressed.mujoco.mj_inverse(pressed.model, pressed.data)
                force[k] = contact.force
        return Replayed(force, self.how)

    def installed(self, model: Any) -> AbstractContextManager[Any]:
        """Install the callback."""
        return callback.ExactContact(model, self._contact(TIP))


def _thrown(mujoco: Any, model: Any) -> float:
    """Speed after over speed before, of the scene's body from its keyframe on; 0 if it stays."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    first = float(data.qvel[0])
    for _ in range(MOST_STEPS):
        mujoco.mj_step(model, data)
        if data.qpos[0] >= 0.0:
            return max(float(data.qvel[0]), 0.0) / -first
    return 0.0
