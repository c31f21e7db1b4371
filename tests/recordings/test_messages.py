"""Recordings of messages: to the last bit, topic by topic; what was cut off or damaged is said."""

import json
import shutil
import sqlite3
import struct

import message_files as files
import numpy as np
import pytest

from palpate import RecordingError
from palpate.input.recordings import open_recording
from palpate.input.recordings.messages import containers

GIVEN = files.values()


def assert_same(found) -> None:
    for name, column in GIVEN.columns().items():
        values = found.channels[name]
        assert values.dtype == np.float64
        assert values.tobytes() == np.ascontiguousarray(column).tobytes(), name
    for topic in ("/ft", "/pose"):
        stamps = found.channels[f"{topic}.header.stamp"]
        assert stamps.dtype == np.int64
        assert (stamps == GIVEN.stamps).all()
        assert (found.channels[f"{topic}.log_time"] == GIVEN.stamps + files.DELAY).all()
        assert found.clocks[f"{topic}.log_time"] == f"{topic}.header.stamp"
    assert found.units["/ft.header.stamp"] == "ns"
    assert found.units["/ft.wrench.force.x"] == "N"
    assert found.units["/pose.pose.position.z"] == "m"
    assert found.clocks["/ft.wrench.torque.z"] == "/ft.header.stamp"
    assert found.frames["/ft.wrench.force.x"] == "sensor"
    assert found.frames["/pose.pose.orientation.w"] == "base"
    assert found.types == {"/ft": files.WRENCH[2], "/pose": files.POSE[2]}
    assert not found.losses
    assert not found.faults


CHUNKS = [{"chunk_size": 1000}, {"chunk_size": 1 << 20}, {"use_chunking": False}]


@pytest.mark.parametrize("compression", files.COMPRESSIONS, ids=lambda each: each.name)
@pytest.mark.parametrize("chunks", CHUNKS, ids=["small", "large", "none"])
def test_mcap_of_ros2_comes_back_to_the_last_bit(tmp_path, compression, chunks) -> None:
    path = files.wrench_mcap(tmp_path / "a.mcap", GIVEN, compression=compression, **chunks)
    assert_same(open_recording(path))


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_a_bag_of_ros1_comes_back_to_the_last_bit(tmp_path, compression) -> None:
    messages = files.wrenches_and_poses(GIVEN, ros1=True)
    assert_same(open_recording(files.rosbag1(tmp_path / "a.bag", messages, compression)))


MODES = [("SQLITE3", mode) for mode in (None, "FILE", "MESSAGE")]
MODES += [("MCAP", mode) for mode in (None, "FILE", "MESSAGE", "STORAGE")]


@pytest.mark.parametrize("storage, mode", MODES)
def test_a_bag_of_ros2_comes_back_to_the_last_bit(tmp_path, storage, mode) -> None:
    folder = files.rosbag2(tmp_path / "bag", files.wrenches_and_poses(GIVEN), storage, mode)
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
    assert (open_recording(tmp_path).channels["/ft.header.stamp"] == GIVEN.stamps).all()


def test_json_comes_back_as_it_was_written(tmp_path) -> None:
    given = files.values(finite=True)
    rows = zip(given.stamps.tolist(), given.wrenches.tolist(), strict=True)
    objects = [
        {
            "timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9},
            "frame_id": "base",
            "force": dict(zip("xyz", row[:3], strict=True)),
            "list": row[3:],
            "large": 2**62 + k,
            "on": k % 2 == 0,
            "words": "none",
        }
        for k, (stamp, row) in enumerate(rows)
    ]
    texts = [("/json", k, json.dumps(each).encode()) for k, each in enumerate(objects)]
    schemas = {"/json": ("json", "jsonschema", "Any", b"{}")}
    found = open_recording(files.raw_mcap(tmp_path / "a.mcap", texts, schemas))
    assert (found.channels["/json.timestamp"] == given.stamps).all()
    assert found.channels["/json.force.y"].tobytes() == given.wrenches[:, 1].tobytes()
    assert found.channels["/json.list[2]"].tobytes() == given.wrenches[:, 5].tobytes()
    assert found.channels["/json.large"].tolist() == [2**62 + k for k in range(len(given))]
    assert found.channels["/json.on"].dtype == bool
    assert found.clocks["/json.large"] == "/json.timestamp"
    assert found.frames["/json.large"] == "base"
    assert not found.losses


@pytest.mark.parametrize("syntax", ["proto2", "proto3"])
def test_every_kind_of_number_of_protobuf_comes_back(tmp_path, syntax) -> None:
    make = files.protobuf_class(syntax)
    random = np.random.default_rng(4)
    bits = {"int64": 63, "uint64": 64, "int32": 31, "sint32": 31, "sint64": 63, "fixed32": 32}
    messages, rows = [], []
    for k in range(60):
        row = {"a_double": random.normal(), "a_bool": bool(k % 2)}
        row["a_float"] = float(np.float32(random.normal()))
        for kind, most in {**bits, "fixed64": 64}.items():
            sign = -1 if k % 2 and most % 2 else 1
            row[f"a_{kind}"] = sign * (2 ** int(random.integers(1, most + 1)) - 1)
        if k == 7:  # what has its default is left out of the message
            row = {name: type(value)(0) for name, value in row.items()}
        message = make(**row, joints=random.normal(size=3), counts=[1, -k], note="n" * (k % 3))
        message.stamp.FromNanoseconds(files.BEGIN + k)
        messages.append(message)
        stamp = files.BEGIN + k
        rows.append({**row, "joints[1]": message.joints[1], "counts[1]": -k, "stamp": stamp})
    found = open_recording(files.protobuf_mcap(tmp_path / "a.mcap", messages))
    for name in rows[0]:
        assert found.channels[f"/probe.{name}"].tolist() == [row[name] for row in rows], name
    assert found.channels["/probe.a_float"].dtype == np.float32
    assert found.channels["/probe.a_uint64"].dtype == np.uint64
    assert found.clocks["/probe.a_double"] == "/probe.stamp"


def test_files_of_foxglove_are_read_exactly(tmp_path) -> None:
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


# Topics as robots have them.
FEW = files.values(60)
MAKER = files.Maker()


def bag(tmp_path, topic: str, kind: str, *messages, others=()):
    """Messages of one type, stamped as the values are, and others."""
    given = [(topic, kind, int(t), each) for t, each in zip(FEW.stamps, messages, strict=False)]
    return open_recording(files.rosbag2(tmp_path / "bag", [*others, *given]))


def wrenches(tmp_path, make):
    """What ``make`` makes in CDR of each sample's number, stamp and wrench."""
    rows = enumerate(zip(FEW.stamps, FEW.wrenches, strict=True))
    messages = [("/ft", int(stamp), make(k, stamp, row)) for k, (stamp, row) in rows]
    return open_recording(files.raw_mcap(tmp_path / "a.mcap", messages, {"/ft": files.WRENCH}))


def cdr(tmp_path, definition: str, bodies: list[bytes], form: str = "ros2msg"):
    schema = ("cdr", form, "own_msgs/msg/Own", definition.encode())
    messages = [("/own", files.BEGIN + k, b"\0\1\0\0" + body) for k, body in enumerate(bodies)]
    return open_recording(files.raw_mcap(tmp_path / "own.mcap", messages, {"/own": schema}))


def test_each_transform_has_its_own_channels_and_clock(tmp_path) -> None:
    pairs = [("base", "tool"), ("base", "camera")]
    messages = [
        MAKER.transforms(stamp, row, *pairs[: 1 + (k % 3 == 0)])
        for k, (stamp, row) in enumerate(zip(FEW.stamps, FEW.poses, strict=True))
    ]
    found = bag(tmp_path, "/tf", "tf2_msgs/TFMessage", *messages)
    for child, which in (("tool", slice(None)), ("camera", slice(None, None, 3))):
        above = f"/tf[base>{child}]"
        moved = found.channels[f"{above}.transform.translation.y"]
        assert moved.tobytes() == np.ascontiguousarray(FEW.poses[which, 1]).tobytes()
        assert (found.channels[f"{above}.header.stamp"] == FEW.stamps[which]).all()
        assert found.clocks[f"{above}.transform.rotation.w"] == f"{above}.header.stamp"
        assert found.frames[f"{above}.transform.rotation.w"] == "base"
        assert found.units[f"{above}.transform.translation.x"] == "m"
    assert not found.faults
    # Of one that a message holds twice there are two rows.
    message = MAKER.transforms(FEW.stamps[0], FEW.poses[0], *[("base", "tool")] * 2)
    path = files.rosbag2(tmp_path / "twice", [("/tf", "tf2_msgs/TFMessage", 5, message)] * 3)
    assert open_recording(path).channels["/tf[base>tool].log_time"].tolist() == [5] * 6


def test_joints_are_named_and_stay_themselves_when_their_order_changes(tmp_path) -> None:
    messages = []
    for k, stamp in enumerate(FEW.stamps):
        joints = {"shoulder": k + 1.0, "elbow": k + 2.0}
        if k >= 10:  # some messages lack it
            joints["wrist"] = 2.0
        names = list(joints)[:: 1 if k % 2 else -1]
        angles = np.array([joints[name] for name in names])
        given = {"header": MAKER.header(stamp), "name": names, "position": angles}
        messages.append(MAKER.make("sensor_msgs/JointState", **given))
    found = bag(tmp_path, "/joints", "sensor_msgs/JointState", *messages)
    assert (found.channels["/joints.position[shoulder]"] == 1.0 + np.arange(60)).all()
    assert (found.channels["/joints.position[elbow]"] == 2.0 + np.arange(60)).all()
    wrist = found.channels["/joints.position[wrist]"]
    assert np.isnan(wrist[:10]).all()
    assert (wrist[10:] == 2.0).all()
    [(name, faults)] = found.faults.items()
    assert (name, faults.count, faults.sample) == ("/joints.position[wrist]", 10, 0)


def test_velocities_of_an_odometry_are_in_the_frame_that_moves(tmp_path) -> None:
    message = MAKER.make(
        "nav_msgs/Odometry",
        header=MAKER.header(FEW.stamps[0], "odom"),
        child_frame_id="base",
        pose={"pose": {"position": (1.0, 2.0, 3.0)}},
        twist={"twist": {"linear": (4.0, 5.0, 6.0)}},
    )
    found = bag(tmp_path, "/odom", "nav_msgs/Odometry", message)
    assert found.frames["/odom.pose.pose.position.x"] == "odom"
    assert found.frames["/odom.twist.twist.linear.x"] == "base"
    assert found.units["/odom.twist.twist.linear.x"] == "m/s"
    assert found.notes["/odom.child_frame_id"] == "base"
    assert found.channels["/odom.pose.covariance[35]"].tolist() == [0.0]


@pytest.mark.parametrize("other", ["tools", "another frame of another length"])
def test_a_frame_that_changes_is_said_and_none_is_given(tmp_path, other) -> None:
    found = wrenches(
        tmp_path, lambda k, stamp, row: files.cdr_wrench(stamp, row, "sensor" if k < 30 else other)
    )
    assert not found.frames
    assert any("frame changes" in each and other in each for each in found.omissions)
    assert found.channels["/ft.wrench.force.x"].tobytes() == FEW.wrenches[:, 0].tobytes()


def test_messages_of_both_orders_of_bytes_may_be_mixed(tmp_path) -> None:
    found = wrenches(
        tmp_path, lambda k, stamp, row: files.cdr_wrench(stamp, row, order="<>"[k % 2])
    )
    assert found.channels["/ft.wrench.torque.y"].tobytes() == FEW.wrenches[:, 4].tobytes()
    assert (found.channels["/ft.header.stamp"] == FEW.stamps).all()
    # Stamps that are all zero are no clock.
    found = wrenches(tmp_path, lambda _, stamp, row: files.cdr_wrench(0, row))
    assert found.clocks["/ft.wrench.force.x"] == "/ft.log_time"
    assert not found.channels["/ft.header.stamp"].any()


def test_numbers_keep_their_type_and_their_alignment(tmp_path) -> None:
    definition = "uint8 a\nint64 b\nbool c\nfloat32[3] d\nstring e\nuint16[] f\nint8 g\nfloat64 h"
    bodies = []
    for k in range(20):
        body = struct.pack("<B7xqB3x3f", k, -(2**62) + k, k % 2, k, 0.1, -k)
        text = b"n" * (k % 4) + b"\0"
        body += struct.pack("<I", len(text)) + text
        body += bytes(-len(body) % 4) + struct.pack("<I3Hb", 3, k, 1, 2, -k)
        body += bytes(-len(body) % 8) + struct.pack("<d", k / 3)
        bodies.append(body)
    found = cdr(tmp_path, definition, bodies)
    n = np.arange(20)
    assert found.channels["/own.a"].dtype == np.uint8
    assert (found.channels["/own.b"] == -(2**62) + n).all()
    assert found.channels["/own.c"].dtype == bool
    assert found.channels["/own.d[1]"].dtype == np.float32
    assert (found.channels["/own.d[2]"] == -n).all()
    assert (found.channels["/own.f[0]"] == n).all()
    assert (found.channels["/own.g"] == -n).all()
    assert (found.channels["/own.h"] == n / 3).all()


def test_definitions_in_idl_are_read(tmp_path) -> None:
    text = f"""{"=" * 80}
IDL: own_msgs/msg/Own
module own_msgs {{ module msg {{ struct Own {{ double force; sequence<float> list; }}; }}; }};
"""
    found = cdr(tmp_path, text, [struct.pack("<dI2f", 1.5, 2, 0.5, 0.25)] * 3, "ros2idl")
    assert found.channels["/own.force"].tolist() == [1.5] * 3
    assert found.channels["/own.list[1]"].tolist() == [0.25] * 3


def test_images_and_scans_are_left_out_and_said(tmp_path) -> None:
    image = MAKER.make("sensor_msgs/Image", data=np.zeros(10_000, np.uint8))
    words = ("/words", "std_msgs/String", files.BEGIN, MAKER.make("std_msgs/String", data="a"))
    messages = [*files.wrenches_and_poses(FEW), words]
    found = bag(tmp_path, "/image", "sensor_msgs/Image", image, others=messages)
    assert not any(name.startswith(("/image", "/words")) for name in found.channels)
    assert any(each.startswith("/image (sensor_msgs/msg/Image, 1 ") for each in found.omissions)
    assert any("/words" in each and "no numbers" in each for each in found.omissions)
    assert not found.losses


def test_a_long_list_beside_numeric_channels_is_skipped(tmp_path) -> None:
    body = struct.pack("<60dI65B", *range(60), 65, *range(65))
    found = cdr(tmp_path, "float64[60] short\nuint8[] long", [body] * 3)
    assert found.channels["/own.short[59]"].tolist() == [59.0] * 3
    assert any("palpate skips long lists: long" in each for each in found.omissions)


def test_only_what_is_asked_for_is_read(tmp_path) -> None:
    path = files.wrench_mcap(tmp_path / "a.mcap", FEW)
    found = open_recording(path, ["/ft.wrench.force"])
    own = {"/ft.header.stamp", "/ft.log_time", *(f"/ft.wrench.force.{axis}" for axis in "xyz")}
    assert set(found.channels) == own
    assert found.omissions == ("not requested: /pose",)
    with pytest.raises(RecordingError, match=r"'/other'.*available topics: /ft, /pose"):
        open_recording(path, ["/ft", "/other"])


def test_channels_of_one_topic_and_type_are_one_topic(tmp_path) -> None:
    wrench = files.cdr_wrench(1, FEW.wrenches[0])
    with (tmp_path / "b.mcap").open("wb") as file:
        writer = files.Writer(file)
        writer.start()
        schema = writer.register_schema(*files.WRENCH[2:0:-1], files.WRENCH[3])
        other = writer.register_schema("Other", "jsonschema", b"{}")
        for encoding, kind, data in (
            ("cdr", schema, wrench), ("cdr", schema, wrench), ("json", other, b'{"a": 1}'),
        ):  # fmt: skip
            channel = writer.register_channel("/ft", encoding, kind, {"n": str(id(data))})
            writer.add_message(channel, files.BEGIN, data, files.BEGIN)
        writer.finish()
    found = open_recording(tmp_path / "b.mcap")
    assert len(found.channels["/ft.wrench.force.x"]) == 2
    assert found.channels["/ft (Other).a"].tolist() == [1]


@pytest.mark.parametrize("encoding", ["flatbuffer", "cbor", ""])
def test_encodings_that_are_not_read_are_said(tmp_path, encoding) -> None:
    schemas = {"/x": (encoding, "x", "X", b""), "/ft": files.WRENCH}
    messages = [("/x", 1, b"a"), ("/ft", 2, files.cdr_wrench(1, FEW.wrenches[0]))]
    found = open_recording(files.raw_mcap(tmp_path / "a.mcap", messages, schemas))
    assert any(
        each.startswith("/x ") and "palpate reads messages in" in each for each in found.omissions
    )


def test_the_progress_goes_from_nothing_to_all(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(containers, "_WINDOW", 2000)
    path = files.wrench_mcap(tmp_path / "a.mcap", FEW, chunk_size=1000)
    seen: list[float] = []
    open_recording(path, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert len(seen) > 5


@pytest.mark.long
@pytest.mark.parametrize("sizes", [(40, 30), (36, 40)])
@pytest.mark.parametrize("chunk", [1000, 1025, 1050, 1075, None])
def test_as_many_messages_are_found_however_they_interleave(tmp_path, chunk, sizes) -> None:
    """In turn, of sizes by whose pattern a chunk may end, then by chance and in a row."""
    random = np.random.default_rng(5)
    n = np.arange(2000)
    kinds = np.where(n < 400, n % 2, random.random(2000) < 0.3)
    kinds[(n > 1000) & (n < 1500)] = 1
    schemas = dict.fromkeys(("/0", "/1"), ("json", "jsonschema", "Any", b"{}"))
    messages = [
        (f"/{kind}", k, (b'{"z": %d}' % k).ljust(sizes[kind])) for k, kind in enumerate(kinds)
    ]
    ft = [("/ft", k, files.cdr_wrench(k, np.full(6, float(k)))) for k in range(2000, 2400)]
    kind = {"use_chunking": False} if chunk is None else {"chunk_size": chunk}
    path = tmp_path / "a.mcap"
    files.raw_mcap(path, messages + ft, {**schemas, "/ft": files.WRENCH}, **kind)
    found = open_recording(path)
    for k in range(2):
        for name in ("z", "log_time"):
            assert found.channels[f"/{k}.{name}"].tolist() == np.flatnonzero(kinds == k).tolist()
    assert found.channels["/ft.wrench.torque.z"].tolist() == list(range(2000, 2400))
    assert not found.losses


WHOLE = files.values(300, seed=2)
FIRST = "/ft.wrench.force.x"


def assert_begins_as_recorded(found, *, whole=False) -> int:
    """What there is of each topic is what was recorded first, to the last bit."""
    for name, column in WHOLE.columns().items():
        values = found.channels.get(name, column[:0])
        assert values.tobytes() == np.ascontiguousarray(column[: len(values)]).tobytes()
    count = len(found.channels[FIRST])
    assert (count == len(WHOLE)) == whole
    return count


@pytest.mark.parametrize("compression", files.COMPRESSIONS, ids=lambda each: each.name)
@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.77])
def test_an_mcap_that_is_cut_off_is_read_to_where_it_is(tmp_path, compression, fraction) -> None:
    kind = {"compression": compression, "use_chunking": fraction != 0.5, "chunk_size": 8000}
    path = files.wrench_mcap(tmp_path / "a.mcap", WHOLE, **kind)
    data = path.read_bytes()
    path.write_bytes(data[: int(fraction * len(data))])
    found = open_recording(path)
    count = assert_begins_as_recorded(found)
    # The summary, and the index of each chunk, are a quarter of so short a file at the most; the
    # chunk that the cut goes through has some 30 messages of each topic.
    assert count > 0.7 * fraction * len(WHOLE) - 30
    assert any("recorder was probably killed" in each for each in found.losses)
    with pytest.raises(RecordingError, match=r"a\.mcap"):
        open_recording(path, strict=True)


@pytest.mark.parametrize("compression", files.COMPRESSIONS, ids=lambda each: each.name)
def test_a_chunk_with_a_wrong_checksum_is_left_out_and_said(tmp_path, compression) -> None:
    kind = {"compression": compression, "chunk_size": 8000}
    path = files.wrench_mcap(tmp_path / "a.mcap", WHOLE, **kind)
    data = bytearray(path.read_bytes())
    plain = compression.name == "NONE"
    data[data.index(WHOLE.wrenches[100].tobytes()) if plain else len(data) // 3] ^= 0x10
    path.write_bytes(data)
    found = open_recording(path)
    there = np.isin(WHOLE.stamps, found.channels["/ft.header.stamp"])
    assert 0.5 < there.mean() < 1.0
    assert found.channels[FIRST].tobytes() == WHOLE.wrenches[there, 0].tobytes()
    assert any("cannot be read" in each for each in found.losses)
    assert any("lists 600 messages" in each for each in found.losses)
    with pytest.raises(RecordingError):
        open_recording(path, strict=True)


@pytest.mark.parametrize("compression", [None, "LZ4"])
@pytest.mark.parametrize("fraction", [0.3, 0.8, None])
def test_an_unclosed_ros1_bag_is_refused_with_the_remedy(tmp_path, compression, fraction):
    messages = files.wrenches_and_poses(WHOLE, ros1=True)
    path = files.rosbag1(tmp_path / "a.bag", messages, compression)
    data = bytearray(path.read_bytes())
    if fraction is None:  # as a recorder leaves it: no index
        path = tmp_path / "a.bag.active"
        index = data.index(b"index_pos=")
        data[index + 10 : index + 18] = bytes(8)
        end = data.rindex(b"op=\x07")
    else:
        end = int(fraction * len(data))
    path.write_bytes(data[:end])
    cure = r"a\.bag.*: the bag was not closed by its recorder.* rosbag reindex .*a\.bag"
    with pytest.raises(RecordingError, match=cure):
        open_recording(path)


def database(tmp_path, mode: str | None = None):
    folder = files.rosbag2(tmp_path / "bag", files.wrenches_and_poses(WHOLE), mode=mode)
    return folder / "bag.db3"


def test_rows_in_the_write_ahead_log_are_read(tmp_path) -> None:
    path = database(tmp_path)
    count = len(open_recording(path).channels["/ft.log_time"])
    live = sqlite3.connect(path)
    live.execute("PRAGMA journal_mode = WAL")
    live.execute("PRAGMA wal_autocheckpoint = 0")
    rows = live.execute("SELECT topic_id, timestamp, data FROM messages LIMIT 2").fetchall()
    live.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    live.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for each in (path, path.with_name("bag.db3-wal")):
        shutil.copy(each, killed)
    before = {each.name: each.read_bytes() for each in killed.iterdir()}
    for given in (killed, killed / "bag.db3"):
        found = open_recording(given)
        assert len(found.channels["/ft.log_time"]) == count + 1  # the other row is a pose
        assert "recovered copy" in found.notes["recovered"]
    live.close()
    assert {each.name: each.read_bytes() for each in killed.iterdir()} == before


def test_without_its_metadata_a_bag_is_read(tmp_path) -> None:
    messages = files.wrenches_and_poses(WHOLE)
    for storage in ("MCAP", "SQLITE3"):
        (files.rosbag2(tmp_path / storage, messages, storage) / "metadata.yaml").unlink()
        found = open_recording(tmp_path / storage)
        assert_begins_as_recorded(found, whole=True)
        assert found.losses == ("metadata.yaml is missing; the recorder was probably killed",)
    assert_begins_as_recorded(open_recording(tmp_path / "SQLITE3" / "SQLITE3.db3"), whole=True)


def test_a_bag_of_which_a_file_is_missing_says_so(tmp_path) -> None:
    path = database(tmp_path)
    metadata = path.with_name("metadata.yaml")
    metadata.write_text(metadata.read_text().replace("  - bag.db3", "  - bag.db3\n  - bag_1.db3"))
    found = open_recording(path.parent)
    assert_begins_as_recorded(found, whole=True)
    assert any("one of its files" in each and "bag_1.db3" in each for each in found.losses)
    metadata.unlink()
    path.unlink()
    with pytest.raises(RecordingError, match="holds no ROS 2 bag"):
        open_recording(path.parent)


def test_metadata_that_cannot_be_understood_are_passed_over(tmp_path) -> None:
    path = database(tmp_path)
    for text in ("[", "a: 1", "rosbag2_bagfile_information: 3", "x: &x [*x]"):
        path.with_name("metadata.yaml").write_text(text)
        found = open_recording(path.parent)
        assert_begins_as_recorded(found, whole=True)
        assert any("metadata.yaml is invalid" in each for each in found.losses)


def test_single_messages_that_are_not_of_their_type_are_counted(tmp_path) -> None:
    messages = [
        ("/ft", int(stamp), files.cdr_wrench(stamp, row)[: 40 if k % 50 == 7 else None])
        for k, (stamp, row) in enumerate(zip(WHOLE.stamps, WHOLE.wrenches, strict=True))
    ]
    path = files.raw_mcap(tmp_path / "a.mcap", messages, {"/ft": files.WRENCH})
    found = open_recording(path)
    assert len(found.channels[FIRST]) == len(WHOLE) - 6
    assert any("6 of 300 messages could not be decoded" in each for each in found.losses)
    with pytest.raises(RecordingError, match="6 of 300"):
        open_recording(path, strict=True)
