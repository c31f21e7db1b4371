"""Finding the payload of a wrist sensor in a log: free air, weight, mount, zero and clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.contact import run_slices
from palpate.digits import with_error
from palpate.errors import RecordingError
from palpate.estimators.least_squares import long_run_covariance
from palpate.findings import MARKS, Check, Finding, Mark
from palpate.preparation.flange_motion import FlangeMotion
from palpate.preparation.payload import GRAVITY, Payload
from palpate.preparation.resolution import noise_of
from palpate.validation import Floats

Mask = NDArray[np.bool_]

BLOCK, MOST_BLOCKS = 0.02, 3000  # s of a mean; longer where a log has more blocks
SLOW = 0.2  # s of the filter of the motion in free air: noise of α would bias lever and mass
DRAWS, DRAWN, POINTS = 500, 1000, 5  # of the consensus: hypotheses, blocks scored, blocks of each
# A block is near another until the tool has moved or turned so far, m and rad: a press that is held
# is one pose, however long. Drawn by time, six holds of 8 s passed for free air.
MOVED, TURNED = 2e-3, 0.02
LONGEST_DELAY, DELAY_GRID, SHIFT = 0.1, 0.01, 0.005  # s
CUT = 6.0  # of Tukey's weight, in scales
ROUNDS, FIRST_ROUNDS, CONVERGED = 14, 4, 0.05  # Gauss–Newton steps; standard errors
SHORTEST_FREE, MARGIN = 0.16, 0.04  # s of a run in free air, and excluded at each end
FEWEST_FREE = 50  # blocks
KNOT, MOST_KNOTS = 5.0, 40  # s between the knots of the bias; farther apart in a long log
CHUNK = 64  # rows
WANDER = np.repeat([0.025, 1e-3], 3)  # N, N·m: expected change of the bias from knot to knot
LEAST_TURN = 0.03  # standard deviation of the direction of gravity about an axis, rad
RETARE, RETARE_BLOCKS = 3.0, 10.0  # s of the local mean, and blocks that draw it to zero
FILTER_ERROR = 3e-4  # of the mass, by what the filter of the motion attenuates
FIXED = 1e-9  # standard deviation of a known value
# Columns of the fit: mass, m c, inertia, m d, mount, delay.
MASS, ARM, TENSOR, LEVER, MOUNT, CLOCK = (
    0,
    slice(1, 4),
    slice(4, 10),
    slice(10, 13),
    slice(13, 16),
    16,
)
SIZE = 17
OF_MOUNT, EVERYTHING = range(13, 16), range(16)  # columns to fix


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


@dataclass(slots=True, eq=False)
class PayloadFit:
    """A payload, and what it was found from.

    Attributes
    ----------
    payload : Payload
        The payload.
    blocks : Blocks
        Means of the wrench times the sign of the payload, without the steps of zeroing.
    free : numpy.ndarray of bool, shape (k,)
        Blocks in free air.
    scale : float
        Residual of the force in free air, over the white noise of a block.
    zeroed : sequence of Zeroing
        When the sensor was zeroed.
    """

    payload: Payload
    blocks: Blocks
    free: Mask
    scale: float
    zeroed: Sequence[Zeroing]

    @property
    def scatter(self) -> float:
        """Residual in free air, over the tolerance of a consensus and 1 % of the weight."""
        tolerable = self.blocks.floor + 0.01 * GRAVITY * self.payload.mass
        return self.scale * float(self.blocks.noise[:3].max()) / tolerable


def skew(vectors: Floats) -> Floats:
    """Return the matrices v× of vectors, shape (k, 3, 3)."""
    crossed: Floats = -np.cross(vectors[..., None, :], np.eye(3))
    return crossed


def rotation(vector: Floats) -> Floats:
    """Return the rotation matrix of a rotation vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    cross = skew(vector)
    first, second = np.sinc(angle / math.pi), 0.5 * np.sinc(0.5 * angle / math.pi) ** 2
    turned: Floats = np.eye(3) + first * cross + second * cross @ cross
    return turned


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
    blocks: Blocks, known: Payload | None = None, delay: tuple[float, float] | None = None
) -> tuple[float, float, Floats, Floats, float]:
    """Return a cost, and the mass, mount, bias and delay that explain the most blocks.

    Random sample consensus (Fischler & Bolles 1981) with the truncated squares of Torr & Zisserman
    (2000); then a grid of delays, because Gauss–Newton from zero ends in a local minimum.
    """
    random, floor = np.random.default_rng(0), blocks.floor
    clock = 0.0 if delay is None else delay[0]
    seen = blocks.seen(clock)
    rate = np.linalg.norm(seen[:, 3:6], axis=1)
    way = np.cumsum((seen[:, 15] / MOVED + rate / TURNED + 0.05) * (blocks.stop - blocks.start))
    few = np.unique(np.searchsorted(way, np.linspace(way[0], way[-1], DRAWN)))
    part, f, g = blocks.taken(few), blocks.wrench[few, :3], seen[few, :3]
    # A clock that is 50 ms off, and the lever of a tool that turns, must not exclude free air.
    tolerance = floor + 0.02 * GRAVITY * rate[few] + 0.05 * seen[few, 16]
    picks = random.integers(len(few), size=(DRAWS, POINTS))
    if known is None:
        masses, mounts, biases = fit_weight(g[picks], f[picks], np.ones(picks.shape))
    else:
        masses, mounts = np.full(DRAWS, known.mass), np.tile(known.mount, (DRAWS, 1, 1))
        biases = (f - known.mass * g @ known.mount)[picks].mean(axis=1)

    def squares(g: Floats, mass: float, mount: Floats, bias: Floats) -> Floats:
        total: Floats = ((f - mass * g @ mount - bias) ** 2).sum(axis=1)
        return total

    trials = list(zip(masses.tolist(), mounts, biases, strict=True))
    costs = [np.minimum(squares(g, *each) / tolerance**2, 9.0).mean() for each in trials]
    best, cost = trials[int(np.argmin(costs))], float(min(costs))

    def refit(late: float) -> tuple[float, tuple[float, Floats, Floats], float]:
        g, own = part.seen(late, 3), best
        for _ in range(3):
            inside = np.clip(1.0 - squares(g, *own) / (3.0 * tolerance) ** 2, 0.0, 1.0) ** 2 + 1e-12
            if known is None:
                mass, mount, bias = fit_weight(g, f, inside)
            else:
                mass, mount = best[:2]
                bias = inside @ (f - mass * g @ mount) / inside.sum()
            own = float(mass), mount, bias
        rest = np.minimum(np.sqrt(squares(g, *own)) / floor, 10.0)
        return float(rest.sum()), own, late

    if best[0] == 0.0 or delay is not None:
        return cost, *refit(clock)[1], clock
    steps = round(LONGEST_DELAY / DELAY_GRID) - 1
    grid = (DELAY_GRID * np.arange(-steps, steps + 1)).tolist()
    _, own, late = min(map(refit, grid), key=lambda each: each[0])
    return cost, *own, late


def regressors(seen: Floats, mount: Floats) -> tuple[Floats, Floats]:
    """Return force and torque by mass, m c, inertia and m d, shapes (k, 3, 13), sensor's axes."""
    g, w, a = (seen[:, 3 * k : 3 * k + 3] @ mount for k in range(3))
    xx, yy, zz, xy, xz, yz = seen[:, 9:15].T
    products = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    products = mount.T @ products @ mount
    # ω×ω× = ωωᵀ − |ω|² 1
    turning = skew(a) + products - np.trace(products, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    none = np.zeros((len(g), 3, 6))
    force = np.concatenate([g[:, :, None], -turning, none, -turning], axis=2)

    def of_inertia(u: Floats) -> Floats:
        """I u by xx, yy, zz, xy, xz, yz."""
        x, y, z = u.T
        o = np.zeros_like(x)
        rows = (x, o, o, y, z, o), (o, y, o, x, o, z), (o, o, z, o, x, y)
        return np.stack([np.stack(row, -1) for row in rows], axis=1)

    inertia = of_inertia(a) + skew(w) @ of_inertia(w)
    torque = np.concatenate([none[:, :, :1], -skew(g), -inertia, none[:, :, :3]], axis=2)
    return force, torque


def hats(time: Floats, segment: NDArray[np.int64]) -> tuple[Floats, Floats, Floats]:
    """Return the linear bias between knots: its columns, its knots, and differences as rows."""
    spacing, columns, times = max(KNOT, (time[-1] - time[0]) / MOST_KNOTS), [], []
    for part in run_slices(segment):
        start, stop = time[part.start], time[part.stop - 1]
        knots = np.linspace(start, stop, max(math.ceil((stop - start) / spacing), 1) + 1)
        own = np.zeros((len(knots), len(time)))
        own[:, part] = [np.interp(time[part], knots, each) for each in np.eye(len(knots))]
        columns.append(own)
        times.append(knots)
    borders = np.cumsum([len(each) for each in times])
    differences = np.delete(np.diff(np.eye(borders[-1]), axis=0), borders[:-1] - 1, axis=0)
    return np.vstack(columns).T, np.concatenate(times), differences


def opened(mask: Mask, least: int, margin: int) -> Mask:
    """Return the runs of at least so many blocks, without a margin at each end."""
    wide = np.zeros(len(mask), dtype=bool)
    for run in run_slices(mask):
        if mask[run.start] and run.stop - run.start >= least:
            wide[run.start + margin : run.stop - margin] = True
    return wide


@dataclass(slots=True, eq=False)
class _Free:
    """One linearization of the fit, with a column for each axis of the wrench."""

    rest: Floats  # (k, 6)
    jacobian: Floats  # (k, 6, SIZE)
    columns: Floats  # (k, knots), of the bias
    weight: Floats  # (k, 6), Tukey's over the variance

    def solve(
        self, prior: Floats, pull: Floats, ties: Sequence[Floats], drift: Floats
    ) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Solve the normal equations; the bias of each axis is eliminated first.

        Parameters
        ----------
        prior, pull : numpy.ndarray, shape (SIZE,)
            Precision of the prior of each parameter, and its part of the slope.
        ties : sequence of numpy.ndarray
            Precision of the prior of each bias.
        drift : numpy.ndarray, shape (knots, 6)
            The biases.

        Returns
        -------
        tuple
            The moves of parameters and biases, the covariance of the parameters for white noise,
            the move of the biases by that of the parameters, shape (6, knots, SIZE), and the
            variances of the mean biases for known parameters.
        """
        normal, slope = np.diag(prior), pull.copy()
        couplings, moves, variances = [], [], []
        mean = np.full(len(drift), 1.0 / len(drift))
        for k, tie in enumerate(ties):
            x = np.hstack([self.jacobian[:, k], self.columns, self.rest[:, k, None]])
            # In chunks, because on a busy machine threads of BLAS wait for each other.
            chunks = np.zeros((-(-len(x) // CHUNK), CHUNK, x.shape[1]))
            weighted = np.zeros_like(chunks)
            chunks.reshape(-1, x.shape[1])[: len(x)] = x
            weighted.reshape(-1, x.shape[1])[: len(x)] = self.weight[:, k, None] * x
            products = (weighted.transpose(0, 2, 1) @ chunks).sum(axis=0)
            both, own = products[:SIZE, SIZE:-1], products[SIZE:-1, SIZE:-1] + tie
            right = np.column_stack([both.T, products[SIZE:-1, -1] - tie @ drift[:, k], mean])
            solved = np.linalg.solve(own, right)
            couplings.append(solved[:, :SIZE])
            moves.append(solved[:, SIZE])
            variances.append(mean @ solved[:, -1])
            normal += products[:SIZE, :SIZE] - both @ solved[:, :SIZE]
            slope += products[:SIZE, -1] - both @ solved[:, SIZE]
        unit = 1.0 / np.sqrt(np.diag(normal))
        inverse = np.linalg.inv(normal * unit * unit[:, None]) * unit * unit[:, None]
        move, coupling = inverse @ slope, np.array(couplings)
        moved = (np.array(moves) - coupling @ move).T
        return move, moved, inverse, coupling, np.array(variances)

    def covariance(self, inverse: Floats, coupling: Floats, used: Mask) -> Floats:
        """Return the covariance of the parameters, with the correlation of the residuals."""
        covariance = np.zeros((SIZE, SIZE))
        for k in range(6):
            weight = self.weight[used, k, None]
            scores = weight * (self.jacobian[used, k] - self.columns[used] @ coupling[k]) @ inverse
            if weight.any():
                covariance += long_run_covariance(
                    scores, self.rest[used, k], (), self.columns.shape[1]
                )
        # Few turns do not show all of the wander, which the prior of the bias allows for.
        error = np.sqrt(np.diag(covariance) + 1e-300)
        inflation = np.maximum(1.0, np.sqrt(np.diag(inverse)) / error)
        widened: Floats = covariance * inflation * inflation[:, None]
        return widened


def fit_payload(
    blocks: Blocks,
    *,
    known: Payload | None = None,
    fixed: Sequence[int] = (),
    delay: tuple[float, float] | None = None,
) -> tuple[Payload, Mask, float]:
    """Find payload, mount, bias and clock from the free air of a log.

    Gauss–Newton with Tukey's weights from the largest consensus; the standard errors allow for the
    correlation of the residuals.

    Parameters
    ----------
    blocks : Blocks
        Means of the wrench.
    known : Payload, optional
        Known values of the ``fixed`` columns; its mass and mount also begin the search.
    fixed : sequence of int
        Columns that are known.
    delay : tuple of float, optional
        Delay of the wrench and its standard error, s, if they are known.

    Returns
    -------
    tuple
        The payload without marks, the mask of the blocks in free air, and the scale of
        :class:`PayloadFit`.
    """
    noise, floor = blocks.noise, blocks.floor
    span = float(np.median(blocks.stop - blocks.start))
    _, mass, mount, bias, clock = largest_consensus(blocks, known, delay)
    columns, knots, changes = hats(blocks.time, blocks.segment)
    count, wander = columns.shape[1], WANDER * math.sqrt((knots[1] - knots[0]) / KNOT)
    expected, spread = _prior(known, fixed, delay, mass)
    theta = np.where(spread < FIXED * 1.1, expected, 0.0)
    theta[MASS], theta[CLOCK] = mass, clock
    drift = np.tile(np.concatenate([bias, np.median(blocks.wrench[:, 3:], axis=0)]), (count, 1))
    seen = blocks.seen(clock)
    rest = blocks.wrench[:, :3] - mass * seen[:, :3] @ mount - bias
    allowed = floor + 0.02 * GRAVITY * np.linalg.norm(seen[:, 3:6], axis=1) + 0.05 * seen[:, 16]
    free = np.linalg.norm(rest, axis=1) < 2.0 * allowed
    scale = np.maximum(1.0, np.repeat([floor / math.sqrt(3.0), 0.02], 3) / noise)
    if mass == 0.0:  # nothing turns: inertia alone may tell the mass, from farther off
        scale *= 4.0
    least, margin = (math.ceil(each / span - 1e-6) for each in (SHORTEST_FREE, MARGIN))
    tie = changes.T @ changes
    ties = [tie / each**2 + 1e-8 * np.eye(count) for each in wander]
    for step in range(ROUNDS):
        fit = _linearized(blocks, columns, theta, mount, drift)
        sigma = noise * scale
        sizes = [
            np.linalg.norm(fit.rest[:, axes] / sigma[axes], axis=1) / math.sqrt(3.0) / cut
            for axes, cut in ((slice(0, 3), CUT), (slice(3, 6), 4.0 * CUT))
        ]
        inside = free & (sizes[0] < 1.0) & (sizes[1] < 1.0)
        tukey = [np.where(inside, (1.0 - size**2) ** 2, 0.0) for size in sizes]
        fit.weight = np.repeat(np.column_stack(tukey), 3, axis=1) / sigma**2
        pull = (expected - theta) / spread**2
        move, moved, inverse, coupling, variances = fit.solve(spread**-2, pull, ties, drift)
        move[MOUNT] *= min(1.0, 0.3 / max(float(np.linalg.norm(move[MOUNT])), 1e-300))
        move[CLOCK] = np.clip(move[CLOCK], -0.03, 0.03)
        theta = theta + move
        theta[CLOCK] = np.clip(theta[CLOCK], -LONGEST_DELAY, LONGEST_DELAY)
        mount, drift = mount @ rotation(move[MOUNT]), drift + moved
        used = tukey[0] > 0.3
        if np.count_nonzero(used) > FEWEST_FREE:  # growing, it would take contact for free air
            deviation = 1.4826 * np.median(np.abs(fit.rest[used]), axis=0) / noise
            scale = np.minimum(np.maximum(np.maximum(1.0, deviation), 0.5 * scale), scale)
        if step >= FIRST_ROUNDS:
            before, free = free, opened(sizes[0] < 1.0, max(least, 3), max(margin, 1))
            if (free == before).all() and (move**2 < CONVERGED**2 * np.diag(inverse)).all():
                break
    covariance = fit.covariance(inverse, coupling, inside)
    means = coupling.mean(axis=1)
    variances += np.einsum("ki,ij,kj->k", means, covariance, means)
    found = _payload_of(theta, mount, covariance, blocks, inside, knots, drift)
    return replace(found, bias_error=np.sqrt(variances)), inside, float(scale[:3].max())


def _prior(
    known: Payload | None, fixed: Sequence[int], delay: tuple[float, float] | None, mass: float
) -> tuple[Floats, Floats]:
    """Return the expected values of the payload and their standard deviations."""
    heavy, expected = max(mass, 0.05), np.zeros(SIZE)
    sizes = 10.0, 1.0, 0.02 * heavy, 0.1 * heavy, math.pi, LONGEST_DELAY
    spread = np.repeat(sizes, (1, 3, 6, 3, 3, 1))
    if known is not None:
        tensor = np.zeros(6) if known.inertia is None else known.inertia
        arms = known.mass * known.centre, tensor, known.mass * known.lever
        expected[: MOUNT.start] = np.concatenate([[known.mass], *arms])
        spread[list(fixed)] = FIXED
        expected[spread != FIXED] = 0.0
    if delay is not None:
        expected[CLOCK], spread[CLOCK] = delay[0], max(delay[1], 1e-6)
    return expected, spread


def _linearized(
    blocks: Blocks,
    columns: Floats,
    theta: Floats,
    mount: Floats,
    drift: Floats,
) -> _Free:
    """Return residuals and their negative slopes by payload, mount and delay."""
    seen = blocks.seen(theta[CLOCK])
    ahead, behind = (blocks.seen(theta[CLOCK] - t, 3) for t in (SHIFT, -SHIFT))
    rate = (ahead - behind) / (2.0 * SHIFT) @ mount
    by_force, by_torque = regressors(seen, mount)
    model = np.hstack([by_force @ theta[:13], by_torque @ theta[:13]])
    # A mount turned further by φ changes g to g + g × φ.
    by_mount = skew(seen[:, :3] @ mount)
    force = [by_force, theta[MASS] * by_mount, -theta[MASS] * rate[:, :, None]]
    cross = -np.cross(theta[ARM], rate)[:, :, None]
    torque = [by_torque, skew(theta[ARM]) @ by_mount, cross]
    jacobian = np.concatenate([np.concatenate(each, axis=2) for each in (force, torque)], axis=1)
    rest = blocks.wrench - model - columns @ drift
    return _Free(rest, jacobian, columns, np.zeros_like(rest))


def _payload_of(
    theta: Floats,
    mount: Floats,
    covariance: Floats,
    blocks: Blocks,
    free: Mask,
    knots: Floats,
    drift: Floats,
) -> Payload:
    """Return the payload of the parameters, with standard errors and what it was found from."""
    mass, error = float(theta[MASS]), np.sqrt(np.diag(covariance))
    heavy = max(mass, 1e-9)
    arms = []
    for own in (ARM, LEVER):
        slopes = np.zeros((3, SIZE))
        slopes[:, own], slopes[:, MASS] = np.eye(3) / heavy, -theta[own] / heavy**2
        arms.append(np.sqrt(np.diag(slopes @ covariance @ slopes.T)))
    around, axes = _turns(blocks.seen(theta[CLOCK])[free, 17:]) if free.any() else (0.0, 0)
    bias = drift.mean(axis=0)
    span = blocks.stop - blocks.start
    return Payload(
        mass,
        theta[ARM] / heavy,
        mount,
        bias,
        inertia=theta[TENSOR],
        lever=theta[LEVER] / heavy,
        delay=float(theta[CLOCK]),
        bias_times=knots,
        bias_changes=drift - bias,
        mass_error=math.hypot(error[MASS], FILTER_ERROR * mass),
        centre_error=arms[0],
        mount_error=error[MOUNT],
        lever_error=arms[1],
        inertia_error=error[TENSOR],
        delay_error=float(error[CLOCK]),
        turn=around,
        axes=axes,
        free_share=float(np.mean(free)),
        free_time=float(span[free].sum()),
    )


def _turns(directions: Floats) -> tuple[float, int]:
    """Return the largest angle between directions, rad, and about how many axes they turn."""
    far = directions[int(np.argmin(directions @ directions.mean(axis=0)))]
    largest = math.acos(float(np.clip((directions @ far).min(), -1.0, 1.0)))
    # Turns about one axis keep gravity in a plane.
    spread = np.linalg.svd(directions, compute_uv=False) / math.sqrt(len(directions))
    return largest, int(np.count_nonzero(spread[1:] > LEAST_TURN))


# A sensor that is zeroed during the log: all axes step to zero at once, while the probe moves on.

STEP_WINDOW, STEP_GAP = 0.01, 2  # s of a mean on either side, and samples between the two
STEP_NOISES, LEAST_STEP = 12.0, 0.2  # of the step: standard errors, N
AFTER_STEP = 0.5  # fraction of the force before that may be left after
EXPLAINED = 0.9  # cost of the consensus without the step, over that with it
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


# The whole search: signs, zeroings, and what to do where a part is not identified.

LEAST_FREE, LEAST_FREE_TIME = 0.05, 1.0  # fraction of the log, s
MASS_ERRORS = 0.01, 0.05  # relative standard errors: trust, with care
MOUNT_ERRORS = math.radians(0.5), math.radians(2.0)
DELAY_ERRORS = 0.5e-3, 2e-3  # s
SCATTERS = 1.0, 5.0  # residual in free air over what is tolerable: trust, with care
FEW_FREE, FITS = 0.2, 3.0  # share and scale of a log whose sign is in doubt
NO_TURN = math.radians(2.0)  # shifts 3 % of the weight from one axis to another
TURN_MORE = "turn the tool by 30° about two axes in free air, or pass --payload of a log that does"
UNKNOWN_TOOL = Payload(0.0, np.zeros(3), np.eye(3), np.zeros(6))


def find_payload(
    motion: FlangeMotion,
    time: Floats,
    wrench: Floats,
    *,
    delay: tuple[float, float] | None = None,
    known: Payload | None = None,
    weight: float | None = None,
    source: str = "",
) -> PayloadFit | None:
    """Find the payload of a log, with the sign of its wrench and the zeroings of its sensor.

    Where the log does not identify the mass, the payload has none: then its bias is the mean wrench
    in the axes of the sensor. Where it does not identify the mount, the axes are those of the pose.

    Parameters
    ----------
    motion : FlangeMotion
        Motion of the flange, filtered over 0.2 s.
    time, wrench : numpy.ndarray, shapes (k,) and (k, 6)
        s, N and N·m, as recorded; a torque of NaN is ignored.
    delay : tuple of float, optional
        Delay of the wrench and its standard error, s.
    known : Payload, optional
        Tool and mount; then only bias and clock are found.
    weight : float, optional
        Weight of the tool, N, for a log that does not identify it.
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
    blocks = blocks_of(time, wrench, motion)
    if len(blocks.start) < FEWEST_FREE:
        return None
    if weight and _turns(motion.values[:, 17:])[0] < NO_TURN:
        raise idle_weight(weight, source)
    blocks, zeroed = _without_zeroings(time, wrench, blocks, known, delay)
    if known is not None:
        if delay is None and known.delay_error < DELAY_ERRORS[1]:
            delay = known.delay, max(known.delay_error, 1e-3)
        found = _fit_signed(blocks, zeroed, known, EVERYTHING, delay, (known.sign,))
        names = "mass_error", "centre_error", "mount_error", "lever_error"
        errors = {name: np.nan_to_num(getattr(known, name)) for name in names}
        found = replace(found, payload=replace(found.payload, **errors))
        return found if _is_free(found) else None
    found = _fit_signed(blocks, zeroed, None, (), delay, (1.0, -1.0))
    own = found.payload
    if _is_free(found) and own.mass_error <= MASS_ERRORS[1] * own.mass:
        if weight is not None:
            _check_weight(own, weight, source)
        if own.mount_error.max() > MOUNT_ERRORS[1]:
            aligned = replace(own, mount=np.eye(3))
            other = _fit_signed(blocks, zeroed, aligned, OF_MOUNT, delay, (own.sign,))
            found = other if other.scale < 1.5 * found.scale else found
    else:
        fixed: Sequence[int] = EVERYTHING
        tool = UNKNOWN_TOOL
        if weight:
            tool, fixed = replace(tool, mass=weight / GRAVITY), (MASS, *OF_MOUNT)
        found = _fit_signed(blocks, zeroed, tool, fixed, delay, (1.0,))
        if not _is_free(found):
            return None
        turn = replace(found.payload, mass_error=own.mass_error, mount_error=own.mount_error)
        found = replace(found, payload=turn)
    late = found.payload.delay_error
    if delay is None and not late <= DELAY_ERRORS[1]:
        found = replace(found, payload=replace(found.payload, delay=0.0, delay_error=late))
    return found


def _is_free(fit: PayloadFit) -> bool:
    own = fit.payload
    enough = own.free_share > LEAST_FREE and own.free_time > LEAST_FREE_TIME
    return enough and fit.scatter < SCATTERS[1]


def _fit_signed(
    blocks: Blocks,
    zeroed: Sequence[Zeroing],
    known: Payload | None,
    fixed: Sequence[int],
    delay: tuple[float, float] | None,
    signs: Sequence[float],
) -> PayloadFit:
    """Fit with the sign that explains more blocks; in doubt with the first."""
    best: PayloadFit | None = None
    for sign in signs:
        signed = replace(blocks, wrench=sign * blocks.wrench)
        own, free, scale = fit_payload(signed, known=known, fixed=fixed, delay=delay)
        fit = PayloadFit(replace(own, sign=sign), signed, free, scale, zeroed)
        if best is not None:
            more = fit.payload.free_share - best.payload.free_share
            if more < 0.02 and (more < -0.02 or scale > 0.7 * best.scale):
                continue
        best = fit
        if own.mass > 0.0 and own.free_share > FEW_FREE and scale < FITS:
            break
    assert best is not None
    return best


def _without_zeroings(
    time: Floats,
    wrench: Floats,
    blocks: Blocks,
    known: Payload | None,
    delay: tuple[float, float] | None,
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


def _check_weight(own: Payload, weight: float, source: str) -> None:
    off, error = abs(own.mass * GRAVITY - weight), own.mass_error * GRAVITY
    if off > max(3.0 * error, 0.02 * weight):
        fits = with_error(own.mass * GRAVITY, error, unit="N")
        words = f"the force in free air fits a tool weight of {fits}, not --tool-weight {weight:g}N"
        raise RecordingError.of(source, f"{words}; drop it")


def idle_weight(weight: float, source: str) -> RecordingError:
    """Return the error for a weight that the tare removes."""
    words = f"--tool-weight {weight:g}N has no effect: in the frame of the force the weight is "
    remedy = "drop it, or pass --force-frame tool if the sensor rotates with the tool"
    return RecordingError.of(source, f"{words}constant, and the tare removes it; {remedy}")


def mark_payload(fit: PayloadFit) -> Payload:
    """Return the payload with its marks, and findings that give the reasons."""
    own, findings = fit.payload, list[Finding]()
    turns = f"the tool turns by {math.degrees(own.turn):.0f}° in free air: palpate cannot identify "
    mass = _mark(own.mass_error / max(own.mass, 1e-9), MASS_ERRORS)
    mount = _mark(float(own.mount_error.max()), MOUNT_ERRORS)
    late = _mark(own.delay_error, DELAY_ERRORS)
    if mass == "do-not-trust" and own.mass_error * GRAVITY < fit.blocks.floor:
        words = "the tool weighs less than the noise of the sensor: palpate takes the axes of the "
        findings.append(Check.PAYLOAD.finding(f"{words}pose for those of the sensor"))
    elif mass == "do-not-trust":
        words = "its weight, and subtracts the mean force in the axes of the sensor"
        mark: Mark = "with-care" if own.turn > NO_TURN else "trust"
        findings.append(Check.PAYLOAD.finding(turns + words, TURN_MORE, mark=mark))
    elif mount == "do-not-trust":
        words = "the mount, and takes the axes of the pose for those of the sensor"
        findings.append(Check.PAYLOAD.finding(turns + words, TURN_MORE, mark="with-care"))
    if fit.scatter > SCATTERS[0]:
        words = f"the force in free air fits the weight of the tool {fit.scatter:.1f} times worse "
        remedy = "move more slowly, or check that the z axis of the pose points up"
        words += "than its noise explains"
        findings.append(Check.PAYLOAD.finding(words, remedy, severity="with-care"))
    if own.sign < 0.0:
        words = "by the weight of the tool the sensor reads the force on the material"
        words += ": palpate reversed its sign"
        findings.append(Check.PAYLOAD.finding(words, "pass --flip-force to confirm"))
    if fit.zeroed:
        times = ", ".join(f"{each.time:.2f} s" for each in fit.zeroed)
        words = f"the sensor was zeroed during the log, at {times}: palpate took the step out"
        findings.append(Check.ZEROED.finding(words, "zero the sensor before the log begins"))
    return replace(own, mass_mark=mass, mount_mark=mount, delay_mark=late, findings=tuple(findings))


def _mark(error: float, limits: tuple[float, float]) -> Mark:
    return MARKS[sum(not error <= limit for limit in limits)]


def external_force(fit: PayloadFit, motion: FlangeMotion, time: Floats, force: Floats) -> Floats:
    """Return the force of the material on the tool, in the axes of the sensor, shape (k, 3).

    The mean of what is left in free air nearby is subtracted too, weighted by exp(−|t − tᵢ|/3 s)
    and drawn to zero by 0.2 s: the sensor wanders faster than the bias of the payload.

    Parameters
    ----------
    motion : FlangeMotion
        Motion of the flange, filtered over 0.1 s: the tool is quicker in contact.
    time, force : numpy.ndarray, shapes (k,) and (k, 3)
        s and N, on the clock of the wrench; with the sign of the payload, without steps.
    """
    own, blocks, times = fit.payload, fit.blocks, fit.blocks.time

    def rest(force: Floats, time: Floats, seen: Floats) -> Floats:
        model = own.wrench(seen[:, :3], seen[:, 3:6], seen[:, 6:9]) + own.bias_at(time)
        remainder: Floats = force - model[:, :3]
        return remainder

    seen = motion.mean(blocks.start - own.delay, blocks.stop - own.delay)
    means = rest(blocks.wrench[:, :3], times, seen)
    left = rest(force, time, motion.at(time - own.delay))
    block = float(np.median(blocks.stop - blocks.start))
    far = math.ceil(5.0 * RETARE / block)
    kernel = np.exp(-np.abs(np.arange(-far, far + 1)) * block / RETARE)
    columns = np.column_stack([fit.free, fit.free[:, None] * means])
    for part in run_slices(blocks.segment):
        near = [np.convolve(column, kernel)[far:-far] for column in columns[part].T]
        ends = -np.inf if part.start == 0 else times[part.start]
        until = np.inf if part.stop == len(times) else times[part.stop]
        there = slice(*np.searchsorted(time, (ends, until)))
        for k in range(3):
            local = near[k + 1] / (near[0] + RETARE_BLOCKS * BLOCK / block)
            left[there, k] -= np.interp(time[there], times[part], local)
    return left
