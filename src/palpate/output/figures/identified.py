"""Figures of one identification, its map, its dynamic stiffness, and of several methods."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.force_laws import RelaxationSpectrum
from palpate.identification.diagnosis import Quantity
from palpate.identification.identified import Identified
from palpate.identification.quantities.derived import SmallOscillation, motion_band
from palpate.identification.ranking import rank
from palpate.output.figures.field import ERRORS, VALUES, draw_field
from palpate.output.figures.panels import (
    JOINED,
    Final,
    describe_fit,
    describe_parameters,
    describe_verdict,
    describe_working_depth,
    draw_at_depth,
    draw_condition,
    draw_error,
    draw_force,
    draw_loop,
    draw_parameter,
    draw_residual,
    draw_residual_rows,
    draw_spectrum,
    file_name,
    replay_course,
)
from palpate.output.figures.style import (
    Look,
    choose_look,
    choose_scale,
    drawing,
    head,
    largest,
    scale_as_written,
    set_titles,
    stack,
)
from palpate.output.results.parameters import law_name, parameter_rows
from palpate.output.results.view import short_answer
from palpate.stages import log_stage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


# Parameter panels in a row.
_IN_A_ROW = 4


@log_stage("figure")
def draw(identification: Identified, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw force, stiffness and damping at working depth, and the parameters of the contact model.

    The panels show force over time and over penetration; stiffness and damping at working depth
    and each parameter over time, with error bars; and the residual of the final law. The last
    panel compares the speed with its limit for the single-stage method; for other methods it shows
    the one-step prediction error. Below a width of 0.14 m (one journal column) the panels stand
    one below the other, and the title lists the parameters. A law with a relaxation spectrum has
    one more panel, with the stiffness of each relaxation time.

    Parameters
    ----------
    identification : Identification
        As returned by :func:`palpate.identify`.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches. Letters have at least 7 points.

    Raises
    ------
    InvalidParameterError
        The width is outside its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = choose_look(dark=dark, width=width)
    result = identification
    condition = result.estimator.needs_condition_10
    law: Any = result.law
    spectrum = law.remembers and isinstance(law.relaxation, RelaxationSpectrum)
    if look.narrow:
        rendered = []
        heights = [1.1, 1.3, 1.0, 1.0, 1.0, *([1.0] * (condition + spectrum))]
        height = 1.7 * sum(heights) + 1.8
    else:
        # Parameters that a selected model keeps fixed have no course over time.
        every = not result.estimator.chooses_law
        rendered = [row for row in parameter_rows(result) if every or row.estimated]
        small = len(rendered) + spectrum
        heights = [1.25, 0.95, *([0.85] * math.ceil(small / _IN_A_ROW)), 0.85]
        height = 2.7 * sum(heights)
    with drawing(look, height) as figure:
        if look.narrow:
            panels = list(figure.subplots(len(heights), 1, height_ratios=heights))
        else:
            panels = _page_panels(figure, heights, small)
        if spectrum:
            draw_spectrum(panels.pop(-1 if look.narrow else 3 + small), law, look)
        course = replay_course(result, result.diagnosis.working_depth.depth)
        draw_force(panels[0], result, look)
        draw_loop(panels[1], result, look)
        head(panels[1], "Force over penetration")
        draw_at_depth(panels[2], result, course, "stiffness", look)
        if result.contact.timeless:
            panels[3].set_axis_off()
        else:
            draw_at_depth(panels[3], result, course, "damping", look)
        for axes, parameter in zip(panels[4:], rendered, strict=False):
            draw_parameter(axes, result, course, parameter, look)
        residual, *check = panels[4 + len(rendered) :]
        draw_residual(residual, result, look)
        if condition:
            draw_condition(check[0], result, course, look)
        elif check:
            draw_error(check[0], result, look)
        counts = (
            next(short_answer(result, ())).lines[0].text
            if result.segments
            else describe_verdict(result)
        )
        title = [counts, describe_fit(result)]
        if look.narrow:
            stack(panels[2:])
            figure.align_ylabels(panels)
            title += [describe_working_depth(result, ["force"]), describe_parameters(result)]
        else:
            title.append(describe_working_depth(result))
        set_titles(figure, look, title, _caption(result), lines=3 if look.narrow else 1)
    return figure


def _page_panels(figure: "Figure", heights: list[float], parameters: int) -> "list[Axes]":
    """Return panels for force and loop, stiffness and damping, the parameters, and two more."""
    rows = len(heights) - 3
    length = math.ceil(parameters / rows)
    counts = [min(length, parameters - start) for start in range(0, parameters, length)]
    columns = math.lcm(6, *counts)
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    edges = [[0.0, 2 / 3, 1.0], [0.0, 0.5, 1.0]]
    edges += [[i / count for i in range(count + 1)] for count in counts]
    return [
        figure.add_subplot(grid[row, round(columns * start) : round(columns * stop)])
        for row, several in enumerate([*edges, [0.0, 0.5, 1.0]])
        for start, stop in pairwise(several)
    ]


def _caption(result: Identified) -> str:
    white = result.estimator.minimises is not None
    taken = ", which assumes white noise" if white else ""
    if result.segments:
        kind = "place" if result.segments[0].place is not None else "segment"
        last = f"Boxes: result of each {kind}, ±2 standard errors (statistical and systematic)"
    else:
        last = (
            "At the right: result, ±2 standard errors; of stiffness and damping at working depth: "
            "thick statistical, thin with systematic"
        )
    return (
        f"Lines and bands: estimate up to that time, ±2 standard errors of the recursion{taken}. "
        f"{last}. Residual: median, band from 10th to 90th percentile; dotted: band of noise alone."
    )


# The map of a probe that travels.

# Shapes tell the verdicts apart; colour, which shows the value, could not.
_MARKERS = {"trust": "o", "with-care": "s", "do-not-trust": "X"}
PLACES_CAPTION = (
    "Stiffness of each place at its own working depth, over position in the frame of the "
    "recording, and its standard error (statistical and systematic). The shape of a marker "
    "shows the verdict."
)


def draw_places(result: Identified) -> "Figure":
    """Draw the stiffness of each place over its position, and next to it the standard error."""
    places = [segment.place for segment in result.segments if segment.place is not None]
    positions = 1e3 * np.array([place.position for place in places])
    normals = [place.normal.vector for place in places if place.normal is not None]
    # The map is seen along the axis closest to the normals, else along the one of least spread.
    seen_along = -np.mean(np.abs(normals), axis=0) if normals else np.ptp(positions, axis=0)
    across = np.delete(np.arange(3), np.argmin(seen_along))
    marks = np.array([part.diagnosis.verdict.stiffness for part in result.segments])
    shapes = [(m.replace("-", " "), _MARKERS[m], marks == m) for m in np.unique(marks).tolist()]
    trusted = marks != "do-not-trust"
    values = [part.diagnosis.working_depth.stiffness for part in result.segments]
    look = choose_look(dark=False, width=None)
    with drawing(look, 4.8) as figure:
        left, right = figure.subplots(1, 2)
        for axes, title, colours, numbers in (
            (left, "Stiffness at working depth", VALUES, [each.value for each in values]),
            (right, "Its standard error", ERRORS, [each.whole_error for each in values]),
        ):
            size = np.array(numbers)
            unit = choose_scale(largest(size[trusted] if trusted.any() else size), "N/m")
            at = positions[:, across]
            label = f"[{unit.unit}]"
            size *= unit.factor
            draw_field(axes, at, size, trusted, label, look, colours=colours, markers=shapes)
            axes.set(xlabel=f"{'xyz'[across[0]]} [mm]", ylabel=f"{'xyz'[across[1]]} [mm]")
            axes.set_aspect("equal", adjustable="datalim")
            head(axes, title)
    return figure


# Dynamic stiffness and damping over the frequencies that a motion contained.

# Number of points of a line over a band that is a factor of four wide.
_FREQUENCIES = 25
_STYLES = ("-", "--", "-.", ":")
OSCILLATION_CAPTION = (
    "Stiffness and damping of a small oscillation at working depth, over the frequencies of the "
    "motion. Dark band: ±2 statistical standard errors, light: with systematic. Neither includes "
    "the error of a wrong contact model."
)


def draw_oscillations(
    results: Sequence[Identified],
    *,
    dark: bool = False,
    width: float | None = None,
) -> "Figure":
    """Draw K′ and B′ over the frequencies of the motion, one line per contact model.

    Parameters
    ----------
    results : sequence of Identification
        Results of one contact.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches.

    Raises
    ------
    InvalidParameterError
        The probe did not move in any contact, or the width is outside its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = choose_look(dark=dark, width=width)
    courses = [(result, _course(result)) for result in results]
    courses = [(result, course) for result, course in courses if course]
    if not courses:
        raise InvalidParameterError("no probe moved: dynamic stiffness needs motion")
    with drawing(look, 7.0 if look.narrow else 3.6) as figure:
        stiffness, damping = np.ravel(figure.subplots(*((2, 1) if look.narrow else (1, 2))))
        _draw(stiffness, courses, ("stiffness", "K′", "N/m"), look)
        _draw(damping, courses, ("damping", "B′", "N·s/m"), look)
        head(stiffness, "Dynamic stiffness K′")
        head(damping, "Dynamic damping B′", legend=False)
        depth = choose_scale(courses[0][1][0].depth, "m")
        at = f"at {depth.factor * courses[0][1][0].depth:.4g} {depth.unit}"
        name = file_name(courses[0][0])
        set_titles(figure, look, [f"{name}, {at}" if name else at], OSCILLATION_CAPTION)
    return figure


def _course(result: Identified) -> list[SmallOscillation]:
    """Return dynamic stiffness over the band of the motion; empty for a probe at rest."""
    with suppress(InvalidParameterError):
        low, high = motion_band(result)
        inside = np.geomspace(low, high, _FREQUENCIES)[1:-1].tolist() if low > 0.0 else []
        return [result.dynamic_stiffness(omega) for omega in (low, *inside, high)]
    return []


def _draw(
    axes: "Axes",
    courses: Sequence[tuple[Identified, list[SmallOscillation]]],
    words: tuple[str, str, str],
    look: Look,
) -> None:
    name, symbol, unit = words
    parts = [[getattr(each, name) for each in course] for _, course in courses]
    largest = max(abs(each.value) for part in parts for each in part)
    scale = choose_scale(largest, unit)
    for row, ((result, course), part) in enumerate(zip(courses, parts, strict=True)):
        hertz = np.array([each.frequency for each in course]) / (2.0 * math.pi)
        value = scale.factor * np.array([each.value for each in part])
        own = [each.standard_error for each in part]
        whole = [each.whole_error for each in part]
        colour = look.colour(row)
        for errors, alpha in ((own, 0.3), (whole, 0.12)):
            bar = 2.0 * scale.factor * np.where(np.isfinite(errors), errors, 0.0)
            axes.fill_between(hertz, value - bar, value + bar, color=colour, alpha=alpha, lw=0)
        line = _STYLES[row % len(_STYLES)]
        axes.plot(hertz, value, color=colour, linestyle=line, label=_label(result))
    axes.set_xscale("log")
    _mark_frequencies(axes, [each.frequency for _, course in courses for each in course])
    axes.set(xlabel="frequency [Hz]", ylabel=scale.label(symbol))
    axes.locator_params(axis="y", nbins=6)


def _mark_frequencies(axes: "Axes", rendered: Sequence[float]) -> None:
    """Set ticks at the ends and the middle of the band, where decades may have none."""
    from matplotlib.ticker import FixedLocator, NullLocator

    low = min(rendered) / (2.0 * math.pi)
    high = max(rendered) / (2.0 * math.pi)
    hertz = [low, math.sqrt(low * high), high]
    axes.xaxis.set_major_locator(FixedLocator(hertz))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(hertz, [f"{each:.3g}" for each in hertz])


def _label(result: Identified) -> str:
    chosen = result.estimator.chooses_law
    return law_name(result) if chosen else f"{result.law.kind}, {result.method}"


# Stiffness and damping at working depth by several methods, as dots with their error bars.

# Values whose difference from the first exceeds this multiple of it become an arrow at the edge.
_MOST_APART = 1.0
# Depths that differ by a smaller ratio are equal in the three digits of the title.
_SAME_DEPTH = 0.01


def draw_values(
    stiffness: "Axes",
    damping: "Axes",
    results: Sequence[Identified],
    names: Sequence[str],
    look: Look,
) -> None:
    """Draw stiffness and damping in two panels, one row per result."""
    there = [result.diagnosis.working_depth for result in results]
    at = _format_depths([each.depth for each in there])
    _draw_dots(stiffness, [each.stiffness for each in there], ("Stiffness", "N/m"), look)
    _draw_dots(damping, [each.damping for each in there], ("Damping", "N·s/m"), look)
    stiffness.set_yticks(range(len(names)), names)
    damping.set_yticks(range(len(names)), ["" for _ in names])
    head(stiffness, f"Stiffness {at}")
    head(damping, f"Damping {at}")


def _format_depths(depths: Sequence[float]) -> str:
    """Describe the depth of the values; it may differ between methods that use other samples."""
    scale = choose_scale(depths[0], "m")
    low, high = (scale.factor * depth for depth in (min(depths), max(depths)))
    if high <= (1.0 + _SAME_DEPTH) * low:
        return f"at {scale.factor * depths[0]:.3g} {scale.unit}"
    return f"at {low:.3g} to {high:.3g} {scale.unit}"


def _draw_dots(
    axes: "Axes",
    quantities: list[Quantity],
    words: tuple[str, str],
    look: Look,
) -> None:
    finals = [Final.of(quantity) for quantity in quantities]
    low, high = _limits(finals)
    scale = scale_as_written(max(abs(low), abs(high)), words[1])
    k = scale.factor
    ink = look.theme.ink
    axes.axvline(k * finals[0].value, color=ink, linewidth=look.points(0.7), linestyle=":")
    for row, quantity in enumerate(finals):
        colour = look.colour(row)
        if not low <= quantity.value <= high:
            _draw_arrow(axes, row, quantity.value, (k * low, k * high), colour, look)
            continue
        for error, line, cap in ((quantity.error, 3.0, 0.0), (quantity.whole_error, 1.1, 3.0)):
            bar = 2.0 * k * error
            dot = look.dot(5.0, line, cap)
            axes.errorbar(k * quantity.value, row, xerr=bar, color=colour, **dot)
    axes.set(xlim=(k * low, k * high), ylim=(len(finals) - 0.4, -0.6), xlabel=f"[{scale.unit}]")
    axes.locator_params(axis="x", nbins=3 if look.narrow else 4)
    axes.grid(visible=False, axis="y")


def _draw_arrow(
    axes: "Axes",
    row: int,
    value: float,
    limits: tuple[float, float],
    colour: str,
    look: Look,
) -> None:
    """Draw an arrow for a value beyond the panel."""
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
        fontsize=0.9 * look.font,
    )


def _limits(finals: list[Final]) -> tuple[float, float]:
    """Return limits around the best method's value that include most other values."""
    best = finals[0]
    most = max(_MOST_APART * abs(best.value), 2.2 * best.whole_error, 1e-300)
    ends = [best.value - 2.2 * best.whole_error, best.value + 2.2 * best.whole_error]
    for quantity in finals:
        for sign in (-2.2, 2.2):
            end = quantity.value + sign * quantity.whole_error
            if math.isfinite(end):
                ends.append(min(max(end, best.value - most), best.value + most))
    spread = max(max(ends) - min(ends), 1e-3 * abs(best.value), 1e-300)
    return min(ends) - 0.08 * spread, max(ends) + 0.08 * spread


# The figure of several identifications of one contact: one row per method, the best first.

# Points of each loop.
_LOOP_POINTS = 400
COMPARED_CAPTION = (
    "Methods by rank. Stiffness and damping at working depth: ±2 standard errors, thick "
    "statistical, thin with systematic; of viscoelastic models K′ and B′ at the frequency of the "
    "motion; arrow: outside the panel. Residual, measured − final law, on one scale: median, "
    "band from the 10th to the 90th percentile; dotted: band of noise alone."
)


@log_stage("figure")
def draw_comparison(
    results: Mapping[str, Identified],
    *,
    dark: bool = False,
    width: float | None = None,
) -> "Figure":
    """Draw several identifications of one contact, one row per method, the best first.

    The panels show stiffness and damping at working depth with error bars and the residual of each
    method; a figure as wide as a page also shows force over penetration.

    Parameters
    ----------
    results : mapping
        As returned by :func:`palpate.compare`.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches.

    Raises
    ------
    InvalidParameterError
        ``results`` is empty, or the width is outside its range.
    MissingExtraError
        matplotlib is not installed.
    """
    if not results:
        raise InvalidParameterError("results is empty: pass at least one identification")
    look = choose_look(dark=dark, width=width)
    ranking = rank(results)
    ordered = [results[name] for name in ranking.order]
    best = ranking.recommended
    text = "recommended: none" if best is None else f"recommended: {best}"
    count = len(ordered)
    narrow = look.narrow
    heights = (0.9 + 0.19 * count, 1.15 * count + 0.3) if narrow else (2.3, 1.3 * count + 0.3)
    with drawing(look, sum(heights) + (1.8 if narrow else 1.1)) as figure:
        grid = figure.add_gridspec(2, 1, height_ratios=heights)
        _draw_comparison(
            figure.add_subfigure(grid[0]),
            figure.add_subfigure(grid[1]),
            ordered,
            look,
        )
        set_titles(figure, look, [text, file_name(ordered[0])], COMPARED_CAPTION)
    return figure


def _draw_comparison(
    above: "SubFigure",
    below: "SubFigure",
    ordered: list[Identified],
    look: Look,
) -> None:
    """Draw values above and residuals below; on a page also force and loops."""
    count = len(ordered)
    narrow = look.narrow
    names = [f"{row + 1}" for row in range(count)]
    if narrow:
        stiffness, damping = above.subplots(1, 2)
        panels = below.subplots(count, 1, squeeze=False)
    else:
        names = [f"{name}. {each.method}" for name, each in zip(names, ordered, strict=True)]
        force, stiffness, damping = above.subplots(1, 3, width_ratios=(1.4, 1.0, 1.0))
        draw_force(force, ordered[0], look)
        panels = below.subplots(count, 2, width_ratios=(2.0, 1.0), squeeze=False)
    draw_values(stiffness, damping, ordered, names, look)
    rows = list(panels[:, 0])
    draw_residual_rows(rows, ordered, look)
    for row, (axes, result) in enumerate(zip(rows, ordered, strict=True)):
        fit = f"{result.fit_rmse_percent:.2g}{JOINED}%{JOINED}rms"
        head(axes, f"{row + 1}. {result.method}: {result.diagnosis.verdict.both}, {fit}")
    stack(rows)
    if not narrow:
        for row, (axes, result) in enumerate(zip(panels[:, 1], ordered, strict=True)):
            draw_loop(axes, result, look, colour=look.colour(row), points=_LOOP_POINTS)
        head(panels[0, 1], "Measured (grey) and final law", legend=False)
        stack(list(panels[:, 1]))
