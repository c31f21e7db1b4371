"""ZeroMQ: samples from a controller in any language, and estimates back to it.

Little-endian: number uint64, time float64 [s], position 1 or 3 float64 [m], force 1 or 3 float64
[N]. Or an object of JSON with ``time``, ``position``, ``force`` and, optionally, ``number``.
"""

import json
import math
import struct
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from palpate.errors import InvalidParameterError, PalpateError, needed
from palpate.live.ordering import Receipt, Succession, WireAddress, WireSource, parsed
from palpate.live.publishing import AFTER, BEFORE, TOPICS, Wire
from palpate.live.ring import MOST_PARAMETERS
from palpate.live.sources import SourceOptions, Value
from palpate.validation import plain, shown

if TYPE_CHECKING:
    import zmq


NUMBERS = struct.Struct("<Qddd")
VECTORS = struct.Struct("<Qd3d3d")
# bytes; JSON of six numbers with all their digits has some 300.
LONGEST = 4096
# s: three thousand years, and 2⁶³ ns are less than three hundred: a time beyond that is none.
_LATEST = 9e9


class PacketError(PalpateError):
    """A packet that holds no sample; the message says why."""


class Packet(NamedTuple):
    """One sample."""

    number: int | None
    stamp: int  # ns
    position: Value
    force: Value


def packed(number: int, time: float, position: Value, force: Value) -> bytes:
    """Return the packet of a sample: its number, time [s], position [m] and force [N]."""
    if isinstance(position, tuple) and isinstance(force, tuple):
        return VECTORS.pack(number, time, *position, *force)
    return NUMBERS.pack(number, time, position, force)


def unpacked(data: bytes, *, vectors: bool) -> Packet:
    """Return the sample of a packet.

    Raises
    ------
    PacketError
        It holds none, or one of another kind than is asked for.
    """
    size = len(data)
    # A force whose last byte is a brace would be of 10²⁹⁴ N.
    if size in (NUMBERS.size, VECTORS.size) and not (data[:1] == b"{" and data[-1:] == b"}"):
        if (size == VECTORS.size) is not vectors:
            raise _other_kind(vectors)
        if vectors:
            number, time, x, y, z, *force = VECTORS.unpack(data)
            return Packet(number, _stamp(time), (x, y, z), (force[0], force[1], force[2]))
        number, time, position, push = NUMBERS.unpack(data)
        return Packet(number, _stamp(time), position, push)
    if size > LONGEST:
        raise PacketError(f"a packet of {size} bytes")
    return _of_json(data, vectors)


def _of_json(data: bytes, vectors: bool) -> Packet:
    try:
        given = json.loads(data)
    except (ValueError, RecursionError):
        raise PacketError(
            f"a packet of {len(data)} bytes, neither {NUMBERS.size}, {VECTORS.size} nor JSON"
        ) from None
    if not isinstance(given, dict):
        raise PacketError("JSON that is no object")
    number = given.get("number")
    if number is not None and (type(number) is not int or not 0 <= number < 1 << 64):
        raise PacketError("a number that is no whole number of 64 bits")
    for name in ("time", "position", "force"):
        if name not in given:
            raise PacketError(f"JSON without {name}")
    position, force = (_value(given[name], name, vectors) for name in ("position", "force"))
    return Packet(number, _stamp(_float(given["time"], "time")), position, force)


def _stamp(time: float) -> int:
    if not abs(time) < _LATEST:  # or NaN
        raise PacketError("a time that is none")
    return round(time * 1e9)


def _value(value: Any, name: str, vectors: bool) -> Value:
    if isinstance(value, list) is not vectors and value is not None:
        raise _other_kind(vectors)
    if not isinstance(value, list):
        return _float(value, name)
    if len(value) != 3:
        raise PacketError(f"a {name} of {len(value)} numbers, not 3")
    x, y, z = (_float(each, name) for each in value)
    return x, y, z


def _float(value: Any, name: str) -> float:
    if value is None:
        return math.nan  # JSON has no NaN of its own
    if type(value) not in (int, float):
        raise PacketError(f"a {name} that is no number")
    try:
        return float(value)
    except OverflowError:
        raise PacketError(f"a {name} of {len(str(value))} digits") from None


def _other_kind(vectors: bool) -> PacketError:
    numbers = "numbers, where a direction asks for vectors"
    other = numbers if vectors else "vectors: say --direction, such as 0,0,-1"
    return PacketError(f"position and force are {other}")


class Endpoint:
    """A socket of ZeroMQ that connects or binds.

    Parameters
    ----------
    address : WireAddress
        An endpoint of ZeroMQ, and the option ``bind``.
    example : str
        What an endpoint is such as.
    binds : bool
        Whether it binds where ``bind`` does not say.
    """

    def __init__(self, address: WireAddress, example: str, *, binds: bool) -> None:
        choices = ("yes", "no") if binds else ("no", "yes")
        self._endpoint, self._bind = address.target, address.one_of("bind", choices) == "yes"
        if "://" not in self._endpoint:
            raise InvalidParameterError(
                f"zmq: an endpoint must be such as {example}, not {shown(self._endpoint)}"
            )
        self.name = f"zmq:{self._endpoint}"
        self._socket: zmq.Socket[bytes] | None = None

    def _open(self, kind: str, options: Mapping[str, int | bytes]) -> None:
        """Bind or connect; a peer that is not there yet is waited for in the background."""
        zmq = needed("zmq", "ZeroMQ", "live")
        self._socket = socket = zmq.Context().socket(getattr(zmq, kind))
        for name, value in options.items():
            socket.setsockopt(getattr(zmq, name), value)
        try:
            (socket.bind if self._bind else socket.connect)(self._endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise PalpateError(f"{self.name}: {zmq.strerror(error.errno or 0).lower()}") from None

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket.context.term()
        self._socket = None


# Samples by ZeroMQ, from a controller in any language: ``zmq:tcp://127.0.0.1:5555``.

# Packets that wait in the socket, 20 s at 1 kHz: the default of 1000 would lose what comes while
# the loop is held up for a second.
WAITING = 20_000


class ZeroMQ(Endpoint, WireSource):
    """A SUB or PULL socket, that connects or binds.

    Parameters
    ----------
    address : str
        An endpoint of ZeroMQ, and options, such as ``tcp://127.0.0.1:5555?socket=pull&bind=yes``:
        ``socket`` (``sub`` or ``pull``), ``bind`` (``no`` or ``yes``), and ``topic``, by which a
        SUB chooses: the beginning of the first frame of two.
    options : SourceOptions
        What is known of the samples.
    """

    def __init__(self, address: str, options: SourceOptions) -> None:
        given = parsed("zmq", address, ("socket", "bind", "topic"))
        self._pull = given.one_of("socket", ("sub", "pull")) == "pull"
        self._topic = given.options.get("topic", "")
        if self._pull and self._topic:
            raise InvalidParameterError("zmq: topic is for socket=sub; a PULL socket takes all")
        Endpoint.__init__(self, given, "tcp://127.0.0.1:5555 or ipc:///tmp/robot", binds=False)
        WireSource.__init__(self, self.name, options)
        self._receipt = Receipt()

    def open(self) -> None:
        """Bind or connect; a peer that is not there yet is waited for in the background."""
        # No MAXMSGSIZE: it would end the connection for good, and the loop would hear nothing more.
        options: dict[str, int | bytes] = {"LINGER": 0, "RCVHWM": WAITING}
        if not self._pull:
            options["SUBSCRIBE"] = self._topic.encode()
        self._open("PULL" if self._pull else "SUB", options)

    def _receive(self, seconds: float) -> bool:
        if self._socket is None:
            raise self.closed()
        if not self._socket.poll(round(1e3 * seconds)):
            return False
        frames = self._socket.recv_multipart()  # the topic may be the first
        try:
            if len(frames) > 2:
                raise PacketError(f"a message of {len(frames)} frames, not 1 or 2")
            packet = unpacked(frames[-1], vectors=self._vectors)
        except PacketError as fault:
            self.refuse(str(fault))
            return True
        if self._orders[0].admit(packet.stamp, packet.number) is not Succession.REFUSED:
            there = self._receipt.there(packet.stamp, waited=seconds > 0.0)
            self.give(packet.stamp, packet.position, packet.force, there)
        return True

    def close(self) -> None:
        """Close the socket."""
        self.finish_pending()
        super().close()


# Estimates by ZeroMQ: ``--publish zmq:tcp://127.0.0.1:5556``.

SINK_OPTIONS = ("bind", "format")
# Messages that wait for each subscriber, 20 s at 1 kHz; what is beyond them is counted.
#: Number uint64, then float64: what stands before the parameters, parameters, standard errors; NaN
#: in the places of parameters that the law has not.
BINARY = struct.Struct(f"<Q{len(BEFORE) + 2 * MOST_PARAMETERS}d")


class ZeroMQWire(Endpoint, Wire):
    """A PUB socket: frames ``estimate`` and the numbers, or ``status`` and words, in JSON.

    Parameters
    ----------
    text : str
        An endpoint, and options: ``bind`` (``yes`` or ``no``), and ``format`` of the estimates:
        ``json`` or ``binary``, :data:`BINARY`; such as ``tcp://127.0.0.1:5556?format=binary``.
    """

    def __init__(self, text: str) -> None:
        address = parsed("zmq", text, SINK_OPTIONS)
        super().__init__(address, "tcp://127.0.0.1:5556 or ipc:///tmp/estimates", binds=True)
        self._binary = address.one_of("format", ("json", "binary")) == "binary"
        self._number = 0

    def open(self) -> None:
        """Bind or connect."""
        # 200 ms for what waits at the end. Where there is no room it says so, where it would drop
        # without a word.
        self._open("PUB", {"LINGER": 200, "SNDHWM": WAITING, "XPUB_NODROP": 1})

    def estimate(self, names: tuple[str, ...], values: Sequence[float]) -> bytes:
        """Return the second frame of one sample."""
        self._number += 1
        if self._binary:
            values = values[: -len(AFTER)]  # which the status has too: the layout stays
            size = (len(values) - len(BEFORE)) // 2
            rest = [math.nan] * (MOST_PARAMETERS - size)
            first = len(BEFORE) + size
            return BINARY.pack(self._number, *values[:first], *rest, *values[first:], *rest)
        return _json({"number": self._number, **dict(zip(names, values, strict=True))})

    def status(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> bytes:
        """Return the second frame of what is said in words."""
        return _json({"state": state, "source": source, "time": 1e-9 * stamp, **values})

    def put(self, topic: int, data: bytes) -> bool:
        """Send two frames; whether there was room for them."""
        import zmq

        assert self._socket is not None  # it is open
        try:
            self._socket.send_multipart([TOPICS[topic][0].encode(), data], zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True


def _json(page: dict[str, Any]) -> bytes:
    """JSON has no NaN: what is not known is null."""
    return json.dumps(plain(page)).encode()
