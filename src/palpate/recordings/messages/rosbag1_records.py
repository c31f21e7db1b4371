"""Records of bags of ROS 1: a head of named fields, then the content, each behind its length.

The format is public (wiki.ros.org/Bags/Format/2.0).
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.messages.layout import Bytes, Entity, Layout, NumberAt, TimeAt, gather
from palpate.recordings.messages.record_starts import Starts, record_starts

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, FILE, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)

_LONGEST_HEAD = 4000  # bytes; a connection's has the topic's name, others some 60

_LENGTH = struct.Struct("<I").unpack_from


@dataclass(frozen=True, slots=True)
class Record:
    """The head of a record.

    Attributes
    ----------
    fields : dict
        Bytes by name.
    begin : int
        Where its content begins, from where it does.
    size : int
        Bytes of content.
    """

    fields: dict[str, bytes]
    begin: int
    size: int

    @property
    def kind(self) -> int:
        """What it is."""
        return self.fields["op"][0]

    def number(self, name: str, form: str) -> int | None:
        """Return a field as a number; None where it is none."""
        try:
            value: int = struct.unpack(form, self.fields[name])[0]
        except (KeyError, struct.error):
            return None
        return value

    def text(self, name: str) -> str:
        """Return a field as text."""
        return self.fields.get(name, b"").decode("utf-8", "replace")


def fields_of(data: bytes) -> dict[str, bytes] | None:
    """Return named fields, each behind its length; None where they are none."""
    fields = {}
    position = 0
    while position < len(data):
        if position + 4 > len(data):
            return None
        size = _LENGTH(data, position)[0]
        name, equals, value = data[position + 4 : position + 4 + size].partition(b"=")
        position += 4 + size
        if not equals or position > len(data):
            return None
        fields[name.decode("utf-8", "replace")] = value
    return fields


def record_in(data: bytes, position: int, room: int) -> Record | None:
    """Return the head of the record that begins at a place; None where none does.

    Parameters
    ----------
    data : bytes
        A block.
    position : int
        The place in it.
    room : int
        Bytes that follow it in the file.
    """
    if position + 8 > len(data):
        return None
    head = _LENGTH(data, position)[0]
    begin = position + 4 + head
    if not 8 <= head <= _LONGEST_HEAD or begin + 4 > len(data) or head + 8 > room:
        return None
    fields = fields_of(data[position + 4 : begin])
    if fields is None or len(fields.get("op", b"")) != 1:
        return None
    if not MESSAGE <= fields["op"][0] <= CONNECTION:
        return None
    return Record(fields, 8 + head, _LENGTH(data, begin)[0])


def size_at(data: bytes, position: int) -> int:
    """Return how many bytes the record has that begins here; 0 where it is not whole."""
    room = len(data) - position
    if room < 8:
        return 0
    head = _LENGTH(data, position)[0]
    if head > _LONGEST_HEAD or head + 8 > room:
        return 0
    size: int = head + 8 + _LENGTH(data, position + 4 + head)[0]
    return size if size <= room else 0


def heads_at(data: bytes, position: int) -> list[tuple[int, int]]:
    """Return which bytes of a record say its size: from where in it, and how many."""
    return [(0, 4), (4 + _LENGTH(data, position)[0], 4)]


def whole_records(data: bytes) -> tuple[Starts, int]:
    """Return where the whole records of a block begin, one after another, and where they end."""
    return record_starts(data, 0, size_at, heads_at)


def candidates(data: bytes) -> list[int]:
    """Return where in a block a record may begin: two short lengths, the second of a field."""
    view = np.frombuffer(data, np.uint8)
    if len(view) < 16:
        return []
    size = len(view) - 8
    found = (view[:size] >= 8) & (view[4 : size + 4] < view[:size])
    for k in (1, 2, 3, 5, 6, 7):
        found &= view[k : size + k] == 0
    where: list[int] = np.flatnonzero(found).tolist()
    return where


@dataclass(frozen=True, slots=True)
class Messages:
    """The messages of a block: where the data of each is, and what stands before it.

    Attributes
    ----------
    others : list of int
        Where records begin that are no messages.
    """

    connections: NDArray[np.uint32]
    times: NDArray[np.int64]
    starts: Starts
    lengths: Starts
    others: list[int]

    def before(self, place: int) -> "Messages":
        """Return those that stand before a place."""
        which = self.starts < place
        return Messages(
            self.connections[which],
            self.times[which],
            self.starts[which],
            self.lengths[which],
            [each for each in self.others if each < place],
        )


def messages_of(data: bytes, starts: Starts) -> Messages:
    """Return what the messages say that are among the records that begin at these places."""
    view = np.frombuffer(data, np.uint8)
    connections = np.zeros(len(starts), np.uint32)
    times = np.zeros(len(starts), np.int64)
    begins = np.zeros(len(starts), np.int64)
    sizes = np.zeros(len(starts), np.int64)
    message = np.zeros(len(starts), bool)
    heads = _lengths(view, starts)
    for head in np.unique(heads).tolist():
        which = np.flatnonzero(heads == head)
        while len(which):
            first = int(starts[which[0]])
            layout = _head_layout(data[first : first + head + 8])
            if layout is None:
                which = which[1:]
                continue
            matrix = gather(view, starts[which], head + 8)
            same = layout.matches(matrix)
            chosen, matrix = which[same], matrix[same]
            leaves = layout.entities[0].leaves
            connections[chosen] = leaves["conn"].read(matrix)
            times[chosen] = leaves["time"].read(matrix)
            sizes[chosen] = leaves["size"].read(matrix)
            begins[chosen] = starts[chosen] + head + 8
            message[chosen] = True
            which = which[~same]
    others: list[int] = starts[~message].tolist()
    return Messages(connections[message], times[message], begins[message], sizes[message], others)


def _head_layout(head: bytes) -> Layout | None:
    """Where in the head of a message its connection, its time and its size are; None of others."""
    fields = fields_of(head[4:-4])
    if fields is None or fields.get("op") != bytes([MESSAGE]):
        return None
    layout = Layout(len(head))
    entity = Entity()
    layout.entities.append(entity)
    position = 4
    layout.check(head, 0, 4)
    for name, value in fields.items():
        begin = position + 4 + len(name.encode()) + 1
        position = begin + len(value)
        if name == "conn" and len(value) == 4:
            entity.leaves[name] = NumberAt(begin, "<u4")
        elif name == "time" and len(value) == 8:
            entity.leaves[name] = TimeAt(NumberAt(begin, "<u4"), NumberAt(begin + 4, "<u4"))
        else:
            layout.check(head, begin, position)
        layout.check(head, begin - len(name.encode()) - 5, begin)
    entity.leaves["size"] = NumberAt(len(head) - 4, "<u4")
    return layout if entity.leaves.keys() >= {"conn", "time"} else None


def _lengths(view: Bytes, starts: Starts) -> Starts:
    if not len(starts):
        return np.empty(0, np.int64)
    anywhere = np.ndarray((len(view) - 3,), "<u4", view, 0, (1,))
    return anywhere[starts].astype(np.int64)
