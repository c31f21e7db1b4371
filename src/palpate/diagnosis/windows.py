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
FEWEST_ROWS = 60  # with fewer the correlation of the residual cannot be estimated


@dataclass(frozen=True, eq=False)  # no slots: the instance caches the shared parts
class WindowedSamples:
    """Windows of samples in contact; each window gives one row of the fit.

    The fit compares window means of the force and of its columns, which removes noise faster than
    the motion. Penetration and velocity are never averaged before the law is evaluated: a smoothed
    motion is another motion, and a delay of half a sample would fit clean data better.

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (s,)
        The samples that belong to at least one window, in order.
    places : numpy.ndarray of int, shape (width, rows)
        Indices into ``samples``, one column for each window; such sums are six times faster.
    """

    samples: NDArray[np.intp]
    places: NDArray[np.intp]

    @classmethod
    def from_indices(cls, index: NDArray[np.intp]) -> "WindowedSamples":
        """Return windows from the samples of each, shape (width, rows)."""
        samples = np.unique(index)
        return cls(samples, np.searchsorted(samples, index))

    @property
    def width(self) -> int:
        """Samples in a window."""
        return int(self.places.shape[0])

    def __len__(self) -> int:
        return int(self.places.shape[1])

    def mean(self, values: Floats) -> Floats:
        """Average values at ``samples``, a vector or columns, over each window."""
        sums: Floats = np.take(values, self.places, axis=0).sum(axis=0)
        return sums / self.width

    @cached_property
    def shared(self) -> tuple[Floats, ...]:
        """Fraction of its window that a row shares with the next one, two, … rows."""
        starts = self.samples[self.places[0]]
        length = self.samples[self.places[-1]] - starts + 1
        overlaps: list[Floats] = []
        for lag in range(1, len(self)):
            overlap = np.clip(1.0 - (starts[lag:] - starts[:-lag]) / length[:-lag], 0.0, None)
            if not overlap.any():
                break
            overlaps.append(overlap)
        return tuple(overlaps)

    def thin(self, every: int) -> "WindowedSamples":
        """Return every n-th window."""
        return WindowedSamples.from_indices(self.samples[self.places[:, ::every]])


def windows_over(
    inside: NDArray[np.bool_], segment: NDArray[np.int64], width: int
) -> WindowedSamples:
    """Return windows of ``width`` samples, all of them inside, a third of a window apart.

    No window spans two segments.
    """
    if len(inside) < width:
        return WindowedSamples.from_indices(np.empty((width, 0), np.intp))
    broken = np.concatenate([[0], np.cumsum((~inside[1:]) | (np.diff(segment) != 0))])
    starts = np.arange(len(inside) - width + 1)
    unbroken = inside[starts] & (broken[starts + width - 1] == broken[starts])
    starts = starts[unbroken][:: max(width // 3, 1)]
    starts = starts[:: -(-starts.size // MOST_ROWS) or 1]
    # In a long window 64 samples resolve the motion; the noise is then averaged over those.
    within = np.unique(np.linspace(0, width - 1, min(width, 64)).round().astype(np.intp))
    return WindowedSamples.from_indices(starts + within[:, None])


FEWEST_FREE = 50  # samples above the surface; with fewer an error of the surface does not show
LOWEST_FREE = 75.0  # percent of the samples above the surface
FEWEST_WINDOWS = 3  # number of windows that do not overlap, for each interval of free air


@dataclass(frozen=True, slots=True)
class FreeAir:
    """Force in free air after subtracting the mean of each interval: noise, and slopes with motion.

    Attributes
    ----------
    noise : float
        Rms of a window mean, N.
    windows : float
        Number of windows that do not overlap.
    slopes, errors : tuple of float
        ∂F/∂x [N/m] and ∂F/∂v [N·s/m] in free air, and their standard errors.
    """

    noise: float = 0.0
    windows: float = 0.0
    slopes: tuple[float, float] = (0.0, 0.0)
    errors: tuple[float, float] = (math.inf, math.inf)


def free_air_statistics(data: Data, windows: WindowedSamples) -> FreeAir:
    """Return statistics of the force over windows in free air."""
    starts = windows.samples[windows.places[0]]
    step = max(windows.width // 3, 1)
    interval = np.cumsum(np.diff(starts, prepend=starts[:1]) > max(windows.width, 2 * step))
    count = np.bincount(interval) * step / windows.width  # windows that do not overlap
    long = (count >= FEWEST_WINDOWS)[interval]
    if not long.any():
        return FreeAir()
    samples = windows.samples
    rows = windows.mean(
        np.column_stack([data.force[samples], data.penetration[samples], data.velocity[samples]])
    )
    means = np.array([np.bincount(interval, column) for column in rows.T])
    rows = (rows - (means / np.bincount(interval)).T[interval])[long]
    force = rows[:, 0]
    motion = rows[:, 1:]
    counted = count[count >= FEWEST_WINDOWS]
    freedom = 1.0 - counted.size / float(counted.sum())  # a mean of each interval is fitted
    slopes, *_ = np.linalg.lstsq(motion, force, rcond=1e-9)
    residual = force - motion @ slopes
    noise = math.sqrt(float(residual @ residual) / len(residual) / freedom)
    if counted.size < 2:  # on one approach slow noise and drift look like a slope
        return FreeAir(noise, float(counted.sum()))
    errors = np.sqrt(np.maximum(np.diag(robust_covariance(motion, residual)), 0.0))
    return FreeAir(noise, float(counted.sum()), tuple(slopes.tolist()), tuple(errors.tolist()))
