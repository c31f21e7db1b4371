"""Geometry of the planar twin pantograph: motor angles to tip, and back.

The plane has x along the surface and y into the material, y = 0 at the surface. Each pantograph is
a five-bar linkage: two motors, two proximal and two distal links that meet in its wrist. The wrists
of the two pantographs carry a handle, and the handle the poking device.
"""

from dataclasses import dataclass

import numpy as np

from palpate.lab.elementary import arccos, arctan2, cos, sin
from palpate.validation import Floats

#: Of each motor: which pantograph it belongs to, and on which side its elbow lies.
PANTOGRAPH = np.array([0, 0, 1, 1])
ELBOW = np.array([1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True, slots=True)
class Geometry:
    """Lengths of the rig, m. They are ours: the paper gives none.

    Parameters
    ----------
    proximal, distal : float
        Links from a motor to its elbow, and from there to the wrist.
    motor_spacing : float
        Between the two motors of a pantograph.
    handle : float
        Between the two wrists.
    poker : float
        From the handle to the tip.
    reach : float
        From the line of motors to the wrists, when the tip is at the surface.
    """

    proximal: float = 0.075
    distal: float = 0.1
    motor_spacing: float = 0.04
    handle: float = 0.16
    poker: float = 0.06
    reach: float = 0.12

    @property
    def motors(self) -> Floats:
        """Places of the four motors, shape (4, 2)."""
        middle = np.array([-0.5, -0.5, 0.5, 0.5]) * self.handle
        side = np.array([-0.5, 0.5, -0.5, 0.5]) * self.motor_spacing
        height = np.full(4, -self.poker - self.reach)
        return np.column_stack([middle + side, height])

    def wrists(self, lateral_position: Floats, penetration: Floats) -> Floats:
        """Places of the two wrists for a tip that points straight into the material; (k, 2, 2)."""
        side = np.array([-0.5, 0.5]) * self.handle
        x = np.asarray(lateral_position)[..., None] + side
        y = np.broadcast_to(np.asarray(penetration)[..., None] - self.poker, x.shape)
        return np.stack([x, y], axis=-1)

    def motor_angles(self, lateral_position: Floats, penetration: Floats) -> Floats:
        """Inverse kinematics: angles of the four motors from the x axis, rad; shape (k, 4)."""
        reach = self.wrists(lateral_position, penetration)[..., PANTOGRAPH, :] - self.motors
        distance = _length(reach)
        cosine = (self.proximal**2 + distance**2 - self.distal**2) / (2 * self.proximal * distance)
        # Beyond the links' length they stretch as far as they can.
        turn = arccos(np.clip(cosine, -1.0, 1.0))
        angles: Floats = arctan2(reach[..., 1], reach[..., 0]) + ELBOW * turn
        return angles

    def motor_motion(
        self,
        lateral_position: Floats,
        penetration: Floats,
        lateral_velocity: Floats,
        velocity: Floats,
    ) -> tuple[Floats, Floats]:
        """Angles of the four motors, rad, and their speeds, rad/s; shapes (k, 4).

        A distal link keeps its length: (wrist − elbow) · (wrist velocity − elbow velocity) = 0.
        """
        angles = self.motor_angles(lateral_position, penetration)
        wrists = self.wrists(lateral_position, penetration)[..., PANTOGRAPH, :]
        out = np.stack([cos(angles), sin(angles)], axis=-1)
        along = wrists - (self.motors + self.proximal * out)
        turning = np.stack([-out[..., 1], out[..., 0]], axis=-1) * self.proximal
        moving = np.stack([lateral_velocity, velocity], axis=-1)[..., None, :]
        speeds: Floats = (along * moving).sum(axis=-1) / (along * turning).sum(axis=-1)
        return angles, speeds

    def elbows(self, angles: Floats) -> Floats:
        """Places of the four elbows; shape (k, 4, 2)."""
        out = np.stack([cos(angles), sin(angles)], axis=-1)
        positions: Floats = self.motors + self.proximal * out
        return positions

    def tip(self, angles: Floats) -> tuple[Floats, Floats]:
        """Forward kinematics: lateral position and penetration of the tip, m; each of shape (k,).

        A wrist is where the circles about its two elbows meet, deeper than both.
        """
        elbows = self.elbows(angles)
        wrists = [_meeting(elbows[..., i, :], elbows[..., i + 1, :], self.distal) for i in (0, 2)]
        along = wrists[1] - wrists[0]
        along = along / _length(along)[..., None]
        middle = 0.5 * (wrists[0] + wrists[1])
        x = middle[..., 0] - self.poker * along[..., 1]
        y = middle[..., 1] + self.poker * along[..., 0]
        return x, y


def _length(vectors: Floats) -> Floats:
    lengths: Floats = np.sqrt(vectors[..., 0] ** 2 + vectors[..., 1] ** 2)
    return lengths


def _meeting(left: Floats, right: Floats, radius: float) -> Floats:
    """The deeper of the two points at a distance from both."""
    first, second = (left, right)
    between = second - first
    distance = _length(between)[..., None]
    height = np.sqrt(np.maximum(radius**2 - 0.25 * distance**2, 0.0))
    across = np.stack([-between[..., 1], between[..., 0]], axis=-1) / distance
    across = across * np.where(across[..., 1:] >= 0.0, 1.0, -1.0)
    point: Floats = 0.5 * (first + second) + height * across
    return point
