"""Help on the command line: readable at any width."""

import re

import pytest
from rich.cells import cell_len

from palpate.cli.application import COMMANDS

#: A Python union, or the name of a module, has no place in front of a user.
PYTHON = re.compile(r"Union|Optional|Literal|NoneType|typing\.|palpate\.\w|\bNone\b|\bTrue\b|False")


@pytest.mark.parametrize(
    "command, columns", [*((command, 40) for command in (*COMMANDS, "")), ("live", 100), ("", 100)]
)
def test_help_fits_the_terminal_and_shows_an_example(run, monkeypatch, command, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    status, out, err = run(*command.split(), "--help")
    assert (status, err) == (0, "")
    assert max(map(cell_len, out.split("\n"))) <= columns
    assert not PYTHON.search(out)
    assert "…" not in out.replace("--exponent …", "")
    assert out.startswith("Usage: palpate")
    assert re.search("in a file.*--config.*Any command.*--no-color.*--verbose", out, re.DOTALL)
    if command:
        assert re.search(rf"^ palpate {command} ", out, re.MULTILINE)
    else:
        assert all(re.search(rf"│ {each} +[A-Z]\w+", out) for each in COMMANDS)
