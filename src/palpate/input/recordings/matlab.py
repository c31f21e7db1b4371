"""MATLAB files of version 5 and 7.3: variables and structs of arrays.

This module reads version 5 itself and checks every length in the file: on a damaged file SciPy may
allocate far too much memory or end the process.

The layout: a header of 128 bytes, then an element for each variable, a tag (type, length) and its
data. A variable is a matrix: elements for its flags, sizes, name and numbers; the members of a
struct or cell are matrices again. A whole variable may be compressed with deflate.
"""

import math
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from rich.filesize import decimal as format_bytes

from palpate.errors import import_extra
from palpate.input.recordings.nested import OBJECTS, UNIT_FIELDS, Arrays, no_class, plain_numbers
from palpate.input.recordings.opening import Request
from palpate.input.recordings.recording import Recording
from palpate.validation import Values, frozen

Order = Literal["little", "big"]

_MATRIX = 14
_COMPRESSED = 15
_TYPES = {  # types of stored numbers
    **dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4"), start=1)),
    9: "f8", 12: "i8", 13: "u8", 16: "u1", 17: "u2", 18: "u4",
}  # fmt: skip
# Types of the numbers of a variable, which may be stored in fewer bytes.
_CLASSES = dict(enumerate(("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"), start=6))
_STRUCT = 2
_OBJECT = 3
_CHAR = 4
_OPAQUE = 17
_COMPLEX = 0x0800
_LOGICAL = 0x0200
_OTHERS = {1: "cell", 5: "sparse", 16: "function_handle"}
_DEEPEST = 32
_MOST_FIELDS = 10_000


@frozen
class Other:
    """A value that is not numeric: the name of its MATLAB class."""

    kind: str


class Element(NamedTuple):
    """An element: its type, and where its data begin and end."""

    kind: int
    start: int
    stop: int


#: The value of a variable; of an array of structs the fields of each.
Value = Values | list[dict[str, Any]] | Other | str


class _WrongError(ValueError):
    """An element is damaged: the message says how."""


def read(path: Path, request: Request) -> Recording:
    """Read a MATLAB file: every variable and every field of a struct that holds numbers.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The file has another version, is too damaged, or holds no time series.
    """
    with path.open("rb") as file:
        begin = file.read(128)
    if begin.startswith((b"MATLAB 7.3", b"\x89HDF")):
        # Version 7.3 needs h5py; version 5 does not.
        hdf5 = import_extra(
            "palpate.input.recordings.hdf5", "reading a MATLAB 7.3 file", "recordings"
        )
        recording: Recording = hdf5.read_matlab(path, request)
        return recording
    if not begin.startswith(b"MATLAB 5.0"):
        raise request.error(
            "this is not a MATLAB file of version 5 to 7.3; "
            "save it again with save(name, '-v7') or '-v7.3'"
        )
    arrays = Arrays(request)
    for name, value in _variables(path, arrays):
        if name:  # MATLAB stores the data of its objects in a variable without a name
            _take(value, "", name, arrays)
    return arrays.recording()


def _take(value: Value, group: str, name: str, arrays: Arrays, unit: str | None = None) -> None:
    """Add a value: numbers or a struct of numbers; report anything else."""
    if isinstance(value, str):
        arrays.note(group + name, value)
    elif isinstance(value, Other):
        arrays.omit(group + name, no_class(value.kind))
    elif isinstance(value, list):
        _take_structs(value, group, name, arrays)
    elif value.size == 1:
        arrays.note(group + name, value.reshape(-1)[0])
    else:
        numbers = np.asarray(value)
        arrays.add(group, name, numbers.shape, lambda: plain_numbers(numbers), group_unit=unit)


def _take_structs(structs: list[dict[str, Any]], group: str, name: str, arrays: Arrays) -> None:
    if len(structs) > OBJECTS:
        arrays.omit(group + name, f"holds {len(structs)} structs, not a time series")
        return
    for k, fields in enumerate(structs):
        struct = f"{group}{name}/" if len(structs) == 1 else f"{group}{name}[{k}]/"
        texts = [fields[u] for u in UNIT_FIELDS if isinstance(fields.get(u), str)]
        for field, inner in fields.items():
            _take(inner, struct, field, arrays, texts[0].strip() if texts else None)


def _variables(path: Path, arrays: Arrays) -> Iterator[tuple[str, Value]]:
    """The complete variables of a file; report the others."""
    size = path.stat().st_size
    with path.open("rb") as file:
        order: Order = "big" if file.read(128)[126:] == b"MI" else "little"
        for number in range(1, size):
            name = f"variable {number}"
            tag = file.read(8)
            if not tag:
                return
            kind = int.from_bytes(tag[:4], order)
            length = int.from_bytes(tag[4:], order)
            if len(tag) < 8 or kind not in (_MATRIX, _COMPRESSED):
                arrays.lose(name, "the file is cut off or damaged here; the rest is not read")
                return
            stored = size - file.tell()
            if length > stored:
                share = f"{format_bytes(stored)} of {format_bytes(length)}"
                arrays.lose(name, f"the file is cut off here: it holds {share}")
                return
            try:
                yield _Matrix(_content(file, tag, kind, length, arrays.request), order).variable()
            except (_WrongError, zlib.error) as error:
                arrays.lose(name, f"cannot be read: {error}")


def _content(file: BinaryIO, tag: bytes, kind: int, length: int, request: Request) -> bytes:
    """An element with its tag, decompressed."""
    request.reserve(length)
    packed = file.read(length)
    if kind == _MATRIX:
        return tag + packed
    unpacker = zlib.decompressobj()
    content = unpacker.decompress(packed, request.max_size)
    request.reserve(len(content))
    if not unpacker.eof:
        raise _WrongError("its compressed data are cut off")
    return content


class _Matrix:
    """Reads matrices, and checks that each element lies within the enclosing one."""

    def __init__(self, content: bytes, order: Order) -> None:
        self.content = content
        self.order = order

    def variable(self) -> tuple[str, Value]:
        """Return the name and the value."""
        element = next(self._elements(0, len(self.content)))
        if element.kind != _MATRIX:
            raise _WrongError("it is not a variable")
        return self._matrix(element, 0)

    def _int(self, start: int) -> int:
        return int.from_bytes(self.content[start : start + 4], self.order)

    def _text(self, element: Element) -> str:
        return self.content[element.start : element.stop].partition(b"\0")[0].decode("latin-1")

    def _elements(self, start: int, end: int) -> Iterator[Element]:
        """Yield the elements in order; raise if the next one is missing."""
        while True:
            if start + 8 > end:
                raise _WrongError("it is cut off")
            kind = self._int(start)
            if length := kind >> 16:  # a small element: its data are in its tag
                kind &= 0xFFFF
                if length > 4:
                    raise _WrongError("the tag of a small element is wrong")
                yield Element(kind, start + 4, start + 4 + length)
                start += 8
                continue
            length = self._int(start + 4)
            start += 8
            if start + length > end:
                raise _WrongError(
                    f"it states {format_bytes(length)} but has {format_bytes(end - start)}"
                )
            yield Element(kind, start, start + length)
            padded = length if kind == _MATRIX else -(-length // 8) * 8
            start = min(start + padded, end)

    def _matrix(self, matrix: Element, depth: int) -> tuple[str, Value]:
        if matrix.start == matrix.stop:  # what MATLAB writes for []
            return "", np.empty((0, 0))
        if depth > _DEEPEST:
            raise _WrongError("it is nested too deeply")
        elements = self._elements(matrix.start, matrix.stop)
        flags = self._int(next(elements).start)
        kind = flags & 0xFF
        if kind == _OPAQUE:  # the names of the variable, the system and the class
            name, _, class_name = (self._text(next(elements)) for _ in range(3))
            return name, Other(class_name)
        _, begin, stop = next(elements)
        sizes = tuple(self._int(k) for k in range(begin, stop - 3, 4))
        name = self._text(next(elements))
        if kind in _CLASSES:
            return name, self._numbers(flags, sizes, next(elements))
        if kind == _CHAR:
            return name, Other("char") if sizes[:1] > (1,) else self._chars(next(elements))
        if kind == _OBJECT:
            return name, Other(self._text(next(elements)))
        if kind == _STRUCT:
            return name, self._struct(math.prod(sizes), elements, matrix.stop, depth)
        if kind not in _OTHERS:
            raise _WrongError(f"its class {kind} does not exist in MATLAB")
        return name, Other(_OTHERS[kind])

    def _numbers(self, flags: int, sizes: tuple[int, ...], element: Element) -> Value:
        if flags & _COMPLEX:
            return Other("complex")
        kind, start, stop = element
        if kind not in _TYPES:
            raise _WrongError(f"the type {kind} of its numbers does not exist in MATLAB")
        form = np.dtype(_TYPES[kind]).newbyteorder(self.order)
        stored = np.frombuffer(self.content, form, (stop - start) // form.itemsize, start)
        if stored.size != math.prod(sizes):
            raise _WrongError(f"it states {math.prod(sizes)} values but has {stored.size}")
        dtype = np.dtype(bool if flags & _LOGICAL else _CLASSES[flags & 0xFF])
        return stored.astype(dtype, copy=False).reshape(sizes, order="F")

    def _chars(self, element: Element) -> Value:
        kind, start, stop = element
        utf16 = "utf-16-be" if self.order == "big" else "utf-16-le"
        encoding = {2: "latin-1", 1: "latin-1", 16: "utf-8", 17: utf16, 4: utf16}.get(kind)
        if encoding is None:
            return Other("char")
        return self.content[start:stop].decode(encoding, "replace")

    def _struct(self, count: int, elements: Iterator[Element], end: int, depth: int) -> Value:
        longest = self._int(next(elements).start)
        _, start, stop = next(elements)
        if not longest or (stop - start) % longest:
            raise _WrongError("the names of its fields are damaged")
        fields = [self._text(Element(_CHAR, k, k + longest)) for k in range(start, stop, longest)]
        if count * len(fields) * 8 > end - stop or (not fields and count > 1):
            raise _WrongError(f"it states {count} structs in {format_bytes(end - stop)}")
        if count > OBJECTS:  # another kind of table: report only its size
            return [{}] * count
        if len(fields) > _MOST_FIELDS:
            raise _WrongError(f"a struct of {len(fields)} fields is not a time series")
        return [
            {name: self._matrix(next(elements), depth + 1)[1] for name in fields}
            for _ in range(count)
        ]
