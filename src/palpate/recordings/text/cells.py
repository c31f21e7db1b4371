"""Cells of a line, and the numbers in them."""

import csv
import re
from collections.abc import Sequence

from palpate.recordings.recording import number_in_text
from palpate.recordings.text.times import is_iso_time

_BRACKETS = re.compile(r"^\s*(?:np\.)?array\(|,?\s?dtype=[\w.]+|[\[\](){}]")
MOST_ELEMENTS = 1000
LONGEST_VECTOR = 40 * MOST_ELEMENTS  # characters


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of one line; a space as a delimiter stands for any run of spaces and tabs.

    Raises
    ------
    csv.Error
        A cell is too long, or the line has an end within.
    """
    if '"' not in line:
        return line.split() if delimiter == " " else line.split(delimiter)
    if delimiter == " ":
        line = line.replace("\t", " ").strip(" ")
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])


def parsed_number(cell: str, decimal: str) -> float | None:
    """Return the number that a cell holds with this mark of decimals; None where it holds none."""
    if decimal == ",":
        if "." in cell:  # of thousands: palpate does not guess them away
            return None
        cell = cell.replace(",", ".")
    try:
        return number_in_text(cell)
    except ValueError:
        return None


def is_number(cell: str, delimiter: str) -> bool:
    """Whether a cell is a number, a time or a vector, and so no name of a column."""
    if parsed_number(cell, ".") is not None or is_iso_time(cell):
        return True
    if vector_in(cell, ".") is not None:
        return True
    return "," in cell and delimiter != "," and parsed_number(cell, ",") is not None


def vector_in(cell: str, decimal: str) -> list[float] | None:
    """Return the numbers of a cell that holds several, as robots' loggers write them.

    ``[0.1, 0.2, 0.3]``, ``(0.1 0.2 0.3)``, ``array([0.1, 0.2])`` or ``0.1 0.2 0.3``; None where it
    holds something else, or one number without brackets.
    """
    if len(cell) > LONGEST_VECTOR:
        return None
    bare = _BRACKETS.sub(" ", cell)
    words = (bare if decimal == "," else bare.replace(",", " ")).replace(";", " ").split()
    numbers = [parsed_number(word, decimal) for word in words]
    bracketed = bare != cell
    if not 1 + (not bracketed) <= len(numbers) <= MOST_ELEMENTS or None in numbers:
        return None
    return [number for number in numbers if number is not None]


def unclosed(line: str) -> bool:
    """Whether a quotation begins in a line and does not end there."""
    return line.count('"') % 2 == 1


def padded(cells: Sequence[str], width: int) -> list[str] | None:
    """Return cells as many as the header has; None where there are more than that."""
    extra = cells[width:]
    if any(map(str.strip, extra)):
        return None
    return [*cells[:width], *[""] * (width - len(cells))]
