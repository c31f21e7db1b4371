"""Many contacts to a table, a row for each; and what rows say together: repeats, maps, the page."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from fleets import LAW, STEP, contact, curves, rows, write_recordings

import palpate
from palpate import (
    FleetError,
    GeneralisedHuntCrossley,
    InvalidParameterError,
    RelaxationSpectrum,
    VariableProjection,
    identify,
    identify_many,
)
from palpate.findings import Check, Finding
from palpate.fleet.files import Results, list_sources, read_results
from palpate.fleet.maps import (
    describe_flag,
    format_values,
    kinds_of,
    map_of,
    outliers_of,
    reasons_of,
    repeats_of,
    rig_lag_of,
    slowest,
    verdicts_of,
)  # fmt: skip
from palpate.fleet.rows import finding_cell, table_of_rows
from palpate.fleet.running import identify_batch
from palpate.fleet.tasks import ContactSource, Settings, batches, sources_digest, tasks_table
from palpate.identification.checks import NEGATIVE_STIFFNESS
from palpate.method.estimators.estimate import ADVICE


def cell(severity, check, message):
    """A finding in a row."""
    mark = "trust" if severity == "note" else severity
    return finding_cell(Finding(check, message, severity=severity, stiffness=mark, damping=mark))


def texts(row):
    """The messages of a row's flags."""
    return [flag["message"] for flag in row["flags"] or ()]


RELAXING = GeneralisedHuntCrossley(
    K=4000.0, n=1.3, B=0.0, p=1.3, relaxation=RelaxationSpectrum((0.05, 0.2), (3000.0, 2000.0))
)


def relaxing_contact():
    time, [x], [v] = STEP * np.arange(3000), *curves(1, samples=3000)[:2]
    x, v = x + 4e-3, np.asarray(v)  # in contact most of the time
    steps = np.full(x.size, STEP)
    noise = np.random.default_rng(3).normal(0.0, 0.01, x.size)
    force = RELAXING.force_along(x, v, steps) + noise
    return palpate.Contact(time, penetration=x, velocity=v, force=force, source="touch")


@pytest.mark.parametrize("touch", [contact(), relaxing_contact()], ids=["plain", "relaxing"])
def test_a_row_says_what_identify_says(touch):
    [row] = identify_many([touch], diagnosis="full").to_pylist()
    result = identify(touch)
    assert [row[name] for name in result.law.names()] == result.law.parameters.tolist()
    errors = [row[f"{name}_standard_error"] for name in result.law.names()]
    assert errors == result.standard_errors.tolist()
    assert (row["method"], row["frequency"]) == (result.method, result.frequency)
    if result.law.remembers:
        assert row["law_name"].endswith("with relaxation")
        assert row["relaxed_stiffness"] == result.relaxed_stiffness().value
    else:
        assert row["law_name"] == "hunt-crossley"
        assert row["p"] == row["n"]
        assert np.isnan(row["relaxed_stiffness"])
    there = result.diagnosis.working_depth
    assert row["depth"] == there.depth
    for name in ("force", "stiffness", "damping"):
        quantity = getattr(there, name)
        assert row[name] == quantity.value
        assert row[f"{name}_standard_error"] == quantity.standard_error
        assert row[f"{name}_systematic"] == quantity.systematic
    assert row["verdict_stiffness"] == result.stiffness.mark
    assert row["checked"] == "full"
    assert row["largest_depth"] == result.largest_depth
    assert row["flags"] == [finding_cell(each) for each in result.findings]
    assert (row["source"], row["index"], row["error"]) == ("touch", 0, None)
    assert (row["version"], row["fit"]) == (palpate.__version__, "recursion")


def test_columns_have_units_and_what_is_not_known_is_nan_or_null():
    table = identify_many([contact()])
    schema = table.schema
    assert schema.field("K").metadata[b"unit"] == "N/mⁿ".encode()
    assert schema.field("surface").metadata[b"unit"] == b"m"
    assert b"unit" not in schema.field("n").metadata
    assert all(field.metadata[b"description"] for field in schema)
    assert json.loads(schema.metadata[b"settings"])["method"] == "auto"
    assert table.to_pylist()[0]["findings"] is not None
    method = VariableProjection(offset=False)
    [row] = identify_many([contact()], diagnosis="none", method=method).to_pylist()
    unknown = ["x", "y", "z", "surface", "surface_standard_error", "stiffness_systematic"]
    assert all(np.isnan(row[name]) for name in [*unknown, "offset"])
    assert [row[name] for name in ("verdict_stiffness", "findings", "part", "error")] == [None] * 4


def test_a_contact_that_fails_is_a_row_with_its_reason(tmp_path):
    absent = tmp_path / "absent.csv"
    table = identify_many([contact(), absent, contact().window(0.0, 0.001), 7])
    rows = table.to_pylist()
    assert [row["index"] for row in rows] == [0, 1, 2, 3]
    assert rows[0]["error"] is None
    assert "absent.csv" in rows[1]["error"]
    assert rows[1]["error_kind"] == "RecordingError"
    assert "no contact found" in rows[2]["error"]
    assert rows[3]["error_kind"] == "InvalidParameterError"
    assert all(np.isnan(row["K"]) for row in rows[1:])


def test_arrays_are_fitted_together_as_the_recursion_fits_each():
    x, v, f = curves(6)
    table = fitted(x, v, f, source="touches", places={"x": list(range(6))})
    for k, row in enumerate(table):
        own = identify(one(x[k], v[k], f[k]), method="variable-projection")
        assert (row["source"], row["index"], row["fit"]) == ("touches", k, "whole-curve")
        assert row["x"] == k
        for name, value, error in zip(
            own.law.names(), own.law.parameters, own.standard_errors, strict=True
        ):
            # The recursion lies within a tenth of an error of the whole curve's minimum.
            assert abs(row[name] - value) < 0.1 * error
        there = own.diagnosis.working_depth
        assert row["depth"] == pytest.approx(there.depth, rel=0.02)  # gates differ in a sample
        assert row["largest_depth"] == own.largest_depth
        assert row["checked"] == "none"
        assert_at_depth(row)


def fitted(x, v, f, surface=None, **options):
    clock = {} if "time" in options else {"sample_time": STEP}
    options = {"method": searching(surface), "diagnosis": "none", **clock, **options}
    return identify_many(penetration=x, velocity=v, force=f, **options).to_pylist()


def searching(surface="estimate", **settings):
    return VariableProjection(surface=surface, **settings)


def one(x, v, f):
    return palpate.Contact(STEP * np.arange(x.size), penetration=x, velocity=v, force=f)


def assert_at_depth(row):
    """The stiffness there is that of the law, within five errors of at most 2 %."""
    error = row["stiffness_standard_error"]
    expected = LAW.stiffness_at(row["depth"])
    assert abs(row["stiffness"] - expected) < 5.0 * error
    assert error < 0.02 * expected


searching_or_not = pytest.mark.parametrize("surface", [None, "estimate"])


@searching_or_not
def test_a_row_that_says_nothing_says_so_and_spoils_no_other(surface):
    x, v, f = curves(5)
    x[1], v[1] = 3e-3, 0.0  # a probe that is held
    x[2] = np.nan
    x[3], f[3] = -1e-3 + 1e-7 * np.arange(x.shape[1]), 0.0
    f[4, 100:110] = np.nan
    rows = fitted(x, v, f, surface)
    [alone] = fitted(x[:1], v[:1], f[:1], surface)
    assert rows[0]["K"] == alone["K"]
    for row in rows[2:4]:
        assert row["error"] is not None
        assert row["covariance"] is None
        assert np.isnan(row["stiffness"])
    assert surface or "no contact found" in rows[3]["error"]
    assert rows[4]["error"] is None
    assert rows[4]["samples"] == x.shape[1] - 10
    assert_at_depth(rows[4])


@searching_or_not
def test_times_that_do_not_increase_are_an_error_whatever_is_checked(surface):
    x, _, f = curves(3)
    time = np.tile(STEP * np.arange(x.shape[1]), (3, 1))
    time[1, 100] = time[1, 99]
    rows = fitted(x, None, f, surface, time=time)
    assert [row["error"] is None for row in rows] == [True, False, True]
    assert "increase within a segment; sample 100 is 0.099 s after 0.099 s" in rows[1]["error"]
    assert np.isnan(rows[1]["K"])


@searching_or_not
@pytest.mark.parametrize("spoil", ["spiked", "clipped"])
def test_identify_many_rejects_outliers_like_identify(spoil, surface):
    x, v, f = curves(1)
    rounded = fitted(x, v, np.round(f / 0.2) * 0.2, surface)  # no end of the range
    assert not any("excluded" in flag for flag in texts(rounded[0]))
    if spoil == "spiked":
        f[0, [120, 330]] += 5.0
        x[0, 140] += 2e-3
    else:
        f[0] = np.minimum(f[0], 0.9 * f[0].max())
    [row] = fitted(x, v, f, surface)
    assert any("excluded as outliers" in flag for flag in texts(row))
    assert_at_depth(row)
    [all_of_it] = fitted(x, v, f, method=searching(surface, outlier_rejection=False))
    assert not any("excluded" in flag for flag in texts(all_of_it))
    error = row["stiffness_standard_error"]
    assert all_of_it["stiffness_standard_error"] > 5.0 * error


@searching_or_not
def test_a_force_of_the_wrong_sign_is_refused_or_flagged(surface):
    x, v, f = curves(1)
    [row] = fitted(x, v, -f, surface)
    assert row["error"] or any("negative stiffness" in flag for flag in texts(row))


def test_the_checks_see_the_penetration_below_the_surface_that_was_found():
    """4 mN at 5 mm is a soft material; at 50 mm, most of it through the air, a wrong unit."""
    x, v, f = curves(1)
    options = {"method": searching(surface_range=(0.04, 0.05))}
    options |= {"diagnosis": "input", "preparation": {"surface": "estimate"}}
    [row] = fitted(x + 0.045, v, 1e-3 * f, **options)
    assert row["surface"] == pytest.approx(0.045, abs=1e-4)
    assert row["findings"] == []


def test_identify_many_uses_the_working_depth_of_identify():
    """What a law leaves is no noise: a gate by it would call only the deepest samples firm."""
    x, v, f = curves(1)
    f += 0.3 * np.sin(3e3 * x) * (x > 0.0)
    [row] = fitted(x, v, f)
    own = identify(one(x[0], v[0], f[0]), trace=False)
    assert row["depth"] == pytest.approx(own.depths[0], rel=0.02)
    assert row["residual"] > 0.05


def test_rows_of_a_gated_recursion_are_those_of_identify():
    names = ["good", "negative damping", "spiked", "few samples", "brief", "no velocity"]
    names += ["wrong sign of the velocity", "infinite", "absurd", "too short", "nothing", "free"]
    rate, time = 4.0 * np.pi, STEP * np.arange(400)
    wave = 1e-3 * np.sin(rate * time) + 5e-4 * np.sin(5.3 * rate * time)
    speed = 1e-3 * rate * np.cos(rate * time) + 2.65e-3 * rate * np.cos(5.3 * rate * time)
    x, v = np.tile(4e-3 + wave, (12, 1)), np.tile(speed, (12, 1))
    force = LAW.force(x, v) + np.random.default_rng(11).normal(0.0, 0.01, x.shape)
    force[1] = palpate.HuntCrossley(K=4000.0, B=-3000.0, n=1.3).force(x[1], v[1])
    force[2, 200] *= 3.0
    force[3, 25:] = np.nan
    x[4, 100:] = -1e-3
    v[5, 100] = np.nan
    v[6] *= -1.0
    force[7, 100], force[8, 100], force[9, 3:], force[10] = np.inf, 1e200, np.nan, np.nan
    x[11] -= 1.0
    rows = fitted(x, v, force, method="single-stage", diagnosis="input")
    flags = {name: " ".join(texts(row)) for name, row in zip(names, rows, strict=True)}
    assert "negative damping" in flags["negative damping"]
    assert "excluded as outlier" in flags["spiked"]
    assert "only 25 samples" in flags["few samples"]
    assert "less than 0.2 s" in flags["brief"]
    assert "|v| ≥ 0.1 K/B in" in flags["wrong sign of the velocity"]
    assert "rejected" in flags["no velocity"]
    assert [row["error"] is None for row in rows] == [True] * 10 + [False] * 2
    assert "no contact found" in rows[11]["error"]
    for k, row in enumerate(rows[:10]):
        there = np.isfinite(x[k]) & np.isfinite(force[k])
        channels = {"penetration": x[k], "velocity": v[k], "force": force[k]}
        channels = {name: values[there] for name, values in channels.items()}
        touch = palpate.prepare(time=STEP * np.flatnonzero(there), **channels)
        own = identify(touch, "single-stage")
        assert [row[name] for name in own.law.names()] == own.law.parameters.tolist()
        assert row["covariance"] == own.covariance.reshape(-1).tolist()
        assert row["flags"] == [finding_cell(each) for each in own.findings]
        assert row["taken"] == np.count_nonzero(own.trace.taken)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"penetration": np.ones((2, 3))}, "pass contacts, or the arrays"),
        ({"penetration": np.ones((2, 3)), "force": np.ones((2, 4)), "sample_time": 1.0}, "shape"),
        ({"penetration": np.ones((2, 3)), "force": np.ones((2, 3))}, "either time or sample_time"),
        ({"contacts": [], "force": np.ones((2, 3))}, "not contacts and force"),
        ({"contacts": [], "diagnosis": "some"}, "diagnosis must be none, input or full"),
        ({"contacts": [], "preparation": {"tares": 1}}, "no setting tares"),
    ],
)
def test_impossible_queries_are_refused(options, words):
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
    for name in ("source", "K", "B", "n", "flags", "error"):
        assert named.column(name).to_pylist() == held.column(name).to_pylist()


def test_a_worker_of_another_version_is_refused():
    with pytest.raises(FleetError, match=r"by palpate 9\.9; install the same version"):
        identify_batch(tasks_table([], [], []), Settings(version="9.9"))
    with pytest.raises(InvalidParameterError, match="source, kind and index"):
        identify_batch(pa.table({"file": ["a"]}), Settings())


def test_batches_hold_every_contact_once_and_keep_chunks_whole():
    sources = [
        ContactSource("a.zarr", "zarr", 10_007, 1000, 300),
        *(ContactSource(f"{k}.csv", "file") for k in range(70)),
        ContactSource("m.jpk-force-map", "map", 65),
    ]
    work = [source.seconds("input", whole_curve=source.kind != "file") for source in sources]
    cut = batches(sources, work)
    found = sorted((batch.first, batch.end) for batch in cut)
    assert [first for first, _ in found] == [0, *(end for _, end in found[:-1])]
    assert found[-1][1] == 10_007 + 70 + 65
    rows = [row for batch in sorted(cut, key=lambda b: b.first) for row in batch.table.to_pylist()]
    assert [row["index"] for row in rows] == [*range(10_007), *[None] * 70, *range(65)]
    assert all(first % 300 == 0 for first, _ in found if first < 10_007)
    again = zip(cut, batches(sources, work), strict=True)
    assert all(one.table.equals(other.table) for one, other in again)
    changed = [*sources[:-1], ContactSource("m.jpk-force-map", "map", 65, stamp="later")]
    assert sources_digest(changed) != sources_digest(sources)


@pytest.mark.parametrize("diagnosis, most", [("none", 0.5), ("input", 0.2), ("full", 0.1)])
def test_many_short_curves_are_divided_among_the_workers(diagnosis, most):
    """2000 curves of 200 samples: no task is more than a part of one worker's share."""
    source = ContactSource("a.zarr", "zarr", 2000, 200, 2000)
    work = source.seconds(diagnosis, whole_curve=diagnosis != "full")
    seconds = [batch.seconds for batch in batches([source], [work], workers=2)]
    assert max(seconds) < most * 0.5 * sum(seconds)
    assert max(seconds) <= 1.0
    assert min(seconds[:-1]) > 0.04  # or the overhead of a task would count


def force_maps():
    beside = Path(__file__).parents[3] / "shared" / "data"
    folder = Path(os.environ.get("PALPATE_DATA", beside)) / "afm_maps"
    return sorted(folder.glob("*.jpk-force-map"))


@pytest.mark.skipif(not force_maps(), reason="no force maps in PALPATE_DATA")
def test_curves_of_a_force_map_are_rows_with_their_places():
    settings = Settings(tip=palpate.Sphere(5e-6))
    batch = tasks_table([str(force_maps()[0])] * 4, ["map"] * 4, [2, 0, 1, 9])
    rows = identify_batch(batch, settings).to_pylist()
    assert [row["index"] for row in rows] == [2, 0, 1, 9]
    assert [row["error"] is None for row in rows] == [True, True, True, False]
    assert "no curve 9; choose one" in rows[3]["error"]
    for row in rows[:3]:
        assert row["fit"] == "approach"
        assert row["n"] == 1.5
        assert 0.0 < row["surface_standard_error"] < row["largest_depth"]
        assert abs(row["x"]) < 2e-3  # the stage's travel
        assert row["verdict_stiffness"] == row["verdict_modulus"] is not None
    assert identify_batch(batch.slice(1, 1), settings).to_pylist()[0]["x"] == rows[1]["x"]


def test_repeats_agree_as_often_as_their_errors_say():
    """χ² of normal repeats: z is standard normal, by the cube root to a tenth already for two."""
    random = np.random.default_rng(3)
    error = random.uniform(1.0, 5.0, 4000)
    value = 1000.0 + error * random.normal(size=4000)
    x = np.repeat(np.arange(1000.0), 4)
    zs = [each.z for each in repeats_of(rows(value, error, x=x), "stiffness")]
    assert len(zs) == 1000
    assert abs(np.mean(zs)) < 0.15
    assert 0.9 < np.std(zs) < 1.1
    assert np.mean([z > 3.0 for z in zs]) < 0.01
    found = repeats_of(rows(value, error / 5.0, x=x), "stiffness")
    assert np.mean([each.agree for each in found]) < 0.15
    assert 4.0 < np.median([each.ratio for each in found]) < 5.0  # of three degrees: 0.89 × 5


def test_repeats_are_of_one_folder_where_no_place_is_known():
    [found] = repeats_of(rows([10.0, 11.0, 12.0], [1.0] * 3), "stiffness")
    assert (found.name, found.count, found.mean) == ("this folder", 3, 11.0)
    assert found.error == pytest.approx(3.0**-0.5)
    [found] = repeats_of(rows([10.0, 20.0, 30.0, np.nan], [1.0] * 4), "stiffness")
    assert (found.count, found.total) == (3, 4)
    assert found.error == pytest.approx(10.0 * 3.0**-0.5)  # their scatter is ten times their errors
    assert repeats_of(rows([10.0, 11.0], [1.0, 1.0], index=[0, 1]), "stiffness") == []


def rig(ratio, *, stiffness=(1000.0, 1400.0, 2500.0, 6000.0), frequency=12.0):
    damping = np.multiply(ratio, stiffness)
    table = {
        "stiffness": list(stiffness),
        "frequency": list(np.broadcast_to(frequency, len(stiffness))),
    }
    return rows(damping, 0.01 * np.abs(damping), quantity="damping", **table)


def test_a_constant_damping_ratio_is_a_lag_of_the_rig():
    lag = rig_lag_of(rig([0.031, 0.0325, 0.032, 0.030]))
    assert lag.time == pytest.approx(0.0315)
    assert (lag.files, lag.span) == (4, 6.0)
    text = str(lag)
    assert "31.5 ± 1.1 ms" in text
    assert "early by as much, or all materials have one loss tangent" in text
    assert text.endswith("(palpate skew), or try --delay -31.5ms+-1.1ms")
    other = str(rig_lag_of(rig([-0.01] * 4, frequency=[6.0, 12.0, 6.0, 12.0])))
    assert "late" in other
    assert other.endswith("--delay 10ms+-0.2ms")
    assert "loss tangent" not in other  # it would differ between the two frequencies


@pytest.mark.parametrize(
    "ratio, stiffness",
    [
        ([0.02, 0.03, 0.04, 0.03], (1000.0, 1400.0, 2500.0, 6000.0)),
        ([0.03] * 4, (1000.0, 1100.0, 1200.0, 1300.0)),
        ([0.03] * 3, (1000.0, 2500.0, 6000.0)),
    ],
    ids=["other ratios", "one stiffness", "three files"],
)
def test_a_lag_of_the_rig_needs_four_files_of_several_stiffnesses(ratio, stiffness):
    assert rig_lag_of(rig(ratio, stiffness=stiffness)) is None


def test_outliers_are_named_and_an_uncertain_value_is_none():
    value, error = np.full(40, 1000.0) + np.arange(40.0), np.full(40, 5.0)
    value[7], value[9] = 5000.0, 5000.0
    error[9] = 5000.0
    [found] = outliers_of(rows(value, error))
    assert (found.name, found.quantity, found.value) == ("touch-007.csv", "stiffness", 5000.0)


def test_a_fleet_counts_findings_and_lists_slow_sources():
    few = [cell("note", Check.EXCITATION, f"only {k} samples") for k in (12, 7, 8)]
    found = kinds_of([[few[0], cell("note", Check.SPIKES, "a")], few[1:], None], describe_flag)
    assert found[0] == ("only … samples", 2, "only 12 samples")
    made = [{"source": f"{k}.csv", "error": f"{k}.csv: row {k} is no number"} for k in range(3)]
    [(kind, count, first)] = reasons_of(table_of_rows(made, Settings()))
    assert (kind, count, first) == ("row … is no number", 3, "0.csv")
    times = pa.table({"source": ["a", "b", "a"], "index": [0, None, 1], "seconds": [1.0, 1.5, 1.0]})
    assert slowest(times) == [("a", 2.0, 2), ("b", 1.5, 1)]


def grid(side=6, **others):
    x, y = (each.reshape(-1) for each in np.meshgrid(*[1e-3 * np.arange(side)] * 2))
    value = 1000.0 + 1e5 * x
    value[3] = np.nan
    return rows(value, np.full(side**2, 20.0), x=x.tolist(), y=y.tolist(), **others)


def test_a_map_has_values_and_errors_over_places():
    found = map_of(grid(), ["x", "y"])
    assert found.places.shape == (36, 2)
    assert (found.units, found.unit, np.isnan(found.value).sum()) == (("m", "m"), "N/m", 1)
    assert "median 1200 ± 20 N/m" in found.summary
    assert "; 1 place has no value" in found.summary
    law = {"K": 4000.0, "B": 50.0, "n": 1.3}
    row = {"depth": 2e-3, "covariance": [100.0**2, *[0.0] * 8], **law}

    def at_5_mm(*depths):
        made = [{"x": 1e-3 * k, "largest_depth": each, **row} for k, each in enumerate(depths)]
        table = table_of_rows(made, Settings(method="variable-projection"))
        return map_of(table, ["x"], of="force", depth=5e-3)

    found = at_5_mm(6e-3, 4e-3)
    assert found.value[0] == pytest.approx(4000.0 * 5e-3**1.3)
    assert found.error[0] == pytest.approx(100.0 * 5e-3**1.3)
    assert "at 5 mm" in found.summary
    assert np.isnan(found.value[1])
    assert "1 place was not pressed to this depth" in found.summary
    found = at_5_mm(np.nan, np.nan)
    assert "none of 2 places has a force at 5 mm; 2 places were not pressed" in found.summary


def test_a_map_has_the_dynamic_stiffness_of_each_row():
    touch = relaxing_contact()
    table = identify_many([touch])
    [row] = table.to_pylist()
    found = map_of(table, ["index"], depth=row["depth"])
    assert found.value[0] == pytest.approx(row["stiffness"])
    assert found.value[0] > 1.2 * row["relaxed_stiffness"]
    deeper = map_of(table, ["index"], of="damping", depth=0.99 * row["largest_depth"])
    expected = identify(touch).at(0.99 * row["largest_depth"]).damping.value
    assert deeper.value[0] == pytest.approx(expected)


def test_a_map_marks_places_with_untrusted_numbers():
    """By a verdict where there is one, else by what the checks of the data found, or by flags."""
    table = rows(
        [1.0, 2.0, 3.0, 4.0],
        [0.1] * 4,
        x=[0.0, 1.0, 2.0, 2.0],
        y=[0.0, 1.0, 2.0, 2.0],
        findings=[
            [cell("do-not-trust", "signs", "...")],
            [cell("with-care", "spikes", "...")],
            [cell("note", "tare", "")],
            None,
        ],
        verdict_stiffness=[None, None, "do-not-trust", "trust"],
        flags=[[], [finding_cell(ADVICE[2])], [], []],
    )
    found = map_of(table, ["x", "y"])
    assert found.mistrusted.tolist() == [True, False, True, False]
    assert map_of(table, ["x"], of="damping").mistrusted.tolist() == [True, True, False, False]
    for words in (
        "do not trust, signs: at 1 of 4 places", "with care, spikes: at 1", "1 place repeats",
    ):  # fmt: skip
        assert words in found.summary
    assert "tare" not in found.summary
    pulls = rows([1.0], [0.1], x=[0.0], flags=[[finding_cell(NEGATIVE_STIFFNESS)]])
    assert map_of(pulls, ["x"]).mistrusted.all()
    uncertain = rows([1.0, 1.0], [2.0, 0.1], x=[0.0, 1.0])
    assert map_of(uncertain, ["x"]).mistrusted.tolist() == [True, False]
    unchecked = rows([1.0], [0.1], x=[0.0], checked=["none"])
    assert "data not checked" in map_of(unchecked, ["x"]).summary


@pytest.mark.parametrize(
    "by, words",
    [
        (["x", "w"], "no column 'w'"),
        (["z"], "column z is empty; columns with values: x, y"),
        (["source"], "holds no numbers"),
        (["x", "y", "z"], "one or two columns"),
        (["x", "x"], "one or two columns"),
    ],
)
def test_a_map_over_what_is_not_there_is_refused(by, words, refused, tmp_path):
    with pytest.raises(InvalidParameterError, match=words):
        map_of(grid(), by)
    assert "holds no results of palpate fleet" in refused("map", tmp_path)


def written(folder, table):
    sources = [ContactSource("all", "file")]
    [batch] = batches(sources, [1.0])
    Results.begin(folder, Settings(), sources).write(batch, table, np.ones(table.num_rows))
    return folder


@pytest.mark.parametrize("by", ["x,y", "x"])
def test_maps_are_drawn(printed, tmp_path, by):
    folder = written(tmp_path / "results", grid())
    figure = tmp_path / "map.svg"
    out = printed("map", folder, "--by", by, "--figure", figure, "--width", "88mm")
    assert "of 35 places" in out
    text = figure.read_text()
    assert "stiffness [kN/m]" in text
    assert "standard error" in text


def test_scattered_places_are_drawn_as_dots():
    from palpate.fleet.figures import draw_map

    random = np.random.default_rng(2)
    value = np.r_[random.uniform(100.0, 200.0, 30), np.nan]
    x, y = random.uniform(0.0, 0.05, (2, 31)).tolist()
    for findings, labels in (
        ([[]] * 31, ["no value"]),
        ([[cell("do-not-trust", "signs", "")]] * 2 + [[]] * 29, ["no value", "not to be trusted"]),
    ):
        table = rows(value, np.full(31, 3.0), x=x, y=y, findings=findings)
        for by in (["x", "y"], ["x"]):
            left = draw_map(map_of(table, by)).axes[0]
            assert sorted(left.get_legend_handles_labels()[1]) == labels
            if len(by) == 2:
                assert len(left.collections[0].get_offsets()) == 30
                assert len(left.lines[0].get_xdata()) == 1


@pytest.mark.long
def test_the_page_says_what_there_is_and_leaves_the_rest_out(tmp_path, monkeypatch):
    from palpate.fleet.report import fleet_page

    table = grid(flags=[[cell("note", Check.EXCITATION, "only 3 samples in contact")]] * 36)
    failed = [{"source": "<b>.csv", "error": "<b>.csv: it is damaged", "error_kind": "X"}]
    folder = written(tmp_path / "r", pa.concat_tables([table, table_of_rows(failed, Settings())]))
    page = fleet_page(folder)
    for words in ("Identified values", "Map of the material", "only … samples", "it is damaged"):
        assert words in page
    assert "&lt;b&gt;.csv" in page
    assert "<b>.csv" not in page
    assert "Outliers" not in page
    assert "<h2>Findings" not in page
    assert "not checked" not in page
    monkeypatch.setattr("palpate.output.reports.html.drawing", lambda *_: iter(()))
    unchecked = written(tmp_path / "n", rows([1.0] * 6, [0.1] * 6, checked=["none"] * 6))
    assert "palpate checked neither the data nor the fits" in fleet_page(unchecked)
    assert read_results(folder).num_rows == 37


def judged(count):
    """Rows of a full diagnosis: one failed, two not to be trusted, one with care, the rest well."""
    verdicts = ["do-not-trust", "do-not-trust", "with-care", *["trust"] * (count - 4)]
    findings = [
        [
            cell("with-care", "tare", "the tare is uncertain"),
            cell("do-not-trust", "signs", "3 samples pull"),
        ],
        [cell("do-not-trust", "signs", "4 samples pull")],
        [cell("with-care", "spikes", "there are spikes")],
        *[[cell("note", "tare", "the tare is good")]] * (count - 4),
    ]
    table = rows(
        range(1, count), [0.1] * (count - 1), verdict_stiffness=verdicts, findings=findings
    )
    failed = {"source": "bad.csv", "error": "bad.csv: no column 'force_N'", "error_kind": "X"}
    return pa.concat_tables([table, table_of_rows([failed], Settings())])


REASONS = [
    "failed: bad.csv: no column 'force_N'",
    "stiffness, damping do not trust: touch-000.csv: signs: 3 samples pull (and 1 more)",
    "stiffness, damping with care: touch-002.csv: spikes: there are spikes",
]


@pytest.mark.parametrize("count", [30, 31])
def test_a_fleet_above_30_rows_prints_counts_and_the_worst(count, printed, run, tmp_path):
    folder = tmp_path / "results"
    write_recordings(tmp_path / "all", 1)
    sources = list_sources([tmp_path / "all"])
    [batch] = batches(sources, [1.0])
    settings = Settings(diagnosis="full")  # the default for recordings
    Results.begin(folder, settings, sources).write(batch, judged(count), np.ones(count))
    lines = printed("fleet", tmp_path / "all", "-o", folder).splitlines()
    assert lines[0] == "1 of 1 contact reused from an earlier run"
    assert lines[-1 - (count > 30)] == f"results: {folder}"
    if count == 30:
        assert lines[1].split() == ["contact", "stiffness", "mark", "mark"]
        assert " ".join(lines[2].split()).startswith("touch-000.csv 1.00 ± 0.10 N/m do not trust")
        assert lines[31].split() == ["bad.csv", "–", "failed", "failed"]
        assert lines[32:35] == REASONS
        assert len(lines) == 36
    else:
        assert lines[1] == "31 rows"
        assert lines[2] == "stiffness: 1 failed, 2 do not trust, 1 with care, 27 trust"
        assert lines[4:7] == REASONS
        assert lines[-1].startswith("for all reasons, repeat the command with --report")
        assert len(lines) == 9
    assert run("fleet", tmp_path / "all", "-o", folder, "--fail-on", "do-not-trust")[0] == 3


def test_a_row_without_a_verdict_has_the_severity_of_its_findings():
    flags = [[], [cell("note", Check.EXCITATION, "only 3 samples in contact")]]
    flags += [[finding_cell(NEGATIVE_STIFFNESS)], [], []]
    findings = [[], [], [], [cell("note", "a", "b"), cell("with-care", "spikes", "two")], []]
    checked = [*["input"] * 4, "none"]
    table = rows([1.0] * 5, [0.1] * 5, flags=flags, findings=findings, checked=checked)
    assert [verdict[:2] for verdict in verdicts_of(table, "stiffness")] == [
        ("no-finding", ""),
        ("flagged", "only 3 samples in contact"),
        ("do-not-trust", str(NEGATIVE_STIFFNESS)),
        ("with-care", "spikes: two"),
        ("not-checked", ""),
    ]
    uncertain = rows([300.0], [3.0], stiffness_systematic=[4.0])
    assert format_values(uncertain, "stiffness") == ["300 ± 5 N/m"]
