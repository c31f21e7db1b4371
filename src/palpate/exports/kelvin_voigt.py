"""What engines have in common whose contact is F = K x + B v."""

import math

from palpate.exports.asked import Asked
from palpate.force_laws import GeneralisedHuntCrossley

# b v from which on a Hunt–Crossley damper differs by a tenth from a linear one: e follows.
SLOW = 0.1


def is_kelvin_voigt(law: GeneralisedHuntCrossley) -> bool:
    """Whether a law is exactly K x + B v."""
    linear = law.damping == 0.0 or law.damping_exponent == 0.0
    return law.exponent == 1.0 and linear and not law.remembers


def impact_warnings(asked: Asked) -> tuple[str, ...]:
    """Say that impacts will be wrong, where a law that is not Kelvin–Voigt is made one."""
    law = asked.law
    if is_kelvin_voigt(law):
        return ()
    quick = law.stiffness > 0.0 and law.damping / law.stiffness * asked.motion.fastest > SLOW
    if law.exponent == 1.0 and not quick:
        return ()
    return (
        "the engine has F = K x + B v, and this law is another: impacts will be wrong, with a "
        "restitution 20 to 50 % too low where other laws were tried",
    )


def stable_step(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Time step from which on an explicit penalty contact is unstable, s.

    h² k/m + 2 h c/m = 4, with k = n K xⁿ⁻¹ and c = B xᵖ, at the greatest depth. (Semi-implicit
    Euler of m ẍ + c ẋ + k x = 0; MuJoCo held to within 10 % of it.)
    """
    k = law.exponent * law.stiffness * depth ** (law.exponent - 1.0)
    c = law.damping * depth**law.damping_exponent
    return float((math.sqrt(c * c + 4.0 * k * mass) - c) / k)
