"""Figures of one identification, its map, its dynamic stiffness, and of several methods."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from palpate._core import __version__
from palpate.digits import format_hertz, format_quantity, rounded
from palpate.errors import InvalidParameterError
from palpate.force_laws import RelaxationSpectrum
from palpate.identification.diagnosis import Quantity
from palpate.identification.identified import Identified
from palpate.identification.quantities.derived import SmallOscillation, motion_band
from palpate.identification.ranking import rank
from palpate.output.figures.panels import (
    JOINED,
    Final,
    Subject,
    describe_fit,
    describe_verdict,
    draw_at_depth,
    draw_condition,
    draw_force,
    draw_loop,
    draw_numbers,
    draw_parameter,
    draw_places,
    draw_residual,
    draw_residual_rows,
    draw_spectrum,
    file_name,
    has_numbers,
)
from palpate.output.figures.style import (
    INCH,
    LINE_STYLES,
    Look,
    choose_look,
    choose_scale,
    drawing,
    head,
    scale_as_written,
    set_titles,
    stack,
)
from palpate.output.results.parameters import law_name, parameter_rows
from palpate.output.results.view import short_answer
from palpate.stages import log_stage
from palpate.validation import frozen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


# Panels by name, and the figure that holds them.


@frozen
class Panel:
    """One panel of a figure.

    Attributes
    ----------
    words : str
        What it shows, for ``--panels help`` and captions.
    height : float
        Height in a journal's column, mm.
    draw : callable
        ``draw(axes, subjects, look)``.
    over_time : bool
        Whether its abscissa is time, which stacked panels share.
    shows : callable
        Whether a result has the quantity.
    """

    words: str
    height: float
    draw: Callable[["Axes", Sequence[Subject], Look], None]
    over_time: bool = False
    shows: Callable[[Identified], bool] = bool


def _has_time(result: Identified) -> bool:
    return not result.contact.timeless


def _has_spectrum(result: Identified) -> bool:
    return result.law.remembers and isinstance(
        getattr(result.law, "relaxation", None), RelaxationSpectrum
    )


def _travels(result: Identified) -> bool:
    return any(part.place is not None for part in result.segments)


PANELS = {
    "force": Panel("force over time, measured and predicted", 32.0, draw_force, over_time=True),
    "loop": Panel("force over penetration, measured and by the law", 46.0, draw_loop),
    "numbers": Panel(
        "stiffness and damping over time, as parts of their results, with bars and marks",
        38.0,
        draw_numbers,
        over_time=True,
        shows=has_numbers,
    ),
    "stiffness": Panel(
        "stiffness at working depth over time, and its result",
        34.0,
        partial(draw_at_depth, quantity="stiffness"),
        over_time=True,
    ),
    "damping": Panel(
        "damping at working depth over time, and its result",
        34.0,
        partial(draw_at_depth, quantity="damping"),
        over_time=True,
        shows=_has_time,
    ),
    "residual": Panel(
        "residual over time: median, band from the 10th to the 90th percentile; dotted: the same "
        "band of noise alone",
        30.0,
        draw_residual,
        over_time=True,
    ),
    "speed": Panel(
        "speed, and the limit of the single-stage method",
        30.0,
        draw_condition,
        over_time=True,
        shows=lambda result: result.estimator.needs_condition_10,
    ),
    "relaxation": Panel(
        "stiffness of each relaxation time", 34.0, draw_spectrum, shows=_has_spectrum
    ),
    "map": Panel("stiffness of each place", 60.0, draw_places, shows=_travels),
    "map-error": Panel(
        "standard error of the stiffness of each place",
        60.0,
        partial(draw_places, errors=True),
        shows=_travels,
    ),
}
#: Names for several panels, beside which each parameter has one by its symbol.
PARAMETERS = "parameters"
ALL = "all"
SEVERAL = {
    PARAMETERS: "each estimated parameter over time, and its result; one by its symbol, such as K",
    ALL: "every panel",
}
_DEFAULT = ("force", "loop", "numbers")
_COMPARED = ("loop", "stiffness", "damping")
_SEGMENTED = ("force", "loop", "stiffness", "damping")
_TRAVELLED = ("map", "map-error")
# Height of a line of a legend in a column, mm.
_LEGEND_LINE = 4.0
# Height of a row of a wide figure, inches.
_ROW = 2.5


@log_stage("figure")
def draw(
    result: "Identified | Mapping[str, Identified]",
    panels: Sequence[str] | None = None,
    *,
    ax: "Axes | Sequence[Axes] | None" = None,
    dark: bool = False,
    width: float | None = None,
) -> "Figure":
    """Draw an identification: force over time, the loop, and stiffness and damping.

    Several results stand in the same panels, each in its colour and with its name, as before and
    after a correction. Up to a width of 0.1 m a figure has no title and no caption, as a journal
    wants it: :func:`caption` writes them. Below 0.14 m the panels stand one below the other.

    Parameters
    ----------
    result : Identification or mapping of str to Identification
        As returned by :func:`palpate.identify`; several with the name of each.
    panels : sequence of str, optional
        Names of ``PANELS``, symbols of parameters, ``"parameters"``, or ``"all"``. Default: force,
        loop and numbers; of a probe that travels the map.
    ax : Axes or sequence of Axes, optional
        Draw into these, one for each panel, without titles. Default: a new figure.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches. Letters have at least 7 points.

    Returns
    -------
    matplotlib.figure.Figure
        The new figure, or that of ``ax``.

    Raises
    ------
    InvalidParameterError
        A panel is not known or shows nothing of this result, the number of axes is not that of the
        panels, or the width is outside its range.
    MissingExtraError
        matplotlib is not installed.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> figure = palpate.figures.draw(result, ["loop", "residual"], width=88e-3)
    >>> len(figure.axes)
    2
    """
    look = choose_look(dark=dark, width=width)
    named = result if isinstance(result, Mapping) else {"": result}
    if not named:
        raise InvalidParameterError("result is empty: pass at least one identification")
    subjects = [
        Subject(each, look.colour(place), name) for place, (name, each) in enumerate(named.items())
    ]
    chosen = choose_panels(panels, list(named.values()))
    if ax is not None:
        return _draw_into(ax, chosen, subjects, look)
    names = len(subjects) if len(subjects) > 1 else 0
    with drawing(look, _height(chosen, names, look)) as figure:
        axes = _arrange(figure, len(chosen), [panel.height for panel in chosen], look)
        for each, panel in zip(axes, chosen, strict=True):
            panel.draw(each, subjects, look)
        if look.narrow:
            _stack_in_time(axes, chosen)
            figure.align_ylabels(axes)
        if look.plain:
            letters = [f"({chr(ord('a') + place)})" for place in range(len(axes))]
            for each, letter in zip(axes, letters if len(axes) > 1 else [""], strict=True):
                head(each, letter)
        words = _describe_bars(chosen, subjects[0].result)
        set_titles(figure, look, _title(subjects), words)
    return figure


def _draw_into(
    ax: "Axes | Sequence[Axes]", chosen: Sequence[Panel], subjects: Sequence[Subject], look: Look
) -> "Figure":
    axes = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(axes) != len(chosen):
        raise InvalidParameterError(
            f"ax has {len(axes)} axes for {len(chosen)} panels: pass one each"
        )
    for each, panel in zip(axes, chosen, strict=True):
        panel.draw(each, subjects, look)
        head(each, "", legend=False)
        if each.get_legend_handles_labels()[1]:
            each.legend(frameon=False)  # inside, as a title of the user's may stand above
    figure: Figure = axes[0].figure
    return figure


def choose_panels(names: Sequence[str] | None, results: Sequence[Identified]) -> list[Panel]:
    """Return the panels of some names, or the usual ones of these results.

    Raises
    ------
    InvalidParameterError
        A name is not known, or a result does not have the quantity.
    """
    chosen = []
    for name in names or _usual_panels(results):
        if name == ALL:
            present = [each for each in PANELS if all(map(PANELS[each].shows, results))]
            chosen += [PANELS[each] for each in present if each != "numbers"]
        if name in (ALL, PARAMETERS):
            chosen += [_parameter_panel(symbol) for symbol in _estimated(results)]
        elif name in PANELS:
            if not all(map(PANELS[name].shows, results)):
                raise InvalidParameterError(f"panel {name!r} shows nothing of this result")
            chosen.append(PANELS[name])
        elif any(name in result.law.symbols for result in results):
            chosen.append(_parameter_panel(name))
        else:
            known = ", ".join([*PANELS, PARAMETERS, ALL])
            raise InvalidParameterError(f"panels has no {name!r}: choose from {known}")
    if not chosen:
        raise InvalidParameterError(
            "panels shows nothing of this result: no parameter was estimated"
        )
    return chosen


def _usual_panels(results: Sequence[Identified]) -> list[str]:
    usual: tuple[str, ...]
    if len(results) > 1:
        usual = _COMPARED
    elif _travels(results[0]):
        usual = _TRAVELLED
    else:
        usual = _SEGMENTED if results[0].segments else _DEFAULT
    return [name for name in usual if all(map(PANELS[name].shows, results))]


def _estimated(results: Sequence[Identified]) -> list[str]:
    """Return the symbols of the parameters that were estimated; a fixed one has no course."""
    symbols = [
        row.symbol
        for result in results
        for row in parameter_rows(result)
        if row.estimated and result.law.parameters[row.index]
    ]
    return list(dict.fromkeys(symbols))


def _parameter_panel(symbol: str) -> Panel:
    draw = partial(draw_parameter, symbol=symbol)
    return Panel(f"{symbol} over time, and its result", 34.0, draw, over_time=True)


def _height(chosen: Sequence[Panel], names: int, look: Look) -> float:
    """Return the height of a figure with some names in its legends, inches at full width."""
    if look.narrow:
        titles = 0.0 if look.plain else 36.0
        panels = sum(panel.height + _LEGEND_LINE * names for panel in chosen)
        return (panels + titles) * 1e-3 / INCH / look.scale
    rows = -(-len(chosen) // _columns(len(chosen)))
    tall = any(panel.height > 50.0 for panel in chosen)
    return _ROW * (rows + 0.6 * tall) + 1.0


def _columns(count: int) -> int:
    """Return the number of columns of a wide figure."""
    return 1 if count == 1 else 2 if count <= 4 else 3


def _arrange(figure: "Figure", count: int, heights: Sequence[float], look: Look) -> "list[Axes]":
    """Return the panels in rows; those of the last row share its width."""
    if look.narrow:
        return list(np.ravel(figure.subplots(count, 1, height_ratios=heights, squeeze=False)))
    columns = _columns(count)
    rows = -(-count // columns)
    last = count - columns * (rows - 1)
    grid = figure.add_gridspec(rows, columns * last)
    axes = []
    for place in range(count):
        row, column = divmod(place, columns)
        width = columns if row == rows - 1 else last
        axes.append(figure.add_subplot(grid[row, column * width : (column + 1) * width]))
    return axes


def _stack_in_time(axes: "Sequence[Axes]", chosen: Sequence[Panel]) -> None:
    """Give panels over time that follow each other one abscissa."""
    following = zip(chosen, axes, strict=True)
    for over_time, group in groupby(following, key=lambda each: each[0].over_time):
        if over_time:
            stack([each for _, each in group])


def _title(subjects: Sequence[Subject]) -> list[str]:
    if len(subjects) > 1:
        return [f"{each.name}: {describe_verdict(each.result)}" for each in subjects]
    result = subjects[0].result
    if result.segments:
        counts = next(short_answer(result, ())).lines[0].text
        return [f"{file_name(result)}: {counts}".lstrip(": ")]
    return [describe_verdict(result), describe_fit(result)]


def caption(
    result: "Identified | Mapping[str, Identified]", panels: Sequence[str] | None = None
) -> str:
    """Return the caption of a figure: what each panel shows, and what bands and bars are.

    Parameters
    ----------
    result : Identification or mapping of str to Identification
        What :func:`draw` draws.
    panels : sequence of str, optional
        As for :func:`draw`.

    Returns
    -------
    str
        Sentences, with a letter for each panel if there are several.
    """
    results = list(result.values()) if isinstance(result, Mapping) else [result]
    chosen = choose_panels(panels, results)
    parts = [panel.words for panel in chosen]
    if len(parts) > 1:
        parts = [f"({chr(ord('a') + place)}) {words}" for place, words in enumerate(parts)]
    words = f"{'; '.join(parts)}. {_describe_bars(chosen, results[0])}".strip()
    return words[0].upper() + words[1:]


def _describe_bars(chosen: Sequence[Panel], result: Identified) -> str:
    """Say what bands and bars are, if a panel has any."""
    if not any(panel.over_time for panel in chosen):
        return ""
    white = ", which assumes white noise" * bool(result.estimator.minimises)
    if result.segments:
        bars = "Boxes: result of each segment, ±2 standard errors (statistical and systematic)"
    else:
        bars = "At the right: result, ±2 standard errors, thick statistical, thin with systematic"
    return (
        f"Lines and bands: estimate up to that time, ±2 standard errors of the recursion{white}. "
        f"{bars}."
    )


def methods_sentence(result: Identified) -> str:
    """Return a sentence for the methods section of a paper.

    Parameters
    ----------
    result : Identification
        The result that the paper states.

    Returns
    -------
    str
        Method, law, working depth and what the errors are.
    """
    often = "" if result.contact.timeless else f" and {format_hertz(result.frequency)}"
    depth = format_quantity(result.diagnosis.working_depth.depth, "m", 4)
    return (
        f"Contacts were identified with palpate {__version__} ({law_name(result)} law, method "
        f"{result.method}); stiffness and damping are those at {depth}{often}, with standard "
        "errors that include systematic ones."
    )


CITATION = (
    f"The palpate developers, palpate {__version__}: real-time identification of contact models. "
    "Method: A. Haddadi and K. Hashtrudi-Zaad, Real-time identification of Hunt–Crossley dynamic "
    "models of contact environments, IEEE Trans. Robotics 28(3), 2012."
)


# Dynamic stiffness and damping over the frequencies that a motion contained.

# Number of points of a line over a band that is a factor of four wide.
_FREQUENCIES = 25
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
        line = LINE_STYLES[row % len(LINE_STYLES)]
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
    method; a figure as wide as a page also shows force over penetration, and one of up to 0.1 m
    only the values.

    Parameters
    ----------
    results : mapping
        As returned by :func:`palpate.compare`.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches.

    Returns
    -------
    matplotlib.figure.Figure
        The new figure.

    Raises
    ------
    InvalidParameterError
        ``results`` is empty, or the width is outside its range.
    MissingExtraError
        matplotlib is not installed.

    Examples
    --------
    >>> import palpate
    >>> results = palpate.compare("examples/recordings/ball.csv")
    >>> figure = palpate.figures.draw_comparison(results, width=88e-3)
    >>> round(float(figure.get_figwidth()) * 25.4)  # mm
    88
    """
    if not results:
        raise InvalidParameterError("results is empty: pass at least one identification")
    look = choose_look(dark=dark, width=width)
    ranking = rank(results)
    ordered = [results[name] for name in ranking.order]
    best = ranking.recommended
    text = "recommended: none" if best is None else f"recommended: {best}"
    count = len(ordered)
    if look.plain:
        values = 0.9 + 0.3 * count
        with drawing(look, values) as figure:
            stiffness, damping = figure.subplots(1, 2)
            draw_values(stiffness, damping, ordered, _number_methods(ordered), look)
        return figure
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


def _number_methods(ordered: list[Identified]) -> list[str]:
    return [f"{place}. {each.method}" for place, each in enumerate(ordered, 1)]


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
        names = _number_methods(ordered)
        force, stiffness, damping = above.subplots(1, 3, width_ratios=(1.4, 1.0, 1.0))
        draw_force(force, [Subject(ordered[0], look.colour(0))], look)
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
            draw_loop(axes, [Subject(result, look.colour(row))], look, points=_LOOP_POINTS)
            head(axes, "", legend=False)
        head(panels[0, 1], "Measured (grey) and final law", legend=False)
        stack(list(panels[:, 1]))
