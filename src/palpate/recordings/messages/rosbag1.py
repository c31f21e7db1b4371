"""Bags of ROS 1, also those that a recorder did not close (``.bag.active``)."""

import os
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from palpate.recordings.formats import Request
from palpate.recordings.messages import rosbag1_records as records
from palpate.recordings.messages.blocks import Block
from palpate.recordings.messages.collection import Collection
from palpate.recordings.messages.compression import LARGEST, RATIO, Budget, unpack, unpack_begin
from palpate.recordings.messages.fields import UndecodableError
from palpate.recordings.messages.files import opened
from palpate.recordings.messages.rosbag1_records import Record
from palpate.recordings.messages.schemas import topic_of
from palpate.recordings.messages.searching import MOST_PLACES, Search
from palpate.recordings.messages.topic import Topic
from palpate.recordings.recording import Recording

_FIRST_WINDOW = 1 << 16
_LONGEST_CHUNK = 64 << 20  # bytes, packed, of one whose size is not known; usual are 768 kB
_WINDOW = 4 << 20  # bytes of a file that are looked at at a time


def read(path: Path, request: Request) -> Recording:
    """Read a bag of ROS 1: every topic whose messages hold numbers.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        The file cannot be read, or holds no numbers; or, where strict, is damaged.
    """
    collection = Collection(path, request)
    with opened(path, collection) as file:
        _Bag(file, collection).read()
    return collection.recording()


class _Bag:
    def __init__(self, file: BinaryIO, collection: Collection) -> None:
        self.file = file
        self.collection = collection
        self.size = os.fstat(file.fileno()).st_size
        self.budget = Budget(self.size)
        self.position = 0
        self.topics: dict[int, Topic] = {}
        self.messages = 0
        self.claimed = 0  # messages, by the index
        self.closed = False
        self.unknown = 0
        self.window = _FIRST_WINDOW
        self.search = Search(self.size, self._bytes, _record_in_block)

    def read(self) -> None:
        first = self._bytes(0, 64)
        if first.startswith(records.MAGIC):
            self.position = len(records.MAGIC)
        elif first.startswith(b"#ROSBAG V"):
            version = first[9:].split(b"\n")[0][:8].decode("ascii", "replace")
            raise self.collection.error(
                f"a bag of version {version!r}, where 2.0 is read", "convert it by rosbag fix"
            )
        else:
            self.collection.lost("it does not begin as a bag does")
            self.position = self.search.after(0)
        while self.position + 8 <= self.size:
            self._record()
            self.collection.request.report(self.position / self.size)
        if self.position < self.size:
            self._lost(self.position, self.size, "the last record is cut off")
        if not self.closed:
            self.collection.lost(
                "the recorder did not close it: it has no index, and what the recorder had not "
                f"written yet is missing; {self.messages} messages were read"
            )
        elif self.claimed != self.messages:
            self.collection.lost(
                f"its index counts {self.claimed} messages, of which {self.messages} were read"
            )
        if self.unknown:
            self.collection.lost(f"{self.unknown} messages are of connections that are missing")

    def _record(self) -> None:
        at = self.position
        record = records.record_in(self._bytes(at, 4096), 0, self.size - at)
        if record is None:
            return self._damaged("something that is no record")
        begin = at + record.begin
        kind = record.kind
        if kind == records.CHUNK:
            return self._chunk(record, begin)
        if record.size > self.size - begin:
            return self._damaged("a record that goes on beyond the end of the file")
        if kind == records.MESSAGE:
            if record.size > LARGEST:
                return self._damaged(f"a message of {record.size} bytes")
            return self._loose()
        if kind == records.CONNECTION and record.size < _WINDOW:
            self._connection(record, self._bytes(begin, record.size))
        elif kind == records.FILE:
            self.closed = record.number("index_pos", "<Q") != 0
        elif kind == records.CHUNK_INFO and record.size < _WINDOW:
            counts = np.frombuffer(self._bytes(begin, record.size - record.size % 8), "<u4")
            self.claimed += int(counts[1::2].sum())
        self.position = begin + record.size
        return None

    def _chunk(self, record: Record, begin: int) -> None:
        kind = record.text("compression")
        left = self.size - begin
        unpacked = record.number("size", "<I") or 0
        if kind in ("none", "") and not 0 < record.size <= left:
            self.position = begin  # never closed, or cut off: its records follow as if loose
            return
        try:
            if 0 < record.size <= left:
                self.position = begin + record.size
                self.budget.allow(record.size, unpacked)
                self._records(unpack(kind, self._bytes(begin, record.size), unpacked))
                return
            # Cut off, or its size is wrong: then there are records after it.
            self.position = self.search.after(begin)
            packed = min(left, _LONGEST_CHUNK)
            data = unpack_begin(kind, self._bytes(begin, packed), min(RATIO * packed, LARGEST))
            self.budget.allow(packed, len(data))
            self._records(data)
            self.collection.lost(f"a chunk at byte {begin} is cut off")
        except UndecodableError as error:
            self._lost(begin, self.position, f"a chunk is lost: {error}")

    def _loose(self) -> None:
        """Messages outside of a chunk, as many as are in a window."""
        data = self._bytes(self.position, self.window)
        size = records.size_at(data, 0)
        if not size:
            record = records.record_in(data, 0, self.size - self.position)
            assert record is not None
            data = self._bytes(self.position, record.begin + record.size)
        end = self._take(data, loose=True)
        if not end:
            return self._damaged("a message without a connection or a time")
        # At first little is read at a time, as other records may come between.
        self.window = min(4 * self.window, _WINDOW) if end > len(data) / 2 else _FIRST_WINDOW
        self.position += end
        return None

    def _records(self, data: bytes) -> None:
        end = self._take(data)
        if end < len(data):
            self.collection.lost(
                f"{len(data) - end} bytes at the end of a chunk before byte {self.position} are "
                "no whole record"
            )

    def _take(self, data: bytes, *, loose: bool = False) -> int:
        """Take messages and connections; return where they end."""
        starts, end = records.whole_records(data)
        found = records.messages_of(data, starts)
        for start in found.others:
            record = records.record_in(data, start, len(data) - start)
            if record is None or record.kind != records.CONNECTION:
                if loose:  # a chunk or an index: whoever reads the file goes on from here
                    found = found.before(start)
                    end = start
                    break
                continue
            body = start + record.begin
            self._connection(record, data[body : body + record.size])
        self.messages += len(found.starts)
        view = np.frombuffer(data, np.uint8)
        for number in np.unique(found.connections).tolist():
            which = found.connections == number
            topic = self.topics.get(number)
            if topic is None:
                self.unknown += int(which.sum())
                continue
            topic.add(Block(view, found.starts[which], found.lengths[which], found.times[which]))
        return end

    def _connection(self, record: Record, data: bytes) -> None:
        number = record.number("conn", "<I")
        fields = records.fields_of(data)
        if number is None or number in self.topics or fields is None:
            return
        name = record.text("topic")
        texts = {key: value.decode("utf-8", "replace") for key, value in fields.items()}
        definition = texts.get("message_definition", "").encode()
        type_name = texts.get("type", "")
        make = partial(topic_of, "ros1", "ros1msg", type_name, definition)
        self.topics[number] = self.collection.topic(name, type_name, "ros1", make, len(definition))

    def _damaged(self, what: str) -> None:
        """Go on with the next record that can be one."""
        at = self.position
        self.position = self.search.after(at + 1)
        self._lost(at, self.position, what)

    def _bytes(self, begin: int, count: int) -> bytes:
        self.file.seek(begin)
        return self.file.read(max(0, min(count, self.size - begin)))

    def _lost(self, begin: int, end: int, what: str) -> None:
        self.collection.lost(f"{what}, at byte {begin}: {end - begin} bytes are lost")


def _record_in_block(data: bytes, offset: int, size: int) -> int | None:
    """Where in a block of the file the next record may begin."""
    for k in records.candidates(data)[:MOST_PLACES]:
        record = records.record_in(data, k, size - offset - k)
        if record is not None and offset + k + record.begin + record.size <= size:
            return k
    return None
