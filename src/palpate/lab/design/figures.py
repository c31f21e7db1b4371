"""The figure of a design: the planned and the better motion, and the precision of each."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from palpate.digits import rounded
from palpate.lab.design import Design, PredictedPrecision
from palpate.output import figures
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Shown periods of the slowest sine, and points per period of the fastest.
_PERIODS = 2.0
_POINTS = 40
_MOST_POINTS = 1500
_DURATIONS = 30
NOT_IDENTIFIABLE = "not identifiable"
CAPTION = (
    "Standard errors: lower bound for any unbiased method (Cramér–Rao), relative to the guessed "
    "value; lines at 5 % and 1 %."
)


def draw_design(design: Design, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw the planned motion and the better one, and how soon each identifies the material.

    Penetration over time, velocity over penetration within the limits, and the predicted relative
    standard errors of stiffness, damping and exponent over the time in motion.

    Parameters
    ----------
    design : Design
        As :func:`palpate.lab.design.design` returns it.
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
    look = figures.choose_look(dark=dark, width=width)
    with figures.drawing(look, 6.2 if look.plain else 6.8) as figure:
        cells = "AA;BC;DE" if look.narrow else "AAABBB;CCDDEE"
        panels = list(figure.subplot_mosaic(cells).values())
        shown = [_Shown("planned", design.planned, look.theme.lines[1], "--")]
        if design.better is not None:
            shown.append(_Shown("better", design.better, look.theme.lines[0], "-"))
        _draw_motions(panels[0], panels[1], design, shown, look)
        rounds = any(
            bool((each.of.expected_errors > 1.02 * each.of.relative_errors).any()) for each in shown
        )
        _draw_precision(panels[2:], design, shown, look, rounds=rounds)
        if look.narrow:
            figure.align_ylabels(panels)
        better = "no better motion" if design.better is None else "better"
        caption = f"{CAPTION} Circles: including the sensor's rounding error."
        parts = zip(design.law.symbols, design.law.parameters, design.law.units, strict=True)
        phrases = (f"{symbol} = {rounded(float(value), 4)} {unit}" for symbol, value, unit in parts)
        title = [f"{better}: {design.reason}", f"guessed: {', '.join(map(str.strip, phrases))}"]
        figures.set_titles(figure, look, title, caption if rounds else CAPTION, lines=6)
    return figure


class _Shown(NamedTuple):
    """A motion with its colour and dashes."""

    name: str
    of: PredictedPrecision
    colour: str
    dashes: str


def _shown_time(motions: list[_Shown]) -> Floats:
    """Times to draw motions at, s."""
    frequencies = [
        w
        for motion in motions
        for a, w in zip(motion.of.motion.amplitudes, motion.of.motion.frequencies, strict=True)
        if a > 0.0
    ]
    longest = motions[0].of.durations[-1]
    if not frequencies:
        return np.array([0.0, longest])
    span = min(_PERIODS * 2.0 * math.pi / min(frequencies), longest)
    points = _POINTS * span * max(frequencies) / (2.0 * math.pi)
    return np.linspace(0.0, span, min(int(points) + 2, _MOST_POINTS))


def _draw_motions(
    depths: "Axes",
    orbits: "Axes",
    design: Design,
    motions: list[_Shown],
    look: figures.Look,
) -> None:
    """Penetration over time; velocity over penetration, with the better motion's limits."""
    time = _shown_time(motions)
    limits = design.limits
    depth = figures.choose_scale(max(motion.of.peak_penetration for motion in motions), "m")
    speed = figures.choose_scale(
        max([limits.speed, *(each.of.peak_speed for each in motions)]),
        "m/s",
    )
    least_penetration = limits.least_penetration
    right = limits.peak_penetration
    orbits.plot(
        depth.factor
        * np.array([least_penetration, right, right, least_penetration, least_penetration]),
        speed.factor * limits.speed * np.array([-1.0, -1.0, 1.0, 1.0, -1.0]),
        ":",
        color=look.theme.ink,
        linewidth=look.points(1.0),
        label="limits",
    )
    for name, of, colour, dashes in motions:
        x, v = of.motion.at(time)
        depths.plot(time, depth.factor * x, dashes, color=colour, label=name)
        orbits.plot(depth.factor * x, speed.factor * v, dashes, color=colour, label=name)
    depths.set(xlabel="time [s]", ylabel=depth.label("penetration"))
    figures.head(depths, "Penetration")
    orbits.set(xlabel=depth.label("penetration"), ylabel=speed.label("velocity"))
    figures.head(orbits, "Velocity over penetration")


def _draw_precision(
    panels: "list[Axes]",
    design: Design,
    motions: list[_Shown],
    look: figures.Look,
    *,
    rounds: bool,
) -> None:
    """Relative standard error of each parameter over the time in motion, a panel each."""
    durations = design.planned.durations
    first = max(min(0.1, 0.2 * durations[0]), 10.0 * design.sample_time)
    times = np.geomspace(min(first, durations[-1]), durations[-1], _DURATIONS)
    for name, of, colour, dashes in motions:
        bounds = [design.relative_errors(of.motion, t, quick=True) for t in times]
        rows = zip(panels, 100.0 * np.transpose(bounds), of.expected_errors.T, strict=True)
        for axes, errors, expected in rows:
            known = np.where(np.isfinite(errors), errors, np.nan)
            label = name if np.isfinite(errors).any() else f"{name}: {NOT_IDENTIFIABLE}"
            axes.plot(times, known, dashes, color=colour, label=label)
            if rounds:
                circles = np.where(np.isfinite(expected), 100.0 * expected, np.nan)
                size = look.points(5.0)
                axes.plot(durations, circles, "o", color=colour, mfc="none", markersize=size)
    for axes, symbol in zip(panels, design.law.symbols, strict=True):
        _finish_precision(axes, symbol, design.planned.targets, look)


def _finish_precision(
    axes: "Axes",
    symbol: str,
    targets: tuple[float, ...],
    look: figures.Look,
) -> None:
    """Logarithmic axes with numbers written out, and lines at the targets."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if any(np.isfinite(line.get_ydata()).any() for line in axes.get_lines()):
        for target in targets:
            axes.axhline(
                100.0 * target,
                color=look.theme.ink,
                linestyle=":",
                linewidth=look.points(0.7),
            )
        axes.set_yscale("log")
    axes.set_xscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
        if axis.get_scale() == "log":
            low, high = axis.get_view_interval()
            room_for_decades = axis is axes.yaxis or look.narrow
            few = high > 100.0 * low and room_for_decades
            axis.set_major_locator(LogLocator(subs=(1.0,) if few else (1.0, 2.0, 5.0), numticks=9))
    axes.set(xlabel="time in motion [s]", ylabel=f"s.e. of {symbol} [%]")
    if look.narrow:  # the label says it, and the first panel's legend names the lines
        unknown = any(NOT_IDENTIFIABLE in label for label in axes.get_legend_handles_labels()[1])
        figures.head(axes, "", legend=unknown)
    else:
        figures.head(axes, f"Relative standard error of {symbol}")
