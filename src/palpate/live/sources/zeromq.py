"""Samples by ZeroMQ, from a controller in any language: ``zmq:tcp://127.0.0.1:5555``."""

import time
from typing import TYPE_CHECKING, Any

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.arrivals import Arrival, Counts
from palpate.live.sources.opening import SourceOptions
from palpate.live.wires.addresses import WireAddress, parsed
from palpate.live.wires.ordering import Order, Origin, Receipt, Verdict
from palpate.live.wires.packets import Endpoint, PacketError, unpacked

if TYPE_CHECKING:
    import zmq

OPTIONS = ("socket", "bind", "topic")
# Packets that wait in the socket, 20 s at 1 kHz: the default of 1000 would lose what comes while
# the loop is held up for a second.
WAITING = 20_000


def open_source(address: str, options: SourceOptions | None = None) -> "ZeroMQ":
    """Return the source of an address such as ``tcp://127.0.0.1:5555?socket=pull&bind=yes``."""
    return ZeroMQ(parsed("zmq", address, OPTIONS), options or SourceOptions())


class ZeroMQ(Endpoint):
    """A SUB or PULL socket, that connects or binds.

    Parameters
    ----------
    address : WireAddress
        An endpoint of ZeroMQ, and options: ``socket`` (``sub`` or ``pull``), ``bind`` (``no`` or
        ``yes``), and ``topic``, by which a SUB chooses: the beginning of the first frame of two.
    options : SourceOptions
        What is known of the samples.
    """

    def __init__(self, address: WireAddress, options: SourceOptions) -> None:
        self._pull = address.one_of("socket", ("sub", "pull")) == "pull"
        self._topic = address.text("topic", "")
        if self._pull and self._topic:
            raise InvalidParameterError("zmq: topic is for socket=sub; a PULL socket takes all")
        super().__init__(address, "tcp://127.0.0.1:5555 or ipc:///tmp/robot", binds=False)
        self._vectors = options.vectors
        self.sample_time = options.sample_time or 1e-3
        self.counts, self._origin, self._receipt = Counts(), Origin(), Receipt()
        self._order = Order(self.counts)
        self._poller: zmq.Poller | None = None

    @property
    def origin(self) -> int:
        """What times are counted from, ns by the sender's clock."""
        return self._origin.value or 0

    def open(self) -> None:
        """Bind or connect; a peer that is not there yet is waited for in the background."""
        # No MAXMSGSIZE: it would end the connection for good, and the loop would hear nothing more.
        options: dict[str, int | bytes] = {"LINGER": 0, "RCVHWM": WAITING}
        if not self._pull:
            options["SUBSCRIBE"] = self._topic.encode()
        socket = self._open("PULL" if self._pull else "SUB", options)
        import zmq

        self._poller = zmq.Poller()
        self._poller.register(socket, zmq.POLLIN)

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s]."""
        socket = self._socket
        if socket is None:
            raise PalpateError(f"{self.name} is not open")
        until = time.monotonic() + timeout
        while True:
            waited = not self._poll(0.0)
            if waited and not self._poll(until - time.monotonic()):
                self._order.settle()
                return None
            arrival = self._next(socket, waited=waited)
            if arrival is not None or time.monotonic() >= until:
                return arrival

    def _poll(self, seconds: float) -> bool:
        """Whether a packet is there, or comes in time."""
        assert self._poller is not None  # it is open
        return bool(self._poller.poll(max(round(1e3 * seconds), 0)))

    def _next(self, socket: "zmq.Socket[bytes]", *, waited: bool) -> Arrival | None:
        """The sample of the packet that is there, or None where it holds none."""
        counts = self.counts
        data = socket.recv()
        try:
            if socket.rcvmore:
                first, data = data, socket.recv()
                if socket.rcvmore:
                    frames = 2 + len(socket.recv_multipart())
                    raise PacketError(f"a message of {frames} frames, not 1 or 2")
                del first  # the topic
            packet = unpacked(data, vectors=self._vectors)
        except PacketError as fault:
            counts.malformed += 1
            counts.last_fault = str(fault)
            return None
        if self._order.admit(packet.stamp, packet.number) is Verdict.REFUSED:
            return None
        there = self._receipt.there(packet.stamp, waited=waited)
        return Arrival(self._origin.seconds(packet.stamp), packet.position, packet.force, there)

    def ask(self, options: dict[str, Any]) -> str:
        """A robot cannot be asked for anything."""
        raise InvalidParameterError("a robot on the wire moves as it does: nothing can be chosen")

    def close(self) -> None:
        """Close the socket."""
        self._order.settle()
        super().close()
