"""ROS 1 and ROS 2 bags, read with the package rosbags, and MCAP, read with the package mcap.

A reader passes blocks of raw messages to the
:class:`~palpate.input.recordings.messages.topic.Topic` of
each channel, which decodes them block by block.
"""

import bz2
import re
import shutil
import sqlite3
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import quote

import apsw
import lz4.frame
import numpy as np
import zstandard
from mcap import records as mcap
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from rosbags.rosbag1 import Reader as Rosbag1
from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from palpate.errors import RecordingError
from palpate.input.recordings.messages.collection import Collection
from palpate.input.recordings.messages.layout import Block, Bytes, gather, one_line
from palpate.input.recordings.messages.topic import Topic
from palpate.input.recordings.opening import METADATA, Request, excess, first_line, regular_size
from palpate.input.recordings.recording import Recording, printable
from palpate.validation import Integers
from palpate.writing import scratch_file

_LZ4 = b"\x04\x22\x4d\x18"
_MAGIC = b"\x89MCAP0\r\n"
_WINDOW = 1 << 18  # bytes of an MCAP file read at a time; a chunk may be longer
_BATCH = 8 << 20  # bytes of messages from rosbags collected before they are decoded
_LENGTH = struct.Struct("<Q").unpack_from
_HIGHEST_RATIO = 2000  # size of unpacked chunks over the file; time stamps alone prevent more
_BEFORE = 9  # bytes of kind and length at the start of an MCAP record
# The header of an MCAP message: kind, length, channel, number, log time, publish time.
_HEAD = np.dtype("u1, <i8, <u2, <u4, <i8, <u8")


def read(path: Path, request: Request) -> Recording:
    """Read a ROS 1 or 2 bag or an MCAP file: every topic whose messages hold numbers.

    Parameters
    ----------
    path : Path
        The file; for a ROS 2 bag also its folder or the metadata in it.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The file cannot be read, was not closed (ROS 1 and SQLite bags), or holds no numbers; or it
        is damaged and the request is strict.
    """
    collection = Collection(request)
    folder = path.parent if path.name == METADATA else path
    if folder.is_dir():
        _read_folder(folder, collection)
    else:
        _read_file(path, collection)
    return collection.recording()


def _read_folder(folder: Path, collection: Collection) -> None:
    files, expected = _files(folder, collection)
    for k, file in enumerate(files):
        try:
            _read_file(file, collection, k, len(files))
        except RecordingError as error:
            if len(files) == 1 or collection.request.strict:
                raise
            collection.lost(f"one of its files cannot be read: {error}")
    if expected is not None and collection.messages < expected:
        collection.lost(
            f"{METADATA} lists {expected} messages, but only {collection.messages} were found"
        )


def _files(folder: Path, collection: Collection) -> tuple[list[Path], int | None]:
    """The files of a ROS 2 bag in order, and the number of messages in its metadata."""
    files = [path for path in folder.iterdir() if re.search(r"\.(db3|mcap)(\.zstd)?$", path.name)]
    # Read a file once that exists both compressed and uncompressed.
    files = [path for path in files if path.with_suffix("") not in files]
    files.sort(key=lambda path: [int(n) for n in re.findall(r"\d+", path.name.split(".")[0])[-1:]])
    metadata = folder / METADATA
    if not metadata.is_file():
        if not files:
            raise collection.error("the folder holds no ROS 2 bag; name a recording file instead")
        collection.lost(f"{METADATA} is missing; the recorder was probably killed")
        return files, None
    try:
        about = YAML(typ="safe").load(metadata.read_text("utf-8"))["rosbag2_bagfile_information"]
        names = [Path(str(path)).name for path in about["relative_file_paths"]]
        expected = int(about["message_count"])
        distribution = about.get("ros_distro")
    except (OSError, ValueError, YAMLError, LookupError, TypeError, AttributeError):
        collection.lost(f"{METADATA} is invalid: palpate reads all files in its folder")
        return files, None
    if distribution:
        collection.notes["ROS distribution"] = one_line(str(distribution))
    by_name = {path.name.removesuffix(".zstd"): path for path in files}
    files = [by_name.pop(name.removesuffix(".zstd"), folder / name) for name in names]
    if by_name:
        collection.omit(f"not listed in {METADATA}", ", ".join(sorted(by_name)[:5]))
    return files, expected


def _read_file(path: Path, collection: Collection, number: int = 0, count: int = 1) -> None:
    regular_size(path)
    with _unpack_file(path, collection) as plain:
        with plain.open("rb") as file:
            begin = file.read(16)
        reader = next((_READERS[mark] for mark in _READERS if begin.startswith(mark)), None)
        if reader is None:
            raise collection.error(
                f"{printable(path.name)} is not a bag or an MCAP file; check what wrote it"
            )
        for fraction in reader(plain, collection):
            collection.request.report((number + fraction) / count)


@contextmanager
def _unpack_file(path: Path, collection: Collection) -> Iterator[Path]:
    """The file, or an uncompressed copy of a compressed one."""
    if not path.name.endswith(".zstd"):
        yield path
        return
    with path.open("rb") as file, scratch_file(path.stem) as (plain, copy):
        try:
            with zstandard.ZstdDecompressor().stream_reader(file) as unpacked:
                while piece := unpacked.read(_BATCH):
                    copy.write(piece)
                    if copy.tell() > (most := collection.request.max_size):
                        raise collection.error(excess("its file takes", copy.tell(), most))
        except zstandard.ZstdError as error:
            collection.lost(f"{one_line(path.name)} cannot be fully decompressed: {error}")
        copy.flush()
        yield plain


def _read_ros1(path: Path, collection: Collection) -> Iterator[float]:
    request = collection.request
    bag = Rosbag1(path)
    # rosbags may raise anything on a damaged file.
    with request.explain_damage(
        "the bag was not closed by its recorder or is damaged",
        f"close it with: rosbag reindex {request.source}",
        (Exception,),
    ):
        bag.open()
    for position, chunk in bag.chunks.items():
        unpack = partial(_unpack_bag_chunk, request=request)
        bag.chunks[position] = chunk._replace(decompressor=unpack)
    with closing(bag):
        total = sum(sum(info.connection_counts.values()) for info in bag.chunk_infos)
        kinds = {connection.id: ("ros1", "ros1msg") for connection in bag.connections}
        yield from _read_rosbags(bag.connections, kinds, bag.messages(), total, collection)


def _unpack_bag_chunk(data: bytes, request: Request) -> bytes:
    """Decompress a chunk of a ROS 1 bag, up to the cap; its first bytes show the method."""
    if data.startswith(_LZ4):
        unpacker: Any = lz4.frame.LZ4FrameDecompressor()
    elif data.startswith(b"BZh"):
        unpacker = bz2.BZ2Decompressor()
    else:
        return data
    unpacked: bytes = unpacker.decompress(data, request.largest_block + 1)
    request.check_block(len(unpacked))
    if not unpacker.eof:
        raise ValueError("a compressed chunk is cut off")
    return unpacked


@contextmanager
def _recover_bag(path: Path, collection: Collection) -> Iterator[Path]:
    """The bag; if its recorder did not close it, a copy to which SQLite applied the journal."""
    logs = [path.with_name(path.name + end) for end in ("-wal", "-journal")]
    logs = [log for log in logs if log.is_file() and log.stat().st_size]
    if not logs:
        yield path
        return
    with scratch_file(path.name) as (copy, _):
        try:
            for file in (path, *logs):
                shutil.copyfile(file, copy.with_name(file.name))
            with closing(sqlite3.connect(copy)) as database:
                database.execute("PRAGMA journal_mode = DELETE")
                database.execute("SELECT count(*) FROM sqlite_master")
        except sqlite3.Error as error:
            collection.lost(f"the journal of the bag cannot be applied: {first_line(error)}")
        except OSError as error:
            raise collection.error(
                f"cannot copy the bag, which its recorder did not close: {error.strerror}; "
                "free some space, or set TMPDIR"
            ) from None
        else:
            collection.notes["recovered"] = (
                "its recorder did not close the bag; palpate reads a recovered copy"
            )
        yield copy


def _read_sqlite(path: Path, collection: Collection) -> Iterator[float]:
    with _recover_bag(path, collection) as closed:
        # rosbags converts the path to a URI, in which ?, # and % have other meanings.
        bag = Sqlite3Reader(Path(quote(str(closed.absolute()))))
        why = f"{printable(closed.name)} is an SQLite file, but "
        remedy = "copy it again, or recover it with: sqlite3 FILE .recover"
        with collection.request.explain_damage(f"{why}damaged or cut off", remedy, (Exception,)):
            try:
                bag.open()
            except ReaderError:
                raise collection.error(f"{why}not a ROS 2 bag; check what wrote it") from None
        with closing(bag):
            assert bag.dbconn is not None
            most = min(collection.request.largest_block, (1 << 31) - 1)
            bag.dbconn.limit(apsw.SQLITE_LIMIT_LENGTH, most)
            kinds = {}
            for connection in bag.connections:
                form = "ros2idl" if connection.msgdef.format.name == "IDL" else "ros2msg"
                encoding = getattr(connection.ext, "serialization_format", "cdr")
                kinds[connection.id] = str(encoding), form
            messages = bag.messages(bag.connections)
            total = bag.metadata.message_count
            yield from _read_rosbags(bag.connections, kinds, messages, total, collection)


def _read_rosbags(
    connections: Iterable[Any],
    kinds: dict[int, tuple[str, str]],
    messages: Iterator[tuple[Any, int, bytes]],
    total: int,
    collection: Collection,
) -> Iterator[float]:
    """Pass the messages of each connection to its topic, in batches."""
    topics = {}
    waiting: dict[int, tuple[list[bytes], list[int]]] = {}
    for connection in connections:
        definition = (connection.msgdef.data or "").encode()
        topics[connection.id] = collection.topic(
            connection.topic, connection.msgtype, *kinds[connection.id], definition
        )
        waiting[connection.id] = [], []
    size = count = 0

    def flush() -> None:
        for number, (contents, times) in waiting.items():
            topics[number].add(Block.joined(contents, times))
            contents.clear()
            times.clear()

    for connection, time, data in _until_damaged(messages, collection):
        contents, times = waiting[connection.id]
        contents.append(data)
        times.append(time)
        size += len(data)
        count += 1
        if size >= _BATCH:
            flush()
            size = 0
            yield count / max(total, count)
    flush()
    if count != total:
        collection.lost(f"the bag lists {total} messages, but only {count} were read")


def _until_damaged(
    messages: Iterator[tuple[Any, int, bytes]], collection: Collection
) -> Iterator[tuple[Any, int, bytes]]:
    bad = 0
    try:
        for connection, time, data in messages:
            if isinstance(time, int) and isinstance(data, bytes):
                collection.request.check_block(len(data))
                yield connection, time, data
            else:
                bad += 1
    except apsw.TooBigError:
        most = collection.request.largest_block
        collection.lost(f"palpate reads the bag up to a message: {excess('it needs', most, most)}")
    except Exception as error:  # rosbags may raise anything on a damaged file
        collection.lost(f"the bag is damaged; palpate reads it up to there: {first_line(error)}")
    if bad:
        collection.lost(f"{bad} rows of the bag are not messages")


class _Mcap:
    """Reads an MCAP file record by record, up to its end or to a damaged record."""

    def __init__(self, path: Path, collection: Collection) -> None:
        self.path = path
        self.collection = collection
        self.schemas: dict[int, mcap.Schema] = {}
        self.topics: dict[int, Topic] = {}
        self.messages = 0
        self.unpacked = 0  # bytes of chunks
        self.unknown = 0  # messages of channels without a channel record
        self.claimed: int | None = None  # the number of messages that the file states
        self.ended = False

    def read(self) -> Iterator[float]:
        size = self.path.stat().st_size
        position = len(_MAGIC)
        with self.path.open("rb") as file:
            while position < size and not self.ended:
                file.seek(position)
                data = file.read(_WINDOW)
                starts, end = _whole_records(data)
                if not starts and len(data) >= _BEFORE and data[0]:  # longer than the window
                    end = _BEFORE + _LENGTH(data, 1)[0]
                    if end > size - position:
                        break
                    try:
                        self.collection.request.check_block(end)
                    except ValueError as error:
                        self._lost(f"the record at byte {position} is skipped: {error}")
                        position += end
                        continue
                    data += file.read(end - len(data))
                    starts = [0]
                if not starts:
                    break
                self._take(data, starts, end)
                position += end
                yield position / size
        if not self.ended:
            self._lost(
                "the file is cut off (the recorder was probably killed) or damaged at byte "
                f"{position}: palpate uses the {self.messages} messages before it"
            )
        if self.unknown:
            self._lost(f"{self.unknown} messages are on channels that the file does not describe")
        if self.claimed is not None and self.claimed != self.messages:
            self._lost(f"it lists {self.claimed} messages, but {self.messages} were read")

    def _take(self, data: bytes, starts: list[int], end: int) -> None:
        """Process complete records, the messages last: what describes them precedes them."""
        view = np.frombuffer(data, np.uint8)
        begins = np.array(starts, np.int64)
        sizes = np.diff(begins, append=end)
        kinds = view[begins]
        for k in np.flatnonzero(_IS_OTHER[kinds]).tolist():
            self._other(data[starts[k]], data[starts[k] + _BEFORE : starts[k] + sizes[k]])
        is_message = (kinds == Opcode.MESSAGE) & (sizes >= _HEAD.itemsize)
        self._messages(view, begins[is_message], sizes[is_message])

    def _messages(self, view: Bytes, begins: Integers, sizes: Integers) -> None:
        if not len(begins):
            return
        heads = gather(view, begins, _HEAD.itemsize).view(_HEAD)[:, 0]
        self.messages += len(begins)
        for channel in np.unique(heads["f2"]).tolist():
            which = heads["f2"] == channel
            if channel not in self.topics:
                self.unknown += int(which.sum())
                continue
            lengths = sizes[which] - _HEAD.itemsize
            times = heads["f4"][which].astype(np.int64)
            self.topics[channel].add(Block(view, begins[which] + _HEAD.itemsize, lengths, times))

    def _other(self, kind: int, data: bytes) -> None:
        self.ended = self.ended or kind == Opcode.FOOTER
        if kind not in _KINDS:
            return
        try:
            record = _KINDS[kind].read(ReadDataStream(BytesIO(data)))
        except Exception as error:  # mcap may raise anything on a damaged record
            self._lost(f"a record of kind {kind} cannot be read: {first_line(error)}")
            return
        if isinstance(record, mcap.Chunk):
            self._chunk(record)
        elif isinstance(record, mcap.Schema):
            self.schemas[record.id] = record
        elif isinstance(record, mcap.Channel):
            self._channel(record)
        elif isinstance(record, mcap.Statistics):
            self.claimed = record.message_count
        elif isinstance(record, mcap.Metadata):
            for key, text in record.metadata.items():
                name = f"{record.name}.{key}" if record.name else key
                self.collection.note(one_line(name), text)
        else:
            maker = (record.profile, record.library)
            self.collection.note("written as", " by ".join(filter(None, maker)))

    def _chunk(self, chunk: mcap.Chunk) -> None:
        request = self.collection.request
        most = max(request.largest_block, _HIGHEST_RATIO * self.path.stat().st_size)
        try:
            request.check_block(max(chunk.uncompressed_size, len(chunk.data)))
            self.unpacked += chunk.uncompressed_size
            if self.unpacked > most:  # far more than any recording has
                self.ended = True
                raise ValueError(excess("this and all before need", self.unpacked, most))
            data = _unpack_mcap_chunk(chunk)
            starts, end = _whole_records(data)
            if end != chunk.uncompressed_size:
                raise ValueError("it is shorter than stated")
        except Exception as error:  # mcap and the decompressors may raise anything
            start = chunk.message_start_time / 1e9
            span = chunk.message_end_time / 1e9 - start
            self._lost(
                f"a chunk of {span:.3g} s from {start:.3f} s on cannot be read: {first_line(error)}"
            )
        else:
            self._take(data, starts, end)

    def _channel(self, channel: mcap.Channel) -> None:
        if channel.id in self.topics:  # repeated in another chunk or in the summary
            return
        schema = self.schemas.get(channel.schema_id) or mcap.Schema(0, b"", "", "")
        self.topics[channel.id] = self.collection.topic(
            channel.topic, schema.name, channel.message_encoding, schema.encoding, schema.data
        )

    def _lost(self, sentence: str) -> None:
        self.collection.lost(f"{printable(self.path.name)}: {sentence}")


def _unpack_mcap_chunk(chunk: mcap.Chunk) -> bytes:
    """Decompress a chunk, up to the size that it states; raise ValueError if its CRC differs."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, size)
    elif chunk.compression:
        raise ValueError(f"its compression {chunk.compression[:20]!r} is unknown")
    else:
        data = chunk.data
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("its checksum is wrong")
    return data


def _whole_records(data: bytes) -> tuple[list[int], int]:
    """The starts of the complete records of a block of MCAP, and the end of the last."""
    starts: list[int] = []
    position = 0
    last = len(data) - _BEFORE
    while position <= last and data[position]:  # a hole is zeros; no record has the kind 0
        end = position + _BEFORE + _LENGTH(data, position + 1)[0]
        if end > len(data):
            break
        starts.append(position)
        position = end
    return starts, position


#: The MCAP records that palpate reads, besides messages.
_KINDS: dict[int, Any] = {
    Opcode.CHUNK: mcap.Chunk,
    Opcode.SCHEMA: mcap.Schema,
    Opcode.CHANNEL: mcap.Channel,
    Opcode.STATISTICS: mcap.Statistics,
    Opcode.METADATA: mcap.Metadata,
    Opcode.HEADER: mcap.Header,
}
_IS_OTHER = np.isin(np.arange(256), [*_KINDS, Opcode.FOOTER])
_READERS: dict[bytes, Callable[[Path, Collection], Iterator[float]]] = {
    b"#ROSBAG V": _read_ros1,
    b"SQLite format 3\0": _read_sqlite,
    _MAGIC: lambda path, collection: _Mcap(path, collection).read(),
}
