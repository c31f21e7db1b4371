"""How precisely, and how soon, a planned motion identifies the parameters of a guessed law.

The Fisher information gives the bound: for F = f(x, v; θ) + ε with white noise of standard
deviation σ, no unbiased estimator of θ has a covariance below

    (JᵀJ)⁻¹ σ²,   J = ∂f/∂θ at every sample.

A sensor's rounding adds to it. A search finds a better motion within limits of depth and speed.
"""

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from palpate.digits import percent, rounded
from palpate.force_laws import ForceLaw, HuntCrossley
from palpate.lab.design.motion import Motion
from palpate.validation import Floats, frozen, number_in, plain

# Harmonics of the rounding error that are treated apart from white noise: 87 % of its power.
_MOST = 4
# Harmonics below this fraction of the noise count as white noise.
_LEAST = 1e-3


def effective_noise(noise: float, resolution: float) -> float:
    """Standard deviation of a sensor's noise and rounding together: √(σ² + Δ²/12), N.

    Rounding to steps of Δ adds an error that is uniform over a step, of variance Δ²/12. For
    σ ≥ Δ/2 it is independent from sample to sample. Below that, a part of amplitude
    (Δ/π) e^(−2π²σ²/Δ²) depends on the force only. It averages out over a motion that crosses many
    steps without repeating soon, but not over a periodic motion or a held force: see
    ``expected_errors``.

    Parameters
    ----------
    noise : float
        σ before rounding, N, in [1e-15, 1e15].
    resolution : float
        Δ, N, in [0, 1e15]; 0 for a sensor that does not round.
    """
    sigma = number_in("noise", noise, 1e-15, 1e15)
    step = number_in("resolution", resolution, 0.0, 1e15)
    return math.hypot(sigma, step / math.sqrt(12.0))


def mean_rounding_error(noise: float, resolution: float) -> Floats:
    """Amplitudes βₖ [N] of the mean rounding error, Σ βₖ sin 2πk F/Δ, k = 1, 2, … up to four.

    βₖ = Δ/(πk) e^(−2π²k²σ²/Δ²): the sawtooth of a sensor of step Δ, blurred by Gaussian noise of σ.
    Amplitudes that are small compared with the noise are omitted.
    """
    if resolution == 0.0:
        return np.empty(0)
    order = np.arange(1, _MOST + 1)
    # Beyond this the exponential is 0, and its argument might overflow.
    ratio = min(noise / resolution, 10.0)
    betas: Floats = resolution / (np.pi * order) * np.exp(-2.0 * (np.pi * order * ratio) ** 2)
    count = int(np.count_nonzero(betas > _LEAST * effective_noise(noise, resolution)))
    return betas[:count]


def jacobian(
    law: ForceLaw,
    penetration: Floats,
    velocity: Floats,
    *,
    offset: bool = False,
    surface: bool = False,
) -> Floats:
    """∂F/∂(θ[, offset][, surface]) at every sample, shape (k, q); ∂F/∂θ is 0 out of contact.

    Parameters
    ----------
    law : force law
        The material.
    penetration, velocity : numpy.ndarray, shape (k,)
        m and m/s, finite.
    offset, surface : bool
        Whether a force offset [N] and the surface position [m] are estimated too.
    """
    inside = penetration > 0.0
    depth = np.where(inside, penetration, 1.0)
    columns = [np.where(inside[:, None], law.parameter_gradient(depth, velocity), 0.0)]
    if offset:
        columns.append(np.ones((inside.size, 1)))
    if surface:  # x becomes x − d
        slope = np.where(inside, -law.penetration_gradient(depth, velocity), 0.0)
        columns.append(slope[:, None])
    return np.hstack(columns)


def cramer_rao_bound(
    law: ForceLaw, penetration: Floats, velocity: Floats, noise: float, **unknown: bool
) -> Floats:
    """Return lower bounds of the standard errors for a motion, in the order of :func:`jacobian`.

    A bound is infinite for a parameter that the motion does not identify. ``noise`` is the standard
    deviation of the force, N.
    """
    rows = jacobian(law, penetration, velocity, **unknown) / noise
    return np.sqrt(np.diag(inverse_information(rows.T @ rows)))


def inverse_information(information: Floats) -> Floats:
    """Covariance from an information matrix; infinite for directions without information."""
    diagonal = np.sqrt(np.diag(information))
    unit = np.where(diagonal > 0.0, diagonal, 1.0)
    scaled = information / np.outer(unit, unit)
    # Rounding errors of sums over k samples leave eigenvalues of this size instead of 0.
    if np.linalg.eigvalsh(scaled).min() < 1e-13:
        return np.full_like(information, np.inf)
    inverse: Floats = np.linalg.inv(scaled) / np.outer(unit, unit)
    return inverse


# The measurement of one planned motion.

#: Longest predicted time, s; a longer one counts as infinite.
HORIZON = 1000.0
# Until this time every sample counts, s; then one sample represents several.
_EVERY_SAMPLE = 20.0
# Samples per block: it limits memory and the part that the search bisects.
_BLOCK = 500
# Samples for a quick estimate of the rounding's effect.
_QUICK = 20_000
# Factors on the guessed forces over which the rounding's effect is averaged.
_FORCES = (0.9, 1.0, 1.1)


@frozen
class PlannedMeasurement:
    """The guessed law, the sensor, and what else is estimated.

    Only samples in contact (x > 0) count: the others carry no information about the law.

    Parameters
    ----------
    law : HuntCrossley
        Guess of the material.
    noise, resolution : float
        σ of the force before rounding, and the quantisation step Δ, N.
    sample_time : float
        s.
    offset, surface : bool
        Whether a force offset and the surface position are estimated too.
    """

    law: HuntCrossley
    noise: float
    resolution: float
    sample_time: float
    offset: bool
    surface: bool

    @property
    def speed_limit(self) -> float:
        """0.1 K/B, m/s (eq. 10).

        Above it the single-stage method is biased; variable projection is not.
        """
        return 0.1 * self.law.K / self.law.B

    @property
    def effective_noise(self) -> float:
        """√(σ² + Δ²/12), N."""
        return effective_noise(self.noise, self.resolution)

    def relative_errors(self, motion: Motion, duration: float, *, quick: bool = False) -> Floats:
        """Cramér–Rao bounds of (K, B, n) over their values after a duration [s], shape (3,).

        A bound is infinite for a parameter that the motion does not identify. With ``quick`` one
        sample represents several.
        """
        stride = self._stride(motion) if quick else 1
        total = self._nothing()
        for index in _blocks(0, self._count(duration), stride, 20 * _BLOCK):
            total += self._information(motion, index, stride)
        return self._relative(total)

    def expected_errors(self, motion: Motion, duration: float, *, quick: bool = False) -> Floats:
        """Relative RMS errors of least squares with a sensor that rounds, shape (3,).

        If the noise does not blur the steps, part of the rounding error depends on the force only,
        m(F) = Σ βₖ sin 2πk(F/Δ + φ), and does not average out over a periodic motion. With
        C = (JᵀJ)⁻¹ and the mean over the unknown φ,

            E δθ² = (σ² + Δ²/12 − Σ βₖ²/2) C + Σ βₖ²/2 [(CJᵀ cos 2πkF/Δ)² + (CJᵀ sin 2πkF/Δ)²].

        As the steps' positions depend on the guess, the waves use the mean over 0.9, 1 and 1.1
        times the forces. The result is at least the bound, :meth:`relative_errors`, and equal to it
        if noise blurs the steps. With ``quick`` one sample represents several.
        """
        bound = self.relative_errors(motion, duration, quick=quick)
        betas = mean_rounding_error(self.noise, self.resolution)
        if not betas.size or np.isinf(bound).any():
            return bound
        count = self._count(duration)
        stride = max(1, count // _QUICK) if quick else 1
        total = self._nothing()
        waves = np.zeros((len(total), len(_FORCES), 2 * betas.size))
        for index in _blocks(0, count, stride, 20 * _BLOCK):
            x, v = self._touching(motion, index)
            rows = jacobian(self.law, x, v, offset=self.offset, surface=self.surface)
            steps = self.law.force(x, v) / self.resolution
            phase = np.multiply.outer(steps, np.outer(_FORCES, np.arange(1, betas.size + 1)))
            total += rows.T @ rows
            wave = np.exp(2j * math.pi * phase)
            waves += np.tensordot(rows.T, np.concatenate([wave.real, wave.imag], axis=2), 1)
        covariance = inverse_information(total)
        power = 0.5 * betas**2
        white = (self.effective_noise**2 - power.sum()) * np.diag(covariance)
        repeated = np.tensordot(covariance, waves, 1) ** 2 @ np.tile(power, 2)
        squares = white / stride + repeated.mean(axis=1)
        errors: Floats = np.maximum(np.sqrt(squares[:3]) / self.law.parameters, bound)
        return errors

    def times_to(self, motion: Motion, targets: Sequence[float]) -> Floats:
        """Time [s] after which each parameter's bound is within each target, shape (targets, 3).

        Each sample adds information (JᵀJ grows by positive semidefinite terms), so no bound grows
        with time, and the first block of samples that meets a target is bisected. Every sample
        counts for 20 s; then one represents several, with at least 64 in a period of the fastest
        sine and one in 10 ms, which changes the time by far less than its printed digits. A time
        beyond ``HORIZON`` is infinite.
        """
        times = np.full((len(targets), 3), math.inf)
        total = self._nothing()
        for index, stride in self._to_horizon(motion):
            grown = total + self._information(motion, index, stride)
            errors = self._relative(grown)
            for row, target in enumerate(targets):
                for column in np.flatnonzero((errors <= target) & np.isinf(times[row])):
                    count = self._first(motion, total, index, stride, int(column), target)
                    times[row, column] = (index[count - 1] + stride) * self.sample_time
            if np.isfinite(times).all():
                break
            total = grown
        return times

    def _first(
        self,
        motion: Motion,
        before: Floats,
        index: Floats,
        stride: int,
        column: int,
        target: float,
    ) -> int:
        """Return the least number of a block's samples that meets a target; all of them meet it."""

        def met(count: int) -> bool:
            part = before + self._information(motion, index[:count], stride)
            return bool(self._relative(part)[column] <= target)

        return bisect_left(range(len(index)), True, lo=1, key=met)

    def _to_horizon(self, motion: Motion) -> Iterator[tuple[Floats, int]]:
        every = self._count(_EVERY_SAMPLE)
        for index in _blocks(0, every, 1, _BLOCK):
            yield index, 1
        stride = self._stride(motion)
        for index in _blocks(every, self._count(HORIZON), stride, _BLOCK):
            yield index, stride

    def _stride(self, motion: Motion) -> int:
        longest = min([0.01, *(2.0 * math.pi / 64.0 / w for w in motion.frequencies)])
        return max(1, int(longest / self.sample_time))

    def _count(self, duration: float) -> int:
        return round(duration / self.sample_time)

    def _touching(self, motion: Motion, index: Floats) -> tuple[Floats, Floats]:
        x, v = motion.at(index * self.sample_time)
        return x[x > 0.0], v[x > 0.0]

    def _information(self, motion: Motion, index: Floats, weight: int) -> Floats:
        x, v = self._touching(motion, index)
        rows = jacobian(self.law, x, v, offset=self.offset, surface=self.surface)
        rows /= self.effective_noise
        information: Floats = weight * (rows.T @ rows)
        return information

    def _relative(self, information: Floats) -> Floats:
        errors: Floats = np.sqrt(np.diag(inverse_information(information)))[:3]
        with np.errstate(over="ignore"):  # a parameter near 0 has an infinite relative error
            return errors / self.law.parameters

    def _nothing(self) -> Floats:
        size = 3 + self.offset + self.surface
        return np.zeros((size, size))


def _blocks(start: int, stop: int, stride: int, size: int) -> Iterator[Floats]:
    """Blocks of sample numbers from start to stop by stride, ``size`` at most each."""
    for first in range(start, stop, size * stride):
        yield np.arange(first, min(stop, first + size * stride), stride, dtype=np.float64)


# A better motion than the planned one, within limits of depth and speed.

# The probe stays deeper than this fraction of the peak penetration, and where K xⁿ is this many
# times the noise but at most this fraction of its largest value: gates exclude lighter samples.
MARGIN = 0.1
CLEAR = 10.0
# A smaller gain is not worth a change.
LEAST_GAIN = 0.02
# A quadratic velocity filter of 15 samples reduces a sine's speed by 5.57 (ω Δt)²: here 0.5 %.
FASTEST_PHASE = 0.03
# Rounding to four digits changes a depth by less than this fraction of it.
_DIGITS = 4
_SLACK = 1e-3


@frozen
class Limits:
    """Limits of a motion, of any duration.

    Parameters
    ----------
    peak_penetration, least_penetration : float
        m, 0 < least_penetration < peak_penetration.
    speed : float
        m/s.
    frequency : float
        rad/s.
    """

    peak_penetration: float
    least_penetration: float
    speed: float
    frequency: float

    def allow(self, motion: Motion) -> bool:
        """Whether the motion is within the limits."""
        return (
            motion.peak_penetration <= self.peak_penetration * (1.0 + 1e-12)
            and motion.least_penetration >= self.least_penetration * (1.0 - 1e-12)
            and motion.top_speed <= self.speed * (1.0 + 1e-12)
            and max(motion.frequencies, default=0.0) <= self.frequency * (1.0 + 1e-12)
        )


def limits_around(
    motion: Motion,
    measurement: PlannedMeasurement,
    max_depth: float | None,
    max_speed: float | None,
) -> Limits:
    """Return the requested limits; by default they are the motion's own extremes.

    The speed also stays below K/B, above which the law is adhesive on withdrawal, and the frequency
    so low that a velocity filter of 15 samples biases the damping by at most 0.5 %.
    """
    peak_penetration = motion.peak_penetration if max_depth is None else max_depth
    law = measurement.law
    clear = min(CLEAR * measurement.effective_noise / law.K, MARGIN * peak_penetration**law.n)
    least_penetration = max(MARGIN * peak_penetration, clear ** (1.0 / law.n))
    if 0.0 < motion.least_penetration < least_penetration:
        least_penetration = motion.least_penetration
    speed = motion.top_speed if max_speed is None else max_speed
    frequency = max([FASTEST_PHASE / measurement.sample_time, *motion.frequencies])
    return Limits(peak_penetration, least_penetration, min(speed, law.K / law.B), frequency)


def find_better(
    given: Motion,
    measurement: PlannedMeasurement,
    limits: Limits,
    duration: float,
) -> Motion | None:
    """Return a motion within the limits with a smaller worst error of (K, B, n), or None.

    It compares the worst expected error after the duration for strokes from the peak penetration up
    to 24 heights, then to 9 around the best, all at the highest speed, for three shapes: the
    planned sines in their proportions, a single sine, and a sine with a small second one, which
    does not repeat. If the planned motion is within the limits, the gain must be at least 2 %.
    """
    if limits.speed == 0.0:
        return None
    top = limits.peak_penetration * (1.0 - _SLACK)
    bottom = limits.least_penetration + limits.peak_penetration * _SLACK
    heights = np.linspace(bottom, bottom + 0.95 * (top - bottom), 24)
    step = float(heights[1] - heights[0])

    best = given
    least = math.inf
    best_shape = given

    def look(shape: Motion, heights: Floats) -> None:
        nonlocal best, least, best_shape
        for height in heights.tolist():
            candidate = _stroke(shape, top, height, limits)
            # The bound is fast to compute, and no expected error is less.
            if measurement.relative_errors(candidate, duration, quick=True).max() >= least:
                continue
            error = float(measurement.expected_errors(candidate, duration, quick=True).max())
            if error < least:
                best = candidate
                least = error
                best_shape = shape

    for shape in _shapes(given):
        look(shape, heights)
    if math.isinf(least):
        return None
    low = best.least_penetration - step
    high = best.least_penetration + step
    look(best_shape, np.linspace(max(bottom, low), min(heights[-1], high), 9))
    exact = measurement.expected_errors(best, duration).max()
    before = measurement.expected_errors(given, duration).max()
    gains = exact < (1.0 - LEAST_GAIN) * before
    return best if gains or not limits.allow(given) else None


def _shapes(motion: Motion) -> Iterator[Motion]:
    """Motions to be scaled: only the proportions of their sines count."""
    if motion.top_speed > 0.0:
        yield motion
    yield Motion(1.0, (1.0,), (1.0,))
    yield Motion(1.0, (1.0, 0.05), (1.0, 0.5 * (1.0 + math.sqrt(5.0))))


def _stroke(shape: Motion, top: float, bottom: float, limits: Limits) -> Motion:
    """Return the shape's sines between two depths, as fast as the limits allow, in few digits."""
    scale = 0.5 * (top - bottom) / math.fsum(shape.amplitudes)
    faster = min(
        (1.0 - _SLACK) * limits.speed / (scale * shape.top_speed),
        (1.0 - _SLACK) * limits.frequency / max(shape.frequencies),
    )
    return Motion(
        _round_for_typing(0.5 * (top + bottom)),
        tuple(_round_for_typing(scale * a) for a in shape.amplitudes),
        tuple(_round_for_typing(faster * w) for w in shape.frequencies),
    )


def _round_for_typing(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


# The precision of one planned motion on a guessed material.

TARGETS = (0.05, 0.01)


@frozen(eq=False)
class PredictedPrecision:
    """The predicted precision of one motion on a guessed material.

    Attributes
    ----------
    motion : Motion
        The motion.
    durations : tuple of float
        s, increasing.
    relative_errors : numpy.ndarray, shape (durations, 3)
        Lower bound of the relative standard errors of (K, B, n) after each duration (Cramér–Rao);
        infinite for a parameter that the motion does not identify.
    expected_errors : numpy.ndarray, shape (durations, 3)
        Relative RMS errors of least squares, including the sensor's rounding.
    targets : tuple of float
        5 % and 1 %.
    times : numpy.ndarray, shape (targets, 3)
        Time after which (K, B, n) can be within each target, s; infinite above 1000 s.
    least_penetration, peak_penetration : float
        Least and largest penetration within the longest duration, m.
    peak_speed, rms_speed : float
        m/s, in contact, within the longest duration.
    violated_fraction : float
        Fraction of the contact at or above the speed limit of eq. 10; NaN without contact.
    peak_force : float
        N.
    notes : tuple of str
        Warnings about the motion.
    """

    motion: Motion
    durations: tuple[float, ...]
    relative_errors: Floats
    expected_errors: Floats
    targets: tuple[float, ...]
    times: Floats
    least_penetration: float
    peak_penetration: float
    peak_speed: float
    rms_speed: float
    violated_fraction: float
    peak_force: float
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        errors = ", ".join(map(percent, self.expected_errors[-1]))
        return f"<PredictedPrecision after {self.durations[-1]:g} s: K, B, n to {errors}>"

    def describe(self, symbols: Sequence[str]) -> str:
        """Return the relative standard error of each parameter after the longest duration."""
        pairs = zip(symbols, map(percent, self.expected_errors[-1]), strict=True)
        errors = "  ".join(f"{symbol} ± {error}" for symbol, error in pairs)
        return f"{errors}  after {self.durations[-1]:g} s"

    @property
    def leaves_contact(self) -> bool:
        """Whether the probe reaches the surface or leaves it within the longest duration."""
        return self.least_penetration <= 0.0

    @property
    def worst(self) -> float:
        """Largest expected error after the longest duration."""
        return float(self.expected_errors[-1].max())

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and text; infinite or undefined numbers are None."""
        names = HuntCrossley.names()

        def rows(key: str, values: Sequence[float], table: Floats) -> list[dict[str, float]]:
            every = zip(values, table.tolist(), strict=True)
            return [{key: value, **dict(zip(names, row, strict=True))} for value, row in every]

        own = {field.name: getattr(self, field.name) for field in fields(self)}
        own |= {"motion": asdict(self.motion), "leaves_contact": self.leaves_contact}
        own["relative_errors"] = rows("duration", own.pop("durations"), self.relative_errors)
        own["expected_errors"] = rows("duration", self.durations, self.expected_errors)
        own["times"] = rows("relative_error", own.pop("targets"), self.times)
        whole: dict[str, Any] = plain(own)
        return whole


def predict_precision(
    motion: Motion,
    measurement: PlannedMeasurement,
    durations: tuple[float, ...],
) -> PredictedPrecision:
    """Predict the precision of a motion after each of the durations, which increase."""
    law = measurement.law
    step = measurement.sample_time
    _, x, v = motion.sampled(durations[-1], step)
    touching = x > 0.0
    speed = np.abs(v[touching])
    met = bool(speed.size)
    errors = np.array([measurement.relative_errors(motion, d) for d in durations])
    expected = np.array([measurement.expected_errors(motion, d) for d in durations])
    outward = float(v[touching].min(initial=0.0))
    notes = _notes(motion, measurement, float(x.min()), outward)
    if np.isfinite(errors[-1]).all() and (expected[-1] > 1.2 * errors[-1]).any():
        notes.append(
            "the sensor's quantisation error repeats with the motion, as the noise is below its "
            f"steps: after {durations[-1]:g} s the errors are about "
            f"{(expected[-1] / errors[-1]).max():.1f} times the bound"
        )
    return PredictedPrecision(
        motion=motion,
        durations=durations,
        relative_errors=errors,
        expected_errors=expected,
        targets=TARGETS,
        times=measurement.times_to(motion, TARGETS),
        least_penetration=float(x.min()),
        peak_penetration=float(x.max()),
        peak_speed=float(speed.max()) if met else 0.0,
        rms_speed=float(np.sqrt(np.mean(speed**2))) if met else 0.0,
        violated_fraction=float(np.mean(speed >= measurement.speed_limit)) if met else math.nan,
        peak_force=float(law.force(x, v).max()),
        notes=tuple(notes),
    )


def _notes(
    motion: Motion,
    measurement: PlannedMeasurement,
    least_penetration: float,
    outward: float,
) -> list[str]:
    notes = []
    law = measurement.law
    if motion.top_speed == 0.0:
        notes.append("the probe is held still: no parameter is identifiable")
    if least_penetration <= 0.0:
        notes.append(
            f"the probe leaves contact: it rises to {rounded(1e3 * least_penetration, 3)} mm; "
            "increase the depth to stay in contact"
        )
    if outward < -law.K / law.B:
        notes.append(
            "the probe withdraws faster than K/B = "
            f"{rounded(law.K / law.B, 3)} m/s, where the law becomes adhesive "
            "(negative force)"
        )
    fastest = max(motion.frequencies, default=0.0)
    if fastest * measurement.sample_time > FASTEST_PHASE:
        loss = 5.57 * (fastest * measurement.sample_time) ** 2
        notes.append(
            f"a velocity filter of 15 samples reduces the speed of the sine of "
            f"{rounded(fastest, 4)} rad/s by {percent(loss)}, which biases the damping"
        )
    return notes
