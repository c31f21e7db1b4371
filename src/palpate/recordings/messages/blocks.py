"""Messages of one topic, as they lie in a block of bytes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.messages.layout import Bytes


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


def joined(messages: list[bytes], times: list[np.int64]) -> Block:
    """Return messages as a block."""
    lengths = np.array([len(message) for message in messages], np.int64)
    data = np.frombuffer(b"".join(messages), np.uint8)
    return Block(data, np.cumsum(lengths) - lengths, lengths, np.array(times, np.int64))
