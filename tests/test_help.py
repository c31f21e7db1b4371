"""Help on the command line and in Python: readable at any width, and in any editor."""

import inspect
import re

import pytest
from rich.cells import cell_len

import palpate
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


def test_options_stand_under_headings_with_what_they_take(run):
    out = run("identify", "--help")[1]
    assert "; ".join(re.findall(r"^╭─ ([A-Z][\w ]+) ─", out, re.MULTILINE)) == (
        "Arguments; Options; What is printed and drawn; How it is judged; "
        "What follows from the law; What is read; How it is prepared; "
        "Options in a file; Any command"
    )
    for words in ("choices: do-not-trust", "--surface DEPTH", "--no-reject-outliers"):
        assert words in out
    assert "--no-dark" not in out  # off is what it is already


def public_callables():
    for name in palpate.__all__:
        each = getattr(palpate, name)
        yield name, each
        for part, method in inspect.getmembers(each, callable) if inspect.isclass(each) else ():
            if not part.startswith("_") and getattr(method, "__module__", "") == each.__module__:
                yield f"{name}.{part}", method


def test_no_type_in_a_signature_is_a_riddle():
    """NumPy's array_like alone is a union of 300 characters where it is not quoted."""
    for name, function in public_callables():
        try:
            parameters = inspect.signature(function).parameters.values()
        except (TypeError, ValueError):  # compiled
            continue
        for parameter in parameters:
            words = inspect.formatannotation(parameter.annotation)
            assert len(words) <= 120, f"{name}({parameter.name}: {words})"
