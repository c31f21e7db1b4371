"""A page that is served in a thread of the test, from a ring that the test itself fills."""

import json
import struct
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.client import HTTPConnection
from multiprocessing import Pipe
from pathlib import Path
from typing import NamedTuple

import numpy as np
from websockets.sync.client import connect

import palpate
from palpate.live.loop import Loop
from palpate.live.page import Page
from palpate.live.page.watch import CHANNELS, HEADER
from palpate.live.ring import ESTIMATE, Board, Writer
from palpate.live.sinks import Session
from palpate.live.sources import Replay

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


@dataclass
class Served:
    """What a test has of a page that is served."""

    page: Page
    writer: Writer
    estimates: Writer
    board: Board
    own: Board
    commands: object
    loop: Loop
    rows: list = field(default_factory=list)

    @property
    def origin(self) -> str:
        return f"http://127.0.0.1:{self.page.port}"

    def get(self, path="/", **headers):
        connection = HTTPConnection("127.0.0.1", self.page.port, timeout=10)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer, body.decode()

    def socket(self, **options):
        options = {"origin": self.origin, "max_size": None, "compression": None, **options}
        options.setdefault("open_timeout", 60)
        return connect(f"ws://127.0.0.1:{self.page.port}/socket", **options)

    def counts(self):
        """What the server says of itself from now on."""
        self.own.read()
        before, until = self.own.version, time.monotonic() + 5.0
        while not (found := self.own.read()) or self.own.version == before:
            assert time.monotonic() < until, "the server says nothing any more"
            time.sleep(0.02)
        return found

    def counted(self, name, count, *, seconds=10.0):
        """Wait until so many are counted."""
        until = time.monotonic() + seconds
        while (found := self.counts()[name]) < count and time.monotonic() < until:
            pass
        return found

    def write(self, count):
        """Write the last row so many times again, a millisecond apart."""
        row = list(self.rows)
        for _ in range(count):
            row[0] += 1e-3
            row[1] += 1e-3
            self.writer.write(*row)
        self.rows = row


@contextmanager
def served(recording="tapping.csv", *, seconds=3.0, estimator=None, **options):
    """Serve the page of a recording that the loop has gone through already."""
    contact = palpate.prepare(EXAMPLES / recording)
    writer, estimates = Writer(), Writer(width=len(ESTIMATE))
    board, own = Board(), Board()
    source = Replay(contact, speed=float("inf"))
    preparation = palpate.OnlinePreparation(sample_time=contact.sample_time)
    estimator = estimator or palpate.VariableProjection()
    loop = Loop(source, preparation, estimator, writer, estimates, every_sample=True)
    written = []
    write = writer.write
    writer.write = lambda *row: (written.append(row), write(*row))
    for _ in range(round(seconds / contact.sample_time)):
        loop.step(source.take(1.0))
    del writer.write
    board.write(loop.status())
    page = Page(port=0, **options)
    ours, theirs = Pipe()
    addresses = writer.address, estimates.address
    session = Session(*addresses, board.name, {"page": own.name}, own.name)
    thread = threading.Thread(target=page.run, args=(session, theirs))
    thread.start()
    try:
        yield Served(page, writer, estimates, board, own, ours, loop, list(written[-1]))
    finally:
        board.write({**loop.status(), "stopped": True})
        thread.join(20.0)
        assert not thread.is_alive()
        page.close()
        for each in (board, own, writer, estimates):
            each.close()


class Head(NamedTuple):
    """What a frame says of itself."""

    every: int
    first: int
    dropped: int
    void: int


def frame_of(message):
    """Head, times and channels of a frame."""
    every, count, *rest = HEADER.unpack_from(message)
    times = np.frombuffer(message, "<f8", count, HEADER.size)
    values = np.frombuffer(message, "<f4", offset=HEADER.size + 8 * count)
    values = values.reshape(len(CHANNELS), count)
    return Head(every, *rest), times, dict(zip(CHANNELS, values, strict=True))


def received(socket, kind=bytes | dict, true=lambda message: True, seconds=10.0):
    """The next message of a kind of which something is true: words, or a frame taken apart."""
    end = time.monotonic() + seconds
    while True:
        message = socket.recv(timeout=max(end - time.monotonic(), 0.01))
        message = json.loads(message) if isinstance(message, str) else message
        if isinstance(message, kind) and true(message):
            return message


def frame(socket, true=lambda head: True):
    return frame_of(received(socket, bytes, lambda message: true(frame_of(message)[0])))


def raw_frame(opcode, payload=b"", *, fin=True, masked=True, length=None):
    """A WebSocket frame as a client sends it, or ought not to."""
    size = len(payload) if length is None else length
    head = bytes([(0x80 if fin else 0) | opcode])
    mask = 0x80 if masked else 0
    if size < 126:
        head += bytes([mask | size])
    elif size < 1 << 16:
        head += bytes([mask | 126]) + struct.pack(">H", size)
    else:
        head += bytes([mask | 127]) + struct.pack(">Q", size)
    return head + (b"\0\0\0\0" if masked else b"") + payload
