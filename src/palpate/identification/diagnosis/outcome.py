"""A diagnosis: findings, marks, and numbers with error bars at the working depth."""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from palpate.digits import format_quantity, rough_percent, with_error
from palpate.findings import Check, Finding, Mark, Remedy, spoken
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.method.estimators import ContactEstimator, LawVerdict
from palpate.method.estimators.law_verdicts import judge_evidence
from palpate.validation import Plain, frozen


@frozen
class Verdict(Plain):
    """Marks of the stiffness and the damping at working depth, and the overall mark.

    Parameters
    ----------
    stiffness, damping, overall : str
        ``"trust"``, ``"with-care"`` or ``"do-not-trust"``.

    Examples
    --------
    >>> import palpate
    >>> palpate.identify("examples/recordings/tapping.csv").diagnosis.verdict
    Verdict(stiffness='with-care', damping='with-care', overall='with-care')
    """

    stiffness: Mark
    damping: Mark
    overall: Mark

    @property
    def both(self) -> str:
        """Both marks as text: *stiffness trust, damping with care*."""
        return f"stiffness {spoken(self.stiffness)}, damping {spoken(self.damping)}"

    def as_dict(self) -> dict[str, Any]:
        """Return the marks of the two numbers; an overall mark is for who asks for one."""
        return {"stiffness": self.stiffness, "damping": self.damping}


@frozen
class Where(Plain):
    """Where a number holds.

    Attributes
    ----------
    depth : float
        m.
    frequency : float
        rad/s; NaN if the number does not depend on it.
    speed : float
        m/s.
    """

    depth: float
    frequency: float = math.nan
    speed: float = 0.0


@frozen
class Quantity(Plain):
    """A number, what it is worth and where it holds, SI; or arrays of them.

    Every output prints it and its own mark from here. ``float`` gives the value.

    Parameters
    ----------
    value : float
        Value of the identified law.
    standard_error : float
        Statistical part, from the long-run covariance of the residual; NaN if unknown.
    systematic : float
        Other laws, misfit, causes and distance from the least squares (``docs/explain/marks.md``).
    mark : str, optional
        ``"trust"``, ``"with-care"`` or ``"do-not-trust"``; None if nothing judges the number.
    reason : str
        Why the mark is not *trust*, or why there is no value.
    at : Where, optional
        Depth, frequency and speed.

    Examples
    --------
    >>> import palpate
    >>> stiffness = palpate.Quantity(2000.7, standard_error=0.3, systematic=0.4)
    >>> float(stiffness), stiffness.whole_error
    (2000.7, 0.5)
    >>> print(stiffness.combined.format("N/m"))
    2000.7 ± 0.5 N/m
    """

    value: float
    standard_error: float
    systematic: float
    mark: Mark | None = None
    reason: str = ""
    at: Where | None = None

    def __float__(self) -> float:
        return float(self.value)

    def __str__(self) -> str:
        mark = "" if self.mark is None else f" ({spoken(self.mark)})"
        return f"{self.combined.format()}{mark}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers; mark, reason and place if it has any of them."""
        whole = Plain.as_dict(self)
        known = self.mark is not None or bool(self.reason)
        return {name: whole[name] for name in (whole if known else _NUMBERS)}

    @property
    def whole_error(self) -> float:
        """Both standard errors together, hypot(statistical, systematic); NaN if one is unknown."""
        return math.hypot(self.standard_error, self.systematic)

    @property
    def combined(self) -> "Quantity":
        """The same with :attr:`whole_error` as its one standard error."""
        return replace(self, standard_error=self.whole_error, systematic=0.0)

    def scaled(self, factor: float) -> "Quantity":
        """Return the number multiplied by a factor: another one, which nothing has judged."""
        value, error, systematic = (factor * each for each in self.numbers)
        return Quantity(value, error, systematic)

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Value, statistical and systematic standard error."""
        return self.value, self.standard_error, self.systematic

    def format(self, unit: str = "") -> str:
        """Format value ± statistical ± systematic standard error, and a unit."""
        return with_error(self.value, self.standard_error, self.systematic, unit=unit)


_NUMBERS = "value", "standard_error", "systematic"
#: A number that is not given.
UNKNOWN = Quantity(math.nan, math.nan, math.nan)


@frozen
class WorkingDepth(Plain):
    """Force, stiffness and damping of the law at one depth, SI.

    Parameters
    ----------
    depth : float
        Below the surface, m.
    force : Quantity
        N.
    stiffness : Quantity
        ∂F/∂x, N/m.
    damping : Quantity
        Damping force over velocity at the motion's rms speed, N·s/m; ∂F/∂v for a linear damper.
    speed : float
        Velocity at which force and stiffness hold, m/s: 0, at rest, unless the probe moves one way
        at nearly one speed.

    Examples
    --------
    >>> import palpate
    >>> there = palpate.identify("examples/recordings/ball.csv").at(5e-3)
    >>> print(there.force.format("N"), there.stiffness.format("N/m"), sep=", ")
    9.982 ± 0.012 ± 0.004 N, 1999.2 ± 0.8 ± 0.9 N/m
    """

    depth: float
    force: Quantity
    stiffness: Quantity
    damping: Quantity
    speed: float = field(default=0.0, kw_only=True)

    def __repr__(self) -> str:
        if np.ndim(self.depth):
            return f"<WorkingDepth: numbers at {np.size(self.depth)} depths>"
        return f"<WorkingDepth at {format_quantity(self.depth, 'm')}: {self.numbers}>"

    @property
    def numbers(self) -> str:
        """Force, stiffness and damping with their marks, as text."""
        units = {"force": "N", "stiffness": "N/m", "damping": "N·s/m"}
        parts = []
        for name, unit in units.items():
            number: Quantity = getattr(self, name)
            mark = "" if number.mark is None else f" ({spoken(number.mark)})"
            parts.append(f"{name} {number.combined.format(unit)}{mark}")
        return ", ".join(parts)


def stack_depths(depths: Sequence[WorkingDepth], shape: tuple[int, ...]) -> WorkingDepth:
    """Combine the numbers at several depths into arrays of a shape; floats for ()."""
    rows = [
        (at.depth, *at.force.numbers, *at.stiffness.numbers, *at.damping.numbers, at.speed)
        for at in depths
    ]
    table = np.array(rows).T.reshape(11, *shape)
    depth, *numbers, speed = table if shape else table.tolist()
    quantities = (Quantity(*numbers[k : k + 3]) for k in (0, 3, 6))
    return WorkingDepth(depth, *quantities, speed=speed)


@frozen
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


@frozen(repr=False)
class Diagnosis(Plain):
    """Findings, marks and error bars of an identification.

    Parameters
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

    Examples
    --------
    >>> import palpate
    >>> diagnosis = palpate.identify("examples/recordings/ball.csv").diagnosis
    >>> diagnosis.verdict
    Verdict(stiffness='trust', damping='trust', overall='trust')
    >>> print(diagnosis.working_depth.stiffness)  # N/m
    2000.7 ± 0.8 (trust)
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    working_depths: tuple[WorkingDepth, ...]
    episodes: tuple[Episode, ...] = ()
    law_verdict: LawVerdict | None = None
    limits: tuple[Finding | None, Finding | None] = (None, None)

    def __repr__(self) -> str:
        at = self.working_depth
        return (
            f"<Diagnosis at {format_quantity(at.depth, 'm')}: {at.numbers}\n"
            f" {len(self.findings)} findings>"
        )

    def marked(self, frequency: float, *, relaxes: bool) -> "Diagnosis":
        """Return it with marks, reasons and places in the numbers at the working depth.

        Parameters
        ----------
        frequency : float
            ω of the motion, rad/s.
        relaxes : bool
            Whether the stiffness depends on it too.
        """
        at = self.working_depth
        marks = self.verdict.stiffness, self.verdict.damping
        for name, mark, limit in zip(("stiffness", "damping"), marks, self.limits, strict=True):
            quantity: Quantity = getattr(at, name)
            reason = "" if limit is None else limit.brief or limit.message
            error = quantity.whole_error
            size = quantity.value
            if limit is not None and limit.check is Check.PRECISION and size > 2.0 * error:
                reason = f"± {rough_percent(error / size)}, {reason}"
            often = frequency if relaxes or name == "damping" else math.nan
            has_value = math.isfinite(size)
            where = Where(at.depth, often, at.speed) if has_value else None
            judged = mark if has_value else None
            changed: Any = {name: replace(quantity, mark=judged, reason=reason, at=where)}
            at = replace(at, **changed)
        return replace(self, working_depths=(at, *self.working_depths[1:]))

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
        deciding = self.deciding
        return (
            "no problem found that would change the result"
            if deciding is None
            else deciding.message
        )

    @property
    def remedy(self) -> Remedy | None:
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


@frozen(eq=False)
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
        evidence = estimator.evidence()
        estimate = estimator.estimate()
        return cls(estimate.law, judge_evidence(evidence, estimate), evidence.longest)
