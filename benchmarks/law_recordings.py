"""Others' recordings, each with a part held out from the selection of a law."""

import csv
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate import Contact, ContactGate, Scale, ViscoelasticContact, identify, prepare
from palpate.preparation.velocity import velocity_of
from palpate.validation import Floats

BLOCKS = 10
FEWEST = 60  # samples of contact
LEAD = 2.0  # s before the window of the notes, because a material may have memory
# A pause between segments, s, that resets the branches.
PAUSE = 0.5


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
    def scale(self) -> Scale:
        """Units near the largest values."""
        parts = self.penetration, np.abs(self.velocity), self.force
        return Scale(*(float(np.percentile(part[self.good], 99.0)) for part in parts))

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


def learned(record: Recorded, train: NDArray[np.bool_], **settings: str) -> ViscoelasticContact:
    """Return an estimator fitted to some of the samples; its branches follow all of them."""
    estimator = ViscoelasticContact(
        gate=ContactGate(),
        sample_time=record.sample_time,
        scale=record.scale,
        **settings,  # type: ignore[arg-type]
    )
    # The force marks samples that must not be learned as out of contact.
    outside = (record.penetration > 0.0) & ~train
    force = np.where(outside, -float(np.max(record.force)), record.force)
    steps = np.where(record.steps > 0.0, record.steps, record.sample_time)
    rows = zip(
        record.breaks.tolist(),
        record.penetration.tolist(),
        record.velocity.tolist(),
        force.tolist(),
        steps.tolist(),
        strict=True,
    )
    for broken, x, v, push, step in rows:
        if broken:
            estimator.leave_contact()
        estimator.update(x, v, push, step)
    estimator.finish_pending()
    return estimator


def predicted(record: Recorded, estimator: ViscoelasticContact) -> Floats:
    """Return the force by the current law, from penetration and velocity alone, N."""
    estimate, force = estimator.estimate(), np.empty(len(record.force))
    borders = [*np.flatnonzero(record.breaks).tolist(), len(force)]
    for start, stop in pairwise(borders):
        part = slice(start, stop)
        steps = record.steps[part].copy()
        steps[0] = record.sample_time
        x, v = record.penetration[part], record.velocity[part]
        force[part] = estimate.law.force_along(x, v, steps) + estimate.offset
    return force


def held_out(folder: Path, split: str) -> dict[str, float]:
    """Return the RMSE of the held-out part over that of Hunt–Crossley, by recording."""
    ratios = {}
    for notes in sorted(folder.glob("*.json")):
        path = notes.with_suffix(".csv")
        # The first half of set E is one approach at one speed, which does not identify damping.
        if not path.exists() or (split == "second half" and path.name.startswith("E_")):
            continue
        record = read(path)
        if np.count_nonzero(record.good) >= FEWEST:
            ratios[path.stem] = held_out_of(record, split)
    return ratios


def held_out_of(record: Recorded, split: str) -> float:
    """Return the RMSE of the held-out part of one recording, over that of Hunt–Crossley."""
    places = np.flatnonzero(record.good)
    rank = np.full(record.good.size, -1)
    rank[places] = np.arange(places.size)
    block = rank * (2 if split == "second half" else BLOCKS) // places.size
    train = record.good & (block % 2 == 0)
    test = record.good & ~train
    errors = []
    for settings in ({"damping": "hunt-crossley", "memory": "none"}, {}):
        left = record.force - predicted(record, learned(record, train, **settings))
        errors.append(float(np.sqrt(np.mean(left[test] ** 2))))
    return errors[1] / errors[0]


def microrheology(folder: Path) -> list[tuple[str, float, float]]:
    """Return the relative difference of K′ and B′ at 100 Hz from the Fourier reference."""
    found = []
    for path in sorted(folder.glob("F_microrheo_*.csv")):
        notes = json.loads(path.with_suffix(".json").read_text())
        reference = next(row for row in notes["dynamic_stiffness"] if row["freq_hz"] == 100.0)
        record = read(path)
        with path.open() as lines:
            segments = [int(row["segment"]) for row in csv.DictReader(lines)]
        # From the notes: slower ones drift, and at 300 Hz the cantilever's mass matters.
        train = record.good & np.isin(segments, notes["fit_segments"])
        estimator = learned(record, train, memory="any")
        depth = float(np.median(record.penetration[train]))
        omega = 200.0 * np.pi
        whole = estimator.estimate().law.dynamic_stiffness(depth, omega)
        stiffness = whole.real / reference["K_N_per_m"] - 1.0
        damping = whole.imag / omega / reference["B_Ns_per_m"] - 1.0
        found.append((path.stem, stiffness, damping))
    return found


def whole_files(folder: Path) -> Iterator[tuple[str, str, float]]:
    """Yield name, verdict with its evidence, and residual over Hunt–Crossley's, if it has notes."""
    for notes in sorted(folder.glob("*.json")):
        path = notes.with_suffix(".csv")
        if not path.exists():
            continue
        verdict = identify(path, "viscoelastic").law_verdict
        assert verdict is not None  # the method has one
        errors = {str(each.candidate): each.rms_error for each in verdict.model_ranking}
        words = (
            f"{verdict.candidate}, {verdict.effective_samples:.0f} independent samples of "
            f"{verdict.samples:.0f}"
        )
        yield path.stem, words, errors[str(verdict.candidate)] / errors["Hunt–Crossley"]
