"""The page's server: what it sends, what it refuses, and what it withstands."""

import json
import socket
import struct
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from http.client import HTTPConnection
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scripted import Endless, resident
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import palpate
from palpate.errors import InvalidParameterError
from palpate.live import run
from palpate.live.choices import LiveCommand
from palpate.live.loop import Loop
from palpate.live.page import Page, server, watch
from palpate.live.page.sink import token_for
from palpate.live.page.watch import CHANNELS, HEADER
from palpate.live.ring import ESTIMATE, SharedJson, Writer
from palpate.live.sinks import Session, Watching
from palpate.live.sources import EndOfSourceError, Replay

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


class Served(SimpleNamespace):
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
    shared_json, own = SharedJson(), SharedJson()
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
    shared_json.write(loop.status())
    page = Page(port=0, **options)
    ours, theirs = Pipe()
    memories = writer.memory, estimates.memory
    watching = Watching(Session(*memories, shared_json.memory, {"page": own.memory}), "page")
    thread = threading.Thread(target=page.run, args=(watching, theirs))
    thread.start()
    try:
        yield Served(
            page=page, writer=writer, own=own, commands=ours, loop=loop, rows=written[-1],
            shared_json=shared_json,
        )  # fmt: skip
    finally:
        shared_json.write({**loop.status(), "stopped": True})
        thread.join(20.0)
        assert not thread.is_alive()
        page.close()


class Head(NamedTuple):
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


TOKEN = "a-token-of-twenty-letters"


@pytest.fixture(scope="module")
def page():
    """One server for what leaves nothing behind."""
    with served() as made:
        yield made


# --- what it sends


def test_a_browser_gets_the_last_seconds_and_then_what_is_new(page):
    with page.socket() as client:
        hello = received(client)
        assert hello["kind"] == "hello"
        assert "variable-projection" in hello["methods"]
        head, times, _ = frame(client)
        assert head == (1, 0, 0, 1)
        assert np.all(np.diff(times) >= 0.0)
        frame(client)  # the rest of it
        total = page.writer.count
        page.write(50)
        head, _, values = frame(client, lambda head: head.first >= total)
        assert head == (1, total, 0, 0)
        assert values["force"] == pytest.approx(page.rows[6], rel=1e-6)


def test_a_chosen_depth_is_the_one_of_all_that_is_shown(page):
    def choose(client, value):
        client.send(json.dumps({"ask": "depth", "value": value}))
        assert page.commands.recv() == LiveCommand("depth", {"value": value})
        page.shared_json.write({**page.loop.status(), "depth": value})  # as the loop does

    with page.socket() as client:
        choose(client, 0.004)
        received(client, dict, lambda each: each.get("depth", {}).get("chosen"))
        head, _, values = frame(client)
        assert head.void  # all of it anew
        stiffness, exponent = values["parameter_0"][-1], values["parameter_2"][-1]
        expected = stiffness * exponent * 0.004 ** (exponent - 1)
        assert values["stiffness"][-1] == pytest.approx(expected, rel=1e-5)
        choose(client, None)
        received(client, dict, lambda each: each.get("depth", {}).get("chosen") is False)


def test_a_browser_that_asks_for_fewer_samples_gets_every_fourth(page):
    with page.socket() as client:
        frame(client)
        client.send(json.dumps({"ask": "every", "value": 4}))
        head, times, _ = frame(client, lambda head: head.every == 4)
        assert (head.first % 4, head.void) == (0, 1)
        assert np.median(np.diff(times)) == pytest.approx(4e-3)


class Until(Endless):
    """Samples at their own pace, until a test ends them."""

    ended = False

    def take(self, timeout):
        if self.ended:
            raise EndOfSourceError
        return super().take(timeout)


@pytest.mark.long
def test_the_page_gets_every_row_of_a_running_loop_once():
    page, said = Page(port=0), []
    source = Until()
    running = threading.Thread(target=lambda: said.append(run(source, sinks=[page])))
    running.start()
    origin, rows, asked = f"http://127.0.0.1:{page.port}", 0, False
    where = f"ws://127.0.0.1:{page.port}/socket"
    with connect(where, origin=origin, max_size=None, open_timeout=60) as client:
        message = {}
        while isinstance(message, bytes) or not message.get("ended"):
            message = received(client, seconds=30)
            if isinstance(message, bytes):
                head, times, _ = frame_of(message)
                assert head.dropped == 0
                assert head.void or head.first == rows
                rows = head.first + len(times)
                if not asked:
                    client.send(json.dumps({"ask": "hold"}))
                    asked = True
            elif message.get("loop", {}).get("held"):
                source.ended = True
    running.join(20.0)
    assert rows == said[0]["counts"]["taken"]
    assert message["loop"]["stopped"]
    assert message["loop"]["held"]
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", page.port), timeout=5)
    with pytest.raises(InvalidParameterError, match="already used in a run"):
        run(source, sinks=[page])


# --- who may come in


def test_every_answer_forbids_what_the_page_does_not_need(page):
    for path in ("/", "/look.css", "/static/main.js", "/nothing"):
        answer, _ = page.get(path)
        assert answer.headers["content-security-policy"].startswith("default-src 'self'")
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["cache-control"] == "no-store"
        assert "server" not in answer.headers


@pytest.mark.parametrize(
    "path", ["/static/../sink.py", "/static/%2e%2e/sink.py", "/static//etc/passwd"]
)
def test_nothing_is_served_but_the_page(page, path):
    assert page.get(path)[0].status == 404


@pytest.mark.parametrize(
    "host", ["elsewhere.example", "127.0.0.1.elsewhere.example", "", "[::1", "localhost:x"]
)
def test_a_name_that_is_not_this_machines_is_refused(page, host):
    answer, words = page.get(Host=host)
    assert answer.status in (400, 403)
    assert "palpate" not in words
    for own in ("localhost:1", "127.0.0.1", "[::1]:8765"):
        assert page.get(Host=own)[0].status == 200


@pytest.mark.parametrize(
    "origin", [None, "null", "http://elsewhere.example", "http://127.0.0.1:1", "file://"]
)
def test_another_origin_gets_no_socket(page, origin):
    with pytest.raises(InvalidStatus, match="403"):
        page.socket(origin=origin)


def test_with_a_token_nothing_is_shown_without_it():
    with served(seconds=0.1, token=TOKEN) as page:
        for path in ("/", "/look.css", "/static/main.js", "/?token=", "/?token=" + TOKEN[:-1]):
            answer, words = page.get(path)
            assert (answer.status, "open the address" in words) == (403, True)
        with pytest.raises(InvalidStatus, match="403"):
            page.socket()
        answer, _ = page.get(page.page.url.removeprefix(page.origin))
        assert (answer.status, answer.headers["location"]) == (303, "/")
        remembered, *guarded = answer.headers["set-cookie"].split("; ")
        assert {"HttpOnly", "SameSite=strict"} <= set(guarded)
        assert page.get(Cookie=remembered)[0].status == 200
        with page.socket(additional_headers={"Cookie": remembered}) as client:
            assert client.recv(timeout=10)
        assert page.get(Cookie=remembered[:-1] + "é; x")[0].status == 403
        assert page.counted("refused", 7) >= 7


def test_beyond_the_loopback_a_token_is_demanded():
    assert token_for("127.0.0.1", None) is token_for("::1", None) is None
    tokens = {token_for(address, None) for address in ("0.0.0.0", "::", "192.0.2.1")}
    assert len(tokens) == 3
    assert all(len(token) >= 24 for token in tokens)


@pytest.mark.parametrize("token", ["", "short", "spaces are no letters here", 12345678901234567890])
def test_a_token_that_can_be_guessed_is_refused(token):
    with pytest.raises(InvalidParameterError, match="token must have at least 16"):
        Page(port=0, token=token)


def test_a_port_in_use_is_known_before_anything_starts(page):
    with pytest.raises(
        InvalidParameterError, match=r"cannot listen on 127.0.0.1 port \d+: address"
    ):
        Page(port=page.page.port)
    with pytest.raises(InvalidParameterError, match=r"unknown host 'no\.such\.name\.invalid'"):
        Page(host="no.such.name.invalid", port=0)
    with pytest.raises(InvalidParameterError, match="port must be in"):
        Page(port=70000)


# --- what it passes on


@pytest.mark.parametrize(
    "name, options",
    [
        ("hold", {}),
        ("resume", {}),
        ("reset", {}),
        ("tare", {"seconds": 2}),
        ("record", {"on": True}),
        ("estimator", {"method": "kelvin-voigt", "forgetting_factor": 0.99}),
    ],
)
def test_commands_of_the_page_reach_the_loop(page, name, options):
    with page.socket() as client:
        client.send(json.dumps({"ask": name, **options}))
        assert page.commands.poll(10)
        assert page.commands.recv() == LiveCommand(name, options)


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "must be JSON"),
        ('{"ask": 1}', '"ask"'),
        ("[" * 2000, "must be JSON"),
        ('{"ask": NaN}', "must be JSON"),
        ('{"ask": "stop"}', "unknown request 'stop'"),
        ('{"ask": "hold", "path": "/etc/passwd"}', "options must be none"),
        ('{"ask": "record", "path": "/etc/passwd"}', "options must be on"),
        ('{"ask": "tare"}', "options must be seconds"),
        ('{"ask": "tare", "seconds": 1e9}', "seconds must be in"),
        ('{"ask": "tare", "seconds": [1]}', "seconds must be a number"),
        ('{"ask": "every", "value": 3}', "value must be one of"),
        ('{"ask": "estimator", "method": "none"}', "method must be one of"),
        ('{"ask": "estimator", "method": "kelvin-voigt", "gate": 1}', "main settings only"),
        ('{"ask": "estimator", "method": "kelvin-voigt", "forgetting_factor": 2}', "factor"),
        ('{"ask": "estimator", "method": "kelvin-voigt", "change_detector": 7}', "change_detector"),
        ('{"ask": "source"}', "exactly one option"),
        ('{"ask": "source", "material": "ball"}', "the source has no such choice of 'material'"),
    ],
)
def test_impossible_requests_are_refused(page, text, words):
    with page.socket() as client:
        client.send(text)
        assert words in received(client, dict, lambda each: each["kind"] == "refused")["words"]
    assert not page.commands.poll(0)


@pytest.mark.long
def test_the_loop_is_asked_for_no_more_than_a_person_would():
    with served(seconds=0.1) as page, page.socket() as client:
        for _ in range(300):
            client.send('{"ask": "reset"}')
        assert page.counted("refused", 200) >= 200
        arrived = 0
        while page.commands.poll(0.2):
            page.commands.recv()
            arrived += 1
        # A burst, and ten a second of what it took.
        assert server.MOST_COMMANDS <= arrived < 100


@pytest.mark.long
def test_a_silent_loop_and_its_return_are_reported(monkeypatch):
    monkeypatch.setattr(watch, "ALIVE", 0.6)  # s
    with served(seconds=0.1) as page, page.socket() as client:
        assert received(client, dict, lambda each: "state" in each)["state"] != "dead"
        assert received(client, dict, lambda each: each.get("state") == "dead")["loop"]["state"]
        page.write(1)
        received(client, dict, lambda each: each.get("state", "dead") != "dead")


@pytest.mark.slow
def test_a_loop_that_does_not_answer_holds_up_no_page(monkeypatch):
    monkeypatch.setattr(server, "COMMAND_TIME", 1e-9)  # a person of endless patience
    with served(seconds=0.1) as page, page.socket() as client:
        for _ in range(4000):  # nobody reads them, and the system has room for some hundred kB
            client.send('{"ask": "reset"}')
        received(client, dict, lambda each: "the loop does not respond" in str(each), seconds=20)
        assert page.get()[0].status == 200


# --- what it withstands


@pytest.mark.long
def test_there_is_room_for_so_many_browsers_and_no_more(page):
    with ExitStack() as open_ones:
        clients = [open_ones.enter_context(page.socket()) for _ in range(server.MOST_CLIENTS)]
        with page.socket() as one_more:
            with pytest.raises(ConnectionClosed) as closed:
                one_more.recv(timeout=10)
            assert closed.value.rcvd.code == 4429
        assert clients[0].recv(timeout=10)
        assert page.counts()["turned_away"] >= 1


@pytest.mark.long
@pytest.mark.parametrize("count", [600, pytest.param(10_000, marks=pytest.mark.slow)])
def test_malformed_messages_are_counted_and_take_no_memory(count):
    with served(seconds=0.5) as page, page.socket() as client:
        hostile = ['{"ask"', "\x00", "[1, 2", '{"ask": {}}', b"\xff\xfe", "9" * 4000, "nul"]
        for k in range(200):
            client.send(hostile[k % len(hostile)])
        page.counted("malformed", 200)
        before = resident()
        for k in range(200, count):
            client.send(hostile[k % len(hostile)])
        assert page.counted("malformed", count, seconds=30) == count
        # Ten thousand are 6 MB; what the test's own threads take of a sudden is below 4.
        assert resident() - before < 4e6
        page.write(10)
        received(client, bytes, lambda each: len(each) > 24)


def connected(page):
    return socket.create_connection(("127.0.0.1", page.page.port), timeout=10)


def handshaken(page):
    made = connected(page)
    made.sendall(
        f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{page.page.port}\r\nOrigin: {page.origin}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n".encode()
    )
    assert b"101" in made.recv(64)
    return made


MALFORMED = {
    "opcode": raw_frame(0x3, b"reserved"),
    "unmasked": raw_frame(0x1, b"unmasked", masked=False),
    "no text": raw_frame(0x1, b"\xff\xff"),
    "endless": raw_frame(0x1, length=1 << 62),
    "long": raw_frame(0x2, bytes(5000)),
    "continuation": raw_frame(0x0, b"continues nothing"),
    "ping": raw_frame(0x9, bytes(126)),
    "pieces": raw_frame(0x1, fin=False) + raw_frame(0x0, fin=False) * 50,
}
NO_REQUESTS = [b"\x00\xff\r\n\r\n", b"GET / HTTP/9\r\n\r\n", b"A" * 100_000]


@pytest.mark.long
def test_malformed_requests_end_their_connections(page):
    before = page.counts()["malformed"]
    sent = [(handshaken, each) for each in MALFORMED.values()]
    sent += [(connected, each) for each in NO_REQUESTS]
    for begun, words in sent:
        connection = begun(page)
        connection.sendall(words)
        with connection, suppress(ConnectionError):
            while connection.recv(1 << 16):  # until the other end closes it
                pass
    expected = before + len(MALFORMED) + len(NO_REQUESTS)
    assert page.counted("malformed", expected) == expected
    assert page.get()[0].status == 200


@pytest.mark.long
def test_idle_connections_do_not_block_active_ones(monkeypatch):
    monkeypatch.setattr(server, "PATIENCE", 0.5)
    with served(seconds=0.1) as page, ExitStack() as idle, page.socket() as client:
        for k in range(100):
            made = idle.enter_context(connected(page))
            if k % 2:
                with suppress(ConnectionError):
                    made.sendall(b"GET / HTTP/1.1\r\nHost: 127")  # and never the rest
        assert page.counted("turned_away", 100) == 100
        assert page.get()[0].status == 200
        received(client, dict)  # it is not idle


@pytest.mark.long
@pytest.mark.slow
def test_a_client_that_never_reads_is_cut_off():
    with served(seconds=0.1) as page:
        connection = handshaken(page)
        before = resident()
        ping = raw_frame(0x9, bytes(125)) * 1000
        with pytest.raises(OSError, match=r"reset|[Bb]roken pipe"):
            connection.sendall(ping * 1000)
        connection.close()
        # 130 MB of answers are asked for; what a connection holds is bounded by 1 MB.
        assert resident() - before < 2e7


@pytest.mark.long
@pytest.mark.slow
def test_a_browser_that_stops_reading_is_disconnected(monkeypatch):
    monkeypatch.setattr(server, "STALLED", 0.7)
    with served(seconds=1.0) as page:
        stuck = handshaken(page)  # it never reads
        before = resident()
        with page.socket() as client:
            frame(client)
            seen, until = 0, time.monotonic() + 30.0
            while not page.own.read().get("stalled") and time.monotonic() < until:
                page.write(1000)  # as fast as it goes: the buffers of the system are some MB
                total = page.writer.count
                seen = max(seen, frame(client)[0].first)
            assert seen > total // 2
        assert page.counts()["stalled"] == 1
        # The page's own rows, touched here first, are 18 MB, and what it imports some 20.
        assert resident() - before < 6e7
        stuck.close()
