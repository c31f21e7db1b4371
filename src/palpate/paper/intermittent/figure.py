"""Fig. 19: parameters, force error and penetration of an intermittent contact."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.figures.style import style
from palpate.paper.curves import draw_lines, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = {
    "regular": "regular",
    "self-perturbing": "self-perturbing",
    "variable projection": "variable projection with change detection",
}
LABELS = {"K": "K [N/mⁿ]", "B": "B [N·s/mⁿ⁺¹]", "n": "n"}


def draw_intermittent(
    title: str,
    truths: Sequence[Sequence[float]],
    changes: Sequence[float],
    outcomes: Sequence[Outcome],
    *,
    dark: bool,
) -> "Figure":
    """Draw the first outcome; the truth dotted, the hard zone shaded."""
    theme, curves = theme_of(dark), outcomes[0].curves
    time = curves["time"]
    with style(theme) as new_figure:
        figure = new_figure(figsize=(10.5, 10.0), layout="constrained")
        rows = figure.subplots(5, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 1.2, 0.7))
        for i, (axes, symbol) in enumerate(zip(rows, LABELS, strict=False)):
            draw_lines(
                axes,
                time,
                [(label, curves[f"{name}/{symbol}"]) for name, label in SHOWN.items()],
                theme,
            )
            for truth in truths:
                axes.axhline(truth[i], color=theme.ink, linewidth=0.8, linestyle=":")
            axes.set(ylabel=LABELS[symbol])
            largest = max(truth[i] for truth in truths)
            axes.set_ylim(0.0, 1.5 * largest)
        error = rows[3]
        for i, name in enumerate(SHOWN):
            values = curves[f"{name}/error"]
            draw_lines(error, time[: len(values)], [(name, values)], theme, width=0.9, first=i)
        error.set(yscale="log", ylim=(0.02, 60.0), ylabel="|force error| [N]\nlargest of 20 ms")
        millimetres = [1e3 * x for x in curves["penetration"]]
        rows[4].plot(time, millimetres, color=theme.measured, linewidth=0.9)
        rows[4].set(ylabel="penetration [mm]", xlabel="time [s]", xlim=(2.0, 27.0))
        for axes in rows:
            for a, b in zip(changes[::2], changes[1::2], strict=True):
                axes.axvspan(a, b, color=theme.grid, alpha=0.5, linewidth=0)
        rows[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
        rows[0].set_title("hard zone shaded, truth dotted", loc="right", fontsize=9)
        figure.suptitle(title, fontsize=11)
    return figure
