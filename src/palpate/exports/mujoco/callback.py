"""F = K x^n + B x^p v, at least 0, between two geoms in MuJoCo, exactly, by mjcb_passive.

    with ExactContact(model):
        mujoco.mj_step(model, data)

palpate_contact.json, beside this file, has the four numbers and the names of the two geoms.

The two geoms must not collide by themselves (contype="0" conaffinity="0"). MuJoCo has one such
callback for all models: other models are left alone, and a callback that was there before is called
first and put back at the end. While any is installed MuJoCo compiles no model from Python ("Python
exception raised"): compile them before.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def read_contact() -> dict[str, Any]:
    """Return the numbers and names beside this file."""
    text = Path(__file__).with_name("palpate_contact.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


class ExactContact:
    """The contact of a tip and a pad of one model, from install() to uninstall().

    Parameters
    ----------
    model : mujoco.MjModel
        That both geoms are in.
    contact : mapping, optional
        stiffness K [N/m^n], exponent n, damping B [N s/m^(p+1)], damping_exponent p, and the names
        of the geoms, tip and pad; default: those beside this file.
    """

    def __init__(self, model: Any, contact: Mapping[str, Any] | None = None) -> None:
        import mujoco  # here, since palpate is installed without it too

        self.mujoco = mujoco
        self.contact = read_contact() if contact is None else contact
        self.address = model._address
        self.tip, self.pad = model.geom(self.contact["tip"]).id, model.geom(self.contact["pad"]).id
        self.bodies = model.geom_bodyid[self.tip], model.geom_bodyid[self.pad]
        self.line = np.zeros(6)
        self.jacobians = np.zeros((2, 3, model.nv))
        self.reach = 1e3 * float(model.stat.extent)
        self.before: Any = None
        self.force = 0.0  # as of the last call, N
        self.penetration = 0.0  # m

    def law(self, penetration: float, velocity: float) -> float:
        """Force [N] at a penetration [m] and a velocity [m/s]; a contact does not pull."""
        if penetration <= 0.0:
            return 0.0
        c = self.contact
        elastic = c["stiffness"] * penetration ** c["exponent"]
        damper = c["damping"] * penetration ** c["damping_exponent"]
        return max(float(elastic + damper * velocity), 0.0)

    def install(self) -> "ExactContact":
        """Let MuJoCo call this contact at every step."""
        self.before = self.mujoco.get_mjcb_passive()
        self.mujoco.set_mjcb_passive(self)
        return self

    def uninstall(self) -> None:
        """Put back the callback that was there before."""
        self.mujoco.set_mjcb_passive(self.before)

    __enter__ = install

    def __exit__(self, *error: object) -> None:
        self.uninstall()

    def __call__(self, model: Any, data: Any) -> None:
        """Add the contact's force to the passive forces; MuJoCo calls this."""
        if self.before is not None:
            self.before(model, data)
        if model._address != self.address:
            return
        mujoco = self.mujoco
        distance = mujoco.mj_geomDistance(model, data, self.pad, self.tip, self.reach, self.line)
        self.penetration, self.force = -distance, 0.0
        if not distance < 0.0:
            return
        out = (self.line[3:] - self.line[:3]) / distance  # from the pad to the tip
        on_tip, on_pad = self.jacobians
        mujoco.mj_jac(model, data, on_tip, None, self.line[3:], self.bodies[0])
        mujoco.mj_jac(model, data, on_pad, None, self.line[:3], self.bodies[1])
        away = out @ (on_tip - on_pad)
        self.force = self.law(-distance, -float(away @ data.qvel))
        data.qfrc_passive += self.force * away


def _drop() -> None:
    """Drop the body of scene.xml, beside this file, whose geom is called tip."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("scene.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    peak = 0.0
    with ExactContact(model, {**read_contact(), "tip": "tip"}) as contact:
        while data.qpos[0] <= 0.0 and data.time < 10.0:
            mujoco.mj_step(model, data)
            peak = max(peak, contact.force)
    print(f"peak force {peak:.3f} N; leaves at {float(data.qvel[0]):.4f} m/s")


if __name__ == "__main__":
    _drop()
