"""The parts of a diagnosis: findings, a verdict, and numbers at the working depth."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.digits import format_quantity, with_error
from palpate.errors import OldName
from palpate.estimators import ContactEstimator, LawVerdict
from palpate.estimators.law_verdicts import verdict_of
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
    """A number with a statistical and a systematic standard error, SI; or arrays of them.

    Attributes
    ----------
    value : float
        By the identified law.
    standard_error : float
        Statistical part, from the long-run covariance of the residual; NaN if unknown.
    systematic : float
        How far the causes that were found change it, or how far the method is off the least
        squares of its law, whichever is larger; 0 without either.
    """

    value: float
    standard_error: float
    systematic: float

    words = OldName("format")

    @property
    def whole_error(self) -> float:
        """Both standard errors together, hypot(statistical, systematic); NaN if one is unknown."""
        return math.hypot(self.standard_error, self.systematic)

    @property
    def combined(self) -> "Quantity":
        """The same with :attr:`whole_error` as its one standard error."""
        return Quantity(self.value, self.whole_error, 0.0)

    def scaled(self, factor: float) -> "Quantity":
        """Return so many times the quantity."""
        return Quantity(*(factor * x for x in (self.value, self.standard_error, self.systematic)))

    def format(self, unit: str = "") -> str:
        """Format value ± statistical ± systematic standard error, and a unit."""
        return with_error(self.value, self.standard_error, self.systematic, unit=unit)


@dataclass(frozen=True, slots=True)
class WorkingDepth(Plain):
    """Force, stiffness and damping of the law at one depth and at rest, SI.

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
    """A time span in which the material did not change.

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
            "law": self.law.description(),
            "working_depth": self.working_depth.as_dict(),
            "verdict": None,  # it takes an identification of its own
        }


@dataclass(frozen=True, slots=True, repr=False)
class Diagnosis(Plain):
    """What may be wrong with an identification, and how far to trust its numbers.

    Attributes
    ----------
    verdict : Verdict
        On the stiffness and the damping at working depth, and overall.
    findings : tuple of Finding
        The most severe first.
    working_depths : tuple of WorkingDepth
        Force, stiffness and damping with both error bars: at the working depth, which the verdict
        is about (default: the median penetration); then at the 90th percentile of the
        penetration.
    episodes : tuple of Episode
        One for each segment between changes of the material; empty without a change.
    law_verdict : LawVerdict, optional
        Model selection among the common laws on the same samples, if the identified law is one.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    working_depths: tuple[WorkingDepth, ...]
    episodes: tuple[Episode, ...] = ()
    law_verdict: LawVerdict | None = None

    def __repr__(self) -> str:
        at, marks = self.working_depth, self.verdict
        stiffness, damping = (
            with_error(each.value, each.whole_error, unit=unit)
            for each, unit in ((at.stiffness, "N/m"), (at.damping, "N·s/m"))
        )
        return (
            f"<Diagnosis: {marks.overall}; {self.reason}\n"
            f" at {format_quantity(at.depth, 'm')}: stiffness {stiffness} ({marks.stiffness}), "
            f"damping {damping} ({marks.damping}); {len(self.findings)} findings>"
        )

    @property
    def working_depth(self) -> WorkingDepth:
        """Numbers at the working depth."""
        return self.working_depths[0]

    @property
    def reason(self) -> str:
        """The message of the most severe finding, if that is more than a note."""
        if not self.findings or self.findings[0].severity == "note":
            return "no problem found that would change the result"
        return self.findings[0].message

    @property
    def remedy(self) -> str | None:
        """The next step: the remedy of the reason."""
        first = self.findings[:1]
        return first[0].remedy if first and first[0].severity != "note" else None

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and text; undefined values are None."""
        return {**Plain.as_dict(self), "working_depth": self.working_depth.as_dict()}


# Model selection on the samples that were identified.

REMEDY = "run again with --law auto"
TASK_SPEED = "record at the speed of the task"


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
    before : Laws, optional
        The same by the first two thirds of the contact.
    missed, surprise : float
        Rms error of the force that :attr:`before` predicts for the last third, of its rms force,
        and over the rms error in its own samples.
    """

    law: GeneralisedHuntCrossley
    verdict: LawVerdict
    own: bool = False
    longest: float = 0.0
    before: "Laws | None" = None
    missed: float = 0.0
    surprise: float = 0.0

    @classmethod
    def of(cls, estimator: ContactEstimator, *, own: bool = False) -> "Laws":
        """Of an estimator that has learned the samples."""
        evidence, estimate = estimator.evidence(), estimator.estimate()
        verdict = verdict_of(evidence, estimate)
        return cls(estimate.law, verdict, own, evidence.longest)


def remedy_of_memory(laws: Laws | None, time: float) -> str:
    """Return the next step for relaxation in the residual; it agrees with the model selection.

    Parameters
    ----------
    laws : Laws, optional
        That were compared.
    time : float
        Relaxation time that the residual shows, s.
    """
    if laws is None or all(each.candidate.memory == "none" for each in laws.verdict.model_ranking):
        return REMEDY
    if laws.verdict.candidate.memory != "none" and not laws.own:
        return REMEDY
    if time > laws.longest:  # as likely the drift of a sensor
        return "tare the sensor before each touch"
    return TASK_SPEED
