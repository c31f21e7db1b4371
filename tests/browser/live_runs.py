"""A live run that goes on until a test ends it, and a wire that a test can cut."""

import socket
import socketserver
import threading
from contextlib import contextmanager, suppress
from itertools import count

from palpate.live import run
from palpate.live.page import Page
from palpate.live.sources import EndOfSourceError, Replay


class Endless(Replay):
    """A recording again and again at its own pace; every second time 1.6 times as firm."""

    offers = {"material": ["as it is", "firmer"], "change": ["firmer", "softer"]}  # noqa: RUF012

    def __init__(self, contact):
        super().__init__(contact)
        self.ended = threading.Event()
        self.asked = []
        columns = contact.time, contact.penetration, contact.force
        rows = list(zip(*(column.tolist() for column in columns), strict=True))
        span = rows[-1][0] - rows[0][0] + contact.sample_time
        self._rows = (
            (t + k * span, x, f * (1.6 if k % 2 else 1.0)) for k in count() for t, x, f in rows
        )

    def take(self, timeout):
        if self.ended.is_set():
            raise EndOfSourceError
        return super().take(timeout)

    def ask(self, options):
        self.asked.append(options)
        return f"the source was asked for {options}"


@contextmanager
def running(contact, *sinks, estimator=None):
    """A run with its page: its source, and the page."""
    source, page = Endless(contact), Page(port=0)
    thread = threading.Thread(target=run, args=(source, estimator, [*sinks, page]))
    thread.start()
    try:
        yield source, page
    finally:
        source.ended.set()
        thread.join(30.0)
        page.close()
        assert not thread.is_alive()


def _passed_on(source, sink):
    with suppress(OSError):
        while piece := source.recv(1 << 16):
            sink.sendall(piece)
    _cut(source, sink)


def _cut(*ends):
    for end in ends:
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)


class Wire(socketserver.ThreadingTCPServer):
    """Passes bytes between a browser and a server, until it is cut."""

    daemon_threads = True

    def __init__(self, port):
        super().__init__(("127.0.0.1", 0), None)
        self.whole, self._port, self._ends = True, port, []
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_address[1]}/"

    def finish_request(self, near, _):
        if self.whole:
            with socket.create_connection(("127.0.0.1", self._port)) as far:
                self._ends += [near, far]
                threading.Thread(target=_passed_on, args=(far, near), daemon=True).start()
                _passed_on(near, far)

    def cut(self):
        self.whole = False
        _cut(*self._ends)

    def __exit__(self, *_):
        self.cut()
        self.shutdown()
        self.server_close()
