"""Adhesion: a material that pulls the probe back, which looks like relaxation."""

import math

import numpy as np

from palpate.diagnosis.delay import cause_of, memory
from palpate.diagnosis.fit import FEWEST_FREE, Fit, MisfitHypothesis, augmented_fit, deeper_half
from palpate.diagnosis.marks import SURE
from palpate.digits import format_quantity
from palpate.estimators.least_squares import mean_error

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
        slope = min(float(np.polyfit(x[comes], force[comes], 1)[0]), 0.0)
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
