"""Panels that several of the paper's figures share."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from palpate.figures.style import Theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What a person calls the lab's materials.
LABELS: Mapping[str, str] = {
    "ball": "ball",
    "sponge": "sponge",
    "pvc": "PVC phantom",
    "inclusion": "PVC with inclusion",
    "relaxing-sponge": "relaxing sponge",
}


def draw_course(
    axes: "Axes",
    time: Sequence[float],
    lines: Sequence[tuple[str, Sequence[float], str, str]],
    theme: Theme,
    truth: float,
) -> None:
    """One parameter over time; each line has a label, values, a colour and a style.

    The start-up leaves any scale: what is shown is where the estimates stay, three times over.
    """
    clock, settled = np.array(time), []
    for label, values, colour, dashes in lines:
        known = np.array(values)
        axes.plot(clock, known, dashes, color=colour, linewidth=1.1, label=label)
        settled.append(known[clock > clock[0] + 1.0])
    axes.axhline(truth, color=theme.ink, linewidth=0.9, linestyle=":", label="truth")
    every = np.concatenate(settled)
    reach = 3.0 * float(np.nanmax(np.abs(every - truth), initial=0.02 * abs(truth)))
    axes.set_ylim(truth - reach, truth + reach)
    axes.set_xlim(clock[0], clock[-1])


def draw_finals(
    axes: "Axes",
    dots: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    theme: Theme,
    truth: float,
) -> None:
    """Final values of several methods, each with two standard errors, beside the truth."""
    for row, (values, errors) in enumerate(dots.values()):
        places = row + np.linspace(-0.3, 0.3, len(values)) if len(values) > 1 else [row]
        axes.errorbar(
            values,
            places,
            xerr=2.0 * np.array(errors),
            fmt="o",
            color=theme.lines[0] if row == 0 else theme.ink,
            markersize=3.0,
            linewidth=0.8,
        )
    axes.axvline(truth, color=theme.ink, linewidth=0.9, linestyle=":")
    axes.set_yticks(range(len(dots)), list(dots))
    axes.set_ylim(len(dots) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
