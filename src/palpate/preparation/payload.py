"""The payload of a force-torque sensor: tool, mount, zero and clock, from one log of its wrench."""

import math
from dataclasses import dataclass, field

import numpy as np

from palpate.findings import Finding, Mark, worst
from palpate.validation import Floats

GRAVITY = 9.80665  # m/s², along −z of the frame of the pose


@dataclass(frozen=True, slots=True, eq=False)
class Payload:
    """What a wrist sensor carries, how it is mounted, and what it reads without contact.

    With the specific force g = Rᵀ(g₀ − p̈), the angular velocity ω and the angular acceleration α
    of the pose, turned to the axes of the sensor by the mount, the wrench in free air is

        f = m g − (α× + ω×ω×)(m c + m d) + b_f,   τ = m c × g − (I α + ω × I ω) + b_τ

    with the mass m, the centre of mass c, the lever d, the inertia I and the bias b. ``sign`` times
    the recorded wrench obeys it; the remainder is the force of the material on the tool.

    Attributes
    ----------
    mass : float
        kg.
    centre : numpy.ndarray, shape (3,)
        Centre of mass from the origin of the sensor, in its axes, m.
    mount : numpy.ndarray, shape (3, 3)
        Rotation of the sensor in the flange, the frame of the pose: v_flange = mount · v_sensor.
    bias : numpy.ndarray, shape (6,)
        Mean wrench of the unloaded sensor, in its axes, N and N·m.
    inertia : numpy.ndarray, shape (6,), or None
        xx, yy, zz, xy, xz, yz about the origin of the sensor, in its axes, kg·m²; None if the tool
        does not turn.
    lever : numpy.ndarray, shape (3,)
        From the origin of the pose to that of the sensor, in the axes of the sensor, m.
    delay : float
        s, positive if the wrench is late behind the pose.
    sign : float
        −1 if the sensor reads the force that the tool exerts, else 1.
    bias_times : numpy.ndarray, shape (k,)
        Times of the drift, s, on the clock of the wrench; empty without drift.
    bias_changes : numpy.ndarray, shape (k, 6)
        Wrench that is added to the mean bias at these times, N and N·m; linear in between.
    mass_error, delay_error : float
        Standard errors, kg and s.
    centre_error, mount_error, lever_error : numpy.ndarray, shape (3,)
        Standard errors, m, rad (about the axes of the sensor) and m.
    bias_error : numpy.ndarray, shape (6,)
        Standard errors, N and N·m.
    inertia_error : numpy.ndarray, shape (6,), or None
        Standard errors, kg·m².
    turn : float
        Largest angle between the directions of gravity in free air, in the axes of the sensor, rad.
    axes : int
        Number of axes about which gravity turns: 0, 1 or 2.
    free_share : float
        Fraction of the log in free air.
    free_time : float
        Time in free air, s.
    mass_mark, mount_mark, delay_mark : str
        ``"trust"``, ``"with-care"`` or ``"do-not-trust"``.
    findings : tuple of Finding
        Reasons for the marks, with the remedy.
    version : int
        Version of these fields in a file.
    """

    mass: float
    centre: Floats
    mount: Floats
    bias: Floats
    inertia: Floats | None = None
    lever: Floats = field(default_factory=lambda: np.zeros(3))
    delay: float = 0.0
    sign: float = 1.0
    bias_times: Floats = field(default_factory=lambda: np.zeros(0))
    bias_changes: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    mass_error: float = math.nan
    centre_error: Floats = field(default_factory=lambda: np.full(3, math.nan))
    mount_error: Floats = field(default_factory=lambda: np.full(3, math.nan))
    lever_error: Floats = field(default_factory=lambda: np.full(3, math.nan))
    bias_error: Floats = field(default_factory=lambda: np.full(6, math.nan))
    inertia_error: Floats | None = None
    delay_error: float = math.nan
    turn: float = math.nan
    axes: int = 0
    free_share: float = math.nan
    free_time: float = math.nan
    mass_mark: Mark = "trust"
    mount_mark: Mark = "trust"
    delay_mark: Mark = "trust"
    findings: tuple[Finding, ...] = ()
    version: int = 1

    @property
    def mark(self) -> Mark:
        """The worst of the marks of mass, mount and delay."""
        return worst(self.mass_mark, self.mount_mark, self.delay_mark)

    def wrench(
        self, specific_force: Floats, angular_velocity: Floats, angular_acceleration: Floats
    ) -> Floats:
        """Return the wrench of weight and inertia in the axes of the sensor, without the bias.

        Parameters
        ----------
        specific_force, angular_velocity, angular_acceleration : numpy.ndarray, shape (k, 3)
            In the axes of the flange: m/s², rad/s and rad/s².

        Returns
        -------
        numpy.ndarray, shape (k, 6)
            N and N·m.
        """
        g, w, a = (
            np.asarray(each) @ self.mount
            for each in (specific_force, angular_velocity, angular_acceleration)
        )
        h = self.mass * self.centre
        arm = h + self.mass * self.lever
        force = self.mass * g - np.cross(a, arm) - np.cross(w, np.cross(w, arm))
        torque = np.cross(h, g)
        if self.inertia is not None:
            xx, yy, zz, xy, xz, yz = self.inertia
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            torque = torque - a @ tensor - np.cross(w, w @ tensor)
        return np.hstack([force, torque])

    def bias_at(self, time: Floats) -> Floats:
        """Return the bias at some times of the log that it was found from, shape (k, 6)."""
        bias: Floats = np.tile(self.bias, (len(time), 1))
        if not len(self.bias_times):
            return bias
        changes: list[Floats] = [
            np.interp(time, self.bias_times, column) for column in self.bias_changes.T
        ]
        return bias + np.column_stack(changes)
