"""Gates and scales of many contacts of one length at once, and percentiles of their samples."""

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.validation import Floats


def percentile_of_rows(values: Floats, used: NDArray[np.bool_], part: float) -> Floats:
    """A percentile of those of each row that are used, as NumPy's; NaN of none.

    Parameters
    ----------
    values : numpy.ndarray, shape (k, m)
        None that is used is NaN.
    used : numpy.ndarray of bool, shape (k, m)
        Which of them count.
    part : float
        In [0, 1].
    """
    found = np.empty(len(values))
    _core.percentiles(values, used, part, found)
    return found


def gates_of_rows(penetration: Floats, velocity: Floats, force: Floats) -> Floats:
    """Suggest a gate for each row.

    Parameters
    ----------
    penetration, velocity, force : numpy.ndarray, shape (k, m)
        m, m/s and N; NaN, or from 1e100 in size, is a sample that is not there.

    Returns
    -------
    numpy.ndarray, shape (k, 3)
        ``minimum_penetration`` [m], ``make_force`` and ``break_force`` [N].
    """
    found = np.empty((len(penetration), 3))
    _core.gates(penetration, velocity, force, found)
    return found


def scales_of_rows(penetration: Floats, velocity: Floats, force: Floats) -> Floats:
    """Suggest units for the arithmetic of each row, shape (k, 3), from what a gate is made of."""
    found = np.empty((len(penetration), 3))
    _core.scales(penetration, velocity, force, found)
    return found
