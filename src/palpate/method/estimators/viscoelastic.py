"""A generalised Hunt–Crossley law, with a spectrum of relaxation times if there is memory."""

from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

import palpate._core as _core
from palpate._core import Status
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, RelaxationSpectrum
from palpate.method.estimators.contact_estimator import CompiledEstimator, Rejection, loop_settings
from palpate.method.estimators.estimate import Estimate
from palpate.method.estimators.law_verdicts import (
    CANDIDATES,
    DAMPINGS,
    Candidate,
    DynamicStiffness,
    Evidence,
    LawVerdict,
    judge_evidence,
)
from palpate.method.estimators.variable_projection import PROBING, positive_or_none
from palpate.method.settings import (
    SAMPLE_TIME,
    ChangeDetector,
    ContactGate,
    Forgetting,
    Scale,
)
from palpate.validation import Floats, arguments, check_choice, instance, number, number_in, shown

_DEFAULTS = _core.defaults["ViscoelasticContact"]

Damping = Literal["auto", "hunt-crossley", "half-space", "linear", "none"]
Memory = Literal["auto", "none"]


def build_law(times: Floats, numbers: Floats) -> GeneralisedHuntCrossley:
    """Return the law from relaxation times [s], and K, n, B, p and a stiffness for each time."""
    (stiffness, n, damping, p) = numbers[:4].tolist()
    stiffnesses = np.maximum(numbers[4:], 0.0)
    if not stiffnesses.any():
        return GeneralisedHuntCrossley(K=stiffness, n=n, B=damping, p=p)
    # Times whose stiffness is 0 stay: the spacing of the times sets the error of a single time.
    spectrum = RelaxationSpectrum(tuple(times), tuple(stiffnesses))
    return GeneralisedHuntCrossley(K=stiffness, n=n, B=damping, p=p, relaxation=spectrum)


def dynamic_response(law: GeneralisedHuntCrossley, depth: float, frequency: float) -> Floats:
    """K′ [N/m] and B′ [N·s/m] of a law at a depth [m] and a frequency ω [rad/s], shape (2,)."""
    response = complex(law.dynamic_stiffness(depth, frequency))
    return np.array([response.real, response.imag / frequency])


class RelaxingEstimate(Estimate):
    """An estimate of a law with a spectrum, which has more numbers than its five parameters.

    Attributes
    ----------
    spectrum : tuple
        Relaxation times, s, shape (r,); K, n, B, p and a stiffness for each time, shape (r + 4,);
        their covariance, with the offset as the last; force [N] and decay time [s] of each column
        that models an unknown start.
    """

    __slots__ = ("_spectrum",)

    def __init__(self, value: _core.EstimateValue, fixed: tuple[str, ...], spectrum: Any) -> None:
        super().__init__(value, GeneralisedHuntCrossley, fixed)
        self._spectrum = spectrum

    @property
    def spectrum(self) -> Any:
        """Relaxation times, numbers, covariance and start, computed on first access."""
        if isinstance(self._spectrum, _core.SpectrumValue):
            self._spectrum = self._spectrum.numbers()
        return self._spectrum

    @property
    def law(self) -> GeneralisedHuntCrossley:
        """The contact model, SI."""
        times, numbers, _, _ = self.spectrum
        return build_law(times, numbers)

    def start_force(self, clock: Floats) -> Floats:
        """Force of an unknown state at the start, N, at these times after the start [s]."""
        force = np.zeros_like(clock)
        for amount, time in self.spectrum[3]:
            force += amount * np.exp(-clock / time)
        return force

    def _numbers(self) -> tuple[Floats, Floats, Callable[[Floats], ForceLaw], Any]:
        times, numbers, joint, _ = self.spectrum
        plain = np.isin(np.arange(len(numbers)), (1, 3))
        return numbers, joint[:-1, :-1], lambda each: build_law(times, each), plain


class ViscoelasticContact(CompiledEstimator, _core.ViscoelasticContact):
    """A generalised Hunt–Crossley law, with a spectrum of relaxation times if there is memory.

    min over (K, n, B, mᵢ, F₀) of Σ (F − K xⁿ − B xᵖ v − Σ mᵢ gᵢ − F₀)²,  ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ,
    with K, B, mᵢ ≥ 0

    The candidates with memory have p = n, n − 1 or 0; those without have p = n, p = n − 1, or
    n = 1 with p = 0. All share one set of sums. The relaxation times τᵢ are fixed, a factor of
    about two apart, and their stiffnesses are a nonnegative least squares (Lawson & Hanson 1974).
    The law with the lowest N_eff ln(RSS/N) + 2 p ln N_eff is selected as samples arrive: Schwarz's
    criterion (BIC) with twice the penalty, and with the effective sample size N_eff for the
    residual's correlation. A law with memory must also reduce the error of the others by 5 %. The
    computation is spread over the samples; :meth:`finish_pending` completes it. See
    ``docs/explain/relaxation.md``.

    The relaxation state follows from the penetration and continues through loss of contact. If the
    samples begin in contact, the state is unknown, and two decaying forces model it.

    Parameters
    ----------
    damping : "auto", "hunt-crossley", "half-space", "linear" or "none"
        Damping form: p = n, p = n − 1, p = 0 (with memory), or none (with memory). Default:
        "auto", the best fit of the first three.
    memory : "auto" or "none"
        Whether the law may relax. Default: "auto".
    forgetting : ConstantForgetting or FadingForgetting, optional
        Forgetting of old samples, not of the relaxation state. Default: none.
    change_detector, outlier_rejection : optional
        As in :class:`VariableProjection`.
    offset : bool
        Estimate a constant force offset together with the law. Default: True.
    offset_deviation, surface_deviation : float, optional
        Standard deviation of the force offset after the tare, N, > 0, and of the surface position,
        m, > 0; as in :class:`VariableProjection`.
    exponent : float, optional
        Known n, in [0.5, 3.25], from the tip's shape. Default: estimated in that range.
    gate : ContactGate, optional
        Selects the samples in contact. The estimate uses those above 0.1 % of the unit of
        penetration.
    sample_time : float, optional
        Time between samples, s, in (0, 1e6]; a ``dt`` of ``update`` must be close to it. The
        shortest relaxation time is two sample times. Default: 1 ms; in :func:`identify` the data's.
    longest_time : float, optional
        The longest relaxation time, s, at least four sample times. Default: 4096 sample times; in
        :func:`identify` half of the recording.
    scale : Scale, optional
        Units of the arithmetic, near the largest expected values. Default: 10 mm, 20 mm/s and 1 N;
        in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range, or no law matches damping and memory.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv", palpate.ViscoelasticContact())
    >>> result.law_verdict.candidate.memory, round(result.law.n, 2)
    ('none', 1.0)
    """

    __slots__ = ("_settings",)
    method = "viscoelastic"
    estimate_type = RelaxingEstimate
    law_type = GeneralisedHuntCrossley
    chooses_law = True
    chooses_samples = True
    knows_offset = True
    exponents = _DEFAULTS["exponent_range"]

    def __init__(
        self,
        *,
        damping: Damping = "auto",
        memory: Memory = "auto",
        forgetting: Forgetting | None = None,
        change_detector: ChangeDetector | None = None,
        outlier_rejection: Rejection = None,
        offset: bool = _DEFAULTS["offset"],
        offset_deviation: float | None = None,
        surface_deviation: float | None = None,
        exponent: float | None = None,
        gate: ContactGate | None = None,
        sample_time: float | None = None,
        longest_time: float | None = None,
        scale: Scale | None = None,
    ) -> None:
        instance("offset", offset, bool)
        self._settings: dict[str, Any] = arguments(locals())
        low, high = self.exponents
        times = 4.0 * number("sample_time", self._step), 1e12
        super().__init__(
            _candidate_bits(damping, memory),
            0.0 if exponent is None else number_in("exponent", exponent, low, high),
            offset,
            positive_or_none("offset_deviation", offset_deviation),
            positive_or_none("surface_deviation", surface_deviation),
            0.0 if longest_time is None else number_in("longest_time", longest_time, *times),
            loop_settings({**self._settings, "sample_time": self._step}, PROBING),
        )

    def _name(self, estimate: Any) -> None:
        super()._name(estimate)
        estimate._spectrum = self._spectrum()

    @property
    def offered(self) -> tuple[Candidate, ...]:
        """The laws that compete."""
        return self.evidence().laws

    @property
    def candidate(self) -> Candidate | None:
        """The selected law; None before the first verdict and after a detected change.

        It takes less than a microsecond, so it can be read after every sample.
        """
        rows, *_, chosen, _, _, _, _ = self._evidence()
        return CANDIDATES[chosen] if rows else None

    def evidence(self) -> Evidence:
        """Return the numbers of a verdict, in some microseconds, for use in another process."""
        offered = _candidate_bits(self._settings["damping"], self._settings["memory"])
        longest = float(self._spectrum().numbers()[3][-1][1])
        return Evidence(*self._evidence(), offered, longest)

    def pack_verdict(self, *, with_estimate: bool = True) -> dict[str, Any]:
        """Return the numbers of a verdict and an estimate as JSON types, for another process.

        :func:`unpack_verdict` reads them. The estimate has some 350 numbers: as decimal digits they
        would take ten times as long.
        """
        packed: dict[str, Any] = {"evidence": self.evidence()}
        if not with_estimate:
            return packed | dict.fromkeys(("fixed", "covariance", "spectrum"))
        estimate: Any = self.estimate()
        packed |= {"fixed": estimate.fixed, "covariance": _pack_numbers(estimate.covariance)}
        return packed | {"spectrum": [*map(_pack_numbers, estimate.spectrum[:3])]}

    def verdict(self) -> LawVerdict:
        """Return the selected law, with the evidence for all competing laws."""
        return judge_evidence(self.evidence(), self.estimate())

    def dynamic_stiffness(
        self,
        depth: float | None = None,
        frequency: float | None = None,
    ) -> DynamicStiffness:
        """Return stiffness and damping for small oscillations, with standard errors.

        The standard errors come from the selected law's covariance by the delta method. They are
        statistical: the systematic parts are those of an identification's ``dynamic_stiffness``.

        Parameters
        ----------
        depth : float, optional
            m, > 0. Default: the motion's mean depth.
        frequency : float, optional
            rad/s. Default: the motion's mean frequency.

        Raises
        ------
        InvalidParameterError
            The frequency is outside half to twice the motion's mean frequency, where the samples
            carry no information; or there is no verdict on this material yet.
        """
        verdict = self.verdict()
        estimate = self.estimate()
        low, high = verdict.band
        # Without a verdict the law is the initial one, or the one before a change.
        if not (verdict.model_ranking and high > 0.0 and verdict.depth > 0.0):
            raise InvalidParameterError("the motion's frequency is unknown: take more samples")
        omega = verdict.frequency if frequency is None else number("frequency", frequency)
        if not low <= omega <= high:
            raise InvalidParameterError(
                f"frequency must be in the band of the motion, {low:.3g} to {high:.3g} rad/s, not "
                f"{shown(frequency)}: the samples carry no information outside of it"
            )
        x = verdict.depth if depth is None else number_in("depth", depth, 0.0, 1e100, open_low=True)

        values, errors = estimate.with_errors(lambda law: dynamic_response(law, x, omega).tolist())
        stiffness, damping = zip(values.tolist(), errors.tolist(), strict=True)
        return DynamicStiffness(x, omega, *stiffness, *damping)

    @property
    def _step(self) -> float:
        given = self._settings["sample_time"]
        return SAMPLE_TIME if given is None else given


def _pack_numbers(values: Floats) -> str:
    return b64encode(values.tobytes()).decode()


def unpack_verdict(packed: Mapping[str, Any]) -> tuple[LawVerdict, Estimate]:
    """Return verdict and estimate from :meth:`ViscoelasticContact.pack_verdict`.

    Without an estimate the law is one of zero force.
    """
    if packed["spectrum"] is None:
        law = GeneralisedHuntCrossley(K=0.0, n=1.0, B=0.0, p=1.0)
        covariance = np.zeros((law.parameters.size,) * 2)
        estimate = Estimate.from_law(law, covariance, status=Status.WAITING, samples=0)
    else:
        arrays = (packed["covariance"], *packed["spectrum"])
        covariance, times, numbers, joint = (np.frombuffer(b64decode(each)) for each in arrays)
        law = build_law(times, numbers)
        value = Estimate.from_law(law, covariance, status=Status.UPDATED, samples=1)
        spectrum: Any = times, numbers, joint.reshape(len(numbers) + 1, -1), []
        estimate = RelaxingEstimate(value, tuple(packed["fixed"]), spectrum)
    return judge_evidence(Evidence(*packed["evidence"]), estimate), estimate


def _candidate_bits(damping: str, memory: str) -> int:
    """The candidates that compete, one bit each."""
    check_choice("damping", damping, ("auto", *DAMPINGS))
    check_choice("memory", memory, ("auto", "none"))
    bits = 0
    for index, law in enumerate(CANDIDATES):
        offered = law.damping != "none" if damping == "auto" else damping == law.damping
        if offered and memory in ("auto", law.memory):
            bits |= 1 << index
    if not bits:
        raise InvalidParameterError(
            f"no law has damping={damping!r} and memory={memory!r}: change one of them"
        )
    return bits
