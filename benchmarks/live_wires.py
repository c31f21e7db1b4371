"""``python -m benchmarks.live_wires --seconds 60``: 1 kHz over each wire, on loopback.

Another process sends poses and wrenches, stamped with this machine's monotonic clock; the time is
measured until ``take`` returns them, and compared with a bare datagram of the same numbers between
the same processes. All lost samples are counted.
"""

import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command
from palpate.errors import PalpateError
from palpate.live.sources import SourceOptions, open_source

RATE = 1000.0  # Hz
KINDS = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped")
NAMES = ("/pose", "/wrench")
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
    """Messages created once; only stamp and number change."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    made = [bytearray(_zeros(store, kind)) for kind in KINDS]
    put = {"dds": _dds, "zenoh": _zenoh}[wire](store, where)

    def send(k: int, stamp: int) -> None:
        seconds, nanoseconds = divmod(stamp, 10**9)
        for index, message in enumerate(made):
            struct.pack_into("<II", message, 4, seconds, nanoseconds)  # after the head of CDR
            put(index, bytes(message), k)

    return send


def _zeros(store: Any, kind: str) -> bytes:
    types = store.types
    time_ = types["builtin_interfaces/msg/Time"](0, 0)
    header = types["std_msgs/msg/Header"](time_, "base")
    vector = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    point = types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    whole = {
        KINDS[0]: lambda: types["geometry_msgs/msg/Pose"](point, turned),
        KINDS[1]: lambda: types["geometry_msgs/msg/Wrench"](vector, vector),
    }[kind]()
    return bytes(store.serialize_cdr(types[kind](header, whole), kind))


def _dds(_: Any, where: str) -> Callable[[int, bytes, int], None]:
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


def _zenoh(store: Any, where: str) -> Callable[[int, bytes, int], None]:
    import zenoh

    from palpate.live import zenoh as wire
    from palpate.live.wires import parse_address

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


def serve(wire: str, where: str, count: int) -> None:
    """Send at the rate, on request."""
    send = sender(wire, where)
    print("ready", flush=True)
    sys.stdin.readline()
    begin = time.monotonic()
    for k in range(count):
        time.sleep(max(begin + k / RATE - time.monotonic(), 0.0))
        send(k, time.monotonic_ns())
    sys.stdin.readline()
    os._exit(0)  # the libraries' threads do not matter here


def measure(wire: str, seconds: float) -> tuple[np.ndarray[Any, Any], int, int]:
    """Return times from sending to taking, s; the number sent; and lost by the source's count."""
    count = round(seconds * RATE)
    where = {"zmq": f"tcp://127.0.0.1:{_free()}", "zenoh": f"tcp/127.0.0.1:{_free()}"}.get(wire)
    where = where or (str(_free(socket.SOCK_DGRAM)) if wire == DIRECT else str(_DOMAIN))
    command = [sys.executable, "-m", "benchmarks.live_wires", "--send", wire, where, str(count)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdout.readline()
        begin = _Begin(process.stdin)
        try:
            if wire == DIRECT:
                return _bare(int(where), count, begin), count, 0
            return _taken(wire, where, count, begin)
        finally:
            begin()
            with suppress(BrokenPipeError):
                process.communicate("end\n", timeout=30)


class _Begin:
    """Starts the sender, once."""

    def __init__(self, stream: Any) -> None:
        self._stream, self._done = stream, False

    def __call__(self) -> None:
        if not self._done:
            with suppress(BrokenPipeError):  # the sender has printed why
                self._stream.write("begin\n")
                self._stream.flush()
        self._done = True


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


def main(
    *wires: str,
    seconds: float = 60.0,
    send: Annotated[tuple[str, str, int] | None, Parameter(show=False)] = None,
) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    wires
        Default: zmq, dds and zenoh.
    seconds
        How long, each.
    send
        Be the sender of a wire: its name, its address, the number of samples.
    """
    if send is not None:
        serve(*send)
    publish([section_of(wires or ("zmq", "dds", "zenoh"), seconds)], describe_machine())


if __name__ == "__main__":
    run_command(main)
