"""Effects of the material beyond the law: friction, other damping, relaxation, adhesion."""

import math
from collections.abc import Sequence
from operator import attrgetter

import numpy as np

import palpate._core as _core
from palpate.digits import format_quantity, percent, rounded
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.identification.diagnosis.causes import (
    CARE,
    RISE,
    SURE,
    MisfitHypothesis,
    ParameterChange,
    cause_from_column,
    causes_from_columns,
    clearly_better,
    relative_time,
)
from palpate.identification.diagnosis.change import find_changes
from palpate.identification.diagnosis.excitation import presses_once
from palpate.identification.diagnosis.fit import FEWEST_FREE, SIGNIFICANT, Fit, fit_with_column
from palpate.identification.diagnosis.misfit import deeper_half_remedy
from palpate.identification.diagnosis.outcome import ModelSelection
from palpate.method.estimators.least_squares import mean_error, robust_covariance
from palpate.method.rows import median


def find_material_causes(fit: Fit) -> list[MisfitHypothesis]:
    """Fit one column each for friction, slow change, other damping and other shape."""
    law = fit.solution.law
    time = relative_time(fit)
    x = np.maximum(fit.x, 1e-12)
    at_rest = np.zeros_like(fit.x)
    # Dimensionless: depth over the working depth, speed over its rms.
    depth = x * fit.units.depth / fit.reference
    speed = fit.v * fit.units.speed / fit.speed
    spring = law.force(x, at_rest)
    slope = law.penetration_gradient(x, at_rest)
    spring = spring / (median(spring) or 1.0)  # ξⁿ of a power law
    slope = slope / (median(slope) or 1.0)  # ξⁿ⁻¹ of a power law
    logarithm = np.log(np.maximum(depth, 1e-12))
    columns = {
        Check.SLOW_CHANGE: law.force(x, fit.v) * time,
        Check.FRICTION: spring * np.tanh(RISE * speed),
        # Only for laws whose damping grows as xⁿ. For a constant damper, K₁ v + 2 K₂ x v would
        # equal that damper except for rounding of K₂.
        Check.DAMPING_FORM: slope * speed if law.power_law else at_rest,
        Check.DAMPING_WITH_DEPTH: spring * speed,
        # ∂²F/∂n², or ∂F/∂n if the exponent is fixed, because the true exponent is then only
        # assumed.
        Check.SHAPE: spring * (logarithm if fit.fixed else logarithm**2),
        Check.SQUARE_SPEED: spring * speed * np.abs(speed),
    }
    return causes_from_columns(fit, columns, _explain_column)


def _explain_column(fit: Fit, check: Check, amount: float) -> tuple[str, Remedy | None]:
    """Return the sentence and the next step for an amount of a column."""
    force_fraction = percent(abs(amount) / max(abs(fit.force_at_depth(fit.solution.law)), 1e-300))
    # The line through a change that is not even may fall below zero.
    change = f"hardens by {percent(amount)}" if amount > 0.0 else f"softens by {percent(-amount)}"
    change = "softens by over 90 %" if amount < -0.9 else change
    half = rounded(median(fit.data.time), 3)
    return {
        Check.SLOW_CHANGE: (
            f"the material {change} during the recording",
            None if presses_once(fit) else Remedy(NextStep.TWO_HALVES, half),
        ),
        Check.FRICTION: (
            f"friction of {force_fraction} of the force: it depends on the direction of motion, "
            "not on the speed",
            Remedy(NextStep.ALONG_NORMAL) if _knows_directions(fit) else None,
        ),
        Check.DAMPING_FORM: (
            "the damping grows with depth differently than in the law",
            Remedy(NextStep.WORKING_DEPTH),
        ),
        Check.DAMPING_WITH_DEPTH: (
            "the damping grows with depth, but not in this law",
            Remedy(NextStep.GROWING_DAMPING),
        ),
        Check.SHAPE: (
            "the force does not grow with depth by the exponent that was passed"
            if fit.fixed
            else "the force grows with depth differently than in the law",
            deeper_half_remedy(fit),
        ),
        Check.SQUARE_SPEED: (
            "the damping force is not proportional to the speed: the damping holds at "
            f"{format_quantity(fit.speed, 'm/s', digits=2)}",
            Remedy(NextStep.TASK_SPEED),
        ),
    }[check]


def _knows_directions(fit: Fit) -> bool:
    """Whether several axes were recorded: one axis, a testing machine, has no other direction."""
    prepared = fit.data.contact.prepared
    return prepared is not None and prepared.normal is not None


TIMES = 7  # relaxation times tried, from P/30 to 0.7 of the recording


def find_relaxation(fit: Fit) -> list[MisfitHypothesis]:
    """Fit a relaxation branch dh/dt = d(ξⁿ)/dt − h/τ next to the law, with the best of seven τ.

    With q = ωτ at the motion's frequency ω, the branch adds q²/(1 + q²) of its force to the
    stiffness and τ/(1 + q²) to the damping. Without these terms a dynamic stiffness would be
    reported as 50 % wrong. Without time a branch would only follow the difference of press and
    release.
    """
    data = fit.data
    steps = np.diff(data.time, prepend=data.time[0])
    duration = float(steps.sum())
    shortest = max(8.0 * data.sample_time, fit.period / 30.0)
    if data.contact.timeless or not 0.0 < shortest < 0.7 * duration:
        return []
    law = fit.solution.law
    x = np.maximum(fit.penetration / fit.units.depth, 0.0)
    at_depth = fit.force_at_depth(law) or 1.0
    spring = law.force(x, np.zeros_like(x)) / at_depth
    times = np.geomspace(shortest, 0.7 * duration, TIMES)
    states = _core.relaxation_states(1.0, times, steps, spring)[fit.windows.samples]
    fits = [fit_with_column(fit, fit.windows.mean(h)) for h in states.T]
    fitted = [(each, time) for each, time in zip(fits, times.tolist(), strict=True) if each]
    if not fitted:
        return []
    best, time = max(fitted, key=lambda each: each[0].explained_fraction)
    turn = 2.0 * math.pi * time / fit.period
    branch = best.amount / (1.0 + turn**2) / at_depth
    change = ParameterChange(law, best.change, (turn**2 * branch, time * branch))
    explanation = _describe_relaxation(fit, time)
    numbers = best.z, best.explained_fraction, 0.0
    return [MisfitHypothesis(Check.MEMORY, *numbers, *explanation, change, *change.relative(fit))]


def _describe_relaxation(fit: Fit, time: float) -> tuple[str, Remedy]:
    """Return the sentence and the next step for relaxation in the residual."""
    over = f"about {rounded(time, 2)} s"
    remedy = relaxation_remedy(fit.laws, time)
    relaxing = fit.equivalent
    if relaxing is None:
        frequency = f"{rounded(1.0 / fit.period, 2)} Hz"
        return f"stress relaxation over {over}: the stiffness holds at {frequency}", remedy
    if relaxing.longest == 0.0:
        suffix = (
            ", which no compared law describes better: sensor drift, or a material that changes"
        )
    elif time > relaxing.longest:
        suffix = ", longer than the law does: sensor drift, or a material that softens"
    else:
        return f"the force relaxes over {over} differently than the law", remedy
    return f"the force relaxes over {over}{suffix}", Remedy(NextStep.TARE_EACH_TOUCH)


# Depth range over the working depth in which adhesion is searched for, and its number of pieces.
LIGHT = (-0.2, 0.5)
PIECES = 8
FEWEST_PULLED = 10  # samples in a piece
PULL_Z = 4.0
LEAST_PULL = 0.003  # standard errors; fraction of the largest force
REACHES = (0.1, 0.2, 0.4, 0.8)  # lengths of an adhesive neck over the working depth


def find_adhesion_or_relaxation(fit: Fit) -> list[MisfitHypothesis]:
    """Return adhesion if the force is negative and adhesion fits as well, else relaxation.

    The columns of adhesion are −exp(−ξ/r) on withdrawal, a neck that breaks, and −√ξ on withdrawal
    or in both directions, as in the theory of Johnson, Kendall and Roberts. Relaxation of
    a material causes no negative force. A relaxing law may still have one; it then explains far
    more than adhesion.
    """
    causes = find_relaxation(fit)
    pull = largest_pull(fit)
    if not pull > 0.0:
        return causes
    depth = np.maximum(fit.x, 0.0) * fit.units.depth / fit.reference
    root = np.sqrt(depth)
    shapes = np.array([*(np.exp(-depth / reach) for reach in REACHES), root])
    columns = fit.windows.mean(-np.vstack([np.where(fit.v < 0.0, shapes, 0.0), root]).T).T
    fits = (fit_with_column(fit, column) for column in columns)
    pulls = [each for each in fits if each is not None and each.amount > 0.0]
    if not pulls:
        return causes
    best = max(pulls, key=lambda each: each.explained_fraction)
    if causes and clearly_better(causes[0], best):
        return causes
    force = format_quantity(pull, "N")
    sentence = f"adhesion: near the surface the material pulls the probe with {force}"
    remedy = Remedy(NextStep.STAY_IN_CONTACT, otherwise=deeper_half_remedy(fit))
    return [cause_from_column(fit, Check.ADHESION, best, sentence, remedy)]


def largest_pull(fit: Fit) -> float:
    """Return the largest adhesive force during withdrawal, relative to free air, N; 0 without.

    The reference is the lower of two means in free air, of all samples and of those in withdrawal,
    so that friction of the probe does not count, and follows the slope of the approach in air.
    """
    free = np.flatnonzero(fit.free)
    if free.size < FEWEST_FREE:
        return 0.0
    x = fit.penetration / fit.reference
    force = fit.data.contact.force[fit.data.known]
    leaves = (fit.data.velocity < -0.1 * fit.speed) & ~fit.rejected
    free_sets = [each for each in (free, free[leaves[free]]) if each.size]
    away = [each[x[each] <= np.median(x[each])] for each in free_sets]
    zero = min((force[each] for each in away), key=np.mean)
    comes = free[~leaves[free]]
    slope = 0.0
    if comes.size and np.ptp(x[comes]) > 0.0:
        # Centred sums, which are defined even if the positions differ in their last digits only.
        off = x[comes] - x[comes].mean()
        slope = min(float(off @ force[comes] / max(off @ off, float(np.finfo(float).tiny))), 0.0)
    place = (x - LIGHT[0]) * PIECES / (LIGHT[1] - LIGHT[0])
    least = LEAST_PULL * fit.data.peak_force
    largest = 0.0
    for piece in range(PIECES):
        in_piece = leaves & (place >= piece) & (place < piece + 1)
        if np.count_nonzero(in_piece) < FEWEST_PULLED:
            continue
        below = zero.mean() + slope * (x[in_piece] - float(np.mean(x[away[0]]))) - force[in_piece]
        pull = float(below.mean())
        error = math.hypot(mean_error(below), mean_error(zero))
        if pull > max(least, largest, PULL_Z * error):
            largest = pull
    return largest


HOLD = 3.0  # relaxation times, after which e⁻³ = 5 % remains
STILL = 0.05  # fraction of the rms velocity


def check_relaxed_stiffness(fit: Fit) -> Finding | None:
    """The relaxed stiffness is extrapolated: no hold of three relaxation times was recorded."""
    if fit.laws is None or fit.equivalent is None or not fit.laws.law.remembers:
        return None
    inside = np.flatnonzero(fit.inside)
    data = fit.data
    is_still = np.abs(data.velocity[inside]) < STILL * fit.speed
    ends = np.flatnonzero(np.diff(is_still, prepend=False, append=False)).reshape(-1, 2)
    time = data.time[inside]
    held = max((float(time[end - 1] - time[begin]) for begin, end in ends.tolist()), default=0.0)
    relaxation = fit.laws.law.relaxation
    assert relaxation is not None
    if held >= HOLD * relaxation.longest_time:
        return None
    return Check.RELAXED_STIFFNESS.finding(
        "the relaxed stiffness is extrapolated: no hold as long as three relaxation times was "
        "recorded; K′ and B′ at the motion's frequency do not need it",
        Remedy(NextStep.HOLD, rounded(HOLD * relaxation.longest_time, 2)),
    )


def check_behind_relaxation(fit: Fit) -> list[Finding]:
    """Report adhesion, or a change of the material, that a relaxing law has absorbed.

    The Hunt–Crossley law is fitted to the same samples. With adhesion its residual is about as
    small as the residual of the selected law, with a change of the material far smaller.
    """
    plain = fit.equivalent_law_fit()
    energy = fit.solution.energy
    causes = []
    if largest_pull(plain) > 0.0:
        pulls = (each for each in find_adhesion_or_relaxation(plain) if each.z > SIGNIFICANT)
        causes += [(each, energy / SURE) for each in pulls if each.check is Check.ADHESION]
    if not fit.at_noise_floor and (changed := find_changes(plain)) is not None:
        causes.append((changed.cause, energy * SURE))
    return [
        each.check.finding(each.sentence, each.remedy, each.z, mark="with-care")
        for each, most in causes
        if (1.0 - each.explained_fraction) * plain.solution.energy < most
    ]


# Any other cause explains at most the first fraction of what a leading cause does, and a memory at
# least the second fraction of the residual.
SECOND = 0.8
ALONE = 0.25
LEAST_MEMORY = 0.03  # fraction of the force
# A bent sensor, a material of another shape and a wrong surface bend the same curve, so none is
# another's rival, and a law with a free exponent imitates a part of each: what the residual shows
# does not bound the change. The largest z of several columns is larger than that of one. Of 1580
# stiffnesses of ``benchmarks.diagnosis.mix`` (seeds 0, 2000, 8000 to 11000) that are *trust*
# otherwise, this finds 21, of which 14 are more than 10 % off.
ELASTIC = (Check.SHAPE, Check.SENSOR_GAIN, Check.SURFACE)
BENT_Z = 6.0
# Least slope of the residual, as a fraction of the stiffness and in standard errors, of at least so
# many windows within this fraction of the working depth.
LEAST_SLOPE = 0.2
SLOPE_Z = 3.0
NEAR_DEPTH = 0.15
FEWEST_NEAR = 6


def check_unknown_law(
    fit: Fit, causes: Sequence[MisfitHypothesis], unexplained: float
) -> Finding | None:
    """The selected law lacks what it should describe: a memory, the shape, a knee.

    One cause without a rival explains it, or the residual has a slope at the working depth.
    Hysteresis of a sensor or a material makes small motions up to a third softer than large ones.
    """
    if fit.laws is None or not causes:
        return None
    leading, *others = sorted(causes, key=attrgetter("explained_fraction"), reverse=True)
    explained = leading.explained_fraction
    rivals = [cause for cause in others if {leading.check, cause.check} - {*ELASTIC}]
    leads = all(cause.explained_fraction < SECOND * explained for cause in rivals)
    memory = leading.check is Check.MEMORY and fit.equivalent is None and unexplained > LEAST_MEMORY
    bent = leading.check is Check.SENSOR_GAIN and abs(leading.stiffness) > CARE
    shape = leading.check is Check.SHAPE or bent
    if leads and memory and explained > ALONE:
        what = "the force depends on its past as in no compared law, as by hysteresis"
    elif leads and shape and leading.z > BENT_Z:
        what = "the force grows with depth as in no compared law, as of a sensor near its limit"
    elif (slope := local_slope(fit)) > LEAST_SLOPE:
        what = f"at the working depth the force is {percent(slope)} steeper or flatter than the law"
    else:
        return None
    return Check.UNKNOWN_LAW.finding(
        f"{what}: the stiffness may be that of another law",
        Remedy(NextStep.SPRING_CHECK),
        stiffness="with-care",
        brief=what,
    )


def local_slope(fit: Fit) -> float:
    """Slope of the residual around the working depth over the stiffness; 0 if not significant."""
    mean = fit.windows.mean
    scale = fit.units.depth / fit.depth
    place = scale * mean(fit.x) - 1.0
    speed = mean(fit.v)
    nearby = np.abs(place) < NEAR_DEPTH
    if np.count_nonzero(nearby) < FEWEST_NEAR:
        return 0.0
    columns = np.column_stack([place, np.ones_like(place), speed])[nearby]
    solved, *_ = np.linalg.lstsq(columns, fit.solution.residual[nearby], rcond=None)
    remaining = fit.solution.residual[nearby] - columns @ solved
    error = math.sqrt(robust_covariance(columns, remaining, fit.windows.shared)[0, 0])
    stiffness = fit.depth * float(fit.reference_scales[0])
    return abs(float(solved[0])) / stiffness if abs(solved[0]) > SLOPE_Z * error else 0.0


def relaxation_remedy(laws: ModelSelection | None, time: float) -> Remedy:
    """Return the next step for relaxation in the residual.

    Parameters
    ----------
    laws : ModelSelection, optional
        The model selection, if the law was selected.
    time : float
        Relaxation time in the residual, s.
    """
    if laws is None:
        return Remedy(NextStep.SELECT_LAW)
    if time > laws.longest:  # sensor drift is as likely
        return Remedy(NextStep.TARE_EACH_TOUCH)
    return Remedy(NextStep.TASK_SPEED)
