"""The nearest law of an engine's form, along a motion."""

import math
from collections.abc import Callable

import numpy as np

from palpate.digits import format_hertz
from palpate.exports.motion import ProbeMotion
from palpate.exports.replay_errors import force_error
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Floats, frozen

# n of a law that is sought: a little beyond sqrt(x) and x².
_EXPONENTS = (0.3, 3.0)
# Each round narrows the range of n to a tenth: the last is 1e-8 wide.
_ROUNDS = 8
_TRIED = 21
# Hunt and Crossley's p = n is kept unless another p lowers the error by more than this, %: all
# engines take it, and its restitution is exact in most.
_PREFERENCE = 0.5

#: The damper's exponent p for an n: Hunt and Crossley's, a half-space's, Kelvin and Voigt's.
_DAMPERS: tuple[Callable[[float], float], ...] = (
    lambda n: n,
    lambda n: max(n - 1.0, 0.0),
    lambda n: 0.0,
)


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
    return _fit_powers(motion.force_by(law), motion, n, p)[0]


def _fit_powers(
    force: Floats,
    motion: ProbeMotion,
    n: float,
    p: float,
) -> tuple[GeneralisedHuntCrossley, float]:
    """Return K xⁿ + B xᵖ v, B ≥ 0, by least squares over the judged samples, and its misfit, N²."""
    unit = motion.deepest  # in SI units K and n are correlated
    x = motion.penetration[motion.judged] / unit
    columns = np.column_stack([x**n, x**p * motion.velocity[motion.judged]])
    target = force[motion.judged]
    columns = columns if np.any(columns[:, 1]) else columns[:, :1]
    strengths = np.linalg.lstsq(columns, target, rcond=None)[0]
    if strengths[-1] < 0.0 or strengths.size == 1:
        columns = columns[:, :1]
        strengths = np.linalg.lstsq(columns, target, rcond=None)[0]
    misfit = target - columns @ strengths
    stiffness, damping = (*strengths.tolist(), 0.0)[:2]
    law = GeneralisedHuntCrossley(K=stiffness / unit**n, n=n, B=damping / unit**p, p=p)
    return law, float(misfit @ misfit)


def nearest_to_force(
    force: Floats,
    motion: ProbeMotion,
    exponent: float | None = None,
) -> GeneralisedHuntCrossley:
    """Return the K xⁿ + B xᵖ v without memory that is nearest to a force [N] along a motion.

    p is n, n − 1 or 0. ``exponent`` fixes n (default: least squares).
    """
    fitted = [_best_exponent(force, motion, damper, exponent) for damper in _DAMPERS]
    errors = [force_error(motion.force_by(law), force, motion.judged) for law in fitted]
    best = min(range(len(fitted)), key=errors.__getitem__)
    return fitted[0 if errors[0] <= errors[best] + _PREFERENCE else best]


def _best_exponent(
    force: Floats,
    motion: ProbeMotion,
    damper: Callable[[float], float],
    exponent: float | None = None,
) -> GeneralisedHuntCrossley:
    """Return the law of least misfit over n, by narrowing its range; K and B are linear."""
    low, high = _EXPONENTS if exponent is None else (exponent, exponent)
    rounds = _ROUNDS if low < high else 1
    for _ in range(rounds):
        tried = np.linspace(low, high, _TRIED if low < high else 1).tolist()
        fits = [_fit_powers(force, motion, n, damper(n)) for n in tried]
        best = min(range(len(fits)), key=lambda k: fits[k][1])
        low = tried[max(best - 1, 0)]
        high = tried[min(best + 1, len(tried) - 1)]
    return fits[best][0]


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
    """Return the law without relaxation whose force is nearest along a motion."""
    if not law.remembers:
        return Nearest(law)
    fitted = nearest_to_force(motion.force_by(law), motion)
    which = (
        f"the law without relaxation nearest along this motion of {format_hertz(motion.frequency)}"
    )
    return Nearest.of(fitted, law, motion, which)


def one_power(law: ForceLaw, motion: ProbeMotion) -> Nearest:
    """Return the K xⁿ + B v nearest to the quadratic law K₁ x + K₂ x² + B v."""
    nearest = _best_exponent(motion.force_by(law), motion, _DAMPERS[-1])
    return Nearest.of(
        nearest,
        law,
        motion,
        "the law with one power of depth nearest along this motion",
    )
