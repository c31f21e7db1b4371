"""What every command takes, and what a shell completes."""

import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from cyclopts.completion.detect import ShellDetectionError
from recordings import written

from palpate.results.saved import as_toml


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
def test_each_shell_gets_its_completion_where_it_looks_for_it(run, home, shell):
    status, out, err = run("--install-completion", "--shell", shell)
    assert (status, err) == (0, "")
    [path] = [p for p in home.rglob("*") if p.is_file() and "--method" in p.read_text()]
    assert str(path) in out


def test_a_completion_that_cannot_be_made_is_one_line(refused, good, home, monkeypatch):
    unknown = Mock(side_effect=ShellDetectionError)
    monkeypatch.setattr("cyclopts.completion.detect.detect_shell", unknown)
    refused("--install-completion", "--shell", "bash", "-o", good / "x")
    assert "name it with --shell" in refused("--install-completion")
