"""The rig: geometry, probes and sensors, and a planar twin pantograph simulated in MuJoCo.

The plane has x along the surface and y into the material, y = 0 at the surface. Each pantograph is
a five-bar linkage: two motors, two proximal and two distal links that meet in its wrist. The wrists
of the two pantographs carry a handle, and the handle the poking device.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from palpate.errors import InvalidParameterError, require_mujoco
from palpate.lab.materials import Material, Touch, force_of_touch
from palpate.lab.trajectories import Command, Trajectory, arccos, arctan2, cos, sin
from palpate.validation import Floats, frozen, number_in

if TYPE_CHECKING:
    import mujoco


#: For each motor its pantograph, and the side of its elbow.
PANTOGRAPH = np.array([0, 0, 1, 1])
ELBOW = np.array([1.0, -1.0, 1.0, -1.0])


@frozen
class Geometry:
    """Lengths of the rig, m. They are assumed: the paper has none.

    Parameters
    ----------
    proximal, distal : float
        Length of the links from a motor to its elbow, and from the elbow to the wrist.
    motor_spacing : float
        Distance of the two motors of a pantograph.
    handle : float
        Distance of the two wrists.
    poker : float
        Distance from the handle to the tip.
    reach : float
        Distance from the line of motors to the wrists with the tip at the surface.
    """

    proximal: float = 0.075
    distal: float = 0.1
    motor_spacing: float = 0.04
    handle: float = 0.16
    poker: float = 0.06
    reach: float = 0.12

    @property
    def motors(self) -> Floats:
        """Positions of the four motors, shape (4, 2)."""
        middle = np.array([-0.5, -0.5, 0.5, 0.5]) * self.handle
        side = np.array([-0.5, 0.5, -0.5, 0.5]) * self.motor_spacing
        height = np.full(4, -self.poker - self.reach)
        return np.column_stack([middle + side, height])

    def wrists(self, lateral_position: Floats, penetration: Floats) -> Floats:
        """Positions of the two wrists for a tip normal to the surface, shape (k, 2, 2)."""
        side = np.array([-0.5, 0.5]) * self.handle
        x = np.asarray(lateral_position)[..., None] + side
        y = np.broadcast_to(np.asarray(penetration)[..., None] - self.poker, x.shape)
        return np.stack([x, y], axis=-1)

    def motor_angles(self, lateral_position: Floats, penetration: Floats) -> Floats:
        """Inverse kinematics: angles of the four motors from the x axis, rad; shape (k, 4)."""
        reach = self.wrists(lateral_position, penetration)[..., PANTOGRAPH, :] - self.motors
        distance = _length(reach)
        cosine = (self.proximal**2 + distance**2 - self.distal**2) / (2 * self.proximal * distance)
        # Beyond their length the links are fully stretched.
        turn = arccos(np.clip(cosine, -1.0, 1.0))
        angles: Floats = arctan2(reach[..., 1], reach[..., 0]) + ELBOW * turn
        return angles

    def motor_motion(self, command: Command) -> tuple[Floats, Floats]:
        """Angles of the four motors, rad, and their speeds, rad/s; shapes (k, 4).

        A distal link keeps its length: (wrist − elbow) · (wrist velocity − elbow velocity) = 0.
        """
        tip = command.lateral_position, command.penetration
        angles = self.motor_angles(*tip)
        wrists = self.wrists(*tip)[..., PANTOGRAPH, :]
        out = np.stack([cos(angles), sin(angles)], axis=-1)
        along = wrists - (self.motors + self.proximal * out)
        turning = np.stack([-out[..., 1], out[..., 0]], axis=-1) * self.proximal
        moving = np.stack([command.lateral_velocity, command.velocity], axis=-1)[..., None, :]
        speeds: Floats = (along * moving).sum(axis=-1) / (along * turning).sum(axis=-1)
        return angles, speeds

    def elbows(self, angles: Floats) -> Floats:
        """Positions of the four elbows; shape (k, 4, 2)."""
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
    between = right - left
    distance = _length(between)[..., None]
    height = np.sqrt(np.maximum(radius**2 - 0.25 * distance**2, 0.0))
    across = np.stack([-between[..., 1], between[..., 0]], axis=-1) / distance
    across = across * np.where(across[..., 1:] >= 0.0, 1.0, -1.0)
    point: Floats = 0.5 * (left + right) + height * across
    return point


# Probes, which carry the tip and record its motion.

#: Called from time to time with the simulated time, s.
Progress = Callable[[float], None]


@frozen(eq=False)
class SimulatedMotion:
    """True motion and force of the probe, and its recorded motion.

    Attributes
    ----------
    penetration, velocity, lateral_position, force : numpy.ndarray, shape (k,)
        True values at the probe's tip: m, m/s, m and N.
    recorded_penetration : numpy.ndarray, shape (k,)
        Penetration according to the probe's own sensors, m.
    """

    penetration: Floats
    velocity: Floats
    lateral_position: Floats
    force: Floats
    recorded_penetration: Floats


@runtime_checkable
class Probe(Protocol):
    """A probe that moves the tip along a trajectory."""

    @property
    def name(self) -> str:
        """Name of the probe in tables and figures."""

    def follow(
        self,
        trajectory: Trajectory,
        material: Material,
        time: Floats,
        random: np.random.Generator,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Press ``material`` along ``trajectory``; times are s, evenly spaced, from 0 on."""


@frozen
class IdealProbe:
    """A tip that follows the command exactly, without a robot; for statistics."""

    name: str = "ideal probe"

    def follow(
        self,
        trajectory: Trajectory,
        material: Material,
        time: Floats,
        random: np.random.Generator,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Press ``material`` exactly along ``trajectory``."""
        command = trajectory.at(time)
        x = command.penetration
        v = command.velocity
        lateral = command.lateral_position
        return SimulatedMotion(x, v, lateral, material.force(time, lateral, x, v), x)

    def start(
        self,
        command: Command,
        sample_time: float,
        random: np.random.Generator,
    ) -> "IdealProbe":
        """Return a tip that follows this command and its continuations; it has no state."""
        return self

    def simulate(
        self,
        time: Floats,
        command: Command,
        touch: Touch,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Follow a command over its times [s]."""
        x = command.penetration
        v = command.velocity
        lateral = command.lateral_position
        return SimulatedMotion(x, v, lateral, force_of_touch(touch, time, lateral, x, v), x)


# The sensors.


@frozen
class Sensors:
    """The force sensor and the clock; the defaults are those of the paper's section IV.

    recorded = step · round((F + bias + ε) / step) − mean of the same over the pause,  ε ~ N(0, σ²)

    Parameters
    ----------
    force_noise : float
        σ, N, in [0, 1e6]; 0 for none.
    force_resolution : float
        Quantisation step of the force, N, in [0, 1e6]; 0 for none.
    force_bias : float
        Standard deviation of the random bias, N, in [0, 1e6]; 0 for none.
    penetration_resolution : float
        Quantisation step of an ideal probe's penetration, m, in [0, 1]; 0 for none. A robot's step
        follows from its encoders.
    sample_time : float
        s, in [1e-5, 1].
    """

    force_noise: float = 0.05
    force_resolution: float = 0.125
    force_bias: float = 0.5
    penetration_resolution: float = 0.0
    sample_time: float = 1e-3

    def __post_init__(self) -> None:
        number_in("force_noise", self.force_noise, 0.0, 1e6)
        number_in("force_resolution", self.force_resolution, 0.0, 1e6)
        number_in("force_bias", self.force_bias, 0.0, 1e6)
        number_in("penetration_resolution", self.penetration_resolution, 0.0, 1.0)
        number_in("sample_time", self.sample_time, 1e-5, 1.0)

    def force(self, force: Floats, random: np.random.Generator) -> Floats:
        """Force as the sensor shows it, including the bias, N."""
        return self.measure_force(force, self.bias(random), random)

    def bias(self, random: np.random.Generator) -> float:
        """Draw a sensor's constant bias, N."""
        return float(self.force_bias * random.standard_normal())

    def measure_force(self, force: Floats, bias: float, random: np.random.Generator) -> Floats:
        """Force as a sensor with this bias [N] shows it."""
        noise = self.force_noise * random.standard_normal(force.size)
        return quantise(force + bias + noise, self.force_resolution)

    def describe(self) -> str:
        """Describe the sensors in a line."""
        return (
            f"force noise {self.force_noise:g} N rms, in steps of {self.force_resolution:g} N, "
            f"unknown bias of {self.force_bias:g} N rms; a sample every {self.sample_time:g} s"
        )


#: Sensors without noise, bias and quantisation.
PERFECT = Sensors(force_noise=0.0, force_resolution=0.0, force_bias=0.0)


def quantise(values: Floats, step: float) -> Floats:
    """Round to the nearest step, as far as floats resolve it; adding zero turns −0 into 0."""
    if step <= np.spacing(np.abs(values).max(initial=0.0)):
        return values
    return step * np.round(values / step) + 0.0


# The twin pantograph as a MuJoCo model: bodies, closed chains, motors.

# kg and m; assumed, like a desktop haptic device with a force sensor at its handle.
LINK_MASS = 0.02
LINK_WIDTH = 0.005
THICKNESS = 0.004


def rig_xml(geometry: Geometry, home: Floats, *, time_step: float) -> str:
    """Return the model with every joint at zero at home.

    Parameters
    ----------
    geometry : Geometry
        Lengths.
    home : numpy.ndarray, shape (4,)
        Angles of the motors, rad.
    time_step : float
        s.
    """
    chains = "\n".join(_chain(i, geometry, home) for i in range(4))
    bases = (
        f'    <geom type="cylinder" pos="{x:.9g} {y:.9g} -0.03" size="0.017 0.022" '
        'rgba="0.2 0.21 0.23 1"/>'
        for x, y in geometry.motors
    )
    return _fill_template(
        "rig.xml",
        geometry=geometry,
        time_step=time_step,
        # The stiffest constraint that the step allows, as bearings are nearly rigid.
        stiff=f'solref="{2.0 * time_step:g} 1" solimp="0.999 0.9999 0.0001"',
        table=-0.5 * (geometry.poker + geometry.reach),
        bases="\n".join(bases),
        chains=chains,
    )


def _fill_template(name: str, **values: Any) -> str:
    """A template file next to this module, with its placeholders filled in."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8").format(**values)


def _chain(i: int, geometry: Geometry, home: Floats) -> str:
    """One motor, its proximal and its distal link, at home; the first chain carries the handle."""
    (x, y) = geometry.motors[i]
    angle = float(home[i])
    elbow = geometry.elbows(home)[i]
    wrist = geometry.wrists(*geometry.tip(home))[i // 2]
    # The two chains of a pantograph lie one above the other.
    level = THICKNESS * (1.2 if ELBOW[i] > 0.0 else -1.2)
    turned = math.atan2(wrist[1] - elbow[1], wrist[0] - elbow[0])
    handle = ""
    if i == 0:
        half = geometry.handle / 2
        end = geometry.poker - 0.004
        handle = _fill_template(
            "rig_handle.xml",
            geometry=geometry,
            angle=-turned,
            half=half,
            end=end,
        )
    links = {
        "near": _link(geometry.proximal, level, "0.16 0.38 0.62 1"),
        "far": _link(geometry.distal, level, "0.45 0.62 0.78 1"),
        "elbow": geometry.proximal,
        "handle": handle,
    }
    return _fill_template("rig_chain.xml", i=i, x=x, y=y, angle=angle, turn=turned - angle, **links)


def _link(length: float, level: float, colour: str) -> str:
    pin = f'size="0.0058 {1.25 * THICKNESS:.9g}" mass="0" rgba="0.15 0.16 0.18 1"'
    return (
        f'<geom type="cylinder" pos="{length:.9g} 0 0" {pin}/>'
        f'<geom type="box" mass="{LINK_MASS}" pos="{length / 2:.9g} 0 {level:.9g}" '
        f'size="{length / 2:.9g} {LINK_WIDTH} {THICKNESS / 2}" rgba="{colour}"/>'
    )


# A planar twin pantograph, simulated in MuJoCo, with the tracking errors of a real robot.

# Beyond these the simulation has diverged: the motors can move the tip at about 3 m/s and press
# with about 300 N.
TOP_SPEED = 20.0
PEAK_FORCE = 1e4  # m/s, N


@frozen
class TwinPantograph:
    """Two pantographs that carry one poking device, each driven by two motors at its base.

    Encoders count the motors' turns; position control holds each motor at the angle q* from inverse
    kinematics,

        τ = k_p (q* − q) + k_d (q̇* − q̇),   q̇ by a low-pass filtered difference of the counts,

    and forward kinematics of the counts gives the recorded position (section IV).

    Parameters
    ----------
    counts_per_turn : float
        Counts per turn of each encoder, ≥ 0; 0 for exact encoders.
    proportional_gain : float
        k_p, N·m/rad, in (0, 1e4].
    derivative_gain : float
        k_d, N·m·s/rad, in [0, 1e2].
    velocity_filter : float
        Corner of the low-pass filter, rad/s, in (0, 1e4].
    torque_limit : float
        N·m, in (0, 1e4].
    time_step : float
        The longest step of the simulation, s, in [1e-5, 1e-3].
    """

    name: ClassVar[str] = "twin pantograph"
    counts_per_turn: float = 20_000.0
    proportional_gain: float = 40.0
    derivative_gain: float = 0.4
    velocity_filter: float = 600.0
    torque_limit: float = 5.0
    time_step: float = 0.5e-3

    def __post_init__(self) -> None:
        number_in("counts_per_turn", self.counts_per_turn, 0.0, 1e12)
        number_in("proportional_gain", self.proportional_gain, 0.0, 1e4, open_low=True)
        number_in("derivative_gain", self.derivative_gain, 0.0, 1e2)
        number_in("velocity_filter", self.velocity_filter, 0.0, 1e4, open_low=True)
        number_in("torque_limit", self.torque_limit, 0.0, 1e4, open_low=True)
        number_in("time_step", self.time_step, 1e-5, 1e-3)

    def follow(
        self,
        trajectory: Trajectory,
        material: Material,
        time: Floats,
        random: np.random.Generator,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Press ``material`` along ``trajectory`` under position control."""
        step = float(time[1] - time[0]) if time.size > 1 else 1e-3
        command = trajectory.at(time)
        run = self.start(command, step, random)
        return run.simulate(time, command, material.touch(), progress)

    def start(
        self,
        command: Command,
        sample_time: float,
        random: np.random.Generator,
    ) -> "Simulation":
        """Return the rig at rest where a command begins; it follows it and its continuations."""
        return Simulation(self, command, sample_time, random)


class _Encoders:
    """Incremental encoders, zeroed at rest, with a random phase within a count."""

    def __init__(self, counts_per_turn: float, home: Floats, random: np.random.Generator) -> None:
        phase = random.uniform(0.0, 1.0, home.size)
        self._step = 2.0 * math.pi / counts_per_turn if counts_per_turn > 0.0 else 0.0
        self._zeros = list(zip(home.tolist(), phase.tolist(), strict=True))

    def read(self, angles: list[float]) -> list[float]:
        """Angles as counted, rad."""
        step = self._step
        if step == 0.0:
            return angles
        # Not math.floor, which raises on the NaN of a diverged simulation.
        return [
            home + ((angle - home) / step + phase) // 1.0 * step
            for angle, (home, phase) in zip(angles, self._zeros, strict=True)
        ]


class _PositionControl:
    """Torques of the position control, one sample after the other."""

    def __init__(self, settings: TwinPantograph, sample_time: float, counted: list[float]) -> None:
        self._settings = settings
        self._sample_time = sample_time
        self._kept = math.exp(-settings.velocity_filter * sample_time)
        self._counted = counted
        self._filtered = [0.0] * len(counted)

    def torques(self, counted: list[float], goal: list[float], speed: list[float]) -> list[float]:
        """Torques [N·m] for the measured angles [rad] and the desired angles and speeds."""
        kept = self._kept
        step = self._sample_time
        before = self._counted
        self._filtered = [
            kept * filtered + (1.0 - kept) * ((now - last) / step)
            for filtered, now, last in zip(self._filtered, counted, before, strict=True)
        ]
        self._counted = counted
        rig = self._settings
        limit = self._settings.torque_limit
        every = zip(goal, counted, speed, self._filtered, strict=True)
        wanted = (
            rig.proportional_gain * (q - now) + rig.derivative_gain * (rate - known)
            for q, now, rate, known in every
        )
        return [min(max(torque, -limit), limit) for torque in wanted]


class Simulation:
    """One run of the rig from rest, a substep at a time.

    Parameters
    ----------
    settings : TwinPantograph
        Settings of the robot.
    command : Command
        The rig starts at its first sample.
    sample_time : float
        s, at most 0.01.
    random : numpy.random.Generator
        Random generator of the encoders' phases.
    """

    def __init__(
        self,
        settings: TwinPantograph,
        command: Command,
        sample_time: float,
        random: np.random.Generator,
    ) -> None:
        if sample_time > 1e-2:
            raise InvalidParameterError(
                "sample_time must be at most 0.01 s for the position-controlled robot, not "
                f"{sample_time:g} s"
            )
        self._mujoco = require_mujoco()
        self._geometry = Geometry()
        first = command.lateral_position[:1], command.penetration[:1]
        home = self._geometry.motor_angles(*first)[0]
        self._encoders = _Encoders(settings.counts_per_turn, home, random)
        counted = self._encoders.read(home.tolist())
        self._control = _PositionControl(settings, sample_time, counted)
        self._substeps = math.ceil(sample_time / settings.time_step - 1e-9)
        self._step_time = sample_time / self._substeps
        xml = rig_xml(self._geometry, home, time_step=self._step_time)
        self.model: mujoco.MjModel = self._mujoco.MjModel.from_xml_string(xml)
        self.data: mujoco.MjData = self._mujoco.MjData(self.model)
        motors = [self.model.joint(f"motor_{i}").qposadr[0] for i in range(4)]
        self._motors = list(zip(motors, home.tolist(), strict=True))
        # Views of MuJoCo's arrays: requesting one takes as long as reading it.
        self._positions = self.data.qpos
        self._torques = self.data.ctrl
        self._applied = self.data.qfrc_applied
        tip = self.model.site("tip").id
        self._tip, self._tip_body = self.data.site_xpos[tip], int(self.model.site_bodyid[tip])
        self._tip_velocity = self.data.sensor("tip_velocity").data
        self._push = np.zeros(3)
        self._twist = np.zeros(3)
        self._before = 0.0

    def simulate(
        self,
        time: Floats,
        command: Command,
        touch: Touch,
        progress: Progress | None = None,
    ) -> SimulatedMotion:
        """Follow a command over its times [s]; the next call continues where this one ends."""
        goals, speeds = self._geometry.motor_motion(command)
        samples = []
        counts = []
        every = zip(time.tolist(), goals.tolist(), speeds.tolist(), strict=True)
        for k, (now, goal, speed) in enumerate(every):
            if progress is not None and k % 100 == 0:
                progress(now)
            turned = self._positions.tolist()
            counted = self._encoders.read([turned[motor] + home for motor, home in self._motors])
            self._torques[:] = self._control.torques(counted, goal, speed)
            counts.append(counted)
            samples.append(self._step(now, touch))
            for substep in range(1, self._substeps):
                self._step(now + substep * self._step_time, touch)
        felt = np.array(samples, dtype=np.float64).reshape(-1, 4).T.copy()
        depth, velocity, lateral_position, force = felt
        recorded = self._geometry.tip(np.array(counts, dtype=np.float64).reshape(-1, 4))[1]
        return SimulatedMotion(depth, velocity, lateral_position, force, recorded)

    def _step(self, now: float, touch: Touch) -> tuple[float, float, float, float]:
        """Advance by a substep; return the tip's motion and force at its start."""
        mujoco = self._mujoco
        model = self.model
        data = self.data
        mujoco.mj_step1(model, data)
        lateral_position, depth, _ = self._tip.tolist()
        # MuJoCo steps by x(t + h) = x(t) + h v(t + h): its velocity is that half a step earlier.
        lagging = self._tip_velocity.item(1)
        velocity = 1.5 * lagging - 0.5 * self._before
        self._before = lagging
        force = touch(now, lateral_position, depth, velocity)
        if not (abs(velocity) < TOP_SPEED and abs(force) < PEAK_FORCE):
            raise InvalidParameterError(
                f"the simulation of the twin pantograph diverged at t = {now:.3f} s, because the "
                f"material is too stiff or too damped for steps of {model.opt.timestep:g} s: use "
                "probe ideal, or a smaller time_step"
            )
        self._applied.fill(0.0)
        self._push[1] = -force
        mujoco.mj_applyFT(
            model,
            data,
            self._push,
            self._twist,
            self._tip,
            self._tip_body,
            self._applied,
        )
        mujoco.mj_step2(model, data)
        return depth, velocity, lateral_position, force
