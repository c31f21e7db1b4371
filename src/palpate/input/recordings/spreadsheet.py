"""Spreadsheets (.xlsx), read with openpyxl: the text reader parses the table of each sheet."""

import csv
import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from openpyxl import load_workbook

from palpate.errors import list_names
from palpate.input.recordings.opening import TEXT, Draft, Request, check_members
from palpate.input.recordings.recording import Recording
from palpate.input.recordings.times import SECONDS, clock_rank
from palpate.validation import Values
from palpate.writing import temporary_file

_MOST_ROWS = 1 << 20  # limit of Excel; a row may state a number far beyond it
_CELL = 60  # bytes that a cell takes as a Python object
_COPIES = 4  # of a text, from the cell to the text reader
_PADDING = 10  # bytes of a missing cell, as text and as a number
# Fewest samples of a contact; a shorter table next to longer ones is a list of results.
_FEWEST_ROWS = 20
_NO_TABLE = "holds no table of numbers; expected names above columns of numbers"
_FORMULAS = "has formulas without values; open it in a spreadsheet program and save it again"

_Row: TypeAlias = tuple[Any, ...]


def read(path: Path, request: Request) -> Recording:
    """Read the table of each sheet; if there are several, each is a group and a contact.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read; ``sheet`` chooses one sheet.

    Raises
    ------
    RecordingError
        The file is no spreadsheet, is damaged, has no such sheet, or none of them holds a table.
    """
    draft = Draft(request)
    tables: dict[str, Recording] = {}
    with path.open("rb") as file:
        with _damage_explained(draft):
            check_members(file, request, partial(_largest_member, request))
            book = load_workbook(file, read_only=True, data_only=True)
        for name in _chosen_sheets([sheet.title for sheet in book.worksheets], draft):
            with _damage_explained(draft):
                rows = _read_rows(book[name], draft)
            table = _parse_table(rows, draft) if any(map(any, rows)) else Recording({})
            filled = {n: values for n, values in table.channels.items() if _is_filled(values)}
            if all(values.dtype == object for values in filled.values()):
                filled = {}  # a sheet of text
            if filled:
                tables[name] = replace(table, channels=filled)
            else:
                draft.omit(f"sheet {name!r}", _NO_TABLE)
            if len(filled) < len(table.channels):
                with _damage_explained(draft):
                    if _has_formulas(file, name):
                        draft.lose(f"sheet {name!r}", _FORMULAS)
    if not tables:
        raise draft.error([*draft.losses, *draft.omissions, "the file holds no sheet of cells"][0])
    counts = {name: len(table.rows or ()) for name, table in tables.items()}
    for name, count in counts.items():
        if count < _FEWEST_ROWS <= max(counts.values()):
            draft.omit(f"sheet {name!r}", f"holds only {count} rows of numbers")
            del tables[name]
    return _join_tables(tables, draft)


@contextmanager
def _damage_explained(draft: Draft) -> Iterator[None]:
    """Name the file and the remedy if openpyxl cannot read it; it raises many types."""
    what = "the spreadsheet is damaged or has a password"
    remedy = "open it in a spreadsheet program and save it again"
    with draft.request.explain_damage(what, remedy, (Exception,)), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # extensions and styles that openpyxl does not know
        yield


def _largest_member(request: Request, name: str) -> int:
    return request.max_size if name.startswith("xl/worksheets/") else request.largest_block


def _chosen_sheets(names: Sequence[str], draft: Draft) -> Sequence[str]:
    sheet = draft.request.sheet
    if sheet is None:
        return names
    by_name = {str(number): name for number, name in enumerate(names, start=1)}
    by_name |= {name: name for name in names}
    if sheet not in by_name:
        raise draft.error(f"no sheet {sheet!r}; pass --sheet with one of {list_names(list(names))}")
    return [by_name[sheet]]


def _read_rows(sheet: Any, draft: Draft) -> list[_Row]:
    """The cells of a sheet up to the last used one; a cell that is only coloured is not used."""
    sheet.reset_dimensions()  # the stated ones may be wrong
    rows: list[_Row] = []
    width = 0
    for k, row in enumerate(sheet.iter_rows(max_row=_MOST_ROWS, values_only=True)):
        if row.count(None) == len(row):
            continue
        reach = width if row[width:].count(None) == len(row[width:]) else len(row)
        used = next(n for n in range(min(reach, len(row)), 0, -1) if row[n - 1] is not None)
        texts = sum(len(cell) for cell in row if isinstance(cell, str))
        draft.request.reserve(_CELL * (used + 1) + 8 * (k - len(rows)) + _COPIES * texts)
        rows += [()] * (k - len(rows))
        rows.append(row[:used])
        width = max(width, used)
    draft.request.reserve(_PADDING * sum(width - len(row) for row in rows if row))
    return rows


def _parse_table(rows: Sequence[_Row], draft: Draft) -> Recording:
    """Parse the table in a sheet with the text reader; no channels without a table.

    Raises
    ------
    RecordingError
        The table has no header, or another defect that the text reader refuses.
    """
    text = io.StringIO()
    lines = csv.writer(text, delimiter="\t", lineterminator="\n")
    width = max((len(row) for row in rows), default=0)
    for row in rows:
        cells = [_as_text(cell) for cell in row]
        lines.writerow([*cells, *[""] * (width - len(cells))] if any(cells) else [])
    with temporary_file("sheet.tsv", [text.getvalue().encode()]) as copy:
        return TEXT.read(copy, replace(draft.request, channels=None, progress=None))


def _as_text(cell: Any) -> str:
    """Format a cell as text that the text reader parses to the same number, time or words."""
    cell = cell.total_seconds() if isinstance(cell, timedelta) else cell
    return "" if cell is None else str(cell)


def _join_tables(tables: dict[str, Recording], draft: Draft) -> Recording:
    """Join tables to one recording: a single table without a group, else a group for each sheet."""
    for sheet, table in tables.items():
        group = f"{sheet}/" if len(tables) > 1 else ""
        clock = _find_clock(table) if group else None
        for name in table.channels:
            draft.channels[group + name] = table.channels[name]
            if clock not in (None, name):
                draft.clocks[group + name] = f"{group}{clock}"
        draft.units |= {group + name: unit for name, unit in table.units.items()}
        draft.faults |= {group + name: fault for name, fault in table.faults.items()}
        draft.notes |= {group + name: text for name, text in table.notes.items()}
        draft.losses += [f"sheet {sheet!r}: {loss}" for loss in table.losses]
    needed = {*filter(draft.request.wants, draft.channels)}
    needed |= {draft.clocks[name] for name in needed if name in draft.clocks}
    if not needed:
        requested = ", ".join(draft.request.channels or ())
        raise draft.error(f"no channel {requested}; available: {list_names(list(draft.channels))}")
    for name in draft.channels.keys() - needed:
        del draft.channels[name]
    return draft.done(table.rows if len(tables) == 1 else None)


def _find_clock(table: Recording) -> str | None:
    """The column with the times: its name or else its unit shows it."""
    ranks = {name: rank for name in table.channels if (rank := clock_rank(name)) is not None}
    timed = [name for name in table.channels if table.unit_of(name) in SECONDS]
    return min(ranks, key=ranks.__getitem__) if ranks else next(iter(timed), None)


def _is_filled(values: Values) -> bool:
    """Whether a column belongs to the table, not to a list of results next to it."""
    count = np.count_nonzero(values != "" if values.dtype == object else values == values)
    return bool(count >= min(_FEWEST_ROWS, 0.1 * len(values)) and count)


def _has_formulas(file: Any, name: str) -> bool:
    """Whether a sheet holds formulas, which without their values look like empty cells."""
    sheet = load_workbook(file, read_only=True)[name]
    rows = sheet.iter_rows(max_row=1000, max_col=100, values_only=True)
    return any(isinstance(cell, str) and cell.startswith("=") for row in rows for cell in row)
