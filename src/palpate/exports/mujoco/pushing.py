"""Two rows that only push, for a MuJoCo whose contacts cannot pull.

Where a damper alone would have to pull, each row needs a spring too, and both are looked for at
once: the shapes d(x) by differential evolution, and for each shape the springs S₁, S₂ and dampers
D₁, D₂ ≥ 0 by least squares, over the motion and over two free impacts.
"""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from palpate.exports.errors import Drop, drop_to
from palpate.exports.motion import Motion
from palpate.exports.mujoco.rows import LEAST, MOST, Row, Rows, impedance
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

# d at the width: as light as still leaves room down to 1e-4. Four times it fitted as well.
_HIGH = 0.005
# Of each row: low/high, midpoint, power, width/deepest.
_LOWEST = np.array([0.0, LEAST, 1.0, 1.0] * 2)
_HIGHEST = np.array([1.0, MOST, 16.0, 5.0] * 2)
# How much the motion counts, and impacts to all of its depth and to a third.
_COUNTS = ((1.0, 0.3), (0.3, 0.15))
_SAMPLES = 120, 50  # of the motion, and of each impact
# Of the evolution: more found no better rows.
_POPULATION, _GENERATIONS, _SEED = 64, 80, 20121
# Times that the clipped samples are left out and springs and dampers solved for again.
_PASSES = 3
_STEPS = 4000  # to half a period, of an impact
_SETS = [list(each) for size in range(1, 5) for each in combinations(range(4), size)]


@dataclass(frozen=True, slots=True)
class _States:
    """Penetration, velocity, acceleration and force at states, and how much each counts."""

    x: Floats
    v: Floats
    a: Floats
    force: Floats
    weight: Floats


def two_contacts(
    law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int
) -> Rows:
    """Return two rows nearest to F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0, that never pull."""
    mass = 1.0 / mobility
    deepest = 1.02 * motion.deepest
    search = _Search(_states(law, motion, mass, deepest), deepest, mass)
    best = search.evolve()
    strengths = search.judge(best[None])[1][0]
    share = mobility / contacts
    made = []
    for k, (ratio, midpoint, power, width) in enumerate(best.reshape(2, 4).tolist()):
        solimp = (max(ratio * _HIGH, LEAST), _HIGH, width * deepest, midpoint, power)
        spring, damper = strengths[2 * k : 2 * k + 2].tolist()
        made.append(Row(spring * _HIGH**2 * share, damper * _HIGH * share, solimp))
    return Rows(tuple(made), mobility, contacts)


def _states(law: GeneralisedHuntCrossley, motion: Motion, mass: float, deepest: float) -> _States:
    firm = np.flatnonzero(motion.judged)
    firm = firm[np.argsort(motion.penetration[firm], kind="stable")]
    some = firm[np.linspace(0, firm.size - 1, _SAMPLES[0]).astype(int)]
    parts = [np.stack([motion.penetration[some], motion.velocity[some], motion.acceleration[some]])]
    counts = [1.0]
    for part, count in zip(*_COUNTS, strict=True):
        course = _impact(law, drop_to(law, mass, part * deepest))
        if course.size:
            parts.append(course)
            counts.append(count)
    forces = [np.maximum(law.force(x, v), 0.0) for x, v, _ in parts]
    weights = [
        np.full(force.size, count / max(float(np.linalg.norm(force)), 1e-300))
        for force, count in zip(forces, counts, strict=True)
    ]
    x, v, a = np.concatenate(parts, axis=1)
    return _States(x, v, a, np.concatenate(forces), np.concatenate(weights))


def _impact(law: GeneralisedHuntCrossley, drop: Drop) -> Floats:
    """Some states of a free body's impact, evenly spaced in time."""
    secant = law.stiffness * drop.depth ** (law.exponent - 1.0)
    step = math.pi * math.sqrt(drop.mass / secant) / _STEPS
    x, v, course = 0.0, drop.speed, []
    for _ in range(10 * _STEPS):
        a = -max(law.force(x, v), 0.0) / drop.mass
        v += step * a
        x += step * v
        if not x > 0.0:
            break
        course.append((x, v, a))
    states: Floats = np.array(course).reshape(-1, 3)
    if course:
        states = states[np.linspace(0, len(course) - 1, _SAMPLES[1]).astype(int)]
    return states.T


@dataclass(frozen=True, slots=True)
class _Search:
    states: _States
    deepest: float
    mass: float

    def evolve(self) -> Floats:
        """Differential evolution around the best; the same on every run."""
        random = np.random.default_rng(_SEED)
        span = _HIGHEST - _LOWEST
        alive = _LOWEST + span * random.random((_POPULATION, span.size))
        misfit = self.judge(alive)[0]
        for _ in range(_GENERATIONS):
            one, other = (alive[random.permutation(_POPULATION)] for _ in range(2))
            best = alive[misfit.argmin()]
            step = random.uniform(0.5, 1.0, (_POPULATION, 1))
            # Half of them near the best, half near themselves, so that others are not lost.
            near = np.where(random.random((_POPULATION, 1)) < 0.5, best, alive)
            changed = random.random(alive.shape) < 0.7
            tried = np.where(changed, near + step * (one - other), alive)
            tried = np.clip(tried, _LOWEST, _HIGHEST)
            values = self.judge(tried)[0]
            better = values < misfit
            alive[better], misfit[better] = tried[better], values[better]
        found: Floats = alive[misfit.argmin()]
        return found

    def judge(self, tried: Floats) -> tuple[Floats, Floats]:
        """Of each candidate the squared misfit, clipping and all, and S₁, D₁, S₂, D₂."""
        columns = self._columns(tried)
        sizes = np.sqrt(np.einsum("ijk,k->ij", columns**2, self.states.weight**2)) + 1e-300
        columns = columns / sizes[:, :, None]
        pushes = np.ones((len(tried), 2, self.states.x.size), dtype=np.bool_)
        for _ in range(_PASSES):
            strengths = self._solved(columns * np.repeat(pushes, 2, axis=1))
            each = (columns * strengths[:, :, None]).reshape(len(tried), 2, 2, -1).sum(axis=2)
            pushes = each > 0.0
        off = (np.maximum(each, 0.0).sum(axis=1) - self.states.force) * self.states.weight
        return np.einsum("ij,ij->i", off, off), strengths / sizes

    def _columns(self, tried: Floats) -> Floats:
        """What S₁, D₁, S₂ and D₂ of 1 push with at each state, by candidate."""
        made = []
        for k in (0, 4):
            ratio, midpoint, power, width = (column[:, None] for column in tried.T[k : k + 4])
            low = np.maximum(ratio * _HIGH, LEAST)
            d = impedance(self.states.x, low, _HIGH, width * self.deepest, midpoint, power)
            mass = d / (1.0 - d)
            made += [mass * d * self.states.x, mass * self.states.v]
        return np.stack(made, axis=1)

    def _solved(self, columns: Floats) -> Floats:
        """Least squares with no number below 0: the best of all sets that are not 0."""
        weighted = columns * self.states.weight
        target = self.states.force * self.states.weight
        squares = np.einsum("ijk,ilk->ijl", weighted, weighted)
        along = weighted @ target
        best, least = np.zeros(along.shape), np.zeros(len(along))
        for chosen in _SETS:
            part = squares[:, chosen][:, :, chosen] + 1e-10 * np.eye(len(chosen))
            some = np.linalg.solve(part, along[:, chosen][:, :, None])[:, :, 0]
            gain = -np.einsum("ij,ij->i", some, along[:, chosen])
            good = (some >= 0.0).all(axis=1) & (gain < least)
            least = np.where(good, gain, least)
            full = np.zeros(best.shape)
            full[:, chosen] = some
            best = np.where(good[:, None], full, best)
        return best
