"""Episodes of a probe that travels: times in which it stays at one place of the material."""

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.validation import Floats

RADIUS = 2e-3  # m; the recordings of others that were cut by hand were cut so
SHORTEST = 1.0  # s
FEWEST = 60  # samples
STRIDES = 4000  # places at which an episode may begin: of a longer recording every k-th sample


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """A time in which the probe stays at one place.

    Attributes
    ----------
    start, stop : int
        Its samples.
    place : numpy.ndarray, shape (3,)
        The median position, m.
    radius : float
        How far from there it goes, across the contact normal, m.
    """

    start: int
    stop: int
    place: Floats
    radius: float


def episodes_of(
    time: Floats,
    position: Floats,
    force: Floats,
    *,
    radius: float = RADIUS,
    shortest: float = SHORTEST,
) -> list[Episode]:
    """Cut a recording into episodes, the longest first, and return them in their order.

    In an episode the position stays within ``radius`` of its median, across the contact normal of
    that episode: the mean direction of its forces, weighted by their size.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, increasing.
    position, force : numpy.ndarray, shape (k, 3)
        m, and N in the same frame.
    radius : float
        m.
    shortest : float
        s; what is shorter is none, nor what has fewer than 60 samples.
    """
    path = _Path(time, position, force, radius, shortest)
    waiting = [(-(stop - start), start, stop) for start, stop in path.longest()]
    heapq.heapify(waiting)
    taken = np.zeros(time.size, dtype=bool)
    found = []
    while waiting:
        _, start, stop = heapq.heappop(waiting)
        free = _rest(taken, start, stop)
        if free is None or not path.long_enough(*free):
            continue
        if free != (start, stop):
            heapq.heappush(waiting, (-(free[1] - free[0]), *free))
            continue
        taken[start:stop] = True
        place, far = path.extent(start, stop)
        found.append(Episode(start, stop, place, far))
    return sorted(found, key=lambda episode: episode.start)


def _rest(taken: NDArray[np.bool_], start: int, stop: int) -> tuple[int, int] | None:
    """The longest part of an interval that is not taken yet."""
    borders = np.flatnonzero(np.diff(np.concatenate([[1], taken[start:stop].view(np.int8), [1]])))
    if not borders.size:
        return None
    lows, highs = borders[0::2], borders[1::2]
    k = int(np.argmax(highs - lows))
    return start + int(lows[k]), start + int(highs[k])


class _Path:
    def __init__(
        self, time: Floats, position: Floats, force: Floats, radius: float, shortest: float
    ) -> None:
        self.time, self.position = time, position
        self.radius, self.shortest = radius, shortest
        weighted = np.nan_to_num(force) * np.linalg.norm(np.nan_to_num(force), axis=1)[:, None]
        self.weighted = np.concatenate([np.zeros((1, 3)), np.cumsum(weighted, axis=0)])

    def long_enough(self, start: int, stop: int) -> bool:
        """Whether an interval is an episode's length."""
        return (
            stop - start >= FEWEST
            and float(self.time[stop - 1] - self.time[start]) >= self.shortest
        )

    def extent(self, start: int, stop: int) -> tuple[Floats, float]:
        """The median position of an interval, and how far from it the probe goes across n."""
        inside = self.position[start:stop]
        total = self.weighted[stop] - self.weighted[start]
        length = float(np.linalg.norm(total))
        # The same numbers; looking for NaN by columns takes some times as long.
        median = np.nanmedian if np.isnan(inside).any() else np.median
        place: Floats = median(inside, axis=0)
        away = inside - place
        if length > 0.0:
            n = total / length
            away = away - np.outer(away @ n, n)
        return place, float(np.sqrt(np.nanmax((away**2).sum(axis=1), initial=0.0)))

    def longest(self) -> list[tuple[int, int]]:
        """The longest interval from each start that stays within the radius."""
        size = self.time.size
        stride = max(size // STRIDES, 1)
        shortest = max(FEWEST, int(np.searchsorted(self.time, self.time[0] + self.shortest)))
        found = []
        stop = 0
        for start in range(0, size, stride):
            stop = max(stop, min(start + shortest, size))
            if not self._within(start, stop):
                stop = start
                continue
            stop = self._reach(start, stop, stride)
            found.append((start, stop))
        return [each for each in found if self.long_enough(*each)]

    def _reach(self, start: int, stop: int, stride: int) -> int:
        """How far an interval goes on: in steps that double, then halve."""
        size, step = self.time.size, stride
        while stop < size and self._within(start, min(stop + step, size)):
            stop = min(stop + step, size)
            step *= 2
        while step > stride:
            step //= 2
            if stop + step <= size and self._within(start, stop + step):
                stop += step
        return stop

    def _within(self, start: int, stop: int) -> bool:
        return self.extent(start, stop)[1] <= self.radius


def travel(position: Floats, force: Floats) -> float:
    """How far a probe goes across the contact normal while it is in contact, m.

    The radius around its median position; in contact is a force beyond a tenth of the largest.
    """
    size = np.linalg.norm(np.nan_to_num(force), axis=1)
    touching = size > 0.1 * float(np.percentile(size, 99.0)) if size.size else size > 0.0
    if np.count_nonzero(touching) < 2:
        return 0.0
    path = _Path(np.zeros(touching.sum()), position[touching], force[touching], math.inf, 0.0)
    return path.extent(0, int(np.count_nonzero(touching)))[1]
