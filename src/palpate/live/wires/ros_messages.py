"""Messages of ROS as they come: the numbers that are wanted of each, wherever they stand in it.

A message is walked once by its definition, as those of a recording are
(:mod:`palpate.recordings.messages`); every other one with the same bytes wherever a byte says how a
message goes on has its numbers in the same places, and costs a few comparisons.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.live.arrivals import Value
from palpate.live.wires.ordering import NANO
from palpate.recordings.messages.fields import Field, Group, Number, UndecodableError
from palpate.recordings.messages.layout import Layout, Leaf, NumberAt, TimeAt

# bytes: the state of a hundred joints, with their names, has some 6000; to walk so many takes up to
# 4 ms, once.
LONGEST = 16_384
_MOST_LAYOUTS = 64  # kept to compare messages with; a robot's topic has one
_STAMP = "header.stamp"

#: Where in a message the position is, by its type.
POSITIONS = {
    "geometry_msgs/msg/PoseStamped": "pose.position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/Pose": "position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/Point": "",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
    "geometry_msgs/msg/Vector3Stamped": "vector",
    "geometry_msgs/msg/Vector3": "",
    "nav_msgs/msg/Odometry": "pose.pose.position",
    "std_msgs/msg/Float64": "data",
    "std_msgs/msg/Float32": "data",
}
#: Where in a message the force is, by its type.
FORCES = {
    "geometry_msgs/msg/WrenchStamped": "wrench.force",
    "geometry_msgs/msg/Wrench": "force",
    "geometry_msgs/msg/Vector3Stamped": "vector",
    "geometry_msgs/msg/Vector3": "",
    "std_msgs/msg/Float64": "data",
    "std_msgs/msg/Float32": "data",
}


class Reading(NamedTuple):
    """What one message says.

    Attributes
    ----------
    stamp : int or None
        Of its header, ns; None where it has none, or one of 0, which ROS takes for none.
    values : tuple of Value
        In the order of the paths that are wanted.
    """

    stamp: int | None
    values: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class _Places:
    """A layout, as comparisons and struct's formats."""

    checks: tuple[tuple[int, int, bytes], ...]
    stamp: tuple[struct.Struct, int, struct.Struct, int] | None
    numbers: tuple[tuple[tuple[struct.Struct, int], ...], ...]

    def fits(self, message: bytes) -> bool:
        return all(message[start:stop] == want for start, stop, want in self.checks)

    def read(self, message: bytes) -> Reading:
        stamp = None
        if self.stamp is not None:
            seconds, at, nanoseconds, after = self.stamp
            whole: int = seconds.unpack_from(message, at)[0]
            rest: int = nanoseconds.unpack_from(message, after)[0]
            stamp = whole * NANO + rest or None
        found = [
            [float(form.unpack_from(message, at)[0]) for form, at in each] for each in self.numbers
        ]
        values: tuple[Any, ...] = tuple(e[0] if len(e) == 1 else tuple(e) for e in found)
        return Reading(stamp, values)


class MessageReader:
    """Reads the messages of one topic.

    Parameters
    ----------
    topic, type_name : str
        For errors; and the type, such as ``geometry_msgs/msg/WrenchStamped``.
    paths : sequence of str
        The fields that are wanted: a number such as ``wrench.force.z`` or ``position[joint_1]``, or
        a vector such as ``wrench.force``.
    vectors : bool
        Whether vectors are wanted.

    Raises
    ------
    InvalidParameterError
        ROS has no such type.
    MissingExtraError
        rosbags, which knows ROS's types, is not installed.
    """

    def __init__(self, topic: str, type_name: str, paths: Sequence[str], *, vectors: bool) -> None:
        self._paths, self._vectors = tuple(paths), vectors
        self._known: dict[int, list[_Places]] = {}
        self._kept = 0
        fields, self._walk = _walk_of(topic, type_name)
        for path in paths:
            self._check(f"topic {topic} of the type {type_name}", fields, path)

    def _check(self, where: str, fields: Group, path: str) -> None:
        """Refuse a path that no message of the type can have; those into lists are seen later."""
        if "[" in path:
            return
        found: Field = fields
        for name in path.split(".") if path else ():
            below = dict(found.fields) if isinstance(found, Group) else {}
            if name not in below:
                known = ", ".join(below) or "nothing more"
                raise InvalidParameterError(f"{where} has no field {path}: there is {known[:200]}")
            found = below[name]
        axes = dict(found.fields) if isinstance(found, Group) else {}
        vector = all(isinstance(axes.get(axis), Number) for axis in "xyz")
        if isinstance(found, Number) and self._vectors:
            raise InvalidParameterError(
                f"{where}: {path} is a number, where a direction asks for vectors"
            )
        if vector and not self._vectors:
            raise InvalidParameterError(f"{where}: {_vector_words(path)}")
        if not vector and not isinstance(found, Number):
            raise InvalidParameterError(f"{where}: {path} is neither a number nor a vector")

    def read(self, message: bytes) -> Reading:
        """Return what a message says.

        Raises
        ------
        PalpateError
            It is damaged, or has not the fields that are wanted; the message says which.
        """
        for places in self._known.get(len(message), ()):
            if places.fits(message):
                return places.read(message)
        if len(message) > LONGEST:
            raise InvalidParameterError(f"a message of {len(message)} bytes")
        places = self._places(message, self._walk(message))
        if self._kept >= _MOST_LAYOUTS:
            self._known.clear()
            self._kept = 0
        self._known.setdefault(len(message), []).append(places)
        self._kept += 1
        return places.read(message)

    def _places(self, message: bytes, layout: Layout) -> _Places:
        leaves = layout.entities[0].leaves
        checks = []
        for start, want in layout.checks:
            checks.append((start, start + len(want), want.tobytes()))
        stamp = leaves.get(_STAMP)
        return _Places(
            tuple(checks),
            (*_form(stamp.seconds), *_form(stamp.nanoseconds))
            if isinstance(stamp, TimeAt)
            else None,
            tuple(
                tuple(_form(leaf) for leaf in self._leaves(leaves, path)) for path in self._paths
            ),
        )

    def _leaves(self, leaves: dict[str, Leaf], path: str) -> list[Leaf]:
        if path in leaves:
            if self._vectors:
                raise InvalidParameterError(
                    f"{path} is a number, where a direction asks for vectors"
                )
            return [leaves[path]]
        below = [f"{path}.{axis}" if path else axis for axis in "xyz"]
        if not all(each in leaves for each in below):
            known = ", ".join(each for each in leaves if each != _STAMP)
            raise InvalidParameterError(f"it has no {path}, but {known[:200] or 'no number'}")
        if not self._vectors:
            raise InvalidParameterError(_vector_words(path))
        return [leaves[each] for each in below]


def _vector_words(path: str) -> str:
    one = f"{path}.z".removeprefix(".")
    return (
        f"{path or 'it'} is a vector: say --direction, such as 0,0,-1, or name one of its numbers, "
        f"such as {one}"
    )


def _walk_of(topic: str, type_name: str) -> tuple[Group, Callable[[bytes], Layout]]:
    try:
        from palpate.recordings.messages.definitions import message_fields
        from palpate.recordings.messages.walking import walk_cdr
    except ImportError:
        raise MissingExtraError(
            "messages of ROS need rosbags: pip install 'palpate[live]'"
        ) from None
    try:
        fields = message_fields(type_name, "ros2msg", "")
    except UndecodableError:
        raise InvalidParameterError(
            f"topic {topic} is of the type {type_name}, which ROS itself does not define"
        ) from None
    return fields, lambda message: walk_cdr(message, fields)


def _form(leaf: Leaf) -> tuple[struct.Struct, int]:
    assert isinstance(leaf, NumberAt)  # the others are protobuf's
    order = "<" if leaf.dtype[0] not in "<>" else leaf.dtype[0]
    kind = {"f4": "f", "f8": "d", "b1": "B"}.get(leaf.dtype.lstrip("<>"))
    if kind is None:
        sign, size = leaf.dtype.lstrip("<>")[0], leaf.dtype[-1]
        kind = {"1": "b", "2": "h", "4": "i", "8": "q"}[size]
        kind = kind.upper() if sign == "u" else kind
    return struct.Struct(order + kind), leaf.offset
