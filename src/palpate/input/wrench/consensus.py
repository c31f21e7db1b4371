"""The largest consensus of a log: the weight, mount, bias and clock that most blocks agree on."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from palpate._core import noise_of
from palpate.input.recordings.units import GRAVITY
from palpate.input.wrench.motion import FlangeMotion
from palpate.input.wrench.payload import Payload
from palpate.method.contact import Delay
from palpate.method.rows import finite_rows, norm, row_norms, typical_step
from palpate.validation import Floats, Integers, Mask

# s of a mean; longer where a log has more blocks
BLOCK = 0.02
MOST_BLOCKS = 3000
# of the consensus: hypotheses, blocks scored, blocks of each
DRAWS = 500
DRAWN = 1000
POINTS = 5
# A block is near another until the tool has moved or turned so far, m and rad: a press that is held
# is one pose, however long. Drawn by time, six holds of 8 s passed for free air.
MOVED = 2e-3
TURNED = 0.02
# s
LONGEST_DELAY = 0.1
DELAY_GRID = 0.01


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
    segment: Integers
    motion: FlangeMotion

    @property
    def time(self) -> Floats:
        """Centre of each block, s."""
        return 0.5 * (self.start + self.stop)

    @property
    def duration(self) -> Floats:
        """Duration of each block, s."""
        return self.stop - self.start

    @property
    def floor(self) -> float:
        """Least tolerance of a consensus, N."""
        return 3.0 * norm(self.noise[:3]) + 0.03

    def motion_before(self, delay: float, columns: int = 20) -> Floats:
        """Return the means of the first columns of the motion some seconds before."""
        return self.motion.mean(self.start - delay, self.stop - delay, columns)

    def tolerance(self, motion: Floats) -> Floats:
        """Return the tolerance of each block for the motion in it, N.

        A clock that is 50 ms off, and the lever of a tool that turns, must not exclude free air.
        """
        turning = row_norms(motion[:, 3:6])
        tolerance: Floats = self.floor + 0.02 * GRAVITY * turning + 0.05 * motion[:, 16]
        return tolerance

    def taken(self, keep: Mask | Integers) -> "Blocks":
        """Return the selected blocks."""
        names = "start", "stop", "wrench", "segment"
        return replace(self, **{name: getattr(self, name)[keep] for name in names})


def blocks_of(
    time: Floats, wrench: Floats, motion: FlangeMotion, zeroed: Floats | None = None
) -> Blocks:
    """Return the means of a wrench, shape (k, 6), inside the motion and between zeroings, s."""
    step = typical_step(time)
    span = min(time[-1], motion.stop) - max(time[0], motion.start)
    size = max(round(max(BLOCK, span / MOST_BLOCKS) / step), 1)
    count = len(time) // size
    times = time[: count * size].reshape(count, size)
    start = times[:, 0] - 0.5 * step
    stop = times[:, -1] + 0.5 * step
    means = wrench[: count * size].reshape(count, size, 6).mean(axis=1)
    borders = np.zeros(0) if zeroed is None else zeroed
    segment = np.searchsorted(borders, start)
    keep = (start - LONGEST_DELAY > motion.start) & (stop + LONGEST_DELAY < motion.stop)
    keep &= finite_rows(means[:, :3]) & (stop - start < 1.5 * size * step)
    keep &= segment == np.searchsorted(borders, stop)
    blocks = Blocks(start, stop, np.nan_to_num(means), np.zeros(6), segment, motion).taken(keep)
    noise = np.array([noise_of(column) for column in wrench.T]) / math.sqrt(size)
    repeated = noise == 0.0  # of a coarse or held force
    noise[repeated] = [noise_of(column) for column in blocks.wrench.T[repeated]]
    noise = np.maximum(noise, 1e-9 + 1e-6 * np.nanpercentile(np.abs(wrench), 99.0, axis=0))
    measured = (blocks.wrench[1:] != blocks.wrench[:-1]).any(axis=0)
    measured[:3] = True
    return replace(blocks, noise=np.where(measured, noise, np.inf))


def fit_weight(g: Floats, f: Floats, weight: Floats) -> tuple[Floats, Floats, Floats]:
    """Fit f = m Qᵀ g + b by weighted Procrustes, for a batch of sets (..., n, 3).

    Q is the identity where gravity does not turn.

    Returns
    -------
    tuple
        m, Q and b.
    """
    total = weight.sum(axis=-1)[..., None]
    mean_g, mean_f = ((weight[..., None] * values).sum(axis=-2) / total for values in (g, f))
    dg = g - mean_g[..., None, :]
    df = f - mean_f[..., None, :]
    moments = np.swapaxes(weight[..., None] * dg, -1, -2) @ df
    energy = (weight * (dg**2).sum(axis=-1)).sum(axis=-1)
    prior = 1e-3 * np.linalg.norm(moments, axis=(-2, -1)) + 1e-12
    u, _, vt = np.linalg.svd(moments + prior[..., None, None] * np.eye(3))
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    q = u @ vt
    mass = np.maximum((q * moments).sum(axis=(-2, -1)) / np.maximum(energy, 1e-12), 0.0)
    return mass, q, mean_f - mass[..., None] * (mean_g[..., None, :] @ q)[..., 0, :]


class Consensus(NamedTuple):
    """The mass, mount, bias of the force and delay that explain the most blocks, and their cost."""

    cost: float
    mass: float
    mount: Floats
    bias: Floats
    delay: float

    def residual(self, blocks: Blocks) -> Floats:
        """Return what weight and bias leave of the force of some blocks, N."""
        g = blocks.motion_before(self.delay, 3)
        rest: Floats = blocks.wrench[:, :3] - self.mass * g @ self.mount - self.bias
        return rest


def largest_consensus(
    blocks: Blocks, known: Payload | None = None, delay: Delay | None = None
) -> Consensus:
    """Return the mass, mount, bias and delay that explain the most blocks.

    Random sample consensus (Fischler & Bolles 1981) with the truncated squares of Torr & Zisserman
    (2000); then a grid of delays, because Gauss–Newton from zero ends in a local minimum.
    """
    random = np.random.default_rng(0)
    clock = 0.0 if delay is None else delay.seconds
    motion = blocks.motion_before(clock)
    rate = row_norms(motion[:, 3:6])
    path = np.cumsum((motion[:, 15] / MOVED + rate / TURNED + 0.05) * blocks.duration)
    drawn = np.unique(np.searchsorted(path, np.linspace(path[0], path[-1], DRAWN)))
    sample = blocks.taken(drawn)
    tolerance = sample.tolerance(motion[drawn])
    g, f = _observe(sample, clock, known)
    picks = random.integers(len(drawn), size=(DRAWS, POINTS))
    if known is None:
        masses, mounts, biases = fit_weight(g[picks], f[picks], np.ones(picks.shape))
    else:
        masses = np.full(DRAWS, known.mass)
        mounts = np.tile(known.mount, (DRAWS, 1, 1))
        biases = (f - known.mass * g @ known.mount)[picks].mean(axis=1)
    squares = _squares(g, f, masses, mounts, biases) / tolerance**2
    costs = np.minimum(squares, 9.0).mean(axis=1)
    k = int(np.argmin(costs))
    best = Consensus(float(costs[k]), float(masses[k]), mounts[k], biases[k], clock)
    grid = np.array([clock])
    if best.mass > 0.0 and delay is None:
        steps = round(LONGEST_DELAY / DELAY_GRID) - 1
        grid = DELAY_GRID * np.arange(-steps, steps + 1)
    return _search_delay(sample, known, best, grid, tolerance)


def _observe(sample: Blocks, delay: float, known: Payload | None) -> tuple[Floats, Floats]:
    """Return the specific force, and the sensor's force less the inertia of a known tool."""
    motion = sample.motion_before(delay, 3 if known is None else 9)
    g = motion[:, :3]
    force = sample.wrench[:, :3]
    if known is None:
        return g, force
    load = known.wrench(g, motion[:, 3:6], motion[:, 6:])[:, :3]
    return g, force - load + known.mass * g @ known.mount


def _search_delay(
    sample: Blocks, known: Payload | None, start: Consensus, grid: Floats, tolerance: Floats
) -> Consensus:
    """Refine a consensus at each delay of a grid by reweighting, and return the best one."""
    observed = [_observe(sample, delay, known) for delay in grid.tolist()]
    g, f = (np.array(column) for column in zip(*observed, strict=True))
    mass = np.full(len(grid), start.mass)
    mount = np.tile(start.mount, (len(grid), 1, 1))
    bias = np.tile(start.bias, (len(grid), 1))

    for _ in range(3):
        inside = (
            np.clip(1.0 - _squares(g, f, mass, mount, bias) / (3.0 * tolerance) ** 2, 0.0, 1.0) ** 2
            + 1e-12
        )
        if known is None:
            mass, mount, bias = fit_weight(g, f, inside)
        else:
            unloaded = inside[:, :, None] * (f - start.mass * g @ start.mount)
            bias = unloaded.sum(axis=1) / inside.sum(axis=1)[:, None]
    costs = np.minimum(np.sqrt(_squares(g, f, mass, mount, bias)) / sample.floor, 10.0).sum(axis=1)
    k = int(np.argmin(costs))
    return Consensus(start.cost, float(mass[k]), mount[k], bias[k], float(grid[k]))


def _squares(g: Floats, f: Floats, mass: Floats, mount: Floats, bias: Floats) -> Floats:
    """Return |f − m Qᵀg − b|² of each block by each hypothesis, N²."""
    # With the blocks along the last axis, sums of three terms run over whole rows.
    weights = np.swapaxes(mass[:, None, None] * mount, 1, 2)
    residual = weights @ np.swapaxes(g, -1, -2)
    residual += bias[:, :, None]
    residual -= np.swapaxes(f, -1, -2)
    squares: Floats = np.square(residual, out=residual).sum(axis=1)
    return squares
