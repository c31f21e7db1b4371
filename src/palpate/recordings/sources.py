"""Bytes from files, pipes, devices and gzip, with a bound to each, for nothing has to end."""

import itertools
import os
import select
import stat
import sys
import time
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from palpate.errors import RecordingError
from palpate.recordings.recording import printable
from palpate.writing import scratch_file

CHUNK = 1 << 20
SLICE = 1 << 14  # of compressed bytes: each may be gone through again, a byte at a time
GZIP = b"\x1f\x8b"

# An hour of wrench and pose at 1 kHz is nearly that as a bag, and 1e7 rows of text 0.7 GB. It is
# written to a temporary file within the ten seconds that anyone would wait, on a busy machine too.
MOST_OF_A_PIPE = 1 << 30
# No device is a recording; this is read in a tenth of a second, and a terminal never gets there.
MOST_OF_A_DEVICE = 64 << 20
# What comes slower is a stream that goes on, such as a sensor's: 1000 rows a second are 50 kB/s. A
# program that makes a recording may think for a few seconds before it prints.
PATIENCE = 8.0  # s
SLOWEST = 64 << 10  # bytes/s
# Numbers as text shrink 2 to 12 times, and a column that never changes some hundred times; zeros
# made to fill a memory shrink a thousand times.
MOST_EXPANSION = 100
ALWAYS_EXPANDED = 16 << 20


@dataclass(slots=True)
class Source:
    """The bytes of a regular file, a chunk at a time; those within, where it is gzip.

    Attributes
    ----------
    path : Path
        The file.
    losses : list of str
        What could not be read, in sentences, once all has been read.
    fraction : float
        How much of the file has been read, 0 to 1.
    size : int
        Of the file, bytes.
    compressed : bool
        Whether it is gzip.
    """

    path: Path
    losses: list[str] = field(default_factory=list)
    fraction: float = 0.0
    size: int = 0
    compressed: bool = False

    def __iter__(self) -> Iterator[bytes]:
        """Yield what the file holds.

        Raises
        ------
        RecordingError
            It cannot be read, or expands to more than a recording would.
        """
        try:
            with self.path.open("rb") as file:
                self.size = os.fstat(file.fileno()).st_size
                chunks = self._raw(file)
                first = next(chunks, b"")
                self.compressed = first.startswith(GZIP)
                if self.compressed:
                    yield from self._inflated(first, chunks)
                else:
                    yield first
                    yield from chunks
        except (OSError, ValueError) as error:
            raise unreadable(printable(self.path), error) from None

    def _raw(self, file: IO[bytes]) -> Iterator[bytes]:
        """What the file held when it was opened: one that grows has no end."""
        left = self.size or MOST_OF_A_DEVICE  # files of /proc say that they are empty
        while left and (chunk := file.read(min(CHUNK, left))):
            left -= len(chunk)
            self.fraction = 1.0 - left / max(self.size, 1)
            yield chunk

    def _inflated(self, first: bytes, rest: Iterator[bytes]) -> Iterator[bytes]:
        most = max(ALWAYS_EXPANDED, MOST_EXPANSION * self.size)
        inflater, made, begun = zlib.decompressobj(31), 0, True
        for data in _slices(itertools.chain([first], rest)):
            while data:
                begun, before = True, inflater.copy()
                try:
                    out = inflater.decompress(data, CHUNK)
                except zlib.error:
                    out = _until_damaged(before, data)
                    yield out
                    self._damaged(made + len(out), "are damaged")
                    return
                made += len(out)
                if made > most:
                    raise RecordingError(
                        f"{printable(self.path)}: expands to more than {MOST_EXPANSION} times its "
                        "size, as no recording does; if it is one, decompress it and read that"
                    )
                if out:
                    yield out
                data = inflater.unconsumed_tail
                if inflater.eof:  # another member may follow, or zeros that fill a block
                    data, begun = inflater.unused_data.lstrip(b"\0"), False
                    inflater = zlib.decompressobj(31)
        if begun:
            if rest_of_it := inflater.flush():
                yield rest_of_it
            self._damaged(made, "end early")

    def _damaged(self, made: int, what: str) -> None:
        if not made:
            raise RecordingError(
                f"{printable(self.path)}: the compressed data {what}, and nothing can be read; "
                "copy the file again"
            )
        self.losses.append(f"the compressed data {what}, after {made} bytes of text")


@contextmanager
def on_disk(path: Path) -> Iterator[tuple[Path, str, list[str]]]:
    """Yield a regular file with what a path leads to, its name in words, and what was lost.

    A regular file is itself. What standard input (``-``), a pipe or a device gives is written to a
    temporary file first, as far as the bounds above, so that every format can be read from it.

    Raises
    ------
    RecordingError
        It has no end, or nothing came.
    """
    source = "standard input" if str(path) == "-" else printable(path)
    if source != "standard input" and not _is_stream(path):
        yield path, source, []
        return
    # The suffix stays, for the format may be known by that only.
    with scratch_file(f"recording{path.suffix}") as (copy, file):
        try:
            losses = _spool(path, source, file)
            file.flush()
        except OSError as error:
            raise unreadable(source, error) from None
        yield copy, source, losses


def _cut_to_lines(file: IO[bytes]) -> None:
    """Take off the begin of a line, whose last number would lack digits, where this is text."""
    file.seek(0)
    if b"\0" in file.read(1024):
        return
    end = file.seek(0, os.SEEK_END)
    file.seek(max(end - CHUNK, 0))
    last = file.read()
    file.truncate(end - (len(last) - last.rfind(b"\n") - 1))


def _slices(chunks: Iterable[bytes]) -> Iterator[bytes]:
    for chunk in chunks:
        for k in range(0, len(chunk), SLICE):
            yield chunk[k : k + SLICE]


def _until_damaged(inflater: "zlib._Decompress", data: bytes) -> bytes:
    """What compressed data give before the byte that cannot be."""
    found, left = list[bytes](), CHUNK
    with suppress(zlib.error):
        for k in range(len(data)):
            found.append(inflater.decompress(data[k : k + 1], left))
            left -= len(found[-1])
            if left <= 0:  # before the damage no more came, or it had been given already
                break
    return b"".join(found)


def unreadable(source: str, error: Exception) -> Exception:
    """Return the error of a file that the system does not let read; any other error as it is.

    A ValueError is the system's only where it is about a zero byte in the name.
    """
    if not isinstance(error, OSError) and "embedded null" not in str(error):
        return error
    reason = getattr(error, "strerror", None) or "cannot be read"
    return RecordingError(f"{source}: {reason}; check the path")


def _is_stream(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # whoever reads it says what is wrong
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISSOCK(mode)


def _spool(path: Path, source: str, file: IO[bytes]) -> list[str]:
    """Copy all that comes; say what ended it where that was no end."""
    stream = None
    if source != "standard input":
        # A pipe that no one writes to would keep whoever opens it waiting.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    else:
        stream = getattr(sys.stdin, "buffer", None)
        if stream is None:  # closed, or that of a notebook
            raise RecordingError(f"{source}: nothing can be read from it here; name a file")
        try:
            descriptor = os.dup(stream.fileno())
        except (OSError, ValueError):  # something in memory stands in for it
            file.write(stream.read(MOST_OF_A_PIPE))
            return []
    try:
        if os.isatty(descriptor):
            raise RecordingError(f"{source}: a terminal; name a file, or pipe one in")
        return _Spool(source, descriptor, awaited=stream is None).into(file)
    finally:
        os.close(descriptor)


@dataclass(slots=True)
class _Spool:
    """A stream that is copied for as long as it hurries, and as far as its kind may go."""

    source: str
    descriptor: int
    awaited: bool  # whether a writer may yet open it
    came: int = 0

    def into(self, file: IO[bytes]) -> list[str]:
        mode = os.fstat(self.descriptor).st_mode
        most = MOST_OF_A_DEVICE if stat.S_ISCHR(mode) else MOST_OF_A_PIPE
        if stat.S_ISREG(mode):  # standard input is a file: that has an end
            most = sys.maxsize
        until, expected = time.monotonic() + PATIENCE, 0.0
        while True:
            chunk = self._next(until)
            if chunk:
                file.write(chunk)
                self.came += len(chunk)
            elif chunk is not None:
                if self.came or not (self.awaited and stat.S_ISFIFO(mode)):
                    return []
                time.sleep(0.02)  # a pipe without a writer is at its end, until it has one
            if self.came > most:
                raise RecordingError(
                    f"{self.source}: does not end: more than {most >> 20} MiB came; write it to a "
                    "file, and name that"
                )
            if time.monotonic() >= until:
                if self.came < expected + PATIENCE * SLOWEST:
                    _cut_to_lines(file)
                    return self._too_slow()
                until, expected = until + PATIENCE, float(self.came)

    def _next(self, until: float) -> bytes | None:
        """What has come; nothing at an end, None where there is nothing yet."""
        if os.name == "posix":
            wait = max(until - time.monotonic(), 0.0)
            if not select.select([self.descriptor], [], [], wait)[0]:
                return None
        with suppress(BlockingIOError):
            return os.read(self.descriptor, CHUNK)
        return None

    def _too_slow(self) -> list[str]:
        if not self.came:
            raise RecordingError(
                f"{self.source}: nothing came for {PATIENCE:g} s; write to a file, and name that"
            )
        return [
            f"the stream was still open, but gave less than {SLOWEST >> 10} KiB/s for "
            f"{PATIENCE:g} s: what came later is not read"
        ]
