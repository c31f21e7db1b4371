"""Subtraction of the tool's weight and inertia from a wrench: of a log, and in a control loop."""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

import palpate._core as _core
from palpate.errors import InvalidParameterError, RecordingError
from palpate.input.channels.frames import interpolate_columns, rotate
from palpate.input.wrench.consensus import BLOCK
from palpate.input.wrench.fit import PayloadFit
from palpate.input.wrench.marks import mark_payload
from palpate.input.wrench.motion import WINDOW, FlangeMotion, motion_of
from palpate.input.wrench.payload import TENSOR, Payload
from palpate.input.wrench.readings import Reading
from palpate.input.wrench.search import SLOW, does_turn, find_payload
from palpate.input.wrench.zeroing import without_zeroings
from palpate.method.contact import Delay
from palpate.method.rows import finite_rows, median, run_slices, typical_step
from palpate.method.settings import Configured
from palpate.validation import Floats, Mask, arguments, check_choice, frozen, instance, number_in

# In a log.

LONGEST_MEAN = 4e-3  # s of the wrench for one sample: 0.1 % is lost of an oscillation at 6 Hz
# s of the local mean, and blocks that draw it to zero
RETARE = 3.0
RETARE_BLOCKS = 10.0


@frozen(eq=False)
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


@dataclass(slots=True, eq=False)
class Compensated:
    """The force of the material, from a sensor that turns with the tool.

    Attributes
    ----------
    force : numpy.ndarray, shape (n, 3)
        N, in the axes of the position, of the samples that have one.
    kept : numpy.ndarray of bool, shape (k,)
        The samples that have a force.
    free : numpy.ndarray of bool, shape (n,)
        Their samples in free air.
    bias : numpy.ndarray, shape (n, 3)
        The force of the unloaded sensor, N, in its axes.
    fit : PayloadFit
        Tool, mount, bias and clock, and what they were found from.
    motion : FlangeMotion
        Motion of the flange.
    delay : Delay or None
        The delay that was taken out.
    """

    force: Floats
    kept: Mask
    free: Mask
    bias: Floats
    fit: PayloadFit
    motion: FlangeMotion
    delay: Delay | None

    @property
    def payload(self) -> Payload:
        """Tool, mount, bias and clock."""
        return self.fit.payload


def compensate(
    time: Floats,
    orientation: Floats,
    log: PosedWrench,
    reading: Reading,
    source: str,
    *,
    known: Payload | None = None,
    weight: float | None = None,
    tried: bool = False,
) -> Compensated | None:
    """Take weight, inertia, bias and delay out of a wrench in the axes of the sensor.

    None where the log has no free air: then the mean force is subtracted as that of a sensor that
    does not turn.

    Parameters
    ----------
    time, orientation : numpy.ndarray, shapes (k,) and (k, 4)
        Times of the samples, s, and their unit quaternions x, y, z, w.
    log : PosedWrench
        Wrench and pose.
    reading : Reading
        Frame, order of the quaternions and sign.
    source : str
        Name of the file for messages.
    known : Payload, optional
        Tool and mount.
    weight : float, optional
        Weight of the tool, N.
    tried : bool
        Whether the other sign was tried.
    """
    quick = log.motion(reading)
    slow = log.motion(reading, SLOW)
    motion = slow if does_turn(slow) else quick
    fit = find_payload(
        motion,
        log.time,
        log.wrench,
        delay=log.delay,
        known=known,
        weight=weight,
        sign=reading.sign,
        tried=tried,
        source=source,
    )
    if fit is None:
        if known is None:
            return None
        problem = "--payload needs a second of free air, to find the bias of the sensor"
        raise RecordingError.of(source, f"{problem}; record the approach too")
    fit = mark_payload(fit, delay_given=log.delay is not None)
    payload = fit.payload
    delay = log.delay
    if delay is None and payload.delay_mark != "do-not-trust":
        delay = Delay(payload.delay, payload.delay_error, found=True)
    shifted = time + (0.0 if delay is None else delay.seconds)
    smooth = _average(time, log, fit)
    recorded = interpolate_columns(shifted, log.time, smooth)
    in_flange = external_force(fit, quick, shifted, recorded) @ payload.mount.T
    force = rotate(in_flange, orientation)
    kept = finite_rows(force) & (shifted >= log.time[0]) & (shifted <= log.time[-1])
    shifted = shifted[kept]
    k = np.clip(np.searchsorted(fit.blocks.start, shifted) - 1, 0, None)
    free = fit.free[k] & (shifted <= fit.blocks.stop[k])
    bias = payload.sign * payload.bias_at(shifted)[:, :3]
    return Compensated(force[kept], kept, free, bias, fit, motion, delay)


def _average(time: Floats, log: PosedWrench, fit: PayloadFit) -> Floats:
    """Return means of the sensor's force over the time of a sample, with the payload's sign."""
    step, wrench_step = (typical_step(clock) for clock in (time, log.time))
    half = round(0.5 * min(step, LONGEST_MEAN) / wrench_step)
    weights = np.full(2 * half + 1, fit.payload.sign / (2 * half + 1))
    steady = without_zeroings(log.time, log.wrench[:, :3], fit.zeroed)
    padded = np.pad(steady, ((half, half), (0, 0)), "edge")
    return np.column_stack([np.convolve(column, weights, "valid") for column in padded.T])


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
    payload = fit.payload
    blocks = fit.blocks
    times = blocks.time
    in_blocks = motion.mean(blocks.start - payload.delay, blocks.stop - payload.delay)
    means = payload.unload(blocks.wrench[:, :3], times, in_blocks)
    external = payload.unload(force, time, motion.at(time - payload.delay))
    span = median(blocks.duration)
    reach = math.ceil(5.0 * RETARE / span)
    kernel = np.exp(-np.abs(np.arange(-reach, reach + 1)) * span / RETARE)
    columns = np.column_stack([fit.free, fit.free[:, None] * means])
    for run in run_slices(blocks.segment):
        count, *sums = (np.convolve(column, kernel)[reach:-reach] for column in columns[run].T)
        start = -np.inf if run.start == 0 else times[run.start]
        stop = np.inf if run.stop == len(times) else times[run.stop]
        samples = slice(*np.searchsorted(time, (start, stop)))
        for k, total in enumerate(sums):
            local = total / (count + RETARE_BLOCKS * BLOCK / span)
            external[samples, k] -= np.interp(time[samples], times[run], local)
    return external


# In a control loop.

MOTION_WINDOW = 0.1  # s
# a quartic needs five; the filter holds the larger number
FEWEST_SAMPLES = 7
MOST_SAMPLES = 151


class PayloadCompensation(Configured, _core.PayloadCompensation):
    """Subtracts weight, inertia and bias of a tool from its sensor's wrench, sample by sample.

    Acceleration and angular velocity are derivatives of the pose: of a quartic through the poses of
    a window, at its middle. Each output is therefore half a window old, force and position alike,
    which does not affect an estimate. :class:`palpate.OnlinePreparation` takes the outputs.

    Parameters
    ----------
    payload : Payload
        Mass, centre of mass, mount, bias and delay, such as ``Payload.load("tool.toml")``. A drift
        of its bias is not continued; :meth:`start_tare` and :meth:`finish_tare` update the bias.
    sample_time : float
        Time between samples, s, in [1e-6, 1e3]. palpate interpolates samples of another clock to
        these steps.
    motion_window : float
        Length of the window of poses, s, of 7 to 151 samples. Default: 0.1. With 0, palpate
        subtracts the weight but no inertia, without delay.
    frame : str
        Axes of force and torque: ``"base"`` (default), those of the pose's position, or
        ``"sensor"``.

    Raises
    ------
    InvalidParameterError
        A setting is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> tool = palpate.Payload(
    ...     mass=0.5, centre=np.array([0.0, 0.0, 0.04]), mount=np.eye(3), bias=np.zeros(6)
    ... )
    >>> compensation = palpate.PayloadCompensation(payload=tool, motion_window=0.0)
    >>> for k in range(3):  # the tool hangs down, and pushes with 2 N
    ...     status = compensation.update([0, 0, 0], [1, 0, 0, 0], [0, 0, 2.9, 0, 0, 0], 0.001 * k)
    >>> status
    Status.UPDATED
    >>> [round(value, 2) for value in compensation.force]
    [0.0, 0.0, 2.0]
    """

    __slots__ = ("_settings",)

    def __init__(
        self,
        *,
        payload: Payload,
        sample_time: float = 1e-3,
        motion_window: float = MOTION_WINDOW,
        frame: Literal["base", "sensor"] = "base",
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        instance("payload", payload, Payload)
        step = number_in("sample_time", sample_time, 1e-6, 1e3)
        length = number_in("motion_window", motion_window, 0.0, 1e6)
        check_choice("frame", frame, ("base", "sensor"))
        samples = min(max(round(length / step), FEWEST_SAMPLES), MOST_SAMPLES) | 1
        try:
            super().__init__(
                step,
                samples if length > 0.0 else 1,
                frame == "base",
                payload.delay,
                payload.sign,
                payload.mass,
                payload.centre.tolist(),
                payload.lever.tolist(),
                payload.parameters[4:10][TENSOR].tolist(),
                payload.mount.tolist(),
                payload.bias.tolist(),
            )
        except ValueError as fault:
            raise InvalidParameterError(f"payload: {fault}") from None
