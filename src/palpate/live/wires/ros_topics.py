"""Topics of ROS, on whatever wire they come: from their messages to positions with forces."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.arrivals import Arrival, Counts, Value
from palpate.live.sources.opening import SourceOptions
from palpate.live.wires.addresses import WireAddress, topics_of
from palpate.live.wires.ordering import NANO, Followed, Order, Origin, Receipt, Verdict
from palpate.live.wires.pairing import Pair, Pairing, Stamped
from palpate.live.wires.ros_messages import FORCES, POSITIONS, MessageReader

#: Options of an address that all wires of ROS know.
OPTIONS = ("position", "force", "at", "tolerance")
#: Letters of what is said of a message: a name in it may have as many as a peer likes.
LONGEST_WORDS = 300


@dataclass(frozen=True, slots=True)
class Message:
    """A message as it came.

    Attributes
    ----------
    topic : int
        Which of the topics of the address.
    payload : bytes
        In CDR, with its head.
    written : int
        When it was sent, ns since 1970, or when it came where the wire does not say.
    number : int, optional
        By the sender's count.
    sender : object
        By which publishers are distinguished.
    """

    topic: int
    payload: bytes
    written: int
    number: int | None = None
    sender: object = None


@dataclass(slots=True)
class _Topic:
    name: str
    paths: tuple[str | None, ...]  # of position and force, or one of them; None is by the type
    roles: tuple[dict[str, str], ...]
    order: Order
    followed: Followed = field(default_factory=Followed)
    receipt: Receipt = field(default_factory=Receipt)
    type_name: str = ""
    reader: MessageReader | None = None


class RosTopics:
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
        self.sample_time = options.sample_time or 1e-3
        self.counts, self._origin = Counts(), Origin()
        self.ready: deque[Arrival] = deque()
        self._news: list[str] = []
        self._vectors, self._scheme = options.vectors, address.scheme
        given = (address.options.get("position"), address.options.get("force"))
        roles = (POSITIONS, FORCES)
        if len(names) == 1:
            self.topics = [_Topic(names[0], given, roles, Order(self.counts))]
        else:
            self.topics = [
                _Topic(name, (path,), (role,), Order(self.counts))
                for name, path, role in zip(names, given, roles, strict=True)
            ]
        self._leads = ("position", "force").index(address.one_of("at", ("position", "force")))
        tolerance = address.number("tolerance", 2.0 * self.sample_time, 0.0, 10.0)
        self._pairing = Pairing(round(tolerance * NANO), self.counts)

    @property
    def names(self) -> list[str]:
        """The topics' names."""
        return [topic.name for topic in self.topics]

    @property
    def name(self) -> str:
        """Scheme and topics."""
        return f"{self._scheme}:{','.join(self.names)}"

    @property
    def origin(self) -> int:
        """What times are counted from, ns by the sender's clock."""
        return self._origin.value or 0

    def accept(self, index: int, type_name: str) -> None:
        """Learn the type of a topic.

        Raises
        ------
        InvalidParameterError
            Positions or forces cannot be read from it.
        """
        topic = self.topics[index]
        if topic.type_name == type_name:
            return
        paths = []
        for path, role, word in zip(topic.paths, topic.roles, self._words(topic), strict=True):
            if path is None and type_name not in role:
                raise InvalidParameterError(
                    f"{self._scheme}: topic {topic.name} is of the type {type_name}, of which the "
                    f"{word} is not known: {_advice(word, role)}"
                )
            paths.append(role[type_name] if path is None else path)
        topic.reader = MessageReader(topic.name, type_name, paths, vectors=self._vectors)
        topic.type_name = type_name
        self._news.append(f"topic {topic.name} is there, of the type {type_name}")

    def news(self) -> list[str]:
        """What is to be said since the last call."""
        said, self._news = self._news, []
        return said

    def await_topics(self) -> None:
        """Say of which topics nothing is known yet."""
        waiting = [topic.name for topic in self.topics if not topic.type_name]
        if waiting:
            self._news.append(f"nobody publishes {' or '.join(waiting)} yet: waiting")

    def _words(self, topic: _Topic) -> Sequence[str]:
        if len(topic.paths) == 2:
            return "position", "force"
        return ("position",) if topic is self.topics[0] else ("force",)

    def receive(self, message: Message, *, waited: bool) -> None:
        """Take a message; what comes of it is in ``ready``."""
        topic = self.topics[message.topic]
        assert topic.reader is not None  # it was accepted before
        if not topic.followed.accepts(message.sender):
            self.refuse(f"a second publisher sends on {topic.name}: it is not followed")
            return
        try:
            reading = topic.reader.read(message.payload)
        except PalpateError as fault:
            self.refuse(f"{topic.name}: {fault}")
            return
        stamp = message.written if reading.stamp is None else reading.stamp
        verdict = topic.order.admit(stamp, message.number)
        if verdict is Verdict.REFUSED:
            return
        there = topic.receipt.there(stamp, waited=waited)
        if len(self.topics) == 1:
            self._give(stamp, reading.values[0], reading.values[1], there)
            return
        sample, anew = Stamped(stamp, reading.values[0], there), verdict is Verdict.ANEW
        leads = message.topic == self._leads
        for pair in (self._pairing.lead if leads else self._pairing.follow)(sample, anew=anew):
            self._give_pair(pair)

    def _give_pair(self, pair: Pair) -> None:
        first, second = pair.leader, pair.follower
        if self._leads == 1:
            first, second = second, first
        self._give(pair.stamp, first, second, pair.there)

    def _give(self, stamp: int, position: Value, force: Value, there: float) -> None:
        self.ready.append(Arrival(self._origin.seconds(stamp), position, force, there))

    def refuse(self, words: str, count: int = 1) -> None:
        """Count messages that hold no sample."""
        self.counts.malformed += count
        self.counts.last_fault = words[:LONGEST_WORDS]  # a peer's own may be in it

    def ask(self, options: dict[str, Any]) -> str:
        """A robot cannot be asked for anything."""
        raise InvalidParameterError("a robot on the wire moves as it does: nothing can be chosen")

    def settle(self) -> None:
        """Count what is missing so far."""
        for topic in self.topics:
            topic.order.settle()


def _advice(word: str, role: dict[str, str]) -> str:
    types = ", ".join(name.rpartition("/")[2] for name in role)
    return f"name a field with {word}=…, or publish one of {types}"


def ros2_type(dds_name: str) -> str:
    """``geometry_msgs/msg/WrenchStamped`` of ``geometry_msgs::msg::dds_::WrenchStamped_``."""
    parts = dds_name.split("::")
    if len(parts) == 4 and parts[2] == "dds_" and parts[3].endswith("_"):
        return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"
    return dds_name


def dds_type(ros2_name: str) -> str:
    """``geometry_msgs::msg::dds_::WrenchStamped_`` of ``geometry_msgs/msg/WrenchStamped``."""
    package, kind, name = ros2_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"
