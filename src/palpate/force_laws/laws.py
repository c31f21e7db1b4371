"""Force laws: what each has, those of Kelvin–Voigt and Hunt–Crossley, and the table of all.

Equation numbers are those of Haddadi & Hashtrudi-Zaad, *Real-Time Identification of Hunt–Crossley
Dynamic Models of Contact Environments*, IEEE T-RO 28(3), 2012.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, Self, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.validation import in_contact, number, one_of, shown, together

Floats = NDArray[np.float64]


class ForceLaw:
    """Force by penetration and velocity: a frozen dataclass whose fields are its parameters, SI.

    A law of one's own derives from this one, gives ``kind``, ``units``, ``symbols``, ``force`` and
    the two gradients, and is made known by :func:`register`; see ``CONTRIBUTING.md``.
    """

    __slots__ = ()
    #: What the command line and files call it.
    kind: ClassVar[str]
    #: Of the parameters, in their order.
    units: ClassVar[tuple[str, ...]]
    symbols: ClassVar[tuple[str, ...]]
    #: Parameters that are 0 where a description leaves them out.
    optional: ClassVar[tuple[str, ...]] = ()
    #: Whether condition 10 of the paper, |v| < 0.1 K/B, concerns it.
    has_condition_10: ClassVar[bool] = False
    #: How many parameters, the first ones, the force is a linear sum of: F = Σ θᵢ ∂F/∂θᵢ.
    linear: ClassVar[int] = 0
    #: Whether the law is (K + B v) xⁿ, of the parameters K, B and n in this order.
    power_law: ClassVar[bool] = False
    #: Whether laws of this class may relax; :attr:`remembers` says whether this one does.
    relaxes: ClassVar[bool] = False
    #: Damping, memory and whether n = 1 of the candidate of the model selection that it is.
    candidate: ClassVar[tuple[str, str, bool] | None] = None

    def __post_init__(self) -> None:
        for name, value in self.as_dict().items():
            object.__setattr__(self, name, number(name, value))

    @classmethod
    def from_parameters(cls, parameters: "ArrayLike") -> Self:
        """Return the law of these numbers, as :attr:`parameters` has them."""
        return cls(*np.asarray(parameters, dtype=np.float64).tolist())

    @classmethod
    def from_dict(cls, numbers: dict[str, Any]) -> Self:
        """Return the law of its numbers by name, as :meth:`as_dict` has them."""
        return cls(**numbers)

    @classmethod
    def names(cls) -> list[str]:
        """Return the names of the parameters, in their order."""
        return list(cls.__match_args__)  # type: ignore[attr-defined]  # every subclass is a dataclass

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name, SI."""
        return {name: getattr(self, name) for name in self.names()}

    @classmethod
    def sizes(cls, depth: float, speed: float, force: float) -> Floats:
        """Return how large its parameters may be, by a depth [m], a speed [m/s] and a force [N].

        By their units. Where a fit begins the others are a hundredth to a hundred times this, and
        those without unit a tenth to ten; a law whose parameters are otherwise says so here.
        """
        own = {"N": force, "m": depth, "s": depth / speed if speed > 0.0 else 1.0}
        return np.array([_size_of(unit, own) for unit in cls.units])

    @property
    def remembers(self) -> bool:
        """Whether its force depends on more than the present."""
        return False

    @property
    def relaxation_time(self) -> float | None:
        """Its one relaxation time, s; None of a law that has none, or many."""
        return None

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """What :class:`GeneralisedHuntCrossley` has for the same law; None where it is none."""
        return None

    def simplest(self) -> "ForceLaw":
        """Return Kelvin and Voigt's law, or Hunt and Crossley's, where it is exactly that."""
        return self

    def scaled(self, depth: float, speed: float) -> "ForceLaw":
        """Return the law with penetration in units of a depth [m] and velocity in a speed [m/s].

        Only a power law needs that, whose K and n are hardly told apart in metres.
        """
        return self

    @property
    def parameters(self) -> Floats:
        """The parameters in their order, SI."""
        return np.array(list(self.as_dict().values()))

    @overload
    def force(self, penetration: float, velocity: float) -> float: ...
    @overload
    def force(self, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats: ...
    def force(self, penetration: "ArrayLike", velocity: "ArrayLike") -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays."""
        raise NotImplementedError

    def in_a_loop(self) -> Callable[[float, float], float]:
        """Return :meth:`force` of plain numbers, one after the other: the same, quicker."""
        return self.force

    def force_along(
        self, penetration: "ArrayLike", velocity: "ArrayLike", time_steps: "ArrayLike"
    ) -> Floats:
        """Force [N] along a motion, of samples so many seconds apart, shapes (k,).

        The same as :meth:`force` of a law without memory.
        """
        return np.asarray(self.force(penetration, velocity))

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂θ in contact, shape (k, p), at penetrations > 0 [m] and velocities [m/s], (k,)."""
        raise NotImplementedError

    @classmethod
    def force_and_gradient(cls, parameters: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Force [N] and ∂F/∂θ in contact by parameters; NaN where there is no such law."""
        try:
            law = cls.from_parameters(parameters)
            return law.force(x, v), law.parameter_gradient(x, v)
        except (InvalidParameterError, ArithmeticError):
            return np.full_like(x, np.nan), np.full((len(x), len(parameters)), np.nan)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x in contact, N/m, shape (k,), at penetrations > 0 [m] and velocities [m/s], (k,)."""
        raise NotImplementedError

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v in contact and at rest, N·s/m, shape (k,), at penetrations > 0 [m], (k,).

        By (F(x, v) − F(x, −v))/2v at 1 mm/s: exact for every law that is linear in v.
        """
        v = 1e-3
        return (self.force(penetration, v) - self.force(penetration, -v)) / (2.0 * v)

    @overload
    def stiffness_at(self, depth: float, velocity: float = 0.0) -> float: ...
    @overload
    def stiffness_at(self, depth: "ArrayLike", velocity: "ArrayLike" = 0.0) -> Floats: ...
    def stiffness_at(self, depth: "ArrayLike", velocity: "ArrayLike" = 0.0) -> float | Floats:
        """∂F/∂x [N/m] at a depth > 0 [m] and a velocity [m/s]: what a small motion there feels.

        Scalars give a float; arrays go together as in NumPy.
        """
        x, v = in_contact(depth, velocity)
        slope = self.penetration_gradient(x.reshape(-1), v.reshape(-1)).reshape(x.shape)
        return slope if slope.ndim else float(slope)

    @overload
    def damping_at(self, depth: float) -> float: ...
    @overload
    def damping_at(self, depth: "ArrayLike") -> Floats: ...
    def damping_at(self, depth: "ArrayLike") -> float | Floats:
        """∂F/∂v [N·s/m] at a depth > 0 [m] and at rest; a scalar gives a float."""
        x = in_contact(depth)[0]
        slope = self.velocity_gradient(x.reshape(-1)).reshape(x.shape)
        return slope if slope.ndim else float(slope)

    def at_rest(self, depth: float) -> tuple[float, float, float]:
        """Force [N], stiffness [N/m] and damping [N·s/m] at a depth > 0 [m] and at rest."""
        return float(self.force(depth, 0.0)), self.stiffness_at(depth), self.damping_at(depth)

    @classmethod
    def many_at(cls, parameters: Floats, depth: float | Floats) -> tuple[Floats, Floats]:
        """:meth:`stiffness_at` and :meth:`damping_at` a depth, of many laws at once.

        Parameters
        ----------
        parameters : numpy.ndarray, shape (k, p)
            A law a row; NaN gives NaN.
        depth : float or numpy.ndarray, shape (k,)
            m, > 0.
        """
        found = np.full((2, len(parameters)), np.nan)
        depths = np.broadcast_to(depth, len(parameters))
        for k in np.flatnonzero(np.isfinite(parameters).all(axis=1)).tolist():
            law = cls.from_parameters(parameters[k])
            found[:, k] = law.stiffness_at(float(depths[k])), law.damping_at(float(depths[k]))
        return found[0], found[1]


def _size_of(unit: str, own: dict[str, float]) -> float:
    """The size of a unit, such as ``N·s/m²``; what is none of N, m and s counts as 1."""
    size, sign = 1.0, 1
    for symbol, separator in re.findall(r"([^·/]*)([·/]?)", unit):
        power = re.sub("[^0-9]", "", symbol.translate(_SUPERSCRIPTS)) or "1"
        size *= own.get(symbol.rstrip("⁰¹²³⁴⁵⁶⁷⁸⁹ⁿᵖ⁺⁻"), 1.0) ** (sign * int(power))
        sign = -1 if separator == "/" else sign
    return size


_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")

Law = TypeVar("Law", bound=type[ForceLaw])

#: Every force law by its kind.
FORCE_LAWS: dict[str, type[ForceLaw]] = {}

# What is to know of each law that is registered: estimators, which stand above the laws.
WATCHERS: list[Callable[[type[ForceLaw]], None]] = []


def register(law: Law) -> Law:
    """Make a law known to estimators, lab, figures, reports and the command line; a decorator.

    Raises
    ------
    InvalidParameterError
        It is no force law, lacks a part, or another has its kind.
    """
    if not (isinstance(law, type) and issubclass(law, ForceLaw) and is_dataclass(law)):
        raise InvalidParameterError(f"law must be a dataclass of ForceLaw, not {shown(law)}")
    missing = [name for name in ("kind", "units", "symbols") if not hasattr(law, name)]
    needed = ("force", "parameter_gradient", "penetration_gradient")
    missing += [name for name in needed if getattr(law, name) is getattr(ForceLaw, name)]
    if missing:
        raise InvalidParameterError(f"{law.__name__} lacks {', '.join(missing)}")
    if not len(law.names()) == len(law.units) == len(law.symbols):
        raise InvalidParameterError(f"{law.__name__} must have a unit and a symbol a parameter")
    if FORCE_LAWS.setdefault(law.kind, law) is not law:
        raise InvalidParameterError(f"kind must be new: {law.kind!r} is {FORCE_LAWS[law.kind]}")
    for watch in WATCHERS:
        watch(law)
    return law


def law_from(description: dict[str, Any]) -> ForceLaw:
    """Return the law of a ``kind`` and its parameters, as :meth:`ForceLaw.as_dict` names them.

    Raises
    ------
    InvalidParameterError
        The kind is unknown, or the parameters are not its own.
    """
    given = dict(description)
    kind: Any = given.pop("kind", None)
    one_of("kind", kind, FORCE_LAWS)
    law = FORCE_LAWS[kind]
    needed = [name for name in law.names() if name not in law.optional]
    if not set(needed) <= set(given) <= set(law.names()):
        words = f"{kind} needs {', '.join(needed)}"
        if law.optional:
            words += f", may have {', '.join(law.optional)}"
        raise InvalidParameterError(f"{words}, and no others")
    return law.from_dict({**dict.fromkeys(law.optional, 0.0), **given})


class CompiledLaw(ForceLaw):
    """A law whose force is worked out by the compiled core."""

    __slots__ = ()
    _compiled: ClassVar[Callable[..., None]]

    @overload
    def force(self, penetration: float, velocity: float) -> float: ...
    @overload
    def force(self, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats: ...
    def force(self, penetration: "ArrayLike", velocity: "ArrayLike") -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays."""
        given = together(penetration=penetration, velocity=velocity)
        force = np.empty(given[0].shape)
        x, v = (np.ascontiguousarray(array).reshape(-1) for array in given)
        type(self)._compiled(self.parameters, x, v, force.reshape(-1))
        return float(force) if force.ndim == 0 else force

    @classmethod
    def many_at(cls, parameters: Floats, depth: float | Floats) -> tuple[Floats, Floats]:
        """∂F/∂x and ∂F/∂v of many laws at rest, a row each, once they have relaxed."""
        laws = object.__new__(cls)  # of columns, which the gradients take as they take numbers
        for own, column in zip(fields(cls), parameters.T, strict=False):  # type: ignore[arg-type]
            object.__setattr__(laws, own.name, column)
        x = np.broadcast_to(np.asarray(depth, dtype=np.float64), len(parameters))
        with np.errstate(all="ignore"):  # a start may be anything
            return laws.penetration_gradient(x, np.zeros_like(x)), laws.velocity_gradient(x)

    def in_a_loop(self) -> Callable[[float, float], float]:
        """Return :meth:`force` of plain numbers, in arrays of its own: not for several threads."""
        compiled, parameters = type(self)._compiled, self.parameters
        depth, speed, force = np.empty(1), np.empty(1), np.empty(1)

        def felt(penetration: float, velocity: float) -> float:
            depth[0], speed[0] = penetration, velocity
            compiled(parameters, depth, speed, force)
            return force.item()

        return felt


@register
@dataclass(frozen=True, slots=True)
class KelvinVoigt(CompiledLaw):
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
    linear: ClassVar[int] = 2
    candidate: ClassVar[tuple[str, str, bool] | None] = ("half-space", "none", True)
    _compiled: ClassVar[Callable[..., None]] = _core.kelvin_voigt_force

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """K x + B x⁰ v."""
        return self.stiffness, 1.0, self.damping, 0.0

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K, B) = (x, v)."""
        return np.stack([penetration, velocity], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = K."""
        return np.full_like(penetration, self.stiffness)

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B."""
        return np.full_like(penetration, self.damping)


@register
@dataclass(frozen=True, slots=True)
class ExtendedKelvinVoigt(CompiledLaw):
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
    linear: ClassVar[int] = 3
    _compiled: ClassVar[Callable[..., None]] = _core.extended_kelvin_voigt_force

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """K₁ x + B x⁰ v or K₂ x² + B x⁰ v, where the other is 0."""
        if self.quadratic_stiffness == 0.0:
            return self.stiffness, 1.0, self.damping, 0.0
        return None if self.stiffness else (self.quadratic_stiffness, 2.0, self.damping, 0.0)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K₁, K₂, B) = (x, x², v)."""
        return np.stack([penetration, penetration**2, velocity], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = K₁ + 2 K₂ x."""
        slope: Floats = self.stiffness + 2.0 * self.quadratic_stiffness * penetration
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B."""
        return np.full_like(penetration, self.damping)


@register
@dataclass(frozen=True, slots=True)
class HuntCrossley(CompiledLaw):
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
    has_condition_10: ClassVar[bool] = True
    linear: ClassVar[int] = 2
    power_law: ClassVar[bool] = True
    candidate: ClassVar[tuple[str, str, bool] | None] = ("hunt-crossley", "none", False)
    _compiled: ClassVar[Callable[..., None]] = _core.hunt_crossley_force

    @property
    def dissipation(self) -> float:
        """Dissipation b = B/K, s/m, as simulators call it."""
        return self.damping / self.stiffness if self.stiffness else float("nan")

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """K xⁿ + B xⁿ v."""
        return self.stiffness, self.exponent, self.damping, self.exponent

    def scaled(self, depth: float, speed: float) -> "HuntCrossley":
        """Return k = K x_rⁿ, c = B x_rⁿ V and n."""
        power = depth**self.exponent
        return HuntCrossley(self.stiffness * power, self.damping * power * speed, self.exponent)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K, B, n) = (xⁿ, xⁿ v, F ln x)."""
        power = penetration**self.exponent
        force = power * (self.stiffness + self.damping * velocity)
        return np.stack([power, power * velocity, np.log(penetration) * force], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = n xⁿ⁻¹ (K + B v)."""
        stiffness = self.stiffness + self.damping * velocity
        slope: Floats = self.exponent * penetration ** (self.exponent - 1.0) * stiffness
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B xⁿ."""
        slope: Floats = self.damping * penetration**self.exponent
        return slope
