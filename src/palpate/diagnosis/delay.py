"""Causes of misfit as columns of a fit: drift, friction, another shape, delay, relaxation, pull."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.finding import TASK_SPEED, remedy_of_memory
from palpate.diagnosis.fit import (
    FEWEST_FREE,
    MISFIT,
    AugmentedFit,
    Band,
    Fit,
    MisfitHypothesis,
    MovedSamples,
    Moves,
    Solution,
    augmented_fit,
    deeper_half,
)
from palpate.diagnosis.marks import SURE
from palpate.digits import format_quantity, rounded, with_error
from palpate.estimators.least_squares import mean_error
from palpate.validation import Floats

# Of the sensor's gain: a curve that bends more is the material's.
MOST_CURVED = 0.3


def columns(fit: Fit) -> list[MisfitHypothesis]:
    """Add one column at a time to the law's own, and fit."""
    law, data, samples = fit.solution.law, fit.data, fit.band.samples
    x, rest = np.maximum(fit.x, 1e-12), np.zeros_like(fit.x)
    # Without units: depth over the working depth, speed over its rms, time from −½ to ½.
    depth, speed = x * fit.units.depth / fit.reference, fit.v * fit.units.speed / fit.speed
    time = data.time[samples]
    time = (time - time.mean()) / (float(np.ptp(time)) or 1.0)
    spring, slope = law.force(x, rest), law.penetration_gradient(x, rest)
    spring = spring / (float(np.median(spring)) or 1.0)  # ξⁿ of a power law
    slope = slope / (float(np.median(slope)) or 1.0)  # ξⁿ⁻¹ of a power law
    logarithm = np.log(np.maximum(depth, 1e-12))
    values = {
        "gain drift": law.force(x, fit.v) * time,
        "offset drift": time,
        "friction": spring * np.tanh(20.0 * speed),
        # Of a law whose damping grows as xⁿ. Beside a constant damper, K₁ v + 2 K₂ x v would be
        # that damper but for some rounding of K₂.
        "damping form": slope * speed if law.power_law else rest,
        "damping with depth": spring * speed,
        # ∂²F/∂n², or where the exponent is fixed ∂F/∂n: xⁿ is the tip's as far as that is known.
        "shape": spring * (logarithm if fit.fixed else logarithm**2),
        "square speed": spring * speed * np.abs(speed),
        # Of a law whose exponent is not free the bend is rather the material's.
        "sensor gain": (
            law.force(x, fit.v) ** 2 / (fit.force_at_depth(law) or 1.0)
            if law.power_law and not fit.fixed
            else rest
        ),
        "inertia": fit.acceleration,  # times the mass that moves beyond the sensor it is a force
    }
    causes = []
    for name, column in zip(values, fit.band.mean(np.array([*values.values()]).T).T, strict=True):
        found = augmented_fit(fit, column)
        if name == "sensor gain" and found is not None and abs(found.amount) > MOST_CURVED:
            continue
        if found is not None:
            causes.append(cause_of(fit, name, found, *_explained(fit, name, found.amount)))
    return causes


def _explained(fit: Fit, name: str, amount: float) -> tuple[str, str]:
    """What so much of a column means, and the next step."""
    part = abs(amount) / max(abs(fit.force_at_depth(fit.solution.law)), 1e-300)
    half = rounded(float(np.median(fit.data.time)), 3)
    return {
        "gain drift": (
            f"the material {'hardens' if amount > 0.0 else 'softens'} by {abs(amount):.1%} during "
            "the recording",
            f"identify the two halves separately: --stop {half}, then --start {half}",
        ),
        "offset drift": (
            f"the force sensor's zero drifts by {format_quantity(abs(amount), 'N')}",
            "tare the sensor before each touch",
        ),
        "friction": (
            f"friction of {part:.1%} of the force: it depends on the direction of motion, not on "
            "the speed",
            "press along the surface normal",
        ),
        "damping form": (
            "the damping grows with depth differently than in the law",
            "use the damping at the working depth only",
        ),
        "damping with depth": (
            "the damping grows with depth, but not in this law",
            "run again with --method variable-projection, whose damping grows with depth",
        ),
        "shape": (
            "the force does not grow with depth by the exponent that was passed"
            if fit.fixed
            else "the force grows with depth differently than in the law",
            deeper_half(fit),
        ),
        "square speed": (
            "the damping force is not proportional to the speed",
            TASK_SPEED,
        ),
        "sensor gain": (
            f"the force sensor's gain changes by {abs(amount):.0%} up to the working force",
            "calibrate the force sensor at several forces",
        ),
        "inertia": (
            f"a mass of {rounded(amount, 2)} kg moves between the force sensor and the material"
            if amount > 0.0
            else "the force depends on the acceleration",
            "subtract the inertia of the parts beyond the sensor from the force",
        ),
    }[name]


def cause_of(
    fit: Fit,
    name: str,
    result: AugmentedFit,
    sentence: str,
    remedy: str,
    moves: Moves | None = None,
) -> MisfitHypothesis:
    """A cause from what its column gave."""
    law, change = fit.solution.law, result.change
    # Relative move of the law's first parameter, SI: Δk/k − Δn ln x_r for a power law.
    parameter = float(change[0]) / max(abs(float(law.parameters[0])), 1e-300)
    if law.power_law:
        parameter -= float(change[2]) * math.log(fit.units.depth)
    moves = moves or (lambda it: it.moves(change))
    found = result.z, result.gain, parameter
    settled = name != "shape" or fit.ratio * math.sqrt(max(1.0 - result.gain, 0.0)) < MISFIT
    return MisfitHypothesis(name, *found, sentence, remedy, moves, *moves(fit), settled)


# Delay: the force late, or early, against the penetration.

LONGEST = 25e-3  # s; beyond that a recording is out of step, not late
MOST_ROWS = 700  # on which whole shifts are tried
OFF_AXIS, SOFT_MOUNT = 10.0, 0.05  # degrees; part of the stiffness
ROUGHLY = 1e-3  # of the energy, to which a shift is tried: one sample more changes it by more


def delay(fit: Fit) -> list[MisfitHypothesis]:
    """Shift penetration and velocity by whole samples, refit, and take the best of them.

    Whole samples, because to interpolate them smooths them, and half a sample then fits clean data
    better. What is left of a sample is a column, dF/dτ by a central difference.
    """
    step = fit.data.sample_time
    reach = int(min(max(LONGEST, 3.0 * step), fit.period / 6.0) / step)
    if reach < 1:
        return []
    fine = augmented_fit(fit, _by_delay(fit, 0))
    if fine is None:
        return []
    moved, shift = _best_shift(fit, reach)
    before, late, result = fit.solution, fine.amount, fine
    if shift:  # its influence is the refit less the same fit without it
        left = moved.without(_by_delay(fit, shift))
        rest = float(left @ moved.residual / max(float(left @ left), 1e-300))
        late = shift * step + min(max(rest, -step), step)
        change = np.zeros_like(fine.change)
        change[: len(before.law.symbols)] = moved.law.parameters - before.law.parameters
        result = AugmentedFit(change, late, fine.z, max(fit.gain(moved.energy), fine.gain))
    if abs(shift) >= reach:
        return []
    error = abs(fine.amount) / max(fine.z, 1e-300)
    applied = fit.data.contact.delay
    total = late + (0.0 if applied is None else applied.seconds)
    sentence = (
        f"the force is {with_error(abs(total) * 1e3, error * 1e3, unit='ms')} "
        f"{'late, or the position is commanded' if total > 0.0 else 'early'}"
        f"{'' if applied is None else ' in total'}, or the damping follows another law (the "
        "recording cannot tell which)"
    )
    # Found already, what is left is by the law that is identified here.
    found = applied is not None and applied.found
    known = f"{total * 1e3:.4g}ms+-{error * 1e3:.2g}ms" if found else "find"
    remedy = f"run again with --delay {known} if the sensors can be out of step by that much"

    def moves(other: Fit) -> tuple[float, float]:
        after = other.stiffness(moved.law), other.damping(moved.law)
        return other.apart(after, before.law)

    return [cause_of(fit, "delay", result, sentence, remedy, moves if shift else None)]


# A skew that jumps: samples of one channel were lost midway, which no time stamp shows.

BORDERS = 24  # at which it is looked for; then as many between the neighbours of the best one
# The largest z of 96 clean recordings, in white and in slow noise, is 4.6; the least of 30 with a
# jump of 2 to 20 ms is 10.5.
JUMP_Z = 6.0
BOTH_WAYS = 0.1  # least share of either direction in a part
LEAST_JUMP = 0.25  # of a sample


def skew_jump(fit: Fit) -> list[MisfitHypothesis]:
    """Fit dF̂/dτ, and dF̂/dτ from a border on, next to the law's columns; with the best border."""
    slope, solution = _by_delay(fit, 0), fit.solution
    whole = augmented_fit(fit, slope)
    if whole is None:
        return []
    beside = Solution(
        solution.law,
        solution.offset,
        np.column_stack([solution.jacobian, slope]),
        solution.residual - whole.amount * solution.without(slope),
    )
    rows, between = len(fit.band), (0, len(fit.band))
    pressing = np.cumsum(fit.band.mean(fit.v) > 0.0)
    place = 0
    for _ in range(2):
        borders = np.unique(np.linspace(*between, BORDERS + 2)[1:-1].astype(int))
        borders = borders[(borders > 0) & (borders < rows)]
        # A part that only presses or only withdraws does not tell a delay from the law.
        before = pressing[borders - 1]
        shares = np.stack([before / borders, (pressing[-1] - before) / (rows - borders)])
        borders = borders[np.all((shares > BOTH_WAYS) & (shares < 1.0 - BOTH_WAYS), axis=0)]
        if not borders.size:
            return []
        later = np.where(np.arange(rows)[:, None] >= borders, slope[:, None], 0.0)
        left = later - beside.jacobian @ (beside.inverse @ later)
        energy = np.square(left).sum(axis=0)
        removed = (left.T @ beside.residual) ** 2 / np.maximum(energy, 1e-300)
        place = int(borders[np.argmax(np.where(energy > 0.0, removed, 0.0))])
        step = -(-(between[1] - between[0]) // (BORDERS + 1))
        between = place - step, place + step
    result = augmented_fit(fit, np.where(np.arange(rows) >= place, slope, 0.0), beside)
    if result is None or result.z < JUMP_Z:
        return []
    if abs(result.amount) < LEAST_JUMP * fit.data.sample_time:
        return []
    time = float(fit.time[place])
    error = abs(result.amount) / result.z
    sentence = (
        f"from {rounded(time, 3)} s on the force is "
        f"{with_error(abs(result.amount) * 1e3, error * 1e3, unit='ms')} "
        f"{'later' if result.amount > 0.0 else 'earlier'}: samples of one channel were lost"
    )
    remedy = f"identify the two parts separately: --stop {time:.4g}, then --start {time:.4g}"
    change = whole.change + result.change[: len(whole.change)]
    moved = AugmentedFit(change, result.amount, result.z, result.gain)
    return [cause_of(fit, "skew jump", moved, sentence, remedy)]


def delay_sensitivity(fit: Fit) -> str:
    """Describe how much 1 ms between force and position would change the damping.

    K (x + vτ)ⁿ = K xⁿ + τ n K xⁿ⁻¹ v: to first order a force that is early by τ is the damper of a
    half-space.
    """
    law = fit.solution.law
    damping = abs(fit.damping(law))
    by_skew = abs(fit.stiffness(law)) * 1e-3 / damping if damping > 0.0 else math.inf
    words = f"1 ms of skew between force and position changes the damping by {by_skew:.1%}"
    if (applied := fit.data.contact.delay) is not None and applied.seconds:
        size = with_error(abs(applied.seconds) * 1e3, applied.standard_error * 1e3, unit="ms")
        way = "late" if applied.seconds > 0.0 else "early"
        words = f"a delay was taken out: the force was {size} {way}; {words}"
    if fit.laws is None or fit.laws.verdict.candidate.damping != "half-space":
        return words
    return f"{words}; no check can distinguish half-space damping from a force that is early"


def delay_error(fit: Fit) -> float:
    """How far the standard error of an applied delay moves the damping, of its size: S SE(τ)."""
    applied = fit.data.contact.delay
    error = 0.0 if applied is None else applied.standard_error
    return abs(fit.stiffness(fit.solution.law)) * error / fit.sizes[1]


def unseen(fit: Fit) -> str:
    """Describe what no recording can show, and what it would cost.

    At θ to the normal both x and F are their projections: S = ∂F/∂x keeps cosᵖ⁺¹ θ and C cosᵖ⁺² θ,
    with p = x S/F, which is n of a power law. A mount of stiffness k in series leaves S k/(S + k).
    """
    law, part = fit.solution.law, math.cos(math.radians(OFF_AXIS))
    stiffness, force = fit.stiffness(law), fit.force_at_depth(law)
    power = fit.depth * stiffness / force if force else 1.0
    lost = (1.0 - part ** (power + 1.0), 1.0 - part ** (power + 2.0))
    soft = format_quantity(abs(stiffness) * (1.0 / SOFT_MOUNT - 1.0), "N/m")
    return (
        f"no recording shows these: {OFF_AXIS:.0f}° off the surface normal makes the stiffness "
        f"{lost[0]:.1%} and the damping {lost[1]:.1%} too small; 1 % of scale changes them by 1 %; "
        f"a mount softer than {soft} makes the stiffness over {SOFT_MOUNT:.0%} too small"
    )


def _by_delay(fit: Fit, shift: int) -> Floats:
    """dF̂/dτ at a shift of whole samples, N/s."""
    law, step = fit.solution.law, fit.data.sample_time
    later, earlier = (_motion(fit, shift + by, fit.band, fit.force) for by in (1, -1))
    more = law.force(np.maximum(later.x, 0.0), later.v)
    less = law.force(np.maximum(earlier.x, 0.0), earlier.v)
    return (fit.band.mean(more) - fit.band.mean(less)) / (2.0 * step)


def _motion(fit: Fit, shift: int, band: Band, force: Floats) -> MovedSamples:
    """The motion that a force later by some samples answers to."""
    place = _within_segment(fit, band, shift)
    x = fit.penetration[place] / fit.units.depth
    return MovedSamples(x, fit.data.velocity[place] / fit.units.speed, band, force)


def _within_segment(fit: Fit, band: Band, shift: int) -> NDArray[np.intp]:
    """The samples that were some earlier, none across the border of a segment."""
    segment = fit.data.segment
    own = segment[band.samples]
    first, last = np.searchsorted(segment, own), np.searchsorted(segment, own, "right") - 1
    place: NDArray[np.intp] = np.clip(band.samples - shift, first, last)
    return place


def _best_shift(fit: Fit, reach: int) -> tuple[Solution, int]:
    """The whole shift that fits best: a coarse scan, then single samples around its best."""
    every = max(-(-len(fit.band) // MOST_ROWS), 1)
    band, force = fit.band.thinned(every) if every > 1 else fit.band, fit.force[::every]
    law, offset = fit.solution.law, fit.solution.offset

    @cache
    def energy(shift: int) -> float:
        return fit.solve(law, offset, _motion(fit, shift, band, force), enough=ROUGHLY).energy

    coarse = max(reach // 6, 1)
    best = min({0, -reach, reach, *range(-reach, reach + 1, coarse)}, key=energy)
    while coarse > 1:
        coarse //= 2
        near = (best - coarse, best, best + coarse)
        best = min((s for s in near if abs(s) <= reach), key=energy)
    return fit.solve(law, offset, _motion(fit, best, fit.band, fit.force)), best


# Memory: a branch that relaxes, as viscoelastic materials have.

TIMES = 7  # relaxation times tried, from P/30 to 0.7 of the recording
BLOCK = 64  # samples that are relaxed at once


def memory(fit: Fit) -> list[MisfitHypothesis]:
    """Fit dh/dt = d(ξⁿ)/dt − h/τ beside the law, with the best of seven τ.

    At the motion's frequency ω the branch adds q²/(1 + q²) of its force to the stiffness and
    τ/(1 + q²) to the damping, q = ωτ: without that a dynamic stiffness is called 50 % wrong.
    """
    data = fit.data
    steps = np.diff(data.time, prepend=data.time[0])
    duration = float(steps.sum())
    shortest = max(8.0 * data.sample_time, fit.period / 30.0)
    if not 0.0 < shortest < 0.7 * duration:
        return []
    law, x = fit.solution.law, np.maximum(fit.penetration / fit.units.depth, 0.0)
    at_depth = fit.force_at_depth(law) or 1.0
    spring = law.force(x, np.zeros_like(x)) / at_depth
    best, time = None, shortest
    for tau in np.geomspace(shortest, 0.7 * duration, TIMES):
        state = relaxed(spring, steps, float(tau), data.sample_time)
        found = augmented_fit(fit, fit.band.mean(state[fit.band.samples]))
        if found is not None and (best is None or found.gain > best.gain):
            best, time = found, float(tau)
    if best is None:
        return []
    turn = 2.0 * math.pi * time / fit.period
    part, change = best.amount / (1.0 + turn**2) / at_depth, best.change

    def moves(other: Fit) -> tuple[float, float]:
        stiffness, damping = other.moves(change)
        slope = part * other.stiffness(law)
        by_branch = turn**2 * slope / other.sizes[0], time * slope / other.sizes[1]
        return stiffness + by_branch[0], damping + by_branch[1]

    described = best.z, best.gain, 0.0, *_describe(fit, time)
    return [MisfitHypothesis("memory", *described, moves, *moves(fit))]


def _describe(fit: Fit, time: float) -> tuple[str, str]:
    """What was found, and the next step; a law that relaxes may leave some relaxation over."""
    over, tare = f"about {rounded(time, 2)} s", "tare the sensor before each touch"
    if fit.equivalent is None:
        return (
            f"stress relaxation over {over}: the stiffness holds at "
            f"{rounded(1.0 / fit.period, 2)} Hz",
            remedy_of_memory(fit.laws, time),
        )
    if fit.equivalent.longest == 0.0:
        return (
            f"the force relaxes over {over}, which no compared law describes better: sensor drift, "
            "or a material that changes",
            tare,
        )
    if time > fit.equivalent.longest:
        return (
            f"the force relaxes over {over}, longer than the law does: sensor drift, or a material "
            "that softens",
            tare,
        )
    return (
        f"the force relaxes over {over} differently than the law",
        remedy_of_memory(fit.laws, time),
    )


def relaxed(drive: Floats, steps: Floats, tau: float, sample_time: float) -> Floats:
    """State h of dh = d(drive) − h dt/τ, from h = 0; on the median step within a block of samples.

    Exact on an even time base. On an uneven one the decay over a block of 64 is that of its own
    time, and within it that of the median step.
    """
    decay = math.exp(-sample_time / tau)
    power = decay ** np.arange(BLOCK + 1)
    blocks = -(-len(drive) // BLOCK)
    rise = np.zeros(blocks * BLOCK)
    rise[1 : len(drive)] = np.diff(drive)
    local, span = rise.reshape(blocks, BLOCK), 1
    while span < BLOCK:  # Σ aⁱz⁻ⁱ = (1 + az⁻¹)(1 + a²z⁻²)(1 + a⁴z⁻⁴)…
        local[:, span:] += power[span] * local[:, :-span]
        span *= 2
    elapsed = np.zeros(blocks * BLOCK)
    elapsed[: len(drive)] = steps
    over = np.exp(-elapsed.reshape(blocks, BLOCK).sum(axis=1) / tau).tolist()
    carried, state = np.empty(blocks), 0.0
    for block, (end, fade) in enumerate(zip(local[:, -1].tolist(), over, strict=True)):
        carried[block] = state
        state = end + fade * state
    return (local + carried[:, None] * power[1:]).reshape(-1)[: len(drive)]


# Adhesion: a material that pulls the probe back, which looks like relaxation.

# Of the working depth: where a pull is looked for, in so many pieces.
LIGHT, PIECES = (-0.2, 0.5), 8
FEWEST_PULLED = 10  # samples of a piece
PULL_Z, LEAST_PULL = 4.0, 0.003  # standard errors; of the largest force
REACHES = (0.1, 0.2, 0.4, 0.8)  # of the working depth, over which a neck lets go


def adhesion_or_memory(fit: Fit) -> list[MisfitHypothesis]:
    """Relaxation; or adhesion, where the force is below zero and adhesion explains about as much.

    Its columns are −exp(−ξ/r) on withdrawal, a neck that lets go, and −√ξ on withdrawal or both
    ways, as of Johnson, Kendall and Roberts. No relaxation pulls, but that of a law may: then it
    explains far more.
    """
    found = memory(fit)
    pull = largest_pull(fit)
    if not pull > 0.0:
        return found
    depth = np.maximum(fit.x, 0.0) * fit.units.depth / fit.reference
    root = np.sqrt(depth)
    shapes = np.array([*(np.exp(-depth / reach) for reach in REACHES), root])
    columns = fit.band.mean(-np.vstack([np.where(fit.v < 0.0, shapes, 0.0), root]).T).T
    fits = (augmented_fit(fit, column) for column in columns)
    pulls = [each for each in fits if each is not None and each.amount > 0.0]
    if not pulls:
        return found
    best = max(pulls, key=lambda each: each.gain)
    if found and 1.0 - found[0].gain < SURE * (1.0 - best.gain):
        return found
    force = format_quantity(pull, "N")
    sentence = f"adhesion: near the surface the material pulls the probe with {force}"
    remedy = f"record a motion that stays in contact, or {deeper_half(fit)}"
    return [cause_of(fit, "adhesion", best, sentence, remedy)]


def largest_pull(fit: Fit) -> float:
    """How far the force is below that in free air as the probe withdraws, N; 0 if it is not.

    Below that of any direction, for friction of the probe, and of what pulls on the probe in air.
    """
    free = np.flatnonzero(fit.free)
    if free.size < FEWEST_FREE:
        return 0.0
    x, force = fit.penetration / fit.reference, fit.data.contact.force[fit.data.known]
    leaves = (fit.data.velocity < -0.1 * fit.speed) & ~fit.rejected
    still = [each for each in (free, free[leaves[free]]) if each.size]
    away = [each[x[each] <= np.median(x[each])] for each in still]
    zero = min((force[each] for each in away), key=np.mean)
    comes, slope = free[~leaves[free]], 0.0
    if comes.size and np.ptp(x[comes]) > 0.0:
        # Sums about the means: they also exist where the places differ in their last digits only.
        off = x[comes] - x[comes].mean()
        slope = min(float(off @ force[comes] / max(off @ off, float(np.finfo(float).tiny))), 0.0)
    place = (x - LIGHT[0]) * PIECES / (LIGHT[1] - LIGHT[0])
    least, largest = LEAST_PULL * fit.data.peak_force, 0.0
    for piece in range(PIECES):
        there = leaves & (place >= piece) & (place < piece + 1)
        if np.count_nonzero(there) < FEWEST_PULLED:
            continue
        below = zero.mean() + slope * (x[there] - float(np.mean(x[away[0]]))) - force[there]
        pull = float(below.mean())
        if pull > max(least, largest) and pull > PULL_Z * math.hypot(
            mean_error(below), mean_error(zero)
        ):
            largest = pull
    return largest
