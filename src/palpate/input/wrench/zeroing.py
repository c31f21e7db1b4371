"""A sensor that is zeroed during the log: all axes step to zero at once, while the probe moves."""

import math
from collections.abc import Sequence

import numpy as np

from palpate._core import noise_of
from palpate.input.wrench.consensus import Blocks, blocks_of, largest_consensus
from palpate.input.wrench.payload import Payload
from palpate.method.contact import Delay
from palpate.method.rows import norm, row_norms, true_runs, typical_step
from palpate.validation import Floats, frozen

# s of a mean on either side, and samples between the two
STEP_WINDOW = 0.01
STEP_GAP = 2
# of the step: standard errors, N
STEP_NOISES = 12.0
LEAST_STEP = 0.2
AFTER_STEP = 0.5  # fraction of the force before that may be left after
EXPLAINED = 0.985  # cost of the consensus without the step, over that with it
MOST_ZEROINGS = 3


@frozen(eq=False)
class Zeroing:
    """A zeroing of the sensor: its time, s, and the step of the wrench there, shape (6,)."""

    time: float
    step: Floats

    @property
    def size(self) -> float:
        """Size of the step of the force, N."""
        return norm(self.step[:3])


def find_zeroings(time: Floats, wrench: Floats) -> list[Zeroing]:
    """Return where a wrench may have been zeroed: steps of the force to nearly zero.

    The step is between lines through the means before and after, so that a force that grows is
    none.
    """
    step = typical_step(time)
    size = max(round(STEP_WINDOW / step), 3)
    reach = 2 * size + STEP_GAP
    if len(time) < 2 * reach + 2:
        return []
    finite = np.nan_to_num(wrench)
    sums = np.vstack([np.zeros(finite.shape[1]), np.cumsum(finite, axis=0)])
    middle = np.arange(reach, len(time) - reach)

    def mean(offset: int) -> Floats:
        start = middle + offset
        means: Floats = (sums[start + size] - sums[start]) / size
        return means

    ahead = 0.5 + STEP_GAP / size
    last = mean(-STEP_GAP - size)
    arriving = last + ahead * (last - mean(-STEP_GAP - 2 * size))
    next_mean = mean(STEP_GAP)
    leaving = next_mean - ahead * (mean(STEP_GAP + size) - next_mean)
    steps = leaving - arriving
    noise = np.array([noise_of(column) for column in finite.T]) * math.sqrt(2.0 * 5.0 / size)
    force = row_norms(steps[:, :3])
    large = force > np.maximum(STEP_NOISES * norm(noise[:3]), LEAST_STEP)
    large &= row_norms(leaving[:, :3]) < AFTER_STEP * force
    zeroings = list[Zeroing]()
    for run in true_runs(large):
        k = run.start + int(np.argmax(force[run]))
        zeroings.append(Zeroing(float(time[middle[k]]), steps[k]))
    largest = sorted(zeroings, key=lambda zeroing: -zeroing.size)[:MOST_ZEROINGS]
    return sorted(largest, key=lambda zeroing: zeroing.time)


def without_zeroings(time: Floats, wrench: Floats, zeroed: Sequence[Zeroing]) -> Floats:
    """Return the wrench without the steps; unknown next to them."""
    wrench = wrench.copy()
    reach = (STEP_GAP + 0.5) * typical_step(time)
    for zeroing in zeroed:
        wrench[time >= zeroing.time] -= zeroing.step[: wrench.shape[1]]
        wrench[np.abs(time - zeroing.time) < reach] = np.nan
    return wrench


def remove_zeroings(
    time: Floats,
    wrench: Floats,
    blocks: Blocks,
    known: Payload | None,
    delay: Delay | None,
) -> tuple[Blocks, list[Zeroing]]:
    """Take out the steps after which one payload explains more of the log."""
    zeroed = list[Zeroing]()
    candidates = find_zeroings(time, wrench)
    cost = largest_consensus(blocks, known, delay).cost if candidates else 0.0
    for candidate in candidates:
        trial = sorted([*zeroed, candidate], key=lambda zeroing: zeroing.time)
        times = np.array([zeroing.time for zeroing in trial])
        cut = blocks_of(time, without_zeroings(time, wrench, trial), blocks.motion, times)
        trial_cost = largest_consensus(cut, known, delay).cost
        if trial_cost < EXPLAINED * cost:
            zeroed = trial
            cost = trial_cost
            blocks = cut
    return blocks, zeroed
