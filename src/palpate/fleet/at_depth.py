"""Force, stiffness and damping of many Hunt–Crossley laws, each at its own working depth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.curves import CurveFits
from palpate.preparation.suggestions import (
    MOST_UNDECIDED,
    NOISE_FACTOR,
    decisive_depth,
    noise_of,
)
from palpate.validation import Floats

Numbers = tuple[Floats, Floats]
#: Rows that are sorted together: 32 of 1000 samples stay in a core's own memory.
_ROWS = 32
# Median of the fourth differences' size, over the deviation of normal noise.
_OF_DIFFERENCES = 0.6745 * 70.0**0.5
# So many of them know the noise to 7 %, by which a threshold moves, and its depth hardly.
_ENOUGH = 300


def working_depths(penetration: Floats, force: Floats, fits: CurveFits) -> Numbers:
    """Median and largest penetration of each row where contact is firm, m; NaN where it never is.

    Firm is what the gate of :func:`palpate.choose_gate` takes, at whose median
    :func:`palpate.identify` works: not what the law leaves decides, but the noise.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m; counted from the surfaces of the fits here.
    force : numpy.ndarray, shape (k, samples)
        N.
    fits : CurveFits
        Of these rows.
    """
    found, deepest = np.full(len(penetration), np.nan), np.full(len(penetration), np.nan)
    for start in range(0, len(penetration), _ROWS):
        some = slice(start, start + _ROWS)
        x, f = penetration[some] - fits.surface[some, None], force[some]
        firm = _firm(x, f)
        found[some] = _percentile(np.where(firm, x, np.inf), firm.sum(axis=1), 0.5)
        largest = np.where(firm, x, -np.inf).max(axis=1, initial=-np.inf)
        deepest[some] = np.where(largest > 0.0, largest, np.nan)
    return found, deepest


def _firm(x: Floats, force: Floats) -> NDArray[np.bool_]:
    """What the gate takes that is chosen from each row, as :func:`palpate.suggest_gate` does."""
    touching = (x > 0.0) & (force > 0.0)
    make, noise = _threshold(force, touching)
    least, _ = _threshold(x, touching)
    inside = touching & (x > least[:, None])
    undecided = np.abs(force - make[:, None]) < 3.0 * noise[:, None]
    light = (inside & undecided).sum(axis=1) > MOST_UNDECIDED * inside.sum(axis=1)
    firm: NDArray[np.bool_] = inside & (force > make[:, None])
    for k in np.flatnonzero(light).tolist():
        depth = decisive_depth(x[k], force[k], touching[k], make[k], least[k])
        if depth is not None:
            firm[k] &= x[k] > depth
    return firm


def _threshold(values: Floats, touching: NDArray[np.bool_]) -> Numbers:
    """Ten times the noise, within 1 % and 10 % of the largest value; and the noise."""
    largest = _largest(np.where(touching, values, -np.inf), touching.sum(axis=1))
    noise = _noise_of(values)
    return np.clip(NOISE_FACTOR * noise, 0.01 * largest, 0.10 * largest), noise


def _largest(values: Floats, counts: "np.ndarray[tuple[int], np.dtype[np.int64]]") -> Floats:
    """The 99th percentile of so many of each row, by sorting no more than the top hundredth."""
    few = min(values.shape[1] // 100 + 2, values.shape[1])
    top = np.sort(np.partition(values, -few, axis=1)[:, -few:], axis=1)
    place = few - 1 - 0.01 * np.maximum(counts - 1, 0)
    low = place.astype(np.int64)
    rows, part = np.arange(len(values)), place - low
    with np.errstate(invalid="ignore"):  # of rows that touch nothing
        above = top[rows, np.minimum(low + 1, few - 1)]
        found: Floats = top[rows, low] + np.where(part > 0.0, part * (above - top[rows, low]), 0.0)
    return np.where(counts > 0, found, np.nan)


def _noise_of(values: Floats) -> Floats:
    """As :func:`palpate.preparation.suggestions.noise_of`, of each row."""
    if values.shape[1] < 5 or not np.isfinite(values).all():
        return np.array([noise_of(row) for row in values])
    every = max(values.shape[1] // _ENOUGH, 1)
    differences = np.abs(np.diff(values, n=4, axis=1)[:, ::every])
    found: Floats = np.median(differences, axis=1) / _OF_DIFFERENCES
    return found


def _percentile(
    values: Floats, counts: "np.ndarray[tuple[int], np.dtype[np.int64]]", part: float
) -> Floats:
    """A percentile of the first so many of each row, once sorted, by linear interpolation."""
    order = np.sort(values, axis=1)
    place = part * np.maximum(counts - 1, 0)
    low = place.astype(np.int64)
    high = np.minimum(low + 1, np.maximum(counts - 1, 0))
    rows = np.arange(len(values))
    left, right = order[rows, low], order[rows, high]
    with np.errstate(invalid="ignore"):
        found: Floats = left + (place - low) * (right - left)
    return np.where(counts > 0, found, np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class LawsAtDepth:
    """Values and standard errors, SI, one a row.

    F = K xⁿ, S = n K xⁿ⁻¹, C = B xⁿ with x = X − d: at the place X where the probe was, so that
    what is not known of the surface d moves them as little as it moves the force there.
    """

    force: Numbers
    stiffness: Numbers
    damping: Numbers

    @classmethod
    def of(cls, fits: CurveFits, depth: Floats) -> "LawsAtDepth":
        """Return them for each fit at its own depth, m; NaN where that is."""
        with np.errstate(all="ignore"):
            k, c, n = fits.stiffness, fits.damping, fits.exponent
            power, log, none = depth**n, np.log(depth), np.zeros_like(depth)
            force, damping = k * power, c * power
            stiffness = n * force / depth
            bend = (n - 1.0) * stiffness / depth
            # By K, B, n, F₀ and d.
            of_force = [power, none, log * force, none, -stiffness]
            of_stiffness = [
                n * power / depth, none, (1.0 / n + log) * stiffness, none, -bend,
            ]  # fmt: skip
            of_damping = [none, power, log * damping, none, -n * damping / depth]
            return cls(
                (force, _error(of_force, fits)),
                (stiffness, _error(of_stiffness, fits)),
                (damping, _error(of_damping, fits)),
            )


def _error(gradient: list[Floats], fits: CurveFits) -> Floats:
    """√(gᵀ C g) of each row."""
    g = np.stack(gradient, axis=1)
    variance = np.einsum("ki,kij,kj->k", g, fits.covariance, g)
    found: Floats = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    return found
