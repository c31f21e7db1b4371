"""Fig. 19: a probe that moves from soft to hard and back, without losing contact."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import SingleStageRLS, VariableProjection
from palpate.estimators.contact_estimator import ContactEstimator
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import (
    INCLUSION,
    PALPATION,
    PVC,
    Bench,
    Homogeneous,
    IdealProbe,
    SpaceVaryingMaterial,
)
from palpate.paper.curves import median_and_range, plain
from palpate.paper.experiment import Outcome, Table
from palpate.paper.intermittent.claims import INTERMITTENT_CLAIMS
from palpate.paper.intermittent.figure import draw_intermittent
from palpate.paper.judged import Curves, JudgedExperiment
from palpate.paper.sessions import START, pressed
from palpate.paper.starts import identified
from palpate.settings import ChangeDetector, SelfPerturbation
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SECONDS = 27.0
#: When the probe crosses from one zone to the other, s.
CHANGES = (7.0, 12.0, 17.0, 22.0)
#: A change takes half a second about its middle.
SHIFTING = 0.25
#: Mean over this many samples below twice the force noise: the error is back.
WINDOW, FLOOR = 5, 0.1
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "regular": SingleStageRLS,
    "self-perturbing": partial(SingleStageRLS, perturbation=SelfPerturbation(0.05, 2.5)),
    "constants exchanged": partial(SingleStageRLS, perturbation=SelfPerturbation(2.5, 0.05)),
    "variable projection": partial(VariableProjection, change_detector=ChangeDetector()),
}
#: A hard zone that is only a tenth stiffer.
TENTH = SpaceVaryingMaterial(
    (PVC, Homogeneous(HuntCrossley(1.1e5, 2.2e5, 2.0))), (0.0,), "a tenth stiffer"
)


class Intermittent(JudgedExperiment):
    """Palpation over a soft and a hard zone, with and without self-perturbation."""

    caption = (
        "K, B, n, force error and penetration over time while the probe changes between a "
        "soft and a hard zone every five seconds: the regular single stage is lost, the "
        "self-perturbing one follows."
    )

    def __init__(self) -> None:
        super().__init__(
            "fig19",
            "PVC phantom with a hard zone: regular and self-perturbing single stage",
            INTERMITTENT_CLAIMS,
        )

    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Palpate the phantom once; and, with an ideal probe, one whose zones hardly differ."""
        contact = pressed("soft-and-hard", "palpation", seed, SECONDS)
        mild = Bench(TENTH, PALPATION, IdealProbe()).run(seed, seconds=SECONDS)
        softly = mild.contact.window(START)
        numbers: dict[str, Any] = {"methods": {}, "a tenth stiffer": {}}
        keep = np.arange(0, len(contact), 20)
        curves: Curves = {
            "time": plain(contact.time[keep]),
            "penetration": plain(contact.penetration[keep]),
        }
        for name, estimator in METHODS.items():
            result = identified(contact, estimator())
            numbers["methods"][name] = _summary(result)
            numbers["a tenth stiffer"][name] = _summary(identified(softly, estimator()))
            curves |= _curves(name, result)
        return numbers, curves

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw parameters, force error and penetration over time."""
        truths = (_law(PVC), _law(INCLUSION))
        return draw_intermittent(self.title, truths, CHANGES, outcomes, dark=dark)

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return force errors by zone, and how soon they are back after a change."""
        return (
            _table("Soft and hard zones", "methods", outcomes),
            _table(
                "Zones that differ by a tenth, ideal probe",
                "a tenth stiffer",
                outcomes,
            ),
        )


def _law(material: Homogeneous) -> list[float]:
    return plain(material.law.parameters)


def _zones(time: Floats) -> list[Any]:
    """Which samples lie in each visit of a zone, the changes left out."""
    edges = (START, *CHANGES, SECONDS)
    return [(time > a + SHIFTING) & (time < b - SHIFTING) for a, b in itertools.pairwise(edges)]


def _summary(result: Identification) -> dict[str, Any]:
    contact, trace = result.contact, result.trace
    error = np.where(trace.taken, np.abs(contact.force - trace.predicted_force), np.nan)
    zones = _zones(contact.time)
    first = error[trace.taken]
    ends = [np.flatnonzero(zone)[-1] for zone in zones]
    late = trace.parameters[(contact.time > 10.0) & trace.taken]
    return {
        "zone errors": plain([np.nanmean(error[zone]) for zone in zones]),
        "first error": float(np.max(first[:20])),
        "first milliseconds": int(np.count_nonzero(first[:20] > 4.0 * FLOOR)),
        "zone ends": [plain(trace.parameters[end]) for end in ends],
        "back": plain([_back(error, contact, change) for change in CHANGES]),
        "late range": plain(np.ptp(late, axis=0) / np.abs(late.mean(axis=0))),
        "alarms": plain(result.changes),
    }


def _back(error: Floats, contact: Contact, change: float) -> float:
    """Milliseconds after a change until the mean |e| over 5 ms is first below 0.1 N."""
    start = int(np.searchsorted(contact.time, change))
    after = np.nan_to_num(error[start : start + 4000])
    jump = int(np.argmax(after[:20] > FLOOR))
    mean = np.convolve(after[jump:], np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    back = np.flatnonzero(mean < FLOOR)
    return 1e3 * contact.sample_time * float(back[0]) if back.size else float("nan")


def _curves(name: str, result: Identification) -> Curves:
    contact, trace = result.contact, result.trace
    keep = np.arange(0, len(contact), 20)
    curves: Curves = {}
    for i, symbol in enumerate(result.law.symbols):
        known = np.where(trace.taken, trace.parameters[:, i], np.nan)
        curves[f"{name}/{symbol}"] = plain(known[keep])
    error = np.where(trace.taken, contact.force - trace.predicted_force, 0.0)
    # The largest of each 20 samples, so that no peak is thinned away.
    blocks = np.abs(error[: len(error) // 20 * 20]).reshape(-1, 20)
    curves[f"{name}/error"] = plain(blocks.max(axis=1))
    return curves


def _table(title: str, what: str, outcomes: Sequence[Outcome]) -> Table:
    rows = []
    for name in METHODS:
        every: list[Mapping[str, Any]] = [outcome.numbers[what][name] for outcome in outcomes]
        zones = [
            median_and_range((numbers["zone errors"][i] for numbers in every), ".2g")
            for i in range(len(CHANGES) + 1)
        ]
        back = median_and_range((max(numbers["back"]) for numbers in every), ".2g")
        rows.append((name, *zones, back))
    header = ("method", "2–7 s", "7–12 s", "12–17 s", "17–22 s", "22–27 s", "back, slowest [ms]")
    note = (
        "Mean |force error| in each zone, N, without the half second of a change; back: until its "
        "mean over 5 ms is first below 0.1 N after a change, the slowest of four."
    )
    return Table(title, header, tuple(rows), note)


INTERMITTENT = (Intermittent(),)
