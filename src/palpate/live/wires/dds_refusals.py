"""What Cyclone DDS itself refuses: it says so in its log only, of which the lines are counted."""

import ctypes
import fcntl
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_LONGEST = 120  # characters of what is shown
#: In a line of the log about a packet or a message that was thrown away.
_SIGNS = ("malformed packet", "deserialization", "invalid data")


class Refusals:
    """Counts what was refused in all domains of this process, and keeps it off the terminal.

    Cyclone DDS writes a line for each to C's ``stderr``, and its Python package has no way to say
    otherwise; but it keeps the file that ``stderr`` is while a domain is made. That is a pipe
    then, which a thread reads as lines come: one that is full would hold up what receives.
    """

    def __init__(self) -> None:
        self._count, self._words, self._line = 0, "", ""
        self._file: int | None = None
        libc = ctypes.CDLL(None)
        try:
            self._stderr = ctypes.c_void_p.in_dll(libc, "stderr")
        except ValueError:  # not glibc: the lines go where they go
            return
        ours, theirs = os.pipe()
        with suppress(OSError):
            fcntl.fcntl(theirs, 1031, 1 << 20)  # F_SETPIPE_SZ, of Linux: some thousand lines
        libc.fdopen.restype = ctypes.c_void_p
        self._file = libc.fdopen(theirs, b"w")
        threading.Thread(target=self._count_lines, args=(ours,), daemon=True).start()

    @contextmanager
    def taken(self) -> Iterator[None]:
        """While a domain is made: its log comes here."""
        if self._file is None:
            yield
            return
        before = self._stderr.value
        self._stderr.value = self._file
        try:
            yield
        finally:
            self._stderr.value = before

    def _count_lines(self, descriptor: int) -> None:
        rest = b""
        while data := os.read(descriptor, 1 << 16):
            *lines, rest = (rest + data).split(b"\n")
            for each in lines:
                # After time, domain and thread: 1795334633.371701 [33]       recv: …
                line = each.decode("utf-8", "replace").partition(": ")[2]
                self._line = line[:_LONGEST]
                if any(sign in line for sign in _SIGNS):
                    self._count += 1
                    self._words = line.partition(" <")[0].partition(" (for ")[0][-_LONGEST:]
            rest = rest[-4096:]

    def since(self, count: int) -> tuple[int, str]:
        """Return how many there were after the first ``count``, and what the last one was."""
        return self._count - count, f"Cyclone DDS: {self._words}"

    @property
    def count(self) -> int:
        """How many there were so far."""
        return self._count

    @property
    def line(self) -> str:
        """The last line, whatever it is about."""
        return self._line
