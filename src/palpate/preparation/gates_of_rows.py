"""Gates and scales of many contacts of one length at once: those of ``suggestions.py``, to the bit.

A percentile of one contact costs what those of thirty do together.
"""

import numpy as np
from numpy.typing import NDArray

from palpate.preparation.suggestions import (
    LARGEST,
    MOST_UNDECIDED,
    NOISE_FACTOR,
    decisive_depth,
    noise_of,
)
from palpate.settings import ContactGate
from palpate.validation import Floats

Counts = NDArray[np.int64]


def percentile_of_rows(values: Floats, counts: Counts, part: float) -> Floats:
    """A percentile of the least so many of each row, as NumPy's; NaN of none.

    Parameters
    ----------
    values : numpy.ndarray, shape (k, m)
        What does not count is infinite or NaN.
    counts : numpy.ndarray of int64, shape (k,)
        How many of a row count.
    part : float
        In [0, 1].
    """
    last = np.maximum(counts - 1, 0)
    place = last * part
    low = np.floor(place).astype(np.int64)
    left, right = _in_order(values, low, np.minimum(low + 1, last))
    beyond = place - low
    with np.errstate(invalid="ignore"):
        step = right - left
        found = np.where(beyond >= 0.5, right - step * (1.0 - beyond), left + step * beyond)
    return np.where(counts > 0, found, np.nan)


def gates_and_scales(penetration: Floats, velocity: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Suggest a gate and a scale for each row.

    Parameters
    ----------
    penetration, velocity, force : numpy.ndarray, shape (k, m)
        m, m/s and N, all below 1e100 in size; a row ends in NaN where it has fewer samples, of
        which it has five at least.

    Returns
    -------
    tuple of numpy.ndarray, shape (k, 3)
        Of the gates ``minimum_penetration``, ``make_force`` and ``break_force``; the units of the
        scales.
    """
    touching = (penetration > 0.0) & (force > 0.0) & (np.abs(velocity) < LARGEST)
    gates = gates_of_rows(penetration, force, touching)
    return gates, _scales(penetration, velocity, force, touching)


def gates_of_rows(penetration: Floats, force: Floats, touching: NDArray[np.bool_]) -> Floats:
    """Suggest a gate for each row, of the samples that touch.

    Parameters
    ----------
    penetration, force : numpy.ndarray, shape (k, m)
        m and N; NaN is a sample that is not there.
    touching : numpy.ndarray of bool, shape (k, m)
        Which of them are in contact.

    Returns
    -------
    numpy.ndarray, shape (k, 3)
        ``minimum_penetration`` [m], ``make_force`` and ``break_force`` [N].
    """
    counts = touching.sum(axis=1)
    noise = _noises(force)
    make = _thresholds(force, noise, touching, counts)
    least = _thresholds(penetration, _noises(penetration), touching, counts)
    gates = np.stack([least, make, 0.8 * make], axis=1)
    with np.errstate(invalid="ignore"):  # of samples that are not there
        undecided = np.abs(force - make[:, None]) < 3.0 * noise[:, None]
        inside = touching & (penetration > least[:, None])
    doubtful = (inside & undecided).sum(axis=1) > MOST_UNDECIDED * inside.sum(axis=1)
    for k in np.flatnonzero(doubtful & (counts > 0)).tolist():
        depth = decisive_depth(penetration[k], force[k], touching[k], make[k], least[k])
        if depth is not None:
            gates[k, 0], gates[k, 2] = depth, 0.0
    gates[counts == 0] = ContactGate()._plain()
    return gates


def _scales(
    penetration: Floats, velocity: Floats, force: Floats, touching: NDArray[np.bool_]
) -> Floats:
    units = []
    for values in (penetration, np.abs(velocity), force):
        largest = np.max(values, axis=1, initial=0.0, where=touching)
        units.append(np.where(largest > 0.0, np.clip(largest, 1e-30, 1e30), 1.0))
    return np.stack(units, axis=1)


def _thresholds(
    values: Floats, noise: Floats, touching: NDArray[np.bool_], counts: Counts
) -> Floats:
    largest = percentile_of_rows(np.where(touching, values, np.inf), counts, 0.99)
    return np.clip(NOISE_FACTOR * noise, 0.01 * largest, 0.10 * largest)


def _noises(values: Floats) -> Floats:
    """As ``noise_of`` each row."""
    if values.shape[1] < 5:
        return np.zeros(len(values))
    differences = np.abs(np.diff(values, n=4, axis=1))
    counts = np.count_nonzero(~np.isnan(differences), axis=1)
    middle = np.maximum(counts - 1, 0) // 2, np.minimum(counts // 2, differences.shape[1] - 1)
    left, right = _in_order(differences, *middle)
    found = np.where(counts > 0, 0.5 * (left + right) / 0.6745 / np.sqrt(70.0), 0.0)
    missing = np.isnan(values)
    for k in np.flatnonzero((missing[:, :-1] & ~missing[:, 1:]).any(axis=1)).tolist():
        found[k] = noise_of(values[k])  # with a hole, over which it goes on
    return found


def _in_order(values: Floats, first: Counts, second: Counts) -> tuple[Floats, Floats]:
    """Two numbers of each row as they stand once it is sorted, NaN last."""
    places = np.unique(np.concatenate([first, second]))
    # Two places are found in half the time of a sort; more than some are not.
    few = places.size <= 4
    order = np.partition(values, places, axis=1) if few else np.sort(values, axis=1)
    rows = np.arange(len(values))
    return order[rows, first], order[rows, second]
