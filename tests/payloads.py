"""A tool on a wrist sensor, and the wrench that it reads by the formula for a whole log."""

import numpy as np

from palpate import Payload
from palpate.input.channels.frames import multiply, rotate

STEP = 1e-3  # s


def turn(axis, angle):
    """Quaternions of rotations about an axis."""
    angle = np.asarray(angle)[..., None]
    return np.concatenate([np.sin(0.5 * angle) * np.asarray(axis), np.cos(0.5 * angle)], axis=-1)


def matrix_of(quaternion):
    return rotate(np.eye(3), np.asarray(quaternion)).T


PAYLOAD = Payload(
    mass=0.7,
    centre=np.array([0.004, -0.003, 0.045]),
    mount=matrix_of([0.1, 0.2, np.sin(0.3), np.sqrt(1.0 - 0.05 - np.sin(0.3) ** 2)]),
    bias=np.array([3.0, -5.0, 8.0, 0.1, -0.2, 0.05]),
    inertia=np.array([2e-3, 1.8e-3, 4e-4, 1e-4, -2e-4, 5e-5]),
    lever=np.array([0.001, 0.002, 0.03]),
)
FORCE, TORQUE = np.array([1.0, -2.0, 5.0]), np.array([0.1, 0.2, -0.3])  # external, base


def motion(time):
    """A tool that points down, swings by 30° about two axes and moves at up to 2 Hz."""
    position = 0.05 * np.column_stack(
        [np.sin(5.0 * time), np.cos(9.0 * time + 1.0), np.sin(12.0 * time + 2.0)]
    )
    down = np.array([1.0, 0.0, 0.0, 0.0])
    swing = multiply(turn([0, 1, 0], 0.5 * np.sin(4.0 * time)), turn([1, 0, 0], np.sin(6.0 * time)))
    return position, multiply(np.broadcast_to(down, swing.shape), swing)


def derivatives(of, time, step=1e-4):
    """First and second derivatives of a function of time, by differences of fourth order."""
    far, near = (of(time + 2 * step), of(time + step)), (of(time - step), of(time - 2 * step))
    first = (far[1] * 8 - far[0] - near[0] * 8 + near[1]) / (12 * step)
    second = (16 * (far[1] + near[0]) - far[0] - near[1] - 30 * of(time)) / (12 * step**2)
    return first, second


def conjugate(quaternion):
    return quaternion * [-1.0, -1.0, -1.0, 1.0]


def wrench_of(payload, time, force=FORCE, torque=TORQUE, motion=motion):
    """The wrench that the sensor reads under an external force, N, and torque, N·m, in the base."""
    _, acceleration = derivatives(lambda t: motion(t)[0], time)
    q = motion(time)[1]
    q1, q2 = derivatives(lambda t: motion(t)[1], time)
    spin, change = (2.0 * multiply(conjugate(q), each)[:, :3] for each in (q1, q2))
    specific = rotate([0.0, 0.0, -9.80665] - acceleration, conjugate(q))
    load = payload.wrench(specific, spin, change) + payload.bias
    outside = [rotate(each, conjugate(q)) @ payload.mount for each in (force, torque)]
    return payload.sign * (load + np.hstack(outside))
