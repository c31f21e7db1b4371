"""A planar twin pantograph, simulated in MuJoCo: it follows a command as well as a robot can."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.lab.kinematics import Geometry
from palpate.lab.materials import Material, Touch
from palpate.lab.probes import Progress, SimulatedMotion
from palpate.lab.rig import rig_xml
from palpate.lab.trajectories import Command, Trajectory
from palpate.validation import Floats, number_in

if TYPE_CHECKING:
    import mujoco


# Beyond these a simulation has broken down: its motors can move the tip at some 3 m/s and press
# with some 300 N.
TOP_SPEED, PEAK_FORCE = 20.0, 1e4  # m/s, N


_PANTOGRAPH = "the twin pantograph needs MuJoCo: pip install 'palpate[lab]', or use an ideal probe"


def require_mujoco(words: str = _PANTOGRAPH) -> Any:
    """Return MuJoCo, or say in words what needs it and how to install it."""
    try:
        import mujoco
    except ImportError:
        raise MissingExtraError(words) from None
    except Exception as error:  # a graphics library asked for by MUJOCO_GL, but not there
        raise MissingExtraError(
            f"MuJoCo is installed but does not load: {error}; check the variable MUJOCO_GL"
        ) from None
    return mujoco


@dataclass(frozen=True, slots=True)
class TwinPantograph:
    """Two pantographs that carry one poking device, each driven by two motors at its base.

    Encoders count the motors' turns; position control holds each motor to the angle that inverse
    kinematics asks for,

        τ = k_p (q* − q) + k_d (q̇* − q̇),   q̇ by a low-pass filtered difference of the counts,

    and forward kinematics of the counts gives the recorded position (section IV).

    Parameters
    ----------
    counts_per_turn : float
        Of each encoder, ≥ 0; 0 for encoders without steps.
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

    @property
    def name(self) -> str:
        """What a person calls it."""
        return "twin pantograph"

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
        self, command: Command, sample_time: float, random: np.random.Generator
    ) -> "Simulation":
        """Return the rig at rest where a command begins; it follows that and any that continue."""
        return Simulation(self, command, sample_time, random)


class _Encoders:
    """Incremental encoders, zeroed at rest: the phase within a count is anyone's guess."""

    def __init__(self, counts_per_turn: float, home: Floats, random: np.random.Generator) -> None:
        phase = random.uniform(0.0, 1.0, home.size)
        self._step = 2.0 * math.pi / counts_per_turn if counts_per_turn > 0.0 else 0.0
        self._home, self._phase = home, phase

    def read(self, angles: Floats) -> Floats:
        """Angles as counted, rad."""
        if self._step == 0.0:
            return angles.copy()
        counts = np.floor((angles - self._home) / self._step + self._phase)
        return self._home + counts * self._step


class Simulation:
    """One run of the rig from rest, a substep at a time.

    Parameters
    ----------
    settings : TwinPantograph
        The robot's.
    command : Command
        Where it begins: its first sample.
    sample_time : float
        s, at most 0.01.
    random : numpy.random.Generator
        Of the encoders' phases.
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
                "sample_time must be at most 0.01 s for a robot under control, not "
                f"{sample_time:g} s"
            )
        self._mujoco = require_mujoco()
        self._settings, self._geometry = settings, Geometry()
        first = command.lateral_position[:1], command.penetration[:1]
        self._home = self._geometry.motor_angles(*first)[0]
        self._encoders = _Encoders(settings.counts_per_turn, self._home, random)
        self._substeps = math.ceil(sample_time / settings.time_step - 1e-9)
        self._sample_time = sample_time
        xml = rig_xml(self._geometry, self._home, time_step=sample_time / self._substeps)
        self.model: mujoco.MjModel = self._mujoco.MjModel.from_xml_string(xml)
        self.data: mujoco.MjData = self._mujoco.MjData(self.model)
        self._motors = np.array([self.model.joint(f"motor_{i}").qposadr[0] for i in range(4)])
        self._tip = self.model.site("tip").id
        self._tip_body = self.model.site_bodyid[self._tip]
        self._tip_velocity = self.data.sensor("tip_velocity").data
        self._before = 0.0
        self._filtered = np.zeros(4)
        self._counted = self._encoders.read(self._home)

    def simulate(
        self, time: Floats, command: Command, touch: Touch, progress: Progress | None = None
    ) -> SimulatedMotion:
        """Follow a command over its times [s]; the next call continues from where this one ends."""
        goal = self._geometry.motor_angles(command.lateral_position, command.penetration)
        speed = self._geometry.motor_speeds(
            command.lateral_position,
            command.penetration,
            command.lateral_velocity,
            command.velocity,
        )
        samples = np.empty((time.size, 4))
        counted = np.empty((time.size, 4))
        for k, now in enumerate(time.tolist()):
            if progress is not None and k % 100 == 0:
                progress(now)
            counted[k] = self._encoders.read(self._angles())
            self._control(counted[k], goal[k], speed[k])
            samples[k] = self._sample(now, touch)
        recorded = self._geometry.tip(counted)[1]
        return SimulatedMotion(samples[:, 0], samples[:, 1], samples[:, 2], samples[:, 3], recorded)

    def _sample(self, now: float, touch: Touch) -> tuple[float, float, float, float]:
        """Advance by a sample time; what the tip did and felt at its beginning."""
        step = self._sample_time / self._substeps
        felt = self._step(now, touch)
        for substep in range(1, self._substeps):
            self._step(now + substep * step, touch)
        return felt

    def _angles(self) -> Floats:
        angles: Floats = self.data.qpos[self._motors] + self._home
        return angles

    def _control(self, counted: Floats, goal: Floats, speed: Floats) -> None:
        kept = math.exp(-self._settings.velocity_filter * self._sample_time)
        difference = (counted - self._counted) / self._sample_time
        self._filtered = kept * self._filtered + (1.0 - kept) * difference
        self._counted = counted
        torque = self._settings.proportional_gain * (goal - counted)
        torque += self._settings.derivative_gain * (speed - self._filtered)
        limit = self._settings.torque_limit
        self.data.ctrl[:] = np.clip(torque, -limit, limit)

    def _step(self, now: float, touch: Touch) -> tuple[float, float, float, float]:
        """Advance by a substep; what the tip did and felt at its beginning."""
        mujoco, model, data = self._mujoco, self.model, self.data
        mujoco.mj_step1(model, data)
        lateral_position, depth, _ = data.site_xpos[self._tip].tolist()
        # MuJoCo moves by x(t + h) = x(t) + h v(t + h): its velocity is that of half a step ago.
        lagging = float(self._tip_velocity[1])
        velocity = 1.5 * lagging - 0.5 * self._before
        self._before = lagging
        force = touch(now, lateral_position, depth, velocity)
        if not (abs(velocity) < TOP_SPEED and abs(force) < PEAK_FORCE):
            raise InvalidParameterError(
                f"material is too stiff or too damped for the twin pantograph at steps of "
                f"{model.opt.timestep:g} s: the simulation breaks down at t = {now:.3f} s; take a "
                "softer material, a smaller time_step, or an ideal probe"
            )
        data.qfrc_applied[:] = 0.0
        push = np.array([0.0, -force, 0.0])
        mujoco.mj_applyFT(
            model,
            data,
            push,
            np.zeros(3),
            data.site_xpos[self._tip],
            self._tip_body,
            data.qfrc_applied,
        )
        mujoco.mj_step2(model, data)
        return depth, velocity, lateral_position, force
