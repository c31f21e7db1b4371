"""Fig. 19: a probe that moves from soft to hard and back, without losing contact."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.estimators import ContactEstimator, SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
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
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table, by_symbol
from palpate.paper.panels import UNITS, draw_course, draw_lines, draw_truth
from palpate.paper.quantities import Numbers
from palpate.paper.sessions import START, identified, pressed
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
#: Of a thousand samples a second one in so many is drawn.
EVERY = 20
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "regular": SingleStageRLS,
    "self-perturbing": partial(SingleStageRLS, perturbation=SelfPerturbation(0.05, 2.5)),
    "constants exchanged": partial(SingleStageRLS, perturbation=SelfPerturbation(2.5, 0.05)),
    "variable projection": partial(VariableProjection, change_detector=ChangeDetector()),
}
SHOWN = {
    "regular": "regular",
    "self-perturbing": "self-perturbing",
    "variable projection": "variable projection with change detection",
}
#: A hard zone that is only a tenth stiffer.
STIFFER = Homogeneous(HuntCrossley(1.1e5, 2.2e5, 2.0))
TENTH = SpaceVaryingMaterial((PVC, STIFFER), (0.0,), "a tenth stiffer")


@dataclass(frozen=True)
class Intermittent(Experiment):
    """Palpation over a soft and a hard zone, with and without self-perturbation."""

    name: str = "fig19"
    title: str = "PVC phantom with a hard zone: regular and self-perturbing single stage"
    caption = (
        "K, B, n, force error and penetration over time while the probe changes between a soft "
        "and a hard zone every five seconds: the regular single stage is lost, the "
        "self-perturbing one follows."
    )
    size: tuple[float, float] = (10.5, 10.0)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Palpate the phantom once; and, with an ideal probe, one whose zones hardly differ."""
        contact = pressed("soft-and-hard", "palpation", seed, SECONDS)
        mild = Bench(TENTH, PALPATION, IdealProbe()).run(seed, seconds=SECONDS)
        softly = mild.contact.window(START)
        # β = 0.05, γ = 2.5 N⁻²: NINT lets an error perturb from γ e² = 0.5 on.
        numbers: dict[str, float] = {"error that perturbs [N]": np.sqrt(0.5 / 2.5)}
        curves = {
            "time": contact.time[::EVERY],
            "penetration": 1e3 * contact.penetration[::EVERY],
        }
        for name, estimator in METHODS.items():
            result = identified(contact, estimator())
            numbers |= _summary(name, result, INCLUSION)
            gently = identified(softly, estimator())
            numbers |= _summary(f"{name}, a tenth stiffer", gently, STIFFER)
            curves |= _curves(name, result)
        return numbers, curves

    def draw(self, figure: "Figure", outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome; the truth dotted, the hard zone shaded."""
        curves, truths = outcomes[0].curves, [each.law.parameters for each in (PVC, INCLUSION)]
        time = curves["time"]
        rows = figure.subplots(5, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 1.2, 0.7))
        shown = {label: name for name, label in SHOWN.items()}
        for i, (axes, (symbol, unit)) in enumerate(zip(rows, UNITS.items(), strict=False)):
            limits = (0.0, 1.5 * max(truth[i] for truth in truths))
            draw_course(axes, curves, symbol, shown, clock="time", unit=unit, ylim=limits)
            for truth in truths:
                draw_truth(axes, truth[i], None)
        errors = {name: curves[f"{name}/error"] for name in SHOWN}
        blocks = time[: len(next(iter(errors.values())))]
        draw_lines(rows[3], blocks, errors, linewidth=0.9)
        rows[3].set(yscale="log", ylim=(0.02, 60.0), ylabel="|force error| [N]\nlargest of 20 ms")
        rows[4].plot(time, curves["penetration"], color=THEME.measured, linewidth=0.9)
        rows[4].set(ylabel="penetration [mm]", xlabel="time [s]", xlim=(START, SECONDS))
        for axes in rows:
            for a, b in zip(CHANGES[::2], CHANGES[1::2], strict=True):
                axes.axvspan(a, b, color=THEME.grid, alpha=0.5, linewidth=0)
        rows[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
        rows[0].set_title("hard zone shaded, truth dotted", loc="right", fontsize=9)

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return force errors by zone, and how soon they are back after a change."""
        columns = {"2–7 s": "mean error before {}{}"}
        for k, visit in enumerate(("7–12 s", "12–17 s", "17–22 s", "22–27 s"), 1):
            columns[visit] = f"mean error after change {{}}{{}} {k}"
        columns["back, slowest [ms]"] = "back {}{}"
        note = (
            "Mean |force error| in each zone, N, without the half second of a change; back: until "
            "its mean over 5 ms is first below 0.1 N after a change, the slowest of four."
        )
        titles = {"": "Soft and hard zones"}
        titles[", a tenth stiffer"] = "Zones that differ by a tenth, ideal probe"
        return tuple(
            Table.of(say, title, ("method",), columns, {(m,): (m, which) for m in METHODS}, note)
            for which, title in titles.items()
        )


def _zones(time: Floats) -> list[NDArray[np.intp]]:
    """Which samples lie in each visit of a zone, the changes left out."""
    edges = (START, *CHANGES, SECONDS)
    pairs = itertools.pairwise(edges)
    return [np.flatnonzero((time > a + SHIFTING) & (time < b - SHIFTING)) for a, b in pairs]


def _summary(name: str, result: Identification, hard: Homogeneous) -> dict[str, float]:
    contact, trace = result.contact, result.trace
    error = np.where(trace.taken, np.abs(contact.force - trace.predicted_force), np.nan)
    first = error[trace.taken][:20]
    late = trace.parameters[(contact.time > 10.0) & trace.taken]
    span = 100.0 * np.ptp(late, axis=0) / np.abs(late.mean(axis=0))
    numbers = {
        f"first error {name} [N]": np.max(first),
        f"first error lasts {name} [ms]": np.count_nonzero(first > 4.0 * FLOOR),
        **{f"alarm {name} {k} [s]": time for k, time in enumerate(result.changes, 1)},
        **by_symbol(f"range after 10 s {name}", span, "%"),
    }
    for k, zone in enumerate(_zones(contact.time)):
        when = f"after change {name} {k}" if k else f"before {name}"
        end, truth = trace.parameters[zone[-1]], (PVC, hard)[k % 2].law.parameters
        numbers[f"mean error {when} [N]"] = np.nanmean(error[zone])
        numbers |= by_symbol(f"end of visit {k} {name}", end, "")
        numbers[f"K off at a zone's end {name} {k} [%]"] = 100.0 * abs(end[0] / truth[0] - 1.0)
    for k, change in enumerate(CHANGES, 1):
        numbers[f"back {name} {k} [ms]"] = _back(error, contact, change)
    return numbers


def _back(error: Floats, contact: Contact, change: float) -> float:
    """Milliseconds after a change until the mean |e| over 5 ms is first below 0.1 N."""
    start = int(np.searchsorted(contact.time, change))
    after = np.nan_to_num(error[start : start + 4000])
    jump = int(np.argmax(after[:20] > FLOOR))
    mean = np.convolve(after[jump:], np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    back = np.flatnonzero(mean < FLOOR)
    return 1e3 * contact.sample_time * float(back[0]) if back.size else float("nan")


def _curves(name: str, result: Identification) -> dict[str, Floats]:
    contact, trace = result.contact, result.trace
    known = np.where(trace.taken[:, None], trace.parameters, np.nan)[::EVERY]
    curves = {f"{name}/{symbol}": known[:, i] for i, symbol in enumerate(UNITS)}
    error = np.where(trace.taken, contact.force - trace.predicted_force, 0.0)
    # The largest of each 20 samples, so that no peak is thinned away.
    blocks = np.abs(error[: len(error) // EVERY * EVERY]).reshape(-1, EVERY)
    return {**curves, f"{name}/error": blocks.max(axis=1)}


EXPERIMENTS = (Intermittent(),)
