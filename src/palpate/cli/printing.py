"""What goes to standard output: one JSON object or text, in whatever its encoding can carry."""

import codecs
import io
import json
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console

from palpate.cli.groups import OUTPUT
from palpate.errors import printable

AsJson = Annotated[bool, Parameter(name="--json", negative="", group=OUTPUT)]

#: Of a line that goes to a file or a pipe, unless COLUMNS says otherwise.
PIPE_WIDTH = 100

# A word of a person or a file that is no word is shown by its beginning and its end; a path of the
# usual length is shown whole.
_TOO_LONG = re.compile(r"(\S{60})\S{121,}(\S{20})")
_LONGEST_LINE = 2000

_COLOURLESS = ContextVar("palpate.colourless", default=False)

# What the tables print beyond ASCII, for terminals that have no more than that.
_PLAIN = {
    "µ": "u", "°": " deg", "₁": "1", "₂": "2", "·": "*", "±": "+-",
    "–": "-", "−": "-", "×": "x", "√": "sqrt", "≥": ">=", "≤": "<=", "…": "...", "“": '"',
    "”": '"', "é": "e", "ó": "o", "σ": "sigma", "✓": "+", "✗": "-", "◐": "~",
    "≈": "~", "→": "->", "λ": "lambda", "₀": "0", "α": "alpha", "τ": "tau",
}  # fmt: skip
# Of several in a row only the first needs the sign that says what they are: 10⁻¹² is 10^-12.
_SUPERSCRIPTS = dict(zip("ⁿᵖ⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "np+-0123456789", strict=True))


@contextmanager
def colourless(plain: bool) -> Iterator[None]:
    """Let every terminal that is made inside write without colour, if so asked."""
    token = _COLOURLESS.set(plain)
    try:
        yield
    finally:
        _COLOURLESS.reset(token)


class Terminal(Console):
    """Where text is printed: standard output, or standard error.

    In colour only where a person looks on who did not ask for none: by ``--no-color``, by the
    environment's NO_COLOR (no-color.org) or by TERM=dumb.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        plain = _COLOURLESS.get() or os.environ.get("NO_COLOR", "") != ""
        super().__init__(
            stderr=stderr,
            highlight=False,
            color_system=None if plain else "auto",
            # A bar on standard error follows the window. A dumb terminal has a width only where
            # there is a height too.
            width=None if stderr else _width(),
            height=None if stderr else 25,
        )

    def on_broken_pipe(self) -> None:
        """Leave the exit status to who runs the command."""
        raise BrokenPipeError


def _width() -> int:
    """Of a line on standard output: COLUMNS, else the window's, else that of a pipe."""
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns) > 0:
        return int(columns)
    with suppress(OSError, ValueError, AttributeError):  # no terminal, or no descriptor
        return os.get_terminal_size(sys.stdout.fileno()).columns or PIPE_WIDTH
    return PIPE_WIDTH


def print_json(whole: dict[str, Any]) -> None:
    """Print one JSON object on a line of its own; escaped where the output is not UTF-8."""
    text = json.dumps(whole, ensure_ascii=False, allow_nan=False)
    if not _carried(text) or any("\x7f" <= sign <= "\x9f" for sign in text):
        text = json.dumps(whole, allow_nan=False)
    print(text)


def prepare_output() -> None:
    """Let what the output's encoding lacks be printed in other signs, instead of failing.

    A stream that is closed leads nowhere: no file that is opened later takes its descriptor, into
    which libraries print.
    """
    while (nowhere := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(nowhere)
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, "w", encoding="utf-8", errors="replace"))
    codecs.register_error("palpate.plain", _in_plain_signs)
    # In the C locale Python lets bytes of file names through, and other signs fail all the same.
    failing = ("strict", "surrogateescape")
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in failing:
        sys.stdout.reconfigure(errors="palpate.plain")


def finish_output() -> None:
    """Write out what is waiting, so that what cannot be written is known before the end."""
    sys.stdout.flush()


def abandon_output() -> None:
    """Let go of what cannot be written: Python would try again on its way out, and complain."""
    with suppress(OSError, ValueError, AttributeError):  # it may have no descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def complain(words: str) -> None:
    """Print one line on standard error, whatever the words are made of."""
    line = _TOO_LONG.sub(r"\1…\2", printable(" ".join(words.split())))
    with suppress(OSError):  # there is nobody left to tell
        print(f"palpate: {line[:_LONGEST_LINE]}", file=sys.stderr)


def _carried(text: str) -> bool:
    encoding = getattr(sys.stdout, "encoding", None) or "ascii"
    try:
        text.encode("utf-8")  # a file's name may hold bytes that are not
    except UnicodeEncodeError:
        return False
    return codecs.lookup(encoding).name == "utf-8"


def _in_plain_signs(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    signs = error.object[error.start : error.end]
    plain, raised = "", False
    for sign in signs:
        if sign in _SUPERSCRIPTS:
            plain += _SUPERSCRIPTS[sign] if raised else f"^{_SUPERSCRIPTS[sign]}"
        elif sign in _PLAIN:
            plain += _PLAIN[sign]
        else:
            return codecs.backslashreplace_errors(error)
        raised = sign in _SUPERSCRIPTS
    return plain, error.end
