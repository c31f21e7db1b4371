"""Preparation of a contact from positions and forces in space: tare, normal, surface, places."""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact, Delay, VelocityFilter, between, run_slices
from palpate.digits import percent, rounded, with_error
from palpate.errors import RecordingError
from palpate.findings import Check, Finding, Mark
from palpate.preparation.along_penetration import describe_filter
from palpate.preparation.clocks import Signals, build_signals
from palpate.preparation.delay import remove_delay
from palpate.preparation.held import find_fresh_samples
from palpate.preparation.inertia import subtract_inertia
from palpate.preparation.prepared import Place, Prepared
from palpate.preparation.resolution import noise_of
from palpate.preparation.roles import Roles, choose_roles
from palpate.preparation.settings import (
    ForceFrame,
    Normal,
    Preparation,
    are_quaternions,
    check_delay,
    grows,
    no_normal,
    normal_found,
    normal_given,
    rotate_to_base,
    unit_quaternions,
)
from palpate.preparation.surfaces import (
    Baseline,
    Stay,
    Surface,
    SurfaceRule,
    add,
    baseline_between,
    deviation_left,
    estimate_baseline,
    find_episodes,
    find_presses,
    find_surface,
    free_samples,
    never_free,
    report_assumed_surface,
    travel,
)
from palpate.preparation.velocity import estimate_velocities, step_of
from palpate.recordings import Recording
from palpate.recordings.poses import INVERSE, align_signs, interpolate_columns
from palpate.stages import log_stage, stage
from palpate.validation import Floats
from palpate.wrench.consensus import without_zeroings
from palpate.wrench.marks import (
    SLOW,
    PayloadFit,
    does_turn,
    external_force,
    find_payload,
    idle_weight,
    mark_payload,
    report_unknown_inertia,
)
from palpate.wrench.motion import WINDOW, FlangeMotion, motion_of
from palpate.wrench.payload import Payload
from palpate.wrench.readings import (
    SECOND_BEST,
    Reading,
    fitting_readings,
    frame_in_doubt,
    order_in_doubt,
    possible_readings,
    report_frame,
    report_order,
    report_unknown_tip,
    stated_frame,
    states_order,
    turn_findings,
)

_LOGGER = logging.getLogger(__name__)

FIRM = 0.1  # fraction of the largest force; an episode with less force is free air


@dataclass(slots=True, eq=False)
class AlongNormal:
    """Depth and compression along one normal.

    Attributes
    ----------
    depth : numpy.ndarray, shape (k,)
        m, increasing into the material, from an arbitrary origin.
    force : numpy.ndarray, shape (k,)
        N, compression positive.
    normal : Normal or None
        None if both were already along one axis.
    findings : list of Finding
        Assumptions.
    """

    depth: Floats
    force: Floats
    normal: Normal | None = None
    findings: list[Finding] = field(default_factory=list)


#: The signals at one place, the episode, and depth and compression along its normal.
Piece = tuple[Signals, Stay | None, AlongNormal]


def along_normal(
    recording: Recording, roles: Roles, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact from a position and a force, tared and projected on the contact normal."""
    made, findings = dict(signals.made), list[Finding]()
    if settings.tip_offset is not None and signals.orientation is not None:
        named = settings.columns.orientation
        if roles.orientation and not states_order(roles.orientation, named):
            words = "the offset of the tip needs the order of the quaternion: pass --orientation "
            names = ",".join(roles.orientation)
            raise RecordingError.of(recording.source, f"{words}{names} if that is x, y, z, w")
        offset = rotate_to_base(np.array(settings.tip_offset), signals.orientation)
        signals = replace(signals, depth=signals.depth + offset)
        add(made, "penetration", "of the tip, whose offset the orientation rotates")
    if "force" in settings.flip:
        signals = replace(signals, force=-signals.force)
    if "penetration" in settings.flip:
        signals = replace(signals, depth=-signals.depth)
    signals = signals.taken(between(signals.time, *settings.ends, recording.source))
    recorded, late, turning = signals.force, settings.delay, signals.orientation
    frame = _check_frame(recording, roles, signals, settings, findings)
    with stage(_LOGGER, "payload"):
        signals, compensated, choice = read_force(signals, settings, roles, frame)
    findings += choice
    if compensated is not None:
        signals, recorded = compensated.signals, recorded[compensated.kept]
        zero: Baseline | None = compensated.baseline
        compensated.describe(made, findings)
        late = 0.0 if compensated.delay is not None else late
    else:
        if settings.payload is not None:
            words = "--payload needs a pose and a force in space, on clocks that do not restart"
            raise RecordingError.of(recording.source, words)
        in_space = signals.force.ndim == signals.depth.ndim == 2
        if in_space and turning is not None:
            findings += turn_findings(turning, settings.tool_weight)
        if in_space and settings.tool_weight is not None:
            add(made, "force", f"minus the tool's weight of {settings.tool_weight:g} N")
        with stage(_LOGGER, "force offset"):
            signals, zero, said = tare_force(signals, settings, recording.source)
        findings += said
        if zero is not None:
            zero.say(made, findings)
        if signals.orientation is not None:
            add(made, "force", "rotated by the orientation")
    with stage(_LOGGER, "contact normal"):
        whole = project_on_normal(signals, settings, recording.source)
    left = None if zero is None else deviation_left(whole.force, zero.free)
    if compensated is not None and turning is not None and settings.tip_offset is None:
        turned = turning[compensated.kept]
        findings[:0] = _report_pose_of_sensor(recording, roles)
        upright = find_upright(whole.force, turned)
        findings += _report_turn(whole.force, turned, upright)
        if not upright.all():
            signals, recorded = _cut(signals, upright), recorded[upright]
            whole = replace(whole, depth=whole.depth[upright], force=whole.force[upright])
            add(made, "penetration", "without samples turned by 2° or more from the nearest touch")
    held = None
    if not settings.no_time:
        held = find_fresh_samples(signals.time, signals.depth, recorded, whole.force)
    if held is not None:
        force = held.taken(signals.force)
        signals = replace(signals.taken(held.before), force=force, fresh=held.after)
        whole = replace(whole, depth=whole.depth[held.before], force=held.taken(whole.force))
        findings.append(held.finding)
        late = late or held.late
    pieces = _pieces(signals, whole, settings)
    if len(pieces) > 1 or pieces[0][1] is not None:
        findings += _report_travel(pieces, signals)
    findings += whole.findings
    contact, places = _join_pieces(pieces, settings, made, findings)
    done = Prepared(
        recording,
        settings,
        zero=None if zero is None else zero.mean,
        drift=0.0 if zero is None else zero.drift,
        payload=None if compensated is None else compensated.payload,
        normal=whole.normal,
        surface=places[0].surface if places else None,
        places=tuple(places) if pieces[0][1] is not None else (),
    )
    contact = replace(contact, tare_deviation=left, prepared=done, source=recording.source)
    if compensated is not None:
        own = compensated.payload
        contact = replace(contact, delay=compensated.delay, moving_mass=own.mass)
        if settings.mass is None:
            doubts = _report_unknown_inertia(contact, own.mass_error)
            contact = replace(contact, findings=(*contact.findings, *doubts))
    return subtract_inertia(remove_delay(contact, late), settings.mass)


def compensate_log(recording: Recording, settings: Preparation) -> "Compensated":
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
    _, found, choice = read_force(signals, settings, roles, settings.force_frame, "tool")
    if found is None:
        raise never_free(recording.source)
    payload = replace(found.payload, findings=(*found.payload.findings, *roles.findings, *choice))
    return replace(found, fit=replace(found.fit, payload=payload))


def no_pose(source: str, what: str = "a payload") -> RecordingError:
    """Return the error for what needs a pose and a wrench, of a recording without them."""
    words = f"{what} needs a force in space and a pose; name the channels with --force, "
    return RecordingError.of(source, f"{words}--position and --orientation")


@dataclass(slots=True, eq=False)
class Compensated:
    """The force of the material, from a sensor that turns with the tool.

    Attributes
    ----------
    signals : Signals
        With the force in the axes of the position, on its clock, and without an orientation.
    kept : numpy.ndarray of bool
        The samples that have a force.
    baseline : Baseline
        Free air and the bias of the sensor, in its axes.
    fit : PayloadFit
        Tool, mount, bias and clock, and what they were found from.
    motion : FlangeMotion
        Motion of the flange.
    delay : Delay or None
        The delay that was taken out.
    """

    signals: Signals
    kept: NDArray[np.bool_]
    baseline: Baseline
    fit: PayloadFit
    motion: FlangeMotion
    delay: Delay | None

    @property
    def payload(self) -> Payload:
        """Tool, mount, bias and clock."""
        return self.fit.payload

    def describe(self, made: dict[str, str], findings: list[Finding]) -> None:
        """Record how the force was obtained."""
        own = self.payload
        if own.mass > 0.0:
            mass = with_error(own.mass, own.mass_error, unit="kg")
            centre = ", ".join(rounded(1e3 * each, 3) for each in own.centre.tolist())
            add(made, "force", f"minus weight and inertia of {mass} at ({centre}) mm")
        self.baseline.say(made, findings)
        add(made, "force", "rotated by mount and orientation")
        if self.delay is not None and self.delay.seconds:
            late, error = 1e3 * self.delay.seconds, 1e3 * self.delay.standard_error
            way = "earlier" if late > 0.0 else "later"
            add(made, "force", f"shifted {with_error(abs(late), error, unit='ms')} {way}")
        findings += own.findings


FEWEST_TIMES = 20  # samples
UNLIKELY = 1e3  # times the 99th percentile of a channel: a bit error
LONGEST_MEAN = 4e-3  # s of the wrench for one sample: 0.1 % is lost of an oscillation at 6 Hz


@dataclass(frozen=True, slots=True, eq=False)
class PosedWrench:
    """A wrench and the pose of its flange, each on its own clock.

    Attributes
    ----------
    stamps, position, orientation : numpy.ndarray, shapes (m,), (m, 3) and (m, 4)
        s, m and unit quaternions, as recorded.
    time, wrench : numpy.ndarray, shapes (k,) and (k, 6)
        s, N and N·m.
    delay : Delay or None
        The given delay of the wrench.
    """

    stamps: Floats
    position: Floats
    orientation: Floats
    time: Floats
    wrench: Floats
    delay: Delay | None
    _motions: dict[tuple[Reading, float], FlangeMotion] = field(default_factory=dict)

    def motion(self, reading: Reading, window: float = WINDOW) -> FlangeMotion:
        """Return the motion of the flange over a window, s."""
        key = replace(reading, sign=1.0), window
        if key not in self._motions:
            turned = reading.turn(self.orientation)
            self._motions[key] = motion_of(self.stamps, self.position, turned, window)
        return self._motions[key]


def pose_wrench(signals: Signals, settings: Preparation, source: str) -> PosedWrench | None:
    """Return pose and wrench on their own clocks.

    None without an orientation or a clock, or with a given interval of free air.
    """
    if signals.orientation is None or settings.no_time or isinstance(settings.tare, tuple):
        return None
    streams = {}
    for role, (time, values) in signals.clocks.items():
        values = unit_quaternions(values, source) if role == "orientation" else values
        known = np.abs(values[np.isfinite(values)])
        likely = np.abs(values) <= (UNLIKELY * np.percentile(known, 99.0) if known.size else 0.0)
        if (inside := between(time, *settings.ends, source) & likely.all(axis=1)).any():
            streams[role] = time[inside], values[inside]
    needed = "depth", "orientation", "force"
    if not streams.keys() >= {*needed}:
        return None
    (stamps, position), (turns, orientation), (time, force) = (streams[role] for role in needed)
    torque = np.zeros_like(force)
    if "torque" in streams:
        torque = interpolate_columns(time, *streams["torque"])
    clocks = stamps, turns, time
    if any(len(each) < FEWEST_TIMES or (np.diff(each) <= 0.0).any() for each in clocks):
        return None
    wrench = np.hstack([force, torque]) * (-1.0 if "force" in settings.flip else 1.0)
    late = settings.delay
    delay = None
    if late and not isinstance(late, str):
        delay = check_delay("delay", late, float(np.median(np.diff(stamps))))
    turned = interpolate_columns(stamps, turns, orientation)
    return PosedWrench(stamps, position, turned, time, wrench, delay)


def compensate(
    signals: Signals,
    log: PosedWrench,
    settings: Preparation,
    reading: Reading,
    source: str,
    *,
    tried: bool = False,
) -> Compensated | None:
    """Take weight, inertia, bias and delay out of a wrench in the axes of the sensor.

    The signals have the orientation of the reading; the other sign may have been tried. None where
    the log has no free air: then the mean force is subtracted as that of a sensor that does not
    turn.
    """
    time, wrench, delay, sign = log.time, log.wrench, log.delay, reading.sign
    quick, slow = log.motion(reading), log.motion(reading, SLOW)
    motion = slow if does_turn(slow) else quick
    tool, weight = settings.payload, settings.tool_weight
    fit = find_payload(
        motion,
        time,
        wrench,
        delay=delay,
        known=tool,
        weight=weight,
        sign=sign,
        tried=tried,
        source=source,
    )
    if fit is None and settings.payload is not None:
        words = "--payload needs a second of free air, to find the bias of the sensor"
        raise RecordingError.of(source, f"{words}; record the approach too")
    if fit is None:
        return None
    payload = mark_payload(fit, delay_given=delay is not None)
    fit = replace(fit, payload=payload)
    applied = delay
    if delay is None and payload.delay_mark != "do-not-trust":
        applied = Delay(payload.delay, payload.delay_error, found=True)
    at = signals.time + (0.0 if applied is None else applied.seconds)
    steps = [float(np.median(np.diff(each))) for each in (signals.time, time)]
    half = round(0.5 * min(steps[0], LONGEST_MEAN) / steps[1])
    mean = np.full(2 * half + 1, payload.sign / (2 * half + 1))
    steady = without_zeroings(time, wrench[:, :3], fit.zeroed)
    padded = np.pad(steady, ((half, half), (0, 0)), "edge")
    smooth = np.column_stack([np.convolve(column, mean, "valid") for column in padded.T])
    force = external_force(fit, quick, at, interpolate_columns(at, time, smooth)) @ payload.mount.T
    assert signals.orientation is not None
    force = rotate_to_base(force, signals.orientation, source)
    kept = np.isfinite(force).all(axis=1) & (at >= time[0]) & (at <= time[-1])
    blocks = fit.blocks
    k = np.clip(np.searchsorted(blocks.start, at[kept]) - 1, 0, None)
    free = fit.free[k] & (at[kept] <= blocks.stop[k])
    zero = payload.sign * payload.bias_at(at[kept])[:, :3]
    words = f"over {np.count_nonzero(free)} samples in free air"
    return Compensated(
        replace(replace(signals, force=force).taken(kept), orientation=None),
        kept,
        Baseline(free, zero, 0.0, words),
        fit,
        motion,
        applied,
    )


@log_stage("frame of the force")
def _check_frame(
    recording: Recording,
    roles: Roles,
    signals: Signals,
    settings: Preparation,
    findings: list[Finding],
) -> ForceFrame | None:
    """The frame of the force; None if the recording does not state it."""
    if signals.force.ndim == 1 or signals.depth.ndim == 1:
        return "base"
    findings += check_saturation(signals.force)
    asked = settings.force_frame or (None if settings.payload is None else "tool")
    frame = stated_frame(recording, roles, asked, findings)
    if frame == "tool" and signals.orientation is None:
        what = f"{recording.source}: --force-frame tool needs an orientation"
        raise RecordingError(f"{what}; name its channels with --orientation x,y,z,w")
    return frame


# An unstated frame is that of the reading that fits in free air, else in contact.


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
        found = self.compensated
        return self.reading.frame == "base" or (
            found is not None and found.payload.mass_mark != "do-not-trust"
        )

    def direction(self, settings: Preparation, source: str) -> tuple[float, Floats] | None:
        """Angle between force and motion in contact, and the normal; None without a contact."""
        signals = self.signals
        try:
            if self.compensated is not None:
                signals = self.compensated.signals
            else:
                signals = tare_force(signals, settings, source)[0]
            normal = normal_found(signals.force, signals.depth, source).vector
        except RecordingError:
            return None
        motion, _ = _direction(signals.depth, signals.force @ normal)
        return None if motion is None else (_angle(motion, normal), normal)


def read_force(
    signals: Signals,
    settings: Preparation,
    roles: Roles,
    frame: ForceFrame | None,
    usual: ForceFrame = "base",
) -> tuple[Signals, Compensated | None, list[Finding]]:
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
    usual : str
        The frame to take where both would do.

    Returns
    -------
    tuple
        The signals, with an orientation only if the force is in the tool's axes; the force of the
        material, if free air gives it; reports of what was chosen.

    Raises
    ------
    RecordingError
        Several readings fit as well, and they differ: the message names the option that chooses.
    """
    source, orientation = roles.recording.source, signals.orientation
    if orientation is None or signals.force.ndim == 1 or signals.depth.ndim == 1:
        return replace(signals, orientation=None), None, []
    if frame is None and usual == "base" and not are_quaternions(orientation):
        frame = "base"
    log = pose_wrench(signals, settings, source) if frame != "base" else None
    stated = states_order(roles.orientation, settings.columns.orientation)
    signs = (1.0,) if "force" in settings.flip else (1.0, -1.0)
    if settings.payload is not None:
        signs = (settings.payload.sign,)
    readings = possible_readings(frame, usual, signs, order_stated=stated)
    near, enough = _fit_free_air(readings, log, settings)
    by = "free air" if len(near) < len(readings) else None
    if usual == "tool":
        near = [reading for reading in near if reading.frame == "tool"] or near
    trials = _try_readings(near, signals, log, settings, source)
    if frame is None and usual == "base" and not any(trial.weighs for trial in trials.values()):
        trials = _try_readings(readings, signals, log, settings, source)
    chosen, decided = next(iter(trials.values())), by
    if len(trials) > 1:
        chosen, decided = _choose_by_contact([*trials.values()], settings, roles, usual, enough)
    own, compensated = chosen.reading, chosen.compensated
    if len({replace(reading, sign=1.0) for reading in trials}) > 1:
        by = decided
    opposite = replace(chosen.key, sign=-chosen.key.sign)
    if compensated is not None and opposite in trials and decided is None:
        fit = replace(compensated.fit, sign_in_doubt=True)
        given = log is not None and log.delay is not None
        payload = mark_payload(fit, delay_given=given)
        compensated = replace(compensated, fit=replace(fit, payload=payload))
    if usual == "tool" and own.frame == "base":
        words = (
            "the force is in the axes of the position, and a payload needs one in the sensor's; "
        )
        raise RecordingError.of(source, f"{words}pass --force-frame tool if it is")
    findings = [report_frame(own, by)] if frame is None and usual == "base" else []
    if own.frame == "tool" and not stated:
        findings.append(report_order(own, by, roles.orientation))
    return chosen.signals, compensated, findings


def _fit_free_air(
    readings: list[Reading], log: PosedWrench | None, settings: Preparation
) -> tuple[list[Reading], bool]:
    """Return the readings that fit in free air, and whether there is enough of it to tell."""
    if log is None or len(readings) == 1:
        return readings, False
    motions = {reading: log.motion(reading, SLOW) for reading in readings}
    known, delay = settings.payload, log.delay
    return fitting_readings(motions, log.time, log.wrench, delay=delay, known=known)


def _try_readings(
    readings: Sequence[Reading],
    signals: Signals,
    log: PosedWrench | None,
    settings: Preparation,
    source: str,
) -> dict[Reading, _Trial]:
    """Try each reading, except those that a given weight contradicts, or that are alike."""
    trials, refusals = dict[Reading, _Trial](), list[RecordingError]()
    assert signals.orientation is not None
    for reading in readings:
        turned = None if reading.frame == "base" else reading.turn(signals.orientation)
        own, compensated = replace(signals, orientation=turned), None
        if turned is not None and log is not None:
            try:
                tried = reading.sign < 0.0 and replace(reading, sign=1.0) in trials
                compensated = compensate(own, log, settings, reading, source, tried=tried)
            except RecordingError as error:
                refusals.append(error)
                continue
        trial = _Trial(reading, own, compensated)
        trials.setdefault(trial.key, trial)
    if not trials:
        raise refusals[0]
    return trials


def _choose_by_contact(
    trials: list[_Trial], settings: Preparation, roles: Roles, usual: ForceFrame, enough: bool
) -> tuple[_Trial, str | None]:
    """Return the reading whose force points along the motion, else the first.

    If they do not agree on the normal, the first must be the usual one of a log without free air.
    """
    source = roles.recording.source
    found = [trial.direction(settings, source) for trial in trials]
    angles = [math.pi if each is None else each[0] for each in found]
    best = int(np.argmin(angles))
    least = SECOND_BEST * max(angles[best], LARGE_ANGLE)
    normals = [each[1] for each in found if each is not None]
    complete = len(normals) == len(trials)
    if complete and all(k == best or angle >= least for k, angle in enumerate(angles)):
        return trials[best], "contact"
    agree = all(_angle(normals[0], each) <= LARGE_ANGLE for each in normals)
    without_contact = not normals and usual == "base"  # what follows finds none either
    usual_fits = not enough and trials[0].reading.frame == usual and angles[0] < least
    if without_contact or usual_fits or (complete and agree):
        return trials[0], None
    if len({trial.reading.frame for trial in trials}) > 1:
        raise frame_in_doubt(source)
    if len({trial.reading.scalar_first for trial in trials}) > 1:
        raise order_in_doubt(source, roles.orientation)
    return trials[0], None


# The pose of a flange: a tool that turns moves its tip against the flange.

UPRIGHT = math.radians(2.0)  # moves a tip that is 10 cm away by 3.5 mm across and 0.06 mm along


def find_upright(force: Floats, orientation: Floats) -> NDArray[np.bool_]:
    """Find the runs around each touch in which the tool has the orientation of the touch.

    Parameters
    ----------
    force : numpy.ndarray, shape (k,)
        N, compression positive.
    orientation : numpy.ndarray, shape (k, 4)
        Quaternions.
    """
    touching = _find_touches(force)
    at, every = np.flatnonzero(touching), np.arange(len(force))
    if not at.size:
        return np.ones(len(force), dtype=bool)
    after = np.clip(np.searchsorted(at, every), 0, at.size - 1)
    before = np.clip(after - 1, 0, None)
    nearest = np.where(at[after] - every < every - at[before], at[after], at[before])
    nearest[touching] = at
    upright = _angle_between(orientation, orientation[nearest]) < UPRIGHT
    for run in run_slices(upright):
        upright[run] &= touching[run].any()
    return upright


def _find_touches(force: Floats) -> NDArray[np.bool_]:
    peak = float(np.nanpercentile(force, 99.0))
    return find_presses(np.nan_to_num(force), FIRM * peak, peak)


def _angle_between(one: Floats, other: Floats) -> Floats:
    lengths = np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1)
    cosine = np.abs((one * other).sum(axis=-1)) / lengths
    angle: Floats = 2.0 * np.arccos(np.minimum(cosine, 1.0))
    return angle


def _cut(signals: Signals, keep: NDArray[np.bool_]) -> Signals:
    """The selected samples, with a new part after each gap."""
    gaps = np.cumsum(np.diff(np.flatnonzero(keep), prepend=0) > 1)
    cut = signals.taken(keep)
    return replace(cut, part=cut.part + gaps)


def _report_turn(force: Floats, orientation: Floats, upright: NDArray[np.bool_]) -> list[Finding]:
    """Report a tool that turns in contact: the depth of the flange is not that of the tip."""
    touching, angle = _find_touches(force), 0.0
    for run in run_slices(upright):
        if upright[run.start] and touching[run].any():
            turns = align_signs(orientation[run][touching[run]])
            angle = max(angle, float(_angle_between(turns, turns.mean(axis=0)).max()))
    if angle <= UPRIGHT:
        return []
    words = f"the tool turns by {math.degrees(angle):.0f}° in contact, and the depth is that of "
    return [report_unknown_tip(f"{words}the pose's origin", "with-care")]


def _report_unknown_inertia(contact: Contact, mass_error: float) -> list[Finding]:
    """Warn of the inertia of a tool whose mass is not known, where it may add to the stiffness."""
    touching = _find_touches(contact.force)
    columns = contact.penetration, contact.velocity, contact.force
    depth, speed, force = (float(np.nanstd(each[touching])) for each in columns)
    if not depth * force > 0.0:
        return []
    # In an oscillation of angular frequency speed/depth, mass times its square adds to force/depth.
    return report_unknown_inertia(mass_error, speed**2 / (depth * force))


def _report_pose_of_sensor(recording: Recording, roles: Roles) -> list[Finding]:
    """Report transforms that end at the sensor: the tip is elsewhere."""
    frame = recording.frames.get(roles.force[0])
    if frame is None or frame != roles.orientation_frame:
        return []
    words = f"the transforms end at the sensor {frame!r}: palpate takes its origin for the tip"
    return [report_unknown_tip(words)]


@log_stage("episodes")
def _pieces(signals: Signals, whole: AlongNormal, settings: Preparation) -> list[Piece]:
    """The whole recording, or its episodes if the probe travels over the material."""
    position, force = signals.depth, signals.force
    if position.ndim == 1 or not math.isfinite(settings.spot):
        return [(signals, None, whole)]
    if force.ndim == 1 and whole.normal is not None:
        force = force[:, None] * whole.normal.vector
    if travel(position, force) <= settings.spot:
        return [(signals, None, whole)]
    peak = float(np.nanpercentile(whole.force, 99.0))
    found: list[Piece] = []
    for part in run_slices(signals.part):
        for each in find_episodes(signals.time[part], position[part], force[part], settings.spot):
            there = np.arange(part.start + each.start, part.start + each.stop)
            if float(np.nanpercentile(whole.force[there], 99.0)) > FIRM * peak:
                own = signals.taken(there)
                found.append((own, each, _project_place(own, whole, settings)))
    return found or [(signals, None, whole)]


def _project_place(own: Signals, whole: AlongNormal, settings: Preparation) -> AlongNormal:
    """Depth and compression at one place, with the signs found from the whole recording."""
    if own.force.ndim == 1:  # its own largest values give its sign
        return project_on_normal(own, settings, "")
    if whole.normal is not None and whole.normal.turned and "force" not in settings.flip:
        own = replace(own, force=-own.force)
    settings = replace(settings, flip=(*settings.flip, "force"))
    try:
        return project_on_normal(own, settings, "")
    except RecordingError:  # no force exceeds the noise at this place
        if whole.normal is None:
            raise
        return project_on_normal(own, replace(settings, normal=whole.normal.vector.tolist()), "")


def _report_travel(pieces: list[Piece], signals: Signals) -> list[Finding]:
    left = 1.0 - sum(len(piece[0].time) for piece in pieces) / len(signals.time)
    words = f"the probe travels over the material: {len(pieces)} places, each prepared separately"
    elsewhere = "between them, or less than a second at one"
    end = "; one law for all of them is an average"
    if len(pieces) == 1:
        words = "the probe travels over the material and stays for a second at one place only"
        elsewhere, end = "elsewhere, and are excluded", ""
    words += f"; {percent(left)} of the samples were {elsewhere}{end}" if left > 0.0 else end
    remedy = "pass --spot inf if it is all one material"
    return [Check.EPISODES.finding(words, remedy, severity="with-care")]


@log_stage("surface and velocity of each place")
def _join_pieces(
    pieces: list[Piece], settings: Preparation, made: dict[str, str], findings: list[Finding]
) -> tuple[Contact, list[Place]]:
    """Join the pieces, each with its own surface."""
    rule: SurfaceRule = settings.surface if isinstance(settings.surface, str) else "fit"
    channels, places, filters, lost = [], list[Place](), list[VelocityFilter](), 0
    for number, (signals, episode, own) in enumerate(pieces):
        runs = list(run_slices(signals.part))
        # The velocity does not depend on the origin of the depth.
        window = settings.velocity_window
        velocity, used, count = estimate_velocities(signals.time, own.depth, runs, window)
        if (fresh := signals.fresh) is not None:
            signals, velocity = signals.taken(fresh), velocity[fresh]
            own = replace(own, depth=own.depth[fresh], force=own.force[fresh])
        if isinstance(settings.surface, float | int):
            surface = Surface(float(settings.surface), 0.0, "as given")
        else:
            surface = find_surface(own.depth, velocity, own.force, rule)
        label = signals.part if episode is None else np.full(len(signals.time), number)
        depth = own.depth - surface.position
        channels.append((signals.time, depth, velocity, own.force, label))
        position = np.atleast_1d(np.nanmedian(signals.depth, axis=0))
        position = position if episode is None else episode.place
        times = float(signals.time[0]), float(signals.time[-1])
        places.append(Place(*times, position, own.normal, surface))
        filters.append(used)
        lost += count
    _say_surface(places, made, findings)
    normal = pieces[0][2].normal
    if normal is not None and len(pieces) == 1:
        add(made, "penetration", f"against the contact normal {normal}")
        add(made, "force", f"along the contact normal {normal}")
    used = max(filters, key=attrgetter("samples"))
    made["velocity"] = describe_filter(used, lost)
    # An estimator takes one number for the uncertainty of all surfaces.
    known = [place.surface.deviation for place in places if place.surface.deviation]
    one = rule != "estimate" and len(known) == len(places)
    time, depth, velocity, force, segment = map(np.concatenate, zip(*channels, strict=True))
    contact = Contact(
        time,
        penetration=depth,
        velocity=velocity,
        force=force,
        segment=segment,
        provenance=made,
        surface_deviation=float(np.median(known)) if one else None,
        findings=findings,
        velocity_filter=used,
    )
    return contact, places


def _say_surface(places: list[Place], made: dict[str, str], findings: list[Finding]) -> None:
    if len(places) == 1:
        places[0].surface.say(made, findings)
        return
    add(made, "penetration", "at each place along its own normal, relative to its own surface")
    assumed = sum(place.surface.assumed for place in places)
    if assumed:
        where = f"at {assumed} of {len(places)} places the probe is always in contact"
        findings.append(report_assumed_surface(where, "lift the probe between places"))


# Projection of a position and a force in space on the contact normal.

WEIGHT_DIRECTION = (0.0, 0.0, -1.0)  # in the frame of the position
NOTHING = 1e-3  # fraction of the largest force: no sensor is more linear than that


def project_on_normal(signals: Signals, settings: Preparation, source: str) -> AlongNormal:
    """Project position and force on the contact normal.

    Either may already be along one axis. If not given, the normal is found by
    :func:`~palpate.preparation.settings.normal_found`, or for a force along one axis as the
    direction in which the probe moves when the force grows. Signs are chosen so that compression is
    positive and grows with the depth.

    Parameters
    ----------
    signals : Signals
        Signals on one clock, with a tared force.
    settings : Preparation
        Only ``normal`` and ``flip`` are used.
    source : str
        Name of the file for messages.
    """
    position, force = signals.depth, signals.force
    given = None if settings.normal is None else normal_given(settings.normal)
    if force.ndim == position.ndim == 2:
        return _project_vectors(position, force, given, settings, source)
    if force.ndim == 2:
        normal = given or normal_found(force, np.column_stack([position] * 3) * 0.0, source)
        return _along_axis(position, force @ normal.vector, normal, settings)
    if position.ndim == 1:
        return _along_axis(position, force, None, settings)
    normal = given or _normal_from_motion(position, force, source)
    depth = -(position @ normal.vector)
    result = _along_axis(depth, force, normal, settings, turn_depth=False)
    if given is None:
        words = "palpate found the contact normal from the motion in which the force grows"
        remedy = "pass it if known, such as --normal z"
        result.findings.append(Check.DIRECTION.finding(words, remedy))
    return result


def _project_vectors(
    position: Floats, force: Floats, given: Normal | None, settings: Preparation, source: str
) -> AlongNormal:
    found, findings = given or normal_found(force, position, source), list[Finding]()
    along = force @ found.vector
    if given is None and found.turned:
        along = -along
        if "force" in settings.flip:  # a requested sign takes precedence
            found = Normal(-found.vector, found.spread)
        else:
            words = "the recorded force acts on the material: palpate reversed its sign"
            findings.append(Check.DIRECTION.finding(words, "pass --flip-force to confirm"))
    depth = -(position @ found.vector)
    known = np.isfinite(along)
    pulls = _is_negative(along)
    if given is not None and (pulls or not grows(depth[known], along[known])):
        how = "is mostly negative" if pulls else "decreases as the probe goes in"
        words = f"along the given normal the force {how}"
        remedy = "reverse the sign of --normal, or pass --flip-force"
        findings.append(Check.DIRECTION.finding(words, remedy, mark="do-not-trust"))
    findings += check_force_direction(position, force, found.vector, given=given is not None)
    return AlongNormal(depth, along, found, findings)


def _is_negative(force: Floats) -> bool:
    """Whether a force is mostly negative, weighted by magnitude."""
    return float(np.nansum(force * np.abs(force))) < 0.0


def _normal_from_motion(position: Floats, force: Floats, source: str) -> Normal:
    """The normal, opposite to the motion in which the force grows: −Σ ΔF Δp."""
    known = np.isfinite(position).all(axis=1) & np.isfinite(force)
    p, f = position[known], np.abs(force[known])
    total = -_products(p, f, min(STRIDE, max(len(f) // 4, 1))).sum(axis=0)
    length = float(np.linalg.norm(total))
    if not length > 0.0:
        raise no_normal(source, "the force does not change with the position")
    return Normal(total / length)


def _along_axis(
    depth: Floats,
    force: Floats,
    normal: Normal | None,
    settings: Preparation,
    *,
    turn_depth: bool = True,
) -> AlongNormal:
    """Choose the signs of a position and a force along one axis."""
    findings = []
    if "force" not in settings.flip and _is_negative(force):
        force = -force
        words = "the force is mostly negative: palpate reversed its sign, compression is positive"
        findings.append(Check.DIRECTION.finding(words, "pass --flip-force to confirm"))
    both = np.isfinite(force) & np.isfinite(depth)
    asked = "penetration" in settings.flip
    if turn_depth and not asked and not grows(depth[both], force[both]):
        depth = -depth
        words = "the force grows as the position decreases: palpate reversed the position's sign"
        findings.append(Check.DIRECTION.finding(words, "pass --flip-penetration to confirm"))
    return AlongNormal(depth, force, normal, findings)


def tare_force(
    signals: Signals, settings: Preparation, source: str
) -> tuple[Signals, Baseline | None, list[Finding]]:
    """Subtract the tool's weight and the force offset in free air, then rotate the force.

    Free air is a given interval, or detected. With an orientation the offset is constant in the
    axes of the sensor, in which the weight rotates: both are subtracted there, before the force is
    rotated to the frame of the position.
    """
    force, weight, down = signals.force, settings.tool_weight, None
    if signals.orientation is not None:
        down = rotate_to_base(np.array(WEIGHT_DIRECTION), signals.orientation * INVERSE, source)
    elif weight is not None and force.ndim == signals.depth.ndim == 2:
        down = np.broadcast_to(WEIGHT_DIRECTION, force.shape)
    if down is not None:
        force = force - (weight or 0.0) * down
    found = _zero(replace(signals, force=force), settings, source)
    words = "palpate found no free air and did not tare the force"
    findings = [Check.NO_TARE.finding(words, "record a second in free air")]
    if found is not None:
        signals, findings = replace(signals, force=force - found.zero), []
        if down is not None and weight:
            _refuse_idle_weight(signals, down, weight, source)
        force = signals.force
    if signals.orientation is not None:
        force = rotate_to_base(force, signals.orientation, source)
    return replace(signals, force=force), found, findings


def _zero(signals: Signals, settings: Preparation, source: str) -> Baseline | None:
    """The force offset in free air, in the sensor's axes; None if there is no free air."""
    tare, force = settings.tare, signals.force
    if isinstance(tare, tuple):
        return baseline_between(signals.time, force, tare, source)
    if signals.orientation is not None:
        # A rotating offset hides the contact axis: iterate once, with the offset subtracted.
        along = force - np.nanmedian(force, axis=0)
        for _ in range(2):
            mask = _free(signals, rotate_to_base(along, signals.orientation, source))
            if mask is not None:
                along = force - estimate_baseline(signals.time, force, mask).mean
    else:
        mask = _free(signals, force)
    if mask is not None:
        return estimate_baseline(signals.time, force, mask)
    if tare == "find":
        raise never_free(source)
    return None


def _refuse_idle_weight(signals: Signals, down: Floats, weight: float, source: str) -> None:
    """Reject a weight that is constant in the frame of the force, so that the tare removes it."""
    known = np.isfinite(signals.force).all(axis=1) & np.isfinite(down).all(axis=1)
    peak = float(np.nanpercentile(np.linalg.norm(signals.force, axis=1), 99.0))
    reach = float(np.linalg.norm(np.ptp(down[known], axis=0))) if known.any() else 0.0
    if weight * reach <= NOTHING * peak:
        raise idle_weight(weight, source)


def _free(signals: Signals, along: Floats) -> NDArray[np.bool_] | None:
    """Samples in free air: at one end of the motion along the normal, where the force is constant.

    It tries both ends, because the sign of the force is not known yet. The normal is found from
    ``along``, the force in the frame of the position.
    """
    height = signals.depth
    if height.ndim == 2 and along.ndim == 1:
        height = height @ _normal_from_motion(height, along, "").vector
    elif height.ndim == 2:  # the direction in which the force varies most, whatever its offset
        known = along[np.isfinite(along).all(axis=1)]
        height = height @ np.linalg.svd(known - known.mean(axis=0), full_matrices=False)[2][0]
    ends = [free_samples(signals.time, side * height, signals.force) for side in (1.0, -1.0)]
    found = [end for end in ends if end is not None]
    return max(found, key=np.count_nonzero, default=None)


# Checks of forces in space: agreement with the motion, and saturated axes.

# An error of 5° shortens the depth by 0.4 % and changes the stiffness of a law with exponent 2 by
# 1 %; 20° give 6 % and 13 %. A tool is aligned with its sensor to better than 3°, and friction of
# 0.3 inclines the force by 17°.
LARGE_ANGLE, TOO_LARGE_ANGLE = math.radians(5.0), math.radians(20.0)
BLOCKS_OF_DIRECTION = 8  # blocks whose scatter gives the uncertainty of the direction
ERRORS_OF_DIRECTION = 3.0  # standard errors of the direction
STRIDE = 5  # samples over which changes are computed; over fewer, noise dominates

SHORTEST = 5  # samples in a row
MOVES, STEPS = 8.0, 3.0  # change of the other axes meanwhile: σ and steps of resolution
SOME, MANY = 0.002, 0.02  # fractions of the recording


def check_force_direction(
    position: Floats, force: Floats, normal: Floats, *, given: bool
) -> list[Finding]:
    """Report forces that do not point along the motion in which they grow.

    The motion, −Σ ΔF Δp, does not depend on the axes of the force. The two differ if an axis is
    reversed or swapped, the frame is wrong, the force is not tared, or there is friction; also if
    the probe slides down a slope without friction, although the normal is then right.

    Parameters
    ----------
    position, force : numpy.ndarray, shape (k, 3)
        m and N, nominally in one frame.
    normal : numpy.ndarray, shape (3,)
        The contact normal.
    given : bool
        Whether the user gave the normal: then it must agree with the motion or with the forces.
    """
    motion, error = _direction(position, force @ normal)
    if motion is None:
        return []
    angle, other = _angle(motion, normal), "motion in which it grows"
    of = "the force points"
    if given:
        of, other = "the given normal points", "force and from the motion in which it grows"
        try:
            angle = min(angle, _angle(normal_found(force, 0.0 * position).vector, normal))
        except RecordingError:
            return []
    if angle <= LARGE_ANGLE + ERRORS_OF_DIRECTION * error:
        return []
    words = (
        f"{of} {math.degrees(angle):.0f}° away from the {other}: a wrong frame, a reversed or "
        "swapped axis, a force offset, friction, or a probe that slides down a slope"
    )
    remedy = "compare the axes of force and position, then pass --force-frame tool or --normal z"
    mark: Mark = "do-not-trust" if angle > TOO_LARGE_ANGLE else "with-care"
    return [Check.DIRECTION.finding(words, remedy, mark=mark)]


def _direction(position: Floats, along: Floats) -> tuple[Floats | None, float]:
    """The direction of the probe's motion as the force grows, and its standard error, rad."""
    known = np.isfinite(position).all(axis=1) & np.isfinite(along)
    p, f = position[known], along[known]
    if len(f) < 2 * BLOCKS_OF_DIRECTION * STRIDE:
        return None, math.inf
    products = _products(p, f, STRIDE)
    sums = np.array([part.sum(axis=0) for part in np.array_split(products, BLOCKS_OF_DIRECTION)])
    total = sums.sum(axis=0)
    length = float(np.linalg.norm(total))
    if not 0.0 < length < math.inf:
        return None, math.inf
    direction: Floats = total / length
    across = sums - np.outer(sums @ direction, direction)
    # Across the direction, the sums of the blocks add to zero; their scatter is the error.
    scatter = float((across**2).sum()) * BLOCKS_OF_DIRECTION / (BLOCKS_OF_DIRECTION - 1)
    return direction, math.sqrt(scatter) / length


def _products(position: Floats, force: Floats, stride: int) -> Floats:
    """ΔF Δp over a stride, which points along the motion in which the force grows."""
    return (force[stride:] - force[:-stride])[:, None] * (position[stride:] - position[:-stride])


def _angle(one: Floats, other: Floats) -> float:
    """The angle between two axes, regardless of their signs."""
    across = float(np.linalg.norm(np.cross(one, other)))
    return math.atan2(across, abs(float(one @ other)))


def check_saturation(force: Floats) -> list[Finding]:
    """Report axes of the sensor that stay at their largest value while the others change.

    An axis that never changes is not saturated but not measured, as with a load cell of one axis.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        Force as recorded, N: a rotation or a tare would hide the constant value.
    """
    moves = [bool(np.isfinite(c).any() and np.nanmin(c) < np.nanmax(c)) for c in force.T]
    axes = " and ".join(axis for axis, moving in zip("xyz", moves, strict=True) if not moving)
    words = f"the force along {axes} is constant: the sensor does not measure it"
    found = [Check.FORCE_AXES.finding(words)] if axes else []
    beyond = [MOVES * noise_of(column) + STEPS * step_of(column) for column in force.T]
    for k, column in enumerate(force.T):
        others = [each for each in range(force.shape[1]) if each != k]
        for edge in (np.nanmax(column), np.nanmin(column)) if moves[k] else ():
            held = (run for run in run_slices(column == edge) if column[run.start] == edge)
            count = sum(
                run.stop - run.start
                for run in held
                if run.stop - run.start >= SHORTEST
                and any(np.ptp(force[run, each]) > beyond[each] for each in others)
            )
            part = count / len(column)
            if part > SOME:
                words = f"the force along {'xyz'[k]} stays at {edge:.3g} N for {percent(part)} of "
                words += "the recording while the others change: it is probably saturated"
                remedy = "press less deeply, or use a sensor with a larger range"
                mark: Mark = "do-not-trust" if part > MANY else "with-care"
                found.append(Check.SATURATED_AXIS.finding(words, remedy, mark=mark))
    return found
