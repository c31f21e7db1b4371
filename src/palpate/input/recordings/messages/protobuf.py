"""Messages decoded one by one: JSON and protobuf."""

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import compress
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import DecodeError

from palpate.input.recordings.messages.layout import LONGEST_LIST, UndecodableError, one_line
from palpate.input.recordings.messages.topic import ObjectTopic, PathColumn, Series
from palpate.input.recordings.opening import Request, first_line
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

    def decode_message(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError if it is invalid."""
        try:
            content = json.loads(message, parse_int=_whole)
        except (ValueError, RecursionError) as error:
            raise UndecodableError(f"it is not JSON: {first_line(error)[:60]}") from None
        if not isinstance(content, dict):
            raise UndecodableError(f"it must be a JSON object, not {type(content).__name__}")
        return content

    def take_objects(self, messages: list[Any], times: Integers) -> None:
        """Read decoded messages with their log times, ns."""
        cells: dict[str, list[tuple[int, Any]]] = defaultdict(list)
        series = self.series.get("", Series())
        for row, message in enumerate(messages, start=series.count):
            for path, value in self._numbers(message, "", series, 0):
                cells[path].append((row, value))
        columns = []
        for path in [path for path in cells if self.wants("", path)]:
            rows, values = zip(*cells[path], strict=True)
            columns.append(PathColumn(path, np.array(rows), _column(values)))
        self.keep("", series, columns, times)

    def _numbers(
        self, value: Any, path: str, series: Series, depth: int
    ) -> Iterator[tuple[str, int | float | bool]]:
        """All numbers in a value, with their paths."""
        if isinstance(value, int | float):
            yield path, value
        elif isinstance(value, dict):
            time = _time(value)
            if time is not None and path:
                series.times.add(path)
                yield path, time
            elif depth < _DEEPEST:
                for name, inner in value.items():
                    below = f"{path}.{name}" if path else name
                    yield from self._numbers(inner, below, series, depth + 1)
        elif isinstance(value, list):
            if len(value) > LONGEST_LIST:
                self.skipped.add(path)
            elif depth < _DEEPEST:
                for k, inner in enumerate(value):
                    yield from self._numbers(inner, f"{path}[{k}]", series, depth + 1)
        elif isinstance(value, str) and path.rpartition(".")[2] in ("frame_id", "parent_frame_id"):
            series.meet_frame(path, value[:200])


def _time(value: dict[str, Any]) -> int | None:
    """The time in ns of an object of seconds and nanoseconds; None for any other object."""
    seconds = [value[name] for name in _SECONDS if isinstance(value.get(name), int)]
    nanoseconds = [value[name] for name in _NANOSECONDS if isinstance(value.get(name), int)]
    if len(value) != 2 or not seconds or not nanoseconds:
        return None
    time = int(seconds[0]) * 1_000_000_000 + int(nanoseconds[0])
    return time if abs(time) < _LARGEST else None


def _column(numbers: Sequence[Any]) -> Values:
    kinds = {*map(type, numbers)}
    return np.array(numbers, kinds.pop() if len(kinds) == 1 else float)


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
            raise UndecodableError(f"its schema is invalid: {first_line(error)[:80]}") from None

    def decode_message(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError if it is invalid."""
        try:
            return self._class.FromString(message)
        except DecodeError as error:
            raise UndecodableError(f"{error}"[:100]) from None

    def take_objects(self, messages: list[Any], times: Integers) -> None:
        """Read decoded messages with their log times, ns."""
        if not self.series and self.request.channels is None and _is_long(messages[0]):
            self.omitted = "most of it is in long lists"
            return
        list_field = self._class.DESCRIPTOR.fields_by_name.get("transforms")
        pairs: dict[str, list[tuple[Any, int]]] = defaultdict(list)
        if list_field is not None and list_field.message_type is not None and _is_list(list_field):
            for k, message in enumerate(messages):
                for transform in message.transforms:
                    parent = one_line(getattr(transform, "parent_frame_id", ""))
                    child = one_line(getattr(transform, "child_frame_id", ""))
                    pairs[f"[{parent}>{child}]"].append((transform, k))
        for name, pair in pairs.items():
            transforms, which = zip(*pair, strict=True)
            self._extend(name, transforms, times[list(which)])
        self._extend("", messages, times, list_field if pairs else None)

    def _extend(
        self, name: str, messages: Sequence[Any], times: Integers, without: Any = None
    ) -> None:
        series = self.series.get(name, Series())
        rows = series.count + np.arange(len(messages))
        columns = self._columns(messages, rows, "", series, without)
        self.keep(
            name, series, [column for column in columns if self.wants(name, column.path)], times
        )

    def _columns(
        self,
        messages: Sequence[Any],
        rows: Integers,
        path: str,
        series: Series,
        without: Any = None,
    ) -> Iterator[PathColumn]:
        """Each number of some messages: its path, the rows that have it, and the values."""
        kind = messages[0].DESCRIPTOR
        for field in kind.fields:
            below = f"{path}.{field.name}" if path else field.name
            if field is without:
                continue
            series.types[below] = kind.full_name, field.name
            values = [getattr(message, field.name) for message in messages]
            if _is_list(field):
                longest = max(map(len, values))
                if longest > LONGEST_LIST:
                    self.skipped.add(below)
                    continue
                for k in range(longest):
                    item_path = f"{below}[{k}]"
                    has_item = [len(items) > k for items in values]
                    items = [items[k] for items in values if len(items) > k]
                    series.types[item_path] = kind.full_name, field.name
                    yield from self._values(field, items, rows[has_item], item_path, series)
                continue
            is_set = [True] * len(messages)
            if field.has_presence and not field.has_default_value:  # absent fields give no value
                is_set = [message.HasField(field.name) for message in messages]
            values = list(compress(values, is_set))
            yield from self._values(field, values, rows[is_set], below, series)

    def _values(
        self, field: Any, values: Sequence[Any], rows: Integers, path: str, series: Series
    ) -> Iterator[PathColumn]:
        if not values:
            return
        if field.cpp_type in _DTYPES:
            yield PathColumn(path, rows, np.array(values, _DTYPES[field.cpp_type]))
        elif field.message_type is not None and field.message_type.full_name in _TIMES:
            series.times.add(path)
            times = [value.seconds * 10**9 + value.nanos for value in values]
            yield PathColumn(path, rows, np.array(times, np.int64))
        elif field.message_type is not None:
            yield from self._columns(values, rows, path, series)
        elif field.name in _FRAMES:
            for frame in dict.fromkeys(values):
                series.meet_frame(path, one_line(frame))
        elif field.type == FieldDescriptor.TYPE_BYTES and max(map(len, values)) > LONGEST_LIST:
            self.skipped.add(path)


def _is_list(field: Any) -> bool:
    """Whether a field is repeated, in any version of protobuf."""
    # A map has no order, and no element by number.
    entry = field.message_type is not None and field.message_type.GetOptions().map_entry
    return bool(field.default_value == [] and not entry)


def _is_long(message: Any) -> bool:
    """Whether most of a message is an image or similar."""
    lengths = [
        len(value)
        for field, value in message.ListFields()
        if field.type == FieldDescriptor.TYPE_BYTES or _is_list(field)
    ]
    return 2 * sum(size for size in lengths if size > LONGEST_LIST) > int(message.ByteSize())
