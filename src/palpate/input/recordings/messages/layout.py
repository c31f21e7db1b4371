"""The structure of ROS messages, and the position of each number in them.

The definition of a type gives a tree of numbers, texts, lists and groups. Parsing one message with
it gives the layout. All messages of equal length whose structural bytes (encoding, counts of lists,
lengths of strings, names) agree with the first message have their numbers at the same positions.
They form one matrix of bytes, in which a field is some of the columns.
"""

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg
from rosbags.typesys import get_typestore as typestore

from palpate.errors import PalpateError
from palpate.validation import Integers, Mask, Values, frozen

# A list of more elements is a scan or an image, not a vector, a matrix or a set of joints.
LONGEST_LIST = 64
MOST_TRANSFORMS = 256  # in a message; a humanoid has some 100

#: Names of the groups of two numbers, seconds first, that are a time or a duration.
TIME = "builtin_interfaces/msg/Time"
DURATION = "builtin_interfaces/msg/Duration"
TRANSFORM = "geometry_msgs/msg/TransformStamped"


class UndecodableError(PalpateError):
    """A ROS message or its definition cannot be decoded: the error message says why."""


@frozen
class Number:
    """A number of fixed size, with its NumPy dtype without the byte order: ``f8``."""

    dtype: str

    @property
    def size(self) -> int:
        """Its size in bytes."""
        return int(self.dtype[1:])


@frozen
class Text:
    """A string."""


@frozen
class Many:
    """A list, of fixed length unless ``length`` is None."""

    element: "Field"
    length: int | None


@frozen
class Group:
    """A message within a message: names and fields.

    Attributes
    ----------
    smallest : int
        Its smallest possible size in bytes, without padding.
    """

    name: str
    fields: tuple[tuple[str, "Field"], ...]
    smallest: int


Field: TypeAlias = Number | Text | Many | Group


def smallest(field: Field) -> int:
    """Return the smallest possible size of a field in bytes, without padding."""
    if isinstance(field, Number):
        return field.size
    if isinstance(field, Group):
        return field.smallest
    if isinstance(field, Many) and field.length is not None:
        return field.length * smallest(field.element)
    return 4  # the count of a list or a string


def normal_name(type_name: str) -> str:
    """Return the name of a type in ROS 2 form: ``geometry_msgs/msg/Wrench``."""
    package, slash, rest = type_name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else type_name


def one_line(text: str) -> str:
    """Return a name from a file as one printable line of at most 200 characters."""
    shown = "".join(letter if letter.isprintable() else "?" for letter in text[:200])
    return shown if len(text) <= 200 else shown + "…"


# Parsing the definition of a message, as bags and MCAP files contain it, to a tree of fields.

_DTYPES = {
    "bool": "b1", "byte": "u1", "char": "u1", "octet": "u1",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
# Seconds and nanoseconds: ROS 1 has no sign in a time, ROS 2 has none in the nanoseconds.
_TIMES = {
    (TIME, True): ("u4", "u4"),
    (DURATION, True): ("i4", "i4"),
    (TIME, False): ("i4", "u4"),
    (DURATION, False): ("i4", "u4"),
}

Definitions = Mapping[str, tuple[Any, Any]]


@lru_cache(maxsize=256)
def message_fields(type_name: str, encoding: str, text: str) -> Group:
    """Return the fields of a type of messages.

    Parameters
    ----------
    type_name : str
        For example ``geometry_msgs/msg/Wrench`` or ``geometry_msgs/Wrench``.
    encoding : str
        Language of the definition: ``"ros1msg"``, ``"ros2msg"`` or ``"ros2idl"``.
    text : str
        The definition. If blank, ROS's own definition of the type.

    Raises
    ------
    UndecodableError
        The definition is invalid or missing.
    """
    name = normal_name(type_name)
    ros1 = encoding == "ros1msg"
    if encoding != "ros2idl":
        text = re.sub(r"^[ \t]*#[^\n]*\n", "", text, flags=re.MULTILINE)
    definitions = dict(_standard(ros1))
    try:
        if text.strip():
            definitions |= _parse_definition(name, encoding, text)
        elif name not in definitions:
            raise UndecodableError("the file lacks the definition of its type")
        return _Builder(definitions, ros1).group(name)
    except (RecursionError, TypesysError, ValueError, LookupError, AssertionError) as error:
        reason = " ".join(str(error).split())[:80]
        raise UndecodableError(f"its definition is invalid: {reason}") from None


def _parse_definition(name: str, encoding: str, text: str) -> Definitions:
    if encoding != "ros2idl":
        return get_types_from_msg(text, name)
    # In a text with several definitions a line with its name precedes each.
    types: dict[str, tuple[Any, Any]] = {}
    for definition in re.split(r"^=+\s*\nIDL:[^\n]*\n", text, flags=re.MULTILINE):
        if definition.strip():
            types |= get_types_from_idl(definition)
    return types


@lru_cache(maxsize=2)
def _standard(ros1: bool) -> Definitions:
    return typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST).fielddefs


class _Builder:
    """Builds the trees of the types in one definition, each type once."""

    def __init__(self, definitions: Definitions, ros1: bool) -> None:
        self.definitions = definitions
        self.ros1 = ros1
        self.built: dict[str, Group] = {}

    def group(self, name: str) -> Group:
        if name in self.built:
            return self.built[name]
        fields: list[tuple[str, Field]]
        if (name, self.ros1) in _TIMES:
            seconds, nanoseconds = _TIMES[name, self.ros1]
            fields = [("sec", Number(seconds)), ("nanosec", Number(nanoseconds))]
        else:
            if name not in self.definitions:
                raise UndecodableError(f"the definition of {name[:80]} is missing")
            fields = [(label, self._field(what)) for label, what in self.definitions[name][1]]
        if not fields and not self.ros1:
            fields = [("", Number("u1"))]  # ROS 2 sends one byte for an empty message
        size = sum(smallest(field) for _, field in fields)
        self.built[name] = Group(name, tuple(fields), size)
        return self.built[name]

    def _field(self, what: Any) -> Field:
        kind, value = what
        if kind == Nodetype.NAME:
            return self.group(value)
        if kind == Nodetype.BASE:
            if value[0] == "string":
                return Text()
            if value[0] not in _DTYPES:
                raise UndecodableError(f"palpate cannot read its field of type {value[0]}")
            if self.ros1 and value[0] in ("byte", "char"):
                return Number("i1" if value[0] == "byte" else "u1")
            return Number(_DTYPES[value[0]])
        element, length = value
        return Many(self._field(element), length if kind == Nodetype.ARRAY else None)


Bytes: TypeAlias = NDArray[np.uint8]
#: Messages of one length, a row each.
Matrix: TypeAlias = NDArray[np.uint8]


@frozen
class NumberAt:
    """The position of a number in a message, with its NumPy dtype: ``<f8``."""

    offset: int
    dtype: str

    def read(self, messages: Matrix) -> Values:
        """Return the number in each message, in native byte order."""
        dtype = np.dtype(self.dtype)
        rows, width = messages.shape
        column: Values = np.ndarray((rows,), dtype, messages, self.offset, (width,))
        if dtype.kind == "b":  # any byte but 0 means true, but NumPy expects 1
            column = column.view(np.uint8) != 0
        return column.astype(dtype.newbyteorder("="))


@frozen
class TimeAt:
    """The position of a time or duration of two numbers, read as integer nanoseconds."""

    seconds: NumberAt
    nanoseconds: NumberAt

    def read(self, messages: Matrix) -> Values:
        """Return the time in each message."""
        seconds = self.seconds.read(messages).astype(np.int64)
        return seconds * 1_000_000_000 + self.nanoseconds.read(messages).astype(np.int64)


#: The position of a number or time in a message.
MessageNumber: TypeAlias = NumberAt | TimeAt


@frozen
class Entity:
    """A set of channels with common rows: a topic, or one transform of a list of transforms.

    Attributes
    ----------
    name : str
        Suffix of the topic's name: empty, or ``[parent>child]``.
    leaves : dict
        Path, such as ``wrench.force.x``, to its :class:`MessageNumber`.
    types : dict
        Path to message type and field: ``wrench.force`` to ``("geometry_msgs/msg/Wrench",
        "force")``.
    frames : dict
        Path, such as ``header.frame_id``, to the name of a coordinate frame.
    """

    name: str = ""
    leaves: dict[str, MessageNumber] = field(default_factory=dict)
    types: dict[str, tuple[str, str]] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class Layout:
    """The positions of the numbers in a message.

    Attributes
    ----------
    length : int
        Length of the message in bytes.
    checks : list
        Position and value of the bytes that all messages of this layout have in common.
    entities : list of Entity
        The channels of the message.
    skipped : dict
        Path and number of bytes of the fields skipped because they are long.
    """

    length: int
    checks: list[tuple[int, Bytes]] = field(default_factory=list)
    entities: list[Entity] = field(default_factory=list)
    skipped: dict[str, int] = field(default_factory=dict)

    def check(self, data: bytes | memoryview, start: int, stop: int) -> None:
        """Require every message of this layout to have the same bytes here."""
        want = np.frombuffer(data, np.uint8)[start:stop]
        if self.checks and self.checks[-1][0] + len(self.checks[-1][1]) == start:
            start, previous = self.checks.pop()
            want = np.concatenate([previous, want])
        self.checks.append((start, want.copy()))

    def matches(self, messages: Matrix) -> Mask:
        """Mask of the messages, all of equal length, that have this layout."""
        same = np.ones(len(messages), bool)
        for start, want in self.checks:
            same &= (messages[:, start : start + len(want)] == want).all(axis=1)
        return same


@frozen
class Block:
    """Messages of one topic in one array of bytes.

    Attributes
    ----------
    data : ndarray
        The bytes.
    starts, lengths : ndarray
        Start and length of each message, in bytes.
    times : ndarray
        Log time of each message, ns.
    """

    data: Bytes
    starts: Integers
    lengths: Integers
    times: Integers

    def message(self, k: int) -> bytes:
        """Return one message."""
        return self.data[self.starts[k] : self.starts[k] + self.lengths[k]].tobytes()

    @classmethod
    def joined(cls, messages: Sequence[bytes], times: Sequence[int]) -> "Block":
        """Return separate messages as one block."""
        lengths = np.fromiter(map(len, messages), np.int64, len(messages))
        data = np.frombuffer(b"".join(messages), np.uint8)
        return cls(data, np.cumsum(lengths) - lengths, lengths, np.array(times, np.int64))


def gather(data: Bytes, starts: Integers, length: int) -> Matrix:
    """Return messages of equal length, at any positions in a block, as rows of a matrix."""
    if length == 0 or not len(starts):
        return np.empty((len(starts), length), np.uint8)
    windows = np.ndarray((len(data) - length + 1,), f"V{length}", data, 0, (1,))
    return windows[starts].view(np.uint8).reshape(-1, length)


# Parsing one ROS 1 or ROS 2 message with its definition, to find its layout.

# A message of more parts is a map or a plan; parsing one takes some 0.1 s.
MOST_PARTS = 100_000

FRAMES = ("frame_id", "child_frame_id")
_NAMES = ("name", "names", "joint_names")  # names for the elements of the other lists
_LONGEST_NAME = 200  # bytes


# Second byte of a CDR message: byte order and largest alignment.
_CDR = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}


def walk_ros1(message: bytes, fields: Group) -> Layout:
    """Return the layout of a ROS 1 message; raise UndecodableError if it is not of this type."""
    return _Walk(message, 0, "<", 1).walk(fields)  # ROS 1 does not align


def walk_cdr(message: bytes, fields: Group) -> Layout:
    """Return the layout of a ROS 2 message; raise UndecodableError if it is not of this type."""
    if len(message) < 4:
        raise UndecodableError(f"a message of {len(message)} bytes has no header")
    if message[0] != 0 or message[1] not in _CDR:
        raise UndecodableError(f"its encoding {message[:2].hex()} is not plain CDR")
    return _Walk(message, 4, *_CDR[message[1]]).walk(fields)


def leaves_of_empty(fields: Group) -> dict[str, MessageNumber]:
    """Return the numbers of a ROS 2 message in which every list and text is empty."""
    walk = _Walk(bytes(8 * fields.smallest + 64), 4, "<", 8)
    walk.group(fields, "")
    return walk.entity.leaves


class _Walk:
    """Parses a message; CDR aligns fields relative to the first one, at ``begin``."""

    def __init__(self, message: bytes, begin: int, order: str, alignment: int) -> None:
        self.message = message
        self.order = order
        self.alignment = alignment
        self.begin = self.position = begin
        self.left = MOST_PARTS
        self.layout = Layout(len(message))
        self.layout.check(message, 0, min(2, begin))  # the padding bits after it may differ
        self.entity = Entity()
        self.quiet = 0  # > 0 inside a long list, which is not recorded

    def walk(self, fields: Group) -> Layout:
        self.layout.entities.append(self.entity)
        self.group(fields, "")
        # Some middlewares pad a message to a multiple of 4 bytes.
        padding = len(self.message) - self.position
        if padding < 0 or padding > (3 if self.begin else 0):
            raise UndecodableError(
                f"a message has {len(self.message)} bytes, but its type needs {self.position}"
            )
        return self.layout

    def group(self, group: Group, path: str) -> None:
        if group.name in (TIME, DURATION):
            return self._time(group, path)
        names: list[str] = []
        for name, item in group.fields:
            below = f"{path}.{name}" if path else name
            if not self.quiet:
                self.entity.types[below] = group.name, name
            if isinstance(item, Many) and isinstance(item.element, Text) and name in _NAMES:
                names = self._names(item)
            elif isinstance(item, Text) and name in FRAMES and not self.quiet:
                self.entity.frames[below] = self._text()
            else:
                self._field(item, below, names)
        return None

    def _field(self, field: Field, path: str, names: list[str]) -> None:
        self.left -= 1
        if self.left < 0:
            raise UndecodableError(f"a message has more than {MOST_PARTS} parts")
        if isinstance(field, Number):
            number = self._number(field)
            if not self.quiet and path and not path.endswith("."):
                self.entity.leaves[path] = number
        elif isinstance(field, Group):
            self.group(field, path)
        elif isinstance(field, Text):
            self._skip_text()
        else:
            self._many(field, path, names)

    def _time(self, group: Group, path: str) -> None:
        numbers = [self._number(field) for _, field in group.fields]
        if not self.quiet:
            self.entity.leaves[path] = TimeAt(*numbers)

    def _number(self, field: Field) -> NumberAt:
        assert isinstance(field, Number)
        order = "" if field.size == 1 else self.order
        return NumberAt(self._take(field.size), order + field.dtype)

    def _many(self, field: Many, path: str, names: list[str]) -> None:
        count = self._count(field)
        element = field.element
        begin = self.position
        transforms = isinstance(element, Group) and element.name == TRANSFORM
        long = count > (MOST_TRANSFORMS if transforms else LONGEST_LIST)
        self.quiet += long
        if isinstance(element, Number) and self.quiet and count:
            self._take(element.size, count)
        else:
            for k in range(count):
                if transforms and not self.quiet:
                    self._transform(element)
                    continue
                index = names[k] if len(names) == count else str(k)
                self._field(element, f"{path}[{index}]", [])
        self.quiet -= long
        if long and not self.quiet:
            self.layout.skipped[path] = self.position - begin

    def _transform(self, group: Field) -> None:
        assert isinstance(group, Group)
        above = self.entity
        self.entity = Entity()
        self.group(group, "")
        frames = self.entity.frames
        name = f"[{frames.get('header.frame_id', '')}>{frames.get('child_frame_id', '')}]"
        self.layout.entities.append(Entity(name, self.entity.leaves, self.entity.types, frames))
        self.entity = above

    def _names(self, field: Many) -> list[str]:
        """The names in a list; none if one is empty or repeated."""
        count = self._count(field)
        if count > LONGEST_LIST or self.quiet:
            for _ in range(count):
                self._field(field.element, "", [])
            return []
        names = [self._text() for _ in range(count)]
        return names if len(set(names)) == count and all(names) else []

    def _count(self, field: Many) -> int:
        """The number of elements of a list; raise if the rest of the message is too short."""
        if field.length is not None:
            return field.length
        count = self._size()
        room = len(self.message) - self.position
        if count * max(1, smallest(field.element)) > room:
            raise UndecodableError(f"a list states {count} elements in {room} bytes")
        return count

    def _size(self) -> int:
        """A count or a length, which must be equal in all messages of the layout."""
        start = self._take(4)
        self.layout.check(self.message, start, start + 4)
        size: int = struct.unpack_from(self.order + "I", self.message, start)[0]
        return size

    def _skip_text(self) -> tuple[int, int]:
        size = self._size()
        begin = self.position
        self.position += size
        self._check_inside()
        return begin, self.position

    def _text(self) -> str:
        """A name, which must be equal in all messages of the layout."""
        begin, end = self._skip_text()
        if end - begin > _LONGEST_NAME:
            raise UndecodableError(f"a name is {end - begin} bytes long")
        self.layout.check(self.message, begin, end)
        text = self.message[begin:end].rstrip(b"\0").decode("utf-8", "backslashreplace")
        return one_line(text)

    def _take(self, size: int, count: int = 1) -> int:
        """Advance past numbers of a size; return the position of the first."""
        step = min(size, self.alignment)
        start = self.position + (self.begin - self.position) % step
        self.position = start + size * count
        self._check_inside()
        return start

    def _check_inside(self) -> None:
        if self.position > len(self.message):
            raise UndecodableError(
                f"a message of {len(self.message)} bytes is too short for its type"
            )
