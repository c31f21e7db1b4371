"""The payload of a log of pose and wrench, and the force in free air before and after it."""

import numpy as np

from palpate.input.wrench.compensation import Compensated
from palpate.input.wrench.fit import skew
from palpate.input.wrench.payload import Payload
from palpate.validation import Floats, frozen


@frozen(eq=False)
class PayloadLog:
    """A payload, and means of the force in free air.

    Attributes
    ----------
    payload : Payload
        The payload, with its marks.
    source : str
        The log.
    sensor_frame : str
        Frame of the force, if the log states it; else empty.
    time : numpy.ndarray, shape (k,)
        Middle of each block in free air, s.
    recorded, remaining : numpy.ndarray, shape (k, 3)
        Force of the sensor, N, as recorded but for its sign, and less weight, inertia and bias.
    error : numpy.ndarray, shape (k, 3)
        Standard error of what is subtracted, N.
    """

    payload: Payload
    source: str
    sensor_frame: str
    time: Floats
    recorded: Floats
    remaining: Floats
    error: Floats


def summarize(compensated: Compensated, source: str, sensor_frame: str) -> PayloadLog:
    """Return the payload of a log with its force in free air, before and after compensation."""
    payload = compensated.payload
    blocks = compensated.fit.blocks.taken(compensated.fit.free)
    delay = payload.delay
    motion = compensated.motion.mean(blocks.start - delay, blocks.stop - delay)
    g = motion[:, :3] @ payload.mount
    # By the errors of the mass, of the mount, φ × m g, and of the bias.
    variance = np.square(payload.mass_error * g)
    variance += np.square(payload.mass * skew(g)) @ np.square(payload.mount_error)
    variance += np.nan_to_num(np.square(payload.bias_error[:3]))
    force = blocks.wrench[:, :3]
    return PayloadLog(
        payload,
        source,
        sensor_frame,
        blocks.time,
        force,
        payload.unload(force, blocks.time, motion),
        np.sqrt(variance),
    )
