"""Files of groups and columns: to the last bit, on their clocks; what is damaged is said."""

import gzip
import io
import random
import shutil
import zipfile
from functools import partial

import afmformats
import h5py
import message_files as files
import numpy as np
import pandas
import pyarrow as pa
import pytest
import scipy.io
from containers import (
    COLUMNS,
    HEIGHT_SCALE,
    SENSITIVITY,
    SPRING_CONSTANT,
    VOLTS,
    write_feather,
    write_hdf5,
    write_jpk,
    write_mat5,
    write_mat73,
    write_parquet,
)

from palpate import MissingExtraError, RecordingError, errors, prepare
from palpate.input.recordings import FORMATS, Recording, open_recording

RNG = np.random.default_rng(5)
NOW = 1_763_800_000_123_456_789  # ns since 1970; a float is exact to 256 of them
STAMPS = NOW + 1_000_001 * np.arange(500)

WRITERS = {
    "probe.parquet": write_parquet,
    "probe.feather": write_feather,
    "probe.h5": write_hdf5,
    "packed.h5": partial(write_hdf5, compression="gzip", shuffle=True, chunks=(100,)),
    "probe.mat": write_mat5,
    "packed.mat": partial(write_mat5, do_compression=True),
    "column.mat": partial(write_mat5, oned_as="column"),
    "new.mat": write_mat73,
}


def same(left: np.ndarray, right: np.ndarray) -> bool:
    """Equal, NaN and the sign of zero too."""
    return left.dtype == right.dtype and left.tobytes() == right.tobytes()


@pytest.mark.parametrize("name", WRITERS)
def test_requested_numbers_are_read_exactly(name, tmp_path):
    write, path = WRITERS[name], tmp_path / name
    # A format is known by its content before its suffix.
    path = path.with_suffix(".csv") if name == "packed.h5" else path
    extreme = np.resize([0.1, -0.0, 5e-324, 1.7976931348623157e308, np.pi, np.nan, np.inf], 600)
    for columns in ({**COLUMNS, "extreme": extreme}, {"stamp": STAMPS, "force": extreme[:500]}):
        recording = open_recording(write(path, columns))
        assert set(recording.channels) == set(columns)
        for channel, values in columns.items():
            assert same(recording.channels[channel], values)
        assert not recording.losses

    contact, direct = prepare(write(path)), prepare(Recording(COLUMNS))
    for channel in ("time", "penetration", "velocity", "force"):
        assert same(getattr(contact, channel), getattr(direct, channel))
    recording = open_recording(path, ["force_N"])
    clock = {"time_s"} if recording.clocks else set()
    assert set(recording.channels) == {"force_N"} | clock
    with pytest.raises(RecordingError, match=r"no (column|channel) nothing; available: .*force_N"):
        open_recording(path, ["nothing"])


def test_groups_of_hdf5_have_their_own_clocks_units_frames_and_notes(tmp_path):
    columns = {
        "robot/time": np.arange(100) * 1e-3,
        "robot/pose": RNG.normal(size=(100, 3)).astype(">f4"),
        "robot/arm/joints": RNG.normal(size=(7, 100)),
        "sensor/stamp": STAMPS.astype(np.uint64),
        "sensor/wrench": RNG.normal(size=(500, 6)),
        "sensor/odd": np.arange(40),
        "camera_time": np.arange(20.0),
        "camera": np.arange(20.0),
    }
    with h5py.File(write_hdf5(tmp_path / "all.h5", columns), "r+") as file:
        file["robot"].attrs["frame_id"] = "base_link"
        file["robot"].attrs["sample_rate"] = 1000.0
        file["robot/time"].attrs["units"] = np.bytes_("ms")
        file["robot/pose"].attrs["unit"] = ["mm"]
        file.attrs["subject"] = "phantom 3"
        file["mass"] = 1.25
    recording = open_recording(tmp_path / "all.h5")
    assert recording.clocks["robot/pose[2]"] == "robot/time"
    assert recording.clocks["robot/arm/joints[6]"] == "robot/time"
    assert recording.clocks["sensor/wrench[5]"] == "sensor/stamp"
    assert recording.clocks["camera"] == "camera_time"
    assert "sensor/odd" not in recording.clocks
    assert same(recording.channels["sensor/stamp"], STAMPS)
    pose = {f"robot/pose[{k}]": "mm" for k in range(3)}
    assert recording.units == {"robot/time": "ms", "sensor/stamp": "ns", **pose}
    assert recording.frames["robot/pose[0]"] == "base_link"
    notes = {"robot sample_rate": "1000.0", "subject": "phantom 3", "mass": "1.25"}
    assert notes.items() <= recording.notes.items()
    assert "assumed from its values" in recording.notes["sensor/stamp"]
    assert recording.channels["robot/pose[0]"].dtype == np.dtype("=f4")
    for k in range(7):
        found = recording.channels[f"robot/arm/joints[{k}]"]
        assert same(found, columns["robot/arm/joints"][k])


def test_tables_of_hdf5_give_a_channel_a_field(tmp_path):
    table = np.zeros(50, dtype=[("t", "f8"), ("force", "f8", (3,)), ("name", "S4"), ("ok", "?")])
    table["t"], table["force"] = np.arange(50.0), RNG.normal(size=(50, 3))
    recording = open_recording(write_hdf5(tmp_path / "table.h5", {"run": table}))
    assert recording.clocks["run.force[1]"] == "run.t"
    np.testing.assert_array_equal(recording.channels["run.force[1]"], table["force"][:, 1])
    assert recording.channels["run.ok"].dtype == bool
    assert recording.omissions == ("run.name: holds no numbers",)


STRUCT = {
    "robot": {
        "time": np.arange(60) * 0.01,
        "force": RNG.normal(size=(60, 3)),
        "turned": RNG.normal(size=(2, 60)),
        "touch": np.arange(60) % 2 == 0,
        "counts": np.arange(60, dtype=np.int16),
        "unit": "N",
    },
    "mass": 1.5,
    "title": "a trial",
}


@pytest.mark.parametrize("write", [write_mat5, write_mat73], ids=["5", "7.3"])
def test_both_versions_of_matlab_give_the_same_channels(write, tmp_path):
    recording = open_recording(write(tmp_path / "struct.mat", STRUCT))
    robot = STRUCT["robot"]
    assert set(recording.channels) == {
        "robot/time", *(f"robot/force[{k}]" for k in range(3)), "robot/turned[0]",
        "robot/turned[1]", "robot/touch", "robot/counts",
    }  # fmt: skip
    assert recording.clocks["robot/turned[1]"] == "robot/time"
    assert recording.units["robot/force[0]"] == "N"
    assert "robot/time" not in recording.units
    assert recording.notes["mass"] == "1.5"
    assert recording.notes["title"] == "a trial"
    for k in range(3):
        assert same(recording.channels[f"robot/force[{k}]"], robot["force"][:, k])
    assert same(recording.channels["robot/turned[1]"], robot["turned"][1])
    for name in ("counts", "touch"):  # differences do not overflow
        assert same(recording.channels[f"robot/{name}"], robot[name].astype(np.float64))


def test_simulinks_structure_with_time_has_the_clock_above_its_signals(tmp_path):
    time, values = np.arange(30.0), [RNG.normal(size=30), RNG.normal(size=(30, 2))]
    signals = [{"values": value, "label": f"s{k}"} for k, value in enumerate(values)]
    new = write_mat73(tmp_path / "new.mat", {"out": {"time": time, "signals": signals}})
    old = np.empty((1, 2), dtype=[("values", "O"), ("label", "O")])
    for k, value in enumerate(values):
        old[0, k] = (value, f"s{k}")
    scipy.io.savemat(tmp_path / "old.mat", {"out": {"time": time, "signals": old}})
    for path in (new, tmp_path / "old.mat"):
        recording = open_recording(path)
        assert recording.clocks["out/signals[0]/values"] == "out/time"
        assert recording.clocks["out/signals[1]/values[1]"] == "out/time"
        np.testing.assert_array_equal(recording.channels["out/signals[0]/values"], values[0])
        assert recording.notes["out/signals[1]/label"] == "s1"


def test_columns_of_arrow_are_flattened_and_their_times_exact(tmp_path):
    force = RNG.normal(size=(500, 3))
    nested = [{"force": {"x": row[0], "y": row[1]}, "valid": True} for row in force]
    table = {
        "stamp": pa.array(STAMPS, pa.timestamp("ns", tz="UTC")),
        "elapsed": pa.array(np.arange(500), pa.duration("ms")),
        "f": pa.array(list(force)),
        "fixed": pa.FixedSizeListArray.from_arrays(pa.array(force.ravel()), 3),
        "wrench": pa.array(nested),
        "state": pa.array(["free", "touch"] * 250).dictionary_encode(),
        "some": pa.array([1, None, 3] + [4] * 497),
        "uneven": pa.array([[1.0] * (k % 3) for k in range(500)]),
    }
    for path in (
        write_parquet(tmp_path / "all.parquet", table, row_group_size=99),
        write_feather(tmp_path / "all.feather", table, chunksize=99),
    ):
        recording = open_recording(path)
        channels = recording.channels
        assert same(channels["stamp"], STAMPS)
        assert recording.units == {"stamp": "ns", "elapsed": "ns"}
        assert same(channels["elapsed"], np.arange(500) * 1_000_000)
        for k in range(3):
            assert same(channels[f"f[{k}]"], force[:, k])
            assert same(channels[f"fixed[{k}]"], force[:, k])
        assert same(channels["wrench.force.y"], force[:, 1])
        assert list(channels["state"][:2]) == ["free", "touch"]
        fault = recording.faults["some"]
        assert (fault.count, fault.sample, fault.text) == (1, 1, "null")
        assert np.isnan(channels["some"][1])
        assert recording.omissions == ("column 'uneven' holds lists of 0 to 2 values",)


def test_units_and_index_of_pandas_columns_are_read(tmp_path):
    frame = pandas.DataFrame({"force": [1.0, 2.0]}, index=pandas.Index([0.0, 0.1], name="time_s"))
    table = pa.Table.from_pandas(frame)
    described = table.schema.field(0).with_metadata({"unit": "mN"})
    table = table.cast(table.schema.set(0, described))
    pa.parquet.write_table(table, tmp_path / "frame.parquet")
    recording = open_recording(tmp_path / "frame.parquet")
    assert list(recording.channels) == ["force", "time_s"]
    assert recording.units["force"] == "mN"


def curve(seed: int) -> tuple[np.ndarray, np.ndarray]:
    chance = np.random.default_rng(seed)
    return chance.integers(-3000, 3000, 200), chance.integers(-3000, 3000, 200)


def test_a_curve_of_a_force_map_is_calibrated_and_keeps_its_segments(tmp_path):
    height, deflection = curve(3)
    path = write_jpk(tmp_path / "map.jpk-force-map", [curve(1), (height, deflection)])
    with pytest.raises(
        RecordingError, match=r"holds 2 curves; choose one with --curve N, .* 0 to 1"
    ):
        open_recording(path)
    with pytest.raises(RecordingError, match=r"no curve 2; .* 0 to 1"):
        open_recording(path, curve=2)
    recording = open_recording(path, curve=1)
    expected = deflection * VOLTS * SENSITIVITY * SPRING_CONSTANT
    # Four products of floats, whose order is the reader's own.
    np.testing.assert_allclose(recording.channels["force"], expected, rtol=1e-15)
    np.testing.assert_allclose(
        recording.channels["height (measured)"], height * VOLTS * HEIGHT_SCALE, rtol=1e-15
    )
    np.testing.assert_array_equal(recording.channels["segment"], np.repeat([0, 1], 100))
    np.testing.assert_allclose(recording.channels["time"], np.arange(200) * 0.005, atol=1e-12)
    assert recording.units["force"] == "N"
    assert recording.clocks["force"] == "time"
    assert recording.notes["spring constant"] == f"{SPRING_CONSTANT} N/m"
    assert recording.omissions == ("height (piezo): not in this file",)


def test_a_single_curve_needs_no_choice(tmp_path):
    path = write_jpk(tmp_path / "one.jpk-force-map", [curve(1)])
    direct = open_recording(path)
    # Without the height that the instrument does not have, as afmformats itself would refuse.
    group = afmformats.load_data(path)[0]
    columns = {name: group[name] for name in direct.channels if name in group}
    made = afmformats.AFMForceDistance(columns, group.metadata)
    made.metadata.pop("z range", None)
    keys = ["spring constant", "imaging mode", "enum", "path", "point count"]
    made.export_data(tmp_path / "one.h5", metadata=keys, fmt="hdf5")
    recording = open_recording(tmp_path / "one.h5")
    assert same(recording.channels["force"], direct.channels["force"])
    assert recording.notes["spring constant"] == f"{SPRING_CONSTANT} N/m"


def cut(path, size: int):
    path.write_bytes(path.read_bytes()[:size])
    return path


CURVE = [(np.arange(200), np.arange(200))]


@pytest.mark.parametrize("write", [write_parquet, write_mat73, write_hdf5])
def test_a_file_that_ends_too_early_is_said_to_be_cut_off(write, tmp_path):
    path = write(tmp_path / "probe")
    with pytest.raises(RecordingError, match="cut off"):
        open_recording(cut(path, path.stat().st_size * 2 // 3))


def test_complete_batches_of_a_truncated_feather_file_are_read(tmp_path):
    path = write_feather(tmp_path / "cut.feather", chunksize=100)
    recording = open_recording(cut(path, path.stat().st_size * 2 // 3))
    count = len(recording.channels["force_N"])
    assert count in (300, 400)
    np.testing.assert_array_equal(recording.channels["force_N"], COLUMNS["force_N"][:count])
    assert "cut off" in recording.losses[0]
    assert f"only the first {count}" in recording.losses[1]
    with pytest.raises(RecordingError, match=r"cut off.*--strict"):
        open_recording(path, strict=True)


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "packed"])
def test_complete_variables_of_a_truncated_matlab_file_are_read(packed, tmp_path):
    path = write_mat5(tmp_path / "cut.mat", do_compression=packed)
    recording = open_recording(cut(path, -200))
    assert set(recording.channels) == {"time_s", "penetration_m"}
    assert "the file is cut off here" in recording.losses[0]
    with pytest.raises(RecordingError, match="the file is cut off here"):
        open_recording(path, strict=True)


def damage(path, at: int) -> None:
    content = bytearray(path.read_bytes())
    content[at : at + 40] = bytes(40)
    path.write_bytes(content)


def test_only_the_damaged_column_of_parquet_is_lost(tmp_path):
    columns = {"time_s": COLUMNS["time_s"], "force_N": COLUMNS["force_N"]}
    kind = {"row_group_size": 100, "use_dictionary": False, "compression": "gzip"}
    path = write_parquet(tmp_path / "bad.parquet", columns, **kind)
    chunk = pa.parquet.ParquetFile(path).metadata.row_group(2).column(1)
    damage(path, chunk.data_page_offset + chunk.total_compressed_size // 2)
    recording = open_recording(path)
    assert recording.losses[0].startswith("column 'force_N' cannot be read")
    assert set(recording.channels) == {"time_s"}
    np.testing.assert_array_equal(recording.channels["time_s"], COLUMNS["time_s"])


def test_a_damaged_array_of_hdf5_is_lost_and_the_others_are_read(tmp_path):
    path = write_hdf5(tmp_path / "bad.h5", compression="gzip", chunks=(300,))
    with h5py.File(path) as file:
        at = file["force_N"].id.get_chunk_info(1).byte_offset
    damage(path, at + 20)
    recording = open_recording(path)
    assert set(recording.channels) == {"time_s", "penetration_m"}
    assert recording.losses[0].startswith("force_N: cannot be read")


@pytest.mark.parametrize("write", [write_hdf5, write_mat73], ids=["hdf5", "matlab"])
def test_an_unwritten_array_takes_no_memory_and_is_reported(write, tmp_path):
    path = write(tmp_path / "fill.h5")
    with h5py.File(path, "r+") as file:
        for name, size, chunk, written in (
            ("huge", 10**10, 1000, 0),
            ("most", 600, 100, 450),
            ("some", 10**10, 1000, 1000),
        ):
            made = file.create_dataset(name, shape=(size,), dtype="f8", chunks=(chunk,))
            made.attrs["MATLAB_class"] = np.bytes_("double")
            made[:written] = 1.0
    recording = open_recording(path)
    assert set(recording.channels) == {*COLUMNS, "most"}
    assert recording.channels["most"][499:501].tolist() == [0.0, 0.0]
    assert recording.losses == (
        "huge: none of its 10000000000 values was written",
        "most: 1 of its 6 chunks were never written; they read as 0.0",
        "some: only 1 of its 10000000 chunks were written",
    )


@pytest.mark.parametrize("at", [132, 160, 164, 188], ids=["element", "rows", "columns", "data"])
def test_sizes_that_a_matlab_file_only_claims_take_no_memory(at, tmp_path):
    path = write_mat5(tmp_path / "claims.mat", {"force": np.arange(100.0)})
    content = bytearray(path.read_bytes())
    content[at : at + 4] = b"\xff\xff\xff\x7f"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"claims|ends in it|too early|nothing in it"):
        open_recording(path)


def test_channels_that_are_not_series_of_numbers_are_skipped(tmp_path):
    odd = {
        "cells: holds cells": np.array([1.0, "a"], dtype=object),
        "complex: holds complex": np.arange(5) * 1j,
        "cube: has 3 dim": np.zeros((3, 4, 5)),
        "empty: holds no": np.zeros((0, 3)),
        "image: is a matrix or an image, 300 by 400": np.zeros((300, 400)),
        "sparse: is a sparse matrix": scipy.sparse.eye(50).tocsc(),
    }
    named = {words.partition(":")[0]: values for words, values in odd.items()}
    path = write_mat5(tmp_path / "odd.mat", {**named, "force": np.arange(5.0)})
    recording = open_recording(path)
    assert set(recording.channels) == {"force"}
    for words in odd:
        assert words in " ".join(recording.omissions)


def test_a_matlab_object_is_skipped_with_a_remedy(tmp_path):
    path = write_mat73(tmp_path / "object.mat", {"force": np.arange(5.0)})
    with h5py.File(path, "r+") as file:
        made = file.create_dataset("ts", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], np.uint32))
        made.attrs["MATLAB_class"] = np.bytes_("timeseries")
        made.attrs["MATLAB_object_decode"] = np.int32(3)
    recording = open_recording(path)
    assert set(recording.channels) == {"force"}
    assert "save s = struct('time', ts.Time, 'data', ts.Data) instead" in recording.omissions[0]


def test_links_out_of_a_group_are_not_followed(tmp_path):
    path = write_hdf5(tmp_path / "links.h5")
    with h5py.File(path, "r+") as file:
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/x")
        file.create_group("a")["above"] = file["/"]
        file["gone"] = h5py.SoftLink("/nowhere")
    recording = open_recording(path)
    assert set(recording.channels) == set(COLUMNS)
    assert recording.omissions == ("elsewhere: links to another file; open that file",)
    assert recording.losses[0].startswith("gone: cannot be read")


SUFFIXES = [suffix for each in FORMATS if each.extra for suffix in each.suffixes]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_wrong_suffix_is_refused_in_one_line(suffix, tmp_path):
    file = io.BytesIO()
    np.savez(file, a=np.zeros(3))  # a zip
    path = tmp_path / f"probe{suffix}"
    for content in (b"", b"time_s,force_N\n0,1\n", file.getvalue(), bytes(999)):
        path.write_bytes(content)
        with pytest.raises(RecordingError) as refusal:
            open_recording(path)
        assert len(str(refusal.value).splitlines()) == 1
        assert path.name in str(refusal.value)
    (tmp_path / f"folder{suffix}").mkdir()
    for name, words in (("folder", "folder"), ("absent", "check the path")):
        with pytest.raises(RecordingError, match=words):
            open_recording(tmp_path / f"{name}{suffix}")


VALUES = files.values(120, seed=4, finite=True)


def write_sqlite(path):
    folder = files.rosbag2(path.parent / "bag", files.wrenches_and_poses(VALUES))
    return (folder / "bag.db3").rename(path)


def write_text(path, encoding="utf-8"):
    text = "\n".join(",".join(map(repr, row)) for row in zip(*COLUMNS.values(), strict=True))
    content = (",".join(COLUMNS) + "\n" + text + "\n").encode(encoding)
    path.write_bytes(gzip.compress(content, mtime=0) if path.suffix == ".gz" else content)
    return path


DAMAGED = {
    "a.csv": write_text,
    "a.csv.gz": write_text,
    "a.tsv": partial(write_text, encoding="utf-16"),
    "a.parquet": write_parquet,
    "a.feather": partial(write_feather, chunksize=100),
    "a.h5": partial(write_hdf5, compression="gzip", chunks=(100,)),
    "a.mat": partial(write_mat5, do_compression=True),
    "a.xlsx": lambda path: pandas.DataFrame(COLUMNS).to_excel(path, index=False) or path,
    "a.npz": lambda path: np.savez(path, **COLUMNS) or path,
    "a.jsonl": lambda path: (
        pandas.DataFrame(COLUMNS).to_json(path, orient="records", lines=True) or path
    ),
    "a.bag": lambda path: files.rosbag1(path, files.wrenches_and_poses(VALUES, ros1=True)),
    "a.db3": write_sqlite,
    "a.mcap": lambda path: files.wrench_mcap(path, VALUES, chunk_size=4000),
    "a.jpk-force-map": lambda path: write_jpk(path, CURVE),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_refused_or_read_with_a_warning(name, tmp_path):
    path = DAMAGED[name](tmp_path / name)
    whole, clean = path.read_bytes(), open_recording(path)
    size, chance = len(whole), random.Random(name)
    damaged = {
        f"cut after {cut}": whole[:cut] for cut in (1, 8, size // 3, size * 2 // 3, size - 1)
    }
    damaged["noise at the begin"] = chance.randbytes(16) + whole[16:]
    damaged["a hole"] = whole[: size // 2] + bytes(size // 8) + whole[size // 2 + size // 8 :]
    for k in range(12):
        at = chance.randrange(size)
        flipped = bytes([whole[at] ^ 1 << chance.randrange(8)])
        damaged[f"bit flipped at {at}, {k}"] = whole[:at] + flipped + whole[at + 1 :]
    for what, content in damaged.items():
        path.write_bytes(content)
        refused = None
        try:
            found = open_recording(path)
        except RecordingError as error:
            refused = str(error)
        if refused is not None:
            assert len(refused.splitlines()) == 1, what
            assert path.name in refused, what
            continue
        lengths = {name: len(values) for name, values in found.channels.items()}
        whole_still = lengths == {name: len(values) for name, values in clean.channels.items()}
        said = found.losses or found.faults or found.omissions
        # Of text any beginning is a good file too, and a digit or a name may change unseen.
        assert whole_still or said or name in ("a.csv", "a.tsv"), what


def test_a_force_map_that_lacks_its_calibration_is_refused(tmp_path):
    path = write_jpk(tmp_path / "map.jpk-force-map", CURVE)
    plain = tmp_path / "plain.jpk-force-map"
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(plain, "w") as target:
        for item in source.infolist():
            content = source.read(item)
            if item.filename.endswith(".properties"):
                content = content.replace(b"conversion.force.scaling.multiplier", b"nothing")
            target.writestr(item, content)
    with pytest.raises(RecordingError, match="is not calibrated"):
        open_recording(plain)


def test_a_missing_package_is_an_error_that_says_how_to_install_it(tmp_path, monkeypatch):
    path = write_hdf5(tmp_path / "probe.h5")

    def absent(name):
        raise ModuleNotFoundError("No module named 'h5py'", name="h5py")

    monkeypatch.setattr(errors, "import_module", absent)
    with pytest.raises(MissingExtraError, match=r"h5py.*pip install '\.\[recordings\]'"):
        open_recording(path)


def test_a_file_may_be_written_anew_while_its_path_stays(tmp_path):
    """Readers keep nothing of a file that they have read."""
    path = tmp_path / "map.jpk-force-map"
    for scale in (1, 2):
        write_jpk(tmp_path / "new", [(np.arange(200), scale * np.arange(200))])
        shutil.move(tmp_path / "new", path)
        force = open_recording(path).channels["force"]
        assert force[-1] / force[100] == pytest.approx(1.99)
        assert round(force[1] / 3.6e-13) == scale
