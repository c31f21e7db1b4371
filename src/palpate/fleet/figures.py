"""The figures of a fleet: distributions, the scatter of repeats, and the map over position."""

from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.fleet.maps import JUDGED, Map, Repeats, describe_frequencies, numbers
from palpate.fleet.rows import AT_DEPTH
from palpate.fleet.tasks import Table
from palpate.output import figures
from palpate.validation import Floats, Mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_BINS = 40
# Percentiles that a histogram spans; its title counts the values beyond.
_HISTOGRAM_SPAN = (0.5, 99.5)
_MOST_POINTS = 2000  # of a line in a page
# Ratio of these percentiles above which the axis is logarithmic: on a linear one half of the values
# could lie in the first bar.
_DECADES = 100.0


def draw_distributions(table: Table, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw histograms of the identified values and of their relative errors.

    Stiffness and damping at working depth, and the exponent if it was identified; below each its
    standard error over its absolute value.

    Parameters
    ----------
    table : pyarrow.Table
        Rows of results.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches.
    """
    look = figures.choose_look(dark=dark, width=width)
    shown = [
        (
            f"{of} at working depth{describe_frequencies(table, of)}",
            of,
            AT_DEPTH[of],
        )
        for of in JUDGED
    ]
    if "n" in table.schema.names and _varies(table, "n"):
        shown.append(("exponent", "n", ""))
    count = len(shown)
    narrow = look.narrow
    with figures.drawing(look, 5.2 * count if narrow else 5.6) as figure:
        grid = figure.subplots(2 * count, 1) if narrow else figure.subplots(2, count)
        panels = np.reshape(grid, (count, 2)) if narrow else np.transpose(grid)
        for (name, column, unit), (above, below) in zip(shown, panels, strict=True):
            value = numbers(table, column)
            error = numbers(table, f"{column}_standard_error")
            scale = figures.choose_scale(_usual(value, 90.0), unit)
            wide = _spans_decades(value)
            label = scale.label(name)
            _histogram(above, scale.factor * value, label, name, look, logarithmic=wide)
            with np.errstate(all="ignore"):
                relative = np.abs(error / value)[np.isfinite(value)]
            _histogram(below, relative, "standard error / value", "", look, logarithmic=True)
    return figure


def draw_card(table: Table, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw the episodes of a data set: contact, peak force, stiffness and delay of the force.

    Parameters
    ----------
    table : pyarrow.Table
        Rows of results, one for each episode.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        As for :func:`draw_distributions`.
    """
    look = figures.choose_look(dark=dark, width=width)
    fraction, force, delay = (
        numbers(table, name) for name in ("contact_fraction", "largest_force", "force_delay")
    )
    with figures.drawing(look, 10.4 if look.narrow else 5.6) as figure:
        grid = figure.subplots(4, 1) if look.narrow else figure.subplots(2, 2)
        contact, peak, over, lag = np.reshape(grid, 4).tolist()
        title = "share of samples in contact"
        _histogram(contact, 100.0 * fraction, "share [%]", title, look)
        scale = figures.choose_scale(_usual(force, 90.0), "N")
        _histogram(peak, scale.factor * force, scale.label("largest force"), "peak force", look)
        if np.isfinite(delay).any():
            _histogram(lag, 1e3 * delay, "delay [ms]", "delay of the force", look)
        else:
            lag.set_axis_off()
        stiffness = numbers(table, "stiffness")
        place = numbers(table, "index")
        parts = (numbers(table, f"stiffness_{k}") for k in ("standard_error", "systematic"))
        error = np.sqrt(sum(np.nan_to_num(part) ** 2 for part in parts))
        scale = figures.choose_scale(_usual(stiffness, 90.0), AT_DEPTH["stiffness"])
        place = np.where(np.isfinite(place), place, np.arange(len(place)))
        every = slice(None, None, -(-len(place) // _MOST_POINTS))
        over.errorbar(
            place[every],
            scale.factor * stiffness[every],
            scale.factor * error[every],
            fmt="o",
            color=look.theme.lines[0],
            markersize=look.points(3.0),
            elinewidth=look.points(0.8),
        )
        over.set(xlabel="episode", ylabel=scale.label("stiffness"))
        text = "stiffness at working depth"
        figures.head(over, text + f", one row of {every.step}" * (every.step > 1), legend=False)
    return figure


def draw_repeats(
    found: list[Repeats],
    quantity: str,
    *,
    dark: bool = False,
    width: float | None = None,
) -> "Figure":
    """Draw the scatter of repeats relative to their standard errors.

    Parameters
    ----------
    found : list of Repeats
        The groups of repeats.
    quantity : str
        The repeated quantity, for the title.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        As for :func:`draw_distributions`.
    """
    look = figures.choose_look(dark=dark, width=width)
    with figures.drawing(look, 3.2) as figure:
        axes = figure.subplots()
        for agree, words, colour in zip(
            (True, False),
            ("agree", "do not agree"),
            look.theme.lines[:2],
            strict=True,
        ):
            some = [each for each in found if each.agree == agree]
            ratios = [max(each.ratio, 1e-3) for each in some]
            [line] = axes.plot([each.count for each in some], ratios, "o", color=colour)
            line.set(label=f"{words}: {len(some)}", markersize=look.points(5.0))
        axes.axhline(1.0, color=look.theme.ink, linewidth=look.points(0.8), linestyle=":")
        axes.set_yscale("log")
        axes.set(xlabel="repeats", ylabel="scatter / standard errors")
        figures.head(axes, f"Repeats of the {quantity}")
    return figure


def _varies(table: Table, name: str) -> bool:
    """Whether a parameter was identified; a fixed one has no error."""
    return bool((numbers(table, f"{name}_standard_error") > 0.0).any())


def _spans_decades(values: Floats) -> bool:
    """Whether positive values span more decades than a linear axis can show."""
    known = values[np.isfinite(values)]
    if not known.size or known.min() <= 0.0:
        return False
    low, high = np.percentile(known, _HISTOGRAM_SPAN).tolist()
    return bool(high > _DECADES * low)


def _histogram(
    axes: "Axes",
    values: Floats,
    label: str,
    title: str,
    look: figures.Look,
    *,
    logarithmic: bool = False,
) -> None:
    known = values[np.isfinite(values) & ((values > 0.0) | (not logarithmic))]
    if known.size:
        low, high = np.percentile(known, _HISTOGRAM_SPAN).tolist()
        if high <= low:
            low = low - 0.5 * abs(low) - 1e-12
            high = high + 0.5 * abs(high) + 1e-12
            low = max(low, 1e-12) if logarithmic else low
        spaced = np.geomspace if logarithmic else np.linspace
        edges = spaced(low, high, _BINS + 1).tolist()
        inside = known[(known >= low) & (known <= high)]
        axes.hist(inside, edges, color=look.theme.lines[0], linewidth=0)
        if logarithmic:
            from matplotlib.ticker import LogLocator

            axes.set_xscale("log")
            # Within a decade powers of ten alone would leave one label.
            subs = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
            axes.xaxis.set_major_locator(LogLocator(subs=subs))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
        beyond = known.size - inside.size
        if beyond and title:
            title = f"{title} ({beyond} outside)"
    missing = values.size - known.size
    if missing and not title:
        title = f"{missing} without a known error"
    axes.set(xlabel=label, ylabel="contacts")
    axes.locator_params(axis="y", nbins=5, integer=True)
    figures.head(axes, title, legend=False)


# A map of values over position, with their errors next to it.

# A strip with a larger ratio of length to width is not drawn to scale, because its width would
# vanish.
_LONGEST = 20.0
# Percentile of the sizes that determines the unit.
_USUAL = 98.0


def draw_map(found: Map, *, dark: bool = False, width: float | None = None) -> "Figure":
    """Draw values over position, and next to them their standard errors.

    Parameters
    ----------
    found : Map
        Result of :func:`palpate.fleet.maps.map_of`.
    dark : bool
        Draw for a dark background. Default: False.
    width : float, optional
        Printed width, m, in [0.06, 0.4]. Default: 11 inches.

    Raises
    ------
    InvalidParameterError
        The width is outside its range.
    MissingExtraError
        matplotlib is not installed.
    """
    look = figures.choose_look(dark=dark, width=width)
    line = len(found.axes) == 1
    height = (7.5 if look.narrow else 4.2) if line else _plane_height(found, look)
    with figures.drawing(look, height) as figure:
        panels = figure.subplots(*((2, 1) if look.narrow else (1, 2)))
        for axes, what in zip(panels, ("value", "error"), strict=True):
            unit = figures.choose_scale(_usual(getattr(found, what)), found.unit)
            (_draw_line if line else _draw_plane)(axes, found, what, unit, look)
        figures.set_titles(figure, look, [found.title])
    return figure


def _plane_height(found: Map, look: figures.Look) -> float:
    """Return the height of two maps to scale with their colour bars, inches at full width."""
    sides = np.ptp(found.places, axis=0)
    ratio = float(np.clip(sides[1] / max(sides[0], 1e-30), 0.3, 1.6)) if _to_scale(found) else 0.8
    width = look.inches / look.scale
    return 2.0 * (0.55 * width * ratio + 0.9) if look.narrow else 0.33 * width * ratio + 1.4


def _to_scale(found: Map) -> bool:
    """Return whether both coordinates are lengths, and the map no strip."""
    sides = np.ptp(found.places, axis=0)
    metres = found.units[0] == found.units[1] == "m"
    return bool(metres and max(sides) < _LONGEST * min(sides))


def _usual(values: Floats, percentile: float = _USUAL) -> float:
    """Return the typical largest size, for the choice of a unit; robust against outliers."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, percentile)) if known.size else 0.0


def _draw_line(
    axes: "Axes",
    found: Map,
    what: str,
    unit: figures.AxisScale,
    look: figures.Look,
) -> None:
    """Draw values with error bars, or the errors alone, over one coordinate."""
    along = figures.choose_scale(figures.largest(found.places[:, 0]), found.units[0])
    x = along.factor * found.places[:, 0]
    colour = look.theme.lines[0]
    y = unit.factor * getattr(found, what)
    size = look.points(4.0)
    if what == "value":
        bars = np.where(np.isfinite(found.error), unit.factor * found.error, 0.0)
        axes.errorbar(x, y, bars, fmt="o", color=colour, markersize=size, linewidth=size / 4.0)
        at_foot = {"transform": axes.get_xaxis_transform()}
        known = np.isfinite(y)
        _mark(axes, x, np.where(known, y, 0.02), known, found, look, **at_foot)
    else:
        axes.plot(x, y, "o", color=colour, markersize=size)
        axes.set_ylim(bottom=0.0)
    name = found.name if what == "value" else "its standard error"
    axes.set(xlabel=along.label(found.axes[0]), ylabel=unit.label(name))
    figures.head(axes, name.capitalize())


def _mark(
    axes: "Axes",
    x: Floats,
    y: Floats,
    known: Mask,
    found: Map,
    look: figures.Look,
    **missing: Any,
) -> None:
    """Mark places without a value, and places whose value is not to be trusted."""
    for there, sign, size, label, options in (
        (~known, "x", 5.0, "no value", missing),
        (known & found.mistrusted, "s", 9.0, "not to be trusted", {"fillstyle": "none"}),
    ):
        if there.any():
            options = {"color": look.theme.lines[1], "linestyle": "none", **options}
            size = look.points(size)
            axes.plot(x[there], y[there], sign, markersize=size, label=label, **options)


def _draw_plane(
    axes: "Axes",
    found: Map,
    what: str,
    unit: figures.AxisScale,
    look: figures.Look,
) -> None:
    """Draw values over two coordinates, as cells of a grid or as dots."""
    places = found.places - _origin(found)
    along = figures.choose_scale(figures.largest(places), found.units[0])
    places = along.factor * places
    x, y = places.T
    values = unit.factor * getattr(found, what)
    name, colours = (
        (found.name, figures.VALUES) if what == "value" else ("its standard error", figures.ERRORS)
    )
    label = unit.label(name)
    figures.draw_field(axes, places, values, ~found.mistrusted, label, look, colours=colours)
    _mark(axes, x, y, np.isfinite(values), found, look)
    if _to_scale(found):
        axes.set_aspect("equal", adjustable="box")
    axes.grid(False)
    labels = [f"{axis} [{along.unit}]" if along.unit else axis for axis in found.axes]
    axes.set(xlabel=labels[0], ylabel=labels[1])
    figures.head(axes, name.capitalize())


def _origin(found: Map) -> Floats:
    """Return the origin to subtract: the zero of a stage may be far from the places."""
    low = found.places.min(axis=0)
    high = found.places.max(axis=0)
    far = np.abs(found.places).max(axis=0) > 20.0 * np.maximum(high - low, 1e-12)
    origin: Floats = np.where(far & (np.array(found.units) == "m"), low, 0.0)
    return origin
