"""A live run that goes on until a test ends it, and a wire that a test can cut."""

import socket
import threading
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count

from palpate.live import run
from palpate.live.page import Page
from palpate.live.sources.replay import Replay
from palpate.live.sources.source import EndOfSourceError


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


@dataclass
class Wire:
    """Passes bytes between a browser and a server, until it is cut."""

    port: int
    listening: socket.socket = field(init=False)
    whole: bool = True
    _ends: list = field(default_factory=list)

    def __post_init__(self):
        self.listening = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.listening.getsockname()[1]}/"

    def cut(self):
        self.whole = False
        for end in self._ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        self._ends.clear()

    def _accept(self):
        while True:
            try:
                near, _ = self.listening.accept()
            except OSError:
                return
            if not self.whole:
                near.close()
                continue
            far = socket.create_connection(("127.0.0.1", self.port))
            self._ends += [near, far]
            for a, b in ((near, far), (far, near)):
                threading.Thread(target=self._pass, args=(a, b), daemon=True).start()

    def _pass(self, source, sink):
        with suppress(OSError):
            while piece := source.recv(1 << 16):
                sink.sendall(piece)
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


@contextmanager
def wire_to(port):
    made = Wire(port)
    try:
        yield made
    finally:
        made.cut()
        made.listening.close()
