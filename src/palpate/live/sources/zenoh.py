"""Samples of ROS 2 over Zenoh, as rmw_zenoh sends them: ``zenoh:/pose,/wrench``."""

import time
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple

from palpate.errors import PalpateError
from palpate.live.arrivals import Arrival
from palpate.live.sources.opening import SourceOptions
from palpate.live.wires import ros_topics, zenoh_session
from palpate.live.wires.addresses import WireAddress, parsed
from palpate.live.wires.ros_messages import LONGEST
from palpate.live.wires.ros_topics import Message, RosTopics

if TYPE_CHECKING:
    import zenoh

OPTIONS = (*ros_topics.OPTIONS, *zenoh_session.OPTIONS)
# Messages that wait for the loop, 10 s of two topics at 1 kHz. What comes beyond them is lost, and
# known by its number.
WAITING = 20_000


def open_source(address: str, options: SourceOptions | None = None) -> "Zenoh":
    """Return the source of an address: ``/pose,/wrench?connect=tcp/192.168.1.2:7447``."""
    return Zenoh(parsed("zenoh", address, OPTIONS), options or SourceOptions())


class _Came(NamedTuple):
    topic: int
    key: str
    payload: bytes | None  # None where it is too long
    attachment: bytes | None
    written: int
    length: int


class Zenoh(RosTopics):
    """Topics of ROS 2; their types are known by the keys of the messages.

    Parameters
    ----------
    address : WireAddress
        Topics and options: those of :class:`~palpate.live.wires.ros_topics.RosTopics`, ``domain``;
        ``connect``, where a router or peer listens; ``listen``, to be a peer oneself; ``scouting``
        to find others by multicast.
    options : SourceOptions
        What is known of the samples.
    """

    def __init__(self, address: WireAddress, options: SourceOptions) -> None:
        super().__init__(address, options)
        self._address = address
        self._domain = address.whole("domain", 0, 0, 1_000_000)
        self._queue: SimpleQueue[_Came] = SimpleQueue()
        self._session: zenoh.Session | None = None

    def open(self) -> None:
        """Open the session; a topic that comes later is waited for."""
        self._session = zenoh_session.opened(self._address)
        import zenoh

        for index, name in enumerate(self.names):
            key = zenoh_session.key_of(self._domain, name, "*", "*")
            # In Zenoh's own thread: another one between would cost each message a change of thread.
            took = zenoh.handlers.Callback(self._taker(index), lambda: None, indirect=False)
            self._session.declare_subscriber(key, took)
        self.await_topics()

    def _taker(self, index: int) -> Any:
        queue = self._queue

        def take(sample: "zenoh.Sample") -> None:
            if queue.qsize() >= WAITING:
                return
            payload, extra = sample.payload, sample.attachment
            length = len(payload)
            queue.put(
                _Came(
                    index,
                    str(sample.key_expr),
                    payload.to_bytes() if length <= LONGEST else None,
                    extra.to_bytes() if extra is not None and len(extra) < LONGEST else None,
                    time.time_ns(),
                    length,
                )
            )

        return take

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s]."""
        if self._session is None:
            raise PalpateError(f"{self.name} is not open")
        until, ready = time.monotonic() + timeout, self.ready
        while not ready:
            waited = self._queue.empty()
            try:
                came = self._queue.get(timeout=max(until - time.monotonic(), 0.0))
            except Empty:
                self.settle()
                return None
            self._receive(came, waited=waited)
            if not ready and time.monotonic() >= until:
                return None
        return ready.popleft()

    def _receive(self, came: _Came, *, waited: bool) -> None:
        topic = self.topics[came.topic]
        type_name = ros_topics.ros2_type(came.key.split("/")[-2])
        if topic.type_name and type_name != topic.type_name:
            self.refuse(f"{topic.name}: a publisher of the type {type_name} is not followed")
            return
        self.accept(came.topic, type_name)
        if came.payload is None:
            self.refuse(f"{topic.name}: a message of {came.length} bytes")
            return
        written, number, sender = came.written, None, b""
        if came.attachment is not None:
            known = zenoh_session.attached(came.attachment)
            if known is None:
                self.refuse(
                    f"{topic.name}: an attachment of {len(came.attachment)} bytes that is not "
                    "rmw_zenoh's"
                )
                return
            number, written, sender = known
        message = Message(came.topic, came.payload, written, number, sender)
        self.receive(message, waited=waited)

    def close(self) -> None:
        """Close the session."""
        self.settle()
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]
        self._session = None
