"""Figs. 5, 11 and 14: three repetitions on one material, from the first set of starts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from palpate.estimators import ContactEstimator, DoubleStageRLS, SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.identification import Identification
from palpate.paper.experiment import (
    Curves,
    Experiment,
    Outcome,
    Say,
    Table,
    by_parameter,
    by_symbol,
)
from palpate.paper.panels import (
    LABELS,
    UNITS,
    Axes,
    Figure,
    draw_lines,
    draw_truth,
    known,
    thinned,
)
from palpate.paper.quantities import Numbers, named, readable
from palpate.paper.sessions import identified, pressed, session, truth_of

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
        curves: Curves = {}
        seeds = [REPETITIONS * seed + i for i in range(REPETITIONS)]
        for material in (self.material, *self.beside):
            contacts = [pressed(material, "three-sines", each) for each in seeds]
            for method, estimator in METHODS.items():
                results = [identified(contact, estimator()) for contact in contacts]
                values = np.array([result.law.parameters for result in results])
                spread = 100.0 * np.ptp(values, axis=0) / np.abs(values.mean(axis=0))
                numbers |= by_symbol(f"spread {material} {method}", spread, "%")
                if material == self.material:
                    numbers |= _finals(method, results)
                    curves |= _courses(method, results)
            truth = session(material, "three-sines", seeds[0]).truth.window(3.0)
            # The level of the excitation that the rig reached.
            numbers[f"motion {material} [mm]"] = 1e3 * float(np.std(truth.penetration))
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first seed's courses, and every seed's final values."""
        truth = dict(zip(UNITS, truth_of(self.material), strict=True))
        axes = figure.subplots(2, 3, height_ratios=(1.5, 1.0))
        titles = ("stiffness", "damping", "exponent")
        for upper, lower, symbol, title in zip(*axes, UNITS, titles, strict=True):
            label = f"{symbol} [{UNITS[symbol]}]" if UNITS[symbol] else symbol
            _draw_courses(upper, symbol, outcomes[0], truth[symbol])
            upper.set(title=title, ylabel=label, xlabel="time [s]")
            _draw_finals(lower, symbol, outcomes, truth[symbol])
            lower.set(xlabel=label)
        axes[1, 0].set_title("final values, all seeds")
        shown = axes[0, 0].get_legend_handles_labels()
        figure.legend(*shown, loc="outside lower center", ncols=5)

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Final values and how far the repetitions lie apart, by method."""
        rows = [("truth, ours", *map(readable, truth_of(self.material)), "")]
        for method in METHODS:
            each = [[f"final {method} {k} {s}" for k in range(REPETITIONS)] for s in UNITS]
            spread = f"{say(f'spread {self.material} {method}')} %"
            rows.append((method, *(say(*names) for names in each), spread))
        header = ("method", "K, N/mⁿ", "B, N·s/mⁿ⁺¹", "n", "spread of three repetitions")
        note = (
            "Median of all repetitions and seeds, range in brackets. Spread: largest minus least "
            "of three, relative to their mean, of the parameter with the most; over the seeds."
        )
        title = f"{LABELS[self.material].capitalize()}: final values from set I"
        return (Table(title, header, tuple(rows), note),)


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


def _courses(method: str, results: Sequence[Identification]) -> Curves:
    """Parameters over time: of every repetition by the single stage, of the first by others."""
    drawn = thinned(results[0].contact.time)
    curves = {"time": results[0].contact.time[drawn]}
    for k, result in enumerate(results if method == "single-stage" else results[:1]):
        columns = known(result)[drawn].T
        curves |= {f"{method} {k}/{symbol}": y for symbol, y in zip(UNITS, columns, strict=True)}
    return curves


def _draw_courses(axes: Axes, symbol: str, outcome: Outcome, truth: float) -> None:
    """Every repetition by the single stage, and the first by variable projection."""
    curves, time = outcome.curves, np.array(outcome.curves["time"])
    singles = {
        f"single stage, {k + 1}": curves[f"single-stage {k}/{symbol}"] for k in range(REPETITIONS)
    }
    projected = curves[f"variable-projection 0/{symbol}"]
    draw_lines(axes, time, singles, linestyle="-", linewidth=1.1)
    axes.plot(time, projected, "--", label="variable projection, 1", color=THEME.ink, linewidth=1.1)
    draw_truth(axes, truth)
    # The start-up leaves any scale: what is shown is where the estimates stay, three times.
    settled = np.abs(np.array([*singles.values(), projected])[:, time > time[0] + 1.0] - truth)
    reach = 3.0 * float(np.nanmax(settled, initial=0.02 * abs(truth)))
    axes.set(ylim=(truth - reach, truth + reach), xlim=(time[0], time[-1]))


def _draw_finals(axes: Axes, symbol: str, outcomes: Sequence[Outcome], truth: float) -> None:
    """Final values of two methods, each with two standard errors, beside the truth."""
    methods = {"single-stage": THEME.lines[0], "variable-projection": THEME.ink}
    for row, (method, colour) in enumerate(methods.items()):
        values, errors = (
            [
                value
                for outcome in outcomes
                for k in range(REPETITIONS)
                for value in named(f"{what} {method} {k} {symbol}", outcome.numbers).values()
            ]
            for what in ("final", "standard error")
        )
        rows, bars = row + np.linspace(-0.3, 0.3, len(values)), 2.0 * np.array(errors)
        axes.errorbar(values, rows, xerr=bars, fmt="o", color=colour, markersize=3.0, linewidth=0.8)
    axes.axvline(truth, color=THEME.ink, linewidth=0.9, linestyle=":")
    axes.set_yticks(range(len(methods)), [method.replace("-", " ") for method in methods])
    axes.set_ylim(len(methods) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")


EXPERIMENTS = (
    Repetitions("fig05", "Rubber ball, three repetitions", "ball"),
    Repetitions("fig11", "Sponge, three repetitions", "sponge"),
    Repetitions("fig14", "PVC phantom, three repetitions", "pvc", ("ball", "sponge")),
)
