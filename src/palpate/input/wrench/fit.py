"""The fit of a payload to free air by Gauss–Newton: weight, inertia, mount, bias and clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from palpate.input.channels.frames import cross, quaternion_of_vector, rotate
from palpate.input.recordings.units import GRAVITY
from palpate.input.wrench.consensus import LONGEST_DELAY, Blocks, largest_consensus
from palpate.input.wrench.payload import TENSOR, Payload
from palpate.input.wrench.zeroing import Zeroing
from palpate.method.contact import Delay
from palpate.method.estimators.least_squares import long_run_covariance
from palpate.method.rows import count_true, median, norm, row_norms, run_slices, true_runs
from palpate.validation import Floats, Integers, Mask

SHIFT = 30e-3  # s, of the difference for the clock
CUT = 6.0  # of Tukey's weight, in scales
# Gauss–Newton steps; standard errors
ROUNDS = 14
FIRST_ROUNDS = 4
CONVERGED = 0.05
# s of a run in free air, and excluded at each end
SHORTEST_FREE = 0.16
MARGIN = 0.04
FEWEST_FREE = 50  # blocks
# s between the knots of the bias; farther apart in a long log
KNOT = 5.0
MOST_KNOTS = 40
CHUNK = 64  # rows
WANDER = np.repeat([0.025, 1e-3], 3)  # N, N·m: expected change of the bias from knot to knot
ARMS = 0.15  # m, of sensor and centre of mass, as first allowed for
LEAST_TURN = 0.03  # standard deviation of the direction of gravity about an axis, rad
# The filter of the motion attenuates the acceleration, which raises the mass: by 0.2 % at 2.4 and
# 3.5 Hz and 0.9 % at 5 Hz where inertia alone tells it.
FILTER_ERROR = 3e-4
BY_INERTIA = 1e-2
# Noise of the pose in the columns: largest part of their squares that is subtracted, and its error.
MOST_BLURRED = 0.9
UNSURE_BLUR = 0.2
FIXED = 1e-9  # standard deviation of a known value
# Columns of the fit: mass, m c, inertia, m d, mount, delay.
MASS = 0
ARM = slice(1, 4)
INERTIA = slice(4, 10)
LEVER = slice(10, 13)
MOUNT = slice(13, 16)
CLOCK = 16
SIZE = 17
# columns to fix
OF_MOUNT = range(13, 16)
EVERYTHING = range(16)
# The matrices e× of the three axes, and the inertia tensors whose entries are 1.
CROSSES = np.cross(np.eye(3), np.eye(3)[:, None])
TENSORS = np.eye(6)[:, TENSOR]


def skew(vectors: Floats) -> Floats:
    """Return the matrices v× of vectors, shape (k, 3, 3)."""
    return np.tensordot(vectors, CROSSES, axes=1)


def rotation(vector: Floats) -> Floats:
    """Return the rotation matrix of a rotation vector."""
    return rotate(np.eye(3), quaternion_of_vector(vector[None])).T


def regressors(motion: Floats, mount: Floats, lever: Floats) -> Floats:
    """Return the wrench by mass, m c, inertia and m d, shape (k, 6, 13), in the sensor's axes.

    It is linear in these: :meth:`~palpate.input.wrench.payload.Payload.wrench` for 13 unit vectors.
    """
    g, w, a = (motion[:, 3 * k : 3 * k + 3] @ mount for k in range(3))
    products = mount.T @ motion[:, 9 + TENSOR] @ mount
    square = np.trace(products, axis1=1, axis2=2)[:, None, None]
    swing = square * np.eye(3) - skew(a) - products
    by_moment = -skew(g + swing @ lever)
    by_inertia = np.moveaxis(-(a @ TENSORS) - cross(w, w @ TENSORS), 0, 2)
    columns = np.zeros((len(g), 6, 13))
    columns[:, :3, MASS] = g
    columns[:, :3, ARM] = columns[:, :3, LEVER] = swing
    columns[:, 3:, ARM] = by_moment
    columns[:, 3:, INERTIA] = by_inertia
    return columns


@dataclass(slots=True, eq=False)
class _Drift:
    """A bias that is linear between knots.

    Attributes
    ----------
    columns : numpy.ndarray, shape (k, knots)
        The bias of each block by those of the knots.
    knots : numpy.ndarray, shape (knots,)
        Times, s.
    ties : list of numpy.ndarray, shape (knots, knots)
        Precision of the changes from knot to knot, for each axis.
    """

    columns: Floats
    knots: Floats
    ties: list[Floats]

    @classmethod
    def of(cls, time: Floats, segment: Integers) -> "_Drift":
        """Return the knots of a log, and separate ones after each zeroing."""
        spacing = max(KNOT, (time[-1] - time[0]) / MOST_KNOTS)
        columns = list[Floats]()
        knots = list[Floats]()
        for run in run_slices(segment):
            start = time[run.start]
            stop = time[run.stop - 1]
            times = np.linspace(start, stop, max(math.ceil((stop - start) / spacing), 1) + 1)
            hats = np.zeros((len(times), len(time)))
            hats[:, run] = [np.interp(time[run], times, hat) for hat in np.eye(len(times))]
            columns.append(hats)
            knots.append(times)
        borders = np.cumsum([len(times) for times in knots])
        changes = np.delete(np.diff(np.eye(borders[-1]), axis=0), borders[:-1] - 1, axis=0)
        times = np.concatenate(knots)
        tie = changes.T @ changes
        wander = WANDER * math.sqrt((times[1] - times[0]) / KNOT)
        ties = [tie / change**2 + 1e-8 * np.eye(len(times)) for change in wander]
        return cls(np.vstack(columns).T, times, ties)


class _Step(NamedTuple):
    """The solution of one linearization.

    ``parameters`` and ``biases`` are moves; ``inverse`` is the covariance of the parameters for
    white noise, ``coupling``, shape (6, knots, SIZE), the move of the biases by that of the
    parameters, ``variances`` those of the mean biases for known parameters, and ``unblurring`` the
    part of the move that corrects for the noise of the pose.
    """

    parameters: Floats
    biases: Floats
    inverse: Floats
    coupling: Floats
    variances: Floats
    unblurring: Floats


@dataclass(slots=True, eq=False)
class _Linearization:
    """One linearization of the fit, with a column for each axis of the wrench."""

    residual: Floats  # (k, 6)
    jacobian: Floats  # (k, 6, SIZE)
    columns: Floats  # (k, knots), of the bias
    blur: Floats  # (k, 6, SIZE), columns by the noise of the pose alone
    weight: Floats  # (k, 6), Tukey's over the variance

    def solve(
        self, prior: Floats, pull: Floats, ties: Sequence[Floats], drift: Floats, load: Floats
    ) -> _Step:
        """Solve the normal equations; the bias of each axis is eliminated first.

        This is not :func:`~palpate.method.estimators.least_squares.least_squares`, which has no
        weights
        that change from step to step, no rotation among its parameters, and takes its columns for
        exact. Here the noise of the pose adds to the squares of the columns, which draws mass and
        clock to zero. Its part is subtracted (Fuller, Measurement error models, 1987), at most a
        half.

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
        """
        normal = np.diag(prior)
        slope = pull.copy()
        couplings = list[Floats]()
        moves = list[Floats]()
        variances = list[Floats]()
        mean = np.full(len(drift), 1.0 / len(drift))
        for k, tie in enumerate(ties):
            products = self._products(k)
            cross = products[:SIZE, SIZE:-1]
            right = [cross.T, products[SIZE:-1, -1] - tie @ drift[:, k], mean]
            solved = np.linalg.solve(products[SIZE:-1, SIZE:-1] + tie, np.column_stack(right))
            couplings.append(solved[:, :SIZE])
            moves.append(solved[:, SIZE])
            variances.append(mean @ solved[:, -1])
            normal += products[:SIZE, :SIZE] - cross @ solved[:, :SIZE]
            slope += products[:SIZE, -1] - cross @ solved[:, SIZE]
        inverse, correction = self._correct_blur(normal)
        unblurring = correction @ normal[:, : len(load)] @ load
        move = inverse @ slope + unblurring
        coupling = np.array(couplings)
        biases = (np.array(moves) - coupling @ move).T
        return _Step(move, biases, inverse, coupling, np.array(variances), unblurring)

    def _products(self, axis: int) -> Floats:
        """Return the weighted products of the columns, biases and residual of one axis."""
        residual = self.residual[:, axis, None]
        columns = np.hstack([self.jacobian[:, axis], self.columns, residual])
        weighted = self.weight[:, axis, None] * columns
        products = np.zeros((columns.shape[1],) * 2)
        # In chunks, because on a busy machine threads of BLAS wait for each other.
        for k in range(0, len(columns), CHUNK):
            products += weighted[k : k + CHUNK].T @ columns[k : k + CHUNK]
        return products

    def _correct_blur(self, normal: Floats) -> tuple[Floats, Floats]:
        """Return the inverse of the normal matrix without the noise of the pose, and its excess."""
        unit = 1.0 / np.sqrt(np.diag(normal))
        weighted = (self.blur * self.weight[:, :, None]).reshape(-1, SIZE)
        blurred = weighted.T @ self.blur.reshape(-1, SIZE)
        half = np.linalg.inv(np.linalg.cholesky(normal * unit * unit[:, None])) * unit
        share, axes = np.linalg.eigh(half @ blurred @ half.T)
        axes = axes.T @ half  # of normal to the identity, of blurred to the shares
        share = np.minimum(share, MOST_BLURRED)
        return axes.T / (1.0 - share) @ axes, axes.T * (share / (1.0 - share)) @ axes

    def covariance(self, step: _Step, used: Mask) -> Floats:
        """Return the covariance of the parameters, with the correlation of the residuals."""
        covariance = np.zeros((SIZE, SIZE))
        for k in range(6):
            weight = self.weight[used, k, None]
            slopes = self.jacobian[used, k] - self.columns[used] @ step.coupling[k]
            if weight.any():
                scores = weight * slopes @ step.inverse
                knots = self.columns.shape[1]
                covariance += long_run_covariance(scores, self.residual[used, k], (), knots)
        # Few turns do not show all of the wander, which the prior of the bias allows for.
        white = np.diag(step.inverse)
        inflation = np.maximum(1.0, np.sqrt(white) / np.sqrt(np.diag(covariance) + 1e-300))
        widened: Floats = covariance * inflation * inflation[:, None]
        np.fill_diagonal(widened, np.maximum(np.diag(widened), white))
        return widened + np.outer(step.unblurring, step.unblurring) * UNSURE_BLUR**2


@dataclass(slots=True, eq=False)
class PayloadFit:
    """A payload, and the free air that it was fitted to.

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
    sign_in_doubt : bool
        Whether the wrench fits with either sign.
    """

    payload: Payload
    blocks: Blocks
    free: Mask
    scale: float
    zeroed: Sequence[Zeroing] = ()
    sign_in_doubt: bool = False

    @property
    def scatter(self) -> float:
        """Residual in free air, over the tolerance of a consensus and 1 % of the weight."""
        tolerable = self.blocks.floor + 0.01 * GRAVITY * self.payload.mass
        return self.scale * float(self.blocks.noise[:3].max()) / tolerable


def fit_payload(
    blocks: Blocks,
    *,
    known: Payload | None = None,
    fixed: Sequence[int] = (),
    delay: Delay | None = None,
) -> PayloadFit:
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
    PayloadFit
        The payload without marks.
    """
    consensus = largest_consensus(blocks, known, delay)
    mass = consensus.mass
    mount = consensus.mount
    expected, spread = _prior(known, fixed, delay, mass)
    theta = np.where(spread < FIXED * 1.1, expected, 0.0)
    theta[MASS] = mass
    theta[CLOCK] = consensus.delay
    motion = blocks.motion_before(consensus.delay)
    unloaded = blocks.wrench - regressors(motion, mount, _lever_of(theta)) @ theta[:13]
    drift = _Drift.of(blocks.time, blocks.segment)
    bias = np.concatenate([consensus.bias, np.median(unloaded[:, 3:], axis=0)])
    biases = np.tile(bias, (len(drift.knots), 1))
    allowed = blocks.tolerance(motion)
    # The inertia of a heavy tool, by arms that are not known yet, exceeds that.
    accelerating = allowed - blocks.floor + ARMS * row_norms(motion[:, 6:9])
    inertia = max(mass - 1.0, 0.0) * accelerating
    rest = row_norms(unloaded[:, :3] - consensus.bias)
    free = rest < 2.0 * (allowed + inertia)
    least = np.repeat([blocks.floor / math.sqrt(3.0), 0.02], 3)
    scale = np.maximum(1.0, least / blocks.noise)
    if mass == 0.0:  # nothing turns: inertia alone may tell the mass, from farther off
        scale *= 4.0
    for count in range(ROUNDS):
        linear = _linearize(blocks, drift.columns, theta, mount, biases)
        slack = 1.0 + inertia / blocks.floor if count < FIRST_ROUNDS else 1.0
        sigma = blocks.noise * scale
        force_size, torque_size = _residual_sizes(linear.residual, sigma, slack)
        inside = free & (force_size < 1.0) & (torque_size < 1.0)
        tukey = [np.where(inside, (1.0 - s**2) ** 2, 0.0) for s in (force_size, torque_size)]
        linear.weight = np.repeat(np.column_stack(tukey), 3, axis=1) / sigma**2
        pull = (expected - theta) / spread**2
        step = linear.solve(spread**-2, pull, drift.ties, biases, theta[:13])
        move = _limit_move(step.parameters, fixed)
        theta = theta + move
        theta[CLOCK] = np.clip(theta[CLOCK], -LONGEST_DELAY, LONGEST_DELAY)
        mount = mount @ rotation(move[MOUNT])
        biases = biases + step.biases
        used = tukey[0] > 0.3
        if count_true(used) > FEWEST_FREE:  # growing, it would take contact for free air
            deviation = np.median(np.abs(linear.residual[used]), axis=0)
            larger = np.maximum(1.0, 1.4826 * deviation / blocks.noise)
            scale = np.minimum(np.maximum(larger, 0.5 * scale), scale)
        if count >= FIRST_ROUNDS:
            previous = free
            free = _free_runs(force_size < 1.0, blocks)
            settled = move**2 < CONVERGED**2 * np.diag(step.inverse)
            if (free == previous).all() and settled.all():
                break
    covariance = linear.covariance(step, inside)
    means = step.coupling.mean(axis=1)
    variances = step.variances + np.einsum("ki,ij,kj->k", means, covariance, means)
    payload = replace(
        _payload_of(theta, mount, covariance, blocks, inside),
        bias=biases.mean(axis=0),
        bias_error=np.sqrt(variances),
        bias_times=drift.knots,
        bias_changes=biases - biases.mean(axis=0),
    )
    return PayloadFit(payload, blocks, inside, float(scale[:3].max()))


def _residual_sizes(
    residual: Floats, sigma: Floats, slack: Floats | float
) -> tuple[Floats, Floats]:
    """Return the sizes of force and torque over the cut of Tukey's weight."""
    force = row_norms(residual[:, :3] / sigma[:3]) / math.sqrt(3.0)
    torque = row_norms(residual[:, 3:] / sigma[3:]) / math.sqrt(3.0)
    return force / CUT / slack, torque / (4.0 * CUT) / slack


def _limit_move(move: Floats, fixed: Sequence[int]) -> Floats:
    """Return a move without the fixed parameters, of at most 0.3 rad and 30 ms."""
    move[list(fixed)] = 0.0
    move[MOUNT] *= min(1.0, 0.3 / max(norm(move[MOUNT]), 1e-300))
    move[CLOCK] = np.clip(move[CLOCK], -0.03, 0.03)
    return move


def _free_runs(fitting: Mask, blocks: Blocks) -> Mask:
    """Return the runs of blocks that fit for long enough to be free air, without their ends."""
    span = median(blocks.duration)
    least, margin = (math.ceil(time / span - 1e-6) for time in (SHORTEST_FREE, MARGIN))
    margin = max(margin, 1)
    free = np.zeros(len(fitting), dtype=bool)
    for run in true_runs(fitting):
        if run.stop - run.start >= max(least, 3):
            free[run.start + margin : run.stop - margin] = True
    return free


def _prior(
    known: Payload | None, fixed: Sequence[int], delay: Delay | None, mass: float
) -> tuple[Floats, Floats]:
    """Return the expected values of the payload and their standard deviations."""
    heavy = max(mass, 0.05)
    expected = np.zeros(SIZE)
    sizes = 10.0, 1.0, 0.02 * heavy, 0.1 * heavy, math.pi, LONGEST_DELAY
    spread = np.repeat(sizes, (1, 3, 6, 3, 3, 1))
    if known is not None:
        expected[: MOUNT.start] = known.parameters
        spread[list(fixed)] = FIXED
        expected[spread != FIXED] = 0.0
    if delay is not None:
        expected[CLOCK] = delay.seconds
        spread[CLOCK] = max(delay.standard_error, 1e-6)
    return expected, spread


def _linearize(
    blocks: Blocks, columns: Floats, theta: Floats, mount: Floats, biases: Floats
) -> _Linearization:
    """Return residuals and their negative slopes by payload, mount and delay."""
    noise = blocks.motion.noise
    assert noise is not None
    jacobian = _slopes(blocks, theta, mount)
    blur = _slopes(replace(blocks, motion=noise), theta, mount)
    residual = blocks.wrench - jacobian[:, :, :13] @ theta[:13] - columns @ biases
    return _Linearization(residual, jacobian, columns, blur, np.zeros_like(residual))


def _lever_of(theta: Floats) -> Floats:
    lever: Floats = theta[LEVER] / max(float(theta[MASS]), 1e-9)
    return lever


def _slopes(blocks: Blocks, theta: Floats, mount: Floats) -> Floats:
    """Return the slopes of the wrench by payload, mount and delay."""
    motion = blocks.motion_before(theta[CLOCK])
    change = blocks.motion_before(theta[CLOCK] - SHIFT, 3)
    change -= blocks.motion_before(theta[CLOCK] + SHIFT, 3)
    rate = change / (2.0 * SHIFT) @ mount
    # A mount turned further by φ changes g to g + g × φ.
    turned = skew(motion[:, :3] @ mount)
    by_mount = np.hstack([theta[MASS] * turned, skew(theta[ARM]) @ turned])
    by_clock = np.hstack([-theta[MASS] * rate, -cross(theta[ARM], rate)])[:, :, None]
    by_load = regressors(motion, mount, _lever_of(theta))
    return np.concatenate([by_load, by_mount, by_clock], axis=2)


def _payload_of(
    theta: Floats, mount: Floats, covariance: Floats, blocks: Blocks, free: Mask
) -> Payload:
    """Return the payload of the parameters, with standard errors, but for its bias."""
    mass = float(theta[MASS])
    error = np.sqrt(np.diag(covariance))
    heavy = max(mass, 1e-9)
    arm_errors = list[Floats]()
    for arm in (ARM, LEVER):
        slopes = np.zeros((3, SIZE))
        slopes[:, arm] = np.eye(3) / heavy
        slopes[:, MASS] = -theta[arm] / heavy**2
        arm_errors.append(np.sqrt(np.diag(slopes @ covariance @ slopes.T)))
    gravity = blocks.motion_before(theta[CLOCK])[free, 17:]
    turn, axes = turns_of(gravity) if free.any() else (0.0, 0)
    return Payload(
        mass,
        theta[ARM] / heavy,
        mount,
        np.zeros(6),
        inertia=theta[INERTIA],
        lever=theta[LEVER] / heavy,
        delay=float(theta[CLOCK]),
        mass_error=math.hypot(error[MASS], (FILTER_ERROR if axes else BY_INERTIA) * mass),
        centre_error=arm_errors[0],
        mount_error=error[MOUNT],
        lever_error=arm_errors[1],
        inertia_error=error[INERTIA],
        delay_error=float(error[CLOCK]),
        turn=turn,
        axes=axes,
        free_share=float(np.mean(free)),
        free_time=float(blocks.duration[free].sum()),
    )


def turns_of(directions: Floats) -> tuple[float, int]:
    """Return the largest angle between directions, rad, and about how many axes they turn."""
    farthest = directions[int(np.argmin(directions @ directions.mean(axis=0)))]
    largest = math.acos(float(np.clip((directions @ farthest).min(), -1.0, 1.0)))
    # Turns about one axis keep gravity in a plane.
    spread = np.linalg.svd(directions, compute_uv=False) / math.sqrt(len(directions))
    return largest, count_true(spread[1:] > LEAST_TURN)
