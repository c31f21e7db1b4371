"""The one place that writes files: whole or not at all, and never over what is read.

A regular file is replaced in one step, when all of the new one is on disk, and keeps its mode and
owner; symbolic links are followed. Anything else, such as a device or a named pipe, is written
through to.
"""

import errno
import json
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from palpate.errors import RecordingError

_MOST_NAMES = 100_000


def write_bytes(path: Path, content: bytes, inputs: Sequence[Path] = ()) -> None:
    """Write a file.

    Parameters
    ----------
    path : Path
        What to write to.
    content : bytes
        All of it.
    inputs : sequence of Path
        Files that must not be written over.

    Raises
    ------
    RecordingError
        It cannot be written; a regular file that was there is as it was.
    BrokenPipeError
        What it leads to has no reader any more.
    """
    with _os_errors_as_recording_errors(path):
        _refuse_inputs(path, inputs)
        status = _status(path)
        descriptor = _own_descriptor(status)
        if descriptor is not None:
            _write_through(os.dup(descriptor), content)
        elif status is None or stat.S_ISREG(status.st_mode):
            _replace(Path(os.path.realpath(path)), content, status)
        else:
            _write_through(os.open(path, os.O_WRONLY), content)


def write_text(path: Path, text: str, inputs: Sequence[Path] = ()) -> None:
    """Write text as UTF-8, as :func:`write_bytes` does."""
    write_bytes(path, encoded(text), inputs)


def abandon_output() -> None:
    """Let go of standard output, which nobody reads or which is full.

    Else Python would try again on its way out, and complain.
    """
    with suppress(OSError, ValueError, AttributeError):  # it may have no descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def as_json(whole: Mapping[str, Any]) -> str:
    """An object as the text of a file of JSON, a field a line."""
    return json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def encoded(text: str) -> bytes:
    """Text as :func:`write_text` writes it."""
    # A file's name that is not UTF-8 reaches text as surrogates; JSON has the same escapes.
    return text.encode("utf-8", "backslashreplace")


def check_own(folder: Path, names: Iterable[str], own: Callable[[Path], bool]) -> None:
    """Refuse to replace a file in a folder that palpate, as ``own`` says of it, did not write.

    Raises
    ------
    RecordingError
        There is one.
    """
    for path in (folder / name for name in names):
        if path.is_file() and not own(path):
            raise RecordingError(
                f"{path}: palpate did not write this file, or somebody changed it since; name "
                "another folder (-o FOLDER)"
            )


def check_writable(path: Path, inputs: Sequence[Path] = ()) -> None:
    """Say now, before work is done, that a file could not be written.

    Raises
    ------
    RecordingError
        The folder does not exist or cannot be written to, or ``path`` is a folder, protected, or
        one of the ``inputs``.
    """
    with _os_errors_as_recording_errors(path):
        _refuse_inputs(path, inputs)
        status = _status(path)
        if _own_descriptor(status) is not None:
            return
        if status is not None and not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if status is None or stat.S_ISREG(status.st_mode):
            with _beside(Path(os.path.realpath(path))) as temporary:
                temporary.touch(exist_ok=False)
        elif stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))


def check_outputs(outputs: Sequence[Path], inputs: Sequence[Path] = ()) -> None:
    """Check several files at once: each as by :func:`check_writable`, and no two the same.

    Raises
    ------
    RecordingError
        One cannot be written, or two are one file.
    """
    for i, path in enumerate(outputs):
        check_writable(path, inputs)
        if any(_same_file(path, other) for other in outputs[:i]):
            raise RecordingError(f"{path}: two outputs would be this file; name another for one")


def opened_new(path: Path) -> tuple[IO[bytes], Path]:
    """Open a file that was not there, to be written piece by piece; a taken name gets a number.

    Returns
    -------
    tuple
        The file, and its path: ``touch-2.mcap`` where there is a ``touch.mcap``.

    Raises
    ------
    OSError
        It cannot be made.
    """
    for number in range(1, _MOST_NAMES):
        tried = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
        try:
            return tried.open("xb"), tried
        except FileExistsError:
            continue
    raise FileExistsError(errno.EEXIST, "there are too many of its name")


def make_folder(path: Path) -> None:
    """Make a folder, with those above it, and say now whether a file can be written into it.

    Raises
    ------
    RecordingError
        It cannot be made or written to.
    """
    with _os_errors_as_recording_errors(path):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise RecordingError(f"{path}: this is no folder; name another for the files") from None
        with _beside(path / "any") as temporary:
            temporary.touch(exist_ok=False)


@contextmanager
def scratch_file(name: str) -> Iterator[tuple[Path, IO[bytes]]]:
    """Open a new file of this name in a folder of its own; both are gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        path = Path(folder) / name
        with path.open("wb+") as file:
            yield path, file


@contextmanager
def temporary_file(name: str, pieces: Iterable[bytes]) -> Iterator[Path]:
    """Write a file of this name in a folder of its own, which is gone afterwards.

    Parameters
    ----------
    name : str
        Of the file, for what reads files only and knows them by their names.
    pieces : iterable of bytes
        What it holds, one after another.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    with scratch_file(name) as (path, file):
        with _os_errors_as_recording_errors(path):
            file.writelines(pieces)
            file.flush()
        yield path


def is_standard_output(path: Path) -> bool:
    """Whether a path leads to where this process prints, such as ``/dev/stdout``."""
    try:
        return _own_descriptor(path.stat()) == 1
    except (OSError, ValueError):
        return False


def _replace(target: Path, content: bytes, former: os.stat_result | None) -> None:
    if former is not None and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    with _beside(target) as temporary:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            if former is not None:
                _make_like(file.fileno(), former)
            os.fsync(file.fileno())
        temporary.replace(target)
    _sync_folder(target.parent)


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """Name a new file in the same folder; it is gone afterwards, unless it was renamed."""
    temporary = target.parent / f".palpate-{os.urandom(8).hex()}"
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def _make_like(descriptor: int, former: os.stat_result) -> None:
    with suppress(OSError, AttributeError):  # only root gives files away; Windows has no owners
        os.fchown(descriptor, former.st_uid, former.st_gid)
    with suppress(AttributeError):
        os.fchmod(descriptor, stat.S_IMODE(former.st_mode))


def _sync_folder(folder: Path) -> None:
    """Put the new name on disk too, where the system lets a folder be opened."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _write_through(descriptor: int, content: bytes) -> None:
    with os.fdopen(descriptor, "wb", buffering=0) as stream:
        rest = memoryview(content)
        while rest:
            rest = rest[stream.write(rest) :]


def _own_descriptor(status: os.stat_result | None) -> int | None:
    """Standard output or error, where that is the file: opened again it would begin at its top."""
    for descriptor, stream in ((1, sys.stdout), (2, sys.stderr)):
        with suppress(OSError):
            if status is not None and os.path.samestat(os.fstat(descriptor), status):
                if stream is not None:
                    stream.flush()
                return descriptor
    return None


def _status(path: Path) -> os.stat_result | None:
    """What a path leads to; None where that does not exist yet."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _refuse_inputs(path: Path, inputs: Sequence[Path]) -> None:
    if any(_same_file(path, each) for each in inputs):
        raise RecordingError(f"{path}: this file is read; name another one to write to")


def _same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one regular file, there or to be; hard links count."""
    try:
        if one.exists() and other.exists():
            return one.is_file() and one.samefile(other)
        return os.path.realpath(one) == os.path.realpath(other)
    except (OSError, ValueError):  # of no file's name: who opens it says so
        return False


@contextmanager
def _os_errors_as_recording_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (RecordingError, BrokenPipeError):
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {_describe_os_error(path, error)}") from None
    except ValueError as error:  # a name with a null byte, or of a lone surrogate
        raise RecordingError(f"{path!r}: not a file's name: {error}") from None


def _describe_os_error(path: Path, error: OSError) -> str:
    if error.errno == errno.EISDIR:
        return "this is a folder; name a file in it"
    if error.errno == errno.ENOENT:
        folder = Path(os.path.realpath(path)).parent
        return f"the folder {folder} does not exist; make it, or choose another"
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{error.strerror}; make room, or choose another place"
    reason = error.strerror or "cannot be written"
    return f"{reason}; choose a place that can be written to"
