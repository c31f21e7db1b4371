"""The one kind of message with a severity: what was found, what to do, what it changes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from palpate.validation import Plain, or_nan

Mark: TypeAlias = Literal["trust", "with-care", "do-not-trust"]
Severity: TypeAlias = Literal["note", "with-care", "do-not-trust"]
#: From the best to the worst.
MARKS: tuple[Mark, ...] = ("trust", "with-care", "do-not-trust")
#: The overall verdict that each causes, in the same order.
SEVERITIES: tuple[Severity, ...] = ("note", "with-care", "do-not-trust")


#: Checks whose findings may lower a mark beyond what the error bars say: faults of the recording
#: that no error bar can hold. Every other finding changes error bars only.
MAY_CAP = frozenset([
    "adhesion", "change", "channels", "depth", "direction", "excitation", "file", "force frame",
    "force jump", "force unit", "forecast", "held channel", "late force", "load transfer",
    "misfit", "no time", "one way", "orientation", "outliers", "penetration unit", "precision",
    "saturation", "signs", "spikes", "stuck force", "time stamps", "time unit", "tool weight",
    "units", "velocity column", "weak prior",
])  # fmt: skip


def worst(*marks: Mark) -> Mark:
    """Return the worst of some marks; *trust* of none."""
    return MARKS[max(map(MARKS.index, marks), default=0)]


def spoken(mark: str) -> str:
    """Return a mark as text: *with care*."""
    return mark.replace("-", " ")


@dataclass(frozen=True, slots=True)
class Finding(Plain):
    """One message about a recording, its preparation or its identification.

    Attributes
    ----------
    check : str
        The check or the step that found it, such as ``"delay"`` or ``"surface"``.
    message : str
        What was found.
    remedy : str or None
        The next step: one sentence, perhaps with options of ``palpate identify``.
    severity : str
        ``"note"``, ``"with-care"`` or ``"do-not-trust"``: the overall verdict is at least that. It
        follows the marks: that of the stiffness counts in full, a damping that is not trusted calls
        for care.
    z : float
        Significance, in standard errors; NaN if the check has none.
    stiffness, damping : str
        The marks that it alone gives at working depth: ``"trust"``, ``"with-care"`` or
        ``"do-not-trust"``.
    moves_stiffness_percent, moves_damping_percent : float
        How far it changes them, in per cent of their size; NaN if unknown.
    brief : str
        The message in fewer words, for the line of a number; empty if it is short enough.
    """

    check: str
    message: str
    remedy: str | None = None
    severity: Severity = "note"
    z: float = math.nan
    stiffness: Mark = "trust"
    damping: Mark = "trust"
    moves_stiffness_percent: float = math.nan
    moves_damping_percent: float = math.nan
    brief: str = ""

    def __post_init__(self) -> None:
        least = worst(self.stiffness, "with-care" if self.damping != "trust" else "trust")
        k = max(MARKS.index(least), SEVERITIES.index(self.severity))
        object.__setattr__(self, "severity", SEVERITIES[k])

    @classmethod
    def of_both(
        cls, mark: Mark, check: str, message: str, remedy: str | None = None, z: float = math.nan
    ) -> "Finding":
        """Return one that gives stiffness and damping the same mark."""
        return cls(check, message, remedy, z=z, stiffness=mark, damping=mark)

    @classmethod
    def from_dict(cls, words: Mapping[str, Any]) -> "Finding":
        """Return the finding of :meth:`as_dict`."""
        given = dict(words)
        for name in ("z", "moves_stiffness_percent", "moves_damping_percent"):
            given[name] = or_nan(given.get(name))  # JSON's null is NaN
        return cls(**given)

    def __str__(self) -> str:
        return f"{self.message} ({self.remedy})" if self.remedy else self.message
