"""Rows of a table: lines that are divided into cells, where they stood, and which were lost."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.recordings.text.cells import cells_of, padded, unclosed

# A remark in a cell may run over so many lines; a quotation mark too many would take all the rest.
MOST_LINES = 50
WIDE = 8  # columns
MOST_RUNS = 10_000  # that are held as Python's numbers


@dataclass(slots=True)
class Losses:
    """Whole rows that were left out, by the reason.

    Attributes
    ----------
    source : str
        The file, for messages.
    strict : bool
        Raise a RecordingError at the first.
    """

    source: str
    strict: bool
    _found: dict[str, tuple[int, int]] = field(default_factory=dict)
    _said: list[str] = field(default_factory=list)

    def add(self, what: str, row: int) -> None:
        """Count a row of which something is said: ``"has more cells than the header"``."""
        if self.strict:
            raise RecordingError(f"{self.source}: row {row} {what}")
        count, first = self._found.get(what, (0, row))
        self._found[what] = count + 1, first

    def say(self, sentence: str) -> None:
        """Take a whole sentence on what was lost."""
        if self.strict:
            raise RecordingError(f"{self.source}: {sentence}")
        self._said.append(sentence)

    def sentences(self) -> list[str]:
        """Return what was lost, a sentence a reason."""
        return [
            f"row {first} {what}: left out"
            if count == 1
            else f"{count} rows were left out, as each {what}; the first is row {first}"
            for what, (count, first) in self._found.items()
        ] + self._said


@dataclass(slots=True)
class Rows:
    """The rows of the file that samples stand in, as runs of consecutive ones."""

    _runs: list[list[int]] = field(default_factory=list)  # first row, and how many
    _arrays: list[NDArray[np.int64]] = field(default_factory=list)

    def add(self, first: int, count: int) -> None:
        """Add rows that follow each other."""
        if self._runs and sum(self._runs[-1]) == first:
            self._runs[-1][1] += count
            return
        self._runs.append([first, count])
        if len(self._runs) > MOST_RUNS:
            self._arrays.append(self._expanded())
            self._runs.clear()

    def all(self) -> Sequence[int]:
        """Return them: a range where it can be one."""
        if not self._arrays and len(self._runs) < 2:
            first, count = self._runs[0] if self._runs else (0, 0)
            return range(first, first + count)
        rows: Any = np.concatenate([*self._arrays, self._expanded()])
        return rows  # type: ignore[no-any-return]

    def _expanded(self) -> NDArray[np.int64]:
        return np.concatenate(
            [np.empty(0, np.int64), *(np.arange(a, a + n, dtype=np.int64) for a, n in self._runs)]
        )


@dataclass(slots=True)
class Records:
    """Rows of a table, each of as many cells as the header has.

    Attributes
    ----------
    delimiter : str
        Between cells.
    width : int
        Cells of the header.
    losses : Losses
        Where rows go that cannot be read.
    left : list of str
        The last lines, where a quotation begins in them that has not ended.
    """

    delimiter: str
    width: int
    losses: Losses
    left: list[str] = field(default_factory=list)

    def of(
        self, lines: Sequence[str], row: int, *, final: bool = True
    ) -> Iterator[tuple[int, list[str]]]:
        """Yield the row in the file and the cells of each record; ``row`` is the first line's.

        Unless these are the ``final`` lines, a quotation may end in those that follow: then it is
        ``left``.
        """
        self.left = []
        k = 0
        while k < len(lines):
            line = lines[k]
            if "\0" in line:
                self.losses.add("holds zero bytes", row + k)
                k += 1
                continue
            if unclosed(line):
                if not final and self._may_go_on(lines, k):
                    self.left = list(lines[k:])
                    return
                taken, cells = self._over_lines(lines, k)
                if cells is None:
                    self.losses.add(
                        "cannot be read: a quotation begins there and does not end", row + k
                    )
                else:
                    yield row + k, cells
                k += taken
                continue
            cells = self._cells(line, row + k)
            if cells is not None:
                yield row + k, cells
            k += 1

    def _cells(self, line: str, row: int) -> list[str] | None:
        try:
            cells = cells_of(line, self.delimiter)
        except csv.Error as error:
            self.losses.add(f"cannot be read: {error}", row)
            return None
        if len(cells) == self.width:
            return cells
        # Of a wide table an all but empty row would be many numbers that no one wrote.
        if self.width > WIDE and 2 * len(cells) < self.width:
            self.losses.add("has less than half of the header's cells", row)
            return None
        fitting = padded(cells, self.width)
        if fitting is None:
            self.losses.add("has more cells than the header", row)
        return fitting

    @staticmethod
    def _may_go_on(lines: Sequence[str], k: int) -> bool:
        rest = lines[k + 1 : k + MOST_LINES]
        return len(rest) < MOST_LINES - 1 and not any(map(unclosed, rest))

    def _over_lines(self, lines: Sequence[str], k: int) -> tuple[int, list[str] | None]:
        """How many lines a quotation runs over, and the cells; no cells where it has no end."""
        for end in range(k + 1, min(k + MOST_LINES, len(lines))):
            if unclosed(lines[end]):
                try:
                    cells = cells_of("\n".join(lines[k : end + 1]), self.delimiter)
                except csv.Error:
                    return 1, None
                # Two marks that are too many, far apart, are no cell with the rows between them.
                return (end + 1 - k, cells) if len(cells) == self.width else (1, None)
        return 1, None
