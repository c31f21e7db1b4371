"""Forces in the tool's frame, turned into the frame of the position; the tool's own weight."""

import math
from typing import Literal

import numpy as np

from palpate.errors import RecordingError
from palpate.preparation.roles import Roles
from palpate.recordings import Recording
from palpate.remarks import Remark
from palpate.validation import Floats

ForceFrame = Literal["tool", "base"]
#: Turned by more than this the tool's weight moves by 3 % of it from one axis to another: 0.3 N of
#: a kilogram, which is a tenth of a soft contact.
LARGEST_TURN = math.radians(2.0)
UNIT_LENGTH = 0.02  # from 1, of a quaternion: printed digits and interpolation stay within


def turned(force: Floats, orientation: Floats, source: str = "") -> Floats:
    """Return the forces turned by the orientation of the probe: from its frame into the base's.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        In the tool's frame.
    orientation : numpy.ndarray, shape (k, 4)
        Quaternions x, y, z, w.

    Raises
    ------
    RecordingError
        They are no quaternions: their length is not 1.
    """
    length = np.linalg.norm(orientation, axis=1)
    wrong = np.abs(length - 1.0) > UNIT_LENGTH
    if wrong.mean() > 0.1:
        where = f"{source}: " if source else ""
        raise RecordingError(
            f"{where}the orientation is no quaternion x, y, z, w: its length is "
            f"{float(np.nanmedian(length)):.3g}; name the right channels with --orientation"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = orientation / length[:, None]
    axis, scalar = unit[:, :3], unit[:, 3:]
    across = 2.0 * np.cross(axis, force)
    result: Floats = force + scalar * across + np.cross(axis, across)
    return result


def largest_turn(orientation: Floats) -> float:
    """Largest angle between the orientation at any time and a typical one, rad."""
    known = orientation[np.isfinite(orientation).all(axis=1)]
    length = np.linalg.norm(known, axis=1)
    unit = known[length > 0.0] / length[length > 0.0, None]
    if not len(unit):
        return 0.0
    typical = unit[len(unit) // 2]
    cosine = np.clip(np.abs(unit @ typical), 0.0, 1.0)  # q and −q are one orientation
    return 2.0 * math.acos(float(np.percentile(cosine, 1.0)))


def frame_of(
    recording: Recording, roles: Roles, asked: ForceFrame | None, remarks: list[Remark]
) -> ForceFrame:
    """Say in which frame the force is: as asked, by the frames that the recording names, or base.

    What is assumed is added to the remarks.
    """
    if asked is not None:
        return asked
    force, depth = (recording.frames.get(names[0]) for names in (roles.force, roles.depth))
    if force is None or depth is None:
        if roles.orientation:
            remarks.append(
                Remark(
                    "force frame",
                    "the recording does not say in which frame the force is; it is taken to be "
                    "the position's",
                    "--force-frame tool, where the sensor turns with the tool",
                )
            )
        return "base"
    if force.lstrip("/") == depth.lstrip("/"):
        return "base"
    if roles.orientation:
        remarks.append(
            Remark(
                "force frame",
                f"the force is in the frame {force!r}, the position in {depth!r}: it is turned by "
                "the probe's orientation, as if the sensor's axes were the tool's",
                "--force-frame base, where they are not turned against each other",
            )
        )
        return "tool"
    remarks.append(
        Remark(
            "force frame",
            f"the force is in the frame {force!r}, the position in {depth!r}, and there is no "
            "orientation to turn one into the other",
            "record the pose, or give the contact normal with --normal",
            "with-care",
        )
    )
    return "base"


def turn_remark(orientation: Floats, weight: float | None) -> list[Remark]:
    """Say that the orientation changes, where nothing takes the tool's weight off."""
    angle = largest_turn(orientation)
    if weight is not None or angle <= LARGEST_TURN:
        return []
    return [
        Remark(
            "orientation",
            f"the orientation changes by {math.degrees(angle):.0f}°, and with it the part of the "
            "tool's weight that the sensor feels; no weight is given",
            "--tool-weight, such as 1.2N; or keep the tool's orientation",
            "with-care",
            numbers=True,
        )
    ]
