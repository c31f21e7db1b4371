"""Text for engines and about them: numbers that read back exactly, errors, and comments."""

import math
import re
from collections.abc import Sequence

from palpate.digits import rounded


def digits(value: float) -> str:
    """A number in the fewest digits that read back as the same float."""
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e15 else repr(float(value))


def xml_comment(notes: Sequence[str]) -> str:
    """Lines as an XML comment, in which two hyphens may not stand together."""
    lines = [re.sub("-(?=-)", "- ", line) for line in _lines(notes)]
    inside = "\n".join(f"  {line}".rstrip() for line in lines)
    return f"<!--\n{inside}\n-->"


def hash_comment(notes: Sequence[str]) -> str:
    """Lines as comments that begin with #."""
    return "\n".join(f"# {line}".rstrip() for line in _lines(notes))


def _lines(notes: Sequence[str]) -> list[str]:
    """Lines of text, without what XML does not take: a file's name may have anything in it."""
    lines = [line for note in notes for line in note.splitlines()]
    return ["".join(each if each.isprintable() else " " for each in line) for line in lines]


def percent(value: float) -> str:
    """An error in two digits, rounded up: what is within 0.31 % is not within 0.3 %."""
    if not math.isfinite(value):
        return "an unknown part"
    if value <= 0.0:
        return "0 %"
    place = 10.0 ** (math.floor(math.log10(value)) - 1)
    up = math.ceil(value / place - 1e-9) * place
    return f"{rounded(up, 2)} %"


def length(metres: float, figures: int) -> str:
    """A length in mm; in µm where it is less than a tenth of one."""
    if abs(metres) >= 1e-4 or metres == 0.0:
        return f"{rounded(1e3 * metres, figures)} mm"
    return f"{rounded(1e6 * metres, figures)} µm"
