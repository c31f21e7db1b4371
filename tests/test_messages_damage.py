"""Recordings that were cut off or damaged: what is whole is read, and what is lost is said."""

import shutil
import sqlite3

import message_files as files
import numpy as np
import pytest

from palpate.errors import RecordingError
from palpate.recordings import open_recording

GIVEN = files.values(300, seed=2)
FIRST = "/ft.wrench.force.x"


def assert_begins_as_recorded(found, *, whole=False) -> int:
    """What there is of each topic is what was recorded first, to the last bit."""
    for name, column in GIVEN.columns().items():
        values = found.channels.get(name, column[:0])
        assert values.tobytes() == np.ascontiguousarray(column[: len(values)]).tobytes()
    count = len(found.channels[FIRST])
    assert (count == len(GIVEN)) == whole
    return count


@pytest.mark.parametrize("compression", files.COMPRESSIONS, ids=lambda each: each.name)
@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.77])
def test_an_mcap_that_is_cut_off_is_read_to_where_it_is(tmp_path, compression, fraction) -> None:
    kind = {"compression": compression, "use_chunking": fraction != 0.5, "chunk_size": 8000}
    path = files.wrench_mcap(tmp_path / "a.mcap", GIVEN, **kind)
    data = path.read_bytes()
    path.write_bytes(data[: int(fraction * len(data))])
    found = open_recording(path)
    count = assert_begins_as_recorded(found)
    # The summary, and the index of each chunk, are a quarter of so short a file at the most; the
    # chunk that the cut goes through has some 30 messages of each topic.
    assert count > 0.7 * fraction * len(GIVEN) - 30
    assert any("recorder was killed" in each for each in found.losses)
    with pytest.raises(RecordingError, match=r"a\.mcap"):
        open_recording(path, strict=True)


@pytest.mark.parametrize("compression", files.COMPRESSIONS, ids=lambda each: each.name)
def test_a_chunk_with_a_wrong_checksum_is_left_out_and_said(tmp_path, compression) -> None:
    kind = {"compression": compression, "chunk_size": 8000}
    path = files.wrench_mcap(tmp_path / "a.mcap", GIVEN, **kind)
    data = bytearray(path.read_bytes())
    plain = compression.name == "NONE"
    data[data.index(GIVEN.wrenches[100].tobytes()) if plain else len(data) // 3] ^= 0x10
    path.write_bytes(data)
    found = open_recording(path)
    stamps = found.channels["/ft.header.stamp"]
    there = np.isin(GIVEN.stamps, stamps)
    assert 0.5 < there.mean() < 1.0
    assert found.channels[FIRST].tobytes() == GIVEN.wrenches[there, 0].tobytes()
    assert any("is lost" in each for each in found.losses)
    assert any("counts 600 messages" in each for each in found.losses)
    with pytest.raises(RecordingError):
        open_recording(path, strict=True)


@pytest.mark.parametrize("compression", [None, "LZ4"])
@pytest.mark.parametrize("fraction", [0.3, 0.8, None])
def test_a_bag_of_ros1_that_was_not_closed_is_refused_with_the_cure(
    tmp_path, compression, fraction
):
    messages = files.wrenches_and_poses(GIVEN, ros1=True)
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
    cure = r"a\.bag.*: the recorder did not close the bag.* rosbag reindex .*a\.bag"
    with pytest.raises(RecordingError, match=cure):
        open_recording(path)


def database(tmp_path, mode: str | None = None):
    folder = files.rosbag2(tmp_path / "bag", files.wrenches_and_poses(GIVEN), mode=mode)
    return folder / "bag.db3"


def test_what_a_recorder_left_in_the_log_of_its_database_is_read(tmp_path) -> None:
    path = database(tmp_path)
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
    live.close()
    before = {each.name: each.read_bytes() for each in killed.iterdir()}
    cure = r"did not close the bag.* ros2 bag reindex .*killed"
    for given in (killed, killed / "bag.db3"):
        with pytest.raises(RecordingError, match=cure):
            open_recording(given)
    assert {each.name: each.read_bytes() for each in killed.iterdir()} == before


def test_without_its_metadata_a_bag_in_mcap_is_read_and_one_in_sqlite_refused(tmp_path) -> None:
    messages = files.wrenches_and_poses(GIVEN)
    for storage in ("MCAP", "SQLITE3"):
        folder = files.rosbag2(tmp_path / storage, messages, storage)
        (folder / "metadata.yaml").unlink()
    found = open_recording(tmp_path / "MCAP")
    assert_begins_as_recorded(found, whole=True)
    assert found.losses == ("metadata.yaml is missing, as where the recorder was killed",)
    with pytest.raises(RecordingError, match=r"did not close the bag.* ros2 bag reindex"):
        open_recording(tmp_path / "SQLITE3")
    # A file of it that SQLite closed is whole.
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
    with pytest.raises(RecordingError, match="holds no bag"):
        open_recording(path.parent)


def test_metadata_that_cannot_be_understood_are_passed_over(tmp_path) -> None:
    path = database(tmp_path)
    for text in ("[", "a: 1", "rosbag2_bagfile_information: 3", "x: &x [*x]"):
        path.with_name("metadata.yaml").write_text(text)
        found = open_recording(path.parent)
        assert_begins_as_recorded(found, whole=True)
        assert any("cannot be understood" in each for each in found.losses)


def test_single_messages_that_are_not_of_their_type_are_counted(tmp_path) -> None:
    messages = [
        ("/ft", int(stamp), files.cdr_wrench(stamp, row)[: 40 if k % 50 == 7 else None])
        for k, (stamp, row) in enumerate(zip(GIVEN.stamps, GIVEN.wrenches, strict=True))
    ]
    path = files.raw_mcap(tmp_path / "a.mcap", messages, {"/ft": files.WRENCH})
    found = open_recording(path)
    assert len(found.channels[FIRST]) == len(GIVEN) - 6
    assert any("6 of 300 messages could not be decoded" in each for each in found.losses)
    with pytest.raises(RecordingError, match="6 of 300"):
        open_recording(path, strict=True)
