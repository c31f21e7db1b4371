"""Channels that grow by blocks of messages; a field that a message does not have is NaN."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.recording import Faults

# Fields that few messages have may take this much more than the messages themselves did: enough for
# any that come and go, and no room for a file that names new ones in each message.
SLACK = 16 << 20


@dataclass(slots=True)
class Column:
    """One channel: its values so far, and which of them are absent."""

    values: NDArray[Any]
    size: int = 0
    missing: int = 0
    absent: list[tuple[int, NDArray[np.bool_] | int]] = field(default_factory=list)

    def append(self, values: NDArray[Any]) -> None:
        """Add values; of another dtype, all are converted to one that holds both."""
        dtype = np.result_type(self.values.dtype, values.dtype)
        end = self.size + len(values)
        if end > len(self.values) or dtype != self.values.dtype:
            # Half as much again: pages that are never written to take no memory.
            grown = np.empty(max(end + end // 2, 64), dtype)
            grown[: self.size] = self.values[: self.size]
            self.values = grown
        self.values[self.size : end] = values
        self.size = end

    def append_absent(self, count: int) -> None:
        """Add rows that have no value."""
        if count:
            self.absent.append((self.size, count))
            self.missing += count
            self.append(np.zeros(count, self.values.dtype))

    def append_some(self, values: NDArray[Any], present: NDArray[np.bool_]) -> None:
        """Add rows of which some have no value."""
        self.absent.append((self.size, ~present))
        self.missing += int(np.count_nonzero(~present))
        self.append(values)

    def finish(self) -> tuple[NDArray[Any], Faults | None]:
        """Return the channel, and where it has no number."""
        values = self.values[: self.size]
        if len(self.values) > self.size:
            values = values.copy()
        self.values = self.values[:0]
        if not self.absent:
            return values, None
        if values.dtype.kind != "f":
            values = values.astype(np.float64)
        first = self.size
        for start, rows in self.absent:
            stop = start + (rows if isinstance(rows, int) else len(rows))
            which = np.arange(start, stop)[... if isinstance(rows, int) else rows]
            values[which] = np.nan
            first = min(first, int(which[0])) if len(which) else first
        return values, Faults(self.missing, first, "nothing: the message has no such field")


class Rows:
    """The columns of a topic; all have the same number of rows."""

    def __init__(self) -> None:
        self.count = 0
        self.columns: dict[str, Column] = {}
        self.dropped: set[str] = set()

    def extend(
        self,
        count: int,
        values: Mapping[str, NDArray[Any]],
        present: Mapping[str, NDArray[np.bool_]] | None = None,
    ) -> None:
        """Add rows.

        Parameters
        ----------
        count : int
            How many.
        values : mapping
            An array of that length for each column; columns that are not named have no value.
        present : mapping, optional
            Which rows of a column have a value, where not all have.
        """
        for name, column in values.items():
            if name in self.dropped:
                continue
            if name not in self.columns:
                self.columns[name] = Column(np.empty(0, column.dtype))
                self.columns[name].append_absent(self.count)
            if present is not None and name in present:
                self.columns[name].append_some(column, present[name])
            else:
                self.columns[name].append(column)
        for name in self.columns.keys() - values.keys():
            self.columns[name].append_absent(count)
        self.count += count

    def prune(self, allowed: int) -> None:
        """Drop the columns with the fewest values while absent ones take more bytes than that."""
        absent = sum(column.missing for column in self.columns.values()) * 8
        if absent <= allowed + SLACK:
            return
        for name in sorted(self.columns, key=lambda each: -self.columns[each].missing):
            absent -= self.columns.pop(name).missing * 8
            self.dropped.add(name)
            if absent <= allowed + SLACK:
                return
