"""What a person asks of a running loop."""

from dataclasses import dataclass, field
from typing import Any, Literal

Name = Literal["tare", "hold", "resume", "reset", "estimator", "source", "record", "stop"]


@dataclass(frozen=True, slots=True)
class Command:
    """One request.

    Attributes
    ----------
    name : str
        ``"tare"``, ``"hold"``, ``"resume"``, ``"reset"``, ``"estimator"`` (``method`` and its
        settings), ``"source"`` (what the source itself offers, such as the laboratory's material),
        ``"record"`` (``path``; or ``on``: whether to record, to a path of the recorder's own
        choice) or ``"stop"``.
    options : dict
        What goes with it.
    """

    name: Name
    options: dict[str, Any] = field(default_factory=dict)
