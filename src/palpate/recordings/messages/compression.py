"""Compressed blocks, unpacked to no more than a recording can hold."""

import bz2

import lz4.frame
import zstandard

from palpate.recordings.messages.fields import UndecodableError

# Messages of a robot that stands still, with but their stamps changing, are packed 14 times at the
# most (zstd, level 19); lists of zeros, such as an image with the cap on, without a limit. So a
# block may always unpack to 16 MiB, 4 times the largest that ROS 2 writes, and beyond that to 64
# times its size.
RATIO = 64
ALLOWANCE = 16 << 20
# No writer makes a chunk, or a message, of a tenth of this.
LARGEST = 1 << 30

_PIECE = 1 << 17
ZSTD = b"\x28\xb5\x2f\xfd"  # what its blocks begin with


class Budget:
    """How much the blocks of a file may come to: each, and all together.

    Parameters
    ----------
    file_size : int
        In bytes.
    """

    def __init__(self, file_size: int) -> None:
        self.left = 4 * ALLOWANCE + RATIO * file_size

    def add(self, size: int) -> None:
        """Take into account that there are more bytes."""
        self.left += RATIO * size

    def allow(self, packed: int, unpacked: int) -> None:
        """Take a block into account; raise UndecodableError where it is too much."""
        if max(packed, unpacked) > LARGEST:
            raise UndecodableError(f"{packed} bytes that unpack to {unpacked} are too many")
        if unpacked > max(ALLOWANCE, RATIO * packed):
            raise UndecodableError(f"{packed} bytes claim to unpack to {unpacked}")
        self.left -= unpacked
        if self.left < 0:
            raise UndecodableError(f"the file unpacks to more than {RATIO} times its size")


def unpack(kind: str, data: bytes, size: int) -> bytes:
    """Return a block that is known to unpack to so many bytes.

    Raises
    ------
    UndecodableError
        It does not, or its compression is not known.
    """
    if kind in ("", "none"):
        found = data
    elif kind == "zstd" and zstandard_size(data) == size:
        try:
            found = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        except zstandard.ZstdError as error:
            raise UndecodableError(f"it does not unpack: {error}") from None
    else:
        found = unpack_begin(kind, data, size + 1)
    if len(found) != size:
        raise UndecodableError("it does not unpack to the size that it claims")
    return found


def unpack_begin(kind: str, data: bytes, most: int) -> bytes:
    """Return what the beginning of a block unpacks to, no more than asked."""
    if kind in ("", "none"):
        return data[:most]
    if kind == "zstd":
        return _zstd_begin(data, most)
    if kind == "lz4":
        stream = lz4.frame.LZ4FrameDecompressor()
    elif kind == "bz2":
        stream = bz2.BZ2Decompressor()
    else:
        raise UndecodableError(f"its compression is {kind[:20]!r}, not zstd, lz4 or bz2")
    pieces = []
    have = 0
    try:
        while have < most and not stream.eof:
            piece = stream.decompress(data, min(most - have, 64 * _PIECE))
            if not piece and stream.needs_input:
                break
            data = b""
            pieces.append(piece)
            have += len(piece)
    except (RuntimeError, OSError, EOFError, ValueError):  # what was unpacked before stands
        pass
    return b"".join(pieces)


def zstandard_size(data: bytes) -> int:
    """Return how many bytes a block says that it unpacks to; -1 where it does not say."""
    try:
        return int(zstandard.frame_content_size(data))
    except zstandard.ZstdError:
        return -1


def _zstd_begin(data: bytes, most: int) -> bytes:
    pieces = []
    try:
        with zstandard.ZstdDecompressor().stream_reader(data) as stream:
            while most > 0 and (piece := stream.read(min(most, _PIECE))):
                pieces.append(piece)
                most -= len(piece)
    except zstandard.ZstdError:  # what was unpacked before stands
        pass
    return b"".join(pieces)
