"""The same loops in MuJoCo, written apart from palpate: many gains side by side.

One slide joint a gain, MuJoCo's own position actuators for admittance, the law as a passive force,
Runge and Kutta's method at 0.25 ms. Controllers, delay and filter are written from their
definitions, and share no line with ``palpate.control_loops``.
"""

import math
from typing import Any

import mujoco
import numpy as np

from benchmarks.gains.cases import Case
from palpate.validation import Floats

_RUNAWAY = (0.3, 30.0, 1e7)  # m, m/s, m/s²


class Material:
    """The force of a law on many probes, with the memory of each."""

    def __init__(self, law: Any, count: int, step: float) -> None:
        self.law, self.step = law, step
        times, weights = law.branches()
        self.times, self.stiffness = times[:, None], (law.M * weights)[:, None]
        self.memory = np.zeros((len(times), count))
        self.before = np.zeros(count)

    def _elastic(self, x: Floats) -> Floats:
        return np.where(x > 0.0, np.clip(x, 0.0, None) ** self.law.n, 0.0)

    def _branches(self, x: Floats, elapsed: float) -> Floats:
        if elapsed <= 0.0:
            return self.memory + (self._elastic(x) - self.before)
        kept = np.exp(-elapsed / self.times)
        gained = (1.0 - kept) * self.times / elapsed
        relaxed: Floats = kept * self.memory + gained * (self._elastic(x) - self.before)
        return relaxed

    def force(self, x: Floats, v: Floats, elapsed: float = 0.0) -> Floats:
        """Return the force at a time after the last step, N."""
        deep = np.clip(x, 1e-300, None)
        force = self.law.K * deep**self.law.n + self.law.B * deep**self.law.p * v
        if len(self.times):
            force = force + (self.stiffness * self._branches(x, elapsed)).sum(axis=0)
        return np.where(x > 0.0, np.clip(force, 0.0, None), 0.0)

    def advance(self, x: Floats) -> None:
        """Relax for a step that ends at a penetration."""
        if len(self.times):
            self.memory = self._branches(x, self.step)
            self.before = self._elastic(x)


def _model(case: Case, count: int, step: float) -> Any:
    loop = case.loop
    admittance = loop.name == "admittance"
    if admittance:
        spring = loop.mass * loop.bandwidth**2
        damper = 2.0 * loop.mass * loop.bandwidth
    friction = 0.0 if admittance else loop.friction
    bodies = []
    actuators = []
    for i in range(count):
        bodies.append(
            f'<body pos="0 {i} 0"><inertial pos="0 0 0" mass="{loop.mass}" diaginertia="1 1 1"/>'
            f'<joint name="j{i}" type="slide" axis="1 0 0" damping="{friction}"/></body>'
        )
        gains = f'kp="{spring}" kv="{damper}"' if admittance else ""
        actuators.append(f'<{"position" if admittance else "motor"} joint="j{i}" {gains}/>')
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" gravity="0 0 0" integrator="RK4">'
        '<flag contact="disable"/></option>'
        f"<worldbody>{''.join(bodies)}</worldbody><actuator>{''.join(actuators)}</actuator></mujoco>"
    )


def _butterworth(corner: float, step: float) -> tuple[Floats, Floats]:
    """Return the exact step of a second-order Butterworth filter for a held input."""
    from scipy.signal import cont2discrete

    rate = np.array([[0.0, 1.0], [-(corner**2), -math.sqrt(2.0) * corner]])
    inlet = np.array([[0.0], [corner**2]])
    found = cont2discrete((rate, inlet, np.eye(2), np.zeros((2, 1))), step, "zoh")
    return found[0], found[1]


def run(case: Case, factors: Floats, seconds: float, step: float = 2.5e-4) -> tuple[Floats, Floats]:
    """Return for each factor on the gain whether the loop swings on, and whether it bounces."""
    loop = case.loop
    count = len(factors)
    model = _model(case, count, step)
    data = mujoco.MjData(model)
    material = Material(case.law, count, step)
    clock = {"start": 0.0}

    def passive(_: Any, now: Any) -> None:
        elapsed = now.time - clock["start"]
        now.qfrc_passive[:] -= material.force(now.qpos, now.qvel, elapsed)

    corner = 2.0 * math.pi * getattr(loop, "force_filter", 20.0)
    decay, inlet = _butterworth(corner, step)
    filtered = np.zeros((2, count))
    period = 1.0 / loop.sample_rate
    every, late = round(period / step), round(loop.delay / step)
    speed = loop.approach_speed
    data.qvel[:] = speed
    lag = 2.0 * speed / getattr(loop, "bandwidth", np.inf)
    motion = np.full(count, lag + speed * (loop.delay - period / 2.0))
    motion_speed = np.full(count, speed)
    sums = np.zeros(count)
    steady = getattr(loop, "friction", 0.0) * speed
    target = steady / (factors * getattr(loop, "stiffness", 1.0))
    last = np.full(count, -speed * period)
    queue = []
    for k in range(late):
        samples_ago = math.ceil((late - k) / every) - 1
        moved = motion - speed * period * samples_ago
        queue.append(moved if loop.name == "admittance" else np.full(count, steady))
    command = np.zeros(count)
    bounced = np.zeros(count, dtype=bool)
    dead = np.zeros(count, dtype=bool)
    low, high = np.full((2, count), np.inf), np.full((2, count), -np.inf)
    steps = int(seconds / step)
    mujoco.set_mjcb_passive(passive)
    try:
        for k in range(steps):
            x, v = data.qpos.copy(), data.qvel.copy()
            if k % every == 0:
                error = loop.wanted_force - filtered[0]
                difference = (x - last) / period
                last = x
                if loop.name == "admittance":
                    push = factors * error - loop.virtual_damping * motion_speed
                    motion_speed = motion_speed + push / loop.virtual_mass * period
                    motion = motion + motion_speed * period
                    command = motion
                elif loop.name == "impedance":
                    goes = target < case.depth
                    aimed = np.where(goes, speed, 0.0)
                    spring = loop.stiffness * (target - x)
                    ahead = loop.wanted_force * np.clip(target / case.depth, 0.0, 1.0)
                    command = factors * (spring + loop.damping * (aimed - difference)) + ahead
                    target = np.where(goes, np.minimum(target + speed * period, case.depth), target)
                else:
                    sums = sums + error * period
                    control = loop.proportional * error + loop.integral * sums
                    command = loop.wanted_force + factors * control
                if 2 * k >= steps:
                    quarter = 1 if 4 * k >= 3 * steps else 0
                    now = material.force(x, v)
                    low[quarter] = np.minimum(low[quarter], now)
                    high[quarter] = np.maximum(high[quarter], now)
            queue.append(command)
            data.ctrl[:] = np.where(dead, 0.0, queue.pop(0))
            felt = material.force(x, v)
            clock["start"] = data.time
            mujoco.mj_step(model, data)
            # MuJoCo resets every body if one runs away: such a one is stopped for good.
            limits = zip((data.qpos, data.qvel, data.qacc), _RUNAWAY, strict=True)
            dead |= ~np.all([np.abs(values) < most for values, most in limits], axis=0)
            data.qpos[dead] = 0.0
            data.qvel[dead] = 0.0
            material.advance(data.qpos)
            filtered = decay @ filtered + inlet * (felt + loop.tool_mass * data.qacc)
            bounced |= data.qpos <= 0.0
    finally:
        mujoco.set_mjcb_passive(None)
    third, fourth = high - low
    swings = dead | ((fourth > 0.02 * loop.wanted_force) & (fourth > 0.8 * third))
    return swings, swings | bounced
