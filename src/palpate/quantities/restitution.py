"""The restitution of what was identified, with its error bar."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from palpate.diagnosis.finding import Quantity, WorkingDepth
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, HuntCrossley
from palpate.quantities.approximations import APPROXIMATIONS
from palpate.quantities.impact import restitution, restitution_slope
from palpate.validation import Floats, Plain

UNKNOWN = Quantity(math.nan, math.nan, math.nan)
UNTRUSTED = "the diagnosis does not trust the damping"


@dataclass(frozen=True, slots=True)
class Restitution(Plain):
    """How a free body would rebound from the contact that was identified, at one speed.

    Attributes
    ----------
    speed : float
        v₀ at first touch, m/s.
    fastest_approach : float
        Into the material in the recording, m/s: 99.9 % of its samples were slower.
    coefficient : Quantity
        e by the law's exact relation, :func:`palpate.restitution`; NaN where it is not defined.
    dissipation : Quantity
        b = B/K, s/m, by :func:`dissipation_of`.
    approximations : mapping of str to float
        e by relations that people quote, at the same b v₀; NaN where one says nothing.
    remarks : tuple of str
        What a reader should know of it.
    """

    speed: float
    fastest_approach: float
    coefficient: Quantity
    dissipation: Quantity
    approximations: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    remarks: tuple[str, ...] = ()


def restitution_of(
    law: ForceLaw,
    b: Quantity,
    fastest_approach: float,
    speed: float | None = None,
    *,
    trusted: bool = True,
) -> Restitution:
    """Return the restitution of a law whose dissipation is known with its errors.

    They go to e by de/dd of the exact relation, the repeatable and the systematic part apart.

    Parameters
    ----------
    law : ForceLaw
        What was identified.
    b : Quantity
        Its dissipation, by :func:`dissipation_of`.
    fastest_approach : float
        That was recorded in contact, m/s.
    speed : float, optional
        v₀, m/s; the fastest approach unless given.
    trusted : bool
        Whether the diagnosis trusts the damping, with care or without.
    """
    v0 = fastest_approach if speed is None else speed
    if not isinstance(law, HuntCrossley):
        words = f"not the same for every body: by {_in_words(law)} it depends on the body's mass"
        return Restitution(v0, fastest_approach, UNKNOWN, b, remarks=(words,))
    if not (math.isfinite(b.value) and v0 > 0.0):
        force = (
            "the law's stiffness is not positive" if v0 > 0.0 else "nothing approached in contact"
        )
        return Restitution(v0, fastest_approach, UNKNOWN, b, remarks=(f"not known: {force}",))
    d = b.value * v0
    e, slope = restitution(b.value, v0), abs(restitution_slope(d)) * v0 if d > -1.0 else math.nan
    return Restitution(
        v0,
        fastest_approach,
        Quantity(e, slope * b.standard_error, slope * b.systematic),
        b,
        MappingProxyType({each.name: each.restitution(b.value, v0) for each in APPROXIMATIONS}),
        (*_remarks(b, v0, fastest_approach), *([] if trusted else [UNTRUSTED])),
    )


def dissipation_of(law: ForceLaw, covariance: Floats, there: WorkingDepth) -> Quantity:
    """Return b = B/K of a Hunt–Crossley law, s/m; unknown of another, or without stiffness.

    Var b = b² (Var B/B² + Var K/K² − 2 Cov/(B K)): K and B go together with the exponent and with
    the surface, of which b knows nothing. Systematic: that of the damping at working depth over the
    force there, C/F = b.

    Parameters
    ----------
    law : ForceLaw
        What was identified.
    covariance : numpy.ndarray, shape (3, 3)
        Of K, B and n, SI.
    there : WorkingDepth
        Its numbers.
    """
    if not (isinstance(law, HuntCrossley) and law.stiffness > 0.0):
        return UNKNOWN
    slope = np.array([-law.dissipation, 1.0]) / law.stiffness
    variance = float(slope @ covariance[:2, :2] @ slope)
    force = there.force.value
    systematic = there.damping.systematic / force if force > 0.0 else math.nan
    return Quantity(law.dissipation, math.sqrt(max(variance, 0.0)), systematic)


def _in_words(law: ForceLaw) -> str:
    if law.remembers:
        return "a law with memory"
    words = "a law whose damping does not grow with depth as its force"
    return words if isinstance(law, GeneralisedHuntCrossley) else f"the {law.kind} law"


def _remarks(b: Quantity, speed: float, fastest: float) -> list[str]:
    remarks = []
    if b.value * speed <= -1.0:
        remarks.append("the law draws the body in at this speed: nothing rebounds")
    elif b.value < 0.0:
        remarks.append("the damping is negative: the law makes energy, which no material does")
    # Two standard errors: 95 % of what the error bar leaves possible.
    if b.value >= 0.0 and b.value < 2.0 * math.hypot(b.standard_error, b.systematic):
        remarks.append("the damping is not distinguishable from 0: e may be 1")
    # Of two figures: the fastest approach is itself a percentile.
    if speed > 1.01 * fastest:
        remarks.append(f"an extrapolation: no approach in the recording exceeds {fastest:.2g} m/s")
    return remarks
