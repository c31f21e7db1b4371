"""A topic: blocks of its messages in, channels out."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.formats import Request
from palpate.recordings.messages.blocks import Block, joined
from palpate.recordings.messages.compression import ZSTD, Budget, unpack, zstandard_size
from palpate.recordings.messages.fields import UndecodableError
from palpate.recordings.messages.layout import Entity, Layout, Matrix, TimeAt, gather
from palpate.recordings.messages.rows import Rows

# A topic whose messages cannot be walked is given up after so many: some 0.1 s, of which a file can
# hold many.
PATIENCE = 1000
# Transforms or sets of fields by name that a topic may hold; a robot has some tens.
MOST_ENTITIES = 500
# Layouts that are kept to compare messages with.
MOST_LAYOUTS = 256

_BATCH = 8 << 20  # bytes of messages that are unpacked at once

Walk: TypeAlias = Callable[[bytes], Layout]


@dataclass(slots=True)
class Found:
    """What has been found of a topic, or of one transform of it."""

    rows: Rows = field(default_factory=Rows)
    times: set[str] = field(default_factory=set)
    types: dict[str, tuple[str, str]] = field(default_factory=dict)
    frames: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def meet_frame(self, path: str, frame: str) -> None:
        """Note the frame that a field names: two are enough to know that it changes."""
        if len(self.frames[path]) < 2 and frame not in self.frames[path]:
            self.frames[path].append(frame)


_Part: TypeAlias = tuple[NDArray[np.int64] | None, Layout, Matrix]


class Topic:
    """Messages of one type under one name.

    Parameters
    ----------
    name, type_name : str
        As the file says them.
    request : Request
        What is asked for.

    Attributes
    ----------
    found : dict
        What has been found, by what follows the topic's name: nothing, or ``[parent>child]``.
    messages, bytes, undecodable : int
        How many there were; bytes of those that were read; how many could not be decoded.
    omitted : str
        Why nothing of it is read.
    """

    def __init__(self, name: str, type_name: str, request: Request) -> None:
        self.name = name
        self.type_name = type_name
        self.request = request
        self.found: dict[str, Found] = {}
        self.messages = 0
        self.bytes = 0
        self.undecodable = 0
        self.reason = ""  # of the first message that could not be decoded
        self.omitted = ""
        self.skipped: set[str] = set()
        self.overflow = False  # whether there were more transforms than are read
        self._budget = Budget(0)

    def add(self, block: Block) -> None:
        """Take messages."""
        self.messages += len(block.starts)
        if self.omitted or not len(block.starts):
            return
        self._budget.add(int(block.lengths.sum()))
        for each in self._unpacked(block) if self.packed(block) else (block,):
            if len(each.starts) and not self.omitted:
                self.bytes += int(each.lengths.sum())
                self.take(each)
        for found in self.found.values():
            found.rows.prune(self.bytes)

    def packed(self, block: Block) -> bool:
        """Whether each message is compressed, as those of ROS 2 may be."""
        return False

    def take(self, block: Block) -> None:
        """Read messages; a topic that is omitted has no way to."""

    def _unpacked(self, block: Block) -> Iterator[Block]:
        """Messages, each of which was compressed by zstd; those that do not unpack are left out."""
        pieces: list[bytes] = []
        times: list[np.int64] = []
        held = 0
        for k in range(len(block.starts)):
            packed = block.message(k)
            size = zstandard_size(packed)
            try:
                if size < 0:
                    raise UndecodableError("a message does not say what it unpacks to")
                self._budget.allow(len(packed), size)
                pieces.append(unpack("zstd", packed, size))
            except UndecodableError as error:
                self.fail(str(error))
                continue
            times.append(block.times[k])
            held += size
            if held > _BATCH:
                yield joined(pieces, times)
                pieces, times, held = [], [], 0
        yield joined(pieces, times)

    def fail(self, reason: str, count: int = 1) -> None:
        """Count messages that could not be decoded, and give up where none of many could."""
        self.undecodable += count
        self.reason = self.reason or reason
        if self.undecodable >= PATIENCE and not self.found:
            self.omitted = reason


class BinaryTopic(Topic):
    """A topic whose messages have layouts.

    Parameters
    ----------
    walk : callable
        Returns the layout of a message, or raises UndecodableError.
    request : Request
        What is asked for.
    cdr : bool
        Whether they are in CDR, whose first byte is 0: so it shows where they are compressed.
    """

    def __init__(self, walk: Walk, request: Request, *, cdr: bool = False) -> None:
        super().__init__("", "", request)
        self._cdr = cdr
        self._walk = walk
        self._layouts: dict[int, list[Layout]] = {}

    def packed(self, block: Block) -> bool:
        """Whether each message is compressed, as those of ROS 2 may be."""
        return self._cdr and block.message(0)[:4] == ZSTD

    def take(self, block: Block) -> None:
        """Read messages."""
        parts = self._parts(block)
        if not self.omitted:
            self._extend(parts, block.times)

    def _parts(self, block: Block) -> list[_Part]:
        """Messages by their layout: which of the block, or None for all; the layout; the bytes."""
        parts: list[_Part] = []
        first = int(block.lengths[0])
        if (block.lengths == first).all():
            self._match(block, None, first, parts)
            return parts
        for length in np.unique(block.lengths):
            which = np.flatnonzero(block.lengths == length)
            self._match(block, which, int(length), parts)
        return parts

    def _match(
        self, block: Block, which: NDArray[np.int64] | None, length: int, parts: list[_Part]
    ) -> None:
        known = self._layouts.setdefault(length, [])
        if not known:  # before an image is copied, which is then left out
            first = 0 if which is None else int(which[0])
            if not self._new_layout(block.message(first), known):
                which = (np.arange(len(block.starts)) if which is None else which)[1:]
        if self.omitted:
            return
        starts = block.starts if which is None else block.starts[which]
        matrix = gather(block.data, starts, length)
        tried = 0
        while len(matrix):
            if tried == len(known) and not self._new_layout(matrix[0].tobytes(), known):
                if self.omitted:
                    return
                which = np.arange(len(block.starts)) if which is None else which
                which, matrix = which[1:], matrix[1:]
                continue
            layout = known[tried]
            tried += 1
            same = layout.matches(matrix)
            if same.all():
                parts.append((which, layout, matrix))
                return
            if same.any():
                which = np.arange(len(block.starts)) if which is None else which
                parts.append((which[same], layout, matrix[same]))
                which, matrix = which[~same], matrix[~same]

    def _new_layout(self, message: bytes, known: list[Layout]) -> bool:
        """Walk a message, and keep its layout; whether it could be."""
        try:
            layout = self._walk(message)
        except UndecodableError as error:
            self.fail(str(error))
            return False
        self._choose(layout)
        if sum(len(each) for each in self._layouts.values()) > MOST_LAYOUTS:
            for each in self._layouts.values():
                if each is not known:
                    each.clear()
            self._layouts = {layout.length: known}
        known.append(layout)
        return True

    def _choose(self, layout: Layout) -> None:
        """Leave out what is not asked for, and what is long."""
        named = self.request.channels is not None
        long = sum(layout.skipped.values())
        if not self.found and not named and long > layout.length / 2:
            what = ", ".join(sorted(layout.skipped)[:3])
            self.omitted = f"most of it is in long lists ({what})"
            return
        self.skipped |= layout.skipped.keys()
        for entity in layout.entities:
            above = f"{self.name}{entity.name}."
            stamp = stamp_of(entity.leaves)
            for path in list(entity.leaves):
                if path != stamp and not self.request.wants(above + path):
                    del entity.leaves[path]
            if set(entity.leaves) <= {stamp}:
                entity.leaves.clear()

    def _extend(self, parts: list[_Part], times: NDArray[np.int64]) -> None:
        by_name: dict[str, list[tuple[_Part, Entity]]] = defaultdict(list)
        for part in parts:
            for entity in part[1].entities:
                if entity.leaves:
                    by_name[entity.name].append((part, entity))
        for name, pieces in by_name.items():
            if name not in self.found and len(self.found) >= MOST_ENTITIES:
                self.overflow = True
                continue
            found = self.found.setdefault(name, Found())
            for _, entity in pieces:
                found.types |= entity.types
                found.times |= {p for p, leaf in entity.leaves.items() if isinstance(leaf, TimeAt)}
                for path, frame in entity.frames.items():
                    found.meet_frame(path, frame)
            if len(pieces) == 1:
                (which, _, matrix), entity = pieces[0]
                values = {path: leaf.read(matrix) for path, leaf in entity.leaves.items()}
                values[LOG_TIME] = times if which is None else times[which]
                found.rows.extend(len(matrix), values)
            else:
                _extend_mixed(found.rows, pieces, times)


#: Below an entity, the column of the times at which messages were logged. Fields of messages have
#: no space in their names.
LOG_TIME = "log time"
STAMPS = ("header.stamp", "timestamp", "stamp")


def stamp_of(paths: Any) -> str | None:
    """Return which of the paths of an entity says when it was measured; None where none does."""
    return next((path for path in STAMPS if path in paths), None)


def _extend_mixed(rows: Rows, pieces: list[tuple[_Part, Entity]], times: NDArray[np.int64]) -> None:
    """Add messages of several layouts, in the order in which they stand in the file."""
    which = [part[0] if part[0] is not None else np.arange(len(times)) for part, _ in pieces]
    order = np.argsort(np.concatenate(which), kind="stable")
    ends = np.cumsum([len(each) for each in which])
    values: dict[str, NDArray[Any]] = {LOG_TIME: times[np.concatenate(which)]}
    present: dict[str, NDArray[np.bool_]] = {}
    for ((_, _, matrix), entity), end in zip(pieces, ends, strict=True):
        here = slice(end - len(matrix), end)
        for path, leaf in entity.leaves.items():
            column = leaf.read(matrix)
            if path not in values:
                values[path] = np.zeros(len(order), column.dtype)
                present[path] = np.zeros(len(order), bool)
            else:
                dtype = np.result_type(values[path].dtype, column.dtype)
                values[path] = values[path].astype(dtype, copy=False)
            values[path][here] = column
            present[path][here] = True
    some = {path: mask[order] for path, mask in present.items() if not mask.all()}
    rows.extend(len(order), {path: column[order] for path, column in values.items()}, some)
