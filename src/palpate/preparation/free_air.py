"""Free air in a log of a wrist sensor: blocks, consensus, and zeroings of the sensor."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Delay, run_slices
from palpate.preparation.flange_motion import FlangeMotion
from palpate.preparation.payload import Payload
from palpate.preparation.resolution import noise_of
from palpate.recordings.units import GRAVITY
from palpate.validation import Floats

Mask = NDArray[np.bool_]

BLOCK, MOST_BLOCKS = 0.02, 3000  # s of a mean; longer where a log has more blocks
DRAWS, DRAWN, POINTS = 500, 1000, 5  # of the consensus: hypotheses, blocks scored, blocks of each
TOGETHER = 10  # hypotheses that are scored at once
# A block is near another until the tool has moved or turned so far, m and rad: a press that is held
# is one pose, however long. Drawn by time, six holds of 8 s passed for free air.
MOVED, TURNED = 2e-3, 0.02
LONGEST_DELAY, DELAY_GRID = 0.1, 0.01  # s


@dataclass(frozen=True, slots=True, eq=False)
class Zeroing:
    """A zeroing of the sensor: its time, s, and the step of the wrench there, shape (6,)."""

    time: float
    step: Floats


@dataclass(slots=True, eq=False)
class Blocks:
    """Means of the wrench over blocks of samples.

    Attributes
    ----------
    start, stop : numpy.ndarray, shape (k,)
        s.
    wrench : numpy.ndarray, shape (k, 6)
        N and N·m.
    noise : numpy.ndarray, shape (6,)
        Standard deviation of a mean by white noise; infinite without a torque.
    segment : numpy.ndarray of int, shape (k,)
        Number of zeroings of the sensor before the block.
    motion : FlangeMotion
        Motion of the flange.
    """

    start: Floats
    stop: Floats
    wrench: Floats
    noise: Floats
    segment: NDArray[np.int64]
    motion: FlangeMotion

    @property
    def time(self) -> Floats:
        """Centre of each block, s."""
        return 0.5 * (self.start + self.stop)

    @property
    def floor(self) -> float:
        """Least tolerance of a consensus, N."""
        return 3.0 * float(np.linalg.norm(self.noise[:3])) + 0.03

    def seen(self, late: float, columns: int = 20) -> Floats:
        """Return the means of the first columns of the motion some seconds before."""
        return self.motion.mean(self.start - late, self.stop - late, columns)

    def taken(self, keep: Mask | NDArray[np.int64]) -> "Blocks":
        """Return the selected blocks."""
        names = "start", "stop", "wrench", "segment"
        return replace(self, **{name: getattr(self, name)[keep] for name in names})


def blocks_of(
    time: Floats, wrench: Floats, motion: FlangeMotion, zeroed: Sequence[Zeroing] = ()
) -> Blocks:
    """Return the means of a wrench, shape (k, 6), inside the motion and between the zeroings."""
    step = float(np.median(np.diff(time)))
    span = min(time[-1], motion.stop) - max(time[0], motion.start)
    size = max(round(max(BLOCK, span / MOST_BLOCKS) / step), 1)
    count = len(time) // size
    times = time[: count * size].reshape(count, size)
    start, stop = times[:, 0] - 0.5 * step, times[:, -1] + 0.5 * step
    means = wrench[: count * size].reshape(count, size, 6).mean(axis=1)
    times = np.array([each.time for each in zeroed])
    segment = np.searchsorted(times, start)
    keep = (start - LONGEST_DELAY > motion.start) & (stop + LONGEST_DELAY < motion.stop)
    keep &= np.isfinite(means[:, :3]).all(axis=1) & (stop - start < 1.5 * size * step)
    keep &= segment == np.searchsorted(times, stop)
    blocks = Blocks(start, stop, np.nan_to_num(means), np.zeros(6), segment, motion).taken(keep)
    noise = np.array([noise_of(column) for column in wrench.T]) / math.sqrt(size)
    repeated = noise == 0.0  # of a coarse or held force
    noise[repeated] = [noise_of(column) for column in blocks.wrench.T[repeated]]
    noise = np.maximum(noise, 1e-9 + 1e-6 * np.nanpercentile(np.abs(wrench), 99.0, axis=0))
    seen = (blocks.wrench[1:] != blocks.wrench[:-1]).any(axis=0)
    return replace(blocks, noise=np.where((np.arange(6) < 3) | seen, noise, np.inf))


def fit_weight(g: Floats, f: Floats, weight: Floats) -> tuple[Floats, Floats, Floats]:
    """Fit f = m Qᵀ g + b by weighted Procrustes, for a batch of sets (..., n, 3).

    Q is the identity where gravity does not turn.

    Returns
    -------
    tuple
        m, Q and b.
    """
    total = weight.sum(axis=-1)[..., None]
    mean_g, mean_f = ((weight[..., None] * each).sum(axis=-2) / total for each in (g, f))
    dg, df = g - mean_g[..., None, :], f - mean_f[..., None, :]
    moments = np.swapaxes(weight[..., None] * dg, -1, -2) @ df
    energy = (weight * (dg**2).sum(axis=-1)).sum(axis=-1)
    prior = 1e-3 * np.linalg.norm(moments, axis=(-2, -1)) + 1e-12
    u, _, vt = np.linalg.svd(moments + prior[..., None, None] * np.eye(3))
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    q = u @ vt
    mass = np.maximum((q * moments).sum(axis=(-2, -1)) / np.maximum(energy, 1e-12), 0.0)
    return mass, q, mean_f - mass[..., None] * (mean_g[..., None, :] @ q)[..., 0, :]


def largest_consensus(
    blocks: Blocks, known: Payload | None = None, delay: Delay | None = None
) -> tuple[float, float, Floats, Floats, float]:
    """Return a cost, and the mass, mount, bias and delay that explain the most blocks.

    Random sample consensus (Fischler & Bolles 1981) with the truncated squares of Torr & Zisserman
    (2000); then a grid of delays, because Gauss–Newton from zero ends in a local minimum.
    """
    random, floor = np.random.default_rng(0), blocks.floor
    clock = 0.0 if delay is None else delay.seconds
    seen = blocks.seen(clock)
    rate = np.linalg.norm(seen[:, 3:6], axis=1)
    way = np.cumsum((seen[:, 15] / MOVED + rate / TURNED + 0.05) * (blocks.stop - blocks.start))
    few = np.unique(np.searchsorted(way, np.linspace(way[0], way[-1], DRAWN)))
    part, force = blocks.taken(few), blocks.wrench[few, :3]

    def observe(late: float) -> tuple[Floats, Floats]:
        """Specific force and the sensor's, less the inertia of a known tool."""
        seen = part.seen(late, 9)
        g = seen[:, :3]
        if known is None:
            return g, force
        load = known.wrench(g, seen[:, 3:6], seen[:, 6:])[:, :3]
        return g, force - load + known.mass * g @ known.mount

    g, f = observe(clock)
    # A clock that is 50 ms off, and the lever of a tool that turns, must not exclude free air.
    tolerance = floor + 0.02 * GRAVITY * rate[few] + 0.05 * seen[few, 16]
    picks = random.integers(len(few), size=(DRAWS, POINTS))
    if known is None:
        masses, mounts, biases = fit_weight(g[picks], f[picks], np.ones(picks.shape))
    else:
        masses, mounts = np.full(DRAWS, known.mass), np.tile(known.mount, (DRAWS, 1, 1))
        biases = (f - known.mass * g @ known.mount)[picks].mean(axis=1)

    costs = _truncated_squares(g, f, masses, mounts, biases, tolerance)
    k = int(np.argmin(costs))
    mass, mount, bias, cost = float(masses[k]), mounts[k], biases[k], float(costs[k])
    grid = np.array([clock])
    if mass > 0.0 and delay is None:
        steps = round(LONGEST_DELAY / DELAY_GRID) - 1
        grid = DELAY_GRID * np.arange(-steps, steps + 1)
    g, f = (np.array(each) for each in zip(*map(observe, grid.tolist()), strict=True))
    count = len(grid)
    own = np.full(count, mass), np.tile(mount, (count, 1, 1)), np.tile(bias, (count, 1))

    def sizes() -> Floats:
        masses, mounts, biases = own
        rest = f - masses[:, None, None] * g @ mounts - biases[:, None]
        squares: Floats = (rest**2).sum(axis=2)
        return squares

    for _ in range(3):
        inside = np.clip(1.0 - sizes() / (3.0 * tolerance) ** 2, 0.0, 1.0) ** 2 + 1e-12
        if known is None:
            own = fit_weight(g, f, inside)
        else:
            rest = inside[:, :, None] * (f - mass * g @ mount)
            own = *own[:2], rest.sum(axis=1) / inside.sum(axis=1)[:, None]
    best = int(np.argmin(np.minimum(np.sqrt(sizes()) / floor, 10.0).sum(axis=1)))
    return cost, float(own[0][best]), own[1][best], own[2][best], float(grid[best])


def _truncated_squares(
    g: Floats, f: Floats, masses: Floats, mounts: Floats, biases: Floats, tolerance: Floats
) -> Floats:
    """Return the mean of min(|f − m Qᵀg − b|²/tolerance², 9) of each hypothesis.

    The square is linear in products of f and g, so that a product of matrices gives it.
    """
    products = (f[:, :, None] * g[:, None]).reshape(len(f), 9)
    sizes = (f**2).sum(axis=1), (g**2).sum(axis=1), np.ones(len(f))
    features = np.column_stack([products, f, g, *sizes]) / tolerance[:, None] ** 2
    turned = masses[:, None, None] * mounts
    weights = np.column_stack(
        [
            -2.0 * turned.transpose(0, 2, 1).reshape(-1, 9),
            -2.0 * biases,
            2.0 * (turned @ biases[:, :, None])[:, :, 0],
            np.ones(len(masses)),
            masses**2,
            (biases**2).sum(axis=1),
        ]
    ).T
    # In parts, because on a busy machine threads of BLAS wait for each other.
    parts = np.split(weights, range(TOGETHER, weights.shape[1], TOGETHER), axis=1)
    return np.concatenate([np.minimum(features @ part, 9.0).mean(axis=0) for part in parts])


# A sensor that is zeroed during the log: all axes step to zero at once, while the probe moves on.

STEP_WINDOW, STEP_GAP = 0.01, 2  # s of a mean on either side, and samples between the two
STEP_NOISES, LEAST_STEP = 12.0, 0.2  # of the step: standard errors, N
AFTER_STEP = 0.5  # fraction of the force before that may be left after
EXPLAINED = 0.985  # cost of the consensus without the step, over that with it
MOST_ZEROINGS = 3


def zeroings_of(time: Floats, wrench: Floats) -> list[Zeroing]:
    """Return where a wrench may have been zeroed: steps of the force to nearly zero.

    The step is between lines through the means before and after, so that a force that grows is
    none.
    """
    step = float(np.median(np.diff(time)))
    size = max(round(STEP_WINDOW / step), 3)
    reach = 2 * size + STEP_GAP
    if len(time) < 2 * reach + 2:
        return []
    known = np.nan_to_num(wrench)
    sums = np.vstack([np.zeros(known.shape[1]), np.cumsum(known, axis=0)])
    middle = np.arange(reach, len(time) - reach)

    def mean(offset: int) -> Floats:
        first = middle + offset
        means: Floats = (sums[first + size] - sums[first]) / size
        return means

    near, far = mean(-STEP_GAP - size), mean(-STEP_GAP - 2 * size)
    after, later = mean(STEP_GAP), mean(STEP_GAP + size)
    ahead = 0.5 + STEP_GAP / size
    before, behind = near + ahead * (near - far), after - ahead * (later - after)
    steps = behind - before
    noise = np.array([noise_of(column) for column in known.T]) * math.sqrt(2.0 * 5.0 / size)
    force = np.linalg.norm(steps[:, :3], axis=1)
    large = force > np.maximum(STEP_NOISES * np.linalg.norm(noise[:3]), LEAST_STEP)
    large &= np.linalg.norm(behind[:, :3], axis=1) < AFTER_STEP * force
    found: list[Zeroing] = []
    for run in run_slices(large):
        if large[run.start]:
            k = run.start + int(np.argmax(force[run]))
            found.append(Zeroing(float(time[middle[k]]), steps[k]))
    found.sort(key=lambda each: -float(np.linalg.norm(each.step[:3])))
    return sorted(found[:MOST_ZEROINGS], key=lambda each: each.time)


def without_zeroings(time: Floats, wrench: Floats, zeroed: Sequence[Zeroing]) -> Floats:
    """Return the wrench without the steps; unknown next to them."""
    wrench, near = wrench.copy(), (STEP_GAP + 0.5) * float(np.median(np.diff(time)))
    for each in zeroed:
        wrench[time >= each.time] -= each.step[: wrench.shape[1]]
        wrench[np.abs(time - each.time) < near] = np.nan
    return wrench


def remove_zeroings(
    time: Floats,
    wrench: Floats,
    blocks: Blocks,
    known: Payload | None,
    delay: Delay | None,
) -> tuple[Blocks, list[Zeroing]]:
    """Take out the steps after which one payload explains more of the log."""
    zeroed: list[Zeroing] = []
    candidates = zeroings_of(time, wrench)
    cost = largest_consensus(blocks, known, delay)[0] if candidates else 0.0
    for each in candidates:
        trial = sorted([*zeroed, each], key=lambda zeroing: zeroing.time)
        cut = blocks_of(time, without_zeroings(time, wrench, trial), blocks.motion, trial)
        less = largest_consensus(cut, known, delay)[0]
        if less < EXPLAINED * cost:
            zeroed, cost, blocks = trial, less, cut
    return blocks, zeroed
