"""Stiffness K′ and damping B′ of the selected law from all samples, with valid error bars.

The residual of such a law is correlated, its spectrum is estimated too, and the law's own
covariance is too small if a stiffness is held at 0. An error bar therefore has two parts
(``docs/explain/relaxation.md``): the largest sandwich over blocks of the residual, and the spread
over laws that fit equally well. The diagnosis adds the rest.
"""

import math
from functools import cached_property

import numpy as np

import palpate._core as _core
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.method.estimators.law_verdicts import CANDIDATES, Candidate
from palpate.method.estimators.viscoelastic import ViscoelasticContact, build_law, dynamic_response
from palpate.method.rows import count_true
from palpate.validation import Floats, Mask, frozen

# A law fits equally well if its rms error is at most this multiple of the least.
AS_WELL = 1.05
FEWEST_BLOCKS = 10
# The force is late if a damper of free sign is below this, in standard errors. It flagged 2 of 213
# contacts without a fault, and 82 and 45 % of 33 contacts with forces 10 and 3 ms late.
LATE = -2.5
# Sets of relaxation times, one bit each, that alternative laws exclude: none, every second, the
# others, the shortest.
_LEFT_OUT = (0, 0x555555, 0xAAAAAA, 1)
# Up to this time after contact a force in air may come from the material, s.
_SETTLED = 0.5
_STEP = 1e-3  # step of the exponent for its derivative


@frozen(eq=False)
class Oscillation:
    """Small oscillations by the selected law of an estimator and by the laws that fit as well.

    Attributes
    ----------
    laws : tuple of GeneralisedHuntCrossley
        The laws that fit as well as the best; the first is the estimate's.
    delay : float
        Lower bound of the force's delay, s, from a damper of free sign; 0 if it is not late.
    """

    laws: tuple[GeneralisedHuntCrossley, ...]
    delay: float
    _columns: "_Columns"

    def __repr__(self) -> str:
        return f"<Oscillation by {len(self.laws)} laws that fit as well, the first {self.laws[0]}>"

    @classmethod
    def of(
        cls,
        estimator: ViscoelasticContact,
        penetration: Floats,
        velocity: Floats,
        force: Floats,
        time_steps: Floats,
        taken: Mask,
    ) -> "Oscillation | None":
        """Return the small oscillations from an estimator's samples; None without a verdict.

        Parameters
        ----------
        estimator : ViscoelasticContact
            After all its samples, with nothing pending.
        penetration, velocity, force, time_steps : numpy.ndarray, shape (k,)
            The estimator's samples, in order: m, m/s, N and s.
        taken : numpy.ndarray of bool, shape (k,)
            Whether the estimator learned from each sample.
        """
        evidence = estimator.evidence()
        candidate = CANDIDATES[evidence.chosen]
        if not (evidence.rows and np.count_nonzero(taken) > 1):
            return None
        samples = _Samples(estimator, penetration, velocity, force, time_steps, taken)
        times, numbers, _, _ = estimator._spectrum().numbers()
        columns = _Columns(samples, candidate, numbers)
        fits = [
            estimator._beside(index, left_out, False)
            for index, law in enumerate(CANDIDATES)
            if law in evidence.laws
            for left_out in (_LEFT_OUT if law.memory != "none" else (0,))
        ]
        least = min(mean_square for mean_square, _, _ in fits)
        equivalent = (
            build_law(times, parameters)
            for mean_square, parameters, _ in fits
            if mean_square <= AS_WELL**2 * least
        )
        laws = build_law(times, numbers), *equivalent
        # At a start in contact the columns of the unknown state absorb a lag, or imitate one: 18 of
        # 96 contacts were flagged.
        relaxes = candidate.memory != "none" and not evidence.begun
        delay = _delay(samples, evidence.laws, evidence.depth) if relaxes else 0.0
        return cls(laws, delay, columns)

    def at(self, depth: float, frequency: float) -> tuple[Floats, Floats]:
        """K′ [N/m] and B′ [N·s/m] at a depth [m] and a frequency ω [rad/s], each shape (2,).

        Returns
        -------
        tuple of numpy.ndarray
            The numbers, and their statistical standard errors from the largest sandwich.
        """
        law = self.laws[0]
        return dynamic_response(law, depth, frequency), self._columns.standard_errors(
            depth,
            frequency,
        )

    def stiffness_after(self, depth: float, time: float) -> tuple[float, float, float]:
        """Stiffness a time [s] after a small step at a depth [m], its error and its spread, N/m.

        The statistical standard error is from the largest sandwich; the spread is the largest
        distance of the laws that fit as well.
        """
        value = self.laws[0].stiffness_after(depth, time)
        others = [law.stiffness_after(depth, time) for law in self.laws]
        error = self._columns.error_after(depth, time)
        return value, error, float(np.max(np.abs(np.array(others) - value)))

    def spread(self, values: Floats, depth: float, frequency: float) -> Floats:
        """Largest distances of K′ and B′ by the laws that fit as well from these values."""
        others = np.array([dynamic_response(law, depth, frequency) for law in self.laws])
        distances: Floats = np.abs(others - values).max(axis=0)
        return distances


def _delay(samples: "_Samples", laws: tuple[Candidate, ...], depth: float) -> float:
    """Lower bound of the force's delay, s: −B′/K∞ if the damper is clearly negative, else 0.

    It uses the damping form that fits best with a damper of any sign.
    """
    free = [
        (*samples.estimator._beside(CANDIDATES.index(law), 0, True)[:2], law)
        for law in laws
        if law.memory != "none" and law.damping != "none"
    ]
    if not free:
        return 0.0
    _, numbers, law = min(free, key=lambda each: each[0])
    only_damper = np.zeros((1, len(numbers)))
    only_damper[0, 2] = 1.0
    error = _Columns(samples, law, numbers).errors(only_damper)[0]
    if not numbers[2] < LATE * error < 0.0:
        return 0.0
    n = numbers[1]
    p = numbers[3]
    stiffness = n * depth ** (n - 1.0) * (numbers[0] + numbers[4:].sum())
    return float(-numbers[2] * depth**p / stiffness)


class _Samples:
    """The whole path of the probe, and the samples that inform the law.

    These are the samples taken, and those in free air, which inform only the offset; free air is
    excluded if the contact contradicts it.
    """

    def __init__(
        self,
        estimator: ViscoelasticContact,
        penetration: Floats,
        velocity: Floats,
        force: Floats,
        steps: Floats,
        taken: Mask,
    ) -> None:
        self.estimator = estimator
        self.steps = steps
        self.path = np.where(np.isfinite(penetration), np.maximum(penetration, 0.0), 0.0)
        self.clock = np.cumsum(steps) - steps[0]
        self.rows = np.flatnonzero(taken | self._air(penetration, force, taken))
        self.contact = taken[self.rows]
        self.depth = self.path[self.rows]
        self.velocity = velocity[self.rows]
        self.force = force[self.rows]

    def _air(
        self,
        penetration: Floats,
        force: Floats,
        taken: Mask,
    ) -> Mask:
        """Whether each sample is one of the selected free-air samples, at most as many as taken."""
        touched = np.maximum.accumulate(np.where(self.path > 0.0, self.clock, -np.inf))
        air = (penetration < 0.0) & (self.clock - touched > _SETTLED) & np.isfinite(force)
        free = np.flatnonzero(air)
        estimate = self.estimator.estimate()
        if not (free.size and self.estimator.settings["offset"]):
            return np.zeros_like(taken)
        away = abs(float(np.mean(force[free])) - estimate.offset)
        if away > 5.0 * math.hypot(estimate.offset_standard_error, float(np.std(force[free]))):
            return np.zeros_like(taken)
        selected = np.zeros_like(taken)
        selected[free[:: -(-free.size // max(count_true(taken), 1))]] = True
        return selected


class _Columns:
    """The columns of a law's parameters at the samples, and the residual of the force.

    Parameters that are 0 are held there, except the damper's: held at 0 it would have no error.
    """

    def __init__(self, samples: _Samples, candidate: Candidate, numbers: Floats) -> None:
        self.candidate = candidate
        self.numbers = numbers
        self._errors = dict[tuple[float, float], Floats]()
        times, _, _, start = samples.estimator._spectrum().numbers()
        self.times = times
        active = np.flatnonzero(numbers[4:])
        n = numbers[1]
        steps = samples.steps
        path = samples.path
        rows = samples.rows
        states, moved = (
            _core.relaxation_states(each, times[active], steps, path)[rows]
            for each in (n, n + _STEP)
        )
        depth = np.where(samples.contact, samples.depth, 1.0)
        elastic = depth**n
        further = depth ** (n + _STEP)
        damper, damper_further = (
            depth ** _power(candidate, each) * samples.velocity for each in (n, n + _STEP)
        )
        by_exponent = numbers[0] * (further - elastic) + numbers[2] * (damper_further - damper)
        by_exponent += (moved - states) @ numbers[4 + active]
        columns = {4 + k: states[:, j] for j, k in enumerate(active.tolist())}
        if candidate.damping != "none":
            columns[2] = damper
        if numbers[0]:
            columns[0] = elastic
        if samples.estimator.fixed == () and not candidate.linear:
            columns[1] = by_exponent / _STEP
        others = []
        if samples.estimator.evidence().begun:
            clock = samples.clock[rows]
            others = [np.exp(-clock / time) for _, time in start]
        inside = [np.where(samples.contact, each, 0.0) for each in (*columns.values(), *others)]
        constant = [np.ones_like(depth)] if samples.estimator.settings["offset"] else []
        self.moved = list(columns)
        matrix = np.column_stack([*inside, *constant])
        self.sizes = np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-300)
        self.matrix = matrix / self.sizes
        self.inverse = np.linalg.pinv(self.matrix.T @ self.matrix, rcond=1e-12, hermitian=True)
        solved = self.inverse @ (self.matrix.T @ samples.force)
        self.residual = samples.force - self.matrix @ solved

    @cached_property
    def scores(self) -> Floats:
        """Σ s sᵀ with s = Σ a r over blocks of 1, 2, 4 … rows, scaled to the count of all rows."""
        sums = self.matrix * self.residual[:, None]
        rows = len(self.residual)
        sums_by_size: list[Floats] = []
        while len(sums) >= FEWEST_BLOCKS or not sums_by_size:
            blocks = len(sums)
            used = blocks * (rows // blocks)
            sums_by_size.append(rows / used * blocks / max(blocks - 1, 1) * (sums.T @ sums))
            sums = sums[: blocks // 2 * 2].reshape(blocks // 2, 2, -1).sum(axis=1)
        return np.array(sums_by_size)

    def errors(self, gradient: Floats) -> Floats:
        """Standard errors of functions of the numbers with this gradient, shape (m, 4 + rungs)."""
        scaled = np.zeros((len(gradient), len(self.sizes)))
        scaled[:, : len(self.moved)] = gradient[:, self.moved] / self.sizes[: len(self.moved)]
        weights = scaled @ self.inverse
        variances = np.einsum("ij,kjl,il->ki", weights, self.scores, weights)
        errors: Floats = np.sqrt(np.maximum(variances.max(axis=0), 0.0))
        return errors

    def standard_errors(self, depth: float, frequency: float) -> Floats:
        """Standard errors of K′ and B′, computed once for a depth and a frequency."""
        place_of_motion = (depth, frequency)
        if place_of_motion in self._errors:
            return self._errors[place_of_motion]
        gradient = np.zeros((2, len(self.numbers)))
        for place in self.moved:
            size = abs(self.numbers[place]) or 1e-3 * np.abs(self.numbers).max()
            step = _STEP if place == 1 else 1e-4 * size
            for side in (step, -step):
                numbers = self.numbers.copy()
                numbers[place] += side
                numbers[3] = _power(self.candidate, numbers[1])
                law = build_law(self.times, numbers)
                gradient[:, place] += dynamic_response(law, depth, frequency) / (2.0 * side)
        self._errors[place_of_motion] = self.errors(gradient)
        return self._errors[place_of_motion]

    def error_after(self, depth: float, time: float) -> float:
        """Standard error of n xⁿ⁻¹ [K + Σ mᵢ exp(−t/τᵢ)] by the delta method."""
        stiffness, n = self.numbers[:2]
        slope = n * depth ** (n - 1.0)
        left = np.exp(-time / self.times)
        gradient = np.zeros((1, len(self.numbers)))
        gradient[0, 0] = slope
        gradient[0, 4:] = slope * left
        whole = slope * (stiffness + float(self.numbers[4:] @ left))
        gradient[0, 1] = whole * (1.0 / n + math.log(depth))
        return float(self.errors(gradient)[0])


def _power(candidate: Candidate, exponent: float) -> float:
    """The damper's exponent p."""
    if candidate.damping == "linear":
        return 0.0
    return exponent - 1.0 if candidate.damping == "half-space" else exponent
