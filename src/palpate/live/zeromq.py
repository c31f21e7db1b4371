"""ZeroMQ: a source of samples from a controller in any language, and a wire for estimates.

A sample is little-endian binary: number uint64, time float64 [s], position 1 or 3 float64 [m],
force 1 or 3 float64 [N], and with a payload the orientation, a quaternion of 4 float64 x, y, z, w.
Or it is a JSON object with ``time``, ``position``, ``force``, with a payload ``orientation``, and,
optionally, ``number``.
"""

import json
import math
import struct
from collections.abc import Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from palpate.errors import InvalidParameterError, PalpateError, import_extra
from palpate.live.schema import as_json, pack_estimate
from palpate.live.sources import Orientation, SourceOptions, Value
from palpate.live.wires import (
    TOPICS,
    Receipt,
    Succession,
    Wire,
    WireAddress,
    WireSource,
    parse_address,
)
from palpate.validation import shown

if TYPE_CHECKING:
    import zmq


#: Lengths of a binary packet, bytes: with numbers, with vectors, and with an orientation too.
LENGTHS = 32, 64, 96
# bytes; JSON of ten numbers with all digits has about 400.
LONGEST = 4096
# s: the limit of 2⁶³ ns; a later time is invalid.
_LATEST = 9e9


class PacketError(PalpateError):
    """The packet has no valid sample; the message says why."""


class Packet(NamedTuple):
    """One sample."""

    number: int | None
    stamp: int  # ns
    position: Value
    force: Value
    orientation: Orientation | None = None


def packed(
    number: int,
    time: float,
    position: Value,
    force: Value,
    orientation: Orientation | None = None,
) -> bytes:
    """Return the packet of a sample: number, time [s], position [m], force [N], orientation."""
    parts = (each if isinstance(each, tuple) else (each,) for each in (time, position, force))
    values = [*chain.from_iterable(parts), *(orientation or ())]
    return struct.pack(f"<Q{len(values)}d", number, *values)


def unpacked(data: bytes, *, vectors: bool, orientation: bool = False) -> Packet:
    """Return the sample of a packet.

    Raises
    ------
    PacketError
        The packet has no valid sample, or numbers instead of vectors, or vice versa.
    """
    size = len(data)
    # A binary force whose last byte is a brace would be about 10²⁹⁴ N.
    if size in LENGTHS and not (data[:1] == b"{" and data[-1:] == b"}"):
        number, time, *values = struct.unpack(f"<Q{size // 8 - 1}d", data)
        if (size > LENGTHS[0]) is not vectors:
            raise _other_kind(vectors)
        if orientation and size < LENGTHS[2]:
            raise PacketError(_NO_ORIENTATION)
        if not vectors:
            return Packet(number, _stamp(time), *values)
        parts: list[Any] = [tuple(values[:3]), tuple(values[3:6]), tuple(values[6:])]
        position, force, pose = parts
        return Packet(number, _stamp(time), position, force, pose if orientation else None)
    if size > LONGEST:
        raise PacketError(f"a packet of {size} bytes, the limit is {LONGEST}")
    return _parse_json(data, vectors, orientation)


_NO_ORIENTATION = "a packet without orientation, which --payload needs"


def _parse_json(data: bytes, vectors: bool, orientation: bool) -> Packet:
    try:
        given = json.loads(data)
    except (ValueError, RecursionError):
        raise PacketError(
            f"a packet of {len(data)} bytes, neither {', '.join(map(str, LENGTHS))} nor JSON"
        ) from None
    if not isinstance(given, dict):
        raise PacketError("JSON that is not an object")
    number = given.get("number")
    if number is not None and (type(number) is not int or not 0 <= number < 1 << 64):
        raise PacketError("a sample number that is not an unsigned 64-bit integer")
    for name in ("time", "position", "force"):
        if name not in given:
            raise PacketError(f"JSON without {name}")
    position, force = (_value(given[name], name, vectors) for name in ("position", "force"))
    pose: Any = None
    if orientation:
        pose = given.get("orientation")
        if not isinstance(pose, list) or len(pose) != 4:
            raise PacketError(_NO_ORIENTATION)
        pose = tuple(_float(each, "orientation") for each in pose)
    return Packet(number, _stamp(_float(given["time"], "time")), position, force, pose)


def _stamp(time: float) -> int:
    if not abs(time) < _LATEST:  # or NaN
        raise PacketError(f"a time that is not within ±{_LATEST:g} s")
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
        return math.nan  # JSON has no NaN
    if type(value) not in (int, float):
        raise PacketError(f"a {name} that is not a number")
    try:
        return float(value)
    except OverflowError:
        raise PacketError(f"a {name} of {len(str(value))} digits") from None


def _other_kind(vectors: bool) -> PacketError:
    numbers = "numbers, not vectors: omit --direction"
    other = numbers if vectors else "vectors: pass --direction, such as 0,0,-1"
    return PacketError(f"position and force are {other}")


class Endpoint:
    """A ZeroMQ socket that connects or binds.

    Parameters
    ----------
    address : WireAddress
        A ZeroMQ endpoint and the option ``bind``.
    example : str
        Example of an endpoint, for errors.
    binds : bool
        Default of the option ``bind``.
    """

    def __init__(self, address: WireAddress, example: str, *, binds: bool) -> None:
        choices = ("yes", "no") if binds else ("no", "yes")
        self._endpoint = address.target
        self._bind = address.one_of("bind", choices) == "yes"
        if "://" not in self._endpoint:
            raise InvalidParameterError(
                f"zmq: an endpoint must have the form {example}, not {shown(self._endpoint)}"
            )
        self.name = f"zmq:{self._endpoint}"
        self._socket: zmq.Socket[bytes] | None = None

    def _open(self, kind: str, options: Mapping[str, int | bytes]) -> None:
        """Bind or connect; the peer may appear later."""
        zmq = import_extra("zmq", "ZeroMQ", "live")
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


# Samples over ZeroMQ: ``zmq:tcp://127.0.0.1:5555``.

# Queue length, 20 s at 1 kHz: with the default of 1000, a loop that stalls for a second loses
# samples.
WAITING = 20_000


class ZeroMQ(Endpoint, WireSource):
    """Source with a SUB or PULL socket that connects or binds.

    Parameters
    ----------
    address : str
        A ZeroMQ endpoint and options, such as ``tcp://127.0.0.1:5555?socket=pull&bind=yes``:
        ``socket`` (``sub``, the default, or ``pull``), ``bind`` (``no``, the default, or ``yes``),
        and ``topic``, the beginning of the first of two frames, for a SUB socket.
    options : SourceOptions
        Options of the source.
    """

    def __init__(self, address: str, options: SourceOptions) -> None:
        given = parse_address("zmq", address, ("socket", "bind", "topic"))
        self._pull = given.one_of("socket", ("sub", "pull")) == "pull"
        self._topic = given.options.get("topic", "")
        if self._pull and self._topic:
            raise InvalidParameterError(
                "zmq: a PULL socket has no topic: use socket=sub, or omit topic"
            )
        Endpoint.__init__(self, given, "tcp://127.0.0.1:5555 or ipc:///tmp/robot", binds=False)
        WireSource.__init__(self, self.name, options)
        self._receipt = Receipt()

    def open(self) -> None:
        """Bind or connect; the peer may appear later."""
        # No MAXMSGSIZE: a longer message would end the connection for good.
        options: dict[str, int | bytes] = {"LINGER": 0, "RCVHWM": WAITING}
        if not self._pull:
            options["SUBSCRIBE"] = self._topic.encode()
        self._open("PULL" if self._pull else "SUB", options)

    def _receive(self, seconds: float) -> bool:
        if self._socket is None:
            raise self.not_open_error()
        if not self._socket.poll(round(1e3 * seconds)):
            return False
        frames = self._socket.recv_multipart()  # the first may be the topic
        try:
            if len(frames) > 2:
                raise PacketError(f"a message of {len(frames)} frames, not 1 or 2")
            packet = unpacked(frames[-1], vectors=self._vectors, orientation=self._orientation)
        except PacketError as fault:
            self.refuse(str(fault))
            return True
        if self._orders[0].admit(packet.stamp, packet.number) is not Succession.REFUSED:
            there = self._receipt.there(packet.stamp, waited=seconds > 0.0)
            self.give(packet.stamp, packet.position, packet.force, there, packet.orientation)
        return True

    def close(self) -> None:
        """Close the socket."""
        self.finish_pending()
        super().close()


# Estimates over ZeroMQ: ``--publish zmq:tcp://127.0.0.1:5556``.

SINK_OPTIONS = ("bind", "format")


class ZeroMQWire(Endpoint, Wire):
    """Publishes on a PUB socket: frames ``estimate`` and an estimate, or ``status`` and JSON.

    Parameters
    ----------
    text : str
        An endpoint and options, such as ``tcp://127.0.0.1:5556?format=binary``: ``bind`` (``yes``,
        the default, or ``no``), and the ``format`` of the estimates (``json``, the default, or
        ``binary``: :func:`palpate.live.schema.pack_estimate`).
    """

    def __init__(self, text: str) -> None:
        address = parse_address("zmq", text, SINK_OPTIONS)
        super().__init__(address, "tcp://127.0.0.1:5556 or ipc:///tmp/estimates", binds=True)
        self._binary = address.one_of("format", ("json", "binary")) == "binary"

    def open(self) -> None:
        """Bind or connect."""
        # 200 ms to send the queue at the end. XPUB_NODROP reports a full queue, so that drops are
        # counted.
        self._open("PUB", {"LINGER": 200, "SNDHWM": WAITING, "XPUB_NODROP": 1})

    def estimate(self, values: dict[str, Any]) -> bytes:
        """Return the second frame of one sample."""
        return pack_estimate(values) if self._binary else as_json(values)

    def status(self, values: dict[str, Any]) -> bytes:
        """Return the second frame of a status."""
        return as_json(values)

    def put(self, topic: int, data: bytes) -> bool:
        """Send two frames; return whether the queue had room."""
        import zmq

        assert self._socket is not None  # it is open
        try:
            self._socket.send_multipart([TOPICS[topic].encode(), data], zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True
