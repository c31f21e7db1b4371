"""What a reader of a contact's numbers should know of how it was made."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Remark:
    """One sentence about how a contact was made from a recording.

    Attributes
    ----------
    step : str
        Of the preparation, such as ``"surface"``.
    sentence : str
        What was found, assumed or left out.
    remedy : str or None
        What to do about it: an option, or a few words.
    severity : str
        ``"note"``, ``"with-care"`` or ``"do-not-trust"``: what it does to the verdict.
    numbers : bool
        It may move stiffness and damping at working depth beyond their errors, and the verdict of
        each is no better than this; else only that of the whole.
    """

    step: str
    sentence: str
    remedy: str | None = None
    severity: Literal["note", "with-care", "do-not-trust"] = "note"
    numbers: bool = False
