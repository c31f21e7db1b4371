"""Bags and MCAP files of the recording that the other hostile files hold, by rosbags."""

import shutil
from pathlib import Path

import numpy as np
from containers import COLUMNS
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

BEGIN = 1_763_800_000_000_000_000  # ns since 1970


def as_mcap(path: Path, columns=COLUMNS) -> None:
    _as_rosbag2(path, columns, StoragePlugin.MCAP, "*.mcap")


def as_sqlite(path: Path, columns=COLUMNS) -> None:
    _as_rosbag2(path, columns, StoragePlugin.SQLITE3, "*.db3")


def as_rosbag1(path: Path, columns=COLUMNS) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Rosbag1Writer(path) as writer:
        _write(writer, store, store.serialize_ros1, columns, seq=0)


def _as_rosbag2(path: Path, columns, plugin, pattern: str) -> None:
    """ROS 2 writes a folder; the file in it is all that counts here."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    folder = path.with_name(f"{path.name}.folder")
    with Rosbag2Writer(folder, version=9, storage_plugin=plugin) as writer:
        _write(writer, store, store.serialize_cdr, columns)
    [made] = folder.glob(pattern)
    made.replace(path)
    shutil.rmtree(folder)


def _write(writer, store, serialize, columns, **header) -> None:
    """A wrench and a point for each sample, on two topics."""
    types = store.types
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    wrench, stamped = types["geometry_msgs/msg/Wrench"], types["geometry_msgs/msg/WrenchStamped"]
    placed = types["geometry_msgs/msg/PointStamped"]
    topics = {
        "/ft": (stamped, lambda _, force: wrench(vector(0.0, 0.0, force), vector(0.0, 0.0, 0.0))),
        "/tip": (placed, lambda depth, _: point(0.0, 0.0, -depth)),
    }
    made = {
        topic: writer.add_connection(topic, kind.__msgtype__, typestore=store)
        for topic, (kind, _) in topics.items()
    }
    samples = zip(columns["time_s"], columns["penetration_m"], columns["force_N"], strict=True)
    for time, depth, force in samples:
        stamp = BEGIN + int(np.rint(1e9 * time))
        clock = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
        head = types["std_msgs/msg/Header"](stamp=clock, frame_id="tool", **header)
        for topic, (kind, body) in topics.items():
            content = serialize(kind(head, body(float(depth), float(force))), kind.__msgtype__)
            writer.write(made[topic], stamp, content)
