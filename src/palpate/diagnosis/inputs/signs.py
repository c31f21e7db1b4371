"""Signs: force positive in compression, penetration positive into the material."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.diagnosis.inputs.stop import stop
from palpate.digits import rounded
from palpate.validation import Floats

MOST = 5000  # samples whose ranks are taken
AGAINST = -0.3  # rank correlation; recordings with the right signs have 0.4 and more


def signs(data: Data) -> Finding | None:
    """Rank correlation of x and F below −0.3, and less force at the deepest 5 % than at the least.

    Looked at before any gate, which would throw away what tells it.
    """
    every = -(-len(data) // MOST)
    x, force = data.penetration[::every], data.force[::every]
    if np.ptp(x) == 0.0 or np.ptp(force) == 0.0:
        return None
    if np.corrcoef(_ranks(x), _ranks(force))[0, 1] >= AGAINST:
        return None
    low, high = np.percentile(x, [5.0, 95.0])
    deep, shallow = float(force[x >= high].mean()), float(force[x <= low].mean())
    if deep >= shallow:
        return None
    if deep < 0.0 and abs(deep) > abs(shallow):
        words = f"the force is negative, {rounded(deep, 3)} N, where the penetration is largest"
        return stop("signs", f"{words}: compression must be positive", "--flip-force")
    words = (
        f"the force falls from {rounded(shallow, 3)} N to {rounded(deep, 3)} N as the penetration "
        "grows"
    )
    return stop("signs", f"{words}: is it positive into the material?", "--flip-penetration")


def _ranks(values: Floats) -> Floats:
    ranks = np.empty(len(values))
    ranks[np.argsort(values, kind="stable")] = np.arange(len(values))
    return ranks
