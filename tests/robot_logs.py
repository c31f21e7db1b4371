"""Logs of a wrench and a pose, and what palpate makes of them against the truth.

A robot turns its tool in free air and presses it into a flat material. The simulator integrates
nothing: the path is a sum of minimum-jerk moves, the wrench follows from Newton's and Euler's
equations at 2 kHz, and pose and wrench are sampled on two clocks. Friction is Dahl's.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

import palpate
from palpate import Recording

Floats = NDArray[np.float64]
FINE = 2000.0  # Hz
GRAVITY = np.array([0.0, 0.0, -9.80665])


@dataclass(frozen=True)
class Setup:
    """A robot, its sensor, its tool and its material; SI, angles in degrees."""

    seed: int = 0
    mass: float = 0.4
    centre: tuple[float, float, float] = (0.004, -0.003, 0.045)
    mount: tuple[float, float, float] = (10.0, -15.0, 24.0)  # rotation vector
    bias: tuple[float, ...] = (3.0, -5.0, 8.0, 0.1, -0.2, 0.05)
    drift: float = 0.1  # N over the log
    wander: float = 0.03  # N, standard deviation of a random walk at the end
    noise: float = 0.05  # N
    torque_noise: float = 0.002  # N·m
    delay: float = 0.01  # s, of the wrench
    sensor: tuple[float, float, float] = (0.0, 0.0, 0.03)  # from the flange
    tip: tuple[float, float, float] = (0.003, 0.0, 0.14)  # from the flange
    tilt: float = 20.0  # of the material's normal to the vertical
    stiffness: float = 2e4
    exponent: float = 1.5
    dissipation: float = 1.0  # s/m
    friction: float = 0.3
    turns: float = 60.0  # of the tool in free air
    axes: int = 2
    touch_tilt: float = 10.0  # of the tool between touches
    pose_rate: float = 500.0
    pose_noise: float = 1e-5  # m
    rate: float = 1000.0
    depth: float = 3e-3
    presses: int = 4
    hold: float = 0.0  # s, at constant depth in each touch
    speed: float = 1.0
    sign: float = 1.0
    zeroed: float | None = None  # fraction of the log after which the sensor is zeroed once
    free_height: float = 0.12  # m, of the turns in free air; below 0.1 at one place
    pivot: float = 0.0  # degrees, of the tool about its tip in each touch
    filtered: float = 0.03  # s, by which the robot smooths its path


def random_setup(seed: int, **more: Any) -> Setup:
    """Return a random set-up: every mount is 30° off, every clock up to 50 ms."""
    g = np.random.default_rng(70_000 + seed)
    axis = g.normal(size=3)
    exponent, depth = math.exp(g.uniform(math.log(1.1), math.log(2.0))), g.uniform(2e-3, 4e-3)
    made = Setup(
        seed=seed,
        mass=g.uniform(0.15, 1.0),
        centre=(g.uniform(-0.01, 0.01), g.uniform(-0.01, 0.01), g.uniform(0.02, 0.06)),
        mount=tuple(30.0 * axis / np.linalg.norm(axis)),
        bias=(*g.uniform(-10.0, 10.0, 3), *g.uniform(-0.5, 0.5, 3)),
        drift=g.uniform(0.0, 0.2),
        wander=g.uniform(0.0, 0.05),
        noise=math.exp(g.uniform(math.log(0.02), math.log(0.1))),
        torque_noise=math.exp(g.uniform(math.log(1e-3), math.log(5e-3))),
        delay=g.uniform(-0.05, 0.05),
        tip=(g.uniform(-0.01, 0.01), g.uniform(-0.01, 0.01), g.uniform(0.08, 0.2)),
        tilt=g.uniform(0.0, 40.0),
        stiffness=g.uniform(4.0, 12.0) / depth**exponent,
        exponent=exponent,
        dissipation=math.exp(g.uniform(math.log(0.3), math.log(3.0))),
        friction=g.uniform(0.1, 0.7),
        turns=g.uniform(30.0, 70.0),
        touch_tilt=g.uniform(0.0, 20.0),
        pose_rate=(125.0, 250.0, 500.0, 1000.0)[seed % 4],
        depth=depth,
    )
    return replace(made, **more)


@dataclass(frozen=True)
class Log:
    """The recording, and the truth at 2 kHz."""

    recording: Recording
    mount: Floats
    normal: Floats
    penetration: Floats
    duration: float


@lru_cache(maxsize=8)
def simulate(setup: Setup, frame: str = "ft_sensor") -> Log:
    """Return the log of a set-up."""
    g = np.random.default_rng(setup.seed)
    tilt = math.radians(setup.tilt)
    normal = np.array([math.sin(tilt) * 0.8, math.sin(tilt) * 0.6, math.cos(tilt)])
    point = np.array([0.45, 0.05, 0.12])
    path, turn = _path(setup, normal, point, g)
    time = np.arange(len(path)) / FINE
    rotation = turn.as_matrix()
    flange = path - rotation @ np.array(setup.tip)

    def rate(values: Floats) -> Floats:
        return np.gradient(values, 1.0 / FINE, axis=0)

    spin = np.vstack([(turn[:-1].inv() * turn[1:]).as_rotvec() * FINE, np.zeros((1, 3))])
    spin[1:] = 0.5 * (spin[1:] + spin[:-1])  # rad/s, in the axes of the flange
    depth = (point - path) @ normal
    push = setup.stiffness * np.maximum(depth, 0.0) ** setup.exponent
    push = np.maximum(push * (1.0 + setup.dissipation * rate(depth)), 0.0)
    slide = np.diff(path - np.outer((path - point) @ normal, normal), axis=0, prepend=path[:1])
    slide[0] = 0.0
    contact_force = push[:, None] * normal
    if setup.friction > 0.0:
        contact_force -= setup.friction * push[:, None] * _dahl(slide, push)

    mount = Rotation.from_rotvec(np.radians(setup.mount)).as_matrix()
    sensor = rotation @ mount

    def seen(vectors: Floats) -> Floats:
        turned: Floats = np.einsum("kji,kj->ki", sensor, vectors)
        return turned

    origin = flange + rotation @ np.array(setup.sensor)
    centre = np.array(setup.centre)
    weight = seen(setup.mass * (GRAVITY - rate(rate(origin + sensor @ centre))))
    w = spin @ mount
    inertia = setup.mass * np.diag([0.03, 0.045, 0.02]) ** 2
    torque = np.cross(centre, weight) - rate(w) @ inertia - np.cross(w, w @ inertia)
    torque += np.cross(seen(path - origin), seen(contact_force))
    wrench = np.hstack([seen(contact_force) + weight, torque]) + np.array(setup.bias)
    scale = np.array([1.0, 1.0, 1.0, 0.02, 0.02, 0.02])
    away = g.normal(size=6)
    away /= np.linalg.norm(away[:3])
    end = float(time[-1])
    wrench += setup.drift * np.outer(time / end - 0.5, away * scale)
    walk = np.cumsum(g.normal(size=(int(end) + 2, 6)), axis=0) / math.sqrt(end)
    seconds = np.arange(len(walk))
    wander = [np.interp(time, seconds, column) for column in walk.T]
    wrench += setup.wander * np.column_stack(wander) * scale
    stamps = np.arange(0.02, end - 0.02, 1.0 / setup.rate)
    read = np.column_stack([np.interp(stamps - setup.delay, time, c) for c in wrench.T])
    if setup.zeroed is not None:
        after = stamps > setup.zeroed * end
        read[after] -= read[np.argmax(after)]
    noises = [setup.noise] * 3 + [setup.torque_noise] * 3
    read = setup.sign * (read + g.normal(size=read.shape) * np.array(noises))
    at = np.rint(np.arange(0.0107, end - 0.01, 1.0 / setup.pose_rate) * FINE).astype(int)
    place = flange[at] + setup.pose_noise * g.normal(size=(len(at), 3))
    tool = (turn[at] * Rotation.from_rotvec(1e-4 * g.normal(size=(len(at), 3)))).as_quat()
    channels = {"pose.time": time[at], "wrench.time": stamps}
    for k, axis in enumerate("xyz"):
        channels[f"/pose.position.{axis}"] = place[:, k]
        channels[f"/ft.force.{axis}"], channels[f"/ft.torque.{axis}"] = read[:, k], read[:, 3 + k]
    channels |= {f"/pose.orientation.{axis}": tool[:, k] for k, axis in enumerate("xyzw")}
    clocks = {n: "pose.time" if n[1] == "p" else "wrench.time" for n in channels if n[0] == "/"}
    recording = Recording(
        channels,
        clocks=clocks,
        frames={name: "base" if name[1] == "p" else frame for name in clocks},
        types={"/pose": "geometry_msgs/msg/PoseStamped", "/ft": "geometry_msgs/msg/WrenchStamped"},
        units={"pose.time": "s", "wrench.time": "s"},
        source="log",
    )
    return Log(recording, mount, normal, depth, end)


def on_one_clock(log: Log) -> dict[str, Floats]:
    """Return the columns of a table, on the clock of the wrench: it states no frame."""
    channels = dict(log.recording.channels)
    poses, clock = channels.pop("pose.time"), channels.pop("wrench.time")
    inside = (clock > poses[0]) & (clock < poses[-1])
    columns = {"time_s": clock[inside]}
    for name, values in channels.items():
        even = np.interp(clock, poses, values) if name.startswith("/pose") else values
        columns[name.removeprefix("/")] = even[inside]
    return columns


def _path(
    setup: Setup, normal: Floats, point: Floats, g: np.random.Generator
) -> tuple[Floats, Rotation]:
    """The path of the tip and the orientation of the flange: free turns, then touches."""
    side = np.cross(normal, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(normal, side)
    upright = Rotation.align_vectors([-normal, side], [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])[0]
    places, turns = [np.tile(point + 0.06 * normal, (2, 1))], [upright.as_quat()[None].repeat(2, 0)]

    def move(
        to: Floats, turn: Rotation, seconds: float, dip: Callable[[Floats], Floats] | None
    ) -> None:
        s = np.arange(1, int(seconds / setup.speed * FINE) + 1) / int(seconds / setup.speed * FINE)
        smooth = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        begin, first = places[-1][-1], Rotation.from_quat(turns[-1][-1])
        moved = begin + smooth[:, None] * (to - begin)
        places.append(moved if dip is None else moved - dip(s)[:, None] * normal)
        whole = (first.inv() * turn).as_rotvec()
        turns.append((first * Rotation.from_rotvec(smooth[:, None] * whole)).as_quat())

    def about(x: float, y: float, z: float = 0.0) -> Rotation:
        return Rotation.from_rotvec(np.radians([x, y, z]))

    move(places[0][-1], upright, 0.6, None)
    for k in range(6 if setup.axes else 3):
        angle = setup.turns * (1.0 if k % 4 < 2 else -1.0) * g.uniform(0.6, 1.0)
        turn = about(angle, 0.0) if setup.axes == 1 or k % 2 == 0 else about(0.0, angle)
        if setup.axes == 2:
            turn = turn * about(0.0, 0.0, setup.turns * g.uniform(-0.5, 0.5))
        aside = 0.03 * g.normal(size=3)
        to = point + setup.free_height * normal + (setup.free_height > 0.1) * aside
        move(to, upright * turn if setup.axes else upright, 1.5, None)
        move(to, upright * turn if setup.axes else upright, 0.4, None)
    for k in range(setup.presses):
        x, y = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-0.7, -0.7)][k % 4]
        turn = upright * about(setup.touch_tilt * x, setup.touch_tilt * y)
        touch = point + 0.02 * (math.cos(2.4 * k + 0.3) * side + math.sin(2.4 * k + 0.3) * other)
        move(touch + 0.008 * normal, turn, 1.2, None)
        move(touch + 0.008 * normal, turn, 0.3, None)
        deep = touch - 0.5 * setup.depth * normal + 2e-4 * g.normal() * side
        move(deep, turn, 0.5, None)
        cycles = 2.0 + k % 4
        swing = 0.5 * setup.depth

        def dip(s: Floats, cycles: float = cycles, swing: float = swing) -> Floats:
            return swing * np.sin(2.0 * np.pi * cycles * s) * np.minimum(1.0, 10.0 * s * (1.0 - s))

        turn = turn * about(setup.pivot, 0.0)
        move(deep, turn, 2.0, dip)
        if setup.hold:
            move(deep, turn, setup.hold, None)
        move(touch + 0.008 * normal, turn, 0.5, None)
        move(touch + 0.008 * normal, turn, 0.2, None)
    move(places[-1][-1], Rotation.from_quat(turns[-1][-1]), 0.4, None)
    quaternions = np.concatenate(turns)
    flips = np.sign((quaternions[1:] * quaternions[:-1]).sum(axis=1))
    quaternions[1:] *= np.cumprod(flips)[:, None]
    path, size = np.concatenate(places), int(setup.filtered * FINE / 3.0)
    for _ in range(3):
        path, quaternions = (uniform_filter1d(e, size, axis=0) for e in (path, quaternions))
    return path, Rotation.from_quat(quaternions)


def _dahl(slide: Floats, push: Floats, length: float = 2e-4) -> Floats:
    """Dahl's state of friction: the direction of sliding, low-passed over the way slid."""
    state, states = np.zeros(3), np.zeros_like(slide)
    for k in np.flatnonzero(push > 0.0):
        if push[k - 1] <= 0.0:
            state = np.zeros(3)
        state = (state + slide[k] / length) / (1.0 + math.sqrt(slide[k] @ slide[k]) / length)
        states[k] = state
    return states


@dataclass(frozen=True)
class Errors:
    """Errors of one log: estimate less truth, and in standard errors."""

    absolute: dict[str, float]
    in_errors: dict[str, float]
    damping_mark: str
    mark: str


def identify(setup: Setup, *, stated: bool = True, **options: Any) -> Errors:
    """Prepare and identify a log, and compare with the truth at the median depth.

    With ``stated=False`` it is a table on one clock, which states no frame.
    """
    log = simulate(setup)
    recording = log.recording if stated else Recording(on_one_clock(log), source="log.csv")
    contact = palpate.prepare(recording, **options)
    depth = float(np.median(log.penetration[log.penetration > 0.1 * setup.depth]))
    result = palpate.identify(contact).at_depth(depth)
    there, found = result.diagnosis.working_depth, contact.prepared.payload
    stiffness = setup.stiffness * setup.exponent * depth ** (setup.exponent - 1.0)
    damping = setup.stiffness * setup.dissipation * depth**setup.exponent
    absolute = {"S, %": 100.0 * (there.stiffness.value / stiffness - 1.0)}
    absolute["C, %"] = 100.0 * (there.damping.value / damping - 1.0)
    numbers = ("S", there.stiffness, stiffness), ("C", there.damping, damping)
    in_errors = {
        name: (number.value - truth) / math.hypot(number.standard_error, number.systematic)
        for name, number, truth in numbers
    }
    if found is not None:
        turn = Rotation.from_matrix(log.mount.T @ found.mount).as_rotvec()
        absolute["mass, %"] = 100.0 * (found.mass / setup.mass - 1.0)
        absolute["centre, mm"] = 1e3 * float(np.linalg.norm(found.centre - setup.centre))
        absolute["mount, °"] = math.degrees(float(np.linalg.norm(turn)))
        absolute["clock, ms"] = 1e3 * (found.delay - setup.delay)
        in_errors["mass"] = (found.mass - setup.mass) / found.mass_error
        in_errors |= {f"mount {k}": turn[k] / found.mount_error[k] for k in range(3)}
        in_errors["clock"] = (found.delay - setup.delay) / found.delay_error
    verdict = result.diagnosis.verdict
    return Errors(absolute, in_errors, verdict.damping, verdict.stiffness)


#: One fault at a time, without friction; then what turns too little, and what is zeroed.
IDEAL = {"touch_tilt": 0.0, "friction": 0.0, "delay": 0.0, "drift": 0.0, "wander": 0.0}
NO_TOOL = IDEAL | {"mass": 1e-6, "mount": (0.0, 0.0, 0.0)}
STILL: dict[str, Any] = {"axes": 0, "turns": 0.0}
VERTICAL = STILL | {"tilt": 0.0, "touch_tilt": 0.0, "free_height": 0.09}
VERTICAL |= {"friction": 0.0, "mount": (0.0, 0.0, 40.0)}
FAULTS: dict[str, dict[str, Any]] = {
    "mount 30° about x, no weight": NO_TOOL | STILL | {"mount": (30.0, 0.0, 0.0)},
    "weight 4 N, tool never turns": IDEAL | STILL | {"mount": (0.0, 0.0, 0.0)},
    "weight 4 N, turns 60°": IDEAL,
    "drift 0.2 N, wander 0.05 N": NO_TOOL | STILL | {"drift": 0.2, "wander": 0.05},
    "delay 5 ms": IDEAL | {"delay": 0.005},
    "delay 50 ms": IDEAL | {"delay": 0.05},
    "turns 10°": IDEAL | {"turns": 10.0},
    "turns 30° about 1 axis": IDEAL | {"turns": 30.0, "axes": 1},
    "mass 50 g": IDEAL | {"mass": 0.05},
    "drift 1 N, wander 0.2 N": IDEAL | {"drift": 1.0, "wander": 0.2},
    "held 8 s": IDEAL | {"hold": 8.0},
    "sign reversed": IDEAL | {"sign": -1.0},
    "twice as quick": IDEAL | {"speed": 2.0},
    "zeroed in contact": IDEAL | {"zeroed": 0.62},
    "zeroed in free air": IDEAL | {"zeroed": 0.2},
    "zeroed in one touch": IDEAL | {"presses": 1, "zeroed": 0.86},
}
