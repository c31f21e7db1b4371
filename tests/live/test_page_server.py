"""The page's server: what it sends, what it refuses, and what it withstands."""

import json
import os
import socket
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("uvicorn", reason="the extra live is not installed")

from page_server import frame_of, messages, raw_frame, served
from websockets.exceptions import ConnectionClosed, InvalidStatus

from palpate.errors import InvalidParameterError
from palpate.live.commands import Command
from palpate.live.page import Page, protocol, requests, server, watch
from palpate.live.page.sink import token_for

TOKEN = "a-token-of-twenty-letters"


@pytest.fixture(scope="module")
def page():
    """One server for what leaves nothing behind."""
    with served() as made:
        yield made


def resident():
    """What this process takes, bytes."""
    words = Path("/proc/self/statm").read_text().split()
    return int(words[1]) * os.sysconf("SC_PAGE_SIZE")


# --- what it sends


def test_a_browser_gets_the_last_seconds_and_then_what_is_new(page):
    with page.socket() as client:
        hello, *_, first = messages(client, until=lambda each: isinstance(each, bytes))
        assert hello["kind"] == "hello"
        assert "variable-projection" in hello["methods"]
        (every, number, dropped, void), times, values = frame_of(first)
        assert (every, number, dropped, void) == (1, 0, 0, 1)
        assert np.all(np.diff(times) >= 0.0)
        list(messages(client, until=lambda each: isinstance(each, bytes)))  # the rest of it
        total = page.writer.count
        page.write(50)
        *_, new = messages(
            client, until=lambda each: isinstance(each, bytes) and frame_of(each)[0][1] >= total
        )
        (_, number, dropped, void), times, values = frame_of(new)
        assert (number, dropped, void) == (total, 0, 0)
        assert values["force"] == pytest.approx(page.rows[6], rel=1e-6)


def test_stiffness_at_depth_comes_with_the_error_that_the_estimate_has(page):
    with page.socket() as client:
        *_, words = messages(
            client,
            until=lambda each: isinstance(each, dict) and each.get("now", {}).get("stiffness"),
        )
    depth = words["depth"]["value"]
    estimate = page.loop.estimator.estimate()
    assert words["now"]["stiffness"] == pytest.approx(estimate.stiffness_at(depth), rel=1e-6)
    assert words["now"]["damping"] == pytest.approx(estimate.damping_at(depth), rel=1e-6)
    assert words["now"]["parameters"] == pytest.approx(estimate.parameters, rel=1e-12)


def test_a_chosen_depth_is_the_one_of_all_that_is_shown(page):
    with page.socket() as client:
        client.send(json.dumps({"ask": "depth", "value": 0.004}))
        void = []
        for message in messages(
            client,
            until=lambda each: isinstance(each, dict) and each.get("depth", {}).get("chosen"),
        ):
            void += [frame_of(message)[0][3]] if isinstance(message, bytes) else []
        *_, again = messages(client, until=lambda each: isinstance(each, bytes))
        _, _, values = frame_of(again)
        assert frame_of(again)[0][3] == 1  # all of it anew
        law = page.loop.estimator.estimate().law
        assert np.nanmax(values["stiffness"]) > 0.0
        last = values["parameter_0"][-1], values["parameter_2"][-1]
        assert values["stiffness"][-1] == pytest.approx(
            last[0] * last[1] * 0.004 ** (last[1] - 1), rel=1e-5
        )
        assert law.kind == "hunt-crossley"
        client.send(json.dumps({"ask": "depth", "value": None}))
        list(
            messages(
                client,
                until=lambda each: (
                    isinstance(each, dict) and each.get("depth", {}).get("chosen") is False
                ),
            )
        )


def test_a_browser_that_asks_for_fewer_samples_gets_every_fourth(page):
    with page.socket() as client:
        list(messages(client, until=lambda each: isinstance(each, bytes)))
        client.send(json.dumps({"ask": "every", "value": 4}))
        *_, thin = messages(
            client, until=lambda each: isinstance(each, bytes) and frame_of(each)[0][0] == 4
        )
        (_, number, _, void), times, _ = frame_of(thin)
        assert (number % 4, void) == (0, 1)
        assert np.median(np.diff(times)) == pytest.approx(4e-3)


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


@pytest.mark.parametrize("host", ["localhost:1", "127.0.0.1", "[::1]:8765"])
def test_an_address_and_the_names_of_this_machine_are_let_in(page, host):
    assert page.get(Host=host)[0].status == 200


@pytest.mark.parametrize(
    "origin", [None, "null", "http://elsewhere.example", "http://127.0.0.1:1", "file://"]
)
def test_another_site_gets_no_socket(page, origin):
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
        cookie = answer.headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie
        remembered = cookie.partition(";")[0]
        assert page.get(Cookie=remembered)[0].status == 200
        with page.socket(additional_headers={"Cookie": remembered}) as client:
            assert client.recv(timeout=10)
        assert page.get(Cookie=remembered[:-1] + "é; x")[0].status == 403
        assert page.counted("refused", 7) >= 7


def test_beyond_the_loopback_a_token_is_demanded():
    assert token_for("127.0.0.1", None) is None
    assert token_for("::1", None) is None
    tokens = {token_for(address, None) for address in ("0.0.0.0", "::", "192.0.2.1")}
    assert len(tokens) == 3
    assert all(len(token) >= 24 for token in tokens)


@pytest.mark.parametrize("token", ["", "short", "spaces are no letters here", 12345678901234567890])
def test_a_token_that_can_be_guessed_is_refused(token):
    with pytest.raises(InvalidParameterError, match="token must have 16"):
        Page(port=0, token=token)


def test_a_port_in_use_is_known_before_anything_starts(page):
    with pytest.raises(
        InvalidParameterError, match=r"cannot listen on 127.0.0.1 port \d+: address"
    ):
        Page(port=page.page.port)
    with pytest.raises(InvalidParameterError, match=r"host 'no\.such\.name\.invalid' is not known"):
        Page(host="no.such.name.invalid", port=0)
    with pytest.raises(InvalidParameterError, match="port must be in"):
        Page(port=70000)


# --- what it passes on


@pytest.mark.parametrize(
    "request_, command",
    [
        ({"ask": "hold"}, Command("hold")),
        ({"ask": "resume"}, Command("resume")),
        ({"ask": "reset"}, Command("reset")),
        ({"ask": "tare", "seconds": 2}, Command("tare", {"seconds": 2.0})),
        ({"ask": "record", "on": True}, Command("record", {"on": True})),
        (
            {"ask": "estimator", "method": "kelvin-voigt", "forgetting_factor": 0.99},
            Command("estimator", {"method": "kelvin-voigt", "forgetting_factor": 0.99}),
        ),
    ],
)
def test_what_a_person_asks_arrives_at_the_loop(page, request_, command):
    with page.socket() as client:
        client.send(json.dumps(request_))
        assert page.commands.poll(10)
        assert page.commands.recv() == command


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "must be JSON"),
        ("[]", '"ask"'),
        ('{"ask": 1}', '"ask"'),
        ("[" * 2000, "must be JSON"),
        ('{"ask": NaN}', "must be JSON"),
        ('{"ask": "stop"}', "nothing is called 'stop'"),
        ('{"ask": "hold", "path": "/etc/passwd"}', "options must be none"),
        ('{"ask": "record", "path": "/etc/passwd"}', "options must be on"),
        ('{"ask": "tare"}', "options must be seconds"),
        ('{"ask": "tare", "seconds": 1e9}', "seconds must be in"),
        ('{"ask": "tare", "seconds": [1]}', "seconds must be a number"),
        ('{"ask": "depth", "value": -1}', "value must be in"),
        ('{"ask": "every", "value": 3}', "value must be one of"),
        ('{"ask": "every", "value": [1]}', "value must be one of"),
        ('{"ask": "estimator", "method": "none"}', "method must be one of"),
        ('{"ask": "estimator", "method": "kelvin-voigt", "gate": 1}', "main settings only"),
        ('{"ask": "estimator", "method": "kelvin-voigt", "forgetting_factor": 2}', "factor"),
        ('{"ask": "estimator", "method": "kelvin-voigt", "change_detector": 7}', "change_detector"),
        ('{"ask": "source", "material": "ball"}', "the source offers no such 'material'"),
        ('{"ask": "source"}', "one thing at a time"),
    ],
)
def test_what_cannot_be_done_is_refused_in_words(page, text, words):
    with page.socket() as client:
        client.send(text)
        *_, said = messages(
            client, until=lambda each: isinstance(each, dict) and each["kind"] == "refused"
        )
    assert words in said["words"]
    assert not page.commands.poll(0)


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
        assert requests.MOST_COMMANDS <= arrived < 100


def test_a_loop_that_writes_nothing_more_is_said_and_its_return_too(monkeypatch):
    monkeypatch.setattr(watch, "ALIVE", 0.6)  # s
    with served(seconds=0.1) as page, page.socket() as client:
        silent = messages(client, until=lambda each: isinstance(each, dict) and "alive" in each)
        assert list(silent)[-1]["alive"]
        *_, last = messages(client, until=lambda each: is_of(each, alive=False))
        assert last["loop"]["state"]
        page.write(1)
        assert list(messages(client, until=lambda each: is_of(each, alive=True)))


def is_of(message, *, alive):
    return isinstance(message, dict) and message.get("alive") is alive


@pytest.mark.slow
def test_a_loop_that_does_not_answer_holds_up_no_page(monkeypatch):
    monkeypatch.setattr(requests, "COMMAND_TIME", 1e-9)  # a person of endless patience
    with served(seconds=0.1) as page, page.socket() as client:
        for _ in range(4000):  # nobody reads them, and the system has room for some hundred kB
            client.send('{"ask": "reset"}')
        words = "the loop does not answer"
        refused = messages(client, until=lambda each: words in str(each), seconds=20)
        assert words in list(refused)[-1]["words"]
        assert page.get()[0].status == 200


# --- what it withstands


def test_there_is_room_for_so_many_browsers_and_no_more(page):
    with ExitStack() as open_ones:
        clients = [open_ones.enter_context(page.socket()) for _ in range(server.MOST_CLIENTS)]
        with page.socket() as one_more:
            with pytest.raises(ConnectionClosed) as closed:
                one_more.recv(timeout=10)
            assert closed.value.rcvd.code == 4429
        assert clients[0].recv(timeout=10)
        assert page.counts()["turned_away"] >= 1


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
        list(messages(client, until=lambda each: isinstance(each, bytes) and len(each) > 24))


def handshaken(page):
    """A bare connection after the handshake."""
    made = socket.create_connection(("127.0.0.1", page.page.port), timeout=10)
    made.sendall(
        f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{page.page.port}\r\nOrigin: {page.origin}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n".encode()
    )
    assert b"101" in made.recv(64)
    return made


def wait_for_the_end(connection):
    """Read until the other end closes it."""
    with connection, suppress(ConnectionError):
        while connection.recv(1 << 16):
            pass


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


def test_malformed_frames_and_requests_end_their_connections_and_are_counted(page):
    before = page.counts()["malformed"]
    for frame in MALFORMED.values():
        connection = handshaken(page)
        connection.sendall(frame)
        wait_for_the_end(connection)
    for words in NO_REQUESTS:
        connection = socket.create_connection(("127.0.0.1", page.page.port), timeout=10)
        connection.sendall(words)
        wait_for_the_end(connection)
    expected = before + len(MALFORMED) + len(NO_REQUESTS)
    assert page.counted("malformed", expected) == expected
    assert page.get()[0].status == 200


def test_connections_that_ask_for_nothing_take_no_room_from_those_that_do(monkeypatch):
    monkeypatch.setattr(protocol, "PATIENCE", 0.5)
    with served(seconds=0.1) as page, ExitStack() as idle, page.socket() as client:
        for k in range(100):
            made = socket.create_connection(("127.0.0.1", page.page.port), timeout=10)
            idle.enter_context(made)
            if k % 2:
                with suppress(ConnectionError):
                    made.sendall(b"GET / HTTP/1.1\r\nHost: 127")  # and never the rest
        assert page.counted("turned_away", 100) == 100
        assert page.get()[0].status == 200
        list(messages(client, until=lambda each: isinstance(each, dict)))  # it is not idle


@pytest.mark.slow
def test_who_asks_for_answers_and_never_reads_them_is_cut_off():
    with served(seconds=0.1) as page:
        connection = handshaken(page)
        before = resident()
        ping = raw_frame(0x9, bytes(125)) * 1000
        with pytest.raises(OSError, match=r"reset|[Bb]roken pipe"):
            connection.sendall(ping * 1000)
        connection.close()
        # 130 MB of answers are asked for; what a connection holds is bounded by 1 MB.
        assert resident() - before < 2e7


@pytest.mark.slow
def test_a_browser_that_takes_nothing_holds_up_nobody_and_is_closed(monkeypatch):
    monkeypatch.setattr(server, "STALLED", 0.7)
    with served(seconds=1.0) as page:
        stuck = handshaken(page)  # it never reads
        before = resident()
        with page.socket() as client:
            list(messages(client, until=lambda each: isinstance(each, bytes)))
            seen, until = 0, time.monotonic() + 30.0
            while not page.own.read().get("stalled") and time.monotonic() < until:
                page.write(1000)  # as fast as it goes: the buffers of the system are some MB
                total = page.writer.count
                *_, last = messages(client, until=lambda each: isinstance(each, bytes))
                seen = max(seen, frame_of(last)[0][1])
            assert seen > total // 2
        counts = page.counts()
        assert counts["stalled"] == 1
        # The page's own rows, touched here first, are 18 MB, and what it imports some 20.
        assert resident() - before < 6e7
        stuck.close()
