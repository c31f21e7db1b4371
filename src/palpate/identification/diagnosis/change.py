"""Changes of the material within the recording: their times, their number and their sizes."""

import itertools
import math
from operator import attrgetter

import numpy as np

from palpate.digits import rounded
from palpate.findings import Check, NextStep, Remedy
from palpate.force_laws import ForceLaw
from palpate.identification.diagnosis.causes import MisfitHypothesis, SeveralLaws
from palpate.identification.diagnosis.fit import WINDOWS_A_PERIOD, Fit
from palpate.method.estimators.by_law import linear_in
from palpate.method.estimators.least_squares import Fitted, least_squares, robust_covariance
from palpate.validation import Floats, frozen

BLOCKS = 48  # changes are searched for at the borders of these blocks
MOST_CHANGES = 3
WORTH_ANOTHER = 0.2  # fraction of the remaining energy that another change must remove
# A search over borders has a larger maximum than a single test: 5.4 on 196 clean recordings of
# ``benchmarks.diagnosis``, for steps far below 3 %.
SIGNIFICANT = 6.0
SMALLEST_STEP = 0.03  # relative; below it a slow drift looks like steps
FEWEST_PERIODS = 2.0  # of an episode; one stroke cannot distinguish change from relaxation
EXPONENTS = (1.0, 1.5, 2.0)  # starts: the exponent pooled over two materials is useless
_ENERGY = attrgetter("energy")


@frozen(eq=False)
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


@frozen(eq=False)
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
    law = fit.solution.law
    linear = list(range(law.linear) or linear_in(type(law)))
    if len(fit.windows) < 4 * BLOCKS or not linear:
        return None
    starts = (law.parameters[2], *EXPONENTS) if law.power_law else (math.nan,)
    fits = _EpisodeFits(fit, linear)
    starts = starts[:1] if fit.fixed else starts
    costs = {float(n): fits.block_costs(float(n), fit.solution.offset) for n in starts}
    cut = None
    energy = fit.solution.energy
    duration = float(fit.time[-1] - fit.time[0])
    for count in range(1, MOST_CHANGES + 1):
        if duration / (count + 1) <= FEWEST_PERIODS * fit.period:
            break
        cuts = (fits.cut(fits.best_borders(c, count), n, held=True) for n, c in costs.items())
        best = fits.refine_borders(min(cuts, key=_ENERGY), count)
        if best.energy > (1.0 - WORTH_ANOTHER) * energy and cut is not None:
            break
        cut = best
        energy = best.energy
    return None if cut is None else _significant_changes(fits, fits.sharpen_borders(cut))


class _EpisodeFits:
    """Fits with coefficients for each episode: of xⁿ and xⁿv for a power law, else linear ones."""

    def __init__(self, fit: Fit, linear: list[int]) -> None:
        self.fit = fit
        self.linear = linear
        self.rows = len(fit.windows)
        #: Rows at which blocks begin, and the end.
        self.edges = np.linspace(0, self.rows, BLOCKS + 1).astype(np.intp)
        #: Force minus the part of the law that does not depend on the linear parameters, N.
        self.force = fit.force
        if not fit.solution.law.linear:
            best = fit.solution
            columns = fit.solution.jacobian[:, linear]
            self.force = best.residual + best.offset + columns @ best.law.parameters[linear]
        # Cached because the searches return to the same exponents.
        self._powers: dict[tuple[float, bool], Floats] = {}

    def columns(self, exponent: float, *, logarithm: bool = False) -> Floats:
        """Return the columns of the coefficients, or their derivatives in the exponent."""
        if math.isnan(exponent):
            return self.fit.solution.jacobian[:, self.linear]
        key = exponent, logarithm
        if key not in self._powers:
            depth = np.maximum(self.fit.x, 1e-12)
            power = depth**exponent * (np.log(depth) if logarithm else 1.0)
            columns = np.column_stack([power, power * self.fit.v])
            self._powers[key] = self.fit.windows.mean(columns)
        return self._powers[key]

    def block_costs(self, exponent: float, offset: float) -> Floats:
        """Return the residual energy of a separate fit to blocks i … j − 1, shape (49, 49)."""
        basis = self.columns(exponent)
        joint = np.column_stack([basis, self.force - offset])
        products = np.add.reduceat(joint[:, :, None] * joint[:, None, :], self.edges[:-1], axis=0)
        sums = np.concatenate([np.zeros((1, *products.shape[1:])), np.cumsum(products, axis=0)])
        block_sums = sums[None, :] - sums[:, None]
        size = basis.shape[1]
        i, j = np.triu_indices(BLOCKS + 1, 1)
        normal = block_sums[i, j, :size, :size]
        right = block_sums[i, j, :size, size]
        ridge = 1e-10 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(size)
        solved = np.linalg.solve(normal + ridge, right[:, :, None])[:, :, 0]
        cost = np.full((BLOCKS + 1, BLOCKS + 1), np.inf)
        cost[i, j] = block_sums[i, j, size, size] - (solved * right).sum(axis=1)
        return cost

    def best_borders(self, cost: Floats, count: int) -> list[int]:
        """Return the rows at which ``count`` changes leave the least energy."""
        best = cost[0].copy()
        chosen = []
        for _ in range(count):
            total = best[:, None] + cost
            chosen.append(np.argmin(total, axis=0))
            best = total.min(axis=0)
        borders = []
        block = BLOCKS
        for back in reversed(chosen):
            block = int(back[block])
            borders.append(block)
        rows: list[int] = self.edges[sorted(set(borders) - {0, BLOCKS})].tolist()
        return rows

    def cut(self, borders: list[int], exponent: float, *, held: bool = False) -> Cut:
        """Fit coefficients for each episode, an offset, and a common exponent unless held."""
        linear = math.isnan(exponent)
        held = held or linear or bool(self.fit.fixed)
        start_columns = self.columns(exponent)
        count = start_columns.shape[1]
        start = 0.0 if linear else exponent
        episodes = [slice(*ends) for ends in itertools.pairwise([0, *borders, self.rows])]

        def model(parameters: Floats) -> tuple[Floats, Floats]:
            coefficients = parameters[:-2].reshape(-1, count)
            n = float(parameters[-2])
            basis = start_columns if held else self.columns(n)
            slopes = None if held else self.columns(n, logarithm=True)
            columns = np.zeros((len(basis), len(parameters)))
            for k, episode in enumerate(episodes):
                columns[episode, k * count : (k + 1) * count] = basis[episode]
                if slopes is not None:
                    columns[episode, -2] = slopes[episode] @ coefficients[k]
            columns[:, -1] = self.fit.with_offset
            residual = self.force - columns[:, :-2] @ parameters[:-2] - parameters[-1]
            return residual, columns

        high = np.full(count * len(episodes) + 2, np.inf)
        low = -high
        low[-2], high[-2] = (start, start) if held else (max(start - 0.4, 0.3), start + 0.4)
        initial = np.zeros(len(high))
        initial[-2] = start
        fitted = least_squares(model, initial, (low, high), 1e-6)
        *coefficients, n, offset = fitted.parameters.tolist()
        shares = np.reshape(coefficients, (-1, count))
        return Cut(borders, math.nan if linear else n, offset, shares, fitted)

    def refine_borders(self, start: Cut, count: int) -> Cut:
        """Return the best borders near a start, improving exponent and borders in turn."""
        cut = self.cut(start.borders, start.exponent)
        for _ in range(2):
            borders = self.best_borders(self.block_costs(cut.exponent, cut.offset), count)
            if borders == cut.borders:
                break
            refitted = self.cut(borders, cut.exponent)
            if refitted.energy >= cut.energy * (1.0 - 1e-6):
                break
            cut = refitted
        return cut

    def sharpen_borders(self, cut: Cut) -> Cut:
        """Move each border to the row from which the next law has the smaller residual.

        Then drop borders nearer than half a period to another border or to an end. A filtered
        velocity smears a change over some rows, which then look like another material. At an end
        of the recording the filter sees only half of its window.
        """
        basis = self.columns(cut.exponent)
        half = self.rows // BLOCKS
        target = self.force - cut.offset
        rows = set()
        for k, border in enumerate(cut.borders):
            nearby = slice(max(border - half, 1), min(border + half, self.rows - 1))
            residual_before, residual_after = (
                target[nearby] - basis[nearby] @ cut.coefficients[k + m] for m in (0, 1)
            )
            rows.add(
                nearby.start + int(np.argmin(np.cumsum(residual_before**2 - residual_after**2))) + 1
            )
        cut = self.cut(sorted(rows), cut.exponent)
        while cut.borders:
            lengths = np.diff(self.fit.time[[0, *cut.borders, -1]])
            if lengths.min() >= 0.5 * self.fit.period:
                break
            near_end = int(np.argmin(lengths))
            drops = {max(near_end - 1, 0), min(near_end, len(cut.borders) - 1)}
            borders = ([*cut.borders[:k], *cut.borders[k + 1 :]] for k in drops)
            cut = min((self.cut(each, cut.exponent) for each in borders), key=_ENERGY)
        return cut

    def law(self, cut: Cut, coefficients: Floats) -> ForceLaw:
        """Return the law of an episode, SI."""
        law = self.fit.solution.law
        parameters = law.parameters
        parameters[self.linear] = coefficients
        if not math.isnan(cut.exponent):
            parameters[2] = cut.exponent
        return self.fit.units.to_si(law.from_parameters(parameters))


def _significant_changes(fits: _EpisodeFits, cut: Cut) -> Changes | None:
    fit = fits.fit
    count = cut.coefficients.shape[1]
    residual = cut.least.residual
    columns = np.delete(cut.least.jacobian, [-2] if fit.with_offset else [-2, -1], axis=1)
    covariance = robust_covariance(columns, residual, fit.windows.shared)
    difference = np.hstack([-np.eye(count), np.eye(count)])
    wald = []
    for k, step in enumerate(np.diff(cut.coefficients, axis=0)):
        both = slice(k * count, (k + 2) * count)
        spread = difference @ covariance[both, both] @ difference.T
        wald.append(math.sqrt(max(float(step @ np.linalg.pinv(spread) @ step), 0.0)))
    laws = tuple(fits.law(cut, row) for row in cut.coefficients)
    values = [fit.stiffness(fit.units.to_local(law)) for law in laws]
    size = [abs(b / a - 1.0) if a else math.inf for a, b in itertools.pairwise(values)]
    if min(wald, default=0.0) <= SIGNIFICANT or max(size) <= SMALLEST_STEP:
        return None
    stats = min(wald), fit.explained_fraction(float(residual @ residual)), 0.0
    times = tuple(_border_time(fit, cut, laws, k) for k in range(len(cut.borders)))
    when = ", ".join(f"{rounded(time, 3)} s" for time in times)
    levels = " → ".join(rounded(value, 3) for value in values)
    sentence = f"the material changes at {when}: stiffness at working depth {levels} N/m"
    remedy = Remedy(NextStep.SEGMENTS)
    change = SeveralLaws(laws)
    cause = MisfitHypothesis(Check.CHANGE, *stats, sentence, remedy, change, *change.relative(fit))
    return Changes(cause, times, laws)


def _border_time(fit: Fit, cut: Cut, laws: tuple[ForceLaw, ...], border: int) -> float:
    """Return the time from which on the next law fits the samples better, s."""
    row = cut.borders[border]
    data = fit.data
    reach = 2.0 * fit.period / WINDOWS_A_PERIOD + 2.0 * data.sample_time
    middle = 0.5 * (fit.time[row - 1] + fit.time[row])
    nearby = np.flatnonzero(fit.inside & (np.abs(data.time - middle) <= reach))
    if not nearby.size:
        return float(middle)
    x = fit.penetration[nearby]
    v = data.velocity[nearby]
    force = data.force[nearby] - cut.offset
    residual_before, residual_after = (force - laws[border + m].force(x, v) for m in (0, 1))
    last = int(np.argmin(np.cumsum(residual_before**2 - residual_after**2)))
    return float(data.time[nearby[min(last + 1, nearby.size - 1)]])
