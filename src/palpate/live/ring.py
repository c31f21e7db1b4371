"""Rings of rows in shared memory: one loop writes, any number of processes read.

The writer never waits. A reader that falls behind by more than the ring holds loses rows, and knows
how many. One ring holds every sample; another the estimates, which are more than a sample and cost
more: the loop computes them 50 times a second, or at every sample where somebody asks for that.
"""

import json
import struct
from multiprocessing import resource_tracker, shared_memory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from palpate.validation import Floats

#: The most parameters that a law may have to be shown live.
MOST_PARAMETERS = 8

#: Columns of a sample, in their order.
SAMPLE = (
    "time",  # of the sample that was prepared, s, by the source's clock
    "arrived",  # time of the newest measurement, s, by the same clock
    "position", "raw_force",  # of the newest measurement, along the contact normal; m, N
    "penetration", "velocity", "force",  # as they were given to the estimator; NaN where none was
    "predicted_force",  # a priori, N
    "status", "preparation", "state",  # numbers of Status, Status and State
    "cycle", "lateness",  # s
    "estimate",  # number of the newest estimate after this sample
    # As the newest measurement came, before signs and direction: a number is the first of three.
    *(f"input_{what}_{axis}" for what in ("position", "force") for axis in "xyz"),
)  # fmt: skip
#: Columns of an estimate.
ESTIMATE = (
    "method",  # number of the estimator's generation: another means that it was changed
    "offset", "surface", "margin",  # N, m, and of condition 10
    *(f"parameter_{k}" for k in range(MOST_PARAMETERS)),
    *(f"covariance_{k}" for k in range(MOST_PARAMETERS**2)),  # row by row
)  # fmt: skip
#: Columns of a row as readers get it: a sample, and the newest estimate that there was after it.
COLUMNS = (*SAMPLE, *ESTIMATE)
_NUMBER = SAMPLE.index("estimate")
_HEADER = 64  # bytes: a cache line of its own
#: 16 s at 1 kHz: what a page shows, and a reader may stall for.
CAPACITY = 1 << 14


class Taken(NamedTuple):
    """Rows that a reader took.

    Attributes
    ----------
    rows : numpy.ndarray, shape (k, columns)
        In the order of time.
    dropped : int
        Rows between the last ones taken and these, which the ring no longer held.
    """

    rows: Floats
    dropped: int


class _Shared:
    """Memory that one process makes and gives back, and others find by its name.

    It begins with 64-bit numbers, which are stored and read whole: ``struct.pack_into`` clears the
    bytes before it writes them, and another process would see zeros.
    """

    def __init__(self, size: int, name: str | None = None) -> None:
        self._own = name is None
        self._memory = (
            shared_memory.SharedMemory(create=True, size=size) if name is None else _attached(name)
        )
        assert self._memory.buf is not None  # it is open
        self._buffer: memoryview = self._memory.buf
        self._header = self._buffer[:16].cast("q")
        #: By which another process finds it.
        self.name = self._memory.name

    def close(self) -> None:
        """Let go of the memory; who made it gives it back, whether every reader has gone or not."""
        self._header.release()
        self._buffer.release()
        self._memory.close()
        if self._own:
            self._memory.unlink()


def _attached(name: str) -> shared_memory.SharedMemory:
    # Python before 3.13 gives it back when the first reader ends, unless it is not told of it.
    register = resource_tracker.register
    resource_tracker.register = lambda *_: None
    try:
        return shared_memory.SharedMemory(name=name)
    finally:
        resource_tracker.register = register


class Address(NamedTuple):
    """Name and size of a ring: how many rows it holds, and how many numbers are in each."""

    name: str
    capacity: int
    width: int


class Writer(_Shared):
    """The loop's end; it owns the memory, unless another process made it.

    Parameters
    ----------
    capacity, width : int
        Rows that it holds, and numbers in each.
    made : Address, optional
        Of a ring that another process made, and gives back; nobody else may write it.
    """

    def __init__(
        self, capacity: int = CAPACITY, width: int = len(SAMPLE), *, made: Address | None = None
    ) -> None:
        super().__init__(_HEADER + 8 * capacity * width, None if made is None else made.name)
        self.address = made or Address(self.name, capacity, width)
        self._row, self._capacity = struct.Struct(f"@{self.address.width}d"), self.address.capacity
        #: Rows written so far.
        self.count = 0

    def write(self, *row: float) -> None:
        """Write one row, such as of :data:`SAMPLE`."""
        at = _HEADER + (self.count % self._capacity) * self._row.size
        self._row.pack_into(self._buffer, at, *row)
        self.count += 1
        # The row first, then the count: on x86 and, by the interpreter's own locks, elsewhere too.
        self._header[0] = self.count


class Reader(_Shared):
    """One reader's end; it begins with the first row of all, and counts those that are gone."""

    def __init__(self, address: Address) -> None:
        super().__init__(0, address.name)
        self._capacity, self._next = address.capacity, 0
        self._rows: NDArray[np.float64] = np.ndarray(
            (address.capacity, address.width), dtype="=f8", buffer=self._buffer, offset=_HEADER
        )

    @property
    def count(self) -> int:
        """Rows written so far."""
        return self._header[0]

    def go_back(self, to: int) -> None:
        """Take the rows from a count on again, as far as the ring still holds them."""
        self._next = max(min(to, self._next), self.count - self._capacity // 2, 0)

    def take(self) -> Taken:
        """Return the rows written since the last call."""
        begin, self._next = self._next, self.count
        rows = self.at(np.arange(max(begin, self._next - self._capacity), self._next))
        return Taken(rows, self._next - begin - len(rows))

    def at(self, numbers: NDArray[np.int64]) -> Floats:
        """Return the rows of rising numbers, without the first ones that the ring holds no more."""
        rows: Floats = self._rows[numbers % self._capacity]
        # Rows that were written over while they were copied are no rows.
        return rows[numbers > self.count - self._capacity]

    def close(self) -> None:
        """Let go of the memory."""
        del self._rows
        super().close()


class RowReader:
    """Reads samples, each with the newest estimate that there was after it: :data:`COLUMNS`."""

    def __init__(self, samples: Address, estimates: Address) -> None:
        self.samples, self._estimates = Reader(samples), Reader(estimates)
        self._last: Floats = np.empty((0, len(SAMPLE)))

    def take(self) -> Taken:
        """Return the samples written since the last call."""
        samples, dropped = self.samples.take()
        estimates = self._estimates.at(samples[:, _NUMBER].astype(np.int64))
        spoilt = len(samples) - len(estimates)
        rows = np.hstack([samples[spoilt:], estimates])
        if len(rows):
            self._last = samples[-1:].copy()
        return Taken(rows, dropped + spoilt)

    def now(self) -> Floats:
        """The last sample that was taken, with the newest estimate; shape (0 or 1, columns)."""
        newest = np.full(len(self._last), self._estimates.count - 1)
        return np.hstack([self._last, self._estimates.at(newest)])

    def close(self) -> None:
        """Let go of the memory."""
        self.samples.close()
        self._estimates.close()


# A page of words in shared memory: one process writes it now and then, any number read it.

SIZE = 1 << 16  # bytes: the loop's statistics, and what it said last, are some kilobytes
_TEXT = 16  # byte where it begins: behind how often it was written, odd while it is, and its length


class SharedJson(_Shared):
    """JSON that is always whole: a reader sees the last page or the one before.

    Parameters
    ----------
    name : str, optional
        Of one that another process made; a new one unless given.
    """

    def __init__(self, name: str | None = None) -> None:
        super().__init__(SIZE, name)
        self._seen, self._last = -1, dict[str, Any]()

    @property
    def version(self) -> int:
        """Of the page that was read last: another means that the writer is alive."""
        return self._seen

    def write(self, page: dict[str, Any]) -> None:
        """Write a page; one that is too long is cut to its first fields."""
        text = json.dumps(page).encode()
        while len(text) > SIZE - _TEXT:
            page = dict(list(page.items())[:-1])
            text = json.dumps(page).encode()
        self._header[0] += 1
        self._header[1] = len(text)
        self._buffer[_TEXT : _TEXT + len(text)] = text
        self._header[0] += 1

    def read(self) -> dict[str, Any]:
        """Return the last whole page; empty before the first."""
        for _ in range(3):
            version, length = self._header
            if version == self._seen or version % 2 or not version:
                break
            text = bytes(self._buffer[_TEXT : _TEXT + length])
            if self._header[0] == version:
                self._seen, self._last = version, json.loads(text)
                break
        return dict(self._last)
