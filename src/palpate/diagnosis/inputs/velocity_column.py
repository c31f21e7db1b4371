"""A recorded velocity against the penetration's own rate."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.diagnosis.inputs.stop import stop

MEAN = 15  # samples, over which noise of the rate is averaged
SLOPES = (0.8, 1.25)  # recorded columns have 0.96 to 1.07
ALIKE = 0.9  # correlation, above which a slope means something
AGAINST = -0.5


def velocity_column(data: Data) -> Finding | None:
    """Slope of v on dx/dt outside 0.8 … 1.25 where they are alike, or they run against another."""
    if data.differentiated or len(data) < 4 * MEAN:
        return None
    count = len(data) // MEAN
    ends = np.arange(0, count * MEAN, MEAN)
    whole = data.segment[ends] == data.segment[ends + MEAN - 1]
    ends = ends[whole]
    rate = (data.penetration[ends + MEAN - 1] - data.penetration[ends]) / (
        data.time[ends + MEAN - 1] - data.time[ends]
    )
    sums = np.concatenate([[0.0], np.cumsum(data.velocity)])
    velocity = (sums[ends + MEAN] - sums[ends]) / MEAN
    if rate.size < 4 or np.ptp(rate) == 0.0 or np.ptp(velocity) == 0.0:
        return None
    alike = float(np.corrcoef(rate, velocity)[0, 1])
    slope = float(rate @ velocity / (rate @ rate))
    if alike >= AGAINST and not (alike > ALIKE and not SLOPES[0] <= slope <= SLOPES[1]):
        return None
    words = f"the velocity column is {slope:.3g} times the rate of the penetration"
    if alike < AGAINST:
        words = "the velocity column runs against the rate of the penetration"
    return stop(
        "velocity column",
        f"{words}: another unit, sign or channel",
        "leave it out: name a --velocity that the file does not have",
    )
