"""An HDF5 file that is cut off: what lies before its end is read, and nothing else.

HDF5 opens no file that is shorter than it says. Given one that is filled up with zeros it does, and
what is read must then come from before the true end.
"""

import io
import itertools
import math
from collections import Counter
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.recordings.bounds import Budget, in_words
from palpate.recordings.formats import Request
from palpate.recordings.hdf5 import DAMAGED, Walk
from palpate.recordings.recording import Recording, printable


class Filled(io.RawIOBase):
    """A file that goes on with zeros behind its end, and knows whether these were read."""

    def __init__(self, path: Path, size: int, claimed: int) -> None:
        self._file = path.open("rb")
        self.size = size
        self.claimed = claimed
        self.beyond = False
        self._at = 0

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place, which may lie behind the end."""
        self._at = offset + (0, self._at, self.claimed)[whence]
        return self._at

    def tell(self) -> int:
        """Where it is."""
        return self._at

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer, with zeros for what is not there."""
        view = memoryview(buffer).cast("B")
        self._file.seek(min(self._at, self.size))
        count = self._file.readinto(view)
        if count < len(view):
            self.beyond = True
            view[count:] = bytes(len(view) - count)
        self._at += len(view)
        return len(view)

    def close(self) -> None:
        """Close the file too."""
        self._file.close()
        super().close()


def read_cut(path: Path, size: int, claimed: int, request: Request) -> Recording:
    """Read what lies before the end of a file.

    Arrays of one length belong together, and all of them are read as far as the shortest is there.

    Parameters
    ----------
    path : Path
        The file.
    size, claimed : int
        Its size, and that which it says to have, bytes.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        Nothing of it can be read, or the request is strict.
    """
    source = printable(path)
    cut_off = f"{in_words(size)} of {in_words(claimed)} are there"
    with Filled(path, size, claimed) as filled:
        try:
            file = h5py.File(filled, "r")
        except DAMAGED:
            raise RecordingError(
                f"{source}: the file is cut off: {cut_off}, and what HDF5 needs to find anything "
                "is not among it; copy it again, or let the recorder close its file"
            ) from None
        with file:
            measuring = _Measuring(Budget(size))
            measuring.filled = filled
            measuring.file(file)
            walk = _Cut(Budget(size))
            walk.filled, walk.kept, walk.gone = filled, measuring.kept, measuring.gone
            walk.found.lose("the file", f"is cut off: {cut_off}")
            for count, there in measuring.kept.items():
                if there < count:
                    walk.found.lose(f"arrays of {count} samples", f"the first {there} are read")
            walk.file(file)
            if not walk.found.leaves:
                walk.found.losses[1:] = []  # the rest follows from it
            return walk.found.recording(source, request)


class _Measuring(Walk):
    """How many samples of the arrays of each length lie before the end of the file."""

    filled: Filled

    def __init__(self, budget: Budget) -> None:
        super().__init__(budget)
        self.kept: dict[int, int] = {}
        self.gone: set[Any] = set()

    def dataset(self, item: h5py.Dataset, path: tuple[str, ...], name: str) -> None:
        """Measure an array."""
        if item.shape and all(item.shape) and item.dtype.kind in "iufbV":
            count, there = int(item.shape[0]), self._rows(item)
            if there:
                self.kept[count] = min(there, self.kept.get(count, count))
            else:  # it is lost alone
                self.gone.add(h5py.h5o.get_info(item.id).addr)

    def _rows(self, item: h5py.Dataset) -> int:
        count, size = int(item.shape[0]), self.filled.size
        if item.chunks is not None:
            return min(self._whole_pieces(item) * int(item.chunks[0]), count)
        begin = item.id.get_offset()
        if begin is None:  # so small that it stands beside its name
            return count
        row = item.dtype.itemsize * math.prod(item.shape[1:])
        return min(max(size - int(begin), 0) // int(row), count)

    def _whole_pieces(self, item: h5py.Dataset) -> int:
        """How many pieces, one after the other from the first sample on, are there."""
        there: Counter[int] = Counter()

        def look(piece: Any) -> None:
            if piece.byte_offset + piece.size <= self.filled.size:
                there[int(piece.chunk_offset[0]) // item.chunks[0]] += 1

        item.id.chunk_iter(look)
        sides = zip(item.shape[1:], item.chunks[1:], strict=True)
        beside = math.prod(-(-side // piece) for side, piece in sides)
        whole = (number for number in itertools.count() if there[number] < beside)
        return next(whole)


class _Cut(Walk):
    """The arrays of a file, as far as they are there."""

    filled: Filled
    kept: dict[int, int]
    gone: set[Any]

    def dataset(self, item: h5py.Dataset, path: tuple[str, ...], name: str) -> None:
        """Take an array, unless nothing of it is there."""
        if h5py.h5o.get_info(item.id).addr in self.gone:
            self.found.lose("/".join((*path, name)), "lies behind the end of the file")
        else:
            super().dataset(item, path, name)

    def shape(self, item: h5py.Dataset) -> tuple[int, ...]:
        """Return the shape of what is read of an array."""
        return (self.kept[int(item.shape[0])], *item.shape[1:])

    def values(self, item: h5py.Dataset, field: str | None = None) -> NDArray[Any]:
        """Read what is there of an array.

        Raises
        ------
        OSError
            Some of it comes from behind the end.
        """
        self.filled.beyond = False
        whole = item if field is None else item.fields(field)
        values = np.asarray(whole[: self.shape(item)[0]])
        # What is not packed in pieces was measured; around it HDF5 reads more than is asked for.
        if self.filled.beyond and item.chunks is not None:
            raise OSError("it lies behind the end of the file")
        return values
