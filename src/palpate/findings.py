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


_OF_SCHEMA_1 = {"sentence": "message", "step": "check"}


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
    def from_dict(cls, words: Mapping[str, Any] | str) -> "Finding":
        """Return the finding of :meth:`as_dict`, or of ``result.json`` in its first schema."""
        if isinstance(words, str):
            return cls("which law", words)
        given = {_OF_SCHEMA_1.get(name, name): value for name, value in words.items()}
        # Whether stiffness and damping suffer.
        if given.pop("numbers", False) or ("step" in words and given["severity"] == MARKS[-1]):
            given |= {"stiffness": given["severity"], "damping": given["severity"]}
        for name in ("z", "moves_stiffness_percent", "moves_damping_percent"):
            given[name] = or_nan(given.get(name))  # JSON's null is NaN
        return cls(**given)

    def __str__(self) -> str:
        return f"{self.message} ({self.remedy})" if self.remedy else self.message

    @property
    def sentence(self) -> str:
        """The message: its name before 0.1, for one release."""
        return self.message
