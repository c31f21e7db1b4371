"""A page of words in shared memory: one process writes it now and then, any number read it."""

import json
import struct
from multiprocessing import shared_memory
from typing import Any

from palpate.live.ring import attached

SIZE = 1 << 16  # bytes: the loop's statistics, and what it said last, are some kilobytes
# How often it was written, odd while it is; and how long it is. In the machine's own order, as the
# ring's count.
_HEADER = struct.Struct("@qq")


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
        if self._own:
            _HEADER.pack_into(self._buffer, 0, 0, 0)
        self._seen, self._last = -1, dict[str, Any]()

    @property
    def name(self) -> str:
        """By which another process finds it."""
        return self._memory.name

    def write(self, page: dict[str, Any]) -> None:
        """Write a page; one that is too long is cut to its first fields."""
        text = json.dumps(page).encode()
        while len(text) > SIZE - _HEADER.size:
            page = dict(list(page.items())[:-1])
            text = json.dumps(page).encode()
        version, _ = _HEADER.unpack_from(self._buffer, 0)
        _HEADER.pack_into(self._buffer, 0, version + 1, len(text))
        self._buffer[_HEADER.size : _HEADER.size + len(text)] = text
        _HEADER.pack_into(self._buffer, 0, version + 2, len(text))

    def read(self) -> dict[str, Any]:
        """Return the last whole page; empty before the first."""
        for _ in range(3):
            version, length = _HEADER.unpack_from(self._buffer, 0)
            if version == self._seen or version % 2 or not version:
                break
            text = bytes(self._buffer[_HEADER.size : _HEADER.size + length])
            if _HEADER.unpack_from(self._buffer, 0)[0] == version:
                self._seen, self._last = version, json.loads(text)
                break
        return dict(self._last)

    def close(self) -> None:
        """Let go of the memory; who made it gives it back."""
        self._buffer.release()
        self._memory.close()
        if self._own:
            self._memory.unlink()
