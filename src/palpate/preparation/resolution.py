"""How finely a recording resolves force and penetration: noise, dead band, steps."""

import math

import numpy as np

import palpate._core as _core
from palpate._core import noise_of as noise_of
from palpate.contact import Contact
from palpate.validation import Floats

FEWEST_RESTING, FEWEST_PRESSED = 20, 3  # samples at the value of the dead band; of these in contact
ABOVE_NOISE = 4.0  # σ or steps, from that value to the next


def find_dead_band(contact: Contact) -> float:
    """Return the least force above a dead band, N; 0 without one.

    In a dead band the most common force is the least, and no sample lies within four σ and steps
    above it. The probe is in contact there, but no deeper than at twice that force: otherwise the
    sensor failed.
    """
    known = np.isfinite(contact.force) & np.isfinite(contact.penetration)
    force, depth = contact.force[known], contact.penetration[known]
    if np.count_nonzero(force[1:] == force[:-1]) < FEWEST_RESTING:
        return 0.0
    values, counts = np.unique(force, return_counts=True)
    most = int(np.argmax(counts))
    if counts[most] < FEWEST_RESTING or most + 1 == values.size:
        return 0.0
    least = float(values[most + 1])
    band = least - float(values[most])
    if band <= ABOVE_NOISE * max(noise_of(force), _core.step_of(force)):
        return 0.0
    shown = np.flatnonzero(force >= least)
    near = shown[force[shown] <= least + band]
    if near.size < FEWEST_PRESSED:
        near = shown[np.argsort(force[shown])[:FEWEST_PRESSED]]
    pressed = depth[(force == values[most]) & (depth > 0.0)]
    dead = pressed.size >= FEWEST_PRESSED and pressed.max() <= depth[near].max()
    return least if dead else 0.0


def suggest_surface_deviation(contact: Contact) -> float | None:
    """Return the uncertainty of the surface, m: twice the noise and rounding of the penetration.

    None if the penetration has neither.
    """
    [found] = estimate_resolutions(contact.penetration[None]).tolist()
    return None if math.isnan(found) else found


def estimate_resolutions(penetration: Floats, *, threads: int = 1) -> Floats:
    """Return twice the noise and rounding of each row, m; NaN if it has neither.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m.
    threads : int
        Number of threads.
    """
    found = np.empty(len(penetration))
    _core.resolutions(penetration, found, threads)
    return found
