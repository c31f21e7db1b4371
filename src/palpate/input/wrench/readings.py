"""How to read a wrench that does not say it: frame and sign, and the order of the quaternions.

In free air the force of the right reading is the weight of the tool, m Qᵀ g + b, to within the
noise; that of a wrong reading is newtons off.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from palpate.input.recordings.units import GRAVITY
from palpate.input.wrench.consensus import (
    Blocks,
    Consensus,
    blocks_of,
    fit_weight,
    largest_consensus,
)
from palpate.input.wrench.fit import FEWEST_FREE
from palpate.input.wrench.motion import FlangeMotion
from palpate.input.wrench.payload import Payload
from palpate.method.contact import Delay
from palpate.method.rows import count_true, row_norms
from palpate.method.settings import ForceFrame
from palpate.validation import Floats, Mask, frozen

SECOND_BEST = 1.5  # times what the best reading leaves; a reading that leaves less may be right
# Share of the log in free air; a smaller one fits by chance, up to so many times better.
ENOUGH = 0.2
BY_CHANCE = 5.0
# tolerances: of free air, and the largest that counts
FREE = 3.0
FARTHEST = 10.0


@frozen
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
    frame: ForceFrame | None, default: ForceFrame, signs: Sequence[float], *, order_stated: bool
) -> list[Reading]:
    """Return the readings that what is stated allows, the default one first."""
    base = [] if frame == "tool" else [Reading("base")]
    if frame == "base":
        return base
    orders = (False,) if order_stated else (False, True)
    tool = [Reading("tool", order, sign) for order in orders for sign in signs]
    return base + tool if default == "base" else tool + base


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
        As in :func:`~palpate.input.wrench.search.find_payload`.
    """
    logs = dict[Reading, Blocks]()
    fits = dict[Reading, Consensus]()
    for reading, motion in motions.items():
        blocks = blocks_of(time, reading.sign * wrench, motion)
        if len(blocks.start) < FEWEST_FREE:
            return list(motions), False
        logs[reading] = blocks
        fits[reading] = largest_consensus(blocks, known, delay)
    # As of the consensus, but one for all: a flange that does not turn would have a smaller one.
    moving = np.array([blocks.motion_before(0.0) for blocks in logs.values()])
    turning = row_norms(moving[:, :, 3:6]).max(axis=0)
    tolerance = blocks.floor + 0.02 * GRAVITY * turning + 0.05 * moving[0, :, 16]
    sizes = {
        reading: row_norms(consensus.residual(logs[reading])) / tolerance
        for reading, consensus in fits.items()
    }
    best = min(sizes, key=lambda reading: float(np.minimum(sizes[reading], FARTHEST).sum()))
    free = sizes[best] < FREE
    if count_true(free) < FEWEST_FREE:
        return list(motions), False
    residuals = {
        reading: _residual_in(free, blocks, fits[best].delay, known)
        for reading, blocks in logs.items()
    }
    enough = bool(free.mean() > ENOUGH)
    limit = (SECOND_BEST if enough else BY_CHANCE) * min(residuals.values())
    return [reading for reading, residual in residuals.items() if residual < limit], enough


def _residual_in(free: Mask, blocks: Blocks, delay: float, known: Payload | None) -> float:
    """Return the rms of what weight and bias leave of the force in free air, N."""
    force = blocks.wrench[free, :3]
    g = blocks.motion_before(delay, 3)[free]
    if known is None:
        mass, mount, bias = fit_weight(g, force, np.ones(len(g)))
        load = mass * g @ mount + bias
    else:
        load = known.mass * g @ known.mount
        load += (force - load).mean(axis=0)
    squares = np.square(force - load).sum(axis=1)
    return float(np.sqrt(squares.mean() + (blocks.floor / 3.0) ** 2))
