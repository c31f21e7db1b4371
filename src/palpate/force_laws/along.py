"""Forces along samples that break off and go on."""

import numpy as np

from palpate.force_laws.laws import ForceLaw
from palpate.validation import Floats


def force_over_breaks(
    law: ForceLaw, penetration: Floats, velocity: Floats, steps: Floats, starts: list[int]
) -> Floats:
    """Force by a law at every sample, N, as an estimator has it.

    A material that is in contact before a break and after it was not left alone in between: what
    it remembers is carried over. Else it is at rest where samples begin.

    Parameters
    ----------
    law : ForceLaw
        With memory or without.
    penetration, velocity, steps : numpy.ndarray, shape (k,)
        m, m/s, and the time since the sample before, s, > 0.
    starts : list of int
        Places of the samples that do not follow upon the one before, the first among them.
    """
    fresh = [k for k in starts if k > 0 and not min(penetration[k - 1], penetration[k]) > 0.0]
    force = np.empty(len(penetration))
    for part in np.split(np.arange(len(penetration)), fresh):
        if part.size:
            own = slice(int(part[0]), int(part[-1]) + 1)
            force[own] = law.force_along(penetration[own], velocity[own], steps[own])
    return force
