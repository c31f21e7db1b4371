"""Topics: convert blocks of messages to channels."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import zstandard

from palpate.input.recordings.messages.layout import (
    Block,
    Entity,
    Layout,
    Matrix,
    TimeAt,
    UndecodableError,
    gather,
)
from palpate.input.recordings.opening import Request
from palpate.input.recordings.recording import Faults
from palpate.validation import Integers, Values

# Undecodable messages after which palpate gives up on a topic: some 0.1 s per topic.
PATIENCE = 1000
#: Largest number of layouts in a topic. All messages of a length are compared with each.
MOST_PARSED = 4096
_BATCH = 4096  # messages in a batch of Python objects, some 1 kB each

_ZSTD = b"\x28\xb5\x2f\xfd"  # first bytes of a compressed message
#: The column of log times. No field of a message has a space in its name.
LOG_TIME = "log time"
STAMPS = ("header.stamp", "timestamp", "stamp")

Walk: TypeAlias = Callable[[bytes], Layout]
_Rows: TypeAlias = slice | Integers
_Pieces: TypeAlias = list[tuple[_Rows, Values]]


def find_stamp(paths: Iterable[str]) -> str | None:
    """Return the path of the time of measurement, or None without such a path."""
    return next(filter({*paths}.__contains__, STAMPS), None)


@dataclass(slots=True)
class Series:
    """The data of a topic, or of one transform of it.

    Attributes
    ----------
    count : int
        Number of rows.
    columns : dict
        Pieces of each column: their rows and the numbers.
    """

    count: int = 0
    columns: dict[str, _Pieces] = field(default_factory=lambda: defaultdict(list))
    times: set[str] = field(default_factory=set)
    types: dict[str, tuple[str, str]] = field(default_factory=dict)
    frames: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def meet_frame(self, path: str, frame: str) -> None:
        """Note the frame in a field, up to two: these show that it changes."""
        if len(self.frames[path]) < 2 and frame not in self.frames[path]:
            self.frames[path].append(frame)

    def finish(self, path: str) -> tuple[Values, Faults | None]:
        """Return and clear a column; a row without the field is NaN and counted as a fault."""
        pieces = self.columns.pop(path)
        dtype = np.result_type(*(column.dtype for _, column in pieces))
        missing = self.count - sum(len(column) for _, column in pieces)
        if missing and dtype.kind != "f":
            dtype = np.dtype(np.float64)
        values = np.full(self.count, np.nan if missing else 0, dtype)
        absent = np.ones(self.count, bool)
        for rows, column in pieces:
            values[rows] = column
            absent[rows] = False
        if not missing:
            return values, None
        return values, Faults(missing, int(np.argmax(absent)), "a message without this field")


class PathColumn(NamedTuple):
    """A column of numbers: its path, the rows that have it, and the values."""

    path: str
    rows: _Rows
    values: Values


class _Matched(NamedTuple):
    """Messages of one layout: their indices in a block, and their bytes."""

    which: Integers
    layout: Layout
    matrix: Matrix


class Topic:
    """Messages of one type under one name.

    Parameters
    ----------
    request : Request
        What to read.

    Attributes
    ----------
    name, type_name : str
        Name and type in the file.
    series : dict
        Suffix of the topic's name, empty or ``[parent>child]``, to data.
    messages, undecodable : int
        Number of messages; number of messages that could not be decoded.
    omitted : str
        Why the topic is skipped; empty if it is read.
    """

    def __init__(self, request: Request) -> None:
        self.name = self.type_name = ""
        self.request = request
        self.series: dict[str, Series] = {}
        self.messages = 0
        self.undecodable = 0
        self.reason = ""  # of the first message that could not be decoded
        self.omitted = ""
        self.skipped: set[str] = set()

    def add(self, block: Block) -> None:
        """Count messages and read them."""
        self.messages += len(block.starts)
        if not self.omitted and len(block.starts):
            self.take(block)

    def take(self, block: Block) -> None:
        """Read messages; subclasses implement this."""

    def fail(self, reason: str, count: int = 1) -> None:
        """Count undecodable messages; give up after many if none could be decoded."""
        self.undecodable += count
        self.reason = self.reason or reason
        if self.undecodable >= PATIENCE and not self.series:
            self.omitted = reason

    def wants(self, name: str, path: str) -> bool:
        """Whether a column is requested, or is the time of measurement."""
        return path in STAMPS or self.request.wants(f"{self.name}{name}.{path}")

    def keep(
        self, name: str, series: Series, columns: Sequence[PathColumn], times: Integers
    ) -> None:
        """Add columns of some messages, unless they hold nothing but the time stamp."""
        paths = {column.path for column in columns}
        if paths <= {find_stamp(paths)}:
            return
        self.request.reserve(sum(column.values.nbytes for column in columns) + times.nbytes)
        self.series[name] = series
        rows = slice(series.count, series.count + len(times))
        for path, which, values in (*columns, (LOG_TIME, rows, times)):
            series.columns[path].append((which, values))
        series.count += len(times)


class ObjectTopic(Topic):
    """A topic whose messages a package decodes to Python objects, one by one."""

    def decode_message(self, message: bytes) -> Any:
        """Return a message as an object; raise UndecodableError if it is invalid."""
        raise NotImplementedError

    def take_objects(self, messages: list[Any], times: Integers) -> None:
        """Read decoded messages with their log times, ns."""
        raise NotImplementedError

    def take(self, block: Block) -> None:
        """Read messages."""
        for begin in range(0, len(block.starts), _BATCH):
            messages = []
            times = []
            for k in range(begin, min(begin + _BATCH, len(block.starts))):
                try:
                    messages.append(self.decode_message(block.message(k)))
                except UndecodableError as error:
                    self.fail(str(error))
                    continue
                times.append(block.times[k])
            if messages and not self.omitted:
                self.take_objects(messages, np.array(times, np.int64))


class BinaryTopic(Topic):
    """A topic whose messages have layouts.

    Parameters
    ----------
    walk : callable
        Returns the layout of a message, or raises UndecodableError.
    request : Request
        What to read.
    cdr : bool
        Whether they are in CDR. Its first byte is 0, unless the messages are compressed.
    """

    def __init__(self, walk: Walk, request: Request, *, cdr: bool = False) -> None:
        super().__init__(request)
        self._cdr = cdr
        self._walk = walk
        self._parsed = 0  # number of messages with a new layout
        self._layouts: dict[int, list[Layout]] = {}

    def take(self, block: Block) -> None:
        """Read messages."""
        if self._cdr and block.message(0).startswith(_ZSTD):  # ROS 2 can compress each message
            block = self._unpack_block(block)
        matched: list[_Matched] = []
        for length in np.unique(block.lengths).tolist():
            matched += self._match(block, np.flatnonzero(block.lengths == length), length)
        if not self.omitted:
            self._extend(matched, block.times)

    def _unpack_block(self, block: Block) -> Block:
        messages = []
        times = []
        for k, time in enumerate(block.times.tolist()):
            try:
                unpacked = zstandard.ZstdDecompressor().stream_reader(block.message(k))
                message = unpacked.read(self.request.largest_block + 1)
                self.request.check_block(len(message))
                messages.append(message)
            except (zstandard.ZstdError, ValueError) as error:
                self.fail(f"it cannot be decompressed: {error}")
                continue
            times.append(time)
        return Block.joined(messages, times)

    def _match(self, block: Block, which: Integers, length: int) -> Iterator[_Matched]:
        """Group messages of one length by layout: their indices, the layout, the bytes."""
        layouts = self._layouts.setdefault(length, [])
        # Parse the first message before copying, so that images are skipped without a copy.
        if not layouts and not self._new_layout(block.message(int(which[0])), layouts):
            which = which[1:]
        if self.omitted:
            return
        matrix = gather(block.data, block.starts[which], length)
        tried = 0
        while len(which):
            if tried == len(layouts):
                if self._parsed > MOST_PARSED:
                    self.fail(f"they have more than {MOST_PARSED} layouts", len(which))
                    return
                if not self._new_layout(matrix[0].tobytes(), layouts):
                    if self.omitted:
                        return
                    which = which[1:]
                    matrix = matrix[1:]
                    continue
            layout = layouts[tried]
            tried += 1
            same = layout.matches(matrix)
            if same.all():
                yield _Matched(which, layout, matrix)
                return
            if same.any():
                yield _Matched(which[same], layout, matrix[same])
                which = which[~same]
                matrix = matrix[~same]

    def _new_layout(self, message: bytes, layouts: list[Layout]) -> bool:
        """Parse a message and keep its layout; return whether that succeeded."""
        self._parsed += 1
        try:
            layout = self._walk(message)
        except UndecodableError as error:
            self.fail(str(error))
            return False
        self._choose(layout)
        layouts.append(layout)
        return True

    def _choose(self, layout: Layout) -> None:
        """Drop columns that are not requested, and topics that consist of long lists."""
        named = self.request.channels is not None
        long = sum(layout.skipped.values())
        if not self.series and not named and long > layout.length / 2:
            what = ", ".join(sorted(layout.skipped)[:3])
            self.omitted = f"most of it is in long lists ({what})"
            return
        self.skipped |= layout.skipped.keys()
        for entity in layout.entities:
            stamp = find_stamp(entity.leaves)
            for path in list(entity.leaves):
                if not self.wants(entity.name, path):
                    del entity.leaves[path]
            if set(entity.leaves) <= {stamp}:
                entity.leaves.clear()

    def _extend(self, matched: list[_Matched], times: Integers) -> None:
        by_name: dict[str, list[tuple[Integers, Matrix, Entity]]] = defaultdict(list)
        for which, layout, matrix in matched:
            for entity in layout.entities:
                if entity.leaves:
                    by_name[entity.name].append((which, matrix, entity))
        for name, pieces in by_name.items():
            series = self.series.get(name, Series())
            # Messages of several layouts keep their order in the file.
            indices = np.concatenate([which for which, _, _ in pieces])
            order = np.argsort(indices, kind="stable")
            places = series.count + np.argsort(order)
            ends = np.cumsum([len(which) for which, _, _ in pieces[:-1]], dtype=int)
            columns: list[PathColumn] = []
            for split, (_, matrix, entity) in zip(np.split(places, ends), pieces, strict=True):
                rows: _Rows = split
                if len(pieces) == 1:
                    rows = slice(series.count, series.count + len(matrix))
                series.types |= entity.types
                for path, frame in entity.frames.items():
                    series.meet_frame(path, frame)
                for path, leaf in entity.leaves.items():
                    if isinstance(leaf, TimeAt):
                        series.times.add(path)
                    columns.append(PathColumn(path, rows, leaf.read(matrix)))
            self.keep(name, series, columns, times[indices[order]])
