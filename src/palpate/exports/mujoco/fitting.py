"""A law as rows of MuJoCo's solver: what a row does, and the numbers of those nearest to a law.

For every row that is not clipped the solver gives R f = a_ref − a, R = (1 − d)/d · Â, with
a_ref = D/d_w v + S/d_w² d x of a contact whose solref is in the direct format, (−S, −D) (MuJoCo,
*Computation*, constraint model, and *Modeling*, solver parameters). In terms of the penetration x,

    f = d²/(d_w² (1 − d) Â) · S x + d/(d_w (1 − d) Â) · D v + d/((1 − d) Â) · ẍ,   d = d(x).

Gravity and every other force are in ẍ already. The last term is a mass that the contact adds.

The ways of a law into rows are at the end: one for Kelvin–Voigt, a spring and a damper that may
pull, or two rows that only push.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.engine import (
    Drop,
    ProbeMotion,
    course,
    drop_to,
    force_error,
    half_period,
    kelvin_voigt,
)
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

#: What the engine clamps an impedance to (mjMINIMP, mjMAXIMP).
LEAST, MOST = 1e-4, 0.9999
# How far a width goes beyond the deepest sample.
_ROOM = 1.02
#: A row's (d₀, d_w, width, midpoint, power).
Solimp = tuple[float, float, float, float, float]


def impedance(depth: Floats | float, *solimp: Floats | float) -> Floats:
    """Return d(x): from low at the surface to high at the width, along MuJoCo's sigmoid.

    ``solimp`` is low, high, width, midpoint and power.
    y = z^p/m^(p − 1) up to the midpoint m, 1 − (1 − z)^p/(1 − m)^(p − 1) from there, z = x/width;
    d = low + y (high − low). All go together as in NumPy.
    """
    low, high, width, midpoint, power = solimp
    z = np.clip(np.asarray(depth, dtype=np.float64) / width, 0.0, 1.0)
    m, p = np.asarray(midpoint, dtype=np.float64), np.asarray(power, dtype=np.float64)
    rising = z**p * m ** (1.0 - p)
    falling = 1.0 - (1.0 - z) ** p * (1.0 - m) ** (1.0 - p)
    y = np.where(z <= m, rising, falling)
    found: Floats = low + y * (high - low)
    return found


@dataclass(frozen=True, slots=True)
class PairRow:
    """One contact of one pair: numbers as MuJoCo's XML has them.

    Parameters
    ----------
    spring, damper : float
        S, 1/s², and D, 1/s, ≥ 0, of solref = (−S, −D).
    solimp : tuple of float
        (d₀, d_w, width, midpoint, power).
    inset : float
        By how much deeper than the surface the contact begins, m, ≥ 0: −margin.
    adhesion : float
        How strongly the row may pull, N.
    """

    spring: float
    damper: float
    solimp: Solimp
    inset: float = 0.0
    adhesion: float = 0.0

    def reach(self, penetration: Floats) -> Floats:
        """Impedance at each penetration [m], and 0 where there is no contact."""
        inside = np.asarray(penetration) - self.inset
        return np.where(inside > 0.0, impedance(inside, *self.solimp), 0.0)

    def added_mass(self, penetration: Floats, mobility: float) -> Floats:
        """d/((1 − d) Â), kg."""
        d = self.reach(penetration)
        return np.asarray(d / ((1.0 - d) * mobility))

    def springs_and_dampers(self, penetration: Floats, mobility: float) -> tuple[Floats, Floats]:
        """The force at rest [N], and ∂f/∂v [N·s/m]."""
        d, high = self.reach(penetration), self.solimp[1]
        inside = np.maximum(np.asarray(penetration) - self.inset, 0.0)
        mass = d / ((1.0 - d) * mobility * high)
        return mass * d / high * self.spring * inside, mass * self.damper

    def force(
        self, penetration: Floats, velocity: Floats, acceleration: Floats, mobility: float
    ) -> Floats:
        """What the row pushes with, N, at least −adhesion."""
        spring, damper = self.springs_and_dampers(penetration, mobility)
        mass = self.added_mass(penetration, mobility)
        whole = spring + damper * velocity + mass * acceleration
        return np.where(mass > 0.0, np.maximum(whole, -self.adhesion), 0.0)


@dataclass(frozen=True, slots=True)
class PairRows:
    """The rows of one fragment, each as often as MuJoCo makes a contact of it.

    Parameters
    ----------
    rows : tuple of PairRow
        One a pair.
    mobility : float
        Â, 1/kg: the sum of both bodies' translational body_invweight0.
    contacts : int
        That the two geoms have with each other, each of which pushes.
    """

    rows: tuple[PairRow, ...]
    mobility: float
    contacts: int = 1

    def force(self, penetration: Floats, velocity: Floats, acceleration: Floats) -> Floats:
        """What MuJoCo pushes with along a motion, N: added mass, clamps, clipping and all."""
        each = [row.force(penetration, velocity, acceleration, self.mobility) for row in self.rows]
        return np.asarray(self.contacts * np.sum(each, axis=0))

    def added_mass(self, penetration: Floats) -> Floats:
        """Σ d/((1 − d) Â), kg."""
        each = [row.added_mass(penetration, self.mobility) for row in self.rows]
        return np.asarray(self.contacts * np.sum(each, axis=0))


# A row whose force goes as a power of depth: solimp by least squares.
#
# With d ∝ x^q a damper goes as x^q and a spring as x^(1 + 2q), but for 1 − d and for the 1e-4 that
# every d is at least. What solimp's sigmoid can be of that is fitted: its low end, width, midpoint
# and power, and how far below the surface it begins. The scale is linear, and solved for.

# Of low/high, midpoint, power, width/deepest and inset/deepest. A sigmoid from its midpoint on
# depends on power/width only once both are large: beyond these nothing gets better (measured).
_LOWEST_PROFILE = np.array([0.0, LEAST, 1.0, 1.0, 0.0])
_HIGHEST_PROFILE = np.array([1.0, MOST, 16.0, 5.0, 0.2])
# Misfits count in N over the fourth root of the force there: by the force alone (0) a spring of
# n = 1.5 is 10 % off at a seventh of the depth, 33 % at a fourteenth and .21 % on the paper's
# motion; so 6 %, 26 % and .31 %.
_EVENNESS = 0.25


def power_of_depth(
    depths: Floats, target: Floats, high: float, *, spring: bool, low: bool
) -> tuple[Solimp, float, float]:
    """Return solimp and inset [m] of a power of depth, and the factor that makes it the target.

    Parameters
    ----------
    depths, target : numpy.ndarray, shape (k,)
        The depths [m] that count, the deepest of them the last; and there the force of a spring, N,
        a multiple of d² x/(1 − d), or of a damper, N·s/m, of d/(1 − d).
    high : float
        d at the width.
    spring, low : bool
        Which of both; and whether d may begin above the least that there is, as it has to for less
        than x¹.
    """
    deepest = float(depths[-1])
    # Near the surface a spring has no force to miss.
    highest = _HIGHEST_PROFILE * np.array([low, 1.0, 1.0, 1.0, not spring])
    even = target ** (1.0 - _EVENNESS)

    def judge(tried: Floats) -> tuple[Floats, Floats]:
        """Of each row of candidates the squared misfit, and the scale that has the least."""
        ratio, midpoint, power, width, inset = (column[:, None] for column in tried.T)
        inside = np.maximum(depths - inset * deepest, 0.0)
        d = impedance(
            inside, np.maximum(ratio * high, LEAST), high, width * deepest, midpoint, power
        )
        d = np.where(inside > 0.0, d, 0.0)
        shape = d / (1.0 - d) * (d * inside if spring else 1.0)
        shape = shape / target**_EVENNESS
        scale = (shape @ even) / np.einsum("ij,ij->i", shape, shape)
        misfit = scale[:, None] * shape - even
        return np.einsum("ij,ij->i", misfit, misfit), scale

    best = _evolved(judge, _LOWEST_PROFILE, highest)
    ratio, midpoint, power, width, inset = best.tolist()
    solimp = (max(ratio * high, LEAST), high, width * deepest, midpoint, power)
    return solimp, inset * deepest, float(judge(best[None])[1][0])


# Of the evolution: more found no better rows. What is drawn at random is the same on every run.
_POPULATION, _GENERATIONS, _SEED = 64, 80, 20121


def _evolved(
    judge: Callable[[Floats], tuple[Floats, Floats]], lowest: Floats, highest: Floats
) -> Floats:
    """Return the candidate of the least misfit, by differential evolution around the best."""
    random = np.random.default_rng(_SEED)
    alive = lowest + (highest - lowest) * random.random((_POPULATION, lowest.size))
    misfit = judge(alive)[0]
    for _ in range(_GENERATIONS):
        one, other = (alive[random.permutation(_POPULATION)] for _ in range(2))
        best = alive[misfit.argmin()]
        step = random.uniform(0.5, 1.0, (_POPULATION, 1))
        # Half of them near the best, half near themselves, so that others are not lost.
        near = np.where(random.random((_POPULATION, 1)) < 0.5, best, alive)
        changed = random.random(alive.shape) < 0.7
        tried = np.clip(np.where(changed, near + step * (one - other), alive), lowest, highest)
        values = judge(tried)[0]
        better = values < misfit
        alive[better], misfit[better] = tried[better], values[better]
    found: Floats = alive[misfit.argmin()]
    return found


# Two rows that only push, for a MuJoCo whose contacts cannot pull.
#
# Where a damper alone would have to pull, each row needs a spring too, and both are looked for at
# once: the shapes d(x) by differential evolution, and for each shape the springs S₁, S₂ and dampers
# D₁, D₂ ≥ 0 by least squares, over the motion and over two free impacts.

# d at the width: as light as still leaves room down to 1e-4. Four times it fitted as well.
_HIGH = 0.005
# Of each row: low/high, midpoint, power, width/deepest.
_LOWEST_PAIR = np.array([0.0, LEAST, 1.0, 1.0] * 2)
_HIGHEST_PAIR = np.array([1.0, MOST, 16.0, 5.0] * 2)
# How much the motion counts, and impacts to all of its depth and to a third.
_COUNTS = ((1.0, 0.3), (0.3, 0.15))
_SAMPLES = 120, 50  # of the motion, and of each impact
# Times that the clipped samples are left out and springs and dampers solved for again.
_PASSES = 3
_STEPS = 1000  # to half a period, of an impact
_SETS = [list(each) for size in range(1, 5) for each in combinations(range(4), size)]


def two_contacts(
    law: GeneralisedHuntCrossley, motion: ProbeMotion, mobility: float, contacts: int
) -> PairRows:
    """Return two rows nearest to F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0, that never pull."""
    search = _search_of(law, motion, 1.0 / mobility)
    best, deepest = _evolved(search.judge, _LOWEST_PAIR, _HIGHEST_PAIR), search.deepest
    strengths = search.judge(best[None])[1][0]
    share = mobility / contacts
    made = []
    for k, (ratio, midpoint, power, width) in enumerate(best.reshape(2, 4).tolist()):
        solimp = (max(ratio * _HIGH, LEAST), _HIGH, width * deepest, midpoint, power)
        spring, damper = strengths[2 * k : 2 * k + 2].tolist()
        made.append(PairRow(spring * _HIGH**2 * share, damper * _HIGH * share, solimp))
    return PairRows(tuple(made), mobility, contacts)


@dataclass(frozen=True, slots=True)
class _Search:
    """Penetration, velocity and force at states, and how much each counts."""

    x: Floats
    v: Floats
    force: Floats
    weight: Floats
    deepest: float

    def judge(self, tried: Floats) -> tuple[Floats, Floats]:
        """Of each candidate the squared misfit, clipping and all, and S₁, D₁, S₂, D₂."""
        columns = self._columns(tried)
        sizes = np.sqrt(np.einsum("ijk,k->ij", columns**2, self.weight**2)) + 1e-300
        columns = columns / sizes[:, :, None]
        pushes = np.ones((len(tried), 2, self.x.size), dtype=np.bool_)
        for _ in range(_PASSES):
            strengths = self._solved(columns * np.repeat(pushes, 2, axis=1))
            each = (columns * strengths[:, :, None]).reshape(len(tried), 2, 2, -1).sum(axis=2)
            pushes = each > 0.0
        off = (np.maximum(each, 0.0).sum(axis=1) - self.force) * self.weight
        return np.einsum("ij,ij->i", off, off), strengths / sizes

    def _columns(self, tried: Floats) -> Floats:
        """What S₁, D₁, S₂ and D₂ of 1 push with at each state, by candidate."""
        made = []
        for k in (0, 4):
            ratio, midpoint, power, width = (column[:, None] for column in tried.T[k : k + 4])
            low = np.maximum(ratio * _HIGH, LEAST)
            d = impedance(self.x, low, _HIGH, width * self.deepest, midpoint, power)
            mass = d / (1.0 - d)
            made += [mass * d * self.x, mass * self.v]
        return np.stack(made, axis=1)

    def _solved(self, columns: Floats) -> Floats:
        """Least squares with no number below 0: the best of all sets that are not 0."""
        weighted = columns * self.weight
        target = self.force * self.weight
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


def _search_of(law: GeneralisedHuntCrossley, motion: ProbeMotion, mass: float) -> _Search:
    """Some states of the motion, and of impacts to all of its depth and to a part."""
    firm = np.flatnonzero(motion.judged)
    firm = firm[np.argsort(motion.penetration[firm], kind="stable")]
    some = firm[np.linspace(0, firm.size - 1, _SAMPLES[0]).astype(int)]
    parts, counts = [np.stack([motion.penetration[some], motion.velocity[some]])], [1.0]
    deepest = _ROOM * motion.deepest
    for part, count in zip(*_COUNTS, strict=True):
        impact = _impact(law, drop_to(law, mass, part * deepest))
        if impact.size:
            parts.append(impact)
            counts.append(count)
    forces = [np.maximum(law.force(x, v), 0.0) for x, v in parts]
    weights = [
        np.full(force.size, count / max(float(np.linalg.norm(force)), 1e-300))
        for force, count in zip(forces, counts, strict=True)
    ]
    x, v = np.concatenate(parts, axis=1)
    return _Search(x, v, np.concatenate(forces), np.concatenate(weights), deepest)


def _impact(law: GeneralisedHuntCrossley, drop: Drop) -> Floats:
    """Some penetrations and velocities of a free body's impact, evenly spaced in time."""
    step = half_period(law, drop.mass, drop.depth) / _STEPS
    pushing = lambda x, v: max(law.force(x, v), 0.0)  # noqa: E731
    inside = [(x, v) for x, v in course(pushing, drop.mass, 0.0, drop.speed, step) if x > 0.0]
    places = np.linspace(0, len(inside) - 1, _SAMPLES[1] if inside else 0).astype(int)
    states: Floats = np.array(inside, dtype=np.float64).reshape(-1, 2)[places].T
    return states


# How a free body rebounds from rows, step by step as in MuJoCo.

# Points of the table that a drop is integrated with.
_TABLE = 2000
#: A body that has not come back by then stays: a half period is some ten steps that are stable.
MOST_STEPS = 20_000


def drop_restitution(rows: PairRows, drop: Drop, step: float) -> float:
    """Restitution that the rows give a free body, by semi-implicit Euler as in MuJoCo.

    Parameters
    ----------
    rows : Rows
        Of the fragment.
    drop : Drop
        Where it enters, how fast and how heavy.
    step : float
        s.
    """
    depths = np.linspace(0.0, 1.5 * drop.depth, _TABLE + 1)
    spacing = 1.5 * drop.depth / _TABLE
    depths[0] = 1e-6 * depths[1]
    tables, n = [], rows.contacts
    for row in rows.rows:
        spring, damper = row.springs_and_dampers(depths, rows.mobility)
        mass = row.added_mass(depths, rows.mobility)
        tables.append([*((n * each).tolist() for each in (spring, damper, mass)), n * row.adhesion])
    # Where the tip touches, MuJoCo has no contact yet: the first step is free flight.
    x, v = step * drop.speed, drop.speed
    for _ in range(MOST_STEPS):
        place = min(x / spacing, _TABLE - 1.0)
        k = int(place)
        part = place - k
        felt = []
        for push, drag, added, pull in tables:
            held = push[k] + part * (push[k + 1] - push[k])
            held += (drag[k] + part * (drag[k + 1] - drag[k])) * v
            felt.append((held, added[k] + part * (added[k + 1] - added[k]), pull))
        v += step * _acceleration(felt, drop.mass)
        x += step * v
        if x <= 0.0:
            return max(-v, 0.0) / drop.speed
        if not math.isfinite(v):
            break
    return 0.0


def _acceleration(felt: list[tuple[float, float, float]], mass: float) -> float:
    """ẍ of a free body, m ẍ = −Σ f, each f = held + m_a ẍ, but not below what it may pull with."""
    clipped: list[bool] = [False] * len(felt)
    while True:
        load = added = 0.0
        for (held, more, pull), off in zip(felt, clipped, strict=True):
            load += -pull if off else held
            added += 0.0 if off else more
        a = -load / (mass + added)
        now = [off or held + more * a < -pull
               for (held, more, pull), off in zip(felt, clipped, strict=True)]  # fmt: skip
        if now == clipped:
            return a
        clipped = now


# The rows that carry a law, and how much impedance they may have.

# A spring misses nothing where d is at its least, 1e-4, and so may add as little mass as this; with
# less, d could no longer fall enough towards the surface (20 times, for the shapes seen).
SPRING_HIGH = 0.002
# What a damper may have, a factor of 1.5 apart. Less is clamped at 1e-4 too soon, more adds mass.
DAMPER_HIGHS = (0.002, 0.003, 0.005, 0.0075, 0.011, 0.017, 0.025, 0.04, 0.06)
# The force's bar is .6 %, restitution's 3 %: a percent of the one counts as five of the other.
_FORCE_TO_REBOUND = 5.0
# Of what a damper may have to pull with: two digits of it are written, and none below.
_ADHESION = 1.1
# Steps to a drop's half period, where e has to be known to a tenth of a percent only.
_COARSE = 400
# Drops that are judged, as parts of the greatest depth.
_DROPS = (1.0, 0.3)


def depths_that_count(motion: ProbeMotion) -> Floats:
    """Depths [m] to fit at: as often as the motion was there, and once all the way from 0."""
    firm = np.sort(motion.penetration[motion.judged])
    places = np.linspace(0, firm.size - 1, 120).astype(int)
    deepest = _ROOM * float(firm[-1])
    return np.sort(np.concatenate([firm[places], np.linspace(0.0, deepest, 61)[1:]]))


def single(
    law: GeneralisedHuntCrossley, motion: ProbeMotion, mobility: float, contacts: int
) -> PairRows:
    """One row: the nearest Kelvin–Voigt law, S = K (1 − d) Â and D = B (1 − d) Â at d = 1e-4."""
    nearest = kelvin_voigt(law, motion)
    if not (nearest.stiffness > 0.0 and nearest.damping >= 0.0):
        # solref would turn positive, which is another format with another meaning.
        raise InvalidParameterError(
            f"form kelvin-voigt: the nearest K x + B v has K = {nearest.stiffness:.3g} N/m and B = "
            f"{nearest.damping:.3g} N·s/m, and MuJoCo takes none below 0: take the callback "
            "(--form callback)"
        )
    share = (1.0 - LEAST) * mobility / contacts
    solimp = (LEAST, LEAST, _ROOM * motion.deepest, 0.5, 2.0)
    row = PairRow(share * nearest.stiffness, share * nearest.damping, solimp)
    return PairRows((row,), mobility, contacts)


def pair(
    law: GeneralisedHuntCrossley, motion: ProbeMotion, mobility: float, contacts: int
) -> PairRows:
    """A spring, and a damper that may pull: F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0."""
    depths, share = depths_that_count(motion), mobility / contacts
    # Where the law pushes, its damper pulls less strongly than its spring pushes; on the motion it
    # may pull more. Beyond both the whole pair would pull, as no real contact does.
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    drag = law.damping * x**law.damping_exponent * -v
    strongest = max(float(drag.max()), law.stiffness * float(depths[-1]) ** law.exponent)
    adhesion = float(f"{_ADHESION * strongest / contacts:.2g}")
    if law.exponent == 1.0:
        solimp, inset, scale = _level(depths), 0.0, law.stiffness * (1.0 - LEAST) / LEAST**2
    else:
        target = law.stiffness * depths**law.exponent
        solimp, inset, scale = power_of_depth(depths, target, SPRING_HIGH, spring=True, low=True)
    spring = PairRow(scale * solimp[1] ** 2 * share, 0.0, solimp, inset)
    if law.damping == 0.0:
        return PairRows((spring,), mobility, contacts)
    if law.damping_exponent == 0.0:
        shapes = [(_level(depths), 0.0, law.damping * (1.0 - LEAST) / LEAST)]
    else:
        target, low = law.damping * depths**law.damping_exponent, law.damping_exponent < 1.0
        shapes = [
            power_of_depth(depths, target, high, spring=False, low=low) for high in DAMPER_HIGHS
        ]
    dampers = (
        PairRow(0.0, scale * solimp[1] * share, solimp, inset, adhesion)
        for solimp, inset, scale in shapes
    )
    made = [PairRows((spring, damper), mobility, contacts) for damper in dampers]
    return made[0] if len(made) == 1 else min(made, key=misfit_to(law, motion, 1.0 / mobility))


def _level(depths: Floats) -> Solimp:
    """One impedance at every depth: a linear spring, or a damper that does not know depth."""
    return (LEAST, LEAST, float(depths[-1]), 0.5, 2.0)


def misfit_to(
    law: GeneralisedHuntCrossley, motion: ProbeMotion, mass: float
) -> Callable[[PairRows], float]:
    """Return what says the error of rows: of force on a motion, %, and a fifth of restitution's."""
    drops = [drop_to(law, mass, part * motion.deepest) for part in _DROPS]
    steps = [half_period(law, mass, drop.depth) / _COARSE for drop in drops]
    target = motion.force_by(law)

    def misfit(rows: PairRows) -> float:
        force = rows.force(motion.penetration, motion.velocity, motion.acceleration)
        off = [
            abs(drop_restitution(rows, drop, step) - drop.restitution)
            for drop, step in zip(drops, steps, strict=True)
        ]
        return force_error(force, target, motion.judged) + 100.0 * max(off) / _FORCE_TO_REBOUND

    return misfit


#: The ways of a law into rows, by the name of the form.
FITS: dict[str, Callable[[GeneralisedHuntCrossley, ProbeMotion, float, int], PairRows]] = {
    "kelvin-voigt": single,
    "pair": pair,
    "two-contacts": two_contacts,
}
