"""Force laws: the base class, Kelvin–Voigt and Hunt–Crossley, and the table of all laws.

Equation numbers refer to Haddadi & Hashtrudi-Zaad, *Real-Time Identification of Hunt–Crossley
Dynamic Models of Contact Environments*, IEEE T-RO 28(3), 2012.
"""

import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, Self, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate._plugins import load_plugins
from palpate.errors import InvalidParameterError
from palpate.force_laws.relaxation import steps_over_breaks
from palpate.validation import Floats as Floats
from palpate.validation import broadcast_contact, check_choice, frozen, number, shown, together


class ForceLaw:
    """Force as a function of penetration and velocity: a frozen dataclass of coefficients, SI.

    Coefficients have the symbols of the law as names, and are passed by keyword: K, B, n.
    :meth:`stiffness_at` and :meth:`damping_at` give ∂F/∂x [N/m] and ∂F/∂v [N·s/m] at a depth.

    Your own law derives from this class, defines ``kind``, ``units``, ``symbols``, ``_force`` and
    the two gradients, and is registered by :func:`register`; see ``CONTRIBUTING.md``.

    Examples
    --------
    >>> import palpate
    >>> law = palpate.identify("examples/recordings/ball.csv").law
    >>> isinstance(law, palpate.ForceLaw)
    True
    >>> law.kind, law.names(), law.units
    ('hunt-crossley', ['K', 'B', 'n'], ('N/mⁿ', 'N·s/mⁿ⁺¹', ''))
    """

    __slots__ = ()
    #: Name of the law on the command line and in files.
    kind: ClassVar[str]
    #: Units and symbols of the parameters, in their order.
    units: ClassVar[tuple[str, ...]]
    symbols: ClassVar[tuple[str, ...]]
    #: Parameters, and other entries of the description, that have a default.
    optional: ClassVar[tuple[str, ...]] = ()
    #: Whether condition 10 of the paper, abs(v) < 0.1 K/B, concerns it.
    has_condition_10: ClassVar[bool] = False
    #: Number of leading parameters in which the force is linear: F = Σ θᵢ ∂F/∂θᵢ.
    linear: ClassVar[int] = 0
    #: Whether the law is (K + B v) xⁿ, with the parameters K, B and n in this order.
    power_law: ClassVar[bool] = False
    #: Whether laws of this class can have memory; for one law see :attr:`remembers`.
    relaxes: ClassVar[bool] = False
    #: Damping, memory and linearity of the equivalent model-selection candidate.
    candidate: ClassVar[tuple[str, str, bool] | None] = None

    def __post_init__(self) -> None:
        for name in self.names():
            value = getattr(self, name)
            checked = number(name, value)
            if checked is not value:
                object.__setattr__(self, name, checked)

    @classmethod
    def from_parameters(cls, parameters: "ArrayLike") -> Self:
        """Return the law with these numbers, in the order of :attr:`parameters`."""
        numbers = np.asarray(parameters, dtype=np.float64).tolist()
        return cls(**dict(zip(cls.names(), numbers, strict=True)))

    def with_parameters(self, parameters: "ArrayLike") -> "ForceLaw":
        """Return the law with other parameters, and the rest of it, such as its memory, the same.

        Raises
        ------
        InvalidParameterError
            A parameter is outside its range.
        """
        return self.from_parameters(parameters)

    @classmethod
    def from_dict(cls, numbers: dict[str, Any]) -> Self:
        """Return the law from a :meth:`description` without its kind."""
        return cls(**numbers)

    def description(self) -> dict[str, Any]:
        """Return kind, parameters and what else a saved law needs, as JSON types, SI."""
        return {"kind": self.kind, **self.as_dict()}

    @classmethod
    def names(cls) -> list[str]:
        """Return the names of the parameters, in their order."""
        return list(names_of_fields(cls))

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name, SI."""
        return {name: getattr(self, name) for name in self.names()}

    @classmethod
    def sizes(cls, depth: float, speed: float, force: float) -> Floats:
        """Return typical parameter values for a depth [m], a speed [m/s] and a force [N].

        They follow from the units. A fit starts from 0.01 to 100 times these values, or 0.1 to 10
        times for parameters without unit; override this method for other ranges.
        """
        own = {"N": force, "m": depth, "s": depth / speed if speed > 0.0 else 1.0}
        return np.array([_typical_value(unit, own) for unit in cls.units])

    @property
    def remembers(self) -> bool:
        """Whether the law has memory."""
        return False

    @property
    def relaxation_time(self) -> float | None:
        """The relaxation time, s; None for a law without one or with a spectrum of them."""
        return None

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """Parameters of the equivalent :class:`GeneralisedHuntCrossley`; None without one."""
        return None

    def simplest(self) -> "ForceLaw":
        """Return the equivalent Kelvin–Voigt or Hunt–Crossley law, else the law itself."""
        return self

    def scaled(self, depth: float, speed: float) -> "ForceLaw":
        """Return the law with penetration in units of a depth [m] and velocity in a speed [m/s].

        Only a power law needs that: in metres its K and n are strongly correlated.
        """
        return self

    @property
    def parameters(self) -> Floats:
        """The parameters in their order, SI."""
        return np.array([getattr(self, name) for name in self.names()])

    @overload
    def force(self, penetration: float, velocity: float) -> float: ...
    @overload
    def force(self, penetration: "ArrayLike", velocity: "ArrayLike") -> Floats: ...
    def force(self, penetration: "ArrayLike", velocity: "ArrayLike") -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays.

        0 out of contact, and NaN for NaN.
        """
        x, v = together(penetration=penetration, velocity=velocity)
        force = np.zeros(x.shape)
        inside = ~(x <= 0.0)
        force[inside] = self._force(x[inside], v[inside])
        return force if force.ndim else float(force)

    def _force(self, x: Floats, v: Floats) -> Floats:
        """Force [N] in contact, shape (k,), at penetrations > 0 [m] and velocities [m/s], (k,)."""
        raise NotImplementedError

    def in_a_loop(self) -> Callable[[float, float], float]:
        """Return a faster :meth:`force` for repeated calls with plain floats."""
        return self.force

    def force_along(
        self,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        time_steps: "ArrayLike",
    ) -> Floats:
        """Force [N] along a motion, shapes (k,), with the time steps [s].

        Equal to :meth:`force` for a law without memory.
        """
        return np.asarray(self.force(penetration, velocity))

    def force_over(
        self,
        time: Floats,
        penetration: Floats,
        velocity: Floats,
        time_step: float,
    ) -> Floats:
        """Force [N] along a motion at these times [s], over breaks in it, shape (k,).

        A break in the material counts as one usual time step [s], as in an estimator.
        """
        steps = steps_over_breaks(time, penetration, time_step)
        return self.force_along(penetration, velocity, steps)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂θ in contact, shape (k, p), at penetrations > 0 [m] and velocities [m/s], (k,)."""
        raise NotImplementedError

    @classmethod
    def force_and_gradient(cls, parameters: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Force [N] and ∂F/∂θ in contact by parameters; NaN for invalid parameters."""
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

        (F(x, v) − F(x, −v))/2v at 1 mm/s: exact for every law that is linear in v.
        """
        v = 1e-3
        return (self.force(penetration, v) - self.force(penetration, -v)) / (2.0 * v)

    @overload
    def stiffness_at(self, depth: float, velocity: float = 0.0) -> float: ...
    @overload
    def stiffness_at(self, depth: "ArrayLike", velocity: "ArrayLike" = 0.0) -> Floats: ...
    def stiffness_at(self, depth: "ArrayLike", velocity: "ArrayLike" = 0.0) -> float | Floats:
        """∂F/∂x [N/m] at a depth > 0 [m] and a velocity [m/s].

        Scalars give a float; arrays broadcast as in NumPy.
        """
        x, v = broadcast_contact(depth, velocity)
        slope = self.penetration_gradient(x.reshape(-1), v.reshape(-1)).reshape(x.shape)
        return slope if slope.ndim else float(slope)

    @overload
    def damping_at(self, depth: float) -> float: ...
    @overload
    def damping_at(self, depth: "ArrayLike") -> Floats: ...
    def damping_at(self, depth: "ArrayLike") -> float | Floats:
        """∂F/∂v [N·s/m] at a depth > 0 [m] and at rest; a scalar gives a float."""
        x = broadcast_contact(depth)[0]
        slope = self.velocity_gradient(x.reshape(-1)).reshape(x.shape)
        return slope if slope.ndim else float(slope)

    def at_rest(self, depth: float) -> tuple[float, float, float]:
        """Force [N], stiffness [N/m] and damping [N·s/m] at a depth > 0 [m] and at rest."""
        return self.at_speed(depth, 0.0)

    def at_speed(self, depth: float, velocity: float) -> tuple[float, float, float]:
        """Force [N], stiffness [N/m], damping [N·s/m] at a depth > 0 [m] and a velocity [m/s]."""
        force = self.force(depth, velocity)
        stiffness = self.stiffness_at(depth, velocity)
        return float(force), stiffness, self.damping_at(depth)


def names_of_fields(law: Any) -> tuple[str, ...]:
    """Names of a law's fields."""
    return tuple(each.name for each in fields(law))


def _typical_value(unit: str, own: dict[str, float]) -> float:
    """The typical value of a unit, such as ``N·s/m²``; other symbols than N, m, s count as 1."""
    size = 1.0
    sign = 1
    for symbol, separator in re.findall(r"([^·/]*)([·/]?)", unit):
        power = re.sub("[^0-9]", "", symbol.translate(_SUPERSCRIPTS)) or "1"
        size *= own.get(symbol.rstrip("⁰¹²³⁴⁵⁶⁷⁸⁹ⁿᵖ⁺⁻"), 1.0) ** (sign * int(power))
        sign = -1 if separator == "/" else sign
    return size


_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")

Law = TypeVar("Law", bound=type[ForceLaw])

#: What is felt at a depth, no names of coefficients.
FELT = frozenset(("force", "stiffness", "damping"))


class LawRegistry(dict[str, type[ForceLaw]]):
    """Laws by ``kind``; those of other packages are loaded when their kind is asked for.

    Examples
    --------
    >>> import palpate
    >>> sorted(palpate.FORCE_LAWS)
    ['extended-kelvin-voigt', 'generalised-hunt-crossley', 'hunt-crossley', 'kelvin-voigt']
    """

    def __contains__(self, kind: object) -> bool:
        if not super().__contains__(kind):
            load_plugins("palpate.laws", register)
        return super().__contains__(kind)

    def __missing__(self, kind: str) -> type[ForceLaw]:
        check_choice("kind", kind, self if kind in self else [*self])
        return self[kind]

    def get(self, kind: str, default: Any = None) -> Any:
        """Return the law of a kind; ``default`` if there is none."""
        return super().get(kind, default) if kind in self else default


#: All force laws by ``kind``.
FORCE_LAWS = LawRegistry()

# Callbacks for each registered law; estimators, which may not be imported here, add theirs.
WATCHERS: list[Callable[[type[ForceLaw]], None]] = []


def register(law: Law) -> Law:
    """Register a law for estimators, lab, figures, reports and the command line; a decorator.

    Raises
    ------
    InvalidParameterError
        It is not a force law, lacks an attribute, or another law has its kind.
    """
    if not (isinstance(law, type) and issubclass(law, ForceLaw) and is_dataclass(law)):
        raise InvalidParameterError(f"law must be a dataclass of ForceLaw, not {shown(law)}")
    missing = [name for name in ("kind", "units", "symbols") if not hasattr(law, name)]
    needed = ["parameter_gradient", "penetration_gradient"]
    needed += ["_force"] * (law.force is ForceLaw.force)
    missing += [name for name in needed if getattr(law, name) is getattr(ForceLaw, name)]
    if missing:
        raise InvalidParameterError(f"{law.__name__} lacks {', '.join(missing)}")
    if taken := sorted(FELT.intersection(law.names())):
        raise InvalidParameterError(
            f"{law.__name__}.{taken[0]} is felt at a depth: name a coefficient by its symbol"
        )
    if not len(law.names()) == len(law.units) == len(law.symbols):
        raise InvalidParameterError(f"{law.__name__} must have one unit and symbol per parameter")
    if FORCE_LAWS.setdefault(law.kind, law) is not law:
        raise InvalidParameterError(f"kind {law.kind!r} is taken by another law: rename one")
    for watch in WATCHERS:
        watch(law)
    return law


def law_from(description: dict[str, Any], spell: Callable[[str], str] = str) -> ForceLaw:
    """Return the law from a :meth:`ForceLaw.description`.

    ``spell`` gives the name of a parameter in the error.

    Raises
    ------
    InvalidParameterError
        The kind is unknown, or has other parameters.
    """
    given = dict(description)
    kind: Any = given.pop("kind", None)
    if kind == Spring.kind:
        return Spring.from_dict(given)
    law = FORCE_LAWS[kind]
    needed = [name for name in law.names() if name not in law.optional]
    if not set(needed) <= set(given) <= {*law.names(), *law.optional}:
        words = f"law {kind!r} takes exactly {', '.join(map(spell, needed))}"
        if law.optional:
            words += f", and optionally {', '.join(map(spell, law.optional))}"
        raise InvalidParameterError(words)
    return law.from_dict(given)


class CompiledLaw(ForceLaw):
    """A law whose force the compiled core computes."""

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

    def in_a_loop(self) -> Callable[[float, float], float]:
        """Return a faster :meth:`force` for plain floats; it is not thread-safe."""
        compiled = type(self)._compiled
        parameters = self.parameters
        depth = np.empty(1)
        speed = np.empty(1)
        force = np.empty(1)

        def sample_force(penetration: float, velocity: float) -> float:
            depth[0] = penetration
            speed[0] = velocity
            compiled(parameters, depth, speed, force)
            return force.item()

        return sample_force


@frozen(kw_only=True)
class Spring(ForceLaw):
    """A power-law spring whose damping is unknown: the law of a curve without time.

    F = K xⁿ  for x ≥ 0, else 0.

    It is not registered: no method identifies it alone, and a simulation needs a damping.

    Parameters
    ----------
    K : float
        N/mⁿ.
    n : float
        n.
    """

    K: float
    n: float
    kind: ClassVar[str] = "spring"
    units: ClassVar[tuple[str, ...]] = ("N/mⁿ", "")
    symbols: ClassVar[tuple[str, ...]] = ("K", "n")

    def _force(self, x: Floats, v: Floats) -> Floats:
        """K xⁿ, at whatever velocity."""
        force: Floats = self.K * x**self.n
        return force

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂K and ∂F/∂n."""
        power = penetration**self.n
        return np.column_stack([power, self.K * power * np.log(penetration)])

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = n K xⁿ⁻¹."""
        slope: Floats = self.n * self.K * penetration ** (self.n - 1.0)
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """Unknown: NaN."""
        return np.full_like(penetration, np.nan)


@register
@frozen(kw_only=True)
class KelvinVoigt(CompiledLaw):
    """A linear spring and a linear damper in parallel.

    F = K x + B v  for x ≥ 0, else 0.   (eq. 1)

    On fast withdrawals the force can become negative, unlike a real contact's (paper, Fig. 10).

    Parameters
    ----------
    K : float
        N/m; positive for a real material.
    B : float
        N·s/m; not negative for a real material.

    Examples
    --------
    >>> import palpate
    >>> law = palpate.KelvinVoigt(K=1000.0, B=5.0)
    >>> law.force([0.01, -0.01], [0.2, 0.2]).tolist()  # N; the second is out of contact
    [11.0, 0.0]
    """

    K: float
    B: float
    kind: ClassVar[str] = "kelvin-voigt"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N·s/m")
    symbols: ClassVar[tuple[str, ...]] = ("K", "B")
    linear: ClassVar[int] = 2
    candidate: ClassVar[tuple[str, str, bool] | None] = ("half-space", "none", True)
    _compiled: ClassVar[Callable[..., None]] = _core.kelvin_voigt_force

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """K x + B x⁰ v."""
        return self.K, 1.0, self.B, 0.0

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K, B) = (x, v)."""
        return np.stack([penetration, velocity], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = K."""
        return np.full_like(penetration, self.K)

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B."""
        return np.full_like(penetration, self.B)


@register
@frozen(kw_only=True)
class ExtendedKelvinVoigt(CompiledLaw):
    """A stiffening spring and a linear damper in parallel.

    F = K₁ x + K₂ x² + B v  for x ≥ 0, else 0.   (eq. 14)

    Parameters
    ----------
    K1 : float
        N/m.
    K2 : float
        N/m².
    B : float
        N·s/m.

    Examples
    --------
    >>> import palpate
    >>> law = palpate.ExtendedKelvinVoigt(K1=500.0, K2=1e5, B=5.0)
    >>> round(law.force(0.01, 0.2), 3), round(law.stiffness_at(0.01), 3)  # N and N/m
    (16.0, 2500.0)
    """

    K1: float
    K2: float
    B: float
    kind: ClassVar[str] = "extended-kelvin-voigt"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m²", "N·s/m")
    symbols: ClassVar[tuple[str, ...]] = ("K₁", "K₂", "B")
    linear: ClassVar[int] = 3
    _compiled: ClassVar[Callable[..., None]] = _core.extended_kelvin_voigt_force

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """K₁ x + B x⁰ v or K₂ x² + B x⁰ v, where the other is 0."""
        if self.K2 == 0.0:
            return self.K1, 1.0, self.B, 0.0
        return None if self.K1 else (self.K2, 2.0, self.B, 0.0)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K₁, K₂, B) = (x, x², v)."""
        return np.stack([penetration, penetration**2, velocity], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = K₁ + 2 K₂ x."""
        slope: Floats = self.K1 + 2.0 * self.K2 * penetration
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B."""
        return np.full_like(penetration, self.B)


@register
@frozen(kw_only=True)
class HuntCrossley(CompiledLaw):
    """A spring and a damper in parallel, both increasing with depth.

    F = K xⁿ + B xⁿ v = K xⁿ (1 + b v)  for x > 0, else 0.   (eq. 2)

    Parameters
    ----------
    K : float
        N/mⁿ; positive for a real material.
    B : float
        N·s/mⁿ⁺¹; not negative for a real material.
    n : float
        1 to 2 for most materials (1.5 for a Hertzian sphere, 2 for a cone).

    Examples
    --------
    >>> import palpate
    >>> law = palpate.HuntCrossley(K=2000.0, B=1000.0, n=1.0)
    >>> law.force(0.01, 0.1)  # N, at 10 mm and 0.1 m/s
    21.0
    >>> law.stiffness_at(0.01), law.damping_at(0.01)  # N/m and N·s/m
    (2000.0, 10.0)
    """

    K: float
    B: float
    n: float
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
        """Dissipation b = B/K, s/m, as simulators name it."""
        return self.B / self.K if self.K else float("nan")

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """K xⁿ + B xⁿ v."""
        return self.K, self.n, self.B, self.n

    def scaled(self, depth: float, speed: float) -> "HuntCrossley":
        """Return k = K x_rⁿ, c = B x_rⁿ V and n."""
        power = depth**self.n
        return HuntCrossley(K=self.K * power, B=self.B * power * speed, n=self.n)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K, B, n) = (xⁿ, xⁿ v, F ln x)."""
        power = penetration**self.n
        force = power * (self.K + self.B * velocity)
        return np.stack([power, power * velocity, np.log(penetration) * force], axis=-1)

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = n xⁿ⁻¹ (K + B v)."""
        coefficient = self.K + self.B * velocity
        slope: Floats = self.n * penetration ** (self.n - 1.0) * coefficient
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B xⁿ."""
        slope: Floats = self.B * penetration**self.n
        return slope
