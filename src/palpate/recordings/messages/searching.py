"""Where a file goes on after bytes that are no record."""

from collections.abc import Callable

# Bytes that are looked through in a file, at some 100 MB/s; a file of nothing else ends in time.
_MOST = 256 << 20
_FIRST_WINDOW = 1 << 16
_WINDOW = 4 << 20
# Places in a window that are looked at one by one, in some 0.1 s.
MOST_PLACES = 20_000
_OVERLAP = 1 << 12  # the head of a record may lie across the end of a window


class Search:
    """Finds records, in a bounded time for the whole of a file.

    Parameters
    ----------
    size : int
        Of the file, in bytes.
    read : callable
        Returns bytes: from where, and how many.
    find : callable
        Returns where in a block the next record may begin, or None; takes the block, where it
        begins in the file, and the file's size.
    """

    def __init__(
        self,
        size: int,
        read: Callable[[int, int], bytes],
        find: Callable[[bytes, int, int], int | None],
    ) -> None:
        self.size = size
        self.left = _MOST
        self._read = read
        self._find = find

    def after(self, begin: int) -> int:
        """Return where the next record begins; the end of the file where none is found."""
        window = _FIRST_WINDOW
        while begin < self.size and self.left > 0:
            data = self._read(begin, window)
            self.left -= len(data)
            found = self._find(data, begin, self.size)
            if found is not None:
                return begin + found
            if begin + len(data) >= self.size:
                break
            begin += max(1, len(data) - _OVERLAP)
            window = min(4 * window, _WINDOW)
        return self.size
