"""Hunt–Crossley laws whose damper has an exponent of its own, and that may remember."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self, overload

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.force_laws.laws import (
    CompiledLaw,
    Floats,
    ForceLaw,
    HuntCrossley,
    KelvinVoigt,
    register,
)
from palpate.force_laws.relaxation import LONGEST, Relaxation, RelaxationState, relaxation_of
from palpate.validation import all_good, in_contact, instance, number, number_in, signals, together

# The law's own numbers; those of its relaxation follow.
_OWN = ("stiffness", "exponent", "damping", "damping_exponent", "relaxation_stiffness")


@register
@dataclass(frozen=True, slots=True)
class GeneralisedHuntCrossley(CompiledLaw):
    """A spring that stiffens with depth, a damper, and a part of the spring that relaxes.

    F = K xⁿ + B xᵖ v + M ∫ w(τ) g_τ d(ln τ)  for x > 0, else 0;   ġ_τ = d(xⁿ)/dt − g_τ/τ

    With p = n it is the law of Hunt & Crossley (1975); with p = n − 1 that of a sphere, a cone or a
    punch on a Kelvin–Voigt half-space, whose damper acts on the area of contact (Radok 1957, Lee &
    Radok 1960); at n = 1, p = 0 that of Kelvin & Voigt. The relaxing part is Boltzmann's
    superposition of xⁿ, quasi-linear viscoelasticity (Fung 1981). Out of contact xⁿ counts as 0,
    and the material goes on relaxing.

    Parameters
    ----------
    stiffness : float
        K, N/mⁿ: that of the relaxed material.
    exponent : float
        n; 1.5 a Hertzian sphere, 2 a cone, 1 a punch.
    damping : float
        B, N·s/mᵖ⁺¹.
    damping_exponent : float
        p.
    relaxation_stiffness : float
        M, N/mⁿ: by so much the material is stiffer at once than when it has relaxed.
    relaxation : FlatSpectrum, SingleRelaxation or PowerLawRelaxation, optional
        How it relaxes; needed where M is not 0. Without it there is no memory.

    Raises
    ------
    InvalidParameterError
        A parameter is not a finite number, or there is a relaxation stiffness without relaxation.
    """

    stiffness: float
    exponent: float
    damping: float
    damping_exponent: float
    relaxation_stiffness: float = 0.0
    relaxation: Relaxation | None = None
    kind: ClassVar[str] = "generalised-hunt-crossley"
    units: ClassVar[tuple[str, ...]] = (
        "N/mⁿ", "", "N·s/mᵖ⁺¹", "", "N/mⁿ", "", "s", "s",
    )  # fmt: skip
    symbols: ClassVar[tuple[str, ...]] = ("K", "n", "B", "p", "M", "α", "τ₁", "τ₂")
    optional: ClassVar[tuple[str, ...]] = (
        "relaxation_stiffness", "spectrum_exponent", "shortest_time", "longest_time",
    )  # fmt: skip
    relaxes: ClassVar[bool] = True
    _compiled: ClassVar[Callable[..., None]] = _core.generalised_hunt_crossley_force

    def __post_init__(self) -> None:
        for name in _OWN:
            object.__setattr__(self, name, number(name, getattr(self, name)))
        instance("relaxation", self.relaxation, (Relaxation, type(None)))
        if self.relaxation is None and self.relaxation_stiffness != 0.0:
            raise InvalidParameterError(
                "relaxation must be a FlatSpectrum, SingleRelaxation or PowerLawRelaxation where "
                f"relaxation_stiffness is not 0: it is {self.relaxation_stiffness!r}"
            )

    @classmethod
    def of(cls, law: ForceLaw) -> "GeneralisedHuntCrossley":
        """Return the same law as one of these.

        Parameters
        ----------
        law : ForceLaw
            p is 0 where the damper is linear, and n where it is Hunt and Crossley's.

        Raises
        ------
        InvalidParameterError
            There is none: of an extended Kelvin–Voigt law with K₁ and K₂, or a law of one's own.
        """
        if law.powers is None:
            raise InvalidParameterError(
                f"law must have one power of depth in its spring, not {law!r}"
            )
        return GeneralisedHuntCrossley(*law.powers)

    def simplest(self) -> "KelvinVoigt | HuntCrossley | GeneralisedHuntCrossley":
        """Return the law as Kelvin and Voigt's, or Hunt and Crossley's, where it is exactly that.

        Itself where it remembers or has another damper. Without a damper p does not matter.
        """
        if self.remembers:
            return self
        undamped = self.damping == 0.0
        if self.exponent == 1.0 and (undamped or self.damping_exponent == 0.0):
            return KelvinVoigt(self.stiffness, self.damping)
        if undamped or self.damping_exponent == self.exponent:
            return HuntCrossley(self.stiffness, self.damping, self.exponent)
        return self

    @classmethod
    def names(cls) -> list[str]:
        """Return the names of the numbers that it comes to, in their order."""
        return [*_OWN, "spectrum_exponent", "shortest_time", "longest_time"]

    @classmethod
    def from_parameters(cls, parameters: "ArrayLike") -> Self:
        """Return the law of eight numbers, as :attr:`parameters` has them."""
        stiffness, n, damping, p, relaxing, alpha, shortest, longest = np.asarray(
            parameters, dtype=np.float64
        ).tolist()
        relaxation = relaxation_of(alpha, shortest, longest)
        if relaxation is None and relaxing != 0.0:
            raise InvalidParameterError(
                "longest_time must be above 0 where relaxation_stiffness is not 0: alone it is the "
                "one relaxation time, with shortest_time the end of a spectrum"
            )
        return cls(stiffness, n, damping, p, relaxing, relaxation)

    @classmethod
    def from_dict(cls, numbers: dict[str, Any]) -> Self:
        """Return the law of its numbers by name, as :meth:`as_dict` has them."""
        return cls.from_parameters([number(name, numbers[name]) for name in cls.names()])

    def as_dict(self) -> dict[str, float]:
        """Return the numbers by name, SI: the last three are those of the relaxation, or 0."""
        spectrum = (0.0, 0.0, 0.0) if self.relaxation is None else self.relaxation.spectrum
        own = [getattr(self, name) for name in _OWN]
        return dict(zip(self.names(), (*own, *spectrum), strict=True))

    @property
    def spectrum_exponent(self) -> float:
        """α of the relaxation; 0 where there is none."""
        return self.as_dict()["spectrum_exponent"]

    @property
    def shortest_time(self) -> float:
        """The shortest relaxation time, s; 0 where there is one only, or none."""
        return self.as_dict()["shortest_time"]

    @property
    def longest_time(self) -> float:
        """The longest relaxation time, s; 0 where there is none."""
        return self.as_dict()["longest_time"]

    @property
    def remembers(self) -> bool:
        """Whether its force depends on more than the present."""
        return self.relaxation is not None and self.relaxation_stiffness != 0.0

    @property
    def relaxation_time(self) -> float | None:
        """Its one relaxation time, s; None of a law that has none, or a spectrum of many."""
        return self.longest_time if self.remembers and not self.shortest_time else None

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """Its own numbers."""
        return tuple(getattr(self, each.name) for each in fields(self))

    def relaxed(self) -> "GeneralisedHuntCrossley":
        """Return the law of the material once it has relaxed: K alone, without memory."""
        return replace(self, relaxation_stiffness=0.0, relaxation=None)

    def instantaneous(self) -> "GeneralisedHuntCrossley":
        """Return the law before anything has relaxed: K + M, without memory."""
        whole = self.stiffness + self.relaxation_stiffness
        return replace(self, stiffness=whole, relaxation_stiffness=0.0, relaxation=None)

    def branches(self) -> tuple[Floats, Floats]:
        """Relaxation times [s] and weights of the branches that stand for the spectrum.

        Two of them to a factor of two in time; none without memory.
        """
        times, weights = _core.relaxation_branches(self.parameters)
        return times, weights

    def rest(self, penetration: float = 0.0) -> RelaxationState:
        """Return the state of a material that has been at a penetration [m] for ever."""
        depth = number("penetration", penetration)
        elastic = depth**self.exponent if depth > 0.0 else 0.0
        return RelaxationState(elastic, (0.0,) * len(self.branches()[0]))

    def step(self, state: RelaxationState, penetration: float, dt: float) -> RelaxationState:
        """Return the state after going on to a penetration.

        Exact where xⁿ is linear in time in between, whatever the time step.

        Parameters
        ----------
        state : RelaxationState
            At the last sample.
        penetration : float
            m; at and above the surface xⁿ counts as 0.
        dt : float
            Time since then, s, in (0, 1e12].

        Raises
        ------
        InvalidParameterError
            The state is of a law with another spectrum, or a number is outside its range.
        """
        numbers, depth = self._numbers_of(state), np.array([number("penetration", penetration)])
        steps = np.array([number_in("dt", dt, 0.0, LONGEST, open_low=True)])
        self._go(numbers, steps, depth, np.zeros(1))
        return RelaxationState(float(numbers[0]), tuple(numbers[1:].tolist()))

    @overload
    def force(
        self, penetration: float, velocity: float, state: RelaxationState | None = None
    ) -> float: ...
    @overload
    def force(
        self, penetration: "ArrayLike", velocity: "ArrayLike", state: RelaxationState | None = None
    ) -> Floats: ...
    def force(
        self, penetration: "ArrayLike", velocity: "ArrayLike", state: RelaxationState | None = None
    ) -> float | Floats:
        """Force [N] at a penetration [m] and velocity [m/s], scalars or arrays.

        Parameters
        ----------
        penetration, velocity : float or array_like
            m and m/s.
        state : RelaxationState, optional
            What the material remembers, once it was stepped to this penetration. None: everything
            has relaxed. Along a whole motion there is :meth:`force_along`.
        """
        static = CompiledLaw.force(self, penetration, velocity)
        if state is None or not self.remembers:
            return static
        weights = self.branches()[1]
        memory = self.relaxation_stiffness * float(weights @ self._numbers_of(state)[1:])
        if isinstance(static, float):
            return static + memory if float(np.asarray(penetration)) > 0.0 else static
        return np.where(np.broadcast_to(penetration, static.shape) > 0.0, static + memory, static)

    def force_along(
        self,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        time_steps: "ArrayLike",
        state: RelaxationState | None = None,
    ) -> Floats:
        """Force [N] along a motion, from what the material remembers when it begins.

        Parameters
        ----------
        penetration, velocity : array_like, shape (k,)
            m and m/s; a NaN is passed over.
        time_steps : float or array_like, shape (k,)
            Time since the sample before, s, > 0; the first one's is that since the state.
        state : RelaxationState, optional
            Before the first sample. None: at rest at the first penetration.

        Raises
        ------
        InvalidParameterError
            The arrays do not go together, or a time step is not positive.
        """
        x, v = signals(penetration=penetration, velocity=velocity)
        steps = np.ascontiguousarray(together(penetration=x, time_steps=time_steps)[1])
        all_good("time_steps", steps, (steps > 0.0) & np.isfinite(steps), "positive and finite")
        if not x.size:
            return np.empty(0)
        known = x[np.isfinite(x)]
        begun = self.rest(float(known[0]) if known.size else 0.0) if state is None else state
        return self._go(self._numbers_of(begun), steps, x, v)

    def dynamic_stiffness(self, depth: "ArrayLike", frequency: "ArrayLike") -> Any:
        """K′ + iωB′ [N/m]: what a small oscillation about a depth feels.

        n xⁿ⁻¹ [K + M ∫ w iωτ/(1 + iωτ) d(ln τ)] + iω B xᵖ

        Parameters
        ----------
        depth : float or array_like
            m, > 0.
        frequency : float or array_like
            ω, rad/s, ≥ 0. What a motion did not contain, its recording does not say.

        Returns
        -------
        complex or numpy.ndarray
            Scalars give a complex number. Stiffness is its real part, damping its imaginary part
            over ω, tan δ the one over the other.
        """
        x, omega = together(depth=in_contact(depth)[0], frequency=frequency)
        all_good("frequency", omega, (omega >= 0.0) & np.isfinite(omega), "finite and ≥ 0")
        times, weights = self.branches()
        phase = 1j * omega[..., None] * times
        memory = self.relaxation_stiffness * (weights * phase / (1.0 + phase)).sum(axis=-1)
        slope = self.exponent * x ** (self.exponent - 1.0)
        whole = slope * (self.stiffness + memory)
        whole = whole + 1j * omega * self.damping * x**self.damping_exponent
        return whole if whole.ndim else complex(whole)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K, n, B, p) of the relaxed material, and 0 for what it remembers."""
        elastic = penetration**self.exponent
        damper = penetration**self.damping_exponent * velocity
        depth = np.log(penetration)
        spring = elastic, self.stiffness * elastic * depth
        return np.column_stack(
            [*spring, damper, self.damping * damper * depth, *[np.zeros_like(elastic)] * 4]
        )

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = n K xⁿ⁻¹ + p B xᵖ⁻¹ v of the relaxed material."""
        elastic = self.exponent * self.stiffness * penetration ** (self.exponent - 1.0)
        damper = self.damping * velocity * penetration ** (self.damping_exponent - 1.0)
        slope: Floats = elastic + self.damping_exponent * damper
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B xᵖ."""
        slope: Floats = self.damping * penetration**self.damping_exponent
        return slope

    def _numbers_of(self, state: RelaxationState) -> Floats:
        instance("state", state, RelaxationState)
        if len(state.branches) != len(self.branches()[0]):
            raise InvalidParameterError(
                f"state must be of this law's spectrum, of {len(self.branches()[0])} branches, "
                f"not {len(state.branches)}"
            )
        return np.array([state.elastic, *state.branches])

    def _go(self, numbers: Floats, steps: Floats, x: Floats, v: Floats) -> Floats:
        """Take the numbers of a state along, and return the force."""
        force = np.empty(x.size)
        _core.generalised_force_along(self.parameters, steps, x, v, numbers, force)
        return force
