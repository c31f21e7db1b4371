"""Estimates by ZeroMQ: ``--publish zmq:tcp://127.0.0.1:5556``."""

import json
import math
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from palpate.errors import InvalidParameterError, MissingExtraError, PalpateError
from palpate.live.ring import MOST_PARAMETERS
from palpate.live.wires.addresses import parsed
from palpate.live.wires.estimates import AFTER, BEFORE
from palpate.validation import shown

if TYPE_CHECKING:
    import zmq

OPTIONS = ("bind", "format")
# Messages that wait for each subscriber, 20 s at 1 kHz; what is beyond them is counted.
WAITING = 20_000
#: Number uint64, then float64: what stands before the parameters, parameters, standard errors; NaN
#: in the places of parameters that the law has not.
BINARY = struct.Struct(f"<Q{len(BEFORE) + 2 * MOST_PARAMETERS}d")


class ZeroMQWire:
    """A PUB socket: frames ``estimate`` and the numbers, or ``status`` and words, in JSON.

    Parameters
    ----------
    text : str
        An endpoint, and options: ``bind`` (``yes`` or ``no``), and ``format`` of the estimates:
        ``json`` or ``binary``, :data:`BINARY`; such as ``tcp://127.0.0.1:5556?format=binary``.
    """

    def __init__(self, text: str) -> None:
        address = parsed("zmq", text, OPTIONS)
        self._endpoint = address.target
        self._bind = address.one_of("bind", ("yes", "no")) == "yes"
        self._binary = address.one_of("format", ("json", "binary")) == "binary"
        if "://" not in self._endpoint:
            raise InvalidParameterError(
                "zmq: an endpoint must be such as tcp://127.0.0.1:5556 or ipc:///tmp/estimates, "
                f"not {shown(self._endpoint)}"
            )
        self._number = 0
        self._context: zmq.Context[zmq.Socket[bytes]] | None = None
        self._socket: zmq.Socket[bytes] | None = None

    @property
    def name(self) -> str:
        """Scheme and endpoint."""
        return f"zmq:{self._endpoint}"

    def open(self) -> None:
        """Bind or connect."""
        try:
            import zmq
        except ImportError:
            raise MissingExtraError("ZeroMQ needs pyzmq: pip install 'palpate[live]'") from None
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.PUB)
        self._socket.linger = 200  # ms: for what waits at the end
        self._socket.sndhwm = WAITING
        # Where there is no room it says so, where it would drop without a word.
        self._socket.setsockopt(zmq.XPUB_NODROP, 1)
        try:
            (self._socket.bind if self._bind else self._socket.connect)(self._endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise PalpateError(f"{self.name}: {zmq.strerror(error.errno or 0).lower()}") from None

    def send(self, names: tuple[str, ...], values: Sequence[Sequence[float]]) -> int:
        """Send estimates; return how many there was no room for."""
        refused = 0
        for each in values:
            self._number += 1
            refused += not self._put(b"estimate", self._packed(names, each))
        return refused

    def _packed(self, names: tuple[str, ...], values: Sequence[float]) -> bytes:
        if self._binary:
            values = values[: -len(AFTER)]  # which the status has too: the layout stays
            size = (len(values) - len(BEFORE)) // 2
            rest = [math.nan] * (MOST_PARAMETERS - size)
            first = len(BEFORE) + size
            return BINARY.pack(self._number, *values[:first], *rest, *values[first:], *rest)
        return _json({"number": self._number, **dict(zip(names, values, strict=True))})

    def tell(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> None:
        """Send what is said in words."""
        said = {"state": state, "source": source, "time": 1e-9 * stamp, **values}
        self._put(b"status", _json(said))

    def _put(self, topic: bytes, data: bytes) -> bool:
        import zmq

        assert self._socket is not None  # it is open
        try:
            self._socket.send_multipart([topic, data], zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
        if self._context is not None:
            self._context.term()
        self._socket = self._context = None


def _json(page: dict[str, Any]) -> bytes:
    """JSON has no NaN: what is not known is null."""
    known = {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in page.items()
    }
    return json.dumps(known).encode()
