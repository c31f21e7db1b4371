"""One page, and a WebSocket to each browser that shows it."""

import asyncio
import json
import mimetypes
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import Any

from starlette.applications import Starlette
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from palpate.errors import InvalidParameterError
from palpate.live.choices import CHOICES, offered
from palpate.live.commands import Command
from palpate.live.page.channels import CHANNELS
from palpate.live.page.gate import Gate
from palpate.live.page.history import MOST_ROWS, History
from palpate.live.page.look import STATIC, style_sheet
from palpate.live.page.protocol import ABORT, Served
from palpate.live.page.requests import (
    VIEWS,
    Allowance,
    command_of,
    depth_of,
    request_of,
    thinning_of,
)
from palpate.live.page.watch import Watch

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
    words: int = -1
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

    def __init__(self, watch: Watch, send: Callable[[Command], None]) -> None:
        self.watch, self._send = watch, send
        self.served = Served()
        self._text, self._version, self._over = "{}", 0, False
        self._cached: dict[tuple[int, int, int, int, bool], bytes] = {}
        self._allowance = Allowance()
        self._tick = asyncio.Event()
        self._methods = offered()

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
                self.watch.run.tell(self.counts())
                if self.served.clients or last:
                    page = self.watch.page(self.counts())
                    self._text = json.dumps({"kind": "page", **page, "ended": last})
                    self._version, self._over = self._version + 1, last
            self._cached.clear()
            self._tick.set()
            self._tick = asyncio.Event()
            if last:
                await asyncio.sleep(0.3)  # so that the last words arrive
                return
            # Nobody watches: what the ring holds is soon enough.
            await asyncio.sleep(FRAME_TIME if self.served.clients else WORDS_TIME)

    def counts(self) -> dict[str, Any]:
        """Return what was counted, as plain numbers."""
        return asdict(self.served)

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
        hello = {
            "kind": "hello",
            "channels": CHANNELS,
            "methods": self._methods,
            "choices": CHOICES,
        }
        sending = asyncio.create_task(self._send_all(client, json.dumps(hello)))
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

    async def _send_all(self, client: Client, hello: str) -> None:
        """One message at a time: what a client has not taken is not made for it."""
        try:
            async with asyncio.timeout(None) as patience:
                clock = asyncio.get_running_loop().time
                patience.reschedule(clock() + STALLED)
                await client.socket.send_text(hello)
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
        if client.words != self._version and self._version and not self._over:
            client.words = self._version
            return self._text
        history = self.watch.history
        if client.recast != self.watch.recast or client.next < history.begins:
            client.recast = self.watch.recast
            self._start_again(client)
        rows = self._rows_for(client, history)
        if rows is None and client.words != self._version and self._version:
            client.words = self._version  # the last words, after the last row
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
        if name == "depth":
            depth = depth_of(options)
            self._allowance.spend()  # all of the history is worked out anew
            self.watch.chosen_depth = depth
        else:
            client.every = thinning_of(options)
            self._start_again(client)

    def _start_again(self, client: Client) -> None:
        history = self.watch.history
        client.next, client.until, client.void = history.oldest, history.total, True
