"""How figures look, and how they are written."""

import io
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.errors import MissingExtraError, RecordingError
from palpate.figures.sheet import PAGE, Sheet
from palpate.writing import check_writable, write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of Okabe & Ito, distinct for colour-blind readers too, for one background."""

    background: str
    ink: str
    grid: str
    measured: str
    lines: tuple[str, ...]

    def variables(self) -> dict[str, str]:
        """Each colour by the name that a page's style sheet has for it."""
        named = {"background": self.background, "ink": self.ink, "grid": self.grid}
        named |= {"measured": self.measured}
        named |= {f"line-{k}": colour for k, colour in enumerate(self.lines)}
        return {f"--drawing-{name}": colour for name, colour in named.items()}


LIGHT = Theme(
    "#ffffff",
    "#1a1a1a",
    "#dddddd",
    "#8c8c8c",
    ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a6761d", "#332288", "#5a6b00"),
)
DARK = Theme(
    "#16181c",
    "#e8e8e8",
    "#3a3d44",
    "#9a9a9a",
    ("#56b4e9", "#e69f00", "#2fc99a", "#e39ac3", "#c9b458", "#a89bff", "#9fb33c"),
)


class style:  # noqa: N801 - reads as a statement
    """Matplotlib's settings for one figure, put back afterwards."""

    def __init__(self, theme: Theme, sheet: Sheet = PAGE) -> None:
        try:
            import matplotlib

            from palpate.figures.drawn import Drawn
        except ImportError:
            raise MissingExtraError(
                "figures need matplotlib: pip install 'palpate[figures]'"
            ) from None
        self._new_figure = Drawn
        font, scale = sheet.font, sheet.scale
        self._context = matplotlib.rc_context(
            {
                "figure.facecolor": theme.background,
                "axes.facecolor": theme.background,
                "axes.edgecolor": theme.ink,
                "axes.labelcolor": theme.ink,
                "text.color": theme.ink,
                "xtick.color": theme.ink,
                "ytick.color": theme.ink,
                "grid.color": theme.grid,
                "axes.grid": True,
                "axes.spines.top": False,
                "axes.spines.right": False,
                "axes.axisbelow": True,
                "axes.titlesize": 10.0 * scale,
                "axes.formatter.useoffset": False,
                "axes.formatter.limits": (-3, 4),
                "legend.frameon": False,
                "legend.fontsize": 9.0 * scale,
                "lines.linewidth": 1.3 * scale,
                "axes.linewidth": 0.8 * scale,
                "grid.linewidth": 0.8 * scale,
                "font.family": "sans-serif",
                "font.sans-serif": _FONTS,
                "font.size": font,
            }
        )

    def __enter__(self) -> type["Figure"]:
        self._context.__enter__()
        return self._new_figure

    def __exit__(self, *error: Any) -> None:
        self._context.__exit__(*error)


def save(figure: "Figure", path: str | Path, inputs: Sequence[Path] = ()) -> None:
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
    MissingExtraError
        matplotlib is not installed.
    RecordingError
        As :func:`save`, or the figure would replace one of the ``inputs``.
    """
    style(LIGHT)
    _format_of(path)
    check_writable(path, inputs)


def as_svg(figure: "Figure") -> str:
    """Return a figure as SVG, the same as :func:`save` writes."""
    return _as_bytes(figure, ".svg").decode("utf-8")


def recoloured(svg: str) -> str:
    """Return an SVG drawn for a light background in the colours for a dark one."""
    dark = dict(zip(LIGHT.variables().values(), DARK.variables().values(), strict=True))
    return re.sub(r"#[0-9a-f]{6}\b", lambda colour: dark.get(colour[0], colour[0]), svg)


def _as_bytes(figure: "Figure", ending: str) -> bytes:
    import matplotlib

    drawn = io.BytesIO()
    with matplotlib.rc_context(_WRITTEN), warnings.catch_warnings():
        # A name in a script that the font lacks is drawn as boxes, and axes to 1e308 overflow.
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        warnings.filterwarnings("ignore", "overflow encountered", RuntimeWarning)
        dots = matplotlib.rcParams["savefig.dpi"]
        figure.savefig(
            drawn,
            format=ending[1:],
            dpi=_DOTS_AN_INCH if dots == "figure" else dots,
            facecolor=figure.get_facecolor(),
            metadata=_FORMATS[ending],
        )
    return _rounded(drawn.getvalue()) if ending == ".svg" else drawn.getvalue()


def _rounded(svg: bytes) -> bytes:
    """Paths to a hundredth of a point, which nobody sees: matplotlib writes a millionth."""
    return re.sub(rb' d="[^"]*"', lambda path: _DECIMALS.sub(rb"\1", path[0]), svg)


def _format_of(path: Path) -> str:
    ending = path.suffix.lower()
    if ending not in _FORMATS:
        raise RecordingError(f"{path}: a figure's name must end in .svg, .pdf or .png")
    return ending
