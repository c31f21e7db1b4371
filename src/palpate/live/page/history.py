"""The last seconds of a run, as every browser gets them."""

import math
import struct

import numpy as np
from numpy.typing import NDArray

from palpate.force_laws import ForceLaw
from palpate.live.page.channels import CHANNELS, channels_of, column
from palpate.live.ring import WIDTH
from palpate.validation import Floats

SHOWN = 10.0  # s
#: Rows of a frame: 180 kB, of which one at most waits for a client.
MOST_ROWS = 2000
#: Kind, rows, number of the first row, rows that this client did not get, 1 if all before is void.
HEADER = struct.Struct("<IIdII")
# Rows, as the browser has room for too: 10 s at 6.5 kHz, of a quicker source less.
_LEAST_KEPT, _MOST_KEPT = 1000, 1 << 16
_MOST_GENERATIONS = 50  # more resets than that are not within ten seconds
_BACKWARD = 1.0  # s: what goes back further is another clock; less is jitter


class History:
    """Rows of the ring and what is sent of them, without a gap in memory.

    Attributes
    ----------
    total : int
        Rows taken so far.
    begins : int
        Number of the first row of the present clock: what was before it is void.
    """

    def __init__(self, sample_time: float) -> None:
        # With room for a source that is a fifth faster than it says.
        wanted = math.ceil(1.2 * SHOWN / max(sample_time, 1e-6))
        self._most = min(max(wanted, _LEAST_KEPT), _MOST_KEPT)
        self._rows = np.empty((2 * self._most, WIDTH))
        self._times = np.empty(2 * self._most)
        self._values = np.empty((len(CHANNELS), 2 * self._most), dtype="<f4")
        self._end = 0
        self.total = self.begins = 0
        self._law: type[ForceLaw] | None = None
        self._generations: list[float] = []
        self._depth = math.nan

    @property
    def oldest(self) -> int:
        """Number of the oldest row that is kept."""
        return max(self.total - min(self._end, self._most), self.begins)

    def rows(self) -> Floats:
        """What is kept, as the loop wrote it."""
        return self._rows[self._end - (self.total - self.oldest) : self._end]

    def show(self, law: type[ForceLaw] | None, depth: float, generation: float) -> bool:
        """Work out stiffness and damping by another law or at another depth; whether it did.

        Parameters
        ----------
        law : type, optional
            Of the estimator that runs.
        depth : float
            m; NaN where it is not known yet.
        generation : float
            Number of the estimator, as the loop counts them: of the earlier ones those are shown
            that identified the same law.
        """
        same_depth = depth == self._depth or (math.isnan(depth) and math.isnan(self._depth))
        if same_depth and law is self._law and generation in self._generations:
            return False
        if law is not self._law:
            self._generations.clear()
        self._generations = [*self._generations[-_MOST_GENERATIONS:], generation]
        self._law, self._depth = law, depth
        start = self._end - (self.total - self.oldest)
        self._values[:, start : self._end] = self._worked_out(self.rows())
        return True

    def _worked_out(self, rows: Floats) -> NDArray[np.float32]:
        """Of rows that an estimator of another law wrote only what needs no law."""
        found = channels_of(rows, self._law, self._depth)
        wrote = column(rows, "method")
        void = ~np.isin(wrote, self._generations)
        void[1:] |= wrote[1:] != wrote[:-1]  # no line leads from one to the next
        found[4:-3, void] = np.nan
        return found

    def add(self, rows: Floats, delay: float) -> None:
        """Take rows of the ring; times that go back by more than a second void what was before.

        Parameters
        ----------
        rows : numpy.ndarray, shape (k, columns)
            The next ones.
        delay : float
            Of the preparation, s: by so much a row is older than the measurement it came with.
        """
        if not len(rows):
            return
        self.total += max(len(rows) - self._most, 0)
        rows = rows[-self._most :]
        times = column(rows, "time").copy()
        missing = ~np.isfinite(times)
        times[missing] = column(rows, "arrived")[missing] - delay
        before = self._times[self._end - 1] if self._end else -math.inf
        times[~np.isfinite(times)] = -math.inf  # then that of the row before
        steps = np.diff(times, prepend=before)
        back = np.flatnonzero((steps < -_BACKWARD) & np.isfinite(times))
        self.total += len(rows)
        if len(back):
            rows, times, before = rows[back[-1] :], times[back[-1] :], -math.inf
            self._end, self.begins = 0, self.total - len(rows)
        times = np.maximum.accumulate(np.concatenate([[before], times]))[1:]
        if not np.isfinite(times[0]):  # of a start without any time
            times[~np.isfinite(times)] = 0.0
        self._append(rows, times)

    def _append(self, rows: Floats, times: Floats) -> None:
        if self._end + len(rows) > len(self._times):
            kept = slice(self._end - self._most, self._end)
            self._rows[: self._most] = self._rows[kept]
            self._times[: self._most] = self._times[kept]
            self._values[:, : self._most] = self._values[:, kept]
            self._end = self._most
        new = slice(self._end, self._end + len(rows))
        self._rows[new], self._times[new] = rows, times
        self._values[:, new] = self._worked_out(rows)
        self._end = new.stop

    def frame(self, first: int, until: int, *, every: int, dropped: int, void: bool) -> bytes:
        """Rows first to until, without the last, as one binary message.

        Little-endian: :data:`HEADER`; the times [s], float64; then each of :data:`CHANNELS`,
        float32. With ``every`` > 1 only each so many-th row, by its number.
        """
        offset = self._end - self.total
        first = first + (-first) % every
        part = slice(offset + first, offset + until, every)
        times = self._times[part]
        head = HEADER.pack(every, len(times), first, dropped, void)
        return head + times.tobytes() + self._values[:, part].tobytes()
