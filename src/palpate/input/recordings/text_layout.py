"""The layout of a text table, also of one inside a report: notes, header, units, delimiter."""

import csv
import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, starmap
from typing import NamedTuple

from palpate.errors import RecordingError
from palpate.input.recordings.recording import number_in_text
from palpate.input.recordings.times import is_timelike
from palpate.input.recordings.units import (
    KNOWN,
    OTHER_UNITS,
    UNITS,
    UNSTATED,
    find_unit,
    plain_unit,
    unit_in_name,
)
from palpate.validation import frozen, shown

DELIMITERS = ",;\t|"
SPACES = " "  # as a delimiter: any run of spaces and tabs
MOST_COLUMNS = 1 << 16  # four times the limit of a spreadsheet
LONGEST_NAME = 10_000  # characters
TRIED = 50  # lines that show the delimiter
_BRACKETS = re.compile(r"^\s*(?:np\.)?array\(|,?\s?dtype=[\w.]+|[\[\](){}]")
MOST_ELEMENTS = 1000
LONGEST_VECTOR = 40 * MOST_ELEMENTS  # characters
MOST_NOTES = 200
WIDE = 8  # columns
# Numbers, also several with brackets around them, dates and times.
_NUMERIC = re.compile(
    r"[\[(]*[+-]?(?:[.,]?\d(?:[\d.,;:/TZ'+-]*[\d.Z])?(?:E[+-]?\d+)?|nan|inf(?:inity)?)[\]),;]*|[AP]M",
    re.I,
)
_BEFORE_BRACKET = re.compile(r"(?<=[^\W\d_]) (?=[\[(][^\[\]()\s]+[\])](?:\s|$))")
_RULE = re.compile(r"[-=_+|:,;\s]*[-=_]{3}[-=_+|:,;\s]*")
_ENCLOSED = re.compile(r'"[^"]*"|\[[^\]]*\]|\([^)]*\)')
_NUMBERS_IN_SPACES = re.compile(r"\s*(?:[+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?(?:\s+|$)){2,}")
_NAMES_UNITS = re.compile(r"(?:^|[\W_])(?:units?|einheit(?:en)?)(?:[\W_]|$)", re.I)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2}(\.\d{3})+,\d*\s*")
#: Whole thousands, ``1,063``: with a decimal point a number of thousands, else perhaps a decimal.
WHOLE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


class RowShape(NamedTuple):
    """The shape of a row of numbers.

    Attributes
    ----------
    delimiter : str
        Delimiter of its cells; empty if there is no row.
    cells, numbers : int
        How many of each it has.
    key : str
        Its first cell; empty if that is a number.
    """

    delimiter: str = ""
    cells: int = 0
    key: str = ""
    numbers: int = 0


_NO_ROW = RowShape()


@dataclass(slots=True)
class NumberBlock:
    """A block of numbers: rows of one shape below one header.

    Attributes
    ----------
    header, first, last : int
        Index of the line of its header (or of the first row, if it has none), of its first row, and
        of the line below its last row (0 without rows).
    named : bool
        Whether it has a header.
    shape : RowShape
        That of its first row.
    rows, numbers : int
        Its size.
    keys : set of str
        First words of its rows, if they are not numbers.
    others : list of int
        Lines, counted from 1, at which smaller blocks with a header begin.
    """

    header: int = 0
    first: int = 0
    last: int = 0
    named: bool = False
    shape: RowShape = _NO_ROW
    rows: int = 0
    numbers: int = 0
    keys: set[str] = field(default_factory=set)
    others: list[int] = field(default_factory=list)

    def add_row(self, line: int, numbers: int) -> None:
        """Count a row."""
        self.last = line + 1
        self.rows += 1
        self.numbers += numbers

    @property
    def score(self) -> int:
        """Its numbers, twice with a header; 0 for lines of a name and a value."""
        is_list = 2 * len(self.keys) > self.rows or (self.keys and not self.named)
        return 0 if is_list else (1 + self.named) * self.numbers


@frozen
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
        Lines ``# name: words`` above the header, lines of a name and a value in the text above it,
        and assumptions.
    first : int
        Number of lines above the first sample.
    settings : dict of float
        Settings in the text above the header: see :class:`Recording`.
    table : NumberBlock
        Where the table is among the given lines.
    place : str
        Begin of the table and the text there, for messages; empty if it is the first line.
    clocks : dict of str
        For samples side by side, each column to the time of its sample.
    """

    header: list[str]
    delimiter: str
    decimal: str
    units: dict[str, str]
    notes: dict[str, str]
    first: int
    settings: dict[str, float]
    table: NumberBlock
    place: str
    clocks: dict[str, str] = field(default_factory=dict)


def detect_layout(lines: Sequence[str], source: str, header_row: int | None = None) -> TextLayout:
    """Return the layout of a table, from its first lines.

    Parameters
    ----------
    lines : sequence of str
        The first lines of the file.
    source : str
        Name of the file, for errors.
    header_row : int, optional
        Line of the header, counted from 1. Default: above the largest block of numbers.

    Raises
    ------
    RecordingError
        There is neither a header nor a sample.
    """
    comments = _read_comments(lines)
    table = _find_table(lines, comments.lines, source, header_row)
    body = lines[table.header :]
    if not body and not comments.notes:
        raise RecordingError(f"{source}: the file is empty; expected a header and samples")
    report = [line for line in lines[comments.lines : table.header] if line.strip()]
    delimiter = comments.delimiter or table.shape.delimiter or _common_delimiter(body)
    header = _names(body[0], delimiter) if body else []
    has_header = table.named or (not report and _are_counted(header))
    if not has_header:
        header = _read_commented_header("" if report else comments.last, header, delimiter)
    first = int(has_header)
    _check_header(header, table.header + first, source)
    size = _size_of_repeat(header, table.shape.numbers)
    names = _make_names_unique(_name_samples(header, size))
    decimal = _decimal_mark(body[max(first, table.first - table.header) :][:TRIED], delimiter)
    notes = comments.notes
    if not has_header and header[0] == "column 1":
        notes["header"] = "none: the columns are numbered"
    if decimal == ",":
        notes["decimal mark"] = "comma"
    description = _read_description(report, delimiter, decimal)
    may_be_blank = size + len(report) > 0
    unit_rows = _read_unit_rows(body[first:], names, delimiter, decimal, may_be_blank=may_be_blank)
    units = {name: unit for name in names if (unit := unit_in_name(name))}
    for row in unit_rows:
        units |= row
    if report:
        units = _read_units_of_report(report, names, delimiter, units)
    clocks = _clocks_of_samples(names, size, units)
    is_plain = not report and header_row is None and table.rows > 0
    return TextLayout(
        names,
        delimiter,
        decimal,
        units,
        dict(description[:MOST_NOTES]) | notes,
        table.header + first + len(unit_rows),
        dict(filter(None, starmap(_read_setting, description))),
        table,
        "" if is_plain else _describe_place(table.header + 1, names),
        clocks,
    )


def _describe_place(row: int, names: Sequence[str]) -> str:
    listed = shown(", ".join(names), 80)
    return f"palpate takes line {row} for the header: {listed}; --header-row N names another"


# The comments above the table, or above the report that holds it.


class _Comments(NamedTuple):
    """The lines of comments at the begin of a file.

    Attributes
    ----------
    lines : int
        How many.
    notes : dict of str
        Those of a name and words.
    last : str
        The last one, which may be the header; empty if it is a note.
    delimiter : str
        The delimiter that they state; empty without.
    """

    lines: int
    notes: dict[str, str]
    last: str
    delimiter: str


def _read_comments(lines: Sequence[str]) -> _Comments:
    notes: dict[str, str] = {}
    last = ""
    delimiter = ""
    for count, line in enumerate(lines):
        text = line.strip()
        if text[:4].lower() == "sep=" and len(text) <= 5:  # written by Excel
            delimiter = line.strip("\r\n")[4:5] or delimiter
        elif text[:1] in ("#", "%"):
            name, colon, value = text.lstrip("#% ").partition(": ")
            if name and colon:
                notes[name] = value.strip()
            last = "" if colon else text
        elif text:
            return _Comments(count, notes, last, delimiter)
    return _Comments(len(lines), notes, last, delimiter)


# The table: the largest block of numbers.


def _find_table(lines: Sequence[str], top: int, source: str, header_row: int | None) -> NumberBlock:
    if header_row is None:
        table = _largest_block(lines, top)
        if 2 * table.rows < len(lines):
            _refuse_steps(lines, source)
        return table
    if header_row > len(lines):
        raise RecordingError(
            f"{source}: --header-row {header_row} is below the lines in which a table begins, "
            f"{len(lines)}; pass that of the column names"
        )
    shape = _largest_block(lines, header_row).shape
    return NumberBlock(header_row - 1, header_row, len(lines), named=True, shape=shape)


def _refuse_steps(lines: Sequence[str], source: str) -> None:
    """Refuse a text that repeats lines of several words and sizes for each step."""
    rows = [re.split(r"[,;:\s]+", line.strip(" ,;:")) for line in lines if line.strip()]
    counts = Counter(cells[0] for cells in rows if cells[0].isidentifier())
    words = [word for word, count in counts.items() if count > 2]
    sizes = {len(cells) for cells in rows if cells[0] in words}
    alternate = sum(a[0] != b[0] and a[0] in words for a, b in pairwise(rows))
    if len(words) > 2 and len(sizes) > 1 and 2 * alternate > len(rows):
        raise RecordingError(
            f"{source}: this is no table: it has a block of lines for each step, with "
            f"{', '.join(words[:4])}; write one row for each step, with time, position and force"
        )


def is_other_table(lines: Sequence[str]) -> bool:
    """Whether lines of words within a table, and the row below them, begin another table."""
    table = _largest_block(lines, 0)
    return table.named and table.header > 0


def _largest_block(lines: Sequence[str], top: int) -> NumberBlock:
    """Return the block with most numbers; blocks below the same header count together."""
    blocks = _list_blocks(lines, top)
    best = max(blocks, key=lambda block: block.score, default=NumberBlock())
    if not best.score:
        return NumberBlock(top, top, named=True)
    if not best.named:
        _find_short_header(best, lines, top)
    tables = [block for block in blocks if block.named and block.rows > 2 and block.score]
    best.others = [block.header + 1 for block in tables if block is not best]
    return best


def _list_blocks(lines: Sequence[str], top: int) -> Collection[NumberBlock]:
    blocks: dict[tuple[str, str, int, bool], NumberBlock] = {}
    above: list[int] = []  # lines without numbers since the last row
    title = ""
    block = NumberBlock()
    delimiter, cells, key, numbers = _NO_ROW
    for k in range(top, len(lines)):
        line = lines[k]
        # Most rows have the shape of the row above; skipping their analysis saves most of the time.
        is_same = line[:1].isdecimal() and line.count(delimiter) == cells - 1 and not key
        if k == block.last and is_same:
            block.add_row(k, numbers)
            continue
        shape = _row_shape(line)
        if shape is None:
            above.append(k)
            continue
        delimiter, cells, key, numbers = shape
        header = _find_header(lines, above, shape)
        previous = blocks.get((title, delimiter, cells, not key))
        if previous is not None and above == [previous.last]:  # one bad row is no header
            header = None
        above.clear()
        begin = k
        if header is not None:
            begin = header
            title = lines[header].strip()
        new = NumberBlock(begin, k, named=header is not None, shape=shape)
        block = blocks.setdefault((title, delimiter, cells, not key), new)
        block.add_row(k, numbers)
        block.keys.update([key] if key else ())
    return blocks.values()


def _find_short_header(block: NumberBlock, lines: Sequence[str], top: int) -> None:
    """Find a header that is short, or is above rows that look like words."""
    filled = [k for k in range(top, block.first) if lines[k].strip()]
    if not filled:
        return
    line = lines[filled[0]]
    has_cells = any(mark in line for mark in DELIMITERS)
    has_cells = has_cells or len(_names(line, block.shape.delimiter)) > 1
    is_alone = len(filled) == 1 and (has_cells or len(line) > LONGEST_NAME)
    if is_alone or _find_header(lines, filled[:1], block.shape) is not None:
        block.header = filled[0]
        block.first = filled[0] + 1
        block.named = True


def _row_shape(line: str) -> RowShape | None:
    """Return the shape of a row; None for words."""
    if not any(map(str.isdecimal, line)):
        return None
    bare = _ENCLOSED.sub("", line)
    has_spaces = " " in bare.strip()
    mark = next((mark for mark in ";\t|," if mark in bare), SPACES if has_spaces else ",")
    if mark in "\t," and has_spaces and _NUMBERS_IN_SPACES.fullmatch(line):
        mark = SPACES
    cells = [cell.strip() for cell in split_cells(line, mark)]
    numeric = [bool(cell) and all(map(_NUMERIC.fullmatch, cell.split())) for cell in cells]
    numbers = sum(numeric)
    texts = sum(map(bool, cells)) - numbers
    if not numbers or numbers < texts + (mark == SPACES and texts > 0):
        return None
    return RowShape(mark, len(cells), "" if numeric[0] else cells[0], numbers)


# The header.


def _find_header(lines: Sequence[str], above: Sequence[int], shape: RowShape) -> int | None:
    """Return the line above a row that names its cells; blank lines and units may lie between."""
    least = min(shape.numbers, shape.cells)
    for k in reversed(above):
        cells = _names(lines[k].strip(" \r\n"), shape.delimiter)
        filled = [cell for cell in cells if cell]
        if not filled or _RULE.fullmatch(lines[k]) or _are_units(filled):
            continue
        if len(cells) == shape.cells and _are_starts(cells):
            continue
        is_second = k - 1 in above and len(_names(lines[k - 1], shape.delimiter)) == len(cells)
        if is_second and _are_units(filled, 0.5):
            continue
        are_names = all(re.search(r"[^\W\d_]", cell) for cell in filled)
        fit = least <= len(cells) <= shape.cells + 2 and 2 * len(filled) >= least
        fit = fit or _size_of_repeat(cells, shape.numbers) > 0
        return k if are_names and fit else None
    return None


def _names(line: str, delimiter: str) -> list[str]:
    """The cells of a header; a space before a bracket is no delimiter: ``Time (s)``."""
    line = line.lstrip("# ") if line.startswith("#") else line
    if delimiter == SPACES:
        line = _BEFORE_BRACKET.sub("\0", line)
    return [cell.replace("\0", " ").strip() for cell in split_cells(line, delimiter)]


def _are_counted(names: Sequence[str]) -> bool:
    """Whether columns are numbered, as pandas numbers those without names."""
    counted = [str(place) for place in range(len(names))]
    return names in (counted, ["", *counted[:-1]])


def _read_commented_header(comment: str, row: Sequence[str], delimiter: str) -> list[str]:
    """The names in the last comment, as rostopic and NumPy write them; else numbered columns.

    In ``%time,field.x`` the sign belongs to the name, in ``# time, force`` it does not.
    """
    line = comment.lstrip("# ")
    line = line.lstrip("% ") if line.startswith("% ") else line
    names = _names(line, delimiter)
    if line and len(names) == len(row):
        return names
    return [f"column {place}" for place in range(1, len(row) + 1)]


def _check_header(header: Sequence[str], row: int, source: str) -> None:
    if not header:
        raise RecordingError(f"{source}: the file has only notes; expected a header and samples")
    longest = max(map(len, header))
    if longest > LONGEST_NAME:
        raise RecordingError(
            f"{source}: row {row} is not a header: one of its cells has {longest} characters"
        )
    if len(header) > MOST_COLUMNS:
        raise RecordingError(
            f"{source}: the header has {len(header)} columns; palpate reads at most {MOST_COLUMNS}"
        )


def _make_names_unique(names: Sequence[str]) -> list[str]:
    """The names; repeated and empty ones get their column number."""
    times = Counter(names)
    unique: dict[str, None] = {}
    for place, name in enumerate(names, start=1):
        if not name or times[name] > 1:
            name = f"{name} (column {place})".strip()
        while name in unique:
            name += " (2)"
        unique[name] = None
    return list(unique)


# Samples side by side: the same names again and again, or names above the first sample only.


def _size_of_repeat(header: Sequence[str], numbers: int) -> int:
    """The number of columns of a sample; 0 if no names repeat."""
    named = [*header]
    while named and not named[-1]:
        named.pop()
    repeats = bool(named and named[0]) and named.count(named[0]) > 1
    size = named.index(named[0], 1) if repeats else len(named)
    filled = [name for name in named[:size] if name]
    if not 1 < len({*filled}) == len(filled) < numbers:
        return 0
    # Without the border after the last sample; or without names from the second sample on.
    count = len(named) + (not named[size - 1]) if repeats else len(header)
    same = all(name == named[k % size] for k, name in enumerate(named))
    is_whole = size < count and count % size == 0
    return size if same and is_whole and (repeats or filled == named) else 0


def _are_starts(cells: Sequence[str]) -> bool:
    """Whether cells are filled at equal distances from the first on: names of samples."""
    starts = [place for place, cell in enumerate(cells) if cell]
    return len(starts) > 1 and starts[1] > 1 and starts == [*range(0, len(cells), starts[1])]


def _name_samples(header: list[str], size: int) -> list[str]:
    """The names after the number of their sample: ``sample 2/Force``."""
    if not size:
        return header
    names = [header[k % size] for k in range(len(header))]
    return [name and f"sample {1 + k // size}/{name}" for k, name in enumerate(names)]


def _clocks_of_samples(names: Sequence[str], size: int, units: dict[str, str]) -> dict[str, str]:
    """The time of each column of samples side by side, which share the units of the first one."""
    clocks: dict[str, str] = {}
    for k in range(0, len(names), size) if size else ():
        sample = names[k : k + size]
        units |= {a: units[b] for a, b in zip(sample, names, strict=False) if b in units} | units
        times = [name for name in sample if is_timelike(name) or units.get(name) in UNITS["time"]]
        clocks |= dict.fromkeys(sample, *times[:1]) if times else {}
    return clocks


# Units: in rows below the header, in lines above it, or by the kind of the report.


def _read_unit_rows(
    lines: Iterable[str], names: Sequence[str], delimiter: str, decimal: str, *, may_be_blank: bool
) -> list[dict[str, str]]:
    """The units in the rows between the header and the first sample; none in a rule."""
    rows: list[dict[str, str]] = []
    for line in lines:
        units = _read_units(line, names, delimiter, decimal)
        if units is None and not _RULE.fullmatch(line) and (line.strip() or not may_be_blank):
            break
        rows.append(units or {})
    return rows


def _read_units(
    line: str, names: Sequence[str], delimiter: str, decimal: str
) -> dict[str, str] | None:
    """The units in a line below the header; None if it is not a row of units."""
    cells = [cell.strip() for cell in split_cells(line, delimiter)]
    if len(cells) > 1:
        cells += [""] * (len(names) - len(cells))
    if len(cells) != len(names) or any(_is_number(cell, decimal) for cell in cells):
        return None
    if _are_starts(cells):
        return {}
    units = {name: plain_unit(cell) for name, cell in zip(names, cells, strict=True)}
    filled = list(filter(None, units.values()))
    known = sum(unit in KNOWN or unit in OTHER_UNITS for unit in filled)
    if KNOWN.isdisjoint(filled) or 2 * known < len(filled):  # other words in brackets are no units
        return {} if filled and _are_units([cell for cell in cells if cell]) else None
    return {name: unit for name, unit in units.items() if unit not in ("", "-", "–")}


def _is_number(cell: str, decimal: str) -> bool:
    return cell != "1" and parse_number(cell, decimal) is not None  # as a unit, 1 is one


def _are_units(filled: Sequence[str], least: float = 1.0) -> bool:
    """Whether all cells, or more than a fraction of them, are units or in brackets."""
    units = sum(
        (cell[0] + cell[-1] in ("[]", "()", "<>") and len(cell) > 1 and "DATA" not in cell.upper())
        or plain_unit(cell) in KNOWN
        or plain_unit(cell) in OTHER_UNITS
        for cell in filled
    )
    return units == len(filled) or units > least * len(filled)


def _read_units_of_report(
    report: Sequence[str], names: Sequence[str], delimiter: str, units: dict[str, str]
) -> dict[str, str]:
    """The units of columns, and those that only a report states."""
    units = _read_units_above(report, names, delimiter) | units
    if any(line.strip() == "endheader" for line in report):  # OpenSim writes SI units
        # Names of translations end in _tx, _ty, _tz.
        units |= {name: "m" for name in names if re.search(r"_t[xyz]$", name)}
    elif not any(map(find_unit, names)) and not units:
        units = {name: UNSTATED for name in names if not is_timelike(name)}
    return units | {name: "s" for name in names if name.startswith("X_Value")}  # LabVIEW's time


def _read_units_above(
    report: Iterable[str], names: Sequence[str], delimiter: str
) -> dict[str, str]:
    """Units that a line above the header lists, such as LabVIEW's ``Y_Unit_Label``."""
    for line in report:
        label, *cells = [cell.strip() for cell in split_cells(line.strip(), delimiter)]
        units = [plain_unit(cell) for cell in cells if cell]
        if not units or not _NAMES_UNITS.search(label) or KNOWN.isdisjoint(units):
            continue
        # LabVIEW lists the units of all columns but the times, X_Value, and the comments.
        measured = [name for name in names if not name.startswith(("X_Value", "Comment"))]
        for columns in (measured, names):
            if len(columns) == len(units):
                return dict(zip(columns, units, strict=True))
    return {}


# The description: lines of a name and a value above the table, some of them settings.


def _read_description(report: Iterable[str], delimiter: str, decimal: str) -> list[tuple[str, str]]:
    """Names and values in lines of text, the latter with decimal points."""
    pairs = []
    for line in report:
        marks = [mark for mark in (delimiter, "\t", ";") if mark.strip(" ") and mark in line]
        cells = split_cells(line, marks[0]) if marks else [line]
        filled = [cell.strip() for cell in cells if cell.strip()]
        if len(filled) == 1:
            filled = re.split(r":\s+|\s*=\s*", filled[0], maxsplit=1)
        value = " ".join(filled[1:])
        if decimal == ",":
            value = _DECIMAL_COMMA.sub(lambda number: number[0].replace(",", "."), value)
        if value and (name := filled[0].strip(" :=#%")):
            pairs.append((name[:100], value[:200]))
    return pairs


_RATES = {"": 1.0, "Hz": 1.0, "kHz": 1e3}
_PERIODS = {"": 1.0, **UNITS["time"]}
_LENGTHS = UNITS["penetration"]
_AREAS = {f"{unit}{square}": size**2 for unit, size in _LENGTHS.items() for square in ("²", "^2")}
#: Words of settings that palpate uses, with their units in SI.
_SETTINGS: dict[str, tuple[str, dict[str, float]]] = {
    "(sampl|acqui|log|data|mess|abtast).*(rate|freq)|^fs$": ("rate", _RATES),
    "(sampl|acqui|data|mess).*(interval|period)|^delta_x$": ("interval", _PERIODS),
    "(tip|probe|indenter|ball|sphere).*radius": ("tip radius", _LENGTHS),
    "(tip|probe|indenter|ball|sphere).*diameter": ("tip diameter", _LENGTHS),
    "spring const|^k$": ("spring constant", {"N/m": 1.0, "mN/m": 1e-3, "N/mm": 1e3}),
    "(specimen|sample).*(height|thickness|length)": ("specimen height", _LENGTHS),
    "(specimen|sample).*diameter": ("specimen diameter", _LENGTHS),
    "(specimen|sample).*area": ("specimen area", _AREAS),
}
_VALUE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\W\d]\S*)?.*")


def _read_setting(name: str, value: str) -> tuple[str, float] | None:
    """A setting that a report states, and its value in SI; None for other lines.

    The unit is in the name or behind the number; a rate and an interval need none.
    """
    stated = find_unit(name) or ""
    bare = name.replace(stated, "").strip(" ()[],:_") if stated else name
    fitting = (what for pattern, what in _SETTINGS.items() if re.search(pattern, bare, re.I))
    setting, sizes = next(fitting, ("", {}))
    number = _VALUE.fullmatch(value)
    size = sizes.get(plain_unit(number[2] or stated), 0.0) if number else 0.0
    amount = size * float(number[1]) if number else 0.0
    if not 1e-12 < amount < 1e12:
        return None
    inferred = {"interval": ("rate", 1.0 / amount), "tip diameter": ("tip radius", 0.5 * amount)}
    return inferred.get(setting, (setting, amount))


# The cells of a line, and the numbers in them.


def _common_delimiter(lines: Iterable[str]) -> str:
    """The delimiter that the first line has most often, for lines without numbers."""
    bare = _ENCLOSED.sub("", next(filter(str.strip, lines), ""))
    most = max(DELIMITERS, key=bare.count)
    return most if most in bare or " " not in bare.strip() else SPACES


def _decimal_mark(lines: Iterable[str], delimiter: str) -> str:
    """The decimal mark: the one with which more cells are numbers.

    A comma before three digits may be between thousands, if there are points too.
    """
    commas = points = either = 0
    for line in lines:
        if "," not in line or (delimiter == "," and '"' not in line):
            points += line.count(".")
            continue
        for cell in map(str.strip, split_cells(line, delimiter)):
            if WHOLE_THOUSANDS.fullmatch(cell):
                either += 1
            else:
                commas += bool(_DECIMAL_COMMA.fullmatch(cell))
            points += "." in cell and parse_number(cell, ".") is not None
    return "," if commas > points or (either and not points) else "."


def split_cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; the delimiter space means any run of spaces and tabs."""
    if '"' not in line:
        return line.split() if delimiter == " " else line.split(delimiter)
    if delimiter == " ":
        line = line.replace("\t", " ").strip(" ")
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a cell is too long
        return line.split(delimiter)


def parse_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, with this decimal mark; None for any other text."""
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


def parse_vector(cell: str, decimal: str) -> list[float] | None:
    """Return the numbers of a cell with several, as robot loggers write them.

    ``[0.1, 0.2, 0.3]``, ``(0.1 0.2 0.3)``, ``array([0.1, 0.2])`` or ``0.1 0.2 0.3``; None for
    anything else, and for one number without brackets.
    """
    if len(cell) > LONGEST_VECTOR:
        return None
    bare = _BRACKETS.sub(" ", cell)
    spaced = (bare if decimal == "," else bare.replace(",", " ")).replace(";", " ")
    numbers = [parse_number(number, decimal) for number in spaced.split()]
    least = 2 if bare == cell else 1  # a plain number is no vector
    if not least <= len(numbers) <= MOST_ELEMENTS or None in numbers:
        return None
    return [number for number in numbers if number is not None]


def has_open_quote(line: str) -> bool:
    """Whether a quoted cell begins in a line and does not end there."""
    return line.count('"') % 2 == 1
