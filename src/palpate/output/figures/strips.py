"""Strip chart of a recording: each channel over its own clock, one below the other."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.input.recordings.recording import Recording
from palpate.input.recordings.survey import GAP, ClockSurvey, Survey, seconds
from palpate.output.figures.style import Look, figure_style
from palpate.output.results.colours import DARK, LIGHT, Theme
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Most strips on a page; the title states how many channels there are.
MOST_STRIPS = 24

# Pairs of minimum and maximum along a strip: more than a page has dots.
_PIECES = 800


def draw_strips(recording: Recording, surveyed: Survey, *, dark: bool = False) -> "Figure":
    """Draw each numeric channel that varies over the time of its clock.

    Parameters
    ----------
    recording : Recording
        The recording to draw.
    surveyed : Survey
        As returned by :func:`palpate.input.recordings.survey.survey`.
    dark : bool
        Draw for a dark background. Default: False.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    theme = DARK if dark else LIGHT
    # A clock is the abscissa of others: over itself it is a line.
    clocks = {clock.name for clock in surveyed.clocks}
    varying = {
        channel.name
        for channel in surveyed.channels
        if channel.known
        and channel.minimum < channel.maximum
        and channel.name not in clocks
        and recording.units.get(channel.name) != "ns"
    }
    strips = [
        (clock, name) for clock in surveyed.clocks for name in clock.channels if name in varying
    ]
    shown = strips[:MOST_STRIPS]
    with figure_style(Look(theme)) as new_figure:
        height = 1.0 + 0.85 * max(len(shown), 1)
        figure = new_figure(figsize=(9.0, height), layout="constrained")
        title = _title(recording, len(strips), len(shown), len(surveyed.channels))
        figure.suptitle(title, fontsize=11, parse_math=False)
        if shown:
            panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
            for k, (clock, name) in enumerate(shown):
                last = k + 1 == len(shown) or shown[k + 1][0] is not clock
                _draw_strip(panels[k], recording, clock, name, theme)
                _label_time(panels[k], clock, last=last)
            figure.align_ylabels(list(panels))
    return figure


def _title(recording: Recording, varying: int, shown: int, channels: int) -> str:
    name = Path(recording.source).name or "recording"
    name = "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in name)
    if shown < varying:
        return f"{name}: first {shown} of {varying} varying channels"
    return f"{name}: {shown} of {channels} channels vary"


def _draw_strip(
    axes: "Axes",
    recording: Recording,
    clock: ClockSurvey,
    name: str,
    theme: Theme,
) -> None:
    values = np.asarray(recording.channels[name], dtype=np.float64)
    values = np.where(np.isfinite(values), values, np.nan)
    time = seconds(recording, clock.name) if clock.name else np.arange(len(values), dtype=float)
    axes.plot(
        *_reduce_to_extremes(time, values, GAP * clock.step),
        color=theme.lines[0],
        linewidth=0.9,
    )
    unit = recording.units.get(name, "")
    axes.set_title(name, loc="left", fontsize=9, pad=2.0, parse_math=False)
    axes.set_ylabel(f"[{unit}]" if unit else "", parse_math=False)
    axes.locator_params(axis="y", nbins=3)
    axes.margins(x=0.01, y=0.1)


def _label_time(axes: "Axes", clock: ClockSurvey, *, last: bool) -> None:
    """Label the ticks and the axis of the last strip of a clock only."""
    axes.tick_params(labelbottom=last)
    if last and clock.name:
        axes.set_xlabel(f"time since the first {clock.name} [s]", parse_math=False)
    elif last:
        axes.set_xlabel("sample")


def _reduce_to_extremes(time: Floats, values: Floats, gap: float) -> tuple[Floats, Floats]:
    """Return minimum and maximum of each piece, which keeps spikes; NaN breaks at gaps."""
    if len(values) > 4 * _PIECES:
        edges = np.linspace(0, len(values), _PIECES + 1).astype(np.intp)
        width = -(-len(values) // _PIECES)
        whole = np.full((_PIECES, width), np.nan)
        for k in range(_PIECES):
            whole[k, : edges[k + 1] - edges[k]] = values[edges[k] : edges[k + 1]]
        none = np.isnan(whole).all(axis=1)
        whole[none] = 0.0
        ends = np.column_stack([np.nanmin(whole, axis=1), np.nanmax(whole, axis=1)])
        ends[none] = np.nan
        time = np.repeat(time[edges[:-1]], 2)
        values = ends.reshape(-1)
        gap = math.inf if math.isnan(gap) else max(gap, GAP * float(np.median(np.diff(time[::2]))))
    broken = np.flatnonzero(np.diff(time) > gap) + 1
    return np.insert(time, broken, np.nan), np.insert(values, broken, np.nan)
