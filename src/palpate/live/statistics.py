"""How long things took, counted into bins: no memory is taken in the loop."""

import math
from typing import Any

import numpy as np

# From 0.1 µs to 100 s, a twentieth of a decade apart: a percentile is known to 6 %.
_LOWEST, _DECADES, _PER_DECADE = 1e-7, 9, 20


class Histogram:
    """Times in s, counted into logarithmic bins; their maximum and how many exceed a limit.

    Parameters
    ----------
    limit : float
        s.
    """

    __slots__ = ("_bins", "count", "largest", "limit", "over")

    def __init__(self, limit: float) -> None:
        self._bins = [0] * (_DECADES * _PER_DECADE + 2)
        self.limit, self.count, self.over, self.largest = limit, 0, 0, 0.0

    def add(self, seconds: float) -> None:
        """Count one time."""
        self.count += 1
        if seconds > self.largest:
            self.largest = seconds
        if seconds > self.limit:
            self.over += 1
        if seconds <= _LOWEST:
            self._bins[0] += 1
            return
        place = 1 + int(_PER_DECADE * math.log10(seconds / _LOWEST))
        self._bins[min(place, len(self._bins) - 1)] += 1

    def percentile(self, percent: float) -> float:
        """The upper end of the bin that holds a percentile, s; NaN of none."""
        if not self.count:
            return math.nan
        reached = np.cumsum(self._bins) >= percent / 100.0 * self.count
        end = _LOWEST * 10.0 ** (int(np.argmax(reached)) / _PER_DECADE)
        return float(min(end, self.largest))

    def as_dict(self) -> dict[str, Any]:
        """Return p50, p99, p99.9 and the maximum, s, and what is within the limit."""
        within = 1.0 - self.over / self.count if self.count else math.nan
        return {
            "count": self.count,
            "p50": self.percentile(50.0),
            "p99": self.percentile(99.0),
            "p99.9": self.percentile(99.9),
            "max": self.largest,
            "limit": self.limit,
            "within": within,
        }
