"""Estimates and diagnoses of a curve that was recorded without time.

The contact is at rest at every sample, so that no damper is fitted: numbers of rows are no time,
and in a press one way a damper would be collinear with the spring. The difference of loading and
unloading stays in the residual and widens the error bars.
"""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from palpate.findings import HOLD_WITHOUT_TIME, Check, Finding, NextStep, Remedy, worst
from palpate.force_laws.laws import Spring
from palpate.identification.diagnosis.misfit import misfit_without_time
from palpate.identification.diagnosis.outcome import UNKNOWN, Diagnosis
from palpate.identification.diagnosis.verdict import assemble_diagnosis
from palpate.method.estimators.estimate import Estimate, Trace
from palpate.validation import Floats

#: Indices of K and n among the parameters of Hunt–Crossley.
_SPRING = np.array([0, 2])

NO_TIME = Check.NO_TIME.finding(
    "the recording has no time: palpate gives the stiffness alone, and no damping",
    Remedy(NextStep.SAMPLE_TIMES),
    damping="do-not-trust",
    brief="the recording has no time",
)


class SpringEstimate(Estimate):
    """The spring of an estimate of the Hunt–Crossley law."""

    __slots__ = ()

    def __init__(self, estimate: Estimate) -> None:
        fixed = tuple(name for name in estimate.fixed if name in Spring.names())
        super().__init__(estimate, Spring, fixed)

    @property
    def parameters(self) -> Floats:
        """K and n."""
        both: Floats = super().parameters[_SPRING]
        return both

    @property
    def covariance(self) -> Floats:
        """Joint covariance of K and n."""
        block: Floats = super().covariance[np.ix_(_SPRING, _SPRING)]
        return block

    @property
    def joint_covariance(self) -> Floats:
        """The same with the offset."""
        places = np.array([*_SPRING, 3])
        block: Floats = super().joint_covariance[np.ix_(places, places)]
        return block

    @property
    def standard_errors(self) -> Floats:
        """Square roots of the covariance's diagonal."""
        errors: Floats = np.sqrt(np.diag(self.covariance))
        return errors

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the curve that do not need time."""
        return findings_without_time(super().findings)


def trace_without_time(trace: Trace) -> Trace:
    """Return the trace of the spring alone."""
    return replace(
        trace,
        parameters=trace.parameters[:, _SPRING],
        standard_errors=trace.standard_errors[:, _SPRING],
        validity_margin=np.full_like(trace.validity_margin, np.nan),
    )


def findings_without_time(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings that hold without time; a general misfit replaces others that mark S."""
    remaining = list[Finding]()
    marks = []
    for finding in findings:
        if finding.check in HOLD_WITHOUT_TIME:
            alone = replace(finding, damping="trust", moves_damping_percent=math.nan)
            remaining.append(finding if finding is NO_TIME else alone)
        else:
            marks.append(finding.stiffness)
    if (mark := worst(*marks)) != "trust":
        remaining.append(misfit_without_time(mark))
    return tuple(remaining)


def diagnosis_without_time(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis of the stiffness alone."""
    depths = [replace(depth, damping=UNKNOWN) for depth in diagnosis.working_depths]
    return assemble_diagnosis((*findings_without_time(diagnosis.findings), NO_TIME), depths)
