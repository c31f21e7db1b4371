"""From the definition of a message, as bags and MCAP files carry it, to its tree of fields."""

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg
from rosbags.typesys import get_typestore as typestore

from palpate.recordings.messages.fields import (
    DURATION,
    TIME,
    Field,
    Group,
    Many,
    Number,
    Text,
    UndecodableError,
    normal_name,
    smallest,
)

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
        For instance ``geometry_msgs/msg/Wrench``, or ``geometry_msgs/Wrench``.
    encoding : str
        How the definition is written: ``"ros1msg"``, ``"ros2msg"`` or ``"ros2idl"``.
    text : str
        The definition; where it is blank, that of the type in ROS itself.

    Raises
    ------
    UndecodableError
        It cannot be understood, or there is none.
    """
    name = normal_name(type_name)
    ros1 = encoding == "ros1msg"
    if encoding != "ros2idl":
        text = re.sub(r"^[ \t]*#[^\n]*\n", "", text, flags=re.MULTILINE)
    known = dict(_standard(ros1))
    try:
        if text.strip():
            known |= _parsed(name, encoding, text)
        elif name not in known:
            raise UndecodableError("the file does not hold the definition of its type")
        return _Builder(known, ros1).group(name)
    except (RecursionError, TypesysError, ValueError, LookupError, AssertionError) as error:
        words = " ".join(str(error).split())[:80]
        raise UndecodableError(f"its definition cannot be understood: {words}") from None


def _parsed(name: str, encoding: str, text: str) -> Definitions:
    if encoding != "ros2idl":
        return get_types_from_msg(text, name)
    # Each definition of a file that holds several stands below a line that names it.
    parts = re.split(r"^=+\s*\nIDL:[^\n]*\n", text, flags=re.MULTILINE)
    found: dict[str, tuple[Any, Any]] = {}
    for part in parts:
        if part.strip():
            found |= get_types_from_idl(part)
    return found


@lru_cache(maxsize=2)
def _standard(ros1: bool) -> Definitions:
    return typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST).fielddefs


class _Builder:
    """Trees of the types of one definition; a type that is used twice is built once."""

    def __init__(self, known: Definitions, ros1: bool) -> None:
        self.known = known
        self.ros1 = ros1
        self.built: dict[str, Group] = {}

    def group(self, name: str) -> Group:
        if name in self.built:
            return self.built[name]
        if (name, self.ros1) in _TIMES:
            parts = zip(("sec", "nanosec"), _TIMES[name, self.ros1], strict=True)
            fields: list[tuple[str, Field]] = [(each, Number(dtype)) for each, dtype in parts]
        else:
            if name not in self.known:
                raise UndecodableError(f"the definition of {name[:80]} is missing")
            fields = [(each, self._field(what)) for each, what in self.known[name][1]]
        if not fields and not self.ros1:
            fields = [("", Number("u1"))]  # ROS 2 sends a byte in place of nothing
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
                raise UndecodableError(f"it holds a field of the type {value[0]}")
            if self.ros1 and value[0] in ("byte", "char"):
                return Number("i1" if value[0] == "byte" else "u1")
            return Number(_DTYPES[value[0]])
        element, length = value
        return Many(self._field(element), length if kind == Nodetype.ARRAY else None)
