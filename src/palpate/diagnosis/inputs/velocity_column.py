"""A recorded velocity against the penetration's own rate."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.diagnosis.inputs.stop import stop
from palpate.digits import rounded
from palpate.validation import Floats

REMEDY = "leave it out: --velocity none"
MEAN = 15  # samples of a stretch, over which noise averages out
STOP = (0.8, 1.25)  # slopes; recorded columns have 1.01 to 1.08
CARE = 0.05  # of the damping, as for every cause
ALIKE = 0.9  # correlation, above which a slope means something
AGAINST = -0.5


def velocity_column(data: Data) -> Finding | None:
    """Slope of ∫v dt on Δx, over stretches of 15 samples, where the two are alike.

    Beyond 0.8 … 1.25, or where they run against each other, it is another channel; within, the
    damping B = ∂F/∂v is wrong by the slope.
    """
    if data.differentiated or len(data) < 4 * MEAN:
        return None
    way, integral = _stretches(data)
    if way.size < 4 or np.ptp(way) == 0.0 or np.ptp(integral) == 0.0:
        return None
    alike = float(np.corrcoef(way, integral)[0, 1])
    if alike < AGAINST:
        words = "the velocity column runs against the rate of the penetration"
        return stop("velocity column", f"{words}: another unit, sign or channel", REMEDY)
    if alike <= ALIKE:
        return None
    # Noise in one of the two lowers the first and raises the second: the one nearer to 1 is sure.
    slopes = float(way @ integral / (way @ way)), float(integral @ integral / (way @ integral))
    slope = min(slopes, key=lambda each: abs(each - 1.0))
    words = f"the velocity column is {rounded(slope, 3)} times the rate of the penetration"
    if not STOP[0] <= slope <= STOP[1]:
        return stop("velocity column", f"{words}: another unit, sign or channel", REMEDY)
    if abs(slope - 1.0) <= CARE:
        return None
    wrong = f"{abs(slope - 1.0):.0%} too {'small' if slope > 1.0 else 'large'}"
    return Finding(
        "velocity column",
        f"{words}: the damping is {wrong}, if the penetration is right",
        REMEDY,
        damping="with-care",
        moves_stiffness_percent=0.0,
        moves_damping_percent=100.0 * (slope - 1.0),
    )


def _stretches(data: Data) -> tuple[Floats, Floats]:
    """Way of each stretch by the penetration, and by the velocity's integral, m."""
    ends = np.arange(0, (len(data) // MEAN) * MEAN, MEAN)
    last = ends + MEAN - 1
    whole = data.segment[ends] == data.segment[last]
    ends, last = ends[whole], last[whole]
    steps = 0.5 * (data.velocity[1:] + data.velocity[:-1]) * np.diff(data.time)
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    return data.penetration[last] - data.penetration[ends], gone[last] - gone[ends]
