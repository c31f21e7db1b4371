"""Records of MCAP: one byte of kind, eight of length, then the content; found in blocks of bytes.

The format is public (mcap.dev/spec). Its own Python package makes an object of each message; here
all messages of a block are found at once.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.messages.fields import UndecodableError
from palpate.recordings.messages.layout import Bytes
from palpate.recordings.messages.record_starts import Starts, record_starts

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = range(1, 7)
STATISTICS = 0x0B
METADATA = 0x0C
DATA_END = 0x0F
LAST = 0x0F  # kinds above are not known, and may be anyone's from 0x80

# What a record of each kind has at the least, by its fields.
_SHORTEST = (0, 8, 20, 14, 16, 22, 40, 6, 48, 36, 44, 40, 8, 20, 9, 4)

#: Kind and length.
HEAD = 9
#: What stands in a message before its data: channel, sequence, log time, publish time.
MESSAGE_HEAD = 22

_LENGTH = struct.Struct("<Q").unpack_from


def size_at(data: bytes, position: int) -> int:
    """Return how many bytes the record has that begins here; 0 where it is not whole."""
    if position + HEAD > len(data):
        return 0
    size: int = HEAD + _LENGTH(data, position + 1)[0]
    return size if size <= len(data) - position else 0


def heads_at(data: bytes, position: int) -> list[tuple[int, int]]:
    """Return which bytes of a record say its kind and size: from where in it, and how many."""
    return [(0, HEAD)]


def whole_records(data: bytes) -> tuple[Starts, int]:
    """Return where the whole records of a block begin, one after another, and where they end."""
    return record_starts(data, 0, size_at, heads_at)


@dataclass(frozen=True, slots=True)
class Messages:
    """The messages of a block: where the data of each is, and what stands before it."""

    channels: NDArray[np.uint16]
    times: NDArray[np.int64]
    starts: Starts
    lengths: Starts


def messages_of(data: bytes, starts: Starts) -> Messages:
    """Return what the messages say that begin at these places; those too short to are left out."""
    view = np.frombuffer(data, np.uint8)
    lengths = _column(view, "<i8", starts + 1).astype(np.int64)
    whole = lengths >= MESSAGE_HEAD
    starts, lengths = starts[whole], lengths[whole]
    return Messages(
        _column(view, "<u2", starts + HEAD).astype(np.uint16),
        _column(view, "<i8", starts + HEAD + 6).astype(np.int64),
        starts + HEAD + MESSAGE_HEAD,
        lengths - MESSAGE_HEAD,
    )


def _column(view: Bytes, dtype: str, offsets: Starts) -> NDArray[np.generic]:
    """Numbers that stand anywhere in a block."""
    if not len(offsets):
        return np.empty(0, dtype)
    anywhere = np.ndarray((len(view) - np.dtype(dtype).itemsize + 1,), dtype, view, 0, (1,))
    found: NDArray[np.generic] = anywhere[offsets]
    return found


@dataclass(slots=True)
class Cursor:
    """Reads the fields of a record one after another."""

    data: bytes
    position: int = 0

    def number(self, form: str) -> int:
        """Return a number, such as ``"<I"``."""
        try:
            value: int = struct.unpack_from(form, self.data, self.position)[0]
        except struct.error:
            raise UndecodableError("a record is too short") from None
        self.position += struct.calcsize(form)
        return value

    def bytes(self) -> bytes:
        """Return as many bytes as the four before them say."""
        size = self.number("<I")
        if size > len(self.data) - self.position:
            raise UndecodableError("a record is too short")
        self.position += size
        return self.data[self.position - size : self.position]

    def text(self) -> str:
        """Return a text."""
        return self.bytes().decode("utf-8", "replace")

    def map(self) -> dict[str, str]:
        """Return texts by their names."""
        inner = Cursor(self.bytes())
        found = {}
        while inner.position < len(inner.data):
            name = inner.text()
            found[name] = inner.text()
        return found


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """What a chunk says of itself; ``begin`` is where its packed records do."""

    first: int
    last: int
    size: int
    checksum: int
    compression: str
    packed: int
    begin: int

    @classmethod
    def read(cls, data: bytes) -> "ChunkHead":
        """Read it from the first bytes of a chunk."""
        cursor = Cursor(data)
        first, last, size = (cursor.number("<Q") for _ in range(3))
        checksum = cursor.number("<I")
        compression = cursor.text()
        packed = cursor.number("<Q")
        return cls(first, last, size, checksum, compression, packed, cursor.position)


def plausible(data: bytes, position: int, size: int, offset: int = 0) -> bool:
    """Whether three records in a row, or all until the end of the file, begin here.

    Parameters
    ----------
    data : bytes
        A block of the file, that begins at ``offset``.
    position : int
        In the block.
    size : int
        Of the file.
    """
    for _ in range(3):
        if position + HEAD > len(data):
            return offset + position <= size
        kind, length = data[position], _LENGTH(data, position + 1)[0]
        if not 0 < kind <= LAST or length > size - offset - position - HEAD:
            return False
        if length < _SHORTEST[kind]:
            return False
        position += HEAD + length
    return True
