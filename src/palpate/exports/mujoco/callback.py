"""The exact force F = max(K x^n + B x^p v, 0) between two geoms in MuJoCo, by mjcb_passive.

    with ExactContact(model):
        mujoco.mj_step(model, data)

palpate_contact.json in this folder has the four parameters and the names of the two geoms.

The two geoms must not collide otherwise (contype="0" conaffinity="0"). MuJoCo has one such callback
for all models: this one ignores other models, calls a callback that was installed earlier first,
and restores it at the end. While a callback is installed, MuJoCo cannot compile models from Python
("Python exception raised"): compile them before.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def read_contact() -> dict[str, Any]:
    """Return the parameters and names from the JSON file in this folder."""
    text = Path(__file__).with_name("palpate_contact.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


class ExactContact:
    """The contact of a tip and a pad of one model, from install() to uninstall().

    Parameters
    ----------
    model : mujoco.MjModel
        Model that contains both geoms.
    contact : mapping, optional
        K [N/m^n], n, B [N s/m^(p+1)], p, and the names
        of the geoms, tip and pad. Default: those of the JSON file in this folder.
    """

    def __init__(self, model: Any, contact: Mapping[str, Any] | None = None) -> None:
        import mujoco  # imported here: palpate also runs without MuJoCo

        self.mujoco = mujoco
        self.contact = read_contact() if contact is None else contact
        self.address = model._address
        self.tip, self.pad = model.geom(self.contact["tip"]).id, model.geom(self.contact["pad"]).id
        self.bodies = model.geom_bodyid[self.tip], model.geom_bodyid[self.pad]
        self.line = np.zeros(6)
        self.jacobians = np.zeros((2, 3, model.nv))
        self.reach = 1e3 * float(model.stat.extent)
        self.before: Any = None
        self.force = 0.0  # N, at the last call
        self.penetration = 0.0  # m

    def law(self, penetration: float, velocity: float) -> float:
        """Return the force [N], at least 0, at a penetration [m] and a velocity [m/s]."""
        if penetration <= 0.0:
            return 0.0
        c = self.contact
        elastic = c["K"] * penetration ** c["n"]
        damper = c["B"] * penetration ** c["p"]
        return max(float(elastic + damper * velocity), 0.0)

    def install(self) -> "ExactContact":
        """Install the callback, which MuJoCo then calls at every step."""
        self.before = self.mujoco.get_mjcb_passive()
        self.mujoco.set_mjcb_passive(self)
        return self

    def uninstall(self) -> None:
        """Restore the callback that was installed before."""
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
        self.penetration = -distance
        self.force = 0.0
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
    """Simulate the impact of scene.xml in this folder, whose geom is named tip."""
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
