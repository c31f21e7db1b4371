"""Recordings of others with their notes, which are not part of this project."""

import csv
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from palpate import Contact, prepare
from palpate.input.preparation.velocity import velocity_of
from palpate.validation import Floats

LEAD = 2.0  # s before the window of the notes, because a material may have memory
PAUSE = 0.5  # s, the longest within a segment, or 20 samples
EXPONENTS = (0.3, 3.6)  # the default range of VariableProjection
STARTS = (0.5, 1.2, 2.0, 3.0)


def recorded(pattern: str = "*.csv") -> list[Path]:
    """Return the recordings of PALPATE_DATA or next to the checkout, if any."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    return sorted(Path(os.environ.get("PALPATE_DATA") or beside).glob(pattern))


def with_notes() -> list[Path]:
    """Return those that have notes; end the program where there are none."""
    found = [file for file in recorded() if file.with_suffix(".json").exists()]
    if not found:
        sys.exit("no recordings in PALPATE_DATA or ../shared/data")
    return found


def read(path: Path) -> tuple[Contact, NDArray[np.intp]]:
    """Return the part of a recording that its notes name, and its contact samples by the notes."""
    notes = json.loads(path.with_suffix(".json").read_text())
    fit = notes["fit"]
    contact = prepare(path)
    velocity = contact.velocity
    if "sg_window_s" in notes:  # if the recording has no velocity
        velocity = differentiated(contact, notes["sg_window_s"])
    channels = contact.time, contact.penetration, velocity, contact.force
    known = np.all(np.isfinite(channels), axis=0)
    masked = np.ones(len(contact), dtype=bool)
    if fit.get("mask"):
        with path.open() as lines:
            masked = np.array([float(row[fit["mask"]]) > 0.0 for row in csv.DictReader(lines)])
    start, stop = fit.get("time", (-np.inf, np.inf))
    known &= (contact.time >= start - LEAD) & (contact.time <= stop)
    time, x, v, force = (channel[known] for channel in channels)
    good = (x > fit["x_min"]) & (force > fit["F_min"]) & (time >= start) & masked[known]
    steps = np.diff(time, prepend=time[:1])
    usual = float(np.median(steps[steps > 0.0]))
    segment = np.cumsum((steps <= 0.0) | (steps > max(20.0 * usual, PAUSE)))
    time = np.cumsum(np.where(steps > 0.0, steps, usual))
    part = Contact(time, penetration=x, velocity=v, force=force, segment=segment)
    return part, np.flatnonzero(good)


def differentiated(contact: Contact, windows: float | dict[str, float]) -> Floats:
    """Return the velocity by the windows of the notes, s: one, or one for each segment."""
    if not isinstance(windows, dict):
        windows = {"default": windows}
    velocity = np.empty(len(contact))
    for part in contact.segments():
        window = windows.get(str(int(contact.segment[part.start])), windows["default"])
        velocity[part] = velocity_of(contact.time[part], contact.penetration[part], window)
    return velocity


@dataclass(frozen=True)
class LeastSquares:
    """Hunt and Crossley's law and an offset, in units of the largest samples."""

    numbers: Floats
    units: tuple[float, float, float]

    def force(self, x: Floats, v: Floats) -> Floats:
        """Force, N."""
        k, c, n, offset = self.numbers
        deepest, fastest, strongest = self.units
        return np.asarray(strongest * ((x / deepest) ** n * (k + c * v / fastest) + offset))


def least_squares_law(x: Floats, v: Floats, force: Floats) -> LeastSquares:
    """Return the plain least squares of these samples by SciPy, the best of several starts."""
    units = float(x.max()), float(np.abs(v).max()), float(np.abs(force).max())

    def residuals(numbers: Floats) -> Floats:
        return (LeastSquares(numbers, units).force(x, v) - force) / units[2]

    (low, high), wide = EXPONENTS, np.inf
    bounds = ([-wide, -wide, low, -wide], [wide, wide, high, wide])
    fits = [
        least_squares(residuals, [1.0, 0.1, n, 0.0], bounds=bounds, xtol=1e-12, ftol=1e-12)
        for n in STARTS
    ]
    return LeastSquares(min(fits, key=lambda fit: float(fit.cost)).x, units)
