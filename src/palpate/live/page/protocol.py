"""uvicorn's protocols, with bounds on what a hostile client can make them hold."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any, cast

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

ABORT = "palpate.abort"  # in the scope of a connection: ends it at once, without a word
_MOST_PIECES = 16  # of one message; a request has hundreds of bytes
#: Of all kinds, at a time.
MOST_CONNECTIONS = 64
#: That a connection has to ask for something, s.
PATIENCE = 10.0
#: What may wait for a client that asks and does not read.
MOST_UNREAD = 1 << 20  # bytes


@dataclass(slots=True)
class Served:
    """What the page counted.

    Attributes
    ----------
    clients : int
        That watch now.
    turned_away : int
        There was no room for, or asked for nothing in :data:`PATIENCE`.
    stalled : int
        Closed since they took nothing.
    skipped : int
        Rows that a slow client did not get.
    malformed : int
        What was no HTTP, no WebSocket frame, each of which ends its connection, or no request.
    refused : int
        Without the token or from another origin; or for what does not exist, or too often.
    """

    clients: int = 0
    turned_away: int = 0
    stalled: int = 0
    skipped: int = 0
    malformed: int = 0
    refused: int = 0


def protocols(counted: Served) -> tuple[type[H11Protocol], type[WebSocketsSansIOProtocol]]:
    """Return both protocols; what they refuse is counted there."""

    class Http(H11Protocol):
        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            if len(self.connections) > MOST_CONNECTIONS:
                counted.turned_away += 1
                self.transport.abort()
            self.loop.call_later(PATIENCE, self._give_up)

        def _give_up(self) -> None:
            # Neither a request nor a WebSocket has come of it: it only takes room.
            idle = self.cycle is None and self.transport.get_protocol() is self
            if idle and not self.transport.is_closing():
                counted.turned_away += 1
                self.transport.abort()

        def send_400_response(self, msg: str) -> None:
            counted.malformed += 1
            super().send_400_response(msg)

    class WebSockets(WebSocketsSansIOProtocol):
        _pieces = 0

        def handle_connect(self, event: Any) -> None:
            super().handle_connect(event)
            with suppress(AttributeError):  # a handshake that failed has no scope
                cast(dict[str, Any], self.scope)[ABORT] = self.transport.abort

        def handle_cont(self, event: Any) -> None:
            super().handle_cont(event)
            # Pieces without content are within the size of any message, and yet take memory.
            self._pieces = 0 if event.fin else self._pieces + 1
            if self._pieces > _MOST_PIECES:
                self._abort()

        def handle_ping(self) -> None:
            super().handle_ping()
            # Each is answered: who never reads the answers would fill the memory with them.
            if self.transport.get_write_buffer_size() > MOST_UNREAD:
                self._abort()

        def _abort(self) -> None:
            if not self.transport.is_closing():  # what came with it is still gone through
                counted.malformed += 1
                self.transport.abort()

        def handle_parser_exception(self) -> None:
            counted.malformed += 1
            super().handle_parser_exception()

    return Http, WebSockets
