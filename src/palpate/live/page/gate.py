"""Who may come in: what every request has to have before anything answers it."""

import hmac
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from palpate.live.page.protocol import Served

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
        answer: ASGIApp = self.app
        if not self._is_token(given or asked.cookies.get(_cookie_name(asked), "")):
            self.counted.refused += 1
            answer = WebSocketClose(1008) if socket else PlainTextResponse(_WITHOUT_TOKEN, 403)
        elif socket and not _same_origin(asked):
            self.counted.refused += 1
            answer = WebSocketClose(1008)  # before accept: 403
        elif given and self.token is not None and not socket:
            # The browser remembers the token, and it is taken out of the address.
            answer = RedirectResponse("/", 303)
            answer.set_cookie(_cookie_name(asked), given, httponly=True, samesite="strict")
        await answer(scope, receive, send)

    def _is_token(self, given: str) -> bool:
        return self.token is None or hmac.compare_digest(given.encode(), self.token.encode())


def _with_headers(send: Send) -> Send:
    more = [(name.encode(), value.encode()) for name, value in HEADERS.items()]

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = [each for each in message.get("headers", ()) if each[0] != b"cache-control"]
            message = {**message, "headers": [*own, *more]}
        await send(message)

    return sending


def _cookie_name(asked: HTTPConnection) -> str:
    """With the port, as browsers give cookies of one port to all others of the machine."""
    host = asked.headers.get("host", "")
    try:
        return f"{COOKIE}-{urlsplit(f'//{host}').port or 80}"
    except ValueError:
        return COOKIE


def _same_origin(asked: HTTPConnection) -> bool:
    origin, host = (asked.headers.get(name, "").lower() for name in ("origin", "host"))
    return origin in (f"http://{host}", f"https://{host}")
