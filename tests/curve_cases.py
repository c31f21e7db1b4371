"""Curves, and SciPy's minimum of their cost: those of the benchmark."""

import sys
from pathlib import Path

# Under plain pytest the checkout is not on the path.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.curve_reference import Reference
from benchmarks.curve_sets import DEPTH, MOTIONS, Curves, approach_and_retract, random_curves

__all__ = [
    "MOTIONS",
    "SURFACES",
    "Curves",
    "Reference",
    "approach_and_retract",
    "random_curves",
]

SURFACES = (-0.2 * DEPTH, 0.2 * DEPTH)
