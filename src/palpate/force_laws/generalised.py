"""Generalised Hunt–Crossley laws: a separate damping exponent, and optional memory."""

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

# The law's own parameters; those of its relaxation follow.
_OWN = ("stiffness", "exponent", "damping", "damping_exponent", "relaxation_stiffness")


@register
@dataclass(frozen=True, slots=True)
class GeneralisedHuntCrossley(CompiledLaw):
    """A spring that stiffens with depth, a damper, and a part of the spring that relaxes.

    F = K xⁿ + B xᵖ v + M ∫ w(τ) g_τ d(ln τ)  for x > 0, else 0;   ġ_τ = d(xⁿ)/dt − g_τ/τ

    With p = n it is the law of Hunt & Crossley (1975); with p = n − 1 that of a sphere, a cone or a
    punch on a Kelvin–Voigt half-space, whose damper acts on the area of contact (Radok 1957, Lee &
    Radok 1960); with n = 1, p = 0 that of Kelvin & Voigt. The relaxing part is Boltzmann's
    superposition of xⁿ, quasi-linear viscoelasticity (Fung 1981). Out of contact xⁿ counts as 0,
    and relaxation continues.

    Parameters
    ----------
    stiffness : float
        K, N/mⁿ, of the fully relaxed material.
    exponent : float
        n; 1.5 for a Hertzian sphere, 2 for a cone, 1 for a punch.
    damping : float
        B, N·s/mᵖ⁺¹.
    damping_exponent : float
        p.
    relaxation_stiffness : float
        M, N/mⁿ: instantaneous stiffness minus relaxed stiffness. Default: 0.
    relaxation : FlatSpectrum, SingleRelaxation or PowerLawRelaxation, optional
        Kind of relaxation; required if M is not 0. Default: none, and no memory.

    Raises
    ------
    InvalidParameterError
        A parameter is not finite, or there is a relaxation stiffness without ``relaxation``.
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
                "relaxation must be a FlatSpectrum, SingleRelaxation or PowerLawRelaxation, as "
                f"relaxation_stiffness is {self.relaxation_stiffness!r}"
            )

    @classmethod
    def of(cls, law: ForceLaw) -> "GeneralisedHuntCrossley":
        """Return a law as an equivalent generalised Hunt–Crossley law.

        Parameters
        ----------
        law : ForceLaw
            p becomes 0 for a linear damper, and n for Hunt and Crossley's.

        Raises
        ------
        InvalidParameterError
            No equivalent exists: for an extended Kelvin–Voigt law with K₁ and K₂, or your own law.
        """
        if law.powers is None:
            raise InvalidParameterError(
                f"the spring of law must be a single power of depth; it is {law!r}"
            )
        return GeneralisedHuntCrossley(*law.powers)

    def simplest(self) -> "KelvinVoigt | HuntCrossley | GeneralisedHuntCrossley":
        """Return the equivalent Kelvin–Voigt or Hunt–Crossley law, if there is one.

        Otherwise, with memory or another damper, the law itself. Without damping p is irrelevant.
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
        """Return the names of its eight parameters, in their order."""
        return [*_OWN, "spectrum_exponent", "shortest_time", "longest_time"]

    @classmethod
    def from_parameters(cls, parameters: "ArrayLike") -> Self:
        """Return the law of eight numbers in the order of :attr:`parameters`."""
        stiffness, n, damping, p, relaxing, alpha, shortest, longest = np.asarray(
            parameters, dtype=np.float64
        ).tolist()
        relaxation = relaxation_of(alpha, shortest, longest)
        if relaxation is None and relaxing != 0.0:
            raise InvalidParameterError(
                "longest_time must be above 0 if relaxation_stiffness is not 0: pass it alone for "
                "one relaxation time, or with shortest_time for a spectrum"
            )
        return cls(stiffness, n, damping, p, relaxing, relaxation)

    @classmethod
    def from_dict(cls, numbers: dict[str, Any]) -> Self:
        """Return the law from the dictionary that :meth:`as_dict` makes."""
        return cls.from_parameters([number(name, numbers[name]) for name in cls.names()])

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name, SI; the last three, of the memory, are 0 without it."""
        spectrum = (0.0, 0.0, 0.0) if self.relaxation is None else self.relaxation.spectrum
        own = [getattr(self, name) for name in _OWN]
        return dict(zip(self.names(), (*own, *spectrum), strict=True))

    @property
    def spectrum_exponent(self) -> float:
        """α of the relaxation; 0 without one."""
        return self.as_dict()["spectrum_exponent"]

    @property
    def shortest_time(self) -> float:
        """The shortest relaxation time, s; 0 if there is only one or none."""
        return self.as_dict()["shortest_time"]

    @property
    def longest_time(self) -> float:
        """The longest relaxation time, s; 0 without relaxation."""
        return self.as_dict()["longest_time"]

    @property
    def remembers(self) -> bool:
        """Whether the law has memory."""
        return self.relaxation is not None and self.relaxation_stiffness != 0.0

    @property
    def relaxation_time(self) -> float | None:
        """The relaxation time, s; None for a law without one or with a spectrum of them."""
        return self.longest_time if self.remembers and not self.shortest_time else None

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """Its own numbers."""
        return tuple(getattr(self, each.name) for each in fields(self))

    def relaxed(self) -> "GeneralisedHuntCrossley":
        """Return the law of the fully relaxed material: stiffness K, without memory."""
        return replace(self, relaxation_stiffness=0.0, relaxation=None)

    def instantaneous(self) -> "GeneralisedHuntCrossley":
        """Return the law before any relaxation: stiffness K + M, without memory."""
        whole = self.stiffness + self.relaxation_stiffness
        return replace(self, stiffness=whole, relaxation_stiffness=0.0, relaxation=None)

    def branches(self) -> tuple[Floats, Floats]:
        """Relaxation times [s] and weights of the branches that approximate the spectrum.

        Two branches per factor of two in time; none without memory.
        """
        times, weights = _core.relaxation_branches(self.parameters)
        return times, weights

    def rest(self, penetration: float = 0.0) -> RelaxationState:
        """Return the state of a material that is fully relaxed at a penetration [m]."""
        depth = number("penetration", penetration)
        elastic = depth**self.exponent if depth > 0.0 else 0.0
        return RelaxationState(elastic, (0.0,) * len(self.branches()[0]))

    def step(self, state: RelaxationState, penetration: float, dt: float) -> RelaxationState:
        """Return the state one step later, at a new penetration.

        Exact for any time step if xⁿ is linear in time in between.

        Parameters
        ----------
        state : RelaxationState
            State at the previous sample.
        penetration : float
            m; at and above the surface xⁿ counts as 0.
        dt : float
            Time since the previous sample, s, in (0, 1e12].

        Raises
        ------
        InvalidParameterError
            The state belongs to a law with another spectrum, or a number is outside its range.
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
            State at this penetration. Default: fully relaxed. For a whole motion use
            :meth:`force_along`.
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
        """Force [N] along a motion, from an initial relaxation state.

        Parameters
        ----------
        penetration, velocity : array_like, shape (k,)
            m and m/s; NaN samples are skipped.
        time_steps : float or array_like, shape (k,)
            Time since the previous sample, s, > 0; for the first sample, since the state.
        state : RelaxationState, optional
            State before the first sample. Default: fully relaxed at the first penetration.

        Raises
        ------
        InvalidParameterError
            The arrays differ in shape, or a time step is not positive.
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
        """Dynamic stiffness K′ + iωB′ [N/m] for small oscillations about a depth.

        n xⁿ⁻¹ [K + M ∫ w iωτ/(1 + iωτ) d(ln τ)] + iω B xᵖ

        Parameters
        ----------
        depth : float or array_like
            m, > 0.
        frequency : float or array_like
            ω, rad/s, ≥ 0. An identified law is valid only in the frequency band of its recording.

        Returns
        -------
        complex or numpy.ndarray
            A complex number for scalars. Stiffness is the real part, damping the imaginary part
            over ω, tan δ the imaginary over the real part.
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
        """∂F/∂(K, n, B, p) of the relaxed material, and 0 for the parameters of its memory."""
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
                f"state must have this law's {len(self.branches()[0])} branches, not "
                f"{len(state.branches)}"
            )
        return np.array([state.elastic, *state.branches])

    def _go(self, numbers: Floats, steps: Floats, x: Floats, v: Floats) -> Floats:
        """Advance a state in place and return the force."""
        force = np.empty(x.size)
        _core.generalised_force_along(self.parameters, steps, x, v, numbers, force)
        return force
