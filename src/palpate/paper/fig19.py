"""Fig. 19: a probe that moves from soft to hard and back, without losing contact."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.estimators import ContactEstimator, SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.identification import Identification
from palpate.lab import INCLUSION, PVC, Homogeneous
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table, by_symbol
from palpate.paper.panels import UNITS, Figure, draw_course, draw_lines, draw_truth, known
from palpate.paper.perturbing import (
    CHANGES,
    CONTRASTS,
    GAINS,
    SENSITIVITY,
    corrected,
    palpated,
    stiffer,
    thresholds,
    time_of_stiffness,
    times_by_gain,
)
from palpate.paper.quantities import Numbers
from palpate.paper.sessions import START, identified, pressed
from palpate.settings import ChangeDetector, ConstantForgetting, SelfPerturbation
from palpate.validation import Floats

SECONDS = 27.0
#: A change takes half a second about its middle.
SHIFTING = 0.25
#: Mean over this many samples below twice the force noise: the error is back.
WINDOW, FLOOR = 5, 0.1
#: Of a thousand samples a second one in so many is drawn.
EVERY = 50
#: What is drawn about a change, samples before and after.
BEFORE, AFTER = 5, 30
SELF_PERTURBING = SelfPerturbation(0.05, SENSITIVITY)
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "regular": SingleStageRLS,
    "self-perturbing": lambda: SingleStageRLS(perturbation=SELF_PERTURBING),
    "constants exchanged": lambda: SingleStageRLS(perturbation=SelfPerturbation(2.5, 0.05)),
    "γ = 0.25": lambda: SingleStageRLS(perturbation=SelfPerturbation(0.05, 0.25)),
    # By the first change λ is 1 anyway, but for 1e-13: what differs from then on is the reset.
    "no reset": lambda: SingleStageRLS(
        perturbation=SELF_PERTURBING, forgetting=ConstantForgetting()
    ),
    "λ = 0.99": lambda: SingleStageRLS(forgetting=ConstantForgetting(0.99)),
    "variable projection": lambda: VariableProjection(change_detector=ChangeDetector()),
}
SHOWN = {
    "regular": "regular",
    "self-perturbing": "self-perturbing",
    "variable projection": "variable projection with change detection",
}
#: The paper does not say how far its zones differ. With 7 % the error after a change is its 0.5 N.
CONTRAST = 0.07
ZONES = {"": INCLUSION, ", 7 % apart": stiffer(CONTRAST)}
TITLES = {"": "three times as stiff", ", 7 % apart": "7 % stiffer, ideal probe"}


@dataclass(frozen=True)
class Intermittent(Experiment):
    """Palpation over a soft and a hard zone, with and without self-perturbation."""

    name: str = "fig19"
    title: str = "PVC phantom with a hard zone: regular and self-perturbing single stage"
    caption = (
        "K, B, n, force error and penetration over time while the probe changes between two zones "
        "every five seconds: left of a phantom with a zone three times as stiff, right with one "
        "7 % stiffer. Below, millisecond by millisecond about a change, the mean of the four. The "
        "regular single stage is lost, the self-perturbing one follows."
    )
    size: tuple[float, float] = (11.5, 11.0)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Palpate the phantom once; and, with an ideal probe, one whose zones hardly differ."""
        contacts = {
            "": pressed("soft-and-hard", "palpation", seed, SECONDS),
            ", 7 % apart": palpated(CONTRAST, seed, SECONDS),
        }
        # β = 0.05, γ = 2.5 N⁻²: NINT lets an error perturb from γ e² = 0.5 on.
        numbers: dict[str, float] = {"error that perturbs [N]": np.sqrt(0.5 / SENSITIVITY)}
        curves: dict[str, Floats] = {}
        for which, contact in contacts.items():
            curves[f"time{which}"] = contact.time[::EVERY]
            curves[f"penetration{which}"] = 1e3 * contact.penetration[::EVERY]
            for name, estimator in METHODS.items():
                result = identified(contact, estimator())
                numbers |= _summary(f"{name}{which}", result, ZONES[which])
                if name in SHOWN:
                    curves |= _curves(f"{name}{which}", result)
        return numbers | times_by_gain(seed) | thresholds(seed), curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome; the truth dotted, the second zone shaded."""
        grid = figure.subplots(6, 2, height_ratios=(1.0, 1.0, 1.0, 1.2, 0.7, 1.2))
        for column, (which, hard) in zip(grid.T, ZONES.items(), strict=True):
            _draw_zones(column, outcomes[0].curves, which, hard)
            column[0].set_title(f"second zone {TITLES[which]}", loc="left", fontsize=10)
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return force errors by zone, how soon they are back, and what β has to do with it."""
        columns = {"2–7 s": "mean error before {}{}"}
        for k, visit in enumerate(("7–12 s", "12–17 s", "17–22 s", "22–27 s"), 1):
            columns[visit] = f"mean error after change {{}}{{}} {k}"
        columns["first 2 ms"] = "first 2 ms {}{}"
        columns["back, slowest [ms]"] = "back {}{}"
        columns["K back [ms]"] = "time of K {}{}"
        note = (
            "Mean |force error| in each zone, N, without the half second of a change, and of the "
            "first two samples that are wrong; back: until its mean over 5 ms is first below 0.1 N "
            "after a change, the slowest of four; K back: until K is within 5 % of the truth for "
            "the rest of the stay, mean of four. Self-perturbing: β = 0.05, γ = 2.5 N⁻²; constants "
            "exchanged: β = 2.5, γ = 0.05; γ = 0.25: with β = 0.05; no reset: self-perturbing with "
            "λ = 1 throughout; λ = 0.99: regular, with λ constant."
        )
        errors = (
            Table.of(
                say,
                f"Second zone {title}",
                ("method",),
                columns,
                {(m,): (m, which) for m in METHODS},
                note,
            )
            for which, title in TITLES.items()
        )
        gains = Table.of(
            say,
            "How soon K is back, by β and by how much the zones differ; γ = 2.5 N⁻², ideal probe",
            ("second zone as stiff",),
            {f"β = {gain:g} [ms]": f"K back with β = {gain:g}, {{}}" for gain in GAINS},
            [(words,) for words in CONTRASTS],
        )
        return (*errors, gains)


def _draw_zones(
    column: Any, curves: Mapping[str, list[float]], which: str, hard: Homogeneous
) -> None:
    """One phantom: parameters, force error, penetration, and the moment of a change."""
    truths = [zone.law.parameters for zone in (PVC, hard)]
    shown = {label: f"{name}{which}" for name, label in SHOWN.items()}
    time = curves[f"time{which}"]
    for i, (axes, (symbol, unit)) in enumerate(zip(column, UNITS.items(), strict=False)):
        known = [truth[i] for truth in truths]
        low, high = (0.85 * min(known), 1.15 * max(known)) if which else (0.0, 1.5 * max(known))
        draw_course(axes, curves, symbol, shown, clock=f"time{which}", unit=unit, ylim=(low, high))
        for value in known:
            draw_truth(axes, value, None)
    errors = {name: curves[f"{name}{which}/error"] for name in SHOWN}
    draw_lines(column[3], time[: len(next(iter(errors.values())))], errors, linewidth=0.9)
    column[3].set(ylabel="|force error| [N]\nlargest of 50 ms")
    column[4].plot(time, curves[f"penetration{which}"], color=THEME.measured, linewidth=0.9)
    column[4].set(ylabel="penetration [mm]", xlabel="time [s]")
    for axes in column[:5]:
        axes.set_xlim(START, SECONDS)
        for a, b in zip(CHANGES[::2], CHANGES[1::2], strict=True):
            axes.axvspan(a, b, color=THEME.grid, alpha=0.5, linewidth=0)
    moments = {name: curves[f"{name}{which}/change"] for name in SHOWN}
    draw_lines(column[5], np.arange(-BEFORE, AFTER), moments, marker=".")
    column[5].set(xlabel="time since a change [ms]", ylabel="|force error| [N]\nmean of four")
    for axes in (column[3], column[5]):
        axes.set(yscale="log", ylim=(0.01, 60.0))


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
        f"time of K {name} [ms]": time_of_stiffness(result, hard),
    }
    for k, zone in enumerate(_zones(contact.time)):
        when = f"after change {name} {k}" if k else f"before {name}"
        end, truth = trace.parameters[zone[-1]], (PVC, hard)[k % 2].law.parameters
        numbers[f"mean error {when} [N]"] = np.nanmean(error[zone])
        numbers |= by_symbol(f"end of visit {k} {name}", end, "")
        numbers[f"K off at a zone's end {name} {k} [%]"] = 100.0 * abs(end[0] / truth[0] - 1.0)
    since = [_since(error, contact, change) for change in CHANGES]
    backs = [_back(each, contact) for each in since]
    for k, back in enumerate(backs, 1):
        numbers[f"back {name} {k} [ms]"] = back
    numbers[f"mean back {name} [ms]"] = np.mean(backs)
    numbers[f"first 2 ms {name} [N]"] = np.mean([each[:2] for each in since])
    if isinstance(result.estimator, SingleStageRLS):
        numbers |= corrected(name, result)
    return numbers


def _since(error: Floats, contact: Contact, change: float) -> Floats:
    """|e| from the first sample on that shows a change, within 20 ms."""
    start = int(np.searchsorted(contact.time, change))
    after = np.nan_to_num(error[start : start + 4000])
    return after[int(np.argmax(after[:20] > FLOOR)) :]


def _back(error: Floats, contact: Contact) -> float:
    """Milliseconds until the mean |e| over 5 ms is first below 0.1 N."""
    mean = np.convolve(error, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    back = np.flatnonzero(mean < FLOOR)
    return 1e3 * contact.sample_time * float(back[0]) if back.size else float("nan")


def _curves(name: str, result: Identification) -> dict[str, Floats]:
    contact, trace = result.contact, result.trace
    courses = zip(UNITS, known(result)[::EVERY].T, strict=True)
    curves = {f"{name}/{symbol}": course for symbol, course in courses}
    error = np.abs(np.where(trace.taken, contact.force - trace.predicted_force, 0.0))
    # The largest of each 50 samples, so that no peak is thinned away.
    blocks = error[: len(error) // EVERY * EVERY].reshape(-1, EVERY)
    starts = (int(np.searchsorted(contact.time, change)) for change in CHANGES)
    changes = [error[start - BEFORE : start + AFTER] for start in starts]
    return {
        **curves,
        f"{name}/error": blocks.max(axis=1),
        f"{name}/change": np.mean(changes, axis=0),
    }


EXPERIMENTS = (Intermittent(),)
