"""Figs. 5, 11 and 14: three repetitions on one material, from the first set of starts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from palpate.estimators import ContactEstimator, DoubleStageRLS, SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import MATERIALS, Homogeneous
from palpate.paper.experiment import (
    Curves,
    Experiment,
    Outcome,
    Say,
    Table,
    by_parameter,
    by_symbol,
)
from palpate.paper.panels import LABELS, UNITS, draw_lines, draw_truth, thinned
from palpate.paper.quantities import Numbers, named, readable
from palpate.paper.sessions import identified, pressed, session
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

REPETITIONS = 3
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: Mapping[str, Callable[[], ContactEstimator]] = {
    "single-stage": SingleStageRLS,
    "variable-projection": VariableProjection,
    "double-stage": DoubleStageRLS,
}


@dataclass(frozen=True)
class Repetitions(Experiment):
    """Three repetitions of one session, with other noise each, and how they agree.

    Parameters
    ----------
    material : str
        What is pressed.
    beside : tuple of str
        What is pressed as often, to hold it against.
    """

    material: str
    beside: tuple[str, ...] = ()
    group: str = field(default="pressed three times", kw_only=True)
    size: tuple[float, float] = field(default=(10.5, 6.2), kw_only=True)

    @property
    def caption(self) -> str:
        """What the figure shows."""
        return (
            f"Stiffness, damping and exponent of the {LABELS[self.material]}. Above, over time in "
            "three repetitions by the single stage, and in the first by variable projection; the "
            "dotted line is the truth. Below, the final values of every repetition and seed, with "
            "two standard errors of each method's own."
        )

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Press three times; PVC is held against the ball and the sponge."""
        numbers: dict[str, float] = {}
        curves: dict[str, Floats] = {}
        for material in (self.material, *self.beside):
            for method, estimator in METHODS.items():
                results = [
                    identified(
                        pressed(material, "three-sines", REPETITIONS * seed + i), estimator()
                    )
                    for i in range(REPETITIONS)
                ]
                numbers |= _spread(f"{material} {method}", results)
                if material == self.material:
                    numbers |= _finals(method, results)
                    curves |= _courses(method, results)
            truth = session(material, "three-sines", REPETITIONS * seed).truth.window(3.0)
            # The level of the excitation that the rig reached.
            numbers[f"motion {material} [mm]"] = 1e3 * float(np.std(truth.penetration))
        return numbers, curves

    def draw(self, figure: "Figure", outcomes: Sequence[Outcome]) -> None:
        """Draw the first seed's courses, and every seed's final values."""
        truth, first = _truth(self.material), outcomes[0].curves
        axes = figure.subplots(2, 3, height_ratios=(1.5, 1.0))
        time = np.array(first["time"])
        for i, (symbol, unit) in enumerate(UNITS.items()):
            upper, lower, true = axes[0, i], axes[1, i], truth.parameters[i]
            label = f"{symbol} [{unit}]" if unit else symbol
            lines = {
                f"single stage, {k + 1}": np.array(first[f"single-stage {k}/{symbol}"])
                for k in range(REPETITIONS)
            }
            draw_lines(upper, time, lines, linestyle="-", linewidth=1.1)
            projected = np.array(first[f"variable-projection 0/{symbol}"])
            looks = {"color": THEME.ink, "linestyle": "--", "linewidth": 1.1}
            upper.plot(time, projected, label="variable projection, 1", **looks)
            draw_truth(upper, true)
            # The start-up leaves any scale: what is shown is where the estimates stay, three times.
            settled = np.abs(np.stack([*lines.values(), projected])[:, time > time[0] + 1.0] - true)
            reach = 3.0 * float(np.nanmax(settled, initial=0.02 * abs(true)))
            upper.set(ylim=(true - reach, true + reach), xlim=(time[0], time[-1]))
            upper.set(
                title=("stiffness", "damping", "exponent")[i], ylabel=label, xlabel="time [s]"
            )
            _draw_finals(lower, symbol, outcomes, true)
            lower.set(xlabel=label)
        axes[1, 0].set_title("final values, all seeds")
        shown = axes[0, 0].get_legend_handles_labels()
        figure.legend(*shown, loc="outside lower center", ncols=5)

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Final values and how far the repetitions lie apart, by method."""
        truth = _truth(self.material)
        rows = [("truth, ours", *(readable(value) for value in truth.parameters), "")]
        for method in METHODS:
            finals = (
                say(*(f"final {method} {k} {symbol}" for k in range(REPETITIONS)))
                for symbol in UNITS
            )
            rows.append((method, *finals, f"{say(f'spread {self.material} {method}')} %"))
        header = ("method", "K, N/mⁿ", "B, N·s/mⁿ⁺¹", "n", "spread of three repetitions")
        note = (
            "Median of all repetitions and seeds, range in brackets. Spread: largest minus least "
            "of three, relative to their mean, of the parameter with the most; over the seeds."
        )
        title = f"{LABELS[self.material].capitalize()}: final values from set I"
        return (Table(title, header, tuple(rows), note),)


def _truth(material: str) -> HuntCrossley:
    known = MATERIALS[material]
    assert isinstance(known, Homogeneous)
    assert isinstance(known.law, HuntCrossley)
    return known.law


def _finals(method: str, results: Sequence[Identification]) -> dict[str, float]:
    """Final values and standard errors of every repetition, and their mean."""
    law = results[0].law
    mean = np.mean([result.law.parameters for result in results], axis=0)
    numbers = by_parameter(f"mean final {method}", law, mean)
    for k, result in enumerate(results):
        numbers |= by_parameter(f"final {method} {k}", law, result.law.parameters)
        errors = result.estimate.standard_errors
        numbers |= by_parameter(f"standard error {method} {k}", law, errors)
    return numbers | {f"B/K {method} [s/m]": mean[1] / mean[0]}


def _spread(what: str, results: Sequence[Identification]) -> dict[str, float]:
    """Largest minus least of the repetitions, relative to their mean, %, by parameter."""
    values = np.array([result.law.parameters for result in results])
    spread = 100.0 * np.ptp(values, axis=0) / np.abs(values.mean(axis=0))
    return by_symbol(f"spread {what}", spread, "%")


def _courses(method: str, results: Sequence[Identification]) -> dict[str, Floats]:
    """Parameters over time: of every repetition by the single stage, of the first by others."""
    curves: dict[str, Floats] = {}
    for k, result in enumerate(results if method == "single-stage" else results[:1]):
        drawn = thinned(result.contact.time)
        known = np.where(result.trace.taken[:, None], result.trace.parameters, np.nan)[drawn]
        curves |= {f"{method} {k}/{symbol}": known[:, i] for i, symbol in enumerate(UNITS)}
        if k == 0:
            curves["time"] = result.contact.time[drawn]
    return curves


def _draw_finals(axes: "Axes", symbol: str, outcomes: Sequence[Outcome], truth: float) -> None:
    """Final values of two methods, each with two standard errors, beside the truth."""
    methods = ("single-stage", "variable-projection")
    for row, method in enumerate(methods):
        values, errors = (
            [
                value
                for outcome in outcomes
                for k in range(REPETITIONS)
                for value in named(f"{what} {k} {symbol}", outcome.numbers).values()
            ]
            for what in (f"final {method}", f"standard error {method}")
        )
        axes.errorbar(
            values,
            row + np.linspace(-0.3, 0.3, len(values)),
            xerr=2.0 * np.array(errors),
            fmt="o",
            color=THEME.lines[0] if row == 0 else THEME.ink,
            markersize=3.0,
            linewidth=0.8,
        )
    axes.axvline(truth, color=THEME.ink, linewidth=0.9, linestyle=":")
    axes.set_yticks(range(len(methods)), [method.replace("-", " ") for method in methods])
    axes.set_ylim(len(methods) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")


EXPERIMENTS = (
    Repetitions("fig05", "Rubber ball, three repetitions", "ball"),
    Repetitions("fig11", "Sponge, three repetitions", "sponge"),
    Repetitions("fig14", "PVC phantom, three repetitions", "pvc", ("ball", "sponge")),
)
