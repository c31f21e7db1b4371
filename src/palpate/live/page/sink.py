"""The page as a sink of the loop: its address, its token, and the process that serves it."""

import asyncio
import ipaddress
import logging
import os
import secrets
import select
import socket
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.live.choices import LiveCommand
from palpate.live.sinks import Session, printed
from palpate.validation import shown, whole_in

if TYPE_CHECKING:
    from uvicorn import Config

PORT = 8765
_BACKLOG = 64
_SHORTEST_TOKEN = 16


class Page:
    """A page that shows the run in any browser of this machine.

    It listens from here on, so that a port in use is known before anything starts. On the loopback
    addresses everybody on this machine may watch and ask; on any other a token is demanded.

    Parameters
    ----------
    host : str
        Address or name to listen on.
    port : int
        In [0, 65535]; 0 takes a free one.
    token : str, optional
        At least 16 characters; a random one where the address is not a loopback one.
    open_browser : bool
        Show the page as soon as it is there.

    Raises
    ------
    InvalidParameterError
        The address is not this machine's, the port is in use or not allowed, or the token is short.
    MissingExtraError
        What it needs is not installed.
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
        """Where the page is, with its token."""
        host = ipaddress.ip_address(self._host)
        if host.is_unspecified:  # it listens on every address of this machine
            name = socket.gethostname()
        else:
            name = f"[{host}]" if host.version == 6 else str(host)
        query = f"?token={self.token}" if self.token else ""
        return f"http://{name}:{self.port}/{query}"

    def close(self) -> None:
        """Let go of the port, in this process."""
        self._socket.close()

    #: The port is the other process's own then: when that ends, nobody answers in its place.
    handed_over = close

    def __getstate__(self) -> dict[str, Any]:
        if self._socket.fileno() < 0:
            raise InvalidParameterError("this page has been served already: make another")
        return dict(self.__dict__)

    def run(self, session: Session, commands: Connection) -> None:
        """Serve the page until the loop has stopped."""
        # Bad requests are counted and shown; a log of them would only fill a disk.
        logging.getLogger("uvicorn").setLevel(logging.CRITICAL)
        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        asyncio.run(self._serve(session, commands))

    async def _serve(self, session: Session, commands: Connection) -> None:
        from uvicorn import Config

        from palpate.live.page.server import MOST_BYTES, Server, protocols
        from palpate.live.page.watch import Watch

        watch = Watch(session)
        server = Server(watch, _sender(commands))
        http, websockets = protocols(server.served)
        config = Config(
            server.app(self.token),
            http=http,
            ws=websockets,
            ws_max_size=MOST_BYTES,
            ws_per_message_deflate=False,  # on one machine it costs more than it saves
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        serving = asyncio.create_task(_quietly(config, self._socket))
        printed(f"The page is at {self.url}")
        if self._open_browser:
            asyncio.get_running_loop().run_in_executor(None, webbrowser.open, self.url)
        try:
            await server.feed()
        finally:
            serving.cancel()
            with suppress(asyncio.CancelledError):
                await serving
            watch.run.close()


async def _quietly(config: "Config", listening: socket.socket) -> None:
    """Serve until cancelled; the loop's process is the one that signals are for."""
    from uvicorn import Server

    class Quiet(Server):
        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            yield

    server = Quiet(config)
    running = asyncio.create_task(server.serve([listening]))
    try:
        await asyncio.shield(running)
    finally:
        server.should_exit = True
        await running


def _sender(commands: Connection) -> Any:
    def send(command: LiveCommand) -> None:
        room = True
        with suppress(OSError, ValueError):  # it has ended, which sending says; or is no file here
            room = bool(select.select([], [commands.fileno()], [], 0)[1])
        if not room:  # the page waits for nobody
            raise InvalidParameterError("the loop does not answer: nothing was asked")
        try:
            commands.send(command)
        except OSError:
            raise InvalidParameterError("the loop has ended") from None

    return send


def _listening(host: str, port: int) -> socket.socket:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError):
        raise InvalidParameterError(f"host {shown(host)} is not known") from None
    family, *_, address = found[0]
    both = family == socket.AF_INET6 and socket.has_dualstack_ipv6()
    try:
        return socket.create_server(address, family=family, backlog=_BACKLOG, dualstack_ipv6=both)
    except OSError as error:
        reason = os.strerror(error.errno or 0).lower()
        raise InvalidParameterError(
            f"the page cannot listen on {host} port {port}: {reason}; choose another port, or 0"
        ) from None


def token_for(address: str, token: str | None) -> str | None:
    """Return the token that a page on an address demands: a random one where it has to have one.

    Raises
    ------
    InvalidParameterError
        The token is short, or would not stand in an address as it is.
    """
    if token is None:
        loopback = ipaddress.ip_address(address.partition("%")[0]).is_loopback
        return None if loopback else secrets.token_urlsafe(24)
    letters = token.replace("-", "").replace("_", "") if isinstance(token, str) else ""
    if not (letters.isascii() and letters.isalnum() and len(token) >= _SHORTEST_TOKEN):
        raise InvalidParameterError(
            f"token must have {_SHORTEST_TOKEN} letters, digits, - or _ at least"
        )
    return token


def _check_installed() -> None:
    for name in ("starlette", "uvicorn", "websockets"):
        if find_spec(name) is None:
            raise MissingExtraError(f"the page needs {name}: pip install 'palpate[live]'")
