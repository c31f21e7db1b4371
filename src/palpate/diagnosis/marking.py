"""From causes to findings: which is named, how sure, and what mark it earns."""

from dataclasses import dataclass, replace

from palpate.diagnosis.cause import SIGNIFICANT, Cause
from palpate.diagnosis.finding import Finding, Mark, severity_of, worst
from palpate.diagnosis.fit import Fit

# How far a cause moves the numbers: judgement, not calibration.
CARE = 0.05
STOP_STIFFNESS, STOP_DAMPING = 0.20, 0.50
STOP_CHANGE = 0.15
NOISE_LIKE = 1.5  # misfit over the noise floor, below which a small cause is but a note
# The surface is named before a cause that removes so little more, in a fit that is no worse: looked
# up on recordings, not calibrated.
NEAR, MOST_UNEXPLAINED = 0.25, 0.15
ALIKE = 0.7  # of the named cause's gain: such a rival's influence counts in full
SURE = 0.6  # (1 − g₁)/(1 − g₂) below which a cause is named by itself


@dataclass(frozen=True, slots=True)
class Judged:
    """Findings of the causes, and what they may be wrong by.

    Attributes
    ----------
    findings : list of Finding
        One for each significant cause, the named one first.
    counted : tuple of (Cause, float)
        The causes that may have moved stiffness and damping, each with its weight.
    damping : float
        Least systematic part of the damping, of its size.
    """

    findings: list[Finding]
    counted: tuple[tuple[Cause, float], ...] = ()
    damping: float = 0.0

    def systematic(self, fit: Fit) -> tuple[float, float]:
        """Systematic parts of stiffness and damping at the fit's working depth, of their size."""
        moved = [(weight, *cause.moves(fit)) for cause, weight in self.counted]
        stiffness = max((weight * abs(s) for weight, s, _ in moved), default=0.0)
        return stiffness, max((self.damping, *(weight * abs(c) for weight, _, c in moved)))


def judge(causes: list[Cause], ratio: float, unexplained: float) -> Judged:
    """Name one of the significant causes, and weigh all of them.

    Parameters
    ----------
    causes : list of Cause
        All that were tried.
    ratio : float
        Misfit over the noise floor.
    unexplained : float
        Fraction of the force that the law leaves.
    """
    significant = sorted(
        (cause for cause in causes if cause.z > SIGNIFICANT), key=lambda c: c.gain, reverse=True
    )
    if not significant:
        return Judged([])
    named = _named(significant, unexplained)
    rivals = [c for c in significant if c is not named and not _explained_by(named, c)]
    findings = [_finding(_in_doubt(named, rivals), 1.0, ratio, leading=True)]
    highest = max(named.gain, 1e-9)
    for rival in rivals:
        weight = 0.5 if rival.gain > 0.5 * highest else 0.25
        findings.append(_finding(rival, weight, ratio, leading=False))
    counted = [(named, 1.0)] if not (named.small and ratio < NOISE_LIKE) else []
    for rival in rivals:
        if rival.name == "offset drift" or (rival.small and ratio < NOISE_LIKE):
            continue
        relative = rival.gain / highest
        counted.append((rival, 1.0 if relative > ALIKE else 0.5 * relative))
    return Judged(findings, tuple(counted))


def _named(significant: list[Cause], unexplained: float) -> Cause:
    """The largest gain; the surface, which hardly shows in the residual, where it comes near."""
    first = significant[0]
    for cause in significant:
        near = first.gain - max(cause.gain, 0.0) < NEAR
        if cause.name == "surface" and unexplained < MOST_UNEXPLAINED and near:
            return cause
    return first


def _explained_by(named: Cause, rival: Cause) -> bool:
    """Whether a change is only what borders anywhere fit of another cause.

    Borders are sought, so they fit some of any misfit: a change that explains far less than the
    named cause was listed for one in ten stationary recordings.
    """
    if rival.name != "change" or named.family == rival.family:
        return False
    less = rival.gain < ALIKE * named.gain or _surely(named, rival)
    return named.name == "surface" or less


def _surely(named: Cause, rival: Cause) -> bool:
    return (1.0 - named.gain) < SURE * (1.0 - rival.gain)


def _in_doubt(named: Cause, rivals: list[Cause]) -> Cause:
    """Say the second cause too, unless the first explains far more."""
    others = [rival for rival in rivals if rival.family != named.family]
    if not others:
        return named
    second = max(others, key=lambda cause: cause.gain)
    if named.name == "surface" or _surely(named, second):
        return named
    return replace(named, sentence=f"{named.sentence}; or {second.sentence}")


def _finding(cause: Cause, weight: float, ratio: float, *, leading: bool) -> Finding:
    stiffness = mark_of(weight * abs(cause.stiffness), STOP_STIFFNESS)
    damping = mark_of(weight * abs(cause.damping), STOP_DAMPING)
    if cause.name == "change" and abs(cause.stiffness) > STOP_CHANGE:
        stiffness = damping = "do-not-trust"
    if not leading:  # a rival is not what happened, so at most care
        stiffness, damping = (
            "with-care" if mark == "do-not-trust" else mark for mark in (stiffness, damping)
        )
    overall: Mark = "trust"
    if cause.small and ratio < NOISE_LIKE:
        stiffness = damping = "trust"
    elif leading or worst(stiffness, damping) != "trust":
        overall = worst(stiffness, "with-care")
    return Finding(
        cause.name,
        cause.sentence,
        cause.remedy,
        cause.z,
        stiffness,
        damping,
        severity_of(overall),
        100.0 * cause.stiffness,
        100.0 * cause.damping,
    )


def mark_of(moved: float, stop: float) -> Mark:
    """The mark of a number that is moved so far, of its size."""
    if moved > stop:
        return "do-not-trust"
    return "with-care" if moved > CARE else "trust"
