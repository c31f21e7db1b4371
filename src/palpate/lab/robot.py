"""A planar twin pantograph, simulated in MuJoCo: it follows a command as well as a robot can."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.lab.bench import Course
from palpate.lab.kinematics import Geometry
from palpate.lab.materials import Material, Touch
from palpate.lab.rig import rig_xml
from palpate.lab.trajectories import Trajectory
from palpate.validation import Floats, number_in

if TYPE_CHECKING:
    import mujoco


def require_mujoco() -> Any:
    """Return MuJoCo, or say how to install it."""
    try:
        import mujoco
    except ImportError:
        raise MissingExtraError(
            "the twin pantograph needs MuJoCo: pip install 'palpate[lab]', or use an ideal probe"
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
    ) -> Course:
        """Press ``material`` along ``trajectory`` under position control."""
        step = float(time[1] - time[0]) if time.size > 1 else 1e-3
        if step > 1e-2:
            raise InvalidParameterError(
                f"sample_time must be at most 0.01 s for a robot under control, not {step:g} s"
            )
        command = trajectory.at(time)
        geometry = Geometry()
        goal = geometry.motor_angles(command.place, command.penetration)
        speed = geometry.motor_speeds(
            command.place, command.penetration, command.place_velocity, command.velocity
        )
        encoders = _Encoders(self.counts_per_turn, goal[0], random)
        run = _Run(self, geometry, goal[0], step, encoders)
        return run.course(time, goal, speed, material.touch())


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


class _Run:
    """One simulation from rest."""

    def __init__(
        self,
        settings: TwinPantograph,
        geometry: Geometry,
        home: Floats,
        sample_time: float,
        encoders: _Encoders,
    ) -> None:
        self._mujoco = require_mujoco()
        self._settings, self._geometry, self._encoders = settings, geometry, encoders
        self._substeps = math.ceil(sample_time / settings.time_step - 1e-9)
        self._sample_time = sample_time
        xml = rig_xml(geometry, home, time_step=sample_time / self._substeps)
        self._model: mujoco.MjModel = self._mujoco.MjModel.from_xml_string(xml)
        self._data: mujoco.MjData = self._mujoco.MjData(self._model)
        motors = [self._model.joint(f"motor_{i}").qposadr[0] for i in range(4)]
        self._motors = np.array(motors)
        self._home = home
        self._tip = self._model.site("tip").id
        self._tip_body = self._model.site_bodyid[self._tip]
        self._tip_velocity = self._data.sensor("tip_velocity").data
        self._filtered = np.zeros(4)
        self._counted = encoders.read(home)

    def course(self, time: Floats, goal: Floats, speed: Floats, touch: Touch) -> Course:
        """Follow the goals of the motors [rad, rad/s], a row a sample."""
        samples = np.empty((time.size, 4))
        counted = np.empty((time.size, 4))
        for k, now in enumerate(time.tolist()):
            counted[k] = self._encoders.read(self._angles())
            self._control(counted[k], goal[k], speed[k])
            for substep in range(self._substeps):
                felt = self._step(now + substep * self._sample_time / self._substeps, touch)
                if substep == 0:
                    samples[k] = felt
        recorded = self._geometry.tip(counted)[1]
        return Course(samples[:, 0], samples[:, 1], samples[:, 2], samples[:, 3], recorded)

    def _angles(self) -> Floats:
        angles: Floats = self._data.qpos[self._motors] + self._home
        return angles

    def _control(self, counted: Floats, goal: Floats, speed: Floats) -> None:
        kept = math.exp(-self._settings.velocity_filter * self._sample_time)
        difference = (counted - self._counted) / self._sample_time
        self._filtered = kept * self._filtered + (1.0 - kept) * difference
        self._counted = counted
        torque = self._settings.proportional_gain * (goal - counted)
        torque += self._settings.derivative_gain * (speed - self._filtered)
        limit = self._settings.torque_limit
        self._data.ctrl[:] = np.clip(torque, -limit, limit)

    def _step(self, now: float, touch: Touch) -> tuple[float, float, float, float]:
        """Advance by a substep; what the tip did and felt at its beginning."""
        mujoco, model, data = self._mujoco, self._model, self._data
        mujoco.mj_step1(model, data)
        place, depth, _ = data.site_xpos[self._tip].tolist()
        velocity = float(self._tip_velocity[1])
        force = touch(now, place, depth, velocity)
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
        return depth, velocity, place, force
