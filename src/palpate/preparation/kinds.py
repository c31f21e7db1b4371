"""What a channel measures, by its unit and by the words of its name."""

import re

from palpate.recordings.units import UNITS, plain_unit, stated_unit

# What each word says of a channel that has no unit. The last word of a name that is here counts:
# "/tool.wrench.torque" is a torque.
WORDS: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "stamp", "timestamp", "seconds", "sec"),
    "force": ("force", "forces", "wrench", "load", "ft", "f", "fx", "fy", "fz", "fn", "fts"),
    "torque": ("torque", "torques", "moment", "tau", "mx", "my", "mz", "tx", "ty", "tz"),
    "penetration": ("penetration", "indentation", "depth", "deformation", "compression"),
    "position": (
        "position", "positions", "pos", "p", "x", "y", "z", "px", "py", "pz", "s", "pose", "tip",
        "tcp", "ee", "translation", "displacement", "disp", "height", "location", "stroke",
    ),
    "velocity": ("velocity", "vel", "speed", "v", "vx", "vy", "vz", "linear", "xd"),
    "orientation": ("orientation", "quaternion", "quat", "q", "rotation", "rot"),
    "nothing": ("angular", "acceleration", "accel", "acc", "covariance", "effort", "current"),
}  # fmt: skip
_KIND = {word: kind for kind, words in WORDS.items() for word in words}
#: Words for what was wanted, not measured.
WANTED = frozenset(
    ("command", "commanded", "cmd", "desired", "des", "target", "setpoint", "reference", "ref")
)
TIP = frozenset(("tip", "tcp", "probe"))
_OF_UNIT = {
    **dict.fromkeys(UNITS["time"], ("time",)),
    **dict.fromkeys(UNITS["force"], ("force",)),
    **dict.fromkeys(UNITS["penetration"], ("penetration", "position")),
    **dict.fromkeys(UNITS["velocity"], ("velocity",)),
    "Nm": ("torque",),
    "N·m": ("torque",),
    "N*m": ("torque",),
    "mNm": ("torque",),
}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


def kind_of(name: str, unit: str | None = None) -> str | None:
    """What a channel measures: a key of ``WORDS``, or None where its name does not say.

    Parameters
    ----------
    name : str
        The channel's, or what the components of a vector share.
    unit : str, optional
        As the recording says it; else what the name ends with.
    """
    unit = plain_unit(unit) if unit else stated_unit(name)
    possible = _OF_UNIT.get(unit or "")
    kinds = [_KIND[word] for word in words_of(name) if word in _KIND and word != unit]
    if possible is None:
        return kinds[-1] if kinds else None
    fitting = [kind for kind in kinds if kind in possible]
    return fitting[-1] if fitting else possible[-1]


def is_wanted(name: str) -> bool:
    """Whether a name says what was commanded, and not what was measured."""
    return not WANTED.isdisjoint(words_of(name))


def is_tip(name: str) -> bool:
    """Whether a name says that it is the part of the robot that touches."""
    return not TIP.isdisjoint(words_of(name))


def words_of(name: str) -> list[str]:
    """The words of a name in lower case, its unit left out: ``Fz [mN]`` is fz."""
    unit = stated_unit(name)
    if unit is not None:
        name = re.sub(rf"[\[(_/ ]*{re.escape(unit)}[\])\s]*$", "", name)
    return [word.lower() for word in _WORD.findall(name)]
