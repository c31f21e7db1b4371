"""The exact law as MuJoCo's passive-force callback: a Python module of text, and its run."""

import ast
from collections.abc import Sequence
from types import ModuleType
from typing import Any

from palpate.exports.text import digits, hash_comment
from palpate.force_laws import GeneralisedHuntCrossley

MODULE = '''\
{comment}
"""F = K x^n + B x^p v, at least 0, between two geoms in MuJoCo, exactly, by mjcb_passive.

    with ExactContact(model, tip={tip!r}, pad={pad!r}):
        mujoco.mj_step(model, data)

The two geoms must not collide by themselves (contype="0" conaffinity="0"). MuJoCo has one such
callback for all models: other models are left alone, and a callback that was there before is called
first and put back at the end. While any is installed MuJoCo compiles no model from Python ("Python
exception raised"): compile them before.
"""

import mujoco
import numpy as np

STIFFNESS = {stiffness}  # K, N/m^n
EXPONENT = {exponent}  # n
DAMPING = {damping}  # B, N s/m^(p+1)
DAMPING_EXPONENT = {damping_exponent}  # p


def law(penetration, velocity):
    """Force [N] at a penetration [m] and a velocity [m/s]; a contact does not pull."""
    if penetration <= 0.0:
        return 0.0
    elastic = STIFFNESS * penetration**EXPONENT
    return max(elastic + DAMPING * penetration**DAMPING_EXPONENT * velocity, 0.0)


class ExactContact:
    """The contact of a tip and a pad of one model, from install() to uninstall()."""

    def __init__(self, model, tip={tip!r}, pad={pad!r}):
        self.address = model._address
        self.tip, self.pad = model.geom(tip).id, model.geom(pad).id
        self.bodies = model.geom_bodyid[self.tip], model.geom_bodyid[self.pad]
        self.line = np.zeros(6)
        self.jacobians = np.zeros((2, 3, model.nv))
        self.reach = 1e3 * float(model.stat.extent)
        self.before = None
        self.force = 0.0  # as of the last call, N
        self.penetration = 0.0  # m

    def install(self):
        self.before = mujoco.get_mjcb_passive()
        mujoco.set_mjcb_passive(self)
        return self

    def uninstall(self):
        mujoco.set_mjcb_passive(self.before)

    __enter__ = install

    def __exit__(self, *error):
        self.uninstall()

    def __call__(self, model, data):
        if self.before is not None:
            self.before(model, data)
        if model._address != self.address:
            return
        distance = mujoco.mj_geomDistance(model, data, self.pad, self.tip, self.reach, self.line)
        self.penetration, self.force = -distance, 0.0
        if not distance < 0.0:
            return
        out = (self.line[3:] - self.line[:3]) / distance  # from the pad to the tip
        on_tip, on_pad = self.jacobians
        mujoco.mj_jac(model, data, on_tip, None, self.line[3:], self.bodies[0])
        mujoco.mj_jac(model, data, on_pad, None, self.line[:3], self.bodies[1])
        away = out @ (on_tip - on_pad)
        self.force = law(-distance, -float(away @ data.qvel))
        data.qfrc_passive += self.force * away


if __name__ == "__main__":
    model = mujoco.MjModel.from_xml_path("scene.xml")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    peak = 0.0
    with ExactContact(model) as contact:
        while data.qpos[0] <= 0.0 and data.time < 10.0:
            mujoco.mj_step(model, data)
            peak = max(peak, contact.force)
    print(f"peak force {{peak:.3f}} N; leaves at {{float(data.qvel[0]):.4f}} m/s")
'''


def module_text(law: GeneralisedHuntCrossley, tip: str, pad: str, notes: Sequence[str]) -> str:
    """Return the module that a user imports."""
    return MODULE.format(
        comment=hash_comment(notes),
        tip=tip,
        pad=pad,
        stiffness=digits(law.stiffness),
        exponent=digits(law.exponent),
        damping=digits(law.damping),
        damping_exponent=digits(law.damping_exponent),
    )


def loaded(text: str) -> Any:
    """Return the module of this text, as an import of its file would."""
    module = ModuleType("palpate_contact")
    exec(compile(ast.parse(text), "palpate_contact.py", "exec"), module.__dict__)
    return module
