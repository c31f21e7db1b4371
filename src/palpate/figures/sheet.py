"""How wide a figure is printed, and how large its letters are then."""

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

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
# Mean width of a letter of a sentence in DejaVu Sans, over the size of the letters.
_LETTER = 0.54


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

    def wrapped(self, words: str, *, part: float = 1.0, lines: int = 2) -> str:
        """Break a sentence into lines of a part of the width; what is too long ends with …."""
        letters = int(part * self.inches * 72.0 / (_LETTER * self.font))
        return "\n".join(
            textwrap.wrap(words, max(letters, 10), max_lines=lines, placeholder=" …") or [""]
        )


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
    """Write a title, each of its sentences on a line of its own, and a caption below."""
    # Names of files may hold a $, which is no formula.
    words = "\n".join(sheet.wrapped(each, lines=lines) for each in title if each)
    figure.suptitle(words, fontsize=1.1 * sheet.font, parse_math=False)
    if caption:
        below = sheet.wrapped(caption, lines=6)
        figure.supxlabel(below, fontsize=0.93 * sheet.font, parse_math=False)


def head(axes: "Axes", title: str, *, columns: int = 4) -> None:
    """Write the title of a panel, and its legend between title and panel, where no data are."""
    handles, labels = axes.get_legend_handles_labels()
    rows = -(-len(labels) // columns)
    size = float(axes.title.get_fontsize())
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
    axes.set_title(title, loc="left", pad=pad, fontsize=size, parse_math=False)
