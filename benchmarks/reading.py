"""Reading recordings of messages, compared with the packages ``mcap`` and ``rosbags``.

``python -m benchmarks.reading --minutes 60`` writes wrenches and poses at 1 kHz, reads them each
way, alternately and in separate processes, and prints a table. It is far larger than the other
benchmarks: an hour is 7.2 million messages, and takes a quarter of an hour and 4 GB of disk.
"""

import struct
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.common.report import (
    describe_machine,
    list_facts,
    markdown_table,
    run_command,
    show,
)
from benchmarks.common.timing import resident
from benchmarks.common.workers import in_new_process
from palpate.input.recordings import open_recording

SEED = 1
BEGIN = 1_700_000_000_000_000_000  # ns since 1970
STEP = 1_000_000
WRENCH, POSE = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PoseStamped"
_PIECE = 10_000  # messages whose numbers are generated at once
OURS = "palpate, to arrays"
Rows = list[list[str]]
Sent = tuple[bool, int, bytes]  # whether it is a wrench, its time, its bytes


def messages(minutes: float) -> Iterator[Sent]:
    """Yield wrenches and poses in CDR, 300 µs apart, as a driver at 1 kHz sends them."""
    random = np.random.default_rng(SEED)
    count = int(minutes * 60_000)
    for first in range(0, count, _PIECE):
        numbers = random.normal(size=(min(_PIECE, count - first), 13))
        for k, row in enumerate(numbers, start=first):
            at = BEGIN + k * STEP
            yield True, at, stamped(at, is_wrench=True) + row[:6].tobytes()
            yield False, at + 300_000, stamped(at, is_wrench=False) + row[6:].tobytes()


def stamped(at: int, *, is_wrench: bool) -> bytes:
    """Return the start of a message in CDR: its header."""
    frame = b"\x08\0\0\0ft_link\0" + bytes(4) if is_wrench else b"\x05\0\0\0base\0" + bytes(7)
    return b"\0\1\0\0" + struct.pack("<iI", *divmod(at, 1_000_000_000)) + frame


def write_mcap(
    path: Path, given: Iterable[Sent], *, compressed: bool = True, chunks: bool = True
) -> None:
    """Write them by the ``mcap`` package."""
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    compression = CompressionType.ZSTD if compressed else CompressionType.NONE
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, use_chunking=chunks)
        writer.start("ros2")
        channels = []
        for topic, name in (("/ft", WRENCH), ("/pose", POSE)):
            text, _ = store.generate_msgdef(name, ros_version=2)
            schema = writer.register_schema(name, "ros2msg", text.encode())
            channels.append(writer.register_channel(topic, "cdr", schema))
        for is_wrench, at, data in given:
            writer.add_message(channels[0 if is_wrench else 1], at, data, at)
        writer.finish()  # type: ignore[no-untyped-call]


def write_rosbag2(path: Path, given: Iterable[Sent]) -> None:
    """Write them by rosbags, into SQLite."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9) as writer:
        wrench = writer.add_connection("/ft", WRENCH, typestore=store)
        pose = writer.add_connection("/pose", POSE, typestore=store)
        for is_wrench, at, data in given:
            writer.write(wrench if is_wrench else pose, at, data)


def write_rosbag1(path: Path, given: Iterable[Sent]) -> None:
    """Write them by rosbags, as a ROS 1 bag, whose messages have a count and no padding."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        wrench = writer.add_connection("/ft", WRENCH, typestore=store)
        pose = writer.add_connection("/pose", POSE, typestore=store)
        for k, (is_wrench, at, data) in enumerate(given):
            frame = b"ft_link" if is_wrench else b"base"
            head = struct.pack("<I", k) + data[4:12] + struct.pack("<I", len(frame)) + frame
            writer.write(wrench if is_wrench else pose, at, head + data[28:])


def by_palpate(path: Path) -> tuple[int, int]:
    """Return how many messages were read, and the bytes of the arrays."""
    found = open_recording(path)
    count = len(found.channels["/ft.log_time"]) + len(found.channels["/pose.log_time"])
    return count, sum(values.nbytes for values in found.channels.values())


def by_mcap(path: Path) -> tuple[int, int]:
    """Raw messages by the reader of the ``mcap`` package, in the order of the file."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages(log_time_order=False)), 0


def by_mcap_stream(path: Path) -> tuple[int, int]:
    """Raw messages by its stream reader, the fastest."""
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    with path.open("rb") as file:
        return sum(isinstance(record, Message) for record in StreamReader(file).records), 0


def by_rosbags(path: Path) -> tuple[int, int]:
    """Raw messages by rosbags."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    with Reader1(path) if path.suffix == ".bag" else Reader2(path) as reader:
        return sum(1 for _ in reader.messages()), 0


def by_rosbags_decoded(path: Path) -> tuple[int, int]:
    """Messages by rosbags, each decoded."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        count = 0
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            count += 1
    return count, 0


def by_mcap_decoded(path: Path) -> tuple[int, int]:
    """Messages by the ``mcap`` package and its support of ROS 2, each decoded."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return sum(1 for _ in reader.iter_decoded_messages(log_time_order=False)), 0


READERS: dict[str, Callable[[Path], tuple[int, int]]] = {
    OURS: by_palpate,
    "mcap, raw messages": by_mcap,
    "mcap, raw records of its stream reader": by_mcap_stream,
    "mcap and mcap-ros2-support, decoded": by_mcap_decoded,
    "rosbags, raw messages": by_rosbags,
    "rosbags, decoded": by_rosbags_decoded,
}
write_loose_mcap = partial(write_mcap, compressed=False, chunks=False)
#: Files: name, writer, and whose packages read it.
KINDS: dict[str, tuple[str, Callable[[Path, Iterable[Sent]], None], str]] = {
    "MCAP, zstd": ("zstd.mcap", partial(write_mcap, compressed=True), "mcap"),
    "MCAP, not compressed": ("plain.mcap", partial(write_mcap, compressed=False), "mcap"),
    "MCAP, no chunks": ("loose.mcap", write_loose_mcap, "mcap"),
    "ROS 2 bag, SQLite": ("bag", write_rosbag2, "rosbags"),
    "ROS 1 bag": ("one.bag", write_rosbag1, "rosbags"),
}


def timed(reader: str, path: Path) -> tuple[float, float, float, float]:
    """Read once; return seconds, messages, bytes of the arrays and of the peak."""
    import palpate.input.recordings.messages.containers  # noqa: F401 - importing is not reading

    before = resident("VmRSS")
    begin = time.perf_counter()
    count, size = READERS[reader](path)
    seconds = time.perf_counter() - begin
    return seconds, count, size, resident("VmHWM") - before


def measure(kind: str, folder: Path, minutes: float, rounds: int, *, decoded: bool) -> Rows:
    """Write a file, read it each way alternately, each time in a new process."""
    name, write, package = KINDS[kind]
    write(folder / name, messages(minutes))
    readers = [each for each in READERS if each.startswith(("palpate", package))]
    readers = [each for each in readers if decoded or "decoded" not in each]
    turns = [
        {each: in_new_process(timed, each, folder / name) for each in readers}
        for _ in range(rounds)
    ]
    best = {each: min(turn[each] for turn in turns) for each in readers}
    ours, rows = best[OURS], []
    for reader, (seconds, count, size, peak) in best.items():
        assert count == ours[1], (reader, count)
        ratio = "" if reader == OURS else f"{ours[0] / seconds:.2f}"
        memory = f"{peak / size:.2f}" if size else ""
        per_message = f"{1e6 * seconds / count:.2f}"
        rows.append([kind, reader, f"{seconds:.2f}", per_message, ratio, memory])
    return rows


def main(
    *,
    minutes: float = 1.0,
    rounds: int = 2,
    decoded: bool = False,
) -> None:
    """Measure all kinds of files.

    Parameters
    ----------
    minutes
        Duration of a recording.
    rounds
        Turns of each reader.
    decoded
        The others decode, too: slow.
    """
    rows: Rows = []
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as scratch:
            rows += measure(kind, Path(scratch), minutes, rounds, decoded=decoded)
    headings = ("s", "µs a message", "palpate's time / this one's", "peak / arrays")
    words = f"{minutes:g} minutes of wrench and pose at 1 kHz, seed {SEED}"
    table = markdown_table(("file", "reader", *headings), rows)
    show([words, "", *table, "", *list_facts(describe_machine())])


if __name__ == "__main__":
    run_command(main)
