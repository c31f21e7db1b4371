"""What the loop counts."""

from dataclasses import dataclass
from typing import Any


@dataclass(slots=True)
class LoopCounts:
    """What the loop itself counted.

    Attributes
    ----------
    taken : int
        Samples that came from the source.
    learned : int
        Of them, those that the estimator took.
    refused : int
        Those that were not finite, out of range, or had an impossible time.
    silences : int
        How often the source went silent.
    changes : int
        How often the material changed.
    """

    taken: int = 0
    learned: int = 0
    refused: int = 0
    silences: int = 0
    changes: int = 0


def summed(*counts: dict[str, Any]) -> dict[str, Any]:
    """One of each name: what both the source and the loop count is added."""
    whole: dict[str, Any] = {}
    for name, value in (item for each in counts for item in each.items()):
        whole[name] = value + whole[name] if name in whole else value
    return whole
