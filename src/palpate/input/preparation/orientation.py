"""The orientation of the tool: the order of its quaternion, its turns, and where the tip is."""

import math
import shlex
from collections.abc import Sequence

import numpy as np

from palpate.errors import RecordingError
from palpate.findings import Check, Finding, Mark
from palpate.input.channels.frames import align_signs
from palpate.input.preparation.surface import find_presses
from palpate.input.wrench.readings import Reading
from palpate.method.contact import Contact
from palpate.method.rows import finite_rows, row_norms, true_runs
from palpate.validation import Floats, Mask

FIRM = 0.1  # fraction of the largest force; an episode with less force is free air
UPRIGHT = math.radians(2.0)  # moves a tip that is 10 cm away by 3.5 mm across and 0.06 mm along
#: A rotation by more than this shifts 3 % of the tool's weight from one axis to another: 0.3 N for
#: a kilogram, a tenth of a soft contact.
LARGEST_TURN = math.radians(2.0)


# The order of a quaternion.


def states_order(orientation: Sequence[str], option: str | None) -> bool:
    """Whether the order of four channels is stated: by an option, or by their letters x to w."""
    pairs = zip(orientation[-1], orientation[0], strict=False)
    differing = [last for last, first in pairs if last != first]
    return "," in (option or "") or "".join(differing).lower() == "w"


def report_order(reading: Reading, evidence: str | None, names: Sequence[str]) -> Finding:
    """Report the order of the quaternion, and the evidence for it."""
    choice = describe_choice(evidence, "w, x, y, z" if reading.scalar_first else "x, y, z, w")
    option = _option_of(names, scalar_first=reading.scalar_first)
    return Check.ORIENTATION.finding(
        f"the recording does not state the order of {', '.join(names)}; {choice}",
        f"pass {option} to confirm",
    )


def describe_choice(evidence: str | None, choice: str) -> str:
    """Describe a choice and the evidence for it."""
    return f"palpate assumes {choice}" if evidence is None else f"by the {evidence} it is {choice}"


def _option_of(names: Sequence[str], *, scalar_first: bool) -> str:
    ordered = (*names[1:], names[0]) if scalar_first else names
    return f"--orientation {shlex.quote(','.join(ordered))}"


def order_in_doubt(source: str, names: Sequence[str]) -> RecordingError:
    """Return the error for quaternions whose order cannot be found."""
    problem = f"the recording does not state the order of {', '.join(names)}, and neither free air "
    scalar_last = _option_of(names, scalar_first=False)
    scalar_first = _option_of(names, scalar_first=True)
    remedy = f"pass {scalar_last} for x, y, z, w, or {scalar_first} for w, x, y, z"
    return RecordingError.of(source, f"{problem}nor contact decides; {remedy}")


# A tool that turns: the pose of a flange, or of a sensor, is not that of the tip.


def largest_turn(orientation: Floats) -> float:
    """Return the largest angle between the orientation and its value halfway, rad."""
    turns = orientation[finite_rows(orientation) & orientation.any(axis=1)]
    if not len(turns):
        return 0.0
    return float(np.percentile(_angle_between(turns, turns[len(turns) // 2]), 99.0))


def report_turning_weight(orientation: Floats, weight: float | None) -> list[Finding]:
    """Warn that the orientation changes while the weight of the tool is not subtracted."""
    angle = largest_turn(orientation)
    if weight is not None or angle <= LARGEST_TURN:
        return []
    problem = (
        f"the orientation changes by {math.degrees(angle):.0f}°, which changes the tool's weight "
        "along each axis of the sensor, and --tool-weight is missing"
    )
    return [
        Check.ORIENTATION.finding(
            problem,
            "pass the weight of the tool, such as --tool-weight 1.2N, or keep its orientation",
            mark="with-care",
        )
    ]


def report_unknown_tip(problem: str, mark: Mark = "trust") -> Finding:
    """Report that the pose is not that of the tip."""
    return Check.ORIENTATION.finding(
        problem,
        "pass --tip-offset x,y,z, from the pose to the tip in its axes, or record its pose",
        mark=mark,
    )


def find_upright(force: Floats, orientation: Floats) -> Mask:
    """Find the runs around each touch in which the tool has the orientation of the touch.

    Parameters
    ----------
    force : numpy.ndarray, shape (k,)
        N, compression positive.
    orientation : numpy.ndarray, shape (k, 4)
        Quaternions.
    """
    pressing = find_firm_presses(force)
    touches = np.flatnonzero(pressing)
    if not touches.size:
        return np.ones(len(force), dtype=bool)
    midway = 0.5 * (touches[1:] + touches[:-1])
    nearest = touches[np.searchsorted(midway, np.arange(len(force)))]
    upright = _angle_between(orientation, orientation[nearest]) < UPRIGHT
    for run in true_runs(upright.copy()):
        upright[run] = pressing[run].any()
    return upright


def find_firm_presses(force: Floats) -> Mask:
    """Find the presses above a tenth of the largest force."""
    peak = float(np.nanpercentile(force, 99.0))
    return find_presses(np.nan_to_num(force), FIRM * peak, peak)


def _angle_between(a: Floats, b: Floats) -> Floats:
    """Return the angles of the rotations between quaternions, rad; q and −q are one rotation."""
    lengths = row_norms(a) * row_norms(b)
    cosine = np.abs((a * b).sum(axis=-1)) / lengths
    angle: Floats = 2.0 * np.arccos(np.minimum(cosine, 1.0))
    return angle


def report_turn(force: Floats, orientation: Floats, upright: Mask) -> list[Finding]:
    """Report a tool that turns in contact: the depth of the flange is not that of the tip."""
    pressing = find_firm_presses(force)
    angle = 0.0
    for run in true_runs(upright):
        if pressing[run].any():
            turns = align_signs(orientation[run][pressing[run]])
            angle = max(angle, float(_angle_between(turns, turns.mean(axis=0)).max()))
    if angle <= UPRIGHT:
        return []
    problem = f"the tool turns by {math.degrees(angle):.0f}° in contact, and the depth is that of "
    return [report_unknown_tip(f"{problem}the pose's origin", "with-care")]


def inertia_share(contact: Contact) -> float:
    """Return the part of a kilogram of the tool in the stiffness, 1/kg.

    In an oscillation of angular frequency speed/depth, mass times its square adds to force/depth.
    """
    pressing = find_firm_presses(contact.force)
    channels = contact.penetration, contact.velocity, contact.force
    depth, speed, force = (float(np.nanstd(channel[pressing])) for channel in channels)
    return speed**2 / (depth * force) if depth * force > 0.0 else 0.0
