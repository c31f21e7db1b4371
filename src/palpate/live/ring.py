"""Ring buffers in shared memory: one loop writes, any number of processes read.

The writer never waits. A reader that falls behind by more than the capacity loses rows and counts
them. One ring holds every sample. Another holds the estimates, which are larger and cost more to
compute: the loop computes them 50 times a second, or at every sample if a sink needs that.
"""

import ctypes
import json
import struct
from multiprocessing.sharedctypes import RawArray
from typing import Any, TypeAlias

import numpy as np

from palpate.validation import Floats, Integers

#: Memory that processes share.
Memory: TypeAlias = ctypes.Array[ctypes.c_byte]
#: Most parameters of a force law in the loop.
MOST_PARAMETERS = 8

#: Columns of a sample, in order.
SAMPLE = (
    "time",  # of the prepared sample, s, on the source's clock
    "arrived",  # time of the newest measurement, s, on the same clock
    "position", "raw_force",  # of the newest measurement, along the contact normal; m, N
    "penetration", "velocity", "force",  # the estimator's input, NaN if none was prepared
    "predicted_force",  # one-step prediction, N
    "status", "preparation", "state",  # Status of estimator, of preparation; State
    "cycle", "lateness",  # s
    "estimate",  # number of the newest estimate after this sample
    # The newest measurement before signs and direction; a scalar is in x.
    *(f"input_{what}_{axis}" for what in ("position", "force") for axis in "xyz"),
)  # fmt: skip
#: Columns of an estimate.
ESTIMATE = (
    "method",  # number of the estimator; each change of estimator increases it
    "offset", "surface", "margin",  # N, m, validity margin of the linearisation
    "learned", "age",  # time of the newest sample in the numbers below, s, and since then
    "stiffness", "stiffness_standard_error", "stiffness_usable",  # N/m, and 1 or 0
    "damping", "damping_standard_error", "damping_usable",  # N·s/m
    "depth", "frequency",  # of both, m and rad/s
    "checks",  # bits of palpate.findings.LOOP_CHECKS
    *(f"parameter_{k}" for k in range(MOST_PARAMETERS)),
    *(f"covariance_{k}" for k in range(MOST_PARAMETERS**2)),  # row by row
)  # fmt: skip
#: Columns of a row as read: a sample, and the newest estimate after it.
COLUMNS = (*SAMPLE, *ESTIMATE)
_NUMBER = SAMPLE.index("estimate")
_HEADER = 64  # bytes: one cache line
#: Rows: 16 s at 1 kHz, longer than the page shows and a reader may stall.
CAPACITY = 1 << 14


class _Shared:
    """Memory that processes share: a process receives it at its start.

    It has no name, and is freed when the last process with it has ended, also if that is killed.
    Its header consists of 64-bit integers that are written atomically: ``struct.pack_into`` clears
    the bytes before it writes them, so another process could read zeros.
    """

    def __init__(self, memory: Memory) -> None:
        #: What another process receives.
        self.memory = memory
        self._buffer = np.frombuffer(memoryview(memory), np.uint8).data
        self._header = self._buffer[:16].cast("q")


class Writer(_Shared):
    """Writes rows. A ring has a single writer.

    Parameters
    ----------
    capacity, width : int
        Rows in the ring, and numbers in each row.
    memory : ctypes array, optional
        Memory of a ring that another process reads. Default: new memory.
    """

    def __init__(
        self,
        capacity: int = CAPACITY,
        width: int = len(SAMPLE),
        *,
        memory: Memory | None = None,
    ) -> None:
        super().__init__(memory or RawArray("b", _HEADER + 8 * capacity * width))
        self._row = struct.Struct(f"@{width}d")
        self._capacity = (len(self._buffer) - _HEADER) // self._row.size
        #: Rows written so far.
        self.count = 0

    def write(self, *row: float) -> None:
        """Write one row, such as of :data:`SAMPLE`."""
        at = _HEADER + (self.count % self._capacity) * self._row.size
        self._row.pack_into(self._buffer, at, *row)
        self.count += 1
        # The row must precede the count: x86 keeps the order, elsewhere the interpreter's locks do.
        self._header[0] = self.count


class Reader(_Shared):
    """Reads rows, from the first one on, and counts the overwritten ones."""

    def __init__(self, memory: Memory, width: int = len(SAMPLE)) -> None:
        super().__init__(memory)
        rows = np.frombuffer(memoryview(memory), np.float64, offset=_HEADER)
        self._rows: Floats = rows.reshape(-1, width)
        self._capacity = len(self._rows)
        self._next = 0

    @property
    def count(self) -> int:
        """Rows written so far."""
        return self._header[0]

    def go_back(self, to: int) -> None:
        """Return to an earlier row, as far back as the ring safely holds."""
        self._next = max(min(to, self._next), self.count - self._capacity // 2, 0)

    def take(self) -> tuple[Floats, int]:
        """Return the rows written since the last call, and how many of those were overwritten."""
        begin = self._next
        self._next = self.count
        rows = self.at(np.arange(max(begin, self._next - self._capacity), self._next))
        return rows, self._next - begin - len(rows)

    def at(self, numbers: Integers) -> Floats:
        """Return the rows of ascending numbers, except those that are already overwritten."""
        rows: Floats = self._rows[numbers % self._capacity]
        # Rows that were overwritten during the copy are invalid.
        return rows[numbers > self.count - self._capacity]


class RowReader:
    """Reads samples, each with the newest estimate after it: :data:`COLUMNS`."""

    def __init__(self, samples: Memory, estimates: Memory) -> None:
        self.samples = Reader(samples)
        self._estimates = Reader(estimates, len(ESTIMATE))
        self._last: Floats = np.empty((0, len(SAMPLE)))

    def take(self) -> tuple[Floats, int]:
        """Return the samples written since the last call, and how many of those are lost."""
        samples, dropped = self.samples.take()
        estimates = self._estimates.at(samples[:, _NUMBER].astype(np.int64))
        spoilt = len(samples) - len(estimates)
        rows = np.hstack([samples[spoilt:], estimates])
        if len(rows):
            self._last = samples[-1:].copy()
        return rows, dropped + spoilt

    def now(self) -> Floats:
        """Return the last sample read, with the newest estimate; shape (0 or 1, columns)."""
        newest = np.full(len(self._last), self._estimates.count - 1)
        return np.hstack([self._last, self._estimates.at(newest)])


# A status in shared memory: one process writes it now and then, any number read it.

SIZE = 1 << 16  # bytes: a status has a few kilobytes
_TEXT = 16  # byte offset of the text, after a count that is odd while writing, and the length


class SharedJson(_Shared):
    """JSON in shared memory that is never read half-written.

    Parameters
    ----------
    memory : ctypes array, optional
        Memory that another process writes or reads. Default: new memory.
    """

    def __init__(self, memory: Memory | None = None) -> None:
        super().__init__(memory or RawArray("b", SIZE))
        self._seen = -1
        self._last = dict[str, Any]()

    @property
    def version(self) -> int:
        """Version of the value read last; it changes while the writer is alive."""
        return self._seen

    def write(self, page: dict[str, Any]) -> None:
        """Write a value; if it is too long, without its last fields."""
        text = json.dumps(page).encode()
        while len(text) > SIZE - _TEXT:
            page = dict(list(page.items())[:-1])
            text = json.dumps(page).encode()
        self._header[0] += 1
        self._header[1] = len(text)
        self._buffer[_TEXT : _TEXT + len(text)] = text
        self._header[0] += 1

    def read(self) -> dict[str, Any]:
        """Return the last complete value; empty before the first."""
        for _ in range(3):
            version, length = self._header
            if version == self._seen or version % 2 or not version:
                break
            text = bytes(self._buffer[_TEXT : _TEXT + length])
            if self._header[0] == version:
                self._seen = version
                self._last = json.loads(text)
                break
        return dict(self._last)
