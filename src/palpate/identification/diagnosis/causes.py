"""Causes of misfit: errors of real rigs, the effect of each cause, the one to name, weights."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np

from palpate.digits import rounded
from palpate.findings import MAY_CAP, Check, Finding, NextStep, Remedy
from palpate.force_laws import ForceLaw
from palpate.identification.diagnosis.fit import SIGNIFICANT, AugmentedFit, Fit, fit_with_column
from palpate.validation import Floats, frozen

# A skew δ between the clocks of force and position is a force that is δ late. For a law that
# relaxes, and for the damper of a half-space, B′ = B − K′ δ exactly: no recording of the material
# shows it. A touch of a spring shows it, or a payload that turns in free air, or a clock that both
# share; the contact's delay holds it.

#: Skew between force and position that is assumed possible if nothing is known of their clocks, s.
#: Half a sample at 66 Hz would instead give 140 % to a damping that repeats to 8 %.
USUAL_SKEW = 1e-3


class Clock(NamedTuple):
    """The skew that may be left between force and position.

    Attributes
    ----------
    error : float
        Its standard deviation, s; 0 if nothing but the fit of the law shows it.
    is_known : bool
        Whether something other than the contact's law shows it. No skew that is assumed makes the
        damping of a law that hides it safe to trust (``benchmarks.known_clock``).
    reason : str
        End of the sentence *the damping is known to ± 20 %, …*.
    remedy : NextStep
        What shows it better.
    """

    error: float
    is_known: bool
    reason: str
    remedy: NextStep


def clock_of(fit: Fit) -> Clock:
    """Return what is known of the clocks of a fit's recording."""
    applied = fit.data.contact.delay
    if applied is not None:
        two = applied.from_contact and has_two_clocks(fit)
        what = "clocks' offset" if two else "delay"
        remedy = NextStep.ONE_CLOCK if two and applied.found else NextStep.IN_STEP
        reason = f"by the standard error of the {what}"
        # Two clocks may be one: then a law that shows the skew knows it better than the offset.
        left_alone = applied.from_contact and not applied.found
        error = 0.0 if left_alone and shows_skew(fit) else applied.standard_error
        return Clock(error, not applied.from_contact, reason, remedy)
    least_delay = 0.0 if fit.response is None else fit.response.delay
    error = 0.0 if shows_skew(fit) else max(USUAL_SKEW, least_delay)
    reason = f"since {rounded(1e3 * error, 2)} ms of skew between force and position is possible"
    return Clock(error, False, reason, NextStep.IN_STEP)


def shows_skew(fit: Fit) -> bool:
    """Whether the law distinguishes a skew from damping.

    A skew τ adds K n xⁿ⁻¹ v τ, which differs from the damping force B xⁿ v of Hunt–Crossley but not
    from the force of half-space damping, of a linear damper or of a relaxation branch.
    """
    law: ForceLaw = fit.given.estimate.law
    return law.power_law


def has_two_clocks(fit: Fit) -> bool:
    """Whether palpate found the offset between the clocks of position and force."""
    return any(each.check == Check.CLOCK_OFFSET for each in fit.data.contact.findings)


# Errors of real rigs that a recording may contain: their prior widths, and what is left of each.
#
# The amount a of a nuisance is 0, or with the odds π normal around 0 with the width p of its row in
# NUISANCES. The recording estimates it as A ± s, the coefficient of its column in the fit.
# With w = p²/(p² + s²) the amount, if the nuisance is present, is w A with the variance w s², and
#
#     log P/(1 − P) = log π/(1 − π) + ½ log(1 − w) + ½ w (A/s)²
#
# is the probability P that it is present (spike and slab; Mitchell & Beauchamp 1988). What is left
# of it in a number Q is √(P (w² A² + w s²)) ∂Q/∂a: little if the recording excludes the nuisance,
# and √π p ∂Q/∂a if the recording does not show it at all.

# Prior odds of a nuisance. Chosen with the widths by the log score of the bars on seeds 0 to 300 of
# ``benchmarks.diagnosis.mix`` and on a second bank; half or twice of them costs 0.1 nat at most.
ODDS = 0.05
# A force that a sensor bends differs from one that a material bends in no recording, and materials
# of another shape are common.
GAIN_ODDS = 0.002
# Odds of a skew of known clocks: its standard error is that of what shows it, and needs no factor.
CERTAIN = 1.0 - 1e-9
# Factor on what is not detected: it is rarely normal. Chosen with the odds.
FACTOR = 1.3


class Nuisance(NamedTuple):
    """A prior of one nuisance.

    Attributes
    ----------
    width : float
        Standard deviation where it is present, in its unit.
    unit : callable
        One unit of the amount, as a coefficient of the column.
    sentence : str
        End of the sentence *the damping is known to ± 20 %, …* if it may be present.
    odds : float
        Prior probability that it is present.
    """

    width: float
    unit: Callable[[Fit], float]
    sentence: str
    odds: float = ODDS


def _second(fit: Fit) -> float:
    return 1.0


def _elastic_force(fit: Fit) -> float:
    """At the median depth."""
    return abs(float(fit.solution.law.force(fit.reference / fit.units.depth, 0.0)))


def _peak_force(fit: Fit) -> float:
    return fit.data.peak_force


def _gain_at_peak(fit: Fit) -> float:
    """The column's coefficient is the change of the gain up to the working force."""
    force = abs(fit.force_at_depth(fit.solution.law))
    return force / max(fit.data.peak_force, 1e-300)


def _damping_force(fit: Fit) -> float:
    """At the rms speed; at least 2 % of the elastic force."""
    damper = float(fit.solution.law.damping_at(fit.reference / fit.units.depth))
    return max(abs(damper) * fit.speed / fit.units.speed, 0.02 * _elastic_force(fit))


def _mass(fit: Fit) -> float:
    """Its inertia at the rms acceleration is the peak force."""
    acceleration = math.sqrt(float((fit.acceleration**2).mean()))
    return fit.data.peak_force / max(acceleration, 1e-300)


NUISANCES: Mapping[Check, Nuisance] = {
    # s. Two channels of one controller differ by a filter of 50–100 Hz or one cycle of 500 Hz.
    Check.DELAY: Nuisance(2e-3, _second, "a delay between force and position"),
    # Fraction of the elastic force: a tip slides where the motion is not normal.
    Check.FRICTION: Nuisance(0.05, _elastic_force, "friction that grows with the load"),
    # Fraction of the peak force: seals and linear guides between sensor and probe rub.
    Check.GUIDE_FRICTION: Nuisance(0.01, _peak_force, "friction of a guide"),
    # Fraction of the peak force: the tip beyond a sensor is about 1 % of what moves.
    Check.INERTIA: Nuisance(0.02, _mass, "a mass beyond the sensor"),
    # Fraction of the elastic force at the rms speed: fluid is pressed out.
    Check.SQUARE_SPEED: Nuisance(0.05, _elastic_force, "damping that grows with the speed"),
    # Fraction of the peak force during the recording: strain gauges warm up.
    Check.OFFSET_DRIFT: Nuisance(0.03, _peak_force, "drift of the force sensor"),
    # Change of the gain between no and the peak force. A bend of b lies b/4 off the line between
    # its ends: load cells are specified to 0.1 to 1 % of their range.
    Check.SENSOR_GAIN: Nuisance(0.04, _gain_at_peak, "a curved sensor gain", GAIN_ODDS),
    # Change of the gain during the recording: materials soften, or sensors warm up.
    Check.SLOW_CHANGE: Nuisance(0.05, _second, "softening or a drifting gain"),
    # Fraction of the damping force: half-space and Hunt–Crossley damping differ by as much over
    # depths of one to three.
    Check.DAMPING_FORM: Nuisance(0.4, _damping_force, "damping of another form"),
}


def _prior(fit: Fit, check: Check) -> Nuisance | None:
    """Return the prior of a nuisance; that of a skew which the law shows is a known clock's error.

    Beside a law that hides a skew, its column stands for damping of another form.
    """
    prior = NUISANCES.get(check)
    if prior is None or check is not Check.DELAY or not shows_skew(fit):
        return prior
    clock = clock_of(fit)
    return prior._replace(width=clock.error, odds=CERTAIN) if clock.is_known else prior


def remaining_part(fit: Fit, check: Check, amount: float, z: float) -> float:
    """Return the multiple of an estimated amount that may remain: √(P (w² A² + w s²))/|A|.

    :data:`FACTOR` times as much of what is not detected; 0 for a check that is no nuisance. With
    ``z`` = |A|/s.
    """
    prior = _prior(fit, check)
    size = abs(amount) / prior.unit(fit) if prior is not None else 0.0
    if prior is None or not 0.0 < size < math.inf:
        return 0.0
    error = size / max(z, 1e-9)
    shrinkage = prior.width**2 / (prior.width**2 + error**2)
    log_odds = math.log(prior.odds / (1.0 - prior.odds))
    log_odds += 0.5 * math.log(max(1.0 - shrinkage, 1e-300)) + 0.5 * shrinkage * z**2
    present = 1.0 / (1.0 + math.exp(-max(log_odds, -700.0)))
    factor = 1.0 if z > SIGNIFICANT or prior.odds == CERTAIN else FACTOR
    return factor * math.sqrt(present * ((shrinkage * size) ** 2 + shrinkage * error**2)) / size


# Changes of stiffness and damping due to a cause. They are frozen values, so that the change can be
# computed at any depth.


@frozen(eq=False)
class ParameterChange:
    """A linear change of the parameters of a law, in the fit's units, and an added branch.

    It is linear, n Δk + k Δn: the product of large changes would give 34 % instead of 2 %. The
    stiffness and the damping [s] of the relaxation branch are multiples of the law's stiffness.
    """

    law: ForceLaw
    parameters: Floats
    branch: tuple[float, float] | None = None

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness and damping at the fit's depth over their scales."""
        changes = fit.gradients[1:] @ self.parameters[: len(self.law.symbols)]
        if self.branch is not None:
            changes = changes + fit.stiffness(self.law) * np.array(self.branch)
        return fit.relative_changes(changes)


@frozen(eq=False)
class OtherLaw:
    """Replacement of a law by another with a surface that is deeper, in the fit's units."""

    law: ForceLaw
    before: ForceLaw
    deeper: float = 0.0

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness and damping at the fit's depth over their scales."""
        place = fit.depth / fit.units.depth
        if self.deeper:
            place = max(place - self.deeper, 0.05)
        after = np.array(self.law.at_rest(place)[1:]) / (fit.units.depth, fit.units.speed)
        return fit.relative_changes(after - fit.force_stiffness_damping(self.before)[1:])


@frozen(eq=False)
class SeveralLaws:
    """Consecutive laws, SI; the one whose stiffness differs most counts."""

    laws: tuple[ForceLaw, ...]

    def relative(self, fit: Fit) -> tuple[float, float]:
        """Return the change of stiffness at the fit's depth over its scale, and 0 for damping."""
        pooled = fit.stiffness(fit.solution.law)
        changes = (fit.stiffness(fit.units.to_local(law)) - pooled for law in self.laws)
        return fit.relative_changes(np.array([max(changes, key=abs), 0.0]))


LawChange: TypeAlias = ParameterChange | OtherLaw | SeveralLaws


@frozen
class MisfitHypothesis:
    """Result of fitting one cause in addition to the law.

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
        Description of the cause.
    remedy : Remedy, optional
        The next step.
    change : LawChange
        Its change of the law.
    stiffness, damping : float
        Relative change of both at the depth of the fit in which it was found.
    amount : float
        Coefficient of its column; 0 for a search without one.
    """

    check: Check
    z: float
    explained_fraction: float
    parameter: float
    sentence: str
    remedy: Remedy | None
    change: LawChange
    stiffness: float
    damping: float
    amount: float = 0.0

    @property
    def group(self) -> Check:
        """The check that this one counts as: drift as a change, a jump of the delay as a delay."""
        groups = {Check.SLOW_CHANGE: Check.CHANGE, Check.SKEW_JUMP: Check.DELAY}
        return groups.get(self.check, self.check)

    @property
    def negligible(self) -> bool:
        """Whether it changes S and C by less than 2 % and K by less than 3 %.

        A dead band of half an encoder count is such a cause: on a stiff material it is significant
        and changes the damping by 1 %, in 18 of 200 clean runs of the robot.
        """
        changed = max(abs(self.stiffness), abs(self.damping))
        return changed < 0.02 and abs(self.parameter) < 0.03


Search = Callable[[Fit], list[MisfitHypothesis]]


def cause_from_column(
    fit: Fit,
    check: Check,
    result: AugmentedFit,
    sentence: str,
    remedy: Remedy | None,
    change: LawChange | None = None,
) -> MisfitHypothesis:
    """Return the cause that a column describes.

    ``change``: default, the change of the parameters in the fit with the column.
    """
    law = fit.solution.law
    parameter_changes = result.change
    # Relative change of the law's first parameter, SI: Δk/k − Δn ln x_r for a power law.
    parameter = float(parameter_changes[0]) / max(abs(float(law.parameters[0])), 1e-300)
    if law.power_law:
        parameter -= float(parameter_changes[2]) * math.log(fit.units.depth)
    change = change or ParameterChange(law, parameter_changes)
    numbers = (result.z, result.explained_fraction)
    changes = change.relative(fit)
    return MisfitHypothesis(
        check, *numbers, parameter, sentence, remedy, change, *changes, result.amount
    )


def causes_from_columns(
    fit: Fit,
    columns: Mapping[Check, Floats],
    explain: Callable[[Fit, Check, float], tuple[str, Remedy | None] | None],
) -> list[MisfitHypothesis]:
    """Fit columns one at a time together with the law's columns.

    Parameters
    ----------
    fit : Fit
        The fit.
    columns : mapping
        For each cause a column at the samples of the windows, N.
    explain : callable
        Returns the sentence and the remedy for a cause and its amount, or None if the amount
        excludes the cause.
    """
    causes = []
    means = fit.windows.mean(np.array([*columns.values()]).T).T
    for check, column in zip(columns, means, strict=True):
        result = fit_with_column(fit, column)
        if result is not None and (explanation := explain(fit, check, result.amount)) is not None:
            causes.append(cause_from_column(fit, check, result, *explanation))
    return causes


def relative_time(fit: Fit) -> Floats:
    """Return the time at the samples of the windows, scaled to −½ … ½."""
    time = fit.data.time[fit.windows.samples]
    relative: Floats = (time - time.mean()) / (float(np.ptp(time)) or 1.0)
    return relative


#: Friction reaches tanh 1 of its full force at 1/20 of the rms speed.
RISE = 20.0

# Which cause is named, and how much of each is in the error bars.

# Causes that the selection of a law has decided; they widen no bar of a selected law.
SELECTED = frozenset([
    Check.MEMORY, Check.DAMPING_FORM, Check.DAMPING_WITH_DEPTH, Check.SHAPE,
])  # fmt: skip
CARE = 0.05  # relative change that calls for care; chosen by hand
# The surface is named instead of the leading cause if it removes at most this much less and the law
# leaves at most this fraction of the force; chosen by hand on recordings.
NEAR = 0.25
MOST_UNEXPLAINED = 0.15
ALIKE = 0.7  # a rival that explains more than this fraction of the leading cause's counts in full
SURE = 0.6  # (1 − g₁)/(1 − g₂) below which the first cause is named without the second
SOUGHT = (Check.CHANGE, Check.SKEW_JUMP)  # found by a search over borders
# Half of a significant cause that is no nuisance counts, because another may be the true one.
OTHER_CAUSE = 0.5


@frozen
class CauseAssessment:
    """The significant causes, and the effect of all causes on stiffness and damping.

    Attributes
    ----------
    findings : list of Finding
        One for each significant cause, the leading one first.
    counted : tuple of (MisfitHypothesis, float)
        The causes that may have changed stiffness and damping, and the multiple of the change of
        each that is in the error bars.
    """

    findings: list[Finding]
    counted: tuple[tuple[MisfitHypothesis, float], ...] = ()


def assess_causes(fit: Fit, causes: list[MisfitHypothesis], unexplained: float) -> CauseAssessment:
    """Choose the leading cause among the significant ones, and weigh all of them.

    A selected law already includes causes of the material.

    Parameters
    ----------
    fit : Fit
        The fit.
    causes : list of MisfitHypothesis
        All causes that were fitted.
    unexplained : float
        Fraction of the force that the law does not explain.
    """
    significant = [cause for cause in causes if cause.z > SIGNIFICANT]
    significant.sort(key=attrgetter("explained_fraction"), reverse=True)
    # The selection of a law that relaxes has compared the forms of its damping.
    decided = () if fit.equivalent is None else (Check.DAMPING_FORM,)
    hidden = (cause for cause in causes if cause.z <= SIGNIFICANT)
    possible = [(cause, 1.0) for cause in hidden if cause.check not in decided]
    findings: list[Finding] = []
    if significant:
        leading = _leading_cause(significant, unexplained)
        rivals = [c for c in significant if c is not leading and not _is_subsumed(leading, c)]
        possible += _weigh_causes(fit, leading, rivals)
        perhaps = (replace(rival, sentence=f"perhaps {rival.sentence}") for rival in rivals)
        shown = [_mention_alternative(leading, rivals), *perhaps]
        findings = [_cause_finding(cause, at_noise_floor=fit.at_noise_floor) for cause in shown]
    counted = ((cause, weight * _remaining_multiple(fit, cause)) for cause, weight in possible)
    return CauseAssessment(findings, tuple(pair for pair in counted if pair[1] > 0.0))


def _remaining_multiple(fit: Fit, cause: MisfitHypothesis) -> float:
    """Return the multiple of a cause's change that is in the error bars."""
    if cause.z > SIGNIFICANT and cause.check not in NUISANCES:
        return OTHER_CAUSE
    return remaining_part(fit, cause.check, cause.amount, cause.z)


def _weigh_causes(
    fit: Fit, leading: MisfitHypothesis, rivals: list[MisfitHypothesis]
) -> list[tuple[MisfitHypothesis, float]]:
    """Return the significant causes that may have changed the numbers, each with its weight."""
    decided = frozenset() if fit.response is None else SELECTED
    if fit.equivalent is not None:  # a material of another shape, before a curved sensor
        decided |= {Check.SENSOR_GAIN}
    highest = max(leading.explained_fraction, 1e-9)
    weighed = []
    for cause in (leading, *rivals):
        relative = cause.explained_fraction / highest
        is_leading = cause is leading
        minor = cause.negligible and fit.at_noise_floor
        drift = cause.check is Check.OFFSET_DRIFT and not is_leading
        if not (minor or drift or cause.check in decided or cause.check is Check.SQUARE_SPEED):
            weighed.append((cause, 1.0 if is_leading or relative > ALIKE else 0.5 * relative))
    return weighed


def _leading_cause(significant: list[MisfitHypothesis], unexplained: float) -> MisfitHypothesis:
    """Return the cause that explains most, or the surface if it explains nearly as much.

    A wrong surface changes the residual little. The surface is not named if the first cause is
    clearly better, because moving the surface fits part of any damping of another form. A material
    comes before a sensor that explains about as much.
    """
    first = significant[0]
    for cause in significant:
        shortfall = first.explained_fraction - max(cause.explained_fraction, 0.0)
        is_near = cause is first or (shortfall < NEAR and not clearly_better(first, cause))
        if cause.check is Check.SURFACE and unexplained < MOST_UNEXPLAINED and is_near:
            return cause
    if first.check.subject != "sensor" or first.check is Check.DELAY:
        return first  # the sentence of a delay names the damping too
    least = ALIKE * first.explained_fraction
    material = (
        cause
        for cause in significant
        if cause.check.subject == "material" and cause.explained_fraction > least
    )
    return next((each for each in material if not clearly_better(first, each)), first)


def _is_subsumed(leading: MisfitHypothesis, rival: MisfitHypothesis) -> bool:
    """Whether a change, or a jump of the delay, only fits part of the leading cause.

    A search over borders fits part of any misfit: without this rule one in ten stationary
    recordings had a change that explains far less than the leading cause.
    """
    if rival.check not in SOUGHT or leading.group == rival.group:
        return False
    explains_less = rival.explained_fraction < ALIKE * leading.explained_fraction
    return leading.check is Check.SURFACE or explains_less or clearly_better(leading, rival)


def clearly_better(
    first: MisfitHypothesis | AugmentedFit, second: MisfitHypothesis | AugmentedFit
) -> bool:
    """Whether a cause or column leaves far less of the residual's energy than another."""
    return (1.0 - first.explained_fraction) < SURE * (1.0 - second.explained_fraction)


def _mention_alternative(
    leading: MisfitHypothesis, rivals: list[MisfitHypothesis]
) -> MisfitHypothesis:
    """Return the leading cause with the second in its sentence, unless it is clearly better."""
    others = [rival for rival in rivals if rival.group != leading.group]
    if not others:
        return leading
    second = max(others, key=attrgetter("explained_fraction"))
    if leading.check is Check.SURFACE or clearly_better(leading, second):
        return leading
    return replace(leading, sentence=f"{leading.sentence}, or {second.sentence}")


def _cause_finding(cause: MisfitHypothesis, *, at_noise_floor: bool) -> Finding:
    """Return the finding of a cause, with care unless the cause is negligible."""
    uncertain = cause.check in MAY_CAP and not (cause.negligible and at_noise_floor)
    return cause.check.finding(
        cause.sentence,
        cause.remedy,
        cause.z,
        mark="with-care" if uncertain else "trust",
        moves_percent=(100.0 * cause.stiffness, 100.0 * cause.damping),
    )
