"""The motion's band: averages over windows a twentieth of the motion's period long."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.validation import Floats

MOST_ROWS = 4000
WINDOWS_A_PERIOD = 20
FEWEST_ROWS = 60  # below that there is no saying how the residual is correlated


@dataclass(frozen=True, eq=False)  # no slots: what rows share is kept in the instance
class Band:
    """Windows wholly in contact, each a row.

    Everything that a fit compares is averaged over them, force and columns alike: noise that the
    motion is too slow to have made is gone. Penetration and velocity are never averaged, since a
    smoothed motion is another motion (a delay of half a sample would fit clean data better).

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (s,)
        The samples that some window holds, in order.
    windows : numpy.ndarray of int, shape (width, rows)
        Places in ``samples``; a column each, over which sums run six times quicker.
    period : float
        2π sd(x)/rms(v), s.
    """

    samples: NDArray[np.intp]
    windows: NDArray[np.intp]
    period: float

    @property
    def width(self) -> int:
        """Samples in a window."""
        return int(self.windows.shape[0])

    def __len__(self) -> int:
        return int(self.windows.shape[1])

    def mean(self, values: Floats) -> Floats:
        """Average over each window of values at ``samples``, a vector or columns."""
        sums: Floats = np.take(values, self.windows, axis=0).sum(axis=0)
        return sums / self.width

    @cached_property
    def shared(self) -> tuple[Floats, ...]:
        """Part of its window that each row shares with the next, the next but one, and so on."""
        first = self.samples[self.windows[0]]
        length = self.samples[self.windows[-1]] - first + 1
        parts: list[Floats] = []
        for lag in range(1, len(self)):
            part = np.clip(1.0 - (first[lag:] - first[:-lag]) / length[:-lag], 0.0, None)
            if not part.any():
                break
            parts.append(part)
        return tuple(parts)

    def rows(self, keep: NDArray[np.bool_]) -> "Band":
        """Return some of the windows."""
        return Band(self.samples, self.windows[:, keep], self.period)


def band_of(
    inside: NDArray[np.bool_], segment: NDArray[np.int64], period: float, sample_time: float
) -> Band:
    """Windows over the samples that are inside, within one segment.

    Parameters
    ----------
    inside : numpy.ndarray of bool, shape (k,)
        The samples in contact.
    segment : numpy.ndarray of int, shape (k,)
        Windows do not reach from one to the next.
    period : float
        Of the motion, s.
    sample_time : float
        s.
    """
    count = int(np.count_nonzero(inside))
    width = int(np.clip(period / WINDOWS_A_PERIOD / sample_time, 1, max(count // 40, 1)))
    broken = np.concatenate([[0], np.cumsum((~inside[1:]) | (np.diff(segment) != 0))])
    starts = np.arange(len(inside) - width + 1)
    whole = inside[starts] & (broken[starts + width - 1] == broken[starts])
    starts = starts[whole][:: max(width // 3, 1)]
    starts = starts[:: -(-starts.size // MOST_ROWS) or 1]
    # Of a long window 64 samples tell as much of the motion; noise is then averaged over them.
    within = np.unique(np.linspace(0, width - 1, min(width, 64)).round().astype(np.intp))
    index = starts + within[:, None]
    samples = np.unique(index)
    return Band(samples, np.searchsorted(samples, index), period)
