"""``python -m benchmarks.live_wires --seconds 60``: 1 kHz over each wire, on loopback.

Another process sends poses and wrenches, stamped with this machine's monotonic clock; the time is
measured until ``take`` returns them, and compared with a bare datagram of the same numbers between
the same processes. All lost samples are counted. The same of estimates, until a listener has read
their fields. ``--faults`` runs ``palpate live`` with a robot that becomes faulty, and measures when
a listener hears of it.
"""

import math
import os
import socket
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from queue import Empty, Queue
from typing import Any

import numpy as np

from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.reading import POSE, WRENCH, stamped
from palpate import HuntCrossley, OnlinePreparation
from palpate.errors import PalpateError
from palpate.findings import LOOP_CHECKS, Check
from palpate.live import ros, run
from palpate.live.diagnosing import Diagnosing
from palpate.live.realtime import give_way, run_first
from palpate.live.schema import (
    ESTIMATE_FIELDS,
    ESTIMATE_TYPE,
    SCHEMA,
    STATUS_TYPE,
    read_estimate,
    read_json,
)
from palpate.live.sources import SourceOptions, find_wire, open_source
from palpate.live.wires import TOPICS, open_publisher, parse_address

RATE = 1000.0  # Hz
KINDS = (POSE, WRENCH)
NAMES = ("/pose", "/wrench")
BODIES = (np.eye(7)[6].tobytes(), bytes(48))  # upright at 0; no force
DIRECT = "a bare datagram"
_SETTLE = 1.0  # s, the longest that discovery takes on one machine
_BARE = struct.Struct("<Qd6d")
_DOMAIN = 200
Send = Callable[[int, int], None]


def sender(wire: str, where: str) -> Send:
    """Return the function that sends a sample, given its number and its stamp in ns."""
    if wire == "zmq":
        return _zeromq(where)
    if wire == DIRECT:
        bare = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        address = ("127.0.0.1", int(where))

        def send(k: int, stamp: int) -> None:
            bare.sendto(_BARE.pack(k, 1e-9 * stamp, *(0.0,) * 6), address)

        return send
    return _ros(wire, where)


def _zeromq(where: str) -> Send:
    from palpate.live.zeromq import packed

    publisher = _bound(where)
    zeros = (0.0, 0.0, 0.0)
    return lambda k, stamp: publisher.send(packed(k, 1e-9 * stamp, zeros, zeros)) and None


def _bound(where: str) -> Any:
    import zmq

    publisher = zmq.Context().socket(zmq.PUB)
    publisher.sndhwm = 0
    publisher.bind(where)
    return publisher


def _ros(wire: str, where: str) -> Send:
    put = {"dds": _dds, "zenoh": _zenoh}[wire](where)

    def send(k: int, stamp: int) -> None:
        for index, body in enumerate(BODIES):
            put(index, stamped(stamp, is_wrench=index == 1) + body, k)

    return send


def _dds(where: str) -> Callable[[int, bytes, int], None]:
    from cyclonedds.core import Policy, Qos
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from palpate.live.dds import participant, raw_type

    member = participant(int(where), None)
    reliable = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(10_000))
    types = [raw_type(kind) for kind in KINDS]
    writers: list[Any] = [
        DataWriter(member, Topic(member, f"rt{name}", kind), qos=reliable)
        for name, kind in zip(NAMES, types, strict=True)
    ]
    return lambda index, data, _: writers[index].write(types[index].of(data))


def _zenoh(where: str) -> Callable[[int, bytes, int], None]:
    import zenoh
    from rosbags.typesys import Stores, get_typestore

    from palpate.live import zenoh as wire
    from palpate.live.wires import parse_address

    store = get_typestore(Stores.LATEST)
    session = wire.open_session(parse_address("zenoh", f"?listen={where}", wire.OPTIONS))
    publishers = [
        session.declare_publisher(
            wire.topic_key(0, name, kind, store.hash_rihs01(kind)),
            congestion_control=zenoh.CongestionControl.BLOCK,
            express=True,
        )
        for name, kind in zip(NAMES, KINDS, strict=True)
    ]

    def put(index: int, data: bytes, k: int) -> None:
        assert not session.is_closed()  # which happens as soon as nobody holds it
        attached = wire.attachment(k, time.time_ns(), b"a robot, 16 byte")
        publishers[index].put(data, attachment=attached)

    return put


def serve(wire: str, where: str, count: int, orders: Connection) -> None:
    """Send at the rate, on request; then wait to be ended."""
    with run_first():  # as a robot's loop, and palpate's, are; also the threads of a wire
        send = sender(wire, where)
        orders.send("ready")
        orders.recv()
        begin = time.monotonic()
        for k in range(count):
            time.sleep(max(begin + k / RATE - time.monotonic(), 0.0))
            send(k, time.monotonic_ns())
    orders.recv()


def measure(wire: str, seconds: float) -> tuple[np.ndarray[Any, Any], int, int]:
    """Return times from sending to taking, s; the number sent; and lost by the source's count."""
    count = round(seconds * RATE)
    where = str(_free(socket.SOCK_DGRAM)) if wire == DIRECT else free_place(wire)
    orders, theirs = Pipe()
    process = get_context("spawn").Process(target=serve, args=(wire, where, count, theirs))
    process.start()
    theirs.close()
    orders.poll(30.0)  # until it is ready, or has ended
    try:
        with run_first():
            if wire == DIRECT:
                return _bare(int(where), count, lambda: orders.send("begin")), count, 0
            return _taken(wire, where, count, lambda: orders.send("begin"))
    finally:
        process.terminate()
        process.join()


def _taken(
    wire: str, where: str, count: int, begin: Callable[[], None]
) -> tuple[np.ndarray[Any, Any], int, int]:
    rest = {
        "zmq": where,
        "dds": f"/pose,/wrench?domain={where}",
        "zenoh": f"/pose,/wrench?connect={where}",
    }[wire]
    source = open_source(f"{wire}:{rest}", SourceOptions(vectors=True))
    source.open()
    try:
        time.sleep(_SETTLE)
        begin()
        times = np.full(count, np.nan)
        found = 0
        while found < count and (arrival := source.take(2.0)) is not None:
            times[found] = time.monotonic() - arrival.time
            found += 1
    finally:
        source.close()
    return times[:found], count, source.counts.lost + source.counts.unpaired


def _bare(port: int, count: int, begin: Callable[[], None]) -> np.ndarray[Any, Any]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bare:
        bare.bind(("127.0.0.1", port))
        bare.settimeout(2.0)
        begin()
        times = []
        for _ in range(count):
            data = bare.recv(100)
            times.append(time.monotonic() - _BARE.unpack(data)[1])
    return np.array(times)


def _free(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port


# Estimates: from a publisher to a listener.


class Listener:
    """What hears estimates and statuses on a wire; ``take`` returns them with their arrival."""

    def __init__(self, wire: str, where: str) -> None:
        self._queue: Queue[tuple[float, str, bytes]] = Queue()
        self._wire = wire
        self._ends: list[Any] = []
        getattr(self, f"_{wire}")(where)

    def take(self, seconds: float) -> Iterator[tuple[float, str, bytes]]:
        """Yield arrival (monotonic, s), topic and message of what comes within a time, s."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            if self._wire == "zmq":
                if not self._ends[0].poll(round(1e3 * left)):
                    return
                topic, data = self._ends[0].recv_multipart()
                yield time.monotonic(), topic.decode(), data
            elif self._wire == "dds":
                self._waits.wait(round(1e9 * left))
                for topic, reader in zip(TOPICS, self._ends, strict=True):
                    for each in reader.take(256):
                        if each.sample_info.valid_data:
                            yield time.monotonic(), topic, each.raw
            else:
                with suppress(Empty):
                    yield self._queue.get(timeout=left)

    def _zmq(self, where: str) -> None:
        import zmq

        socket: Any = zmq.Context.instance().socket(zmq.SUB)
        socket.rcvhwm, socket.reconnect_ivl = 0, 10
        socket.setsockopt(zmq.SUBSCRIBE, b"")
        socket.connect(where)
        self._ends = [socket]

    def _dds(self, where: str) -> None:
        from cyclonedds.core import (
            InstanceState,
            Policy,
            Qos,
            ReadCondition,
            SampleState,
            ViewState,
            WaitSet,
        )
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        from palpate.live.dds import participant, raw_type

        member = participant(int(where), None)
        reliable = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(20_000))
        self._waits = WaitSet(member)
        for topic, kind in zip(TOPICS, (ESTIMATE_TYPE, STATUS_TYPE), strict=True):
            named: Any = Topic(member, f"rt/palpate/{topic}", raw_type(kind))
            self._ends.append(DataReader(member, named, qos=reliable))
            every = InstanceState.Any | ViewState.Any | SampleState.Any
            self._waits.attach(ReadCondition(self._ends[-1], every))

    def _zenoh(self, where: str) -> None:
        import zenoh

        from palpate.live import zenoh as wire

        until = time.monotonic() + 30.0
        while not self._ends:
            try:
                address = parse_address("zenoh", f"?connect={where}", wire.OPTIONS)
                self._ends = [wire.open_session(address)]
            except PalpateError:  # the publisher does not listen yet
                if time.monotonic() > until:
                    raise
                time.sleep(0.1)

        def hear(sample: Any) -> None:
            topic = str(sample.key_expr).split("/")[2]
            self._queue.put((time.monotonic(), topic, sample.payload.to_bytes()))

        self._ends[0].declare_subscriber(
            "0/palpate/**", zenoh.handlers.Callback(hear, lambda: None, indirect=False)
        )

    def read(self, topic: str, data: bytes) -> dict[str, Any]:
        """Return the fields of an estimate, or of a status."""
        if topic == TOPICS[0]:
            return read_estimate(data) if self._wire == "zmq" else ros.read_estimate(data)
        if self._wire == "zmq":
            return read_json(data)
        [status] = ros.typestore().deserialize_cdr(data, STATUS_TYPE).status
        return {each.key: each.value for each in status.values}

    def close(self) -> None:
        """Leave the wire."""
        for end in self._ends:
            if self._wire != "dds":
                end.close()
        self._ends.clear()


EMPTY: dict[str, Any] = {
    field.name: {"string": 20 * "text", "bool": True, "float64": 0.1}.get(field.kind, 0)
    for field in ESTIMATE_FIELDS
}
EMPTY |= {name: [0.1] * 5 for name in ("parameters", "standard_errors")}
EMPTY |= {"schema": SCHEMA, "parameter_names": "K n B p M"}


def published_at(wire: str, where: str) -> str:
    """Return the address of a publisher that the listener at ``where`` hears."""
    return {
        "zmq": f"zmq:{where}?format=binary",
        "dds": f"dds:/palpate?domain={where}",
        "zenoh": f"zenoh:/palpate?listen={where}",
    }[wire]


def free_place(wire: str, domain: int = _DOMAIN) -> str:
    """Return where on this machine two ends of a wire can meet."""
    port = _free()
    return {"zmq": f"tcp://127.0.0.1:{port}", "zenoh": f"tcp/127.0.0.1:{port}"}.get(
        wire, str(domain)
    )


def send_estimates(wire: str, where: str, count: int, orders: Connection) -> None:
    """Send estimates at the rate, on request; then wait to be ended."""
    give_way(gently=False)  # as palpate's publisher does
    publisher = _made(wire, where)
    publisher.open()
    orders.send("ready")
    orders.recv()
    begin = time.monotonic()
    for k in range(count):
        time.sleep(max(begin + k / RATE - time.monotonic(), 0.0))
        publisher.put(0, publisher.estimate({**EMPTY, "number": k, "time": time.monotonic()}))
    orders.recv()


def _made(wire: str, where: str) -> Any:
    kind, module, rest = find_wire(published_at(wire, where))
    assert kind is not None
    return getattr(module, kind.wire)(rest)


def measure_estimates(wire: str, seconds: float) -> tuple[np.ndarray[Any, Any], int]:
    """Return times from the numbers of an estimate to those a listener has read, s; and how many
    were sent.
    """
    count = round(seconds * RATE)
    where = free_place(wire)
    orders, theirs = Pipe()
    process = get_context("spawn").Process(
        target=send_estimates, args=(wire, where, count, theirs), daemon=True
    )
    process.start()
    theirs.close()
    orders.poll(30.0)
    times = []
    with run_first(), closing(Listener(wire, where)) as listener:
        time.sleep(2.0 * _SETTLE)
        orders.send("begin")
        for _, topic, data in listener.take(seconds + 3.0):
            found = listener.read(topic, data)
            times.append(time.monotonic() - found["time"])
            assert found["number"] == len(times) - 1
            if len(times) == count:
                break
    process.terminate()
    process.join()
    return np.array(times), count


# A faulty robot: from the fault to what a listener hears of it.

FAULTS = ("stuck", "late", "saturated", "lost contact", "unplugged")
FAULTY_FROM = 8.0  # s
FAULTY_FOR = 13.0  # s
_RANGE = 25.0  # N, of the force sensor
_LATE = 0.03  # s by which the force becomes late
_OFF = -5e-3  # m, without contact
#: What says that a listener has heard of a fault: a check's bit, or the state; and the reason.
HEARD = {
    "stuck": (Check.STUCK_FORCE, "stuck force"),
    "late": (Check.LATE_FORCE, "late force"),
    "saturated": (Check.SATURATION, "saturation"),
    "lost contact": (Check.LOST_CONTACT, "lost contact"),
    "unplugged": (None, "no samples"),
}


def faulty_robot(fault: str) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return depth and force of a robot that becomes faulty, at the rate."""
    time = np.arange(0.0, FAULTY_FROM + FAULTY_FOR, 1.0 / RATE)
    noise = np.random.default_rng(7).normal(0.0, 1.0, (2, len(time)))
    begin = round(RATE * FAULTY_FROM)
    wave = 9e-3 + 1e-3 * np.sin(4.0 * time) + 1.8e-3 * (np.sin(11.0 * time) + np.sin(15.0 * time))
    wave *= 0.75
    if fault == "saturated":  # it presses harder than the sensor can measure
        wave *= 1.0 + 0.9 * np.clip((time - FAULTY_FROM) / 0.3, 0.0, 1.0)
    depth = wave.copy()
    if fault == "lost contact":
        depth[begin:] = _OFF
    force = HuntCrossley(K=2e4, B=2e4, n=1.5).force(depth, np.gradient(depth, time))
    if fault == "late":
        late = round(RATE * _LATE)
        force[begin + late :] = force[begin:-late].copy()
    force += 0.05 * noise[0]
    depth += 5e-6 * noise[1]
    if fault == "stuck":
        force[begin:] = force[begin]
    return depth, np.minimum(force, _RANGE)


def serve_fault(wire: str, where: str, fault: str, orders: Connection) -> None:
    """Send the faulty robot's samples, on request; answer with the time of the fault."""
    send = sender_of(wire, where)
    depth, force = faulty_robot(fault)
    begin = round(RATE * FAULTY_FROM)
    orders.send("ready")
    orders.recv()
    start = time.monotonic()
    orders.send(start + FAULTY_FROM)
    for k in range(begin if fault == "unplugged" else len(depth)):
        time.sleep(max(start + k / RATE - time.monotonic(), 0.0))
        send(k, round(1e9 * (start + k / RATE)), float(depth[k]), float(force[k]))
    orders.recv()


def sender_of(wire: str, where: str) -> Callable[[int, int, float, float], None]:
    """Return the function that sends a sample: number, stamp [ns], depth [m] and force [N]."""
    if wire == "zmq":
        from palpate.live.zeromq import packed

        publisher = _bound(where)
        return lambda k, stamp, x, f: publisher.send(
            packed(k, 1e-9 * stamp, (0.0, 0.0, -x), (0.0, 0.0, -f))
        )
    put = {"dds": _dds, "zenoh": _zenoh}[wire](where)

    def send(k: int, stamp: int, x: float, f: float) -> None:
        pose = np.array([0.0, 0.0, -x, 0.0, 0.0, 0.0, 1.0]).tobytes()
        wrench = np.array([0.0, 0.0, -f, 0.0, 0.0, 0.0]).tobytes()
        put(0, stamped(stamp, is_wrench=False) + pose, k)
        put(1, stamped(stamp, is_wrench=True) + wrench, k)

    return send


def run_live(wire: str, robot: str, listener: str) -> None:
    """Run the loop with a publisher and the diagnosis, as ``palpate live`` does."""
    rest = {
        "zmq": robot,
        "dds": f"/pose,/wrench?domain={robot}",
        "zenoh": f"/pose,/wrench?connect={robot}",
    }[wire]
    source = open_source(f"{wire}:{rest}", SourceOptions(vectors=True))
    run(
        source,
        sinks=[open_publisher(published_at(wire, listener)), Diagnosing()],
        preparation=OnlinePreparation(direction=[0, 0, -1]),
        seconds=FAULTY_FROM + FAULTY_FOR + 10.0,
    )


def measure_fault(wire: str, fault: str, domain: int) -> dict[str, Any]:
    """Return what a listener hears: s from the fault to the flag and to the verdict, the reason,
    and by how much the age is wrong at the end, s.
    """
    robot_at, listener_at = free_place(wire, domain), free_place(wire, domain)
    orders, theirs = Pipe()
    context = get_context("spawn")
    robot = context.Process(target=serve_fault, args=(wire, robot_at, fault, theirs), daemon=True)
    robot.start()
    theirs.close()
    orders.poll(30.0)
    live = context.Process(target=run_live, args=(wire, robot_at, listener_at))
    live.start()
    listener = Listener(wire, listener_at)
    try:
        time.sleep(8.0)  # the loop and its sinks have started
        orders.recv()
        orders.send("begin")
        fault_at = orders.recv()
        return _hear_fault(listener, fault, fault_at)
    finally:
        listener.close()
        robot.terminate()
        live.terminate()
        robot.join()
        live.join()


def _hear_fault(listener: Listener, fault: str, fault_at: float) -> dict[str, Any]:
    check, reason = HEARD[fault]
    bit = next((bit for bit, each in LOOP_CHECKS.items() if each is check), 0)
    heard: dict[str, Any] = {
        "flag": math.nan,
        "verdict": math.nan,
        "reason": "",
        "age": math.nan,
        "statuses": 0,
    }
    last: dict[str, Any] = {}
    began = time.monotonic()
    for arrived, topic, data in listener.take(fault_at + FAULTY_FOR - 0.5 - began):
        found = listener.read(topic, data)
        if arrived < fault_at:
            continue
        lost = topic == "status" and found["state"] == "lost"
        flagged = lost if fault == "unplugged" else int(found["checks"]) & bit
        if flagged and math.isnan(heard["flag"]):
            heard["flag"] = arrived - fault_at
        if topic == "status":
            heard["statuses"] += 1
            said = str(found["stiffness_reason"])
            if math.isnan(heard["verdict"]) and said.startswith(reason):
                heard["verdict"] = arrived - fault_at
                heard["reason"] = said
            last = found
            heard["age"] = float(found["age"]) - (arrived - fault_at)
    heard["usable"] = last.get("stiffness_usable") in (True, "true")
    heard["mark"] = last.get("stiffness_verdict")
    return heard


def faults_section(wires: Sequence[str]) -> Section:
    """Measure each fault on each wire."""
    rows, notes = [], []
    for wire in wires:
        for place, fault in enumerate(FAULTS):
            heard = measure_fault(wire, fault, _DOMAIN + 1 + place)
            held = fault in ("lost contact", "unplugged")
            rows += [
                Row(f"{wire}, {fault}: flag after", heard["flag"], "s", limit=Limit(1.0)),
                Row(f"{wire}, {fault}: verdict after", heard["verdict"], "s", limit=Limit(10.0)),
                *([Row(f"{wire}, {fault}: age off by", abs(heard["age"]), "s", limit=Limit(0.5))]
                  if held else []),
            ]  # fmt: skip
            notes.append(
                f"{wire}, {fault}: {heard['mark']}, usable {heard['usable']}, "
                f"{heard['statuses'] / FAULTY_FOR:.1f} statuses a second: {heard['reason']}"
            )
    return Section("A faulty robot, until a listener hears of it", rows, notes)


def schema_section(wires: Sequence[str]) -> Section:
    """Count the lines that a listener of another schema gets, which name both versions."""
    rows = []
    for wire in wires:
        publisher = _made(wire, free_place(wire))
        for version in (SCHEMA - 1, SCHEMA + 1):
            data = bytearray(publisher.estimate(EMPTY | {"schema": version}))
            read = read_estimate if wire == "zmq" else ros.read_estimate
            try:
                read(bytes(data))
                line = ""
            except PalpateError as error:
                line = str(error)
            both = str(version) in line and str(SCHEMA) in line and "\n" not in line
            rows.append(Row(f"{wire}: schema {version}, lines that name both", both, "",
                            limit=at_least(1)))  # fmt: skip
    return Section("A listener of another schema", rows, [])


def section_of(wires: Sequence[str], seconds: float) -> Section:
    """Measure each wire, one after the other."""
    notes = [f"{seconds:g} s at {RATE:g} Hz each; ROS's wires carry two messages a sample."]
    direct = float(np.median(measure(DIRECT, seconds)[0]))
    rows = [Row(f"{DIRECT}, median", 1e3 * direct, "ms")]
    for wire in wires:
        try:
            times, sent, lost = measure(wire, seconds)
        except PalpateError as error:
            notes.append(f"not measured: {error}")
            continue
        median, late = np.median(times), np.percentile(times, 99.9)
        rows += [
            Row(f"{wire}: lost of {sent}", sent - len(times), "", limit=Limit(0.0)),
            Row(f"{wire}: lost, by the source's count", lost, "", limit=Limit(0.0)),
            Row(f"{wire}: median above the datagram's", 1e3 * (median - direct), "ms",
                limit=Limit(0.3)),
            Row(f"{wire}: p99.9", 1e3 * late, "ms"),
        ]  # fmt: skip
        times, sent = measure_estimates(wire, seconds)
        rows += [
            Row(f"{wire}: estimates lost of {sent}", sent - len(times), "", limit=Limit(0.0)),
            Row(f"{wire}: estimates, median above the datagram's",
                1e3 * (np.median(times) - direct), "ms", limit=Limit(0.3)),
            Row(f"{wire}: estimates, p99.9", 1e3 * np.percentile(times, 99.9), "ms"),
        ]  # fmt: skip
    notes.append(f"load average {os.getloadavg()[0]:.1f}.")
    return Section("1 kHz on the wire, from sending to taking", rows, notes)


def main(*wires: str, seconds: float = 60.0, faults: bool = False) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    wires
        Default: zmq, dds and zenoh.
    seconds
        How long, each.
    faults
        Also measure when a listener hears of a faulty robot, half a minute for each fault.
    """
    named = wires or ("zmq", "dds", "zenoh")
    sections = [section_of(named, seconds), schema_section(named)]
    if faults:
        sections.append(faults_section(named))
    publish(sections, describe_machine())


if __name__ == "__main__":
    run_command(main)
