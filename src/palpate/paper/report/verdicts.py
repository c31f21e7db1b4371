"""What becomes of a claim of the paper, over the seeds."""

import enum
import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from palpate.paper.experiment import Claim, Experiment, Outcome
from palpate.paper.judging import Finding
from palpate.paper.quantities import said


class Verdict(enum.Enum):
    """What the seeds say together."""

    REPRODUCED = "reproduced"
    PARTLY = "partly reproduced"
    NOT_REPRODUCED = "not reproduced"
    UNCHECKED = "cannot be checked"


#: Beside the words, so that no verdict is told by its colour alone.
SIGNS = {
    Verdict.REPRODUCED: "✓",
    Verdict.PARTLY: "◐",
    Verdict.NOT_REPRODUCED: "✗",
    Verdict.UNCHECKED: "–",
}


def verdict_of(held: int, checked: int) -> Verdict:
    """Reproduced or not: in all seeds, or claims, that could tell; partly: in some of them."""
    if not checked:
        return Verdict.UNCHECKED
    if held == checked:
        return Verdict.REPRODUCED
    return Verdict.PARTLY if held else Verdict.NOT_REPRODUCED


@dataclass(frozen=True, slots=True)
class Judgement:
    """A claim, and what was found of it.

    Attributes
    ----------
    experiment : str
        Name of the experiment.
    claim : Claim
        The paper's.
    findings : tuple of Finding
        One a seed, in their order.
    words : str
        What else was seen.
    """

    experiment: str
    claim: Claim
    findings: tuple[Finding, ...]
    words: str = ""

    @property
    def checked(self) -> int:
        """Seeds that could tell."""
        return sum(finding.holds is not None for finding in self.findings)

    @property
    def held(self) -> int:
        """Seeds in which it holds."""
        return sum(finding.holds is True for finding in self.findings)

    @property
    def verdict(self) -> Verdict:
        """Of all seeds together."""
        return verdict_of(self.held, self.checked)

    @property
    def verdict_words(self) -> str:
        """The verdict, with the count of seeds where they differ."""
        if self.verdict is Verdict.PARTLY:
            return f"reproduced in {self.held} of {self.checked} seeds"
        if 0 < self.checked < len(self.findings):
            return f"{self.verdict.value} ({self.checked} of {len(self.findings)} seeds can tell)"
        return str(self.verdict.value)

    @property
    def ours(self) -> tuple[float, float, float] | None:
        """Median, least and largest of what was measured; None where nothing was."""
        known: list[float] = [
            finding.ours
            for finding in self.findings
            if finding.ours is not None and math.isfinite(finding.ours)
        ]
        return (statistics.median(known), min(known), max(known)) if known else None

    @property
    def ours_words(self) -> str:
        """What was measured, with its unit; the range over the seeds in brackets."""
        return "" if self.ours is None else said(self.ours, self.claim.unit)

    @property
    def remark(self) -> str:
        """What the words are taken to mean, and on what that depends."""
        parts = (part.removesuffix(".") for part in (self.claim.reading, self.claim.depends))
        return " ".join(f"{part[:1].upper()}{part[1:]}." for part in parts if part)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and words."""
        ours = self.ours
        return {
            "experiment": self.experiment,
            **asdict(self.claim),
            "verdict": self.verdict.value,
            "seeds_checked": self.checked,
            "seeds_held": self.held,
            "ours": dict(zip(("median", "least", "largest"), ours, strict=True)) if ours else None,
            "seen": self.words,
        }


def judgements(experiment: Experiment, outcomes: Sequence[Outcome]) -> tuple[Judgement, ...]:
    """Return what the outcomes of an experiment say of each of its claims."""
    every = [outcome.numbers for outcome in outcomes]

    def judged(claim: Claim) -> Judgement:
        judge = experiment.judges[claim.key]
        return Judgement(experiment.name, claim, tuple(map(judge, every)), judge.words(every))

    return tuple(judged(claim) for claim in experiment.claims)
