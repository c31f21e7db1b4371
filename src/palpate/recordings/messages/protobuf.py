"""Messages of protobuf, decoded by its own package; each field of many messages is a column."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from palpate.recordings.formats import Request
from palpate.recordings.messages.fields import LONGEST_LIST, UndecodableError, one_line
from palpate.recordings.messages.layout import Starts
from palpate.recordings.messages.topic import LOG_TIME, Found, ObjectTopic, stamp_of

_Kind = descriptor_pb2.FieldDescriptorProto
_DTYPES = {
    _Kind.TYPE_DOUBLE: "f8", _Kind.TYPE_FLOAT: "f4", _Kind.TYPE_BOOL: "b1", _Kind.TYPE_ENUM: "i4",
    **dict.fromkeys((_Kind.TYPE_INT64, _Kind.TYPE_SINT64, _Kind.TYPE_SFIXED64), "i8"),
    **dict.fromkeys((_Kind.TYPE_INT32, _Kind.TYPE_SINT32, _Kind.TYPE_SFIXED32), "i4"),
    **dict.fromkeys((_Kind.TYPE_UINT64, _Kind.TYPE_FIXED64), "u8"),
    **dict.fromkeys((_Kind.TYPE_UINT32, _Kind.TYPE_FIXED32), "u4"),
}  # fmt: skip
_TIMES = ("google.protobuf.Timestamp", "google.protobuf.Duration")
_FRAMES = ("frame_id", "parent_frame_id", "child_frame_id")


class ProtobufTopic(ObjectTopic):
    """A topic of protobuf messages.

    Parameters
    ----------
    type_name : str
        For instance ``foxglove.PoseInFrame``.
    schema : bytes
        A FileDescriptorSet with the type and all that it holds.
    request : Request
        What is asked for.

    Raises
    ------
    UndecodableError
        The schema is none, or the type is not in it.
    """

    def __init__(self, type_name: str, schema: bytes, request: Request) -> None:
        super().__init__(request)
        try:
            files = descriptor_pb2.FileDescriptorSet.FromString(schema).file
            pool = descriptor_pool.DescriptorPool()
            self._class = message_factory.GetMessages(files, pool=pool)[type_name]
        except DecodeError:
            raise UndecodableError("its schema is no protobuf descriptor") from None
        except KeyError:
            raise UndecodableError("its schema does not hold its type") from None
        except TypeError as error:
            words = " ".join(str(error).split())[:80]
            raise UndecodableError(f"its schema cannot be understood: {words}") from None

    def decoded(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError where it is none."""
        try:
            return self._class.FromString(message)
        except DecodeError as error:
            raise UndecodableError(f"{error}"[:100]) from None

    def take_objects(self, messages: list[Any], times: Starts) -> None:
        """Read decoded messages; and when each was logged."""
        if not self.found and self.request.channels is None and _is_long(messages[0]):
            self.omitted = "most of it is in long lists"
            return
        apart = self._class.DESCRIPTOR.fields_by_name.get("transforms")
        pairs: dict[str, list[tuple[Any, int]]] = {}
        if apart is not None and apart.message_type is not None and _is_list(apart):
            for k, message in enumerate(messages):
                for each in message.transforms:
                    ends = [getattr(each, f"{end}_frame_id", "") for end in ("parent", "child")]
                    pairs.setdefault("[{}>{}]".format(*map(one_line, ends)), []).append((each, k))
        for name, given in pairs.items():
            items, which = zip(*given, strict=True)
            self._extend(name, items, times[list(which)], None)
        self._extend("", messages, times, apart if pairs else None)

    def _extend(self, name: str, messages: Sequence[Any], times: Starts, without: Any) -> None:
        found = self.found.get(name, Found())
        rows = found.count + np.arange(len(messages))
        wanted = [
            (path, part, values)
            for path, part, values in self._columns(messages, rows, "", found, without)
            if path == stamp_of((path,)) or self.request.wants(f"{self.name}{name}.{path}")
        ]
        if {path for path, _, _ in wanted} <= {stamp_of(path for path, _, _ in wanted)}:
            return
        self.found[name] = found
        for path, part, values in wanted:
            found.extend({path: values}, part)
        found.extend({LOG_TIME: times}, rows)
        found.count += len(messages)

    def _columns(
        self, messages: Sequence[Any], rows: Starts, path: str, found: Found, without: Any = None
    ) -> Iterator[tuple[str, Starts, NDArray[Any]]]:
        """Each number of some messages: its path, which rows have it, and the values."""
        kind = messages[0].DESCRIPTOR
        for field in kind.fields:
            below = f"{path}.{field.name}" if path else field.name
            if field is without:
                continue
            found.types[below] = kind.full_name, field.name
            values = [getattr(message, field.name) for message in messages]
            here = rows
            if _is_list(field):
                longest = max(map(len, values))
                if longest > LONGEST_LIST:
                    self.skipped.add(below)
                    continue
                for k in range(longest):
                    some = np.array([len(each) > k for each in values])
                    items = [each[k] for each in values if len(each) > k]
                    found.types[f"{below}[{k}]"] = kind.full_name, field.name
                    yield from self._values(field, items, rows[some], f"{below}[{k}]", found)
                continue
            if field.has_presence and not field.has_default_value:  # what is unknown is left out
                there = [message.HasField(field.name) for message in messages]
                values = [value for value, is_there in zip(values, there, strict=True) if is_there]
                here = rows[np.array(there)]
            yield from self._values(field, values, here, below, found)

    def _values(
        self, field: Any, values: Sequence[Any], rows: Starts, path: str, found: Found
    ) -> Iterator[tuple[str, Starts, NDArray[Any]]]:
        if not values:
            return
        if field.type in _DTYPES:
            yield path, rows, np.array(values, _DTYPES[field.type])
        elif field.message_type is not None and field.message_type.full_name in _TIMES:
            found.times.add(path)
            yield path, rows, np.array([v.seconds * 10**9 + v.nanos for v in values], np.int64)
        elif field.message_type is not None:
            yield from self._columns(values, rows, path, found)
        elif field.name in _FRAMES:
            for frame in dict.fromkeys(values):
                found.meet_frame(path, one_line(frame))
        elif field.type == _Kind.TYPE_BYTES and max(map(len, values)) > LONGEST_LIST:
            self.skipped.add(path)


def _is_list(field: Any) -> bool:
    """Whether a field is repeated; what it is asked for is called otherwise in each version."""
    # A map has no order, and no element by number.
    entry = field.message_type is not None and field.message_type.GetOptions().map_entry
    return bool(field.default_value == [] and not entry)


def _is_long(message: Any) -> bool:
    """Whether most of a message is an image, or the like."""
    found = [
        value
        for field, value in message.ListFields()
        if field.type == _Kind.TYPE_BYTES or _is_list(field)
    ]
    long = sum(len(value) for value in found if len(value) > LONGEST_LIST)
    return 2 * long > int(message.ByteSize())
