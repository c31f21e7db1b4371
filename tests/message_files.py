"""Recordings of messages, written by the packages that people record with."""

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import foxglove
import numpy as np
from foxglove import messages as fox
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
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
RULE = "=" * 80
_HEADER = f"""{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
WRENCH = f"""std_msgs/Header header
geometry_msgs/Wrench wrench
{_HEADER}{RULE}
MSG: geometry_msgs/Wrench
Vector3 force
Vector3 torque
{RULE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
POSE = f"""std_msgs/Header header
geometry_msgs/Pose pose
{_HEADER}{RULE}
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
{RULE}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{RULE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""


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


def cdr_wrench(stamp: int, forces: np.ndarray, frame: str = "sensor", order: str = "<") -> bytes:
    """A WrenchStamped in CDR, as rmw writes it."""
    seconds, rest = split(stamp)
    text = frame.encode() + b"\0"
    head = struct.pack(order + "iII", seconds, rest, len(text)) + text
    head += bytes(-len(head) % 8)
    kind = b"\0\1\0\0" if order == "<" else b"\0\0\0\0"
    return kind + head + forces.astype(order + "f8").tobytes()


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


def wrench_mcap(path: Path, given: Values, **settings: object) -> Path:
    """MCAP of wrenches and poses, written fast."""
    schemas = {
        "/ft": ("cdr", "ros2msg", "geometry_msgs/msg/WrenchStamped", WRENCH.encode()),
        "/pose": ("cdr", "ros2msg", "geometry_msgs/msg/PoseStamped", POSE.encode()),
    }
    messages = []
    for stamp, forces, pose in zip(given.stamps, given.wrenches, given.poses, strict=True):
        time = int(stamp) + DELAY
        messages.append(("/ft", time, cdr_wrench(stamp, forces)))
        messages.append(("/pose", time, cdr_wrench(stamp, pose, "base")))
    return raw_mcap(path, messages, schemas, **settings)


def json_mcap(path: Path, objects: list[object], topic: str = "/json") -> Path:
    """MCAP of JSON."""
    texts = [(topic, BEGIN + k, json.dumps(each).encode()) for k, each in enumerate(objects)]
    return raw_mcap(path, texts, {topic: ("json", "jsonschema", "Any", b"{}")})


def protobuf_class(syntax: str = "proto3") -> Callable[..., object]:
    """A message of every kind of number."""
    file = descriptor_pb2.FileDescriptorProto(
        name=f"probe_{syntax}.proto",
        package="robot",
        syntax=syntax,
        dependency=["google/protobuf/timestamp.proto"],
    )
    message = file.message_type.add(name="Probe")
    kinds = ["double", "float", "int64", "uint64", "int32", "sint32", "sint64"]
    kinds += ["fixed32", "fixed64", "bool"]
    field = descriptor_pb2.FieldDescriptorProto
    for number, kind in enumerate(kinds, start=1):
        kind_number = getattr(field, f"TYPE_{kind.upper()}")
        message.field.add(name=f"a_{kind}", number=number, type=kind_number, label=1)
    message.field.add(name="joints", number=20, type=field.TYPE_DOUBLE, label=3)
    message.field.add(name="counts", number=21, type=field.TYPE_INT32, label=3)
    message.field.add(name="note", number=22, type=field.TYPE_STRING, label=1)
    message.field.add(
        name="stamp",
        number=23,
        type=field.TYPE_MESSAGE,
        type_name=".google.protobuf.Timestamp",
        label=1,
    )
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("robot.Probe"))


def protobuf_mcap(path: Path, messages: list[object]) -> Path:
    """MCAP by the ``mcap`` package and its support of protobuf."""
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
            time = fox.Timestamp(*split(stamp))
            p = position.tolist()
            place = dict(zip("xyz", p[:3], strict=True))
            turn = fox.Quaternion(**dict(zip("xyzw", p[3:], strict=True)))
            body = fox.Pose(position=fox.Vector3(**place), orientation=turn)
            message = fox.PoseInFrame(timestamp=time, frame_id="base", pose=body)
            pose.log(message, log_time=int(stamp) + DELAY)
            moved = fox.FrameTransform(
                timestamp=time,
                parent_frame_id="base",
                child_frame_id="tool",
                translation=fox.Vector3(**place),
                rotation=turn,
            )
            transforms.log(fox.FrameTransforms(transforms=[moved]), log_time=int(stamp) + DELAY)
            wrench.log({"force": forces[:3].tolist()}, log_time=int(stamp) + DELAY)
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
    """Messages of ROS."""

    def __init__(self, ros1: bool = False) -> None:
        self.store = typestore(ros1)
        self.ros1 = ros1

    def make(self, name: str, *parts: object) -> object:
        return self.store.types[name.replace("/", "/msg/")](*parts)

    def header(self, stamp: int, frame: str) -> object:
        time = self.make("builtin_interfaces/Time", *split(stamp))
        return self.make("std_msgs/Header", *([7] if self.ros1 else []), time, frame)

    def wrench(self, stamp: int, numbers: np.ndarray, frame: str = "sensor") -> object:
        force = self.make("geometry_msgs/Vector3", *numbers[:3])
        torque = self.make("geometry_msgs/Vector3", *numbers[3:])
        wrench = self.make("geometry_msgs/Wrench", force, torque)
        return self.make("geometry_msgs/WrenchStamped", self.header(stamp, frame), wrench)

    def pose(self, stamp: int, numbers: np.ndarray, frame: str = "base") -> object:
        place = self.make("geometry_msgs/Point", *numbers[:3])
        turn = self.make("geometry_msgs/Quaternion", *numbers[3:])
        pose = self.make("geometry_msgs/Pose", place, turn)
        return self.make("geometry_msgs/PoseStamped", self.header(stamp, frame), pose)

    def transforms(self, stamp: int, numbers: np.ndarray, *pairs: tuple[str, str]) -> object:
        made = []
        for parent, child in pairs:
            place = self.make("geometry_msgs/Vector3", *numbers[:3])
            turn = self.make("geometry_msgs/Quaternion", *numbers[3:])
            moved = self.make("geometry_msgs/Transform", place, turn)
            head = self.header(stamp, parent)
            made.append(self.make("geometry_msgs/TransformStamped", head, child, moved))
        return self.make("tf2_msgs/TFMessage", made)

    def joints(self, stamp: int, names: list[str], positions: np.ndarray) -> object:
        none = np.empty(0)
        return self.make(
            "sensor_msgs/JointState", self.header(stamp, ""), names, positions, none, none
        )


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


def rosbag1(path: Path, messages: list[Message], compression: str | None = None) -> Path:
    """A bag of ROS 1 by rosbags."""
    writer = Rosbag1Writer(path)
    if compression is not None:
        writer.set_compression(Rosbag1Writer.CompressionFormat[compression])
    return _bag(writer, path, typestore(True), "serialize_ros1", messages)


def rosbag2(
    path: Path, messages: list[Message], storage: str = "SQLITE3", mode: str | None = None
) -> Path:
    """A bag of ROS 2 by rosbags."""
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
