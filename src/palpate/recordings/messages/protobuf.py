"""Messages decoded one by one: JSON and protobuf."""

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import DecodeError

from palpate.recordings.messages.layout import LONGEST_LIST, UndecodableError, one_line
from palpate.recordings.messages.topic import Found, ObjectTopic
from palpate.recordings.opening import Request, first_line
from palpate.validation import Integers, Values

_DEEPEST = 32
_SECONDS = ("sec", "secs", "seconds")
_NANOSECONDS = ("nsec", "nsecs", "nanosec", "nanos", "nanoseconds")
_LARGEST = 1 << 63


class JsonTopic(ObjectTopic):
    """A topic of JSON objects.

    Parameters
    ----------
    request : Request
        What to read.
    """

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self._wanted: dict[str, bool] = {}

    def decode_message(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError if it is invalid."""
        try:
            found = json.loads(message, parse_int=_whole)
        except (ValueError, RecursionError) as error:
            raise UndecodableError(f"it is not JSON: {first_line(error)[:60]}") from None
        if not isinstance(found, dict):
            raise UndecodableError(f"it must be a JSON object, not {type(found).__name__}")
        return found

    def take_objects(self, messages: list[Any], times: Integers) -> None:
        """Read decoded messages with their log times, ns."""
        values: dict[str, list[Any]] = defaultdict(list)
        rows: dict[str, list[int]] = defaultdict(list)
        found = self.found.get("", Found())
        for row, message in enumerate(messages, start=found.count):
            for path, value in self._numbers(message, "", found, 0):
                if path not in self._wanted:
                    self._wanted[path] = self.wants("", path)
                if self._wanted[path]:
                    values[path].append(value)
                    rows[path].append(row)
        columns = [(path, np.array(rows[path]), _column(each)) for path, each in values.items()]
        self.keep("", found, columns, times)

    def _numbers(
        self, value: Any, path: str, found: Found, depth: int
    ) -> Iterator[tuple[str, int | float | bool]]:
        """All numbers in a value, with their paths."""
        if isinstance(value, int | float):
            yield path, value
        elif isinstance(value, dict):
            time = _time(value)
            if time is not None and path:
                found.times.add(path)
                yield path, time
            elif depth < _DEEPEST:
                for name, inner in value.items():
                    below = f"{path}.{name}" if path else name
                    yield from self._numbers(inner, below, found, depth + 1)
        elif isinstance(value, list):
            if len(value) > LONGEST_LIST:
                self.skipped.add(path)
            elif depth < _DEEPEST:
                for k, inner in enumerate(value):
                    yield from self._numbers(inner, f"{path}[{k}]", found, depth + 1)
        elif isinstance(value, str) and path.rpartition(".")[2] in ("frame_id", "parent_frame_id"):
            found.meet_frame(path, value[:200])


def _time(value: dict[str, Any]) -> int | None:
    """The time in ns of an object of seconds and nanoseconds; None for any other object."""
    if len(value) != 2:
        return None
    seconds = next((value[name] for name in _SECONDS if name in value), None)
    rest = next((value[name] for name in _NANOSECONDS if name in value), None)
    if not isinstance(seconds, int) or not isinstance(rest, int):
        return None
    time = seconds * 1_000_000_000 + rest
    return time if abs(time) < _LARGEST else None


def _column(numbers: list[Any]) -> Values:
    kinds = set(map(type, numbers))
    if kinds == {bool}:
        return np.array(numbers, bool)
    return np.array(numbers, np.int64 if kinds == {int} else np.float64)


def _whole(digits: str) -> int | float:
    """An integer; a float if it exceeds 64 bits."""
    number = int(digits)
    return number if -_LARGEST <= number < _LARGEST else float(digits)


# Protobuf messages, decoded by the protobuf package; one field over many messages is a column.

_DTYPES = {
    FieldDescriptor.CPPTYPE_DOUBLE: "f8", FieldDescriptor.CPPTYPE_FLOAT: "f4",
    FieldDescriptor.CPPTYPE_INT64: "i8", FieldDescriptor.CPPTYPE_INT32: "i4",
    FieldDescriptor.CPPTYPE_UINT64: "u8", FieldDescriptor.CPPTYPE_UINT32: "u4",
    FieldDescriptor.CPPTYPE_ENUM: "i4", FieldDescriptor.CPPTYPE_BOOL: "b1",
}  # fmt: skip
_TIMES = ("google.protobuf.Timestamp", "google.protobuf.Duration")
_FRAMES = ("frame_id", "parent_frame_id", "child_frame_id")


class ProtobufTopic(ObjectTopic):
    """A topic of protobuf messages.

    Parameters
    ----------
    type_name : str
        For example ``foxglove.PoseInFrame``.
    schema : bytes
        A FileDescriptorSet with the type and all types that it uses.
    request : Request
        What to read.

    Raises
    ------
    UndecodableError
        The schema is invalid or lacks the type.
    """

    def __init__(self, type_name: str, schema: bytes, request: Request) -> None:
        super().__init__(request)
        try:
            files = descriptor_pb2.FileDescriptorSet.FromString(schema).file
            pool = descriptor_pool.DescriptorPool()
            self._class = message_factory.GetMessages(files, pool=pool)[type_name]
        except DecodeError:
            raise UndecodableError("its schema is not a protobuf descriptor") from None
        except KeyError:
            raise UndecodableError("its schema lacks its type") from None
        except TypeError as error:
            words = " ".join(str(error).split())[:80]
            raise UndecodableError(f"its schema is invalid: {words}") from None

    def decode_message(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError if it is invalid."""
        try:
            return self._class.FromString(message)
        except DecodeError as error:
            raise UndecodableError(f"{error}"[:100]) from None

    def take_objects(self, messages: list[Any], times: Integers) -> None:
        """Read decoded messages with their log times, ns."""
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

    def _extend(self, name: str, messages: Sequence[Any], times: Integers, without: Any) -> None:
        found = self.found.get(name, Found())
        rows = found.count + np.arange(len(messages))
        columns = self._columns(messages, rows, "", found, without)
        self.keep(name, found, [each for each in columns if self.wants(name, each[0])], times)

    def _columns(
        self, messages: Sequence[Any], rows: Integers, path: str, found: Found, without: Any = None
    ) -> Iterator[tuple[str, Integers, Values]]:
        """Each number of some messages: its path, the rows that have it, and the values."""
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
            if field.has_presence and not field.has_default_value:  # absent fields give no value
                there = [message.HasField(field.name) for message in messages]
                values = [value for value, is_there in zip(values, there, strict=True) if is_there]
                here = rows[np.array(there)]
            yield from self._values(field, values, here, below, found)

    def _values(
        self, field: Any, values: Sequence[Any], rows: Integers, path: str, found: Found
    ) -> Iterator[tuple[str, Integers, Values]]:
        if not values:
            return
        if field.cpp_type in _DTYPES:
            yield path, rows, np.array(values, _DTYPES[field.cpp_type])
        elif field.message_type is not None and field.message_type.full_name in _TIMES:
            found.times.add(path)
            yield path, rows, np.array([v.seconds * 10**9 + v.nanos for v in values], np.int64)
        elif field.message_type is not None:
            yield from self._columns(values, rows, path, found)
        elif field.name in _FRAMES:
            for frame in dict.fromkeys(values):
                found.meet_frame(path, one_line(frame))
        elif field.type == FieldDescriptor.TYPE_BYTES and max(map(len, values)) > LONGEST_LIST:
            self.skipped.add(path)


def _is_list(field: Any) -> bool:
    """Whether a field is repeated, in any version of protobuf."""
    # A map has no order, and no element by number.
    entry = field.message_type is not None and field.message_type.GetOptions().map_entry
    return bool(field.default_value == [] and not entry)


def _is_long(message: Any) -> bool:
    """Whether most of a message is an image or similar."""
    found = [
        value
        for field, value in message.ListFields()
        if field.type == FieldDescriptor.TYPE_BYTES or _is_list(field)
    ]
    long = sum(len(value) for value in found if len(value) > LONGEST_LIST)
    return 2 * long > int(message.ByteSize())
