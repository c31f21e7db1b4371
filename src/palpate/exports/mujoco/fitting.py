"""The rows that carry a law, and how much impedance they may have."""

import math
from collections.abc import Callable

import numpy as np

from palpate.exports.errors import Drop, drop_to, force_error
from palpate.exports.motion import Motion
from palpate.exports.mujoco import profiles
from palpate.exports.mujoco.profiles import Profile
from palpate.exports.mujoco.rows import LEAST, Row, Rows
from palpate.exports.nearest import kelvin_voigt
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

# A spring misses nothing where d is at its least, 1e-4, and so may add as little mass as this; with
# less, d could no longer fall enough towards the surface (20 times, for the shapes seen).
SPRING_HIGH = 0.002
# What a damper may have, a factor of 1.5 apart, or of 4 where shares are tried as well. Less is
# clamped at 1e-4 too soon, more adds mass.
DAMPER_HIGHS = (0.002, 0.003, 0.005, 0.0075, 0.011, 0.017, 0.025, 0.04, 0.06)
SHARED_HIGHS = (0.003, 0.011, 0.04)
# The force's bar is .6 %, restitution's 3 %: a percent of the one counts as five of the other.
_FORCE_TO_REBOUND = 5.0
# Of a spring's force that the damper's row may hold instead, so that it need not pull.
_SHARES = (0.0, 0.05, 0.15, 0.3)
# How far a width goes beyond the deepest sample.
_ROOM = 1.02
# A row may pull ten times as strongly as the whole contact ever pushes.
_ADHESION = 10.0
# Steps to a drop, where e has to be known to a tenth of a percent only.
_COARSE = 400
# Drops that are judged, as parts of the greatest depth.
_DROPS = (1.0, 0.3)
# Points of the table that a drop is integrated with.
_TABLE = 2000


def depths_that_count(motion: Motion) -> Floats:
    """Depths [m] to fit at: as often as the motion was there, and once all the way from 0."""
    firm = np.sort(motion.penetration[motion.judged])
    places = np.linspace(0, firm.size - 1, 120).astype(int)
    deepest = _ROOM * float(firm[-1])
    return np.sort(np.concatenate([firm[places], np.linspace(0.0, deepest, 61)[1:]]))


def single(law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int) -> Rows:
    """One row: the nearest Kelvin–Voigt law, S = K (1 − d) Â and D = B (1 − d) Â at d = 1e-4."""
    nearest = kelvin_voigt(law, motion)
    width = _ROOM * motion.deepest
    scale = (1.0 - LEAST) / LEAST  # so that d/(1 − d) · scale = 1
    stiffness = profiles.constant(LEAST, width, scale / LEAST * nearest.stiffness)
    damping = scale * nearest.damping
    row = _row(stiffness, damping, mobility, contacts)
    return Rows((row,), mobility, contacts)


def pair(law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int) -> Rows:
    """A spring and a damper, each a row that may pull: F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0."""
    adhesion = _ADHESION * float(np.abs(motion.force_by(law)[motion.judged]).max()) / contacts
    adhesion = float(f"{adhesion:.2g}")
    return _best(law, motion, mobility, contacts, adhesion)


def two_contacts(
    law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int
) -> Rows:
    """The same where rows cannot pull: the damper's holds a share of the spring's force."""
    return _best(law, motion, mobility, contacts, 0.0)


def _best(
    law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int, adhesion: float
) -> Rows:
    made = _candidates(law, depths_that_count(motion), mobility, contacts, adhesion)
    judged = _judge(law, motion, 1.0 / mobility)
    return min(made, key=judged)


def badness(rows: Rows, law: GeneralisedHuntCrossley, motion: Motion) -> float:
    """Error of the force on a motion, %, and a fifth of that of restitution in two drops."""
    return _judge(law, motion, 1.0 / rows.mobility)(rows)


def _judge(law: GeneralisedHuntCrossley, motion: Motion, mass: float) -> Callable[[Rows], float]:
    drops = [drop_to(law, mass, part * motion.deepest) for part in _DROPS]
    target = motion.force_by(law)

    def judged(rows: Rows) -> float:
        force = rows.force(motion.penetration, motion.velocity, motion.acceleration)
        off = [
            rebound(rows, drop, _half_period(law, drop) / _COARSE) - drop.restitution
            for drop in drops
        ]
        rebounds = max(abs(each) for each in off)
        return force_error(force, target, motion.judged) + 100.0 * rebounds / _FORCE_TO_REBOUND

    return judged


def _candidates(
    law: GeneralisedHuntCrossley, depths: Floats, mobility: float, contacts: int, adhesion: float
) -> list[Rows]:
    shares = (0.0,) if adhesion else _SHARES
    spring = _spring(law, depths)
    found = []
    for damper in _dampers(law, depths, DAMPER_HIGHS if adhesion else SHARED_HIGHS):
        if damper is None:
            return [Rows((_row(spring, 0.0, mobility, contacts, adhesion),), mobility, contacts)]
        for share in shares:
            row = _row(damper, damper.scale, mobility, contacts, adhesion, spring=0.0)
            first = spring
            if share:
                row, first = _shared(law, depths, row, share, mobility, contacts)
            rows = (_row(first, 0.0, mobility, contacts, adhesion), row)
            found.append(Rows(rows, mobility, contacts))
    return found


def _spring(law: GeneralisedHuntCrossley, depths: Floats) -> Profile:
    if law.exponent == 1.0:
        scale = law.stiffness * (1.0 - LEAST) / LEAST**2
        return profiles.constant(LEAST, float(depths[-1]), scale)
    return profiles.spring(depths, law.stiffness * depths**law.exponent, SPRING_HIGH)


def _dampers(
    law: GeneralisedHuntCrossley, depths: Floats, highs: tuple[float, ...]
) -> list[Profile | None]:
    if law.damping == 0.0:
        return [None]
    if law.damping_exponent == 0.0:
        scale = law.damping * (1.0 - LEAST) / LEAST
        return [profiles.constant(LEAST, float(depths[-1]), scale)]
    target = law.damping * depths**law.damping_exponent
    low = law.damping_exponent < 1.0
    return [profiles.damper(depths, target, high, low=low) for high in highs]


def _shared(
    law: GeneralisedHuntCrossley,
    depths: Floats,
    row: Row,
    share: float,
    mobility: float,
    contacts: int,
) -> tuple[Row, Profile]:
    """Give a damper's row a share of the spring's force at the greatest depth, and fit the rest."""
    whole = law.stiffness * depths**law.exponent
    unit = Row(1.0, row.damper, row.solimp, row.inset)
    held = contacts * unit.springs_and_dampers(depths, mobility)[0]
    spring = share * whole[-1] / held[-1]
    rest = np.maximum(whole - spring * held, 1e-9 * whole)
    fitted = profiles.spring(depths, rest, SPRING_HIGH)
    return Row(float(spring), row.damper, row.solimp, row.inset), fitted


def _row(
    profile: Profile,
    damper: float,
    mobility: float,
    contacts: int,
    adhesion: float = 0.0,
    spring: float | None = None,
) -> Row:
    """The row of a profile, of whose factors S = scale d_w² Â and D = scale d_w Â, by contact."""
    high = profile.solimp[1]
    mass = mobility / contacts
    s = profile.scale * high**2 * mass if spring is None else spring
    return Row(s, damper * high * mass, profile.solimp, profile.inset, adhesion)


def rebound(rows: Rows, drop: Drop, step: float) -> float:
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
    deepest = 1.5 * drop.depth
    rows_at = [_tables(row, rows, deepest) for row in rows.rows]
    spacing = deepest / _TABLE
    # Where the tip touches, MuJoCo has no contact yet: the first step is free flight.
    x, v = step * drop.speed, drop.speed
    # A million steps: a body that has not come back by then stays.
    for _ in range(1_000_000):
        place = min(x / spacing, _TABLE - 1.0)
        k = int(place)
        part = place - k
        felt = []
        for push, drag, added, pull in rows_at:
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
    pushing = felt
    while True:
        load = sum(held for held, _, _ in pushing)
        load -= sum(each[2] for each in felt if each not in pushing)
        a = -load / (mass + sum(added for _, added, _ in pushing))
        left = [each for each in pushing if each[0] + each[1] * a >= -each[2]]
        if len(left) == len(pushing):
            return a
        pushing = left


def _tables(
    row: Row, rows: Rows, deepest: float
) -> tuple[list[float], list[float], list[float], float]:
    """Force at rest, damping and added mass at even depths from just inside; the adhesion."""
    depths = np.linspace(0.0, deepest, _TABLE + 1)
    depths[0] = 1e-6 * depths[1]
    n = rows.contacts
    spring, damper = row.springs_and_dampers(depths, rows.mobility)
    mass = row.added_mass(depths, rows.mobility)
    return (n * spring).tolist(), (n * damper).tolist(), (n * mass).tolist(), n * row.adhesion


def _half_period(law: GeneralisedHuntCrossley, drop: Drop) -> float:
    slope = law.stiffness * drop.depth ** (law.exponent - 1.0)
    return math.pi * math.sqrt(drop.mass / slope)


#: The ways of a law into rows, by the name of the form.
FITS: dict[str, Callable[[GeneralisedHuntCrossley, Motion, float, int], Rows]] = {
    "kelvin-voigt": single,
    "pair": pair,
    "two-contacts": two_contacts,
}
