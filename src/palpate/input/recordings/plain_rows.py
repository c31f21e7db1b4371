"""Texts rewritten as plain tables: with names and units in each cell, or in comments of JPK."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

from palpate.input.recordings.text_layout import TextLayout
from palpate.input.recordings.units import KNOWN, OTHER_UNITS, plain_unit

TRIED = 50  # lines that show the words
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_UNIT = r"(?:[ \t]*([^\W\d][^\s,;|:=]*|%)(?=[\s,;|]|$))?"
_CELL = re.compile(rf"[ \t]*{_NUMBER}{_UNIT}[ \t]*")
_NAMED = re.compile(rf"[\s,;|]*([^\W\d][^,;|:=]{{0,60}}?)[ \t]*[:=][ \t]*{_NUMBER}{_UNIT}")
_WORD = re.compile(r"\d[ \t]*(?![eE][+-]?\d)(?:[^\W\d_]|%)|[:=]")
_CLOCK = r"(?:[\d:.]+ -> )?"  # of the Arduino's serial monitor
_COMMENTS = re.compile(rb"^(?:(?:#.*)?\n)+", re.MULTILINE)
_COLUMNS = b"# columns: "
_UNITS = b"# units: "
#: Channels in texts of JPK, with the names in its other files; a segment has its own time.
_NAMES_OF_JPK = {
    b"verticalTipPosition": b'"tip position"',
    b"vDeflection": b"deflection",
    b"measuredHeight": b'"height (measured)"',
    b"height": b'"height (piezo)"',
    b"time": b'"time of the segment"',
    b"seriesTime": b"time",
}
_OF_JPK = re.compile(rb"(?<![^ \n])(?:" + b"|".join(_NAMES_OF_JPK) + rb")(?![^ \n])")

#: Delimiter, names (empty without any) and units (None in a cell without a number) of a row.
_Words: TypeAlias = tuple[str, tuple[str, ...], tuple[str | None, ...]]


class PlainRows(NamedTuple):
    """How lines become rows of a plain table; names and units are those that each row repeats."""

    rewrite: Callable[[bytes], bytes]
    names: Sequence[str] = ()
    units: Sequence[str | None] = ()

    def add_to(self, layout: TextLayout) -> TextLayout:
        """Return the layout of the plain table with these names and units."""
        if len(layout.header) != len(self.units):
            return layout
        header = [*(self.names or layout.header)]
        notes = {name: note for name, note in layout.notes.items() if name != "header"}
        stated = zip(header, self.units, strict=True)
        units = layout.units | {name: plain_unit(unit) for name, unit in stated if unit}
        return replace(layout, header=header, units=units, notes=notes)


def find_plain_rows(head: str, encoding: str) -> PlainRows | None:
    """Return how to rewrite a text, from its first lines; None if it is plain.

    Cells of ``Time: 12 ms, Force: 0.4 N`` become bare numbers. A comment ``# columns: …`` of JPK
    moves down to its rows, with that of the units: such comments separate the segments.
    """
    if _COLUMNS.decode() in head:
        return PlainRows(partial(_COMMENTS.sub, _move_header_down))
    filled = [line for line in head.split("\n")[-TRIED:] if line.strip()]
    found = Counter(filter(None, map(_read_words, filled)))
    words, count = next(iter(found.most_common(1)), (None, 0))
    if words is None or 2 * count <= len(filled):
        return None
    mark, names, units = words
    cells = [_pattern_of(unit, mark) for unit in units]
    border = f"[ \t]*[{mark}][ \t]*"
    if names:
        border = "[ \t,;|]*"
        named = zip(names, cells, strict=True)
        cells = [rf"{re.escape(name)}[ \t]*[:=][ \t]*{cell}" for name, cell in named]
    row = re.compile(
        f"^{_CLOCK}[ \t]*{border.join(cells)}[ \t,;|]*$".encode(encoding), re.MULTILINE
    )
    numbers = mark.join(rf"\{place}" for place in range(1, len(cells) + 1))
    return PlainRows(partial(row.sub, numbers.encode()), names, units)


def _pattern_of(unit: str | None, mark: str) -> str:
    if unit is None:
        return f"([^{mark}\n]*)"
    return rf"({_NUMBER})[ \t]*{re.escape(unit)}" if unit else f"({_NUMBER})"


def _read_words(line: str) -> _Words | None:
    """Return the words of a line; None without units of numbers and without names."""
    if not _WORD.search(line):
        return None
    line = re.sub(_CLOCK, "", line, count=1).rstrip()
    named = _NAMED.findall(line)
    if len(dict(named)) == len(named) > 1 and not _NAMED.sub("", line).strip(" \t,;|"):
        names, units = zip(*named, strict=True)
        return (";", names, units) if all(map(_is_unit, units)) else None
    mark = next((mark for mark in ";\t|," if mark in line), None)
    cells = map(_CELL.fullmatch, line.split(mark))
    read = tuple(cell and (cell[1] or "") for cell in cells)
    return (mark, (), read) if mark and any(read) and all(map(_is_unit, read)) else None


def _is_unit(unit: str | None) -> bool:
    return not unit or plain_unit(unit) in KNOWN or plain_unit(unit) in OTHER_UNITS


def _move_header_down(comments: re.Match[bytes]) -> bytes:
    """Return a block of comments with the names and units of its columns, bare, as last lines."""
    lines = re.findall(rb".*\n", comments[0])
    stated = [line for key in (_COLUMNS, _UNITS) for line in lines if line.startswith(key)]
    others = [line for line in lines if line not in stated]
    if comments.start():  # the notes are those of the first segment
        others = [b"\n"] * len(others)
    rows = b"".join([*others, *(line.partition(b": ")[2] for line in stated)])
    return _OF_JPK.sub(lambda name: _NAMES_OF_JPK[name[0]], rows)
