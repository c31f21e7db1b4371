"""Robots on the wire: what a controller would send, a sample or anything else at a time."""

import os
import socket
import struct
import time

import pytest
import zenoh
import zmq
from message_files import Maker

from palpate.live.sources import Arrival, SourceOptions, open_source

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
START = 1_700_000_000_000_000_000  # ns
VECTORS = SourceOptions(vectors=True)


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def position(k: int) -> tuple[float, float, float]:
    return 0.4, 0.02, -0.001 * (k % 7) - 1e-9 * k


def force(k: int) -> tuple[float, float, float]:
    return 0.1, 0.0, -0.5 * (k % 7) - 1e-6 * k


def collect(source, count: int, patience: float = 3.0) -> list[Arrival]:
    """So many samples, or those that come in time."""
    found: list[Arrival] = []
    until = time.monotonic() + patience
    while len(found) < count and time.monotonic() < until:
        if (arrival := source.take(0.05)) is not None:
            found.append(arrival)
    return found


class ZeroMQRobot:
    """A PUB socket that knows of its subscribers."""

    def __init__(self, address: str = "") -> None:
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.XPUB)
        self.socket.sndhwm, self.socket.linger = 0, 0
        self.socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        self.address = address or f"zmq:tcp://127.0.0.1:{free_port()}"
        self.socket.bind(self.address.removeprefix("zmq:"))

    def again(self) -> "ZeroMQRobot":
        return ZeroMQRobot(self.address)

    def source(self, wanted: SourceOptions = VECTORS):
        source = open_source(self.address, wanted)
        source.open()
        # What it sends before it knows its subscribers it drops.
        while self.socket.recv()[:1] != b"\x01":
            assert self.socket.poll(5000)
        return source

    def send(self, k: int, stamp: int | None = None) -> None:
        stamp = START + k * 1_000_000 if stamp is None else stamp
        self.junk(struct.pack("<Qd6d", k, stamp * 1e-9, *position(k), *force(k)))

    def junk(self, data: bytes) -> None:
        self.socket.send(data)

    def close(self) -> None:
        self.socket.close()
        self.context.term()


class RosRobot:
    """Two topics of ROS, made by rosbags."""

    def __init__(self) -> None:
        self.maker = Maker()
        self.store = self.maker.store

    def message(self, kind: str, k: int, stamp: int) -> bytes:
        if kind == POSE:
            whole = self.maker.pose(stamp, [*position(k), 0.0, 0.0, 0.0, 1.0])
        else:
            whole = self.maker.wrench(stamp, [*force(k), 0.0, 0.0, 0.0])
        return bytes(self.store.serialize_cdr(whole, kind))

    def send(self, k: int, stamp: int | None = None) -> None:
        stamp = START + k * 1_000_000 if stamp is None else stamp
        for index, kind in enumerate((POSE, WRENCH)):
            self.put(index, self.message(kind, k, stamp), k)

    def junk(self, data: bytes) -> None:
        self.put(0, data, 0)

    def again(self) -> "RosRobot":
        return type(self)()


class DDSRobot(RosRobot):
    """Writers of Cyclone DDS, in a domain of their own on this machine only."""

    def __init__(self, types: tuple[str, str] = (POSE, WRENCH)) -> None:
        super().__init__()
        pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install '.[live]'")
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        from palpate.live.dds import participant, raw_type

        self.domain = 100 + os.getpid() % 100
        member = participant(self.domain, None)
        reliable = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(20_000))
        self.writers = []
        for name, kind in zip(("pose", "wrench"), types, strict=True):
            made = raw_type(kind)
            topic = Topic(member, f"rt/{name}", made)
            self.writers.append((DataWriter(member, topic, qos=reliable), made))

    def source(self, wanted: SourceOptions = VECTORS):
        source = open_source(f"dds:/pose,/wrench?domain={self.domain}", wanted)
        source.open()
        return source

    def put(self, index: int, data: bytes, k: int) -> None:
        writer, kind = self.writers[index]
        writer.write(kind.of(data))

    def junk(self, data: bytes) -> None:
        """Cyclone DDS sends no message that is none; so it is a datagram that begins as RTPS does.

        The first participant of a domain on a machine listens where the standard says.
        """
        datagram = b"RTPS\2\3\1\x10" + bytes(12) + b"\xc0" + data
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
            plain.sendto(datagram, ("127.0.0.1", 7410 + 250 * self.domain))

    def close(self) -> None:
        self.writers.clear()


class ZenohRobot(RosRobot):
    """A peer that listens, as rmw_zenoh's router would."""

    def __init__(self, types: tuple[str, str] = (POSE, WRENCH), endpoint: str = "") -> None:
        super().__init__()
        self.endpoint = endpoint or f"tcp/127.0.0.1:{free_port()}"
        config = zenoh.Config()
        config.insert_json5("mode", '"peer"')
        config.insert_json5("listen/endpoints", f'["{self.endpoint}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.publishers = [
            self.session.declare_publisher(
                f"0/{name}/{self.dds_name(kind)}/{self.store.hash_rihs01(kind)}",
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
            )
            for name, kind in zip(("pose", "wrench"), types, strict=True)
        ]

    def again(self) -> "ZenohRobot":
        return ZenohRobot(endpoint=self.endpoint)

    @staticmethod
    def dds_name(kind: str) -> str:
        package, _, name = kind.split("/")
        return f"{package}::msg::dds_::{name}_"

    def source(self, wanted: SourceOptions = VECTORS):
        source = open_source(f"zenoh:/pose,/wrench?connect={self.endpoint}", wanted)
        source.open()
        until = time.monotonic() + 5.0
        while not all(each.matching_status.matching for each in self.publishers):
            assert time.monotonic() < until
            time.sleep(0.01)
        return source

    def put(self, index: int, data: bytes, k: int) -> None:
        attached = struct.pack("<qqB16s", k, time.time_ns(), 16, b"robot robot robo")
        self.publishers[index].put(data, attachment=attached)

    def close(self) -> None:
        self.publishers.clear()
        self.session.close()


ROBOTS = {"zmq": ZeroMQRobot, "dds": DDSRobot, "zenoh": ZenohRobot}
