"""The verdict on which law fits, its findings, and the numbers that all laws have in common."""

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

# In the order of the compiled enumerations.
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
    """A law that can compete in model selection.

    Attributes
    ----------
    damping : "none", "hunt-crossley" or "half-space"
        The damping form: none, p = n, or p = n − 1.
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
    def title(self) -> str:
        """Its name in a sentence; ``str`` is the shorter name in files and on the wire."""
        name = str(self).replace("flat spectrum", "flat relaxation spectrum")
        return name.replace("half-space", "half-space damping")

    @property
    def own(self) -> tuple[str, ...]:
        """Names of its free parameters; the law's other parameters follow from these or are 0."""
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
        """Number of fitted parameters, including the offset."""
        return len(self.own) + 1


#: Every law that can compete; the first :data:`EVERYDAY` are the common laws of ``memory="auto"``.
CANDIDATES: tuple[Candidate, ...] = tuple(
    Candidate(DAMPINGS[damping], MEMORIES[memory], linear)
    for damping, memory, linear in _core.defaults["ViscoelasticContact"]["candidates"]
)
#: Number of common laws.
EVERYDAY = 5
#: Score differences, 2 ln of the odds: e to 1 and e⁵ to 1. Below the first the evidence is "not
#: worth more than a bare mention" (Kass & Raftery, J. Am. Stat. Assoc. 90, 1995).
UNDECIDED, STRONG = 2.0, 10.0


@dataclass(frozen=True, slots=True)
class RankedModel:
    """The score of one competing law at the last verdict.

    Attributes
    ----------
    candidate : Candidate
        The law.
    score : float
        N_eff ln(RSS/N) + 2 p ln N_eff minus the selected law's: 0 for that law, larger is worse.
        Ten is strong evidence.
    rms_error : float
        √(RSS/N), N.
    """

    candidate: Candidate
    score: float
    rms_error: float

    @property
    def meaning(self) -> str:
        """The score in words."""
        if self.score == 0.0:
            return "chosen"
        if self.score < UNDECIDED:
            return "cannot be distinguished"
        return "less likely" if self.score < STRONG else "strong evidence against it"

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text."""
        return {
            "law": str(self.candidate),
            **self.candidate.as_dict(),
            "parameters": self.candidate.parameters,
            "score": defined(self.score),
            "rms_error": defined(self.rms_error),
        }


_NUMBERS = ("samples", "effective_samples", "depth", "frequency")


def band_about(frequency: float) -> tuple[float, float]:
    """Frequency band of a motion, rad/s: half to twice its mean; laws differ outside of it."""
    return 0.5 * frequency, 2.0 * frequency


@dataclass(frozen=True, slots=True)
class LawVerdict(Plain):
    """The selected law and the evidence for it.

    Attributes
    ----------
    candidate : Candidate
        The selected law.
    model_ranking : tuple of RankedModel
        All competing laws, the best first; empty before the first verdict.
    samples : float
        Number of samples in the evidence, after forgetting.
    effective_samples : float
        Effective sample size N_eff: as many independent samples carry the same information.
    depth : float
        Mean depth of the motion, m.
    frequency : float
        Frequency of the motion, rad/s: rms speed over the rms distance from the mean depth.
    findings : tuple of Finding
        What the samples leave open about the law; ``flags`` has their text.
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
        """The findings as text."""
        return tuple(map(str, self.findings))

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text."""
        whole = Plain.as_dict(self)
        return {"law": str(self.candidate), **whole.pop("candidate"), **whole}

    def __str__(self) -> str:
        if not self.known:
            return f"law: {self.candidate.title} (too few samples to compare laws)"
        words = "the only candidate"
        if len(self.model_ranking) > 1:
            other = self.model_ranking[1]
            words = f"cannot be distinguished from {other.candidate.title}"
            if other.score >= UNDECIDED:
                words = f"preferred over {other.candidate.title} (ΔBIC {rounded(other.score, 3)})"
        return (
            f"law: {self.candidate.title}, {words}; effective sample size "
            f"{rounded(self.effective_samples, 3)} of {rounded(self.samples, 4)}"
        )

    def __repr__(self) -> str:
        return f"LawVerdict({self})"

    @classmethod
    def from_dict(cls, words: Mapping[str, Any]) -> "LawVerdict":
        """Return the verdict from the dictionary that :meth:`as_dict` makes."""

        def candidate(each: Mapping[str, Any]) -> Candidate:
            return Candidate(each["damping"], each["memory"], each["linear"])

        model_ranking = (
            RankedModel(candidate(each), or_nan(each["score"]), or_nan(each["rms_error"]))
            for each in words.get("model_ranking") or words["standings"]  # before 0.1
        )
        numbers = {name: or_nan(words[name]) for name in _NUMBERS}
        found = words["findings"] if "findings" in words else words["flags"]  # in schema 1
        findings = tuple(map(Finding.from_dict, found))
        return cls(candidate(words), tuple(model_ranking), **numbers, findings=findings)

    def rank_of(self, law: ForceLaw) -> RankedModel | None:
        """Return the rank of an identified law; None if it did not compete."""
        wanted = law.candidate and Candidate(*law.candidate)
        return next((each for each in self.model_ranking if each.candidate == wanted), None)

    @property
    def known(self) -> bool:
        """Whether the ranking is of the present samples, not of a discarded lead-in."""
        return bool(self.model_ranking) and 2.0 * self.samples >= self.effective_samples

    @property
    def band(self) -> tuple[float, float]:
        """Frequency band of the motion, rad/s: half to twice its mean frequency."""
        return band_about(self.frequency)


@dataclass(frozen=True, slots=True)
class DynamicStiffness:
    """Stiffness and damping for small oscillations about a depth, which laws of every kind have.

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


class Evidence(NamedTuple):
    """The plain numbers from which a verdict is computed; they can be sent to another process.

    Attributes
    ----------
    rows : sequence of (int, float, float)
        For each competing law its index in :data:`CANDIDATES`, its score and RSS/N, N².
    samples, effective_samples, depth, frequency : float
        As in :class:`LawVerdict`.
    chosen : int
        Index of the selected law in :data:`CANDIDATES`.
    begun : bool
        Whether the samples began in contact.
    one_way : float
        Mean velocity over its root mean square: ±1 for motion in one direction at one speed.
    offered : int
        The competing laws, one bit each.
    step : float
        Time between samples, s.
    shallowest : float, optional
        The gate's minimum penetration, m; None if the gate has a force threshold too.
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
        """The competing laws."""
        return tuple(law for index, law in enumerate(CANDIDATES) if self.offered >> index & 1)


# What a verdict on laws leaves open.

#: A motion is one-way above this ratio of mean to rms velocity: 1 at constant speed, 0.90 for a
#: half sine, 0 for any motion that returns.
ONE_WAY = 0.8
# Residual as a fraction of the force at mean depth. 1 % biases Hunt–Crossley's K′ by 0.8 standard
# errors, 3 % by 3 and 10 % by 7 (20 seeds, three sines from free air to 13 mm).
_NOISY = 0.02


def _open_law(
    evidence: Evidence, model_ranking: tuple[RankedModel, ...], law: GeneralisedHuntCrossley
) -> Iterator[Finding]:
    """Findings on what the samples leave open about the law; none before the first verdict."""
    if not model_ranking:
        return
    # At one speed, as in an approach alone, only noise distinguishes a damper from a spring.
    if tied := [each.candidate.title for each in model_ranking[1:] if each.score < UNDECIDED]:
        yield Finding(
            "which law",
            f"the samples do not distinguish it from {' or '.join(tied)}: the standard errors hold "
            "only if this law is the right one",
            "press and release several times, at different speeds",
        )
    stand = {each.candidate for each in model_ranking}
    if any(each.memory != "none" and each not in stand for each in evidence.laws):
        yield Finding(
            "which law",
            "too few samples yet to compare laws with memory: one of them may be right, with other "
            "stiffness and damping",
        )
    # At one speed v damping, memory and stiffness are all functions of the depth alone, x = vt.
    if abs(evidence.one_way) > ONE_WAY:
        yield Finding(
            "one way",
            "the probe moves one way at nearly one speed: only the assumed shape of the law "
            "separates damping, memory and stiffness, which may be far off",
            "press and release several times, at different speeds",
        )
    # Light samples are selected by their own force: noise makes some negative, which count as out
    # of contact. The mean of the others is too high, E(F | F > 0) > F, and the stiffness too low.
    depth, shallowest = evidence.depth, evidence.shallowest
    if shallowest is None or not (depth > 0.0 and law.stiffness > 0.0):
        return
    n, noise = law.exponent, model_ranking[0].rms_error
    force = law.stiffness * depth**n
    # At a force of two standard deviations the gate excludes one sample in forty.
    if noise > _NOISY * force and force * (shallowest / depth) ** n < 2.0 * noise:
        # There the force is three times the noise.
        needed = depth * (3.0 * noise / force) ** (1.0 / n)
        yield Finding(
            "gate",
            "the contact gate selects light samples by a force within the noise, so K′ and K are "
            "too low",
            f"set gate=ContactGate(minimum_penetration={needed:.2g})",
        )


#: The check that reports a relaxation stiffness that is not identifiable.
RELAXATION_STIFFNESS = "relaxation stiffness"
# A third of the half second that is discarded where samples begin in contact: 5 % of a relaxation
# of this time remain.
_FORGOTTEN = 0.5 / 3.0


def _open_memory(evidence: Evidence, estimate: Estimate) -> Iterator[Finding]:
    """Findings on what the samples leave open about the memory."""
    law: GeneralisedHuntCrossley = estimate.law
    if not law.remembers:
        return
    errors = estimate.standard_errors
    if not errors[4] < 0.25 * (law.stiffness + law.relaxation_stiffness):
        words = "relaxation stiffness not identifiable"
        yield Finding(RELAXATION_STIFFNESS, words, "press quickly, then hold")
    if law.stiffness < 0.0:
        yield Finding(
            "relaxed stiffness",
            "negative relaxed stiffness: the samples do not identify the relaxed material; K′ and "
            "B′ at the motion's frequency remain valid",
            "start out of contact, press, then hold",
            stiffness="do-not-trust",
        )
    # The law's longest relaxation time: its only one, or the end of its spectrum.
    if evidence.begun and law.parameters[7] > _FORGOTTEN:
        yield Finding(
            "memory",
            "the samples begin in contact, and the material relaxes for over half a second: K and "
            "M may be off by two standard errors",
            "start recording before the touch",
        )
    if (time := law.relaxation_time) is not None:
        # At this limit two standard errors are a factor of e either way.
        if not errors[7] < 0.5 * time:
            words = "relaxation time not identifiable"
            yield Finding("relaxation time", words, "move at several speeds, then hold")
        if time > 0.5 * evidence.samples * evidence.step:
            words = "slow drift or relaxation: the relaxation time exceeds half of the recording"
            yield Finding("relaxation time", words)


def verdict_of(evidence: Evidence, estimate: Estimate) -> LawVerdict:
    """Return the verdict, from an estimator's evidence and its estimate at the same time."""
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
