"""The contact of all timings: the lab's rubber ball under the paper's three sines."""

import numpy as np
from numpy.typing import NDArray

from palpate import lab

Floats = NDArray[np.float64]
Samples = list[tuple[float, float, float]]

PERIOD = 5000  # samples
BLOCK = 65_536


def contact_arrays(samples: int) -> tuple[Floats, Floats, Floats]:
    """Return penetration, velocity and force at 1 kHz, always in contact; 0.05 N of noise.

    Filled block by block, so that this needs no further memory.
    """
    random = np.random.default_rng(1)
    x, v, force = np.empty(samples), np.empty(samples), np.empty(samples)
    for start in range(0, samples, BLOCK):
        part = slice(start, min(start + BLOCK, samples))
        t = 1e-3 * np.arange(part.start, part.stop)
        x[part], v[part] = lab.THREE_SINES.motion.at(t)
        clean = lab.BALL.law.force(x[part], v[part])
        force[part] = clean + 0.05 * random.standard_normal(t.size)
    return x, v, force


def contact_samples(samples: int) -> Samples:
    """Return the same as plain floats, sample by sample: 5 s of contact, repeated.

    So few that they stay in the cache, as the current sample of a control loop does.
    """
    columns = (array.tolist() for array in contact_arrays(min(samples, PERIOD)))
    period = list(zip(*columns, strict=True))
    return (period * -(-samples // len(period)))[:samples]
