"""Recordings of messages, written by the packages that people record with."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import foxglove
import numpy as np
from foxglove import messages as fox
from google.protobuf import (
    descriptor_pb2,
    descriptor_pool,
    json_format,
    message_factory,
    timestamp_pb2,
)
from mcap.writer import CompressionType, Writer
from mcap_protobuf.writer import Writer as ProtobufWriter
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

BEGIN = 1_700_000_000_123_456_789  # ns since 1970
STEP = 1_000_000
DELAY = 31_416  # from the stamp to the log
FORCE_FIELDS = [f"wrench.{what}.{axis}" for what in ("force", "torque") for axis in "xyz"]
POSE_FIELDS = [f"pose.position.{axis}" for axis in "xyz"] + [
    f"pose.orientation.{axis}" for axis in "xyzw"
]


@dataclass(frozen=True)
class Values:
    """What is recorded: nanoseconds, and wrenches (N, 6) and poses (N, 7)."""

    stamps: np.ndarray
    wrenches: np.ndarray
    poses: np.ndarray

    def __len__(self) -> int:
        return len(self.stamps)

    def columns(self) -> dict[str, np.ndarray]:
        """By what their channels are named after the topic."""
        forces = {f"/ft.{name}": self.wrenches[:, k] for k, name in enumerate(FORCE_FIELDS)}
        poses = {f"/pose.{name}": self.poses[:, k] for k, name in enumerate(POSE_FIELDS)}
        return forces | poses


@lru_cache
def values(count: int = 200, seed: int = 1, *, finite: bool = False) -> Values:
    """Numbers that show when a bit is lost: of all sizes, with −0, subnormal, infinite and NaN."""
    random = np.random.default_rng(seed)
    stamps = BEGIN + STEP * np.arange(count) + random.integers(0, 1000, count)
    wrenches = random.normal(size=(count, 6)) * 10.0 ** random.integers(-300, 300, (count, 1))
    poses = random.normal(size=(count, 7))
    if not finite:
        special = [-0.0, 5e-324, np.inf, -np.inf, np.nan, np.finfo(float).max]
        wrenches[3] = special
        poses[5, :6] = special
    return Values(stamps, wrenches, poses)


def split(stamp: int) -> tuple[int, int]:
    return divmod(int(stamp), 1_000_000_000)


def raw_mcap(
    path: Path,
    messages: list[tuple[str, int, bytes]],
    schemas: dict[str, tuple[str, str, str, bytes]],
    **settings: object,
) -> Path:
    """MCAP of given bytes: ``(topic, time, data)``; schemas are message encoding, encoding, type,
    definition by topic.
    """
    with path.open("wb") as file:
        writer = Writer(file, **settings)
        writer.start()
        numbers = {}
        for topic, (encoding, form, name, text) in schemas.items():
            schema = writer.register_schema(name, form, text) if form else 0
            numbers[topic] = writer.register_channel(topic, encoding, schema)
        for topic, time, data in messages:
            writer.add_message(numbers[topic], time, data, time)
        writer.finish()
    return path


def protobuf_class(syntax: str = "proto3") -> Callable[..., object]:
    kinds = ["double", "float", "int64", "uint64", "int32", "sint32", "sint64"]
    kinds += ["fixed32", "fixed64", "bool"]
    of = dict.fromkeys([f"a_{kind}" for kind in kinds], "LABEL_OPTIONAL")
    of |= {"joints": "LABEL_REPEATED", "counts": "LABEL_REPEATED", "note": "LABEL_OPTIONAL"}
    types = [f"TYPE_{kind.upper()}" for kind in (*kinds, "double", "int32", "string")]
    fields = [
        {"name": name, "number": number, "type": kind, "label": label}
        for number, ((name, label), kind) in enumerate(zip(of.items(), types, strict=True), 1)
    ]
    stamp = {"name": "stamp", "number": 23, "type": "TYPE_MESSAGE", "label": "LABEL_OPTIONAL"}
    fields.append({**stamp, "typeName": ".google.protobuf.Timestamp"})
    file = {"name": "probe.proto", "package": "robot", "syntax": syntax}
    file |= {"dependency": ["google/protobuf/timestamp.proto"]}
    file |= {"messageType": [{"name": "Probe", "field": fields}]}
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(json_format.ParseDict(file, descriptor_pb2.FileDescriptorProto()))
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("robot.Probe"))


def protobuf_mcap(path: Path, messages: list[object]) -> Path:
    with path.open("wb") as file:
        writer = ProtobufWriter(file)
        for k, message in enumerate(messages):
            writer.write_message("/probe", message, BEGIN + k, BEGIN + k)
        writer.finish()
    return path


def foxglove_mcap(path: Path, given: Values) -> Path:
    """MCAP by foxglove-sdk: poses and transforms in its own protobuf, wrenches in JSON."""
    context = foxglove.Context()
    with foxglove.open_mcap(path, context=context):
        from foxglove.channels import FrameTransformsChannel, PoseInFrameChannel

        pose = PoseInFrameChannel("/pose", context=context)
        transforms = FrameTransformsChannel("/tf", context=context)
        wrench = foxglove.Channel("/ft", message_encoding="json", context=context)
        for stamp, forces, position in zip(given.stamps, given.wrenches, given.poses, strict=True):
            time, p = fox.Timestamp(*split(stamp)), position.tolist()
            place, turn = fox.Vector3(**dict(zip("xyz", p[:3], strict=True))), p[3:]
            turn = fox.Quaternion(**dict(zip("xyzw", turn, strict=True)))
            body = fox.Pose(position=place, orientation=turn)
            moved = {"translation": place, "rotation": turn, "timestamp": time}
            moved |= {"parent_frame_id": "base", "child_frame_id": "tool"}
            tree = fox.FrameTransforms(transforms=[fox.FrameTransform(**moved)])
            at = {"log_time": int(stamp) + DELAY}
            pose.log(fox.PoseInFrame(timestamp=time, frame_id="base", pose=body), **at)
            transforms.log(tree, **at)
            wrench.log({"force": forces[:3].tolist()}, **at)
    return path


@lru_cache
def typestore(ros1: bool = False):
    """The types of ROS, with tf."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        one = (Nodetype.NAME, "geometry_msgs/msg/TransformStamped")
        fields = [("transforms", (Nodetype.SEQUENCE, (one, 0)))]
        store.register({"tf2_msgs/msg/TFMessage": ([], fields)})
    return store


class Maker:
    def __init__(self, ros1: bool = False) -> None:
        self.store = typestore(ros1)

    def make(self, kind: str, **fields: object) -> object:
        """One with these fields, which hold theirs by name or in order; zeros elsewhere."""
        kind = kind if "/msg/" in kind else kind.replace("/", "/msg/")
        parts = self.store.fielddefs[kind][1]
        values = [self._part(node, what, fields.get(name)) for name, (node, what) in parts]
        return self.store.types[kind](*values)

    def _part(self, node: Nodetype, what, given):
        if node == Nodetype.NAME:
            if not isinstance(given, dict):
                names = [name for name, _ in self.store.fielddefs[what][1]]
                given = {} if given is None else dict(zip(names, given, strict=True))
            return self.make(what, **given)
        if node == Nodetype.SEQUENCE and what[0][0] == Nodetype.NAME:
            return [self._part(*what[0], each) for each in given or ()]
        if given is None and node == Nodetype.BASE:
            return "" if what[0] == "string" else 0
        return np.zeros(what[1] if node == Nodetype.ARRAY else 0) if given is None else given

    def header(self, stamp: int, frame: str = "") -> dict:
        return {"stamp": split(stamp), "frame_id": frame}

    def wrench(self, stamp: int, numbers: np.ndarray, frame: str = "sensor") -> object:
        parts = {"force": numbers[:3], "torque": numbers[3:]}
        head = self.header(stamp, frame)
        return self.make("geometry_msgs/WrenchStamped", header=head, wrench=parts)

    def pose(self, stamp: int, numbers: np.ndarray, frame: str = "base") -> object:
        parts = {"position": numbers[:3], "orientation": numbers[3:]}
        return self.make("geometry_msgs/PoseStamped", header=self.header(stamp, frame), pose=parts)

    def transforms(self, stamp: int, numbers: np.ndarray, *pairs: tuple[str, str]) -> object:
        moved = numbers[:3], numbers[3:]
        each = [(self.header(stamp, parent), child, moved) for parent, child in pairs]
        return self.make("tf2_msgs/TFMessage", transforms=each)


Message = tuple[str, str, int, object]  # topic, type, time, message


def wrenches_and_poses(
    given: Values, ros1: bool = False, frame: str = "sensor", pose: str = "/pose"
) -> list[Message]:
    maker = Maker(ros1)
    found: list[Message] = []
    for stamp, forces, place in zip(given.stamps, given.wrenches, given.poses, strict=True):
        time, wrench = int(stamp) + DELAY, maker.wrench(stamp, forces, frame)
        found.append(("/ft", "geometry_msgs/WrenchStamped", time, wrench))
        found.append((pose, "geometry_msgs/PoseStamped", time, maker.pose(stamp, place)))
    return found


def cdr(name: str, message: object, order: str = "<") -> bytes:
    """A message as rmw writes it."""
    name = name if "/msg/" in name else name.replace("/", "/msg/")
    return bytes(typestore().serialize_cdr(message, name, little_endian=order == "<"))


def cdr_wrench(stamp: int, forces: np.ndarray, frame: str = "sensor", order: str = "<") -> bytes:
    return cdr("geometry_msgs/WrenchStamped", Maker().wrench(stamp, forces, frame), order)


def schema(name: str) -> tuple[str, str, str, bytes]:
    """Encoding of messages and of the schema, type and definition, with names as people write."""
    text = typestore().generate_msgdef(name, ros_version=2)[0]
    text = text.replace("\ngeometry_msgs/Vector3 ", "\nVector3 ")
    return "cdr", "ros2msg", name, text.encode()


WRENCH = schema("geometry_msgs/msg/WrenchStamped")
POSE = schema("geometry_msgs/msg/PoseStamped")


def wrench_mcap(path: Path, given: Values, **settings: object) -> Path:
    messages = [
        (topic, time, cdr(name, each)) for topic, name, time, each in wrenches_and_poses(given)
    ]
    return raw_mcap(path, messages, {"/ft": WRENCH, "/pose": POSE}, **settings)


def rosbag1(path: Path, messages: list[Message], compression: str | None = None) -> Path:
    writer = Rosbag1Writer(path)
    if compression is not None:
        writer.set_compression(Rosbag1Writer.CompressionFormat[compression])
    return _bag(writer, path, typestore(True), "serialize_ros1", messages)


def rosbag2(
    path: Path, messages: list[Message], storage: str = "SQLITE3", mode: str | None = None
) -> Path:
    writer = Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin[storage])
    if mode is not None:
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    return _bag(writer, path, typestore(False), "serialize_cdr", messages)


def _bag(writer, path: Path, store, serialize: str, messages: list[Message]) -> Path:
    with writer:
        connections = {}
        for topic, name, time, message in messages:
            name = name.replace("/", "/msg/")
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=store)
            writer.write(connections[topic], time, getattr(store, serialize)(message, name))
    return path


COMPRESSIONS = list(CompressionType)
