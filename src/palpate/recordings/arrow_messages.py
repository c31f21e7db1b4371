"""What the messages of an Arrow file claim to unpack to, without unpacking them.

A file is a row of messages: four bytes of FF, the length of the description, the description (a
flatbuffer), and the buffers that it describes. A packed buffer begins with its unpacked length.
"""

import struct
from typing import BinaryIO

_MARK = 0xFFFFFFFF
_DICTIONARY, _BATCH = 2, 3
# A description of a thousand columns takes some 100 kB.
_LONGEST = 64 << 20


def unpacked_size(file: BinaryIO, size: int) -> int:
    """Return the bytes that all buffers of a file unpack to, as they claim; read from byte 8 on."""
    total, at = 0, 8
    while at + 8 <= size:
        file.seek(at)
        mark, length = struct.unpack("<II", file.read(8))
        if mark != _MARK or not 0 < length <= min(_LONGEST, size - at):
            break  # the end of the messages, or of what can be read of them
        try:
            message = _Table.root(file.read(length))
            body = message.number(3, "<q")
            total += _claimed(message, file, at + 8 + length)
        except (OSError, OverflowError, struct.error, ValueError):  # pyarrow says what is wrong
            break
        if body < 0:
            break
        at += 8 + length + body
    return total


def _claimed(message: "_Table", file: BinaryIO, body: int) -> int:
    kind = message.number(1, "<B")
    if kind not in (_DICTIONARY, _BATCH):
        return 0
    batch = message.table(2) if kind == _BATCH else message.table(2).table(1)
    claimed = 8 * max(batch.number(0, "<q"), 0)  # a column of nothing takes no buffer
    packed = batch.place(3) is not None
    for offset, length in batch.pairs(2):
        if packed and length >= 8:
            file.seek(body + offset)
            found = file.read(8)
            unpacked = struct.unpack("<q", found)[0] if len(found) == 8 else 0
            length = unpacked if unpacked >= 0 else length  # -1: this one is not packed
        claimed += max(length, 0)
    return claimed


class _Table:
    """A table of a flatbuffer: fields by their number, each of them optional."""

    def __init__(self, content: bytes, at: int) -> None:
        if not 0 <= at <= len(content) - 4:
            raise ValueError
        self.content, self.at = content, at
        self.index = at - struct.unpack_from("<i", content, at)[0]
        if not 0 <= self.index <= len(content) - 2:
            raise ValueError

    @classmethod
    def root(cls, content: bytes) -> "_Table":
        return cls(content, struct.unpack_from("<I", content)[0])

    def place(self, field: int) -> int | None:
        """Where a field stands; None where it is absent."""
        length = struct.unpack_from("<H", self.content, self.index)[0]
        entry = 4 + 2 * field
        if entry + 2 > length:
            return None
        offset = struct.unpack_from("<H", self.content, self.index + entry)[0]
        return self.at + offset if offset else None

    def number(self, field: int, form: str) -> int:
        place = self.place(field)
        return 0 if place is None else int(struct.unpack_from(form, self.content, place)[0])

    def _leads_to(self, field: int) -> int:
        place = self.place(field)
        if place is None:
            raise ValueError
        return place + int(struct.unpack_from("<I", self.content, place)[0])

    def table(self, field: int) -> "_Table":
        return _Table(self.content, self._leads_to(field))

    def pairs(self, field: int) -> list[tuple[int, int]]:
        """A vector of pairs of whole numbers."""
        if self.place(field) is None:
            return []
        at = self._leads_to(field)
        count = struct.unpack_from("<I", self.content, at)[0]
        if at + 4 + 16 * count > len(self.content):
            raise ValueError
        numbers = struct.unpack_from(f"<{2 * count}q", self.content, at + 4)
        return list(zip(numbers[::2], numbers[1::2], strict=True))
