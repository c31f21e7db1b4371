"""The rows that carry a law, and how much impedance they may have."""

import math
from collections.abc import Callable

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.exports.errors import drop_to, force_error
from palpate.exports.motion import Motion
from palpate.exports.mujoco import profiles
from palpate.exports.mujoco.profiles import Profile
from palpate.exports.mujoco.pushing import two_contacts
from palpate.exports.mujoco.rebounding import rebound
from palpate.exports.mujoco.rows import LEAST, Row, Rows
from palpate.exports.nearest import kelvin_voigt
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.validation import Floats

# A spring misses nothing where d is at its least, 1e-4, and so may add as little mass as this; with
# less, d could no longer fall enough towards the surface (20 times, for the shapes seen).
SPRING_HIGH = 0.002
# What a damper may have, a factor of 1.5 apart. Less is clamped at 1e-4 too soon, more adds mass.
DAMPER_HIGHS = (0.002, 0.003, 0.005, 0.0075, 0.011, 0.017, 0.025, 0.04, 0.06)
# The force's bar is .6 %, restitution's 3 %: a percent of the one counts as five of the other.
_FORCE_TO_REBOUND = 5.0
# How far a width goes beyond the deepest sample.
_ROOM = 1.02
# Of what a damper may have to pull with: two digits of it are written, and none below.
_ADHESION = 1.1
# Steps to a drop's half period, where e has to be known to a tenth of a percent only.
_COARSE = 400
# Drops that are judged, as parts of the greatest depth.
_DROPS = (1.0, 0.3)


def depths_that_count(motion: Motion) -> Floats:
    """Depths [m] to fit at: as often as the motion was there, and once all the way from 0."""
    firm = np.sort(motion.penetration[motion.judged])
    places = np.linspace(0, firm.size - 1, 120).astype(int)
    deepest = _ROOM * float(firm[-1])
    return np.sort(np.concatenate([firm[places], np.linspace(0.0, deepest, 61)[1:]]))


def single(law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int) -> Rows:
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
    row = Row(share * nearest.stiffness, share * nearest.damping, solimp)
    return Rows((row,), mobility, contacts)


def pair(law: GeneralisedHuntCrossley, motion: Motion, mobility: float, contacts: int) -> Rows:
    """A spring, and a damper that may pull: F = K xⁿ + B xᵖ v, n ≥ 1, p ≥ 0."""
    depths, share = depths_that_count(motion), mobility / contacts
    # Where the law pushes, its damper pulls less strongly than its spring pushes; on the motion it
    # may pull more. Beyond both the whole pair would pull, as no real contact does.
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    drag = law.damping * x**law.damping_exponent * -v
    strongest = max(float(drag.max()), law.stiffness * float(depths[-1]) ** law.exponent)
    # Without a damper nothing has to pull.
    adhesion = float(f"{_ADHESION * strongest / contacts:.2g}") if law.damping else 0.0
    shape = _spring(law, depths)
    high = shape.solimp[1]
    spring = Row(shape.scale * high**2 * share, 0.0, shape.solimp, shape.inset)
    made = []
    for shape in _dampers(law, depths):
        high = shape.solimp[1]
        damper = Row(0.0, shape.scale * high * share, shape.solimp, shape.inset, adhesion)
        made.append(Rows((spring, damper), mobility, contacts))
    if not made:
        return Rows((spring,), mobility, contacts)
    return made[0] if len(made) == 1 else min(made, key=_judge(law, motion, 1.0 / mobility))


def badness(rows: Rows, law: GeneralisedHuntCrossley, motion: Motion) -> float:
    """Error of the force on a motion, %, and a fifth of that of restitution in two drops."""
    return _judge(law, motion, 1.0 / rows.mobility)(rows)


def _judge(law: GeneralisedHuntCrossley, motion: Motion, mass: float) -> Callable[[Rows], float]:
    drops = [drop_to(law, mass, part * motion.deepest) for part in _DROPS]
    secants = [law.stiffness * drop.depth ** (law.exponent - 1.0) for drop in drops]
    steps = [math.pi * math.sqrt(mass / each) / _COARSE for each in secants]
    target = motion.force_by(law)

    def judged(rows: Rows) -> float:
        force = rows.force(motion.penetration, motion.velocity, motion.acceleration)
        off = [
            abs(rebound(rows, drop, step) - drop.restitution)
            for drop, step in zip(drops, steps, strict=True)
        ]
        return force_error(force, target, motion.judged) + 100.0 * max(off) / _FORCE_TO_REBOUND

    return judged


def _spring(law: GeneralisedHuntCrossley, depths: Floats) -> Profile:
    if law.exponent == 1.0:
        scale = law.stiffness * (1.0 - LEAST) / LEAST**2
        return profiles.constant(LEAST, float(depths[-1]), scale)
    return profiles.spring(depths, law.stiffness * depths**law.exponent, SPRING_HIGH)


def _dampers(law: GeneralisedHuntCrossley, depths: Floats) -> list[Profile]:
    """Shapes for a damper, by d at the width; none of a law without one."""
    if law.damping == 0.0:
        return []
    if law.damping_exponent == 0.0:
        scale = law.damping * (1.0 - LEAST) / LEAST
        return [profiles.constant(LEAST, float(depths[-1]), scale)]
    target = law.damping * depths**law.damping_exponent
    low = law.damping_exponent < 1.0
    return [profiles.damper(depths, target, high, low=low) for high in DAMPER_HIGHS]


#: The ways of a law into rows, by the name of the form.
FITS: dict[str, Callable[[GeneralisedHuntCrossley, Motion, float, int], Rows]] = {
    "kelvin-voigt": single,
    "pair": pair,
    "two-contacts": two_contacts,
}
