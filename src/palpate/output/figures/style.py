"""Style, size and file formats of figures."""

import io
import math
import re
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.digits import PLAIN
from palpate.errors import MissingExtraError, RecordingError
from palpate.method.contact import Contact
from palpate.output.results.colours import DARK, LIGHT, Theme
from palpate.validation import Floats, frozen, number_in
from palpate.writing import check_writable, write_bytes

try:
    import matplotlib
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.ticker import ScalarFormatter
except ImportError:
    raise MissingExtraError.named("a figure", "matplotlib", "figures") from None


# Mean width of a letter of DejaVu Sans over its size, with a margin. matplotlib itself wraps
# at the edge of a figure, not of a panel.
_LETTER = 0.62


def wrap_text(words: str, width: float, size: float, lines: int) -> str:
    """Break a sentence into lines of limited width; text beyond the last line becomes ….

    Parameters
    ----------
    words : str
        A sentence.
    width, size : float
        Width of a line and size of the letters, points.
    lines : int
        Maximum number of lines.
    """
    letters = max(int(width / (_LETTER * size)), 8)
    rows = textwrap.wrap(words, letters, max_lines=lines, placeholder=" …", break_on_hyphens=False)
    return "\n".join(rows)


# Printed width of a figure, and the resulting letter size.

INCH = 25.4e-3
#: Limits of the width, m: below, five ticks of an axis touch; no paper is wider.
NARROWEST = 60e-3
WIDEST = 400e-3
# A journal's column is 84 to 90 mm wide, its page 170 to 190 mm. In narrower figures than this, the
# panels stand one below the other.
_ONE_COLUMN = 140e-3
# Up to this width a figure has no title and no caption: a journal sets them below it. A hair above
# 0.1, since 100 mm need not be that to the last bit.
_PLAIN_WIDTH = 0.1001
# Letters of a figure as wide as a page, and the smallest that journals print, points.
_LARGEST = 9.5
_SMALLEST = 7.0


@frozen
class Look:
    """Colours and width of a figure, and sizes that depend on the width.

    Parameters
    ----------
    theme : Theme
        Colours.
    width : float
        Printed width, m. Default: 11 inches.
    """

    theme: Theme
    width: float = 11.0 * INCH

    @property
    def inches(self) -> float:
        """Width, inches."""
        return self.width / INCH

    @property
    def font(self) -> float:
        """Letter size, points: scales with the width within a readable range."""
        return min(max(_LARGEST * self.inches / 11.0, _SMALLEST), _LARGEST)

    @property
    def scale(self) -> float:
        """Ratio of letters, lines and heights to those at full width."""
        return self.font / _LARGEST

    @property
    def narrow(self) -> bool:
        """Whether the panels stand one below the other."""
        return self.width < _ONE_COLUMN

    @property
    def plain(self) -> bool:
        """Whether the figure has no title and no caption."""
        return self.width <= _PLAIN_WIDTH

    def points(self, size: float) -> float:
        """Return a line width or marker size, scaled from points at full width."""
        return size * self.scale

    def dot(self, marker: float, line: float, cap: float) -> dict[str, Any]:
        """Return ``errorbar`` options for a dot and its bar; sizes in points at full width."""
        sizes = {"markersize": marker, "elinewidth": line, "capsize": cap}
        return {"fmt": "o", **{name: self.points(size) for name, size in sizes.items()}}

    def colour(self, row: int) -> str:
        """Return the colour of a line by its index; colours repeat after the last."""
        return self.theme.lines[row % len(self.theme.lines)]


#: Dashes tell lines apart in grey too.
LINE_STYLES = ("-", "--", "-.", ":")


def choose_look(*, dark: bool = False, width: float | None = None) -> Look:
    """Return the look for a theme and a width, m (default: 11 inches).

    Raises
    ------
    InvalidParameterError
        The width is outside its range.
    """
    theme = DARK if dark else LIGHT
    return (
        Look(theme) if width is None else Look(theme, number_in("width", width, NARROWEST, WIDEST))
    )


def set_titles(
    figure: Figure,
    look: Look,
    title: list[str],
    caption: str = "",
    *,
    lines: int = 2,
) -> None:
    """Write a title, each sentence on a new line, and a caption below; none in a plain figure."""
    if look.plain:
        return
    large = 1.1 * look.font
    small = 0.93 * look.font
    # Rasterised letters are up to 4 % wider than those of the font.
    width = 0.96 * (72.0 * look.inches - 2.0 * look.font)
    text = "\n".join(wrap_text(each, width, large, lines) for each in title if each)
    figure.suptitle(text, fontsize=large, parse_math=False)  # a file's name may hold a $
    if caption:
        figure.supxlabel(wrap_text(caption, width, small, 9), fontsize=small)
    # Leaves room for the number of a tick at the right end.
    margin = look.font / (72.0 * look.inches)
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0 - margin, 1.0))


def head(axes: Axes, title: str, *, legend: bool = True) -> None:
    """Write the title of a panel, with its legend between title and panel."""
    handles, labels = axes.get_legend_handles_labels() if legend else ([], [])
    _write_numbers_out(axes)
    size = float(axes.title.get_fontsize())
    room = _room(axes, size)
    columns = max(len(labels), 1)
    while columns > 1 and _legend_width(labels, columns, size) > room:
        columns -= 1
    rows = -(-len(labels) // columns)
    if not rows and (present := axes.get_legend()) is not None:
        present.remove()
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
    # 1.4 letter heights per legend row: 1.16 of a line of DejaVu Sans, and the spacing.
    pad = 0.4 * size + 1.4 * rows * size
    words = wrap_text(title, room, size, 3)
    # y=1.0 saves matplotlib from measuring all ticks to place the title above them.
    axes.set_title(words, loc="left", pad=pad, y=1.0, fontsize=size, parse_math=False)


def _write_numbers_out(axes: Axes) -> None:
    """Write ticks without a common power of ten; the unit contains it where needed."""
    for axis in (axes.xaxis, axes.yaxis):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, ScalarFormatter):
            formatter.set_scientific(False)


def stack(panels: Sequence[Axes]) -> None:
    """Give stacked panels one common abscissa, labelled below the last."""
    low = min(axes.get_xlim()[0] for axes in panels)
    high = max(axes.get_xlim()[1] for axes in panels)
    for axes in panels:
        axes.set_xlim(low, high)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
        axes.set_xlabel("")


def _room(axes: Axes, size: float) -> float:
    """Return the width of a panel, points, without the ticks and label of its axis."""
    place = axes.get_subplotspec()
    figure = axes.figure
    part = 1.0
    if place is not None:
        grid = place.get_gridspec()
        ratios = np.asarray(grid.get_width_ratios(), dtype=np.float64)
        part = float(ratios[list(place.colspan)].sum() / ratios.sum())
    return max(part * figure.bbox.width * 72.0 / figure.dpi - 6.0 * size, 8.0 * size)


def _legend_width(labels: list[str], columns: int, size: float) -> float:
    """Return the width of a legend, points: 3.2 letters per column for handle and spacing."""
    widest = [max(map(len, labels[i::columns])) for i in range(columns) if labels[i::columns]]
    return sum(_LETTER * size * letters + 3.2 * size for letters in widest)


# Style and file formats.

# File endings. Without dates or random names, the same result gives the same file.
_FORMATS: dict[str, dict[str, None] | None] = {
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
    ".png": None,
}


# Matplotlib includes the first, so figures have the same layout everywhere. An SVG viewer without
# it uses one of the others: the second has the same widths, the rest are narrower.
_FONTS = ["DejaVu Sans", "Verdana", "Helvetica", "Arial"]


# Text stays text in SVG and PDF (type 42 can be searched and edited). Ids within a file are not
# random. Journals require 300 dots per inch; matplotlib's own settings may state another value.
_WRITTEN: dict[Any, Any] = {
    "font.sans-serif": _FONTS,
    "svg.fonttype": "none",
    "svg.hashsalt": "palpate",
    "pdf.fonttype": 42,
}
_DOTS_AN_INCH = 300
_DECIMALS = re.compile(rb"(\.\d\d)\d+")
_FONT = re.compile(rb"font-family: [^;\"]*; ?")
#: White space between elements; text is on one line with its element.
_INDENT = re.compile(rb">\n\s*<")


@contextmanager
def figure_style(look: Look) -> Iterator[type[Figure]]:
    """Apply matplotlib settings for one figure, and restore the previous ones afterwards."""
    theme = look.theme
    scale = look.scale
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
        "legend.fontsize": look.font,
        "lines.linewidth": 1.3 * scale,
        "font.family": "sans-serif",
        "font.sans-serif": _FONTS,
        "font.size": look.font,
    }
    with matplotlib.rc_context(settings):
        yield Drawn


@contextmanager
def drawing(look: Look, height: float) -> Iterator[Figure]:
    """Create a figure of a look within its settings; height in inches at full width."""
    with figure_style(look) as new_figure:
        yield new_figure(figsize=(look.inches, height * look.scale), layout="constrained")


def save(figure: Figure, path: str | Path, inputs: Sequence[Path] = ()) -> None:
    """Write a figure atomically; the ending of ``path`` selects the format.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        For example from :func:`palpate.output.figures.draw`.
    path : str or Path
        File name that ends in .svg, .pdf or .png.
    inputs : sequence of Path
        Files that must not be overwritten, such as the recording.

    Raises
    ------
    RecordingError
        The path is not writable or has another ending.
    """
    path = Path(path)
    write_bytes(path, _as_bytes(figure, _image_format(path)), inputs)


def check_figure(path: Path, inputs: Sequence[Path] = ()) -> None:
    """Check before any work that a figure can be written.

    Raises
    ------
    RecordingError
        As for :func:`save`, or the figure would replace one of the ``inputs``.
    """
    _image_format(path)
    check_writable(path, inputs)


def as_svg(figure: Figure) -> str:
    """Return a figure as the SVG that :func:`save` writes."""
    return _as_bytes(figure, ".svg").decode("utf-8")


def recolour_for_dark(svg: str) -> str:
    """Return a light-theme SVG with the colours of the dark theme."""
    dark = dict(zip(LIGHT.variables().values(), DARK.variables().values(), strict=True))
    return re.sub(r"#[0-9a-f]{6}\b", lambda colour: dark.get(colour[0], colour[0]), svg)


def _as_bytes(figure: Figure, ending: str) -> bytes:
    rendered = io.BytesIO()
    with matplotlib.rc_context(_WRITTEN), warnings.catch_warnings():
        # Glyphs that the font lacks are drawn as boxes; axes up to 1e308 overflow.
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        warnings.filterwarnings("ignore", "overflow encountered", RuntimeWarning)
        dots = matplotlib.rcParams["savefig.dpi"]
        dots = _DOTS_AN_INCH if dots == "figure" else dots
        if ending == ".svg":
            return _render_svg(figure, dots)
        figure.savefig(
            rendered,
            format=ending[1:],
            dpi=dots,
            facecolor=figure.get_facecolor(),
            metadata=_FORMATS[ending],
        )
    return rendered.getvalue()


def _render_svg(figure: Figure, dots: float) -> bytes:
    """Return an SVG, drawn once; ``savefig`` would draw the figure twice.

    Paths are rounded to 0.01 points, which is invisible; matplotlib writes 1e-6.
    """
    rendered = io.BytesIO()
    shown = figure.canvas
    dpi = figure.dpi
    try:
        figure.dpi = dots  # of images
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(rendered, metadata=_FORMATS[".svg"])
    finally:
        figure.dpi = dpi
        figure.set_canvas(shown)
    text = _INDENT.sub(b"><", rendered.getvalue())
    fonts = set(_FONT.findall(text))
    common = b""
    if len(fonts) == 1:  # said once, for all of the text
        text = _FONT.sub(b"", text)
        common = fonts.pop().strip()
    text = text.replace(b"<svg ", b'<svg style="' + common + b'" ', 1)
    return re.sub(rb' (?:x|y|d)="[^"]*"', lambda place: _DECIMALS.sub(rb"\1", place[0]), text)


def _image_format(path: Path) -> str:
    ending = path.suffix.lower()
    if ending not in _FORMATS:
        raise RecordingError(f"{path}: a figure's name must end in .svg, .pdf or .png")
    return ending


# Unit prefixes for readable numbers.

_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f"}
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@frozen
class AxisScale:
    """Factor from SI values to drawn values, and the unit of the drawn values.

    Parameters
    ----------
    factor : float
        Ratio of drawn value to SI value.
    unit : str
        Unit of the drawn value.
    """

    factor: float
    unit: str

    def label(self, name: str) -> str:
        """Return an axis label with the unit."""
        return f"{name} [{self.unit}]" if self.unit else name


def choose_scale(largest: float, unit: str) -> AxisScale:
    """Choose a unit in which the largest value is from 1 to below 1000.

    Parameters
    ----------
    largest : float
        Largest absolute value, SI.
    unit : str
        SI unit. Units other than m, m/s and those that begin with N stay unchanged.
    """
    if not (math.isfinite(largest) and largest > 0.0) or unit[:1] not in ("N", "m"):
        return AxisScale(1.0, unit)
    power = 3 * math.floor(math.log10(largest * (1.0 + 1e-9)) / 3.0)
    if unit.startswith("m"):
        power = min(power, 0)  # no kilometres of penetration
    if power in _PREFIXES:
        return AxisScale(10.0**-power, _PREFIXES[power] + unit)
    if abs(power) > 300:  # its inverse would not be finite
        return AxisScale(1.0, unit)
    return AxisScale(10.0**-power, f"10{str(power).translate(_POWERS)} {unit}")


def scale_as_written(value: float, unit: str) -> AxisScale:
    """Choose the power of ten with which :func:`palpate.digits.with_error` writes a value."""
    power = math.floor(math.log10(abs(value))) if math.isfinite(value) and value else 0
    if power in PLAIN or abs(power) > 300:
        return AxisScale(1.0, unit)
    return AxisScale(10.0**-power, f"10{str(power).translate(_POWERS)} {unit}".strip())


def largest(values: Floats) -> float:
    """Return the largest finite absolute value; 0 without any."""
    size = np.abs(values)
    return float(np.max(size, where=np.isfinite(size), initial=0.0))


# Notebooks show only figures of pyplot by themselves; this class is shown too.


class Drawn(Figure):
    """matplotlib's figure with an SVG view for notebooks."""

    def _repr_svg_(self) -> str:
        svg = as_svg(self)
        # At most as wide as the cell.
        return svg[svg.index("<svg") :].replace(
            '<svg style="',
            '<svg style="max-width:100%;height:auto;',
            1,
        )


# Fewer points with the same look: a line of all samples makes a large file.

#: Most points of a line; more are not visible.
MOST_POINTS = 1000
# Least samples per piece of a band, and most pieces.
_FEWEST = 8
_PIECES = 150
_BINS = 50
#: Lines are not broken at more gaps than this, because each piece is a path in the file.
MOST_GAPS = 60
#: Percentiles that a band of samples spans, and its half width in standard deviations if normal.
BAND = (10.0, 90.0)
BAND_DEVIATIONS = 1.2816


def clock(contact: Contact) -> tuple[Floats, str]:
    """Return the time axis and its label; segments with overlapping clocks are concatenated."""
    if contact.timeless:
        return np.arange(len(contact), dtype=float), "sample"
    if np.all(np.diff(contact.time) > 0.0):
        return contact.time, "time [s]"
    return np.cumsum(contact.time_steps), "time, contacts concatenated [s]"


def shown(contact: Contact, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return the indices of the samples to draw."""
    return few(np.arange(len(contact)), most)


def few(index: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """Return at most ``most`` of some samples, evenly spaced."""
    return index[:: max(-(-index.size // most), 1)]


def broken(values: Floats, contact: Contact, keep: NDArray[np.intp]) -> Floats:
    """Return the values to draw, with NaN where another contact begins."""
    rendered = np.array(values[keep], dtype=np.float64)
    rendered[1:][np.diff(contact.segment[keep]) != 0] = np.nan
    return rendered


@frozen(eq=False)
class Scatter:
    """Distribution of samples along an axis: median and percentiles of consecutive pieces.

    Attributes
    ----------
    place, low, middle, high : numpy.ndarray
        Median abscissa, and percentiles of the ordinate, per piece; NaN where a line breaks.
    """

    place: Floats
    low: Floats
    middle: Floats
    high: Floats


def scatter_over_time(
    time: Floats,
    values: Floats,
    contact: Contact,
    keep: NDArray[np.bool_],
) -> Scatter:
    """Return the scatter of samples over time, broken between contacts."""
    index = np.flatnonzero(keep & np.isfinite(values))
    each = max(-(-index.size // _PIECES), _FEWEST)
    jump = (np.diff(index) > each) | (np.diff(contact.segment[index]) != 0)
    runs = np.split(index, np.flatnonzero(jump) + 1)
    if len(runs) > MOST_GAPS:
        runs = [index]
    rows = []
    for run in runs:
        pieces = min(max(run.size // each, 2), run.size)  # one piece makes no line
        rows += [_row(time[p], values[p]) for p in np.array_split(run, max(pieces, 1)) if p.size]
        rows.append([np.nan] * 4)
    return Scatter(*np.array(rows).T)


def over(place: Floats, values: Floats, keep: NDArray[np.bool_]) -> Scatter:
    """Return the scatter of samples over another quantity, such as depth."""
    known = keep & np.isfinite(place) & np.isfinite(values)
    x = place[known]
    y = values[known]
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
