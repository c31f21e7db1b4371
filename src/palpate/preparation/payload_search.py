"""The payload of a log: signs, zeroings, what to do where a part is not identified, and marks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.contact import Delay, run_slices
from palpate.digits import percent, with_error
from palpate.errors import RecordingError
from palpate.findings import MARKS, Check, Finding, Mark, worst
from palpate.preparation.flange_motion import FlangeMotion
from palpate.preparation.free_air import BLOCK, Blocks, Mask, Zeroing, blocks_of, remove_zeroings
from palpate.preparation.payload import Payload
from palpate.preparation.payload_fit import (
    EVERYTHING,
    FEWEST_FREE,
    MASS,
    OF_MOUNT,
    fit_payload,
    turns_of,
)
from palpate.recordings.units import GRAVITY
from palpate.validation import Floats

# s of the filter of the motion in free air, against the noise of the pose. A tool that does not
# turn has the shorter one: its mass is told by an acceleration that the filter attenuates.
SLOW = 0.14
RETARE, RETARE_BLOCKS = 3.0, 10.0  # s of the local mean, and blocks that draw it to zero
LEAST_FREE, LEAST_FREE_TIME = 0.05, 1.0  # fraction of the log, s
MASS_ERRORS = 0.01, 0.05  # relative standard errors: trust, with care
MOUNT_ERRORS = math.radians(0.5), math.radians(2.0)
DELAY_ERRORS = 0.5e-3, 2e-3  # s
SCATTERS = 1.0, 5.0  # residual in free air over what is tolerable: trust, with care
NO_TURN = math.radians(2.0)  # shifts 3 % of the weight from one axis to another
# Force that depends on gravity otherwise than a weight: least fraction of it that is reported,
# least spread of gravity over the largest, least size over the changes of the bias. 26 logs without
# a fault have at most 0.5 % or 0.1; a gain or crosstalk of 2 % or a cable gives 0.6 % and 0.14.
LEAST_DIFFERENCE, LEAST_SPREAD, BY_DRIFT = 5e-3, 0.1, 0.12
UNKNOWN_MASS, LARGEST_SHARE = 1.0, 0.05  # kg of a tool at most; of the stiffness, without a word
TURN_MORE = "turn the tool by 30° about two axes in free air, or pass --payload of a log that does"
UNKNOWN_TOOL = Payload(0.0, np.zeros(3), np.eye(3), np.zeros(6))


@dataclass(slots=True, eq=False)
class PayloadFit:
    """A payload, and what it was found from.

    Attributes
    ----------
    payload : Payload
        The payload.
    blocks : Blocks
        Means of the wrench times the sign of the payload, without the steps of zeroing.
    free : numpy.ndarray of bool, shape (k,)
        Blocks in free air.
    scale : float
        Residual of the force in free air, over the white noise of a block.
    zeroed : sequence of Zeroing
        When the sensor was zeroed.
    sign_in_doubt : bool
        Whether the wrench fits with either sign.
    """

    payload: Payload
    blocks: Blocks
    free: Mask
    scale: float
    zeroed: Sequence[Zeroing]
    sign_in_doubt: bool = False

    @property
    def scatter(self) -> float:
        """Residual in free air, over the tolerance of a consensus and 1 % of the weight."""
        tolerable = self.blocks.floor + 0.01 * GRAVITY * self.payload.mass
        return self.scale * float(self.blocks.noise[:3].max()) / tolerable


def does_turn(motion: FlangeMotion) -> bool:
    """Whether the direction of gravity turns in the axes of the flange."""
    return turns_of(motion.values[:, 17:])[0] >= NO_TURN


def find_payload(
    motion: FlangeMotion,
    time: Floats,
    wrench: Floats,
    *,
    delay: Delay | None = None,
    known: Payload | None = None,
    weight: float | None = None,
    sign: float = 1.0,
    tried: bool = False,
    source: str = "",
) -> PayloadFit | None:
    """Find the payload of a log, and the zeroings of its sensor.

    Where the log does not identify the mass, the payload has none: then its bias is the mean wrench
    in the axes of the sensor. Where it does not identify the mount, the axes are those of the pose.

    Parameters
    ----------
    motion : FlangeMotion
        Motion of the flange, filtered over 0.14 s if it turns, else over 0.1 s.
    time, wrench : numpy.ndarray, shapes (k,) and (k, 6)
        s, N and N·m, as recorded; a torque of NaN is ignored.
    delay : Delay, optional
        Delay of the wrench.
    known : Payload, optional
        Tool and mount; then only bias and clock are found.
    weight : float, optional
        Weight of the tool, N, for a log that does not identify it.
    sign : float
        −1 if the sensor reads the force that the tool exerts; without effect where the log does not
        identify the mass.
    tried : bool
        Whether the other sign was tried: then None where the log does not identify the mass.
    source : str
        Name of the file for messages.

    Returns
    -------
    PayloadFit or None
        None if the log is short, or has no free air.

    Raises
    ------
    RecordingError
        The log contradicts the weight, or does not depend on it.
    """
    if known is not None:
        sign = known.sign
    blocks = blocks_of(time, sign * wrench, motion)
    if len(blocks.start) < FEWEST_FREE:
        return None
    if weight and not does_turn(motion):
        raise idle_weight(weight, source)
    blocks, zeroed = remove_zeroings(time, sign * wrench, blocks, known, delay)

    def fit(tool: Payload | None, fixed: Sequence[int]) -> PayloadFit:
        own, free, scale = fit_payload(blocks, known=tool, fixed=fixed, delay=delay)
        steps = [replace(each, step=sign * each.step) for each in zeroed]
        return PayloadFit(replace(own, sign=sign), blocks, free, scale, steps)

    if known is not None:
        if delay is None and known.delay_error < DELAY_ERRORS[1]:
            delay = Delay(known.delay, max(known.delay_error, 1e-3))
        found = fit(known, EVERYTHING)
        names = "mass_error", "centre_error", "mount_error", "lever_error"
        errors = {name: np.nan_to_num(getattr(known, name)) for name in names}
        found = replace(found, payload=replace(found.payload, **errors))
        return found if _is_free(found) else None
    found = fit(None, ())
    own, seen_free = found.payload, _is_free(found)
    if seen_free and own.mass_error <= MASS_ERRORS[1] * own.mass:
        if weight is not None:
            _check_weight(own, weight, source)
        if own.mount_error.max() > MOUNT_ERRORS[1]:
            aligned = replace(own, mount=np.eye(3))
            other = fit(aligned, OF_MOUNT)
            fits_as_well = other.payload.mass > 0.0 and other.scale < 1.5 * found.scale
            if fits_as_well:  # assumed, not found: it is no more certain
                found = _with_errors(other, own)
    elif sign < 0.0 and tried:
        return None
    elif sign < 0.0:
        return find_payload(motion, time, wrench, delay=delay, weight=weight, source=source)
    else:
        fixed: Sequence[int] = EVERYTHING
        tool = UNKNOWN_TOOL
        if weight:
            tool, fixed = replace(tool, mass=weight / GRAVITY), (MASS, *OF_MOUNT)
        if delay is None and own.delay_error <= DELAY_ERRORS[1]:
            delay = Delay(own.delay, own.delay_error)
        found = fit(tool, fixed)
        if not _is_free(found):
            return None
        # A fit without free air has no errors.
        found = _with_errors(found, own if seen_free else UNKNOWN_TOOL)
    late = found.payload.delay_error
    if delay is None and not late <= DELAY_ERRORS[1]:
        late = math.hypot(late, found.payload.delay)
        found = replace(found, payload=replace(found.payload, delay=0.0, delay_error=late))
    return found


def _with_errors(fit: PayloadFit, own: Payload) -> PayloadFit:
    """Return a fit with assumed mass or mount, as uncertain as the payload without assumptions."""
    mass_error = math.hypot(own.mass_error, own.mass - fit.payload.mass)
    unsure = replace(fit.payload, mass_error=mass_error, mount_error=own.mount_error)
    return replace(fit, payload=unsure)


def _is_free(fit: PayloadFit) -> bool:
    own = fit.payload
    enough = own.free_share > LEAST_FREE and own.free_time > LEAST_FREE_TIME
    return enough and fit.scatter < SCATTERS[1]


def _check_weight(own: Payload, weight: float, source: str) -> None:
    off, error = abs(own.mass * GRAVITY - weight), own.mass_error * GRAVITY
    if off > max(3.0 * error, 0.02 * weight):
        fits = with_error(own.mass * GRAVITY, error, unit="N")
        words = f"the force in free air fits a tool weight of {fits}, not --tool-weight {weight:g}N"
        raise RecordingError.of(source, f"{words}; drop it")


def idle_weight(weight: float, source: str) -> RecordingError:
    """Return the error for a weight that the tare removes."""
    words = f"--tool-weight {weight:g}N has no effect: in the frame of the force the weight is "
    remedy = "drop it, or pass --force-frame tool if the sensor rotates with the tool"
    return RecordingError.of(source, f"{words}constant, and the tare removes it; {remedy}")


def mark_payload(fit: PayloadFit, *, delay_given: bool) -> Payload:
    """Return the payload with its marks, and findings that give the reasons."""
    own, findings = fit.payload, list[Finding]()
    turns = f"the tool turns by {math.degrees(own.turn):.0f}° in free air: palpate cannot identify "
    mass = _mark(own.mass_error / max(own.mass, 1e-9), MASS_ERRORS)
    mount = _mark(float(own.mount_error.max()), MOUNT_ERRORS)
    late = _mark(own.delay_error, DELAY_ERRORS)
    if not (delay_given or own.axes):  # by its inertia alone
        late = worst(late, "with-care")
    if mass == "do-not-trust" and own.mass_error * GRAVITY < fit.blocks.floor:
        words = "the tool weighs less than the noise of the sensor: palpate takes the axes of the "
        findings.append(Check.PAYLOAD.finding(f"{words}pose for those of the sensor"))
    elif mass == "do-not-trust":
        words = "its weight, and subtracts the mean force in the axes of the sensor"
        mark: Mark = "with-care" if own.turn > NO_TURN else "trust"
        findings.append(Check.PAYLOAD.finding(turns + words, TURN_MORE, mark=mark))
    elif mount == "do-not-trust":
        words = "the mount, and takes the axes of the pose for those of the sensor"
        findings.append(Check.PAYLOAD.finding(turns + words, TURN_MORE, mark="with-care"))
    if fit.scatter > SCATTERS[0]:
        words = f"the force in free air fits the weight of the tool {fit.scatter:.1f} times worse "
        remedy = "move more slowly, or check that the z axis of the pose points up"
        words += "than its noise explains"
        findings.append(Check.PAYLOAD.finding(words, remedy, severity="with-care"))
    newtons, share = _differ_from_weight(fit)
    if share > LEAST_DIFFERENCE:
        words = (
            f"as the tool turns, the force in free air differs from its weight by {newtons:.2g} N"
        )
        words += f", {percent(share)} of it: a cable, or the gain or crosstalk of the sensor"
        remedy = "fix the cable to the tool, or calibrate the sensor"
        findings.append(Check.PAYLOAD.finding(words, remedy, mark="with-care"))
    if own.sign < 0.0:
        words = "by the weight of the tool the sensor reads the force on the material"
        words += ": palpate reversed its sign"
        findings.append(Check.PAYLOAD.finding(words, "pass --flip-force to confirm"))
    if fit.sign_in_doubt and own.mass > 0.0:
        mount = worst(mount, "with-care")
        words = "the tool turns about one axis in free air, which leaves the sign of the force open"
        remedy = "turn the tool about two axes, or pass --flip-force if the sensor reads the force "
        findings.append(Check.PAYLOAD.finding(words, remedy + "on the material"))
    if fit.zeroed:
        times = ", ".join(f"{each.time:.2f} s" for each in fit.zeroed)
        words = f"the sensor was zeroed during the log, at {times}: palpate took the step out"
        findings.append(Check.ZEROED.finding(words, "zero the sensor before the log begins"))
    return replace(own, mass_mark=mass, mount_mark=mount, delay_mark=late, findings=tuple(findings))


def report_unknown_inertia(mass_error: float, share: float) -> list[Finding]:
    """Warn where the inertia of a tool whose mass is not known may be part of the stiffness.

    Parameters
    ----------
    mass_error : float
        kg.
    share : float
        Part of a kilogram in the stiffness, 1/kg.
    """
    share *= min(mass_error, UNKNOWN_MASS)
    if not share > LARGEST_SHARE:
        return []
    words = "free air does not tell the mass of the tool, whose inertia may change the stiffness "
    return [Check.PAYLOAD.finding(f"{words}by {percent(share)}", TURN_MORE, mark="with-care")]


def _differ_from_weight(fit: PayloadFit) -> tuple[float, float]:
    """Return by how much the force in free air depends on gravity otherwise than a weight, N and 1.

    Zero where the drift of the bias explains it, or the tool does not turn.
    """
    own, blocks = fit.payload, fit.blocks.taken(fit.free)
    if not own.axes or not own.mass > 0.0:
        return 0.0, 0.0
    seen = blocks.seen(own.delay)
    load = own.wrench(seen[:, :3], seen[:, 3:6], seen[:, 6:9]) + own.bias_at(blocks.time)
    left = (blocks.wrench - load)[:, :3]
    gravity = GRAVITY * seen[:, 17:] @ own.mount
    gravity -= gravity.mean(axis=0)
    # Axes about which it hardly turns say nothing.
    slopes = np.linalg.lstsq(gravity, left - left.mean(axis=0), rcond=LEAST_SPREAD)[0]
    different = gravity @ slopes
    if different.std(axis=0).max() < BY_DRIFT * own.bias_changes[:, :3].std(axis=0).max(
        initial=0.0
    ):
        return 0.0, 0.0
    return float(np.abs(different).max()), float(np.linalg.norm(slopes, 2)) / own.mass


def _mark(error: float, limits: tuple[float, float]) -> Mark:
    return MARKS[sum(not error <= limit for limit in limits)]


def external_force(fit: PayloadFit, motion: FlangeMotion, time: Floats, force: Floats) -> Floats:
    """Return the force of the material on the tool, in the axes of the sensor, shape (k, 3).

    The mean of what is left in free air nearby is subtracted too, weighted by exp(−|t − tᵢ|/3 s)
    and drawn to zero by 0.2 s: the sensor wanders faster than the bias of the payload.

    Parameters
    ----------
    motion : FlangeMotion
        Motion of the flange, filtered over 0.1 s: the tool is quicker in contact.
    time, force : numpy.ndarray, shapes (k,) and (k, 3)
        s and N, on the clock of the wrench; with the sign of the payload, without steps.
    """
    own, blocks, times = fit.payload, fit.blocks, fit.blocks.time

    def rest(force: Floats, time: Floats, seen: Floats) -> Floats:
        model = own.wrench(seen[:, :3], seen[:, 3:6], seen[:, 6:9]) + own.bias_at(time)
        remainder: Floats = force - model[:, :3]
        return remainder

    seen = motion.mean(blocks.start - own.delay, blocks.stop - own.delay)
    means = rest(blocks.wrench[:, :3], times, seen)
    left = rest(force, time, motion.at(time - own.delay))
    block = float(np.median(blocks.stop - blocks.start))
    far = math.ceil(5.0 * RETARE / block)
    kernel = np.exp(-np.abs(np.arange(-far, far + 1)) * block / RETARE)
    columns = np.column_stack([fit.free, fit.free[:, None] * means])
    for part in run_slices(blocks.segment):
        near = [np.convolve(column, kernel)[far:-far] for column in columns[part].T]
        ends = -np.inf if part.start == 0 else times[part.start]
        until = np.inf if part.stop == len(times) else times[part.stop]
        there = slice(*np.searchsorted(time, (ends, until)))
        for k in range(3):
            local = near[k + 1] / (near[0] + RETARE_BLOCKS * BLOCK / block)
            left[there, k] -= np.interp(time[there], times[part], local)
    return left
