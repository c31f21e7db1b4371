"""Samples of ROS 1, by rospy in a process of its own: ``ros1:/pose,/wrench``."""

import time
from typing import Any

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.arrivals import Arrival, Counts
from palpate.live.sources.opening import SourceOptions
from palpate.live.wires import ros1_process, ros_topics
from palpate.live.wires.addresses import WireAddress, parsed
from palpate.live.wires.ros1_bridge import MESSAGE, STAMPED, TYPE
from palpate.live.wires.ros1_process import Bridge, Frame
from palpate.live.wires.ros_topics import Message, RosTopics
from palpate.recordings.messages.fields import normal_name

OPTIONS = (*ros_topics.OPTIONS, *ros1_process.OPTIONS)


def open_source(address: str, options: SourceOptions | None = None) -> "ROS1":
    """Return the source of an address: ``/pose,/wrench?master=http://robot:11311``."""
    return ROS1(parsed("ros1", address, OPTIONS), options or SourceOptions())


class ROS1:
    """Topics of ROS 1.

    Parameters
    ----------
    address : WireAddress
        Topics and options: those of :class:`~palpate.live.wires.ros_topics.RosTopics`, and
        ``master``.
    options : SourceOptions
        What is known of the samples.
    """

    def __init__(self, address: WireAddress, options: SourceOptions) -> None:
        self._topics = RosTopics(address, options, ros1=True)
        self._master = address.text("master", "")
        self._bridge: Bridge | None = None

    @property
    def name(self) -> str:
        """Scheme and topics."""
        return f"ros1:{','.join(self._topics.names)}"

    @property
    def sample_time(self) -> float:
        """Nominal time between samples, s."""
        return self._topics.sample_time

    @property
    def counts(self) -> Counts:
        """What was lost, repeated, malformed or unpaired so far."""
        return self._topics.counts

    @property
    def origin(self) -> int:
        """What times are counted from, ns by the sender's clock."""
        return self._topics.origin.value or 0

    def open(self) -> None:
        """Become a node; a topic that comes later is waited for."""
        self._bridge = Bridge({"mode": "subscribe", "topics": self._topics.names}, self._master)
        try:
            for index, type_name in self._bridge.types:
                self._meet(index, type_name)
            self._topics.await_topics()
        except PalpateError:
            self.close()
            raise

    def _meet(self, index: int, type_name: str) -> None:
        name, topic = normal_name(type_name), self._topics.topics[index]
        if type_name == "*" or topic.type_name == name:  # another subscriber that takes any type
            return
        if topic.type_name:
            self._topics.refuse(f"{topic.name}: a publisher of the type {type_name} is not read")
            return
        self._topics.accept(index, name)

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s]."""
        if self._bridge is None:
            raise PalpateError(f"{self.name} is not open")
        until, ready = time.monotonic() + timeout, self._topics.ready
        while not ready:
            waited = [not self._bridge.waiting()] * len(self._topics.topics)
            for frame in self._bridge.frames(until - time.monotonic()):
                self._receive(frame, waited)
            if not ready and time.monotonic() >= until:
                self._topics.settle()
                return None
        return ready.popleft()

    def _receive(self, frame: Frame, waited: list[bool]) -> None:
        """Take a frame; ``waited`` says of which topics nothing was there yet."""
        if frame.kind == TYPE:
            self._meet(frame.topic, frame.body.decode("utf-8", "replace"))
        elif frame.kind == MESSAGE:
            topic = self._topics.topics[frame.topic]
            if topic.reader is None:
                return
            written, sender = STAMPED.unpack_from(frame.body)
            message = Message(frame.topic, frame.body[STAMPED.size :], written, None, sender)
            self._topics.receive(message, waited=waited[frame.topic])
            waited[frame.topic] = False

    def news(self) -> list[str]:
        """What is to be said since the last call: topics that were found."""
        return self._topics.news()

    def ask(self, options: dict[str, Any]) -> str:
        """A robot cannot be asked for anything."""
        raise InvalidParameterError("a robot on the wire moves as it does: nothing can be chosen")

    def close(self) -> None:
        """Leave ROS."""
        self._topics.settle()
        if self._bridge is not None:
            self._bridge.close()
        self._bridge = None
