"""Error bars of force, stiffness and damping at a depth, and the marks that they allow."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.contact import VelocityFilter
from palpate.diagnosis.causes import CauseAssessment
from palpate.diagnosis.delay import delay_systematic
from palpate.diagnosis.fit import Fit, distance_to_least_squares, fit_with_column, standard_errors
from palpate.diagnosis.outcome import Quantity, WorkingDepth
from palpate.digits import format_quantity, rough_percent, rounded, with_error
from palpate.findings import Check, Finding, Mark
from palpate.preparation.velocity import filter_gain
from palpate.validation import Floats

# Distances below so many standard errors widen no bar by more than an eighth.
NEGLIGIBLE_ERRORS = 0.5


@dataclass(frozen=True, slots=True)
class SystematicPart:
    """A part of the error of stiffness and damping that no residual shows.

    Attributes
    ----------
    stiffness, damping : float
        Relative errors.
    reason : str
        The end of a sentence: *known to ± 20 % …*.
    remedy : str or None
        The next step.
    """

    stiffness: float
    damping: float
    reason: str
    remedy: str | None

    def of(self, number: int) -> float:
        """Return the part of the stiffness (0) or of the damping (1)."""
        return self.damping if number else self.stiffness


@dataclass(frozen=True, slots=True)
class SystematicErrors:
    """All systematic parts of a fit; the largest counts.

    Attributes
    ----------
    causes : CauseAssessment
        Causes of misfit, whose parts depend on the depth.
    parts : tuple of SystematicPart
        The others.
    skew : float
        Skew between force and position that the law cannot tell from damping, s; 0 where it can, or
        where the clocks are known.
    """

    causes: CauseAssessment
    parts: tuple[SystematicPart, ...]
    skew: float

    def at(self, fit: Fit) -> list[SystematicPart]:
        """Return all parts at the fit's depth."""
        parts = list(self.parts)
        for cause, weight in self.causes.counted:
            stiffness, damping = (weight * abs(each) for each in cause.change.relative(fit))
            reason = f"since {cause.sentence}"
            parts.append(SystematicPart(stiffness, damping, reason, cause.remedy))
        return parts


def systematic_errors(
    fit: Fit, causes: CauseAssessment, findings: Sequence[Finding]
) -> SystematicErrors:
    """Collect causes, what is undetected, an applied delay, the skew, the velocity and free air."""
    skew = _skew_budget(fit)
    return SystematicErrors(causes, tuple(_parts(fit, causes, findings, skew)), skew)


#: Checks whose findings say how far they change the numbers; none of them is a column of the fit.
OWN_CHANGES = (Check.VELOCITY_NOISE, Check.VELOCITY_COLUMN, Check.FREE_AIR)


def _parts(
    fit: Fit, causes: CauseAssessment, findings: Sequence[Finding], skew: float
) -> Iterator[SystematicPart]:
    undetected = "by friction or a delay that the recording cannot exclude"
    yield SystematicPart(*causes.undetected, undetected, "press along the surface normal")
    if (by_delay := delay_systematic(fit)) > 0.0:
        reason = "by the standard error of the delay"
        yield SystematicPart(0.0, by_delay, reason, "run again with --delay find")
    damping, scale = abs(fit.damping(fit.solution.law)), fit.reference_scales[1]
    if skew > 0.0:
        by_skew = abs(fit.stiffness(fit.solution.law)) * skew / scale
        reason = f"since {rounded(1e3 * skew, 2)} ms of skew between force and position is possible"
        yield SystematicPart(0.0, by_skew, reason, IN_STEP)
    for finding in findings:
        if finding.check in OWN_CHANGES:
            changes = finding.moves_stiffness_percent, finding.moves_damping_percent
            by_stiffness, by_damping = 0.01 * np.abs(np.nan_to_num(changes, posinf=0.0))
            if finding.check != Check.FREE_AIR:  # of the damping itself, not of its scale
                by_damping *= damping / scale
            reason = f"since {finding.brief or finding.message}"
            yield SystematicPart(float(by_stiffness), float(by_damping), reason, finding.remedy)
    if (used := fit.data.velocity_filter) is not None and np.any(fit.v):
        error = _velocity_error(fit, used) * damping
        if error > NEGLIGIBLE_ERRORS * standard_errors(fit)[2]:
            reason = "by the error of the differentiated velocity"
            yield SystematicPart(0.0, error / scale, reason, fit.data.wider_window)


#: Skew between force and position that is allowed for where nothing is known of their clocks, s.
#: Half a sample at 66 Hz would make the bar of a damping 140 % that repeats to 8 %.
USUAL_SKEW = 1e-3


def _skew_budget(fit: Fit) -> float:
    """Return the skew that the law cannot tell from damping, s; 0 for Hunt–Crossley.

    K n xⁿ⁻¹ v is not B xⁿ v; but it is what a half-space, a linear damper or a branch adds.
    """
    # A delay that was taken out has a standard error, which counts in place of the budget.
    if fit.identified_law.power_law or fit.data.contact.delay is not None:
        return 0.0
    return max(USUAL_SKEW, 0.0 if fit.response is None else fit.response.delay)


def _velocity_error(fit: Fit, used: VelocityFilter) -> float:
    """Relative error of the damping by the velocity's filter: its loss, and the noise it leaves.

    At a frequency ω the slope of a parabola through a window of T loses (ωT/2)²/10 of the velocity,
    where ω² = ⟨a²⟩/⟨v²⟩ counts, and a spline λ h ω⁴, where ω⁴ = ⟨ä²⟩/⟨v²⟩ counts, ä the jerk. The
    damping becomes as much larger, and by noise smaller, as in ``check_velocity_noise``.
    """
    speed = fit.v * fit.units.speed
    if used.degree == 2:  # of order ω², the mean over a window keeps it and lowers the noise
        rate = np.linalg.norm(fit.windows.mean(fit.acceleration))
        turn = float(rate / np.linalg.norm(fit.windows.mean(speed)))
    else:
        turn = math.sqrt(float(np.linalg.norm(fit.jerk) / np.linalg.norm(speed)))
    lost = 1.0 - float(filter_gain(used, min(turn * fit.data.sample_time, math.pi)))
    return lost + fit.data.velocity_noise**2 / float(np.mean(speed**2))


# The numbers at a depth.


def numbers_at_depth(fit: Fit, systematic: SystematicErrors) -> WorkingDepth:
    """Return force, stiffness and damping at the fit's depth, with both errors."""
    errors = standard_errors(fit)
    parts = systematic.at(fit)
    largest = [max(part.of(number) for part in parts) for number in (0, 1)]
    wrong = np.array([0.0, *np.multiply(largest, fit.reference_scales)])
    distance = np.abs(distance_to_least_squares(fit))
    wrong = np.maximum(wrong, np.where(distance > NEGLIGIBLE_ERRORS * errors, distance, 0.0))
    if not fit.with_offset:
        wrong = np.maximum(wrong, _offset_sensitivity(fit))
    if fit.equivalent is not None:
        # Relaxation was subtracted from the force; the least squares take it for known.
        by_law = fit.equivalent.law_errors
        errors = np.where(by_law > errors, by_law, errors)
    if fit.response is not None:
        if fit.equivalent is not None:
            errors[1:] = fit.response.at(fit.depth, fit.frequency)[1]
        wrong[1:] = np.maximum(wrong[1:], _law_spread(fit))
    return _working_depth(fit, _add_surface_error(fit, errors), wrong)


def unknown_working_depth(fit: Fit) -> WorkingDepth:
    """Return the numbers at the depth of a fit that could not be checked."""
    unknown = np.full(3, math.nan)
    return _working_depth(fit, unknown, np.zeros(3) if math.isfinite(fit.depth) else unknown)


def _working_depth(fit: Fit, errors: Floats, wrong: Floats) -> WorkingDepth:
    known = math.isfinite(fit.depth)
    values = fit.estimate.law.at_rest(fit.depth) if known else [math.nan] * 3
    return WorkingDepth(fit.depth, *map(Quantity, values, errors.tolist(), wrong.tolist()))


def _law_spread(fit: Fit) -> Floats:
    """How far stiffness and damping differ in other laws that fit as well, or by the misfit."""
    assert fit.response is not None
    values = np.array(fit.estimate.law.at_rest(fit.depth)[1:])
    return fit.response.systematic(values, fit.depth, fit.frequency)


def _offset_sensitivity(fit: Fit) -> Floats:
    """How far the numbers of a method without an offset change when one is fitted as well.

    No tare is exact; what it leaves is in no residual that a stiffness can take up.
    """
    result = fit_with_column(fit, np.ones(len(fit.windows)))
    if result is None:
        return np.zeros(3)
    change = np.abs(fit.gradients @ result.change[: len(fit.solution.law.symbols)])
    return np.where(np.isfinite(change), change, 0.0)


def _add_surface_error(fit: Fit, errors: Floats) -> Floats:
    """Add how far the numbers change with the depth, by the deviation of the surface.

    The law holds where the probe was; how deep that is, no fit knows better than the surface.
    """
    law, depth = fit.estimate.law, fit.depth
    deviation = min(fit.data.contact.surface_deviation or 0.0, 0.5 * depth)
    if not deviation > 0.0:
        return errors
    change = np.subtract(law.at_rest(depth + deviation), law.at_rest(depth - deviation))
    wider: Floats = np.hypot(errors, 0.5 * change)
    return wider


# The marks that the bars allow.

#: Relative standard errors, all causes together: up to the first a number is trusted, beyond the
#: second it is not.
TRUSTED, STOPPED = (0.10, 0.20), (0.25, 0.60)
IN_STEP = "if one clock stamps both, run again with --skew 0.1ms"


def check_precision(fit: Fit, at: WorkingDepth, systematic: SystematicErrors) -> list[Finding]:
    """Find the numbers that their error bars do not let a reader trust, and what sets the bar."""
    found = []
    for number, (name, unit) in enumerate((("stiffness", "N/m"), ("damping", "N·s/m"))):
        quantity: Quantity = getattr(at, name)
        error, size = quantity.whole_error, abs(quantity.value)
        words, sign = (
            f"the {name} is known to ± {rough_percent(error / size if size else math.inf)}",
            "",
        )
        mark: Mark = "trust"
        if not error <= TRUSTED[number] * size:
            mark = "with-care" if error <= STOPPED[number] * size else "do-not-trust"
        if not size > 2.0 * error:
            mark, sign = "do-not-trust", "its sign is open, "
            value = with_error(quantity.value, error, unit=unit)
            words = f"the sign of the {name} is open: {value}"
        elif quantity.value < 0.0:  # no passive material has one
            mark, sign = "do-not-trust", "it is negative, "
            words = f"the {name} is negative, {with_error(quantity.value, error, unit=unit)}"
        reason, remedy = _largest_part(fit, systematic, number, quantity)
        if mark == "trust":
            if not (number and systematic.skew):
                continue
            # Of 46 such laws that a sensor's fault had made of Hunt and Crossley's, 13 were beyond.
            mark, remedy = "with-care", IN_STEP
            step = format_quantity(systematic.skew, "s", digits=1)
            reason = f"if force and position are in step to {step}: this law cannot tell"
        marks: dict[str, Mark] = {name: mark}
        message = f"{words}, {reason}"
        found.append(
            Check.PRECISION.finding(
                message,
                remedy,
                stiffness=marks.get("stiffness"),
                damping=marks.get("damping"),
                brief=f"{sign}{reason}",
            )
        )
    return found


def _largest_part(
    fit: Fit, systematic: SystematicErrors, number: int, quantity: Quantity
) -> tuple[str, str | None]:
    """Return what sets most of the bar of stiffness (0) or damping (1), and the next step."""
    scale = fit.reference_scales[number]
    parts = [(part.of(number), part.reason, part.remedy) for part in systematic.at(fit)]
    if fit.response is not None:
        spread = float(_law_spread(fit)[number]) / scale
        parts.append((spread, "since other laws fit as well", "record a longer motion"))
    wide = "move faster and over a wider range of depths"
    parts.append((quantity.standard_error / scale, "by the noise and the motion", wide))
    return max(parts, key=lambda part: part[0])[1:]
