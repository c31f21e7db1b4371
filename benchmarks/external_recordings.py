"""Recordings of others with their notes, which are not part of this project."""

import csv
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import Limit, Row
from palpate import Contact, GeneralisedHuntCrossley, identify, prepare
from palpate.preparation.velocity import velocity_of
from palpate.validation import Floats

LEAD = 2.0  # s before the window of the notes, because a material may have memory
# A pause between segments, s, that resets the branches.
PAUSE = 0.5
TURN = 2.0 * np.pi


def folder_of_recordings() -> Path | None:
    """Return the folder of the recordings, or None."""
    given = os.environ.get("PALPATE_DATA")
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(given) if given else beside
    return folder if any(folder.glob("*.json")) else None


@dataclass(frozen=True)
class Recorded:
    """A recording, used as its notes specify."""

    steps: Floats  # s; 0 at the first sample
    penetration: Floats
    velocity: Floats
    force: Floats
    good: NDArray[np.bool_]  # within the window of the notes

    @property
    def sample_time(self) -> float:
        """The median time step, s."""
        return float(np.median(self.steps[self.steps > 0.0]))

    @property
    def breaks(self) -> NDArray[np.bool_]:
        """Return the samples that do not directly follow the one before."""
        long = max(20.0 * self.sample_time, PAUSE)
        return np.asarray((self.steps <= 0.0) | (self.steps > long))


def read(path: Path) -> Recorded:
    """Read a recording and its notes."""
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
    return Recorded(np.diff(time, prepend=time[:1]), x, v, force, good)


def differentiated(contact: Contact, windows: float | dict[str, float]) -> Floats:
    """Return the velocity by the windows of the notes, s: one, or one for each segment."""
    if not isinstance(windows, dict):
        windows = {"default": windows}
    velocity = np.empty(len(contact))
    for part in contact.segments():
        window = windows.get(str(int(contact.segment[part.start])), windows["default"])
        velocity[part] = velocity_of(contact.time[part], contact.penetration[part], window)
    return velocity


def fourier_rows(folder: Path, law: str) -> Iterator[Row]:
    """Compare K′ of microrheology by a law with its Fourier analysis in the notes."""
    for path in sorted(folder.glob("F_microrheo_*.csv")):
        notes = json.loads(path.with_suffix(".json").read_text())
        known = {row["freq_hz"]: row["K_N_per_m"] for row in notes["dynamic_stiffness"]}
        result = identify(path, law=law, trace=False)
        printed, general = result.dynamic_stiffness(), GeneralisedHuntCrossley.of(result.law)
        for hertz in (printed.frequency / TURN, 1.0, 3.0, 10.0, 30.0, 100.0):
            reference = np.interp(
                np.log(hertz), np.log(sorted(known)), [known[f] for f in sorted(known)]
            )
            ratio = general.dynamic_stiffness(printed.depth, TURN * hertz).real / reference
            where = f"{hertz:g} Hz" if hertz in known else f"the printed {hertz:.2g} Hz"
            limit = Limit(20.0) if hertz <= 10.0 else None
            off = 100.0 * abs(ratio - 1.0)
            yield Row(
                f"{path.stem}: K′ off at {where}", off, "%", reference=f"{ratio:.2f} ×", limit=limit
            )
