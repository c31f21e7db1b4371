"""A diagnosis: findings, marks, and numbers with error bars at the working depth."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field
from typing import Any

import numpy as np

from palpate.digits import format_quantity, with_error
from palpate.estimators import ContactEstimator, LawVerdict
from palpate.estimators.law_verdicts import judge_evidence
from palpate.findings import Finding, Mark, spoken
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.validation import Plain


@dataclass(frozen=True, slots=True)
class Verdict(Plain):
    """Marks of the stiffness and the damping at working depth, and the overall mark.

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
        Value of the identified law.
    standard_error : float
        Statistical part, from the long-run covariance of the residual; NaN if unknown.
    systematic : float
        The larger of two changes: the one that the detected causes make, and the distance of the
        method from the least squares of its law; 0 without either.
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
        """Return the quantity multiplied by a factor."""
        return Quantity(*(factor * x for x in (self.value, self.standard_error, self.systematic)))

    def format(self, unit: str = "") -> str:
        """Format value ± statistical ± systematic standard error, and a unit."""
        return with_error(self.value, self.standard_error, self.systematic, unit=unit)


#: A number that is not given.
UNKNOWN = Quantity(math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class WorkingDepth(Plain):
    """Force, stiffness and damping of the law at one depth, SI.

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
    speed : float
        Velocity at which force and stiffness hold, m/s: 0, at rest, unless the probe moves one way
        at nearly one speed.
    """

    depth: float
    force: Quantity
    stiffness: Quantity
    damping: Quantity
    speed: float = field(default=0.0, kw_only=True)


def stack_depths(depths: Sequence[WorkingDepth], shape: tuple[int, ...]) -> WorkingDepth:
    """Combine the numbers at several depths into arrays of a shape; floats for ()."""
    rows = [(at.depth, *np.ravel(astuple(at)[1:4]), at.speed) for at in depths]
    table = np.array(rows).T.reshape(11, *shape)
    depth, *numbers, speed = table if shape else table.tolist()
    quantities = (Quantity(*numbers[k : k + 3]) for k in (0, 3, 6))
    return WorkingDepth(depth, *quantities, speed=speed)


@dataclass(frozen=True, slots=True)
class Episode:
    """A time span in which the material did not change.

    Attributes
    ----------
    start, stop : float
        s.
    law : ForceLaw
        The law of this time span.
    working_depth : WorkingDepth
        Its numbers at the working depth of the whole recording.
    """

    start: float
    stop: float
    law: ForceLaw
    working_depth: WorkingDepth

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text."""
        return {
            "start": self.start,
            "stop": self.stop,
            "kind": "change",
            "law": self.law.description(),
            "working_depth": self.working_depth.as_dict(),
            "verdict": None,  # a verdict needs a separate identification
        }


@dataclass(frozen=True, slots=True, repr=False)
class Diagnosis(Plain):
    """Findings, marks and error bars of an identification.

    Attributes
    ----------
    verdict : Verdict
        Marks of the stiffness and the damping at working depth, and overall.
    findings : tuple of Finding
        The most severe first.
    working_depths : tuple of WorkingDepth
        Force, stiffness and damping with both error bars: first at the working depth, to which the
        verdict refers (default: the median penetration), then at the 90th percentile of the
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
        stiffness = at.stiffness.combined.format("N/m")
        damping = at.damping.combined.format("N·s/m")
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
        """The finding that decides the overall mark; None if the overall mark is *trust*."""
        marks = self.verdict.stiffness, self.verdict.damping
        return self.limits[marks.index(self.verdict.overall)]

    @property
    def reason(self) -> str:
        """The message of the deciding finding."""
        found = self.deciding
        return "no problem found that would change the result" if found is None else found.message

    @property
    def remedy(self) -> str | None:
        """The remedy of the deciding finding."""
        return None if self.deciding is None else self.deciding.remedy

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and text, with None for undefined values."""
        limits = zip(("stiffness", "damping"), self.limits, strict=True)
        return {
            **Plain.as_dict(self),
            "limits": {name: found and found.as_dict() for name, found in limits},
            "working_depth": self.working_depth.as_dict(),
        }


SELECT_LAW = "let palpate select the law: run again without --law and --method"


@dataclass(frozen=True, slots=True, eq=False)
class ModelSelection:
    """The selected law and the evidence for it.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        The selected law.
    verdict : LawVerdict
        The evidence.
    longest : float
        The longest relaxation time among the candidates, s.
    """

    law: GeneralisedHuntCrossley
    verdict: LawVerdict
    longest: float = 0.0

    @classmethod
    def of(cls, estimator: ContactEstimator) -> "ModelSelection":
        """Return the selection of an estimator after all its samples."""
        evidence, estimate = estimator.evidence(), estimator.estimate()
        return cls(estimate.law, judge_evidence(evidence, estimate), evidence.longest)
