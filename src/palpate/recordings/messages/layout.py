"""Messages of one layout, read as arrays: where in them each number stands, and how that is known.

All messages that have the length of the first, and its bytes wherever a byte says how the message
goes on (the kind of encoding, counts of lists, lengths of strings, names), have their numbers in
the same places. So they are one matrix of bytes, and a field is some of its columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

Bytes: TypeAlias = NDArray[np.uint8]
Starts: TypeAlias = NDArray[np.int64]
#: Messages of one length, a row each.
Matrix: TypeAlias = NDArray[np.uint8]


class Leaf(Protocol):
    """A number of a message."""

    def read(self, messages: Matrix) -> NDArray[Any]:
        """Return it of every message."""


@dataclass(frozen=True, slots=True)
class NumberAt:
    """A number of fixed size; its dtype as NumPy writes it: ``<f8``."""

    offset: int
    dtype: str

    def read(self, messages: Matrix) -> NDArray[Any]:
        """Return it of every message, in the order of bytes of this machine."""
        dtype = np.dtype(self.dtype)
        rows, width = messages.shape
        column = np.ndarray((rows,), dtype, messages, self.offset, (width,))
        if dtype.kind == "b":  # any byte but 0 is true, and NumPy takes only 1 for it
            truths: NDArray[np.bool_] = column.view(np.uint8) != 0
            return truths
        found: NDArray[Any] = column.astype(dtype.newbyteorder("="))
        return found


@dataclass(frozen=True, slots=True)
class TimeAt:
    """A time or a duration of two numbers, as whole nanoseconds."""

    seconds: Leaf
    nanoseconds: Leaf

    def read(self, messages: Matrix) -> NDArray[Any]:
        """Return it of every message."""
        seconds = self.seconds.read(messages).astype(np.int64)
        return seconds * 1_000_000_000 + self.nanoseconds.read(messages).astype(np.int64)


@dataclass(frozen=True, slots=True)
class Entity:
    """What has rows of its own: a topic, or one transform of a message that holds several.

    Attributes
    ----------
    name : str
        What follows the topic's name: nothing, or ``[parent>child]``.
    leaves : dict
        A :class:`Leaf` for each path below it: ``wrench.force.x``.
    types : dict
        The type of message that a path begins in, with the field: ``("geometry_msgs/msg/Wrench",
        "force")`` for ``wrench.force``.
    frames : dict
        The coordinate frame that a path such as ``header.frame_id`` holds.
    """

    name: str = ""
    leaves: dict[str, Leaf] = field(default_factory=dict)
    types: dict[str, tuple[str, str]] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class Layout:
    """Where the numbers of a message are.

    Attributes
    ----------
    length : int
        Of the message, in bytes.
    checks : list
        What every message of this layout holds: first byte, and the bytes.
    entities : list of Entity
        What it gives.
    skipped : dict
        Fields that are left out because they are long: path and number of bytes.
    """

    length: int
    checks: list[tuple[int, Bytes]] = field(default_factory=list)
    entities: list[Entity] = field(default_factory=list)
    skipped: dict[str, int] = field(default_factory=dict)

    def check(self, data: bytes | memoryview, start: int, stop: int) -> None:
        """Ask for the bytes of a message to be the same in every other."""
        want = np.frombuffer(data, np.uint8)[start:stop]
        if self.checks and self.checks[-1][0] + len(self.checks[-1][1]) == start:
            start, before = self.checks.pop()
            want = np.concatenate([before, want])
        self.checks.append((start, want.copy()))

    def matches(self, messages: Matrix) -> NDArray[np.bool_]:
        """Which messages, all of its length, are of this layout."""
        same = np.ones(len(messages), bool)
        for start, want in self.checks:
            same &= (messages[:, start : start + len(want)] == want).all(axis=1)
        return same


@dataclass(frozen=True, slots=True)
class Block:
    """Messages of one topic, in a block of bytes.

    Attributes
    ----------
    data : ndarray
        The bytes.
    starts, lengths : ndarray
        Of each message, in bytes.
    times : ndarray
        When each was logged, in nanoseconds.
    """

    data: Bytes
    starts: NDArray[np.int64]
    lengths: NDArray[np.int64]
    times: NDArray[np.int64]

    def message(self, k: int) -> bytes:
        """Return one message."""
        return self.data[self.starts[k] : self.starts[k] + self.lengths[k]].tobytes()

    @classmethod
    def joined(cls, messages: Sequence[bytes], times: Sequence[int]) -> "Block":
        """Return messages that lie apart as a block."""
        lengths = np.fromiter(map(len, messages), np.int64, len(messages))
        data = np.frombuffer(b"".join(messages), np.uint8)
        return cls(data, np.cumsum(lengths) - lengths, lengths, np.array(times, np.int64))


def gather(data: Bytes, starts: NDArray[np.int64], length: int) -> Matrix:
    """Return messages of one length, a row each, that begin anywhere in a block of bytes."""
    if length == 0 or not len(starts):
        return np.empty((len(starts), length), np.uint8)
    windows = np.ndarray((len(data) - length + 1,), f"V{length}", data, 0, (1,))
    return windows[starts].view(np.uint8).reshape(-1, length)
