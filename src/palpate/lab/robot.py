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
        self._zeros = list(zip(home.tolist(), phase.tolist(), strict=True))

    def read(self, angles: list[float]) -> list[float]:
        """Angles as counted, rad."""
        step = self._step
        if step == 0.0:
            return angles
        # Not math.floor, which refuses what a simulation that breaks down may give.
        return [
            home + ((angle - home) / step + phase) // 1.0 * step
            for angle, (home, phase) in zip(angles, self._zeros, strict=True)
        ]


class _PositionControl:
    """Torques that hold the motors to their angles, one sample after the other."""

    def __init__(self, settings: TwinPantograph, sample_time: float, counted: list[float]) -> None:
        self._settings, self._sample_time = settings, sample_time
        self._kept = math.exp(-settings.velocity_filter * sample_time)
        self._counted, self._filtered = counted, [0.0] * len(counted)

    def torques(self, counted: list[float], goal: list[float], speed: list[float]) -> list[float]:
        """N·m, for angles as counted [rad], and angles and speeds that are wanted."""
        kept, step, before = self._kept, self._sample_time, self._counted
        self._filtered = [
            kept * filtered + (1.0 - kept) * ((now - last) / step)
            for filtered, now, last in zip(self._filtered, counted, before, strict=True)
        ]
        self._counted = counted
        stiff, damped = self._settings.proportional_gain, self._settings.derivative_gain
        limit = self._settings.torque_limit
        every = zip(goal, counted, speed, self._filtered, strict=True)
        wanted = [stiff * (q - now) + damped * (rate - known) for q, now, rate, known in every]
        return [min(max(torque, -limit), limit) for torque in wanted]


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
        # Views of what MuJoCo works in, for to ask for one takes as long as to read it.
        self._positions, self._torques = self.data.qpos, self.data.ctrl
        self._applied = self.data.qfrc_applied
        tip = self.model.site("tip").id
        self._tip, self._tip_body = self.data.site_xpos[tip], int(self.model.site_bodyid[tip])
        self._tip_velocity = self.data.sensor("tip_velocity").data
        self._push, self._twist = np.zeros(3), np.zeros(3)
        self._before = 0.0

    def simulate(
        self, time: Floats, command: Command, touch: Touch, progress: Progress | None = None
    ) -> SimulatedMotion:
        """Follow a command over its times [s]; the next call continues from where this one ends."""
        goals, speeds = self._geometry.motor_motion(
            command.lateral_position,
            command.penetration,
            command.lateral_velocity,
            command.velocity,
        )
        samples, counts = [], []
        every = zip(time.tolist(), goals.tolist(), speeds.tolist(), strict=True)
        for k, (now, goal, speed) in enumerate(every):
            if progress is not None and k % 100 == 0:
                progress(now)
            counted = self._encoders.read(self._angles())
            self._torques[:] = self._control.torques(counted, goal, speed)
            counts.append(counted)
            samples.append(self._sample(now, touch))
        felt = np.array(samples, dtype=np.float64).reshape(-1, 4).T.copy()
        depth, velocity, lateral_position, force = felt
        recorded = self._geometry.tip(np.array(counts, dtype=np.float64).reshape(-1, 4))[1]
        return SimulatedMotion(depth, velocity, lateral_position, force, recorded)

    def _sample(self, now: float, touch: Touch) -> tuple[float, float, float, float]:
        """Advance by a sample time; what the tip did and felt at its beginning."""
        felt = self._step(now, touch)
        for substep in range(1, self._substeps):
            self._step(now + substep * self._step_time, touch)
        return felt

    def _angles(self) -> list[float]:
        turned = self._positions.tolist()
        return [turned[address] + home for address, home in self._motors]

    def _step(self, now: float, touch: Touch) -> tuple[float, float, float, float]:
        """Advance by a substep; what the tip did and felt at its beginning."""
        mujoco, model, data = self._mujoco, self.model, self.data
        mujoco.mj_step1(model, data)
        lateral_position, depth, _ = self._tip.tolist()
        # MuJoCo moves by x(t + h) = x(t) + h v(t + h): its velocity is that of half a step ago.
        lagging = self._tip_velocity.item(1)
        velocity = 1.5 * lagging - 0.5 * self._before
        self._before = lagging
        force = touch(now, lateral_position, depth, velocity)
        if not (abs(velocity) < TOP_SPEED and abs(force) < PEAK_FORCE):
            raise InvalidParameterError(
                f"material is too stiff or too damped for the twin pantograph at steps of "
                f"{model.opt.timestep:g} s: the simulation breaks down at t = {now:.3f} s; take a "
                "softer material, a smaller time_step, or an ideal probe"
            )
        self._applied.fill(0.0)
        self._push[1] = -force
        mujoco.mj_applyFT(
            model, data, self._push, self._twist, self._tip, self._tip_body, self._applied
        )
        mujoco.mj_step2(model, data)
        return depth, velocity, lateral_position, force
