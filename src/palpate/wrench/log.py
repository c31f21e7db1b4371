"""The payload of a log of pose and wrench, and the force in free air before and after it."""

from dataclasses import dataclass

import numpy as np

from palpate.preparation.roles import choose_roles
from palpate.preparation.settings import Preparation
from palpate.preparation.spatial import compensate_log
from palpate.recordings import Recording
from palpate.validation import Floats
from palpate.wrench.fit import skew
from palpate.wrench.payload import Payload


@dataclass(frozen=True, slots=True, eq=False)
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
    found = compensate_log(recording, settings)
    fit, motion, payload = found.fit, found.motion, found.payload
    blocks = fit.blocks.taken(fit.free)
    late = payload.delay
    seen = motion.mean(blocks.start - late, blocks.stop - late)
    load = payload.wrench(seen[:, :3], seen[:, 3:6], seen[:, 6:9])[:, :3]
    g = seen[:, :3] @ payload.mount
    # By the errors of the mass, of the mount, φ × m g, and of the bias.
    variance = np.square(payload.mass_error * g)
    variance += np.square(payload.mass * skew(g)) @ np.square(payload.mount_error)
    variance += np.nan_to_num(np.square(payload.bias_error[:3]))
    return PayloadLog(
        payload,
        recording.source,
        recording.frames.get(choose_roles(recording, settings.columns).force[0], ""),
        blocks.time,
        blocks.wrench[:, :3],
        blocks.wrench[:, :3] - load - payload.bias_at(blocks.time)[:, :3],
        np.sqrt(variance),
    )
