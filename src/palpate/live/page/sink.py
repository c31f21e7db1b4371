"""The sink that serves the page: its address, its token and its process."""

import asyncio
import ipaddress
import logging
import os
import re
import secrets
import select
import socket
import webbrowser
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from multiprocessing.connection import Connection
from typing import Any

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.live.choices import LiveCommand
from palpate.live.sinks import Watching, print_line
from palpate.validation import shown, whole_in

PORT = 8765
_BACKLOG = 64
_SHORTEST_TOKEN = 16


class Page:
    """Sink that serves a page about the run.

    It listens as soon as it is made, so that a port in use fails before the loop starts. On a
    loopback address every user of this machine may watch and control the run; any other address
    requires a token.

    Parameters
    ----------
    host : str
        Address or name to listen on. Default: 127.0.0.1.
    port : int
        Port in [0, 65535]; 0 takes a free one. Default: 8765.
    token : str, optional
        Token of at least 16 letters, digits, - or _. Default: none on a loopback address, else
        random.
    open_browser : bool
        Whether to open the page in a browser. Default: False.

    Raises
    ------
    InvalidParameterError
        The address is not one of this machine, the port is in use, or the token is invalid.
    MissingExtraError
        A package that the page needs is not installed.
    """

    name = "page"

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        token: str | None = None,
        open_browser: bool = False,
    ) -> None:
        _check_installed()
        token_for("127.0.0.1", token)  # before anything listens
        self._open_browser = open_browser
        self._socket = _listening(host, whole_in("port", port, 0, 65535))
        address = self._socket.getsockname()
        self.port: int = address[1]
        self._host = address[0]
        self.token = token_for(self._host, token)

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        host = ipaddress.ip_address(self._host)
        if host.is_unspecified:  # it listens on all addresses of this machine
            name = socket.gethostname()
        else:
            name = f"[{host}]" if host.version == 6 else str(host)
        query = f"?token={self.token}" if self.token else ""
        return f"http://{name}:{self.port}/{query}"

    def close(self) -> None:
        """Close the port in this process."""
        self._socket.close()

    #: Once the page's process has the port, this process must not answer in its place.
    handed_over = close

    def __getstate__(self) -> dict[str, Any]:
        if self._socket.fileno() < 0:
            raise InvalidParameterError("this Page was already used in a run: make a new one")
        return dict(self.__dict__)

    def run(self, watching: Watching, commands: Connection) -> None:
        """Serve the page until the loop has stopped."""
        # Bad requests are counted and shown; a log of them could fill the disk.
        logging.getLogger("uvicorn").setLevel(logging.CRITICAL)
        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        asyncio.run(self._serve(watching, commands))

    async def _serve(self, watching: Watching, commands: Connection) -> None:
        import uvicorn

        from palpate.live.page.server import MOST_BYTES, Server, protocols
        from palpate.live.page.watch import Watch

        server = Server(Watch(watching), partial(_send, commands))
        http, websockets = protocols(server.served)
        config = uvicorn.Config(
            server.app(self.token),
            http=http,
            ws=websockets,
            ws_max_size=MOST_BYTES,
            ws_per_message_deflate=False,  # not worth its cost on one machine
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        accepting = uvicorn.Server(config)
        serving = asyncio.create_task(accepting.serve([self._socket]))
        print_line(f"The page is at {self.url}")
        if self._open_browser:
            asyncio.get_running_loop().run_in_executor(None, webbrowser.open, self.url)
        try:
            await server.feed()
        finally:
            accepting.should_exit = True
            await serving


def _send(commands: Connection, command: LiveCommand) -> None:
    """Send a command to the loop; the page never waits for room."""
    room = True
    with suppress(OSError, ValueError):  # the loop has ended, or this is no file
        room = bool(select.select([], [commands.fileno()], [], 0)[1])
    if not room:
        raise InvalidParameterError("the loop does not respond: try again")
    try:
        commands.send(command)
    except OSError:
        raise InvalidParameterError("the loop has ended") from None


def _listening(host: str, port: int) -> socket.socket:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError):
        raise InvalidParameterError(
            f"unknown host {shown(host)}: pass an address of this machine"
        ) from None
    family, *_, address = found[0]
    both = family == socket.AF_INET6 and socket.has_dualstack_ipv6()
    try:
        return socket.create_server(address, family=family, backlog=_BACKLOG, dualstack_ipv6=both)
    except OSError as error:
        reason = os.strerror(error.errno or 0).lower()
        raise InvalidParameterError(
            f"the page cannot listen on {host} port {port}: {reason}: pass another --port, or 0"
        ) from None


def token_for(address: str, token: str | None) -> str | None:
    """Return the token of a page on an address: the given one, or a random one if it needs one.

    Raises
    ------
    InvalidParameterError
        The token is too short or has characters that a URL would escape.
    """
    if token is None:
        loopback = ipaddress.ip_address(address.partition("%")[0]).is_loopback
        return None if loopback else secrets.token_urlsafe(24)
    letters = rf"[A-Za-z0-9_-]{{{_SHORTEST_TOKEN},}}"
    if not (isinstance(token, str) and re.fullmatch(letters, token)):
        raise InvalidParameterError(
            f"token must have at least {_SHORTEST_TOKEN} letters, digits, - or _"
        )
    return token


def _check_installed() -> None:
    for name in ("starlette", "uvicorn", "websockets"):
        if find_spec(name) is None:
            raise MissingExtraError.named("the page", name, "live")
