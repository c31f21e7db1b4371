"""ROS 2's messages, which DDS and Zenoh share: positions and forces in, estimates out.

The first message is decoded with its definition, as in a recording
(:mod:`palpate.input.recordings.messages`). Later messages whose length fields have the same bytes
have their numbers at the same offsets, so reading them costs only a few comparisons.
"""

import json
import re
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from palpate.errors import InvalidParameterError, PalpateError
from palpate.input.recordings.messages import layout
from palpate.live import schema
from palpate.live.schema import (
    ESTIMATE_TYPE,
    LONGEST_TEXT,
    STATUS_TYPE,
    MessageError,
    message_definition,
    pack_estimate,
)
from palpate.live.sources import SourceOptions, Value
from palpate.live.wires import (
    NANO,
    TOPICS,
    Followed,
    Order,
    Pairing,
    Receipt,
    Stamped,
    Succession,
    Wire,
    WireAddress,
    WireSource,
    topic_names,
)
from palpate.validation import plain

# bytes: a message with the state of a hundred named joints has about 6000. Decoding the first
# message of this length takes up to 4 ms.
LONGEST = 16_384
_MOST_LAYOUTS = 64  # cached; a robot's topic has one
_STAMP = "header.stamp"

_EITHER = {
    "geometry_msgs/msg/Vector3Stamped": "vector",
    "geometry_msgs/msg/Vector3": "",
    "std_msgs/msg/Float64": "data",
    "std_msgs/msg/Float32": "data",
}
#: Field of the position, by message type.
POSITIONS = {
    "geometry_msgs/msg/PoseStamped": "pose.position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/Pose": "position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/Point": "",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
    "nav_msgs/msg/Odometry": "pose.pose.position",
} | _EITHER
#: Name of the orientation's field beside the position's.
ORIENTATIONS = {"position": "orientation", "translation": "rotation"}
#: Field of the force, by message type.
FORCES = {
    "geometry_msgs/msg/WrenchStamped": "wrench.force",
    "geometry_msgs/msg/Wrench": "force",
} | _EITHER


class RosReading(NamedTuple):
    """Timestamp and values of one message.

    Attributes
    ----------
    stamp : int or None
        Timestamp of the header, ns; None if it is missing or 0, which ROS treats as missing.
    values : tuple of Value
        Values of the requested fields, in order; with an orientation, the first is the position
        followed by it, seven numbers.
    """

    stamp: int | None
    values: tuple[Value | tuple[float, ...], ...]


class _Places:
    """A message layout: bytes to compare, and the offsets of the numbers."""

    def __init__(
        self,
        size: int,
        walked: layout.Layout,
        stamp: Any,
        values: list[list[Any]],
    ) -> None:
        self._size = size
        self._checks = [(start, start + len(want), want.tobytes()) for start, want in walked.checks]
        self._stamped = isinstance(stamp, layout.TimeAt)
        self._sizes = [len(each) for each in values]
        found = [stamp.seconds, stamp.nanoseconds] if self._stamped else []
        found += [number for each in values for number in each]
        names = [f"f{k}" for k in range(len(found))]
        formats = [each.dtype for each in found]
        offsets = [each.offset for each in found]
        self._numbers = np.dtype({"names": names, "formats": formats, "offsets": offsets})

    def fits(self, message: bytes) -> bool:
        return len(message) == self._size and all(
            message[start:stop] == want for start, stop, want in self._checks
        )

    def read(self, message: bytes) -> RosReading:
        numbers = iter(np.frombuffer(message, self._numbers, 1).item())
        stamp = next(numbers) * NANO + next(numbers) if self._stamped else 0
        found = [[float(next(numbers)) for _ in range(size)] for size in self._sizes]
        values: tuple[Any, ...] = tuple(e[0] if len(e) == 1 else tuple(e) for e in found)
        return RosReading(stamp or None, values)


class MessageReader:
    """Reads the messages of one topic.

    Parameters
    ----------
    topic, type_name : str
        Name of the topic, for errors, and type, such as ``geometry_msgs/msg/WrenchStamped``.
    paths : sequence of str
        Fields to read: a number such as ``wrench.force.z`` or ``position[joint_1]``, or a vector
        such as ``wrench.force``.
    vectors : bool
        Whether the fields must be vectors.
    orientation : bool
        Whether to read the orientation beside the first field. Default: False.

    Raises
    ------
    InvalidParameterError
        ROS does not define the type, or the type lacks a field.
    """

    def __init__(
        self,
        topic: str,
        type_name: str,
        paths: Sequence[str],
        *,
        vectors: bool,
        orientation: bool = False,
    ) -> None:
        self._paths = tuple(paths)
        self._vectors = vectors
        self._orientation = orientation
        self._known: deque[_Places] = deque(maxlen=_MOST_LAYOUTS)
        try:
            self._fields = layout.message_fields(type_name, "ros2msg", "")
        except layout.UndecodableError:
            raise InvalidParameterError(
                f"topic {topic} has type {type_name}, which ROS does not define: publish a "
                "standard type"
            ) from None
        leaves = layout.leaves_of_empty(self._fields)
        try:  # finds missing fields early, except in lists, whose length is not known yet
            for path in paths:
                if "[" not in path:
                    self._leaves(leaves, path)
            if orientation:
                self._orientation_leaves(leaves)
        except InvalidParameterError as error:
            where = f"topic {topic} of type {type_name}"
            raise InvalidParameterError(f"{where}: {error}") from None

    def read(self, message: bytes) -> RosReading:
        """Return the timestamp and values of a message.

        Raises
        ------
        PalpateError
            The message is damaged or lacks a requested field.
        """
        for places in self._known:
            if places.fits(message):
                return places.read(message)
        if len(message) > LONGEST:
            raise InvalidParameterError(
                f"a message of {len(message)} bytes exceeds the limit of {LONGEST}"
            )
        walked = layout.walk_cdr(message, self._fields)
        leaves = walked.entities[0].leaves
        values = [self._leaves(leaves, path) for path in self._paths]
        if self._orientation:
            values[0] = values[0] + self._orientation_leaves(leaves)
        places = _Places(len(message), walked, leaves.get(_STAMP), values)
        self._known.append(places)
        return places.read(message)

    def _orientation_leaves(
        self,
        leaves: dict[str, layout.MessageNumber],
    ) -> list[layout.MessageNumber]:
        parent, _, name = self._paths[0].rpartition(".")
        path = _below(parent, ORIENTATIONS.get(name, "orientation"))
        if not (components := _components(leaves, path, "xyzw")):
            raise InvalidParameterError(
                "no orientation, which --payload needs: publish a PoseStamped or TransformStamped"
            )
        return components

    def _leaves(
        self,
        leaves: dict[str, layout.MessageNumber],
        path: str,
    ) -> list[layout.MessageNumber]:
        if path in leaves:
            if self._vectors:
                raise InvalidParameterError(
                    f"{path} is a number, but --direction needs a vector: name a vector field"
                )
            return [leaves[path]]
        if not (components := _components(leaves, path, "xyz")):
            known = ", ".join(leaf for leaf in leaves if leaf != _STAMP)
            raise InvalidParameterError(
                f"no field {path}; the message has {known[:200] or 'no numbers'}"
            )
        if not self._vectors:
            raise InvalidParameterError(
                f"{path or 'the message'} is a vector: pass --direction, such as 0,0,-1, or name "
                f"one component, such as {_below(path, 'z')}"
            )
        return components


def _below(path: str, axis: str) -> str:
    return f"{path}.{axis}".removeprefix(".")


def _components(
    leaves: dict[str, layout.MessageNumber],
    path: str,
    axes: str,
) -> list[layout.MessageNumber]:
    """Return the numbers of a vector; empty if the message has none at this path."""
    names = [_below(path, axis) for axis in axes]
    return [leaves[name] for name in names] if leaves.keys() >= set(names) else []


# ROS topics, common to all wires: from messages to positions with forces.

#: Address options of all ROS wires.
OPTIONS = ("position", "force", "at", "tolerance")


@dataclass(slots=True)
class _Topic:
    name: str
    #: For position, force or both: the name, the field requested, and the default fields by type.
    read: list[tuple[str, str | None, dict[str, str]]]
    order: Order
    followed: Followed = field(default_factory=Followed)
    receipt: Receipt = field(default_factory=Receipt)
    type_name: str = ""
    reader: MessageReader | None = None


class RosTopics(WireSource):
    """Base of the ROS sources: turns the messages of a wire into arrivals.

    Parameters
    ----------
    address : WireAddress
        Topics and options. ``position`` and ``force`` name a field, such as ``wrench.force.z``
        (default: :data:`POSITIONS` and :data:`FORCES`). ``at=position`` (default) gives a sample
        at each position, ``at=force`` at each force. ``tolerance`` is as in :class:`Pairing`, s
        (default: two sample times).
    options : SourceOptions
        Options of the source.
    """

    def __init__(self, address: WireAddress, options: SourceOptions) -> None:
        names = topic_names(address, 2)
        super().__init__(f"{address.scheme}:{','.join(names)}", options, len(names))
        self._news: list[str] = []
        self._scheme = address.scheme
        read = [
            ("position", address.options.get("position"), POSITIONS),
            ("force", address.options.get("force"), FORCES),
        ]
        parts = [read] if len(names) == 1 else [[each] for each in read]
        self.topics = [_Topic(*each) for each in zip(names, parts, self._orders, strict=True)]
        self._leads = ("position", "force").index(address.one_of("at", ("position", "force")))
        tolerance = address.number("tolerance", 2.0 * self.sample_time, 0.0, 10.0)
        self._pairing = Pairing(round(tolerance * NANO), self.counts)

    def accept(self, index: int, type_name: str) -> bool:
        """Set the type of a topic, or compare with it; return whether to read such messages.

        Raises
        ------
        InvalidParameterError
            Messages of this type have no known position or force.
        """
        topic = self.topics[index]
        if topic.type_name:
            if topic.type_name != type_name:
                self.refuse(f"{topic.name}: ignoring a second publisher, of type {type_name}")
            return topic.type_name == type_name
        paths = []
        for word, path, role in topic.read:
            if path is None and type_name not in role:
                types = ", ".join(name.rpartition("/")[2] for name in role)
                raise InvalidParameterError(
                    f"{self._scheme}: topic {topic.name} has type {type_name}, without a known "
                    f"{word}: name a field with {word}=…, or publish one of {types}"
                )
            paths.append(role[type_name] if path is None else path)
        posed = self._orientation and topic.read[0][0] == "position"
        topic.reader = MessageReader(
            topic.name,
            type_name,
            paths,
            vectors=self._vectors,
            orientation=posed,
        )
        topic.type_name = type_name
        self._news.append(f"found topic {topic.name} of type {type_name}")
        return True

    def news(self) -> list[str]:
        """Return the messages since the last call."""
        news = self._news
        self._news = []
        return news

    def await_topics(self) -> None:
        """Report the topics without a publisher."""
        waiting = [topic.name for topic in self.topics if not topic.type_name]
        if waiting:
            self._news.append(f"waiting for a publisher of {' and '.join(waiting)}")

    def receive(
        self,
        index: int,
        payload: bytes,
        written: int,
        number: int | None = None,
        *,
        sender: object,
        waited: bool,
    ) -> None:
        """Process a message, and queue the samples that it completes.

        Parameters
        ----------
        index : int
            Index of the topic in the address.
        payload : bytes
            Message in CDR, with its header.
        written : int
            Time of sending, or of arrival if the wire has none, ns since 1970.
        number : int, optional
            The sender's sample number.
        sender : object
            Identity of the publisher.
        waited : bool
            Whether the loop waited for the message; otherwise it came from the queue.
        """
        topic = self.topics[index]
        assert topic.reader is not None  # it was accepted before
        if not topic.followed.accepts(sender):
            self.refuse(f"{topic.name}: ignoring a second publisher")
            return
        try:
            reading = topic.reader.read(payload)
        except PalpateError as fault:
            self.refuse(f"{topic.name}: {fault}")
            return
        stamp = written if reading.stamp is None else reading.stamp
        verdict = topic.order.admit(stamp, number)
        if verdict is Succession.REFUSED:
            return
        there = topic.receipt.there(stamp, waited=waited)
        if len(self.topics) == 1:
            self._give(stamp, reading.values[0], reading.values[1], there)
            return
        sample = Stamped(stamp, reading.values[0], there)
        anew = verdict is Succession.ANEW
        leads = index == self._leads
        for pair in (self._pairing.lead if leads else self._pairing.follow)(sample, anew=anew):
            leader = pair.leader
            second = pair.follower
            position, force = (second, leader) if self._leads else (leader, second)
            self._give(pair.stamp, position, force, pair.there)

    def _give(self, stamp: int, pose: Any, force: Any, there: float) -> None:
        position, orientation = (pose[:3], pose[3:]) if self._orientation else (pose, None)
        self.give(stamp, position, force, there, orientation)


def ros2_type(dds_name: str) -> str:
    """Convert ``std_msgs::msg::dds_::Header_`` to ``std_msgs/msg/Header``."""
    return re.sub(r"^(\w+)::(\w+)::dds_::(\w+)_$", r"\1/\2/\3", dds_name)


def dds_type(ros2_name: str) -> str:
    """Convert ``std_msgs/msg/Header`` to ``std_msgs::msg::dds_::Header_``."""
    package, kind, name = ros2_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


# Estimates as ROS messages.

# DiagnosticStatus: OK, WARN, ERROR, STALE.
_STATE_LEVELS = {"invalid": 1, "held": 1, "lost": 3}
#: CDR, little endian.
_HEAD = b"\0\1\0\0"
# A header: seconds, nanoseconds, and an empty frame with its length, to a multiple of eight bytes.
_HEADER = struct.Struct("<iII4x")
_LATEST = 2**31  # s: the limit of a time in ROS 2


@cache
def typestore() -> Any:
    """Return the types of ROS 2, with palpate's own, to make and encode messages."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.LATEST)
    store.register(get_types_from_msg(message_definition(), ESTIMATE_TYPE))
    return store


class RosWire(Wire):
    """Base of the ROS wires: encodes ROS 2 messages in CDR.

    ``…/estimate`` is a ``palpate_msgs/ContactEstimate``, which ``ros/palpate_msgs`` defines.
    ``…/status`` is a ``diagnostic_msgs/DiagnosticArray``, which every ROS tool shows: the state,
    and each value by name.

    Parameters
    ----------
    address : WireAddress
        Its target is the beginning of the topics' names.
    """

    def __init__(self, address: WireAddress) -> None:
        (prefix,) = topic_names(address, 1)
        self.name = f"{address.scheme}:{prefix}"
        #: Names and types of the topics.
        self.topics = [
            (f"{prefix}/{end}", kind)
            for end, kind in zip(TOPICS, (ESTIMATE_TYPE, STATUS_TYPE), strict=True)
        ]

    def estimate(self, values: dict[str, Any]) -> bytes:
        """Return the message of one sample."""
        return _HEAD + _HEADER.pack(*_seconds(values["time"]), 1) + pack_estimate(values)

    def status(self, values: dict[str, Any]) -> bytes:
        """Return the message of a status; numbers have 15 digits."""
        types = typestore().types
        stamp = types["builtin_interfaces/msg/Time"](*_seconds(values["time"]))
        header = types["std_msgs/msg/Header"](stamp, "")
        pair = types["diagnostic_msgs/msg/KeyValue"]
        one: Any = types["diagnostic_msgs/msg/DiagnosticStatus"](
            diagnostic_level(values),
            "palpate",
            values["state"],
            values["source"],
            [pair(name, _as_text(value)) for name, value in values.items()],
        )
        message = types[STATUS_TYPE](header, [one])
        return bytes(typestore().serialize_cdr(message, STATUS_TYPE, little_endian=True))


def _seconds(time: float) -> tuple[int, int]:
    """Return seconds and nanoseconds; 0 for a time that ROS cannot express."""
    return divmod(round(1e9 * time), NANO) if 0.0 <= time < _LATEST else (0, 0)


def diagnostic_level(values: dict[str, Any]) -> int:
    """Return the level of a status: 0 fine, 1 with care, 2 do not trust, 3 without samples."""
    mistrusted = "do-not-trust" in (values["stiffness_verdict"], values["damping_verdict"])
    return max(_STATE_LEVELS.get(values["state"], 0), 2 * mistrusted)


def _as_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.15g}"
    return value if isinstance(value, str) else json.dumps(plain(value))


def read_estimate(message: bytes) -> dict[str, Any]:
    """Return the fields of a :data:`~palpate.live.schema.ESTIMATE_TYPE` in CDR.

    Raises
    ------
    MessageError
        The message has another schema, or is damaged.
    """
    body = len(_HEAD) + _HEADER.size
    if message[:4] != _HEAD or len(message) < body:
        raise MessageError(f"a message of {len(message)} bytes, which is no little-endian CDR")
    frame = _HEADER.unpack_from(message, len(_HEAD))[2]
    if frame > LONGEST_TEXT:
        raise MessageError(f"a header whose frame has {frame} bytes")
    start = 12 + frame  # of the fields, after the header; they begin at a multiple of eight bytes
    return schema.read_estimate(message[len(_HEAD) + start + -start % 8 :])
