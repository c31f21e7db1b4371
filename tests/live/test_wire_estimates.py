"""Estimates published on each wire are those of the loop, in standard message types."""

import json
import math
import random
import re
import struct
import subprocess
import time
from contextlib import closing
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zmq
from cases import MATERIALS
from rosbags.typesys import get_types_from_msg
from scripted import Silence, arrivals, in_a_process, looped, measured, pressed
from wire_robots import ROBOTS, free_port

import palpate
from benchmarks.live_wires import FAULTY_FROM, faulty_robot
from palpate.errors import InvalidParameterError, PalpateError
from palpate.live import ros, run, schema
from palpate.live.choices import State
from palpate.live.diagnosing import diagnose_samples, recent
from palpate.live.schema import ESTIMATE_FIELDS, SCHEMA, STATUS_FIELDS, read_run
from palpate.live.sinks import PLACE, UNDIAGNOSED
from palpate.live.sources import Replay
from palpate.live.wires import Publisher, open_publisher, parse_address
from palpate.live.zeromq import ZeroMQWire

DEFINITION = Path(__file__).parents[2] / "ros" / "palpate_msgs" / "msg" / "ContactEstimate.msg"
NAMES = [field.name for field in ESTIMATE_FIELDS]
NUMBERS = ("K", "n", "B", "p", "M")


class Listener:
    """What hears the estimates; each wire's own, without palpate's part of it."""

    def __init__(self) -> None:
        self.raw: list[bytes] = []
        self.estimates: list[dict[str, Any]] = []
        self.said: list[dict[str, Any]] = []

    def connect(self) -> None:
        time.sleep(2.0)


class ZeroMQListener(Listener):
    form = "json"

    def __init__(self) -> None:
        super().__init__()
        self.zmq, self.context = zmq, zmq.Context()
        self.socket = self.context.socket(zmq.SUB)
        self.socket.rcvhwm, self.socket.reconnect_ivl = 0, 10
        self.endpoint = f"tcp://127.0.0.1:{free_port()}"
        self.socket.setsockopt(zmq.SUBSCRIBE, b"")
        self.address = f"zmq:{self.endpoint}?format={self.form}"

    def connect(self) -> None:
        monitor = self.socket.get_monitor_socket(self.zmq.EVENT_HANDSHAKE_SUCCEEDED)
        self.socket.connect(self.endpoint)  # tried every 10 ms, until the publisher is there
        assert monitor.poll(60_000)
        self.socket.disable_monitor()
        monitor.close(0)
        time.sleep(0.3)  # for the subscription, which follows at once

    def hear(self) -> None:
        while self.socket.poll(200):
            topic, data = self.socket.recv_multipart()
            if topic == b"status":
                self.said.append(json.loads(data))
            else:
                self.raw.append(data)
                self.estimates.append(self.read(data))

    def read(self, data: bytes) -> dict[str, Any]:
        page = json.loads(data)
        numbers = {k: math.nan if v is None else v for k, v in page.items()}
        return {**page, **numbers}

    # By palpate's own reader.
    decode = staticmethod(schema.read_estimate)

    def close(self) -> None:
        self.socket.close(0)
        self.context.term()


class BinaryListener(ZeroMQListener):
    form = "binary"

    def read(self, data: bytes) -> dict[str, Any]:
        """As a program in C would: a structure without gaps, then texts."""
        numbers = list(struct.unpack_from("<IIQ33dB??bb3x", data))
        place, texts = 288, []
        while place < len(data):
            (size,) = struct.unpack_from("<I", data, place)
            texts.append(data[place + 4 : place + 3 + size].decode())
            place += 4 + size + -size % 4
        arrays = [numbers[20:25], numbers[28:33]]  # of eight, of which the law has five
        assert np.isnan([*numbers[25:28], *numbers[33:36]]).all()
        return dict(zip(NAMES, [*numbers[:20], *arrays, *numbers[36:], *texts], strict=True))


TYPES = {
    "estimate": "palpate_msgs/msg/ContactEstimate",
    "status": "diagnostic_msgs/msg/DiagnosticArray",
}


class RosListener(Listener):
    wire = ""

    def __init__(self) -> None:
        super().__init__()
        self.robot = ROBOTS[self.wire]()
        self.store = self.robot.store
        own = get_types_from_msg(DEFINITION.read_text(encoding="utf-8"), TYPES["estimate"])
        self.store.register({name: each for name, each in own.items() if "palpate" in name})

    # By palpate's own reader.
    decode = staticmethod(ros.read_estimate)

    def estimate(self, data: bytes) -> None:
        message = self.store.deserialize_cdr(data, TYPES["estimate"])
        found = {name: getattr(message, name) for name in NAMES}
        for name in ("parameters", "standard_errors"):
            found[name] = found[name][: len(NUMBERS)].tolist()
        stamp = message.header.stamp
        assert stamp.sec + 1e-9 * stamp.nanosec == pytest.approx(found["time"], abs=1e-6)
        self.raw.append(data)
        self.estimates.append(found)

    def status(self, data: bytes) -> None:
        message = self.store.deserialize_cdr(data, TYPES["status"])
        (one,) = message.status
        assert one.name == "palpate"
        said = {each.key: each.value for each in one.values}
        stamp = message.header.stamp
        self.said.append({"state": one.message, "time": stamp.sec + 1e-9 * stamp.nanosec, **said})

    def close(self) -> None:
        self.robot.close()


class DDSListener(RosListener):
    wire = "dds"

    def __init__(self) -> None:
        super().__init__()
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        from palpate.live.dds import participant, raw_type

        domain = self.robot.domain
        self.address = f"dds:/palpate?domain={domain}"
        member = participant(domain, None)
        qos = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepAll)
        self.readers = {
            name: DataReader(member, Topic(member, f"rt/palpate/{name}", raw_type(kind)), qos=qos)
            for name, kind in TYPES.items()
        }

    def hear(self) -> None:
        time.sleep(0.2)
        for name, reader in self.readers.items():
            for each in reader.take(100_000):
                if each.sample_info.valid_data:
                    getattr(self, name)(each.raw)


class ZenohListener(RosListener):
    wire = "zenoh"

    def __init__(self) -> None:
        super().__init__()
        import zenoh

        self.address = f"zenoh:/palpate?connect={self.robot.endpoint}"
        self.heard: list[tuple[str, bytes, bytes]] = []
        self.tokens: list[str] = []

        def callback(take):
            return zenoh.handlers.Callback(take, lambda: None, indirect=False)

        def hear(sample) -> None:
            found = sample.payload.to_bytes(), sample.attachment.to_bytes()
            self.heard.append((str(sample.key_expr), *found))

        session = self.robot.session
        session.declare_subscriber("0/palpate/**", callback(hear))
        meet = callback(lambda sample: self.tokens.append(str(sample.key_expr)))
        session.liveliness().declare_subscriber("@ros2_lv/**", meet)

    def hear(self) -> None:
        time.sleep(0.2)
        numbers = {}
        for key, data, attached in self.heard:
            domain, prefix, name, kind, checksum = key.split("/")
            type_name = kind.replace("::msg::dds_::", "/msg/").removesuffix("_")
            assert (domain, prefix) == ("0", "palpate")
            assert checksum == self.store.hash_rihs01(type_name)
            getattr(self, name)(data)
            number, written, length, _ = struct.unpack("<qqB16s", attached)
            assert length == 16
            assert number == numbers.get(name, 0) + 1
            assert abs(written - time.time_ns()) < 60e9
            numbers[name] = number
        kinds = {token.split("/")[5] for token in self.tokens}
        assert kinds == {"NN", "MP"}
        assert any("/%palpate%estimate/palpate_msgs::msg::dds_::" in each for each in self.tokens)


class Later(Replay):
    """Begins when those who listen are connected: a publisher sends nothing to nobody."""

    def open(self) -> None:
        self.listener.connect()
        super().open()


@pytest.mark.parametrize(
    "kind",
    [
        ZeroMQListener,
        *(pytest.param(kind, marks=pytest.mark.slow)
          for kind in (BinaryListener, DDSListener, ZenohListener)),
    ],
)  # fmt: skip
def test_every_estimate_is_published_with_names_and_units(kind) -> None:
    source = Later(touch := palpate.Contact(**vars(pressed(0.4))))
    with closing(kind()) as listener:
        source.listener = listener
        status = run(source, sinks=[open_publisher(listener.address)])
        listener.hear()
    assert len(listener.estimates) == len(touch) == status["counts"]["taken"]
    assert [each["number"] for each in listener.estimates] == list(range(len(touch)))
    last = listener.estimates[-1]
    assert list(last) == NAMES
    times = [each["time"] for each in listener.estimates]
    assert (np.diff(times) > 0).all()
    assert last["schema"] == SCHEMA
    assert (last["method"], last["law"]) == ("viscoelastic", "generalised-hunt-crossley")
    assert tuple(last["parameter_names"].split()) == NUMBERS
    stiffness, error = last["parameters"][0], last["standard_errors"][0]
    assert 0.0 < error < stiffness
    assert 0.0 < last["stiffness_standard_error"]
    assert last["age"] == pytest.approx(last["time"] - last["learned_time"], abs=1e-6)
    # Nothing diagnoses it: no reader may take that for trust.
    assert {each["stiffness_mark"] for each in listener.estimates} == {-1}
    assert repr(listener.decode(listener.raw[-1])) == repr(last)
    said = listener.said[-1]
    names = [name for name in said if name.removesuffix("_standard_error") not in NUMBERS]
    known = {field.name for field in (*ESTIMATE_FIELDS, *STATUS_FIELDS)}
    assert {name for name in names if name not in known} <= {
        f"{field.name}_standard_error" for field in STATUS_FIELDS
    }
    assert known - set(said) == {"parameters", "standard_errors"}
    assert said["state"] in ("contact", "free", "changed", "lost")
    assert (said["law"], int(said["schema"])) == ("generalised-hunt-crossley", SCHEMA)
    assert re.match("K .*±", said["words"])
    assert len(json.loads(str(said["covariance"]))) == len(NUMBERS) ** 2
    numbers = [said[name] for name in ("lost", "age", "K_standard_error", "K")]
    assert sorted(map(float, numbers)) == [*map(float, numbers)]
    # In JSON they are numbers; in ROS every value is text.
    assert issubclass(kind, RosListener) or {type(each) for each in numbers} <= {int, float}
    assert (said["stiffness_verdict"], said["answer"]) == ("not diagnosed yet", "")
    assert said["damping_reason"] == UNDIAGNOSED


def publishing_to(wire):
    publishing = Publisher(wire)
    publishing._watching = SimpleNamespace(dropped=0, tell=lambda page: None)
    return publishing


def test_the_wire_reports_a_silent_source() -> None:
    loop, rows = looped([*arrivals(*measured(0.3)), Silence(3.0)])
    told = []
    words = {"estimate": lambda _: "estimate", "status": lambda values: values}
    full = SimpleNamespace(name="full", **words, put=lambda _, said: told.append(said))
    publishing = publishing_to(full)
    page = loop.status()
    for state in ("contact", "lost"):
        run = read_run({**page, "state": state}, None)
        publishing._publish(run, rows[: 100 * (state == "contact")])
        publishing._told = 0.0
        publishing._tell({**page, "state": state}, run)
    # What could not be sent is counted with the rest.
    assert publishing._watching.dropped == told.count("estimate") == 100
    before, after = told[100:]
    assert (before["state"], after["state"]) == ("contact", "lost")
    assert not after["stiffness_usable"]
    assert after["stiffness_verdict"] == after["damping_verdict"] == "do-not-trust"
    assert after["age"] == pytest.approx(3.0, abs=0.05)
    assert after["stiffness_reason"] == "no samples arrive: the estimate is 3.0 s old"


def test_a_verdict_is_published_until_it_is_outdated():
    """Over ZeroMQ, from the rows of a loop and the page of a real diagnosis."""
    loop, rows = looped(arrivals(*measured(4.0)))
    status = {**loop.status(), "origin": 10**12}
    samples = rows[:, [PLACE[n] for n in ("time", "penetration", "velocity", "force", "status")]]
    pages = {"now": {"dropped": 0}}  # as the diagnosis' board is before the first
    listener = ZeroMQListener()
    publishing = open_publisher(listener.address)
    publisher = publishing._wire
    publisher.open()
    publishing._watching = publishing_to(publisher)._watching

    def heard(first, **columns):
        part = rows[first : first + 100].copy()
        for name, value in columns.items():
            part[:, PLACE[name]] = value
        publishing._told = 0.0
        publishing._publish(state := read_run(status, pages["now"]), part)
        publishing._tell(status, state)
        listener.hear()
        return listener.estimates[-1], listener.said[-1]

    try:
        listener.connect()
        estimate, said = heard(1000)
        assert estimate["stiffness_mark"] == -1
        assert said["stiffness_reason"] == "the first diagnosis has not finished yet"
        pages["now"] = page = diagnose_samples(recent(samples, 20.0, 0.0), status)
        estimate, said = heard(1100)
        assert estimate["age"] < 0.1
        assert estimate["stiffness_mark"] == estimate["damping_mark"] == 2
        depth, bars = said["diagnosed_depth"], said["diagnosed_stiffness_standard_error"]
        exact = MATERIALS["ball"].stiffness_at(depth)
        assert abs(said["diagnosed_stiffness"] - exact) < 4.0 * bars < 0.1 * exact
        assert said["answer"] == page["answer"]
        assert said["stiffness_verdict"] == said["damping_verdict"] == "trust"
        assert said["stiffness_reason"] == ""
        assert said["verdict_time"] == said["diagnosis_time"]
        assert said["diagnosis_time"] == pytest.approx(1000.0 + rows[-1, 0], abs=0.05)
        estimate, said = heard(1200, age=1.2)
        assert said["age"] == estimate["age"] == 1.2
        assert not estimate["stiffness_usable"]
        # Of a change the board does not know yet; then it does.
        changed, _ = heard(1300, state=State.CHANGED)
        assert changed["stiffness_mark"] == -1
        status["counts"]["changes"] += 1
        estimate, said = heard(1400)
        assert estimate["stiffness_mark"] == -1
        assert (said["stiffness_verdict"], said["diagnosis_time"]) == ("not diagnosed yet", None)
        assert said["stiffness_reason"] == "the material has changed since"
    finally:
        publisher.close()
        listener.close()


@pytest.mark.long
@pytest.mark.parametrize("fault", ["stuck", "late", "saturated", "lost contact", "NaN", "clock"])
def test_a_fault_that_the_loop_finds_is_the_reason_of_both_marks(fault) -> None:
    depth, force = faulty_robot(fault)
    begin, end = round(1e3 * FAULTY_FROM), round(1e3 * FAULTY_FROM) + 1500
    times = there = 1e-3 * np.arange(end)
    if fault == "NaN":
        force[begin:] = math.nan
    if fault == "clock":
        times = np.minimum(times, times[begin])
    columns = (each[:end].tolist() for each in (times, depth, force))
    loop, rows = looped(arrivals(*columns, there=there.tolist()))
    state = read_run(loop.status(), None)
    before, last = schema.estimates(rows[[begin - 1, -1]], state, 0)
    assert (before["stiffness_usable"], before["checks"]) == (True, 0)
    reason = state.diagnosis["damping_reason"]
    words = {"stuck": "stuck force", "late": "late force", "saturated": "saturation"}
    words |= {"NaN": "rejecting samples that are NaN", "clock": "rejecting samples that repeat"}
    assert reason == state.diagnosis["stiffness_reason"]
    assert reason.startswith(words.get(fault, fault))
    assert last["stiffness_mark"] == last["damping_mark"] == (-1 if fault == "lost contact" else 0)
    if fault in ("lost contact", "NaN", "clock"):
        assert last["age"] == pytest.approx(1.5, abs=0.3)
        assert not last["stiffness_usable"]


ENCODED = {
    "json": (partial(ZeroMQWire, "tcp://127.0.0.1:1"), schema.read_estimate),
    "binary": (partial(ZeroMQWire, "tcp://127.0.0.1:1?format=binary"), schema.read_estimate),
    "ros": (lambda: ros.RosWire(parse_address("dds", "/palpate", ())), ros.read_estimate),
}
BAD = [
    ({"schema": 3}, "schema 3, this listener reads schema 4: update the palpate that publishes"),
    ({"schema": 5}, "schema 5, this listener reads schema 4: update the listener"),
    ({"state": 9}, "state 9"),
    ({"stiffness_mark": 7}, r"marks \[-1, 7\]"),
]


@pytest.mark.parametrize("wire", ENCODED)
def test_a_listener_refuses_in_one_line_what_is_no_estimate_of_its_schema(wire) -> None:
    make, read = ENCODED[wire]
    publisher = make()
    loop, rows = looped(arrivals(*measured(0.3)))
    (good,) = schema.estimates(rows[-1:], read_run(loop.status(), None), 7)
    whole = publisher.estimate(good)
    assert repr(read(whole)) == repr(good)
    for change, words in BAD:
        with pytest.raises(schema.MessageError, match=words) as caught:
            read(publisher.estimate(good | change))
        assert "\n" not in str(caught.value)
    # Numbers that are none are unknown, not errors; texts are cut.
    odd = {"stiffness": math.inf, "age": math.nan, "flags": "é" * 5000}
    found = read(publisher.estimate(good | odd))
    assert math.isnan(found["stiffness"])
    assert len(found["flags"]) == (5000 if wire == "json" else 500)
    # A stranger's bytes: cut anywhere, changed anywhere, random, and far too many.
    rng = random.Random(3)
    strange = [whole[:k] for k in range(len(whole))] + [b"", b"{}", b"[" * 100_000, b"{" * 10**6]
    for _ in range(2000):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        strange.append(bytes(data))
    refusals = []
    for data in strange:
        try:
            read(data)
        except schema.MessageError as error:
            refusals.append(str(error))
    assert 0 < len(refusals) < len(strange)
    assert not [line for line in refusals if len(line) > 300 or "\n" in line]


def test_an_address_in_use_is_one_clear_line() -> None:
    robot = ROBOTS["zmq"]()
    for address in (robot.address, robot.address + "?format=binary"):
        with pytest.raises(PalpateError, match=r"^zmq:tcp://127\.\S+: address already in use$"):
            open_publisher(address)
    robot.close()
    robot = ROBOTS["zenoh"]()
    listen = f"zenoh:/palpate?listen={robot.endpoint}"
    with pytest.raises(PalpateError, match=r"^zenoh: tcp/127.0.0.1:\d+: address already in use$"):
        open_publisher(listen)
    robot.close()


def test_a_missing_publisher_is_one_line() -> None:
    address = f"zenoh:/palpate?connect=tcp/127.0.0.1:{free_port()}"
    with pytest.raises(PalpateError, match=r"^zenoh: no answer from tcp/.*rmw_zenohd") as caught:
        open_publisher(address)
    assert "\n" not in str(caught.value)


def test_missing_packages_are_named_in_one_line() -> None:
    code = """
import sys
sys.modules["rosbags"] = None
from palpate.errors import MissingExtraError
from palpate.live.sources import open_source
from palpate.live.wires import open_publisher
for opened in (open_source, open_publisher):
    try:
        opened("dds:/pose")
    except MissingExtraError as error:
        print(error)
"""
    out, _ = in_a_process(code, stdout=subprocess.PIPE).communicate(timeout=60)
    assert out == 2 * "dds needs rosbags: pip install '.[live]' in a checkout of palpate\n"


@pytest.mark.parametrize(
    "address",
    ["zmq:127.0.0.1", "zmq:tcp://127.0.0.1:1?format=xml", "dds:/a,/b", "dds:", "zenoh:/p?mode=x"],
)
def test_an_address_that_is_none_is_refused(address) -> None:
    with pytest.raises(InvalidParameterError):
        open_publisher(address)
