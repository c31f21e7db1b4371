"""A position loop that follows a command, by SciPy: written apart from palpate."""

import numpy as np
from scipy.signal import StateSpace, lsim

from palpate.validation import Floats

_FINE = 32  # steps of the simulation in a sample time: every delay is a multiple of a step


def commanded(seconds: float, step: float) -> Floats:
    """Return quick moves of 10 mm in 0.15 s, back and forth every half second, m."""
    time = np.arange(0.0, seconds, step)
    move = np.floor(time / 0.5)
    part = np.clip((time - 0.5 * move) / 0.15, 0.0, 1.0)
    blend = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    return 1e-2 * np.where(move % 2 == 0, blend, 1.0 - blend)


def followed(command: Floats, step: float, bandwidth: float, delay: float) -> Floats:
    """Return the position at the samples of a command that is held and acts after a delay."""
    fine = np.arange(len(command) * _FINE) * step / _FINE
    sample = np.floor((fine - delay) / step + 1e-9).astype(int)
    acting = np.where(sample >= 0, command[np.clip(sample, 0, None)], command[0])
    rate = [[0.0, 1.0], [-(bandwidth**2), -2.0 * bandwidth]]
    system = StateSpace(rate, [[0.0], [bandwidth**2]], [[1.0, 0.0]], [[0.0]])
    _, position, _ = lsim(system, acting, fine, interp=False)
    sampled: Floats = position[::_FINE]
    return sampled
