"""Delay: the force late, or early, against the penetration."""

import math

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.cause import Beside, Cause, beside
from palpate.diagnosis.columns import cause_of
from palpate.diagnosis.fit import Fit, Motion, Solution
from palpate.digits import with_error
from palpate.validation import Floats

LONGEST = 25e-3  # s; beyond that a recording is out of step, not late
LEAST = 0.3  # samples; less is the sampling itself
MOST_ROWS = 700  # on which whole shifts are tried
ROUGHLY = 1e-3  # of the energy, to which a shift is tried: one sample more changes it by more


def delay(fit: Fit) -> list[Cause]:
    """Shift penetration and velocity by whole samples, refit, and take the best of them.

    Whole samples, because to interpolate them smooths them, and half a sample then fits clean data
    better. What is left of a sample is a column, dF/dτ by a central difference.
    """
    step = fit.data.sample_time
    reach = int(min(max(LONGEST, 3.0 * step), fit.period / 6.0) / step)
    if reach < 1:
        return []
    fine = beside(fit, _by_delay(fit, 0))
    if fine is None:
        return []
    moved, shift = _best_shift(fit, reach)
    late = shift * step + _residual_delay(fit, moved, shift) if shift else fine.amount
    if abs(shift) >= reach or abs(late) < LEAST * step:
        return []
    return [_shifted(fit, late, fine, moved) if shift else _described(fit, late, fine, fine)]


def _shifted(fit: Fit, late: float, fine: Beside, moved: Solution) -> Cause:
    """A delay of a sample or more: its influence is the refit less the same fit without it."""
    before = fit.solution
    gain = 1.0 - moved.energy / max(before.energy, np.finfo(float).tiny)
    change = np.zeros(before.jacobian.shape[1])
    change[: len(before.law.symbols)] = moved.law.parameters - before.law.parameters
    cause = _described(fit, late, fine, Beside(change, late, fine.z, max(gain, fine.gain)))
    return cause.moving(fit, lambda other: other.between(before.law, moved.law))


def _described(fit: Fit, late: float, fine: Beside, result: Beside) -> Cause:
    error = abs(fine.amount) / max(fine.z, 1e-300)
    sentence = (
        f"the force is {with_error(abs(late) * 1e3, error * 1e3, unit='ms')} "
        f"{'late' if late > 0.0 else 'early'}, or the damping follows another law; the two cannot "
        "be told apart by the recording"
    )
    read = f"{late * 1e3:.2g}" if abs(late) < 10e-3 else f"{late * 1e3:.3g}"
    remedy = f"--delay {read}ms, if the sensors can be out of step by that"
    return cause_of(fit, "delay", result, sentence, remedy)


def skew_matters(fit: Fit) -> str:
    """How much 1 ms between force and position would change the damping, in words.

    K (x + vτ)ⁿ = K xⁿ + τ n K xⁿ⁻¹ v: to first order a force that is early by τ is the damper of a
    half-space.
    """
    law = fit.solution.law
    damping = abs(fit.damping(law))
    by_skew = abs(fit.stiffness(law)) * 1e-3 / damping if damping > 0.0 else math.inf
    words = f"1 ms of skew between force and position would change the damping by {by_skew:.1%}"
    if fit.laws is None or not fit.laws.own:
        return words
    if fit.laws.verdict.candidate.damping != "half-space":
        return words
    alike = "a half-space's damper and a force that is early are alike, and no check parts them"
    return f"{words}: {alike}"


def _by_delay(fit: Fit, shift: int) -> Floats:
    """dF̂/dτ at a shift of whole samples, N/s."""
    law, step = fit.solution.law, fit.data.sample_time
    later, earlier = _motion(fit, shift + 1), _motion(fit, shift - 1)
    force = [m.band.mean(law.force(np.maximum(m.x, 0.0), m.v)) for m in (later, earlier)]
    return (force[0] - force[1]) / (2.0 * step)


def _residual_delay(fit: Fit, at: Solution, shift: int) -> float:
    """What is left of the delay after whole samples, s."""
    column = _by_delay(fit, shift)
    size = np.linalg.norm(at.jacobian, axis=0)
    size[size == 0.0] = 1.0
    own = np.linalg.lstsq(at.jacobian / size, column, rcond=None)[0]
    left = column - (at.jacobian / size) @ own
    step = fit.data.sample_time
    return float(np.clip(left @ at.residual / max(float(left @ left), 1e-300), -step, step))


def _motion(fit: Fit, shift: int, every: int = 1) -> Motion:
    """The motion that a force later by some samples answers to."""
    band = fit.band if every == 1 else fit.band.rows(np.arange(len(fit.band)) % every == 0)
    place = _within_segment(fit, shift)
    x = fit.penetration[place] / fit.units.depth
    return Motion(x, fit.data.velocity[place] / fit.units.speed, band, fit.force[::every])


def _within_segment(fit: Fit, shift: int) -> NDArray[np.intp]:
    """The samples that were some earlier, none across the border of a segment."""
    segment = fit.data.segment
    own = segment[fit.band.samples]
    first, last = np.searchsorted(segment, own), np.searchsorted(segment, own, "right") - 1
    place: NDArray[np.intp] = np.clip(fit.band.samples - shift, first, last)
    return place


def _best_shift(fit: Fit, reach: int) -> tuple[Solution, int]:
    """The whole shift that fits best: a coarse scan, then single samples around its best."""
    every = max(-(-len(fit.band) // MOST_ROWS), 1)
    energies: dict[int, float] = {}

    def energy(shift: int) -> float:
        if shift not in energies:
            law, offset = fit.solution.law, fit.solution.offset
            moved = _motion(fit, shift, every)
            energies[shift] = fit.solve(law, offset, moved, enough=ROUGHLY).energy
        return energies[shift]

    coarse = max(reach // 6, 1)
    best = min({0, -reach, reach, *range(-reach, reach + 1, coarse)}, key=energy)
    while coarse > 1:
        coarse = max(coarse // 2, 1)
        near = (best - coarse, best, best + coarse)
        best = min((s for s in near if abs(s) <= reach), key=energy)
    law, offset = fit.solution.law, fit.solution.offset
    return fit.solve(law, offset, _motion(fit, best)), best
