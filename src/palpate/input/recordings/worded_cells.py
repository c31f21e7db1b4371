"""Rows that repeat names or units in their cells: ``Time: 12 ms, Force: 0.4 N``."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from palpate.input.recordings.text_layout import TextLayout
from palpate.input.recordings.units import KNOWN, OTHER_UNITS, plain_unit

TRIED = 50  # lines that show the words
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_UNIT = r"(?:[ \t]*([^\W\d][^\s,;|:=]*|%)(?=[\s,;|]|$))?"
_CELL = re.compile(rf"[ \t]*{_NUMBER}{_UNIT}[ \t]*")
_NAMED = re.compile(rf"[\s,;|]*([^\W\d][^,;|:=]{{0,60}}?)[ \t]*[:=][ \t]*{_NUMBER}{_UNIT}")
_WORD = re.compile(r"\d[ \t]*(?![eE][+-]?\d)(?:[^\W\d_]|%)|[:=]")
_CLOCK = r"(?:[\d:.]+ -> )?"  # of the Arduino's serial monitor


class CellWords(NamedTuple):
    """The words that the rows of a text repeat.

    Attributes
    ----------
    mark : str
        Delimiter of the cells of bare numbers.
    names : tuple of str
        The name in each cell; empty without names.
    units : tuple of str or None
        The unit in each cell; None in a cell of anything else than a number.
    """

    mark: str
    names: tuple[str, ...]
    units: tuple[str | None, ...]

    def strip(self, rows: bytes, encoding: str) -> bytes:
        """Return the rows with bare numbers; others unchanged."""
        mark = re.escape(self.mark)
        border = f"[ \t]*{mark}[ \t]*"
        cells = [self._cell(mark, unit) for unit in self.units]
        if self.names:
            border = "[ \t,;|]*"
            named = zip(self.names, cells, strict=True)
            cells = [f"{re.escape(name)}[ \t]*[:=][ \t]*{cell}" for name, cell in named]
        pattern = f"^{_CLOCK}[ \t]*{border.join(cells)}[ \t,;|]*$"
        numbers = self.mark.join(rf"\{place}" for place in range(1, len(cells) + 1))
        return re.sub(pattern.encode(encoding), numbers.encode(), rows, flags=re.MULTILINE)

    @staticmethod
    def _cell(mark: str, unit: str | None) -> str:
        if unit is None:
            return f"([^{mark}\n]*)"
        return f"({_NUMBER})[ \t]*{re.escape(unit)}" if unit else f"({_NUMBER})"

    def add_to(self, layout: TextLayout) -> TextLayout:
        """Return the layout of the bare numbers with these names and units."""
        if len(layout.header) != len(self.units):
            return layout
        header = [*(self.names or layout.header)]
        notes = {name: note for name, note in layout.notes.items() if name != "header"}
        stated = zip(header, self.units, strict=True)
        units = layout.units | {name: plain_unit(unit) for name, unit in stated if unit}
        return replace(layout, header=header, units=units, notes=notes)


def find_cell_words(lines: Sequence[str]) -> CellWords | None:
    """Return the words of most of the last lines; None if these hold none."""
    filled = [line for line in lines[-TRIED:] if line.strip()]
    found = Counter(filter(None, map(_read_words, filled)))
    words, count = next(iter(found.most_common(1)), (None, 0))
    return words if 2 * count > len(filled) else None


def _read_words(line: str) -> CellWords | None:
    """Return the words of a line; None without units of numbers and without names."""
    if not _WORD.search(line):
        return None
    line = re.sub(_CLOCK, "", line, count=1).rstrip()
    named = _NAMED.findall(line)
    if len(dict(named)) == len(named) > 1 and not _NAMED.sub("", line).strip(" \t,;|"):
        names, units = zip(*named, strict=True)
        return CellWords(";", names, units) if all(map(_is_unit, units)) else None
    mark = next((mark for mark in ";\t|," if mark in line), None)
    cells = [_CELL.fullmatch(cell) for cell in line.split(mark)]
    read = tuple(cell and (cell[1] or "") for cell in cells)
    is_worded = mark is not None and any(read) and all(map(_is_unit, read))
    return CellWords(mark or "", (), read) if is_worded else None


def _is_unit(unit: str | None) -> bool:
    return not unit or plain_unit(unit) in KNOWN or plain_unit(unit) in OTHER_UNITS
