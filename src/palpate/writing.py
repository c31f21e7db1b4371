"""Files written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from palpate.errors import RecordingError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a file to write beside ``path``, which takes its place when all went well.

    Raises
    ------
    RecordingError
        The folder cannot be written to.
    """
    try:
        with tempfile.NamedTemporaryFile(
            dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix, delete=False
        ) as part:
            temporary = Path(part.name)
        try:
            yield temporary
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingError(_unwritable(path, error)) from None


def check_writable(path: Path) -> None:
    """Say now, before work is done, that a file could not be written.

    Raises
    ------
    RecordingError
        The folder does not exist or cannot be written to, or ``path`` is a folder.
    """
    if path.is_dir():
        raise RecordingError(f"{path}: this is a folder; name a file in it")
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.stem}-"):
            pass
    except OSError as error:
        raise RecordingError(_unwritable(path, error)) from None


def make_folder(path: Path) -> None:
    """Make a folder, with those above it, and say now whether a file can be written into it.

    Raises
    ------
    RecordingError
        It cannot be made or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path):
            pass
    except OSError as error:
        raise RecordingError(_unwritable(path, error)) from None


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _unwritable(path: Path, error: OSError) -> str:
    reason = error.strerror or "cannot be written"
    return f"{path}: {reason}; choose a folder that exists and can be written to"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
