"""Spikes: single samples that leave their neighbours."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding, Mark, severity_of
from palpate.preparation.spikes import spiked

SOME, MANY = 1e-3, 2e-2  # of the samples
# Of the rms of the velocity: below it the probe turns, and friction jumps from side to side within
# a sample (on the robot at up to 0.26). Spikes come at any speed, so they are counted above it.
SLOW = 1.0 / 3.0
FEWEST_FAST = 0.2  # of the samples; with fewer all are counted


def spikes(data: Data) -> Finding | None:
    """More than 0.1 % of the samples are spikes; of the force only where the probe moves."""
    force, penetration = spiked(data.force), spiked(data.penetration)
    speed = np.abs(data.velocity)
    fast = speed > SLOW * np.sqrt(np.mean(speed**2))
    if np.mean(fast) < FEWEST_FAST:
        fast = np.ones_like(fast)
    fractions = {"force": float(np.mean(force[fast])), "penetration": float(np.mean(penetration))}
    name = max(fractions, key=lambda channel: fractions[channel])
    part = fractions[name]
    if part <= SOME:
        return None
    mark: Mark = "do-not-trust" if part > MANY else "with-care"
    return Finding(
        "spikes",
        f"{part:.2%} of the samples of the {name} are spikes",
        "a median filter of five samples, or look after the cable",
        stiffness=mark,
        damping=mark,
        severity=severity_of(mark),
    )
