"""Messages of protobuf: walked by their descriptor, as those of ROS are by their definition."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError

from palpate.recordings.messages.fields import LONGEST_LIST, UndecodableError
from palpate.recordings.messages.layout import (
    ConstantAt,
    Entity,
    Layout,
    Leaf,
    NumberAt,
    TimeAt,
    VarintAt,
)

_Kind = descriptor_pb2.FieldDescriptorProto
# dtype, wire type (0 varint, 1 eight bytes, 5 four), zigzag
_NUMBERS: dict[int, tuple[str, int, bool]] = {
    _Kind.TYPE_DOUBLE: ("<f8", 1, False),
    _Kind.TYPE_FLOAT: ("<f4", 5, False),
    _Kind.TYPE_FIXED64: ("<u8", 1, False),
    _Kind.TYPE_FIXED32: ("<u4", 5, False),
    _Kind.TYPE_SFIXED64: ("<i8", 1, False),
    _Kind.TYPE_SFIXED32: ("<i4", 5, False),
    _Kind.TYPE_INT64: ("i8", 0, False),
    _Kind.TYPE_UINT64: ("u8", 0, False),
    _Kind.TYPE_INT32: ("i4", 0, False),
    _Kind.TYPE_UINT32: ("u4", 0, False),
    _Kind.TYPE_SINT64: ("i8", 0, True),
    _Kind.TYPE_SINT32: ("i4", 0, True),
    _Kind.TYPE_BOOL: ("b1", 0, False),
    _Kind.TYPE_ENUM: ("i4", 0, False),
}
_TIMES = (".google.protobuf.Timestamp", ".google.protobuf.Duration")
_FRAMES = ("frame_id", "parent_frame_id", "child_frame_id")
_DEEPEST = 32
_MOST_PARTS = 100_000

_Field: TypeAlias = Any  # descriptor_pb2 has no types


@dataclass(frozen=True, slots=True)
class _Message:
    name: str
    by_number: dict[int, _Field]
    proto3: bool


def walk_of(type_name: str, schema: bytes) -> Callable[[bytes], Layout]:
    """Return what walks messages of a type.

    Parameters
    ----------
    type_name : str
        For instance ``foxglove.PoseInFrame``.
    schema : bytes
        A FileDescriptorSet with the type and all that it holds.

    Raises
    ------
    UndecodableError
        It is none, or the type is not in it.
    """
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(schema).file
    except DecodeError:
        raise UndecodableError("its schema is no protobuf descriptor") from None
    types: dict[str, _Message] = {}
    for file in files:
        above = f".{file.package}" if file.package else ""
        for message in file.message_type:
            _collect(types, above, message, file.syntax == "proto3", 0)
    root = types.get(f".{type_name}")
    if root is None:
        raise UndecodableError("its schema does not hold its type")
    return lambda message: _Walk(message, types).walk(root)


def _collect(
    types: dict[str, _Message], above: str, message: Any, proto3: bool, depth: int
) -> None:
    if depth > _DEEPEST:
        raise UndecodableError(f"its schema is nested more than {_DEEPEST} deep")
    name = f"{above}.{message.name}"
    types[name] = _Message(name, {field.number: field for field in message.field}, proto3)
    for nested in message.nested_type:
        _collect(types, name, nested, proto3, depth + 1)


class _Walk:
    def __init__(self, message: bytes, types: dict[str, _Message]) -> None:
        self.data = message
        self.types = types
        self.layout = Layout(len(message))
        self.entity = Entity()
        self.left = _MOST_PARTS

    def walk(self, root: _Message) -> Layout:
        self.layout.entities.append(self.entity)
        self._message(root, 0, len(self.data), "", 0)
        return self.layout

    def _message(self, kind: _Message, position: int, end: int, path: str, depth: int) -> None:
        if depth > _DEEPEST:
            raise UndecodableError(f"a message is nested more than {_DEEPEST} deep")
        counts: dict[int, int] = {}
        while position < end:
            self.left -= 1
            if self.left < 0:
                raise UndecodableError(f"a message has more than {_MOST_PARTS} parts")
            begin = position
            tag, position = self._varint(position, end)
            self.layout.check(self.data, begin, position)
            field = kind.by_number.get(tag >> 3)
            count = counts.get(tag >> 3, 0)
            counts[tag >> 3] = count + 1
            below = _below(path, field, count)
            if field is not None:
                self.entity.types[below] = kind.name.lstrip("."), field.name
            position = self._value(field, tag & 7, position, end, below, depth)
        self._defaults(kind, counts, path)

    def _value(
        self, field: _Field | None, wire: int, position: int, end: int, path: str, depth: int
    ) -> int:
        number = _NUMBERS.get(field.type) if field is not None else None
        begin = position
        if wire == 2:
            size, position = self._varint(position, end)
            self.layout.check(self.data, begin, position)
            if size > end - position:
                raise UndecodableError("a message ends before what its type says")
            if field is not None:
                self._sized(field, number, position, position + size, path, depth)
            return position + size
        if wire == 0:
            _, position = self._varint(position, end)
            self.layout.check(self.data, begin, position, 0x80)
        elif wire in (1, 5):
            position += 8 if wire == 1 else 4
        else:
            raise UndecodableError(f"a message has a field of the wire type {wire}")
        if position > end:
            raise UndecodableError("a message ends before what its type says")
        if number is not None and number[1] == wire:
            self._leaf(path, _number(number, begin, position))
        return position

    def _sized(
        self, field: _Field, number: Any, begin: int, end: int, path: str, depth: int
    ) -> None:
        if field.type == _Kind.TYPE_MESSAGE:
            self._inner(field, begin, end, path, depth)
        elif number is not None:
            self._packed(number, begin, end, path)
        elif field.name in _FRAMES:
            self.layout.check(self.data, begin, end)
            text = self.data[begin:end][:200].decode("utf-8", "backslashreplace")
            text = "".join(each if each.isprintable() else "?" for each in text)
            self.entity.frames[path] = text
        elif field.type == _Kind.TYPE_BYTES and end - begin > LONGEST_LIST:
            self.layout.skipped[path] = end - begin

    def _inner(self, field: _Field, begin: int, end: int, path: str, depth: int) -> None:
        kind = self.types.get(field.type_name)
        if kind is None:
            raise UndecodableError(f"its schema does not hold {field.type_name[:80]}")
        if field.type_name in _TIMES:
            return self._time(kind, begin, end, path, depth)
        index = _index(path)
        if index is not None and index >= LONGEST_LIST:
            bare = path[: path.rindex("[")]
            self.layout.skipped[bare] = self.layout.skipped.get(bare, 0) + end - begin
            self._forget(bare)
            return None
        if path.startswith("transforms[") and path.endswith("]"):
            above, self.entity = self.entity, Entity()
            self._message(kind, begin, end, "", depth + 1)
            frames = self.entity.frames
            pair = f"[{frames.get('parent_frame_id', '')}>{frames.get('child_frame_id', '')}]"
            self.layout.entities.append(Entity(pair, self.entity.leaves, self.entity.types, frames))
            self.entity = above
            return None
        return self._message(kind, begin, end, path, depth + 1)

    def _forget(self, path: str) -> None:
        """Leave out what has been found of a list that turns out to be long."""
        for each in [name for name in self.entity.leaves if name.startswith(f"{path}[")]:
            del self.entity.leaves[each]

    def _time(self, kind: _Message, begin: int, end: int, path: str, depth: int) -> None:
        above, self.entity = self.entity, Entity()
        self._message(kind, begin, end, "", depth + 1)
        leaves = self.entity.leaves
        self.entity = above
        if {"seconds", "nanos"} <= leaves.keys():
            self._leaf(path, TimeAt(leaves["seconds"], leaves["nanos"]))

    def _packed(self, number: tuple[str, int, bool], begin: int, end: int, path: str) -> None:
        path = path.rpartition("[")[0] if path.endswith("]") else path
        position, count = begin, 0
        if number[1]:
            size = 8 if number[1] == 1 else 4
            if (end - begin) % size:
                raise UndecodableError("a list does not consist of whole numbers")
            if (end - begin) // size > LONGEST_LIST:
                self.layout.skipped[path] = end - begin
                return
        elif end - begin > 10 * LONGEST_LIST:
            self.layout.skipped[path] = end - begin
            return
        while position < end:
            at = position
            if number[1]:
                position += size
            else:
                _, position = self._varint(position, end)
                self.layout.check(self.data, at, position, 0x80)
            self._leaf(f"{path}[{count}]", _number(number, at, position))
            count += 1

    def _defaults(self, kind: _Message, counts: dict[int, int], path: str) -> None:
        """Numbers that are left out because they have their default."""
        for number, field in kind.by_number.items():
            known = _NUMBERS.get(field.type)
            if number in counts or known is None or field.label == _Kind.LABEL_REPEATED:
                continue
            if field.HasField("oneof_index") or not (
                kind.proto3 or field.HasField("default_value")
            ):
                continue  # it may be left out because there is none
            value = _default(field.default_value, known[0])
            self._leaf(_below(path, field, 0), ConstantAt(value, known[0]))

    def _leaf(self, path: str, leaf: Leaf) -> None:
        index = _index(path)
        if index is not None and index >= LONGEST_LIST:
            bare = path[: path.rindex("[")]
            self.layout.skipped[bare] = self.layout.skipped.get(bare, 0) + 8
            self._forget(bare)
            return
        self.entity.leaves[path] = leaf

    def _varint(self, position: int, end: int) -> tuple[int, int]:
        value = shift = 0
        while position < end and shift < 70:
            byte = self.data[position]
            value |= (byte & 0x7F) << shift
            position += 1
            shift += 7
            if not byte & 0x80:
                return value, position
        raise UndecodableError("a message has a number that does not end")


def _below(path: str, field: _Field | None, count: int) -> str:
    if field is None:
        return path
    name = f"{path}.{field.name}" if path else str(field.name)
    return f"{name}[{count}]" if field.label == _Kind.LABEL_REPEATED else name


def _index(path: str) -> int | None:
    """The last index of a path that ends with one."""
    if not path.endswith("]"):
        return None
    return int(path[path.rindex("[") + 1 : -1])


def _number(known: tuple[str, int, bool], begin: int, end: int) -> Leaf:
    dtype, wire, zigzag = known
    return NumberAt(begin, dtype) if wire else VarintAt(begin, end - begin, dtype, zigzag)


def _default(text: str, dtype: str) -> float:
    try:
        if dtype == "b1":
            return text == "true"
        return float(text) if "f" in dtype else int(text or 0)
    except ValueError:  # the name of an enumerator
        return 0
