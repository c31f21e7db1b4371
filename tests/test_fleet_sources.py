"""What a fleet finds where people keep recordings: links, pipes, results, arrays in any shape."""

import os

import numpy as np
import pytest
from fleets import LAW, write_recordings, write_zarr

from palpate import RecordingError
from palpate.fleet.batch import identify_batch
from palpate.fleet.listing import sources_of
from palpate.fleet.results import MANIFEST
from palpate.fleet.settings import Settings
from palpate.fleet.stored import described_array
from palpate.fleet.tasks import tasks_table

pytest.importorskip("pyarrow")
zarr = pytest.importorskip("zarr")


def test_one_file_by_many_names_is_one_contact(tmp_path, monkeypatch):
    """Twice the same contact would halve the variance of a mean of repeats."""
    write_recordings(tmp_path / "all", 2)
    (tmp_path / "all" / "link.csv").symlink_to("touch-001.csv")
    (tmp_path / "all" / "loop").symlink_to(tmp_path / "all")
    monkeypatch.chdir(tmp_path)
    names = ["all", tmp_path / "all" / "touch-000.csv", "./all/../all", "all/*.csv"]
    assert len(sources_of(names)) == 2


def test_a_name_of_nothing_is_refused_beside_names_of_something(tmp_path):
    write_recordings(tmp_path / "all", 1)
    for nothing in ("other/*.csv", "al"):
        with pytest.raises(RecordingError, match=r"no recording here|no such file"):
            sources_of([tmp_path / "all", tmp_path / nothing])


def test_what_cannot_be_read_in_a_folder_is_a_row_with_its_reason(tmp_path):
    write_recordings(tmp_path / "all", 1)
    (tmp_path / "all" / "gone.csv").symlink_to("nowhere.csv")
    (tmp_path / "all" / "empty.zarr").mkdir()
    os.mkfifo(tmp_path / "all" / "pipe.csv")  # nobody writes to it
    sources = sources_of([tmp_path / "all"])
    table = tasks_table([s.name for s in sources], [s.kind for s in sources], [None] * 3)
    rows = identify_batch(table, Settings(diagnosis="none")).to_pylist()
    errors = {os.path.basename(row["source"]): row["error"] for row in rows}  # noqa: PTH119
    assert errors.pop("touch-000.csv") is None
    assert set(errors) == {"gone.csv", "empty.zarr"}
    assert all(errors.values())


def test_results_are_no_recordings(tmp_path):
    write_recordings(tmp_path / "all", 1)
    before = tmp_path / "all" / "before"
    before.mkdir()
    (before / MANIFEST).write_text("{}")
    (before / "part-000000.parquet").write_text("")
    assert len(sources_of([tmp_path / "all"])) == 1
    with pytest.raises(RecordingError, match="is the folder of the results"):
        sources_of([tmp_path / "all"], leave_out=tmp_path / "all")


def test_an_array_whose_numbers_are_written_anew_is_another(tmp_path):
    _, _, f = write_zarr(tmp_path / "a.zarr", 4)
    before = described_array(str(tmp_path / "a.zarr")).stamp
    assert described_array(str(tmp_path / "a.zarr")).stamp == before
    zarr.open_group(str(tmp_path / "a.zarr"), mode="a")["force"][:] = 2.0 * f
    assert described_array(str(tmp_path / "a.zarr")).stamp != before


def test_packed_numbers_are_unpacked(tmp_path):
    """As xarray writes them: with a factor, an offset, and a number for what is missing."""
    path = tmp_path / "packed.zarr"
    _, _, f = write_zarr(path, 2)
    group = zarr.open_group(str(path), mode="a")
    packed = np.round((f - 1.0) / 1e-4).astype("int32")
    packed[1, ::7] = -99999
    group.create_array("force", data=packed, overwrite=True)
    group["force"].attrs.update(scale_factor=1e-4, add_offset=1.0, _FillValue=-99999)
    table = tasks_table([str(path)] * 2, ["zarr"] * 2, [0, 1])
    rows = identify_batch(table, Settings(diagnosis="none")).to_pylist()
    for row in rows:
        assert abs(row["stiffness"] - LAW.stiffness) < 5.0 * row["stiffness_standard_error"]
    assert rows[1]["samples"] == f.shape[1] - len(range(0, f.shape[1], 7))


@pytest.mark.parametrize(
    "values, words",
    [
        (np.zeros((0, 600)), "holds no contact"),
        (np.zeros((4, 600), dtype=complex), "complex128, not of real numbers"),
    ],
)
def test_an_array_of_no_contacts_is_refused(values, words, tmp_path):
    group = zarr.open_group(str(tmp_path / "a.zarr"), mode="w")
    for name in ("penetration", "force"):
        group.create_array(name, data=values)
    with pytest.raises(RecordingError, match=words):
        described_array(str(tmp_path / "a.zarr"))
