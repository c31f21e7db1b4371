"""Units: millimetres for metres, millinewtons for newtons, milliseconds for seconds."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.diagnosis.inputs.stop import stop
from palpate.digits import rounded

DEEPEST, FASTEST = 0.25, 3.0  # m, m/s; of the recordings the largest are 19 mm and 0.84 m/s
# F/x², a modulus that no geometry changes much: recordings show 6e3 to 7e7 Pa.
SOFTEST, HARDEST = 2.0, 5e8  # never by depth**2, which overflows
FIRMEST = 5e3  # N; TPU under a testing machine is pressed with 2.6 kN
SLOWEST = 0.2  # s between samples


def penetration_unit(data: Data) -> Finding | None:
    """Largest x > 0.25 m, rms v > 3 m/s, or F/x² < 2 Pa."""
    depth, force = data.peak_penetration, data.peak_force
    if depth <= 0.0:
        return None
    touched = data.penetration > 0.0
    speed = float(np.sqrt(np.mean(data.velocity[touched] ** 2))) if touched.any() else 0.0
    if depth <= DEEPEST and speed <= FASTEST and force / depth >= SOFTEST * depth:
        return None
    return stop(
        "penetration unit",
        f"the penetration reaches {rounded(depth, 3)} m at {rounded(force, 3)} N: millimetres, "
        "or columns swapped?",
        "--unit penetration=mm",
    )


def force_unit(data: Data) -> Finding | None:
    """F > 5 kN or F/x² > 5e8 Pa; it sees 87 % of the cases, so the peak force is always printed."""
    depth, force = data.peak_penetration, data.peak_force
    if depth <= 0.0 or (force <= FIRMEST and force / depth <= HARDEST * depth):
        return None
    return stop(
        "force unit",
        f"the force reaches {rounded(force, 3)} N at {rounded(1e3 * depth, 3)} mm: are these "
        "millinewtons?",
        "--unit force=mN",
    )


def time_unit(data: Data) -> Finding | None:
    """Median step > 0.2 s."""
    if data.sample_time <= SLOWEST:
        return None
    return stop(
        "time unit",
        f"there is a sample every {rounded(data.sample_time, 3)} s: are the times milliseconds?",
        "--unit time=ms",
    )
