"""The words of a channel's name, its unit, and whether it names a command."""

import re
import unicodedata

from palpate.recordings.recording import find_unit

#: Words for commanded, not measured, channels.
WANTED = frozenset(
    ("command", "commands", "commanded", "cmd", "desired", "des", "target", "targets", "setpoint",
     "reference", "ref", "goal", "goals", "action", "actions", "planned", "demand", "demanded")
)  # fmt: skip
# libfranka's names of desired and commanded values.
_DESIRED = re.compile(r"O_d?d?[TP]_EE_[cd](?![^\W\d_])", re.I)
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


def is_wanted(name: str) -> bool:
    """Whether the name suggests a commanded, not a measured, channel."""
    return not WANTED.isdisjoint(split_name(name)) or bool(_DESIRED.search(name))


def split_name(name: str) -> list[str]:
    """The words of a name in lower case, without its unit and accents: ``Fz [mN]`` is fz."""
    bare = unicodedata.normalize("NFKD", divide_unit(name)[0])
    return [word.lower() for word in _WORD.findall(re.sub(r"[\u0300-\u036f]", "", bare))]


def divide_unit(name: str) -> tuple[str, str | None]:
    """The name without the unit at its end, and this unit."""
    unit = find_unit(name)
    if unit is not None:
        name = re.sub(rf"[\[(_/, ]*{re.escape(unit)}[\])\s]*$", "", name, flags=re.IGNORECASE)
    return name, unit
