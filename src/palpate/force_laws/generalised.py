"""Generalised Hunt–Crossley laws: a separate damping exponent, and optional memory."""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, ClassVar, Self, overload

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.digits import format_time, with_error
from palpate.errors import InvalidParameterError
from palpate.force_laws.laws import (
    CompiledLaw,
    Floats,
    ForceLaw,
    HuntCrossley,
    KelvinVoigt,
    names_of_fields,
    register,
)
from palpate.force_laws.relaxation import (
    FORMULA,
    LISTS,
    LONGEST,
    Relaxation,
    RelaxationSpectrum,
    RelaxationState,
    SingleRelaxation,
    relaxation_from,
)
from palpate.validation import (
    all_good,
    broadcast_contact,
    frozen,
    instance,
    number,
    number_in,
    signals,
    together,
)


@register
@frozen(kw_only=True)
class GeneralisedHuntCrossley(CompiledLaw):
    """A spring that stiffens with depth, a damper, and a part of the spring that relaxes.

    F = K xⁿ + B xᵖ v + Σ mᵢ gᵢ  for x > 0, else 0;   ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ,   Σ mᵢ = M

    With p = n it is the law of Hunt & Crossley (1975); with p = n − 1 the law of a sphere, a cone
    or a punch on a Kelvin–Voigt half-space, whose damper acts on the area of contact (Radok 1957,
    Lee & Radok 1960); with n = 1, p = 0 the law of Kelvin & Voigt. The relaxing part is Boltzmann's
    superposition of xⁿ, quasi-linear viscoelasticity (Fung 1981). Out of contact xⁿ counts as 0,
    and relaxation continues.

    Parameters
    ----------
    K : float
        N/mⁿ, of the fully relaxed material.
    n : float
        n; 1.5 for a Hertzian sphere, 2 for a cone, 1 for a punch.
    B : float
        N·s/mᵖ⁺¹.
    p : float
        p.
    M : float
        N/mⁿ: instantaneous stiffness minus relaxed stiffness. Default: 0, or the sum of the
        stiffnesses of a RelaxationSpectrum.
    relaxation : RelaxationSpectrum, FlatSpectrum, SingleRelaxation or PowerLawRelaxation, optional
        Kind of relaxation; required if M is not 0. Default: none, and no memory.

    Raises
    ------
    InvalidParameterError
        A parameter is not finite, there is a relaxation stiffness without ``relaxation``, or it is
        not the sum of the stiffnesses of a RelaxationSpectrum to 1e-9.

    Examples
    --------
    >>> import palpate
    >>> memory = palpate.SingleRelaxation(time=0.5)
    >>> law = palpate.GeneralisedHuntCrossley(
    ...     K=800.0, n=1.0, B=5.0, p=0.0, M=200.0, relaxation=memory
    ... )
    >>> law.force(0.01, 0.1)  # N, relaxed
    8.5
    >>> law.relaxation_time  # s
    0.5
    """

    K: float
    n: float
    B: float
    p: float
    M: float = 0.0
    relaxation: Relaxation | None = None
    kind: ClassVar[str] = "generalised-hunt-crossley"
    units: ClassVar[tuple[str, ...]] = ("N/mⁿ", "", "N·s/mᵖ⁺¹", "", "N/mⁿ")
    symbols: ClassVar[tuple[str, ...]] = ("K", "n", "B", "p", "M")
    optional: ClassVar[tuple[str, ...]] = ("M", *FORMULA, *LISTS)
    relaxes: ClassVar[bool] = True
    _compiled: ClassVar[Callable[..., None]] = _core.generalised_hunt_crossley_force

    def __post_init__(self) -> None:
        ForceLaw.__post_init__(self)
        instance("relaxation", self.relaxation, (Relaxation, type(None)))
        relaxing = self.M
        if isinstance(self.relaxation, RelaxationSpectrum):
            whole = self.relaxation.stiffness
            if relaxing and not abs(relaxing - whole) <= 1e-9 * whole:
                raise InvalidParameterError(
                    f"M must be the sum of the relaxation's stiffnesses, "
                    f"{whole:g}, or omitted, not {relaxing:g}"
                )
            object.__setattr__(self, "M", whole)
        elif self.relaxation is None and relaxing != 0.0:
            raise InvalidParameterError(
                "relaxation must be a RelaxationSpectrum, FlatSpectrum, SingleRelaxation or "
                f"PowerLawRelaxation, as M is {relaxing!r}"
            )

    @classmethod
    def of(cls, law: ForceLaw) -> "GeneralisedHuntCrossley":
        """Return a law as an equivalent generalised Hunt–Crossley law.

        Parameters
        ----------
        law : ForceLaw
            The law; p becomes 0 for a linear damper, and n for a Hunt–Crossley damper.

        Raises
        ------
        InvalidParameterError
            No equivalent exists: for an extended Kelvin–Voigt law with K₁ and K₂, or your own law.
        """
        if law.powers is None:
            raise InvalidParameterError(
                f"the spring of law must be a single power of depth; it is {law!r}"
            )
        names = (each.name for each in fields(GeneralisedHuntCrossley))
        return GeneralisedHuntCrossley(**dict(zip(names, law.powers, strict=False)))

    def simplest(self) -> "KelvinVoigt | HuntCrossley | GeneralisedHuntCrossley":
        """Return the equivalent Kelvin–Voigt or Hunt–Crossley law, if there is one.

        With memory or another damper it is the law itself. Without damping p is irrelevant.
        """
        if self.remembers:
            return self
        undamped = self.B == 0.0
        if self.n == 1.0 and (undamped or self.p == 0.0):
            return KelvinVoigt(K=self.K, B=self.B)
        if undamped or self.p == self.n:
            return HuntCrossley(K=self.K, B=self.B, n=self.n)
        return self

    @classmethod
    def names(cls) -> list[str]:
        """Return the names of its five parameters, in their order."""
        names = names_of_fields(cls)
        return [name for name in names if name != "relaxation"]

    def with_parameters(self, parameters: "ArrayLike") -> "GeneralisedHuntCrossley":
        """Return the law with other parameters and the same relaxation; M scales a spectrum.

        Raises
        ------
        InvalidParameterError
            A parameter is outside its range, or M is not 0 for a law without relaxation.
        """
        numbers = np.asarray(parameters, dtype=np.float64).tolist()
        relaxation = self.relaxation
        if isinstance(relaxation, RelaxationSpectrum):
            relaxation = relaxation.scaled(numbers[-1])
        coefficients = dict(zip(self.names(), numbers, strict=True))
        return GeneralisedHuntCrossley(**coefficients, relaxation=relaxation)

    @classmethod
    def from_dict(cls, numbers: dict[str, Any]) -> Self:
        """Return the law from a :meth:`description` without its kind."""
        own = {name: numbers[name] for name in cls.names() if name in numbers}
        relaxation = relaxation_from({name: numbers.get(name) for name in (*FORMULA, *LISTS)})
        if relaxation is None and own.get("M", 0.0) != 0.0:
            raise InvalidParameterError(
                "longest_time must be above 0 if M is not 0: pass it alone for "
                "one relaxation time, or with shortest_time for a spectrum"
            )
        return cls(**own, relaxation=relaxation)

    def description(self) -> dict[str, Any]:
        """Return kind, parameters, and the relaxation if there is one, as JSON types, SI."""
        relaxation = {} if self.relaxation is None else self.relaxation.description()
        return {**ForceLaw.description(self), **relaxation}

    @property
    def remembers(self) -> bool:
        """Whether the law has memory."""
        return self.relaxation is not None and self.M != 0.0

    @property
    def relaxation_time(self) -> float | None:
        """The relaxation time, s; None for a law without one or with several."""
        relaxation = self.relaxation if self.remembers else None
        if isinstance(relaxation, SingleRelaxation | RelaxationSpectrum):
            return relaxation.time
        return None

    def force_in_order(self) -> Callable[[float, float, float], float]:
        """Return a function for the force [N] of one sample after another, relaxed at the first.

        It takes time [s], penetration [m] and velocity [m/s]. Its arrays are allocated once, so a
        call takes a twentieth of the time of :meth:`step` and :meth:`force`.
        """
        elastic = self.parameters[:4]
        (times, weights) = self.branches()
        stiffnesses = self.M * weights
        last = math.nan
        state = np.empty(0)
        step, depth, speed, force = (np.zeros(1) for _ in range(4))

        def sample_force(time: float, penetration: float, velocity: float) -> float:
            nonlocal last, state
            if not state.size:
                rested = self.rest(penetration)
                last = time
                state = np.array([rested.elastic, *rested.branches])
            step[0] = max(time - last, 0.0)
            depth[0] = penetration
            speed[0] = velocity
            last = time
            _core.generalised_force_along(
                elastic,
                times,
                stiffnesses,
                step,
                depth,
                speed,
                state,
                force,
            )
            return float(force[0])

        return sample_force

    def describe_relaxation(self) -> str:
        """Return the relaxation time of a law with memory, or the range of its times, as text."""
        assert self.relaxation is not None
        if (time := self.relaxation_time) is not None:
            return with_error(time, time * self.relaxation.resolution, unit="s")
        times, stiffnesses = self.branches()
        ends = times[stiffnesses > 0.0][[0, -1]].tolist()
        return f"several relaxation times, {' to '.join(map(format_time, ends))}"

    @property
    def powers(self) -> tuple[Any, ...] | None:
        """Its own numbers."""
        return tuple(getattr(self, each.name) for each in fields(self))

    def relaxed(self) -> "GeneralisedHuntCrossley":
        """Return the law of the fully relaxed material: stiffness K, without memory."""
        return replace(self, M=0.0, relaxation=None)

    def instantaneous(self) -> "GeneralisedHuntCrossley":
        """Return the law before any relaxation: stiffness K + M, without memory."""
        whole = self.K + self.M
        return replace(self, K=whole, M=0.0, relaxation=None)

    def branches(self) -> tuple[Floats, Floats]:
        """Relaxation times [s] of the branches, and weights with the sum 1; none without memory.

        A RelaxationSpectrum has them; another relaxation is approximated by two branches per
        factor of two in time.
        """
        if self.relaxation is None or not self.remembers:
            return np.empty(0), np.empty(0)
        return self.relaxation.branches()

    def rest(self, penetration: float = 0.0) -> RelaxationState:
        """Return the fully relaxed state at a penetration [m]."""
        depth = number("penetration", penetration)
        elastic = depth**self.n if depth > 0.0 else 0.0
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
        numbers = self._flatten_state(state)
        depth = np.array([number("penetration", penetration)])
        steps = np.array([number_in("dt", dt, 0.0, LONGEST, open_low=True)])
        self._advance(numbers, steps, depth, np.zeros(1))
        return RelaxationState(float(numbers[0]), tuple(numbers[1:].tolist()))

    @overload
    def force(
        self,
        penetration: float,
        velocity: float,
        state: RelaxationState | None = None,
    ) -> float: ...
    @overload
    def force(
        self,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        state: RelaxationState | None = None,
    ) -> Floats: ...
    def force(
        self,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        state: RelaxationState | None = None,
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
        memory = self.M * float(weights @ self._flatten_state(state)[1:])
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
        return self._advance(self._flatten_state(begun), steps, x, v)

    def dynamic_stiffness(self, depth: "ArrayLike", frequency: "ArrayLike") -> Any:
        """Dynamic stiffness K′ + iωB′ [N/m] for small oscillations about a depth.

        n xⁿ⁻¹ [K + Σ mᵢ iωτᵢ/(1 + iωτᵢ)] + iω B xᵖ

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
        x, omega = together(depth=broadcast_contact(depth)[0], frequency=frequency)
        all_good("frequency", omega, (omega >= 0.0) & np.isfinite(omega), "finite and ≥ 0")
        times, weights = self.branches()
        phase = 1j * omega[..., None] * times
        memory = self.M * (weights * phase / (1.0 + phase)).sum(axis=-1)
        slope = self.n * x ** (self.n - 1.0)
        whole = slope * (self.K + memory)
        whole = whole + 1j * omega * self.B * x**self.p
        return whole if whole.ndim else complex(whole)

    def stiffness_after(self, depth: "ArrayLike", time: "ArrayLike") -> Any:
        """Stiffness [N/m] a time after a small step of the penetration.

        n xⁿ⁻¹ [K + Σ mᵢ exp(−t/τᵢ)], the relaxation function of a generalised Maxwell material.

        Parameters
        ----------
        depth : float or array_like
            m, > 0.
        time : float or array_like
            t, s, ≥ 0. An identified law is valid only for the times that its recording shows.
        """
        x, after = together(depth=broadcast_contact(depth)[0], time=time)
        all_good("time", after, (after >= 0.0) & np.isfinite(after), "finite and ≥ 0")
        times, weights = self.branches()
        left = (weights * np.exp(-after[..., None] / times)).sum(axis=-1)
        whole = self.n * x ** (self.n - 1.0) * (self.K + self.M * left)
        return whole if whole.ndim else float(whole)

    def parameter_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂(K, n, B, p) of the relaxed material, and 0 for M."""
        elastic = penetration**self.n
        damper = penetration**self.p * velocity
        depth = np.log(penetration)
        spring = elastic, self.K * elastic * depth
        return np.column_stack([*spring, damper, self.B * damper * depth, np.zeros_like(elastic)])

    def penetration_gradient(self, penetration: Floats, velocity: Floats) -> Floats:
        """∂F/∂x = n K xⁿ⁻¹ + p B xᵖ⁻¹ v of the relaxed material."""
        elastic = self.n * self.K * penetration ** (self.n - 1.0)
        damper = self.B * velocity * penetration ** (self.p - 1.0)
        slope: Floats = elastic + self.p * damper
        return slope

    def velocity_gradient(self, penetration: Floats) -> Floats:
        """∂F/∂v = B xᵖ."""
        slope: Floats = self.B * penetration**self.p
        return slope

    def _flatten_state(self, state: RelaxationState) -> Floats:
        instance("state", state, RelaxationState)
        if len(state.branches) != len(self.branches()[0]):
            raise InvalidParameterError(
                f"state must have this law's {len(self.branches()[0])} branches, not "
                f"{len(state.branches)}"
            )
        return np.array([state.elastic, *state.branches])

    def _advance(self, numbers: Floats, steps: Floats, x: Floats, v: Floats) -> Floats:
        """Advance a state in place and return the force."""
        force = np.empty(x.size)
        times, weights = self.branches()
        stiffnesses = self.M * weights
        own = self.parameters[:4]
        _core.generalised_force_along(own, times, stiffnesses, steps, x, v, numbers, force)
        return force
