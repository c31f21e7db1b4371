"""The quantity of a channel, from its unit and the words of its name."""

import re
import unicodedata

from palpate.recordings import Recording
from palpate.recordings.opening import within
from palpate.recordings.recording import UNITS, find_unit, plain_unit

# Words for the quantity of a channel without a unit, also in German, Spanish, French and Italian,
# without accents. The last such word of a name counts: "/tool.wrench.torque" is a torque.
WORDS: dict[str, tuple[str, ...]] = {
    "time": (
        "time", "t", "stamp", "timestamp", "seconds", "sec", "zeit", "uhrzeit", "tiempo", "temps",
        "tempo",
    ),
    "force": (
        "force", "forces", "wrench", "load", "ft", "f", "fx", "fy", "fz", "fn", "fts", "kraft",
        "fuerza", "forza",
    ),
    "torque": ("torque", "torques", "moment", "tau", "mx", "my", "mz", "tx", "ty", "tz"),
    "penetration": (
        "penetration", "indentation", "depth", "deformation", "compression", "eindringtiefe",
        "tiefe", "profundidad", "profondeur", "profondita", "h",  # as in ISO 14577
    ),
    "position": (
        "position", "positions", "pos", "p", "x", "y", "z", "px", "py", "pz", "s", "pose", "tip",
        "tcp", "ee", "translation", "displacement", "disp", "height", "location", "stroke",
        "extension", "crosshead", "weg", "verschiebung", "posicion", "desplazamiento",
        "deplacement", "posizione", "spostamento",
    ),
    "velocity": ("velocity", "vel", "speed", "v", "vx", "vy", "vz", "linear", "xd"),
    "orientation": ("orientation", "quaternion", "quat", "q", "rotation", "rot"),
    "acceleration": (
        "acceleration", "accelerations", "accelerometer", "accel", "acc", "ax", "ay", "az",
        "beschleunigung", "aceleracion", "accelerazione",
    ),
    "angle": ("angle", "angles", "angular", "joint", "joints", "revolute", "gyro", "gyroscope"),
    "stress": ("stress", "spannung", "pressure"),
    "strain": ("strain", "dehnung"),
    "nothing": (
        "covariance", "effort", "current", "voltage", "temperature", "magnetometer", "static",
    ),
}  # fmt: skip
# The strongest words of a name count: "force_z", "f_tcp" and "force_t" are forces.
_WEAK = {
    "h": -1,
    **dict.fromkeys("xyzst", 0),
    **dict.fromkeys(("tip", "tcp", "ee"), 1),
    **dict.fromkeys((*"fpqv", "vx", "vy", "vz"), 2),
}
# "joint_position", "angular_velocity" and "tf_static" are no position and no velocity.
_DOMINANT = frozenset(
    (*WORDS["angle"], "acceleration", "accelerations", "accel", "covariance", "static")
)
JOINTS = "sensor_msgs/msg/JointState"
# A joint that slides has a position in metres.
SLIDES = frozenset(("prismatic", "slide", "slider", "rail", "linear"))
_KIND = {word: kind for kind, words in WORDS.items() for word in words}
#: Words for commanded, not measured, channels.
WANTED = frozenset(
    ("command", "commands", "commanded", "cmd", "desired", "des", "target", "targets", "setpoint",
     "reference", "ref", "goal", "goals", "action", "actions", "planned", "demand", "demanded")
)  # fmt: skip
# libfranka's names of desired and commanded values.
_DESIRED = re.compile(r"O_d?d?[TP]_EE_[cd](?![^\W\d_])", re.I)
TIP = frozenset(("tip", "tcp", "probe"))
_OF_UNIT = {
    **dict.fromkeys(UNITS["time"], ("time",)),
    **dict.fromkeys(UNITS["force"], ("force",)),
    **dict.fromkeys(UNITS["penetration"], ("penetration", "position")),
    **dict.fromkeys(UNITS["velocity"], ("velocity",)),
    **dict.fromkeys(("Nm", "N·m", "N*m", "mNm"), ("torque",)),
    **dict.fromkeys(("rad", "deg", "°"), ("angle",)),
    **dict.fromkeys(("m/s²", "m/s^2", "m/s2"), ("acceleration",)),
}
#: Words for readings that nobody has converted to a quantity.
_RAW = frozenset(("adc", "raw", "count", "counts", "ticks", "lsb"))
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


def channel_kind(name: str, unit: str | None = None) -> str | None:
    """Return the quantity of a channel: a key of ``WORDS``, or None if the name does not show it.

    Parameters
    ----------
    name : str
        Name of the channel, or the common part of the components of a vector.
    unit : str, optional
        Unit in the recording. Default: the unit at the end of the name.
    """
    unit = plain_unit(unit) if unit else find_unit(name)
    possible = _OF_UNIT.get(unit or "")
    words = [word for word in split_name(name) if word in _KIND and word != unit]
    kinds = [_KIND[word] for word in sorted(words, key=lambda word: _WEAK.get(word, 3))]
    if possible is not None:
        return next((kind for kind in reversed(kinds) if kind in possible), possible[-1])
    kind = kinds[-1] if kinds else None
    if kind in ("position", "velocity"):
        return next((_KIND[word] for word in words if word in _DOMINANT), kind)
    return kind


def is_wanted(name: str) -> bool:
    """Whether the name suggests a commanded, not a measured, channel."""
    return not WANTED.isdisjoint(split_name(name)) or bool(_DESIRED.search(name))


def is_raw(recording: Recording, name: str) -> bool:
    """Whether the name of a channel without a unit suggests raw counts; messages are in SI."""
    own = re.split(r"[/.]", name)[-1]
    stated = recording.unit_of(name) or any(within(name, topic) for topic in recording.types)
    return not stated and not _RAW.isdisjoint(split_name(own))


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
