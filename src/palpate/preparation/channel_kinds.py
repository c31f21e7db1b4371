"""The quantity of a channel, from its unit and the words of its name."""

import re

from palpate.recordings import Recording
from palpate.recordings.opening import within
from palpate.recordings.units import UNITS, find_unit, plain_unit, split_name

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
        "normal", "normals",
    ),
}  # fmt: skip
# The strongest words of a name count: "force_z", "f_tcp" and "force_t" are forces.
_WEAK = {
    "h": -1,
    **dict.fromkeys("xyzst", 0),
    **dict.fromkeys(("tip", "tcp", "ee", "normal", "normals", "effort"), 1),
    **dict.fromkeys((*"fpqv", "vx", "vy", "vz"), 2),
}
# "joint_position", "angular_velocity" and "tf_static" are no position and no velocity.
_DOMINANT = frozenset(
    (*WORDS["angle"], "acceleration", "accelerations", "accel", "covariance", "static")
)
_CAMERA = frozenset(("camera", "cam", "image", "images", "rgb", "rgbd", "realsense", "pixel"))
# A sensor of both: its first three numbers are the force.
_FORCE_AND_TORQUE = re.compile(r"forces?[ _/-]*(?:and)?[ _/-]*(?:torque|moment)s?", re.I)
JOINTS = "sensor_msgs/msg/JointState"
# A joint that slides has a position in metres.
SLIDES = frozenset(("prismatic", "slide", "slider", "rail", "linear"))
_KIND = {word: kind for kind, words in WORDS.items() for word in words}
# Words of the channel to prefer: the tip touches the material, and pushes along the normal.
PREFERRED = {
    "position": frozenset(("tip", "tcp", "probe")),
    "force": frozenset(("normal", "fn", "n")),
}
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
    words = split_name(_FORCE_AND_TORQUE.sub("wrench", name))
    if "depth" in words and not _CAMERA.isdisjoint(words):
        return "nothing"
    words = [word for word in words if word in _KIND and word != unit]
    kinds = [_KIND[word] for word in sorted(words, key=lambda word: _WEAK.get(word, 3))]
    if possible is not None:
        return next((kind for kind in reversed(kinds) if kind in possible), possible[-1])
    kind = kinds[-1] if kinds else None
    if kind in ("position", "velocity"):
        return next((_KIND[word] for word in words if word in _DOMINANT), kind)
    return kind


def is_raw(recording: Recording, name: str) -> bool:
    """Whether the name of a channel without a unit suggests raw counts; messages are in SI.

    A raw wrench is one that nobody has tared: UR's ``ft_raw_wrench`` is in N and N·m.
    """
    own = re.split(r"[/.]", name)[-1]
    stated = recording.unit_of(name) or any(within(name, topic) for topic in recording.types)
    words = split_name(own)
    return not stated and "wrench" not in words and not _RAW.isdisjoint(words)
