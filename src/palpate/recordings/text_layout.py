"""The layout of a text table, also of one inside a report: notes, header, units, delimiter."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from palpate.errors import RecordingError
from palpate.recordings.recording import (
    KNOWN,
    OTHER_UNITS,
    UNITS,
    UNSTATED,
    find_unit,
    number_in_text,
    plain_unit,
    unit_in_name,
)
from palpate.recordings.times import is_timelike
from palpate.validation import shown

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
    rows, numbers : int
        Its size.
    mark : str
        Delimiter of its cells; empty if there are no numbers.
    keys : set of str
        First words of its rows, if they are not numbers.
    others : list of int
        Lines, counted from 1, at which smaller blocks with a header begin.
    """

    header: int = 0
    first: int = 0
    last: int = 0
    named: bool = False
    rows: int = 0
    numbers: int = 0
    mark: str = ""
    keys: set[str] = field(default_factory=set)
    others: list[int] = field(default_factory=list)

    @property
    def score(self) -> int:
        """Its numbers, twice with a header; 0 for lines of a name and a value."""
        is_list = 2 * len(self.keys) > self.rows or (self.keys and not self.named)
        return 0 if is_list else (1 + self.named) * self.numbers


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


def is_other_table(lines: Sequence[str]) -> bool:
    """Whether lines of words within a table, and the row below them, begin another table."""
    table = _largest_block(lines, 0)
    return table.named and table.header > 0


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
    top, notes, separator = _above(lines)
    table = _largest_block(lines, top)
    if header_row is not None and header_row > len(lines):
        words = f"--header-row {header_row} is below the lines in which a table begins"
        raise RecordingError(f"{source}: {words}, {len(lines)}; pass that of the column names")
    if header_row is not None:
        below = _largest_block(lines, header_row)
        table = NumberBlock(header_row - 1, header_row, len(lines), True, mark=below.mark)
    report = [line for line in lines[top : table.header] if line.strip()]
    if report:
        notes.pop("", None)
    top = table.header
    body = lines[top:]
    if not body and not notes.keys() - {""}:
        raise RecordingError(f"{source}: the file is empty; expected a header and samples")
    delimiter = separator or table.mark or _delimiter(body)
    commented = notes.pop("", None)  # the last comment line, which may be the header
    header = _names(body[0], delimiter) if body else []
    first = 1
    counted = [str(place) for place in range(len(header))]  # as pandas numbers unnamed columns
    if not table.named and (report or header not in (counted, ["", *counted[:-1]])):
        header = _read_commented_header(commented, header, delimiter if body else "")
        first = 0
    if not header:
        raise RecordingError(f"{source}: the file has only notes; expected a header and samples")
    longest = max(map(len, header))
    if longest > LONGEST_NAME:
        words = f"row {top + first} is not a header: one of its cells has {longest} characters"
        raise RecordingError(f"{source}: {words}")
    if first == 0 and header[0] == "column 1":
        notes["header"] = "none: the columns are numbered"
    if len(header) > MOST_COLUMNS:
        raise RecordingError(
            f"{source}: the header has {len(header)} columns; palpate reads at most {MOST_COLUMNS}"
        )
    names = _make_names_unique(header)
    rows = body[max(first, table.first - top) :]
    decimal = _decimal(rows[:TRIED], delimiter)
    if decimal == ",":
        notes["decimal mark"] = "comma"
    units = {name: unit for name in names if (unit := unit_in_name(name))}
    for line in body[first:]:
        stated = _units_below(line, delimiter, len(names), decimal)
        if stated is None and not _RULE.fullmatch(line) and (line.strip() or not report):
            break
        units |= {name: unit for name, unit in zip(names, stated or (), strict=False) if unit}
        first += 1
    described = _read_description(report, delimiter, decimal)
    notes = dict(described[:MOST_NOTES]) | notes
    settings = dict(found for pair in described if (found := _read_setting(*pair)))
    if report:
        units = _units_above(report, names, delimiter) | units
        in_si = any(line.strip() == "endheader" for line in report)  # OpenSim writes SI units
        if in_si:  # names of translations end in _tx, _ty, _tz
            units |= {name: "m" for name in names if re.search(r"_t[xyz]$", name)}
        elif not any(map(find_unit, names)) and not units:
            units = {name: UNSTATED for name in names if not is_timelike(name)}
        units |= {name: "s" for name in names if name.startswith("X_Value")}  # LabVIEW's time
    listed = shown(", ".join(names), 80)
    place = f"palpate takes line {top + 1} for the header: {listed}; --header-row N names another"
    if not report and header_row is None and table.rows:
        place = ""
    return TextLayout(names, delimiter, decimal, units, notes, top + first, settings, table, place)


def _largest_block(lines: Sequence[str], top: int) -> NumberBlock:
    """Return the block with most numbers; blocks below the same header count together."""
    blocks: dict[tuple[str, tuple[str, int, bool]], NumberBlock] = {}
    words: list[int] = []  # lines without numbers since the last row
    title = ""
    mark, count, key, numbers = "", 0, "", 0
    block = NumberBlock()
    for k in range(top, len(lines)):
        line = lines[k]
        # Most rows have the shape of the row above; skipping their analysis saves most of the time.
        if k == block.last and line[:1].isdecimal() and line.count(mark) == count - 1 and not key:
            block.last, block.rows, block.numbers = k + 1, block.rows + 1, block.numbers + numbers
            continue
        row = _row_shape(line)
        if row is None:
            words.append(k)
            continue
        mark, count, key, numbers = row
        header = _header_above(lines, words, mark, count, numbers)
        before = blocks.get((title, (mark, count, not key)))
        if before is not None and words == [before.last]:  # one bad row is no header
            header = None
        words.clear()
        title = title if header is None else lines[header].strip()
        begin = k if header is None else header
        shape = mark, count, not key
        new = NumberBlock(begin, k, named=header is not None, mark=mark)
        block = blocks.setdefault((title, shape), new)
        block.last, block.rows, block.numbers = k + 1, block.rows + 1, block.numbers + numbers
        block.keys.update([key] if key else ())
    best = max(blocks.values(), key=lambda block: block.score, default=NumberBlock(top, top))
    if not best.score:
        return NumberBlock(top, top, named=True)
    filled = [k for k in range(top, best.first) if lines[k].strip()]
    if filled and not best.named:  # the header may be short, or above rows that look like words
        line = lines[filled[0]]
        _, count, _, numbers = _row_shape(lines[best.first]) or ("", 0, "", 0)
        divided = any(each in line for each in DELIMITERS) or len(_names(line, best.mark)) > 1
        alone = len(filled) == 1 and (divided or len(line) > LONGEST_NAME)
        if alone or _header_above(lines, filled[:1], best.mark, count, numbers) is not None:
            best.header, best.first, best.named = filled[0], filled[0] + 1, True
    tables = [each for each in blocks.values() if each.named and each.rows > 2 and each.score]
    best.others = [each.header + 1 for each in tables if each is not best]
    return best


def _row_shape(line: str) -> tuple[str, int, str, int] | None:
    """Delimiter, cells, first cell (empty for a number) and numbers of a row; None for words."""
    if not any(map(str.isdecimal, line)):
        return None
    bare = _ENCLOSED.sub("", line)
    mark = next((mark for mark in ";\t|," if mark in bare), SPACES if " " in bare.strip() else ",")
    if mark in "\t," and " " in bare.strip() and _NUMBERS_IN_SPACES.fullmatch(line):
        mark = SPACES
    cells = [cell.strip() for cell in split_cells(line, mark)]
    numeric = [bool(cell) and all(map(_NUMERIC.fullmatch, cell.split())) for cell in cells]
    numbers, words = sum(numeric), sum(map(bool, cells)) - sum(numeric)
    if numbers < words + (mark == SPACES and words > 0) or not numbers:
        return None
    return mark, len(cells), "" if numeric[0] else cells[0], numbers


def _header_above(
    lines: Sequence[str], words: Sequence[int], delimiter: str, count: int, numbers: int
) -> int | None:
    """Return the line above a row that names its cells; blank lines and units may lie between."""
    least = min(numbers, count)
    for k in reversed(words):
        cells = _names(lines[k].strip(" \r\n"), delimiter)
        filled = [cell for cell in cells if cell]
        has_names_above = k - 1 in words and len(_names(lines[k - 1], delimiter)) == len(cells)
        if not filled or _RULE.fullmatch(lines[k]) or _are_units(filled):
            continue
        if has_names_above and _are_units(filled, 0.5):
            continue
        names = all(re.search(r"[^\W\d_]", cell) for cell in filled)
        fits = least <= len(cells) <= count + 2 and 2 * len(filled) >= least
        return k if names and fits else None
    return None


def _are_units(filled: Sequence[str], least: float = 1.0) -> bool:
    """Whether all cells, or more than a fraction of them, are units or in brackets."""
    units = sum(
        (cell[0] + cell[-1] in ("[]", "()", "<>") and len(cell) > 1 and "DATA" not in cell.upper())
        or plain_unit(cell) in KNOWN
        or plain_unit(cell) in OTHER_UNITS
        for cell in filled
    )
    return units == len(filled) or units > least * len(filled)


def _read_description(report: Iterable[str], delimiter: str, decimal: str) -> list[tuple[str, str]]:
    """Names and values in lines of text, the latter with decimal points."""
    pairs = []
    for line in report:
        marks = [each for each in (delimiter, "\t", ";") if each.strip(" ") and each in line]
        cells = split_cells(line, marks[0]) if marks else [line]
        filled = [cell.strip() for cell in cells if cell.strip()]
        if len(filled) == 1:
            filled = re.split(r":\s+|\s*=\s*", filled[0], maxsplit=1)
        value = " ".join(filled[1:])
        if decimal == ",":
            value = _DECIMAL_COMMA.sub(lambda found: found[0].replace(",", "."), value)
        if value and (name := filled[0].strip(" :=#%")):
            pairs.append((name[:100], value[:200]))
    return pairs


_RATES, _PERIODS = {"": 1.0, "Hz": 1.0, "kHz": 1e3}, {"": 1.0, **UNITS["time"]}
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
    fitting = (what for words, what in _SETTINGS.items() if re.search(words, bare, re.I))
    setting, sizes = next(fitting, ("", {}))
    number = _VALUE.fullmatch(value)
    size = sizes.get(plain_unit(number[2] or stated), 0.0) if number else 0.0
    amount = size * float(number[1]) if number else 0.0
    if not 1e-12 < amount < 1e12:
        return None
    inferred = {"interval": ("rate", 1.0 / amount), "tip diameter": ("tip radius", 0.5 * amount)}
    return inferred.get(setting, (setting, amount))


def _units_above(report: Iterable[str], names: Sequence[str], delimiter: str) -> dict[str, str]:
    """Units that a line above the header lists, such as LabVIEW's ``Y_Unit_Label``."""
    for line in report:
        name, *cells = [cell.strip() for cell in split_cells(line.strip(), delimiter)]
        found = [plain_unit(cell) for cell in cells if cell]
        if not found or not _NAMES_UNITS.search(name) or KNOWN.isdisjoint(found):
            continue
        # LabVIEW lists the units of all columns but the times, X_Value, and the comments.
        others = [n for n in names if not n.startswith(("X_Value", "Comment"))]
        for listed in (others, names):
            if len(listed) == len(found):
                return dict(zip(listed, found, strict=True))
    return {}


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
    """The delimiter that the first line has most often, for lines without numbers."""
    bare = _ENCLOSED.sub("", next(filter(str.strip, lines), ""))
    most = max(DELIMITERS, key=bare.count)
    return most if most in bare or not bare.strip().count(" ") else SPACES


def _names(line: str, delimiter: str) -> list[str]:
    """The cells of a header; a space before a bracket is no delimiter: ``Time (s)``."""
    line = line.lstrip("# ") if line.startswith("#") else line
    if delimiter == SPACES:
        line = _BEFORE_BRACKET.sub("\0", line)
    return [cell.replace("\0", " ").strip() for cell in split_cells(line, delimiter)]


def _read_commented_header(commented: str | None, row: Sequence[str], delimiter: str) -> list[str]:
    """The names in the last comment, as rostopic and NumPy write them; else numbered columns.

    In ``%time,field.x`` the sign belongs to the name, in ``# time, force`` it does not.
    """
    line = (commented or "").lstrip("# ")
    line = line.lstrip("% ") if line.startswith("% ") else line
    names = _names(line, delimiter or _delimiter([line]))
    if line and (len(names) == len(row) or (not row and len(names) > 1)):
        return names
    return [f"column {place}" for place in range(1, len(row) + 1)]


def _units_below(line: str, delimiter: str, width: int, decimal: str) -> list[str] | None:
    """The units in a line below the header; None if it is not a row of units."""
    cells = [cell.strip() for cell in split_cells(line, delimiter)]
    cells += [""] * (width - len(cells)) if len(cells) > 1 else []
    numbers = any(parse_number(cell, decimal) is not None for cell in cells if cell != "1")
    if numbers or len(cells) != width:
        return None
    units = [plain_unit(cell) for cell in cells]
    filled = [unit for unit in units if unit]
    known = sum(unit in KNOWN or unit in OTHER_UNITS for unit in filled)
    if KNOWN.isdisjoint(filled) or 2 * known < len(filled):  # other words in brackets are no units
        return [] if filled and _are_units([cell for cell in cells if cell]) else None
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
        for cell in map(str.strip, split_cells(line, delimiter)):
            if WHOLE_THOUSANDS.fullmatch(cell):
                either += 1
            else:
                commas += bool(_DECIMAL_COMMA.fullmatch(cell))
            points += "." in cell and parse_number(cell, ".") is not None
    return "," if commas > points or (either and not points) else "."


def _make_names_unique(names: Sequence[str]) -> list[str]:
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


def vector_in(cell: str, decimal: str) -> list[float] | None:
    """Return the numbers of a cell with several, as robot loggers write them.

    ``[0.1, 0.2, 0.3]``, ``(0.1 0.2 0.3)``, ``array([0.1, 0.2])`` or ``0.1 0.2 0.3``; None for
    anything else, and for one number without brackets.
    """
    if len(cell) > LONGEST_VECTOR:
        return None
    bare = _BRACKETS.sub(" ", cell)
    words = (bare if decimal == "," else bare.replace(",", " ")).replace(";", " ").split()
    numbers = [parse_number(word, decimal) for word in words]
    bracketed = bare != cell
    if not 1 + (not bracketed) <= len(numbers) <= MOST_ELEMENTS or None in numbers:
        return None
    return [number for number in numbers if number is not None]


def has_open_quote(line: str) -> bool:
    """Whether a quoted cell begins in a line and does not end there."""
    return line.count('"') % 2 == 1


def pad_cells(cells: Sequence[str], width: int) -> list[str] | None:
    """Return the cells, padded to the width of the header; None if there are more."""
    extra = cells[width:]
    if any(map(str.strip, extra)):
        return None
    return [*cells[:width], *[""] * (width - len(cells))]
