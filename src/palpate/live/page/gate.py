"""Who may come in: what every request has to have before anything answers it."""

import hmac
import ipaddress
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

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
_WRONG_HOST = "This name is not this machine's: open the page by its address.\n"
_WRONG_ORIGIN = "Another site asked for this connection.\n"


@dataclass(slots=True)
class Gate:
    """In front of the application: host, token and origin are checked, and the rest counted.

    A name in ``Host`` has to be this machine's own, or an address: else a page elsewhere could
    have its own name point here, and read what it is not meant to (DNS rebinding). A WebSocket has
    to come from this very page, as no browser keeps another site from opening one.

    Parameters
    ----------
    app : ASGI application
        What answers.
    token : str, optional
        Has to be known; once it was, a cookie of the browser says it.
    refused : int
        Requests that were not let in.
    """

    app: App
    token: str | None
    refused: int = 0
    _names: frozenset[str] = field(default_factory=lambda: _own_names())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[-1]
        if not self._knows_host(headers.get(b"host", "")):
            await self._refuse(scope, send, _WRONG_HOST)
        elif self.token is not None and not self._is_token(given or _cookie(headers)):
            await self._refuse(scope, send, _WITHOUT_TOKEN)
        elif scope["type"] == "websocket" and not _same_origin(headers):
            await self._refuse(scope, send, _WRONG_ORIGIN)
        elif scope["type"] == "http" and self.token is not None and given:
            await self._remember(headers, send)
        else:
            await self.app(scope, receive, _with_headers(send))

    def _is_token(self, given: str) -> bool:
        assert self.token is not None
        return hmac.compare_digest(given.encode(), self.token.encode())

    def _knows_host(self, host: str) -> bool:
        try:
            parts = urlsplit(f"//{host}")
            name, _ = (parts.hostname or "").lower(), parts.port
        except ValueError:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._names
        return True

    async def _remember(self, headers: dict[bytes, str], send: Send) -> None:
        """Let the browser remember the token, and take it out of the address."""
        cookie = f"{_cookie_name(headers)}={self.token}; HttpOnly; SameSite=Strict; Path=/"
        answer = {**HEADERS, "location": "/", "set-cookie": cookie, "content-length": "0"}
        await _answer(send, 303, answer, b"")

    async def _refuse(self, scope: Scope, send: Send, words: str) -> None:
        self.refused += 1
        if scope["type"] == "websocket":
            await send(
                {"type": "websocket.close", "code": 1008, "reason": ""}
            )  # before accept: 403
            return
        headers = {**HEADERS, "content-type": "text/plain; charset=utf-8"}
        await _answer(send, 403, headers, words.encode())


async def _answer(send: Send, status: int, headers: dict[str, str], body: bytes) -> None:
    pairs = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": status, "headers": pairs})
    await send({"type": "http.response.body", "body": body})


def _with_headers(send: Send) -> Send:
    more = [(name.encode(), value.encode()) for name, value in HEADERS.items()]

    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            own = [each for each in message.get("headers", ()) if each[0] != b"cache-control"]
            message = {**message, "headers": [*own, *more]}
        await send(message)

    return sending


def _cookie_name(headers: dict[bytes, str]) -> str:
    """With the port, as browsers give cookies of one port to all others of the machine."""
    return f"{COOKIE}-{urlsplit('//' + headers.get(b'host', '')).port or 80}"


def _cookie(headers: dict[bytes, str]) -> str:
    try:
        found = SimpleCookie(headers.get(b"cookie", "")).get(_cookie_name(headers))
    except (CookieError, ValueError):
        return ""
    return found.value if found else ""


def _same_origin(headers: dict[bytes, str]) -> bool:
    origin, host = headers.get(b"origin", ""), headers.get(b"host", "")
    return origin.lower() in (f"http://{host}".lower(), f"https://{host}".lower())


def _own_names() -> frozenset[str]:
    name = socket.gethostname().lower()
    return frozenset({"localhost", name, f"{name}.local"})
