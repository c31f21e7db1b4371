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

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


def test_a_page_is_there_until_the_run_is_over_and_what_it_asks_is_done():
    page, said = Page(port=0), []
    contact = palpate.prepare(EXAMPLES / "ball.csv")
    options = {"sinks": [page], "seconds": 3.0}
    running = threading.Thread(
        target=lambda: said.append(run(Replay(contact), None, **options)), name="run"
    )
    running.start()
    origin = f"http://127.0.0.1:{page.port}"
    with connect(f"ws://127.0.0.1:{page.port}/socket", origin=origin, max_size=None) as client:
        client.send(json.dumps({"ask": "hold"}))
        *_, last = messages(
            client, until=lambda each: isinstance(each, dict) and each.get("ended"), seconds=20
        )
    running.join(20.0)
    assert last["loop"]["stopped"]
    assert last["loop"]["held"]
    assert said[0]["held"]
    assert last["page"]["clients"] == 1
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", page.port), timeout=5)
    with pytest.raises(InvalidParameterError, match="served already"):
        run(Replay(contact), sinks=[page])


def test_every_row_of_the_loop_comes_to_the_browser_once():
    page, said = Page(port=0), []
    contact = palpate.prepare(EXAMPLES / "ball.csv")
    running = threading.Thread(
        target=lambda: said.append(run(Replay(contact), sinks=[page], seconds=2.0))
    )
    running.start()
    origin, rows, expected = f"http://127.0.0.1:{page.port}", 0, 0
    with connect(f"ws://127.0.0.1:{page.port}/socket", origin=origin, max_size=None) as client:
        for message in messages(
            client, until=lambda each: isinstance(each, dict) and each.get("ended"), seconds=20
        ):
            if not isinstance(message, bytes):
                continue
            (_, first, dropped, void), times, _ = frame_of(message)
            expected = first if void else expected
            assert (first, dropped) == (expected, 0)
            expected = rows = first + len(times)
    running.join(20.0)
    assert rows == said[0]["counts"]["taken"]
