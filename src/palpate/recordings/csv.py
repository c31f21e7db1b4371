"""Comma-separated text: a header line, then a sample a row, read and written."""

import codecs
import csv
import io
import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.errors import RecordingError
from palpate.recordings.formats import Request
from palpate.recordings.recording import Recording, number_in_text, printable
from palpate.writing import write_text

# The columns that palpate writes, and their units.
UNITS = {"time_s": "s", "penetration_m": "m", "velocity_m_s": "m/s", "force_N": "N"}

_MARKS = {  # UTF-32 before UTF-16, whose mark it begins with
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


def read(path: Path, request: Request) -> Recording:
    """Read a CSV file: every column of its header, as numbers where all of it are.

    Text in UTF-8 with commas, semicolons or tabs between values. Lines that begin with ``#`` before
    the header are notes; those like ``# name: words`` are kept. Columns of the same name are
    distinguished by their position: ``force_N (column 3)``.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        The file cannot be read, is no text in UTF-8, or has no header.
    """
    table = _Table.read(path)
    columns, rows = table.columns()
    return Recording(
        dict(zip(table.header, columns, strict=True)),
        units={name: unit for name, unit in UNITS.items() if name in table.header},
        source=table.source,
        notes=table.notes,
        rows=rows,
    )


def write_contact(
    contact: Contact,
    path: str | Path,
    notes: Mapping[str, str] | None = None,
    *,
    velocity: bool = False,
) -> None:
    """Write a contact as CSV, whole or not at all, with what is known of it above the header.

    Parameters
    ----------
    contact : Contact
        For instance of :meth:`palpate.lab.Bench.run`. Several segments get a column.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines for its head, before those of the contact's ``provenance``.
    velocity : bool
        Write the velocity too. Most rigs record none, and it is worked out when it is needed.

    Raises
    ------
    RecordingError
        The path cannot be written.
    """
    head = {**(notes or {}), **contact.provenance}
    if not velocity:
        head.pop("velocity", None)
    columns = {"time_s": (contact.time, "%.9g"), "penetration_m": (contact.penetration, "%.7g")}
    if velocity:
        columns["velocity_m_s"] = contact.velocity, "%.7g"
    columns["force_N"] = contact.force, "%.7g"
    if contact.segment[-1:].any():
        columns["segment"] = (contact.segment + 1).astype(np.float64), "%d"
    text = io.StringIO()
    for name, words in head.items():
        text.write(f"# {name}: {' '.join(words.split())}\n")
    text.write(",".join(columns) + "\n")
    table = np.column_stack([values for values, _ in columns.values()])
    np.savetxt(text, table, fmt=[form for _, form in columns.values()], delimiter=",")
    write_text(Path(path), text.getvalue())


@dataclass(frozen=True, slots=True)
class _Table:
    source: str
    notes: dict[str, str]  # what stands above the header as "# name: words"
    header: list[str]
    delimiter: str
    lines: list[str]
    first_row: int  # number of the first sample's line in the file

    @classmethod
    def read(cls, path: Path) -> "_Table":
        source = printable(path)
        lines = _text(path, source).splitlines()
        top = 0
        while top < len(lines) and (not lines[top].strip() or lines[top].startswith("#")):
            top += 1
        body = lines[top:]
        while body and not body[-1].strip():
            body.pop()
        if not body:
            raise RecordingError(f"{source}: the file is empty; expected a header and samples")
        delimiter = max(",;\t", key=body[0].count)
        try:
            names = next(csv.reader([body[0]], delimiter=delimiter))
        except csv.Error as error:
            raise RecordingError(f"{source}: row {top + 1} is not a header: {error}") from None
        return cls(source, _notes(lines[:top]), _told_apart(names), delimiter, body[1:], top + 2)

    def columns(self) -> tuple[list[NDArray[Any]], Sequence[int]]:
        """Every column, and the row of the file that each sample stands in."""
        if not self.lines:
            return [np.empty(0) for _ in self.header], range(0)
        try:
            table = np.loadtxt(
                io.StringIO("\n".join(self.lines)),
                delimiter=self.delimiter,
                usecols=range(len(self.header)),
                ndmin=2,
                quotechar='"',
                comments=None,
            )
            if len(table) != len(self.lines):  # loadtxt passes over blank lines
                raise ValueError
        except (ValueError, IndexError):
            return self._columns_with_text()
        rows = range(self.first_row, self.first_row + len(table))
        return [np.ascontiguousarray(column) for column in table.T], rows

    def _columns_with_text(self) -> tuple[list[NDArray[Any]], Sequence[int]]:
        rows, samples = zip(*self._rows(), strict=True)
        columns = itertools.zip_longest(*samples, fillvalue="")  # a row may be short, or long
        found = [_column(cells) for _, cells in zip(self.header, columns, strict=False)]
        absent = np.full(len(rows), "", dtype=object)
        return found + [absent] * (len(self.header) - len(found)), rows

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        reader = csv.reader(self.lines, delimiter=self.delimiter)
        while True:
            row = self.first_row + reader.line_num
            try:
                fields = next(reader)
            except StopIteration:
                return
            except csv.Error as error:
                raise RecordingError(f"{self.source}: row {row} cannot be read: {error}") from None
            yield row, fields


def _text(path: Path, source: str) -> str:
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = getattr(error, "strerror", None) or "cannot be read"
        raise RecordingError(f"{source}: {reason}; check the path") from None
    for mark, encoding in _MARKS.items():
        if data.startswith(mark):
            raise RecordingError(f"{source}: the text is in {encoding}; save it as UTF-8")
    if b"\0" in data:
        raise RecordingError(f"{source}: not a text file; expected CSV in UTF-8 with a header")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = len((error.object[: error.start].decode() + "x").splitlines())
        raise RecordingError(
            f"{source}: row {row} holds the byte 0x{error.object[error.start]:02X}, which is not "
            "UTF-8 (the text may be in Latin-1 or Windows-1252); save it as UTF-8"
        ) from None


def _told_apart(names: list[str]) -> list[str]:
    """Names without the spaces around them; those that occur twice with their place."""
    header = [name.strip() for name in names]
    times = Counter(header)
    return [
        name if times[name] == 1 else f"{name} (column {place})"
        for place, name in enumerate(header, start=1)
    ]


def _notes(lines: list[str]) -> dict[str, str]:
    named = (line.lstrip("# ").partition(": ") for line in lines)
    return {name: words.strip() for name, colon, words in named if colon}


def _column(cells: Sequence[str]) -> NDArray[Any]:
    """Numbers where all cells are, else text: as objects, for one long cell would widen all."""
    try:
        return np.array([number_in_text(cell) for cell in cells])
    except ValueError:
        return np.array(cells, dtype=object)
