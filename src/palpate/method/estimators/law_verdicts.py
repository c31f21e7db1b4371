"""The model selection: the selected law, its findings, and quantities that all laws share."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import palpate._core as _core
from palpate.digits import format_quantity, rounded
from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.method.estimators.estimate import Estimate
from palpate.validation import Plain, finite_or_none, frozen, or_nan

# In the order of the compiled enumerations.
DAMPINGS = ("none", "hunt-crossley", "half-space", "linear")
MEMORIES = ("none", "spectrum")
_NAMES = {
    "none": "spring",
    "hunt-crossley": "Hunt–Crossley",
    "half-space": "half-space",
    "linear": "linear damper",
}


@frozen
class Candidate(Plain):
    """A law that can compete in model selection.

    Attributes
    ----------
    damping : "none", "hunt-crossley", "half-space" or "linear"
        The damping form: none, p = n, p = n − 1 or p = 0.
    memory : "none" or "spectrum"
        Whether the material relaxes.
    linear : bool
        Whether n is 1: with p = n − 1 the Kelvin–Voigt law.
    """

    damping: str
    memory: str
    linear: bool = False

    def __str__(self) -> str:
        name = "Kelvin–Voigt" if self.linear else _NAMES[self.damping]
        return name if self.memory == "none" else f"{name} with relaxation"

    @property
    def title(self) -> str:
        """Its name in a sentence; ``str`` is the shorter name in files and on the wire."""
        return str(self).replace("half-space", "half-space damping")

    @property
    def own(self) -> tuple[str, ...]:
        """Names of its free parameters; the law's other parameters follow from them or are 0."""
        has = {
            "K": True,
            "n": not self.linear,
            "B": self.damping != "none",
            "M": self.memory != "none",
        }
        return tuple(name for name, own in has.items() if own)


#: Every law that can compete, those without memory first.
CANDIDATES: tuple[Candidate, ...] = tuple(
    Candidate(DAMPINGS[damping], MEMORIES[memory], linear)
    for damping, memory, linear in _core.defaults["ViscoelasticContact"]["candidates"]
)
#: Score differences, 2 ln of the odds: e to 1 and e⁵ to 1. Below the first the evidence is "not
#: worth more than a bare mention" (Kass & Raftery, J. Am. Stat. Assoc. 90, 1995).
UNDECIDED = 2.0
STRONG = 10.0


@frozen
class RankedModel:
    """The score of one competing law at the last verdict.

    Attributes
    ----------
    candidate : Candidate
        The law.
    score : float
        N_eff ln(RSS/N) + 2 p ln N_eff minus the score of the selected law: 0 for that law; larger
        is worse, and ten is strong evidence. It is negative for a law with memory that scores
        better, but reduces the error by less than 5 %.
    rms_error : float
        √(RSS/N), N.
    """

    candidate: Candidate
    score: float
    rms_error: float

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text."""
        return {
            "law": str(self.candidate),
            **self.candidate.as_dict(),
            "score": finite_or_none(self.score),
            "rms_error": finite_or_none(self.rms_error),
        }


Certainty: TypeAlias = Literal["alone", "open", "weak", "strong"]
_NUMBERS = ("samples", "effective_samples", "depth", "frequency")


def band_about(frequency: float) -> tuple[float, float]:
    """Frequency band of a motion, rad/s: half to twice its mean; laws differ outside of it."""
    return 0.5 * frequency, 2.0 * frequency


@frozen
class LawVerdict(Plain):
    """The selected law and the evidence for it.

    Parameters
    ----------
    candidate : Candidate
        The selected law.
    model_ranking : tuple of RankedModel
        All competing laws, the best first; empty before the first verdict.
    samples : float
        Number of samples in the evidence, after forgetting.
    effective_samples : float
        Effective sample size N_eff: this many independent samples carry the same information.
    depth : float
        Mean depth of the motion, m.
    frequency : float
        Frequency of the motion, rad/s: rms speed over the rms distance from the mean depth.
    findings : tuple of Finding
        Open questions about the law; ``flags`` has their text.

    Examples
    --------
    >>> import palpate
    >>> verdict = palpate.identify("examples/recordings/ball.csv").law_verdict
    >>> verdict.candidate
    Candidate(damping='hunt-crossley', memory='none', linear=False)
    >>> round(verdict.effective_samples, -2)
    4900.0
    """

    candidate: Candidate
    model_ranking: tuple[RankedModel, ...]
    samples: float
    effective_samples: float
    depth: float
    frequency: float
    findings: tuple[Finding, ...] = ()

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
        return f"law: {self.candidate.title}, {self.comparison}"

    @property
    def rival(self) -> RankedModel | None:
        """The best other law without memory; None if none competes."""
        others = (each for each in self.model_ranking[1:] if each.candidate.memory == "none")
        return next(others, None)

    @property
    def lead(self) -> float:
        """ΔBIC of the law over the best other law without memory; NaN without one."""
        rival = self.rival
        return math.nan if rival is None else rival.score

    @property
    def certainty(self) -> Certainty:
        """How strong the evidence is against that other law."""
        if math.isnan(self.lead):
            return "alone"
        if self.lead < UNDECIDED:
            return "open"
        return "weak" if self.lead < STRONG else "strong"

    @property
    def comparison(self) -> str:
        """How the law compares with the best other law without memory, and the sample size."""
        error = format_quantity(self.model_ranking[0].rms_error, "N")
        rival = self.rival
        text = f"the only candidate, rms error {error}"
        if rival is not None:
            other_error = format_quantity(rival.rms_error, "N")
            title = rival.candidate.title
            against = f"with {title}"
            if self.candidate.memory != "none":
                against = f"without relaxation ({title})"
            text = f"rms error {error}, {other_error} {against}"
            if rival.score < UNDECIDED:
                text = f"cannot be distinguished from {title}, {text}"
        effective = rounded(self.effective_samples, 3)
        samples = rounded(self.samples, 4)
        return f"{text}; effective sample size {effective} of {samples}"

    def __repr__(self) -> str:
        return f"LawVerdict({self})"

    @classmethod
    def from_dict(cls, words: Mapping[str, Any]) -> "LawVerdict":
        """Return the verdict from the dictionary that :meth:`as_dict` returns."""

        def candidate(each: Mapping[str, Any]) -> Candidate:
            return Candidate(each["damping"], each["memory"], each["linear"])

        model_ranking = (
            RankedModel(candidate(each), or_nan(each["score"]), or_nan(each["rms_error"]))
            for each in words["model_ranking"]
        )
        numbers = {name: or_nan(words[name]) for name in _NUMBERS}
        findings = tuple(map(Finding.from_dict, words["findings"]))
        return cls(candidate(words), tuple(model_ranking), **numbers, findings=findings)

    @property
    def known(self) -> bool:
        """Whether there are enough samples for a ranking."""
        return bool(self.model_ranking)

    @property
    def band(self) -> tuple[float, float]:
        """Frequency band of the motion, rad/s: half to twice its mean frequency."""
        return band_about(self.frequency)


@frozen
class DynamicStiffness:
    """Stiffness and damping for small oscillations about a depth, which every law has.

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
    longest : float
        The longest relaxation time of the candidates, s.
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
    longest: float

    @property
    def laws(self) -> tuple[Candidate, ...]:
        """The competing laws."""
        return tuple(law for index, law in enumerate(CANDIDATES) if self.offered >> index & 1)


# Open questions about the law.

#: A motion is one-way above this ratio of mean to rms velocity.
ONE_WAY: float = _core.defaults["ViscoelasticContact"]["one_way"]


def one_way(stiffness: Mark = "trust", damping: Mark = "trust") -> Finding:
    """Report a motion that goes one way at nearly one speed.

    At one speed v spring, damper and memory are functions of the depth alone, x = vt, of which the
    residual shows nothing: that of Hunt and Crossley, K xⁿ + B v xⁿ, is one power. Of laws that
    are compared any may win there, and a half-space's spring even come out negative.
    """
    return Check.ONE_WAY.finding(
        "the probe moves one way at nearly one speed: only the shape of the law separates "
        "stiffness, damping and relaxation, which the error bars do not include",
        Remedy(NextStep.VARY_SPEED),
        stiffness=stiffness,
        damping=damping,
        brief="the probe moves one way",
    )


def one_speed(speed: str) -> Finding:
    """Report a motion at one speed, at which the stiffness holds."""
    return Check.ONE_WAY.finding(
        f"the probe moves one way at nearly one speed: the stiffness holds at {speed}, and the "
        "damping is part of it",
        f"for the damping, {NextStep.VARY_SPEED.value}",
        damping="do-not-trust",
        brief="the probe moves one way at nearly one speed",
    )


def _law_findings(evidence: Evidence, model_ranking: tuple[RankedModel, ...]) -> Iterator[Finding]:
    """Findings on open questions about the law; none before the first verdict."""
    if not model_ranking:
        return
    # At one speed, as on an approach alone, only noise distinguishes a damper from a spring.
    selected = model_ranking[0].candidate
    rivals = [
        each for each in model_ranking[1:] if each.candidate.memory == selected.memory == "none"
    ]
    if tied := [each.candidate.title for each in rivals if each.score < UNDECIDED]:
        yield Check.WHICH_LAW.finding(
            f"the samples do not distinguish it from {' or '.join(tied)}: the standard errors hold "
            "only if this law is the right one",
            Remedy(NextStep.VARY_SPEED),
        )
    ranked = {each.candidate for each in model_ranking}
    if any(each.memory != "none" and each not in ranked for each in evidence.laws):
        yield Check.WHICH_LAW.finding(
            "too few samples yet to compare laws with memory: one of them may be right, with other "
            "stiffness and damping"
        )
    if abs(evidence.one_way) > ONE_WAY:
        yield one_way()


def judge_evidence(evidence: Evidence, estimate: Estimate) -> LawVerdict:
    """Return the verdict from an estimator's evidence and its simultaneous estimate."""
    selected_score = next(
        (score for index, score, _ in evidence.rows if index == evidence.chosen),
        0.0,
    )
    ranked = sorted(evidence.rows, key=lambda row: (row[0] != evidence.chosen, row[1]))
    model_ranking = tuple(
        RankedModel(CANDIDATES[int(index)], score - selected_score, math.sqrt(mean_square))
        for index, score, mean_square in ranked
    )
    findings = tuple(_law_findings(evidence, model_ranking))
    numbers = {name: getattr(evidence, name) for name in _NUMBERS}
    return LawVerdict(CANDIDATES[evidence.chosen], model_ranking, **numbers, findings=findings)
