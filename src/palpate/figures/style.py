"""How figures look, how large they are, and how they are written."""

import functools
import io
import math
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.digits import PLAIN
from palpate.errors import MissingExtraError, RecordingError
from palpate.results.colours import DARK, LIGHT, Theme
from palpate.validation import Floats, number_in
from palpate.writing import check_writable, write_bytes

try:
    import matplotlib
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path
    from matplotlib.ticker import ScalarFormatter
except ImportError:
    raise MissingExtraError("figures need matplotlib: pip install 'palpate[figures]'") from None


def wrapped(words: str, width: float, size: float, lines: int) -> str:
    """Break a sentence into lines of at most a width; what is left over becomes ….

    Parameters
    ----------
    words : str
        A sentence.
    width, size : float
        Of a line and of the letters, points.
    lines : int
        At most so many.
    """
    rows = [""]
    for word in words.split(" "):  # not at a no-break space, as split() would
        longer = f"{rows[-1]} {word}".strip()
        if width_of(longer, size) <= width:
            rows[-1] = longer
            continue
        pieces = _broken(word, width, size)
        rows = [*rows, *pieces] if rows[-1] else pieces
    if len(rows) <= lines:
        return "\n".join(rows)
    last = rows[lines - 1]
    while last and width_of(f"{last} …", size) > width:
        last = last[:-1]
    return "\n".join([*rows[: lines - 1], f"{last.rstrip(' ,;:')} …"])


def width_of(words: str, size: float) -> float:
    """Width of a line in letters of a size, points."""
    fonts = matplotlib.rcParams["font.family"], matplotlib.rcParams["font.sans-serif"]
    return _width_in((*fonts[0], *fonts[1]), words, size)


@functools.lru_cache(4096)  # a page's figures share most of their words
def _width_in(fonts: tuple[str, ...], words: str, size: float) -> float:
    """Width of a line in the fonts that matplotlib is set to."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")  # it has some width
        found = text_to_path.get_text_width_height_descent(words, FontProperties(size=size), False)
    return float(found[0])


def _broken(word: str, width: float, size: float) -> list[str]:
    """A word, such as the name of a file, that is wider than a line, in pieces."""
    pieces = [""]
    for letter in word:
        if pieces[-1] and width_of(pieces[-1] + letter, size) > width:
            pieces.append("")
        pieces[-1] += letter
    return pieces


# How wide a figure is printed, and how large its letters are then.

INCH = 25.4e-3
#: Limits of a width, m: below, five ticks of an axis touch; above, no paper is as wide.
NARROWEST, WIDEST = 60e-3, 400e-3
# A journal's column is 84 to 90 mm wide, its page 170 to 190 mm: narrower than this, panels stand
# one below the other.
_ONE_COLUMN = 140e-3
# Letters of a page, and the smallest that journals print, in points.
_LARGEST, _SMALLEST = 9.5, 7.0


@dataclass(frozen=True, slots=True)
class Look:
    """Colours and width of a figure, and what follows from the width.

    Parameters
    ----------
    theme : Theme
        Colours.
    width : float
        As it is printed, m; a page unless given.
    """

    theme: Theme
    width: float = 11.0 * INCH

    @property
    def inches(self) -> float:
        """The width, in."""
        return self.width / INCH

    @property
    def font(self) -> float:
        """Size of the letters, points: those of a page, scaled, but never too small to read."""
        return min(max(_LARGEST * self.inches / 11.0, _SMALLEST), _LARGEST)

    @property
    def scale(self) -> float:
        """Size of letters, lines and heights over that of a page."""
        return self.font / _LARGEST

    @property
    def narrow(self) -> bool:
        """Whether panels stand one below the other."""
        return self.width < _ONE_COLUMN

    def points(self, size: float) -> float:
        """Width of a line, or size of a marker, that has so many points on a page."""
        return size * self.scale

    def dot(self, marker: float, line: float, cap: float) -> dict[str, Any]:
        """What ``errorbar`` takes for a dot and its bar, of such sizes in points on a page."""
        sizes = {"markersize": marker, "elinewidth": line, "capsize": cap}
        return {"fmt": "o", **{name: self.points(size) for name, size in sizes.items()}}

    def colour(self, row: int) -> str:
        """Colour of a line among others; there are so many that few begin again."""
        return self.theme.lines[row % len(self.theme.lines)]


def look_of(*, dark: bool, width: float | None) -> Look:
    """Return the look that a caller asks for; a page unless a width, m, is given.

    Raises
    ------
    InvalidParameterError
        The width is out of its range.
    """
    theme = DARK if dark else LIGHT
    return (
        Look(theme) if width is None else Look(theme, number_in("width", width, NARROWEST, WIDEST))
    )


def set_titles(
    figure: Figure, look: Look, title: list[str], caption: str = "", *, lines: int = 2
) -> None:
    """Write a title, each of its sentences from a line of its own on, and a caption below."""
    large, small = 1.1 * look.font, 0.93 * look.font
    # Letters on a grid of pixels are up to 4 % wider than those of the font.
    width = 0.96 * (72.0 * look.inches - 2.0 * look.font)
    words = "\n".join(wrapped(each, width, large, lines) for each in title if each)
    figure.suptitle(words, fontsize=large, parse_math=False)  # a file's name may hold a $
    if caption:
        figure.supxlabel(wrapped(caption, width, small, 9), fontsize=small)
    # A tick that comes up at the right end when panels have their width has room for its number.
    margin = look.font / (72.0 * look.inches)
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0 - margin, 1.0))


def head(axes: Axes, title: str, *, legend: bool = True) -> None:
    """Write the title of a panel, and its legend between title and panel, where no data are."""
    handles, labels = axes.get_legend_handles_labels() if legend else ([], [])
    _write_numbers_out(axes)
    size = float(axes.title.get_fontsize())
    room = _room(axes, size)
    columns = max(len(labels), 1)
    while columns > 1 and _legend_width(labels, columns, size) > room:
        columns -= 1
    rows = -(-len(labels) // columns)
    if rows:
        axes.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns,
            borderaxespad=0.0,
            borderpad=0.2,
            labelspacing=0.2,
            handlelength=1.5,
            handletextpad=0.5,
            columnspacing=1.2,
        )
    # 1.4 letters a row of the legend: the 1.16 of a line of DejaVu Sans and what is between.
    pad = 0.4 * size + 1.4 * rows * size
    words = wrapped(title, room, size, 3)
    # Where it stands: matplotlib would measure all ticks to find that it is above none.
    axes.set_title(words, loc="left", pad=pad, y=1.0, fontsize=size, parse_math=False)


def _write_numbers_out(axes: Axes) -> None:
    """Let ticks have no power of ten beside the axis: the unit has it, where one is needed."""
    for axis in (axes.xaxis, axes.yaxis):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, ScalarFormatter):
            formatter.set_scientific(False)


def stack(panels: Sequence[Axes]) -> None:
    """Let panels one below the other have one abscissa, with its numbers below the last."""
    low = min(axes.get_xlim()[0] for axes in panels)
    high = max(axes.get_xlim()[1] for axes in panels)
    for axes in panels:
        axes.set_xlim(low, high)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
        axes.set_xlabel("")


def _room(axes: Axes, size: float) -> float:
    """Width of a panel, points: its part of the figure, without ticks and label of its axis."""
    place, figure = axes.get_subplotspec(), axes.figure
    part = 1.0
    if place is not None:
        grid = place.get_gridspec()
        ratios = np.asarray(grid.get_width_ratios(), dtype=np.float64)
        part = float(ratios[list(place.colspan)].sum() / ratios.sum())
    return max(part * figure.bbox.width * 72.0 / figure.dpi - 6.0 * size, 8.0 * size)


def _legend_width(labels: list[str], columns: int, size: float) -> float:
    """Width of a legend, points: 3.2 letters a column for a handle and what is between."""
    widest = [
        max(width_of(label, size) for label in labels[i::columns])
        for i in range(columns)
        if labels[i::columns]
    ]
    return sum(widest) + 3.2 * size * len(widest)


# How figures look, and how they are written.

# Endings of figures. Without a date or random names, the same result gives the same file.
_FORMATS: dict[str, dict[str, None] | None] = {
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
    ".png": None,
}


# Matplotlib brings the first, so that a figure is laid out alike everywhere. Who opens an SVG
# without it sees one of the others: the second has the same widths, the rest are narrower.
_FONTS = ["DejaVu Sans", "Verdana", "Helvetica", "Arial"]


# Text stays text, in SVG and in PDF, where type 42 can be searched and edited. Names within a file
# are not random. Journals ask for 300 dots an inch; matplotlib's own settings may name others.
_WRITTEN: dict[Any, Any] = {
    "font.sans-serif": _FONTS,
    "svg.fonttype": "none",
    "svg.hashsalt": "palpate",
    "pdf.fonttype": 42,
}
_DOTS_AN_INCH = 300
_DECIMALS = re.compile(rb"(\.\d\d)\d+")


@contextmanager
def style(look: Look) -> Iterator[type[Figure]]:
    """Matplotlib's settings for one figure, put back afterwards."""
    theme, scale = look.theme, look.scale
    inked = ("axes.edgecolor", "axes.labelcolor", "text.color", "xtick.color", "ytick.color")
    settings: dict[Any, Any] = {
        **dict.fromkeys(inked, theme.ink),
        **dict.fromkeys(("figure.facecolor", "axes.facecolor"), theme.background),
        **dict.fromkeys(("axes.linewidth", "grid.linewidth"), 0.8 * scale),
        **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
        "grid.color": theme.grid,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.titlesize": 10.0 * scale,
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-3, 4),
        "legend.frameon": False,
        "legend.fontsize": 9.0 * scale,
        "lines.linewidth": 1.3 * scale,
        "font.family": "sans-serif",
        "font.sans-serif": _FONTS,
        "font.size": look.font,
    }
    with matplotlib.rc_context(settings):
        yield Drawn


@contextmanager
def drawing(look: Look, height: float) -> Iterator[Figure]:
    """A figure of a look, so many inches high on a page, in matplotlib's settings for it."""
    with style(look) as new_figure:
        yield new_figure(figsize=(look.inches, height * look.scale), layout="constrained")


def save(figure: Figure, path: str | Path, inputs: Sequence[Path] = ()) -> None:
    """Write a figure whole or not at all; the ending of ``path`` chooses the format.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        For instance of :func:`palpate.figures.draw`.
    path : str or Path
        Ends in .svg, .pdf or .png.
    inputs : sequence of Path
        Files that must not be written over, such as the recording that is drawn.

    Raises
    ------
    RecordingError
        The path cannot be written, or has another ending.
    """
    path = Path(path)
    write_bytes(path, _as_bytes(figure, _format_of(path)), inputs)


def check_figure(path: Path, inputs: Sequence[Path] = ()) -> None:
    """Say now, before work is done, that a figure could not be drawn or written.

    Raises
    ------
    RecordingError
        As :func:`save`, or the figure would replace one of the ``inputs``.
    """
    _format_of(path)
    check_writable(path, inputs)


def as_svg(figure: Figure) -> str:
    """Return a figure as SVG, the same as :func:`save` writes."""
    return _as_bytes(figure, ".svg").decode("utf-8")


def recoloured(svg: str) -> str:
    """Return an SVG drawn for a light background in the colours for a dark one."""
    dark = dict(zip(LIGHT.variables().values(), DARK.variables().values(), strict=True))
    return re.sub(r"#[0-9a-f]{6}\b", lambda colour: dark.get(colour[0], colour[0]), svg)


def _as_bytes(figure: Figure, ending: str) -> bytes:
    rendered = io.BytesIO()
    with matplotlib.rc_context(_WRITTEN), warnings.catch_warnings():
        # A name in a script that the font lacks is drawn as boxes, and axes to 1e308 overflow.
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        warnings.filterwarnings("ignore", "overflow encountered", RuntimeWarning)
        dots = matplotlib.rcParams["savefig.dpi"]
        dots = _DOTS_AN_INCH if dots == "figure" else dots
        if ending == ".svg":
            return _svg_of(figure, dots)
        figure.savefig(
            rendered,
            format=ending[1:],
            dpi=dots,
            facecolor=figure.get_facecolor(),
            metadata=_FORMATS[ending],
        )
    return rendered.getvalue()


def _svg_of(figure: Figure, dots: float) -> bytes:
    """An SVG, drawn once: ``savefig`` draws a figure first to lay it out, and then again.

    Paths to a hundredth of a point, which nobody sees: matplotlib writes a millionth.
    """
    rendered, shown, before = io.BytesIO(), figure.canvas, figure.dpi
    try:
        figure.dpi = dots  # of images
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(rendered, metadata=_FORMATS[".svg"])
    finally:
        figure.dpi = before
        figure.set_canvas(shown)
    return re.sub(rb' d="[^"]*"', lambda path: _DECIMALS.sub(rb"\1", path[0]), rendered.getvalue())


def _format_of(path: Path) -> str:
    ending = path.suffix.lower()
    if ending not in _FORMATS:
        raise RecordingError(f"{path}: a figure's name must end in .svg, .pdf or .png")
    return ending


# Units with the prefix that makes their numbers readable.

_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f"}
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class AxisScale:
    """What SI values are multiplied by to be drawn, and the unit of what is drawn.

    Parameters
    ----------
    factor : float
        Drawn value over SI value.
    unit : str
        Of the drawn value.
    """

    factor: float
    unit: str

    def label(self, name: str) -> str:
        """Return what an axis is called."""
        return f"{name} [{self.unit}]" if self.unit else name


def scale_of(largest: float, unit: str) -> AxisScale:
    """Choose a unit in which the largest value is from 1 to below 1000.

    Parameters
    ----------
    largest : float
        Size of the largest value, in the SI unit.
    unit : str
        N, m, m/s or what begins with N; another unit, and none, stay as they are.
    """
    if not (math.isfinite(largest) and largest > 0.0) or unit[:1] not in ("N", "m"):
        return AxisScale(1.0, unit)
    power = 3 * math.floor(math.log10(largest * (1.0 + 1e-9)) / 3.0)
    if unit.startswith("m"):
        power = min(power, 0)  # nobody counts penetration in kilometres
    if power in _PREFIXES:
        return AxisScale(10.0**-power, _PREFIXES[power] + unit)
    if abs(power) > 300:  # its inverse would not be finite
        return AxisScale(1.0, unit)
    return AxisScale(10.0**-power, f"10{str(power).translate(_POWERS)} {unit}")


def scale_as_written(value: float, unit: str) -> AxisScale:
    """Choose the power of ten that :func:`palpate.digits.with_error` writes a value with."""
    power = math.floor(math.log10(abs(value))) if math.isfinite(value) and value else 0
    if power in PLAIN or abs(power) > 300:
        return AxisScale(1.0, unit)
    return AxisScale(10.0**-power, f"10{str(power).translate(_POWERS)} {unit}".strip())


def largest(values: Floats) -> float:
    """Size of the largest value that is finite; 0 without any."""
    size = np.abs(values)
    return float(np.max(size, where=np.isfinite(size), initial=0.0))


# A figure that a notebook shows by itself: only those of pyplot are shown else.


class Drawn(Figure):
    """matplotlib's figure, in a notebook too."""

    def _repr_svg_(self) -> str:
        svg = as_svg(self)
        # As wide as the cell at most.
        return svg[svg.index("<svg") :].replace(
            "<svg", '<svg style="max-width:100%;height:auto"', 1
        )


# Fewer points that look the same: a line of all samples makes a heavy file.

#: More points than this on a line nobody sees.
MOST_POINTS = 1000
# Of a band: a piece holds so many samples at least, and there are at most so many of them.
_FEWEST = 8
_PIECES = 150
_BINS = 50
#: Where contact is lost more often than this no line is broken: each piece is a path of its own.
MOST_GAPS = 60
#: Percentiles that a band of samples spans, and how many deviations of a normal one that is.
BAND = (10.0, 90.0)
BAND_DEVIATIONS = 1.2816


def clock(contact: Contact) -> tuple[Floats, str]:
    """Time to draw against; segments whose clocks overlap are put one behind the other."""
    if np.all(np.diff(contact.time) > 0.0):
        return contact.time, "time [s]"
    return np.cumsum(contact.time_steps), "time, contacts joined [s]"


def shown(contact: Contact, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Which samples to draw."""
    return few(np.arange(len(contact)), most)


def few(index: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """Return at most so many of some samples, evenly."""
    return index[:: max(-(-index.size // most), 1)]


def broken(values: Floats, contact: Contact, keep: NDArray[np.intp]) -> Floats:
    """The values to draw, with a gap where another contact begins."""
    rendered = np.array(values[keep], dtype=np.float64)
    rendered[1:][np.diff(contact.segment[keep]) != 0] = np.nan
    return rendered


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Where samples lie: the median of each piece of them, and between which most are.

    Attributes
    ----------
    place, low, middle, high : numpy.ndarray
        Median abscissa and percentiles of the ordinate, a piece each; NaN where a line breaks.
    """

    place: Floats
    low: Floats
    middle: Floats
    high: Floats


def in_order(time: Floats, values: Floats, contact: Contact, keep: NDArray[np.bool_]) -> Scatter:
    """Scatter of samples over time, broken where another contact begins or none is."""
    index = np.flatnonzero(keep & np.isfinite(values))
    each = max(-(-index.size // _PIECES), _FEWEST)
    jump = (np.diff(index) > each) | (np.diff(contact.segment[index]) != 0)
    runs = np.split(index, np.flatnonzero(jump) + 1)
    if len(runs) > MOST_GAPS:
        runs = [index]
    rows = []
    for run in runs:
        pieces = min(max(run.size // each, 2), run.size)  # of one piece there is no line
        rows += [_row(time[p], values[p]) for p in np.array_split(run, max(pieces, 1)) if p.size]
        rows.append([np.nan] * 4)
    return Scatter(*np.array(rows).T)


def over(place: Floats, values: Floats, keep: NDArray[np.bool_]) -> Scatter:
    """Scatter of samples over another quantity, such as depth."""
    known = keep & np.isfinite(place) & np.isfinite(values)
    x, y = place[known], values[known]
    if not x.size:
        return Scatter(*np.full((4, 1), np.nan))
    count = min(max(x.size // _FEWEST, 1), _BINS)
    edges = np.linspace(x.min(), x.max(), count + 1)
    bins = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
    order = np.argsort(bins, kind="stable")
    parts = np.split(order, np.searchsorted(bins[order], np.arange(1, count)))
    rows = [_row(x[p], y[p]) if p.size >= _FEWEST else [np.nan] * 4 for p in parts]
    if not np.isfinite(rows).any():
        rows = [_row(x, y)]
    return Scatter(*np.array(rows).T)


def _row(place: Floats, values: Floats) -> list[float]:
    low, middle, high = np.percentile(values, (BAND[0], 50.0, BAND[1]))
    return [float(np.median(place)), float(low), float(middle), float(high)]
