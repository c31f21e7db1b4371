"""Steps of the force that are coarse against the force itself."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding

LARGEST = 0.04  # of the largest force
# Of the samples that repeat the one before; noise dithers the lab's steps of 1/8 N: 55 % repeat.
REPEATED = 0.85


def coarse(data: Data) -> Finding | None:
    """A step above 4 % of the force, and more than 85 % of the samples repeat."""
    part = data.force_step / data.peak_force if data.peak_force > 0.0 else 0.0
    repeated = float(np.mean(np.diff(data.force) == 0.0))
    if part <= LARGEST or repeated <= REPEATED:
        return None
    return Finding(
        "coarse steps",
        f"the force comes in steps of {data.force_step:.2g} N, {part:.1%} of its largest",
        "a finer range of the sensor, or press harder",
        stiffness="with-care",
        damping="with-care",
    )
