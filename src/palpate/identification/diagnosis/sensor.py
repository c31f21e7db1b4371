"""Faults of the force sensor and of the velocity: range, dead band, offset, gain, noise."""

import math
from dataclasses import replace

import numpy as np

from palpate.digits import format_quantity, percent, rough_percent, rounded
from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.identification.diagnosis.causes import (
    CARE,
    NUISANCES,
    RISE,
    MisfitHypothesis,
    ParameterChange,
    causes_from_columns,
    relative_time,
)
from palpate.identification.diagnosis.fit import FEWEST_FREE, SIGNIFICANT, Fit
from palpate.identification.diagnosis.recording import FAR, Data
from palpate.input.preparation.held import hold_length
from palpate.input.preparation.resolution import find_dead_band
from palpate.method.estimators.least_squares import mean_error
from palpate.method.rows import median, rms
from palpate.validation import Floats

SHORTEST = 5  # samples
MOVES = 4.0  # multiple of the noise or of the step by which the law's force must vary during a run
SOME_FLAT = 0.01
MANY_FLAT = 0.05  # fractions of the samples in contact


def check_saturation(fit: Fit) -> Finding | None:
    """Runs of 5 or more equal forces while the law's force varies by more than 4 max(σ, step).

    A held force has another check, so only runs of more than two of its beats count. A dead band
    also has another check, so its samples do not count. A run ends at the surface.
    """
    force = fit.data.force
    inside = fit.inside | (fit.rejected & (fit.penetration > 0.0))
    shortest = max(SHORTEST, math.floor(2.0 * hold_length(force)) + 1)
    changed = np.diff(force, prepend=np.nan, append=np.nan) != 0.0
    below = fit.penetration > 0.0
    changed[1:-1] |= below[1:] != below[:-1]
    borders = np.flatnonzero(changed)
    lengths = np.diff(borders)
    began = borders[:-1]
    # Samples in which the sensor was lost are not taken, but the one before is.
    long = (lengths >= shortest) & below[began] & (inside[began] | inside[np.maximum(began - 1, 0)])
    if band := find_dead_band(fit.data.contact):
        long &= force[began] >= band
    if not long.any():
        return None
    starts = began[long]
    lengths = lengths[long]
    within = np.repeat(starts - np.cumsum(lengths) + lengths, lengths) + np.arange(lengths.sum())
    model = fit.law.force(np.maximum(fit.penetration[within], 0.0), fit.data.velocity[within])
    runs = np.cumsum(lengths) - lengths
    span = np.maximum.reduceat(model, runs) - np.minimum.reduceat(model, runs)
    stuck = span > MOVES * max(fit.data.force_noise, fit.data.force_step)
    top = float(force[inside].max())
    highest = force[starts] >= top
    count = np.count_nonzero(inside)
    at_top = lengths[stuck & highest].sum() / count
    elsewhere = lengths[stuck & ~highest].sum() / count
    fraction = max(at_top, elsewhere)
    if fraction <= SOME_FLAT:
        return None
    mark: Mark = "do-not-trust" if fraction > MANY_FLAT else "with-care"
    if at_top < elsewhere:
        sentence = (
            f"the force is constant for {percent(fraction)} of the contact while the probe moves"
        )
        return Check.STUCK_FORCE.finding(sentence, Remedy(NextStep.CONNECTION), mark=mark)
    sentence = (
        f"the force stays at its largest value, {rounded(top, 3)} N, for {percent(fraction)} of "
        "the contact: the sensor saturates"
    )
    return Check.SATURATION.finding(sentence, Remedy(NextStep.LARGER_RANGE), mark=mark)


def check_dead_band(fit: Fit) -> Finding | None:
    """The force is constant in air and at light touch, and jumps from there to a larger value."""
    band = find_dead_band(fit.data.contact)
    if not band:
        return None
    return Check.DEAD_BAND.finding(
        f"the force is zero below {format_quantity(band, 'N', digits=1)}: the sensor or its "
        "firmware has a dead band, and palpate leaves these samples out",
        Remedy(NextStep.NO_THRESHOLD),
    )


JUMP = 0.05
MUCH = 0.20  # fractions of the largest force
USUAL = 4.0  # multiple of the scatter of the changes of three samples before and after
ONE_SIGN = 0.5  # |sum| over the sum of sizes; jumps up and down are friction or sensor dropouts
MOST_JUMPS = 3  # friction jumps at every reversal of the probe, so it makes more jumps
PRESSING = 0.05  # fraction of the largest force


def find_force_jumps(data: Data) -> tuple[list[int], Floats]:
    """Return the samples before which the force jumps in contact, and the jumps, N.

    Such a change deviates from its six neighbours by 5 % of the largest force. The position must
    not jump with it, and the motion must not reverse, since friction jumps then.
    """
    changes = np.diff(data.force)
    moves = np.abs(np.diff(data.penetration))
    least = max(JUMP * data.peak_force, FAR * data.force_noise, 3.0 * data.force_step)
    beyond = changes.copy()
    jumps = list[int]()
    band = find_dead_band(data.contact)
    for k in np.flatnonzero(np.abs(changes) > least).tolist():
        neighbours = [j for j in range(max(k - 3, 0), min(k + 4, len(changes))) if j != k]
        velocity_before = data.velocity[max(k - 3, 0)]
        velocity_after = data.velocity[min(k + 4, len(data) - 1)]
        pressed = np.max(data.force[k : k + 2]) > PRESSING * data.peak_force
        usual_change = median(changes[neighbours])
        beyond[k] -= usual_change
        if (
            pressed
            and (not band or np.min(data.force[k : k + 2]) >= band)
            and data.segment[k] == data.segment[k + 1]
            and len(neighbours) == 6
            and abs(beyond[k])
            > max(USUAL * np.max(np.abs(changes[neighbours] - usual_change)), least)
            and moves[k] <= 2.0 * np.max(moves[neighbours])
            and velocity_before * velocity_after >= -1e-2 * np.mean(data.velocity**2)
        ):
            jumps.append(k)
    sizes = beyond[jumps]
    if len(jumps) > MOST_JUMPS or abs(sizes.sum()) < ONE_SIGN * np.abs(sizes).sum():
        return [], sizes[:0]
    return jumps, sizes


def check_force_jump(fit: Fit) -> Finding | None:
    """The force jumps at most three times, and stays there.

    Below a fifth of the largest force what this changes decides the marks.
    """
    data = fit.given.data
    jumps, sizes = find_force_jumps(data)
    if not jumps or hold_length(data.force):
        return None
    later = data.time[fit.windows.samples, None] > data.time[jumps]
    added = fit.windows.mean(later @ sizes)
    change = fit.solution.inverse @ added
    changes = fit.relative_changes(fit.gradients[1:] @ change[: len(fit.solution.law.symbols)])
    largest = int(np.argmax(np.abs(sizes)))
    size = float(sizes[largest])
    when = rounded(float(data.time[jumps[largest]]), 4)
    marks: list[Mark] = ["with-care" if abs(relative) > CARE else "trust" for relative in changes]
    if abs(size) > MUCH * data.peak_force:
        marks = ["do-not-trust", "do-not-trust"]
    return Check.FORCE_JUMP.finding(
        f"the force jumps by {format_quantity(size, 'N')} within a sample at {when} s while the "
        "probe presses: the sensor was zeroed in contact, or the material gave way",
        Remedy(NextStep.BEFORE_JUMP, when),
        stiffness=marks[0],
        damping=marks[1],
        brief=f"the force jumps by {format_quantity(size, 'N')} within a sample",
        moves_percent=(100.0 * changes[0], 100.0 * changes[1]),
    )


MANY_LEFT_OUT = 0.05  # fraction of the samples in contact


def outlier_finding(count: int, samples: int) -> Finding:
    """Report the number of samples in contact that were excluded; more than 5 % call for care."""
    percentage = rounded(100.0 * count / samples, 2)
    plural = "s" * (count > 1)
    return Check.OUTLIERS.finding(
        f"{count} sample{plural} ({percentage} %) excluded as outlier{plural}",
        Remedy(NextStep.KEEP_OUTLIERS),
        mark="with-care" if count > MANY_LEFT_OUT * samples else "trust",
    )


def check_velocity_noise(fit: Fit) -> Finding | None:
    """Errors in a regressor attenuate its coefficient: C is too small by σ_v²/⟨v²⟩.

    σ_v is the noise of a recorded velocity, from its fourth differences, or the filter's output for
    the penetration's noise, including its steps.
    """
    speed = float(np.mean(fit.data.velocity[fit.inside] ** 2))
    attenuation = fit.data.velocity_noise**2 / speed if speed > 0.0 else 0.0
    if not attenuation > CARE:
        return None
    derived = fit.data.velocity_filter is not None
    whose = (
        "the velocity, differentiated from the penetration," if derived else "the velocity column"
    )
    return Check.VELOCITY_NOISE.finding(
        f"{whose} is noisy: the damping is about {percent(min(attenuation, 1.0))} too small",
        fit.data.wider_window if derived else Remedy(NextStep.DIFFERENTIATE),
        moves_percent=(0.0, 100.0 * min(attenuation, 1.0)),
    )


#: Standard errors, and fraction of stiffness or damping, above which a slope in free air counts.
AIR_Z = 6.0
AIR_PART = 0.01


def check_free_air(fit: Fit) -> Finding | None:
    """The force in free air follows the probe's position or velocity.

    A cause that moves with the probe in free air also does so in contact: its slope adds to the
    stiffness, its drag to the damping.
    """
    slopes = np.array(fit.free_air.slopes)
    errors = np.array(fit.free_air.errors)
    changes = np.where(np.abs(slopes) > AIR_Z * errors, slopes / fit.reference_scales, 0.0)
    changes = np.where(np.abs(changes) > AIR_PART, changes, 0.0)
    if not changes.any():
        return None
    named_changes = zip(("stiffness", "damping"), changes.tolist(), strict=True)
    much = " and ".join(
        f"{name} by {rough_percent(abs(change))}" for name, change in named_changes if change
    )
    return Check.FREE_AIR.finding(
        "the force changes with the motion in free air: a cable, a guide or a mass that moves "
        f"with the probe changes {much}",
        Remedy(NextStep.FREE_AIR_FORCE),
        float(np.max(np.abs(slopes) / errors)),
        brief="the force in free air changes with the motion",
        moves_percent=(100.0 * float(changes[0]), 100.0 * float(changes[1])),
    )


# Force and acceleration are collinear above this R². In 34 impacts of masses it is 0.96 or more.
COLLINEAR = 0.9
# An impact ends a free flight: beyond the contact the acceleration is below this part of that in
# contact. Without free air a motion is an impact beyond this frequency, rad/s.
FLIGHT = 0.4
IMPACT_FREQUENCY = 100.0


def check_impact(fit: Fit) -> Finding | None:
    """The force only decelerates a free mass, so no part of it shows what moves beyond the sensor.

    A free mass M has M a = −F, of which a sensor that carries a part m measures (1 − m/M) F.
    """
    force = fit.force - fit.solution.offset
    acceleration = fit.windows.mean(fit.acceleration)
    product = float(force @ acceleration)
    squares = float(force @ force) * float(acceleration @ acceleration)
    if fit.data.contact.moving_mass is not None or not product < -math.sqrt(COLLINEAR * squares):
        return None
    inside = rms(fit.acceleration)
    outside = np.abs(fit.acceleration_at(fit.free))
    if outside.size >= FEWEST_FREE:
        free = median(outside) < FLIGHT * inside
    else:
        free = fit.frequency > IMPACT_FREQUENCY
    if not free:
        return None
    mass = -product / float(acceleration @ acceleration)
    return Check.MOVING_MASS.finding(
        f"an impact of {format_quantity(mass, 'kg', digits=2)} does not show what moves beyond the "
        "force sensor: a tenth of it there makes stiffness and damping a tenth too small",
        Remedy(NextStep.WEIGH),
        mark="with-care",
        brief="an impact does not show the mass beyond the force sensor",
    )


OFFSET_Z = 5.0
OFFSET_PART = 0.01


def check_offset(fit: Fit) -> Finding | None:
    """The fitted offset differs from the force in free air."""
    free = np.flatnonzero(fit.free)
    if free.size < FEWEST_FREE or not fit.with_offset:
        return None
    x = fit.penetration[free]
    force = fit.data.force[free[x <= np.median(x)]]
    difference = fit.solution.offset - float(force.mean())
    error = math.hypot(math.sqrt(fit.covariance[-1, -1]), mean_error(force))
    z = abs(difference) / max(error, 1e-300)
    if z <= OFFSET_Z or abs(difference) <= OFFSET_PART * fit.data.peak_force:
        return None
    return Check.OFFSET.finding(
        f"the fitted force offset is {format_quantity(abs(difference), 'N')} "
        f"{'above' if difference > 0 else 'below'} the force in free air: another law at light "
        "touch, or a wrong tare",
        Remedy(NextStep.TARE, _longest_free_interval(fit)),
        z,
    )


def _longest_free_interval(fit: Fit) -> str:
    """Return the longest interval without contact as START:STOP, s."""
    edges = np.flatnonzero(np.diff(np.r_[0, fit.free, 0]))
    starts = edges[::2]
    stops = edges[1::2] - 1
    k = int(np.argmax(stops - starts))
    ends = (float(fit.data.time[at]) for at in (starts[k], stops[k]))
    return ":".join(f"{end:.3f}".rstrip("0").rstrip(".") for end in ends)


# Change of the sensor's gain up to the peak force: 9 % off a line, as of an amplifier that
# saturates. A larger one is the material's.
MOST_CURVED = 0.35


def find_sensor_causes(fit: Fit) -> list[MisfitHypothesis]:
    """Fit a column each for zero drift, a guide's friction, a mass and a nonlinear gain."""
    law = fit.solution.law
    x = np.maximum(fit.x, 1e-12)
    force = law.force(x, fit.v)
    at_depth = fit.force_at_depth(law) or 1.0
    columns = {
        Check.OFFSET_DRIFT: relative_time(fit),
        Check.INERTIA: fit.acceleration,  # its coefficient is the mass beyond the sensor
        Check.GUIDE_FRICTION: np.tanh(RISE * fit.v * fit.units.speed / fit.speed),
    }
    # If the exponent is fixed, curvature is more likely due to the material.
    if law.power_law and not fit.fixed:
        columns[Check.SENSOR_GAIN] = force**2 / at_depth
    causes = causes_from_columns(fit, columns, _explain_column)
    return [_add_effect_of_delay(fit, cause) for cause in causes]


# Part of the delay of a position that the mass of its second order implies: between none for a
# mass that moves and all of it for a relaxing material, whose damping hides the first order.
LATE_PART = 0.15
LEAST_LATE = 0.2  # fraction of the residual that such a mass explains
MOST_LATE = 0.05  # s; a mass that implies a longer delay is a mass


def _add_effect_of_delay(fit: Fit, cause: MisfitHypothesis) -> MisfitHypothesis:
    """Add to a mass m the damping K τ of a delay τ that looks like it, as m = K τ²/2."""
    large = cause.z > SIGNIFICANT and cause.explained_fraction > LEAST_LATE
    stiffness = fit.stiffness(fit.solution.law)
    change = cause.change
    if not (cause.check is Check.INERTIA and large and cause.amount > 0.0 and stiffness > 0.0):
        return cause
    delay = math.sqrt(2.0 * cause.amount / stiffness)
    if delay > MOST_LATE or not isinstance(change, ParameterChange):
        return cause
    change = replace(change, branch=(0.0, LATE_PART * delay))
    sentence = f"{cause.sentence}, or force and position are out of step"
    return replace(cause, sentence=sentence, change=change, damping=change.relative(fit)[1])


def _explain_column(fit: Fit, check: Check, amount: float) -> tuple[str, Remedy | None] | None:
    """Return the sentence and the next step for an amount of a column; None for other causes."""
    if check is Check.OFFSET_DRIFT:
        return (
            f"the force sensor's zero drifts by {format_quantity(abs(amount), 'N')}",
            Remedy(NextStep.TARE_EACH_TOUCH),
        )
    if check is Check.SENSOR_GAIN:
        if abs(amount) > MOST_CURVED * NUISANCES[check].unit(fit):
            return None
        return (
            f"the force sensor's gain changes by {percent(abs(amount))} up to the working force",
            None,
        )
    if check is Check.GUIDE_FRICTION:
        return (
            f"friction of {format_quantity(abs(amount), 'N')} at any load, as of a guide",
            Remedy(NextStep.FREE_AIR_MOTION),
        )
    if amount > 0.0:
        return (
            f"a mass of {rounded(amount, 2)} kg moves between the force sensor and the material",
            Remedy(NextStep.INERTIA),
        )
    # Behind a link of the natural frequency ω₀ the tip moves by x − ẍ/ω₀².
    rate = math.sqrt(abs(fit.stiffness(fit.solution.law) / (amount or 1.0)))
    resonance = format_quantity(rate / (2.0 * math.pi), "Hz", digits=2)
    return (
        f"the force depends on the acceleration, as behind a link that resonates at {resonance}",
        Remedy(NextStep.STIFFER_PROBE),
    )
