"""Error bars of force, stiffness and damping at a depth, and the marks that they allow."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from palpate.digits import format_quantity, rough_percent, with_error
from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.identification.diagnosis.causes import (
    NUISANCES,
    CauseAssessment,
    Clock,
    clock_of,
    shows_skew,
)
from palpate.identification.diagnosis.excitation import presses_once
from palpate.identification.diagnosis.fit import (
    SIGNIFICANT,
    Fit,
    distance_to_least_squares,
    fit_with_column,
    standard_errors,
)
from palpate.identification.diagnosis.misfit import (
    deeper_half_remedy,
    exact_remedy,
    predict_deeper_half,
    smooth_misfit,
)
from palpate.identification.diagnosis.outcome import Quantity, WorkingDepth
from palpate.input.preparation.velocity import filter_gain
from palpate.method.contact import VelocityFilter
from palpate.validation import Floats, frozen

# Multiples of the relative misfit that are in the stiffness and, over ω, in the damping, and of the
# change of the damping by a cause that is found: with the cause another damping may fit as well.
# Chosen with the priors of the nuisances.
MISFIT = np.array([3.1, 4.6])
FOUND = np.array([1.0, 1.5])
# Multiple of the statistical error that the selection of relaxation times adds: the covariance
# holds the times without stiffness at 0.
SPECTRUM = 0.8
# One press repeats to this fraction, of which it shows nothing: presses of the same muscle and of
# the same silicone scatter by 6 to 10 %.
ONE_PRESS = 0.065


class BarPart(NamedTuple):
    """A part of the error bars.

    Attributes
    ----------
    errors : numpy.ndarray, shape (2,)
        Errors of stiffness and damping, SI.
    reason : str
        End of the sentence *the stiffness is known to ± 20 %, …*.
    remedy : Remedy or None
        The next step.
    is_factor : bool
        Whether it multiplies the number, and so cannot turn its sign.
    detected : bool
        Whether the recording shows it. Of what it shows there is one cause: the largest counts.
    """

    errors: Floats
    reason: str
    remedy: Remedy | None
    is_factor: bool = False
    detected: bool = False


@frozen
class SystematicErrors:
    """All systematic errors of a fit.

    Attributes
    ----------
    causes : CauseAssessment
        Causes of misfit.
    findings : tuple of Finding
        Findings that state their effect.
    misfit : float
        Rms of the residual that a smooth function removes, over the force.
    clock : Clock
        What is known of the clocks of force and position.
    """

    causes: CauseAssessment
    findings: tuple[Finding, ...]
    misfit: float
    clock: Clock

    def all_parts(self, fit: Fit) -> list[BarPart]:
        """Return all systematic errors at the fit's depth."""
        parts = [*_parts(fit, self), *_parts_of_causes(fit, self.causes), *_parts_of_law(fit)]
        return [part._replace(errors=np.nan_to_num(part.errors, posinf=0.0)) for part in parts]


def _parts_of_causes(fit: Fit, causes: CauseAssessment) -> Iterator[BarPart]:
    """Yield the errors by causes of misfit, found or not excluded."""
    for cause, multiple in causes.counted:
        detected = cause.z > SIGNIFICANT
        if fit.steady_speed and not detected:
            continue  # friction or a delay shifts the force or the depth, and not the slope
        reason = f"since {cause.sentence}"
        if not detected:
            reason = f"since the recording does not exclude {NUISANCES[cause.check].sentence}"
        errors = multiple * np.abs(cause.change.relative(fit)) * fit.reference_scales
        errors = errors * (FOUND if detected else 1.0)
        yield BarPart(errors, reason, cause.remedy, cause.check in FACTORS, detected)


def _parts_of_law(fit: Fit) -> Iterator[BarPart]:
    """Yield the errors by the choice of the law, its method and the position's steps."""
    if fit.response is not None:
        spread = fit.response.spread(np.array(_values(fit)[1:]), fit.depth, fit.frequency)
        yield BarPart(spread, "since other laws fit as well", Remedy(NextStep.VARY_SPEED))
        if fit.equivalent is not None:
            by_noise = fit.response.at(fit.depth, fit.frequency)[1]
            reason = "by the choice of the relaxation times"
            yield BarPart(SPECTRUM * by_noise, reason, Remedy(NextStep.VARY_SPEED))
    distance = np.abs(distance_to_least_squares(fit))[1:]
    remedy = exact_remedy(fit)
    yield BarPart(distance, "since the method is off its least squares", remedy)
    steps = _change_with_depth(fit, ROUNDING * fit.data.penetration_step)[1:]
    yield BarPart(steps, "by the steps of the position", Remedy(NextStep.FINER_POSITION))
    if not fit.with_offset:
        yield BarPart(_offset_sensitivity(fit)[1:], "since the method has no offset", remedy)


# Steps of an encoder shift whole touches, which no longer recording averages out.
ROUNDING = 0.5
#: Causes that multiply force, stiffness and damping.
FACTORS = (Check.SENSOR_GAIN, Check.SLOW_CHANGE, Check.CHANGE)


def systematic_errors(
    fit: Fit, causes: CauseAssessment, findings: Sequence[Finding]
) -> SystematicErrors:
    """Collect the systematic errors: of causes, misfit, delay, skew, velocity and free air."""
    stated = tuple(finding for finding in findings if finding.check in OWN_CHANGES)
    return SystematicErrors(causes, stated, smooth_misfit(fit), clock_of(fit))


#: Checks whose findings state their effect on the result; none of them is a column of the fit.
OWN_CHANGES = (
    Check.TIME_STAMPS,
    Check.VELOCITY_NOISE,
    Check.VELOCITY_COLUMN,
    Check.FREE_AIR,
    Check.FORCE_JUMP,
)
#: Of these, those whose change of the damping is relative to the damping, not to its scale.
OF_VELOCITY = OWN_CHANGES[:3]


def _combined(parts: Iterable[BarPart]) -> Floats:
    """Return the whole of some parts: all that are hidden, and the largest that is detected."""
    chosen = list(parts)
    hidden = np.array([part.errors for part in chosen if not part.detected]).reshape(-1, 2)
    detected = np.array([part.errors for part in chosen if part.detected]).reshape(-1, 2)
    largest = np.max(detected**2, axis=0, initial=0.0)
    total: Floats = np.sqrt(np.sum(hidden**2, axis=0) + largest)
    return total


def _parts(fit: Fit, known: SystematicErrors) -> Iterator[BarPart]:
    """Yield the errors that are no causes, at the fit's depth."""
    values = np.abs(fit.force_stiffness_damping(fit.solution.law)[1:])
    stiffness, damping = values.tolist()
    if fit.frequency > 0.0 and known.misfit:
        errors = MISFIT * known.misfit * stiffness * np.array([1.0, 1.0 / fit.frequency])
        reason = "since the law does not follow the force"
        yield BarPart(errors, reason, deeper_half_remedy(fit))
    if presses_once(fit):
        reason = "since one press does not show how far the next one differs"
        yield BarPart(ONE_PRESS * values, reason, Remedy(NextStep.SEVERAL_PRESSES), is_factor=True)
    # If the law shows the skew of known clocks, it is among the causes.
    counted = any(cause.check is Check.DELAY for cause, _ in known.causes.counted)
    if known.clock.error and not (known.clock.is_known and shows_skew(fit) and counted):
        errors = np.array([0.0, stiffness * known.clock.error])
        yield BarPart(errors, known.clock.reason, Remedy(known.clock.remedy))
    for finding in known.findings:
        changes = finding.moves_stiffness_percent, finding.moves_damping_percent
        relative = 0.01 * np.abs(np.nan_to_num(changes, posinf=0.0))
        scales = values if finding.check in OF_VELOCITY else fit.reference_scales
        reason = f"since {finding.brief or finding.message}"
        yield BarPart(relative * scales, reason, finding.remedy, detected=True)
    if (used := fit.data.velocity_filter) is not None and np.any(fit.v):
        lost, noise = _velocity_errors(fit, used)
        reason = "by the error of the differentiated velocity"
        # Twice the window loses four times as much, and has an eighth of the noise.
        wider = fit.data.wider_window if noise > 4.0 * lost else None
        yield BarPart(np.array([0.0, (lost + noise) * damping]), reason, wider)


def _velocity_errors(fit: Fit, used: VelocityFilter) -> tuple[float, float]:
    """Relative errors of the damping due to the velocity filter: attenuation and noise.

    At a frequency ω the slope of a parabola through a window of T loses (ωT/2)²/10 of the velocity,
    and a spline λ h ω⁴, with the effective frequency ω² = ⟨a²⟩/⟨v²⟩. A jerk would be that of
    jitter: stamps of arrival gave a damping that was 3 % off a bar of 83 %. The attenuation raises
    the damping by this fraction; noise lowers it, as in ``check_velocity_noise``.
    """
    # Window means keep the motion, and not the noise or the jitter of the time stamps.
    speed = np.linalg.norm(fit.windows.mean(fit.v)) * fit.units.speed
    turn = float(np.linalg.norm(fit.windows.mean(fit.acceleration)) / speed)
    lost = 1.0 - float(filter_gain(used, min(turn * fit.data.sample_time, math.pi)))
    return lost, (fit.data.velocity_noise / fit.speed) ** 2


# The numbers at a depth.


def numbers_at_depth(fit: Fit, systematic: SystematicErrors) -> WorkingDepth:
    """Return force, stiffness and damping at the fit's depth, with both standard errors."""
    errors = standard_errors(fit)
    wrong = np.array([0.0, *_combined(systematic.all_parts(fit))])
    wrong[0] = abs(distance_to_least_squares(fit)[0])
    if not fit.with_offset:
        wrong[0] = max(wrong[0], _offset_sensitivity(fit)[0])
    if fit.equivalent is not None:
        # Relaxation was subtracted from the force, so the least squares treats it as known.
        by_law = fit.equivalent.law_errors
        errors = np.where(by_law > errors, by_law, errors)
        if fit.response is not None:
            errors[1:] = fit.response.at(fit.depth, fit.frequency)[1]
    return _working_depth(fit, _add_surface_error(fit, errors), wrong)


def unknown_working_depth(fit: Fit) -> WorkingDepth:
    """Return the numbers at the depth of a fit without a check, with unknown errors."""
    unknown = np.full(3, math.nan)
    return _working_depth(fit, unknown, np.zeros(3) if math.isfinite(fit.depth) else unknown)


def _values(fit: Fit) -> list[float]:
    """Force, stiffness and damping of the identified law at the fit's depth, SI."""
    return list(fit.estimate.law.at_speed(fit.depth, fit.steady_speed))


def _working_depth(fit: Fit, errors: Floats, wrong: Floats) -> WorkingDepth:
    values = _values(fit) if math.isfinite(fit.depth) else [math.nan] * 3
    quantities = map(Quantity, values, errors.tolist(), wrong.tolist())
    return WorkingDepth(fit.depth, *quantities, speed=fit.steady_speed)


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
    wider: Floats = np.hypot(errors, _change_with_depth(fit, fit.data.contact.surface_deviation))
    return wider


def _change_with_depth(fit: Fit, deviation: float | None) -> Floats:
    """Change of force, stiffness and damping by a deviation of the depth [m], SI, shape (3,)."""
    law = fit.estimate.law
    depth = fit.depth
    off = min(deviation or 0.0, 0.5 * depth)
    ends = (law.at_speed(place, fit.steady_speed) for place in (depth + off, depth - off))
    change = np.subtract(*ends)
    half: Floats = 0.5 * np.abs(change)
    return half


# The marks that the bars allow.

#: Limits of the relative standard error, all causes together: a number is trusted below the first
#: and not trusted above the second.
TRUSTED = (0.10, 0.20)
STOPPED = (0.25, 0.60)


def all_parts(fit: Fit, at: WorkingDepth, systematic: SystematicErrors) -> list[BarPart]:
    """Return all parts of the bars of the numbers at the fit's depth, each with its reason."""
    statistical = np.array([at.stiffness.standard_error, at.damping.standard_error])
    surface = _change_with_depth(fit, fit.data.contact.surface_deviation)[1:]
    noise = np.sqrt(np.maximum(statistical**2 - surface**2, 0.0))
    return [
        BarPart(noise, "by the noise and the motion", Remedy(NextStep.MOVE_MORE)),
        BarPart(surface, "by the standard error of the surface", Remedy(NextStep.APPROACH)),
        *systematic.all_parts(fit),
    ]


def check_precision(fit: Fit, at: WorkingDepth, systematic: SystematicErrors) -> list[Finding]:
    """Report the numbers whose error bars are too wide to trust, with the main reason."""
    parts = all_parts(fit, at, systematic)
    largest = np.argmax([part.errors for part in parts], axis=0)
    turning = _combined(part for part in parts if not part.is_factor)
    findings = []
    for number, (name, unit) in enumerate((("stiffness", "N/m"), ("damping", "N·s/m"))):
        quantity: Quantity = getattr(at, name)
        error = quantity.whole_error
        size = abs(quantity.value)
        relative = rough_percent(error / size if size else math.inf)
        sentence = f"the {name} is known to ± {relative}"
        sign = ""
        mark: Mark = "trust"
        if not error <= TRUSTED[number] * size:
            mark = "with-care" if error <= STOPPED[number] * size else "do-not-trust"
        if not size > 2.0 * turning[number]:
            mark = "do-not-trust"
            sign = "its sign is open, "
            value = with_error(quantity.value, error, unit=unit)
            sentence = f"the sign of the {name} is open: {value}"
        elif quantity.value < 0.0:  # passive materials have none
            mark = "do-not-trust"
            sign = "it is negative, "
            sentence = f"the {name} is negative, {with_error(quantity.value, error, unit=unit)}"
        reason = parts[largest[number]].reason
        if mark != "trust":
            remedy = best_remedy(fit, parts, number)
        elif number and _differs_at_rest(fit, systematic, quantity):
            mark = "with-care"
            remedy = Remedy(NextStep.TASK_SPEED)
            reason = f"at the recorded speed of {format_quantity(fit.speed, 'm/s', digits=2)} only"
        else:
            clock = systematic.clock
            if not number or clock.is_known or shows_skew(fit):
                continue
            mark = "with-care"
            remedy = Remedy(clock.remedy)
            step = format_quantity(clock.error, "s", digits=1)
            reason = (
                f"if force and position were recorded within {step} of each other, which palpate "
                "cannot check"
            )
        marks: Any = {name: mark, "brief": f"{sign}{reason}"}
        findings.append(Check.PRECISION.finding(f"{sentence}, {reason}", remedy, **marks))
    return findings


AT_REST = 0.2  # relative difference of the damping at rest that calls for care


def _differs_at_rest(fit: Fit, systematic: SystematicErrors, damping: Quantity) -> bool:
    """Whether the leading cause is a square of the speed, without which the damping differs."""
    for finding in systematic.causes.findings[:1]:
        change = 0.01 * finding.moves_damping_percent * float(fit.reference_scales[1])
        return finding.check == Check.SQUARE_SPEED and abs(change) > AT_REST * abs(damping.value)
    return False


HELPS = 0.95  # largest ratio of the predicted bar to the present one
#: Factor of the statistical error by steps that identify a part of the recording alone.
OF_A_PART = {NextStep.TWO_HALVES: math.sqrt(2.0), NextStep.TWO_PARTS: math.sqrt(2.0)}


def best_remedy(fit: Fit, parts: Sequence[BarPart], number: int) -> Remedy | None:
    """Return the next step that is predicted to lower the bar of stiffness (0) or damping most.

    The first part is that of the noise. None if no step is predicted to lower it.
    """
    remedies = {part.remedy.step: part.remedy for part in parts if part.remedy is not None}
    bars = {step: float(_predict_parts(fit, parts, step)[number]) for step in remedies}
    best = min(bars, key=bars.__getitem__, default=None)
    if best is None or not bars[best] < HELPS * float(_combined(parts)[number]):
        return None
    return remedies[best]


def _predict_parts(fit: Fit, parts: Sequence[BarPart], step: NextStep) -> Floats:
    """Return the bars of stiffness and damping that are predicted after a step."""
    by_noise: Floats | float = OF_A_PART.get(step, 1.0)
    after = 0.0
    if step is NextStep.DEEPER_HALF:
        if (predicted := predict_deeper_half(fit)) is None:
            return np.full(2, math.inf)
        by_noise, after = predicted.errors, predicted.misfit
    left = [
        part._replace(errors=after * part.errors)
        if part.remedy is not None and part.remedy.step is step
        else part
        for part in parts
    ]
    if parts[0].remedy is None or parts[0].remedy.step is not step:
        left[0] = parts[0]._replace(errors=by_noise * parts[0].errors)
    return _combined(left)
