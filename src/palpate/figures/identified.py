"""The figure of one identification."""

import math
from typing import TYPE_CHECKING

from palpate.estimators import ViscoelasticContact
from palpate.figures.course import course_of
from palpate.figures.look import Look, look_of
from palpate.figures.panels import draw_condition, draw_error, draw_force, draw_loop
from palpate.figures.parameters import draw_damping, draw_parameter, draw_stiffness
from palpate.figures.residuals import draw_residual
from palpate.figures.sheet import head, set_titles, stack
from palpate.figures.style import style
from palpate.figures.words import at_depth, fit_of, force_at_depth, parameters_of, verdict_of
from palpate.identification import Identified
from palpate.results.parameters import Row, parameter_rows
from palpate.stages import timed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Parameters beside one another.
_IN_A_ROW = 4


@timed("figure")
def draw(identification: Identified, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw what was identified: force, stiffness and damping at working depth, and the parameters.

    Force over time and over penetration; stiffness and damping at working depth and each parameter
    over time, with their error bars; and what the final law leaves of the force. The speed beside
    condition 10 stands there for a method that it concerns; the a-priori error for the others. In a
    journal's column (a width below 0.14 m) the panels stand one below the other, and the parameters
    in the title.

    Parameters
    ----------
    identification : Identification
        As :func:`palpate.identify` returns it.
    dark : bool
        For a dark background.
    width : float, optional
        Of the figure as it is printed, m, in [0.06, 0.4]; a page of 11 inches unless given. Letters
        have 7 points at least.

    Raises
    ------
    InvalidParameterError
        The width is out of its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = look_of(dark=dark, width=width)
    with style(look.theme, look.sheet) as new_figure:
        arrange = _in_a_column if look.sheet.narrow else _on_a_page
        return arrange(new_figure, identification, look)


def _on_a_page(new_figure: "type[Figure]", result: Identified, look: Look) -> "Figure":
    drawn = _drawn_of(result)
    length = math.ceil(len(drawn) / math.ceil(len(drawn) / _IN_A_ROW))
    rows = [drawn[i : i + length] for i in range(0, len(drawn), length)]
    columns = math.lcm(6, *(len(row) for row in rows))
    heights = [1.25, 0.95, *(0.85 for _ in rows), 0.85]
    figure = new_figure(figsize=look.sheet.size(2.7 * sum(heights)), layout="constrained")
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)

    def cell(row: int, start: float, stop: float) -> "Axes":
        return figure.add_subplot(grid[row, round(columns * start) : round(columns * stop)])

    draw_force(cell(0, 0, 2 / 3), result, look)
    loop = cell(0, 2 / 3, 1)
    draw_loop(loop, result, look)
    head(loop, "Force over penetration")
    course = course_of(result, result.diagnosis.working_depth.depth)
    draw_stiffness(cell(1, 0, 1 / 2), result, course, look)
    draw_damping(cell(1, 1 / 2, 1), result, course, look)
    for row, several in enumerate(rows):
        for i, parameter in enumerate(several):
            axes = cell(2 + row, i / len(several), (i + 1) / len(several))
            draw_parameter(axes, result, course, parameter, look)
    draw_residual(cell(len(heights) - 1, 0, 1 / 2), result, look)
    check = cell(len(heights) - 1, 1 / 2, 1)
    if result.estimator.needs_condition_10:
        draw_condition(check, result, course, look)
    else:
        draw_error(check, result, look)
    title = [verdict_of(result), fit_of(result), at_depth(result)]
    set_titles(figure, look.sheet, title, _caption(result), lines=1)
    return figure


def _drawn_of(result: Identified) -> list[Row]:
    """The parameters that have a course: of a law that was chosen those that were looked for."""
    rows = parameter_rows(result)
    if not isinstance(result.estimator, ViscoelasticContact):
        return rows
    return [row for row in rows if row.estimated]


def _in_a_column(new_figure: "type[Figure]", result: Identified, look: Look) -> "Figure":
    condition = result.estimator.needs_condition_10
    heights = [1.1, 1.3, 1.0, 1.0, 1.0, *([1.0] * condition)]
    figure = new_figure(figsize=look.sheet.size(1.7 * sum(heights) + 1.8), layout="constrained")
    panels = list(figure.subplots(len(heights), 1, height_ratios=heights))
    course = course_of(result, result.diagnosis.working_depth.depth)
    draw_force(panels[0], result, look)
    draw_loop(panels[1], result, look)
    head(panels[1], "Force over penetration")
    draw_stiffness(panels[2], result, course, look)
    draw_damping(panels[3], result, course, look)
    draw_residual(panels[4], result, look)
    if condition:
        draw_condition(panels[5], result, course, look)
    stack(panels[2:])
    figure.align_ylabels(panels)
    title = [verdict_of(result), fit_of(result), force_at_depth(result), parameters_of(result)]
    set_titles(figure, look.sheet, title, _caption(result), lines=3)
    return figure


def _caption(result: Identified) -> str:
    white = result.estimator.minimises is not None
    taken = ", which takes the noise for white" if white else ""
    if result.stretches:
        kind = "place" if result.stretches[0].place is not None else "stretch"
        last = f"Boxes: the result of each {kind}, ±2 s.e. with what the findings would move"
    else:
        last = (
            "At the right: the result, ±2 s.e.; of stiffness and damping at working depth thick "
            "by noise, thin with what the findings would move"
        )
    return (
        f"Lines and bands: what was known by then, ±2 s.e. by the recursion{taken}. {last}. "
        "Residual: median, band from the 10th to the 90th percentile; dotted: that of noise alone."
    )
