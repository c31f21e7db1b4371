"""Fig. 9: the double stage from starts near the truth."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from palpate.figures.style import style
from palpate.paper.curves import DASHES, PROJECTION, draw_lines, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = {"K": "K [N/mⁿ]", "B": "B [N·s/mⁿ⁺¹]", "n": "n"}
LIMITS = {"K": (0.0, 6000.0), "B": (0.0, 6000.0), "n": (0.6, 1.4)}


def draw_near_truth(
    title: str,
    drawn: Sequence[float],
    scanned: Sequence[float],
    ways: Iterable[str],
    outcomes: Sequence[Outcome],
    *,
    dark: bool,
) -> "Figure":
    """Draw the first outcome's parameters, and below where every seed ends."""
    theme, curves = theme_of(dark), outcomes[0].curves
    with style(theme) as new_figure:
        figure = new_figure(figsize=(10.5, 8.5), layout="constrained")
        grid = figure.add_gridspec(4, len(drawn), height_ratios=(1.0, 1.0, 1.0, 1.1))
        for column, off in enumerate(drawn):
            for row, symbol in enumerate(LABELS):
                axes = figure.add_subplot(grid[row, column])
                lines = [(way, curves[f"{off:g}/{way}/{symbol}"]) for way in ways]
                lines.append(
                    (PROJECTION.replace("\n", " "), curves[f"no start/projection/{symbol}"])
                )
                draw_lines(axes, curves["elapsed"], lines, theme)
                axes.set(xscale="log", ylim=LIMITS[symbol])
                if column == 0:
                    axes.set(ylabel=LABELS[symbol])
                if row == 0:
                    axes.set_title(f"starts {100 * off:g} % off")
                if row == 0 and column == 0:
                    shown = axes.get_legend_handles_labels()
                    figure.legend(*shown, loc="outside lower center", ncols=5)
                if row == len(LABELS) - 1:
                    axes.set(xlabel="time since contact [s]")
        below = figure.add_subplot(grid[3, :])
        for i, material in enumerate(("ball", "sponge")):
            for j, outcome in enumerate(outcomes):
                ends = outcome.numbers[material]
                offs = [f"{off:g}" for off in scanned]
                below.plot(
                    [100.0 * float(name) for name in offs],
                    [max(ends[name]["apart"]) for name in offs],
                    color=theme.lines[i],
                    linestyle=DASHES[i],
                    marker="os"[i],
                    markersize=4,
                    label=material if j == 0 else None,
                )
        below.axhline(5.0, color=theme.ink, linewidth=0.8, linestyle=":")
        below.text(60.0, 5.3, "5 %", color=theme.ink, ha="right")
        below.set(xscale="log", yscale="log", xlim=(0.9, 62.0), ylim=(1.0, 300.0))
        ticks = [1, 2, 5, 10, 20, 50]
        below.set_xticks(ticks, [str(tick) for tick in ticks])
        below.set(xlabel="starts off by [%]", ylabel="apart at the end [%]")
        below.set_title("Every seed: how far apart the starts end")
        below.legend(loc="upper left")
        figure.suptitle(title, fontsize=11)
    return figure
