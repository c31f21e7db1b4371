"""Changes of the material within the recording: their times, their number and their sizes."""

import itertools
import math
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.causes import MisfitHypothesis
from palpate.diagnosis.fit import Fit
from palpate.diagnosis.windows import WINDOWS_A_PERIOD
from palpate.digits import rounded
from palpate.estimators.least_squares import Fitted, least_squares, robust_covariance
from palpate.findings import Check
from palpate.force_laws import ForceLaw
from palpate.validation import Floats

BLOCKS = 48  # changes are searched for at the borders of these blocks
MOST_CHANGES = 3
WORTH_ANOTHER = 0.2  # fraction of the remaining energy that another change must remove
# A search over borders has a larger maximum than a single test: 5.4 on 196 clean recordings, for
# steps far below 3 %.
SIGNIFICANT = 6.0
SMALLEST_STEP = 0.03  # relative; below it a slow drift looks like steps
FEWEST_PERIODS = 2.0  # of an episode; one stroke cannot distinguish change from relaxation
EXPONENTS = (1.0, 1.5, 2.0)  # starts: the exponent pooled over two materials is useless
_ENERGY = attrgetter("energy")


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Times at which the material changes, and the laws between them.

    Attributes
    ----------
    cause : MisfitHypothesis
        For the diagnosis.
    times : tuple of float
        The borders, s.
    laws : tuple of ForceLaw
        One for each segment, SI.
    """

    cause: MisfitHypothesis
    times: tuple[float, ...]
    laws: tuple[ForceLaw, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A fit with separate coefficients for each episode and a common exponent and offset."""

    borders: list[int]  # rows at which the next episode begins
    exponent: float
    offset: float
    coefficients: Floats  # (episodes, coefficients)
    least: Fitted  # fit of coefficients, exponent and offset

    @property
    def energy(self) -> float:
        """Sum of squares of the residual, N²."""
        return float(self.least.residual @ self.least.residual)


def find_changes(fit: Fit) -> Changes | None:
    """Find changes by dynamic programming, with (k, c) for each episode and common n and F₀.

    Return None without a change that is significant (z > 6) and 3 % or more, between episodes of at
    least two periods.
    """
    rows = len(fit.windows)
    if rows < 4 * BLOCKS:
        return None
    law = fit.solution.law
    if not fit.linear:
        return None
    starts = (law.parameters[2], *EXPONENTS) if law.power_law else (math.nan,)
    starts = starts[:1] if fit.fixed else starts
    columns_of = _EpisodeColumns(fit)
    costs = {float(n): _block_costs(columns_of, float(n), fit.solution.offset) for n in starts}
    cut = None
    energy, duration = fit.solution.energy, float(fit.time[-1] - fit.time[0])
    for count in range(1, MOST_CHANGES + 1):
        if duration / (count + 1) <= FEWEST_PERIODS * fit.period:
            break
        cuts = [
            _fit_segments(columns_of, _best_borders(fit, c, count), n, held=True)
            for n, c in costs.items()
        ]
        best = _refine_borders(columns_of, min(cuts, key=_ENERGY), count)
        if best.energy > (1.0 - WORTH_ANOTHER) * energy and cut is not None:
            break
        cut, energy = best, best.energy
    return None if cut is None else _significant_changes(fit, _sharpen_borders(columns_of, cut))


class _EpisodeColumns:
    """Columns of an episode's coefficients: xⁿ and xⁿv for a power law, else the linear ones."""

    def __init__(self, fit: Fit) -> None:
        self.fit = fit
        # Cached because the searches return to the same exponents.
        self._powers: dict[tuple[float, bool], Floats] = {}

    def __call__(self, exponent: float, *, logarithm: bool = False) -> Floats:
        fit = self.fit
        if math.isnan(exponent):
            return fit.solution.jacobian[:, fit.linear]
        key = exponent, logarithm
        if key not in self._powers:
            depth = np.maximum(fit.x, 1e-12)
            power = depth**exponent * (np.log(depth) if logarithm else 1.0)
            self._powers[key] = fit.windows.mean(np.column_stack([power, power * fit.v]))
        return self._powers[key]


def _refine_borders(columns_of: _EpisodeColumns, start: Cut, count: int) -> Cut:
    """Return the best ``count`` borders near a start, improving exponent and borders in turn."""
    fit = columns_of.fit
    cut = _fit_segments(columns_of, start.borders, start.exponent)
    for _ in range(2):
        borders = _best_borders(fit, _block_costs(columns_of, cut.exponent, cut.offset), count)
        if borders == cut.borders:
            break
        again = _fit_segments(columns_of, borders, cut.exponent)
        if again.energy >= cut.energy * (1.0 - 1e-6):
            break
        cut = again
    return cut


def _block_costs(columns_of: _EpisodeColumns, exponent: float, offset: float) -> Floats:
    """Residual energy of a separate fit to blocks i … j − 1, shape (49, 49)."""
    fit = columns_of.fit
    basis = columns_of(exponent)
    joint = np.column_stack([basis, fit.by_linear - offset])
    products = np.add.reduceat(joint[:, :, None] * joint[:, None, :], _edges(fit)[:-1], axis=0)
    sums = np.concatenate([np.zeros((1, *products.shape[1:])), np.cumsum(products, axis=0)])
    block_sums = sums[None, :] - sums[:, None]
    size = basis.shape[1]
    i, j = np.triu_indices(BLOCKS + 1, 1)
    normal, right = block_sums[i, j, :size, :size], block_sums[i, j, :size, size]
    ridge = 1e-10 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(size)
    solved = np.linalg.solve(normal + ridge, right[:, :, None])[:, :, 0]
    cost = np.full((BLOCKS + 1, BLOCKS + 1), np.inf)
    cost[i, j] = block_sums[i, j, size, size] - (solved * right).sum(axis=1)
    return cost


def _edges(fit: Fit) -> NDArray[np.intp]:
    """Return the rows at which blocks begin, and the end."""
    return np.linspace(0, len(fit.windows), BLOCKS + 1).astype(np.intp)


def _best_borders(fit: Fit, cost: Floats, count: int) -> list[int]:
    """Return the rows at which ``count`` changes leave the least energy."""
    best, chosen = cost[0].copy(), []
    for _ in range(count):
        total = best[:, None] + cost
        chosen.append(np.argmin(total, axis=0))
        best = total.min(axis=0)
    borders, at = [], BLOCKS
    for back in reversed(chosen):
        at = int(back[at])
        borders.append(at)
    rows: list[int] = _edges(fit)[sorted(set(borders) - {0, BLOCKS})].tolist()
    return rows


def _episodes(fit: Fit, borders: list[int]) -> list[slice]:
    """Return the rows of each episode."""
    return list(itertools.starmap(slice, itertools.pairwise([0, *borders, len(fit.windows)])))


def _fit_segments(
    columns_of: _EpisodeColumns, borders: list[int], exponent: float, *, held: bool = False
) -> Cut:
    """Fit coefficients for each episode, a common offset, and a common exponent unless held."""
    fit = columns_of.fit
    parts, linear = _episodes(fit, borders), math.isnan(exponent)
    held = held or linear or bool(fit.fixed)
    first = columns_of(exponent)
    count, start = first.shape[1], 0.0 if linear else exponent

    def model(parameters: Floats) -> tuple[Floats, Floats]:
        coefficients, n = parameters[:-2].reshape(-1, count), float(parameters[-2])
        basis = first if held else columns_of(n)
        slopes = None if held else columns_of(n, logarithm=True)
        columns = np.zeros((len(basis), len(parameters)))
        for k, part in enumerate(parts):
            columns[part, k * count : (k + 1) * count] = basis[part]
            if slopes is not None:
                columns[part, -2] = slopes[part] @ coefficients[k]
        columns[:, -1] = fit.with_offset
        residual = fit.by_linear - columns[:, :-2] @ parameters[:-2] - parameters[-1]
        return residual, columns

    high = np.full(count * len(parts) + 2, np.inf)
    low = -high
    low[-2], high[-2] = (start, start) if held else (max(start - 0.4, 0.3), start + 0.4)
    initial = np.zeros(len(high))
    initial[-2] = start
    fitted = least_squares(model, initial, (low, high), 1e-6)
    *coefficients, n, offset = fitted.parameters.tolist()
    shares = np.reshape(coefficients, (-1, count))
    return Cut(borders, math.nan if linear else n, offset, shares, fitted)


def _sharpen_borders(columns_of: _EpisodeColumns, cut: Cut) -> Cut:
    """Move each border to the row from which the next law has the smaller residual."""
    fit = columns_of.fit
    basis, half = columns_of(cut.exponent), len(fit.windows) // BLOCKS
    target = fit.by_linear - cut.offset
    borders = []
    for k, border in enumerate(cut.borders):
        near = slice(max(border - half, 1), min(border + half, len(target) - 1))
        left, right = (target[near] - basis[near] @ cut.coefficients[k + m] for m in (0, 1))
        borders.append(near.start + int(np.argmin(np.cumsum(left**2 - right**2))) + 1)
    return _drop_slivers(columns_of, _fit_segments(columns_of, sorted(set(borders)), cut.exponent))


def _drop_slivers(columns_of: _EpisodeColumns, cut: Cut) -> Cut:
    """Drop borders nearer than half a period to another border or to an end.

    A filtered velocity smears a change over some rows, which then look like another material. At an
    end of the recording the filter sees only half of its window.
    """
    fit = columns_of.fit
    while True:
        lengths = np.diff(fit.time[[0, *cut.borders, -1]])
        if not cut.borders or lengths.min() >= 0.5 * fit.period:
            return cut
        near = int(np.argmin(lengths))
        drops = {max(near - 1, 0), min(near, len(cut.borders) - 1)}
        kept = [[b for k, b in enumerate(cut.borders) if k != drop] for drop in drops]
        cut = min((_fit_segments(columns_of, each, cut.exponent) for each in kept), key=_ENERGY)


def _segment_law(fit: Fit, cut: Cut, coefficients: Floats) -> ForceLaw:
    law = fit.solution.law
    parameters = law.parameters
    parameters[fit.linear] = coefficients
    if not math.isnan(cut.exponent):
        parameters[2] = cut.exponent
    return law.from_parameters(parameters)


def _significant_changes(fit: Fit, cut: Cut) -> Changes | None:
    count, residual = cut.coefficients.shape[1], cut.least.residual
    columns = np.delete(cut.least.jacobian, [-2] if fit.with_offset else [-2, -1], axis=1)
    covariance = robust_covariance(columns, residual, fit.windows.shared)
    steps = np.diff(cut.coefficients, axis=0)
    wald = []
    for k, step in enumerate(steps):
        first, second = slice(k * count, (k + 1) * count), slice((k + 1) * count, (k + 2) * count)
        spread = covariance[first, first] + covariance[second, second]
        spread = spread - covariance[first, second] - covariance[second, first]
        wald.append(math.sqrt(max(float(step @ np.linalg.pinv(spread) @ step), 0.0)))
    laws = tuple(fit.units.restored(_segment_law(fit, cut, row)) for row in cut.coefficients)
    values = [fit.stiffness(fit.units.local(law)) for law in laws]
    size = [abs(b / a - 1.0) if a else math.inf for a, b in itertools.pairwise(values)]
    if min(wald, default=0.0) <= SIGNIFICANT or max(size) <= SMALLEST_STEP:
        return None
    stats = min(wald), fit.explained_fraction(float(residual @ residual)), 0.0
    times = tuple(_border_time(fit, cut, laws, k) for k in range(len(cut.borders)))
    when = ", ".join(f"{rounded(time, 3)} s" for time in times)
    levels = " → ".join(rounded(value, 3) for value in values)

    sentence = f"the material changes at {when}: stiffness at working depth {levels} N/m"
    remedy = "identify each segment separately: --changes"
    change = SeveralLaws(laws)
    cause = MisfitHypothesis(Check.CHANGE, *stats, sentence, remedy, change, *change.relative(fit))
    return Changes(cause, times, laws)


@dataclass(frozen=True, slots=True, eq=False)
class SeveralLaws:
    """Consecutive laws, SI; the one whose stiffness differs most counts."""

    laws: tuple[ForceLaw, ...]

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness at the fit's depth over its scale, and 0 for damping."""
        pooled = fit.stiffness(fit.solution.law)
        changes = (fit.stiffness(fit.units.local(law)) - pooled for law in self.laws)
        return max(changes, key=abs) / fit.reference_scales[0], 0.0


def _border_time(fit: Fit, cut: Cut, laws: tuple[ForceLaw, ...], border: int) -> float:
    """Return the time from which on the next law fits the samples better, s."""
    row, data = cut.borders[border], fit.data
    reach = 2.0 * fit.period / WINDOWS_A_PERIOD + 2.0 * data.sample_time
    middle = 0.5 * (fit.time[row - 1] + fit.time[row])
    near = np.flatnonzero(fit.inside & (np.abs(data.time - middle) <= reach))
    if not near.size:
        return float(middle)
    x, v = fit.penetration[near], data.velocity[near]
    force = data.force[near] - cut.offset
    before, after = (force - laws[border + m].force(x, v) for m in (0, 1))
    last = int(np.argmin(np.cumsum(before**2 - after**2)))
    return float(data.time[near[min(last + 1, near.size - 1)]])
