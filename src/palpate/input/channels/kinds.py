"""The quantity of a channel, from its unit and the words of its name."""

import re
from collections.abc import Iterable, Sequence

from palpate.input.channels.frames import IN_BASE
from palpate.input.channels.vectors import Vector, find_flattened_arrays, find_vectors
from palpate.input.recordings import Recording
from palpate.input.recordings.opening import within
from palpate.input.recordings.recording import holds_numbers
from palpate.input.recordings.units import (
    UNITS,
    find_unit,
    is_wanted,
    plain_unit,
    split_name,
    unit_size,
)

# Words for the quantity of a channel without a unit, also in German, Spanish, French and Italian,
# without accents. The last such word of a name counts: "/tool.wrench.torque" is a torque. h is the
# penetration of ISO 14577.
WORDS: dict[str, str] = {
    "time": "time t stamp timestamp seconds sec zeit uhrzeit tiempo temps tempo",
    "force": "force forces wrench load ft f fx fy fz fn fts kraft fuerza forza",
    "torque": "torque torques moment tau mx my mz tx ty tz",
    "penetration": (
        "penetration indentation depth depths deformation compression eindringtiefe tiefe "
        "profundidad profondeur profondita h"
    ),
    "position": (
        "position positions pos p x y z px py pz s pose tip tcp ee translation displacement "
        "disp height location stroke extension crosshead weg verschiebung posicion "
        "desplazamiento deplacement posizione spostamento"
    ),
    "velocity": "velocity vel speed v vx vy vz linear xd",
    "orientation": "orientation quaternion quat q rotation rot",
    "acceleration": (
        "acceleration accelerations accelerometer accel acc ax ay az beschleunigung "
        "aceleracion accelerazione"
    ),
    "angle": "angle angles angular joint joints revolute gyro gyroscope",
    "stress": "stress spannung pressure",
    "strain": "strain dehnung",
    "nothing": "covariance effort current voltage temperature magnetometer static normal normals",
}
# The strongest words of a name count: "force_z", "f_tcp" and "force_t" are forces.
_WEAK = {
    "h": -1,
    **dict.fromkeys("xyzst", 0),
    **dict.fromkeys(("tip", "tcp", "ee", "normal", "normals", "effort"), 1),
    **dict.fromkeys((*"fpqv", "vx", "vy", "vz"), 2),
}
# "joint_position", "angular_velocity" and "tf_static" are no position and no velocity.
_DOMINANT = frozenset(
    (*WORDS["angle"].split(), "acceleration", "accelerations", "accel", "covariance", "static")
)
_CAMERA = frozenset(("camera", "cam", "image", "images", "rgb", "rgbd", "realsense", "pixel"))
# A sensor of both: its first three numbers are the force.
_FORCE_AND_TORQUE = re.compile(r"forces?[ _/-]*(?:and)?[ _/-]*(?:torque|moment)s?", re.I)
JOINTS = "sensor_msgs/msg/JointState"
# A joint that slides has a position in metres.
SLIDES = frozenset(("prismatic", "slide", "slider", "rail", "linear"))
_KIND = {word: kind for kind, words in WORDS.items() for word in words.split()}
# Words of the channel to prefer: the tip touches the material, and pushes along the normal.
PREFERRED = {
    "position": frozenset(("tip", "tcp", "probe")),
    "force": frozenset(("normal", "fn", "n")),
}
OF_UNIT = {
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
    possible = OF_UNIT.get(unit or "")
    words = split_name(_FORCE_AND_TORQUE.sub("wrench", name))
    if "depth" in words and not _CAMERA.isdisjoint(words):
        return "nothing"
    if "of" in words:  # the velocity of deformation is no deformation
        head = words[: words.index("of")]
        words = words if _KIND.keys().isdisjoint(head) else head
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
    if recording.unit_of(name) or any(within(name, topic) for topic in recording.types):
        return False
    words = split_name(re.split(r"[/.]", name)[-1])
    return "wrench" not in words and not _RAW.isdisjoint(words)


class RecordedKinds:
    """The quantities of a recording's channels and vectors.

    Parameters
    ----------
    recording : Recording
        The recording; channels may be added to it later.
    penetrations : iterable of str
        Channels that are penetrations, whatever their names.

    Attributes
    ----------
    vectors : list of Vector
        The vectors among the channels.
    arrays : list of Vector
        Numbered columns that may be an array written as columns.
    assumed : list of Vector
        The arrays among the vectors: palpate assumes that they are vectors.
    """

    def __init__(self, recording: Recording, penetrations: Iterable[str] = ()) -> None:
        self.recording = recording
        self._kinds: dict[str, str | None] = dict.fromkeys(penetrations, "penetration")
        self.arrays = find_flattened_arrays(recording.channels)
        vectors = find_vectors(recording.channels)
        # If there are depth[0], depth[1] and depth[2], then force[k] are three runs, not axes.
        if any(self.of_vector(vector) == "penetration" for vector in vectors):
            vectors = [v for v in vectors if not v.components[0].endswith("]")]
        self.vectors = [vector for vector in vectors if self.is_one(vector)]
        self.assumed = self._assume_vectors()
        self.add_vectors(self.assumed)
        self.add_vectors([array for array in self.arrays if IN_BASE.match(array.stem)])

    def add_vectors(self, vectors: Iterable[Vector]) -> None:
        """Add vectors that are not known yet."""
        self.vectors += [vector for vector in vectors if vector not in self.vectors]

    def of(self, name: str) -> str | None:
        """Return the quantity of a channel; None if it is unknown."""
        if name not in self._kinds:
            self._kinds[name] = self._find_kind(name)
        return self._kinds[name]

    def _find_kind(self, name: str) -> str | None:
        recording = self.recording
        if recording.channels[name].dtype.kind in "mM":
            return "time"
        kind = channel_kind(name, recording.unit_of(name) or "-")
        if kind in ("position", "velocity") and self._is_joint(name):
            kind = "angle"
        if kind == "angle" and not SLIDES.isdisjoint(split_name(name)):
            return "position"
        if kind is None and name in recording.plots:
            return {"signal": "force", "axis": "position"}[recording.plots[name]]
        return kind

    def of_vector(self, vector: Vector) -> str | None:
        """Return the quantity of a vector; None if it is unknown."""
        if vector.second:
            kind = channel_kind(vector.stem)
            if len(vector) == 4:
                return "angle" if kind == "angle" else "orientation"  # seven joints are no pose
            return "angle" if kind == "position" else "torque"
        name = vector.components[0]
        if channel_kind(name) == "torque":  # the stem of tx, ty and tz is that of a time
            return "torque"
        if "*" not in vector.stem and self._is_joint(name):
            return "angle"
        unit = self.recording.unit_of(name)
        # The stem of x, y, z is empty; then the component's name decides.
        return channel_kind(vector.stem, unit) or channel_kind(name, unit)

    def measures(self, vector: Vector, kind: str) -> bool:
        """Whether a vector measures a quantity; four numbers are an orientation or nothing."""
        right_size = vector.second or len(vector) != 4 or kind == "orientation"
        return right_size and self.of_vector(vector) == kind

    def measuring(self, kind: str, size: int) -> list[tuple[str, ...]]:
        """Return the channels, or the vectors of this size, that measure a quantity."""
        if size > 1:
            sized = (vector for vector in self.vectors if len(vector) == size)
            return [vector.components for vector in sized if self.measures(vector, kind)]
        clocks = set(self.recording.clocks.values())
        names = (n for n in self.outside_vectors() if n not in clocks and self.of(n) == kind)
        return [(name,) for name in names if self._is_numeric(name, kind)]

    def outside_vectors(self) -> list[str]:
        """Return the channels that are in no vector."""
        components = {name for vector in self.vectors for name in vector.components}
        return [name for name in self.recording.channels if name not in components]

    def _is_numeric(self, name: str, kind: str) -> bool:
        values = self.recording.channels[name]
        types = "fiuOmM" if kind == "time" else "fiuO"
        numeric = values.ndim == 1 and values.dtype.kind in types
        return numeric and (values.dtype.kind != "O" or holds_numbers(values))

    def converts(self, name: str, kind: str) -> bool:
        """Whether the unit of a channel, if it has one, is one of this quantity."""
        unit = self.recording.unit_of(name)
        return not unit or unit_size("penetration" if kind == "position" else kind, unit) > 0.0

    def moves(self, names: Sequence[str]) -> bool:
        """Whether any of the channels changes: a fixed frame is not a probe."""
        columns = (self.recording.channels[name] for name in names)
        return any(len(column) > 1 and bool((column != column[0]).any()) for column in columns)

    def is_one(self, vector: Vector) -> bool:
        """Whether all components have one length and one clock, and a vector has this size."""
        recording, names = self.recording, vector.components
        lengths = {len(recording.channels[name]) for name in names}
        clocks = {recording.clocks.get(name) for name in names}
        right_size = vector.second or len(names) == 3 or self.of_vector(vector) == "orientation"
        return len(lengths) == len(clocks) == 1 and right_size

    def _assume_vectors(self) -> list[Vector]:
        """Return position and force if both are arrays written as columns and nothing else fits.

        Numbered columns may as well be three runs or sensors, so otherwise the user must choose.
        """
        arrays = [v for v in self.arrays if not is_wanted(v.components[0])] or self.arrays
        both = [v for kind in ("position", "force") for v in arrays if self.measures(v, kind)]
        if [self.of_vector(vector) for vector in both] != ["position", "force"]:
            return []
        components = {name for vector in arrays for name in vector.components}
        singles = (n for n in self.recording.channels if n not in components and not is_wanted(n))
        if {self.of(name) for name in singles} & {"position", "penetration", "force"}:
            return []
        stems = [vector.stem for vector in both]
        return both + [vector for vector in arrays if vector.second and vector.stem in stems]

    def _is_joint(self, name: str) -> bool:
        """Whether a channel is one of ROS's joints."""
        types = self.recording.types
        return any(types[topic] == JOINTS and within(name, topic) for topic in types)
