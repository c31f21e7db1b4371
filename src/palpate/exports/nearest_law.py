"""The nearest law of an engine's form, along a motion."""

import math

import numpy as np

from palpate.exports.motion import ProbeMotion
from palpate.exports.replay_errors import force_error
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.method.estimators.least_squares import least_squares
from palpate.validation import Floats, frozen

_EXPONENTS = (0.5, 3.0)  # a little beyond x and x²


def fit_with_exponents(
    law: ForceLaw,
    motion: ProbeMotion,
    n: float,
    p: float,
) -> GeneralisedHuntCrossley:
    """Return the nearest K xⁿ + B xᵖ v, by least squares over the judged samples, B ≥ 0.

    The law itself if it has these exponents and no relaxation.
    """
    if law.powers is not None and not law.remembers:
        own = GeneralisedHuntCrossley.of(law)
        same = own.n == n and (own.B == 0.0 or own.p == p)
        if same and own.B >= 0.0:
            return GeneralisedHuntCrossley(K=own.K, n=n, B=own.B, p=p)
    return _nearest(law, motion, (n, n), p)


def _nearest(
    law: ForceLaw,
    motion: ProbeMotion,
    exponents: tuple[float, float],
    p: float,
) -> GeneralisedHuntCrossley:
    """Return K, n within these bounds, and B ≥ 0 by least squares over the judged samples."""
    firm = motion.judged
    unit = motion.deepest  # in SI units K and n are correlated
    x = motion.penetration[firm] / unit
    v = motion.velocity[firm]
    force = motion.force_by(law)[firm]
    damper = x**p * v
    logarithm = np.log(x)

    def model(parameters: Floats) -> tuple[Floats, Floats]:
        stiffness, n, damping = parameters
        power = x**n
        slopes = np.column_stack([power, stiffness * power * logarithm, damper])
        slopes[:, 1] *= exponents[0] < exponents[1]
        return force - stiffness * power - damping * damper, slopes

    bounds = np.array([-np.inf, exponents[0], 0.0]), np.array([np.inf, exponents[1], np.inf])
    found = least_squares(model, np.array([0.0, 0.5 * sum(exponents), 0.0]), bounds, 1e-12)
    stiffness, n, damping = found.parameters.tolist()
    return GeneralisedHuntCrossley(K=stiffness / unit**n, n=n, B=damping / unit**p, p=p)


def fit_with_one_exponent(
    law: GeneralisedHuntCrossley,
    motion: ProbeMotion,
    n: float,
) -> GeneralisedHuntCrossley:
    """Return the nearest K xⁿ (1 + b v), b ≥ 0.

    For a law with p = n it keeps b = B/K, and so the restitution.
    """
    if law.B > 0.0 and law.p != law.n:
        return fit_with_exponents(law, motion, n, n)
    b = max(law.B, 0.0) / law.K
    x = motion.penetration[motion.judged]
    v = motion.velocity[motion.judged]
    weight = np.maximum(1.0 + b * v, 0.0) ** 2 * x**n
    stiffness = law.K * float(weight @ x**law.n / (weight @ x**n))
    return GeneralisedHuntCrossley(K=stiffness, n=n, B=stiffness * b, p=n)


def kelvin_voigt(law: ForceLaw, motion: ProbeMotion) -> GeneralisedHuntCrossley:
    """Return the nearest K x + B v; see :func:`fit_with_exponents`."""
    return fit_with_exponents(law, motion, 1.0, 0.0)


def is_kelvin_voigt(law: GeneralisedHuntCrossley) -> bool:
    """Whether a law is exactly K x + B v."""
    linear = law.B == 0.0 or law.p == 0.0
    return law.n == 1.0 and linear and not law.remembers


def stable_step(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Return the time step, s, from which an explicit penalty contact is unstable.

    h² k/m + 2 h c/m = 4, with k = n K xⁿ⁻¹ and c = B xᵖ, at the greatest depth. (Semi-implicit
    Euler of m ẍ + c ẋ + k x = 0; MuJoCo was stable to within 10 % of it.)
    """
    k = law.n * law.K * depth ** (law.n - 1.0)
    c = law.B * depth**law.p
    return float((math.sqrt(c * c + 4.0 * k * mass) - c) / k)


@frozen
class Nearest:
    """A law K xⁿ + B xᵖ v exported in place of another.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        The exported law.
    which : str
        How it was derived, in words; empty for the law itself.
    error_percent : float
        Rms error of its force against that of the original law, over the judged samples, %.
    """

    law: GeneralisedHuntCrossley
    which: str = ""
    error_percent: float = 0.0

    @classmethod
    def of(
        cls,
        member: GeneralisedHuntCrossley,
        law: ForceLaw,
        motion: ProbeMotion,
        which: str,
    ) -> "Nearest":
        """Return an exported law with its error along a motion."""
        error = force_error(motion.force_by(member), motion.force_by(law), motion.judged)
        return cls(member, which, error)


def nearest_without_memory(law: GeneralisedHuntCrossley, motion: ProbeMotion) -> Nearest:
    """Return the law without relaxation whose force is nearest along a motion.

    The relaxed law, the instantaneous one, or K and B by least squares with the law's exponents.
    """
    if not law.remembers:
        return Nearest(law)
    fitted = fit_with_exponents(law, motion, law.n, law.p)
    members = {
        "the fully relaxed law": law.relaxed(),
        "the instantaneous (unrelaxed) law": law.instantaneous(),
        "the law without relaxation nearest along this motion": fitted,
    }
    found = [Nearest.of(member, law, motion, which) for which, member in members.items()]
    # Avoid laws with K ≤ 0 or B < 0.
    return min(
        found,
        key=lambda each: (each.law.K <= 0.0, each.law.B < 0.0, each.error_percent),
    )


def one_power(law: ForceLaw, motion: ProbeMotion) -> Nearest:
    """Return the K xⁿ + B v nearest to the quadratic law K₁ x + K₂ x² + B v."""
    nearest = _nearest(law, motion, _EXPONENTS, 0.0)
    return Nearest.of(
        nearest,
        law,
        motion,
        "the law with one power of depth nearest along this motion",
    )
