"""The nearest law of a kind that an engine has, along a motion."""

from dataclasses import dataclass

import numpy as np

from palpate.exports.errors import force_error
from palpate.exports.motion import Motion
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Floats


def with_exponents(law: ForceLaw, motion: Motion, n: float, p: float) -> GeneralisedHuntCrossley:
    """Return the K xⁿ + B xᵖ v nearest to a law: least squares over the judged samples, B ≥ 0.

    The law itself where it has these exponents and no memory.
    """
    if isinstance(law, GeneralisedHuntCrossley) and not law.remembers:
        undamped = law.damping == 0.0
        if law.exponent == n and (undamped or law.damping_exponent == p):
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
class WithoutMemory:
    """The law without memory that stands for one that remembers.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        The one exported.
    which : str
        How it came about, in words; empty of a law that does not remember: it is that law.
    error_percent : float
        Of its force against that of the whole law, over the judged samples.
    """

    law: GeneralisedHuntCrossley
    which: str = ""
    error_percent: float = 0.0


def without_memory(law: GeneralisedHuntCrossley, motion: Motion) -> WithoutMemory:
    """Return the member without memory whose force is nearest along a motion.

    The relaxed one, the instantaneous one, or K and B by least squares with the law's exponents.
    """
    if not law.remembers:
        return WithoutMemory(law)
    whole = motion.force_by(law)
    members = {
        "once it has relaxed": law.relaxed(),
        "before anything has relaxed": law.instantaneous(),
        "nearest along this motion": with_exponents(
            law, motion, law.exponent, law.damping_exponent
        ),
    }
    errors = {
        which: force_error(motion.force_by(member), whole, motion.judged)
        for which, member in members.items()
    }
    which = min(errors, key=lambda each: errors[each])
    return WithoutMemory(members[which], which, errors[which])


def _least_squares(elastic: Floats, damper: Floats, force: Floats) -> tuple[float, float]:
    """K and B ≥ 0; both columns scaled, since x² and x² v differ by orders."""
    columns = np.column_stack([elastic, damper])
    sizes = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    sizes[sizes == 0.0] = 1.0
    stiffness, damping = np.linalg.lstsq(columns / sizes, force, rcond=None)[0] / sizes
    if damping >= 0.0:
        return float(stiffness), float(damping)
    return float(elastic @ force) / float(elastic @ elastic), 0.0
