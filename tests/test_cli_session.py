"""What every command takes, and what a shell completes."""

import logging
import shutil
import subprocess
import tomllib

import pytest
from recordings import recording

from palpate.cli import session
from palpate.results.toml import as_toml


@pytest.fixture
def good(tmp_path):
    return recording(tmp_path)


def test_verbose_says_on_standard_error_what_is_done_and_how_long_it_took(run, good):
    quiet = run("identify", good)
    status, out, err = run("identify", good, "-v")
    assert (status, out) == quiet[:2]
    assert f"read {good}: 3 channels of 600 samples" in err
    assert "force is force_N (it has this name)" in err
    assert "velocity by the filter: " in err
    assert "replay: " in err
    assert "diagnosis: " in err
    assert "channel force_N" not in err
    assert all(line[:7].strip().replace(".", "").isdigit() for line in err.splitlines())
    more = run("identify", good, "-vv")[2]
    assert "channel force_N" in more
    assert "search for delay" in more
    assert run("identify", good)[2] == ""
    assert logging.getLogger("palpate").level == logging.NOTSET


def test_a_position_is_prepared_step_by_step(run, tmp_path):
    from palpate.lab import BALL, THREE_SINES, Bench, IdealProbe

    contact = Bench(BALL, THREE_SINES, IdealProbe()).run(1, seconds=3.0).contact
    rows = zip(contact.time, -contact.penetration, contact.force, strict=True)
    lines = [f"{t},0,0,{z},0,0,{f}" for t, z, f in rows]
    path = tmp_path / "pose.csv"
    path.write_text("\n".join(["time_s,px_m,py_m,pz_m,fx_N,fy_N,fz_N", *lines]))
    err = run("identify", path, "-v")[2]
    for step in ("position is px_m", "zero of the force: ", "contact normal: ", "episodes: "):
        assert step in err


@pytest.mark.parametrize(
    "words, found",
    [
        (["identify", "a.csv", "-v"], (False, 1, ["identify", "a.csv"])),
        (["-v", "identify", "--verbose"], (False, 2, ["identify"])),
        (["-vv", "-v", "--no-color", "x"], (True, 2, ["x"])),
        (
            ["identify", "--", "-v", "--no-color"],
            (False, 0, ["identify", "--", "-v", "--no-color"]),
        ),
    ],
)
def test_what_every_command_takes_stands_anywhere_before_the_end_of_options(words, found):
    assert session.session_of(words) == found


def test_no_file_of_options_holds_what_every_command_takes(run, good, tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(as_toml({"verbose": True}, ()))
    status, _, err = run("identify", good, "--config", path)
    assert status == 2
    assert "'verbose' is no option" in err


def test_a_file_of_options_may_say_that_a_flag_is_off(run, good, tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(as_toml({"changes": False, "dark": False, "flip-force": False}, ()))
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


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_commands_options_and_their_values(run, tmp_path):
    script = tmp_path / "palpate.bash"
    status, out, err = run("--install-completion", "--shell", "bash", "-o", script)
    assert (status, out.strip(), err) == (0, f"completion: {script}", "")
    typed = "\n".join(COMPLETED) + "\n"
    done = subprocess.run(
        ["bash", "-c", TYPED.format(script=script)],
        input=typed, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert [line.split() for line in done.stdout.splitlines()] == list(COMPLETED.values())
    # The command line itself is as it was: a method of one's own is refused with its reason.
    status, _, err = run("identify", script, "--method", "magic")
    assert status == 2
    assert "magic" in err


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_gets_its_completion_where_it_looks_for_it(run, tmp_path, monkeypatch, shell):
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("ZSH", "ZSH_CUSTOM", "XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(name, raising=False)
    status, out, err = run("--install-completion", "--shell", shell)
    assert (status, err) == (0, "")
    [path] = [p for p in tmp_path.rglob("*") if p.is_file() and "single-stage" in p.read_text()]
    assert str(path) in out.replace("\n", "")


def test_a_completion_that_cannot_be_written_is_one_line(run, tmp_path):
    status, out, err = run("--install-completion", "--shell", "bash", "-o", tmp_path / "no" / "x")
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1


def test_control_characters_of_a_name_do_not_spoil_the_options():
    text = as_toml({"force": "a\x7f\x01"}, ["of a\x01b\x7f.csv", "two\nlines"])
    assert tomllib.loads(text) == {"force": "a\x7f\x01"}
