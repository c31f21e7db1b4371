"""Sessions at the laboratory's rig, and the estimators as the paper sets them."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.lab import MATERIALS, TRAJECTORIES, Bench, Measurement
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats

#: When the command leaves its pause, s; the paper's clock, in which contact is made at 2 s.
START = 2.0
#: Force of ten times its noise, which keeps the bias of the logarithm under 0.5 %.
GATE = ContactGate(minimum_penetration=0.1e-3, make_force=0.5)
#: The paper computes in SI.
SI = Scale()


@lru_cache(maxsize=8)
def session(material: str, trajectory: str, seed: int, seconds: float = 12.0) -> Measurement:
    """Press a material of the lab with the twin pantograph; kept, for experiments share it."""
    return Bench(MATERIALS[material], TRAJECTORIES[trajectory]).run(seed, seconds=seconds)


def pressed(material: str, trajectory: str, seed: int, seconds: float = 12.0) -> Contact:
    """Return the part of a session after the pause, as recorded."""
    return session(material, trajectory, seed, seconds).contact.window(START)


def thinned(time: Floats) -> NDArray[np.intp]:
    """Which samples to draw: one in 5 in the first half second, then one in 20."""
    early = time < time[0] + 0.5
    position = np.arange(time.size)
    return np.flatnonzero(np.where(early, position % 5 == 0, position % 20 == 0))
