"""What a person sees on terminals of any width: every number whole, no line too long."""

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from rich.cells import cell_len

from palpate.cli.printing import Terminal, print_table, say

BALL = Path(__file__).parents[2] / "examples" / "recordings" / "ball.csv"
GUESS = ("--K", "2000", "--B", "2000", "--n", "1.2", "--noise", "0.05")
COMMANDS = {
    "identify": ("identify", BALL),
    "compare": ("compare", BALL, "--stop", "4"),  # of half, which takes half as long
    "diagnose": ("diagnose", BALL),
    "info": ("info", BALL),
    "design": ("design", *GUESS),
}
NUMBER = re.compile(r"\d[\d.]*")


@pytest.fixture(scope="module")
def wide():
    """What each command printed at 200 columns."""
    return {}


@pytest.mark.long
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    "columns", [40, *(pytest.param(c, marks=pytest.mark.slow) for c in (60, 80)), 120]
)
def test_no_line_is_wider_than_the_terminal_and_no_number_is_lost(
    run, monkeypatch, wide, command, columns
):
    arguments = COMMANDS[command]
    if command not in wide:
        monkeypatch.setenv("COLUMNS", "200")
        wide[command] = run(*arguments)[1]
    monkeypatch.setenv("COLUMNS", str(columns))
    status, out, err = run(*arguments)
    assert (status, err) == (0, "")
    assert "…" not in out
    lines = out.replace(str(BALL), "").split("\n")
    assert max(cell_len(line.rstrip()) for line in lines) <= columns
    # What stands above a column once stands beside each of its numbers where rows are stacked.
    assert set(NUMBER.findall(out)) == set(NUMBER.findall(wide[command]))


def test_output_into_a_pipe_has_a_fixed_width(run, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    out = run("info", BALL)[1]
    monkeypatch.setenv("COLUMNS", "100")
    assert run("info", BALL)[1] == out
    for no_width in ("", "0", "wide", "-3"):
        monkeypatch.setenv("COLUMNS", no_width)
        assert Terminal().width == 100


ROWS = [["one", "–", "12.0 ± 0.3\n7.5 ± 0.1", "many words about it"]]
HEADINGS = ["name", "empty", ">size\nmm", "why"]
WIDE = """\
            size
name          mm  why
one   12.0 ± 0.3  many words about it
       7.5 ± 0.1
"""
NARROW = """\
one
  size, mm  12.0 ± 0.3
            7.5 ± 0.1
  why       many words about it
"""


@pytest.mark.parametrize("columns, expected", [(60, WIDE), (37, WIDE), (36, NARROW)])
def test_rows_stand_side_by_side_where_no_number_would_be_cut(
    capsys, monkeypatch, columns, expected
):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_table(Terminal(), HEADINGS, ROWS, prose=["why"])
    out = capsys.readouterr().out
    assert "\n".join(line.rstrip() for line in out.split("\n")) == expected


def test_words_are_folded_between_them_with_an_indent(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    say(Terminal(), "words that fold 12.5 N and go on")
    assert capsys.readouterr().out == "words that fold\n  12.5 N and go on\n"


# Each command in a process of its own takes half a second to start.
COMMANDS_OF_A_TERMINAL = """
import json, os, sys
from palpate import cli
kept = dict(os.environ)
for arguments, environment in json.loads(sys.argv[1]):
    os.environ.update(environment)
    sys.argv = ["palpate", *arguments]
    cli.main()
    print("=" * 9, flush=True)
    os.environ.clear()
    os.environ.update(kept)
"""


def on_a_terminal(*commands):
    """What commands print where a person looks on, each of arguments and an environment."""
    leader, follower = pty.openpty()
    kept = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "COLUMNS", "FORCE_COLOR")}
    done = subprocess.Popen(
        [sys.executable, "-c", COMMANDS_OF_A_TERMINAL, json.dumps(commands)],
        stdout=follower, stderr=follower, stdin=follower,
        env={**kept, "TERM": "xterm-256color", "LINES": "24"},
    )  # fmt: skip
    os.close(follower)
    seen = b""
    try:
        while part := os.read(leader, 65536):
            seen += part
    except OSError:  # the command has closed it
        pass
    assert done.wait() == 0
    os.close(leader)
    return seen.decode().split("=" * 9)[:-1]


@pytest.mark.long
def test_colour_is_for_terminals_only(run, monkeypatch):
    design = COMMANDS["design"]
    seen = on_a_terminal(
        (design, {}),
        ((*design, "--no-color"), {}),
        (design, {"NO_COLOR": "1"}),
        (design, {"TERM": "dumb", "COLUMNS": "60"}),
        (("design", "--help", "--no-color"), {}),
        (design, {}),
    )
    assert all("spring" in each or "planned" in each for each in seen)
    assert ["\x1b[" in each for each in seen] == [True, False, False, False, False, True]
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    assert "\x1b[" not in run(*design)[1]
