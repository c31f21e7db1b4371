"""The nearest law of a kind that an engine has, along a motion."""

from dataclasses import dataclass

import numpy as np

from palpate.exports.errors import force_error
from palpate.exports.motion import Motion
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Floats

_GOLDEN = 0.5 * (1.0 + 5.0**0.5)
_EXPONENTS = (0.5, 3.0)
_SECTIONS = 22  # n to 2.5/φ²² = 6·10⁻⁵; the error is flat there


def with_exponents(law: ForceLaw, motion: Motion, n: float, p: float) -> GeneralisedHuntCrossley:
    """Return the K xⁿ + B xᵖ v nearest to a law: least squares over the judged samples, B ≥ 0.

    The law itself where it has these exponents and no memory.
    """
    if isinstance(law, GeneralisedHuntCrossley) and not law.remembers:
        undamped = law.damping == 0.0
        same = law.exponent == n and (undamped or law.damping_exponent == p)
        if same and law.damping >= 0.0:
            return GeneralisedHuntCrossley(law.stiffness, n, law.damping, p)
    firm = motion.judged
    x, v = motion.penetration[firm], motion.velocity[firm]
    force = motion.force_by(law)[firm]
    stiffness, damping = _least_squares(x**n, x**p * v, force)
    return GeneralisedHuntCrossley(stiffness, n, damping, p)


def kelvin_voigt(law: ForceLaw, motion: Motion) -> GeneralisedHuntCrossley:
    """Return the K x + B v nearest to a law; see :func:`with_exponents`."""
    return with_exponents(law, motion, 1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Nearest:
    """The law of one power of depth, without memory, that stands for another.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        The one exported.
    which : str
        How it came about, in words; empty where it is the law itself.
    error_percent : float
        Of its force against that of the whole law, over the judged samples.
    """

    law: GeneralisedHuntCrossley
    which: str = ""
    error_percent: float = 0.0

    @classmethod
    def of(
        cls, member: GeneralisedHuntCrossley, law: ForceLaw, motion: Motion, which: str
    ) -> "Nearest":
        """Return a law in place of another, with its error along a motion."""
        error = force_error(motion.force_by(member), motion.force_by(law), motion.judged)
        return cls(member, which, error)


def without_memory(law: GeneralisedHuntCrossley, motion: Motion) -> Nearest:
    """Return the member without memory whose force is nearest along a motion.

    The relaxed one, the instantaneous one, or K and B by least squares with the law's exponents.
    """
    if not law.remembers:
        return Nearest(law)
    fitted = with_exponents(law, motion, law.exponent, law.damping_exponent)
    members = {
        "the law once it has relaxed": law.relaxed(),
        "the law before anything has relaxed": law.instantaneous(),
        "K and B nearest to the law with memory along this motion": fitted,
    }
    found = [Nearest.of(member, law, motion, which) for which, member in members.items()]
    # Not one that nothing pushes back by, or that makes energy.
    return min(
        found,
        key=lambda each: (
            each.law.stiffness <= 0.0,
            each.law.damping < 0.0,
            each.error_percent,
        ),
    )


def one_power(law: ForceLaw, motion: Motion) -> Nearest:
    """Return the K xⁿ + B v nearest to a law of two powers of depth, K₁ x + K₂ x² + B v.

    n by a golden section over what lies between the two powers and a little beyond them.
    """

    def member(n: float) -> Nearest:
        nearest = with_exponents(law, motion, n, 0.0)
        return Nearest.of(nearest, law, motion, "one power of depth nearest along this motion")

    low, high = _EXPONENTS
    for _ in range(_SECTIONS):
        first, second = high - (high - low) / _GOLDEN, low + (high - low) / _GOLDEN
        if member(first).error_percent < member(second).error_percent:
            high = second
        else:
            low = first
    return member(0.5 * (low + high))


def _least_squares(elastic: Floats, damper: Floats, force: Floats) -> tuple[float, float]:
    """K and B ≥ 0; both columns scaled, since x² and x² v differ by orders."""
    columns = np.column_stack([elastic, damper])
    sizes = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    sizes[sizes == 0.0] = 1.0
    stiffness, damping = np.linalg.lstsq(columns / sizes, force, rcond=None)[0] / sizes
    if damping >= 0.0:
        return float(stiffness), float(damping)
    return float(elastic @ force) / float(elastic @ elastic), 0.0
