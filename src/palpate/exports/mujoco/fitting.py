"""A law as rows of MuJoCo's solver: the force of a row, and the fit of rows to a law.

For every row that is not clipped the solver gives R f = a_ref − a, R = (1 − d)/d · Â, with
a_ref = D/d_w v + S/d_w² d x of a contact whose solref is in the direct format, (−S, −D) (MuJoCo,
*Computation*, constraint model, and *Modeling*, solver parameters). In terms of the penetration x,

    f = d²/(d_w² (1 − d) Â) · S x + d/(d_w (1 − d) Â) · D v + d/((1 − d) Â) · ẍ,   d = d(x).

ẍ already includes gravity and all other forces. The last term is a mass that the contact adds.

The fits are at the end: one row for Kelvin–Voigt, a spring and a damper that can pull, or two rows
that only push.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.motion import ProbeMotion
from palpate.exports.nearest_law import kelvin_voigt
from palpate.exports.replay_errors import Drop, course, drop_to, force_error, half_period
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats, frozen

#: MuJoCo's limits of an impedance (mjMINIMP, mjMAXIMP).
LEAST = 1e-4
MOST = 0.9999
#: Ratio of the added mass of a friction row to that of its normal row; an option of the model.
IMPRATIO = 1e6
# Ratio of a width to the deepest sample.
_ROOM = 1.02
#: A row's (d₀, d_w, width, midpoint, power).
Solimp = tuple[float, float, float, float, float]


def impedance(depth: Floats | float, *solimp: Floats | float) -> Floats:
    """Return the impedance d(x), MuJoCo's sigmoid from low at the surface to high at the width.

    ``solimp`` is low, high, width, midpoint and power, each a number or an array to broadcast.
    y = z^p/m^(p − 1) up to the midpoint m, 1 − (1 − z)^p/(1 − m)^(p − 1) from there, z = x/width;
    d = low + y (high − low).
    """
    low, high, width, midpoint, power = solimp
    z = np.clip(np.asarray(depth, dtype=np.float64) / width, 0.0, 1.0)
    m = np.asarray(midpoint, dtype=np.float64)
    p = np.asarray(power, dtype=np.float64)
    rising = z**p * m ** (1.0 - p)
    falling = 1.0 - (1.0 - z) ** p * (1.0 - m) ** (1.0 - p)
    y = np.where(z <= m, rising, falling)
    found: Floats = low + y * (high - low)
    return found


@frozen
class PairRow:
    """One contact of a pair, with the parameters of MuJoCo's XML.

    Parameters
    ----------
    spring, damper : float
        S, 1/s², and D, 1/s, ≥ 0, of solref = (−S, −D).
    solimp : tuple of float
        (d₀, d_w, width, midpoint, power).
    inset : float
        Depth below the surface at which the contact begins, m, ≥ 0: −margin. Default: 0.
    adhesion : float
        Largest pulling force of the row, N. Default: 0.
    friction : float
        Coefficient of friction. Default: 0, frictionless.
    friction_damper : float
        D of solreffriction = (−1, −D), 1/s. Default: 0.
    """

    spring: float
    damper: float
    solimp: Solimp
    inset: float = 0.0
    adhesion: float = 0.0
    friction: float = 0.0
    friction_damper: float = 0.0

    def reach(self, penetration: Floats) -> Floats:
        """Return the impedance at each penetration [m]; 0 out of contact."""
        inside = np.asarray(penetration) - self.inset
        return np.where(inside > 0.0, impedance(inside, *self.solimp), 0.0)

    def added_mass(self, penetration: Floats, mobility: float) -> Floats:
        """Return d/((1 − d) Â), kg."""
        d = self.reach(penetration)
        return np.asarray(d / ((1.0 - d) * mobility))

    def springs_and_dampers(self, penetration: Floats, mobility: float) -> tuple[Floats, Floats]:
        """Return the force at rest [N] and ∂f/∂v [N·s/m]."""
        d = self.reach(penetration)
        high = self.solimp[1]
        inside = np.maximum(np.asarray(penetration) - self.inset, 0.0)
        mass = d / ((1.0 - d) * mobility * high)
        return mass * d / high * self.spring * inside, mass * self.damper

    def force(
        self,
        penetration: Floats,
        velocity: Floats,
        acceleration: Floats,
        mobility: float,
    ) -> Floats:
        """Return the force of the row, N, at least −adhesion."""
        spring, damper = self.springs_and_dampers(penetration, mobility)
        mass = self.added_mass(penetration, mobility)
        whole = spring + damper * velocity + mass * acceleration
        return np.where(mass > 0.0, np.maximum(whole, -self.adhesion), 0.0)


@frozen
class PairRows:
    """The rows of a fragment, each multiplied by the number of contacts MuJoCo makes.

    Parameters
    ----------
    rows : tuple of PairRow
        One row per pair.
    mobility : float
        Â, 1/kg: the sum of both bodies' translational body_invweight0.
    contacts : int
        Number of contacts between the two geoms, each of which pushes. Default: 1.
    """

    rows: tuple[PairRow, ...]
    mobility: float
    contacts: int = 1

    def with_friction(self, friction: float, time_step: float) -> "PairRows":
        """Return the rows with a coefficient of friction for those that cannot pull.

        A friction row has f = −m_t (D/d_w u + u̇) at a sliding speed u, with the added mass m_t =
        ``IMPRATIO`` · d/((1 − d) Â) of an elliptic cone. A body under a load F so creeps by
        F d_w/(D m_t), and D d/d_w up to 1/h is stable. With D = 1e-4/h it creeps by 10⁻² h Â F at
        d = d_w, 0.1 mm/s for 10 N on 1 kg at 1 ms. A larger D would raise the normal force of a
        body that slides.
        """
        rows = tuple(
            replace(row, friction=friction, friction_damper=LEAST / time_step)
            if friction and not row.adhesion
            else row
            for row in self.rows
        )
        return replace(self, rows=rows)

    def force(self, penetration: Floats, velocity: Floats, acceleration: Floats) -> Floats:
        """Return MuJoCo's force along a motion, N, including added mass, limits and clipping."""
        each = [row.force(penetration, velocity, acceleration, self.mobility) for row in self.rows]
        return np.asarray(self.contacts * np.sum(each, axis=0))

    def added_mass(self, penetration: Floats) -> Floats:
        """Return Σ d/((1 − d) Â), kg."""
        each = [row.added_mass(penetration, self.mobility) for row in self.rows]
        return np.asarray(self.contacts * np.sum(each, axis=0))


# A row whose force goes as a power of depth: solimp by least squares.
#
# With d ∝ x^q a damper scales as x^q and a spring as x^(1 + 2q), except for the factor 1 − d and a
# minimum of 1e-4 of every d. The fit varies the sigmoid's low end, width, midpoint and power, and
# its beginning below the surface; the scale is linear and solved for.

# Bounds of low/high, midpoint, power, width/deepest and inset/deepest. When power and width are
# both large the sigmoid depends only on their ratio: larger bounds did not improve fits.
_LOWEST_PROFILE = np.array([0.0, LEAST, 1.0, 1.0, 0.0])
_HIGHEST_PROFILE = np.array([1.0, MOST, 16.0, 5.0, 0.2])
# Residuals are weighted by force^-0.25: without weights a spring of n = 1.5 is 10 % off at 1/7
# of the depth, 33 % at 1/14 and 0.21 % on the paper's motion; with them 6 %, 26 % and
# 0.31 %.
_EVENNESS = 0.25


def power_of_depth(
    depths: Floats,
    target: Floats,
    high: float,
    *,
    spring: bool,
    low: bool,
) -> tuple[Solimp, float, float]:
    """Return solimp and inset [m] that fit a power of depth, and the factor to the target.

    Parameters
    ----------
    depths, target : numpy.ndarray, shape (k,)
        Depths [m] to fit at, the deepest last; and there the spring's force, N, a multiple of
        d² x/(1 − d), or the damper's coefficient, N·s/m, a multiple of d/(1 − d).
    high : float
        d at the width.
    spring, low : bool
        Whether it is a spring, else a damper; and whether d may begin above its minimum, which
        powers below x¹ need.
    """
    deepest = float(depths[-1])
    # Near the surface a spring has too little force to matter, so it needs no inset.
    highest = _HIGHEST_PROFILE * np.array([low, 1.0, 1.0, 1.0, not spring])
    even = target ** (1.0 - _EVENNESS)

    def judge(tried: Floats) -> tuple[Floats, Floats]:
        """Return the squared misfit of each row of candidates, and its best scale."""
        ratio, midpoint, power, width, inset = (column[:, None] for column in tried.T)
        inside = np.maximum(depths - inset * deepest, 0.0)
        d = impedance(
            inside,
            np.maximum(ratio * high, LEAST),
            high,
            width * deepest,
            midpoint,
            power,
        )
        d = np.where(inside > 0.0, d, 0.0)
        shape = d / (1.0 - d) * (d * inside if spring else 1.0)
        shape = shape / target**_EVENNESS
        scale = (shape @ even) / np.einsum("ij,ij->i", shape, shape)
        misfit = scale[:, None] * shape - even
        return np.einsum("ij,ij->i", misfit, misfit), scale

    best = _search_globally(judge, _LOWEST_PROFILE, highest)
    ratio, midpoint, power, width, inset = best.tolist()
    solimp = (max(ratio * high, LEAST), high, width * deepest, midpoint, power)
    return solimp, inset * deepest, float(judge(best[None])[1][0])


# Size of the evolution: larger ones found no better rows. The fixed seed makes runs reproducible.
_POPULATION = 64
_GENERATIONS = 80
_SEED = 20121


def _search_globally(
    judge: Callable[[Floats], tuple[Floats, Floats]],
    lowest: Floats,
    highest: Floats,
) -> Floats:
    """Return the candidate of least misfit, by differential evolution around the best."""
    random = np.random.default_rng(_SEED)
    alive = lowest + (highest - lowest) * random.random((_POPULATION, lowest.size))
    misfit = judge(alive)[0]
    for _ in range(_GENERATIONS):
        one, other = (alive[random.permutation(_POPULATION)] for _ in range(2))
        best = alive[misfit.argmin()]
        step = random.uniform(0.5, 1.0, (_POPULATION, 1))
        # Half of the trials start from the best, half from themselves, to keep diversity.
        near = np.where(random.random((_POPULATION, 1)) < 0.5, best, alive)
        changed = random.random(alive.shape) < 0.7
        tried = np.clip(np.where(changed, near + step * (one - other), alive), lowest, highest)
        values = judge(tried)[0]
        better = values < misfit
        alive[better], misfit[better] = tried[better], values[better]
    found: Floats = alive[misfit.argmin()]
    return found


# Two rows that only push, for versions of MuJoCo whose contacts cannot pull.
#
# A damper alone would have to pull, so each row needs a spring too. Both are fitted together: the
# shapes d(x) by differential evolution, and for each shape the springs S₁, S₂ and dampers
# D₁, D₂ ≥ 0 by least squares, over the motion and two free impacts.

# d at the width: small for little added mass, yet well above 1e-4; four times as much fits as well.
_HIGH = 0.005
# Bounds of each row: low/high, midpoint, power, width/deepest.
_LOWEST_PAIR = np.array([0.0, LEAST, 1.0, 1.0] * 2)
_HIGHEST_PAIR = np.array([1.0, MOST, 16.0, 5.0] * 2)
# Depths of the impacts as fractions of the greatest depth, and their weights.
_COUNTS = ((1.0, 0.3), (0.3, 0.15))
_SAMPLES = 120, 50  # of the motion and of each impact
# Number of solves, each without the samples that the previous one clipped.
_PASSES = 3
# At last both dampers are scaled, for the impact to the greatest depth: of the rebound that is too
# high, 0.03 at K/B = 0.5 m/s, nearly all goes, for 0.3 % of force.
_DAMPER_SCALES = np.linspace(1.0, 1.2, 11).tolist()
_STEPS = 1000  # per half period of an impact
_SETS = [list(each) for size in range(1, 5) for each in combinations(range(4), size)]


def two_contacts(
    law: GeneralisedHuntCrossley,
    motion: ProbeMotion,
    mobility: float,
    contacts: int,
) -> PairRows:
    """Return two rows that never pull, nearest to F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0."""
    search = _prepare_search(law, motion, 1.0 / mobility)
    best = _search_globally(search.judge, _LOWEST_PAIR, _HIGHEST_PAIR)
    deepest = search.deepest
    strengths = search.judge(best[None])[1][0]
    share = mobility / contacts
    made = []
    for k, (ratio, midpoint, power, width) in enumerate(best.reshape(2, 4).tolist()):
        solimp = (max(ratio * _HIGH, LEAST), _HIGH, width * deepest, midpoint, power)
        spring, damper = strengths[2 * k : 2 * k + 2].tolist()
        made.append(PairRow(spring * _HIGH**2 * share, damper * _HIGH * share, solimp))
    misfit = misfit_to(law, motion, 1.0 / mobility, _DROPS[:1])
    damped = (
        tuple(replace(row, damper=scale * row.damper) for row in made) for scale in _DAMPER_SCALES
    )
    return min((PairRows(rows, mobility, contacts) for rows in damped), key=misfit)


@frozen
class _Search:
    """States with penetration, velocity, force and weight, to fit rows to."""

    x: Floats
    v: Floats
    force: Floats
    weight: Floats
    deepest: float

    def judge(self, tried: Floats) -> tuple[Floats, Floats]:
        """Return the squared misfit of each candidate, with clipping, and S₁, D₁, S₂, D₂."""
        columns = self._columns(tried)
        sizes = np.sqrt(np.einsum("ijk,k->ij", columns**2, self.weight**2)) + 1e-300
        columns = columns / sizes[:, :, None]
        pushes = np.ones((len(tried), 2, self.x.size), dtype=np.bool_)
        for _ in range(_PASSES):
            strengths = self._solve_nonnegative(columns * np.repeat(pushes, 2, axis=1))
            each = (columns * strengths[:, :, None]).reshape(len(tried), 2, 2, -1).sum(axis=2)
            pushes = each > 0.0
        off = (np.maximum(each, 0.0).sum(axis=1) - self.force) * self.weight
        return np.einsum("ij,ij->i", off, off), strengths / sizes

    def _columns(self, tried: Floats) -> Floats:
        """Return the forces for S₁, D₁, S₂ and D₂ of 1 at each state, by candidate."""
        made = []
        for k in (0, 4):
            ratio, midpoint, power, width = (column[:, None] for column in tried.T[k : k + 4])
            low = np.maximum(ratio * _HIGH, LEAST)
            d = impedance(self.x, low, _HIGH, width * self.deepest, midpoint, power)
            mass = d / (1.0 - d)
            made += [mass * d * self.x, mass * self.v]
        return np.stack(made, axis=1)

    def _solve_nonnegative(self, columns: Floats) -> Floats:
        """Solve least squares with coefficients ≥ 0, by trying all sets of nonzero ones."""
        weighted = columns * self.weight
        target = self.force * self.weight
        squares = np.einsum("ijk,ilk->ijl", weighted, weighted)
        along = weighted @ target
        best = np.zeros(along.shape)
        least = np.zeros(len(along))
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


def _prepare_search(law: GeneralisedHuntCrossley, motion: ProbeMotion, mass: float) -> _Search:
    """Return states of the motion, and of impacts to its depth and to a fraction of it."""
    firm = np.flatnonzero(motion.judged)
    firm = firm[np.argsort(motion.penetration[firm], kind="stable")]
    some = firm[np.linspace(0, firm.size - 1, _SAMPLES[0]).astype(int)]
    parts = [np.stack([motion.penetration[some], motion.velocity[some]])]
    counts = [1.0]
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
    """Return penetrations and velocities of a free body's impact, evenly spaced in time."""
    step = half_period(law, drop.mass, drop.depth) / _STEPS
    pushing = lambda x, v: max(law.force(x, v), 0.0)  # noqa: E731
    inside = [(x, v) for x, v in course(pushing, drop.mass, 0.0, drop.speed, step) if x > 0.0]
    places = np.linspace(0, len(inside) - 1, _SAMPLES[1] if inside else 0).astype(int)
    states: Floats = np.array(inside, dtype=np.float64).reshape(-1, 2)[places].T
    return states


# The rebound of a free body from rows, with MuJoCo's time stepping.

# Points of the table of forces for the integration.
_TABLE = 2000
#: Steps after which a body counts as at rest; at stable steps a half period takes ten or more.
MOST_STEPS = 20_000


def drop_restitution(rows: PairRows, drop: Drop, step: float) -> float:
    """Return the restitution of a free body on the rows, by semi-implicit Euler as in MuJoCo.

    Parameters
    ----------
    rows : PairRows
        The rows of the fragment.
    drop : Drop
        The impact.
    step : float
        Time step, s.
    """
    depths = np.linspace(0.0, 1.5 * drop.depth, _TABLE + 1)
    spacing = 1.5 * drop.depth / _TABLE
    depths[0] = 1e-6 * depths[1]
    tables = []
    n = rows.contacts
    for row in rows.rows:
        spring, damper = row.springs_and_dampers(depths, rows.mobility)
        mass = row.added_mass(depths, rows.mobility)
        tables.append([*((n * each).tolist() for each in (spring, damper, mass)), n * row.adhesion])
    # At first touch MuJoCo has no contact yet: the first step is free flight.
    x = step * drop.speed
    v = drop.speed
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
    """Return ẍ of a free body, m ẍ = −Σ f, each f = held + m_a ẍ, at least −adhesion."""
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


# The rows for a law, and their largest impedance.

# The minimum of d, 1e-4, hardly affects a spring, so it can have this little added mass; with less,
# d could not decrease enough towards the surface (20 times, for the shapes seen).
SPRING_HIGH = 0.002
# Trial values for a damper, a factor of 1.5 apart. Lower ones reach 1e-4 too soon, higher add mass.
DAMPER_HIGHS = (0.002, 0.003, 0.005, 0.0075, 0.011, 0.017, 0.025, 0.04, 0.06)
# Target errors are 0.6 % of force and 3 % of restitution, so force errors weigh five times as much.
_FORCE_TO_REBOUND = 5.0
# Margin on the largest pull of a damper, because the adhesion is rounded to two digits.
_ADHESION = 1.1
# Steps per half period where restitution is needed to only 0.1 %.
_COARSE = 400
# Impacts to compare, as fractions of the greatest depth.
_DROPS = (1.0, 0.3)


def depths_that_count(motion: ProbeMotion) -> Floats:
    """Return depths [m] to fit at: those of the motion, and evenly spaced ones from 0."""
    firm = np.sort(motion.penetration[motion.judged])
    places = np.linspace(0, firm.size - 1, 120).astype(int)
    deepest = _ROOM * float(firm[-1])
    return np.sort(np.concatenate([firm[places], np.linspace(0.0, deepest, 61)[1:]]))


def single(
    law: GeneralisedHuntCrossley,
    motion: ProbeMotion,
    mobility: float,
    contacts: int,
) -> PairRows:
    """Return one row for the nearest Kelvin–Voigt law: S = K (1 − d) Â, D = B (1 − d) Â."""
    nearest = kelvin_voigt(law, motion)
    if not (nearest.K > 0.0 and nearest.B >= 0.0):
        # A positive solref has another meaning in MuJoCo.
        raise InvalidParameterError(
            f"form kelvin-voigt: the nearest K x + B v has K = {nearest.K:.3g} N/m and B = "
            f"{nearest.B:.3g} N·s/m, but MuJoCo needs K > 0 and B ≥ 0: use --form callback"
        )
    share = (1.0 - LEAST) * mobility / contacts
    solimp = (LEAST, LEAST, _ROOM * motion.deepest, 0.5, 2.0)
    row = PairRow(share * nearest.K, share * nearest.B, solimp)
    return PairRows((row,), mobility, contacts)


def pair(
    law: GeneralisedHuntCrossley,
    motion: ProbeMotion,
    mobility: float,
    contacts: int,
) -> PairRows:
    """Return a spring and a damper that can pull: F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0."""
    depths = depths_that_count(motion)
    share = mobility / contacts
    # While the law pushes, its damper pulls less than its spring pushes; on the motion it may pull
    # more. With more adhesion than both the pair would pull without need.
    x = motion.penetration[motion.judged]
    v = motion.velocity[motion.judged]
    drag = law.B * x**law.p * -v
    strongest = max(float(drag.max()), law.K * float(depths[-1]) ** law.n)
    adhesion = float(f"{_ADHESION * strongest / contacts:.2g}")
    if law.n == 1.0:
        solimp = _level(depths)
        inset = 0.0
        scale = law.K * (1.0 - LEAST) / LEAST**2
    else:
        target = law.K * depths**law.n
        solimp, inset, scale = power_of_depth(depths, target, SPRING_HIGH, spring=True, low=True)
    spring = PairRow(scale * solimp[1] ** 2 * share, 0.0, solimp, inset)
    if law.B == 0.0:
        return PairRows((spring,), mobility, contacts)
    if law.p == 0.0:
        shapes = [(_level(depths), 0.0, law.B * (1.0 - LEAST) / LEAST)]
    else:
        target = law.B * depths**law.p
        low = law.p < 1.0
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
    """Return a constant impedance, for a linear spring or a damper independent of depth."""
    return (LEAST, LEAST, float(depths[-1]), 0.5, 2.0)


def misfit_to(
    law: GeneralisedHuntCrossley,
    motion: ProbeMotion,
    mass: float,
    parts: tuple[float, ...] = _DROPS,
) -> Callable[[PairRows], float]:
    """Return a function for the error of rows: of force, %, plus a fifth of that of restitution."""
    drops = [drop_to(law, mass, part * motion.deepest) for part in parts]
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


#: The fits of a law by rows, by the name of the form.
FITS: dict[str, Callable[[GeneralisedHuntCrossley, ProbeMotion, float, int], PairRows]] = {
    "kelvin-voigt": single,
    "pair": pair,
    "two-contacts": two_contacts,
}
