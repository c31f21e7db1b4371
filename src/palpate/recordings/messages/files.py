"""Files of messages, opened, and times as people read them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from palpate.recordings.messages.collection import Collection
from palpate.recordings.recording import printable
from palpate.recordings.sources import unreadable


@contextmanager
def opened(path: Path, collection: Collection) -> Iterator[BinaryIO]:
    """Open a regular file to read; raise RecordingError where that cannot be."""
    try:
        if path.exists() and not path.is_file():
            raise collection.error("it is not a regular file", "save the recording as a file first")
        with path.open("rb") as file:
            yield file
    except (OSError, ValueError) as error:
        raise unreadable(printable(path), error) from None


def name_of(path: Path) -> str:
    """Return a file's name, without its folder, as text that can be encoded."""
    return printable(Path(path.name))


def span(first: int, last: int) -> str:
    """Return a span of times, in nanoseconds, for a sentence."""
    if first >= last:
        return ""
    return f", {(last - first) / 1e9:.3g} s from {first / 1e9:.3f} s on,"
