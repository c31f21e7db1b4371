"""Noise of the velocity, which makes a damping look smaller than it is."""

import numpy as np

from palpate.diagnosis.finding import Finding
from palpate.diagnosis.fit import Fit

CARE, STOP = 0.05, 0.50  # of the damping, as for every cause


def velocity_noise(fit: Fit) -> Finding | None:
    """Errors in a regressor attenuate its coefficient: C is too small by σ_v²/⟨v²⟩.

    The noise σ_v is the column's own, from its fourth differences, or what the filter leaves of the
    penetration's, its steps included.
    """
    speed = float(np.mean(fit.data.velocity[fit.inside] ** 2))
    part = fit.data.velocity_noise**2 / speed if speed > 0.0 else 0.0
    if not part > CARE:
        return None
    derived = fit.data.differentiated
    whose = "the velocity, worked out of the penetration," if derived else "the velocity column"
    return Finding(
        "velocity noise",
        f"{whose} is noisy: the damping is some {min(part, 1.0):.0%} too small",
        "--velocity-window 0.03, or move faster"
        if derived
        else "--velocity-window on a file without that column, or a filtered velocity",
        damping="do-not-trust" if part > STOP else "with-care",
        moves_stiffness_percent=0.0,
        moves_damping_percent=100.0 * min(part, 1.0),
    )
