"""Files that state, or unpack to, far more than they hold; and good files that compress as well."""

import gzip
import shutil
import sqlite3
import struct

import message_files as files
import numpy as np
import pyarrow as pa
import pytest
import zstandard
from containers import COLUMNS, write_feather, write_hdf5, write_mat5, write_parquet
from mcap.writer import CompressionType, Writer

from palpate import open_recording
from palpate.cli.fleet import _settings
from palpate.cli.options import MethodOptions
from palpate.cli.reading import ReadingOptions
from palpate.errors import RecordingError
from palpate.fleet.running import identify_batch

CAP = 8 << 20  # bytes: a 64th is 128 KiB
LONG = CAP // 8 + 1000  # numbers


def mcap_of(path, size, count=1, compression=CompressionType.ZSTD):
    """One topic of JSON, a message of so many bytes each, all in one chunk."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 40, compression=compression)
        writer.start()
        channel = writer.register_channel("/ft", "json", 0)
        message = b'{"force": 1.0' + b" " * (size - 14) + b"}"
        for k in range(count):
            writer.add_message(channel, k, message, k)
        writer.finish()
    return path


def sqlite_of(path, size):
    bag = files.rosbag2(path.with_suffix(""), files.wrenches_and_poses(files.values(20)))
    shutil.copy(next(bag.glob("*.db3")), path)
    with sqlite3.connect(path) as base:
        base.execute("INSERT INTO messages VALUES (NULL, 1, 9e18, zeroblob(?))", (size,))
    return path


def gz_of(path, rows):
    with gzip.open(path, "wt", compresslevel=9) as file:
        file.write("time_s,penetration_m,force_N\n")
        for _ in range(rows // 1000):
            file.write("0,0,0\n" * 1000)
    return path


def zeros(count=LONG):
    return {**dict.fromkeys(COLUMNS, np.zeros(8)), "force_N": np.zeros(count)}


def column(count=LONG):
    return {"force_N": np.zeros(count)}


BOMBS = {
    "a.csv.gz": lambda path: gz_of(path, LONG),
    "a.parquet": lambda path: write_parquet(path, column()),
    "a.feather": lambda path: write_feather(path, column(), compression="zstd"),
    "one.feather": lambda path: write_feather(path, column(), compression="lz4", chunksize=1 << 30),
    "words.feather": lambda path: write_feather(
        path, {"a": pa.array(["x" * 4000] * 20000).dictionary_encode()}
    ),
    "words.parquet": lambda path: write_parquet(path, {"a": ["x" * 4000] * 20000}),
    "lists.parquet": lambda path: write_parquet(
        path, {"a": pa.FixedSizeListArray.from_arrays(np.zeros(LONG // 200 * 200), 200)}
    ),
    "a.h5": lambda path: write_hdf5(path, column(), compression="gzip"),
    "chunk.h5": lambda path: write_hdf5(
        path, column(10), compression="gzip", chunks=(CAP // 16,), maxshape=(None,)
    ),
    "a.mat": lambda path: write_mat5(path, column(), do_compression=True),
    "a.mcap": lambda path: mcap_of(path, 1 << 20),
    "lz4.mcap": lambda path: mcap_of(path, 1 << 20, compression=CompressionType.LZ4),
    "plain.mcap": lambda path: mcap_of(path, 1 << 20, compression=CompressionType.NONE),
    "a.db3": lambda path: sqlite_of(path, 1 << 20),
}


@pytest.mark.long
@pytest.mark.parametrize("name", BOMBS)
def test_a_file_beyond_the_cap_is_refused_or_reported_with_the_option_that_raises_it(
    name, tmp_path
):
    path = BOMBS[name](tmp_path / name)
    open_recording(path, max_size=64 * CAP)
    try:
        said = "; ".join(open_recording(path, max_size=CAP).losses)
    except RecordingError as error:
        said = str(error)
        assert len(said.splitlines()) == 1
        assert name in said
    assert "larger --max-size" in said


def test_the_message_that_is_too_large_ends_no_good_ones(tmp_path):
    found = open_recording(sqlite_of(tmp_path / "a.db3", 1 << 20), max_size=CAP)
    assert len(found.channels["/ft.log_time"]) == 20


def test_an_option_raises_the_cap(tmp_path, run):
    path = BOMBS["a.parquet"](tmp_path / "a.parquet")
    assert run("info", path)[0] == 0
    status, _, err = run("info", path, "--max-size", "1MB")
    assert (status, err.count("\n")) == (2, 1)
    assert "larger --max-size" in err
    assert run("identify", path, "--max-size", "0.5")[0] == 2


def test_a_fleet_takes_the_option_that_the_error_of_a_row_names(tmp_path):
    path = BOMBS["a.parquet"](tmp_path / "a.parquet")
    batch = pa.table({"source": [str(path)], "kind": ["file"], "index": pa.array([None], "int64")})
    for size, named in ((1e6, True), (1e9, False)):
        settings = _settings(MethodOptions(), "none", ReadingOptions(max_size=size))
        [row] = identify_batch(batch, settings).to_pylist()
        assert ("larger --max-size" in row["error"]) == named


GOOD = {
    "a.csv.gz": lambda path: gz_of(path, 300_000),
    "a.parquet": lambda path: write_parquet(path, column(1_000_000)),
    "a.feather": lambda path: write_feather(path, column(1_000_000), compression="zstd"),
    "a.h5": lambda path: write_hdf5(path, column(1_000_000), compression="gzip"),
    "a.mat": lambda path: write_mat5(path, column(1_000_000), do_compression=True),
    "a.mcap": lambda path: mcap_of(path, 1000, 20_000),
}


@pytest.mark.parametrize("name", GOOD)
def test_constants_that_compress_a_hundredfold_and_more_are_read_whole(name, tmp_path):
    path = GOOD[name](tmp_path / name)
    found = open_recording(path)
    assert not found.losses
    size = sum(values.nbytes for values in found.channels.values())
    assert size > 100 * path.stat().st_size or name == "a.mcap"


@pytest.mark.long
def test_a_chunk_of_endless_descriptions_ends(tmp_path):
    """A chunk that alternates a channel and a message took a second a hundred kilobytes."""
    record = lambda kind, body: bytes([kind]) + struct.pack("<Q", len(body)) + body  # noqa: E731
    channel = record(4, struct.pack("<HHI3sI4sI", 1, 0, 3, b"/ft", 4, b"json", 0))
    message = record(5, struct.pack("<HIqq", 1, 0, 0, 0) + b"{}")
    data = (channel + message) * 200_000
    body = struct.pack("<qqQII4s", 0, 1, len(data), 0, 4, b"zstd")
    packed = zstandard.compress(data)
    chunk = record(6, body + struct.pack("<Q", len(packed)) + packed)
    path = tmp_path / "a.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + record(1, struct.pack("<II", 0, 0)) + chunk)
    assert path.stat().st_size < 20_000
    with pytest.raises(RecordingError):
        open_recording(path)
