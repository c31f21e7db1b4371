"""What is written to a file of groups or columns comes back to the last bit, on its clock."""

from functools import partial

import h5py
import numpy as np
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

from palpate import RecordingError, prepare
from palpate.recordings import Recording, open_recording

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
def test_numbers_come_back_to_the_last_bit_and_only_those_asked_for(name, tmp_path):
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
    with pytest.raises(RecordingError, match=r"none of the .* nothing; there are .*force_N"):
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
    assert "by its size" in recording.notes["sensor/stamp"]
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


def test_units_in_the_description_of_a_column_and_the_index_of_pandas_are_read(tmp_path):
    pandas = pytest.importorskip("pandas")
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
    pytest.importorskip("afmformats")
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
    assert recording.omissions == ("height (piezo): this file has none",)


def test_one_curve_alone_needs_no_choice_and_comes_back_through_hdf5_and_text(tmp_path):
    afmformats = pytest.importorskip("afmformats")
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
