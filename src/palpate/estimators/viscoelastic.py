"""Laws whose damper has an exponent of its own, and that may remember; and which of them it is."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.estimators.contact_estimator import CompiledEstimator
from palpate.estimators.loop_settings import Rejection, loop_settings
from palpate.estimators.registry import register
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.settings import (
    SAMPLE_TIME,
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    FadingForgetting,
    Forgetting,
    Scale,
)
from palpate.validation import instance, number_in, shown

_DEFAULTS = _core.defaults["ViscoelasticContact"]
_PROBING = Scale(*_DEFAULTS["scale"])

Damping = Literal["auto", "hunt-crossley", "half-space", "none"]
Memory = Literal["auto", "any", "none", "flat", "single", "power-law"]

# By the values of the compiled enumerations.
_DAMPINGS = ("none", "hunt-crossley", "half-space")
_MEMORIES = ("none", "flat", "single", "power-law")


@dataclass(frozen=True, slots=True)
class Candidate:
    """A law that may be offered.

    Attributes
    ----------
    damping : "none", "hunt-crossley" or "half-space"
        Whether there is a damper, and its exponent: p = n, or p = n − 1.
    memory : "none", "flat", "single" or "power-law"
        How the material relaxes.
    linear : bool
        Whether n is 1: with p = n − 1 the Kelvin–Voigt law.
    """

    damping: str
    memory: str
    linear: bool = False

    def __str__(self) -> str:
        law = {
            "none": "spring",
            "hunt-crossley": "Hunt–Crossley",
            "half-space": "Kelvin–Voigt" if self.linear else "half-space",
        }[self.damping]
        memories = {
            "none": "",
            "flat": " with a flat spectrum",
            "single": " with one relaxation time",
            "power-law": " with power-law relaxation",
        }
        return law + memories[self.memory]


#: Every law that can be offered; the first five are told apart by the everyday bank.
CANDIDATES: tuple[Candidate, ...] = tuple(
    Candidate(_DAMPINGS[damping], _MEMORIES[memory], linear)
    for damping, memory, linear in _DEFAULTS["candidates"]
)
_EVERYDAY = 5


@dataclass(frozen=True, slots=True)
class Standing:
    """How a law that was offered stood at the last verdict.

    Attributes
    ----------
    candidate : Candidate
        The law.
    score : float
        N_eff ln(RSS/N) + 2 p ln N_eff, less that of the law that was chosen: from 0 on, the more
        the worse. Ten are strong evidence.
    rms_error : float
        Root of RSS/N, N.
    """

    candidate: Candidate
    score: float
    rms_error: float


@dataclass(frozen=True, slots=True)
class LawVerdict:
    """Which law it is, and by what.

    Attributes
    ----------
    candidate : Candidate
        The law that was chosen.
    standings : tuple of Standing
        Of the laws that were offered, the best first; empty before the first verdict.
    samples : float
        Samples that the evidence is of, less what was forgotten.
    effective_samples : float
        N_eff: so many samples of white noise would say as much.
    frequency : float
        Of the motion, rad/s: root mean square speed over that of the way from its middle.
    """

    candidate: Candidate
    standings: tuple[Standing, ...]
    samples: float
    effective_samples: float
    frequency: float


@register
class ViscoelasticContact(CompiledEstimator, _core.ViscoelasticContact):
    """Generalised Hunt–Crossley laws, with memory and without, and which of them it is.

    min over (K, n, B, M, F₀, τ or α) of Σ (F − K xⁿ − B xᵖ v − M Σ wᵢ gᵢ − F₀)²,
    ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ

    for each law that is offered: p = n or n − 1; without memory, or with a flat spectrum, one
    relaxation time or a power law. One set of sums serves them all, and the least
    N_eff ln(RSS/N) + 2 p ln N_eff wins, as the samples come: Schwarz's criterion with twice the
    penalty, N_eff the samples that noise of the residual's correlation leaves of N. Verdict and
    estimate are worked out a little at every sample: a verdict when there are an eighth more
    samples, the estimate when there are a 32nd more, and both at once by :meth:`settle`. ``docs/viscoelastic.md`` says the rest.

    What the material remembers is what the penetration made it: it is carried through loss of
    contact. Where samples begin in contact, nobody saw what it remembers: what the first half
    second says is without memory and flagged, and then given up.

    Parameters
    ----------
    damping : "auto", "hunt-crossley", "half-space" or "none"
        The damper: p = n, p = n − 1, or none, which takes a memory. "auto": as the samples say.
    memory : "auto", "none", "flat", "single", "power-law" or "any"
        The relaxation. "auto": none, or a flat spectrum of six times from one to 4096 sample times.
        "any": whichever of all. "any", "single" and "power-law" keep twelve times and all
        their products, which takes several times as long a sample. A kind
        that is named is taken for granted: the law has it, whatever the samples say.
    forgetting : ConstantForgetting or FadingForgetting, optional
        None forgets nothing. What the material remembers is not forgotten.
    change_detector, outlier_rejection
        As in :class:`VariableProjection`.
    offset : bool
        Estimate a constant force offset beside the law.
    offset_deviation : float, optional
        What a tare left of that offset, N, > 0; as in :class:`VariableProjection`.
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
        exponent: float | None = None,
        gate: ContactGate | None = None,
        sample_time: float | None = None,
        scale: Scale | None = None,
    ) -> None:
        instance("forgetting", forgetting, (ConstantForgetting, FadingForgetting, type(None)))
        instance("offset", offset, bool)
        self._settings: dict[str, Any] = {
            "damping": damping,
            "memory": memory,
            "forgetting": forgetting,
            "change_detector": change_detector,
            "outlier_rejection": outlier_rejection,
            "offset": offset,
            "offset_deviation": offset_deviation,
            "exponent": exponent,
            "gate": gate,
            "sample_time": sample_time,
            "scale": scale,
        }
        low, high = _DEFAULTS["exponent_range"]
        super().__init__(
            _offered(damping, memory),
            0.0 if exponent is None else number_in("exponent", exponent, low, high),
            offset,
            0.0
            if offset_deviation is None
            else number_in("offset_deviation", offset_deviation, 0.0, 1e30, open_low=True),
            (forgetting or ConstantForgetting())._plain(),
            *loop_settings(
                change_detector,
                outlier_rejection,
                gate,
                scale,
                SAMPLE_TIME if sample_time is None else sample_time,
                default_scale=_PROBING,
            ),
        )

    def verdict(self) -> LawVerdict:
        """Return which law it is, with the evidence of all that were offered."""
        rows, samples, effective, chosen, frequency = self._evidence()
        ranked = sorted(rows, key=lambda row: row[1])
        least = ranked[0][1] if ranked else 0.0
        standings = tuple(
            Standing(CANDIDATES[index], score - least, float(np.sqrt(mean_square)))
            for index, score, mean_square in ranked
        )
        return LawVerdict(CANDIDATES[chosen], standings, samples, effective, frequency)


def _offered(damping: str, memory: str) -> int:
    """Which candidates compete, a bit each."""
    _one_of("damping", damping, ("auto", *_DAMPINGS))
    _one_of("memory", memory, ("auto", "any", *_MEMORIES))
    bits = 0
    for index, law in enumerate(CANDIDATES):
        known = index < _EVERYDAY if memory == "auto" else memory in ("any", law.memory)
        if known and damping in ("auto", law.damping):
            bits |= 1 << index
    if not bits:
        raise InvalidParameterError(
            f"damping and memory must leave a law: there is none with damping={damping!r} and "
            f"memory={memory!r}"
        )
    return bits


def _one_of(name: str, value: Any, allowed: Iterable[str]) -> None:
    if not isinstance(value, str) or value not in allowed:
        raise InvalidParameterError(
            f"{name} must be one of {', '.join(map(repr, allowed))}, not {shown(value)}"
        )
