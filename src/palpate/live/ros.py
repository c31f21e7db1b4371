"""Messages of ROS as they come: the numbers that are wanted of each, wherever they stand in it.

A message is walked once by its definition, as those of a recording are
(:mod:`palpate.recordings.messages`); every other one with the same bytes wherever a byte says how a
message goes on has its numbers in the same places, and costs a few comparisons.
"""

import re
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.ordering import (
    NANO,
    Followed,
    Order,
    Pairing,
    Receipt,
    Stamped,
    Succession,
    WireAddress,
    WireSource,
    topics_of,
)
from palpate.live.sources import SourceOptions, Value
from palpate.recordings.messages.layout import (
    Layout,
    MessageNumber,
    TimeAt,
    UndecodableError,
    leaves_of_empty,
    message_fields,
    walk_cdr,
)

# bytes: the state of a hundred joints, with their names, has some 6000; to walk so many takes up to
# 4 ms, once.
LONGEST = 16_384
_MOST_LAYOUTS = 64  # kept to compare messages with; a robot's topic has one
_STAMP = "header.stamp"

_EITHER = {
    "geometry_msgs/msg/Vector3Stamped": "vector",
    "geometry_msgs/msg/Vector3": "",
    "std_msgs/msg/Float64": "data",
    "std_msgs/msg/Float32": "data",
}
#: Where in a message the position is, by its type.
POSITIONS = {
    "geometry_msgs/msg/PoseStamped": "pose.position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/Pose": "position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/Point": "",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
    "nav_msgs/msg/Odometry": "pose.pose.position",
} | _EITHER
#: Where in a message the force is, by its type.
FORCES = {
    "geometry_msgs/msg/WrenchStamped": "wrench.force",
    "geometry_msgs/msg/Wrench": "force",
} | _EITHER


class RosReading(NamedTuple):
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


class _Places:
    """A layout, as comparisons and as one structure of numbers."""

    def __init__(self, size: int, layout: Layout, stamp: Any, values: list[list[Any]]) -> None:
        self._size = size
        self._checks = [(start, start + len(want), want.tobytes()) for start, want in layout.checks]
        self._stamped, self._sizes = isinstance(stamp, TimeAt), [len(each) for each in values]
        found = [stamp.seconds, stamp.nanoseconds] if self._stamped else []
        found += [number for each in values for number in each]
        names, formats = [f"f{k}" for k in range(len(found))], [each.dtype for each in found]
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
    """

    def __init__(self, topic: str, type_name: str, paths: Sequence[str], *, vectors: bool) -> None:
        self._paths, self._vectors = tuple(paths), vectors
        self._known: deque[_Places] = deque(maxlen=_MOST_LAYOUTS)
        try:
            self._fields = message_fields(type_name, "ros2msg", "")
        except UndecodableError:
            raise InvalidParameterError(
                f"topic {topic} is of the type {type_name}, which ROS itself does not define"
            ) from None
        leaves = leaves_of_empty(self._fields)
        try:  # a path that no message of the type can have; those into lists are seen later
            for path in paths:
                if "[" not in path:
                    self._leaves(leaves, path)
        except InvalidParameterError as error:
            where = f"topic {topic} of the type {type_name}"
            raise InvalidParameterError(f"{where}: {error}") from None

    def read(self, message: bytes) -> RosReading:
        """Return what a message says.

        Raises
        ------
        PalpateError
            It is damaged, or has not the fields that are wanted; the message says which.
        """
        for places in self._known:
            if places.fits(message):
                return places.read(message)
        if len(message) > LONGEST:
            raise InvalidParameterError(f"a message of {len(message)} bytes")
        layout = walk_cdr(message, self._fields)
        leaves = layout.entities[0].leaves
        values = [self._leaves(leaves, path) for path in self._paths]
        places = _Places(len(message), layout, leaves.get(_STAMP), values)
        self._known.append(places)
        return places.read(message)

    def _leaves(self, leaves: dict[str, MessageNumber], path: str) -> list[MessageNumber]:
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
            raise InvalidParameterError(_describe_vector(path))
        return [leaves[each] for each in below]


def _describe_vector(path: str) -> str:
    one = f"{path}.z".removeprefix(".")
    return (
        f"{path or 'it'} is a vector: say --direction, such as 0,0,-1, or name one of its numbers, "
        f"such as {one}"
    )


# Topics of ROS, on whatever wire they come: from their messages to positions with forces.

#: Options of an address that all wires of ROS know.
OPTIONS = ("position", "force", "at", "tolerance")


@dataclass(slots=True)
class _Topic:
    name: str
    #: Of position and force, or one of them: what it is, where it is, and where by the type.
    read: list[tuple[str, str | None, dict[str, str]]]
    order: Order
    followed: Followed = field(default_factory=Followed)
    receipt: Receipt = field(default_factory=Receipt)
    type_name: str = ""
    reader: MessageReader | None = None


class RosTopics(WireSource):
    """Takes messages, gives arrivals: a source, but for the wire that the messages come on.

    Parameters
    ----------
    address : WireAddress
        Topics, and options: ``position`` and ``force`` name a field of a message, such as
        ``wrench.force.z``; those of :data:`POSITIONS` and :data:`FORCES` unless given.
        ``at=force`` gives a sample at each force, ``at=position`` at each position. ``tolerance``
        is that of :class:`Pairing`, s; two sample times unless given.
    options : SourceOptions
        What is known of the samples.
    """

    def __init__(self, address: WireAddress, options: SourceOptions) -> None:
        names = topics_of(address, 2)
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
        """Learn the type of a topic; whether it is the one that is followed.

        Raises
        ------
        InvalidParameterError
            Positions or forces cannot be read from it.
        """
        topic = self.topics[index]
        if topic.type_name:
            if topic.type_name != type_name:
                self.refuse(f"{topic.name}: a publisher of the type {type_name} is not followed")
            return topic.type_name == type_name
        paths = []
        for word, path, role in topic.read:
            if path is None and type_name not in role:
                types = ", ".join(name.rpartition("/")[2] for name in role)
                raise InvalidParameterError(
                    f"{self._scheme}: topic {topic.name} is of the type {type_name}, of which the "
                    f"{word} is not known: name a field with {word}=…, or publish one of {types}"
                )
            paths.append(role[type_name] if path is None else path)
        topic.reader = MessageReader(topic.name, type_name, paths, vectors=self._vectors)
        topic.type_name = type_name
        self._news.append(f"topic {topic.name} is there, of the type {type_name}")
        return True

    def news(self) -> list[str]:
        """What is to be said since the last call."""
        said, self._news = self._news, []
        return said

    def await_topics(self) -> None:
        """Say of which topics nothing is known yet."""
        waiting = [topic.name for topic in self.topics if not topic.type_name]
        if waiting:
            self._news.append(f"nobody publishes {' or '.join(waiting)} yet: waiting")

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
        """Take a message, and give what comes of it.

        Parameters
        ----------
        index : int
            Which of the topics of the address.
        payload : bytes
            In CDR, with its head.
        written : int
            When it was sent, ns since 1970, or when it came where the wire does not say.
        number : int, optional
            By the sender's count.
        sender : object
            By which publishers are distinguished.
        waited : bool
            Whether it was waited for, or was there before.
        """
        topic = self.topics[index]
        assert topic.reader is not None  # it was accepted before
        if not topic.followed.accepts(sender):
            self.refuse(f"a second publisher sends on {topic.name}: it is not followed")
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
            self.give(stamp, reading.values[0], reading.values[1], there)
            return
        sample, anew = Stamped(stamp, reading.values[0], there), verdict is Succession.ANEW
        leads = index == self._leads
        for pair in (self._pairing.lead if leads else self._pairing.follow)(sample, anew=anew):
            first, second = pair.leader, pair.follower
            position, force = (second, first) if self._leads else (first, second)
            self.give(pair.stamp, position, force, pair.there)


def ros2_type(dds_name: str) -> str:
    """``geometry_msgs/msg/WrenchStamped`` of ``geometry_msgs::msg::dds_::WrenchStamped_``."""
    return re.sub(r"^(\w+)::(\w+)::dds_::(\w+)_$", r"\1/\2/\3", dds_name)


def dds_type(ros2_name: str) -> str:
    """``geometry_msgs::msg::dds_::WrenchStamped_`` of ``geometry_msgs/msg/WrenchStamped``."""
    package, kind, name = ros2_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"
