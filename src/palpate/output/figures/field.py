"""Values over two coordinates: cells of a grid or dots, coloured up to the peak that is trusted."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.output.figures.style import Look
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

Mask: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.intp]
#: Colours of values and of their errors.
VALUES = "viridis"
ERRORS = "cividis"
# The values are drawn as cells if at least this share of the grid's cells has a place.
_FILLED = 0.6
# Places whose nearest neighbour tells how close dots lie.
_MOST_NEIGHBOURS = 1000


def draw_field(
    axes: "Axes",
    places: Floats,
    values: Floats,
    trusted: Mask,
    label: str,
    look: Look,
    *,
    colours: str = VALUES,
    markers: Iterable[tuple[str, str, Mask]] = (),
) -> None:
    """Draw values in colour over two coordinates, with a colour bar.

    Parameters
    ----------
    axes : Axes
        The panel.
    places : numpy.ndarray, shape (k, 2)
        Coordinates.
    values : numpy.ndarray, shape (k,)
        One value per place; those that are not finite are not drawn.
    trusted : numpy.ndarray of bool, shape (k,)
        The values that span the colours, so that the peak of an inclusion shows.
    label : str
        Label of the colour bar.
    look : Look
        Style of the figure.
    colours : str
        ``VALUES`` (default), or ``ERRORS``, which begin at zero.
    markers : iterable of (str, str, numpy.ndarray of bool)
        Labels, markers and places of dots with one shape. Default: cells of a grid if the places
        fill one, else round dots.
    """
    known = np.isfinite(values)
    shown = values[known & trusted] if (known & trusted).any() else values[known]
    low, high = colour_range(shown, zero=colours == ERRORS)
    scale: dict[str, Any] = {"cmap": colours, "vmin": low, "vmax": high}
    ink: dict[str, Any] = {"edgecolors": look.theme.ink, "linewidths": 0.4}
    markers = [*markers]
    cells = None if markers or not known.any() else _cells(places, values)
    if cells is not None:
        image: ScalarMappable = axes.pcolormesh(*cells, **scale)
    else:
        size = _dot_area(axes, places[known], look)
        for name, marker, here in markers or [("", "o", known)]:
            x, y = places[here & known].T
            image = axes.scatter(x, y, size, values[here & known], marker=marker, **scale, **ink)
            if name:  # the legend shows the shape without a colour
                axes.scatter([], [], size, marker=marker, label=name, facecolor="none", **ink)
    beyond = bool((values[known] < low).any()), bool((values[known] > high).any())
    extend = ("neither", "min", "max", "both")[beyond[0] + 2 * beyond[1]]
    axes.figure.colorbar(image, ax=axes, extend=extend).set_label(label)


def _dot_area(axes: "Axes", places: Floats, look: Look) -> float:
    """Return the area of dots that do not overlap, points²."""
    largest = look.points(8.0)
    sides = np.ptp(places, axis=0) if len(places) else np.zeros(2)
    if len(places) < 2 or not sides.any():
        return largest**2
    some = places[:: -(-len(places) // _MOST_NEIGHBOURS)]
    apart = np.linalg.norm(some[:, None] - places[None], axis=2)
    apart[apart == 0.0] = np.inf
    inside = axes.get_window_extent()
    points_a_dot = 72.0 / axes.figure.dpi
    room = points_a_dot * inside.width, points_a_dot * inside.height
    points_a_unit = min(points / side for points, side in zip(room, sides, strict=True) if side)
    spacing = points_a_unit * float(np.median(apart.min(axis=1)))
    return float(np.clip(0.8 * spacing, look.points(2.5), largest)) ** 2


def colour_range(values: Floats, *, zero: bool) -> tuple[float, float]:
    """Return the ends of the colours for values; the lower end is 0 if ``zero`` is set."""
    if not values.size:
        return 0.0, 1.0
    low = float(values.min())
    high = float(values.max())
    if high <= low:
        low = low - 0.5 * abs(low) - 1e-30
        high = high + 0.5 * abs(high) + 1e-30
    return (0.0 if zero else low), high


def _cells(places: Floats, values: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Return the edges of columns and rows and the values between; None without a filled grid."""
    (columns, i), (rows, j) = (_levels(axis) for axis in places.T)
    count = len(columns) * len(rows)
    if len(columns) < 2 or len(rows) < 2 or len(values) < _FILLED * count:
        return None
    if len({*zip(i.tolist(), j.tolist(), strict=True)}) < len(values):
        return None  # repeats in one cell would hide each other
    cells = np.full((len(rows), len(columns)), np.nan)
    cells[j, i] = values
    return _edges(columns), _edges(rows), cells


def _levels(values: Floats) -> tuple[Floats, Indices]:
    """Return distinct coordinates, and of which each value is; 1/1000 of the range is equal."""
    order = np.argsort(values)
    apart = 1e-3 * max(float(np.ptp(values)), 1e-300)
    level = np.empty(len(values), dtype=np.intp)
    level[order] = np.cumsum(np.diff(values[order], prepend=values[order[:1]]) > apart)
    return np.bincount(level, values) / np.bincount(level), level


def _edges(levels: Floats) -> Floats:
    middle = 0.5 * (levels[1:] + levels[:-1])
    return np.concatenate([2.0 * levels[:1] - middle[:1], middle, 2.0 * levels[-1:] - middle[-1:]])
