"""MCAP: topics of ROS 1 and 2, JSON and protobuf in one file, in compressed chunks or not."""

import os
import zlib
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.formats import Request
from palpate.recordings.messages import mcap_records as records
from palpate.recordings.messages.blocks import Block
from palpate.recordings.messages.collection import Collection, one_line
from palpate.recordings.messages.compression import LARGEST, Budget, unpack, unpack_begin
from palpate.recordings.messages.fields import UndecodableError
from palpate.recordings.messages.files import name_of, opened, span
from palpate.recordings.messages.mcap_records import HEAD, ChunkHead, Cursor
from palpate.recordings.messages.record_starts import Starts
from palpate.recordings.messages.schemas import topic_of
from palpate.recordings.messages.searching import MOST_PLACES, Search
from palpate.recordings.messages.topic import Topic
from palpate.recordings.recording import Recording

_WINDOW = 4 << 20  # bytes of a file without chunks that are read at a time, at the most
_FIRST_WINDOW = 1 << 16  # and at first, as other records may come between
_LONGEST_NOTE = 300  # characters


def read(path: Path, request: Request) -> Recording:
    """Read an MCAP file: every topic whose messages hold numbers.

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
    read_into(path, collection)
    return collection.recording()


def read_into(path: Path, collection: Collection, part: tuple[float, float] = (0.0, 1.0)) -> None:
    """Read a file into a collection, which may have others too.

    Parameters
    ----------
    path : Path
        The file.
    collection : Collection
        Takes the messages.
    part : tuple of float
        Of all that is to be read, for the progress.
    """
    with opened(path, collection) as file:
        _McapFile(file, name_of(path), collection, part).read()


class _McapFile:
    def __init__(
        self, file: BinaryIO, name: str, collection: Collection, part: tuple[float, float]
    ) -> None:
        self.file = file
        self.name = name
        self.collection = collection
        self.part = part
        self.size = os.fstat(file.fileno()).st_size
        self.budget = Budget(self.size)
        self.position = 0
        self.schemas: dict[int, tuple[str, str, bytes]] = {}
        self.channels: dict[int, Topic] = {}
        self.unknown = 0  # messages of channels that were not announced
        self.messages = 0
        self.claimed: int | None = None  # messages, by the file's own count
        self.last_time = 0
        self.ended = False
        self.window = _FIRST_WINDOW
        self.search = Search(self.size, self._bytes, _records_in)

    def read(self) -> None:
        if self._bytes(0, len(records.MAGIC)) != records.MAGIC:
            self._lost("it does not begin as an MCAP file does")
            self.position = self.search.after(0)
        else:
            self.position = len(records.MAGIC)
        while self.position + HEAD <= self.size and not self.ended:
            self._record()
            begin, end = self.part
            self.collection.request.report(begin + (end - begin) * self.position / self.size)
        if not self.ended:
            self._lost(
                "it ends before its end, as where the recorder was killed: the "
                f"{self.messages} messages before are used"
            )
        if self.unknown:
            self._lost(f"{self.unknown} messages are of channels that it does not describe")
        if self.claimed is not None and self.claimed != self.messages:
            self._lost(f"it counts {self.claimed} messages, of which {self.messages} were read")

    def _record(self) -> None:
        head = self._bytes(self.position, HEAD)
        kind, length = head[0], int.from_bytes(head[1:9], "little")
        begin = self.position + HEAD
        if length > self.size - begin:
            self._cut(kind, begin)
        elif kind in (records.MESSAGE, records.SCHEMA, records.CHANNEL):
            if length > LARGEST:
                return self._damaged(f"a record of {length} bytes")
            self._loose()
        elif kind == records.CHUNK:
            self._chunk(begin, length)
            self.position = begin + length
        elif kind == records.FOOTER:
            self.ended = True
        elif 0 < kind <= records.LAST or kind >= 0x80:
            if kind in (records.STATISTICS, records.METADATA, records.HEADER) and length < _WINDOW:
                self._told(kind, self._bytes(begin, length))
            self.position = begin + length
        else:
            self._damaged(f"a record of the kind 0x{kind:02X}")
        return None

    def _loose(self) -> None:
        """Messages outside of a chunk, as many as are in a window."""
        data = self._bytes(self.position, self.window)
        length = int.from_bytes(data[1:9], "little")
        if length > len(data) - HEAD:
            data = self._bytes(self.position, HEAD + length)
        starts, _ = records.whole_records(data)
        kinds = np.frombuffer(data, np.uint8)[starts]
        loose = np.isin(kinds, (records.MESSAGE, records.SCHEMA, records.CHANNEL))
        count = len(starts) if loose.all() else int(np.argmin(loose))
        self.window = min(4 * self.window, _WINDOW) if loose.all() else _FIRST_WINDOW
        starts = starts[:count]
        self._take(data, starts, kinds[:count])
        last = int(starts[-1])
        self.position += last + HEAD + int.from_bytes(data[last + 1 : last + 9], "little")

    def _chunk(self, begin: int, length: int) -> None:
        times = ""
        try:
            head = ChunkHead.read(self._bytes(begin, min(length, 1024)))
            times = span(head.first, head.last)
            if head.packed > length - head.begin:
                raise UndecodableError("it claims more bytes than it has")
            self.budget.allow(head.packed, head.size)
            data = unpack(head.compression, self._bytes(begin + head.begin, head.packed), head.size)
            if head.checksum and zlib.crc32(data) != head.checksum:
                raise UndecodableError("its checksum is wrong")
        except UndecodableError as error:
            self._lost(f"a chunk of {length} bytes at byte {begin}{times} is lost: {error}")
            return
        self._records(data, f"a chunk at byte {begin}")

    def _records(self, data: bytes, where: str) -> None:
        starts, end = records.whole_records(data)
        kinds = np.frombuffer(data, np.uint8)[starts]
        self._take(data, starts, kinds)
        if end < len(data):
            self._lost(f"the last {len(data) - end} bytes of {where} are no whole record")

    def _cut(self, kind: int, begin: int) -> None:
        """A record that claims to go on beyond the end of the file."""
        left = self.size - begin
        if kind == records.CHUNK:
            try:
                head = ChunkHead.read(self._bytes(begin, min(left, 1024)))
                if head.begin + head.packed < left:
                    raise UndecodableError("its length is wrong")
                data = self._bytes(begin + head.begin, left)
                self.budget.allow(len(data), min(head.size, 64 * len(data)))
                data = unpack_begin(head.compression, data, min(head.size, 64 * len(data)))
            except UndecodableError:
                return self._damaged("a chunk that goes on beyond the end of the file")
            starts, _ = records.whole_records(data)
            kinds = np.frombuffer(data, np.uint8)[starts]
            self._take(data, starts, kinds)
            count = int((kinds == records.MESSAGE).sum())
            self._lost(
                f"the last chunk, at byte {begin}, is cut off: of {head.size} bytes"
                f"{span(head.first, head.last)} the first {count} messages were read"
            )
            self.position = self.size
            return None
        return self._damaged("a record that goes on beyond the end of the file")

    def _damaged(self, what: str) -> None:
        """Go on with the next record that can be one."""
        at = self.position
        self.position = self.search.after(at + 1)
        self._lost(f"{what} at byte {at}: {self.position - at} bytes are lost")

    def _take(self, data: bytes, starts: Starts, kinds: NDArray[np.uint8]) -> None:
        for k in np.flatnonzero(kinds != records.MESSAGE).tolist():
            begin = int(starts[k])
            end = begin + HEAD + int.from_bytes(data[begin + 1 : begin + 9], "little")
            self._told(int(kinds[k]), data[begin + HEAD : end])
        found = records.messages_of(data, starts[kinds == records.MESSAGE])
        self.messages += len(found.starts)
        view = np.frombuffer(data, np.uint8)
        for channel in np.flatnonzero(np.bincount(found.channels)).tolist():
            topic = self.channels.get(channel)
            which = found.channels == channel
            if topic is None:
                self.unknown += int(which.sum())
                continue
            topic.add(Block(view, found.starts[which], found.lengths[which], found.times[which]))

    def _told(self, kind: int, data: bytes) -> None:
        """What a record other than a message says."""
        cursor = Cursor(data)
        try:
            if kind == records.SCHEMA:
                number = cursor.number("<H")
                self.schemas[number] = cursor.text(), cursor.text(), cursor.bytes()
            elif kind == records.CHANNEL:
                self._channel(cursor)
            elif kind == records.STATISTICS:
                self.claimed = cursor.number("<Q")
            elif kind == records.METADATA:
                self._note(cursor)
            elif kind == records.HEADER:
                profile, library = cursor.text(), cursor.text()
                words = f"{profile} by {library}" if profile else library
                self.collection.notes["written as"] = one_line(words)
        except UndecodableError:
            self._lost(f"a record of the kind 0x{kind:02X} cannot be understood")

    def _channel(self, cursor: Cursor) -> None:
        number, schema = cursor.number("<H"), cursor.number("<H")
        name, encoding = cursor.text(), cursor.text()
        if number in self.channels:  # again, in another chunk or in the summary
            return
        type_name, form, definition = self.schemas.get(schema, ("", "", b""))
        make = partial(topic_of, encoding, form, type_name, definition)
        self.channels[number] = self.collection.topic(
            name, type_name, f"{encoding} {form}", make, len(definition)
        )

    def _note(self, cursor: Cursor) -> None:
        above = cursor.text()
        for name, words in cursor.map().items():
            if len(words) <= _LONGEST_NOTE and len(self.collection.notes) < 100:
                self.collection.notes[one_line(f"{above}.{name}" if above else name)] = one_line(
                    " ".join(words.split())
                )

    def _bytes(self, begin: int, count: int) -> bytes:
        self.file.seek(begin)
        return self.file.read(max(0, min(count, self.size - begin)))

    def _lost(self, sentence: str) -> None:
        self.collection.lost(f"{self.name}: {sentence}")


def _records_in(data: bytes, offset: int, size: int) -> int | None:
    """Where in a block of the file the next record may begin."""
    kinds = np.frombuffer(data, np.uint8)
    if len(kinds) <= HEAD:
        return None
    # The lengths of records have zeros in their upper bytes.
    high = (kinds[7:-1] | kinds[8:]) == 0
    first = kinds[: len(high)]
    places = np.flatnonzero(high & (first > 0) & (first <= records.LAST))
    for k in places[:MOST_PLACES].tolist():
        if records.plausible(data, k, size, offset):
            return int(k)
    return None
