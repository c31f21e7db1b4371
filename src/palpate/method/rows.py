"""Rows of arrays: runs of equal ones, finite ones, their norms, and the time between them."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.validation import Floats, Mask, Values


def run_slices(labels: NDArray[Any]) -> Iterator[slice]:
    """Slices of the runs of equal labels, in order."""
    borders = np.flatnonzero(labels[1:] != labels[:-1]) + 1
    for start, stop in itertools.pairwise([0, *borders.tolist(), len(labels)]):
        if stop > start:
            yield slice(start, stop)


def true_runs(mask: Mask) -> Iterator[slice]:
    """Slices of the runs in which a mask is true, in order."""
    return (run for run in run_slices(mask) if mask[run.start])


def finite_rows(*arrays: Floats) -> Mask:
    """Whether a row is finite in all arrays, of shape (k,) or (k, n)."""
    finite = (np.isfinite(array) for array in arrays)
    rows = [mask if mask.ndim == 1 else mask.all(axis=1) for mask in finite]
    every: Mask = np.logical_and.reduce(rows)
    return every


def count_true(mask: Mask) -> int:
    """Number of true values."""
    return int(np.count_nonzero(mask))


def typical_step(time: Values) -> float:
    """Median time between samples, s; infinite for fewer than two."""
    return median(np.diff(time)) if time.size > 1 else np.inf


def norm(vector: Floats) -> float:
    """Length of a vector."""
    return float(np.linalg.norm(vector))


def row_norms(vectors: Floats) -> Floats:
    """Length of each row."""
    lengths: Floats = np.linalg.norm(vectors, axis=-1)
    return lengths


def rms(values: Floats) -> float:
    """Square root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def median(values: Values | list[float]) -> float:
    """Middle of all values."""
    return float(np.median(values))
