"""Many contacts to a table: a row for each, whatever it is."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from fleets import LAW, STEP, contact, curves, mixed_touches, write_recordings, write_zarr

import palpate
from palpate import (
    FleetError,
    InvalidParameterError,
    SingleStageRLS,
    VariableProjection,
    identify,
    identify_many,
)
from palpate.fleet.batch import identify_batch
from palpate.fleet.settings import Settings
from palpate.fleet.tasks import Source, batches, digest_of, tasks_table

pa = pytest.importorskip("pyarrow")


def test_a_row_says_what_identify_says():
    touch = contact()
    table = identify_many([touch], diagnosis="full")
    [row] = table.to_pylist()
    result = identify(touch)
    assert [row[name] for name in result.law.names()] == result.law.parameters.tolist()
    errors = [row[f"{name}_standard_error"] for name in result.law.names()]
    assert errors == result.standard_errors.tolist()
    there = result.diagnosis.working_depth
    assert row["depth"] == there.depth
    for name in ("force", "stiffness", "damping"):
        quantity = getattr(there, name)
        assert row[f"{name}_at_depth"] == quantity.value
        assert row[f"{name}_at_depth_standard_error"] == quantity.standard_error
        assert row[f"{name}_at_depth_systematic"] == quantity.systematic
    assert row["verdict"] == result.diagnosis.verdict.overall
    assert row["checked"] == "full"
    assert row["largest_depth"] == result.largest_depth
    assert row["flags"] == list(result.flags)
    assert (row["source"], row["index"], row["error"]) == ("touch", 0, None)
    assert (row["version"], row["fit"]) == (palpate.__version__, "recursion")


def test_columns_have_units_and_the_table_its_settings():
    schema = identify_many([contact()]).schema
    assert schema.field("stiffness").metadata[b"unit"] == "N/mⁿ".encode()
    assert schema.field("surface").metadata[b"unit"] == b"m"
    assert b"unit" not in schema.field("exponent").metadata
    assert all(field.metadata[b"description"] for field in schema)
    assert json.loads(schema.metadata[b"settings"])["method"] == "variable-projection"


def test_what_is_not_known_is_nan_or_null():
    [row] = identify_many([contact()], diagnosis="none").to_pylist()
    unknown = ["x", "y", "z", "surface", "surface_standard_error", "stiffness_at_depth_systematic"]
    assert all(np.isnan(row[name]) for name in unknown)
    assert [row[name] for name in ("verdict", "findings", "part", "error")] == [None] * 4
    assert identify_many([contact()]).to_pylist()[0]["findings"] is not None
    [row] = identify_many([contact()], method=VariableProjection(offset=False)).to_pylist()
    assert np.isnan(row["offset"])


def test_errors_at_depth_are_about_those_of_the_diagnosis():
    """Both are of one law at one depth; those of the diagnosis are by blocks of the residual."""
    touch = contact()
    [plain] = identify_many([touch], diagnosis="none").to_pylist()
    [full] = identify_many([touch], diagnosis="full").to_pylist()
    for name in ("force", "stiffness", "damping"):
        assert plain[f"{name}_at_depth"] == pytest.approx(full[f"{name}_at_depth"], rel=1e-9)
        error, other = (r[f"{name}_at_depth_standard_error"] for r in (plain, full))
        assert 0.2 < error / other < 5.0  # of a second the blocks are few


def test_a_contact_that_fails_is_a_row_with_its_reason(tmp_path):
    absent = tmp_path / "absent.csv"
    table = identify_many([contact(), absent, contact().window(0.0, 0.001), 7])
    rows = table.to_pylist()
    assert [row["index"] for row in rows] == [0, 1, 2, 3]
    assert rows[0]["error"] is None
    assert "absent.csv" in rows[1]["error"]
    assert rows[1]["error_kind"] == "RecordingError"
    assert "never touches" in rows[2]["error"]
    assert rows[3]["error_kind"] == "InvalidParameterError"
    assert all(np.isnan(row["stiffness"]) for row in rows[1:])


def test_arrays_are_fitted_together_as_the_recursion_fits_each():
    x, v, f = curves(6)
    table = identify_many(
        penetration=x, velocity=v, force=f, sample_time=STEP, diagnosis="none", source="touches"
    )
    for k, row in enumerate(table.to_pylist()):
        touch = contact()
        own = identify(palpate.Contact(touch.time, penetration=x[k], velocity=v[k], force=f[k]))
        assert (row["source"], row["index"], row["fit"]) == ("touches", k, "whole-curve")
        for name, value, error in zip(
            own.law.names(), own.law.parameters, own.standard_errors, strict=True
        ):
            # The recursion lies within a tenth of an error of the whole curve's minimum.
            assert abs(row[name] - value) < 0.1 * error
        there = own.diagnosis.working_depth
        assert row["depth"] == pytest.approx(there.depth, rel=0.02)  # gates differ in a sample
        assert row["largest_depth"] == own.largest_depth
        assert row["checked"] == "none"
        error = row["stiffness_at_depth_standard_error"]
        expected = LAW.stiffness_at(row["depth"])
        assert abs(row["stiffness_at_depth"] - expected) < 5.0 * error
        assert error < 0.02 * expected


def test_a_row_of_arrays_without_contact_says_so_and_spoils_no_other():
    x, v, f = curves(3)
    x[1] = -1e-3 + 1e-7 * np.arange(x.shape[1])
    f[1] = 0.0
    f[2, 100:110] = np.nan
    rows = identify_many(penetration=x, velocity=v, force=f, sample_time=STEP).to_pylist()
    assert [row["error"] is None for row in rows] == [True, False, True]
    assert "never touches" in rows[1]["error"]
    assert rows[1]["covariance"] is None
    assert np.isnan(rows[1]["stiffness_at_depth"])
    assert rows[2]["samples"] == x.shape[1] - 10
    assert rows[2]["stiffness"] == pytest.approx(LAW.stiffness, rel=0.1)  # a tenth is ten errors


def test_arrays_take_the_recursion_where_the_whole_curve_fit_does_not_do():
    x, v, f = curves(2)
    options = {"penetration": x, "velocity": v, "force": f, "sample_time": STEP}
    for method, diagnosis, fit in (
        (SingleStageRLS(), "none", "recursion"),
        (None, "full", "recursion"),
    ):
        rows = identify_many(**options, method=method, diagnosis=diagnosis).to_pylist()
        assert {row["fit"] for row in rows} == {fit}
    assert {row["verdict"] for row in rows} <= {"trust", "with-care", "do-not-trust"}


def test_rows_of_a_gated_recursion_are_those_of_identify():
    x, v, force, names = mixed_touches()
    rows = identify_many(
        penetration=x, velocity=v, force=force, sample_time=STEP, method="single-stage"
    ).to_pylist()
    flags = {name: " ".join(row["flags"] or []) for name, row in zip(names, rows, strict=True)}
    assert "negative damping" in flags["negative damping"]
    assert "left out as an outlier" in flags["spiked"]
    assert "only 25 samples" in flags["few samples"]
    assert "less than 0.2 s" in flags["brief"]
    assert "condition 10 violated" in flags["wrong sign of the velocity"]
    assert "refused" in flags["no velocity"]
    for k, row in enumerate(rows):
        there = np.isfinite(x[k]) & np.isfinite(force[k])
        if row["error"] is not None:
            continue
        touch = palpate.prepare(
            time=STEP * np.flatnonzero(there),
            penetration=x[k][there],
            velocity=v[k][there],
            force=force[k][there],
        )
        own = identify(touch, "single-stage")
        assert [row[name] for name in own.law.names()] == own.law.parameters.tolist()
        assert row["covariance"] == own.covariance.reshape(-1).tolist()
        assert row["flags"] == list(own.flags)
        assert row["taken"] == np.count_nonzero(own.trace.taken)
    assert names[17] == "never touches"
    assert "never touches" in rows[17]["error"]


def test_places_come_with_their_rows():
    x, v, f = curves(2)
    table = identify_many(
        penetration=x, force=f, velocity=v, sample_time=STEP, places={"x": [1.0, 2.0]}
    )
    assert table.column("x").to_pylist() == [1.0, 2.0]


@pytest.mark.parametrize(
    "options, words",
    [
        ({}, "contacts must be given"),
        ({"penetration": np.ones((2, 3))}, "contacts must be given"),
        ({"penetration": np.ones((2, 3)), "force": np.ones((2, 4)), "sample_time": 1.0}, "shape"),
        ({"penetration": np.ones((2, 3)), "force": np.ones((2, 3))}, "time and sample_time"),
        ({"contacts": [], "force": np.ones((2, 3))}, "beside contacts"),
        ({"contacts": [], "diagnosis": "some"}, "diagnosis must be none, input or full"),
        ({"contacts": [], "method": "best"}, "method must be one of"),
        ({"contacts": [], "preparation": {"tares": 1}}, "no setting tares"),
    ],
)
def test_what_cannot_be_asked_is_refused(options, words):
    with pytest.raises(InvalidParameterError, match=words):
        identify_many(**options)


def test_a_batch_of_names_and_one_of_samples_give_the_same_numbers(tmp_path):
    write_recordings(tmp_path / "all", 2)
    paths = sorted(map(str, (tmp_path / "all").iterdir()))
    named = identify_batch(tasks_table(paths, ["file"] * 2, [None] * 2), Settings())
    channels = ("time", "penetration", "velocity", "force")
    touches = [palpate.prepare(path) for path in paths]
    samples = {name: [getattr(touch, name).tolist() for touch in touches] for name in channels}
    held = identify_batch(pa.table({"source": paths, **samples}), Settings())
    for name in ("source", "stiffness", "damping", "exponent", "flags", "error"):
        assert named.column(name).to_pylist() == held.column(name).to_pylist()


def test_a_batch_is_a_pure_function_of_what_it_names(tmp_path):
    write_zarr(tmp_path / "a.zarr", 6)
    name = str(tmp_path / "a.zarr")
    batch = tasks_table([name] * 6, ["zarr"] * 6, range(6))
    whole = identify_batch(batch, Settings())
    again = pa.concat_tables([identify_batch(batch.slice(k, 2), Settings()) for k in (0, 2, 4)])
    assert repr(whole.to_pylist()) == repr(again.to_pylist())  # NaN is not NaN
    assert whole.column("index").to_pylist() == list(range(6))


def test_a_worker_of_another_version_refuses():
    with pytest.raises(FleetError, match=r"palpate 9\.9 asks; install one version"):
        identify_batch(tasks_table([], [], []), Settings(version="9.9"))


def test_a_batch_without_its_columns_is_refused():
    with pytest.raises(InvalidParameterError, match="source, kind and index"):
        identify_batch(pa.table({"file": ["a"]}), Settings())


def test_batches_hold_every_contact_once_and_keep_chunks_whole():
    sources = [
        Source("a.zarr", "zarr", 10_007, 1000, 300),
        *(Source(f"{k}.csv", "file") for k in range(70)),
        Source("m.jpk-force-map", "map", 65),
    ]
    cut = batches(sources)
    found = [
        (piece.source.name, k)
        for batch in cut
        for piece in batch.pieces
        for k in range(piece.first, piece.first + piece.count)
    ]
    assert len(found) == len(set(found)) == 10_007 + 70 + 65
    assert [batch.number for batch in cut] == list(range(len(cut)))
    arrays = [batch.pieces[0] for batch in cut if batch.pieces[0].source.kind == "zarr"]
    assert all(piece.first % 300 == 0 for piece in arrays)
    assert batches(sources) == cut
    changed = [*sources[:-1], Source("m.jpk-force-map", "map", 65, stamp="later")]
    assert digest_of(changed) != digest_of(sources)


def force_maps():
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("PALPATE_DATA", beside)) / "afm_maps"
    return sorted(folder.glob("*.jpk-force-map"))


@pytest.mark.skipif(not force_maps(), reason="no force maps in PALPATE_DATA")
def test_curves_of_a_force_map_are_rows_with_their_places():
    pytest.importorskip("afmformats")
    surface = {"surface": "estimate"}
    settings = Settings(estimator={**surface, "exponent": 1.5}, preparation=surface)
    name = str(force_maps()[0])
    batch = tasks_table([name] * 4, ["map"] * 4, [2, 0, 1, 9])
    rows = identify_batch(batch, settings).to_pylist()
    assert [row["index"] for row in rows] == [2, 0, 1, 9]
    assert [row["error"] is None for row in rows] == [True, True, True, False]
    assert "there is no curve 9" in rows[3]["error"]
    for row in rows[:3]:
        assert row["fit"] == "whole-curve"
        assert row["exponent"] == 1.5
        assert row["surface_standard_error"] > 0.0
        assert abs(row["x"]) < 2e-3  # the stage's travel
        assert row["checked"] == "input"
        assert row["flags"] == []  # the tip went through far more air than into the sample
    assert identify_batch(batch.slice(1, 1), settings).to_pylist()[0]["x"] == rows[1]["x"]
