"""The layout of a text table: notes, header, units and delimiter."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from palpate.errors import RecordingError
from palpate.recordings.recording import (
    KNOWN,
    OTHER_UNITS,
    number_in_text,
    plain_unit,
    unit_in_name,
)
from palpate.recordings.times import iso_nanoseconds

DELIMITERS = ",;\t|"
SPACES = " "  # as a delimiter: any run of spaces and tabs
MOST_COLUMNS = 1 << 16  # four times the limit of a spreadsheet
LONGEST_NAME = 10_000  # characters
TRIED = 50  # lines from which the delimiter is found
_BRACKETS = re.compile(r"^\s*(?:np\.)?array\(|,?\s?dtype=[\w.]+|[\[\](){}]")
MOST_ELEMENTS = 1000
LONGEST_VECTOR = 40 * MOST_ELEMENTS  # characters
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2}(\.\d{3})+,\d*\s*")
#: Whole thousands, ``1,063``: with a decimal point a number of thousands, else perhaps a decimal.
WHOLE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


@dataclass(frozen=True, slots=True)
class TextLayout:
    """The layout of a table.

    Attributes
    ----------
    header : list of str
        Unique names of the columns.
    delimiter : str
        The delimiter of cells; a space means any run of spaces and tabs.
    decimal : str
        The decimal mark, ``"."`` or ``","``.
    units : dict of str
        Column to unit, from the row below the header or from the name.
    notes : dict of str
        Lines ``# name: words`` above the header, and assumptions.
    first : int
        Number of lines above the first sample.
    """

    header: list[str]
    delimiter: str
    decimal: str
    units: dict[str, str]
    notes: dict[str, str]
    first: int


def layout_of(lines: Sequence[str], source: str) -> TextLayout:
    """Return the layout of a table, from its first lines.

    Raises
    ------
    RecordingError
        There is neither a header nor a sample.
    """
    top, notes, separator = _above(lines)
    body = lines[top:]
    if not body and not notes.keys() - {""}:
        raise RecordingError(f"{source}: the file is empty; expected a header and samples")
    delimiter = separator or _delimiter(body[: TRIED + 1])
    commented = notes.pop("", None)  # the last comment line, which may be the header
    header, first = _header(body, delimiter, commented, source, top + 1)
    if not body and not header:
        raise RecordingError(f"{source}: the file has only notes; expected a header and samples")
    if header is None:
        count = len(_cells(body[0], delimiter, source, top + 1))
        header = [f"column {place}" for place in range(1, count + 1)]
        notes["header"] = "none: the columns are numbered"
    if len(header) > MOST_COLUMNS:
        raise RecordingError(
            f"{source}: the header has {len(header)} columns; palpate reads at most {MOST_COLUMNS}"
        )
    names = _told_apart(header)
    decimal = _decimal(body[first : first + TRIED], delimiter)
    if decimal == ",":
        notes["decimal mark"] = "comma"
    units = {name: unit for name in names if (unit := unit_in_name(name))}
    stated = _units_below(body[first:], delimiter, len(names), decimal)
    if stated is not None:
        units |= {name: unit for name, unit in zip(names, stated, strict=True) if unit}
        first += 1
    return TextLayout(names, delimiter, decimal, units, notes, top + first)


def _above(lines: Sequence[str]) -> tuple[int, dict[str, str], str]:
    """The number of lines above the table, their notes, and the delimiter if they state it.

    A last line that is not a note is also in the notes, under the name ``""``.
    """
    notes: dict[str, str] = {}
    separator, top = "", 0
    for line in lines:
        words = line.strip()
        if words[:4].lower() == "sep=" and len(words) <= 5:  # written by Excel
            separator = line.strip("\r\n")[4:5] or separator
        elif words[:1] in ("#", "%"):
            name, colon, rest = words.lstrip("#% ").partition(": ")
            if colon:
                notes[name] = rest.strip()
                notes.pop("", None)
            else:
                notes[""] = words
        elif words:
            break
        top += 1
    return top, notes, separator


def _delimiter(lines: Sequence[str]) -> str:
    """The delimiter that divides most lines into as many cells as the first; else the header's."""
    full = [line for line in lines if line.strip()]
    if not full:
        return ","
    unquoted = [re.sub(r'"[^"]*"', "", line) for line in full]
    counts = {each: [line.count(each) for line in unquoted] for each in DELIMITERS}
    counts[SPACES] = [len(line.split()) - 1 for line in unquoted]

    def fits(each: str) -> bool:
        first, *below = counts[each]
        return first > 0 and (not below or below.count(first) > 0.5 * len(below))

    # Columns aligned by padding mix tabs and spaces.
    padded = len(set(counts["\t"])) > 1 == len(set(counts[SPACES]))
    if padded and not any(counts[each][0] for each in ",;|"):
        return SPACES
    ranked = sorted(DELIMITERS, key=lambda each: -counts[each][0])
    usual = SPACES if fits(SPACES) and not counts[ranked[0]][0] else ranked[0]
    return next(filter(fits, ranked), usual)


def _cells(line: str, delimiter: str, source: str, row: int) -> list[str]:
    cells = [cell.strip() for cell in cells_of(line, delimiter)]
    longest = max(map(len, cells), default=0)
    if longest > LONGEST_NAME:
        raise RecordingError(
            f"{source}: row {row} is not a header: one of its cells has {longest} characters"
        )
    return cells


def _header(
    body: Sequence[str], delimiter: str, commented: str | None, source: str, row: int
) -> tuple[list[str] | None, int]:
    """The names, or None, and how many lines of the table they take."""
    first = _cells(body[0], delimiter, source, row) if body else []
    filled = [cell for cell in first if cell]
    # A header of numbers 0, 1, 2 …, as pandas writes for unnamed columns.
    counted = len(filled) > 1 and filled == [str(place) for place in range(len(filled))]
    numbers = bool(filled) and not counted and _is_sample(body, delimiter)
    if commented is not None and (numbers or not body):
        # A header as rostopic and NumPy write it: "%time,field.x" and "# time, force".
        line = commented if commented.startswith("%") else commented.lstrip("# ")
        if line.startswith("% "):
            line = line.lstrip("% ")
        mark = delimiter if body else _delimiter([line])
        names = _cells(line, mark, source, row - 1)
        if len(names) == len(first) or (not body and len(names) > 1):
            return names, 0
    return (None, 0) if numbers else (first, 1)


def _is_sample(body: Sequence[str], delimiter: str) -> bool:
    """Whether the first row is a sample: numbers, or numbers and words where the next has them.

    The header of a column of numbers is a word: ``0.1,base`` above ``0.2,base`` is no header.
    """
    rows = [[cell.strip() for cell in cells_of(line, delimiter)] for line in body[:2]]
    first, *below = [[cell and is_number(cell, delimiter) for cell in cells] for cells in rows]
    if False not in first:
        return True
    if not below or len(first) != len(below[0]) or True not in first:
        return False
    return all(a == b or "" in (a, b) for a, b in zip(first, below[0], strict=True))


def _units_below(body: Sequence[str], delimiter: str, width: int, decimal: str) -> list[str] | None:
    """The units in the first row; None if it is not a row of units."""
    if not body:
        return None
    cells = [cell.strip() for cell in cells_of(body[0], delimiter)]
    numbers = any(parsed_number(cell, decimal) is not None for cell in cells if cell != "1")
    if numbers or len(cells) != width:
        return None
    units = [plain_unit(cell) for cell in cells]
    filled = [unit for unit in units if unit]
    known = sum(unit in KNOWN or unit in OTHER_UNITS for unit in filled)
    if KNOWN.isdisjoint(filled) or 2 * known < len(filled):
        return None
    return ["" if unit in ("-", "–") else unit for unit in units]


def _decimal(lines: Sequence[str], delimiter: str) -> str:
    """The decimal mark: the one with which more cells are numbers.

    A comma before three digits may be between thousands, if there are points too.
    """
    commas = points = either = 0
    for line in lines:
        if "," not in line or (delimiter == "," and '"' not in line):
            points += line.count(".")
            continue
        for cell in map(str.strip, cells_of(line, delimiter)):
            if WHOLE_THOUSANDS.fullmatch(cell):
                either += 1
            else:
                commas += bool(_DECIMAL_COMMA.fullmatch(cell))
            points += "." in cell and parsed_number(cell, ".") is not None
    return "," if commas > points or (either and not points) else "."


def _told_apart(names: Sequence[str]) -> list[str]:
    """The names; repeated and empty ones get their column number."""
    times = Counter(names)
    apart: dict[str, None] = {}
    for place, name in enumerate(names, start=1):
        if not name or times[name] > 1:
            name = f"{name} (column {place})".strip()
        while name in apart:
            name += " (2)"
        apart[name] = None
    return list(apart)


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; the delimiter space means any run of spaces and tabs."""
    if '"' not in line:
        return line.split() if delimiter == " " else line.split(delimiter)
    if delimiter == " ":
        line = line.replace("\t", " ").strip(" ")
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a cell is too long
        return line.split(delimiter)


def parsed_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, with this decimal mark; None if there is none."""
    if decimal == ",":
        if _THOUSANDS.fullmatch(cell):
            cell = cell.replace(".", "")
        if "." in cell:  # one point: a thousands separator, or a decimal point
            return None
        cell = cell.replace(",", ".")
    try:
        return number_in_text(cell)
    except ValueError:
        return None


def is_number(cell: str, delimiter: str) -> bool:
    """Whether a cell is a number, a time or a vector, and so not a column name."""
    found = parsed_number(cell, "."), iso_nanoseconds(cell), vector_in(cell, ".")
    if any(each is not None for each in found):
        return True
    return "," in cell and delimiter != "," and parsed_number(cell, ",") is not None


def vector_in(cell: str, decimal: str) -> list[float] | None:
    """Return the numbers of a cell with several, as robot loggers write them.

    ``[0.1, 0.2, 0.3]``, ``(0.1 0.2 0.3)``, ``array([0.1, 0.2])`` or ``0.1 0.2 0.3``; None for
    anything else, and for one number without brackets.
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
    """Whether a quoted cell begins in a line and does not end there."""
    return line.count('"') % 2 == 1


def padded(cells: Sequence[str], width: int) -> list[str] | None:
    """Return the cells, padded to the width of the header; None if there are more."""
    extra = cells[width:]
    if any(map(str.strip, extra)):
        return None
    return [*cells[:width], *[""] * (width - len(cells))]
