"""A result is saved, read back and shown, and what is wrong is said in a line."""

import functools
import json
import operator
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest

import palpate
from palpate.errors import RecordingError
from palpate.input.recordings import table_files
from palpate.output.reports import identification

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
BALL = EXAMPLES / "ball.csv"


def same(one, other) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def test_saved_results_are_read_back_exactly(ball, saved):
    found = palpate.load_result(saved)
    assert found.law == ball.law
    assert same(found.standard_errors, ball.standard_errors)
    assert same(found.correlations, ball.correlations)
    assert found.verdict == ball.diagnosis.verdict
    assert [repr(each) for each in found.findings] == [repr(e) for e in ball.diagnosis.findings]
    assert found.working_depths == ball.working_depths
    for name in ("time", "penetration", "velocity", "force", "segment"):
        assert same(getattr(found.contact, name), getattr(ball.contact, name))
    assert len(found.trace.parameters) == 2000
    for name in ball.trace.__dataclass_fields__:
        assert same(getattr(found.trace, name), getattr(ball.trace, name)), name
    assert found.contact.provenance == ball.contact.provenance
    assert palpate.identify(found.contact).law == ball.law
    [trace] = saved.glob("trace.*")  # a recording too
    assert palpate.identify(trace).law == ball.law
    assert palpate.open_recording(trace).units["K_standard_error"] == "N/mⁿ"


def test_the_result_is_what_json_prints(ball, saved, run):
    printed = json.loads(run("identify", BALL, "--json")[1])
    written = json.loads((saved / "result.json").read_text(encoding="utf-8"))
    assert written.pop("trace").startswith("trace.")
    assert set(written.pop("trace_digest")) == {"bytes", "sha256"}
    assert written.pop("file") == printed.pop("file")
    assert written == printed


def test_a_folder_may_be_named_like_a_file(ball, saved, tmp_path):
    folder = tmp_path / "ball.json"
    shutil.copytree(saved, folder)
    assert palpate.load_result(folder).law == ball.law
    assert palpate.load_result(folder / "result.json").law == ball.law


def test_saved_options_repeat_standard_input(ball, tmp_path, undrawn):
    identification.Destination(tmp_path).save(ball, options={"method": ball.method})
    assert "palpate identify - --config" in (tmp_path / "report.html").read_text("utf-8")


def test_the_command_writes_the_same_and_its_options_repeat_it(run, tmp_path, undrawn):
    options = ["--start", "2.5", "--at", "9mm", "--method", "single-stage"]
    assert run("identify", BALL, *options, "-o", tmp_path)[0] == 0
    taken = tomllib.loads((tmp_path / "run.toml").read_text(encoding="utf-8"))
    assert taken == {"method": "single-stage", "at": "9mm", "start": 2.5}
    printed = run("identify", BALL, "--config", tmp_path / "run.toml", "--json")[1]
    again = json.loads(printed)["results"][0]
    found = palpate.load_result(tmp_path)
    assert again["law"] == {"kind": "hunt-crossley", **found.law.as_dict()}
    assert again["working_depth"]["depth"] == pytest.approx(9e-3)


@pytest.mark.long
def test_a_result_replaces_only_files_that_palpate_wrote(run, refused, good, undrawn):
    folder = good.parent / "results"
    folder.mkdir()
    for name in ("report.html", "run.toml", "result.json"):
        (folder / name).write_text("mine", encoding="utf-8")
        line = refused("identify", good, "-o", folder)
        assert f"{name}: palpate did not write this file" in line
        assert [(path.name, path.read_text()) for path in folder.iterdir()] == [(name, "mine")]
        (folder / name).unlink()
    assert run("identify", good, "-o", folder)[0] == 0
    (folder / "result.json").unlink()  # as if interrupted before it
    for _ in range(2):
        assert run("identify", good, "-o", folder)[0] == 0


def test_a_trace_that_is_read_is_not_written_over(refused, saved):
    [trace] = saved.glob("trace.*")
    before = trace.read_bytes()
    assert "this is an input file" in refused("identify", trace, "-o", saved)
    assert trace.read_bytes() == before


@pytest.mark.parametrize(
    "spoil, words",
    [
        (lambda folder: (folder / "result.json").unlink(), "No such file"),
        (lambda folder: (folder / "result.json").write_text("{"), "not JSON"),
        (lambda folder: (folder / "result.json").write_text("[1]"), "no schema_version"),
        (
            lambda folder: change(folder, schema_version=3),
            f"has schema 3, but palpate {palpate.__version__} reads schema 4",
        ),
        (lambda folder: change(folder, results=[]), "damaged"),
        (lambda folder: change(folder, findings=[{"wrong": 1}]), "damaged"),
        (lambda folder: change(folder, trace="trace.hdf5"), "trace.hdf5"),
        (lambda folder: change(folder, trace="../ball.csv"), "../ball.csv"),
        (lambda folder: change(folder, provenance=3), "damaged"),
        (lambda folder: lose(folder, "verdict", "damping"), "is not a verdict of palpate"),
        (lambda folder: lose(folder, "working_depths", 0, "force"), "damaged"),
        (lambda folder: next(folder.glob("trace.*")).write_bytes(b""), "trace."),
        (lambda folder: next(folder.glob("trace.*")).write_text("a,b\n1,2\n"), "trace."),
    ],
)
def test_a_damaged_result_is_one_line(saved, tmp_path, spoil, words):
    shutil.copytree(saved, tmp_path, dirs_exist_ok=True)
    spoil(tmp_path)
    with pytest.raises(RecordingError, match=re.escape(words)) as raised:
        palpate.load_result(tmp_path)
    assert "\n" not in str(raised.value)


def test_frequency_relaxed_stiffness_and_limits_are_saved(tmp_path, undrawn):
    result = palpate.identify(faults.remembering(0.1, 1.0))
    result.save(tmp_path)
    found = palpate.load_result(tmp_path)
    assert found.frequency == result.frequency
    assert found.relaxed_stiffness == result.relaxed_stiffness()
    assert found.working_depths == result.working_depths
    whole = json.loads((tmp_path / "result.json").read_text())
    limits = whole["results"][0]["limits"]
    for name, limit in zip(("stiffness", "damping"), result.diagnosis.limits, strict=True):
        assert limits[name] == (None if limit is None else limit.as_dict())


@pytest.mark.parametrize("parquet", [True, False])
def test_the_trace_of_another_run_is_refused(ball, tmp_path, monkeypatch, undrawn, parquet):
    monkeypatch.setattr(identification, "has_pyarrow", lambda: parquet)
    shifted = replace(ball.contact, force=ball.contact.force + 1e-12)  # of the same length
    for folder, each in (("one", ball), ("other", palpate.identify(shifted))):
        each.save(tmp_path / folder)
        assert same(palpate.load_result(tmp_path / folder).contact.force, each.contact.force)
    [trace] = (tmp_path / "other").glob("trace.*")
    shutil.copy(trace, tmp_path / "one")
    with pytest.raises(
        RecordingError, match=rf"result\.json: {trace.name} has changed or is from another run"
    ):
        palpate.load_result(tmp_path / "one")


def change(folder: Path, **fields) -> None:
    file = folder / "result.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **fields}))


def lose(folder: Path, *way) -> None:
    """Make a part of the result null."""
    file = folder / "result.json"
    whole = json.loads(file.read_text())
    *outer, last = way
    functools.reduce(operator.getitem, outer, whole["results"][0])[last] = None
    file.write_text(json.dumps(whole))


def test_a_folder_that_cannot_be_made_is_said_before_the_work(refused, tmp_path, monkeypatch):
    monkeypatch.setattr("palpate.identifying.identify", None)  # no work without this
    taken = tmp_path / "taken"
    taken.write_text("a file")
    assert str(taken) in refused("identify", BALL, "-o", taken)
    if os.geteuid():
        tmp_path.chmod(0o500)
        assert "Permission denied" in refused("identify", BALL, "-o", tmp_path / "inside")


WITHOUT_MATPLOTLIB = """
import sys
sys.modules["matplotlib"] = None
import palpate, palpate.live.page.server
from palpate.cli import main
assert "trust" in palpate.identify(sys.argv[1])._repr_html_()
sys.argv[1:1] = ["identify"]
main()
"""


@pytest.mark.long
@pytest.mark.parametrize("option, extra", [("--figure", "figures"), ("-o", "report")])
def test_without_matplotlib_only_figures_fail(option, extra, tmp_path):
    words = [sys.executable, "-c", WITHOUT_MATPLOTLIB, BALL, option, tmp_path / "a.svg"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert f".[{extra}]" in done.stderr


def test_a_table_has_an_ending_that_is_known(tmp_path):
    with pytest.raises(palpate.InvalidParameterError, match=r"\.parquet or \.csv"):
        table_files.write_columns({"a": np.zeros(3)}, tmp_path / "a.xlsx")


def test_the_representation_is_a_line_and_the_summary_a_page(ball):
    assert repr(ball).startswith(
        "<Identification of ball.csv by Hunt–Crossley: stiffness 2000.7 ± "
    )
    assert " N·s/m at 8.78 mm, 1.58 Hz (trust)>" in repr(ball)
    words = ball.summary()
    for each in (
        "trust",
        "2000.7 ± 0.6 ± 0.5",
        "17.56 ± 0.05 ± 0.04",
        "2011 ± 5",
        "0.996",
        "95 % interval",
    ):
        assert each in words
    assert max(map(len, words.splitlines())) < 120


def test_the_frame_has_the_clock_and_what_was_known(ball):
    pytest.importorskip("pandas")
    frame = ball.to_pandas()
    assert frame.index.name == "time"
    assert len(frame) == len(ball.contact)
    assert same(frame["K"].to_numpy()[ball.trace.after], ball.trace.parameters[:, 0])
    assert frame["K"].count() == len(ball.trace.after)
    assert same(frame["fitted_force"], ball.fitted_force)
    assert frame["status"].iloc[-1] == "updated"
    assert frame.attrs["units"]["velocity"] == "m/s"


def test_the_dataset_has_the_parameters_along_a_dimension(ball):
    pytest.importorskip("xarray")
    data = ball.to_xarray()
    exponent = data.parameters.sel(parameter="n")
    assert same(exponent, ball.trace.everywhere(ball.trace.parameters[:, 2]))
    assert same(data.covariance, ball.covariance)
    assert data.force.attrs["units"] == "N"
    assert data.attrs["law"] == "hunt-crossley"
