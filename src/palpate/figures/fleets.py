"""How what a fleet found is distributed, and how its repeats scatter."""

from typing import TYPE_CHECKING

import numpy as np

from palpate.figures.look import Look, look_of
from palpate.figures.scales import scale_of
from palpate.figures.sheet import head
from palpate.figures.style import style
from palpate.fleet.survey import Repeats, numbers
from palpate.validation import Floats

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BINS = 40
# Percentiles between which a histogram is drawn; what is beyond is counted in its title.
_SPAN = (0.5, 99.5)
# High over low from which values are drawn on a logarithmic axis: by then half of them can lie in
# the first of the bars.
_DECADES = 100.0


def draw_distributions(
    table: "pa.Table", *, dark: bool = False, width: float | None = None
) -> "Figure":
    """Draw histograms of what was identified, and of how well that is known.

    Stiffness and damping at working depth and the exponent, where one was identified; below each
    its standard error over its size.

    Parameters
    ----------
    table : pyarrow.Table
        Of results.
    dark : bool
        For a dark background.
    width : float, optional
        Of the figure as it is printed, m, in [0.06, 0.4]; a page of 11 inches unless given.
    """
    look = look_of(dark=dark, width=width)
    shown = [("stiffness at working depth", "stiffness_at_depth", "N/m")]
    shown.append(("damping at working depth", "damping_at_depth", "N·s/m"))
    if "exponent" in table.schema.names and _varies(table, "exponent"):
        shown.append(("exponent", "exponent", ""))
    with style(look.theme, look.sheet) as new_figure:
        count, narrow = len(shown), look.sheet.narrow
        height = 5.2 * count if narrow else 5.6
        figure = new_figure(figsize=look.sheet.size(height), layout="constrained")
        grid = figure.subplots(2 * count, 1) if narrow else figure.subplots(2, count)
        panels = np.reshape(grid, (count, 2)) if narrow else np.transpose(grid)
        for (name, column, unit), (above, below) in zip(shown, panels, strict=True):
            value = numbers(table, column)
            error = numbers(table, f"{column}_standard_error")
            scale = scale_of(_typical(value), unit)
            _histogram(
                above, scale.factor * value, scale.label(name), name, look,
                logarithmic=_spans_decades(value),
            )  # fmt: skip
            with np.errstate(all="ignore"):
                relative = np.abs(error / value)[np.isfinite(value)]
            _histogram(below, relative, "standard error / value", "", look, logarithmic=True)
    return figure


def draw_repeats(
    found: list[Repeats], quantity: str, *, dark: bool = False, width: float | None = None
) -> "Figure":
    """Draw how far the scatter of repeats is what their errors say.

    Parameters
    ----------
    found : list of Repeats
        A group each.
    quantity : str
        What they are of.
    dark : bool
        For a dark background.
    width : float, optional
        As for :func:`draw_distributions`.
    """
    look = look_of(dark=dark, width=width)
    with style(look.theme, look.sheet) as new_figure:
        figure = new_figure(figsize=look.sheet.size(3.2), layout="constrained")
        axes = figure.subplots()
        for agree, words, colour in (
            (True, "agree", look.theme.lines[0]),
            (False, "do not agree", look.theme.lines[1]),
        ):
            some = [each for each in found if each.agree == agree]
            axes.plot(
                [each.count for each in some], [max(each.ratio, 1e-3) for each in some], "o",
                color=colour, label=f"{words}: {len(some)}", markersize=look.points(5.0),
            )  # fmt: skip
        axes.axhline(1.0, color=look.theme.ink, linewidth=look.points(0.8), linestyle=":")
        axes.set_yscale("log")
        axes.set(xlabel="repeats", ylabel="scatter / standard errors")
        head(axes, f"Repeats of the {quantity}")
    return figure


def _varies(table: "pa.Table", name: str) -> bool:
    """Whether a parameter was identified; one that was given has no error."""
    return bool((numbers(table, f"{name}_standard_error") > 0.0).any())


def _spans_decades(values: Floats) -> bool:
    """Whether most bars of a linear axis would be empty: cells and springs in one archive.

    Never of values of which one is 0 or below: a logarithmic axis has no place for it.
    """
    known = values[np.isfinite(values)]
    if not known.size or known.min() <= 0.0:
        return False
    low, high = np.percentile(known, _SPAN).tolist()
    return bool(high > _DECADES * low)


def _typical(values: Floats) -> float:
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, 90.0)) if known.size else 0.0


def _histogram(
    axes: "Axes", values: Floats, label: str, title: str, look: Look, *, logarithmic: bool = False
) -> None:
    known = values[np.isfinite(values) & ((values > 0.0) | (not logarithmic))]
    if known.size:
        low, high = np.percentile(known, _SPAN).tolist()
        if high <= low:
            low, high = low - 0.5 * abs(low) - 1e-12, high + 0.5 * abs(high) + 1e-12
            low = max(low, 1e-12) if logarithmic else low
        spaced = np.geomspace if logarithmic else np.linspace
        edges = spaced(low, high, _BINS + 1).tolist()
        inside = known[(known >= low) & (known <= high)]
        axes.hist(inside, edges, color=look.theme.lines[0], linewidth=0)
        if logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter("")
        beyond = known.size - inside.size
        if beyond and title:
            title = f"{title} ({beyond} beyond)"
    missing = values.size - known.size
    if missing and not title:
        title = f"{missing} without a known error"
    axes.set(xlabel=label, ylabel="contacts")
    axes.locator_params(axis="y", nbins=5)
    head(axes, title, legend=False)
