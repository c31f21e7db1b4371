"""What every reader asks of a file, and how it says that something is lost."""

import stat
from collections.abc import Sequence
from pathlib import Path

from palpate.errors import RecordingError
from palpate.recordings.formats import Request
from palpate.recordings.recording import printable

#: What a file, or a part of it, may unpack to or claim, bytes: beyond that no recording goes, and
#: a damaged size does.
LARGEST = 8 << 30


def regular_size(path: Path, source: str = "") -> int:
    """Return the size of a file that is read at any place, not from its beginning to its end.

    Raises
    ------
    RecordingError
        It cannot be read, is empty, or is a folder or a device.
    """
    source = source or printable(path)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise RecordingError(f"{source}: this is a folder; name a file in it")
        if not stat.S_ISREG(status.st_mode):
            raise RecordingError(
                f"{source}: this is a device or a socket, which no recording is read from; write "
                "it to a file"
            )
        with path.open("rb"):
            pass
    except (OSError, ValueError) as error:
        raise unreadable(source, error) from None
    if not status.st_size:
        raise RecordingError(f"{source}: the file is empty; record or copy it again")
    return status.st_size


def unreadable(source: str, error: Exception) -> Exception:
    """Return the error of a file that the system does not let read; any other error as it is.

    A ValueError is the system's only where it is about a zero byte in the name.
    """
    if not isinstance(error, OSError) and "embedded null" not in str(error):
        return error
    reason = getattr(error, "strerror", None) or "cannot be read"
    return RecordingError(f"{source}: {reason}; check the path")


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
