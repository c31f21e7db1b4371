"""Figs. 17 and 18: parameters and force error with two sines and with one."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from palpate.estimators.contact_estimator import ContactEstimator
from palpate.figures.style import Theme, style
from palpate.force_laws import HuntCrossley
from palpate.paper.curves import PROJECTION, draw_lines, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


NO_START = f"none: {PROJECTION}"
MOTIONS = ("two sines", "one sine")


def draw_richness(
    title: str, kind: type[ContactEstimator], outcomes: Sequence[Outcome], *, dark: bool
) -> "Figure":
    """Draw the first outcome; beside it the convergence times of every seed over P₀."""
    theme = theme_of(dark)
    rows = len(kind.law_type.symbols)
    with style(theme) as new_figure:
        figure = new_figure(figsize=(11.5, 2.2 * rows + 2.6), layout="constrained")
        grid = figure.subplots(rows + 1, 3)
        for column, motion in zip(grid.T, MOTIONS, strict=False):
            _draw_motion(column, motion, kind, outcomes[0], theme)
        for row, axes in enumerate(grid[:rows, 2]):
            _draw_times(axes, row, outcomes, theme)
            axes.set(ylabel=f"{kind.law_type.symbols[row]}: convergence [s]")
        grid[0, 2].set_title("Every seed, over P₀")
        grid[0, 2].legend(loc="upper right")
        grid[rows - 1, 2].set(xlabel="P₀")
        grid[rows, 2].set_axis_off()
        handles, labels = grid[rows, 0].get_legend_handles_labels()
        grid[rows, 2].legend(handles, labels, loc="center left", title="start")
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_motion(
    column: Any, motion: str, kind: type[ContactEstimator], outcome: Outcome, theme: Theme
) -> None:
    """Parameters and force error of every start; the value from three sines dotted."""
    curves, starts = outcome.curves, list(outcome.numbers[motion]["rmse"])
    time, symbols, units = curves[f"{motion}/elapsed"], kind.law_type.symbols, kind.law_type.units
    labels = {**{start: start for start in starts}, "projection": NO_START}
    # Its stiffness and damping are another law's than Kelvin–Voigt's.
    shown = list(labels) if kind.law_type is HuntCrossley else starts
    for row, symbol in enumerate(symbols):
        axes = column[row]
        lines = [(labels[name], curves[f"{motion}/{name}/{symbol}"]) for name in shown]
        draw_lines(axes, time, lines, theme)
        final = outcome.numbers["three sines"]["final"][starts[0]][row]
        axes.axhline(final, color=theme.ink, linewidth=0.8, linestyle=":")
        unit = f" [{units[row]}]" if units[row] else ""
        axes.set(xscale="log", ylim=(-0.5 * final, 3.0 * final), ylabel=f"{symbol}{unit}")
    column[0].set_title(f"{motion} (dotted: three)")
    lines = [(label, curves[f"{motion}/{name}/error"]) for name, label in labels.items()]
    draw_lines(column[-1], time, lines, theme, width=0.8)
    column[-1].set(xscale="log", ylim=(-1.0, 1.0), ylabel="force error [N]")
    column[-1].set(xlabel="time since contact [s]")


def _draw_times(axes: "Axes", row: int, outcomes: Sequence[Outcome], theme: Theme) -> None:
    for j, outcome in enumerate(outcomes):
        every = {motion: outcome.numbers[motion]["by covariance"] for motion in MOTIONS}
        if "long" in outcome.numbers:
            every["one sine, 450 s"] = outcome.numbers["long"]
        for i, (motion, times) in enumerate(every.items()):
            line = [time[row] for time in times.values()]
            label = motion if j == 0 else ""
            norms = [float(norm) for norm in times]
            draw_lines(axes, norms, [(label, line)], theme, width=1.0, first=i)
    axes.set(xscale="log", yscale="log")
