"""``python -m benchmarks.live_wires --seconds 60``: 1 kHz over each wire, on loopback.

Another process sends poses and wrenches, stamped with this machine's monotonic clock; the time is
measured until ``take`` returns them, and compared with a bare datagram of the same numbers between
the same processes. All lost samples are counted.
"""

import socket
import struct
import time
from collections.abc import Callable, Sequence
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command
from benchmarks.reading import POSE, WRENCH, stamped
from palpate.errors import PalpateError
from palpate.live.sources import SourceOptions, open_source

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
    import zmq

    from palpate.live.zeromq import packed

    publisher = zmq.Context().socket(zmq.PUB)
    publisher.sndhwm = 0
    publisher.bind(where)
    zeros = (0.0, 0.0, 0.0)
    return lambda k, stamp: publisher.send(packed(k, 1e-9 * stamp, zeros, zeros)) and None


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
    where = {"zmq": f"tcp://127.0.0.1:{_free()}", "zenoh": f"tcp/127.0.0.1:{_free()}"}.get(wire)
    where = where or (str(_free(socket.SOCK_DGRAM)) if wire == DIRECT else str(_DOMAIN))
    orders, theirs = Pipe()
    process = get_context("spawn").Process(target=serve, args=(wire, where, count, theirs))
    process.start()
    theirs.close()
    orders.poll(30.0)  # until it is ready, or has ended
    try:
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
    return Section("1 kHz on the wire, from sending to taking", rows, notes)


def main(*wires: str, seconds: float = 60.0) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    wires
        Default: zmq, dds and zenoh.
    seconds
        How long, each.
    """
    publish([section_of(wires or ("zmq", "dds", "zenoh"), seconds)], describe_machine())


if __name__ == "__main__":
    run_command(main)
