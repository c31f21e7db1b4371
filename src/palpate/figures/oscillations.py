"""Dynamic stiffness and damping over the frequencies that a motion contained."""

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.estimators import ViscoelasticContact
from palpate.figures.look import Look, look_of
from palpate.figures.scales import scale_of
from palpate.figures.sheet import head, set_titles
from palpate.figures.style import style
from palpate.figures.words import name_of
from palpate.identification import Identified
from palpate.quantities.oscillation import SmallOscillation, band_of
from palpate.results.parameters import law_in_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of a line over a band that is a factor of four wide.
_POINTS = 25
_STYLES = ("-", "--", "-.", ":")
CAPTION = (
    "What a small oscillation feels at working depth, over the frequencies that the motion "
    "contained; dark band: ±2 s.e. by noise, light: with what the findings would move. That "
    "another law holds is in neither."
)


def draw_oscillations(
    results: Sequence[Identified], *, dark: bool = False, width: float | None = None
) -> "Figure":
    """Draw K′ and B′ over the frequencies of the motion, a line for each law.

    Parameters
    ----------
    results : sequence of Identification
        Of one contact.
    dark : bool
        For a dark background.
    width : float, optional
        Of the figure as it is printed, m, in [0.06, 0.4]; a page unless given.

    Raises
    ------
    InvalidParameterError
        Nothing moved, so there is no frequency; or the width is out of its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = look_of(dark=dark, width=width)
    courses = [(result, _course(result)) for result in results]
    courses = [(result, course) for result, course in courses if course]
    if not courses:
        raise InvalidParameterError("results must hold one whose probe moved, not none")
    sheet = look.sheet
    with style(look.theme, sheet) as new_figure:
        figure = new_figure(figsize=sheet.size(7.0 if sheet.narrow else 3.6), layout="constrained")
        shape = (2, 1) if sheet.narrow else (1, 2)
        stiffness, damping = figure.subplots(*shape, squeeze=False).reshape(-1)
        _draw(stiffness, courses, ("stiffness", "K′", "N/m"), look)
        _draw(damping, courses, ("damping", "B′", "N·s/m"), look)
        head(stiffness, "Dynamic stiffness K′")
        head(damping, "Dynamic damping B′", legend=False)
        depth = scale_of(courses[0][1][0].depth, "m")
        at = f"at {depth.factor * courses[0][1][0].depth:.4g} {depth.unit}"
        name = name_of(courses[0][0])
        set_titles(figure, sheet, [f"{name}, {at}" if name else at], CAPTION)
    return figure


def _course(result: Identified) -> list[SmallOscillation]:
    """What is felt over the band of the motion; nothing of a probe that was held still."""
    with suppress(InvalidParameterError):
        low, high = band_of(result)
        inside = np.geomspace(low, high, _POINTS)[1:-1].tolist() if low > 0.0 else []
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
    scale = scale_of(largest, unit)
    for row, ((result, course), part) in enumerate(zip(courses, parts, strict=True)):
        hertz = np.array([each.frequency for each in course]) / (2.0 * math.pi)
        value = scale.factor * np.array([each.value for each in part])
        bars = [
            scale.factor * np.array([math.hypot(*errors) for errors in each])
            for each in (
                [(q.standard_error, 0.0) for q in part],
                [(q.standard_error, q.systematic) for q in part],
            )
        ]
        colour = look.theme.lines[row % len(look.theme.lines)]
        for bar, alpha in zip(bars, (0.3, 0.12), strict=True):
            known = np.where(np.isfinite(bar), bar, 0.0)
            low, high = value - 2.0 * known, value + 2.0 * known
            axes.fill_between(hertz, low, high, color=colour, alpha=alpha, lw=0)
        line = _STYLES[row % len(_STYLES)]
        axes.plot(hertz, value, color=colour, linestyle=line, label=_label(result))
    axes.set_xscale("log")
    _mark_frequencies(axes, [each.frequency for _, course in courses for each in course])
    axes.set(xlabel="frequency [Hz]", ylabel=scale.label(symbol))
    axes.locator_params(axis="y", nbins=6)


def _mark_frequencies(axes: "Axes", drawn: Sequence[float]) -> None:
    """Ticks at the ends of the band and its middle: a decade has none within a factor of four."""
    from matplotlib.ticker import FixedLocator, NullLocator

    low, high = min(drawn) / (2.0 * math.pi), max(drawn) / (2.0 * math.pi)
    hertz = [low, math.sqrt(low * high), high]
    axes.xaxis.set_major_locator(FixedLocator(hertz))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(hertz, [f"{each:.3g}" for each in hertz])


def _label(result: Identified) -> str:
    chosen = isinstance(result.estimator, ViscoelasticContact)
    return law_in_words(result) if chosen else f"{result.law.kind}, {result.method}"
