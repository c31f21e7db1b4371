"""The command line, as a user meets it: what it prints, writes, returns and completes."""

import json
import logging
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from cyclopts.completion.detect import ShellDetectionError
from recordings import SIGNALS, rows_of, text_of, written
from rich.cells import cell_len

import palpate
from palpate.cli.application import COMMANDS
from palpate.digits import with_error
from palpate.results.saved import as_toml


@pytest.fixture
def identified(printed, good):
    """The JSON of an identification of the good recording with some options."""

    def call(*options, file=good) -> dict:
        out = printed("identify", file, "--json", *options)
        return json.loads(out, parse_constant=pytest.fail)

    return call


def law_of(whole: dict) -> dict:
    [result] = whole["results"]
    return result["law"]


def test_identify_prints_a_table_that_a_person_reads(printed, good):
    out = printed("identify", good)
    assert "600 samples" in out
    assert "variable-" in out
    result = palpate.identify(palpate.prepare(good))
    law, errors = result.law, result.standard_errors
    for symbol, value, error in zip(law.symbols, law.parameters, errors, strict=True):
        assert f"{symbol} = {with_error(value, error)}" in out
    assert "N/mⁿ" in out


def test_compare_prints_every_method_the_same_each_time(run, printed, good):
    out = printed("compare", good)
    assert all(method in out for method in palpate.ESTIMATORS)
    assert run("compare", good) == (0, out, "")


MEASURES = ("prediction_rmse_percent", "fit_rmse_percent", "violated_fraction")


def test_json_is_one_object_of_the_agreed_shape_with_the_numbers_of_the_library(printed, good):
    whole = json.loads(printed("compare", good, "--json"))
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


#: A Python union, or the name of a module, has no place in front of a user.
PYTHON = re.compile(r"Union|Optional|Literal|NoneType|typing\.|palpate\.\w|\bNone\b|\bTrue\b|False")


@pytest.mark.parametrize(
    "command, columns", [*((command, 40) for command in (*COMMANDS, "")), ("live", 100), ("", 100)]
)
def test_help_fits_the_terminal_and_shows_an_example(printed, monkeypatch, command, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    out = printed(*command.split(), "--help")
    assert max(map(cell_len, out.split("\n"))) <= columns
    assert not PYTHON.search(out)
    assert "…" not in out.replace("--exponent …", "")
    assert out.startswith("Usage: palpate")
    assert re.search("in a file.*--config.*Any command.*--no-color.*--verbose", out, re.DOTALL)
    if command:
        assert re.search(rf"^ palpate {command} ", out, re.MULTILINE)
    else:
        assert all(re.search(rf"│ {each} +[A-Z]\w+", out) for each in COMMANDS)


def test_verbose_says_on_standard_error_what_is_done_and_how_long_it_took(run, good):
    quiet = run("identify", good)
    assert quiet[2] == ""
    status, out, err = run("identify", good, "-v")
    assert (status, out) == quiet[:2]
    for words in (
        f"read {good}: 3 channels of 600 samples", "force is force_N (it has this name)",
        "velocity by the filter: ", "replay: ", "diagnosis: ",
    ):  # fmt: skip
        assert words in err
    assert "channel force_N" not in err
    assert all(line[:7].strip().replace(".", "").isdigit() for line in err.splitlines())
    for twice in (["identify", good, "-vv"], ["-v", "identify", "--verbose", good, "--no-color"]):
        more = run(*twice)[2]
        assert "channel force_N" in more
        assert "search for delay" in more
    assert logging.getLogger("palpate").level == logging.NOTSET


def test_a_file_of_options_may_say_that_a_flag_is_off(run, good, tmp_path):
    text = as_toml({"changes": False, "dark": False, "flip-force": False}, ())
    path = written(tmp_path / "run.toml", text)
    assert run("identify", good, "--config", path) == run("identify", good)


COMPLETED = {
    "palpate i": ["identify", "info"],
    "palpate identify --me": ["--method"],
    "palpate identify x.csv --no-c": ["--no-color"],
    "palpate identify --method s": ["single-stage"],
    "palpate identify --fail-on w": ["with-care"],
    "palpate identify --surface ba": ["baseline"],
    "palpate lab ball --trajectory ta": ["tapping"],
    "palpate lab inc": ["inclusion"],
}
TYPED = """
source {script}
function=$(complete -p palpate | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
while read -r -a COMP_WORDS; do
  COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 ))
  COMPREPLY=()
  $function palpate "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD - 1]}}"
  echo "${{COMPREPLY[*]}}"
done
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home in which no shell was ever used."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name in ("ZSH", "ZSH_CUSTOM", "XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / "home"


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_commands_options_and_their_values(run, tmp_path, home):
    script = tmp_path / "palpate.bash"
    status, out, err = run("--install-completion", "--shell", "bash", "-o", script)
    assert (status, out, err) == (0, f"completion: {script}\n", "")
    assert not home.exists()  # that file, and nothing else
    typed = "\n".join(COMPLETED) + "\n"
    done = subprocess.run(
        ["bash", "-c", TYPED.format(script=script)],
        input=typed, capture_output=True, text=True, check=True,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert [line.split() for line in done.stdout.splitlines()] == list(COMPLETED.values())


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_gets_its_completion_where_it_looks_for_it(printed, home, shell):
    out = printed("--install-completion", "--shell", shell)
    [path] = [p for p in home.rglob("*") if p.is_file() and "--method" in p.read_text()]
    assert str(path) in out


def test_a_completion_that_cannot_be_made_is_one_line(refused, good, home, monkeypatch):
    unknown = Mock(side_effect=ShellDetectionError)
    monkeypatch.setattr("cyclopts.completion.detect.detect_shell", unknown)
    refused("--install-completion", "--shell", "bash", "-o", good / "x")
    assert "name it with --shell" in refused("--install-completion")
