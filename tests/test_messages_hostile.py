"""Recordings of messages made to do harm: refused or salvaged, in a line, within bounds."""

import os
import resource
import sqlite3
import struct
import subprocess
import sys
import time

import message_files as files
import pytest
import zstandard
from google.protobuf import descriptor_pb2

from palpate.errors import PalpateError, RecordingError
from palpate.recordings import open_recording, sources

GIVEN = files.values(30)
WRENCH = ("cdr", "ros2msg", "geometry_msgs/msg/WrenchStamped", files.WRENCH.encode())
# The interpreter with NumPy takes some 60 MB; a block may unpack to 16 MiB, and be held twice.
MOST_MEMORY = 250 << 20


def record(kind: int, content: bytes, claimed: int | None = None) -> bytes:
    length = len(content) if claimed is None else claimed
    return bytes([kind]) + struct.pack("<Q", length) + content


def text(words: bytes) -> bytes:
    return struct.pack("<I", len(words)) + words


HEAD = b"\x89MCAP0\r\n" + record(1, text(b"") + text(b""))
ABOUT_FT = record(
    3, struct.pack("<H", 1) + text(b"geometry_msgs/msg/WrenchStamped") + text(b"ros2msg")
    + text(files.WRENCH.encode())
) + record(4, struct.pack("<HH", 1, 1) + text(b"/ft") + text(b"cdr") + text(b""))  # fmt: skip


def message(time: int, data: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", 1, 0, time, time) + data)


def chunk(packed: bytes, claimed: int, kind: bytes = b"zstd", checksum: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 0, claimed, checksum) + text(kind)
    return record(6, head + struct.pack("<Q", len(packed)) + packed)


GOOD = HEAD + ABOUT_FT + message(1, files.cdr_wrench(1, GIVEN.wrenches[0]))


def salvaged(path, data: bytes):
    """What is read of it, within a second (10 are allowed), with its losses."""
    path.write_bytes(data)
    begin = time.monotonic()
    found = open_recording(path)
    assert time.monotonic() - begin < 5.0
    assert found.losses
    assert len(found.channels["/ft.wrench.force.x"]) == 1
    return found


@pytest.mark.parametrize("claimed", [10 << 30, (1 << 64) - 1, 1 << 63])
@pytest.mark.parametrize("kind", [1, 3, 4, 5, 6, 9, 0x90])
def test_records_that_claim_gigabytes_are_passed_over(tmp_path, kind, claimed) -> None:
    salvaged(tmp_path / "a.mcap", GOOD + record(kind, b"abc", claimed) + b"more")


@pytest.mark.parametrize("kind", [b"zstd", b"lz4", b"", b"rar"])
@pytest.mark.parametrize("claimed", [100, 10 << 30, (1 << 64) - 1])
def test_chunks_that_claim_what_they_do_not_hold_are_lost(tmp_path, kind, claimed) -> None:
    salvaged(tmp_path / "a.mcap", GOOD + chunk(b"x" * 50, claimed, kind) + record(15, bytes(4)))


def bombs(count: int, size: int) -> bytes:
    """Chunks of messages that are all zeros; each unpacks to much more than it is."""
    inner = message(0, bytes(1 << 16)) * (size >> 16)
    return chunk(zstandard.compress(inner), len(inner)) * count


def test_chunks_that_unpack_without_an_end_are_stopped(tmp_path) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(GOOD + bombs(500, 8 << 20))  # 4 GB of zeros
    program = (
        "import sys, resource\n"
        "from palpate.recordings import open_recording\n"
        "found = open_recording(sys.argv[1])\n"
        "assert any('unpacks to more than' in each for each in found.losses), found.losses\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )
    command = [sys.executable, "-c", program, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, done.stderr
    # On Linux this is no less than what the process that started it held: pages are shared.
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert int(done.stdout) <= max(MOST_MEMORY >> 10, before)


def test_a_chunk_that_claims_little_and_holds_much_is_lost(tmp_path) -> None:
    packed = zstandard.compress(bytes(200 << 20))
    salvaged(tmp_path / "a.mcap", GOOD + chunk(packed, 1000) + record(15, bytes(4)))


@pytest.mark.parametrize(
    "definition",
    [
        "own_msgs/Own again",
        "own_msgs/Missing other",
        "float64[99999999999999] many",
        "float64[",
        "\x00\x01",
        "wstring text",
        "float64 x\n" * 30_000,
        "a/A a\n" + "".join(
            f"{files.RULE}\nMSG: a/{chr(65 + k)}\na/{chr(66 + k)}[1000] x\n" for k in range(20)
        ) + f"{files.RULE}\nMSG: a/U\n",
    ],
    ids=["recursive", "missing", "huge", "broken", "binary", "wide", "long", "multiplied"],
)  # fmt: skip
def test_absurd_definitions_leave_a_topic_out_in_a_line(tmp_path, definition) -> None:
    schemas = {"/own": ("cdr", "ros2msg", "own_msgs/msg/Own", definition.encode()), "/ft": WRENCH}
    messages = [("/own", k, b"\0\1\0\0" + bytes(100)) for k in range(200)]
    messages.append(("/ft", 1, files.cdr_wrench(1, GIVEN.wrenches[0])))
    path = files.raw_mcap(tmp_path / "a.mcap", messages, schemas)
    begin = time.monotonic()
    found = open_recording(path)
    assert time.monotonic() - begin < 5.0
    said = [each for each in (*found.losses, *found.omissions) if each.startswith("/own")]
    assert said
    assert all("\n" not in each and len(each) < 400 for each in said)
    with pytest.raises(RecordingError, match="/own"):
        open_recording(path, ["/own"])


def test_messages_that_claim_long_lists_are_counted(tmp_path) -> None:
    schemas = {"/own": ("cdr", "ros2msg", "a/msg/A", b"float64[] x"), "/ft": WRENCH}
    messages = [("/own", k, b"\0\1\0\0" + b"\xff" * 4 + bytes(20)) for k in range(2000)]
    messages.append(("/ft", 1, files.cdr_wrench(1, GIVEN.wrenches[0])))
    found = open_recording(files.raw_mcap(tmp_path / "a.mcap", messages, schemas))
    assert any("could not be decoded" in each and "4294967295" in each for each in found.losses)


def test_json_that_is_no_object_is_counted(tmp_path) -> None:
    objects = [{"a": 1}, [1, 2], "text", 3, None, {"a": 2}, {"a": 10**400, "b": {"c": True}}]
    found = open_recording(files.json_mcap(tmp_path / "a.mcap", objects))
    assert found.channels["/json.a"].tolist() == [1.0, 2.0, float("inf")]
    assert any("4 of 7 messages" in each for each in found.losses)
    deep = b"[" * 100_000
    path = files.raw_mcap(
        tmp_path / "b.mcap",
        [("/j", 1, deep), ("/j", 2, b'{"a":' * 5000 + b"1" + b"}" * 5000), ("/j", 3, b'{"a":1}')],
        {"/j": ("json", "", "", b"")},
    )
    assert open_recording(path).channels["/j.a"].tolist()[-1] == 1.0


def test_names_that_are_new_in_each_message_do_not_fill_the_memory(tmp_path) -> None:
    path = files.json_mcap(tmp_path / "a.mcap", [{f"n{k}": k, "x": k} for k in range(5000)])
    found = open_recording(path)
    assert found.channels["/json.x"].tolist() == list(range(5000))
    assert sum(each.nbytes for each in found.channels.values()) < 20 << 20
    assert any("few messages have" in each for each in found.omissions)


@pytest.mark.parametrize(
    "schema",
    [
        b"nonsense",
        b"",
        descriptor_pb2.FileDescriptorSet(
            file=[
                descriptor_pb2.FileDescriptorProto(
                    name="a",
                    package="a",
                    message_type=[
                        descriptor_pb2.DescriptorProto(
                            name="A",
                            field=[
                                descriptor_pb2.FieldDescriptorProto(
                                    name="a", number=1, type=11, type_name=".a.A", label=1
                                )
                            ],
                        )
                    ],
                )
            ]
        ).SerializeToString(),
    ],
    ids=["nonsense", "empty", "recursive"],
)
def test_absurd_protobuf_leaves_a_topic_out_in_a_line(tmp_path, schema) -> None:
    schemas = {"/p": ("protobuf", "protobuf", "a.A", schema), "/ft": WRENCH}
    nested = b""
    for _ in range(60):
        nested = b"\x0a" + bytes([len(nested)]) + nested if len(nested) < 126 else nested
    messages = [("/p", 1, nested), ("/p", 2, b"\xff" * 40), ("/p", 3, b"")]
    messages.append(("/ft", 1, files.cdr_wrench(1, GIVEN.wrenches[0])))
    found = open_recording(files.raw_mcap(tmp_path / "a.mcap", messages, schemas))
    assert any(each.startswith("/p") for each in (*found.losses, *found.omissions))


@pytest.mark.parametrize(
    "statements",
    [
        "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
        "SELECT x AS id, 1 AS topic_id, x AS timestamp, zeroblob(1000000) AS data FROM c",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB AS (zeroblob(1000000000)))",
        "CREATE TABLE other(x)",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, wrong)",
    ],
    ids=["endless view", "computed", "no table", "no columns"],
)
def test_databases_that_are_no_bags_are_refused_in_a_line(tmp_path, statements) -> None:
    path = tmp_path / "a.db3"
    with sqlite3.connect(path) as database:
        database.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)"
        )
        database.execute("INSERT INTO topics VALUES (1, '/f', 'std_msgs/msg/Float64', 'cdr')")
        database.execute(statements)
    database.close()
    with pytest.raises(RecordingError) as caught:
        open_recording(path)
    assert "\n" not in str(caught.value)
    assert "a.db3" in str(caught.value)


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".db3"])
def test_files_of_ten_gigabytes_of_nothing_are_refused_in_time(tmp_path, suffix) -> None:
    huge = struct.pack("<Q", 9 << 30)
    heads = {
        ".mcap": HEAD + record(6, bytes(16) + huge + bytes(8) + huge, (9 << 30) + 40),
        ".bag": b"#ROSBAG V2.0\n",
        ".db3": b"SQLite format 3\0\x10\0",
    }
    path = tmp_path / f"a{suffix}"
    with path.open("wb") as file:
        file.write(heads[suffix])
        file.truncate(10 << 30)  # a hole, which takes no disk
    begin = time.monotonic()
    with pytest.raises(RecordingError) as caught:
        open_recording(path)
    assert time.monotonic() - begin < 10.0
    assert "\n" not in str(caught.value)


def test_a_row_with_the_last_number_there_is_ends_the_messages(tmp_path) -> None:
    folder = files.rosbag2(tmp_path / "bag", files.wrenches_and_poses(GIVEN))
    path = folder / "bag.db3"
    database = sqlite3.connect(path)
    last = (1 << 63) - 1
    database.execute("UPDATE messages SET id = ? WHERE id = 60", (last,))
    database.commit()
    database.close()
    assert len(open_recording(path).channels["/pose.log_time"]) == 30


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".db3", ".db3.zstd", ".mcap.zstd"])
@pytest.mark.parametrize(
    "content",
    [b"", b"\0" * 5000, b"text\n", b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", b"#ROSBAG V1.2\n"],
)
def test_files_without_messages_are_refused_in_a_line(tmp_path, suffix, content) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    with pytest.raises(PalpateError) as caught:
        open_recording(path)
    assert "\n" not in str(caught.value)
    assert path.name in str(caught.value)


def test_folders_pipes_and_missing_files_are_refused_in_a_line(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "folder.mcap"
    folder.mkdir()
    monkeypatch.setattr(sources, "PATIENCE", 0.05)  # s; nobody writes into it
    pipe = tmp_path / "pipe.bag"
    os.mkfifo(pipe)
    for path in (folder, pipe, tmp_path / "no.mcap", tmp_path / "no.db3", tmp_path / "a\0.bag"):
        with pytest.raises(RecordingError) as caught:
            open_recording(path)
        assert "\n" not in str(caught.value)
