"""Stiffness and damping at working depth by several methods, as dots with their error bars."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.diagnosis import Quantity
from palpate.digits import rounded
from palpate.figures.look import Look
from palpate.figures.parameters import Final
from palpate.figures.scales import scale_as_written, scale_of
from palpate.figures.sheet import head
from palpate.identification import Identified
from palpate.results.summary import felt

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# What is so much larger or smaller than the first value, over its size, is an arrow at the edge.
_MOST_APART = 1.0
# Depths that differ by less are the same: three digits are written.
_SAME_DEPTH = 0.01


def draw_values(
    stiffness: "Axes",
    damping: "Axes",
    results: Sequence[Identified],
    names: Sequence[str],
    look: Look,
) -> None:
    """Two panels beside one another, a row for each result."""
    there = [result.diagnosis.working_depth for result in results]
    at = _depth_in_words([each.depth for each in there])
    both = [felt(result) for result in results]
    _draw_dots(stiffness, [each for each, _ in both], ("Stiffness", "N/m"), look)
    _draw_dots(damping, [each for _, each in both], ("Damping", "N·s/m"), look)
    stiffness.set_yticks(range(len(names)), names)
    damping.set_yticks(range(len(names)), ["" for _ in names])
    head(stiffness, f"Stiffness {at}")
    head(damping, f"Damping {at}")


def _depth_in_words(depths: Sequence[float]) -> str:
    """The depth that all values are for; methods that take other samples may differ in it."""
    scale = scale_of(depths[0], "m")
    low, high = (scale.factor * depth for depth in (min(depths), max(depths)))
    if high <= (1.0 + _SAME_DEPTH) * low:
        return f"at {scale.factor * depths[0]:.3g} {scale.unit}"
    return f"at {low:.3g} to {high:.3g} {scale.unit}"


def _draw_dots(
    axes: "Axes", quantities: list[Quantity], words: tuple[str, str], look: Look
) -> None:
    finals = [Final.of(each) for each in quantities]
    low, high = _limits(finals)
    scale = scale_as_written(max(abs(low), abs(high)), words[1])
    k, ink = scale.factor, look.theme.ink
    axes.axvline(k * finals[0].value, color=ink, linewidth=look.points(0.7), linestyle=":")
    for row, final in enumerate(finals):
        colour = look.theme.lines[row % len(look.theme.lines)]
        if not low <= final.value <= high:
            _draw_arrow(axes, row, final.value, (k * low, k * high), colour, look)
            continue
        for error, line, cap in ((final.error, 3.0, 0.0), (final.whole_error, 1.1, 3.0)):
            axes.errorbar(
                [k * final.value],
                [row],
                xerr=[2.0 * k * error],
                fmt="o",
                color=colour,
                markersize=look.points(5.0),
                elinewidth=look.points(line),
                capsize=look.points(cap),
            )
    axes.set(xlim=(k * low, k * high), ylim=(len(finals) - 0.4, -0.6), xlabel=f"[{scale.unit}]")
    axes.locator_params(axis="x", nbins=3 if look.sheet.narrow else 4)
    axes.grid(visible=False, axis="y")


def _draw_arrow(
    axes: "Axes", row: int, value: float, limits: tuple[float, float], colour: str, look: Look
) -> None:
    """A value that is beyond the panel."""
    right = value > limits[1] or not value < limits[0]
    inset = 0.04 * (limits[1] - limits[0])
    place = limits[1] - inset if right else limits[0] + inset
    axes.plot([place], [row], ">" if right else "<", color=colour, markersize=look.points(6.0))
    axes.annotate(
        rounded(value, 3),
        (place, row),
        xytext=(-6.0 if right else 6.0, 0.0),
        textcoords="offset points",
        ha="right" if right else "left",
        va="center",
        fontsize=0.9 * look.sheet.font,
    )


def _limits(finals: list[Final]) -> tuple[float, float]:
    """Around the best method's value, as far as the others are, but not endlessly."""
    best = finals[0]
    most = max(_MOST_APART * abs(best.value), 2.2 * best.whole_error, 1e-300)
    ends = [best.value - 2.2 * best.whole_error, best.value + 2.2 * best.whole_error]
    for each in finals:
        for sign in (-2.2, 2.2):
            end = each.value + sign * each.whole_error
            if math.isfinite(end):
                ends.append(min(max(end, best.value - most), best.value + most))
    spread = max(max(ends) - min(ends), 1e-3 * abs(best.value), 1e-300)
    return min(ends) - 0.08 * spread, max(ends) + 0.08 * spread
