"""The figure of a payload: the force in free air before and after weight, inertia and bias."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.digits import with_error
from palpate.input.wrench.log import PayloadLog
from palpate.output.figures.style import choose_look, drawing, head, set_titles, stack
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS = 120  # of a line
_GAP = 10.0  # median steps between blocks; a line breaks at a longer one
CAPTION = "Means of the force in free air, in the axes of the sensor; bands: two standard errors."


def draw_payload(log: PayloadLog, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw the force in free air as recorded, and less weight, inertia and bias of the tool.

    Parameters
    ----------
    log : PayloadLog
        As :func:`palpate.input.wrench.log.measure_payload` returns it.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width of the figure, m, in [0.06, 0.4]. Default: a page of 11 inches.

    Raises
    ------
    InvalidParameterError
        The width is out of its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = choose_look(dark=dark, width=width)
    payload = log.payload
    with drawing(look, 6.0) as figure:
        before, after = figure.subplots(2, 1)
        band = 2.0 * log.error
        for axes, force, title in (
            (before, log.recorded, "As recorded"),
            (after, log.remaining, "Less weight, inertia and bias"),
        ):
            for k, name in enumerate("xyz"):
                time, value, wide = _means(log.time, force[:, k], band[:, k])
                axes.plot(time, value, color=look.colour(k), label=name)
                if axes is after:
                    axes.fill_between(time, -wide, wide, color=look.colour(k), alpha=0.2, lw=0)
            axes.set(xlabel="time [s]", ylabel="force [N]")
            head(axes, title)
        stack([before, after])
        turn = f"turns {math.degrees(payload.turn):.0f}° about {payload.axes} axes"
        mass = with_error(payload.mass, payload.mass_error, unit="kg")
        set_titles(figure, look, [f"{Path(log.source).name or 'log'}: {mass}, {turn}"], CAPTION)
    return figure


def _means(time: Floats, *columns: Floats) -> list[Floats]:
    """Return means over neighbouring blocks, with NaN where the tool was in contact meanwhile."""
    steps = np.diff(time)
    gap = _GAP * float(np.median(steps)) if len(steps) else 0.0
    many = max(len(time) // _POINTS, 1)
    pieces = [
        piece
        for run in np.split(np.arange(len(time)), np.flatnonzero(steps > gap) + 1)
        for piece in [*np.array_split(run, max(len(run) // many, 1)), run[:0]]
    ]
    return [
        np.array([each[piece].mean() if len(piece) else np.nan for piece in pieces])
        for each in (time, *columns)
    ]
