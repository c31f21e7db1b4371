"""What engines have in common whose contact is F = K x + B v."""

import math

from palpate.force_laws import GeneralisedHuntCrossley


def is_kelvin_voigt(law: GeneralisedHuntCrossley) -> bool:
    """Whether a law is exactly K x + B v."""
    linear = law.damping == 0.0 or law.damping_exponent == 0.0
    return law.exponent == 1.0 and linear and not law.remembers


def stable_step(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Time step from which on an explicit penalty contact is unstable, s.

    h² k/m + 2 h c/m = 4, with k = n K xⁿ⁻¹ and c = B xᵖ, at the greatest depth. (Semi-implicit
    Euler of m ẍ + c ẋ + k x = 0; MuJoCo held to within 10 % of it.)
    """
    k = law.exponent * law.stiffness * depth ** (law.exponent - 1.0)
    c = law.damping * depth**law.damping_exponent
    return float((math.sqrt(c * c + 4.0 * k * mass) - c) / k)
