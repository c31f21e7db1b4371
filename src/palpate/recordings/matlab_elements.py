"""The elements of a MATLAB file of version 5, unpacked within bounds and checked.

SciPy, which reads them, believes what the tags of a file say, and takes memory for it.
"""

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from palpate.recordings.bounds import Budget, in_words
from palpate.recordings.nested import Findings

_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 5, 16, 17
_DEEPEST = 32


@dataclass(frozen=True, slots=True)
class Element:
    """One variable of a file, as bytes that begin with its tag."""

    name: str
    content: bytes


class _WrongError(ValueError):
    """What an element claims does not fit into it."""


def elements(path: Path, size: int, found: Findings) -> Iterator[Element]:
    """Yield the elements of a file that are whole, checked; say which are not."""
    budget = Budget(size)
    with path.open("rb") as file:
        header = file.read(128)
        order: str = "big" if header[126:128] == b"MI" else "little"
        for number in range(1, size):
            tag = file.read(8)
            if not tag:
                return
            kind, length = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))  # type: ignore[arg-type]
            name = f"variable {number}"
            if len(tag) < 8 or kind not in (_MATRIX, _COMPRESSED):
                found.lose(name, "the file is cut off or damaged here; what follows is not read")
                return
            if file.tell() + length > size:
                found.lose(
                    name,
                    f"the file ends in it: {in_words(size - file.tell())} of {in_words(length)} "
                    "are there",
                )
                return
            try:
                content = _content(file, tag, kind, length, budget)
                yield Element(_Check(content, order).variable() or name, content)
            except (_WrongError, zlib.error) as error:
                found.lose(name, f"cannot be read: {error}")


def _content(file: BinaryIO, tag: bytes, kind: int, length: int, budget: Budget) -> bytes:
    packed = file.read(length)
    if kind == _MATRIX:
        return tag + packed
    most = min(budget.left, max(1 << 20, 1100 * length))  # deflate cannot do more than 1032
    unpacker = zlib.decompressobj()
    content = unpacker.decompress(packed, most + 1)
    if len(content) > most or not budget.allows(len(content), length):
        raise _WrongError(f"its {in_words(length)} unpack to more than {in_words(most)}")
    if not unpacker.eof:
        raise _WrongError("its compressed data end too early")
    return content


class _Check:
    """Walks the tags of an element: each has to lie within the one around it."""

    def __init__(self, content: bytes, order: str) -> None:
        self.content = content
        self.order = order

    def variable(self) -> str:
        """Check all of it; return the name of the variable."""
        kind, start, stop, _ = self._tag(0, len(self.content))
        if kind != _MATRIX:
            raise _WrongError("it holds no variable")
        return self._matrix(start, stop, 0)

    def _int(self, at: int, size: int = 4) -> int:
        return int.from_bytes(self.content[at : at + size], self.order)  # type: ignore[arg-type]

    def _tag(self, at: int, end: int) -> tuple[int, int, int, int]:
        """Kind, begin and end of the data of an element, and where the next one begins."""
        if at + 8 > end:
            raise _WrongError("it ends too early")
        word = self._int(at)
        if word >> 16:  # a small one, whose data stand in its tag
            length, start, after = word >> 16, at + 4, at + 8
            if length > 4:
                raise _WrongError("the tag of a small element is wrong")
            return word & 0xFFFF, start, start + length, after
        length, start = self._int(at + 4), at + 8
        if start + length > end:
            raise _WrongError(
                f"it claims {in_words(length)}, and {in_words(end - start)} are there"
            )
        padded = start + length if word in (_MATRIX, _COMPRESSED) else start + -(-length // 8) * 8
        return word, start, start + length, padded

    def _matrix(self, at: int, end: int, depth: int) -> str:
        if at == end:  # an empty one
            return ""
        if depth > _DEEPEST:
            raise _WrongError("it is nested too deeply")
        _, start, _, at = self._tag(at, end)
        kind = self._int(start) & 0xFF
        if kind == _OPAQUE:  # no sizes; SciPy reads the four parts as they come
            return self._opaque(at, end, depth)
        _, start, stop, at = self._tag(at, end)
        sizes = [self._int(k) for k in range(start, stop, 4)]
        count = math.prod(sizes)
        largest = max(sizes[1:], default=0) if kind == _SPARSE else count
        if largest > end - at and largest:
            raise _WrongError(f"it claims {count} values, and {in_words(end - at)} are there")
        _, start, stop, at = self._tag(at, end)
        name = self.content[start:stop].decode("latin-1")
        if kind in (_CELL, _STRUCT, _OBJECT, _FUNCTION):
            self._members(kind, count, at, end, depth)
        else:
            while at < end:
                _, _, _, at = self._tag(at, end)
        return name

    def _members(self, kind: int, count: int, at: int, end: int, depth: int) -> None:
        """The matrices within a struct, or within cells."""
        if kind == _OBJECT:
            _, _, _, at = self._tag(at, end)
        if kind in (_STRUCT, _OBJECT):
            _, start, _, at = self._tag(at, end)
            longest = self._int(start)
            _, start, stop, at = self._tag(at, end)
            if not longest or (stop - start) % longest:
                raise _WrongError("the names of its fields are damaged")
            count *= (stop - start) // longest
        if kind == _FUNCTION:
            count = 1
        for _ in range(count):
            _, start, stop, at = self._tag(at, end)
            self._matrix(start, stop, depth + 1)

    def _opaque(self, at: int, end: int, depth: int) -> str:
        names = []
        while at < end:
            kind, start, stop, at = self._tag(at, end)
            if kind == _MATRIX:
                self._matrix(start, stop, depth + 1)
            else:
                names.append(self.content[start:stop].decode("latin-1"))
        return names[0] if names else ""
