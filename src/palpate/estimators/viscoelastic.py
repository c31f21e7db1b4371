"""Laws whose damper has an exponent of its own, and that may remember; and which of them it is."""

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
    """Generalised Hunt–Crossley laws, with memory and without, and which of them it is.

    min over (K, n, B, M, F₀, τ or α) of Σ (F − K xⁿ − B xᵖ v − M Σ wᵢ gᵢ − F₀)²,
    ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ

    for each law that is offered: p = n or n − 1; without memory, or with a flat spectrum, one
    relaxation time or a power law. One set of sums serves them all, and the least
    N_eff ln(RSS/N) + 2 p ln N_eff wins, as the samples come: Schwarz's criterion with twice the
    penalty, N_eff the samples that noise of the residual's correlation leaves of N. Verdict and
    estimate are worked out a little at every sample: a verdict when there are an eighth more
    samples, the estimate when there are a 32nd more, and both at once by :meth:`finish_pending`.
    ``docs/viscoelastic.md`` says the rest.

    What the material remembers is what the penetration made it: it is carried through loss of
    contact. Where samples begin in contact, nobody saw what it remembers: what the first half
    second says is without memory and flagged, and then given up.

    Parameters
    ----------
    damping : "auto", "hunt-crossley", "half-space" or "none"
        The damper: p = n, p = n − 1, or none, which takes a memory. "auto": as the samples say.
    memory : "auto", "none", "flat", "single", "power-law" or "any"
        The relaxation. "auto": none, or a flat spectrum of six relaxation times from two to 2048
        sample times. "any": whichever of all that there are. A kind that is named is taken for
        granted: the law has it, whatever the samples say. "any", "single" and "power-law" keep
        twelve times and all their products, which takes several times as long a sample.
    forgetting : ConstantForgetting or FadingForgetting, optional
        None forgets nothing. What the material remembers is not forgotten.
    change_detector, outlier_rejection
        As in :class:`VariableProjection`.
    offset : bool
        Estimate a constant force offset beside the law.
    offset_deviation, surface_deviation : float, optional
        What a tare left of that offset, N, > 0, and how well the position of the surface is known,
        m, > 0; as in :class:`VariableProjection`.
    exponent : float, optional
        n, in [0.5, 3.25], where the shape of the tip tells it; None: it is looked for there.
    gate : ContactGate, optional
        Which samples are contact. Those above 0.1 % of the unit of penetration inform the estimate.
    sample_time : float, optional
        Time between samples where ``update`` is given none, s, in (0, 1e6], and nearly that where
        it is: relaxation times are looked for from two of them on. None: 1 ms, and in
        :func:`identify` that of the data.
    scale : Scale, optional
        Units of the arithmetic, near the largest values to come. None: 10 mm, 20 mm/s and 1 N, and
        in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range, or no law is left.
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
        """The law in force; None before the first verdict, and until the next after a change.

        It costs less than a microsecond, and so may be asked for after every sample.
        """
        rows, *_, chosen, _, _, _, _ = self._evidence()
        return CANDIDATES[chosen] if rows else None

    def evidence(self) -> Evidence:
        """Return what a verdict is worked out from, in some microseconds: for another process."""
        offered = _offered(self._settings["damping"], self._settings["memory"])
        gate = self._settings["gate"] or ContactGate()
        shallowest = None if gate.make_force else gate.minimum_penetration
        return Evidence(*self._evidence(), offered, float(self._step), shallowest)

    def verdict(self) -> LawVerdict:
        """Return which law it is, with the evidence of all that were offered."""
        return verdict_of(self.evidence(), self.estimate())

    def dynamic_stiffness(
        self, depth: float | None = None, frequency: float | None = None
    ) -> DynamicStiffness:
        """Return stiffness and damping that a small oscillation feels, with standard errors.

        By the delta method from the covariance of the law that was chosen; that another law might
        have been is not in them.

        Parameters
        ----------
        depth : float, optional
            m, > 0; the motion's mean depth unless given.
        frequency : float, optional
            rad/s; the motion's own unless given.

        Raises
        ------
        InvalidParameterError
            The frequency is outside the band of the motion, half to twice its own: what happens
            there its samples do not say. Or there is no verdict on
            this material yet.
        """
        verdict, estimate = self.verdict(), self.estimate()
        low, high = verdict.band
        # Without a verdict the law is where it starts, or of a motion of before a change.
        if not (verdict.model_ranking and high > 0.0 and verdict.depth > 0.0):
            raise InvalidParameterError("frequency must be one of the motion: none is known yet")
        omega = verdict.frequency if frequency is None else number("frequency", frequency)
        if not low <= omega <= high:
            raise InvalidParameterError(
                f"frequency must be in the band of the motion, {low:.3g} to {high:.3g} rad/s, not "
                f"{shown(frequency)}: a law says nothing of what its samples did not contain"
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
            f"damping and memory must leave a law: there is none with damping={damping!r} and "
            f"memory={memory!r}"
        )
    return bits
