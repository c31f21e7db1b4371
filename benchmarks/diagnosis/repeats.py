"""Repeats of one object: how much too narrow the error bars of stiffness and damping are."""

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from palpate import Contact, RecordingError, identify, prepare
from palpate.diagnosis import Quantity, WorkingDepth
from palpate.validation import Floats

BLOCKS = {"C": 10, "G": 5}  # of equal time, into which each recording of a set is cut
LEVER = "A_aurora_220118"  # one muscle under loads of 100 to 1000 mN: each recording is a repeat


def repeats_of(folder: Path) -> dict[str, list[Path]]:
    """Return the recordings of each comparison, by its name."""
    found = {LEVER: sorted(folder.glob(f"{LEVER}*.csv"))}
    for initial in BLOCKS:
        found |= {path.stem: [path] for path in sorted(folder.glob(f"{initial}_*.csv"))}
    return {name: paths for name, paths in found.items() if paths}


def factors(job: tuple[str, list[Path]]) -> dict[str, Any]:
    """Return reduced χ at a common working depth, without the systematic part and with it."""
    name, paths = job
    parts = [
        part
        for path in paths
        for part in _blocks(prepare(path), BLOCKS.get(name.partition("_")[0], 1))
    ]
    results = []
    for part in parts:
        try:
            results.append(identify(part))
        except RecordingError:  # a block without contact
            continue
    depth = float(np.median([result.diagnosis.working_depth.depth for result in results]))
    there = [result.at_depth(depth).diagnosis.working_depth for result in results]
    row: dict[str, Any] = {"name": name, "repeats": len(there), "depth": depth}
    for key in ("stiffness", "damping"):
        row[key] = _factors(_quantities(there, key))
    return row


def _blocks(contact: Contact, count: int) -> Iterable[Contact]:
    borders = np.linspace(contact.time[0], contact.time[-1], count + 1)
    for start, stop in pairwise(borders.tolist()):
        yield contact.window(start, stop)


def _quantities(there: list[WorkingDepth], key: str) -> list[Quantity]:
    return [getattr(each, key) for each in there]


def _factors(quantities: list[Quantity]) -> list[float]:
    """Return scatter in per cent, and reduced χ by the statistical and by both error bars."""
    values = np.array([quantity.value for quantity in quantities])
    repeatable = np.array([quantity.standard_error for quantity in quantities])
    both = np.hypot(repeatable, [quantity.systematic for quantity in quantities])
    scatter = 100.0 * float(np.std(values, ddof=1) / abs(np.mean(values)))
    return [scatter, _reduced_chi(values, repeatable), _reduced_chi(values, both)]


def _reduced_chi(values: Floats, errors: Floats) -> float:
    weights = errors**-2.0
    mean = float(weights @ values / weights.sum())
    return float(np.sqrt(((values - mean) ** 2 * weights).sum() / (len(values) - 1)))
