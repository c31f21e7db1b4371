"""Generalised Hunt–Crossley laws, with and without memory, and the selection among them."""

from typing import Any, Literal

import palpate._core as _core
from palpate.errors import InvalidParameterError, OldName
from palpate.estimators.contact_estimator import CompiledEstimator, Rejection, loop_settings
from palpate.estimators.law_verdicts import (
    CANDIDATES,
    DAMPINGS,
    EVERYDAY,
    MEMORIES,
    Candidate,
    DynamicStiffness,
    Evidence,
    LawVerdict,
    verdict_of,
)
from palpate.estimators.variable_projection import PROBING, positive_or_none
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.settings import (
    SAMPLE_TIME,
    ChangeDetector,
    ContactGate,
    Forgetting,
    Scale,
)
from palpate.validation import arguments, instance, number, number_in, one_of, shown

_DEFAULTS = _core.defaults["ViscoelasticContact"]

Damping = Literal["auto", "hunt-crossley", "half-space", "none"]
Memory = Literal["auto", "any", "none", "flat", "single", "power-law"]


class ViscoelasticContact(CompiledEstimator, _core.ViscoelasticContact):
    """Generalised Hunt–Crossley laws, with and without memory, and the selection among them.

    min over (K, n, B, M, F₀, τ or α) of Σ (F − K xⁿ − B xᵖ v − M Σ wᵢ gᵢ − F₀)²,
    ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ

    for each competing law: p = n or n − 1; no memory, or a flat relaxation spectrum, one relaxation
    time or a power law. All laws share one set of sums. The law with the least
    N_eff ln(RSS/N) + 2 p ln N_eff is selected as samples arrive: Schwarz's criterion (BIC) with
    twice the penalty, N_eff the effective sample size for the residual's correlation. The work is
    spread over the samples: a new verdict after an eighth more samples, a new estimate after 1/32
    more, and both immediately by :meth:`finish_pending`. See ``docs/viscoelastic.md``.

    The relaxation state follows from the penetration and continues through loss of contact. If the
    samples begin in contact, the state is unknown: for half a second the estimate has no memory and
    a flag, and is then discarded.

    Parameters
    ----------
    damping : "auto", "hunt-crossley", "half-space" or "none"
        Damping form: p = n, p = n − 1, or none (needs a memory). Default: "auto", the best fit.
    memory : "auto", "none", "flat", "single", "power-law" or "any"
        Kind of relaxation. Default: "auto", the better of none and a flat spectrum of six
        relaxation times from two to 2048 sample times. "any": the best of all kinds. The law has a
        named kind whatever the samples show. "any", "single" and "power-law" keep twelve times and
        all their products, and take several times as long per sample.
    forgetting : ConstantForgetting or FadingForgetting, optional
        Forgetting of old samples, not of the relaxation state. Default: none.
    change_detector, outlier_rejection
        As in :class:`VariableProjection`.
    offset : bool
        Estimate a constant force offset together with the law. Default: True.
    offset_deviation, surface_deviation : float, optional
        Standard deviation of the force offset after the tare, N, > 0, and of the surface position,
        m, > 0; as in :class:`VariableProjection`.
    exponent : float, optional
        Known n, in [0.5, 3.25], from the tip's shape. Default: estimated in that range.
    gate : ContactGate, optional
        Which samples are contact. The estimate uses those above 0.1 % of the unit of penetration.
    sample_time : float, optional
        Time between samples, s, in (0, 1e6]; a ``dt`` of ``update`` must be close to it. The
        shortest relaxation time is two sample times. Default: 1 ms; in :func:`identify` the data's.
    scale : Scale, optional
        Units of the arithmetic, near the largest expected values. Default: 10 mm, 20 mm/s and 1 N;
        in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range, or no law matches damping and memory.
    """

    __slots__ = ("_settings",)
    method = "viscoelastic"
    law_type = GeneralisedHuntCrossley
    chooses_law = True
    knows_offset = True
    exponents = _DEFAULTS["exponent_range"]
    settle = OldName("finish_pending")

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
        scale: Scale | None = None,
    ) -> None:
        instance("offset", offset, bool)
        self._settings: dict[str, Any] = arguments(locals())
        low, high = self.exponents
        super().__init__(
            _offered(damping, memory),
            0.0 if exponent is None else number_in("exponent", exponent, low, high),
            offset,
            positive_or_none("offset_deviation", offset_deviation),
            positive_or_none("surface_deviation", surface_deviation),
            loop_settings({**self._settings, "sample_time": self._step}, PROBING),
        )

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
        offered = _offered(self._settings["damping"], self._settings["memory"])
        gate = self._settings["gate"] or ContactGate()
        shallowest = None if gate.make_force else gate.minimum_penetration
        return Evidence(*self._evidence(), offered, float(self._step), shallowest)

    def verdict(self) -> LawVerdict:
        """Return the selected law, with the evidence for all competing laws."""
        return verdict_of(self.evidence(), self.estimate())

    def dynamic_stiffness(
        self, depth: float | None = None, frequency: float | None = None
    ) -> DynamicStiffness:
        """Return stiffness and damping for small oscillations, with standard errors.

        The standard errors come from the selected law's covariance by the delta method; they do not
        include the uncertainty of the selection.

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
        verdict, estimate = self.verdict(), self.estimate()
        low, high = verdict.band
        # Without a verdict the law is its initial value, or that of before a change.
        if not (verdict.model_ranking and high > 0.0 and verdict.depth > 0.0):
            raise InvalidParameterError("the motion's frequency is unknown: take more samples")
        omega = verdict.frequency if frequency is None else number("frequency", frequency)
        if not low <= omega <= high:
            raise InvalidParameterError(
                f"frequency must be in the band of the motion, {low:.3g} to {high:.3g} rad/s, not "
                f"{shown(frequency)}: the samples carry no information outside of it"
            )
        x = verdict.depth if depth is None else number_in("depth", depth, 0.0, 1e100, open_low=True)

        def felt(law: GeneralisedHuntCrossley) -> tuple[float, float]:
            whole = law.dynamic_stiffness(x, omega)
            return whole.real, whole.imag / omega

        (stiffness, damping), errors = estimate.with_errors(felt)
        return DynamicStiffness(
            x, omega, float(stiffness), float(errors[0]), float(damping), float(errors[1])
        )

    @property
    def _step(self) -> float:
        given = self._settings["sample_time"]
        return SAMPLE_TIME if given is None else given


def _offered(damping: str, memory: str) -> int:
    """Which candidates compete, a bit each."""
    one_of("damping", damping, ("auto", *DAMPINGS))
    one_of("memory", memory, ("auto", "any", *MEMORIES))
    bits = 0
    for index, law in enumerate(CANDIDATES):
        known = index < EVERYDAY if memory == "auto" else memory in ("any", law.memory)
        if known and damping in ("auto", law.damping):
            bits |= 1 << index
    if not bits:
        raise InvalidParameterError(
            f"no law has damping={damping!r} and memory={memory!r}: change one of them"
        )
    return bits
