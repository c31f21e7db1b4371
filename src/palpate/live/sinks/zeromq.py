"""Estimates by ZeroMQ: ``--publish zmq:tcp://127.0.0.1:5556``."""

import json
import math
import struct
from collections.abc import Sequence
from typing import Any

from palpate.live.ring import MOST_PARAMETERS
from palpate.live.wires.addresses import parsed
from palpate.live.wires.estimates import AFTER, BEFORE
from palpate.live.wires.packets import Endpoint
from palpate.validation import plain

OPTIONS = ("bind", "format")
# Messages that wait for each subscriber, 20 s at 1 kHz; what is beyond them is counted.
WAITING = 20_000
#: Number uint64, then float64: what stands before the parameters, parameters, standard errors; NaN
#: in the places of parameters that the law has not.
BINARY = struct.Struct(f"<Q{len(BEFORE) + 2 * MOST_PARAMETERS}d")


class ZeroMQWire(Endpoint):
    """A PUB socket: frames ``estimate`` and the numbers, or ``status`` and words, in JSON.

    Parameters
    ----------
    text : str
        An endpoint, and options: ``bind`` (``yes`` or ``no``), and ``format`` of the estimates:
        ``json`` or ``binary``, :data:`BINARY`; such as ``tcp://127.0.0.1:5556?format=binary``.
    """

    def __init__(self, text: str) -> None:
        address = parsed("zmq", text, OPTIONS)
        super().__init__(address, "tcp://127.0.0.1:5556 or ipc:///tmp/estimates", binds=True)
        self._binary = address.one_of("format", ("json", "binary")) == "binary"
        self._number = 0

    def open(self) -> None:
        """Bind or connect."""
        # 200 ms for what waits at the end. Where there is no room it says so, where it would drop
        # without a word.
        self._open("PUB", {"LINGER": 200, "SNDHWM": WAITING, "XPUB_NODROP": 1})

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


def _json(page: dict[str, Any]) -> bytes:
    """JSON has no NaN: what is not known is null."""
    return json.dumps(plain(page)).encode()
