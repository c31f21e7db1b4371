"""Error bars of force, stiffness and damping at a depth, and the marks that they allow."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.contact import VelocityFilter
from palpate.diagnosis.causes import CauseAssessment
from palpate.diagnosis.delay import ONE_CLOCK, has_two_clocks
from palpate.diagnosis.fit import Fit, distance_to_least_squares, fit_with_column, standard_errors
from palpate.diagnosis.outcome import Quantity, WorkingDepth
from palpate.digits import format_quantity, rough_percent, rounded, with_error
from palpate.findings import Check, Finding, Mark
from palpate.preparation.velocity import filter_gain
from palpate.validation import Floats

# A distance of half a standard error, added in quadrature, widens a bar by an eighth; smaller
# distances are ignored.
NEGLIGIBLE_ERRORS = 0.5


@dataclass(frozen=True, slots=True)
class SystematicPart:
    """A systematic error of stiffness and damping that does not show in the residual.

    Attributes
    ----------
    errors : tuple of float
        Relative errors of stiffness and damping.
    reason : str
        End of the sentence *the stiffness is known to ± 20 %, …*.
    remedy : str or None
        The next step.
    """

    errors: tuple[float, float]
    reason: str
    remedy: str | None


@dataclass(frozen=True, slots=True)
class SystematicErrors:
    """All systematic errors of a fit; the largest counts.

    Attributes
    ----------
    causes : CauseAssessment
        Causes of misfit, whose errors depend on the depth.
    parts : tuple of SystematicPart
        The other errors.
    skew : float
        Skew between force and position that the law cannot separate from damping, s; 0 if it can,
        or if the clocks are known.
    """

    causes: CauseAssessment
    parts: tuple[SystematicPart, ...]
    skew: float

    def all_parts(self, fit: Fit) -> list[SystematicPart]:
        """Return all systematic errors at the fit's depth."""
        parts = list(self.parts)
        for cause, weight in self.causes.counted:
            stiffness, damping = (weight * abs(each) for each in cause.change.relative(fit))
            reason = f"since {cause.sentence}"
            parts.append(SystematicPart((stiffness, damping), reason, cause.remedy))
        return parts


def systematic_errors(
    fit: Fit, causes: CauseAssessment, findings: Sequence[Finding]
) -> SystematicErrors:
    """Collect the systematic errors: of causes, delay, skew, velocity and free air."""
    skew = _skew_budget(fit)
    return SystematicErrors(causes, tuple(_parts(fit, causes, findings, skew)), skew)


#: Checks whose findings state their effect on the result; none of them is a column of the fit.
OWN_CHANGES = (Check.VELOCITY_NOISE, Check.VELOCITY_COLUMN, Check.FREE_AIR)


def _parts(
    fit: Fit, causes: CauseAssessment, findings: Sequence[Finding], skew: float
) -> Iterator[SystematicPart]:
    undetected = "by friction or a delay that the recording cannot exclude"
    # At one speed they shift the force or the depth, and not the slope.
    changes = (0.0, 0.0) if fit.steady_speed else causes.undetected
    yield SystematicPart(changes, undetected, "press along the surface normal")
    damping, scale = abs(fit.damping(fit.solution.law)), float(fit.reference_scales[1])
    # A skew τ changes the damping by S τ.
    per_second, applied = abs(fit.stiffness(fit.solution.law)) / scale, fit.data.contact.delay
    if applied is not None and applied.standard_error > 0.0:
        what = "clocks' offset" if has_two_clocks(fit) else "delay"
        reason = f"by the standard error of the {what}"
        again = not (applied.found or has_two_clocks(fit))
        remedy = "run again with --delay find" if again else ONE_CLOCK
        yield SystematicPart((0.0, per_second * applied.standard_error), reason, remedy)
    if skew > 0.0:
        reason = f"since {rounded(1e3 * skew, 2)} ms of skew between force and position is possible"
        yield SystematicPart((0.0, per_second * skew), reason, IN_STEP)
    for finding in findings:
        if finding.check in OWN_CHANGES:
            changes = finding.moves_stiffness_percent, finding.moves_damping_percent
            stiffness, by_damping = (0.01 * np.abs(np.nan_to_num(changes, posinf=0.0))).tolist()
            if finding.check != Check.FREE_AIR:  # relative to the damping, not to its scale
                by_damping *= damping / scale
            reason = f"since {finding.brief or finding.message}"
            yield SystematicPart((stiffness, by_damping), reason, finding.remedy)
    if (used := fit.data.velocity_filter) is not None and np.any(fit.v):
        error = _velocity_error(fit, used) * damping
        if error > NEGLIGIBLE_ERRORS * standard_errors(fit)[2]:
            reason = "by the error of the differentiated velocity"
            yield SystematicPart((0.0, error / scale), reason, fit.data.wider_window)


#: Skew between force and position that is assumed possible if nothing is known of their clocks, s.
#: Half a sample at 66 Hz would instead give 140 % to a damping that repeats to 8 %.
USUAL_SKEW = 1e-3


def _skew_budget(fit: Fit) -> float:
    """Return the skew that the law cannot distinguish from damping, s; 0 for Hunt–Crossley.

    A skew τ adds K n xⁿ⁻¹ v τ, which differs from the damping force B xⁿ v of Hunt–Crossley but not
    from the force of half-space damping, of a linear damper or of a relaxation branch.
    """
    # If a delay was subtracted, its standard error counts instead.
    if fit.given.estimate.law.power_law or fit.data.contact.delay is not None:
        return 0.0
    return max(USUAL_SKEW, 0.0 if fit.response is None else fit.response.delay)


def _velocity_error(fit: Fit, used: VelocityFilter) -> float:
    """Relative error of the damping due to the velocity filter: attenuation and noise.

    At a frequency ω the slope of a parabola through a window of T loses (ωT/2)²/10 of the velocity;
    the effective frequency is ω² = ⟨a²⟩/⟨v²⟩. A spline loses λ h ω⁴ with ω⁴ = ⟨ä²⟩/⟨v²⟩, where ä is
    the jerk. The attenuation raises the damping by this fraction; noise lowers it, as in
    ``check_velocity_noise``.
    """
    speed = fit.v * fit.units.speed
    if used.degree == 2:  # of order ω²: window means preserve it and lower the noise
        rate = np.linalg.norm(fit.windows.mean(fit.acceleration))
        turn = float(rate / np.linalg.norm(fit.windows.mean(speed)))
    else:
        turn = math.sqrt(float(np.linalg.norm(fit.jerk) / np.linalg.norm(speed)))
    lost = 1.0 - float(filter_gain(used, min(turn * fit.data.sample_time, math.pi)))
    return lost + fit.data.velocity_noise**2 / float(np.mean(speed**2))


# The numbers at a depth.


def numbers_at_depth(fit: Fit, systematic: SystematicErrors) -> WorkingDepth:
    """Return force, stiffness and damping at the fit's depth, with both standard errors."""
    errors = standard_errors(fit)
    largest = np.nanmax([part.errors for part in systematic.all_parts(fit)], axis=0)
    wrong = np.array([0.0, *largest * fit.reference_scales])
    distance = np.abs(distance_to_least_squares(fit))
    wrong = np.maximum(wrong, np.where(distance > NEGLIGIBLE_ERRORS * errors, distance, 0.0))
    if not fit.with_offset:
        wrong = np.maximum(wrong, _offset_sensitivity(fit))
    if fit.equivalent is not None:
        # Relaxation was subtracted from the force, so the least squares treats it as known.
        by_law = fit.equivalent.law_errors
        errors = np.where(by_law > errors, by_law, errors)
    if fit.response is not None:
        if fit.equivalent is not None:
            errors[1:] = fit.response.at(fit.depth, fit.frequency)[1]
        wrong[1:] = np.maximum(wrong[1:], _law_spread(fit))
    return _working_depth(fit, _add_surface_error(fit, errors), wrong)


def unknown_working_depth(fit: Fit) -> WorkingDepth:
    """Return the numbers at the depth of a fit without a check, with unknown errors."""
    unknown = np.full(3, math.nan)
    return _working_depth(fit, unknown, np.zeros(3) if math.isfinite(fit.depth) else unknown)


def _working_depth(fit: Fit, errors: Floats, wrong: Floats) -> WorkingDepth:
    known = math.isfinite(fit.depth)
    speed = fit.steady_speed
    values = fit.estimate.law.at_speed(fit.depth, speed) if known else [math.nan] * 3
    quantities = map(Quantity, values, errors.tolist(), wrong.tolist())
    return WorkingDepth(fit.depth, *quantities, speed=speed)


def _law_spread(fit: Fit) -> Floats:
    """Systematic error of K′ and B′: spread over laws that fit equally well, and the misfit."""
    assert fit.response is not None
    values = np.array(fit.estimate.law.at_rest(fit.depth)[1:])
    return fit.response.systematic(values, fit.depth, fit.frequency)


def _offset_sensitivity(fit: Fit) -> Floats:
    """Absolute changes of force, stiffness and damping when an offset is fitted too, shape (3,).

    For a method without an offset. No tare is exact, and a stiffness can absorb the remaining
    offset, which then does not show in the residual.
    """
    result = fit_with_column(fit, np.ones(len(fit.windows)))
    if result is None:
        return np.zeros(3)
    change = np.abs(fit.gradients @ result.change[: len(fit.solution.law.symbols)])
    return np.where(np.isfinite(change), change, 0.0)


def _add_surface_error(fit: Fit, errors: Floats) -> Floats:
    """Add the effect of the surface's standard deviation on the numbers at the depth.

    The law was fitted where the probe was; no fit knows that depth better than the surface.
    """
    law, depth = fit.estimate.law, fit.depth
    deviation = min(fit.data.contact.surface_deviation or 0.0, 0.5 * depth)
    if not deviation > 0.0:
        return errors
    ends = (
        law.at_speed(place, fit.steady_speed) for place in (depth + deviation, depth - deviation)
    )
    change = np.subtract(*ends)
    wider: Floats = np.hypot(errors, 0.5 * change)
    return wider


# The marks that the bars allow.

#: Limits of the relative standard error, all causes together: a number is trusted below the first
#: and not trusted above the second.
TRUSTED, STOPPED = (0.10, 0.20), (0.25, 0.60)
IN_STEP = "if one clock stamps both, run again with --delay 0ms+-0.1ms"


def check_precision(fit: Fit, at: WorkingDepth, systematic: SystematicErrors) -> list[Finding]:
    """Report the numbers whose error bars are too wide to trust, with the main reason."""
    findings = []
    for number, (name, unit) in enumerate((("stiffness", "N/m"), ("damping", "N·s/m"))):
        quantity: Quantity = getattr(at, name)
        error, size = quantity.whole_error, abs(quantity.value)
        relative = rough_percent(error / size if size else math.inf)
        sentence, sign = f"the {name} is known to ± {relative}", ""
        mark: Mark = "trust"
        if not error <= TRUSTED[number] * size:
            mark = "with-care" if error <= STOPPED[number] * size else "do-not-trust"
        if not size > 2.0 * error:
            mark, sign = "do-not-trust", "its sign is open, "
            value = with_error(quantity.value, error, unit=unit)
            sentence = f"the sign of the {name} is open: {value}"
        elif quantity.value < 0.0:  # passive materials have none
            mark, sign = "do-not-trust", "it is negative, "
            sentence = f"the {name} is negative, {with_error(quantity.value, error, unit=unit)}"
        reason, remedy = _largest_part(fit, systematic, number, quantity)
        if mark == "trust":
            if not (number and systematic.skew):
                continue
            # A sensor fault can make palpate select such a law for a Hunt–Crossley contact: of the
            # 200 recordings with a fault in ``benchmarks.diagnosis.mix``, 32 get this mark, and the
            # damping of 15 is more than 20 % off.
            mark, remedy = "with-care", IN_STEP
            step = format_quantity(systematic.skew, "s", digits=1)
            reason = f"provided that force and position are in step to {step}, which no fit shows"
        more: Any = {name: mark, "brief": f"{sign}{reason}"}
        findings.append(Check.PRECISION.finding(f"{sentence}, {reason}", remedy, **more))
    return findings


def _largest_part(
    fit: Fit, systematic: SystematicErrors, number: int, quantity: Quantity
) -> tuple[str, str | None]:
    """Return the main reason for the bar of stiffness (0) or damping (1), and the next step."""
    scale = fit.reference_scales[number]
    parts = [(part.errors[number], part.reason, part.remedy) for part in systematic.all_parts(fit)]
    if fit.response is not None:
        spread = float(_law_spread(fit)[number]) / scale
        parts.append((spread, "since other laws fit as well", "record a longer motion"))
    remedy = "move faster and over a wider range of depths"
    parts.append((quantity.standard_error / scale, "by the noise and the motion", remedy))
    return max(parts, key=lambda part: part[0])[1:]
