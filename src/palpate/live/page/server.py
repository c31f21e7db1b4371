"""The server of the page: access control, the data it sends, and the requests it accepts."""

import asyncio
import hmac
import json
import mimetypes
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, cast

from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import HTTPConnection
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketClose, WebSocketDisconnect, WebSocketState
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from palpate.errors import InvalidParameterError
from palpate.live.choices import CHOICES, NUMBERS, SWITCHES, LiveCommand, chosen, default_settings
from palpate.live.page.watch import CHANNELS, MOST_ROWS, History, Watch
from palpate.method.estimators import estimator_named
from palpate.output.reports import html
from palpate.validation import number_in, shown

ABORT = "palpate.abort"  # key in a connection's scope: aborts it
_MOST_PIECES = 16  # fragments of one message; a request has hundreds of bytes
#: Simultaneous connections of all kinds.
MOST_CONNECTIONS = 64
#: s for a new connection to send a request.
PATIENCE = 10.0
#: Unread answers to a client.
MOST_UNREAD = 1 << 20  # bytes


@dataclass(slots=True)
class Served:
    """Counts of the server.

    Attributes
    ----------
    browsers : int
        Browsers connected now.
    turned_away : int
        Connections beyond the limit, or without a request within :data:`PATIENCE`.
    stalled : int
        Connections closed because the browser read nothing.
    skipped : int
        Rows not sent to slow browsers.
    malformed : int
        Invalid HTTP or WebSocket frames, which end their connection, and invalid requests.
    refused : int
        Requests without the token, from another origin, with invalid options, or too many.
    """

    browsers: int = 0
    turned_away: int = 0
    stalled: int = 0
    skipped: int = 0
    malformed: int = 0
    refused: int = 0


def protocols(counted: Served) -> tuple[type[H11Protocol], type[WebSocketsSansIOProtocol]]:
    """Return the HTTP and WebSocket protocols, which count refused connections and frames."""

    class Http(H11Protocol):
        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            if len(self.connections) > MOST_CONNECTIONS:
                counted.turned_away += 1
                self.transport.abort()
            self.loop.call_later(PATIENCE, self._give_up)

        def _give_up(self) -> None:
            # It has sent neither a request nor a WebSocket handshake.
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
            # Empty fragments pass any limit of size, but take memory.
            self._pieces = 0 if event.fin else self._pieces + 1
            if self._pieces > _MOST_PIECES:
                self._abort()

        def handle_ping(self) -> None:
            super().handle_ping()
            # A client that never reads the answers to its pings would fill the memory.
            if self.transport.get_write_buffer_size() > MOST_UNREAD:
                self._abort()

        def _abort(self) -> None:
            if not self.transport.is_closing():  # called again for the rest of the data
                counted.malformed += 1
                self.transport.abort()

        def handle_parser_exception(self) -> None:
            counted.malformed += 1
            super().handle_parser_exception()

    return Http, WebSockets


# Access control, before anything answers a request.

COOKIE = "palpate-token"
#: The page loads and sends nothing elsewhere, and no other page may frame it.
HEADERS = {
    "content-security-policy": "default-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}
_WITHOUT_TOKEN = "This page needs its token: open the address that palpate printed.\n"
#: Hosts accepted without a token. Otherwise another site could point its own name here and
#: read the page (DNS rebinding).
_LOOPBACK = ("localhost", "127.0.0.1", "[::1]", "::1")


@dataclass(slots=True)
class Gate:
    """Checks host, token and origin of every request before the application answers it.

    A WebSocket must come from this page: browsers let any site open one.

    Parameters
    ----------
    app : ASGI application
        Answers the accepted requests.
    token : str, optional
        Required in the address or the cookie of every request. Without one, the page listens on
        loopback only.
    counted : Served
        Receives the count of refusals.
    """

    app: ASGIApp
    token: str | None
    counted: Served

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer or refuse a request."""
        # The page may listen on another loopback address, such as 127.0.0.2.
        hosts = (*_LOOPBACK, scope["server"][0]) if self.token is None else ("*",)
        guarded = TrustedHostMiddleware(self._checked, hosts, www_redirect=False)
        await guarded(scope, receive, _add_headers(send))

    async def _checked(self, scope: Scope, receive: Receive, send: Send) -> None:
        asked = HTTPConnection(scope)
        socket = scope["type"] == "websocket"
        given = asked.query_params.get("token", "")
        origin, host = (asked.headers.get(name, "").lower() for name in ("origin", "host"))
        answer: ASGIApp = self.app
        # Cookies are shared among the ports of a host.
        cookie = f"{COOKIE}-{scope['server'][1]}"
        key = given or asked.cookies.get(cookie, "")
        if self.token and not hmac.compare_digest(key.encode(), self.token.encode()):
            self.counted.refused += 1
            answer = WebSocketClose(1008) if socket else PlainTextResponse(_WITHOUT_TOKEN, 403)
        elif socket and origin not in (f"http://{host}", f"https://{host}"):
            self.counted.refused += 1
            answer = WebSocketClose(1008)  # before accept: 403
        elif given and self.token is not None and not socket:
            # The cookie keeps the token, so it disappears from the address.
            answer = RedirectResponse("/", 303)
            answer.set_cookie(cookie, given, httponly=True, samesite="strict")
        await answer(scope, receive, send)


def _add_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return sending


# Requests of a browser.

MOST_BYTES = 4096  # per message
THINNINGS = (1, 2, 4, 8)
MOST_COMMANDS = 20  # in a burst; then one per COMMAND_TIME
COMMAND_TIME = 0.1  # s

_OPTIONS = {
    "hold": (), "resume": (), "reset": (), "tare": ("seconds",), "record": ("on",),
    "depth": ("value",),
}  # fmt: skip
_SETTINGS = frozenset({*SWITCHES, *NUMBERS, *CHOICES, "forgetting_factor", "method"})


def parse_request(text: str | bytes) -> tuple[str, dict[str, Any]]:
    """Return the name and the options of a request.

    Raises
    ------
    InvalidParameterError
        The message is not a request.
    """
    if not isinstance(text, str):
        raise InvalidParameterError("a request must be text")
    try:
        given = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise InvalidParameterError("a request must be JSON") from None
    if not isinstance(given, dict) or not isinstance(given.get("ask"), str):
        raise InvalidParameterError('a request must have a text "ask"')
    return given.pop("ask"), given


def _refuse(name: str) -> None:
    raise ValueError(name)


def build_command(name: str, options: dict[str, Any], loop: Mapping[str, Any]) -> LiveCommand:
    """Return the command to the loop.

    Parameters
    ----------
    name, options : str, dict
        From :func:`parse_request`.
    loop : mapping
        The loop's status, with the options of its source.

    Raises
    ------
    InvalidParameterError
        The command is unknown, or its options are invalid.
    """
    if name in _OPTIONS:
        _only(options, *_OPTIONS[name])
        if name == "tare":
            options = {"seconds": number_in("seconds", options["seconds"], 0.01, 60.0)}
        if name == "depth" and (depth := options["value"]) is not None:  # else the median
            options = {"value": number_in("value", depth, 0.0, 10.0, open_low=True)}
        if name == "record":
            options = {"on": bool(options["on"])}
    elif name == "estimator":
        if set(options) - _SETTINGS or "method" not in options:
            raise InvalidParameterError("estimator takes a method and its main settings only")
        # Made once here, so that invalid settings never reach the loop.
        chosen(estimator_named(options["method"])(), options)
    elif name == "source":  # {"material": …}, {"motion": …} or {"change": …}
        if len(options) != 1:
            raise InvalidParameterError("source takes exactly one option")
        ((what, value),) = options.items()
        if not isinstance(value, str) or value not in (loop.get("offers") or {}).get(what, ()):
            raise InvalidParameterError(f"the source has no such choice of {shown(what)}")
    else:
        raise InvalidParameterError(f"unknown request {shown(name)}")
    return LiveCommand(name, options)  # type: ignore[arg-type]  # one of them


def _only(options: dict[str, Any], *names: str) -> None:
    if set(options) != set(names):
        raise InvalidParameterError(f"options must be {', '.join(names) or 'none'}")


class Allowance:
    """Limits the rate of commands: a burst of 20, then ten per second."""

    def __init__(self) -> None:
        self._left = float(MOST_COMMANDS)
        self._filled = time.monotonic()

    def spend(self) -> None:
        """Use one command.

        Raises
        ------
        InvalidParameterError
            The limit is reached.
        """
        now = time.monotonic()
        self._left = min(self._left + (now - self._filled) / COMMAND_TIME, MOST_COMMANDS)
        self._filled = now
        if self._left < 1.0:
            raise InvalidParameterError("too many requests: wait a moment")
        self._left -= 1.0


# The page's style sheet: the style sheet of the reports and the additions of the page.

STATIC = Path(__file__).parent / "static"


def style_sheet() -> str:
    """Return the style sheet, with the light and dark colours of the figures as variables."""
    return html.STYLE + html.DRAWINGS + (STATIC / "live.css").read_text(encoding="utf-8")


# The server: one page, and a WebSocket to each browser.

FRAME_TIME = 1.0 / 30.0  # s
WORDS_TIME = 0.25  # s
MOST_CLIENTS = 8
#: s without reading a message after which a client is disconnected.
STALLED = 15.0
MOST_BEHIND = 2000  # rows: a client further behind continues with the newest
MOST_REQUESTS = 2000  # per second and client: further ones wait unread


@dataclass(slots=True)
class Client:
    """One browser."""

    socket: WebSocket
    next: int
    recast: int
    until: int  # up to this row it receives the full history, however long that takes
    void: bool = True  # whether it must discard its earlier rows
    every: int = 1
    skipped: int = 0
    version: int = -1
    answers: list[str] = field(default_factory=list)


class Server:
    """Sends every browser the new rows and texts, and the loop the browsers' commands.

    Parameters
    ----------
    watch : Watch
        State of the run.
    send : callable
        Sends a command to the loop.
    """

    def __init__(self, watch: Watch, send: Callable[[LiveCommand], None]) -> None:
        self.watch = watch
        self._send = send
        self.served = Served()
        self._text = "{}"
        self._version = 0
        self._over = False
        self._allowance = Allowance()
        known = {"channels": CHANNELS, "methods": default_settings(), "choices": CHOICES}
        self._hello = json.dumps({"kind": "hello", **known})
        self._tick = asyncio.Event()

    def app(self, token: str | None) -> Gate:
        """Return the ASGI application."""
        # Some systems list .js as plain text, which browsers do not run.
        mimetypes.add_type("text/javascript", ".js")
        inner = Starlette(
            routes=[
                Route("/", lambda _: FileResponse(STATIC / "index.html")),
                Route("/look.css", lambda _: Response(style_sheet(), media_type="text/css")),
                WebSocketRoute("/socket", self._serve),
                Mount("/static", StaticFiles(directory=STATIC)),
            ]
        )
        return Gate(inner, token, self.served)

    async def feed(self) -> None:
        """Read new rows and wake the clients, until the run has ended."""
        looked = 0.0
        while True:
            now = time.monotonic()
            last = self.watch.run.over
            self.watch.take()
            if now - looked >= WORDS_TIME or last:
                looked = now
                self.watch.look()
                self.watch.run.tell(asdict(self.served))
                if self.served.browsers or last:
                    page = self.watch.page(asdict(self.served), ended=last)
                    self._text = json.dumps({"kind": "page", **page})
                    self._version = self._version + 1
                    self._over = last
            self._tick.set()
            self._tick = asyncio.Event()
            if last:
                await asyncio.sleep(0.3)  # so that the last message arrives
                return
            # Without clients, reading before the ring overflows is enough.
            await asyncio.sleep(FRAME_TIME if self.served.browsers else WORDS_TIME)

    async def _serve(self, socket: WebSocket) -> None:
        if self.served.browsers >= MOST_CLIENTS:
            self.served.turned_away += 1
            await socket.accept()
            await socket.close(4429, f"{MOST_CLIENTS} browsers are connected already")
            return
        await socket.accept()
        self.served.browsers += 1
        history = self.watch.history
        client = Client(socket, history.oldest, self.watch.recast, history.total)
        sending = asyncio.create_task(self._send_all(client))
        receiving = asyncio.create_task(self._receive_all(client))
        try:
            await asyncio.wait({sending, receiving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.served.browsers -= 1
            for task in (sending, receiving):
                task.cancel()
            await asyncio.gather(sending, receiving, return_exceptions=True)
            # A stalled client would not read a closing handshake either.
            if socket.client_state is WebSocketState.CONNECTED and ABORT in socket.scope:
                socket.scope[ABORT]()

    async def _send_all(self, client: Client) -> None:
        """Send one message at a time, made only when the client has read the one before."""
        try:
            async with asyncio.timeout(None) as patience:
                clock = asyncio.get_running_loop().time
                patience.reschedule(clock() + STALLED)
                await client.socket.send_text(self._hello)
                while True:
                    tick = self._tick
                    while (message := self._next_message(client)) is not None:
                        patience.reschedule(clock() + STALLED)
                        if isinstance(message, bytes):
                            await client.socket.send_bytes(message)
                        else:
                            await client.socket.send_text(message)
                    patience.reschedule(None)
                    await tick.wait()
        except TimeoutError:
            self.served.stalled += 1
        except (WebSocketDisconnect, RuntimeError):
            return

    def _next_message(self, client: Client) -> bytes | str | None:
        """Return the next message for a client, or None if there is nothing new."""
        if client.answers:
            return client.answers.pop(0)
        if client.version != self._version and self._version and not self._over:
            client.version = self._version
            return self._text
        history = self.watch.history
        if client.recast != self.watch.recast or client.next < history.begins:
            client.recast = self.watch.recast
            self._start_again(client)
        rows = self._rows_for(client, history)
        if rows is None and client.version != self._version and self._version:
            client.version = self._version  # the final text, after the last row
            return self._text
        return rows

    def _rows_for(self, client: Client, history: History) -> bytes | None:
        if client.next >= history.total:
            return None
        if client.next >= client.until and history.total - client.next > MOST_BEHIND:
            newest = history.total - MOST_BEHIND // 4
            client.skipped += newest - client.next
            self.served.skipped += newest - client.next
            client.next = newest
        first = max(client.next, history.oldest)
        until = min(first + MOST_ROWS * client.every, history.total)
        frame = history.frame(
            first,
            until,
            every=client.every,
            dropped=client.skipped,
            void=client.void,
        )
        client.next = until
        client.skipped = 0
        client.void = False
        return frame

    async def _receive_all(self, client: Client) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            began = time.monotonic()
            count = 0
            while True:
                message = await client.socket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                count += 1
                self._answer(client, message.get("text") or message.get("bytes") or "")
                if count >= MOST_REQUESTS // 10:
                    await asyncio.sleep(max(began + 0.1 - time.monotonic(), 0.0))
                    began = time.monotonic()
                    count = 0

    def _answer(self, client: Client, text: str | bytes) -> None:
        """Execute a request, or count it and answer why not."""
        try:
            name, options = parse_request(text)
        except InvalidParameterError as error:
            self.served.malformed += 1
            self._tell(client, str(error))
            return
        try:
            if name == "every":
                self._thin(client, options)
            else:
                command = build_command(name, options, self.watch.loop)
                self._allowance.spend()
                self._send(command)
        except (InvalidParameterError, TypeError) as error:
            self.served.refused += 1
            self._tell(client, str(error))

    def _tell(self, client: Client, words: str) -> None:
        if not client.answers:  # one pending answer is enough
            client.answers.append(json.dumps({"kind": "refused", "words": words[:300]}))

    def _thin(self, client: Client, options: dict[str, Any]) -> None:
        _only(options, "value")
        value = options["value"]
        if value not in THINNINGS or isinstance(value, bool):
            raise InvalidParameterError(f"value must be one of {THINNINGS}")
        client.every = int(value)
        self._start_again(client)

    def _start_again(self, client: Client) -> None:
        history = self.watch.history
        client.next = history.oldest
        client.until = history.total
        client.void = True
