"""Sessions at the laboratory's rig, and the estimators as the paper sets them."""

import pickle
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.lab import MATERIALS, TRAJECTORIES, Bench, Measurement
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats
from palpate.writing import write_bytes

#: When the command leaves its pause, s; the paper's clock, in which contact is made at 2 s.
START = 2.0
#: Force of ten times its noise, which keeps the bias of the logarithm under 0.5 %.
GATE = ContactGate(minimum_penetration=0.1e-3, make_force=0.5)
#: The paper computes in SI.
SI = Scale()


# Sessions longer than this are not worth the room on disk, s.
LONGEST_SHARED = 60.0
_shared: Path | None = None


def share_sessions(folder: Path) -> None:
    """Keep sessions in a folder too, for all processes of one run to find."""
    global _shared
    _shared = folder


@lru_cache(maxsize=32)
def session(material: str, trajectory: str, seed: int, seconds: float = 12.0) -> Measurement:
    """Press a material of the lab with the twin pantograph; kept, for experiments share it."""
    bench = Bench(MATERIALS[material], TRAJECTORIES[trajectory])
    if _shared is None or seconds > LONGEST_SHARED:
        return bench.run(seed, seconds=seconds)
    path = _shared / f"{material}-{trajectory}-{seed}-{seconds:g}.pickle"
    if path.is_file():
        found: Measurement = pickle.loads(path.read_bytes())
        return found
    measurement = bench.run(seed, seconds=seconds)
    write_bytes(path, pickle.dumps(measurement))
    return measurement


def pressed(material: str, trajectory: str, seed: int, seconds: float = 12.0) -> Contact:
    """Return the part of a session after the pause, as recorded."""
    return session(material, trajectory, seed, seconds).contact.window(START)


def thinned(time: Floats) -> NDArray[np.intp]:
    """Which samples to draw: one in 5 in the first half second, then one in 20."""
    early = time < time[0] + 0.5
    position = np.arange(time.size)
    return np.flatnonzero(np.where(early, position % 5 == 0, position % 20 == 0))
