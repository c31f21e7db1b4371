"""How figures look, and how they are written."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from palpate.errors import MissingExtraError, RecordingError
from palpate.writing import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of Okabe & Ito, told apart by colour-blind readers too, for one background."""

    background: str
    ink: str
    grid: str
    measured: str
    lines: tuple[str, ...]


LIGHT = Theme(
    "#ffffff",
    "#1a1a1a",
    "#dddddd",
    "#8c8c8c",
    ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a6761d"),
)
DARK = Theme(
    "#16181c",
    "#e8e8e8",
    "#3a3d44",
    "#9a9a9a",
    ("#56b4e9", "#e69f00", "#2fc99a", "#e39ac3", "#c9b458"),
)


class style:  # noqa: N801 - reads as a statement
    """Matplotlib's settings for one figure, put back afterwards."""

    def __init__(self, theme: Theme) -> None:
        try:
            import matplotlib
            from matplotlib.figure import Figure
        except ImportError:
            raise MissingExtraError(
                "figures need matplotlib: pip install 'palpate[figures]'"
            ) from None
        self._new_figure = Figure
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
                "axes.titlesize": 10,
                "axes.formatter.useoffset": False,
                "axes.formatter.limits": (-3, 4),
                "legend.frameon": False,
                "legend.fontsize": 9,
                "lines.linewidth": 1.3,
                "font.size": 9.5,
            }
        )

    def __enter__(self) -> type["Figure"]:
        self._context.__enter__()
        return self._new_figure

    def __exit__(self, *error: Any) -> None:
        self._context.__exit__(*error)


def save(figure: "Figure", path: str | Path) -> None:
    """Write a figure whole or not at all; the ending of ``path`` chooses the format.

    Raises
    ------
    RecordingError
        The path cannot be written, or no format has its ending.
    """
    path = Path(path)
    if not path.suffix:
        raise RecordingError(f"{path}: a figure's name must end in .svg, .pdf or .png")
    try:
        with replacing(path) as temporary:
            _write(figure, temporary, path.suffix)
    except ValueError:
        raise RecordingError(f"{path}: cannot draw {path.suffix}; use .svg, .pdf or .png") from None


def as_svg(figure: "Figure") -> str:
    """Return a figure as SVG, the same as :func:`save` writes."""
    drawn = io.BytesIO()
    _write(figure, drawn, ".svg")
    return drawn.getvalue().decode("utf-8")


def _write(figure: "Figure", target: Path | IO[bytes], ending: str) -> None:
    import matplotlib

    # Without a date or random names, the same result gives the same file.
    undated = {"Date": None} if ending == ".svg" else None
    with matplotlib.rc_context({"svg.hashsalt": "palpate"}):
        figure.savefig(
            target, format=ending[1:], facecolor=figure.get_facecolor(), metadata=undated
        )
