"""Contact force laws: what the lab is built from, and what identification gives back.

Equation numbers are those of Haddadi & Hashtrudi-Zaad, *Real-Time Identification of Hunt–Crossley
Dynamic Models of Contact Environments*, IEEE T-RO 28(3), 2012.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import ClassVar, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.validation import number

Floats = NDArray[np.float64]


class _ForceLaw:
    kind: ClassVar[str]
    units: ClassVar[tuple[str, ...]]
    symbols: ClassVar[tuple[str, ...]]

    def __post_init__(self) -> None:
        for name, value in self.as_dict().items():
            object.__setattr__(self, name, number(name, value))

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name, SI."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]  # every subclass is a dataclass

    @property
    def parameters(self) -> Floats:
        """The parameters in their order, SI."""
        return np.array(list(self.as_dict().values()))


@dataclass(frozen=True, slots=True)
class KelvinVoigt(_ForceLaw):
    """A linear spring and a linear damper in parallel.

    F = K x + B v  for x ≥ 0, else 0.   (eq. 1)

    On a fast rebound it can pull, F < 0, as no contact can: the paper's Fig. 10.

    Parameters
    ----------
    stiffness : float
        K, N/m; positive for a real material.
    damping : float
        B, N·s/m; not negative for a real material.
    """

    stiffness: float
    damping: float
    kind: ClassVar[str] = "kelvin-voigt"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N·s/m")
    symbols: ClassVar[tuple[str, ...]] = ("K", "B")

    @overload
    def force(self, penetration: float, velocity: float) -> float: ...
    @overload
    def force(self, penetration: ArrayLike, velocity: ArrayLike) -> Floats: ...
    def force(self, penetration: ArrayLike, velocity: ArrayLike) -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays (eq. 1)."""
        return _evaluate(_core.kelvin_voigt_force, self, penetration, velocity)


@dataclass(frozen=True, slots=True)
class ExtendedKelvinVoigt(_ForceLaw):
    """A stiffening spring and a linear damper in parallel.

    F = K₁ x + K₂ x² + B v  for x ≥ 0, else 0.   (eq. 14)

    Parameters
    ----------
    stiffness : float
        K₁, N/m.
    quadratic_stiffness : float
        K₂, N/m².
    damping : float
        B, N·s/m.
    """

    stiffness: float
    quadratic_stiffness: float
    damping: float
    kind: ClassVar[str] = "extended-kelvin-voigt"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m²", "N·s/m")
    symbols: ClassVar[tuple[str, ...]] = ("K₁", "K₂", "B")

    @overload
    def force(self, penetration: float, velocity: float) -> float: ...
    @overload
    def force(self, penetration: ArrayLike, velocity: ArrayLike) -> Floats: ...
    def force(self, penetration: ArrayLike, velocity: ArrayLike) -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays (eq. 14)."""
        return _evaluate(_core.extended_kelvin_voigt_force, self, penetration, velocity)


@dataclass(frozen=True, slots=True)
class HuntCrossley(_ForceLaw):
    """A spring and a damper in parallel that both stiffen with depth.

    F = K xⁿ + B xⁿ v = K xⁿ (1 + b v)  for x > 0, else 0.   (eq. 2)

    Parameters
    ----------
    stiffness : float
        K, N/mⁿ; positive for a real material.
    damping : float
        B, N·s/mⁿ⁺¹; not negative for a real material.
    exponent : float
        n; 1 to 2 for most materials (1.5 a Hertzian sphere, 2 a cone).
    """

    stiffness: float
    damping: float
    exponent: float
    kind: ClassVar[str] = "hunt-crossley"
    units: ClassVar[tuple[str, ...]] = ("N/mⁿ", "N·s/mⁿ⁺¹", "")
    symbols: ClassVar[tuple[str, ...]] = ("K", "B", "n")

    @property
    def dissipation(self) -> float:
        """Dissipation b = B/K, s/m, as simulators call it."""
        return self.damping / self.stiffness if self.stiffness else float("nan")

    @overload
    def force(self, penetration: float, velocity: float) -> float: ...
    @overload
    def force(self, penetration: ArrayLike, velocity: ArrayLike) -> Floats: ...
    def force(self, penetration: ArrayLike, velocity: ArrayLike) -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays (eq. 2)."""
        return _evaluate(_core.hunt_crossley_force, self, penetration, velocity)


ForceLaw = KelvinVoigt | ExtendedKelvinVoigt | HuntCrossley
LawType = TypeVar("LawType", KelvinVoigt, ExtendedKelvinVoigt, HuntCrossley)


def _evaluate(
    law_over_arrays: Callable[..., None],
    law: ForceLaw,
    penetration: ArrayLike,
    velocity: ArrayLike,
) -> float | Floats:
    try:
        given = np.asarray(penetration), np.asarray(velocity)
        if any(array.dtype.kind not in "fiub" for array in given):
            raise TypeError
        x, v = np.broadcast_arrays(*(array.astype(np.float64, copy=False) for array in given))
    except (TypeError, ValueError):
        raise InvalidParameterError(
            "penetration and velocity must be numbers, or arrays of shapes that go together, not "
            f"{penetration!r:.60} and {velocity!r:.60}"
        ) from None
    force = np.empty(x.shape)
    law_over_arrays(
        *law.as_dict().values(),
        np.ascontiguousarray(x).reshape(-1),
        np.ascontiguousarray(v).reshape(-1),
        force.reshape(-1),
    )
    return float(force) if force.ndim == 0 else force
