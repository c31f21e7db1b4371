"""Samples as ZeroMQ carries them: 32 or 64 bytes, or JSON.

Little-endian: number uint64, time float64 [s], position 1 or 3 float64 [m], force 1 or 3 float64
[N]. Or an object of JSON with ``time``, ``position``, ``force`` and, optionally, ``number``.
"""

import json
import math
import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from palpate.errors import InvalidParameterError, MissingExtraError, PalpateError
from palpate.live.arrivals import Value
from palpate.live.wires.addresses import WireAddress
from palpate.validation import shown

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
            number, time, *six = VECTORS.unpack(data)
            position: Value = (six[0], six[1], six[2])
            force: Value = (six[3], six[4], six[5])
        else:
            number, time, position, force = NUMBERS.unpack(data)
        return Packet(number, _stamp(time), position, force)
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
    time = _number(given, "time")
    return Packet(
        number, _stamp(time), _value(given, "position", vectors), _value(given, "force", vectors)
    )


def _stamp(time: float) -> int:
    if not abs(time) < _LATEST:  # or NaN
        raise PacketError("a time that is none")
    return round(time * 1e9)


def _number(given: dict[str, Any], name: str) -> float:
    if name not in given:
        raise PacketError(f"JSON without {name}")
    return _float(given[name], name)


def _value(given: dict[str, Any], name: str, vectors: bool) -> Value:
    value = given.get(name)
    if isinstance(value, list) is not vectors and value is not None:
        raise _other_kind(vectors)
    if not isinstance(value, list):
        return _number(given, name)
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
    if vectors:
        return PacketError("position and force are numbers, where a direction asks for vectors")
    return PacketError("position and force are vectors: say --direction, such as 0,0,-1")


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
        self._context: zmq.Context[zmq.Socket[bytes]] | None = None
        self._socket: zmq.Socket[bytes] | None = None

    @property
    def name(self) -> str:
        """Scheme and endpoint."""
        return f"zmq:{self._endpoint}"

    def _open(self, kind: str, options: Mapping[str, int | bytes]) -> "zmq.Socket[bytes]":
        """Bind or connect; a peer that is not there yet is waited for in the background."""
        try:
            import zmq
        except ImportError:
            raise MissingExtraError("ZeroMQ needs pyzmq: pip install 'palpate[live]'") from None
        self._context = zmq.Context()
        self._socket = socket = self._context.socket(getattr(zmq, kind))
        for name, value in options.items():
            socket.setsockopt(getattr(zmq, name), value)
        try:
            (socket.bind if self._bind else socket.connect)(self._endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise PalpateError(f"{self.name}: {zmq.strerror(error.errno or 0).lower()}") from None
        return socket

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
        if self._context is not None:
            self._context.term()
        self._socket = self._context = None
