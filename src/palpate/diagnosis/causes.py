"""Causes of misfit: what one would explain, which is named, and how much each counts."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Protocol

import numpy as np

from palpate.diagnosis.fit import MISFIT, SIGNIFICANT, AugmentedFit, Fit, fit_with_column
from palpate.findings import Check, Finding
from palpate.force_laws import ForceLaw
from palpate.validation import Floats

# How far a cause changes stiffness and damping: values, from which the change at any depth follows.


class LawChange(Protocol):
    """How a cause changes the law."""

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness and damping at the fit's depth over their scales."""


@dataclass(frozen=True, slots=True, eq=False)
class ParameterChange:
    """A linear change of the law's parameters, in the fit's units."""

    parameters: Floats

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness and damping at the fit's depth over their scales."""
        return fit.relative_change(self.parameters)


@dataclass(frozen=True, slots=True, eq=False)
class OtherLaw:
    """Another law in place of one, in the units of the fit."""

    law: ForceLaw
    before: ForceLaw

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness and damping at the fit's depth over their scales."""
        numbers = fit.stiffness(self.law), fit.damping(self.law)
        return fit.relative_difference(numbers, self.before)


@dataclass(frozen=True, slots=True)
class MisfitHypothesis:
    """What one cause would explain in addition to the law.

    Attributes
    ----------
    check : Check
        The cause.
    z : float
        Its coefficient in standard errors, for a correlated residual.
    explained_fraction : float
        Fraction of the residual's energy that it removes.
    parameter : float
        Relative change of the law's stiffness parameter.
    sentence : str
        What would have happened.
    remedy : str
        The next step.
    change : LawChange
        How it changes the law.
    stiffness, damping : float
        Relative change of both at the depth of the fit in which it was found.
    fits_to_noise : bool
        Whether it explains the force to the noise, so that no other cause is needed.
    """

    check: Check
    z: float
    explained_fraction: float
    parameter: float
    sentence: str
    remedy: str
    change: LawChange
    stiffness: float
    damping: float
    fits_to_noise: bool = True

    @property
    def group(self) -> Check:
        """Drift and change are one, a slow change of the material; so are a delay and its jump."""
        groups = {Check.GAIN_DRIFT: Check.CHANGE, Check.SKEW_JUMP: Check.DELAY}
        return groups.get(self.check, self.check)

    @property
    def negligible(self) -> bool:
        """Whether it changes S and C by less than 2 %, K by less than 3 %.

        Half an encoder count is a dead band; it is significant on a stiff material and changes the
        damping by 1 %: in 18 of 200 clean runs of the robot.
        """
        changed = max(abs(self.stiffness), abs(self.damping))
        return changed < 0.02 and abs(self.parameter) < 0.03


Search = Callable[[Fit], list[MisfitHypothesis]]


def cause_from_column(
    fit: Fit,
    check: Check,
    result: AugmentedFit,
    sentence: str,
    remedy: str,
    change: LawChange | None = None,
) -> MisfitHypothesis:
    """Return the cause that a column describes; ``change``: default, that of the parameters."""
    law, moved = fit.solution.law, result.change
    # Relative change of the law's first parameter, SI: Δk/k − Δn ln x_r for a power law.
    parameter = float(moved[0]) / max(abs(float(law.parameters[0])), 1e-300)
    if law.power_law:
        parameter -= float(moved[2]) * math.log(fit.units.depth)
    left = fit.residual_to_noise * math.sqrt(max(1.0 - result.explained_fraction, 0.0))
    change = change or ParameterChange(moved)
    return MisfitHypothesis(
        check,
        result.z,
        result.explained_fraction,
        parameter,
        sentence,
        remedy,
        change,
        *change.relative(fit),
        fits_to_noise=check is not Check.SHAPE or left < MISFIT,
    )


def causes_from_columns(
    fit: Fit,
    columns: Mapping[Check, Floats],
    explain: Callable[[Fit, Check, float], tuple[str, str] | None],
) -> list[MisfitHypothesis]:
    """Fit one column at a time together with the law's own.

    Parameters
    ----------
    fit : Fit
        The fit.
    columns : mapping
        For each cause a column at the samples of the windows, N.
    explain : callable
        Describes a cause of a given amount, and the next step; None: it is not that cause.
    """
    causes = []
    means = fit.windows.mean(np.array([*columns.values()]).T).T
    for check, column in zip(columns, means, strict=True):
        result = fit_with_column(fit, column)
        words = None if result is None else explain(fit, check, result.amount)
        if result is not None and words is not None:
            causes.append(cause_from_column(fit, check, result, *words))
    return causes


def relative_time(fit: Fit) -> Floats:
    """Return the time at the samples of the windows, from −½ to ½."""
    time = fit.data.time[fit.windows.samples]
    relative: Floats = (time - time.mean()) / (float(np.ptp(time)) or 1.0)
    return relative


# Which cause is named, and how much of each is in the error bars.

# Causes of the material. Where a law was selected they change no bar: it has them, or not.
MATERIAL = frozenset([
    Check.MEMORY, Check.DAMPING_FORM, Check.DAMPING_WITH_DEPTH, Check.SHAPE, Check.SQUARE_SPEED,
])  # fmt: skip
# A relative change that matters: judgement, not calibration.
CARE = 0.05
# The surface is named before a cause that removes so little more, in a fit that is no worse: looked
# up on recordings, not calibrated.
NEAR, MOST_UNEXPLAINED = 0.25, 0.15
ALIKE = 0.7  # of the leading cause's explained fraction: such a rival counts in full
SURE = 0.6  # (1 − g₁)/(1 − g₂) below which a cause is named by itself
SOUGHT = (Check.CHANGE, Check.SKEW_JUMP)  # among borders
UNDETECTED = (Check.FRICTION, Check.DELAY)
UNDETECTED_ERRORS = 2.0
MATTERS = 0.02  # of a number


@dataclass(frozen=True, slots=True)
class CauseAssessment:
    """The significant causes, and what all of them may do to stiffness and damping.

    Attributes
    ----------
    findings : list of Finding
        One for each significant cause, the leading one first.
    counted : tuple of (MisfitHypothesis, float)
        The causes that may have changed stiffness and damping, each with its weight.
    undetected : tuple of float
        Relative change of both by causes that are not significant.
    """

    findings: list[Finding]
    counted: tuple[tuple[MisfitHypothesis, float], ...] = ()
    undetected: tuple[float, float] = (0.0, 0.0)

    @property
    def leading(self) -> str | None:
        """The check of the leading cause."""
        return self.findings[0].check if self.findings else None


def assess_causes(
    causes: list[MisfitHypothesis],
    unexplained: float,
    *,
    at_noise_floor: bool,
    law_selected: bool = False,
) -> CauseAssessment:
    """Name one of the significant causes, and weigh all of them.

    Parameters
    ----------
    causes : list of MisfitHypothesis
        All that were tried.
    unexplained : float
        Fraction of the force that the law leaves.
    at_noise_floor : bool
        Whether what it leaves is little more than noise.
    law_selected : bool
        Whether the law was selected, so that causes of the material are its own.
    """
    significant = [cause for cause in causes if cause.z > SIGNIFICANT]
    significant.sort(key=attrgetter("explained_fraction"), reverse=True)
    undetected = _sum_undetected(causes)
    if not significant:
        return CauseAssessment([], undetected=undetected)
    leading = _leading_cause(significant, unexplained)
    rivals = [c for c in significant if c is not leading and not _is_subsumed(leading, c)]
    shown = [_mention_alternative(leading, rivals), *rivals]
    findings = [_cause_finding(cause, at_noise_floor=at_noise_floor) for cause in shown]
    excluded = MATERIAL if law_selected else frozenset()
    highest = max(leading.explained_fraction, 1e-9)
    counted = []
    for cause in (leading, *rivals):
        minor = cause.negligible and at_noise_floor
        if minor or cause.check in excluded:
            continue
        if cause is leading:
            counted.append((cause, 1.0))
        elif cause.check is not Check.OFFSET_DRIFT:
            relative = cause.explained_fraction / highest
            counted.append((cause, 1.0 if relative > ALIKE else 0.5 * relative))
    return CauseAssessment(findings, tuple(counted), undetected)


def _sum_undetected(causes: list[MisfitHypothesis]) -> tuple[float, float]:
    """Return how far friction or a skew that is not significant may change both numbers.

    Each counts by its estimate, or by two standard errors of that if they are larger; a change that
    matters to nobody does not count.
    """
    changes = [(0.0, 0.0)]
    for cause in causes:
        if cause.check in UNDETECTED and 0.0 < cause.z <= SIGNIFICANT:
            wide = max(1.0, UNDETECTED_ERRORS / cause.z)
            changes.append((wide * abs(cause.stiffness), wide * abs(cause.damping)))
    stiffness, damping = np.max(changes, axis=0).tolist()
    return stiffness * (stiffness > MATTERS), damping * (damping > MATTERS)


def _leading_cause(significant: list[MisfitHypothesis], unexplained: float) -> MisfitHypothesis:
    """Return the cause that explains most; or the surface, where it explains nearly as much.

    The surface hardly shows in the residual. It is not named where the first is clearly better: a
    surface fits some of any damper of another form.
    """
    first = significant[0]
    for cause in significant:
        less = first.explained_fraction - max(cause.explained_fraction, 0.0)
        near = cause is first or (less < NEAR and not _clearly_better(first, cause))
        if cause.check is Check.SURFACE and unexplained < MOST_UNEXPLAINED and near:
            return cause
    return first


def _is_subsumed(leading: MisfitHypothesis, rival: MisfitHypothesis) -> bool:
    """Whether a change, or a jump, is only what a border anywhere fits of another cause.

    Borders are searched for, so they fit some of any misfit: a change that explains far less than
    the leading cause was listed for one in ten stationary recordings.
    """
    if rival.check not in SOUGHT or leading.group == rival.group:
        return False
    less = rival.explained_fraction < ALIKE * leading.explained_fraction
    return leading.check is Check.SURFACE or less or _clearly_better(leading, rival)


def _clearly_better(first: MisfitHypothesis, second: MisfitHypothesis) -> bool:
    return (1.0 - first.explained_fraction) < SURE * (1.0 - second.explained_fraction)


def _mention_alternative(
    leading: MisfitHypothesis, rivals: list[MisfitHypothesis]
) -> MisfitHypothesis:
    """Return the leading cause with the second in its sentence, unless it is clearly better."""
    others = [rival for rival in rivals if rival.group != leading.group]
    if not others:
        return leading
    second = max(others, key=attrgetter("explained_fraction"))
    if leading.check is Check.SURFACE or _clearly_better(leading, second):
        return leading
    return replace(leading, sentence=f"{leading.sentence}, or {second.sentence}")


def _cause_finding(cause: MisfitHypothesis, *, at_noise_floor: bool) -> Finding:
    """Return a cause as a finding; no single law describes a change of material or adhesion."""
    uncertain = cause.check.may_cap and not (cause.negligible and at_noise_floor)
    return cause.check.finding(
        cause.sentence,
        cause.remedy,
        cause.z,
        mark="with-care" if uncertain else "trust",
        moves_percent=(100.0 * cause.stiffness, 100.0 * cause.damping),
    )
