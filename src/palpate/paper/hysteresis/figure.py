"""Fig. 10: the motion, the loop, and what is left of it without its spring."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from palpate.figures.style import Theme, style
from palpate.paper.curves import draw_lines, median_and_range, theme_of
from palpate.paper.experiment import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOTION = (4.0, 8.0)  # s


def draw_hysteresis(
    title: str, methods: Sequence[str], outcomes: Sequence[Outcome], *, dark: bool
) -> "Figure":
    """Draw the first outcome; the title of the last panel gives the least force of all seeds."""
    theme, first = theme_of(dark), outcomes[0]
    linear = methods[0]
    with style(theme) as new_figure:
        figure = new_figure(figsize=(10.5, 7.6), layout="constrained")
        (motion, loop), (viscous, near) = figure.subplots(2, 2)
        depth = [1e3 * x for x in first.curves["penetration"]]
        motion.plot(first.curves["time"], depth, color=theme.measured)
        motion.axhline(0.0, color=theme.ink, linewidth=0.8, linestyle=":")
        motion.set(xlabel="time [s]", ylabel="penetration [mm]", title="Motion", xlim=MOTION)
        _draw_loop(loop, first, (linear,), theme)
        loop.set(ylabel="force [N]", title="Force–penetration loop")
        loop.legend(loc="upper left")
        stiffness = first.numbers["methods"][linear]["stiffness"]
        _draw_loop(viscous, first, methods, theme, stiffness)
        viscous.set(ylabel="force − K̂ x [N]", ylim=(-0.75, 0.75))
        viscous.set_title("Without the spring K̂ x: what is measured tapers to the surface")
        _draw_loop(near, first, methods, theme)
        near.set(ylabel="force [N]", xlim=(-0.03, 0.8), ylim=(-0.35, 1.8))
        least = [outcome.numbers["methods"][linear]["least"] for outcome in outcomes]
        near.set_title(f"Near the surface: {linear} down to {median_and_range(least, '.2g')} N")
        near.legend(loc="upper left")
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_loop(
    axes: "Axes", outcome: Outcome, methods: Sequence[str], theme: Theme, stiffness: float = 0.0
) -> None:
    """Force over penetration, less a spring's."""
    depth = np.array(outcome.curves["penetration"])
    spring = stiffness * depth
    measured = np.array(outcome.curves["force"]) - spring
    axes.plot(1e3 * depth, measured, color=theme.measured, linewidth=1.6, label="measured")
    for i, name in enumerate(methods):
        force = np.array(outcome.curves[f"predicted/{name}"]) - spring
        draw_lines(axes, 1e3 * depth, [(name, force)], theme, width=0.9, first=i)
    axes.axhline(0.0, color=theme.ink, linewidth=0.8, linestyle=":")
    axes.set(xlabel="penetration [mm]")
