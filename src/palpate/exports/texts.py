"""Text for engines: numbers that read back exactly, errors, and comments."""

import math
import re
import string
from collections.abc import Sequence
from importlib import resources
from typing import Any

from palpate.digits import rounded
from palpate.force_laws import GeneralisedHuntCrossley


class _Digits(string.Formatter):
    """A formatter that writes numbers so that they read back exactly."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return digits(value) if isinstance(value, int | float) else str(value)


def template(name: str, **values: Any) -> str:
    """Return a file of ``templates`` with its fields filled in."""
    text = resources.files("palpate.exports") / "templates" / name
    return fill(text.read_text(encoding="utf-8"), **values)


def fill(text: str, **values: Any) -> str:
    """Return a text with its fields filled in."""
    return _Digits().format(text, **values)


def digits(value: float) -> str:
    """Return a number in the fewest digits that read back as the same float."""
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e15 else repr(float(value))


def xml_comment(notes: Sequence[str]) -> str:
    """Return lines as an XML comment, which may not contain two adjacent hyphens."""
    lines = [re.sub("-(?=-)", "- ", line) for line in _lines(notes)]
    inside = "\n".join(f"  {line}".rstrip() for line in lines)
    return f"<!--\n{inside}\n-->"


def hash_comment(notes: Sequence[str]) -> str:
    """Return lines as comments that begin with #."""
    return "\n".join(f"# {line}".rstrip() for line in _lines(notes))


def _lines(notes: Sequence[str]) -> list[str]:
    """Return lines without characters that XML forbids; file names may contain any character."""
    lines = [line for note in notes for line in note.splitlines()]
    return ["".join(each if each.isprintable() else " " for each in line) for line in lines]


def percent(value: float) -> str:
    """Return an error in two digits, rounded up: 0.301 % is written 0.31 %."""
    if not math.isfinite(value):
        return "an unknown percentage"
    if value <= 0.0:
        return "0 %"
    place = 10.0 ** (math.floor(math.log10(value)) - 1)
    up = math.ceil(value / place - 1e-9) * place
    return f"{rounded(up, 2)} %"


def length(metres: float, figures: int) -> str:
    """Return a length in mm, or below 0.1 mm in µm."""
    if abs(metres) >= 1e-4 or metres == 0.0:
        return f"{rounded(1e3 * metres, figures)} mm"
    return f"{rounded(1e6 * metres, figures)} µm"


def law_numbers(law: GeneralisedHuntCrossley) -> dict[str, float]:
    """Return K, n, B and p by name."""
    return {name: float(getattr(law, name)) for name in ("K", "n", "B", "p")}
