"""Files that state, or unpack to, far more than they hold; and good files that compress as well."""

import gzip
import json
import os
import pickle
import shutil
import sqlite3
import struct
import subprocess
import sys
import zipfile
import zlib
from contextlib import suppress

import h5py
import message_files as files
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
import zarr
import zstandard
from containers import COLUMNS, write_feather, write_hdf5, write_mat5, write_parquet
from dataset_files import episodes, write_robomimic
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
def test_a_file_beyond_the_cap_names_the_option_that_raises_it(name, tmp_path):
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


def zarr_array(folder, shape, chunk=b"", **changed):
    about = {"zarr_format": 2, "shape": shape, "chunks": shape, "dtype": "<f8", "order": "C"}
    about |= {"fill_value": 0, "compressor": None, "filters": None, **changed}
    folder.mkdir(parents=True)
    (folder / ".zarray").write_text(json.dumps(about))
    if chunk:
        (folder / ".".join("0" for _ in shape)).write_bytes(chunk)


def replay_buffer(path, force=(), ends=(100,), **changed):
    """A data set in Zarr with an episode, whose arrays have this shape, chunk and description."""
    for folder in ("", "data", "meta"):
        (path / folder).mkdir(parents=True)
        (path / folder / ".zgroup").write_text('{"zarr_format": 2}')
    if isinstance(ends, dict):
        zarr_array(path / "meta/episode_ends", **ends)
    else:
        zarr_array(path / "meta/episode_ends", [1], np.array(ends).tobytes(), dtype="<i8")
        zarr_array(path / "data/force", [100], *force, **changed)
    return path


def deflated(size):
    packer = zlib.compressobj(9)
    return b"".join(packer.compress(bytes(1 << 20)) for _ in range(size >> 20)) + packer.flush()


def episodes_of(path):
    (path / "meta/episodes/chunk-000").mkdir(parents=True)
    about = {"codebase_version": "v3.0", "fps": 30, "features": {}}
    (path / "meta/info.json").write_text(json.dumps(about))
    names = ("episode_index", "data/chunk_index", "data/file_index", "dataset_from_index", "length")
    table = pa.table({name: np.zeros(10_000_000, np.int32) for name in names})
    parquet.write_table(table, path / "meta/episodes/chunk-000/file-000.parquet")
    return path


def lines_of(path, *lines):
    path.write_text("\n".join(lines))
    return path


def sheet_of(path, **cells):
    book = openpyxl.Workbook()
    for k in range(100):
        book.active.append(["time_s", "force_N"] if k == 0 else [1e-3 * k, 1.0])
    for place, value in cells.items():
        book.active[place] = value
        book.active[place].fill = openpyxl.styles.PatternFill("solid", fgColor="FF0000")
    book.save(path)
    return path


def long_cell_of(path):
    sheet_of(path.with_name("short.xlsx"))
    with (
        zipfile.ZipFile(path.with_name("short.xlsx")) as old,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"time_s", b"a" * 30_000_000))


def times_of(path):
    np.savez_compressed(path, time=np.zeros(30_000_000, "M8[s]"))
    return path


def chunk_of_hdf5(path, rows=1000, size=256 << 20):
    write_hdf5(path, column(rows), compression="gzip", chunks=(rows,), maxshape=(None,))
    with h5py.File(path, "a") as file:
        file["force_N"].id.write_direct_chunk((0,), deflated(size))
    return path


def shard_of(path, most=1 << 25):
    group = zarr.create_group(path)
    group.create_array("meta/episode_ends", data=np.array([100, 200]))
    codec = {"compressors": zarr.codecs.GzipCodec(level=9), "dtype": "<f8"}
    sizes = {"shape": 2 * most, "chunks": (most,), "shards": (2 * most,)}
    force = group.create_array("data/force", **sizes, **codec)
    force[:most] = 1.0
    about = path / "data/force/zarr.json"
    text = about.read_text().replace(str(2 * most), "200")
    about.write_text(text.replace(str(most), "100"))


def word_of(path):
    words = pa.DictionaryArray.from_arrays(np.zeros(8192, np.int32), ["x" * 500_000])
    parquet.write_table(pa.table({"word": words}), path, store_schema=False)


class Code:
    def __reduce__(self):
        return os.abort, ()


PICKLE = {"filters": [{"id": "pickle", "protocol": 5}]}
RAISED = "larger max_size"
HOSTILE = {
    "pickle.zarr": (
        {"ends": {"shape": [1], "chunk": pickle.dumps([Code()]), "dtype": "|O", **PICKLE}},
        "not numbers",
    ),
    "codec.zarr": ({"force": [pickle.dumps(Code())], **PICKLE}, "does not run"),
    "shape.zarr": ({"ends": {"shape": [600_000_000], "dtype": "<i8"}}, RAISED),
    "rows.zarr": ({"ends": [300_000_000]}, "no number for each sample"),
    "zlib.zarr": ({"force": [deflated(256 << 20)], "compressor": {"id": "zlib"}}, RAISED),
    "zstd.zarr": (
        {"force": [zstandard.compress(bytes(256 << 20))], "compressor": {"id": "zstd"}},
        RAISED,
    ),
    "lerobot": (episodes_of, RAISED),
    "keys.jsonl": (lambda path: lines_of(path, *(f'{{"k{k}": 1}}' for k in range(9000))), RAISED),
    "rows.jsonl": (
        lambda path: lines_of(
            path, json.dumps(dict.fromkeys(map(str, range(4000)), 1)), *["{}"] * 9999
        ),
        RAISED,
    ),
    "keys.json": (
        lambda path: lines_of(path, json.dumps({str(k): [1, 2] for k in range(9000)})),
        RAISED,
    ),
    "dates.npz": (times_of, RAISED),
    "text.xlsx": (long_cell_of, RAISED),
    "chunk.h5": (chunk_of_hdf5, "longer than they state"),
    "packed.h5": (lambda path: chunk_of_hdf5(path, 60_000, 480 << 20), RAISED),
    "shard.zarr": (shard_of, RAISED),
    "word.parquet": (word_of, RAISED),
}


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="the peak is read from /proc")
@pytest.mark.parametrize("name", HOSTILE)
def test_a_bomb_or_a_file_with_code_is_refused_in_one_line(name, tmp_path):
    """The process of its own needs 90 MB to begin with."""
    made, words = HOSTILE[name]
    path = tmp_path / name
    replay_buffer(path, **made) if isinstance(made, dict) else made(path)
    program = (
        "import sys, palpate\n"
        "try: print(palpate.open_recording(sys.argv[1]).losses)\n"
        "except palpate.RecordingError as error: print(error)\n"
        # The peak since exec; getrusage begins with the size of the process that forked it.
        "with open('/proc/self/status') as status:\n"
        "    print(next(line.split()[1] for line in status if line.startswith('VmHWM')))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=60,
        check=True,
    )  # fmt: skip
    said, memory = done.stdout.splitlines()
    assert words in said
    assert int(memory) < 300_000  # KiB


def test_a_coloured_cell_far_from_the_table_is_no_part_of_it(tmp_path):
    found = open_recording(sheet_of(tmp_path / "a.xlsx", XFD5=None, A1048576=None))
    assert {name: len(values) for name, values in found.channels.items()} == {
        "time_s": 99,
        "force_N": 99,
    }


@pytest.mark.parametrize("link", ["data", "data/demo_0", "data/demo_0/obs", "soft"])
def test_a_data_set_does_not_follow_a_link_to_another_file(link, tmp_path):
    other, path = tmp_path / "other.hdf5", tmp_path / "a.hdf5"
    write_robomimic(other, episodes(1))
    with h5py.File(path, "w") as file:
        file["data/demo_1/obs/own"] = np.arange(300.0)
        place = "data/demo_0/obs" if link == "soft" else link
        if link == "data":
            del file["data"]
        file["out"] = h5py.ExternalLink("other.hdf5", "data/demo_0")
        soft = h5py.SoftLink("/out/obs")
        file[place] = soft if link == "soft" else h5py.ExternalLink("other.hdf5", place)
    with pytest.raises(RecordingError, match="links to another file"):
        open_recording(path)


@pytest.mark.parametrize("end", [".npy", ".npz"])
def test_an_array_with_bytes_inserted_is_refused(end, tmp_path):
    """Wherever they are: seed 3."""
    random, path = np.random.default_rng(3), tmp_path / f"a{end}"
    table = np.random.default_rng(0).standard_normal((200, 3))
    np.savez(path, table=table) if end == ".npz" else np.save(path, table)
    whole = path.read_bytes()
    for _ in range(100):
        place = int(random.integers(len(whole)))
        path.write_bytes(whole[:place] + random.bytes(int(random.integers(1, 65))) + whole[place:])
        with suppress(RecordingError):
            found = open_recording(path)
            assert np.array_equal(np.column_stack(list(found.channels.values())), table)


def test_arrays_appended_to_one_file_are_not_damage(tmp_path):
    with (tmp_path / "a.npy").open("wb") as file:
        np.save(file, np.arange(30.0))
        np.save(file, np.arange(9.0))
    assert len(open_recording(tmp_path / "a.npy").channels["column"]) == 30
