"""A fault of a trial: of its sensors, or of its material."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from benchmarks.diagnosis.trials import Trial
from palpate.validation import Floats

Damage = Callable[[Trial], None]


@dataclass(frozen=True)
class Unseen:
    """A fault of one severity, which ``faults.py`` does not have.

    Attributes
    ----------
    kind, severity : str
        Which fault, and how much, as text.
    before, after : callable, optional
        Its effect on the fine grid, and on the samples with their noise.
    shown : bool
        Whether a file can show it: not if another material of the same law gives the same file.
    """

    kind: str
    severity: str
    before: Damage | None = None
    after: Damage | None = None
    shown: bool = True


def percent(
    kind: str,
    make: Callable[[float], Damage],
    *parts: float,
    after: bool = False,
    shown: bool = True,
) -> list[Unseen]:
    """One fault in severities that are parts of one."""
    return [
        Unseen(
            kind,
            f"{100.0 * part:g} %",
            *((None, make(part)) if after else (make(part),)),
            shown=shown,
        )
        for part in parts
    ]


def units(
    kind: str, unit: str, make: Callable[[float], Damage], *sizes: float, after: bool = False
) -> list[Unseen]:
    """One fault in severities with a unit."""
    return [
        Unseen(kind, f"{size:g} {unit}", *((None, make(size)) if after else (make(size),)))
        for size in sizes
    ]


def delayed(trial: Trial, values: Floats, seconds: float | Floats) -> Floats:
    """Values that come later, by linear interpolation on the fine grid."""
    return np.interp(trial.time - seconds, trial.time, values)


def first_order(trial: Trial, values: Floats, hertz: float) -> Floats:
    """Values behind a filter of first order, which starts at rest."""
    keep = float(np.exp(-2.0 * np.pi * hertz * trial.step))
    made: Floats = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0]
    return made


def play(values: Floats, width: float) -> Floats:
    """Values behind a play of a width, which follow only when it is used up."""
    made, at = np.empty_like(values), float(values[0])
    for k, value in enumerate(values.tolist()):
        at = min(max(at, value - 0.5 * width), value + 0.5 * width)
        made[k] = at
    return made
