"""Coefficient of restitution of a Hunt–Crossley contact: the exact relation, and its inverse.

A rigid body of mass m hits the surface at v₀, without adhesion or other forces. Its equation of
motion is m ẍ = −K xⁿ (1 + b ẋ), b = B/K. With depth in place of time, divided by 1 + b v,

    m v dv/(1 + b v) = −K xⁿ dx.

The right side integrates to opposite values on the way in and on the way out. So must the left,
from v₀ to rest and from rest to −e v₀. With ∫₀ᵛ u du/(1 + b u) = [b v − ln(1 + b v)]/b² and
d = b v₀ this gives

    d − ln(1 + d) = −d e − ln(1 − d e),  or  d (1 + e) = ln[(1 + d)/(1 − d e)].

Mass, stiffness and exponent cancel: e depends on d alone, and falls from 1 towards 0 as d grows.
As 1 − d e stays positive, a free body never rebounds faster than 1/b, and the contact force never
becomes negative. The relation is implicit in Hunt & Crossley, *J. Applied Mechanics* 42 (1975)
440–445, and explicit in Gonthier et al., *Multibody System Dynamics* 11 (2004) 209–233.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from types import MappingProxyType
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from palpate.digits import rounded
from palpate.force_laws import ForceLaw
from palpate.identification.diagnosis.outcome import UNKNOWN, Quantity, WorkingDepth
from palpate.validation import Floats, Plain, all_good, frozen, together

# Below it e = 1 − 2d/3 + 4d²/9 is exact: the next term, 44 d³/135, is under 10⁻¹⁵. It follows from
# φ(d) = e² φ(−d e), where φ(z) = 2 [z − ln(1 + z)]/z² = 1 − 2z/3 + z²/2 − …: in e = 1 + p d + q d²
# the terms in d give 2p + 2/3 = −2/3, those in d² give 2q + p² + 2p + 1/2 = 1/2.
SMALL = 1e-5
# Newton's method on a convex function from above decreases at every step and converges
# quadratically. Observed: 5 steps for d > 0, 11 for d just above −1, 5 for the inverse.
MOST_STEPS = 20
# ln(1 + z) = 2 artanh r, r = z/(2 + z): for |r| ≤ 1/4 the terms after r³³ are below 10⁻²⁰.
_ODD = 1.0 / np.arange(3.0, 34.0, 2.0)


@overload
def restitution(dissipation: float, speed: float) -> float: ...
@overload
def restitution(dissipation: "ArrayLike", speed: "ArrayLike") -> Floats: ...
def restitution(dissipation: "ArrayLike", speed: "ArrayLike") -> float | Floats:
    """Return the coefficient of restitution e of a free impact on a Hunt–Crossley contact.

    e = −v₁/v₀, velocity after over velocity before, from d (1 + e) = ln[(1 + d)/(1 − d e)],
    d = b v₀, solved to rounding error for any d; the module's docstring derives it. There is no
    adhesion and no other force, such as the body's weight.

    Parameters
    ----------
    dissipation : float or array_like
        b = B/K, s/m. A negative one generates energy: e > 1 for d > −1. NaN for d ≤ −1, where the
        force pulls the body in and it does not rebound.
    speed : float or array_like
        v₀ at first touch, m/s, ≥ 0; it broadcasts with ``dissipation``.

    Returns
    -------
    float or numpy.ndarray
        Coefficient e; an array if an argument is one.

    Raises
    ------
    InvalidParameterError
        A value is not finite, or a speed is negative; the message names the first.

    Examples
    --------
    >>> import palpate
    >>> round(palpate.restitution(dissipation=1.0, speed=0.5), 4)
    0.7484
    """
    b, speeds = together(dissipation=dissipation, speed=speed)
    all_good("dissipation", b, np.isfinite(b), "finite")
    all_good("speed", speeds, (speeds >= 0.0) & np.isfinite(speeds), "at least 0 and finite")
    with np.errstate(over="ignore"):  # above 10³⁰⁰ e is 0
        d = np.clip(b * speeds, -1e300, 1e300)
    e = _solve_restitution(d.reshape(-1))[0].reshape(d.shape)
    return e if e.ndim else float(e)


def restitution_slope(d: Floats) -> Floats:
    """Return de/dd of the exact relation at d > −1, which propagates an error of b to e.

    With y = d e, d − ln(1 + d) = −y − ln(1 − y) gives d/(1 + d) dd = y/(1 − y) dy, so that
    de/dd = [(1 − y)/(e (1 + d)) − e]/d; near 0, where that cancels, −2/3 + 8d/9 − 44d²/45.
    """
    e, left = _solve_restitution(d)
    few = np.clip(d, -1e-4, 1e-4)
    slopes = -2.0 / 3.0 + 8.0 * few / 9.0 - 44.0 * few**2 / 45.0
    far = np.abs(d) > 1e-4  # there truncation and cancellation errors are both about 10⁻¹²
    slopes[far] = (left[far] / (e[far] * (1.0 + d[far])) - e[far]) / d[far]
    return slopes


@overload
def dissipation_for(restitution: float, speed: float) -> float: ...
@overload
def dissipation_for(restitution: "ArrayLike", speed: "ArrayLike") -> Floats: ...
def dissipation_for(restitution: "ArrayLike", speed: "ArrayLike") -> float | Floats:
    """Return the dissipation b = B/K [s/m] for which an impact at v₀ has the restitution e.

    The inverse of :func:`restitution`.

    Parameters
    ----------
    restitution : float or array_like
        e, in [10⁻¹², 1].
    speed : float or array_like
        v₀, m/s, > 0; it broadcasts with ``restitution``.

    Returns
    -------
    float or numpy.ndarray
        Dissipation b, s/m; an array if an argument is one.

    Raises
    ------
    InvalidParameterError
        A value is out of its range; the message names the first.

    Examples
    --------
    >>> import palpate
    >>> b = palpate.dissipation_for(restitution=0.7, speed=0.5)  # s/m
    >>> round(b, 4), round(palpate.restitution(b, 0.5), 4)
    (1.2697, 0.7)
    """
    e, speeds = together(restitution=restitution, speed=speed)
    all_good("restitution", e, (e >= 1e-12) & (e <= 1.0), "in [1e-12, 1]")
    all_good("speed", speeds, (speeds > 0.0) & np.isfinite(speeds), "above 0 and finite")
    found = _inverse(e.reshape(-1)).reshape(e.shape) / speeds
    return found if found.ndim else float(found)


def _solve_restitution(d: Floats) -> tuple[Floats, Floats]:
    """Restitution e, and 1 − d e without cancellation."""
    few = np.clip(d, -SMALL, SMALL)
    e = 1.0 - 2.0 * few / 3.0 + 4.0 * few**2 / 9.0
    left = 1.0 - few * e
    e[d <= -1.0] = left[d <= -1.0] = np.nan
    many = (d > -1.0) & (np.abs(d) >= SMALL)
    # By t = −ln(1 − d e), of the sign of d: t − 1 + exp(−t) = d − ln(1 + d).
    wanted = _subtract_logarithm(d[many])
    # d e < 1 and (d e)²/2 < d − ln(1 + d) bound t from above; for d < 0 its size, as t²/2 does.
    root = np.sqrt(2.0 * wanted)
    t = np.where(d[many] > 0.0, wanted + np.minimum(root, 1.0), -root)
    for _ in range(MOST_STEPS):
        change = (_subtract_exponential(t) - wanted) / -np.expm1(-t)
        t -= change
        if (np.abs(change) <= 1e-15 * np.abs(t)).all():
            break
    e[many] = -np.expm1(-t) / d[many]
    left[many] = np.exp(-t)
    return e, left


def _subtract_logarithm(z: Floats) -> Floats:
    """Return z − ln(1 + z); where that cancels r z − 2 (r³/3 + r⁵/5 + …), r = z/(2 + z)."""
    near = (z > -0.4) & (z < 0.66)
    value = z - np.log1p(np.where(near, 0.0, z))
    r = z[near] / (2.0 + z[near])
    value[near] = r * z[near] - 2.0 * r**3 * np.polynomial.polynomial.polyval(r**2, _ODD)
    return value


def _subtract_exponential(t: Floats) -> Floats:
    """Return t − 1 + exp(−t); near 0 as z − ln(1 + z) of z = exp(−t) − 1."""
    value = t + np.expm1(-t)
    near = np.abs(t) < 0.5
    value[near] = _subtract_logarithm(np.expm1(-t[near]))
    return value


def _inverse(e: Floats) -> Floats:
    """Newton's method on ln e over ln d, which is concave: it converges from above.

    It starts at min(3 (1 − e)/2e, 1/e) ≥ d: exact to the second order at e = 1, and at e = 0.
    """
    d = np.minimum(1.5 * (1.0 - e), 1.0) / e
    moving = d > 0.0
    for _ in range(MOST_STEPS):
        now = _solve_restitution(d[moving])[0]
        change = np.log(now / e[moving]) * now / (restitution_slope(d[moving]) * d[moving])
        d[moving] *= np.exp(-change)
        # ln e is accurate to 10⁻¹⁶; near d = 0 the relative accuracy of d is lower.
        if (np.abs(change) * np.minimum(d[moving], 1.0) <= 1e-15).all():
            break
    return d


# Published approximations of the exact relation.


def _carvalho_martins(d: float) -> float:
    # The smaller root of e² − 2 p e + q = 0, as q over the larger one.
    p = 6.0 + 3.0 * d
    q = 11.0 - 2.0 * d / 3.0
    return q / (p + math.sqrt(p * p - q))


#: Approximations of e for d = b v₀ ≥ 0, by year. Each is published as the d for a required e (up to
#: the factor K/v₀) and solved for e here. Their errors below are for d from 10⁻³ to 10².
APPROXIMATIONS: dict[str, Callable[[float], float]] = {
    # d = 3 (1 − e)/2: Hunt & Crossley, J. Applied Mechanics 42 (1975) 440–445; within 0.01 for
    # e > 0.905; none for d > 3/2.
    "Hunt–Crossley": lambda d: 1.0 - 2.0 * d / 3.0,
    # d = 3 (1 − e²)/4: Lankarani & Nikravesh, J. Mechanical Design 112 (1990) 369–376; within 0.01
    # for e > 0.924; none for d > 3/4.
    "Lankarani–Nikravesh": lambda d: math.sqrt(1.0 - 4.0 * d / 3.0) if d <= 0.75 else math.nan,
    # d = (1 − e²)/e: Gonthier, McPhee, Lange & Piedbœuf, Multibody System Dynamics 11 (2004)
    # 209–233, next to the exact relation; within 0.033 for every e, and exact towards e = 0. It is
    # (√(d² + 4) − d)/2, without cancellation.
    "Gonthier": lambda d: 2.0 / (d + math.hypot(d, 2.0)),
    # d = 8 (1 − e)/(5 e): Flores, Machado, Silva & Martins, Multibody System Dynamics 25 (2011)
    # 357–375; within 0.046 for every e, 0.01 for e > 0.818.
    "Flores": lambda d: 8.0 / (8.0 + 5.0 * d),
    # d = 3 (1 − e)(11 − e)/(2 + 18 e): Carvalho & Martins, Mechanism and Machine Theory 139 (2019)
    # 174–194; within 0.01 for e > 0.225; none for d > 33/2.
    "Carvalho–Martins": _carvalho_martins,
}


def compute_approximations(dissipation: float, speed: float) -> dict[str, float]:
    """Return e by each of :data:`APPROXIMATIONS` at a dissipation b [s/m] and a speed v₀ [m/s].

    NaN where an approximation is undefined: for b < 0, and where its e would be below 0.
    """
    d = dissipation * speed
    found = {
        name: solved(min(d, 1e150)) if d >= 0.0 else math.nan
        for name, solved in APPROXIMATIONS.items()
    }
    return {name: e if e >= 0.0 else math.nan for name, e in found.items()}


# The restitution of an identified law, with its uncertainty.

UNTRUSTED = "the diagnosis does not trust the damping"
EQUIVALENT = (
    "by the Hunt–Crossley law with the same K′ and B′ at working depth and the motion's frequency"
)


@frozen
class Restitution(Plain):
    """Restitution of a free body that hits the identified contact at one speed.

    Parameters
    ----------
    speed : float
        v₀ at first touch, m/s.
    fastest_approach : float
        Fastest approach in contact in the recording, m/s: the 99.9th percentile.
    coefficient : Quantity
        e from the exact relation, :func:`palpate.restitution`; NaN if undefined.
    dissipation : Quantity
        b = B/K, s/m, from :func:`compute_dissipation`.
    approximations : mapping of str to float
        e from published approximations at the same b v₀; NaN where one is undefined.
    remarks : tuple of str
        Remarks for the reader.

    Examples
    --------
    >>> import palpate
    >>> restitution = palpate.identify("examples/recordings/ball.csv").restitution(speed=0.5)
    >>> round(restitution.coefficient.value, 2)
    0.75
    """

    speed: float
    fastest_approach: float
    coefficient: Quantity
    dissipation: Quantity
    approximations: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        e = self.coefficient.combined.format()
        b = self.dissipation.combined.format("s/m")
        return f"Restitution({e} at {rounded(self.speed, 3)} m/s, dissipation {b})"


def compute_restitution(
    law: ForceLaw,
    b: Quantity,
    fastest_approach: float,
    speed: float | None = None,
    *,
    trusted: bool = True,
) -> Restitution:
    """Return the restitution of a law from its dissipation.

    Statistical and systematic uncertainty of b propagate to e by de/dd of the exact relation.

    Parameters
    ----------
    law : ForceLaw
        The identified law.
    b : Quantity
        Its dissipation, from :func:`compute_dissipation`.
    fastest_approach : float
        Fastest approach recorded in contact, m/s.
    speed : float, optional
        v₀, m/s. Default: the fastest approach.
    trusted : bool
        Whether the diagnosis trusts the damping, possibly with care. Default: True.
    """
    v0 = fastest_approach if speed is None else speed
    if not (law.power_law or law.relaxes):
        text = f"no single value: for the {law.kind} law it depends on the body's mass"
        return Restitution(v0, fastest_approach, UNKNOWN, b, remarks=(text,))
    if not (math.isfinite(b.value) and v0 > 0.0):
        why = "no approach in contact"
        if v0 > 0.0:
            why = "the stiffness is not positive, or the recording does not give the damping"
        return Restitution(v0, fastest_approach, UNKNOWN, b, remarks=(f"unknown: {why}",))
    d = b.value * v0
    e = restitution(b.value, v0)
    slope = math.nan
    if d > -1.0:
        slope = abs(float(restitution_slope(np.array([d]))[0])) * v0
    return Restitution(
        v0,
        fastest_approach,
        Quantity(e, slope * b.standard_error, slope * b.systematic),
        b,
        MappingProxyType(compute_approximations(b.value, v0)),
        (
            *([EQUIVALENT] if law.relaxes else []),
            *_remarks(b, v0, fastest_approach),
            *([] if trusted else [UNTRUSTED]),
        ),
    )


def compute_dissipation(law: ForceLaw, covariance: Floats, there: WorkingDepth) -> Quantity:
    """Return b = B/K of a Hunt–Crossley law, s/m; unknown for other laws or without stiffness.

    For a generalised law, b = B′/F′ of the Hunt–Crossley law with the same K′ and B′ at working
    depth and the motion's frequency; the errors of K′ and B′ are treated as independent.

    Var b = b² (Var B/B² + Var K/K² − 2 Cov/(B K)): errors of the exponent and the surface change K
    and B by the same factor and cancel in b. Its systematic uncertainty is the uncertainty of the
    damping C at working depth over the force F there, as C/F = b.

    Parameters
    ----------
    law : ForceLaw
        The identified law.
    covariance : numpy.ndarray, shape (3, 3)
        Covariance of K, B and n, SI.
    there : WorkingDepth
        Its numbers at working depth.
    """
    if math.isnan(there.damping.value):  # the recording does not determine it
        return UNKNOWN
    if law.relaxes and there.force.value > 0.0 and there.stiffness.value > 0.0:
        b = there.damping.value / there.force.value
        error, moved = (
            math.hypot(damping / there.force.value, b * stiffness / there.stiffness.value)
            for damping, stiffness in (
                (there.damping.standard_error, there.stiffness.standard_error),
                (there.damping.systematic, there.stiffness.systematic),
            )
        )
        return Quantity(b, error, moved)
    if not (law.power_law and law.parameters[0] > 0.0):
        return UNKNOWN
    stiffness, damping, _ = law.parameters.tolist()
    slope = np.array([-damping / stiffness, 1.0]) / stiffness
    variance = float(slope @ covariance[:2, :2] @ slope)
    force = there.force.value
    systematic = there.damping.systematic / force if force > 0.0 else math.nan
    return Quantity(damping / stiffness, math.sqrt(max(variance, 0.0)), systematic)


def _remarks(b: Quantity, speed: float, fastest: float) -> list[str]:
    remarks = []
    if b.value * speed <= -1.0:
        remarks.append("at this speed the law pulls the body in, and it does not rebound")
    elif b.value < 0.0:
        remarks.append("the damping is negative: the law generates energy, which no material does")
    # Two standard errors: the 95 % interval includes 0.
    if 0.0 <= b.value < 2.0 * b.whole_error:
        remarks.append("the damping is not distinguishable from 0: e may be 1")
    # With a margin of 1 %: the fastest approach is itself a percentile.
    if speed > 1.01 * fastest:
        remarks.append(f"extrapolated: no approach in the recording exceeds {fastest:.2g} m/s")
    return remarks
