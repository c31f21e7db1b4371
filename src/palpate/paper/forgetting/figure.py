"""Fig. 7, and what the paper says beside it without a figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.figures.style import style
from palpate.paper.curves import DASHES, PROJECTION, draw_lines, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = {
    **{name: name for name in ("λ = 1", "α = 0.1", "α = 5", "λ = 0.99")},
    "variable projection": PROJECTION,
}
COVARIANCES = {"1": "1", "10": "10", "100": "100", "10000": "1e4", "1e+06": "1e6"}
LABELS = {"K": "K [N/mⁿ]", "B": "B [N·s/mⁿ⁺¹]", "n": "n"}
LIMITS = {"K": (1000.0, 3000.0), "B": (-1000.0, 5000.0), "n": (0.8, 1.2)}
# Later on all are within a few percent.
CLOSE = {"K": (1800.0, 2200.0), "B": (1600.0, 2400.0), "n": (0.96, 1.04)}


def draw_forgetting(title: str, outcomes: Sequence[Outcome], *, dark: bool) -> "Figure":
    """Draw the first outcome: a column for forgetting, one for P₀; below, the held probe."""
    theme, curves = theme_of(dark), outcomes[0].curves
    with style(theme) as new_figure:
        figure = new_figure(figsize=(10.5, 10.0), layout="constrained")
        grid = figure.subplots(4, 2, height_ratios=(1.0, 1.0, 1.0, 0.9))
        for row, symbol in enumerate(LABELS):
            left, right = grid[row]
            lines = [(label, curves[f"profile/{name}/{symbol}"]) for name, label in SHOWN.items()]
            draw_lines(left, curves["elapsed"], lines, theme)
            left.set(ylim=CLOSE[symbol], ylabel=LABELS[symbol], xlim=(0.0, 10.0))
            lines = [
                (f"P₀ = {label}", curves[f"covariance/{name}/{symbol}"])
                for name, label in COVARIANCES.items()
            ]
            draw_lines(right, curves["elapsed"], lines, theme)
            right.set(xscale="log", ylim=LIMITS[symbol], xlim=(1e-2, 10.0))
        grid[0, 0].set_title("Forgetting factor, P₀ = 1e3", pad=46)
        grid[0, 1].set_title("Initial covariance, α = 5", pad=46)
        for axes in grid[0]:
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
        for axes in grid[2]:
            axes.set(xlabel="time since contact [s]")
        held = [name for name in curves if name.startswith("held/") and name != "held/time"]
        lines = [(name.removeprefix("held/"), curves[name]) for name in held]
        draw_lines(grid[3, 0], curves["held/time"], lines, theme, width=1.0)
        grid[3, 0].set(yscale="log", xlabel="time since the probe stopped [s]")
        grid[3, 0].set(ylabel="worst parameter's error [%]", title="Probe held at one depth")
        grid[3, 0].legend(loc="upper right", ncols=2)
        for i, outcome in enumerate(outcomes):
            sizes = outcome.numbers["covariances"]
            times = [max(summary["times"]) for summary in sizes.values()]
            beyond = [max(summary["overshoot"][:2]) for summary in sizes.values()]
            norms = [float(name) for name in sizes]
            label = ("time to 5 % [s]", "overshoot of K or B / truth") if i == 0 else (None, None)
            mark = {"alpha": 0.8, "linewidth": 1.0, "markersize": 4}
            grid[3, 1].plot(
                norms, times, DASHES[0], marker="o", color=theme.lines[0], label=label[0], **mark
            )
            grid[3, 1].plot(
                norms,
                beyond,
                marker="s",
                ls=DASHES[1],
                color=theme.lines[1],
                label=label[1],
                **mark,
            )
        grid[3, 1].set(xscale="log", yscale="log", xlabel="P₀", title="Every seed")
        grid[3, 1].legend(loc="upper left")
        figure.suptitle(title, fontsize=11)
    return figure
