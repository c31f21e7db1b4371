"""MuJoCo's own system identification on the recording of an export.

``pip install 'mujoco[sysid]'``; without it the section is empty. One contact, its touch force at
the recorded states; the seven numbers of solref and solimp are looked for by ``mujoco.sysid``'s
optimizer from random starts within their bounds, and solref alone for the ball.
"""

import io
from contextlib import redirect_stdout
from dataclasses import replace
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.report import Row, Section
from palpate import HuntCrossley, lab
from palpate.exports.motion import ProbeMotion
from palpate.exports.replay_errors import force_error
from palpate.force_laws import ForceLaw
from palpate.validation import Floats

STARTS = 6
SAMPLES = 500  # of three seconds, so that an optimizer's step takes a second
SCENE = """\
<mujoco>
  <option gravity="0 0 0" timestep="0.001" cone="elliptic"/>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 0.1" condim="1"/>
    <body name="probe" pos="0 0 0.03">
      <joint name="slide" type="slide" axis="0 0 1"/>
      <geom name="tip" type="sphere" size="0.03" mass="1" condim="1"/>
    </body>
  </worldbody>
  <contact><pair name="touch" geom1="ground" geom2="tip" condim="1"/></contact>
</mujoco>
"""
# −S, −D; d₀, d_w, width, midpoint, power. All laws here are well inside, for one kilogram.
BOUNDS = {
    "spring": (10.0, 1e6),
    "damper": (0.1, 1e4),
    "low": (1e-4, 0.5),
    "high": (1e-3, 0.9),
    "width": (5e-3, 0.05),
    "midpoint": (0.01, 0.99),
    "power": (1.0, 6.0),
}
LAWS: dict[str, tuple[ForceLaw, bool]] = {
    "ball, solref only": (lab.BALL.law, True),
    "ball": (lab.BALL.law, False),
    "sponge": (lab.SPONGE.law, False),
    "n = 1.5": (HuntCrossley(2e4, 3e4, 1.5), False),
    "PVC": (lab.PVC.law, False),
}


def measure_system_identification() -> Section:
    """Return time, starts that end within 1.2 times the best, and error of force."""
    title = "mujoco.sysid on the same recording, 0.05 N of noise: one contact"
    try:
        sysid: Any = import_module("mujoco.sysid")
    except ImportError:
        return Section(title, [])
    if not hasattr(sysid, "optimize"):  # its own dependencies are absent
        return Section(title, [])
    rows = []
    for name, (law, two) in LAWS.items():
        errors, seconds = _from_random_starts(sysid, law, two)
        best = min(errors)
        arrived = sum(each <= 1.2 * best for each in errors)
        rows += [
            Row(f"{name}: best of {STARTS} starts ({arrived} converged)", best, "%"),
            Row(f"{name}: the worst start", max(errors), "%"),
            Row(f"{name}: a start", seconds, "s"),
        ]
    return Section(title, rows)


def _from_random_starts(sysid: Any, law: ForceLaw, two: bool) -> tuple[list[float], float]:
    whole = ProbeMotion.of_paper()
    motion = replace(whole, judged=whole.judged & (whole.time < 3.0)).firm()
    truth = motion.force_by(law)
    random = np.random.default_rng(0)
    measured = truth + 0.05 * random.standard_normal(truth.size)
    some = np.linspace(0, truth.size - 1, SAMPLES).astype(int)
    engine = _Contact()
    names = list(BOUNDS)[: 2 if two else None]
    errors, begun = [], perf_counter()
    for _ in range(STARTS):
        start = sysid.ParameterDict()
        for name in names:
            low, high = np.log(BOUNDS[name])
            start.add(sysid.Parameter(name, random.uniform(low, high), low, high))

        def residual(x: Floats, *_: Any) -> Any:
            if x.ndim > 1:
                return np.column_stack([residual(each) for each in x.T])
            return engine.force(names, np.exp(x), motion, some) - measured[some]

        with redirect_stdout(io.StringIO()):  # it prints a line an iteration
            best, _found = sysid.optimize(
                start,
                lambda x, params, **_: ([residual(np.asarray(x))], None, None),
                optimizer="scipy",
            )
        values = np.exp(best.as_vector())
        force = engine.force(names, values, motion, np.arange(truth.size))
        errors.append(force_error(force, truth, motion.judged))
    return errors, (perf_counter() - begun) / STARTS


class _Contact:
    """One contact between a sphere and a plane, whose force is evaluated state by state."""

    def __init__(self) -> None:
        mujoco: Any = import_module("mujoco")
        self._inverse = mujoco.mj_inverse
        self._model = mujoco.MjModel.from_xml_string(SCENE)
        self._data = mujoco.MjData(self._model)

    def force(self, names: list[str], values: Floats, motion: ProbeMotion, at: Any) -> Floats:
        model, data = self._model, self._data
        given = dict(zip(names, values.tolist(), strict=True))
        model.pair_solref[0] = -given["spring"], -given["damper"]
        # With two numbers d is constant, and small: it adds a thousandth of the mass.
        model.pair_solimp[0] = [
            given.get(name, other)
            for name, other in zip(list(BOUNDS)[2:], (1e-3, 1e-3, 0.02, 0.5, 2.0), strict=True)
        ]
        force = np.empty(len(at))
        columns = (motion.penetration, motion.velocity, motion.acceleration)
        for k, sample in enumerate(zip(*(each[at].tolist() for each in columns), strict=True)):
            data.qpos[0], data.qvel[0], data.qacc[0] = (-each for each in sample)
            self._inverse(model, data)
            force[k] = data.qfrc_constraint[0]
        return force
