"""The frame of a force, its sign and the order of the quaternions: stated, or found."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from palpate.digits import percent
from palpate.errors import RecordingError
from palpate.findings import Check, Finding, Mark
from palpate.input.channels.frames import (
    IN_BASE,
    are_quaternions,
    interpolate_columns,
    unit_quaternions,
)
from palpate.input.channels.roles import Roles, choose_roles
from palpate.input.channels.signals import Signals, build_signals
from palpate.input.preparation.normal import (
    LARGE_ANGLE,
    angle_between_axes,
    direction_of_growth,
    normal_from_forces,
)
from palpate.input.preparation.orientation import (
    describe_choice,
    order_in_doubt,
    report_order,
    states_order,
)
from palpate.input.preparation.resolution import noise_of
from palpate.input.preparation.settings import Preparation, check_delay
from palpate.input.preparation.tare import never_free, tare_force
from palpate.input.preparation.velocity import step_of
from palpate.input.recordings import Recording
from palpate.input.wrench.compensation import Compensated, PosedWrench, compensate
from palpate.input.wrench.log import PayloadLog, summarize
from palpate.input.wrench.marks import mark_payload
from palpate.input.wrench.readings import SECOND_BEST, Reading, fitting_readings, possible_readings
from palpate.input.wrench.search import SLOW
from palpate.method.contact import between
from palpate.method.rows import true_runs, typical_step
from palpate.method.settings import ForceFrame
from palpate.stages import log_stage
from palpate.validation import Floats, Mask

FEWEST_TIMES = 20  # samples
UNLIKELY = 1e3  # times the 99th percentile of a channel: a bit error


@log_stage("frame of the force")
def find_stated_frame(
    recording: Recording,
    roles: Roles,
    signals: Signals,
    settings: Preparation,
    findings: list[Finding],
) -> ForceFrame | None:
    """Return the frame of the force: as requested, else from the recording; None if in doubt.

    Problems and assumptions are added to the findings.
    """
    if signals.force.ndim == 1 or signals.depth.ndim == 1:
        return "base"
    findings += check_saturation(signals.force)
    frame = settings.force_frame
    if settings.payload is not None:
        frame = "tool"
    elif frame is None:
        frame = _frame_in_recording(recording, roles, findings)
    if frame == "tool" and signals.orientation is None:
        problem = f"{recording.source}: --force-frame tool needs an orientation"
        raise RecordingError(f"{problem}; name its channels with --orientation x,y,z,w")
    return frame


def _frame_in_recording(
    recording: Recording, roles: Roles, findings: list[Finding]
) -> ForceFrame | None:
    if roles.orientation_frame is not None:  # from transforms: the force's frame
        return "tool"
    if IN_BASE.match(roles.force[0]):
        return "base"
    force = recording.frames.get(roles.force[0])
    position = recording.frames.get(roles.depth[0])
    if force is None or position is None:
        return None if roles.orientation else "base"
    if force.lstrip("/") == position.lstrip("/"):
        return "base"
    problem = f"the force is in the frame {force!r}, the position in {position!r}"
    if roles.orientation:
        problem += ": palpate rotates it by the orientation, assuming it is in the tool's axes"
        findings.append(
            Check.FORCE_FRAME.finding(
                problem, "pass --force-frame base if both frames have the same axes"
            )
        )
        return "tool"
    problem += ", and there is no orientation to convert one to the other"
    findings.append(
        Check.FORCE_FRAME.finding(
            problem,
            "record the pose, or pass the contact normal, such as --normal z",
            severity="with-care",
        )
    )
    return "base"


_FRAMES = {"tool": "the tool", "base": "the position"}


def report_frame(reading: Reading, evidence: str | None) -> Finding:
    """Report the frame of the force, and the evidence for it."""
    choice = describe_choice(evidence, f"that of {_FRAMES[reading.frame]}")
    if reading.frame == "base":
        option = "--force-frame tool if the sensor rotates with the tool"
    else:
        option = "--force-frame base if the sensor does not"
    problem = f"the recording does not state the frame of the force; {choice}"
    return Check.FORCE_FRAME.finding(problem, f"pass {option}")


def frame_in_doubt(source: str) -> RecordingError:
    """Return the error for a force whose frame cannot be found."""
    problem = "the recording does not state the frame of the force, and neither free air nor "
    remedy = "pass --force-frame tool if the sensor rotates with the tool, else --force-frame base"
    return RecordingError.of(source, f"{problem}contact decides; {remedy}")


# A wrench and its pose.


def no_pose(source: str, what: str = "a payload") -> RecordingError:
    """Return the error for what needs a pose and a wrench, of a recording without them."""
    problem = f"{what} needs a force in space and a pose; name the channels with --force, "
    return RecordingError.of(source, f"{problem}--position and --orientation")


def pose_wrench(signals: Signals, settings: Preparation, source: str) -> PosedWrench | None:
    """Return pose and wrench on their own clocks.

    None without an orientation or a clock, or with a given interval of free air.
    """
    if signals.orientation is None or settings.no_time or isinstance(settings.tare, tuple):
        return None
    streams = {}
    for role, (time, values) in signals.clocks.items():
        if role == "orientation":
            values = unit_quaternions(values, source)
        likely = _is_likely(values).all(axis=1) & between(time, *settings.ends, source)
        if likely.any():
            streams[role] = time[likely], values[likely]
    if not streams.keys() >= {"depth", "orientation", "force"}:
        return None
    stamps, position = streams["depth"]
    turn_times, orientation = streams["orientation"]
    time, force = streams["force"]
    for clock in (stamps, turn_times, time):
        if len(clock) < FEWEST_TIMES or (np.diff(clock) <= 0.0).any():
            return None
    torque = np.zeros_like(force)
    if "torque" in streams:
        torque = interpolate_columns(time, *streams["torque"])
    wrench = np.hstack([force, torque])
    if "force" in settings.flip:
        wrench = -wrench
    delay = None
    if settings.delay and not isinstance(settings.delay, str):
        delay = check_delay("delay", settings.delay, typical_step(stamps))
    turned = interpolate_columns(stamps, turn_times, orientation)
    return PosedWrench(stamps, position, turned, time, wrench, delay)


def _is_likely(values: Floats) -> Mask:
    """Whether values have no bit error."""
    finite = np.abs(values[np.isfinite(values)])
    return np.abs(values) <= (UNLIKELY * np.percentile(finite, 99.0) if finite.size else 0.0)


# An unstated frame is that of the reading that fits in free air, else in contact.


class ReadForce(NamedTuple):
    """A force in its frame.

    ``signals`` have an orientation only if the force is in the tool's axes; ``compensated`` is the
    force of the material, if free air gives it; ``findings`` report what was chosen.
    """

    signals: Signals
    compensated: Compensated | None
    findings: list[Finding]


@dataclass(slots=True, eq=False)
class _Trial:
    """One reading of a log: its signals, and the force of the material if free air gives it."""

    reading: Reading
    signals: Signals
    compensated: Compensated | None = None

    @property
    def key(self) -> Reading:
        """The reading, with the sign that was used."""
        sign = 1.0 if self.compensated is None else self.compensated.payload.sign
        return replace(self.reading, sign=sign)

    @property
    def weighs(self) -> bool:
        """Whether it is that of a force in the base's axes, or gives a tool its weight."""
        if self.reading.frame == "base":
            return True
        compensated = self.compensated
        return compensated is not None and compensated.payload.mass_mark != "do-not-trust"

    def direction(self, settings: Preparation, source: str) -> tuple[float, Floats] | None:
        """Angle between force and motion in contact, and the normal; None without a contact."""
        position = self.signals.depth
        try:
            if self.compensated is not None:
                force = self.compensated.force
                position = position[self.compensated.kept]
            else:
                force = tare_force(self.signals, settings, source)[0].force
            normal = normal_from_forces(force, position, source).vector
        except RecordingError:
            return None
        motion, _ = direction_of_growth(position, force @ normal)
        return None if motion is None else (angle_between_axes(motion, normal), normal)


@dataclass(eq=False)
class _ForceReader:
    """The choice of the reading of a log; its fields are the arguments of :func:`read_force`."""

    signals: Signals
    settings: Preparation
    roles: Roles
    frame: ForceFrame | None
    default: ForceFrame

    def __post_init__(self) -> None:
        orientation = self.signals.orientation
        assert orientation is not None
        self._orientation = orientation
        self._source = self.roles.recording.source
        if self._in_doubt and not are_quaternions(orientation):
            self.frame = "base"

    @property
    def _in_doubt(self) -> bool:
        """Whether the frame is neither stated nor that of a payload's log."""
        return self.frame is None and self.default == "base"

    def read(self) -> ReadForce:
        """Choose the reading."""
        settings = self.settings
        log = None if self.frame == "base" else pose_wrench(self.signals, settings, self._source)
        stated = states_order(self.roles.orientation, settings.columns.orientation)
        signs = (1.0,) if "force" in settings.flip else (1.0, -1.0)
        if settings.payload is not None:
            signs = (settings.payload.sign,)
        readings = possible_readings(self.frame, self.default, signs, order_stated=stated)
        fitting, enough = self._fit_free_air(readings, log)
        evidence = "free air" if len(fitting) < len(readings) else None
        if self.default == "tool":
            fitting = [reading for reading in fitting if reading.frame == "tool"] or fitting
        trials = self._try(fitting, log)
        if self._in_doubt and not any(trial.weighs for trial in trials.values()):
            trials = self._try(readings, log)
        chosen = next(iter(trials.values()))
        contact_decides = False
        if len(trials) > 1:
            chosen, contact_decides = self._choose_by_contact([*trials.values()], enough=enough)
        if len({replace(reading, sign=1.0) for reading in trials}) > 1:
            evidence = "contact" if contact_decides else None
        opposite = replace(chosen.key, sign=-chosen.key.sign)
        compensated = chosen.compensated
        if compensated is not None and opposite in trials and not contact_decides:
            fit = replace(compensated.fit, sign_in_doubt=True)
            given = log is not None and log.delay is not None
            compensated = replace(compensated, fit=mark_payload(fit, delay_given=given))
        findings = self._report(chosen.reading, evidence, order_stated=stated)
        return ReadForce(chosen.signals, compensated, findings)

    def _report(
        self, reading: Reading, evidence: str | None, *, order_stated: bool
    ) -> list[Finding]:
        """Report what was chosen; raise if it is no reading for a payload."""
        if self.default == "tool" and reading.frame == "base":
            problem = "the force is in the axes of the position, and a payload needs one in the "
            remedy = "sensor's; pass --force-frame tool if it is"
            raise RecordingError.of(self._source, problem + remedy)
        findings = [report_frame(reading, evidence)] if self._in_doubt else []
        if reading.frame == "tool" and not order_stated:
            findings.append(report_order(reading, evidence, self.roles.orientation))
        return findings

    def _fit_free_air(
        self, readings: list[Reading], log: PosedWrench | None
    ) -> tuple[list[Reading], bool]:
        """Return the readings that fit in free air, and whether there is enough of it to tell."""
        if log is None or len(readings) == 1:
            return readings, False
        motions = {reading: log.motion(reading, SLOW) for reading in readings}
        known = self.settings.payload
        return fitting_readings(motions, log.time, log.wrench, delay=log.delay, known=known)

    def _try(self, readings: Sequence[Reading], log: PosedWrench | None) -> dict[Reading, _Trial]:
        """Try each reading, except those that a given weight contradicts, or that are alike."""
        trials = dict[Reading, _Trial]()
        refusals = list[RecordingError]()
        for reading in readings:
            trial = _Trial(reading, replace(self.signals, orientation=None))
            if reading.frame == "tool":
                turned = reading.turn(self._orientation)
                trial.signals = replace(self.signals, orientation=turned)
            if reading.frame == "tool" and log is not None:
                try:
                    trial.compensated = compensate(
                        self.signals.time,
                        unit_quaternions(turned, self._source),
                        log,
                        reading,
                        self._source,
                        known=self.settings.payload,
                        weight=self.settings.tool_weight,
                        tried=reading.sign < 0.0 and replace(reading, sign=1.0) in trials,
                    )
                except RecordingError as error:
                    refusals.append(error)
                    continue
            trials.setdefault(trial.key, trial)
        if not trials:
            raise refusals[0]
        return trials

    def _choose_by_contact(self, trials: list[_Trial], *, enough: bool) -> tuple[_Trial, bool]:
        """Return the reading whose force points along the motion, else the first.

        Also whether contact decides. If they do not agree on the normal, the first must be the
        default of a log without ``enough`` free air.
        """
        directions = [trial.direction(self.settings, self._source) for trial in trials]
        touching = [direction for direction in directions if direction is not None]
        angles = [math.pi if direction is None else direction[0] for direction in directions]
        best = int(np.argmin(angles))
        limit = SECOND_BEST * max(angles[best], LARGE_ANGLE)
        complete = len(touching) == len(trials)
        if complete and sum(angle < limit for angle in angles) == 1:
            return trials[best], True
        is_default = not enough and trials[0].reading.frame == self.default and angles[0] < limit
        no_contact = not touching and self.default == "base"  # what follows finds none either
        if is_default or no_contact or (complete and _agree_on_normal(touching)):
            return trials[0], False
        if len({trial.reading.frame for trial in trials}) > 1:
            raise frame_in_doubt(self._source)
        if len({trial.reading.scalar_first for trial in trials}) > 1:
            raise order_in_doubt(self._source, self.roles.orientation)
        return trials[0], False


def _agree_on_normal(directions: list[tuple[float, Floats]]) -> bool:
    _, normal = directions[0]
    return all(angle_between_axes(normal, vector) <= LARGE_ANGLE for _, vector in directions)


def read_force(
    signals: Signals,
    settings: Preparation,
    roles: Roles,
    frame: ForceFrame | None,
    default: ForceFrame = "base",
) -> ReadForce:
    """Read the force in its frame, with its sign and the order of the quaternions.

    What the recording does not state follows from the free air, else from the contact: in the right
    axes the force points along the motion in which it grows.

    Parameters
    ----------
    signals : Signals
        Signals on one clock.
    settings : Preparation
        Settings, which may state sign, order and tool.
    roles : Roles
        The channels.
    frame : str or None
        Frame of the force, if it is stated.
    default : str
        The frame to take where both would do.

    Raises
    ------
    RecordingError
        Several readings fit as well, and they differ: the message names the option that chooses.
    """
    if signals.orientation is None or signals.force.ndim == 1 or signals.depth.ndim == 1:
        return ReadForce(replace(signals, orientation=None), None, [])
    return _ForceReader(signals, settings, roles, frame, default).read()


def compensate_log(recording: Recording, settings: Preparation) -> Compensated:
    """Find the payload of a log, which may have no contact, and take it out.

    Raises
    ------
    RecordingError
        The log has no pose with an orientation and a force in space, or no free air.
    """
    roles = choose_roles(recording, settings.columns)
    signals = build_signals(roles.recording, roles, settings.units, strict=settings.strict)
    if not {"orientation", "force", "depth"} <= signals.clocks.keys() or signals.force.ndim == 1:
        raise no_pose(recording.source)
    _, compensated, choice = read_force(signals, settings, roles, settings.force_frame, "tool")
    if compensated is None:
        raise never_free(recording.source)
    findings = (*compensated.payload.findings, *roles.findings, *choice)
    payload = replace(compensated.payload, findings=findings)
    return replace(compensated, fit=replace(compensated.fit, payload=payload))


def measure_payload(recording: Recording, settings: Preparation) -> PayloadLog:
    """Find the payload of a log.

    Parameters
    ----------
    recording : Recording
        Pose of the flange and wrench of the sensor, in its axes, perhaps on clocks of their own.
    settings : Preparation
        Channels, units, interval and delay.

    Raises
    ------
    RecordingError
        The log has no orientation or no force of three axes, or no free air.
    """
    compensated = compensate_log(recording, settings)
    sensor = choose_roles(recording, settings.columns).force[0]
    return summarize(compensated, recording.source, recording.frames.get(sensor, ""))


# Saturated axes.

SHORTEST = 5  # samples in a row
# change of the other axes meanwhile: σ and steps of resolution
MOVES = 8.0
STEPS = 3.0
# fractions of the recording
SOME = 0.002
MANY = 0.02


def check_saturation(force: Floats) -> list[Finding]:
    """Report axes of the sensor that stay at their largest value while the others change.

    An axis that never changes is not saturated but not measured, as with a load cell of one axis.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        Force as recorded, N: a rotation or a tare would hide the constant value.
    """
    findings = list[Finding]()
    moves = [bool(np.isfinite(c).any() and np.nanmin(c) < np.nanmax(c)) for c in force.T]
    constant = " and ".join(axis for axis, moving in zip("xyz", moves, strict=True) if not moving)
    if constant:
        findings.append(
            Check.FORCE_AXES.finding(
                f"the force along {constant} is constant: the sensor does not measure it"
            )
        )
    limits = np.array([MOVES * noise_of(column) + STEPS * step_of(column) for column in force.T])
    for k, column in enumerate(force.T):
        for edge in (np.nanmax(column), np.nanmin(column)) if moves[k] else ():
            share = _count_saturated(force, limits, k, edge) / len(column)
            if share > SOME:
                problem = (
                    f"the force along {'xyz'[k]} stays at {edge:.3g} N for {percent(share)} of the "
                    "recording while the others change: it is probably saturated"
                )
                mark: Mark = "do-not-trust" if share > MANY else "with-care"
                findings.append(
                    Check.SATURATED_AXIS.finding(
                        problem, "press less deeply, or use a sensor with a larger range", mark=mark
                    )
                )
    return findings


def _count_saturated(force: Floats, limits: Floats, axis: int, edge: float) -> int:
    """Return the number of samples in which an axis stays at an edge while the others change."""
    column = force[:, axis]
    others = np.arange(force.shape[1]) != axis
    count = 0
    for run in true_runs(column == edge):
        length = run.stop - run.start
        if length >= SHORTEST:
            changes = np.ptp(force[run], axis=0)
            if (changes > limits)[others].any():
                count += length
    return count
