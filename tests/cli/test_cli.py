"""The command line, as a user meets it: what it reads, prints, writes, returns and completes."""

import json
import logging
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from unittest.mock import Mock

import message_files as files
import numpy as np
import pytest
from cyclopts.completion.detect import ShellDetectionError
from recordings import HEADER, SIGNALS, recording, rows_of, text_of, written
from rich.cells import cell_len
from robots import hand, table_of

import palpate
from palpate.cli.application import COMMANDS
from palpate.digits import with_error
from palpate.input.channels.frames import rotate_to_base
from palpate.writing import as_toml


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
    result = palpate.identify(palpate.prepare(good))
    assert f" {result.estimate.samples} samples, 1 contact" in out
    assert "method" not in out  # the usual one
    assert "; method single-stage" in printed("identify", good, "--method", "single-stage")
    law, errors = result.law, result.standard_errors
    for symbol, value, error in zip(law.symbols, law.parameters, errors, strict=True):
        assert f"{symbol} = {with_error(value, error)}" in out
    assert "N/mⁿ" in out


def test_compare_prints_every_method_the_same_each_time(run, printed, good):
    out = printed("compare", good)
    assert all(method in out for method in palpate.ESTIMATORS)
    assert run("compare", good) == (0, out, "")


MEASURES = ("prediction_rmse_percent", "fit_rmse_percent", "violated_fraction")


@pytest.mark.long
def test_json_is_one_object_with_the_numbers_of_the_library(printed, good):
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
        "assumed_units", "delay", "file", "findings", "gate", "palpate_version", "provenance",
        "results", "samples", "scale", "schema_version", "stated_units", "surface_deviation",
        "tare_deviation", "timeless", "touches", "velocity_filter",
    ]  # fmt: skip
    assert sorted(whole["gate"]) == ["break_force", "make_force", "minimum_penetration"]
    assert sorted(whole["scale"]) == ["force", "penetration", "velocity"]
    [result] = whole["results"]
    assert sorted(result) == sorted([
        "changes", "contact_samples", "flags", "law", "method", "standard_errors", "offset",
        "offset_standard_error", *MEASURES, "verdict", "working_depth", "working_depths",
        "findings", "episodes", "rejected_samples", "correlations", "restitution", "energy",
        "passivity", "law_verdict", "small_oscillation", "frequency", "limits",
        "relaxed_stiffness",
    ])  # fmt: skip


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


def test_a_failing_process_prints_one_line_and_sets_its_status(tmp_path):
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
    assert re.search(
        "Configuration file.*--config.*Any command.*--no-color.*--verbose", out, re.DOTALL
    )
    if command:
        assert re.search(rf"^ palpate {command} ", out, re.MULTILINE)
    else:
        assert all(re.search(rf"│ {each} +[A-Z]\w+", out) for each in COMMANDS)


def test_verbose_logs_each_step_with_its_duration(run, good):
    quiet = run("identify", good)
    assert quiet[2] == ""
    status, out, err = run("identify", good, "-v")
    assert status == quiet[0]
    assert "95 % interval" in out
    assert "95 % interval" not in quiet[1]
    for words in (
        f"read {good}: 3 channels of 600 samples", "force is force_N (has this name)",
        "velocity by the filter: ", "replay: ", "diagnosis: ",
    ):  # fmt: skip
        assert words in err
    assert "channel force_N" not in err
    assert all(line[:7].strip().replace(".", "").isdigit() for line in err.splitlines())
    for twice in (["identify", good, "-vv"], ["-v", "identify", "--verbose", good, "--no-color"]):
        more = run(*twice)[2]
        assert "channel force_N" in more
        assert "find_delay: " in more
    assert logging.getLogger("palpate").level == logging.NOTSET


def test_a_file_of_options_may_say_that_a_flag_is_off(run, good, tmp_path):
    text = as_toml({"changes": False, "dark": False, "flip-force": False}, ())
    path = written(tmp_path / "run.toml", text)
    assert run("identify", good, "--config", path) == run("identify", good)


def test_common_options_may_stand_anywhere(run, tmp_path):
    options = written(tmp_path / "run.toml", "seconds = 2.5\nseed = 3")
    words = ["lab", "kelvin-voigt", "--K", "900", "--B", "9", "--probe", "ideal", "-o"]
    first = run("--config", options, *words, tmp_path / "first.csv")
    assert "seed 3" in first[1]
    for k, more in enumerate((["--config", options], [f"--config={options}", "--no-color"])):
        file = tmp_path / f"{k}.csv"
        assert run(*words, file, *more)[0] == 0
        assert file.read_bytes() == (tmp_path / "first.csv").read_bytes()
    assert "seconds" in run("lab", "--verbose", *words[1:], tmp_path / "v.csv", "--seconds")[2]


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


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    recorded = table_of(hand(4.0))
    path = tmp_path_factory.mktemp("robot") / "robot.csv"
    names = list(recorded.channels)
    values = np.column_stack([recorded.channels[name] for name in names])
    scale = np.array([1e3 if name.startswith("p") else 1.0 for name in names])
    header = ",".join(name.replace("_m", "_mm") for name in names)
    np.savetxt(path, values * scale, delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def test_a_robots_table_in_millimetres_needs_no_option(run, printed, robot):
    out = printed("identify", robot, "--json")
    assert "in mm" in json.loads(out)["provenance"]["penetration"]
    assert result_of(out)["working_depth"]["stiffness"]["value"] == pytest.approx(2e3, rel=0.02)
    assert "stiffness" in run("identify", robot, "--normal", "0.48,-0.36,0.8", "--tare", "find")[1]
    _, out, _ = run("identify", robot, "--start", "0.15", "--stop", "0.32", "-v")
    assert "tare: palpate found no free air" in out


def result_of(output: str) -> dict:
    return json.loads(output)["results"][0]


@pytest.mark.long
def test_a_named_position_keeps_the_orientation_of_its_topic(run, tmp_path):
    """Only the topics that are named are read; the wrench is in the tool's frame."""
    felt, maker = hand(2.0), files.Maker()
    turn = np.array([0.0, 0.2, 0.27, 0.0])  # by 39°
    turn[3] = np.sqrt(1.0 - turn @ turn)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(felt.time), 1))
    turns = np.tile(turn, (len(felt.time), 1))
    in_tool = rotate_to_base(felt.force, turns * [-1, -1, -1, 1])
    wrenches = np.hstack([in_tool, np.zeros_like(in_tool)])
    stamps = 1_700_000_000_000_000_000 + np.rint(1e9 * felt.time).astype(np.int64)
    given = files.Values(stamps, wrenches, np.hstack([felt.position, still]))
    messages = files.wrenches_and_poses(given, frame="tool", pose="/camera")
    for at, row in zip(stamps, np.hstack([felt.position, turns]), strict=True):
        messages.append(("/arm", "geometry_msgs/PoseStamped", int(at), maker.pose(at, row)))
    bag = files.rosbag2(tmp_path / "bag", messages)
    for named in (["/arm"], ["/arm", "--force", "/ft"], ["/arm.pose.position", "--force", "/ft"]):
        found = result_of(run("identify", bag, "--position", *named, "--json")[1])
        assert found["working_depth"]["stiffness"]["value"] == pytest.approx(2e3, rel=0.02)


def test_several_files_are_contacts_of_one_object(run, printed, good, tmp_path):
    again = recording(tmp_path, "again.csv")
    out = printed("identify", good, again, "--json")
    both = json.loads(out)
    assert both["files"] == [str(good), str(again)]
    assert both["samples"] == 1200
    alone = result_of(run("identify", good, "--json")[1])["law"]
    assert result_of(out)["law"]["K"] == pytest.approx(alone["K"], rel=0.01)


def test_the_command_line_overrides_a_file_of_options(run, printed, tmp_path):
    rows = [[t, x, repr(1e3 * float(f))] for t, x, f in rows_of()]
    path = written(tmp_path / "n.csv", text_of(rows, ("t", "x", "load")))
    saved = tmp_path / "run.toml"
    given = ("--penetration", "x", "--unit", "force=mN", "--surface", "-0.1mm", "--strict")
    out = printed("identify", path, "--json", *given, "--save-config", saved)
    changed = {"penetration": "x", "unit": ["force=mN"], "surface": "-0.1mm", "strict": True}
    assert tomllib.loads(saved.read_text()) == changed
    assert "# force: column 'load', in mN" in saved.read_text()
    assert run("identify", path, "--json", "--config", saved)[1] == out
    other = run("identify", path, "--json", f"--config={saved}", "--surface", "0mm")
    assert result_of(other[1])["law"] != result_of(out)["law"]
    text = 'quote " back \\ tab \t é 漢 \U0001f600'  # every text survives
    options = {"time": text, "unit": ["a", "\x7f\x01"], "rate": 1e-3, "strict": True}
    assert tomllib.loads(as_toml(options, ["of two\nlines"])) == options


@pytest.mark.parametrize(
    "text, words",
    [
        ("velocty = 'v'", "[velocty]"),
        ("save-config = 'x'", "'save-config' is no option"),
        ("verbose = true", "'verbose' is no option"),
        ("[identify]\nlaw = 'auto'", "'identify' is no option"),
        ("rate = 'fast'", "[rate]"),
        ("time = ", "not TOML"),
        ("time = " + "[" * 1000, "nests too deeply"),
        ("time = " + "[" * 1000 + "]" * 1000, "nests too deeply"),
    ],
)
def test_a_wrong_file_of_options_is_refused_by_name(refused, good, tmp_path, text, words):
    assert words in refused("identify", good, "--config", written(tmp_path / "run.toml", text))


def test_units_are_given_one_by_one_or_together(run, refused, tmp_path):
    rows = [[repr(1e3 * float(t)), repr(1e3 * float(x)), f] for t, x, f in rows_of()]
    path = written(tmp_path / "m.csv", text_of(rows, HEADER))
    one = run("identify", path, "--json", "--unit", "time=ms,penetration=mm")
    two = run("identify", path, "--json", "--unit", "time=ms", "--unit", "penetration=mm")
    assert one == two
    assert one[0] == 0
    refused("identify", path, "--unit", "penetration")
    # And a velocity column can be left out.
    rows = [[*row, "0.0"] for row in rows_of()]
    path = written(tmp_path / "v.csv", text_of(rows, (*HEADER, "velocity_m_s")))
    _, out, _ = run("identify", path, "--json", "--velocity", "none")
    assert "spline" in json.loads(out)["provenance"]["velocity"]


@pytest.mark.parametrize(
    "option, words",
    [
        (("--normal", "w"), "normal must be x, y, z"),
        (("--surface", "deep"), "--surface must be a number and one of m"),
        (("--tare", "soon"), "--tare must be START:STOP"),
        (("--rate", "-1"), "rate must be in"),
        (("--force-frame", "world"), "force-frame"),
    ],
)
def test_a_wrong_option_is_one_line(refused, robot, option, words):
    assert words in refused("identify", robot, *option)
