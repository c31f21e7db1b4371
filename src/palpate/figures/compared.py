"""The figure of several identifications of one contact: a row for each method, the best first."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.errors import InvalidParameterError
from palpate.figures.dots import draw_values
from palpate.figures.look import Look, look_of
from palpate.figures.panels import draw_force, draw_loop
from palpate.figures.residuals import draw_residual_rows
from palpate.figures.sheet import head, set_titles, stack
from palpate.figures.style import style
from palpate.figures.words import JOINED, name_of
from palpate.identification import Identified
from palpate.ranking import rank
from palpate.stages import timed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of a loop, of which there is one for each method.
_POINTS = 400
CAPTION = (
    "Methods in the order of their rank. Stiffness and damping at working depth: ±2 s.e., thick "
    "by noise, thin with what the findings would move, and of a law that remembers K′ and B′ at "
    "the motion's own frequency; an arrow: beyond the panel. Residual, measured − final law, to "
    "one scale: median, band from the 10th to the 90th percentile; dotted: that of noise alone."
)


@timed("figure")
def draw_comparison(
    results: Mapping[str, Identified], *, dark: bool = False, width: float | None = None
) -> "Figure":
    """Draw several identifications of one contact, a row for each, the best first.

    Stiffness and damping at working depth with their error bars, and for each method what its final
    law leaves of the force, and on a page the force over penetration: each on axes of its own.

    Parameters
    ----------
    results : mapping
        As :func:`palpate.compare` returns it.
    dark : bool
        For a dark background.
    width : float, optional
        Of the figure as it is printed, m, in [0.06, 0.4]; a page of 11 inches unless given.

    Raises
    ------
    InvalidParameterError
        There is nothing to draw, or the width is out of its range.
    MissingExtraError
        matplotlib is not installed.
    """
    if not results:
        raise InvalidParameterError("results must hold at least one identification, not none")
    look = look_of(dark=dark, width=width)
    ranking = rank(results)
    ordered = [results[name] for name in ranking.order]
    best = ranking.recommended
    words = "no method is to be trusted" if best is None else f"recommended: {best}"
    with style(look.theme, look.sheet) as new_figure:
        arrange = _in_a_column if look.sheet.narrow else _on_a_page
        figure = arrange(new_figure, ordered, look)
        set_titles(figure, look.sheet, [words, name_of(ordered[0])], CAPTION)
    return figure


def _on_a_page(new_figure: "type[Figure]", ordered: list[Identified], look: Look) -> "Figure":
    heights = 2.3, 1.3 * len(ordered) + 0.3
    figure = new_figure(figsize=look.sheet.size(sum(heights) + 1.1), layout="constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=heights)
    above, below = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    force, stiffness, damping = above.subplots(1, 3, width_ratios=(1.4, 1.0, 1.0))
    draw_force(force, ordered[0], look)
    names = [f"{row + 1}. {result.method}" for row, result in enumerate(ordered)]
    draw_values(stiffness, damping, ordered, names, look)
    panels = below.subplots(len(ordered), 2, width_ratios=(2.0, 1.0), squeeze=False)
    _draw_rows(list(panels[:, 0]), ordered, look)
    for row, result in enumerate(ordered):
        draw_loop(panels[row, 1], result, look, colour=_colours(look, row + 1)[row], points=_POINTS)
    head(panels[0, 1], "Measured (grey) and by the final law", legend=False)
    stack(list(panels[:, 1]))
    return figure


def _in_a_column(new_figure: "type[Figure]", ordered: list[Identified], look: Look) -> "Figure":
    heights = 0.9 + 0.19 * len(ordered), 1.15 * len(ordered) + 0.3
    figure = new_figure(figsize=look.sheet.size(sum(heights) + 1.8), layout="constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=heights)
    above, below = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    stiffness, damping = above.subplots(1, 2)
    names = [f"{row + 1}" for row in range(len(ordered))]
    draw_values(stiffness, damping, ordered, names, look)
    _draw_rows(list(below.subplots(len(ordered), 1, squeeze=False)[:, 0]), ordered, look)
    return figure


def _draw_rows(rows: "list[Axes]", ordered: list[Identified], look: Look) -> None:
    """The residual of each method, with its name and what it came to."""
    draw_residual_rows(rows, ordered, _colours(look, len(ordered)), look)
    for row, (axes, result) in enumerate(zip(rows, ordered, strict=True)):
        fit = f"{result.fit_rmse_percent:.2g}{JOINED}%{JOINED}rms"
        head(axes, f"{row + 1}. {result.method}: {result.diagnosis.verdict.overall}, {fit}")
    stack(rows)


def _colours(look: Look, count: int) -> list[str]:
    lines = look.theme.lines
    return [lines[row % len(lines)] for row in range(count)]
