"""How to read a log that does not say it: frame and sign of its force, order of its quaternions.

In free air the force of the right reading is the weight of the tool, m Qᵀ g + b, to within the
noise; that of a wrong reading is newtons off.
"""

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.contact import Delay
from palpate.errors import RecordingError
from palpate.findings import Check, Finding, Mark
from palpate.preparation.flange_motion import FlangeMotion
from palpate.preparation.free_air import blocks_of, fit_weight, largest_consensus
from palpate.preparation.payload import Payload
from palpate.preparation.payload_fit import FEWEST_FREE
from palpate.preparation.roles import Roles
from palpate.preparation.settings import ForceFrame
from palpate.recordings import Recording
from palpate.recordings.poses import IN_BASE
from palpate.recordings.units import GRAVITY
from palpate.validation import Floats

SECOND_BEST = 1.5  # times what the best reading leaves; a reading that leaves less may be right
# Share of the log in free air; a smaller one fits by chance, up to so many times better.
ENOUGH, BY_CHANCE = 0.2, 5.0
FREE, FARTHEST = 3.0, 10.0  # tolerances: of free air, and the largest that counts


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read a log.

    Attributes
    ----------
    frame : str
        ``"tool"`` if the sensor turns with the tool, ``"base"`` if its force is in the axes of the
        position.
    scalar_first : bool
        Whether the quaternion is w, x, y, z.
    sign : float
        −1 if the sensor reads the force that the tool exerts, else 1.
    """

    frame: ForceFrame = "tool"
    scalar_first: bool = False
    sign: float = 1.0

    def turn(self, orientation: Floats) -> Floats:
        """Return the quaternions x, y, z, w that turn the force to the axes of the position."""
        if self.frame == "base":
            return np.tile([0.0, 0.0, 0.0, 1.0], (len(orientation), 1))
        return np.roll(orientation, -1, axis=1) if self.scalar_first else orientation


def possible_readings(
    frame: ForceFrame | None, usual: ForceFrame, signs: Sequence[float], *, order_stated: bool
) -> list[Reading]:
    """Return the readings that what is stated allows, the usual one first."""
    base = [] if frame == "tool" else [Reading("base")]
    if frame == "base":
        return base
    tool = [
        Reading("tool", scalar_first, sign)
        for scalar_first in ((False,) if order_stated else (False, True))
        for sign in signs
    ]
    return base + tool if usual == "base" else tool + base


def states_order(orientation: Sequence[str], given: str | None) -> bool:
    """Whether the order of four channels is stated: by an option, or by their letters x to w."""
    first, last = orientation[0], orientation[-1]
    differing = [own for own, other in zip(last, first, strict=False) if own != other]
    return "," in (given or "") or "".join(differing).lower() == "w"


def fitting_readings(
    motions: Mapping[Reading, FlangeMotion],
    time: Floats,
    wrench: Floats,
    *,
    delay: Delay | None = None,
    known: Payload | None = None,
) -> tuple[list[Reading], bool]:
    """Return the readings that fit in free air, and whether there is enough of it to tell.

    Free air is that of the reading that explains most of the log; its delay counts for all. Without
    free air all readings are returned.

    Parameters
    ----------
    motions : mapping
        Motion of the flange by each reading; for a force in the base's axes, of a flange that does
        not turn.
    time, wrench, delay, known
        As in :func:`~palpate.preparation.payload_search.find_payload`.
    """
    fits, costs = {}, dict[Reading, float]()
    for reading, motion in motions.items():
        blocks = blocks_of(time, reading.sign * wrench, motion)
        if len(blocks.start) < FEWEST_FREE:
            return list(motions), False
        fits[reading] = blocks, *largest_consensus(blocks, known, delay)[1:]
    # As of the consensus, but one for all: a flange that does not turn would have a smaller one.
    seen = np.array([blocks.seen(0.0) for blocks, *_ in fits.values()])
    turning, speeding = np.linalg.norm(seen[:, :, 3:6], axis=2).max(axis=0), seen[0, :, 16]
    tolerance = blocks.floor + 0.02 * GRAVITY * turning + 0.05 * speeding
    masks = {}
    for reading, (blocks, mass, mount, bias, late) in fits.items():
        rest = blocks.wrench[:, :3] - mass * blocks.seen(late, 3) @ mount - bias
        sizes = np.linalg.norm(rest, axis=1) / tolerance
        masks[reading] = sizes < FREE
        costs[reading] = float(np.minimum(sizes, FARTHEST).sum())
    best = min(costs, key=costs.__getitem__)
    free, late = masks[best], fits[best][-1]
    if np.count_nonzero(free) < FEWEST_FREE:
        return list(motions), False
    left = dict[Reading, float]()
    for reading, (blocks, *_) in fits.items():
        force, g = blocks.wrench[free, :3], blocks.seen(late, 3)[free]
        if known is None:
            fitted, mount, bias = fit_weight(g, force, np.ones(len(g)))
            load = fitted * g @ mount + bias
        else:
            load = known.mass * g @ known.mount
            load += (force - load).mean(axis=0)
        squares = np.square(force - load).sum(axis=1)
        left[reading] = float(np.sqrt(squares.mean() + (blocks.floor / 3.0) ** 2))
    enough = bool(free.mean() > ENOUGH)
    most = (SECOND_BEST if enough else BY_CHANCE) * min(left.values())
    return [reading for reading, rest in left.items() if rest < most], enough


# The frame that a recording states, and a tool that turns.

#: A rotation by more than this shifts 3 % of the tool's weight from one axis to another: 0.3 N for
#: a kilogram, a tenth of a soft contact.
LARGEST_TURN = math.radians(2.0)


def largest_turn(orientation: Floats) -> float:
    """Return the largest angle between the orientation and its value halfway, rad."""
    known = orientation[np.isfinite(orientation).all(axis=1)]
    length = np.linalg.norm(known, axis=1)
    unit = known[length > 0.0] / length[length > 0.0, None]
    if not len(unit):
        return 0.0
    typical = unit[len(unit) // 2]
    cosine = np.clip(np.abs(unit @ typical), 0.0, 1.0)  # q and −q are one orientation
    return 2.0 * math.acos(float(np.percentile(cosine, 1.0)))


def stated_frame(
    recording: Recording, roles: Roles, asked: ForceFrame | None, findings: list[Finding]
) -> ForceFrame | None:
    """Return the frame of the force: as requested, else from the recording; None if in doubt.

    Assumptions are added to the findings.
    """
    if asked is not None:
        return asked
    if roles.orientation_frame is not None:  # from transforms: the force's frame
        return "tool"
    if IN_BASE.match(roles.force[0]):
        return "base"
    force, depth = (recording.frames.get(names[0]) for names in (roles.force, roles.depth))
    if force is None or depth is None:
        return None if roles.orientation else "base"
    if force.lstrip("/") == depth.lstrip("/"):
        return "base"
    words = f"the force is in the frame {force!r}, the position in {depth!r}"
    if roles.orientation:
        words += ": palpate rotates it by the orientation, assuming it is in the tool's axes"
        remedy = "pass --force-frame base if both frames have the same axes"
        findings.append(Check.FORCE_FRAME.finding(words, remedy))
        return "tool"
    words += ", and there is no orientation to convert one to the other"
    remedy = "record the pose, or pass the contact normal, such as --normal z"
    findings.append(Check.FORCE_FRAME.finding(words, remedy, severity="with-care"))
    return "base"


def report_unknown_tip(words: str, mark: Mark = "trust") -> Finding:
    """Report that the pose is not that of the tip."""
    remedy = "pass --tip-offset x,y,z, from the pose to the tip in its axes, or record its pose"
    return Check.ORIENTATION.finding(words, remedy, mark=mark)


def turn_findings(orientation: Floats, weight: float | None) -> list[Finding]:
    """Warn that the orientation changes while the weight of the tool is not subtracted."""
    angle = largest_turn(orientation)
    if weight is not None or angle <= LARGEST_TURN:
        return []
    words = (
        f"the orientation changes by {math.degrees(angle):.0f}°, which changes the tool's weight "
        "along each axis of the sensor, and --tool-weight is missing"
    )
    remedy = "pass the weight of the tool, such as --tool-weight 1.2N, or keep its orientation"
    return [Check.ORIENTATION.finding(words, remedy, mark="with-care")]


# Sentences on a choice, and the question where there is none.

_FRAMES = {"tool": "the tool", "base": "the position"}


def _words_of(by: str | None, choice: str) -> str:
    return f"palpate assumes {choice}" if by is None else f"by the {by} it is {choice}"


def report_frame(reading: Reading, by: str | None) -> Finding:
    """Report the frame of the force, and the evidence for it."""
    other = "base" if reading.frame == "tool" else "tool"
    words = _words_of(by, f"that of {_FRAMES[reading.frame]}")
    when = "rotates with the tool" if other == "tool" else "does not"
    remedy = f"pass --force-frame {other} if the sensor {when}"
    words = f"the recording does not state the frame of the force; {words}"
    return Check.FORCE_FRAME.finding(words, remedy)


def report_order(reading: Reading, by: str | None, names: Sequence[str]) -> Finding:
    """Report the order of the quaternion, and the evidence for it."""
    words = _words_of(by, "w, x, y, z" if reading.scalar_first else "x, y, z, w")
    words = f"the recording does not state the order of {', '.join(names)}; {words}"
    option = _option_of(reading, names)
    return Check.ORIENTATION.finding(words, f"pass {option} to confirm")


def _option_of(reading: Reading, names: Sequence[str]) -> str:
    ordered = (*names[1:], names[0]) if reading.scalar_first else names
    return f"--orientation {shlex.quote(','.join(ordered))}"


def frame_in_doubt(source: str) -> RecordingError:
    """Return the error for a force whose frame cannot be found."""
    words = "the recording does not state the frame of the force, and neither free air nor contact "
    remedy = "pass --force-frame tool if the sensor rotates with the tool, else --force-frame base"
    return RecordingError.of(source, f"{words}decides; {remedy}")


def order_in_doubt(source: str, names: Sequence[str]) -> RecordingError:
    """Return the error for quaternions whose order cannot be found."""
    words = f"the recording does not state the order of {', '.join(names)}, and neither free air "
    last, first = (_option_of(Reading(scalar_first=each), names) for each in (False, True))
    remedy = f"pass {last} for x, y, z, w, or {first} for w, x, y, z"
    return RecordingError.of(source, f"{words}nor contact decides; {remedy}")
