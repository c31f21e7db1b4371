"""A diagnosis: findings, marks, and numbers with error bars at the working depth."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.digits import format_quantity, with_error
from palpate.estimators import ContactEstimator, LawVerdict
from palpate.estimators.law_verdicts import verdict_of
from palpate.findings import Finding, Mark, spoken
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

    @property
    def both(self) -> str:
        """Both marks as text: *stiffness trust, damping with care*."""
        return f"stiffness {spoken(self.stiffness)}, damping {spoken(self.damping)}"


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


def stack_depths(depths: Sequence[WorkingDepth], shape: tuple[int, ...]) -> WorkingDepth:
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
    limits : tuple of Finding or None
        The findings that decide the marks of the stiffness and of the damping; None for *trust*.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    working_depths: tuple[WorkingDepth, ...]
    episodes: tuple[Episode, ...] = ()
    law_verdict: LawVerdict | None = None
    limits: tuple[Finding | None, Finding | None] = (None, None)

    def __repr__(self) -> str:
        at, marks = self.working_depth, self.verdict
        stiffness, damping = (
            with_error(each.value, each.whole_error, unit=unit)
            for each, unit in ((at.stiffness, "N/m"), (at.damping, "N·s/m"))
        )
        return (
            f"<Diagnosis at {format_quantity(at.depth, 'm')}: stiffness {stiffness} "
            f"({marks.stiffness}), damping {damping} ({marks.damping}); {self.reason}\n"
            f" {len(self.findings)} findings>"
        )

    @property
    def working_depth(self) -> WorkingDepth:
        """Numbers at the working depth."""
        return self.working_depths[0]

    @property
    def deciding(self) -> Finding | None:
        """The finding that decides the overall mark; None for *trust* in all that is given."""
        marks = self.verdict.stiffness, self.verdict.damping
        return self.limits[marks.index(self.verdict.overall)]

    @property
    def reason(self) -> str:
        """The message of the deciding finding."""
        found = self.deciding
        return "no problem found that would change the result" if found is None else found.message

    @property
    def remedy(self) -> str | None:
        """The next step: the remedy of the reason."""
        return None if self.deciding is None else self.deciding.remedy

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and text; undefined values are None."""
        limits = zip(("stiffness", "damping"), self.limits, strict=True)
        return {
            **Plain.as_dict(self),
            "limits": {name: found and found.as_dict() for name, found in limits},
            "working_depth": self.working_depth.as_dict(),
        }


SELECT_LAW = "let palpate select the law: run again without --law and --method"


@dataclass(frozen=True, slots=True, eq=False)
class ModelSelection:
    """Which law was selected, and by what evidence.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        That was selected.
    verdict : LawVerdict
        The evidence.
    longest : float
        The longest relaxation time that was looked for, s.
    """

    law: GeneralisedHuntCrossley
    verdict: LawVerdict
    longest: float = 0.0

    @classmethod
    def of(cls, estimator: ContactEstimator) -> "ModelSelection":
        """Return the selection of an estimator that has learned the samples."""
        evidence, estimate = estimator.evidence(), estimator.estimate()
        return cls(estimate.law, verdict_of(evidence, estimate), evidence.longest)
