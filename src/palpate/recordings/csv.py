"""Contacts in comma-separated text: a header line, then a sample a row, in SI."""

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.contact import Contact
from palpate.errors import RecordingError
from palpate.validation import Floats


@dataclass(frozen=True, slots=True)
class Columns:
    """Names of the columns; ``velocity`` and ``segment`` may be absent from the file.

    Parameters
    ----------
    time, penetration, force, velocity : str
        Columns in s, m, N and m/s. A velocity column named here other than the default must exist.
    segment : str
        A label that changes where a separate contact begins.
    """

    time: str = "time_s"
    penetration: str = "penetration_m"
    force: str = "force_N"
    velocity: str = "velocity_m_s"
    segment: str = "segment"


def read_contact(
    path: str | Path, *, columns: Columns | None = None, velocity_window: float | None = None
) -> Contact:
    """Read a contact from a CSV file.

    Parameters
    ----------
    path : str or Path
        Text with a header line and commas, semicolons or tabs between values; lines that begin
        with ``#`` before the header are notes; those like ``# name: words`` go to ``made``.
    columns : Columns, optional
        Names of the columns.
    velocity_window : float, optional
        Length of the Savitzky–Golay filter, s, where the file has no velocity.

    Raises
    ------
    RecordingError
        The file cannot be read, lacks a column, holds something other than numbers, has no sample,
        or its time does not increase within a segment.
    """
    path = Path(path)
    names = columns or Columns()
    table = _Table.read(path)
    wanted = [names.time, names.penetration, names.force]
    has_velocity = names.velocity in table.header
    if has_velocity or names.velocity != Columns().velocity:
        wanted.append(names.velocity)
    values = table.numbers(wanted)
    labels = table.words(names.segment) if names.segment in table.header else None
    _check_time(path, names.time, values[0], labels, table.first_row)
    made = dict(table.notes)
    made |= {"penetration": f"column {names.penetration!r}", "force": f"column {names.force!r}"}
    if has_velocity:
        made["velocity"] = f"column {names.velocity!r}"
    return Contact(
        values[0],
        values[1],
        values[3] if len(values) > 3 else None,
        values[2],
        segment=labels,
        source=str(path),
        made=made,
        velocity_window=velocity_window,
    )


def read_columns(path: str | Path, names: list[str]) -> list[Floats]:
    """Return the columns of these names, as floats; errors as :func:`read_contact`."""
    return _Table.read(Path(path)).numbers(names)


@dataclass(frozen=True, slots=True)
class _Table:
    path: Path
    header: list[str]
    delimiter: str
    lines: list[str]
    notes: dict[str, str]  # what stands above the header as "# name: words"
    first_row: int  # number of the first sample's line in the file

    @classmethod
    def read(cls, path: Path) -> "_Table":
        try:
            text = path.read_text(encoding="utf-8-sig")
        except OSError as error:
            raise RecordingError(
                f"{path}: {error.strerror or 'cannot be read'}; check the path"
            ) from None
        except UnicodeDecodeError:
            text = "\0"
        if "\0" in text:
            raise RecordingError(f"{path}: not a text file; expected CSV with a header")
        lines = text.splitlines()
        top = 0
        while top < len(lines) and (not lines[top].strip() or lines[top].startswith("#")):
            top += 1
        body = lines[top:]
        while body and not body[-1].strip():
            body.pop()
        if not body:
            raise RecordingError(f"{path}: the file is empty; expected a header and samples")
        delimiter = max(",;\t", key=body[0].count)
        try:
            header = [name.strip() for name in next(csv.reader([body[0]], delimiter=delimiter))]
        except csv.Error as error:
            raise RecordingError(f"{path}: row {top + 1} is not a header: {error}") from None
        return cls(path, header, delimiter, body[1:], _notes(lines[:top]), top + 2)

    def numbers(self, names: list[str]) -> list[Floats]:
        """The columns of these names, as floats."""
        for name in names:
            if name not in self.header:
                raise RecordingError(
                    f"{self.path}: no column {name!r}; the file has {_listed(self.header)} "
                    "(map other names with --time, --penetration, --force, --velocity)"
                )
            if self.header.count(name) > 1:
                raise RecordingError(
                    f"{self.path}: {self.header.count(name)} columns are named {name!r}; "
                    "rename all but one"
                )
        if not self.lines:
            raise RecordingError(f"{self.path}: a header but no samples")
        positions = [self.header.index(name) for name in names]
        try:
            table = np.loadtxt(
                io.StringIO("\n".join(self.lines)),
                delimiter=self.delimiter,
                usecols=positions,
                ndmin=2,
                quotechar='"',
                comments=None,
            )
            if len(table) != len(self.lines):  # loadtxt passes over blank lines
                raise ValueError
        except (ValueError, IndexError):
            table = np.array([self._row(row, fields, names) for row, fields in self._rows()])
        return [np.ascontiguousarray(column) for column in table.T]

    def words(self, name: str) -> np.ndarray:
        """The column of this name, as text."""
        position = self.header.index(name)
        return np.array(
            [fields[position] if position < len(fields) else "" for _, fields in self._rows()]
        )

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        reader = csv.reader(self.lines, delimiter=self.delimiter)
        while True:
            row = self.first_row + reader.line_num
            try:
                fields = next(reader)
            except StopIteration:
                return
            except csv.Error as error:
                raise RecordingError(f"{self.path}: row {row} cannot be read: {error}") from None
            yield row, fields

    def _row(self, row: int, fields: list[str], names: list[str]) -> list[float]:
        values = []
        for name in names:
            position = self.header.index(name)
            text = fields[position].strip() if position < len(fields) else ""
            try:
                values.append(float(text.replace("_", "?")))  # to Python 1_000 is a number
            except ValueError:
                found = f"{text[:40]!r} is not a number" if text else "the value is missing"
                raise RecordingError(f"{self.path}: column {name!r}, row {row}: {found}") from None
        return values


def _notes(lines: list[str]) -> dict[str, str]:
    named = (line.lstrip("# ").partition(": ") for line in lines)
    return {name: words.strip() for name, colon, words in named if colon}


def _listed(names: list[str]) -> str:
    """The names that a person can read on a line."""
    shown = [name[:40] if name.isprintable() else repr(name[:40]) for name in names[:20]]
    more = [f"{len(names) - 20} more"] if len(names) > 20 else []
    return ", ".join(shown + more)


def _check_time(
    path: Path, name: str, time: Floats, labels: np.ndarray | None, first_row: int
) -> None:
    behind = time[1:] <= time[:-1]
    if labels is not None:
        behind &= labels[1:] == labels[:-1]
    wrong = ~np.isfinite(time)
    wrong[1:] |= behind
    if not wrong.any():
        return
    sample = int(np.argmax(wrong))
    what = "is not finite"
    if np.isfinite(time[sample]):
        repeats = time[sample] == time[sample - 1]
        what = "repeats the time before it" if repeats else f"runs back from {time[sample - 1]:g} s"
    raise RecordingError(
        f"{path}: column {name!r}, row {first_row + sample}: {time[sample]:g} s {what}; time must "
        "increase within a segment"
    )
