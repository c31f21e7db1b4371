"""Figs. 17 and 18: parameters and force error with two sines and with one."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.estimators.contact_estimator import ContactEstimator
from palpate.figures.style import style
from palpate.force_laws import HuntCrossley
from palpate.paper.curves import draw_lines, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_richness(
    title: str, kind: type[ContactEstimator], outcomes: Sequence[Outcome], *, dark: bool
) -> "Figure":
    """Draw the first outcome; beside it the convergence times of every seed over P₀."""
    theme, curves = theme_of(dark), outcomes[0].curves
    symbols, units = kind.law_type.symbols, kind.law_type.units
    with style(theme) as new_figure:
        figure = new_figure(figsize=(11.5, 2.2 * len(symbols) + 2.6), layout="constrained")
        grid = figure.add_gridspec(len(symbols) + 1, 3)
        for column, motion in enumerate(("two sines", "one sine")):
            starts, time = list(outcomes[0].numbers[motion]["rmse"]), curves[f"{motion}/elapsed"]
            for row, symbol in enumerate(symbols):
                axes = figure.add_subplot(grid[row, column])
                shown = starts
                if kind.law_type is HuntCrossley:
                    shown = [*starts, "projection"]
                lines = [(start, curves[f"{motion}/{start}/{symbol}"]) for start in shown]
                draw_lines(axes, time, lines, theme)
                final = outcomes[0].numbers["three sines"]["final"][starts[0]][row]
                axes.axhline(final, color=theme.ink, linewidth=0.8, linestyle=":")
                axes.set(xscale="log", ylim=(-0.5 * final, 3.3 * final))
                unit = f" [{units[row]}]" if units[row] else ""
                axes.set(ylabel=f"{symbol}{unit}")
                if row == 0:
                    axes.set_title(f"{motion} (dotted: three)")
                    axes.legend(loc="upper right", ncols=4, handlelength=1.6, columnspacing=0.9)
            error = figure.add_subplot(grid[len(symbols), column])
            shown = [*starts, "projection"]
            lines = [(start, curves[f"{motion}/{start}/error"]) for start in shown]
            draw_lines(error, time, lines, theme, width=0.8)
            error.set(xscale="log", ylim=(-1.0, 1.0), ylabel="force error [N]")
            error.set(xlabel="time since contact [s]")
        for row, symbol in enumerate(symbols):
            axes = figure.add_subplot(grid[row, 2])
            for i, motion in enumerate(("two sines", "one sine")):
                for j, outcome in enumerate(outcomes):
                    times = outcome.numbers[motion]["by covariance"]
                    line = [time[row] for time in times.values()]
                    norms = [float(norm) for norm in times]
                    label = motion if j == 0 else ""
                    draw_lines(axes, norms, [(label, line)], theme, width=1.0, first=i)
            for j, outcome in enumerate(outcomes):
                long = outcome.numbers.get("long", {})
                line = [time[row] for time in long.values()]
                label = "one sine, 450 s" if j == 0 and long else ""
                norms = [float(norm) for norm in long]
                draw_lines(axes, norms, [(label, line)], theme, width=1.0, first=2)
            axes.set(xscale="log", yscale="log", ylabel=f"{symbol}: convergence [s]")
            if row == 0:
                axes.set_title("Every seed, over P₀")
                axes.legend(loc="upper right")
            if row == len(symbols) - 1:
                axes.set(xlabel="P₀")
        figure.suptitle(title, fontsize=11)
    return figure
