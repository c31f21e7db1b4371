"""Shapes of a rigid tip, by which the force of an elastic half-space grows with depth.

F = E* g xᵐ with the reduced modulus E* = E/(1 − ν²): a rigid tip without friction or adhesion,
small strains, a homogeneous, isotropic material much thicker than the contact is wide. Sneddon,
*International J. Engineering Science* 3 (1965) 47–57; for the sphere Hertz, *J. für die reine und
angewandte Mathematik* 92 (1882) 156–171.
"""

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from palpate.validation import number_in

# Of the radius, and strain: beyond it small strains, which all of this is for, may not hold.
SMALL_DEPTH = SMALL_STRAIN = 0.1


class Tip:
    """A rigid tip: a frozen dataclass whose fields are its sizes, SI."""

    __slots__ = ()
    kind: ClassVar[str]
    #: m, with which the force grows with depth.
    exponent: ClassVar[float]

    @property
    def factor(self) -> float:
        """The tip's g in F = E* g xᵐ, m^(2−m)."""
        raise NotImplementedError

    def force(self, reduced_modulus: float, depth: float) -> float:
        """Force [N] on a material of reduced modulus E* [Pa] at a depth [m]; 0 out of contact."""
        return float(reduced_modulus * self.factor * max(depth, 0.0) ** self.exponent)

    def departure(self, depth: float) -> float:
        """Fraction by which the formula exceeds the force on the true shape at a depth [m]."""
        return 0.0

    def limitations(self, depth: float) -> list[str]:
        """Say, of a depth [m], what the formula leaves out there."""
        return []

    def holds(self, depth: float) -> bool:
        """Whether a tip of this shape can be so deep at all, m."""
        return True

    def as_dict(self) -> dict[str, Any]:
        """Return kind and sizes, SI."""
        own = fields(self)  # type: ignore[arg-type]  # every subclass is a dataclass
        return {"kind": self.kind, **{each.name: getattr(self, each.name) for each in own}}


def _checked(tip: Tip, name: str, highest: float) -> None:
    value = number_in(name, getattr(tip, name), 0.0, highest, open_low=True)
    object.__setattr__(tip, name, value)


@dataclass(frozen=True, slots=True)
class Sphere(Tip):
    """A ball, or a tip with a round end: F = 4/3 E* √R x^(3/2) (Hertz 1882).

    Hertz takes the ball for a paraboloid. On a ball the force is less by a fraction x/(10 R), to
    0.001 up to x = R, as Sneddon's solution for the sphere says.

    Parameters
    ----------
    radius : float
        R, m, in (0, 1].
    """

    radius: float
    kind: ClassVar[str] = "sphere"
    exponent: ClassVar[float] = 1.5

    def __post_init__(self) -> None:
        _checked(self, "radius", 1.0)

    @property
    def factor(self) -> float:
        """4/3 √R."""
        return 4.0 / 3.0 * math.sqrt(self.radius)

    def departure(self, depth: float) -> float:
        """x/(10 R): a ball against Hertz's paraboloid."""
        return depth / (10.0 * self.radius)

    def limitations(self, depth: float) -> list[str]:
        """Say where the depth is more than a tenth of the radius."""
        part = depth / self.radius
        if part <= SMALL_DEPTH:
            return []
        return [f"Hertz is for depths far below the radius, and the probe goes to {part:.2g} of it"]

    def holds(self, depth: float) -> bool:
        """Whether the depth is less than the radius, beyond which there is no ball."""
        return depth < self.radius


@dataclass(frozen=True, slots=True)
class FlatPunch(Tip):
    """The flat end of a round rod: F = 2 E* R x (Sneddon 1965).

    Parameters
    ----------
    radius : float
        R, m, in (0, 1].
    """

    radius: float
    kind: ClassVar[str] = "punch"
    exponent: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        _checked(self, "radius", 1.0)

    @property
    def factor(self) -> float:
        """2 R."""
        return 2.0 * self.radius

    def limitations(self, depth: float) -> list[str]:
        """Say where the depth is more than a tenth of the radius."""
        part = depth / self.radius
        if part <= SMALL_DEPTH:
            return []
        return [f"linear elasticity is for small strains: the depth is {part:.2g} of the radius"]


@dataclass(frozen=True, slots=True)
class Cone(Tip):
    """A cone: F = (2/π) E* tan α x² (Sneddon 1965).

    Parameters
    ----------
    half_angle : float
        α, rad, between the axis and the side: half of the whole opening; in (0, 1.57].
    """

    half_angle: float
    kind: ClassVar[str] = "cone"
    exponent: ClassVar[float] = 2.0

    def __post_init__(self) -> None:
        _checked(self, "half_angle", 1.57)

    @property
    def factor(self) -> float:
        """(2/π) tan α."""
        return 2.0 / math.pi * math.tan(self.half_angle)

    def limitations(self, depth: float) -> list[str]:
        """Say where the cone is so sharp that no strain is small, at any depth.

        The strain below it is about 0.2 cot α (Johnson, *Contact Mechanics*, 1985, section 6.3).
        """
        strain = 0.2 / math.tan(self.half_angle)
        if strain <= SMALL_STRAIN:
            return []
        return [
            f"linear elasticity is for small strains: below this cone they are {strain:.2g} at any "
            "depth"
        ]


#: Every tip by its kind.
TIPS: dict[str, type[Tip]] = {each.kind: each for each in (Sphere, FlatPunch, Cone)}
