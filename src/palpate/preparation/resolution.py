"""How well a recording can tell where things are."""

import math

import numpy as np

from palpate import _core
from palpate.contact import Contact
from palpate.validation import Floats


def suggest_surface_deviation(contact: Contact) -> float | None:
    """How well the surface is known, m: twice the noise of the penetration, its rounding included.

    None where the penetration has neither.
    """
    [found] = resolutions_of(contact.penetration[None]).tolist()
    return None if math.isnan(found) else found


def resolutions_of(penetration: Floats, *, threads: int = 1) -> Floats:
    """Twice the noise of each row, its rounding included, m; NaN where it has neither.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m.
    threads : int
        That share the rows.
    """
    found = np.empty(len(penetration))
    _core.resolutions(penetration, found, threads)
    return found
