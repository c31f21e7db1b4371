"""Which law it is, and the numbers that laws have in common: what a verdict says."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import palpate._core as _core
from palpate.digits import rounded
from palpate.errors import OldName
from palpate.estimators.estimate import Estimate
from palpate.findings import Finding
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Plain, defined, or_nan

# By the values of the compiled enumerations.
DAMPINGS = ("none", "hunt-crossley", "half-space")
MEMORIES = ("none", "flat", "single", "power-law")
_WITH = {
    "none": "",
    "flat": " with a flat spectrum",
    "single": " with one relaxation time",
    "power-law": " with power-law relaxation",
}


@dataclass(frozen=True, slots=True)
class Candidate(Plain):
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
        half_space = "Kelvin–Voigt" if self.linear else "half-space"
        laws = {"none": "spring", "hunt-crossley": "Hunt–Crossley", "half-space": half_space}
        return laws[self.damping] + _WITH[self.memory]

    @property
    def own(self) -> tuple[str, ...]:
        """Names of its own numbers: the law's others follow from these, or are none."""
        has = {
            "stiffness": True,
            "exponent": not self.linear,
            "damping": self.damping != "none",
            "relaxation_stiffness": self.memory != "none",
            "spectrum_exponent": self.memory == "power-law",
            "longest_time": self.memory == "single",
        }
        return tuple(name for name, own in has.items() if own)

    @property
    def parameters(self) -> int:
        """Numbers that are looked for, the offset among them."""
        return len(self.own) + 1


#: Every law that can be offered; the first five are distinguished by the everyday bank.
CANDIDATES: tuple[Candidate, ...] = tuple(
    Candidate(DAMPINGS[damping], MEMORIES[memory], linear)
    for damping, memory, linear in _core.defaults["ViscoelasticContact"]["candidates"]
)
#: How many of them are distinguished by the everyday bank, from the first on.
EVERYDAY = 5
#: Differences of the score, twice those of a logarithm of the odds: e and e⁵ to one. Less than the
#: first is worth but a bare mention (Kass & Raftery, J. Am. Stat. Assoc. 90, 1995).
UNDECIDED, STRONG = 2.0, 10.0


@dataclass(frozen=True, slots=True)
class RankedModel:
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

    @property
    def meaning(self) -> str:
        """What its score means."""
        if self.score == 0.0:
            return "chosen"
        if self.score < UNDECIDED:
            return "cannot be told from it"
        return "less likely" if self.score < STRONG else "strong evidence against it"

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words."""
        return {
            "law": str(self.candidate),
            **self.candidate.as_dict(),
            "parameters": self.candidate.parameters,
            "score": defined(self.score),
            "rms_error": defined(self.rms_error),
        }


_NUMBERS = ("samples", "effective_samples", "depth", "frequency")


def band_about(frequency: float) -> tuple[float, float]:
    """Frequencies that a motion contained, rad/s, by its own: half to twice; laws part beyond."""
    return 0.5 * frequency, 2.0 * frequency


@dataclass(frozen=True, slots=True)
class LawVerdict(Plain):
    """Which law it is, and by what.

    Attributes
    ----------
    candidate : Candidate
        The law that was chosen.
    model_ranking : tuple of RankedModel
        Of the laws that were offered, the best first; empty before the first verdict.
    samples : float
        Samples that the evidence is of, less what was forgotten.
    effective_samples : float
        N_eff: so many samples of white noise would say as much.
    depth : float
        Where the motion was on average, m.
    frequency : float
        Of the motion, rad/s: root mean square speed over that of the way from its mean depth.
    findings : tuple of Finding
        What the samples leave open of it; ``flags`` has them in words.
    """

    candidate: Candidate
    model_ranking: tuple[RankedModel, ...]
    samples: float
    effective_samples: float
    depth: float
    frequency: float
    findings: tuple[Finding, ...] = ()

    standings, standing_of = OldName("model_ranking"), OldName("rank_of")

    @property
    def flags(self) -> tuple[str, ...]:
        """The findings in words."""
        return tuple(map(str, self.findings))

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words; the standings in their order."""
        whole = Plain.as_dict(self)
        whole["standings"] = whole.pop("model_ranking")
        return {"law": str(self.candidate), **whole.pop("candidate"), **whole}

    def __str__(self) -> str:
        if not self.known:
            return f"law: {self.candidate}, for want of samples"
        words = "the only one that was offered"
        if len(self.model_ranking) > 1:
            other = self.model_ranking[1]
            words = f"which {other.candidate} cannot be told from"
            if other.score >= UNDECIDED:
                words = f"before {other.candidate} by {rounded(other.score, 3)}"
        return (
            f"law: {self.candidate}, {words}; evidence of {rounded(self.effective_samples, 3)} "
            f"independent samples of {rounded(self.samples, 4)}"
        )

    @classmethod
    def from_dict(cls, words: Mapping[str, Any]) -> "LawVerdict":
        """Return the verdict of its numbers and words, as :meth:`as_dict` has them."""

        def candidate(each: Mapping[str, Any]) -> Candidate:
            return Candidate(each["damping"], each["memory"], each["linear"])

        model_ranking = (
            RankedModel(candidate(each), or_nan(each["score"]), or_nan(each["rms_error"]))
            for each in words["standings"]
        )
        numbers = {name: or_nan(words[name]) for name in _NUMBERS}
        said = words["findings"] if "findings" in words else words["flags"]  # in schema 1
        findings = tuple(map(Finding.from_dict, said))
        return cls(candidate(words), tuple(model_ranking), **numbers, findings=findings)

    def rank_of(self, law: ForceLaw) -> RankedModel | None:
        """Return how an identified law stood; None where it was not offered."""
        wanted = law.candidate and Candidate(*law.candidate)
        return next((each for each in self.model_ranking if each.candidate == wanted), None)

    @property
    def known(self) -> bool:
        """Whether it is of the samples that there are, and not of a lead-in that was given up."""
        return bool(self.model_ranking) and 2.0 * self.samples >= self.effective_samples

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies that the motion contained, rad/s: half to twice its own."""
        return band_about(self.frequency)


@dataclass(frozen=True, slots=True)
class DynamicStiffness:
    """What a small oscillation feels: numbers that laws of any kind have in common.

    Attributes
    ----------
    depth, frequency : float
        m and rad/s.
    stiffness, stiffness_error : float
        K′ and its standard error, N/m.
    damping, damping_error : float
        B′ and its standard error, N·s/m.
    loss_tangent : float
        tan δ = ω B′/K′.
    """

    depth: float
    frequency: float
    stiffness: float
    stiffness_error: float
    damping: float
    damping_error: float

    @property
    def loss_tangent(self) -> float:
        """Tan δ = ω B′/K′."""
        return self.frequency * self.damping / self.stiffness if self.stiffness else math.nan


# What a verdict on laws is worked out from, where it may be given to another process.


class Evidence(NamedTuple):
    """What a verdict is worked out from: plain numbers, that another process may be given.

    Attributes
    ----------
    rows : sequence of (int, float, float)
        Of each law that competed its place among :data:`CANDIDATES`, its score and RSS/N, N².
    samples, effective_samples : float
        As those of :class:`LawVerdict`.
    chosen : int
        Place of the law in force.
    depth, frequency : float
        As those of :class:`LawVerdict`.
    begun : bool
        Whether the samples began in contact.
    one_way : float
        Mean velocity over its root mean square, ±1 where the motion went one way at one speed.
    offered : int
        The laws on offer, a bit each.
    step : float
        Between samples, s.
    shallowest : float, optional
        Penetration that the gate asks of a sample, m; None where it asks for a force too.
    """

    rows: Sequence[Sequence[float]]
    samples: float
    effective_samples: float
    chosen: int
    depth: float
    frequency: float
    begun: bool
    one_way: float
    offered: int
    step: float
    shallowest: float | None

    @property
    def laws(self) -> tuple[Candidate, ...]:
        """The laws on offer."""
        return tuple(law for index, law in enumerate(CANDIDATES) if self.offered >> index & 1)


# What a verdict on laws leaves open.

#: Mean velocity over its root mean square, from which on a motion goes one way: 1 at one speed,
#: 0.90 of a half sine, 0 of whatever comes back.
ONE_WAY = 0.8
# Of the force at the mean depth that a law leaves: of HC's K′ 1 % took 0.8 standard errors, 3 % 3
# and 10 % 7, 20 seeds of three sines from out of contact to 13 mm.
_NOISY = 0.02


def _open_law(
    evidence: Evidence, model_ranking: tuple[RankedModel, ...], law: GeneralisedHuntCrossley
) -> Iterator[Finding]:
    """What the samples leave open of which law it is; nothing before the first verdict."""
    if not model_ranking:
        return
    # A motion at one speed, such as an approach alone, tells damper and spring apart by the noise.
    if tied := [str(each.candidate) for each in model_ranking[1:] if each.score < UNDECIDED]:
        yield Finding(
            "which law",
            f"the samples do not tell it from {' or '.join(tied)}, and the error bars are of the "
            "one law alone",
            "press and let go, at several speeds",
        )
    stand = {each.candidate for each in model_ranking}
    if any(each.memory != "none" and each not in stand for each in evidence.laws):
        yield Finding(
            "which law",
            "no law with memory competes yet: five numbers fit any hundred samples; stiffness and "
            "damping may be those of one",
        )
    # At one speed v damper, memory and spring are functions of the depth alone, x = vt.
    if abs(evidence.one_way) > ONE_WAY:
        yield Finding(
            "one way",
            "the motion goes one way at nearly one speed: damping, memory and stiffness are "
            "distinguished by the shape of the law alone, and may be far off",
            "press and let go, at several speeds",
        )
    # Light samples are taken by their own force: those that noise makes negative count as out of
    # contact, and what is left is too firm, E(F | F > 0) > F, and the stiffness too low.
    depth, shallowest = evidence.depth, evidence.shallowest
    if shallowest is None or not (depth > 0.0 and law.stiffness > 0.0):
        return
    n, noise = law.exponent, model_ranking[0].rms_error
    force = law.stiffness * depth**n
    # Two deviations above none, one sample in forty is left out.
    if noise > _NOISY * force and force * (shallowest / depth) ** n < 2.0 * noise:
        needed = 1e3 * depth * (3.0 * noise / force) ** (1.0 / n)
        yield Finding(
            "gate",
            "light samples are taken by a force within the noise, which makes K′ and K too low",
            f"gate=ContactGate(minimum_penetration=…) of {rounded(needed, 2)} mm, where the force "
            "is three times that",
        )


#: The check that says that the samples leave open how much relaxes.
RELAXATION_STIFFNESS = "relaxation stiffness"
# Of the half second that is given up where samples begin in contact a third: 5 % of it are left.
_FORGOTTEN = 0.5 / 3.0


def _open_memory(evidence: Evidence, estimate: Estimate) -> Iterator[Finding]:
    """What the samples leave open of the memory."""
    law: GeneralisedHuntCrossley = estimate.law
    if not law.remembers:
        return
    errors = estimate.standard_errors
    if not errors[4] < 0.25 * (law.stiffness + law.relaxation_stiffness):
        words = "relaxation stiffness not identifiable"
        yield Finding(RELAXATION_STIFFNESS, words, "press quickly, and hold")
    if law.stiffness < 0.0:
        yield Finding(
            "relaxed stiffness",
            "negative relaxed stiffness: where the material ends up once all has relaxed, these "
            "samples do not say; K′ and B′ at their own frequency they do",
            "press from out of contact, and hold",
        )
    # The longest of the law's times: the only one, or the end of its spectrum.
    if evidence.begun and law.parameters[7] > _FORGOTTEN:
        yield Finding(
            "memory",
            "the samples begin in contact, and longer than half a second is remembered: K and M "
            "may be off by twice their error bars",
            "record from before the touch",
        )
    if (time := law.relaxation_time) is not None:
        # A factor of e either way at two deviations.
        if not errors[7] < 0.5 * time:
            words = "relaxation time not identifiable"
            yield Finding("relaxation time", words, "move at several speeds, and hold")
        if time > 0.5 * evidence.samples * evidence.step:
            words = "slow drift or relaxation: the time is longer than half of the samples"
            yield Finding("relaxation time", words)


def verdict_of(evidence: Evidence, estimate: Estimate) -> LawVerdict:
    """Return the verdict.

    Parameters
    ----------
    evidence : Evidence
        Of :meth:`ViscoelasticContact.evidence`.
    estimate : Estimate
        Of the same moment.
    """
    ranked = sorted(evidence.rows, key=lambda row: row[1])
    least = ranked[0][1] if ranked else 0.0
    model_ranking = tuple(
        RankedModel(CANDIDATES[int(index)], score - least, math.sqrt(mean_square))
        for index, score, mean_square in ranked
    )
    findings = (
        *_open_law(evidence, model_ranking, estimate.law),
        *_open_memory(evidence, estimate),
    )
    numbers = {name: getattr(evidence, name) for name in _NUMBERS}
    return LawVerdict(CANDIDATES[evidence.chosen], model_ranking, **numbers, findings=findings)
