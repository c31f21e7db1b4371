"""Figures of an identification: the only part that imports matplotlib.

Needs the extra ``figures``.
"""

import math
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.errors import InvalidParameterError
from palpate.figures.panels import (
    draw_condition,
    draw_error,
    draw_force,
    draw_loop,
    draw_parameter,
)
from palpate.figures.residuals import draw_residuals
from palpate.figures.style import DARK, LIGHT, check_figure, save, style
from palpate.figures.words import name_of
from palpate.identification import Identification

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDEST_TITLE = 130  # letters; of 11 points 143 are as wide as the figure

__all__ = ["check_figure", "draw", "draw_comparison", "draw_residuals", "save"]


def draw(identification: Identification, *, dark: bool = False) -> "Figure":
    """Draw what was identified: force, loop, parameters with error bands, and condition 10.

    Parameters
    ----------
    identification : Identification
        As :func:`palpate.identify` returns it.
    dark : bool
        For a dark background.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    theme = DARK if dark else LIGHT
    law = identification.law
    names = list(law.as_dict())
    with style(theme) as new_figure:
        figure = new_figure(figsize=(11.0, 8.5), layout="constrained")
        columns = math.lcm(6, len(names))  # thirds for the top, a panel a parameter below
        rows = figure.add_gridspec(3, columns, height_ratios=(1.25, 1.0, 0.8))
        draw_force(figure.add_subplot(rows[0, : columns * 2 // 3]), [identification], theme)
        draw_loop(figure.add_subplot(rows[0, columns * 2 // 3 :]), [identification], theme)
        span = columns // len(names)
        for i, name in enumerate(names):
            axes = figure.add_subplot(rows[1, i * span : (i + 1) * span])
            draw_parameter(axes, identification, i, name, theme)
        bottom = figure.add_subplot(rows[2, :])
        if law.has_condition_10:
            draw_condition(bottom, identification, theme)
        else:
            draw_error(bottom, [identification], theme)
        _write_title(figure, _title(identification))
    return figure


def draw_comparison(results: Mapping[str, Identification], *, dark: bool = False) -> "Figure":
    """Draw several identifications of one contact: force, prediction error and loop.

    Parameters
    ----------
    results : mapping
        As :func:`palpate.compare` returns it.
    dark : bool
        For a dark background.

    Raises
    ------
    InvalidParameterError
        There is nothing to draw.
    MissingExtraError
        matplotlib is not installed.
    """
    if not results:
        raise InvalidParameterError("results must hold at least one identification, not none")
    theme = DARK if dark else LIGHT
    shown = list(results.values())
    with style(theme) as new_figure:
        figure = new_figure(figsize=(11.0, 7.0), layout="constrained")
        rows = figure.add_gridspec(2, 3)
        draw_force(figure.add_subplot(rows[0, :2]), shown, theme)
        draw_error(figure.add_subplot(rows[1, :2]), shown, theme)
        draw_loop(figure.add_subplot(rows[:, 2]), shown, theme)
        _write_title(figure, name_of(shown[0]) or "comparison")
    return figure


def _write_title(figure: "Figure", words: str) -> None:
    figure.suptitle(words, fontsize=11, parse_math=False)  # a file's name may hold a $


def _title(result: Identification) -> str:
    name = name_of(result)
    fitted = "the stretches' own laws fit" if result.stretches else "final law fits"
    fit = f"{result.method}, {fitted} to {result.fit_rmse_percent:.2g} %"
    verdict = f"{result.diagnosis.verdict.overall}: {result.diagnosis.reason}"
    words = textwrap.shorten(verdict, WIDEST_TITLE, placeholder=" …")
    return f"{words}\n{name}: {fit}" if name else f"{words}\n{fit}"
