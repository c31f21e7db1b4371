"""The fit of a payload to free air by Gauss–Newton: weight, inertia, mount, bias and clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Delay, run_slices
from palpate.estimators.least_squares import long_run_covariance
from palpate.preparation.free_air import LONGEST_DELAY, Blocks, Mask, largest_consensus
from palpate.preparation.payload import TENSOR, Payload
from palpate.recordings.units import GRAVITY
from palpate.validation import Floats

SHIFT = 30e-3  # s, of the difference for the clock
CUT = 6.0  # of Tukey's weight, in scales
ROUNDS, FIRST_ROUNDS, CONVERGED = 14, 4, 0.05  # Gauss–Newton steps; standard errors
SHORTEST_FREE, MARGIN = 0.16, 0.04  # s of a run in free air, and excluded at each end
FEWEST_FREE = 50  # blocks
KNOT, MOST_KNOTS = 5.0, 40  # s between the knots of the bias; farther apart in a long log
CHUNK = 64  # rows
WANDER = np.repeat([0.025, 1e-3], 3)  # N, N·m: expected change of the bias from knot to knot
ARMS = 0.15  # m, of sensor and centre of mass, as first allowed for
LEAST_TURN = 0.03  # standard deviation of the direction of gravity about an axis, rad
# The filter of the motion attenuates the acceleration, which raises the mass: by 0.2 % at 2.4 and
# 3.5 Hz and 0.9 % at 5 Hz where inertia alone tells it.
FILTER_ERROR, BY_INERTIA = 3e-4, 1e-2
# Noise of the pose in the columns: largest part of their squares that is subtracted, and its error.
MOST_BLURRED, UNSURE_BLUR = 0.9, 0.2
FIXED = 1e-9  # standard deviation of a known value
# Columns of the fit: mass, m c, inertia, m d, mount, delay.
MASS, ARM, INERTIA, LEVER = 0, slice(1, 4), slice(4, 10), slice(10, 13)
MOUNT, CLOCK, SIZE = slice(13, 16), 16, 17
AXES = np.array([k == TENSOR for k in range(6)], dtype=np.float64)  # of the inertia
OF_MOUNT, EVERYTHING = range(13, 16), range(16)  # columns to fix


def skew(vectors: Floats) -> Floats:
    """Return the matrices v× of vectors, shape (k, 3, 3)."""
    crossed = np.zeros((*vectors.shape, 3))
    for k, (first, second) in enumerate(((1, 2), (2, 0), (0, 1))):
        crossed[..., first, second] = -vectors[..., k]
        crossed[..., second, first] = vectors[..., k]
    return crossed


def rotation(vector: Floats) -> Floats:
    """Return the rotation matrix of a rotation vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    cross = skew(vector)
    first, second = np.sinc(angle / math.pi), 0.5 * np.sinc(0.5 * angle / math.pi) ** 2
    turned: Floats = np.eye(3) + first * cross + second * cross @ cross
    return turned


def regressors(seen: Floats, mount: Floats, lever: Floats) -> Floats:
    """Return the wrench by mass, m c, inertia and m d, shape (k, 6, 13), in the sensor's axes."""
    g, w, a = (seen[:, 3 * k : 3 * k + 3] @ mount for k in range(3))
    products = mount.T @ seen[:, 9 + TENSOR] @ mount
    square = np.trace(products, axis1=1, axis2=2)[:, None, None]
    swing = square * np.eye(3) - skew(a) - products
    turned_g = skew(g + swing @ lever)
    by_a, by_w = (np.einsum("kij,nj->nik", AXES, each) for each in (a, w))
    by = np.zeros((len(seen), 6, 13))
    by[:, :3, 0], by[:, :3, ARM], by[:, :3, LEVER] = g, swing, swing
    by[:, 3:, ARM], by[:, 3:, INERTIA] = -turned_g, -by_a - skew(w) @ by_w
    return by


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
    blur: Floats  # (k, 6, SIZE), columns by the noise of the pose alone
    weight: Floats  # (k, 6), Tukey's over the variance

    def solve(
        self, prior: Floats, pull: Floats, ties: Sequence[Floats], drift: Floats, load: Floats
    ) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
        """Solve the normal equations; the bias of each axis is eliminated first.

        The noise of the pose adds to the squares of the columns, which draws mass and clock to
        zero. Its part is subtracted (Fuller, Measurement error models, 1987), at most a half.

        Parameters
        ----------
        prior, pull : numpy.ndarray, shape (SIZE,)
            Precision of the prior of each parameter, and its part of the slope.
        ties : sequence of numpy.ndarray
            Precision of the prior of each bias.
        drift : numpy.ndarray, shape (knots, 6)
            The biases.
        load : numpy.ndarray, shape (13,)
            The parameters of :func:`regressors`.

        Returns
        -------
        tuple
            The moves of parameters and biases, the covariance of the parameters for white noise,
            the move of the biases by that of the parameters, shape (6, knots, SIZE), the
            variances of the mean biases for known parameters, and the part of the move that
            corrects for the noise of the pose.
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
        weighted = (self.blur * self.weight[:, :, None]).reshape(-1, SIZE)
        blurred = weighted.T @ self.blur.reshape(-1, SIZE)
        half = np.linalg.inv(np.linalg.cholesky(normal * unit * unit[:, None])) * unit
        share, axes = np.linalg.eigh(half @ blurred @ half.T)
        axes = axes.T @ half  # of normal to the identity, of blurred to the shares
        share = np.minimum(share, MOST_BLURRED)
        inverse = axes.T / (1.0 - share) @ axes
        steeper = axes.T * (share / (1.0 - share)) @ axes @ normal[:, : len(load)] @ load
        move, coupling = inverse @ slope + steeper, np.array(couplings)
        moved = (np.array(moves) - coupling @ move).T
        return move, moved, inverse, coupling, np.array(variances), steeper

    def covariance(self, inverse: Floats, coupling: Floats, steeper: Floats, used: Mask) -> Floats:
        """Return the covariance of the parameters, with the correlation of the residuals."""
        covariance = np.zeros((SIZE, SIZE))
        for k in range(6):
            weight = self.weight[used, k, None]
            scores = weight * (self.jacobian[used, k] - self.columns[used] @ coupling[k]) @ inverse
            if weight.any():
                knots = self.columns.shape[1]
                covariance += long_run_covariance(scores, self.rest[used, k], (), knots)
        # Few turns do not show all of the wander, which the prior of the bias allows for.
        error = np.sqrt(np.diag(covariance) + 1e-300)
        inflation = np.maximum(1.0, np.sqrt(np.diag(inverse)) / error)
        widened: Floats = covariance * inflation * inflation[:, None]
        np.fill_diagonal(widened, np.maximum(np.diag(widened), np.diag(inverse)))
        return widened + np.outer(steeper, steeper) * UNSURE_BLUR**2


def fit_payload(
    blocks: Blocks,
    *,
    known: Payload | None = None,
    fixed: Sequence[int] = (),
    delay: Delay | None = None,
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
    delay : Delay, optional
        Delay of the wrench, if it is known.

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
    seen = blocks.seen(clock)
    unloaded = blocks.wrench - regressors(seen, mount, _lever_of(theta)) @ theta[:13]
    drift = np.tile(np.concatenate([bias, np.median(unloaded[:, 3:], axis=0)]), (count, 1))
    rest = unloaded[:, :3] - bias
    allowed = floor + 0.02 * GRAVITY * np.linalg.norm(seen[:, 3:6], axis=1) + 0.05 * seen[:, 16]
    # The inertia of a heavy tool, by arms that are not known yet, exceeds that.
    inertia = max(mass - 1.0, 0.0) * (allowed - floor + ARMS * np.linalg.norm(seen[:, 6:9], axis=1))
    allowed += inertia
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
        slack = 1.0 + inertia / floor if step < FIRST_ROUNDS else 1.0
        sizes = [
            np.linalg.norm(fit.rest[:, axes] / sigma[axes], axis=1) / math.sqrt(3.0) / cut / slack
            for axes, cut in ((slice(0, 3), CUT), (slice(3, 6), 4.0 * CUT))
        ]
        inside = free & (sizes[0] < 1.0) & (sizes[1] < 1.0)
        tukey = [np.where(inside, (1.0 - size**2) ** 2, 0.0) for size in sizes]
        fit.weight = np.repeat(np.column_stack(tukey), 3, axis=1) / sigma**2
        pull = (expected - theta) / spread**2
        solved = fit.solve(spread**-2, pull, ties, drift, theta[:13])
        move, moved, inverse, coupling, variances, steeper = solved
        move[list(fixed)] = 0.0
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
    covariance = fit.covariance(inverse, coupling, steeper, inside)
    means = coupling.mean(axis=1)
    variances += np.einsum("ki,ij,kj->k", means, covariance, means)
    found = _payload_of(theta, mount, covariance, blocks, inside, knots, drift)
    return replace(found, bias_error=np.sqrt(variances)), inside, float(scale[:3].max())


def _prior(
    known: Payload | None, fixed: Sequence[int], delay: Delay | None, mass: float
) -> tuple[Floats, Floats]:
    """Return the expected values of the payload and their standard deviations."""
    heavy, expected = max(mass, 0.05), np.zeros(SIZE)
    sizes = 10.0, 1.0, 0.02 * heavy, 0.1 * heavy, math.pi, LONGEST_DELAY
    spread = np.repeat(sizes, (1, 3, 6, 3, 3, 1))
    if known is not None:
        expected[: MOUNT.start] = known.parameters
        spread[list(fixed)] = FIXED
        expected[spread != FIXED] = 0.0
    if delay is not None:
        expected[CLOCK], spread[CLOCK] = delay.seconds, max(delay.standard_error, 1e-6)
    return expected, spread


def _linearized(
    blocks: Blocks,
    columns: Floats,
    theta: Floats,
    mount: Floats,
    drift: Floats,
) -> _Free:
    """Return residuals and their negative slopes by payload, mount and delay."""
    noise = blocks.motion.noise
    assert noise is not None
    noisy = replace(blocks, motion=noise)
    jacobian, blur = (_slopes(each, theta, mount) for each in (blocks, noisy))
    rest = blocks.wrench - jacobian[:, :, :13] @ theta[:13] - columns @ drift
    return _Free(rest, jacobian, columns, blur, np.zeros_like(rest))


def _lever_of(theta: Floats) -> Floats:
    lever: Floats = theta[LEVER] / max(float(theta[MASS]), 1e-9)
    return lever


def _slopes(blocks: Blocks, theta: Floats, mount: Floats) -> Floats:
    """Return the slopes of the wrench by payload, mount and delay."""
    seen = blocks.seen(theta[CLOCK])
    ahead, behind = (blocks.seen(theta[CLOCK] - t, 3) for t in (SHIFT, -SHIFT))
    rate = (ahead - behind) / (2.0 * SHIFT) @ mount
    # A mount turned further by φ changes g to g + g × φ.
    turned = skew(seen[:, :3] @ mount)
    by_mount = np.hstack([theta[MASS] * turned, skew(theta[ARM]) @ turned])
    by_clock = np.hstack([-theta[MASS] * rate, -np.cross(theta[ARM], rate)])[:, :, None]
    return np.concatenate([regressors(seen, mount, _lever_of(theta)), by_mount, by_clock], axis=2)


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
    around, axes = turns_of(blocks.seen(theta[CLOCK])[free, 17:]) if free.any() else (0.0, 0)
    bias = drift.mean(axis=0)
    span = blocks.stop - blocks.start
    return Payload(
        mass,
        theta[ARM] / heavy,
        mount,
        bias,
        inertia=theta[INERTIA],
        lever=theta[LEVER] / heavy,
        delay=float(theta[CLOCK]),
        bias_times=knots,
        bias_changes=drift - bias,
        mass_error=math.hypot(error[MASS], (FILTER_ERROR if axes else BY_INERTIA) * mass),
        centre_error=arms[0],
        mount_error=error[MOUNT],
        lever_error=arms[1],
        inertia_error=error[INERTIA],
        delay_error=float(error[CLOCK]),
        turn=around,
        axes=axes,
        free_share=float(np.mean(free)),
        free_time=float(span[free].sum()),
    )


def turns_of(directions: Floats) -> tuple[float, int]:
    """Return the largest angle between directions, rad, and about how many axes they turn."""
    far = directions[int(np.argmin(directions @ directions.mean(axis=0)))]
    largest = math.acos(float(np.clip((directions @ far).min(), -1.0, 1.0)))
    # Turns about one axis keep gravity in a plane.
    spread = np.linalg.svd(directions, compute_uv=False) / math.sqrt(len(directions))
    return largest, int(np.count_nonzero(spread[1:] > LEAST_TURN))
