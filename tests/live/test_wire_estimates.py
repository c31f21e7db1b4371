"""Estimates published on each wire are those of the loop, in standard message types."""

import json
import math
import re
import struct
import subprocess
import time
from contextlib import closing
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import zmq
from cases import MATERIALS
from scripted import arrivals, in_a_process, looped, measured, pressed
from wire_robots import ROBOTS, free_port

import palpate
from palpate import Status
from palpate.errors import InvalidParameterError, PalpateError
from palpate.live import run
from palpate.live.choices import State
from palpate.live.diagnosing import diagnose_samples, recent
from palpate.live.sinks import PLACE, UNDIAGNOSED, diagnosis_fields
from palpate.live.sources import Replay
from palpate.live.wires import AFTER, Publisher, open_publisher

NAMES = [
    "time", "prepared_time", "penetration", "velocity", "force", "predicted_force", "state",
    "offset", "surface", "margin", "K", "n", "B", "p",
    "M", "K_standard_error", "n_standard_error", "B_standard_error", "p_standard_error",
    "M_standard_error", *AFTER,
]  # fmt: skip


class Listener:
    """What hears the estimates; each wire's own, without palpate's part of it."""

    def __init__(self) -> None:
        self.estimates: list[list[float]] = []
        self.said: list[dict[str, str]] = []
        self.names: list[str] = []

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
                self.take(data)

    def take(self, data: bytes) -> None:
        page = json.loads(data)
        assert page.pop("number") == len(self.estimates) + 1
        self.names = list(page)
        self.estimates.append([math.nan if each is None else each for each in page.values()])

    def close(self) -> None:
        self.socket.close(0)
        self.context.term()


class BinaryListener(ZeroMQListener):
    form = "binary"

    def take(self, data: bytes) -> None:
        number, *values = struct.unpack("<Q26d", data)
        assert number == len(self.estimates) + 1
        self.names = NAMES[: -len(AFTER)]  # the diagnosis and the age are in the status
        # Room for eight parameters and their errors; the law has five.
        assert np.isnan(values[15:18]).all()
        assert np.isnan(values[23:26]).all()
        self.estimates.append([*values[:15], *values[18:23]])


TYPES = {
    "estimate": "std_msgs/msg/Float64MultiArray",
    "status": "diagnostic_msgs/msg/DiagnosticArray",
}


class RosListener(Listener):
    wire = ""

    def __init__(self) -> None:
        super().__init__()
        self.robot = ROBOTS[self.wire]()
        self.store = self.robot.store

    def estimate(self, data: bytes) -> None:
        message = self.store.deserialize_cdr(data, TYPES["estimate"])
        (dimension,) = message.layout.dim
        self.names = dimension.label.split(",")
        assert dimension.size == dimension.stride == len(message.data) == len(self.names)
        self.estimates.append(message.data.tolist())

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
        assert any("/%palpate%estimate/std_msgs::msg::dds_::" in each for each in self.tokens)


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
    assert list(listener.names) == NAMES[: len(listener.names)]
    values = np.array(listener.estimates)
    assert len(values) == len(touch) == status["counts"]["taken"]
    assert (np.diff(values[:, 0]) > 0).all()
    last = dict(zip(listener.names, values[-1], strict=True))
    assert 0.0 < last["K_standard_error"] < last["K"]
    said = listener.said[-1]
    assert said["state"] in ("contact", "free", "changed", "lost")
    assert said["method"] == "viscoelastic"
    assert (said["law"], float(said["schema"])) == ("generalised-hunt-crossley", 3)
    assert re.match("K .*±", said["words"])
    numbers = [said[name] for name in ("lost", "age", "K_standard_error", "K")]
    assert sorted(map(float, numbers)) == [*map(float, numbers)]
    # In JSON they are numbers; in ROS every value is text.
    assert issubclass(kind, RosListener) or {type(each) for each in numbers} <= {int, float}
    # Nothing diagnoses it: no reader may take that for trust.
    assert np.isnan(values[:, 20 : len(NAMES) - 1]).all()
    assert (said["stiffness_verdict"], said["answer"]) == ("not diagnosed yet", "")
    assert said["damping_reason"] == UNDIAGNOSED


def watching(diagnosis):
    return SimpleNamespace(dropped=0, tell=lambda page: None, diagnosis=diagnosis)


def test_the_wire_reports_a_silent_source() -> None:
    loop, rows = looped(arrivals(*measured(0.3)))
    told = []
    words = {"estimate": lambda *_: "estimate", "status": lambda state, *_: state}
    full = SimpleNamespace(name="full", **words, put=lambda _, said: told.append(said))
    publishing = Publisher(full)
    publishing._watching = watching(partial(diagnosis_fields, None))
    page = loop.status()
    publishing._publish(page, rows)
    # What could not be sent is counted with the rest.
    assert publishing._watching.dropped == told.count("estimate") == len(rows)
    publishing._tell(page, silent=False)
    publishing._told = 0.0
    publishing._tell({**page, "state": "lost"}, silent=True)
    assert told[len(rows) :] == ["contact", "lost"]


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
    publishing._watching = watching(lambda page: diagnosis_fields(pages["now"], page))

    def heard(first, **columns):
        part = rows[first : first + 100].copy()
        for name, value in columns.items():
            part[:, PLACE[name]] = value
        publishing._told = 0.0
        publishing._publish(status, part)
        publishing._tell(status, silent=False)
        listener.hear()
        return dict(zip(listener.names, listener.estimates[-1], strict=True)), listener.said[-1]

    try:
        listener.connect()
        estimate, said = heard(1000)
        assert math.isnan(estimate["stiffness_verdict"])
        assert said["stiffness_reason"] == "the first diagnosis has not finished yet"
        pages["now"] = page = diagnose_samples(recent(samples, 20.0, 0.0), status)
        estimate, said = heard(1100)
        assert estimate["age"] == 0.0
        assert estimate["stiffness_verdict"] == estimate["damping_verdict"] == 2.0
        depth, bars = estimate["working_depth"], estimate["stiffness_standard_error"]
        exact = MATERIALS["ball"].stiffness_at(depth)
        assert abs(said["stiffness"] - exact) < 4.0 * bars < 0.1 * exact
        assert said["answer"] == page["answer"]
        assert said["stiffness_verdict"] == said["damping_verdict"] == "trust"
        assert said["stiffness_reason"] == ""
        assert said["diagnosis_time"] == pytest.approx(1000.0 + rows[-1, 0], abs=0.05)
        estimate, said = heard(1200, status=Status.WAITING)
        assert said["age"] >= estimate["age"] == pytest.approx(0.1)
        # Of a change the board does not know yet; then it does.
        changed, _ = heard(1300, state=State.CHANGED)
        assert math.isnan(changed["stiffness_verdict"])
        assert math.isnan(changed["stiffness"])
        status["counts"]["changes"] += 1
        estimate, said = heard(1400)
        assert math.isnan(estimate["stiffness_verdict"])
        assert (said["stiffness_verdict"], said["diagnosis_time"]) == ("not diagnosed yet", None)
        assert said["stiffness_reason"] == "the material has changed since"
    finally:
        publisher.close()
        listener.close()


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
