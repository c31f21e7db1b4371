"""Young's modulus from the force on a rigid tip of known shape.

F = E* g xᵐ with the reduced modulus E* = E/(1 − ν²): a rigid tip without friction or adhesion,
small strains, a homogeneous, isotropic material much thicker than the contact is wide. Sneddon,
*International J. Engineering Science* 3 (1965) 47–57; for the sphere Hertz, *J. für die reine und
angewandte Mathematik* 92 (1882) 156–171.
"""

import math
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np

from palpate.digits import format_quantity, percent
from palpate.findings import Check, Mark, worst
from palpate.force_laws import ForceLaw
from palpate.identification.diagnosis.bars import STOPPED, TRUSTED
from palpate.identification.diagnosis.outcome import UNKNOWN, Diagnosis, Quantity, WorkingDepth
from palpate.validation import check_field, finite_or_none, frozen

# Depth over radius, and strain: beyond these the assumption of small strains may fail.
SMALL_DEPTH = SMALL_STRAIN = 0.1
# The force on a layer that is bonded to stiff ground, over that on a thick sample, as a polynomial
# of the contact's radius √(R x) over the thickness; incompressible. Equation 12 of Dimitriadis,
# Horkay, Maresca, Kachar and Chadwick, *Biophysical J.* 82 (2002) 2798–2810.
LAYER = np.polynomial.Polynomial([1.0, 1.133, 1.283, 0.769, 0.0975])
LAYER_SLOPE = LAYER.deriv()
# Largest radius of the contact over the thickness for which the polynomial is used.
THINNEST = 1.0


class Tip:
    """A rigid tip: a frozen dataclass whose fields are its sizes, SI.

    Examples
    --------
    >>> import palpate
    >>> tip = palpate.Sphere(radius=5e-3)
    >>> isinstance(tip, palpate.Tip), tip.exponent
    (True, 1.5)
    """

    __slots__ = ()
    kind: ClassVar[str]
    #: m in F = E* g xᵐ.
    exponent: ClassVar[float]
    #: Upper limit of its size.
    _largest: ClassVar[float]

    def __post_init__(self) -> None:
        for size in fields(self):  # type: ignore[arg-type]  # every subclass is a dataclass
            if getattr(self, size.name) is not None:
                check_field(self, size.name, 0.0, self._largest, open_low=True)

    @property
    def factor(self) -> float:
        """The tip's g in F = E* g xᵐ, m^(2−m)."""
        raise NotImplementedError

    def force(self, reduced_modulus: float, depth: float) -> float:
        """Force [N] on a material of reduced modulus E* [Pa] at a depth [m]; 0 out of contact."""
        inside = max(depth, 0.0)
        layer = float(LAYER(self.thinness(inside)))
        return float(reduced_modulus * self.factor * inside**self.exponent * layer)

    def thinness(self, depth: float) -> float:
        """Radius of the contact at a depth [m] over the thickness of the sample; 0 if thick."""
        return 0.0

    def exponent_at(self, depth: float) -> float:
        """Exponent d ln F/d ln x at a depth [m]; that of the tip, but larger on a thin sample."""
        thinness = self.thinness(depth)
        growth = float(LAYER_SLOPE(thinness) / LAYER(thinness))
        return self.exponent + (self.exponent - 1.0) * thinness * growth

    def departure(self, depth: float) -> float:
        """Fraction by which the formula exceeds the force on the true shape at a depth [m]."""
        return 0.0

    def limitations(self, depth: float) -> list[str]:
        """Return warnings about the formula's assumptions at a depth [m]."""
        return []

    def holds(self, depth: float) -> bool:
        """Whether the tip's shape allows this depth [m]."""
        return True

    def as_dict(self) -> dict[str, Any]:
        """Return kind and the sizes that were stated, SI."""
        own = fields(self)  # type: ignore[arg-type]  # every subclass is a dataclass
        sizes = {each.name: getattr(self, each.name) for each in own}
        return {"kind": self.kind, **{name: size for name, size in sizes.items() if size}}


@frozen
class Sphere(Tip):
    """A ball, or a tip with a round end: F = 4/3 E* √R x^(3/2) (Hertz 1882).

    Hertz approximates the ball by a paraboloid. According to Sneddon's solution the force on a ball
    is lower by the fraction x/(10 R), accurate to 0.001 up to x = R.

    Parameters
    ----------
    radius : float
        R, m, in (0, 1].
    thickness : float, optional
        Thickness of an incompressible sample that is bonded to stiff ground, m, in (0, 1]; the
        force is then larger by a polynomial of √(R x) over it (Dimitriadis 2002). Default: thick.

    Examples
    --------
    >>> import palpate
    >>> round(palpate.Sphere(radius=5e-3).force(reduced_modulus=10e3, depth=1e-3), 4)  # N
    0.0298
    """

    radius: float
    thickness: float | None = None
    kind: ClassVar[str] = "sphere"
    exponent: ClassVar[float] = 1.5
    _largest: ClassVar[float] = 1.0

    def __repr__(self) -> str:
        layer = "" if self.thickness is None else f", thickness={self.thickness!r}"
        return f"Sphere(radius={self.radius!r}{layer})"

    @property
    def factor(self) -> float:
        """4/3 √R."""
        return 4.0 / 3.0 * math.sqrt(self.radius)

    def thinness(self, depth: float) -> float:
        """√(R x) over the thickness."""
        return 0.0 if self.thickness is None else math.sqrt(self.radius * depth) / self.thickness

    def departure(self, depth: float) -> float:
        """x/(10 R), for a ball instead of Hertz's paraboloid."""
        return depth / (10.0 * self.radius)

    def limitations(self, depth: float) -> list[str]:
        """Return a warning if the depth is more than a tenth of the radius."""
        part = depth / self.radius
        text = f"Hertz assumes depths far below the radius; the depth reaches {part:.2g} of it"
        return [text] if part > SMALL_DEPTH else []

    def holds(self, depth: float) -> bool:
        """Whether the depth is less than the radius, and the sample is not too thin for it."""
        return depth < self.radius and self.thinness(depth) <= THINNEST


@frozen
class FlatPunch(Tip):
    """The flat end of a round rod: F = 2 E* R x (Sneddon 1965).

    Parameters
    ----------
    radius : float
        R, m, in (0, 1].

    Examples
    --------
    >>> import palpate
    >>> round(palpate.FlatPunch(radius=5e-3).force(reduced_modulus=10e3, depth=1e-3), 4)  # N
    0.1
    """

    radius: float
    kind: ClassVar[str] = "punch"
    exponent: ClassVar[float] = 1.0
    _largest: ClassVar[float] = 1.0

    @property
    def factor(self) -> float:
        """2 R."""
        return 2.0 * self.radius

    def limitations(self, depth: float) -> list[str]:
        """Return a warning if the depth is more than a tenth of the radius."""
        part = depth / self.radius
        text = f"linear elasticity assumes small strains: the depth is {part:.2g} of the radius"
        return [text] if part > SMALL_DEPTH else []


@frozen
class Cone(Tip):
    """A cone: F = (2/π) E* tan α x² (Sneddon 1965).

    Parameters
    ----------
    half_angle : float
        α, rad, between the axis and the side (half the opening angle), in (0, 1.57].

    Examples
    --------
    >>> import palpate
    >>> round(palpate.Cone(half_angle=0.6).force(reduced_modulus=10e3, depth=1e-3), 5)  # N
    0.00436
    """

    half_angle: float
    kind: ClassVar[str] = "cone"
    exponent: ClassVar[float] = 2.0
    _largest: ClassVar[float] = 1.57

    @property
    def factor(self) -> float:
        """(2/π) tan α."""
        return 2.0 / math.pi * math.tan(self.half_angle)

    def limitations(self, depth: float) -> list[str]:
        """Return a warning if the cone is too sharp for small strains; depth does not matter.

        The strain below it is about 0.2 cot α (Johnson, *Contact Mechanics*, 1985, section 6.3).
        """
        strain = 0.2 / math.tan(self.half_angle)
        text = "linear elasticity assumes small strains: below this cone they are about "
        return [f"{text}{strain:.2g} at any depth"] if strain > SMALL_STRAIN else []


@frozen
class Pyramid(Tip):
    """A pyramid on a square: F = 0.7453 E* tan α x².

    Bilodeau, *J. Applied Mechanics* 59 (1992) 519–523.

    Parameters
    ----------
    half_angle : float
        α, rad, between the axis and a face (not an edge), in (0, 1.57].

    Examples
    --------
    >>> import palpate
    >>> round(palpate.Pyramid(half_angle=0.6).force(reduced_modulus=10e3, depth=1e-3), 5)  # N
    0.0051
    """

    half_angle: float
    kind: ClassVar[str] = "pyramid"
    exponent: ClassVar[float] = 2.0
    _largest: ClassVar[float] = 1.57

    @property
    def factor(self) -> float:
        """0.7453 tan α."""
        return 0.7453 * math.tan(self.half_angle)

    def limitations(self, depth: float) -> list[str]:
        """Return a warning as for the cone of the same section at each depth."""
        cone = Cone(math.atan(2.0 / math.sqrt(math.pi) * math.tan(self.half_angle)))
        return [each.replace("cone", self.kind) for each in cone.limitations(depth)]


#: The tips by kind.
TIPS: dict[str, type[Tip]] = {each.kind: each for each in (Sphere, FlatPunch, Cone, Pyramid)}


# Young's modulus of the touched material, for a tip of known shape.

# Largest relative systematic uncertainty from the exponent; above it there is no modulus, as a
# stiffness of that uncertainty is not trusted either. An exponent that differs by a half, as
# between neighbouring shapes, causes this uncertainty over depths in a ratio of 2.7; strokes from
# the surface have a ratio of 9.
WIDEST_SPREAD = STOPPED[0]
# Poisson's ratio of incompressible materials; soft tissue, gels and rubber are nearly
# incompressible.
INCOMPRESSIBLE = 0.5
# Exponents that differ by more belong to another shape, and standard errors for a certain
# difference; neighbouring shapes differ by 0.5.
NEXT_SHAPE = 0.2
CERTAIN = 3.0


@frozen
class ElasticModulus:
    """Young's modulus E, Pa, or why there is none.

    Parameters
    ----------
    value : Quantity
        E = (1 − ν²) F(x)/(g xᵐ) at the working depth x, with the tip's exponent m. Systematic: the
        effect of a difference between m and the law's n over the depths in contact, Hertz's
        paraboloid in place of a ball, and the relative systematic uncertainty of the stiffness.
        NaN if refused.
    tip : Tip
        The tip of the probe.
    poisson_ratio : float
        ν, specified or assumed; an indentation does not identify it.
    exponent : Quantity
        n = x (∂F/∂x)/F of the law at the working depth; it should equal the tip's.
    assumed : bool
        Whether Poisson's ratio was assumed.
    refused : str or None
        Why there is no modulus.
    remarks : tuple of str
        Remarks for the reader.
    mark : str
        ``"trust"``, ``"with-care"`` or ``"do-not-trust"``.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/microscale.csv")
    >>> modulus = result.elastic_modulus(palpate.Sphere(radius=10e-6))
    >>> print(modulus.value.combined.format("Pa"), modulus.mark)
    7110 ± 70 Pa trust
    """

    value: Quantity
    tip: Tip
    poisson_ratio: float
    exponent: Quantity
    assumed: bool
    refused: str | None = None
    remarks: tuple[str, ...] = ()
    mark: Mark = "do-not-trust"

    def __repr__(self) -> str:
        number = self.refused or self.value.combined.format("Pa")
        return f"ElasticModulus({number}; {self.tip}, ν = {self.poisson_ratio:g})"

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text, with None for undefined numbers."""
        return {
            **self.value.as_dict(),
            "reduced": finite_or_none(self.value.value / (1.0 - self.poisson_ratio**2)),
            "poisson_ratio": self.poisson_ratio,
            "poisson_ratio_assumed": self.assumed,
            "tip": self.tip.as_dict(),
            "exponent": {**self.exponent.as_dict(), "of_tip": self.tip.exponent},
            "refused": self.refused,
            "remarks": list(self.remarks),
            "mark": self.mark,
        }


def compute_elastic_modulus(
    law: ForceLaw,
    found: Diagnosis,
    depths: tuple[float, float],
    tip: Tip,
    poisson_ratio: float | None,
) -> ElasticModulus:
    """Return Young's modulus from the force at working depth and the shape of the tip.

    It uses the force where it was measured, not K, which is an extrapolation to one metre and
    depends on the exponent. For a relaxing law it uses the force that belongs to K′, so that the
    modulus is valid at the motion's frequency. palpate refuses a modulus if the moduli at both
    depths differ by more than ± 25 % of it, or if the exponent is certainly different: then the
    tip has another shape.

    Parameters
    ----------
    law : ForceLaw
        The identified law.
    found : Diagnosis
        Its diagnosis.
    depths : tuple of float
        10th and 90th percentile of the penetration in contact, m, > 0.
    tip : Tip
        The tip of the probe.
    poisson_ratio : float or None
        ν of the material. Default: 0.5, assumed.
    """
    ratio = INCOMPRESSIBLE if poisson_ratio is None else poisson_ratio
    there = found.working_depth
    exponent = _exponent(there)
    known = (tip, ratio, exponent, poisson_ratio is None)
    refused: str | None = None
    if not math.isfinite(exponent.value):
        refused = "the law has no force at the working depth"
    elif not tip.holds(there.depth):
        depth = format_quantity(there.depth, "m")
        refused = f"the working depth, {depth}, is larger than the {tip.kind} allows"
    if refused:
        return ElasticModulus(UNKNOWN, *known, refused)
    low, modulus, high = (
        (1.0 - ratio**2) * _elastic_force(law, there, depth) / tip.force(1.0, depth)
        for depth in (depths[0], there.depth, depths[1])
    )
    spread = 0.5 * abs(high - low) / modulus
    refused = _shape_mismatch(exponent, spread, tip, there.depth)
    if refused:
        return ElasticModulus(UNKNOWN, *known, refused)
    moved = there.stiffness.systematic / abs(there.stiffness.value)
    by_force = there.force.systematic / there.force.value
    value = Quantity(
        modulus,
        modulus * there.force.standard_error / there.force.value,
        modulus * math.hypot(spread, moved, by_force, tip.departure(there.depth)),
    )
    remarks = (*_remarks(found, exponent, tip), *tip.limitations(depths[1]))
    mark = worst(found.verdict.stiffness, error_mark(value.whole_error / modulus))
    return ElasticModulus(value, *known, remarks=remarks, mark=mark)


def error_mark(relative: float) -> Mark:
    """Return the mark that a relative standard error of the modulus allows."""
    if relative <= TRUSTED[0]:
        return "trust"
    return "with-care" if relative <= STOPPED[0] else "do-not-trust"


def _elastic_force(law: ForceLaw, there: WorkingDepth, depth: float) -> float:
    """Return the force at a depth, N; for a relaxing law the force F = K′ x/n of its K′."""
    if not law.remembers:
        return float(law.force(depth, 0.0))
    exponent = there.depth * there.stiffness.value / there.force.value
    return float(there.force.value * (depth / there.depth) ** exponent)


def _exponent(there: WorkingDepth) -> Quantity:
    """Return the exponent d ln F/d ln x; with the stiffness's relative errors, the larger ones."""
    if not there.force.value > 0.0:
        return UNKNOWN
    return there.stiffness.scaled(there.depth / there.force.value)


def _shape_mismatch(exponent: Quantity, spread: float, tip: Tip, depth: float) -> str | None:
    """Return why the force does not grow with depth as for this tip; None if it does."""
    expected = tip.exponent_at(depth)
    text = (
        f"the force grows with depth to the power {exponent.combined.format()}, but under a "
        f"{tip.kind} it has the power {expected:.3g}"
    )
    if spread > WIDEST_SPREAD:
        return f"{text}: moduli from light and deep touch differ by {percent(2.0 * spread)}"
    if abs(exponent.value - expected) > max(NEXT_SHAPE, CERTAIN * exponent.whole_error):
        return f"{text}: the tip has another shape"
    return None


def _remarks(found: Diagnosis, exponent: Quantity, tip: Tip) -> list[str]:
    remarks = []
    if found.verdict.stiffness == "do-not-trust":
        remarks.append("the diagnosis does not trust the stiffness")
    if not CERTAIN * exponent.whole_error < NEXT_SHAPE:
        remarks.append(
            f"the exponent, {exponent.combined.format()}, is too uncertain to confirm a {tip.kind}"
        )
    if any(finding.check == Check.SURFACE for finding in found.findings):
        remarks.append(
            "the surface position is uncertain (see palpate diagnose): an error of 1 % in depth "
            f"changes the modulus by {tip.exponent:g} %"
        )
    return remarks
