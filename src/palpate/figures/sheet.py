"""How wide a figure is printed, and how large its letters are then."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from palpate.figures.letters import width_of, wrapped
from palpate.validation import number_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INCH = 25.4e-3
#: Limits of a width, m: below, five ticks of an axis touch; above, no paper is as wide.
NARROWEST, WIDEST = 60e-3, 400e-3
# A journal's column is 84 to 90 mm wide, its page 170 to 190 mm: narrower than this, panels stand
# one below the other.
_ONE_COLUMN = 140e-3
# Letters of a page, and the smallest that journals print, in points.
_LARGEST, _SMALLEST = 9.5, 7.0


@dataclass(frozen=True, slots=True)
class Sheet:
    """The width of a figure, and what follows from it.

    Parameters
    ----------
    width : float
        As it is printed, m.
    """

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

    def size(self, height: float) -> tuple[float, float]:
        """Width and height of a figure that is so many inches high on a page."""
        return self.inches, height * self.scale


PAGE = Sheet()


def sheet_of(width: float | None) -> Sheet:
    """Return the sheet of a width, m; a page unless given.

    Raises
    ------
    InvalidParameterError
        It is out of its range.
    """
    return PAGE if width is None else Sheet(number_in("width", width, NARROWEST, WIDEST))


def set_titles(
    figure: "Figure", sheet: Sheet, title: list[str], caption: str = "", *, lines: int = 2
) -> None:
    """Write a title, each of its sentences from a line of its own on, and a caption below."""
    large, small = 1.1 * sheet.font, 0.93 * sheet.font
    # Letters on a grid of pixels are up to 4 % wider than those of the font.
    width = 0.96 * (72.0 * sheet.inches - 2.0 * sheet.font)
    words = "\n".join(wrapped(each, width, large, lines) for each in title if each)
    figure.suptitle(words, fontsize=large, parse_math=False)  # a file's name may hold a $
    if caption:
        figure.supxlabel(wrapped(caption, width, small, 9), fontsize=small)
    # A tick that comes up at the right end when panels have their width has room for its number.
    margin = sheet.font / (72.0 * sheet.inches)
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0 - margin, 1.0))


def head(axes: "Axes", title: str, *, legend: bool = True) -> None:
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
    axes.set_title(words, loc="left", pad=pad, fontsize=size, parse_math=False)


def _write_numbers_out(axes: "Axes") -> None:
    """Let ticks have no power of ten beside the axis: the unit has it, where one is needed."""
    from matplotlib.ticker import ScalarFormatter

    for axis in (axes.xaxis, axes.yaxis):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, ScalarFormatter):
            formatter.set_scientific(False)


def stack(panels: "Sequence[Axes]") -> None:
    """Let panels one below the other have one abscissa, with its numbers below the last."""
    low = min(axes.get_xlim()[0] for axes in panels)
    high = max(axes.get_xlim()[1] for axes in panels)
    for axes in panels:
        axes.set_xlim(low, high)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
        axes.set_xlabel("")


def _room(axes: "Axes", size: float) -> float:
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
