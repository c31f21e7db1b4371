"""Estimates published on each wire are what the loop found, and are said in types that all know."""

import json
import math
import struct
import time
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scripted import arrivals, looped, measured
from test_wires import wire  # noqa: F401 - a fixture
from wire_robots import ROBOTS, free_port, query

import palpate
from palpate import OnlinePreparation, Status
from palpate.errors import InvalidParameterError, PalpateError
from palpate.live import run
from palpate.live.running import default_estimator
from palpate.live.sinks.diagnosis import diagnosed, recent
from palpate.live.sinks.opening import open_publisher
from palpate.live.sinks.publishing import _Publishing
from palpate.live.sinks.watching import PLACE, diagnosis_of
from palpate.live.sinks.zeromq import BINARY
from palpate.live.sources.replay import Replay
from palpate.live.states import State

NAMES = [
    "time",
    "prepared_time",
    "penetration",
    "velocity",
    "force",
    "predicted_force",
    "state",
    "offset",
    "surface",
    "margin",
    "stiffness",
    "damping",
    "exponent",
    "stiffness_standard_error",
    "damping_standard_error",
    "exponent_standard_error",
    "verdict",
    "age",
]


class Listener:
    """What hears the estimates; each wire's own, without palpate's part of it."""

    wait = 2.0  # s, until it is connected

    def __init__(self, wire: str) -> None:  # noqa: F811
        self.estimates: list[list[float]] = []
        self.said: list[dict[str, str]] = []
        self.names: list[str] = []

    def connect(self) -> None:
        time.sleep(self.wait)


class ZeroMQListener(Listener):
    form = "json"

    def __init__(self) -> None:
        super().__init__("zmq")
        zmq = pytest.importorskip("zmq", reason="no pyzmq: pip install 'palpate[live]'")
        self.zmq, self.context = zmq, zmq.Context()
        self.socket = self.context.socket(zmq.SUB)
        self.socket.rcvhwm, self.socket.reconnect_ivl = 0, 10
        self.port = free_port()
        endpoint = f"tcp://127.0.0.1:{self.port}"
        self.endpoint = endpoint
        self.socket.setsockopt(zmq.SUBSCRIBE, b"")
        self.address = f"zmq:{endpoint}{query({'format': self.form})}"

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
        self.names = [name for name in page if name != "number"]
        assert page["number"] == len(self.estimates) + 1
        none = math.nan
        self.estimates.append([none if page[n] is None else page[n] for n in self.names])

    def close(self) -> None:
        self.socket.close(0)
        self.context.term()


class BinaryListener(ZeroMQListener):
    form = "binary"

    def take(self, data: bytes) -> None:
        number, *values = struct.unpack("<Q26d", data)
        assert number == len(self.estimates) + 1
        self.names = NAMES[:-2]  # verdict and age are in the status
        # Room for eight parameters and their errors; the law has three.
        assert np.isnan(values[13:18]).all()
        assert np.isnan(values[21:26]).all()
        self.estimates.append([*values[:13], *values[18:21]])


class RosListener(Listener):
    def __init__(self, wire: str) -> None:  # noqa: F811
        super().__init__(wire)
        self.robot = ROBOTS[wire]()
        self.store = self.robot.store

    def decoded(self, data: bytes, kind: str):
        return self.store.deserialize_cdr(data, kind)

    def take(self, data: bytes) -> None:
        message = self.decoded(data, "std_msgs/msg/Float64MultiArray")
        (dimension,) = message.layout.dim
        self.names = dimension.label.split(",")
        assert dimension.size == dimension.stride == len(message.data) == len(self.names)
        self.estimates.append(message.data.tolist())

    def status(self, data: bytes) -> None:
        message = self.decoded(data, "diagnostic_msgs/msg/DiagnosticArray")
        (one,) = message.status
        assert one.name == "palpate"
        said = {each.key: each.value for each in one.values}
        stamp = message.header.stamp
        self.said.append({"state": one.message, "time": stamp.sec + 1e-9 * stamp.nanosec, **said})

    def close(self) -> None:
        self.robot.close()


class DDSListener(RosListener):
    def __init__(self) -> None:
        super().__init__("dds")
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        from palpate.live.wires.dds_domain import participant, raw_type

        domain = self.robot.domain
        self.address = f"dds:/palpate?domain={domain}"
        member = participant(domain, None)
        qos = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepAll)
        self.readers = [
            DataReader(member, Topic(member, f"rt/palpate/{name}", raw_type(kind)), qos=qos)
            for name, kind in (
                ("estimate", "std_msgs/msg/Float64MultiArray"),
                ("status", "diagnostic_msgs/msg/DiagnosticArray"),
            )
        ]

    def hear(self) -> None:
        time.sleep(0.2)
        for reader, take in zip(self.readers, (self.take, self.status), strict=True):
            for each in reader.take(100_000):
                if each.sample_info.valid_data:
                    take(each.raw)


class ZenohListener(RosListener):
    def __init__(self) -> None:
        super().__init__("zenoh")
        import zenoh

        self.address = f"zenoh:/palpate?connect={self.robot.endpoint}"
        self.heard: list[tuple[str, bytes, bytes]] = []
        self.tokens: list[str] = []
        session = self.robot.session

        def hear(sample) -> None:
            found = sample.payload.to_bytes(), sample.attachment.to_bytes()
            self.heard.append((str(sample.key_expr), *found))

        def meet(sample) -> None:
            self.tokens.append(str(sample.key_expr))

        session.declare_subscriber(
            "0/palpate/**", zenoh.handlers.Callback(hear, lambda: None, indirect=False)
        )
        tokens = zenoh.handlers.Callback(meet, lambda: None, indirect=False)
        session.liveliness().declare_subscriber("@ros2_lv/**", tokens)

    def hear(self) -> None:
        time.sleep(0.2)
        numbers = {}
        for key, data, attached in self.heard:
            domain, prefix, name, kind, checksum = key.split("/")
            type_name = kind.replace("::msg::dds_::", "/msg/").removesuffix("_")
            assert (domain, prefix) == ("0", "palpate")
            assert checksum == self.store.hash_rihs01(type_name)
            (self.take if name == "estimate" else self.status)(data)
            number, written, length, _ = struct.unpack("<qqB16s", attached)
            assert length == 16
            assert number == numbers.get(name, 0) + 1
            assert abs(written - time.time_ns()) < 60e9
            numbers[name] = number
        kinds = {token.split("/")[5] for token in self.tokens}
        assert kinds == {"NN", "MP"}
        assert any("/%palpate%estimate/std_msgs::msg::dds_::" in each for each in self.tokens)


LISTENERS = {
    "zmq": ZeroMQListener,
    "dds": DDSListener,
    "zenoh": ZenohListener,
}


@pytest.fixture
def listener(wire):  # noqa: F811
    made = LISTENERS[wire]()
    yield made
    made.close()


def contact(seconds: float) -> palpate.Contact:
    """A touch of a known material, at its own pace."""
    time, penetration, force = map(np.array, measured(seconds))
    return palpate.Contact(
        time, penetration=penetration, velocity=np.gradient(penetration, time), force=force
    )


class Later(Replay):
    """Begins when those who listen are connected: a publisher sends nothing to nobody."""

    def __init__(self, touch: palpate.Contact, listener: Listener) -> None:
        super().__init__(touch)
        self._listener = listener

    def open(self) -> None:
        self._listener.connect()
        super().open()


def check(listener: Listener, count: int) -> None:
    listener.hear()
    assert list(listener.names) == NAMES[: len(listener.names)]
    values = np.array(listener.estimates)
    assert len(values) == count
    assert (np.diff(values[:, 0]) > 0).all()
    last = dict(zip(listener.names, values[-1], strict=True))
    assert 0.0 < last["stiffness_standard_error"] < last["stiffness"]
    said = listener.said[-1]
    assert said["state"] in ("contact", "free", "changed", "lost")
    assert said["method"] == "variable-projection"
    assert (said["law"], float(said["schema"])) == ("hunt-crossley", 2)
    assert said["words"].startswith("stiffness ")
    assert "±" in said["words"]
    numbers = [said[name] for name in ("lost", "age", "stiffness_standard_error", "stiffness")]
    assert sorted(map(float, numbers)) == [*map(float, numbers)]
    # In JSON they are numbers; in ROS all that is said is text.
    assert {type(each) for each in numbers} <= {int, float} or not isinstance(
        listener, ZeroMQListener
    )
    # Nothing diagnoses it: no reader may take that for trust.
    assert np.isnan(values[:, 16:17]).all()
    assert (said["verdict"], said["reason"]) == ("not diagnosed yet", "nothing diagnoses this loop")


def test_every_estimate_is_published_with_names_and_units() -> None:
    listener = ZeroMQListener()
    try:
        published(listener)
    finally:
        listener.close()


@pytest.mark.slow
def test_ros_hears_every_estimate_with_names_and_units(listener) -> None:
    published(listener)


def published(listener: Listener) -> None:
    touch = contact(0.4)
    status = run(Later(touch, listener), sinks=[open_publisher(listener.address)])
    assert status["counts"]["taken"] == len(touch)
    check(listener, len(touch))


@pytest.mark.slow
def test_zeromq_has_a_form_for_languages_without_json() -> None:
    listener = BinaryListener()
    try:
        published(listener)
    finally:
        listener.close()
    assert BINARY.size == 216


def test_of_a_source_that_is_silent_the_wire_says_that_it_is_lost() -> None:
    loop, rows = looped(arrivals(*measured(0.3)), OnlinePreparation(), default_estimator())
    told = []
    full = SimpleNamespace(send=lambda *_: 7, tell=lambda state, *_: told.append(state))
    quiet = SimpleNamespace(
        dropped=0, tell=lambda page: None, diagnosis=partial(diagnosis_of, None)
    )
    publishing = _Publishing(full, quiet)
    page = loop.status()
    publishing._publish(page, rows)
    assert publishing._watching.dropped == 7  # what could not be sent is counted with the rest
    publishing._tell(page, silent=False)
    publishing._told = 0.0
    publishing._tell({**page, "state": "lost"}, silent=True)
    assert told == ["contact", "lost"]


def test_a_verdict_is_published_until_it_is_not_of_what_the_loop_does():
    """Over ZeroMQ, from the rows of a loop and the page of a real diagnosis."""
    loop, rows = looped(arrivals(*measured(4.0)), OnlinePreparation(), default_estimator())
    status = {**loop.status(), "origin": 10**12}
    samples = rows[:, [PLACE[n] for n in ("time", "penetration", "velocity", "force", "status")]]
    pages = {"now": {"dropped": 0}}  # as the diagnosis' board is before the first
    listener = ZeroMQListener()
    publisher = open_publisher(listener.address)._wire
    publisher.open()
    diagnosis = lambda status: diagnosis_of(pages["now"], status)  # noqa: E731
    publishing = _Publishing(
        publisher, SimpleNamespace(dropped=0, tell=lambda page: None, diagnosis=diagnosis)
    )

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
        assert math.isnan(estimate["verdict"])
        assert said["reason"] == "the first diagnosis is to come"
        pages["now"] = page = diagnosed(recent(samples, 20.0, 0.0), status)
        estimate, said = heard(1100)
        assert (estimate["verdict"], estimate["age"]) == (2.0, 0.0)
        assert said["verdict"] == said["stiffness_verdict"] == said["damping_verdict"] == "trust"
        assert said["reason"] == page["reason"]
        assert said["diagnosis_time"] == pytest.approx(1000.0 + rows[-1, 0], abs=0.05)
        estimate, said = heard(1200, status=Status.WAITING)
        assert said["age"] >= estimate["age"] == pytest.approx(0.1)
        # Of a change the board does not know yet; then it does.
        assert math.isnan(heard(1300, state=State.CHANGED)[0]["verdict"])
        status["counts"]["changes"] += 1
        estimate, said = heard(1400)
        assert math.isnan(estimate["verdict"])
        assert (said["verdict"], said["diagnosis_time"]) == ("not diagnosed yet", None)
        assert said["reason"] == "the material has changed since"
    finally:
        publisher.close()
        listener.close()


def test_an_address_in_use_is_one_clear_line() -> None:
    robot = ROBOTS["zmq"]()
    for address in (robot.address, robot.address + "?format=binary"):
        with pytest.raises(
            PalpateError, match=r"^zmq:tcp://127.0.0.1:\d+: address already in use$"
        ):
            open_publisher(address)
    robot.close()
    robot = ROBOTS["zenoh"]()
    listen = f"zenoh:/palpate?listen={robot.endpoint}"
    with pytest.raises(PalpateError, match=r"^zenoh: tcp/127.0.0.1:\d+: address already in use$"):
        open_publisher(listen)
    robot.close()


def test_nobody_there_is_one_clear_line() -> None:
    pytest.importorskip("zenoh", reason="no eclipse-zenoh: pip install 'palpate[live]'")
    address = f"zenoh:/palpate?connect=tcp/127.0.0.1:{free_port()}"
    with pytest.raises(PalpateError, match=r"^zenoh: nobody answers at tcp/.*rmw_zenohd") as caught:
        open_publisher(address)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "address",
    ["zmq:127.0.0.1", "zmq:tcp://127.0.0.1:1?format=xml", "dds:/a,/b", "dds:", "zenoh:/p?mode=x"],
)
def test_an_address_that_is_none_is_refused(address) -> None:
    with pytest.raises(InvalidParameterError):
        open_publisher(address)
