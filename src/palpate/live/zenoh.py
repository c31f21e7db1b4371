"""ROS 2 over Zenoh, compatible with rmw_zenoh: a source of samples, and a wire for estimates."""

import json
import struct
import time
import uuid
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple

from palpate.errors import InvalidParameterError, PalpateError, import_extra
from palpate.live import ros
from palpate.live.ros import LONGEST, RosTopics, RosWire, dds_type, typestore
from palpate.live.sources import SourceOptions
from palpate.live.wires import WireAddress, parse_address
from palpate.validation import shown

if TYPE_CHECKING:
    import zenoh


#: Options of an address: the domain, and how the session reaches its peers.
OPTIONS = ("domain", "connect", "listen", "scouting")
#: Address of rmw_zenoh's router.
ROUTER = "tcp/127.0.0.1:7447"
# bytes: the session drops longer messages before they take memory.
_LONGEST = 1 << 20
# Sample number and time of sending, each int64, then the length of the publisher's id, and the id.
_ATTACHED = struct.Struct("<qqB16s")


def attachment(number: int, written: int, sender: bytes) -> bytes:
    """Return a message's attachment: number, time of sending, ns since 1970, sender, 16 bytes."""
    return _ATTACHED.pack(number, written, 16, sender)


def parse_attachment(data: bytes) -> tuple[int, int, bytes] | None:
    """Return number, time (ns since 1970) and sender; None if it is not an rmw_zenoh attachment."""
    if len(data) != _ATTACHED.size or data[16] != 16:
        return None
    number, written, _, sender = _ATTACHED.unpack(data)
    return number, written, sender


def topic_key(domain: int, topic: str, type_name: str, type_hash: str) -> str:
    """Return the Zenoh key of a ROS 2 topic; the type's name and hash may be ``*``."""
    name = type_name if type_name == "*" else dds_type(type_name)
    return f"{domain}/{topic.strip('/')}/{name}/{type_hash}"


def open_session(address: WireAddress) -> "zenoh.Session":
    """Open a session: a client of a router or peer, or a peer itself if ``listen`` is given.

    Raises
    ------
    PalpateError
        Nothing answers at the address, or the address to listen on is in use.
    """
    zenoh = import_extra("zenoh", "ROS 2 over Zenoh", "live")
    listen = _endpoints(address, "listen", "")
    connect = _endpoints(address, "connect", "" if listen else ROUTER)
    scouting = address.one_of("scouting", ("no", "yes")) == "yes"
    settings = {
        "mode": "peer" if listen else "client",
        "listen/endpoints": listen,
        "connect/endpoints": connect,
        "scouting/multicast/enabled": scouting,
        "scouting/gossip/enabled": scouting,
        "transport/link/rx/max_message_size": _LONGEST,
    }
    config = zenoh.Config()
    try:
        for name, value in settings.items():
            config.insert_json5(name, json.dumps(value))
    except zenoh.ZError as error:
        raise InvalidParameterError(
            f"zenoh: an address must have the form {ROUTER}: {_first_line(error)}"
        ) from None
    try:
        return zenoh.open(config)  # type: ignore[no-any-return]
    except zenoh.ZError as error:
        taken = "Address already in use" in str(error)
        if taken or (listen and "listener" in str(error)):
            reason = "address already in use" if taken else _first_line(error)
            raise PalpateError(f"zenoh: {', '.join(listen)}: {reason}") from None
        raise PalpateError(
            f"zenoh: no answer from {', '.join(connect)}: start the router with `ros2 run "
            "rmw_zenoh_cpp rmw_zenohd`, or pass its address as connect=tcp/ADDRESS:7447"
        ) from None


def _endpoints(address: WireAddress, name: str, default: str) -> list[str]:
    given = address.options.get(name, default)
    endpoints = given.split(",") if given else []
    for endpoint in endpoints:
        if "/" not in endpoint:
            raise InvalidParameterError(
                f"zenoh: {name} must have the form {ROUTER}, not {shown(endpoint)}"
            )
    return endpoints


def _first_line(error: Exception) -> str:
    return str(error).partition(" at /")[0].splitlines()[0][:120]


# Samples from ROS 2 over Zenoh: ``zenoh:/pose,/wrench``.

# Queue length, 10 s of two topics at 1 kHz. Further messages are lost; their numbers reveal that.
WAITING = 20_000


class _Came(NamedTuple):
    topic: int
    key: str
    payload: bytes | None  # None if too long
    attachment: bytes | None
    written: int
    length: int


class Zenoh(RosTopics):
    """Source that subscribes to ROS 2 topics; the keys of the messages contain their types.

    Parameters
    ----------
    address : str
        Topics and options, such as ``/pose,/wrench?connect=tcp/192.168.1.2:7447``. The options are
        ``domain`` (default: 0), ``connect``, the address of a router or peer, ``listen``, to become
        a peer, ``scouting``, to find peers by multicast, and the options of
        :class:`~palpate.live.ros.RosTopics`.
    options : SourceOptions
        Options of the source.
    """

    def __init__(self, address: str, options: SourceOptions) -> None:
        self._address = parse_address("zenoh", address, (*ros.OPTIONS, *OPTIONS))
        super().__init__(self._address, options)
        self._domain = self._address.whole("domain", 0, 0, 1_000_000)
        self._queue: SimpleQueue[_Came] = SimpleQueue()
        self._session: zenoh.Session | None = None

    def open(self) -> None:
        """Open the session; topics may appear later."""
        self._session = open_session(self._address)
        import zenoh

        for index, topic in enumerate(self.topics):
            key = topic_key(self._domain, topic.name, "*", "*")
            # Called in Zenoh's own thread, which saves a change of thread per message.
            took = zenoh.handlers.Callback(self._taker(index), lambda: None, indirect=False)
            self._session.declare_subscriber(key, took)
        self.await_topics()

    def _taker(self, index: int) -> Any:
        queue = self._queue

        def take(sample: "zenoh.Sample") -> None:
            if queue.qsize() >= WAITING:
                return
            payload = sample.payload
            extra = sample.attachment
            length = len(payload)
            key = str(sample.key_expr)
            data = payload.to_bytes() if length <= LONGEST else None
            about = extra.to_bytes() if extra is not None and len(extra) < LONGEST else None
            queue.put(_Came(index, key, data, about, time.time_ns(), length))

        return take

    def _receive(self, seconds: float) -> bool:
        if self._session is None:
            raise self.not_open_error()
        try:
            came = self._queue.get(timeout=seconds)
        except Empty:
            return False
        topic = self.topics[came.topic]
        extra = came.attachment
        known = (None, came.written, b"") if extra is None else parse_attachment(extra)
        if not self.accept(came.topic, ros.ros2_type(came.key.split("/")[-2])):
            return True
        if came.payload is None:
            self.refuse(f"{topic.name}: a message of {came.length} bytes, the limit is {LONGEST}")
        elif known is None:
            size = len(extra or b"")
            self.refuse(f"{topic.name}: an attachment of {size} bytes, not from rmw_zenoh")
        else:
            number, written, sender = known
            waited = seconds > 0.0
            self.receive(came.topic, came.payload, written, number, sender=sender, waited=waited)
        return True

    def close(self) -> None:
        """Close the session."""
        self.finish_pending()
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]
        self._session = None


# Estimates for ROS 2 over Zenoh: ``--publish zenoh:/palpate``.


class ZenohWire(RosWire):
    """Publishes estimates and status on two topics, under the keys of rmw_zenoh.

    Parameters
    ----------
    address : str
        Prefix of the topics, and options: ``domain``, ``connect``, ``listen`` and ``scouting``,
        such as ``/palpate?connect=tcp/192.168.1.2:7447``.
    """

    def __init__(self, address: str) -> None:
        self._address = parse_address("zenoh", address, OPTIONS)
        super().__init__(self._address)
        self._domain = self._address.whole("domain", 0, 0, 1_000_000)
        self._session: zenoh.Session | None = None
        self._publishers: list[zenoh.Publisher] = []
        self._tokens: list[Any] = []
        self._numbers = [0, 0]
        self._sender = uuid.uuid4().bytes

    def open(self) -> None:
        """Open the session, and announce a node and topics to ``ros2 topic list``."""
        self._session = open_session(self._address)
        import zenoh

        node = f"@ros2_lv/{self._domain}/{self._session.zid()}/0"
        declare = self._session.liveliness().declare_token
        self._tokens = [declare(f"{node}/0/NN/%/%/palpate")]
        for index, (name, type_name) in enumerate(self.topics):
            kind = dds_type(type_name)
            checksum = typestore().hash_rihs01(type_name)
            self._publishers.append(
                self._session.declare_publisher(
                    topic_key(self._domain, name, type_name, checksum),
                    congestion_control=zenoh.CongestionControl.BLOCK,
                    express=True,  # send at once, unbatched
                )
            )
            mangled = name.replace("/", "%")
            # Only the queue depth differs from ROS's default quality of service.
            published = f"{mangled}/{kind}/{checksum}/::,1000:,:,:,,"
            self._tokens.append(declare(f"{node}/{index + 1}/MP/%/%/palpate/{published}"))

    def put(self, topic: int, data: bytes) -> bool:
        """Send a message; waits while the queue is full."""
        import zenoh

        self._numbers[topic] += 1
        attached = attachment(self._numbers[topic], time.time_ns(), self._sender)
        try:
            self._publishers[topic].put(data, attachment=attached)
        except zenoh.ZError as error:
            raise PalpateError(f"{self.name}: {str(error).partition(' at /')[0]}") from None
        return True

    def close(self) -> None:
        """Close the session."""
        self._publishers.clear()
        self._tokens.clear()
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]
        self._session = None
