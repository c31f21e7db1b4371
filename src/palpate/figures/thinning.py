"""Fewer points that look the same: a line of all samples makes a heavy file."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.validation import Floats

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
    drawn = np.array(values[keep], dtype=np.float64)
    drawn[1:][np.diff(contact.segment[keep]) != 0] = np.nan
    return drawn


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
