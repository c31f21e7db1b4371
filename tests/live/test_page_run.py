"""The page as a sink of a run: it is there while the loop runs, and no longer."""

import json
import socket
import threading
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="the extra live is not installed")

from page_server import frame_of, messages
from websockets.sync.client import connect

import palpate
from palpate.errors import InvalidParameterError
from palpate.live import run
from palpate.live.page import Page
from palpate.live.sources.replay import Replay
from palpate.live.sources.source import EndOfSourceError

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


class Until(Replay):
    """A recording at its own pace, until a test ends it."""

    def __init__(self, contact):
        super().__init__(contact)
        self.ended = threading.Event()

    def take(self, timeout):
        if self.ended.is_set():
            raise EndOfSourceError
        return super().take(timeout)


def test_a_page_is_there_while_the_loop_runs_and_every_row_comes_to_it_once():
    page, said = Page(port=0), []
    source = Until(palpate.prepare(EXAMPLES / "ball.csv"))
    running = threading.Thread(target=lambda: said.append(run(source, sinks=[page])))
    running.start()
    origin, rows, asked = f"http://127.0.0.1:{page.port}", 0, False
    with connect(f"ws://127.0.0.1:{page.port}/socket", origin=origin, max_size=None) as client:
        for message in messages(
            client, until=lambda each: isinstance(each, dict) and each.get("ended"), seconds=30
        ):
            if isinstance(message, bytes):
                (_, first, dropped, void), times, _ = frame_of(message)
                assert dropped == 0
                assert void or first == rows
                rows = first + len(times)
                if not asked:
                    client.send(json.dumps({"ask": "hold"}))
                    asked = True
            elif message.get("loop", {}).get("held"):
                source.ended.set()
    running.join(20.0)
    assert rows == said[0]["counts"]["taken"]
    assert message["loop"]["stopped"]
    assert message["loop"]["held"]
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", page.port), timeout=5)
    with pytest.raises(InvalidParameterError, match="served already"):
        run(source, sinks=[page])
