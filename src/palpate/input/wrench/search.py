"""The search for the payload of a log: signs, zeroings, and what to do without a turning tool."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.digits import with_error
from palpate.errors import RecordingError
from palpate.input.recordings.units import GRAVITY
from palpate.input.wrench.consensus import Blocks, blocks_of
from palpate.input.wrench.fit import (
    EVERYTHING,
    FEWEST_FREE,
    MASS,
    OF_MOUNT,
    PayloadFit,
    fit_payload,
    turns_of,
)
from palpate.input.wrench.marks import DELAY_ERRORS, MASS_ERRORS, MOUNT_ERRORS, NO_TURN, SCATTERS
from palpate.input.wrench.motion import FlangeMotion
from palpate.input.wrench.payload import Payload
from palpate.input.wrench.zeroing import Zeroing, remove_zeroings
from palpate.method.contact import Delay
from palpate.validation import Floats, frozen

# s of the filter of the motion in free air, against the noise of the pose. A tool that does not
# turn has the shorter one: its mass is told by an acceleration that the filter attenuates.
SLOW = 0.14
# fraction of the log, s
LEAST_FREE = 0.05
LEAST_FREE_TIME = 1.0
UNKNOWN_TOOL = Payload(0.0, np.zeros(3), np.eye(3), np.zeros(6))
TOOL_ERRORS = "mass_error", "centre_error", "mount_error", "lever_error"


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
    search = _PayloadSearch(blocks, zeroed, sign)
    if known is not None:
        return search.fit_known_tool(known, delay)
    fit = search.fit(None, (), delay)
    if _has_free_air(fit) and fit.payload.mass_error <= MASS_ERRORS[1] * fit.payload.mass:
        if weight is not None:
            _check_weight(fit.payload, weight, source)
        fit = search.align_uncertain_mount(fit, delay)
    elif sign < 0.0:
        if tried:
            return None
        return find_payload(motion, time, wrench, delay=delay, weight=weight, source=source)
    else:
        payload = fit.payload
        if delay is None and payload.delay_error <= DELAY_ERRORS[1]:
            delay = Delay(payload.delay, payload.delay_error)
        without_mass = search.fit_unknown_tool(fit, weight, delay)
        if without_mass is None:
            return None
        fit = without_mass
    return fit if delay is not None else _drop_uncertain_delay(fit)


@frozen(eq=False)
class _PayloadSearch:
    """Means of a wrench with one sign, without the zeroings of its sensor."""

    blocks: Blocks
    zeroed: Sequence[Zeroing]
    sign: float

    def fit(self, tool: Payload | None, fixed: Sequence[int], delay: Delay | None) -> PayloadFit:
        """Fit the payload, with the fixed columns of a known tool."""
        fit = fit_payload(self.blocks, known=tool, fixed=fixed, delay=delay)
        steps = [replace(zeroing, step=self.sign * zeroing.step) for zeroing in self.zeroed]
        return replace(fit, payload=replace(fit.payload, sign=self.sign), zeroed=steps)

    def fit_known_tool(self, tool: Payload, delay: Delay | None) -> PayloadFit | None:
        """Find bias and clock of a known tool; None without free air."""
        if delay is None and tool.delay_error < DELAY_ERRORS[1]:
            delay = Delay(tool.delay, max(tool.delay_error, 1e-3))
        fit = self.fit(tool, EVERYTHING, delay)
        errors = {name: np.nan_to_num(getattr(tool, name)) for name in TOOL_ERRORS}
        fit = replace(fit, payload=replace(fit.payload, **errors))
        return fit if _has_free_air(fit) else None

    def align_uncertain_mount(self, fit: PayloadFit, delay: Delay | None) -> PayloadFit:
        """Return the fit with the axes of the pose, if the mount is uncertain and it is as good."""
        payload = fit.payload
        if not payload.mount_error.max() > MOUNT_ERRORS[1]:
            return fit
        aligned = self.fit(replace(payload, mount=np.eye(3)), OF_MOUNT, delay)
        if aligned.payload.mass > 0.0 and aligned.scale < 1.5 * fit.scale:
            return _with_errors(aligned, payload)  # assumed, not found: it is no more certain
        return fit

    def fit_unknown_tool(
        self, fit: PayloadFit, weight: float | None, delay: Delay | None
    ) -> PayloadFit | None:
        """Return the fit with a given weight or none; None without free air."""
        if weight:
            tool = replace(UNKNOWN_TOOL, mass=weight / GRAVITY)
            assumed = self.fit(tool, (MASS, *OF_MOUNT), delay)
        else:
            assumed = self.fit(UNKNOWN_TOOL, EVERYTHING, delay)
        if not _has_free_air(assumed):
            return None
        # A fit without free air has no errors.
        return _with_errors(assumed, fit.payload if _has_free_air(fit) else UNKNOWN_TOOL)


def _with_errors(fit: PayloadFit, found: Payload) -> PayloadFit:
    """Return a fit with assumed mass or mount, as uncertain as the payload without assumptions."""
    mass_error = math.hypot(found.mass_error, found.mass - fit.payload.mass)
    unsure = replace(fit.payload, mass_error=mass_error, mount_error=found.mount_error)
    return replace(fit, payload=unsure)


def _drop_uncertain_delay(fit: PayloadFit) -> PayloadFit:
    payload = fit.payload
    if payload.delay_error <= DELAY_ERRORS[1]:
        return fit
    error = math.hypot(payload.delay_error, payload.delay)
    return replace(fit, payload=replace(payload, delay=0.0, delay_error=error))


def _has_free_air(fit: PayloadFit) -> bool:
    payload = fit.payload
    enough = payload.free_share > LEAST_FREE and payload.free_time > LEAST_FREE_TIME
    return enough and fit.scatter < SCATTERS[1]


def _check_weight(payload: Payload, weight: float, source: str) -> None:
    error = payload.mass_error * GRAVITY
    if abs(payload.mass * GRAVITY - weight) > max(3.0 * error, 0.02 * weight):
        fits = with_error(payload.mass * GRAVITY, error, unit="N")
        contradiction = f"a tool weight of {fits}, not --tool-weight {weight:g}N; drop it"
        raise RecordingError.of(source, f"the force in free air fits {contradiction}")


def idle_weight(weight: float, source: str) -> RecordingError:
    """Return the error for a weight that the tare removes."""
    problem = f"--tool-weight {weight:g}N has no effect: in the frame of the force the weight is "
    remedy = "drop it, or pass --force-frame tool if the sensor rotates with the tool"
    return RecordingError.of(source, f"{problem}constant, and the tare removes it; {remedy}")
