"""What a file may claim: checked against what it holds, before memory is taken for it."""

import stat
from collections.abc import Sequence
from pathlib import Path

from palpate.errors import RecordingError
from palpate.recordings.formats import Request
from palpate.recordings.recording import printable
from palpate.recordings.sources import unreadable

# How much longer than its file an array may be on its own: a channel that rests, and takes no room,
# is as long as those that move, which shrink to a quarter at most.
_RESTING = 4

# What any file may unpack to, bytes: two million samples of four channels.
ALWAYS_ALLOWED = 64 << 20

# Recorded numbers shrink by 2 to 10 times, and where most channels rest, up to some 50; deflate at
# its limit, of nothing but zeros, by 1030.
MOST_EXPANSION = 100


class Budget:
    """The memory that a file may ask for."""

    def __init__(self, file_size: int) -> None:
        self.file_size = file_size
        self.left = most_unpacked(file_size)

    def allows(self, size: int, stored: int) -> bool:
        """Whether so many bytes, which the file stores in that many, may be unpacked."""
        possible = size <= max(most_unpacked(stored), _RESTING * self.file_size)
        if not possible or size > self.left:
            return False
        self.left -= size
        return True


def most_unpacked(stored: int) -> int:
    """Return what so many bytes of a file may unpack to, bytes."""
    return max(ALWAYS_ALLOWED, MOST_EXPANSION * stored)


def regular_size(path: Path) -> int:
    """Return the size of a file that is read at any place, not from its beginning to its end.

    Raises
    ------
    RecordingError
        It cannot be read, is empty, or is a folder, a pipe or a device.
    """
    source = printable(path)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise RecordingError(f"{source}: this is a folder; name a file in it")
        if not stat.S_ISREG(status.st_mode):
            raise RecordingError(
                f"{source}: a file of this format cannot be read from a pipe or a device; save it "
                "to disk first"
            )
        with path.open("rb"):
            pass
    except (OSError, ValueError) as error:
        raise unreadable(source, error) from None
    if not status.st_size:
        raise RecordingError(f"{source}: the file is empty; record or copy it again")
    return status.st_size


def in_words(size: float) -> str:
    """Return a number of bytes as a person says it."""
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if size < 1000 or unit == "TB":
            break
        size /= 1000
    return f"{size:.3g} {unit}" if size < 1000 else f"{size:.0f} {unit}"


def first_line(error: BaseException) -> str:
    """Return what a library says of an error, on one line of bounded length."""
    lines = str(error).strip().splitlines()
    words = " ".join((lines[0] if lines else type(error).__name__).split())
    return words if len(words) <= 160 else f"{words[:159]}…"


def refuse_losses(source: str, losses: Sequence[str], request: Request) -> None:
    """Refuse a damaged file, where that is asked for.

    Raises
    ------
    RecordingError
        Something is lost, and the request is strict.
    """
    if request.strict and losses:
        more = f" (and {len(losses) - 1} more)" if len(losses) > 1 else ""
        raise RecordingError(
            f"{source}: {losses[0]}{more}; without --strict the rest of the file is read"
        )
