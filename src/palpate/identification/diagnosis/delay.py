"""A constant delay of the force against the penetration, or one that starts midway."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from palpate.digits import percent, rounded, with_error
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.identification.diagnosis.causes import (
    MisfitHypothesis,
    OtherLaw,
    cause_from_column,
    clock_of,
    has_two_clocks,
)
from palpate.identification.diagnosis.fit import (
    SIGNIFICANT,
    Fit,
    MovedSamples,
    Solution,
    WindowedSamples,
    fit_with_column,
)
from palpate.validation import Floats, Indices

LONGEST = 25e-3  # s; with more the recording is misaligned, not delayed
MOST_ROWS = 700  # rows that are used to compare shifts of whole samples
ROUGHLY = 1e-3  # relative accuracy of the energy of a shift; one more sample changes it by more


def find_delay(fit: Fit) -> list[MisfitHypothesis]:
    """Shift penetration and velocity by whole samples, refit, and choose the best shift.

    Interpolation between samples smooths them, and half a sample would then fit clean data better.
    The remaining fraction of a sample is fitted as a column, dF/dτ by a central difference.
    """
    step = fit.data.sample_time
    reach = int(min(max(LONGEST, 3.0 * step), fit.period / 6.0) / step)
    if reach < 1:
        return []
    fine = fit_with_column(fit, _force_by_delay(fit, 0))
    if fine is None:
        return []
    shifted, shift = _best_shift(fit, reach)
    if abs(shift) >= reach:
        return []
    unshifted = fit.solution
    result = fine
    if shift:  # the change is the refit minus the fit without a shift
        remainder = shifted.orthogonal_part(_force_by_delay(fit, shift))
        fraction = float(remainder @ shifted.residual / max(float(remainder @ remainder), 1e-300))
        delay = shift * step + min(max(fraction, -step), step)
        change = np.zeros_like(fine.change)
        change[: len(unshifted.law.symbols)] = shifted.law.parameters - unshifted.law.parameters
        explained = max(fit.explained_fraction(shifted.energy), fine.explained_fraction)
        result = replace(fine, change=change, amount=delay, explained_fraction=explained)
    error = abs(fine.amount) / max(fine.z, 1e-300)
    applied = fit.data.contact.delay
    total = result.amount + (0.0 if applied is None else applied.seconds)
    sentence = (
        f"the force is {with_error(abs(total) * 1e3, error * 1e3, unit='ms')} "
        f"{'late, or the position is commanded' if total > 0.0 else 'early'}"
        f"{'' if applied is None else ' in total'}, or the damping follows another law (the "
        "recording cannot tell which)"
    )
    # If a delay was found and applied before, the rest depends on the law identified here.
    found_in_contact = applied is not None and applied.from_contact
    option = f"{total * 1e3:.4g}ms+-{error * 1e3:.2g}ms" if found_in_contact else "find"
    remedy = Remedy(NextStep.DELAY, option)
    clock = clock_of(fit)
    if has_two_clocks(fit) or (clock.is_known and fine.z <= SIGNIFICANT):
        remedy = Remedy(clock.remedy)
    elif total < 0.0 and fit.equivalent is not None:
        remedy = Remedy(NextStep.STEEL_SPRING)  # relaxation looks like a force that is early
    other_law = OtherLaw(shifted.law, unshifted.law) if shift else None
    return [cause_from_column(fit, Check.DELAY, result, sentence, remedy, other_law)]


BORDERS = 24  # borders that are tried, then as many between the neighbours of the best one
# The largest z of 96 clean recordings, in white and in slow noise, is 4.6; the smallest of 30 with
# a jump of 2 to 20 ms is 10.5.
JUMP_Z = 6.0
BOTH_WAYS = 0.1  # smallest fraction of pressing and of withdrawing samples in each part
LEAST_JUMP = 0.25  # fraction of a sample


def find_skew_jump(fit: Fit) -> list[MisfitHypothesis]:
    """Fit a delay dF̂/dτ for the whole recording, and a second one from the best border on."""
    slope = _force_by_delay(fit, 0)
    solution = fit.solution
    constant_delay = fit_with_column(fit, slope)
    if constant_delay is None:
        return []
    with_delay = Solution(
        solution.law,
        solution.offset,
        np.column_stack([solution.jacobian, slope]),
        solution.residual - constant_delay.amount * solution.orthogonal_part(slope),
    )
    rows = len(fit.windows)
    search_range = (0, len(fit.windows))
    pressing = np.cumsum(fit.windows.mean(fit.v) > 0.0)
    place = 0
    for _ in range(2):
        borders = np.unique(np.linspace(*search_range, BORDERS + 2)[1:-1].astype(int))
        borders = borders[(borders > 0) & (borders < rows)]
        # A part that only presses or only withdraws cannot distinguish a delay from damping.
        pressing_before = pressing[borders - 1]
        shares = np.stack(
            [pressing_before / borders, (pressing[-1] - pressing_before) / (rows - borders)]
        )
        borders = borders[np.all((shares > BOTH_WAYS) & (shares < 1.0 - BOTH_WAYS), axis=0)]
        if not borders.size:
            return []
        later = np.where(np.arange(rows)[:, None] >= borders, slope[:, None], 0.0)
        remainders = later - with_delay.jacobian @ (with_delay.inverse @ later)
        energy = np.square(remainders).sum(axis=0)
        removed = (remainders.T @ with_delay.residual) ** 2 / np.maximum(energy, 1e-300)
        place = int(borders[np.argmax(np.where(energy > 0.0, removed, 0.0))])
        step = -(-(search_range[1] - search_range[0]) // (BORDERS + 1))
        search_range = place - step, place + step
    result = fit_with_column(fit, np.where(np.arange(rows) >= place, slope, 0.0), with_delay)
    least = LEAST_JUMP * fit.data.sample_time
    if result is None or result.z < JUMP_Z or abs(result.amount) < least:
        return []
    time = float(fit.time[place])
    error = abs(result.amount) / result.z
    sentence = (
        f"from {rounded(time, 3)} s on the force is "
        f"{with_error(abs(result.amount) * 1e3, error * 1e3, unit='ms')} "
        f"{'later' if result.amount > 0.0 else 'earlier'}: samples of one channel were lost"
    )
    remedy = Remedy(NextStep.TWO_PARTS, f"{time:.4g}")
    change = constant_delay.change + result.change[: len(constant_delay.change)]
    with_jump = replace(result, change=change)
    return [cause_from_column(fit, Check.SKEW_JUMP, with_jump, sentence, remedy)]


def check_skew(fit: Fit) -> Finding:
    """Report how much 1 ms between force and position would change the damping.

    K (x + vτ)ⁿ = K xⁿ + τ n K xⁿ⁻¹ v: to first order a force that is early by τ is the damper of a
    half-space.
    """
    law = fit.solution.law
    damping = abs(fit.damping(law))
    by_skew = abs(fit.stiffness(law)) * 1e-3 / damping if damping > 0.0 else math.inf
    sentence = f"1 ms of skew between force and position changes the damping by {percent(by_skew)}"
    if (applied := fit.data.contact.delay) is not None and applied.seconds:
        size = with_error(abs(applied.seconds) * 1e3, applied.standard_error * 1e3, unit="ms")
        way = "late" if applied.seconds > 0.0 else "early"
        sentence = f"a delay was taken out: the force was {size} {way}; {sentence}"
    if fit.laws is not None and fit.laws.verdict.candidate.damping == "half-space":
        sentence += "; no check can distinguish half-space damping from a force that is early"
    return Check.SKEW.finding(sentence)


def _force_by_delay(fit: Fit, shift: int) -> Floats:
    """Return dF̂/dτ at a shift of whole samples, N/s."""
    law = fit.solution.law
    step = fit.data.sample_time
    later, earlier = (_shift_motion(fit, shift + side, fit.windows, fit.force) for side in (1, -1))
    force_later = law.force(np.maximum(later.x, 0.0), later.v)
    force_earlier = law.force(np.maximum(earlier.x, 0.0), earlier.v)
    return (fit.windows.mean(force_later) - fit.windows.mean(force_earlier)) / (2.0 * step)


def _shift_motion(fit: Fit, shift: int, windows: WindowedSamples, force: Floats) -> MovedSamples:
    """Return the earlier motion that belongs to a force delayed by some samples."""
    place = _earlier_samples(fit, windows, shift)
    x = fit.penetration[place] / fit.units.depth
    return MovedSamples(x, fit.data.velocity[place] / fit.units.speed, windows, force)


def _earlier_samples(fit: Fit, windows: WindowedSamples, shift: int) -> Indices:
    """Return the samples ``shift`` earlier, clipped to the segment."""
    segment = fit.data.segment
    segments = segment[windows.samples]
    first_of_segment = np.searchsorted(segment, segments)
    last = np.searchsorted(segment, segments, "right") - 1
    place: Indices = np.clip(windows.samples - shift, first_of_segment, last)
    return place


def _best_shift(fit: Fit, reach: int) -> tuple[Solution, int]:
    """Return the best shift of whole samples, by a coarse and then a fine scan."""
    every = max(-(-len(fit.windows) // MOST_ROWS), 1)
    windows = fit.windows.thin(every)
    force = fit.force[::every]
    law = fit.solution.law
    offset = fit.solution.offset

    @cache
    def energy(shift: int) -> float:
        motion = _shift_motion(fit, shift, windows, force)
        return fit.solve(law, offset, motion, enough=ROUGHLY).energy

    coarse = max(reach // 6, 1)
    best = min({0, -reach, reach, *range(-reach, reach + 1, coarse)}, key=energy)
    while coarse > 1:
        coarse //= 2
        nearby_shifts = (best - coarse, best, best + coarse)
        best = min((s for s in nearby_shifts if abs(s) <= reach), key=energy)
    return fit.solve(law, offset, _shift_motion(fit, best, fit.windows, fit.force)), best
