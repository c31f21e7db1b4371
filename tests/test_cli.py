"""The command line, as a user meets it: what it prints, writes and returns."""

import json
import subprocess
import sys

import pytest
from recordings import SIGNALS, rows_of, text_of, written

import palpate
from palpate.digits import with_error


@pytest.fixture
def identified(run, good):
    """The JSON of an identification of the good recording with some options."""

    def call(*options, file=good) -> dict:
        status, out, err = run("identify", file, "--json", *options)
        assert (status, err) == (0, "")
        return json.loads(out, parse_constant=pytest.fail)

    return call


def law_of(whole: dict) -> dict:
    [result] = whole["results"]
    return result["law"]


def test_identify_prints_a_table_that_a_person_reads(run, good):
    status, out, err = run("identify", good)
    assert (status, err) == (0, "")
    assert "600 samples" in out
    assert "variable-" in out
    result = palpate.identify(palpate.prepare(good))
    law, errors = result.law, result.standard_errors
    for symbol, value, error in zip(law.symbols, law.parameters, errors, strict=True):
        assert f"{symbol} = {with_error(value, error)}" in out
    assert "N/mⁿ" in out


def test_compare_prints_every_method_the_same_each_time(run, good):
    status, out, err = run("compare", good)
    assert (status, err) == (0, "")
    assert all(method in out for method in palpate.ESTIMATORS)
    assert run("compare", good) == (0, out, "")


MEASURES = ("prediction_rmse_percent", "fit_rmse_percent", "violated_fraction")


def test_json_is_one_object_of_the_agreed_shape_with_the_numbers_of_the_library(run, good):
    status, out, err = run("compare", good, "--json")
    assert (status, err) == (0, "")
    whole = json.loads(out)
    assert (whole["file"], whole["samples"]) == (str(good), 600)
    printed = {result["method"]: result for result in whole["results"]}
    results = palpate.compare(palpate.prepare(good))
    assert printed == {method: result.as_dict() for method, result in results.items()}
    assert sorted(printed) == sorted(palpate.ESTIMATORS)
    for method, result in printed.items():
        law = palpate.ESTIMATORS[method].law_type
        assert list(result["law"]) == ["kind", *law.names()]
        assert result["law"]["kind"] == law.kind
        assert list(result["standard_errors"]) == law.names()
        assert all(isinstance(result["law"][name], float) for name in law.names())
        assert all(error >= 0.0 for error in result["standard_errors"].values())
        assert all(result[m] is None or isinstance(result[m], float) for m in MEASURES)
        assert (result["violated_fraction"] is None) == (law.kind != "hunt-crossley")
        assert all(isinstance(flag, str) for flag in result["flags"])


def test_json_says_beyond_that_only_how_the_numbers_were_made(identified):
    """So that a field that goes, comes or changes its name is noticed."""
    whole = identified()
    assert sorted(whole) == [
        "file", "findings", "gate", "palpate_version", "provenance", "results", "samples", "scale",
        "schema_version", "surface_deviation", "tare_deviation", "touches",
    ]  # fmt: skip
    assert sorted(whole["gate"]) == ["break_force", "make_force", "minimum_penetration"]
    assert sorted(whole["scale"]) == ["force", "penetration", "velocity"]
    [result] = whole["results"]
    assert sorted(result) == sorted([
        "changes", "contact_samples", "flags", "law", "method", "standard_errors", "offset",
        "offset_standard_error", *MEASURES, "verdict", "working_depth", "working_depths",
        "findings", "episodes", "rejected_samples", "correlations", "restitution", "energy",
        "passivity", "law_verdict", "small_oscillation",
    ])  # fmt: skip


def test_json_of_what_is_not_defined_is_null(identified, tmp_path):
    path = written(tmp_path / "short.csv", text_of(rows_of(SIGNALS[:50])))
    [result] = identified(file=path)["results"]
    assert result["prediction_rmse_percent"] is None


def test_columns_are_mapped(identified, tmp_path):
    rows = [[*row, repr(v)] for row, v in zip(rows_of(), SIGNALS.velocity.tolist(), strict=True)]
    path = written(tmp_path / "m.csv", text_of(rows, ("t", "depth", "Fz", "speed")))
    given = ["--time", "t", "--penetration", "depth", "--force", "Fz", "--velocity", "speed"]
    expected = palpate.identify(palpate.Contact(**vars(SIGNALS))).law
    assert law_of(identified(*given, file=path)) == {"kind": "hunt-crossley", **expected.as_dict()}


def test_a_time_window_is_cut_and_a_velocity_window_is_taken(identified):
    assert identified("--start", "0.1", "--stop", "0.3")["samples"] == 201
    assert identified("--start", "0.5")["samples"] == 100
    assert law_of(identified()) != law_of(identified("--velocity-window", "0.05"))


def test_the_gate_is_set(identified):
    whole = identified("--min-force", "21.5", "--min-penetration", "0.0105")
    gate = {"minimum_penetration": 0.0105, "make_force": 21.5, "break_force": 21.5}
    assert whole["gate"] == gate
    firm = (SIGNALS.force > 21.5) & (SIGNALS.penetration > 0.0105)
    assert 0 < firm.sum() < 600
    assert whole["results"][0]["contact_samples"] == firm.sum()


def test_a_process_of_its_own_fails_with_its_status_and_a_line_on_standard_error(tmp_path):
    command = [sys.executable, "-c", "from palpate.cli import main; main()", "identify"]
    failed = subprocess.run([*command, tmp_path / "absent.csv"], capture_output=True, check=False)
    assert (failed.returncode, failed.stdout, failed.stderr.count(b"\n")) == (2, b"", 1)
