"""A row of MuJoCo's whose force goes as a power of depth: solimp by least squares.

With d ∝ x^q a damper goes as x^q and a spring as x^(1 + 2q), but for 1 − d and for the 1e-4 that
every d is at least. What solimp's sigmoid can be of that is fitted: its low end, width, midpoint
and power, and how far below the surface it begins. The scale is linear, and solved for.
"""

from dataclasses import dataclass

import numpy as np

from palpate.exports.mujoco.rows import LEAST, MOST, impedance
from palpate.validation import Floats

# Of low/high, midpoint, power, width/deepest and inset/deepest. A sigmoid from its midpoint on
# depends on power/width only once both are large: beyond these nothing gets better (measured).
_LOWEST = np.array([0.0, LEAST, 1.0, 1.0, 0.0])
_HIGHEST = np.array([1.0, MOST, 16.0, 5.0, 0.2])
# Points of the first lattice, in each direction.
_LATTICE = (4, 5, 6, 4, 4)
# The best so many of them are gone on from, by steps that shrink where none of a cloud is better.
# Five times as many points fit no better (measured: by 0.003 % of force).
_KEPT, _CLOUD, _ROUNDS, _SHRINK = 3, 60, 60, 0.6
_SEED = 20121
# Misfits count in N over the fourth root of the force there: by the force alone (0) a spring of
# n = 1.5 is 10 % off at a seventh of the depth, 33 % at a fourteenth and .21 % on the paper's
# motion; so 6 %, 26 % and .31 %.
_EVENNESS = 0.25


@dataclass(frozen=True, slots=True)
class Profile:
    """d(x) of a row, and the factor that makes it the power wanted.

    Attributes
    ----------
    solimp : tuple of float
        (d₀, d_w, width, midpoint, power).
    inset : float
        How far below the surface it begins, m.
    scale : float
        Of d/(1 − d) for a damper, of d² x/(1 − d) for a spring.
    """

    solimp: tuple[float, float, float, float, float]
    inset: float
    scale: float


def constant(level: float, width: float, coefficient: float) -> Profile:
    """One impedance at every depth: a linear spring, or a damper that does not know depth."""
    return Profile((level, level, width, 0.5, 2.0), 0.0, coefficient)


def damper(depths: Floats, target: Floats, high: float, *, low: bool) -> Profile:
    """Of a damper, N·s/m at the depths [m] that count, the deepest of them the last.

    ``low``: whether d may begin above the least that there is, as it has to for less than x¹.
    """
    return _fitted(depths, target, high, spring=False, low=low)


def spring(depths: Floats, target: Floats, high: float) -> Profile:
    """Of a spring, N at the depths [m] that count, the deepest of them the last."""
    return _fitted(depths, target, high, spring=True, low=True)


def _fitted(depths: Floats, target: Floats, high: float, *, spring: bool, low: bool) -> Profile:
    deepest = float(depths[-1])
    highest = _HIGHEST.copy()
    if not low:
        highest[0] = 0.0  # a power of 1 or more begins at the least that there is
    if spring:
        highest[4] = 0.0  # near the surface a spring has no force to miss
    fit = _Fit(depths, target, high, spring)
    best = _search(fit, _LOWEST, highest)
    ratio, midpoint, power, width, inset = best.tolist()
    scale = float(fit.judge(best[None])[1][0])
    solimp = (max(ratio * high, LEAST), high, width * deepest, midpoint, power)
    return Profile(solimp, inset * deepest, scale)


@dataclass(frozen=True, slots=True)
class _Fit:
    depths: Floats
    target: Floats
    high: float
    spring: bool

    def judge(self, tried: Floats) -> tuple[Floats, Floats]:
        """Of each row of candidates the squared misfit, and the scale that has the least."""
        ratio, midpoint, power, width, inset = (column[:, None] for column in tried.T)
        deepest = self.depths[-1]
        inside = np.maximum(self.depths - inset * deepest, 0.0)
        low = np.maximum(ratio * self.high, LEAST)
        d = impedance(inside, low, self.high, width * deepest, midpoint, power)
        d = np.where(inside > 0.0, d, 0.0)
        shape = d / (1.0 - d) * (d * inside if self.spring else 1.0)
        shape = shape / self.target**_EVENNESS
        target = self.target ** (1.0 - _EVENNESS)
        scale = (shape @ target) / np.einsum("ij,ij->i", shape, shape)
        misfit = scale[:, None] * shape - target
        return np.einsum("ij,ij->i", misfit, misfit), scale


def _search(fit: _Fit, lowest: Floats, highest: Floats) -> Floats:
    """The best of a lattice, and of what is near its best points; the same on every run."""
    random = np.random.default_rng(_SEED)
    ends = zip(lowest, highest, _LATTICE, strict=True)
    axes = [np.linspace(a, b, count) if b > a else np.array([a]) for a, b, count in ends]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
    misfits = fit.judge(lattice)[0]
    spacing = (highest - lowest) / (np.array(_LATTICE) - 1)
    found = []
    for first in np.argsort(misfits)[:_KEPT]:
        best, least, step = lattice[first], misfits[first], spacing
        for _ in range(_ROUNDS):
            cloud = best + step * random.standard_normal((_CLOUD, best.size))
            cloud = np.clip(cloud, lowest, highest)
            values = fit.judge(cloud)[0]
            nearest = int(values.argmin())
            if values[nearest] < least:
                best, least = cloud[nearest], values[nearest]
            else:
                step = _SHRINK * step
        found.append((float(least), best))
    nearest_of_all: Floats = min(found, key=lambda each: each[0])[1]
    return nearest_of_all
