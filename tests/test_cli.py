"""The command line, as a user meets it: what it prints, writes and returns."""

import json
import subprocess
import sys
from importlib import metadata

import numpy as np
import pytest
from recordings import HEADER, SIGNALS, recording, rows_of, text_of, written

import palpate
from palpate.digits import with_error

PYTHON = sys.executable


@pytest.fixture
def good(tmp_path):
    return recording(tmp_path)


def results_of(output: str) -> dict:
    """The one JSON object on standard output, by method."""
    return {result["method"]: result for result in json.loads(output)["results"]}


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


def test_compare_prints_every_method(run, good):
    status, out, err = run("compare", good)
    assert (status, err) == (0, "")
    for method in ("variable-", "single-stage", "double-stage", "kelvin-voigt", "extended-"):
        assert method in out
    assert "…" not in out  # a narrow terminal folds a name, and cuts nothing off


PARAMETERS = {name: kind.law_type.names() for name, kind in palpate.ESTIMATORS.items()}
KIND = {name: kind.law_type.kind for name, kind in palpate.ESTIMATORS.items()}
MEASURES = ("prediction_rmse_percent", "fit_rmse_percent", "violated_fraction")


def test_json_is_one_object_of_the_agreed_shape(run, good):
    status, out, err = run("compare", good, "--json")
    assert (status, err) == (0, "")
    whole = json.loads(out)
    assert whole["file"] == str(good)
    assert whole["samples"] == 600
    assert sorted(results_of(out)) == sorted(PARAMETERS)
    for method, result in results_of(out).items():
        names = PARAMETERS[method]
        assert list(result["law"]) == ["kind", *names]
        assert result["law"]["kind"] == KIND[method]
        assert list(result["standard_errors"]) == names
        assert all(isinstance(result["law"][name], float) for name in names)
        assert all(result["standard_errors"][name] >= 0.0 for name in names)
        assert all(result[m] is None or isinstance(result[m], float) for m in MEASURES)
        assert (result["violated_fraction"] is None) == (KIND[method] != "hunt-crossley")
        assert all(isinstance(flag, str) for flag in result["flags"])


def test_json_says_beyond_that_only_how_the_numbers_were_made(run, good):
    """So that a field that goes, comes or changes its name is noticed."""
    whole = json.loads(run("identify", good, "--json")[1])
    assert sorted(whole) == [
        "file", "gate", "palpate_version", "provenance", "remarks", "results", "samples", "scale",
        "schema_version", "surface_deviation", "tare_deviation", "touches",
    ]  # fmt: skip
    assert sorted(whole["gate"]) == ["break_force", "make_force", "minimum_penetration"]
    assert sorted(whole["scale"]) == ["force", "penetration", "velocity"]
    [result] = whole["results"]
    expected = ["changes", "contact_samples", "flags", "law", "method", "standard_errors"]
    expected += ["offset", "offset_standard_error", *MEASURES]
    expected += ["verdict", "working_depth", "working_depths", "findings", "episodes"]
    expected += ["rejected_samples", "correlations", "restitution", "energy", "passivity"]
    expected += ["law_verdict", "small_oscillation"]
    assert sorted(result) == sorted(expected)


def test_json_holds_the_numbers_of_the_library(run, good):
    results = palpate.compare(palpate.prepare(good))
    printed = results_of(run("compare", good, "--json")[1])
    assert printed == {method: result.as_dict() for method, result in results.items()}


def test_json_of_what_is_not_defined_is_null(run, tmp_path):
    path = written(tmp_path / "short.csv", text_of(rows_of(SIGNALS[:50])))
    status, out, _ = run("identify", path, "--json")
    [result] = json.loads(out, parse_constant=pytest.fail)["results"]
    assert status == 0
    assert result["prediction_rmse_percent"] is None


@pytest.mark.parametrize("method", PARAMETERS)
def test_identify_takes_one_method(run, good, method):
    status, out, _ = run("identify", good, "--method", method, "--json")
    assert status == 0
    assert list(results_of(out)) == [method]


def test_columns_are_mapped(run, tmp_path):
    rows = [[*row, repr(v)] for row, v in zip(rows_of(), SIGNALS.velocity.tolist(), strict=True)]
    path = written(tmp_path / "m.csv", text_of(rows, ("t", "depth", "Fz", "speed")))
    status, out, _ = run(
        "identify", path, "--json", "--time", "t", "--penetration", "depth", "--force", "Fz",
        "--velocity", "speed",
    )  # fmt: skip
    assert status == 0
    contact = palpate.Contact(**vars(SIGNALS))
    expected = palpate.identify(contact).law
    law = results_of(out)["variable-projection"]["law"]
    assert law == {"kind": "hunt-crossley", **expected.as_dict()}


def test_a_time_window_is_cut(run, good):
    status, out, _ = run("identify", good, "--json", "--start", "0.1", "--stop", "0.3")
    assert status == 0
    assert json.loads(out)["samples"] == 201
    status, out, _ = run("identify", good, "--json", "--start", "0.5")
    assert json.loads(out)["samples"] == 100


def test_the_gate_is_set(run, good):
    whole = json.loads(
        run("identify", good, "--json", "--min-force", "21.5", "--min-penetration", "0.0105")[1]
    )
    gate = whole["gate"]
    assert gate == {"minimum_penetration": 0.0105, "make_force": 21.5, "break_force": 21.5}
    firm = (SIGNALS.force > 21.5) & (SIGNALS.penetration > 0.0105)
    assert 0 < firm.sum() < 600
    assert whole["results"][0]["contact_samples"] == firm.sum()


THRESHOLDS = [
    ("--min-force", 5.0, "make_force"),
    ("--min-penetration", 0.007, "minimum_penetration"),
]


@pytest.mark.parametrize("option, value, name", THRESHOLDS)
def test_a_threshold_that_is_not_given_is_chosen_from_the_data(run, good, option, value, name):
    method = ("--method", "single-stage")
    chosen = json.loads(run("identify", good, "--json", *method)[1])["gate"]
    gate = json.loads(run("identify", good, "--json", *method, option, value)[1])["gate"]
    assert gate[name] == value
    other = {"make_force": "minimum_penetration", "minimum_penetration": "make_force"}[name]
    assert gate[other] == chosen[other]


@pytest.mark.parametrize("option, value, name", THRESHOLDS)
def test_variable_projection_has_no_threshold_that_is_not_given(run, good, option, value, name):
    gate = json.loads(run("identify", good, "--json", option, value)[1])["gate"]
    assert gate.pop(name) == value
    assert gate["make_force" if name == "minimum_penetration" else "minimum_penetration"] == 0.0


def test_a_velocity_window_is_taken(run, good):
    laws = [
        results_of(run("identify", good, "--json", *extra)[1])["variable-projection"]["law"]
        for extra in ((), ("--velocity-window", "0.05"))
    ]
    assert laws[0] != laws[1]


def test_a_segment_column_parts_the_contacts(run, tmp_path):
    """The second contact's clock starts again, 4 mm away: no velocity is taken across that."""
    rows = rows_of(SIGNALS[:300])
    again = [[t, repr(float(x) + 4e-3), repr(float(f) + 8.0)] for t, x, f in rows]
    path = written(tmp_path / "w.csv", text_of(rows + again))
    assert run("identify", path, "--strict")[0] == 2
    again_found = run("identify", path, "--json", "--method", "kelvin-voigt")
    both = [[*row, "a"] for row in rows] + [[*row, "b"] for row in again]
    path = written(tmp_path / "s.csv", text_of(both, (*HEADER, "segment")))
    status, out, _ = run("identify", path, "--json", "--method", "kelvin-voigt")
    assert status == 0
    # A velocity across the border would be 4 mm in 1 ms; the ball stays 2000 N/m.
    stiffness = results_of(out)["kelvin-voigt"]["law"]["stiffness"]
    assert stiffness == pytest.approx(2000.0, rel=0.01)
    assert results_of(again_found[1])["kelvin-voigt"]["law"]["stiffness"] == stiffness


def test_the_version_is_the_packages(run):
    status, out, _ = run("--version")
    assert status == 0
    assert out.strip() == metadata.version("palpate")


def test_help_names_the_commands_and_their_options(run):
    status, out, _ = run("--help")
    assert status == 0
    assert "identify" in out
    assert "compare" in out
    _, out, _ = run("identify", "--help")
    for option in ("--method", "--figure", "--dark", "--json", "--time", "--min-force", "--stop"):
        assert option in out


def test_the_command_itself_returns_what_it_should(good, tmp_path):
    """In a process of its own: exit status, and nothing on the channel it does not belong to."""
    command = [PYTHON, "-c", "from palpate.cli import main; main()"]
    done = subprocess.run(
        [*command, "identify", good, "--json"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["samples"] == 600
    failed = subprocess.run(
        [*command, "identify", tmp_path / "absent.csv"], capture_output=True, text=True, check=False
    )
    assert (failed.returncode, failed.stdout) == (2, "")
    assert len(failed.stderr.splitlines()) == 1


def test_no_command_needs_matplotlib_unless_a_figure_is_asked_for(run, good, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "palpate.figures", raising=False)
    assert run("compare", good)[0] == 0
    status, out, err = run("compare", good, "--figure", good.with_suffix(".svg"))
    assert (status, out) == (2, "")
    assert "palpate[figures]" in err
    assert len(err.splitlines()) == 1


def test_what_is_printed_does_not_depend_on_the_run(run, good):
    assert run("compare", good) == run("compare", good)
    assert np.isfinite(
        json.loads(run("identify", good, "--json")[1])["results"][0]["fit_rmse_percent"]
    )


NO_TRUTH = {
    "deep": "[" * 100_000,
    "no law": '{"kind": "magic"}',
    "of a number beyond all floats": '{"kind": "kelvin-voigt", "damping": 1, "stiffness": 1%s}'
    % ("0" * 400),
}


@pytest.mark.parametrize("words", NO_TRUTH.values(), ids=NO_TRUTH)
def test_a_note_that_states_no_truth_is_passed_over(run, good, words):
    good.write_text(f"# truth: {words}\n{good.read_text()}")
    status, out, err = run("identify", good)
    assert (status, err) == (0, "")
    assert "600 samples" in out
    assert "truth" not in out
