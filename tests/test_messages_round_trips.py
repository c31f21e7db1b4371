"""Recordings of messages come back as they were written, to the last bit."""

import message_files as files
import numpy as np
import pytest

from palpate import RecordingError
from palpate.recordings import open_recording

GIVEN = files.values()


def assert_same(found) -> None:
    given = GIVEN
    for name, column in given.columns().items():
        values = found.channels[name]
        assert values.dtype == np.float64
        assert values.tobytes() == np.ascontiguousarray(column).tobytes(), name
    for topic in ("/ft", "/pose"):
        stamps = found.channels[f"{topic}.header.stamp"]
        assert stamps.dtype == np.int64
        assert (stamps == given.stamps).all()
        assert (found.channels[f"{topic}.log_time"] == given.stamps + files.DELAY).all()
        assert found.clocks[f"{topic}.log_time"] == f"{topic}.header.stamp"
    assert found.units["/ft.header.stamp"] == "ns"
    assert found.units["/ft.wrench.force.x"] == "N"
    assert found.units["/pose.pose.position.z"] == "m"
    assert found.clocks["/ft.wrench.torque.z"] == "/ft.header.stamp"
    assert found.frames["/ft.wrench.force.x"] == "sensor"
    assert found.frames["/pose.pose.orientation.w"] == "base"
    assert found.types == {
        "/ft": "geometry_msgs/msg/WrenchStamped",
        "/pose": "geometry_msgs/msg/PoseStamped",
    }
    assert not found.losses
    assert not found.faults


CHUNKS = [{"chunk_size": 1000}, {"chunk_size": 1 << 20}, {"use_chunking": False}]


@pytest.mark.parametrize("compression", files.COMPRESSIONS, ids=lambda each: each.name)
@pytest.mark.parametrize("chunks", CHUNKS, ids=["small", "large", "none"])
def test_mcap_of_ros2_comes_back_to_the_last_bit(tmp_path, compression, chunks) -> None:
    path = files.wrench_mcap(tmp_path / "a.mcap", GIVEN, compression=compression, **chunks)
    assert_same(open_recording(path))


@pytest.mark.parametrize("sizes", [(40, 30), (36, 40)])
@pytest.mark.parametrize("chunk", [1000, 1025, 1050, 1075])
def test_mcap_of_two_topics_in_turn_comes_back_whatever_a_chunk_holds(
    tmp_path, chunk, sizes
) -> None:
    """A chunk may end with the records by which a pattern of sizes is known."""
    schemas = dict.fromkeys(("/0", "/1"), ("json", "jsonschema", "Any", b"{}"))
    messages = [
        (f"/{k % 2}", files.BEGIN + k, f'{{"z": {k}}}'.ljust(sizes[k % 2]).encode())
        for k in range(400)
    ]
    path = files.raw_mcap(tmp_path / "a.mcap", messages, schemas, chunk_size=chunk)
    found = open_recording(path)
    for k in range(2):
        assert found.channels[f"/{k}.z"].tolist() == list(range(k, 400, 2))
    assert not found.losses


def test_an_error_of_the_reader_itself_is_not_called_one_of_the_path(tmp_path, monkeypatch) -> None:
    path = files.wrench_mcap(tmp_path / "a.mcap", GIVEN)

    def fail(*_: object) -> None:
        raise ValueError("a defect")

    monkeypatch.setattr("palpate.recordings.messages.containers._whole_records", fail)
    with pytest.raises(ValueError, match=r"^a defect$"):
        open_recording(path)
    with pytest.raises(RecordingError, match="cannot be read; check the path"):
        open_recording(f"{path}\0.mcap")


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_a_bag_of_ros1_comes_back_to_the_last_bit(tmp_path, compression) -> None:
    messages = files.wrenches_and_poses(GIVEN, ros1=True)
    assert_same(open_recording(files.rosbag1(tmp_path / "a.bag", messages, compression)))


MODES = [("SQLITE3", mode) for mode in (None, "FILE", "MESSAGE")]
MODES += [("MCAP", mode) for mode in (None, "FILE", "MESSAGE", "STORAGE")]


@pytest.mark.parametrize("storage, mode", MODES)
def test_a_bag_of_ros2_comes_back_to_the_last_bit(tmp_path, storage, mode) -> None:
    messages = files.wrenches_and_poses(GIVEN)
    folder = files.rosbag2(tmp_path / "bag", messages, storage, mode)
    assert_same(open_recording(folder))
    assert_same(open_recording(folder / "metadata.yaml"))
    (file,) = (each for each in folder.iterdir() if each.suffix != ".yaml")
    assert_same(open_recording(file))


def test_a_bag_of_ros2_in_several_files_is_one_recording(tmp_path) -> None:
    messages = files.wrenches_and_poses(GIVEN)
    half = len(messages) // 2
    first = files.rosbag2(tmp_path / "bag", messages[:half])
    second = files.rosbag2(tmp_path / "rest", messages[half:])
    (second / "rest.db3").rename(first / "bag_1.db3")
    metadata = first / "metadata.yaml"
    text, line = metadata.read_text(), "  - bag.db3\n"
    metadata.write_text(text.replace(line, line + "  - bag_1.db3\n"))
    assert_same(open_recording(first))
    # Without metadata, in the order of their numbers: 10 after 9.
    for k in range(11, -1, -1):
        part = files.rosbag2(tmp_path / f"bag_{k}", messages[k * 34 : k * 34 + 34], "MCAP", "FILE")
        (part / f"bag_{k}.mcap.zstd").rename(tmp_path / f"bag_{k}.mcap.zstd")
    stamps = open_recording(tmp_path).channels["/ft.header.stamp"]
    assert (stamps == GIVEN.stamps).all()


def test_json_comes_back_as_it_was_written(tmp_path) -> None:
    given = files.values(finite=True)
    objects = [
        {
            "timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9},
            "frame_id": "base",
            "force": dict(zip("xyz", row[:3], strict=True)),
            "list": row[3:],
            "count": k,
            "large": 2**62 + k,
            "on": k % 2 == 0,
            "words": "none",
        }
        for k, (stamp, row) in enumerate(
            zip(given.stamps.tolist(), given.wrenches.tolist(), strict=True)
        )
    ]
    found = open_recording(files.json_mcap(tmp_path / "a.mcap", objects))
    assert (found.channels["/json.timestamp"] == given.stamps).all()
    assert found.channels["/json.force.y"].tobytes() == given.wrenches[:, 1].tobytes()
    assert found.channels["/json.list[2]"].tobytes() == given.wrenches[:, 5].tobytes()
    assert found.channels["/json.large"].tolist() == [2**62 + k for k in range(len(given))]
    assert found.channels["/json.on"].dtype == bool
    assert found.clocks["/json.count"] == "/json.timestamp"
    assert found.frames["/json.count"] == "base"
    assert not found.losses


@pytest.mark.parametrize("syntax", ["proto2", "proto3"])
def test_every_kind_of_number_of_protobuf_comes_back(tmp_path, syntax) -> None:
    make = files.protobuf_class(syntax)
    random = np.random.default_rng(4)
    whole = {
        "int64": 2**63, "uint64": 2**64, "int32": 2**31, "sint32": 2**31, "sint64": 2**63,
        "fixed32": 2**32, "fixed64": 2**64,
    }  # fmt: skip
    messages, rows = [], []
    for k in range(60):
        row: dict[str, object] = {"a_double": random.normal(), "a_bool": bool(k % 2)}
        row["a_float"] = float(np.float32(random.normal()))
        for kind, limit in whole.items():
            most = int(limit) >> int(random.integers(0, 60 if limit > 2**33 else 30))
            sign = -1 if k % 2 and "u" not in kind and "fixed" not in kind else 1
            row[f"a_{kind}"] = sign * max(most - 1, 0)
        if k == 7:  # what has its default is left out of the message
            row = {name: type(value)(0) for name, value in row.items()}
        message = make(**row, joints=random.normal(size=3), counts=[1, -k], note="n" * (k % 3))
        message.stamp.FromNanoseconds(files.BEGIN + k * files.STEP)
        messages.append(message)
        rows.append({**row, "joints[1]": message.joints[1], "counts[1]": -k})
    found = open_recording(files.protobuf_mcap(tmp_path / "a.mcap", messages))
    for name in rows[0]:
        assert found.channels[f"/probe.{name}"].tolist() == [row[name] for row in rows], name
    assert found.channels["/probe.a_float"].dtype == np.float32
    assert found.channels["/probe.a_uint64"].dtype == np.uint64
    assert found.channels["/probe.stamp"].tolist() == [
        files.BEGIN + k * files.STEP for k in range(60)
    ]
    assert found.clocks["/probe.a_double"] == "/probe.stamp"


def test_what_foxglove_writes_comes_back_to_the_last_bit(tmp_path) -> None:
    given = files.values(finite=True)
    found = open_recording(files.foxglove_mcap(tmp_path / "a.mcap", given))
    for k, name in enumerate(files.POSE_FIELDS):
        assert found.channels[f"/pose.{name}"].tobytes() == given.poses[:, k].tobytes()
    for k, axis in enumerate("xyz"):
        moved = found.channels[f"/tf[base>tool].translation.{axis}"]
        assert moved.tobytes() == given.poses[:, k].tobytes()
        assert found.channels[f"/ft.force[{k}]"].tobytes() == given.wrenches[:, k].tobytes()
    assert (found.channels["/pose.timestamp"] == given.stamps).all()
    assert (found.channels["/ft.log_time"] == given.stamps + files.DELAY).all()
    assert found.frames["/pose.pose.position.x"] == "base"
    assert found.units["/pose.pose.position.x"] == "m"
    assert found.types["/pose"] == "foxglove.PoseInFrame"
    assert not found.losses
