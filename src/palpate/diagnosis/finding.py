"""What a diagnosis says: findings, a verdict, and numbers at the working depth."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.digits import rounded, with_error
from palpate.estimators import ContactEstimator, LawVerdict
from palpate.estimators.law_verdicts import EVERYDAY, verdict_of
from palpate.findings import Finding, Mark
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Plain


@dataclass(frozen=True, slots=True)
class Verdict(Plain):
    """Whether to trust the stiffness and the damping at working depth, and the whole.

    Attributes
    ----------
    stiffness, damping, overall : str
        ``"trust"``, ``"with-care"`` or ``"do-not-trust"``.
    """

    stiffness: Mark
    damping: Mark
    overall: Mark


@dataclass(frozen=True, slots=True)
class Quantity(Plain):
    """A number with two error bars, SI; or arrays of them.

    Attributes
    ----------
    value : float
        By the identified law.
    standard_error : float
        Repeatable part, from the scatter of blocks of the residual; NaN where it is not known.
    systematic : float
        What the causes that were found would move it by, or how far the method is off the least
        squares of its law, where that is more; 0 of neither.
    """

    value: float
    standard_error: float
    systematic: float

    @property
    def whole_error(self) -> float:
        """What repeats and what the findings would move together; NaN where one is unknown."""
        return math.hypot(self.standard_error, self.systematic)

    def scaled(self, factor: float) -> "Quantity":
        """Return so many times the quantity."""
        return Quantity(*(factor * x for x in (self.value, self.standard_error, self.systematic)))

    def format(self, unit: str = "") -> str:
        """It with both error bars, what repeats and what the findings would move, and a unit."""
        return with_error(self.value, self.standard_error, self.systematic, unit=unit)


@dataclass(frozen=True, slots=True)
class WorkingDepth(Plain):
    """What the law says at one depth and at rest, SI.

    Attributes
    ----------
    depth : float
        Below the surface, m.
    force : Quantity
        N.
    stiffness : Quantity
        ∂F/∂x, N/m.
    damping : Quantity
        ∂F/∂v, N·s/m.
    """

    depth: float
    force: Quantity
    stiffness: Quantity
    damping: Quantity


def stacked(depths: Sequence[WorkingDepth], shape: tuple[int, ...]) -> WorkingDepth:
    """Return the numbers at several depths as one, with arrays of a shape; floats for ()."""

    def column(values: Iterable[float]) -> Any:
        found = np.array(list(values)).reshape(shape)
        return found if shape else float(found)

    quantities = [
        Quantity(
            *(
                column(getattr(getattr(depth, name), part) for depth in depths)
                for part in ("value", "standard_error", "systematic")
            )
        )
        for name in ("force", "stiffness", "damping")
    ]
    return WorkingDepth(column(depth.depth for depth in depths), *quantities)


@dataclass(frozen=True, slots=True)
class Episode:
    """A stretch of time in which the material stayed as it was.

    Attributes
    ----------
    start, stop : float
        s.
    law : ForceLaw
        That describes it.
    working_depth : WorkingDepth
        Its numbers at the working depth of the whole.
    """

    start: float
    stop: float
    law: ForceLaw
    working_depth: WorkingDepth

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words."""
        return {
            "start": self.start,
            "stop": self.stop,
            "kind": "change",
            "law": {"kind": self.law.kind, **self.law.as_dict()},
            "working_depth": self.working_depth.as_dict(),
            "verdict": None,  # it takes an identification of its own
        }


@dataclass(frozen=True, slots=True)
class Diagnosis(Plain):
    """What may be wrong with an identification, and how far its numbers can be trusted.

    Attributes
    ----------
    verdict : Verdict
        On the stiffness and the damping at working depth, and overall.
    findings : tuple of Finding
        The gravest first.
    working_depths : tuple of WorkingDepth
        Force, stiffness and damping with both error bars: at the working depth, which the verdict
        is about and is the median penetration unless another is asked for; then at the 90th
        percentile of the penetration.
    episodes : tuple of Episode
        One for each stretch between changes of the material; empty where none was found.
    law_verdict : LawVerdict, optional
        Which everyday law it is by the same samples, where the identified one is among them.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    working_depths: tuple[WorkingDepth, ...]
    episodes: tuple[Episode, ...] = ()
    law_verdict: LawVerdict | None = None

    @property
    def working_depth(self) -> WorkingDepth:
        """Numbers at the working depth."""
        return self.working_depths[0]

    @property
    def reason(self) -> str:
        """The message of the gravest finding that is more than a note."""
        if not self.findings or self.findings[0].severity == "note":
            return "nothing was found that moves the numbers"
        return self.findings[0].message

    @property
    def remedy(self) -> str | None:
        """What to do about the reason."""
        first = self.findings[:1]
        return first[0].remedy if first and first[0].severity != "note" else None

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words; what is not defined is None."""
        return {**Plain.as_dict(self), "working_depth": self.working_depth.as_dict()}


# What laws that are compared made of the samples that were identified.

REMEDY = "--law auto"
FASTER = "move as fast as the task will"
# Of the everyday bank: its longest relaxation time, in sample times.
_LONGEST = 2048.0


@dataclass(frozen=True, slots=True, eq=False)
class Laws:
    """Which of them was chosen, and by what evidence.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        That was chosen.
    verdict : LawVerdict
        The evidence.
    own : bool
        Whether it is the identification's own law.
    longest : float
        The longest relaxation time that was looked for, s.
    """

    law: GeneralisedHuntCrossley
    verdict: LawVerdict
    own: bool = False
    longest: float = 0.0

    @property
    def of_all(self) -> bool:
        """Whether they were more than the everyday ones."""
        return len(self.verdict.model_ranking) > EVERYDAY

    @classmethod
    def of(cls, estimator: ContactEstimator, *, own: bool = False) -> "Laws":
        """Of an estimator that has learned the samples."""
        evidence, estimate = estimator.evidence(), estimator.estimate()
        verdict = verdict_of(evidence, estimate)
        return cls(estimate.law, verdict, own, _LONGEST * evidence.step)


def remedy_of_memory(laws: Laws | None, time: float) -> str:
    """What to do of a memory that the residual shows, in agreement with the verdict on laws.

    Parameters
    ----------
    laws : Laws, optional
        That were compared.
    time : float
        For how long the residual remembers, s.
    """
    if laws is None or all(each.candidate.memory == "none" for each in laws.verdict.model_ranking):
        return f"{REMEDY} tells whether a law with memory is better; or {FASTER}"
    if laws.verdict.candidate.memory != "none":
        if not laws.own:
            return f"{REMEDY} identifies the memory; or {FASTER}"
        return FASTER if laws.of_all else f"--law any has more kinds of memory; or {FASTER}"
    if time > laws.longest and not laws.of_all:
        longest = rounded(laws.longest, 2)
        return f"longer than the {longest} s of {REMEDY}: as likely the drift of a sensor; {FASTER}"
    better = "by the verdict on laws" if laws.own else f"by {REMEDY}: {laws.verdict.candidate} is"
    return f"no law with memory is better, {better}; {FASTER}"
