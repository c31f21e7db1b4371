"""The server of the page: who may come in, what it sends, and what may be asked of it."""

import asyncio
import hmac
import json
import math
import mimetypes
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlsplit

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
from palpate.estimators import estimator_named
from palpate.live.choices import CHOICES, NUMBERS, SWITCHES, LiveCommand, chosen, offered
from palpate.live.page.watch import CHANNELS, MOST_ROWS, History, Watch
from palpate.reports.html import DRAWINGS, STYLE
from palpate.validation import number_in, shown

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


# Who may come in: what every request has to have before anything answers it.

COOKIE = "palpate-token"
#: Nothing comes from elsewhere, nothing goes elsewhere, and no other page may frame this one.
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
#: Without a token only these names open the page. Else another site could point a name of its own
#: here and read what it is not meant to (DNS rebinding); it would not have the token.
_LOOPBACK = ("localhost", "127.0.0.1", "[::1]", "::1")


@dataclass(slots=True)
class Gate:
    """In front of the application: host, token and origin are checked, and refusals counted.

    A WebSocket has to come from this very page, as no browser keeps another site from opening one.

    Parameters
    ----------
    app : ASGI application
        What answers.
    token : str, optional
        Every request needs it, in its address or in the cookie that this sets. Without one, the
        page listens on loopback only.
    counted : Served
        Where it counts whom it refuses.
    """

    app: ASGIApp
    token: str | None
    counted: Served

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        # The address that it listens on may be another loopback one, such as 127.0.0.2.
        hosts = (*_LOOPBACK, scope["server"][0]) if self.token is None else ("*",)
        guarded = TrustedHostMiddleware(self._checked, hosts, www_redirect=False)
        await guarded(scope, receive, _with_headers(send))

    async def _checked(self, scope: Scope, receive: Receive, send: Send) -> None:
        asked = HTTPConnection(scope)
        socket = scope["type"] == "websocket"
        given = asked.query_params.get("token", "")
        origin, host = (asked.headers.get(name, "").lower() for name in ("origin", "host"))
        answer: ASGIApp = self.app
        key = given or asked.cookies.get(_cookie_name(asked), "")
        if self.token and not hmac.compare_digest(key.encode(), self.token.encode()):
            self.counted.refused += 1
            answer = WebSocketClose(1008) if socket else PlainTextResponse(_WITHOUT_TOKEN, 403)
        elif socket and origin not in (f"http://{host}", f"https://{host}"):
            self.counted.refused += 1
            answer = WebSocketClose(1008)  # before accept: 403
        elif given and self.token is not None and not socket:
            # The browser remembers the token, and it is taken out of the address.
            answer = RedirectResponse("/", 303)
            answer.set_cookie(_cookie_name(asked), given, httponly=True, samesite="strict")
        await answer(scope, receive, send)


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return sending


def _cookie_name(asked: HTTPConnection) -> str:
    """With the port, as browsers give cookies of one port to all others of the machine."""
    host = asked.headers.get("host", "")
    try:
        return f"{COOKIE}-{urlsplit(f'//{host}').port or 80}"
    except ValueError:
        return COOKIE


# What a browser may ask for: messages of a fixed form, and everything else is refused.

MOST_BYTES = 4096  # of a message
THINNINGS = (1, 2, 4, 8)
MOST_COMMANDS = 20  # in a burst; then one in each COMMAND_TIME
COMMAND_TIME = 0.1  # s

#: Of the page itself rather than of the loop.
VIEWS = ("depth", "every")
_OPTIONS = {"hold": (), "resume": (), "reset": (), "tare": ("seconds",), "record": ("on",)}
_SETTINGS = frozenset({*SWITCHES, *NUMBERS, *CHOICES, "forgetting_factor", "method"})


def request_of(text: str | bytes) -> tuple[str, dict[str, Any]]:
    """Return what a message asks for, and with which options.

    Raises
    ------
    InvalidParameterError
        It is no message of the page's.
    """
    if not isinstance(text, str):
        raise InvalidParameterError("a request must be text")
    try:
        given = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise InvalidParameterError("a request must be JSON") from None
    if not isinstance(given, dict) or not isinstance(given.get("ask"), str):
        raise InvalidParameterError('a request must have an "ask"')
    return given.pop("ask"), given


def _refuse(name: str) -> None:
    raise ValueError(name)


def command_of(name: str, options: dict[str, Any], loop: Mapping[str, Any]) -> LiveCommand:
    """Return the loop's command.

    Parameters
    ----------
    name, options : str, dict
        Of :func:`request_of`.
    loop : mapping
        What its board says: which method runs, and what the source offers.

    Raises
    ------
    InvalidParameterError
        There is no such command, or its options are out of range.
    """
    if name in _OPTIONS:
        _only(options, *_OPTIONS[name])
        if name == "tare":
            options = {"seconds": number_in("seconds", options["seconds"], 0.01, 60.0)}
        if name == "record":  # where it goes is said where it runs, never from a browser
            options = {"on": bool(options["on"])}
    elif name == "estimator":
        if set(options) - _SETTINGS or "method" not in options:
            raise InvalidParameterError("an estimator needs a method, and its main settings only")
        # Made here once, so that the loop is asked for nothing that cannot be made.
        chosen(estimator_named(options["method"])(), options)
    elif name == "source":  # {"material": …}, {"motion": …} or {"change": …}
        if len(options) != 1:
            raise InvalidParameterError("a source is asked for one thing at a time")
        ((what, value),) = options.items()
        if not isinstance(value, str) or value not in (loop.get("offers") or {}).get(what, ()):
            raise InvalidParameterError(f"the source offers no such {shown(what)}")
    else:
        raise InvalidParameterError(f"nothing is called {shown(name)}")
    return LiveCommand(name, options)  # type: ignore[arg-type]  # one of them


def _only(options: dict[str, Any], *names: str) -> None:
    if set(options) != set(names):
        raise InvalidParameterError(f"options must be {', '.join(names) or 'none'}")


class Allowance:
    """Commands are a person's: some at once, then ten a second."""

    def __init__(self) -> None:
        self._left, self._filled = float(MOST_COMMANDS), time.monotonic()

    def spend(self) -> None:
        """Take one.

        Raises
        ------
        InvalidParameterError
            None is left.
        """
        now = time.monotonic()
        self._left = min(self._left + (now - self._filled) / COMMAND_TIME, MOST_COMMANDS)
        self._filled = now
        if self._left < 1.0:
            raise InvalidParameterError("too many requests: wait a moment")
        self._left -= 1.0


# The page's style sheet: the look of the reports, and what only this page has.

STATIC = Path(__file__).parent / "static"


def style_sheet() -> str:
    """Return it, with the colours of figures as variables, light and dark."""
    return STYLE + DRAWINGS + (STATIC / "live.css").read_text(encoding="utf-8")


# One page, and a WebSocket to each browser that shows it.

FRAME_TIME = 1.0 / 30.0  # s
WORDS_TIME = 0.25  # s
MOST_CLIENTS = 8
#: A client that takes no message in so long is closed, s.
STALLED = 15.0
MOST_BEHIND = 2000  # rows: one that is further behind goes on with the newest
MOST_REQUESTS = 2000  # a second and client: its next ones wait unread


@dataclass(slots=True)
class Client:
    """One browser."""

    socket: WebSocket
    next: int
    recast: int
    until: int  # so far it gets all, however long that takes: the past that it has not seen
    void: bool = True  # whether its next frame says so
    every: int = 1
    skipped: int = 0
    version: int = -1
    answers: list[str] = field(default_factory=list)


class Server:
    """Gives every browser what a run's history has new, and the loop what they ask for.

    Parameters
    ----------
    watch : Watch
        The run.
    send : callable
        Takes commands to the loop.
    """

    def __init__(self, watch: Watch, send: Callable[[LiveCommand], None]) -> None:
        self.watch, self._send = watch, send
        self.served = Served()
        self._text, self._version, self._over = "{}", 0, False
        self._cached: dict[tuple[int, int, int, int, bool], bytes] = {}
        self._allowance = Allowance()
        known = {"channels": CHANNELS, "methods": offered(), "choices": CHOICES}
        self._hello = json.dumps({"kind": "hello", **known})
        self._tick = asyncio.Event()

    def app(self, token: str | None) -> Gate:
        """Return the ASGI application."""
        # Some machines' own tables call it plain text, which no browser would run.
        mimetypes.add_type("text/javascript", ".js")
        inner = Starlette(
            routes=[
                Route("/", self._index),
                Route("/look.css", self._look),
                WebSocketRoute("/socket", self._serve),
                Mount("/static", StaticFiles(directory=STATIC)),
            ]
        )
        return Gate(inner, token, self.served)

    async def _index(self, _: Any) -> Response:
        return FileResponse(STATIC / "index.html")

    async def _look(self, _: Any) -> Response:
        return Response(style_sheet(), media_type="text/css")

    async def feed(self) -> None:
        """Take what is new and wake the clients, until the run has ended."""
        looked = 0.0
        while True:
            now = time.monotonic()
            last = self.watch.run.over
            self.watch.take()
            if now - looked >= WORDS_TIME or last:
                looked = now
                self.watch.look()
                self.watch.run.tell(asdict(self.served))
                if self.served.clients or last:
                    page = self.watch.page(asdict(self.served), ended=last)
                    self._text = json.dumps({"kind": "page", **page})
                    self._version, self._over = self._version + 1, last
            self._cached.clear()
            self._tick.set()
            self._tick = asyncio.Event()
            if last:
                await asyncio.sleep(0.3)  # so that the last words arrive
                return
            # Nobody watches: what the ring holds is soon enough.
            await asyncio.sleep(FRAME_TIME if self.served.clients else WORDS_TIME)

    async def _serve(self, socket: WebSocket) -> None:
        if self.served.clients >= MOST_CLIENTS:
            self.served.turned_away += 1
            await socket.accept()
            await socket.close(4429, f"{MOST_CLIENTS} browsers watch already")
            return
        await socket.accept()
        self.served.clients += 1
        history = self.watch.history
        client = Client(socket, history.oldest, self.watch.recast, history.total)
        sending = asyncio.create_task(self._send_all(client))
        receiving = asyncio.create_task(self._receive_all(client))
        try:
            await asyncio.wait({sending, receiving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.served.clients -= 1
            for task in (sending, receiving):
                task.cancel()
            await asyncio.gather(sending, receiving, return_exceptions=True)
            # One that takes nothing would not take a farewell either.
            if socket.client_state is WebSocketState.CONNECTED and ABORT in socket.scope:
                socket.scope[ABORT]()

    async def _send_all(self, client: Client) -> None:
        """One message at a time: what a client has not taken is not made for it."""
        try:
            async with asyncio.timeout(None) as patience:
                clock = asyncio.get_running_loop().time
                patience.reschedule(clock() + STALLED)
                await client.socket.send_text(self._hello)
                while True:
                    tick = self._tick
                    while (message := self._next_of(client)) is not None:
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

    def _next_of(self, client: Client) -> bytes | str | None:
        """The next message for a client, or None until there is something new."""
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
            client.version = self._version  # the last words, after the last row
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
        key = (first, until, client.every, client.skipped, client.void)
        if key not in self._cached:
            self._cached[key] = history.frame(
                first, until, every=client.every, dropped=client.skipped, void=client.void
            )
        client.next, client.skipped, client.void = until, 0, False
        return self._cached[key]

    async def _receive_all(self, client: Client) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            began, count = time.monotonic(), 0
            while True:
                message = await client.socket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                count += 1
                self._answer(client, message.get("text") or message.get("bytes") or "")
                if count >= MOST_REQUESTS // 10:
                    await asyncio.sleep(max(began + 0.1 - time.monotonic(), 0.0))
                    began, count = time.monotonic(), 0

    def _answer(self, client: Client, text: str | bytes) -> None:
        """Do what is asked, or count it, and say so where somebody may read it."""
        try:
            name, options = request_of(text)
        except InvalidParameterError as error:
            self.served.malformed += 1
            self._tell(client, str(error))
            return
        try:
            if name in VIEWS:
                self._view(client, name, options)
            else:
                command = command_of(name, options, self.watch.loop)
                self._allowance.spend()
                self._send(command)
        except (InvalidParameterError, TypeError) as error:
            self.served.refused += 1
            self._tell(client, str(error))

    def _tell(self, client: Client, words: str) -> None:
        if not client.answers:  # one that waits is enough
            client.answers.append(json.dumps({"kind": "refused", "words": words[:300]}))

    def _view(self, client: Client, name: str, options: dict[str, Any]) -> None:
        _only(options, "value")
        value = options["value"]
        if name == "depth":
            depth = math.nan  # that of the motion
            if value is not None:
                depth = number_in("value", value, 0.0, 10.0, open_low=True)
            self._allowance.spend()  # all of the history is worked out anew
            self.watch.chosen_depth = depth
            return
        if value not in THINNINGS or isinstance(value, bool):
            raise InvalidParameterError(f"value must be one of {THINNINGS}")
        client.every = int(value)
        self._start_again(client)

    def _start_again(self, client: Client) -> None:
        history = self.watch.history
        client.next, client.until, client.void = history.oldest, history.total, True
