"""Single samples of a channel that leave their neighbours."""

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.preparation.suggestions import noise_of
from palpate.validation import Floats

BEYOND = 8.0  # σ
LEAST = 0.02  # of the channel's largest value
STEPS = 1.5  # of the channel; a value that rounds up and down is no spike
# Times the range of its four neighbours. The top of a sine at 66 Hz is 2 % above them, and a lever
# that shakes for a tenth of a second is no noise of all the recording: neither is a spike.
ALONE = 3.0


def spiked(values: Floats) -> NDArray[np.bool_]:
    """Say of each sample whether it is a spike.

    Beyond max(8 σ, 2 %, 1.5 steps) of the median of five, and three times farther from it than its
    four neighbours lie from each other.
    """
    spikes = np.zeros(values.size, dtype=bool)
    if values.size < 5:
        return spikes
    limit = max(BEYOND * noise_of(values), LEAST * largest_of(values), STEPS * step_of(values))
    windows = np.lib.stride_tricks.sliding_window_view(values, 5)
    # Of the many samples that hardly leave their neighbours' mean none is a spike.
    far = np.flatnonzero(np.abs(values[2:-2] - 0.5 * (values[1:-3] + values[3:-1])) > 0.5 * limit)
    near = windows[far]
    away = np.abs(near[:, 2] - np.median(near, axis=1))
    apart = np.ptp(near[:, [0, 1, 3, 4]], axis=1)
    spikes[far[(away > limit) & (away > ALONE * apart)] + 2] = True
    return spikes


def largest_of(values: Floats) -> float:
    """99.9th percentile of the values' size, so that a spike sets nothing."""
    return float(np.percentile(np.abs(values), 99.9)) if values.size else 0.0


def step_of(values: Floats) -> float:
    """Median gap between the distinct values of a channel; 0 of a constant one."""
    return _core.step_of(values)
