"""A page of words in shared memory: one process writes it now and then, any number read it."""

import json
from multiprocessing import shared_memory
from typing import Any

from palpate.live.ring import attached, whole_numbers

SIZE = 1 << 16  # bytes: the loop's statistics, and what it said last, are some kilobytes
_TEXT = 16  # byte where it begins: behind how often it was written, odd while it is, and its length


class Board:
    """JSON that is always whole: a reader sees the last page or the one before.

    Parameters
    ----------
    name : str, optional
        Of one that another process made; a new one unless given.
    """

    def __init__(self, name: str | None = None) -> None:
        self._own = name is None
        self._memory = (
            shared_memory.SharedMemory(create=True, size=SIZE) if name is None else attached(name)
        )
        assert self._memory.buf is not None  # it is open
        self._buffer: memoryview = self._memory.buf
        self._header = whole_numbers(self._buffer, 2)
        if self._own:
            self._header[0] = self._header[1] = 0
        self._seen, self._last = -1, dict[str, Any]()

    @property
    def name(self) -> str:
        """By which another process finds it."""
        return self._memory.name

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

    def close(self) -> None:
        """Let go of the memory; who made it gives it back."""
        self._header.release()
        self._buffer.release()
        self._memory.close()
        if self._own:
            self._memory.unlink()
