"""How precisely a planned motion identifies the parameters of a guessed law, and after how long."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.design.excitation import inverse_information, jacobian
from palpate.design.motion import Motion
from palpate.design.rounding import effective_noise, mean_rounding_error
from palpate.force_laws import HuntCrossley
from palpate.validation import Floats

#: Longest time that is looked at, s; what takes longer counts as never.
HORIZON = 1000.0
# So long every sample is counted; after it one in several stands for all, s.
_EVERY_SAMPLE = 20.0
# At most so many samples are worked on at once: memory, and where the search looks more closely.
_BLOCK = 500
# So many samples are enough for a quick look at what rounding does.
_QUICK = 20_000
# The forces, over those guessed, that rounding is averaged over.
_FORCES = (0.9, 1.0, 1.1)


@dataclass(frozen=True, slots=True)
class Measurement:
    """What a motion is measured with: the law guessed, the sensor, and what else is unknown.

    Only samples in contact (x > 0) count: the others tell nothing of the law.

    Parameters
    ----------
    law : HuntCrossley
        The material as guessed.
    noise, resolution : float
        σ of the force before it is rounded, and the step Δ that it is rounded to, N.
    sample_time : float
        s.
    offset, surface : bool
        Whether a force offset and the position of the surface are estimated along.
    """

    law: HuntCrossley
    noise: float
    resolution: float
    sample_time: float
    offset: bool
    surface: bool

    @property
    def speed_limit(self) -> float:
        """0.1 K/B, m/s (eq. 10)."""
        return 0.1 * self.law.stiffness / self.law.damping

    @property
    def effective_noise(self) -> float:
        """√(σ² + Δ²/12), N."""
        return effective_noise(self.noise, self.resolution)

    def relative_errors(self, motion: Motion, duration: float, *, quick: bool = False) -> Floats:
        """Cramér–Rao bounds of (K, B, n) over their values after a duration [s], shape (3,).

        Infinite where the motion does not tell. ``quick`` counts one sample for several.
        """
        stride = self._stride(motion) if quick else 1
        total = self._nothing()
        for index in _blocks(0, self._count(duration), stride, 20 * _BLOCK):
            total += self._information(motion, index, stride)
        return self._relative(total)

    def expected_errors(self, motion: Motion, duration: float, *, quick: bool = False) -> Floats:
        """RMS errors of least squares with a sensor that rounds, over the values, shape (3,).

        Where the noise does not blur the steps, part of the rounding is the same whenever the
        force is the same, m(F) = Σ βₖ sin 2πk(F/Δ + φ): it does not average out over a motion that
        repeats. With C = (JᵀJ)⁻¹ and the mean over φ, of which nobody knows where it lies,

            E δθ² = (σ² + Δ²/12 − Σ βₖ²/2) C + Σ βₖ²/2 [(CJᵀ cos 2πkF/Δ)² + (CJᵀ sin 2πkF/Δ)²].

        Where the steps fall depends on the guess: this is the mean over 0.9, 1 and 1.1 times the
        forces in the waves, and no less than the bound, :meth:`relative_errors`, below which only
        luck gets. Where noise blurs the steps it is the bound. ``quick`` counts one sample for
        several.
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

        Samples only ever add information (JᵀJ grows by positive semidefinite terms), so that no
        bound grows with time: the first block of samples in which a target is met is bisected.
        Every sample counts for 20 s. After it one in several stands for all, at least 64 in a
        period of the fastest sine and one in 10 ms: sums over a smooth motion, which they change
        by far less than the time is printed to. Infinite beyond ``HORIZON``.
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
        self, motion: Motion, before: Floats, index: Floats, stride: int, column: int, target: float
    ) -> int:
        """Return the least count of a block's samples that meets a target; all of them do."""
        low, high = 0, len(index)
        while high - low > 1:
            middle = (low + high) // 2
            part = before + self._information(motion, index[:middle], stride)
            if self._relative(part)[column] <= target:
                high = middle
            else:
                low = middle
        return high

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
        with np.errstate(over="ignore"):  # of a parameter next to nothing, nothing is known
            return errors / self.law.parameters

    def _nothing(self) -> Floats:
        size = 3 + self.offset + self.surface
        return np.zeros((size, size))


def _blocks(start: int, stop: int, stride: int, size: int) -> Iterator[Floats]:
    """Sample numbers from start to stop by stride, at most so many at a time."""
    for first in range(start, stop, size * stride):
        yield np.arange(first, min(stop, first + size * stride), stride, dtype=np.float64)
