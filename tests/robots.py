"""Recordings of a robot's hand, made of a known law: positions and forces in space."""

from dataclasses import dataclass

import numpy as np
from probing import BALL, NOISE, Floats, Motion, tapping

from palpate import ForceLaw, Recording

NORMAL = np.array([0.48, -0.36, 0.8])  # of length 1
ORIGIN = np.array([0.41, -0.12, 0.233])  # m, on the surface
BIAS = np.array([0.31, -0.22, 0.57])  # N, of the sensor
# m; a robot's kinematics by its encoders. Rounded so, as a contact's penetration in the lab is.
POSITION_NOISE = 1e-6


@dataclass(frozen=True)
class Hand:
    """What a robot would record, before it is put in any file."""

    time: Floats
    position: Floats
    force: Floats
    motion: Motion


def hand(
    seconds: float = 6.0,
    law: ForceLaw = BALL,
    *,
    seed: int = 0,
    normal: Floats = NORMAL,
    origin: Floats = ORIGIN,
    bias: Floats = BIAS,
    motion: Motion | None = None,
) -> Hand:
    """Taps along a normal, felt with white noise on each axis and the sensor's bias."""
    moved = tapping(seconds) if motion is None else motion
    noise = np.random.default_rng(seed)
    pressed = law.force_along(moved.x, moved.v, np.full(len(moved), 1e-3))
    force = pressed[:, None] * normal + bias + NOISE * noise.standard_normal((len(moved), 3))
    position = origin - moved.x[:, None] * normal
    position = position + POSITION_NOISE * noise.standard_normal(position.shape)
    return Hand(moved.time, position, force, moved)


def travelling(*places: tuple[ForceLaw, Motion]) -> Hand:
    """Two places that are 30 mm apart, each of a law and a motion, with a lift between."""
    lifted = Motion(np.full(400, -5e-3), np.zeros(400))
    along = np.array([0.6, 0.8, 0.0])
    stops = zip((places[0], (BALL, lifted), places[1]), (0.0, 0.015, 0.03), strict=True)
    felt = [
        hand(law=law, motion=motion, origin=ORIGIN + far * along, seed=k)
        for k, ((law, motion), far) in enumerate(stops)
    ]
    position, force = (np.vstack([getattr(f, n) for f in felt]) for n in ("position", "force"))
    return Hand(1e-3 * np.arange(len(position)), position, force, lifted)


def table_of(hand: Hand, **more: Floats) -> Recording:
    """As a table of one clock, with the names that a robot's logger would give."""
    names = {f"p{axis}_m": hand.position[:, k] for k, axis in enumerate("xyz")}
    names |= {f"f{axis}_N": hand.force[:, k] for k, axis in enumerate("xyz")}
    return Recording({"time_s": hand.time, **names, **more}, source="robot.csv")


def topics_of(hand: Hand, *, every: int = 1, start: int = 1_700_000_000_123_456_789) -> Recording:
    """As two topics on clocks of their own, in ns since 1970; of the poses every k-th is there."""
    stamp = start + np.round(1e9 * hand.time).astype(np.int64)
    late = np.int64(400_000)  # ns; the two are never sampled at one moment
    channels = {"/ft.header.stamp": stamp, "/pose.header.stamp": (stamp + late)[::every]}
    # Between two samples a straight line: what the probe does then is known, and no harm done.
    shift = 0.4 * np.diff(hand.position, axis=0, append=hand.position[-1:])
    for k, axis in enumerate("xyz"):
        channels[f"/ft.wrench.force.{axis}"] = hand.force[:, k]
        channels[f"/pose.pose.position.{axis}"] = (hand.position + shift)[::every, k]
    clocks = {
        name: f"/{name[1:].split('.')[0]}.header.stamp"
        for name in channels
        if not name.endswith("stamp")
    }
    units = {name: "ns" for name in channels if name.endswith("stamp")}
    types = {"/ft": "geometry_msgs/msg/WrenchStamped", "/pose": "geometry_msgs/msg/PoseStamped"}
    return Recording(channels, units=units, source="robot.mcap", clocks=clocks, types=types)
