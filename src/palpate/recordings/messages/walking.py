"""One message of ROS 1 or of ROS 2, walked by its definition: where its numbers stand."""

import struct
from dataclasses import dataclass

from palpate.recordings.messages.fields import (
    DURATION,
    LONGEST_LIST,
    TIME,
    TRANSFORM,
    Field,
    Group,
    Many,
    Number,
    Text,
    UndecodableError,
    one_line,
    smallest,
)
from palpate.recordings.messages.layout import Entity, Layout, NumberAt, TimeAt

# A message of more parts than this is a map or a plan; walking one takes some 0.1 s.
MOST_PARTS = 100_000

FRAMES = ("frame_id", "child_frame_id")
_NAMES = ("name", "names", "joint_names")  # of what the lists beside them hold
_LONGEST_NAME = 200  # bytes


@dataclass(frozen=True, slots=True)
class Encoding:
    """How the numbers of a message follow each other.

    Attributes
    ----------
    begin : int
        Bytes before the first field, from which CDR aligns.
    order : str
        Of bytes: ``"<"`` or ``">"``.
    alignment : int
        The largest: 1 for ROS 1, which packs; 8 for CDR; 4 for its second version.
    """

    begin: int
    order: str
    alignment: int


ROS1 = Encoding(0, "<", 1)
_CDR = {
    0x00: Encoding(4, ">", 8),
    0x01: Encoding(4, "<", 8),
    0x06: Encoding(4, ">", 4),
    0x07: Encoding(4, "<", 4),
}


def walk_ros1(message: bytes, fields: Group) -> Layout:
    """Return the layout of a message of ROS 1; UndecodableError where it is not of its type."""
    return _Walk(message, ROS1).walk(fields)


def walk_cdr(message: bytes, fields: Group) -> Layout:
    """Return the layout of a message of ROS 2; UndecodableError where it is not of its type."""
    if len(message) < 4:
        raise UndecodableError(f"a message of {len(message)} bytes has no head")
    if message[0] != 0 or message[1] not in _CDR:
        raise UndecodableError(f"the encoding {message[:2].hex()} is not read, only plain CDR")
    return _Walk(message, _CDR[message[1]]).walk(fields)


class _Walk:
    def __init__(self, message: bytes, encoding: Encoding) -> None:
        self.message = message
        self.order = encoding.order
        self.begin = encoding.begin
        self.alignment = encoding.alignment
        self.position = encoding.begin
        self.left = MOST_PARTS
        self.layout = Layout(len(message))
        self.layout.check(message, 0, min(2, encoding.begin))  # padding may differ
        self.entity = Entity()
        self.quiet = 0  # inside of a long list nothing is noted

    def walk(self, fields: Group) -> Layout:
        self.layout.entities.append(self.entity)
        self._group(fields, "")
        # Some middlewares pad a message to whole words of 4 bytes.
        padding = len(self.message) - self.position
        if padding < 0 or padding > (3 if self.begin else 0):
            raise UndecodableError(
                f"a message of {len(self.message)} bytes does not fit its type, which takes "
                f"{self.position}"
            )
        return self.layout

    def _group(self, group: Group, path: str) -> None:
        if group.name in (TIME, DURATION):
            return self._time(group, path)
        names: list[str] = []
        for name, field in group.fields:
            below = f"{path}.{name}" if path else name
            if not self.quiet:
                self.entity.types[below] = group.name, name
            if isinstance(field, Many) and isinstance(field.element, Text) and name in _NAMES:
                names = self._names(field)
            elif isinstance(field, Text) and name in FRAMES and not self.quiet:
                self.entity.frames[below] = self._text()
            else:
                self._field(field, below, names)
        return None

    def _field(self, field: Field, path: str, names: list[str]) -> None:
        self.left -= 1
        if self.left < 0:
            raise UndecodableError(f"a message has more than {MOST_PARTS} parts")
        if isinstance(field, Number):
            at = self._take(field.size)
            if not self.quiet and path and not path.endswith("."):
                self.entity.leaves[path] = NumberAt(at, _dtype(field, self.order))
        elif isinstance(field, Group):
            self._group(field, path)
        elif isinstance(field, Text):
            self._skip_text()
        else:
            self._many(field, path, names)

    def _time(self, group: Group, path: str) -> None:
        parts = []
        for _, field in group.fields:
            assert isinstance(field, Number)
            parts.append(NumberAt(self._take(field.size), _dtype(field, self.order)))
        if not self.quiet:
            self.entity.leaves[path] = TimeAt(*parts)

    def _many(self, many: Many, path: str, names: list[str]) -> None:
        count = self._count(many)
        element = many.element
        begin = self.position
        if isinstance(element, Number) and (count > LONGEST_LIST or self.quiet):
            if count:
                self._take(element.size, count)
            self._skipped(path, begin)
            return
        long = count > LONGEST_LIST
        self.quiet += long
        transforms = isinstance(element, Group) and element.name == TRANSFORM
        for k in range(count):
            if transforms and not self.quiet:
                self._transform(element)
                continue
            index = names[k] if len(names) == count else str(k)
            self._field(element, f"{path}[{index}]", [])
        self.quiet -= long
        if long:
            self._skipped(path, begin)

    def _skipped(self, path: str, begin: int) -> None:
        if not self.quiet:
            self.layout.skipped[path] = self.position - begin

    def _transform(self, group: Field) -> None:
        assert isinstance(group, Group)
        above, self.entity = self.entity, Entity()
        self._group(group, "")
        frames = self.entity.frames
        name = f"[{frames.get('header.frame_id', '')}>{frames.get('child_frame_id', '')}]"
        self.layout.entities.append(Entity(name, self.entity.leaves, self.entity.types, frames))
        self.entity = above

    def _names(self, many: Many) -> list[str]:
        """The names in a list, all different; none where they would say nothing."""
        count = self._count(many)
        if count > LONGEST_LIST or self.quiet:
            for _ in range(count):
                self._field(many.element, "", [])
            return []
        names = [self._text() for _ in range(count)]
        return names if len(set(names)) == count and all(names) else []

    def _count(self, many: Many) -> int:
        """How many elements a list has: no more than can be in what is left of the message."""
        if many.length is not None:
            return many.length
        count = self._size()
        room = len(self.message) - self.position
        if count * max(1, smallest(many.element)) > room:
            raise UndecodableError(f"a list claims {count} elements in {room} bytes")
        return count

    def _size(self) -> int:
        """A count or a length, which has to be the same in all messages of the layout."""
        at = self._take(4)
        self.layout.check(self.message, at, at + 4)
        size: int = struct.unpack_from(self.order + "I", self.message, at)[0]
        return size

    def _skip_text(self) -> tuple[int, int]:
        size = self._size()
        begin = self.position
        self.position += size
        self._inside()
        return begin, self.position

    def _text(self) -> str:
        """A text that names something, which has to be the same in all messages of the layout."""
        begin, end = self._skip_text()
        if end - begin > _LONGEST_NAME:
            raise UndecodableError(f"a name is {end - begin} bytes long")
        self.layout.check(self.message, begin, end)
        text = self.message[begin:end].rstrip(b"\0").decode("utf-8", "backslashreplace")
        return one_line(text)

    def _take(self, size: int, count: int = 1) -> int:
        """Move past numbers of a size; return where they begin."""
        step = min(size, self.alignment)
        at = self.position + (self.begin - self.position) % step
        self.position = at + size * count
        self._inside()
        return at

    def _inside(self) -> None:
        if self.position > len(self.message):
            raise UndecodableError(
                f"a message of {len(self.message)} bytes ends before what its type says"
            )


def _dtype(number: Number, order: str) -> str:
    return number.dtype if number.size == 1 else order + number.dtype
