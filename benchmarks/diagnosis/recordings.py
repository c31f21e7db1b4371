"""The verdict on every real recording of the folder ``PALPATE_DATA``."""

import math
from pathlib import Path
from typing import Any

from palpate import RecordingError, identify


def verdict_of(path: Path) -> dict[str, Any]:
    """Return verdict, reason, and relative errors of stiffness and damping; or an error."""
    try:
        found = identify(path).diagnosis
    except RecordingError as error:
        return {"name": path.stem, "overall": "not identified", "reason": _short(str(error))}
    there = found.working_depth
    return {
        "name": path.stem,
        "overall": found.verdict.overall,
        "stiffness": found.verdict.stiffness,
        "damping": found.verdict.damping,
        "reason": found.reason,
        "errors": [
            100.0 * error / abs(quantity.value) if quantity.value else math.nan
            for quantity in (there.stiffness, there.damping)
            for error in (quantity.standard_error, quantity.systematic)
        ],
    }


def _short(words: str) -> str:
    """Return the name without its folder."""
    return words.rpartition("/")[2]
