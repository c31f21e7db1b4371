"""MATLAB: variables and structs of arrays, of version 5 and of 7.3.

Files of version 5 are read here, and no length in them is believed: of a damaged one SciPy, and
what is built on it, takes memory for what is not there, or ends the process.

The layout: a head of 128 bytes, then an element for each variable, a tag (type, length) and its
data. A variable is a matrix: elements for its flags, sizes, name and numbers; a struct's or cells'
members are matrices again. Whole variables may be packed with deflate.
"""

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.recordings.bounds import LARGEST, in_words
from palpate.recordings.formats import Request
from palpate.recordings.nested import Findings
from palpate.recordings.recording import Recording, printable

#: Structs in an array of them; more are a table of another kind.
OBJECTS = 256

#: Fields of a struct that state the unit of the others.
UNIT_FIELDS = ("unit", "units", "Unit", "Units")

#: MATLAB's classes of plain numbers.
NUMBERS = frozenset(
    {"double", "single", "logical"}.union(
        f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64)
    )
)

_CURES = {
    "timeseries": "s = struct('time', ts.Time, 'data', ts.Data)",
    "timetable": "s = table2struct(timetable2table(tt), 'ToScalar', true), with its times as "
    "seconds(tt.Time - tt.Time(1))",
    "table": "s = table2struct(t, 'ToScalar', true)",
    "datetime": "s = posixtime(d)",
    "duration": "s = seconds(d)",
}
Order = Literal["little", "big"]

_MATRIX, _COMPRESSED = 14, 15
_TYPES = {  # of the numbers in an element
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
    16: "u1", 17: "u2", 18: "u4",
}  # fmt: skip
_CLASSES = {  # of the numbers that a variable holds; they may be stored in fewer bytes
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_COMPLEX, _LOGICAL = 0x0800, 0x0200
_OTHERS = {_CELL: "cell", _SPARSE: "sparse", _FUNCTION: "function_handle"}
_DEEPEST = 32


@dataclass(frozen=True, slots=True)
class Struct:
    """A struct, or an array of them: the fields of each."""

    items: tuple[dict[str, Any], ...]


@dataclass(frozen=True, slots=True)
class Other:
    """What is no array of numbers: MATLAB's name of its class."""

    kind: str


#: What a variable holds.
Value = NDArray[Any] | Struct | Other | str


class _WrongError(ValueError):
    """What an element claims does not fit into it."""


def read(path: Path, request: Request) -> Recording:
    """Read a MATLAB file: every variable of numbers, and those in structs.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        The file is of no version that is read, or too damaged, or holds no series of numbers.
    """
    source = printable(path)
    size = path.stat().st_size
    with path.open("rb") as file:
        begin = file.read(128)
    if begin.startswith((b"MATLAB 7.3", b"\x89HDF")):
        from palpate.recordings import matlab73  # needs h5py, and version 5 does not

        return matlab73.read(path, request)
    if not begin.startswith(b"MATLAB 5.0"):
        raise RecordingError(
            f"{source}: this is no MATLAB file of version 5 to 7.3; save it again with "
            "save(name, '-v7') or '-v7.3'"
        )
    found = Findings()
    for name, value in _variables(path, size, found):
        if name:  # MATLAB keeps what belongs to its objects in one without a name
            _take(value, (), name, found)
    return found.recording(source, request)


def _take(
    value: Value, group: tuple[str, ...], name: str, found: Findings, unit: str | None = None
) -> None:
    """Take a value: numbers, or a struct of them; say why it is neither."""
    whole = "/".join((*group, name))
    if isinstance(value, str):
        found.note(whole, value)
    elif isinstance(value, Other):
        found.omit(whole, no_class(value.kind))
    elif isinstance(value, Struct):
        _take_structs(value, group, name, found)
    elif value.size == 1:
        found.note(whole, value.reshape(-1)[0])
    else:
        numbers = np.asarray(value)
        found.add(group, name, numbers.shape, lambda: plain_numbers(numbers), group_unit=unit)


def _take_structs(value: Struct, group: tuple[str, ...], name: str, found: Findings) -> None:
    if len(value.items) > OBJECTS:
        whole = "/".join((*group, name))
        found.omit(whole, f"holds {len(value.items)} structs, and is no series")
        return
    for k, fields in enumerate(value.items):
        own = (*group, name if len(value.items) == 1 else f"{name}[{k}]")
        texts = [fields[u] for u in UNIT_FIELDS if isinstance(fields.get(u), str)]
        for field, inner in fields.items():
            _take(inner, own, field, found, texts[0].strip() if texts else None)


def no_class(name: str) -> str:
    """Say that a class holds no array that can be read, and how to save it."""
    if name in ("cell", "string", "function_handle", "char"):
        words = {"function_handle": "a function", "char": "text", "string": "text"}
        return f"holds {words.get(name, 'cells')}, and no series of numbers"
    if name == "complex":
        return "holds complex numbers"
    if name == "sparse":
        return "is a sparse matrix, and no series"
    cure = _CURES.get(name, "a struct of arrays")
    return f"is of MATLAB's class {name}, which only MATLAB can read; save {cure} instead"


def plain_numbers(values: NDArray[Any]) -> NDArray[Any]:
    """Return whole numbers of up to 32 bits as floats, which hold them exactly.

    MATLAB saves whole numbers of class double in as few bytes as hold them, and differences of
    small or unsigned ones would overflow.
    """
    small = values.dtype.kind == "b" or (values.dtype.kind in "iu" and values.dtype.itemsize < 8)
    return values.astype(np.float64) if small else values


def _variables(path: Path, size: int, found: Findings) -> Iterator[tuple[str, Value]]:
    """The variables of a file that are whole; say which are not."""
    with path.open("rb") as file:
        order: Order = "big" if file.read(128)[126:] == b"MI" else "little"
        for number in range(1, size):
            name = f"variable {number}"
            tag = file.read(8)
            if not tag:
                return
            kind, length = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))
            if len(tag) < 8 or kind not in (_MATRIX, _COMPRESSED):
                found.lose(name, "the file is cut off or damaged here; what follows is not read")
                return
            there = size - file.tell()
            if length > there:
                found.lose(
                    name, f"the file ends in it: {in_words(there)} of {in_words(length)} are there"
                )
                return
            try:
                yield _Matrix(_content(file, tag, kind, length), order).variable()
            except (_WrongError, zlib.error) as error:
                found.lose(name, f"cannot be read: {error}")


def _content(file: BinaryIO, tag: bytes, kind: int, length: int) -> bytes:
    """An element with its tag, unpacked."""
    packed = file.read(length)
    if kind == _MATRIX:
        return tag + packed
    unpacker = zlib.decompressobj()
    content = unpacker.decompress(packed, LARGEST)
    if not unpacker.eof:
        raise _WrongError("its packed data end too early")
    return content


class _Matrix:
    """Reads matrices, each element of which has to lie within the one around it."""

    def __init__(self, content: bytes, order: Order) -> None:
        self.content = content
        self.order = order

    def variable(self) -> tuple[str, Value]:
        """Return the name and the value."""
        kind, start, stop, _ = self._tag(0, len(self.content))
        if kind != _MATRIX:
            raise _WrongError("it holds no variable")
        return self._matrix(start, stop, 0)

    def _int(self, at: int) -> int:
        return int.from_bytes(self.content[at : at + 4], self.order)

    def _text(self, start: int, stop: int) -> str:
        return self.content[start:stop].partition(b"\0")[0].decode("latin-1")

    def _tag(self, at: int, end: int) -> tuple[int, int, int, int]:
        """Type, begin and end of the data of an element, and where the next one begins."""
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
            raise _WrongError(f"it claims {in_words(length)} of {in_words(end - start)}")
        padded = length if word == _MATRIX else -(-length // 8) * 8
        return word, start, start + length, min(start + padded, end)

    def _matrix(self, at: int, end: int, depth: int) -> tuple[str, Value]:
        if at == end:  # what MATLAB writes for []
            return "", np.empty((0, 0))
        if depth > _DEEPEST:
            raise _WrongError("it is nested too deeply")
        _, start, _, at = self._tag(at, end)
        flags = self._int(start)
        kind = flags & 0xFF
        if kind == _OPAQUE:  # three names: the variable's, the system's and that of the class
            names = []
            for _ in range(3):
                _, start, stop, at = self._tag(at, end)
                names.append(self._text(start, stop))
            return names[0], Other(names[2])
        _, start, stop, at = self._tag(at, end)
        sizes = tuple(self._int(k) for k in range(start, stop - 3, 4))
        _, start, stop, at = self._tag(at, end)
        name = self._text(start, stop)
        if kind in _CLASSES:
            return name, self._numbers(flags, sizes, at, end)
        if kind == _CHAR:
            return name, Other("char") if sizes[:1] > (1,) else self._chars(at, end)
        if kind in (_STRUCT, _OBJECT):
            return name, self._struct(kind, math.prod(sizes), at, end, depth)
        if kind not in _OTHERS:
            raise _WrongError(f"it is of a class that MATLAB does not have, {kind}")
        return name, Other(_OTHERS[kind])

    def _array(self, at: int, end: int) -> NDArray[Any]:
        """The numbers of one element."""
        kind, start, stop, _ = self._tag(at, end)
        if kind not in _TYPES:
            raise _WrongError(f"its numbers are of a type that MATLAB does not have, {kind}")
        form = np.dtype(_TYPES[kind]).newbyteorder(self.order)
        count = (stop - start) // form.itemsize
        return np.frombuffer(self.content, form, count, start)

    def _numbers(self, flags: int, sizes: tuple[int, ...], at: int, end: int) -> Value:
        if flags & _COMPLEX:
            return Other("complex")
        stored = self._array(at, end)
        if stored.size != math.prod(sizes):
            raise _WrongError(f"it claims {math.prod(sizes)} values, and {stored.size} are there")
        kind = np.dtype(np.bool_) if flags & _LOGICAL else np.dtype(_CLASSES[flags & 0xFF])
        return stored.astype(kind, copy=False).reshape(sizes, order="F")

    def _chars(self, at: int, end: int) -> Value:
        kind, start, stop, _ = self._tag(at, end)
        encoding = {2: "latin-1", 1: "latin-1", 16: "utf-8", 17: "utf-16", 4: "utf-16"}.get(kind)
        if encoding is None:
            return Other("char")
        if encoding == "utf-16":
            encoding += "-be" if self.order == "big" else "-le"
        return self.content[start:stop].decode(encoding, "replace")

    def _struct(self, kind: int, count: int, at: int, end: int, depth: int) -> Value:
        if kind == _OBJECT:
            _, start, stop, at = self._tag(at, end)
            return Other(self._text(start, stop))
        _, start, _, at = self._tag(at, end)
        longest = self._int(start)
        _, start, stop, at = self._tag(at, end)
        if not longest or (stop - start) % longest:
            raise _WrongError("the names of its fields are damaged")
        fields = [self._text(k, k + longest) for k in range(start, stop, longest)]
        if count * len(fields) * 8 > end - at or (not fields and count > 1):
            raise _WrongError(f"it claims {count} structs of {in_words(end - at)}")
        items = []
        for _ in range(count):
            item: dict[str, Any] = {}
            for field in fields:
                _, start, stop, at = self._tag(at, end)
                item[field] = self._matrix(start, stop, depth + 1)[1]
            items.append(item)
        return Struct(tuple(items))
