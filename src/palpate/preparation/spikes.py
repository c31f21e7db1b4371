"""Single samples of a channel that leave their neighbours."""

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.validation import Floats


def spiked(values: Floats) -> NDArray[np.bool_]:
    """Say of each sample whether it is a spike.

    Beyond max(8 σ, 2 %, 1.5 steps) of the median of five, and three times farther from it than its
    four neighbours lie from each other.
    """
    found: NDArray[np.bool_] = spikes_of_rows(values[None])[0]
    return found


def spikes_of_rows(
    values: Floats, *, screened: bool = False, threads: int = 1
) -> NDArray[np.bool_]:
    """Say which samples of each row are spikes, among those that are finite.

    Parameters
    ----------
    values : numpy.ndarray, shape (k, m)
        A channel, a row a recording.
    screened : bool
        Whether it is enough to look at rows in which a sample leaves its two neighbours as spikes
        do from white noise.
    threads : int
        That share the rows.
    """
    found = np.zeros(values.shape, dtype=np.uint8)
    _core.mark_spikes(values, screened, found, threads)
    return found.view(np.bool_)


def largest_of(values: Floats) -> float:
    """99.9th percentile of the values' size, so that a spike sets nothing."""
    return _core.largest_of(values)


def step_of(values: Floats) -> float:
    """Median gap between the distinct values of a channel; 0 of a constant one."""
    return _core.step_of(values)
