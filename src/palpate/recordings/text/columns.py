"""Columns that fill, some rows at a time: of numbers, of text, of vectors and of times."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.recording import Faults
from palpate.recordings.text.cells import parsed_number, vector_in
from palpate.recordings.text.growing import Growing
from palpate.recordings.text.times import (
    is_iso_time,
    is_nanoseconds,
    is_timelike,
    iso_nanoseconds,
    plain_iso_times,
    whole_time,
)

MOST_REMEMBERED = 10_000  # labels, of which each is held once


class Column:
    """A column of numbers while it fills; NaN where a cell holds none.

    Parameters
    ----------
    name : str
        As the file has it.
    decimal : str
        The mark of decimals.

    Attributes
    ----------
    dtype : dtype, optional
        Of the array that cells can be parsed to at once; None where that takes more.
    """

    dtype: Any = np.dtype(np.float64)
    stored: Any = np.float64

    def __init__(self, name: str, decimal: str) -> None:
        self.name, self.decimal = name, decimal
        self.size = self.good = self.filled = 0
        self._values = Growing(self.stored)
        self._wrong: tuple[int, str] | None = None

    def refused(self, cells: Sequence[str]) -> list[int]:
        """Say which rows cannot stand in the table for what this column holds there."""
        return []

    def take(self, cells: Sequence[str]) -> None:
        """Add some cells."""
        try:
            if self.decimal == "," or "_" in "".join(cells):
                raise ValueError
            self.extend(np.array(list(map(float, cells)), dtype=np.float64))
        except ValueError:
            self._take_each(cells, np.full(len(cells), np.nan))

    def extend(self, values: NDArray[Any]) -> None:
        """Add some that are parsed."""
        self._values.extend(values)
        self.size += len(values)
        self.good += len(values)
        self.filled += len(values)

    def mistaken(self) -> str | None:
        """Say what the column should have been taken for, where that has turned out wrong."""
        return "text" if 2 * self.good < self.filled else None

    def channels(self) -> dict[str, NDArray[Any]]:
        """Return what has come of it, once; it is empty then."""
        if self.size and not self.filled:  # an empty column holds no numbers that were lost
            return {self.name: np.full(self.size, "", dtype=object)}
        return {self.name: self._values.taken()}

    def faults(self) -> dict[str, Faults]:
        """Say which cells held no number, by the names of the channels."""
        if self._wrong is None or not self.filled:
            return {}
        return dict.fromkeys(self._names(), Faults(self.size - self.good, *self._wrong))

    def _take_each(self, cells: Sequence[str], values: NDArray[Any]) -> None:
        for k, cell in enumerate(cells):
            found = self._value(cell)
            if found is not None:
                values[k] = found
                self.good += 1
                self.filled += 1
                continue
            self.filled += bool(cell.strip())
            if self._wrong is None:
                self._wrong = self.size + k, cell
        self.size += len(cells)
        self._values.extend(values)

    def _value(self, cell: str) -> float | list[float] | None:
        return parsed_number(cell, self.decimal)

    def _names(self) -> list[str]:
        return [self.name]


class Vectors(Column):
    """A column whose cells hold several numbers each: a channel for every place."""

    dtype = None

    def __init__(self, name: str, decimal: str, count: int) -> None:
        super().__init__(name, decimal)
        self._count = count

    def take(self, cells: Sequence[str]) -> None:
        """Add some cells."""
        self._take_each(cells, np.full((len(cells), self._count), np.nan))

    def channels(self) -> dict[str, NDArray[Any]]:
        """Return a channel for every place."""
        whole = self._values.taken().reshape(-1, self._count)
        return {name: whole[:, k].copy() for k, name in enumerate(self._names())}

    def _value(self, cell: str) -> list[float] | None:
        found = vector_in(cell, self.decimal)
        return found if found is not None and len(found) == self._count else None

    def _names(self) -> list[str]:
        return [f"{self.name}[{k}]" for k in range(self._count)]


class Words(Column):
    """A column of text: as objects, for one long cell would widen all."""

    dtype = None

    def __init__(self, name: str, decimal: str) -> None:
        super().__init__(name, decimal)
        self._known: dict[str, tuple[str, bool]] = {}
        self._chunks = [np.empty(0, dtype=object)]

    def take(self, cells: Sequence[str]) -> None:
        """Add some cells."""
        values = np.empty(len(cells), dtype=object)
        for k, cell in enumerate(cells):
            found = self._known.get(cell)
            if found is None:
                found = cell, parsed_number(cell, self.decimal) is not None
                if len(self._known) < MOST_REMEMBERED:
                    self._known[cell] = found
            values[k], number = found
            self.good += number
            self.filled += bool(cell) and not cell.isspace()
        self._chunks.append(values)

    def mistaken(self) -> str | None:
        """Say that it holds numbers, where most cells do."""
        return "numbers" if self.filled and 2 * self.good >= self.filled else None

    def channels(self) -> dict[str, NDArray[Any]]:
        """Return the text."""
        return {self.name: np.concatenate(self._chunks)}


class Times(Column):
    """A column of whole nanoseconds; a row that has none cannot stand in the table."""

    stored = np.int64

    def __init__(self, name: str, parse: Callable[[str], int | None], dtype: Any) -> None:
        super().__init__(name, ".")
        self.dtype = dtype
        self._parse = parse

    def refused(self, cells: Sequence[str]) -> list[int]:
        """Say which rows have no time."""
        if plain_iso_times(cells) is not None:
            return []
        wrong = [k for k, cell in enumerate(cells) if self._parse(cell) is None]
        self.filled += len(wrong)
        return wrong

    def take(self, cells: Sequence[str]) -> None:
        """Add some cells, all of which hold times."""
        times = plain_iso_times(cells)
        if times is None:
            times = np.array(list(map(self._parse, cells)), dtype=np.int64)
        self.extend(times)


class Ignored(Column):
    """A column that was not asked for."""

    def take(self, cells: Sequence[str]) -> None:
        """Forget them."""

    def extend(self, values: NDArray[Any]) -> None:
        """Forget them."""

    def channels(self) -> dict[str, NDArray[Any]]:
        """Return none."""
        return {}


def column_for(name: str, cells: Sequence[str], decimal: str, kind: str | None = None) -> Column:
    """Return an empty column for what its first cells hold, or of a kind that is known."""
    filled = [cell for cell in cells if cell.strip()]
    most = 0.5 * len(filled)
    if kind is None and filled:
        if sum(map(is_iso_time, filled)) > most:
            return Times(name, iso_nanoseconds, None)
        if is_timelike(name) and sum(map(is_nanoseconds, filled)) > most:
            return Times(name, whole_time, np.dtype(np.int64))
        numbers = sum(parsed_number(cell, decimal) is not None for cell in filled)
        vectors = [len(found) for cell in filled if (found := vector_in(cell, decimal))]
        if numbers < most and len(vectors) > most:
            return Vectors(name, decimal, max(set(vectors), key=vectors.count))
        kind = "numbers" if numbers >= most else "text"
    return Words(name, decimal) if kind == "text" else Column(name, decimal)
