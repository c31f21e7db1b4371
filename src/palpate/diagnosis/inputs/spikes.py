"""Spikes: single samples that leave their neighbours."""

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.data import Data, step_of
from palpate.diagnosis.finding import Finding, Mark, severity_of
from palpate.preparation.suggestions import noise_of
from palpate.validation import Floats

BEYOND = 8.0  # σ
LEAST = 0.02  # of the channel's largest value
STEPS = 1.5  # of the channel; a value that rounds up and down is no spike
# Times the range of its four neighbours. The top of a sine at 66 Hz is 2 % above them, and a lever
# that shakes for a tenth of a second is no noise of all the recording: neither is a spike.
ALONE = 3.0
SOME, MANY = 1e-3, 2e-2  # of the samples
# Of the rms of the velocity: below it the probe turns, and friction jumps from side to side within
# a sample (on the robot at up to 0.26). Spikes come at any speed, so they are counted above it.
SLOW = 1.0 / 3.0
FEWEST_FAST = 0.2  # of the samples; with fewer all are counted


def spikes(data: Data) -> Finding | None:
    """More than 0.1 % of the samples beyond max(8 σ, 2 %, 1.5 steps) of the median of five.

    And three times farther from it than its four neighbours lie from each other. Of the force only
    where the probe moves.
    """
    force = _spiked(data.force, data.peak_force)
    penetration = _spiked(data.penetration, data.peak_penetration)
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


def _spiked(values: Floats, largest: float) -> NDArray[np.bool_]:
    """Say of each sample whether it is a spike."""
    spiked = np.zeros(values.size, dtype=bool)
    limit = max(BEYOND * noise_of(values), LEAST * abs(largest), STEPS * step_of(values))
    windows = np.lib.stride_tricks.sliding_window_view(values, 5)
    # Of the many samples that hardly leave their neighbours' mean none is a spike.
    far = np.flatnonzero(np.abs(values[2:-2] - 0.5 * (values[1:-3] + values[3:-1])) > 0.5 * limit)
    near = windows[far]
    away = np.abs(near[:, 2] - np.median(near, axis=1))
    apart = np.ptp(near[:, [0, 1, 3, 4]], axis=1)
    spiked[far[(away > limit) & (away > ALONE * apart)] + 2] = True
    return spiked
