"""Means over windows of the samples in contact, and the noise of the force in free air."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.recording import Data
from palpate.estimators.least_squares import robust_covariance
from palpate.validation import Floats

MOST_ROWS = 4000
WINDOWS_A_PERIOD = 20
FEWEST_ROWS = 60  # below that there is no saying how the residual is correlated


@dataclass(frozen=True, eq=False)  # no slots: what rows share is kept in the instance
class WindowedSamples:
    """Windows wholly in contact, each a row.

    Everything that a fit compares is averaged over them, force and columns alike: noise that the
    motion is too slow to have made is gone. Penetration and velocity are never averaged, since a
    smoothed motion is another motion (a delay of half a sample would fit clean data better).

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (s,)
        The samples that some window holds, in order.
    places : numpy.ndarray of int, shape (width, rows)
        Places in ``samples``; a column each, over which sums run six times quicker.
    period : float
        2π sd(x)/rms(v), s.
    """

    samples: NDArray[np.intp]
    places: NDArray[np.intp]
    period: float

    @property
    def width(self) -> int:
        """Samples in a window."""
        return int(self.places.shape[0])

    def __len__(self) -> int:
        return int(self.places.shape[1])

    def mean(self, values: Floats) -> Floats:
        """Average over each window of values at ``samples``, a vector or columns."""
        sums: Floats = np.take(values, self.places, axis=0).sum(axis=0)
        return sums / self.width

    @cached_property
    def shared(self) -> tuple[Floats, ...]:
        """Part of its window that each row shares with the next, the next but one, and so on."""
        first = self.samples[self.places[0]]
        length = self.samples[self.places[-1]] - first + 1
        parts: list[Floats] = []
        for lag in range(1, len(self)):
            part = np.clip(1.0 - (first[lag:] - first[:-lag]) / length[:-lag], 0.0, None)
            if not part.any():
                break
            parts.append(part)
        return tuple(parts)

    def thinned(self, every: int) -> "WindowedSamples":
        """Return one in so many of the windows."""
        index = self.samples[self.places[:, ::every]]
        samples = np.unique(index)
        return WindowedSamples(samples, np.searchsorted(samples, index), self.period)


def windows_in_contact(
    inside: NDArray[np.bool_], segment: NDArray[np.int64], period: float, sample_time: float
) -> WindowedSamples:
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
    return windows_over(inside, segment, period, width)


def windows_over(
    inside: NDArray[np.bool_], segment: NDArray[np.int64], period: float, width: int
) -> WindowedSamples:
    """Windows of so many samples that are wholly inside, each a third of it after the last."""
    if len(inside) < width:
        return WindowedSamples(np.empty(0, np.intp), np.empty((width, 0), np.intp), period)
    broken = np.concatenate([[0], np.cumsum((~inside[1:]) | (np.diff(segment) != 0))])
    starts = np.arange(len(inside) - width + 1)
    whole = inside[starts] & (broken[starts + width - 1] == broken[starts])
    starts = starts[whole][:: max(width // 3, 1)]
    starts = starts[:: -(-starts.size // MOST_ROWS) or 1]
    # Of a long window 64 samples tell as much of the motion; noise is then averaged over them.
    within = np.unique(np.linspace(0, width - 1, min(width, 64)).round().astype(np.intp))
    index = starts + within[:, None]
    samples = np.unique(index)
    return WindowedSamples(samples, np.searchsorted(samples, index), period)


FEWEST_FREE = 50  # samples above the surface; with fewer an error of the surface does not show
LOWEST_FREE = 75.0  # percent of the samples above the surface
FEWEST_WINDOWS = 3  # of a stretch, beside one another


@dataclass(frozen=True, slots=True)
class FreeAir:
    """Force in free air beside a constant of each stretch: noise, and what moves with the probe.

    Attributes
    ----------
    noise : float
        Rms of a window's mean, N.
    windows : float
        How many there are beside one another.
    slopes, errors : tuple of float
        ∂F/∂x [N/m] and ∂F/∂v [N·s/m] in free air, and their standard errors.
    """

    noise: float = 0.0
    windows: float = 0.0
    slopes: tuple[float, float] = (0.0, 0.0)
    errors: tuple[float, float] = (math.inf, math.inf)


def free_air_statistics(data: Data, windows: WindowedSamples) -> FreeAir:
    """Statistics of the force over windows in free air."""
    starts = windows.samples[windows.places[0]]
    step = max(windows.width // 3, 1)
    stretch = np.cumsum(np.diff(starts, prepend=starts[:1]) > max(windows.width, 2 * step))
    count = np.bincount(stretch) * step / windows.width  # windows beside one another
    long = (count >= FEWEST_WINDOWS)[stretch]
    if not long.any():
        return FreeAir()
    at = windows.samples
    rows = windows.mean(np.column_stack([data.force[at], data.penetration[at], data.velocity[at]]))
    means = np.array([np.bincount(stretch, column) for column in rows.T])
    rows = (rows - (means / np.bincount(stretch)).T[stretch])[long]
    force, motion = rows[:, 0], rows[:, 1:]
    counted = count[count >= FEWEST_WINDOWS]
    left = 1.0 - counted.size / float(counted.sum())  # their own means take the rest
    slopes, *_ = np.linalg.lstsq(motion, force, rcond=1e-9)
    residual = force - motion @ slopes
    noise = math.sqrt(float(residual @ residual) / len(residual) / left)
    if counted.size < 2:  # on one approach slow noise and drift look like a slope
        return FreeAir(noise, float(counted.sum()))
    errors = np.sqrt(np.maximum(np.diag(robust_covariance(motion, residual)), 0.0))
    return FreeAir(noise, float(counted.sum()), tuple(slopes.tolist()), tuple(errors.tolist()))
