"""The one module that writes files: completely or not at all, and never over an input file.

It replaces a regular file in one step, once the new content is on disk, keeps mode and owner, and
follows symbolic links. It writes directly to anything else, such as a device or a named pipe.
"""

import errno
import io
import json
import os
import re
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from palpate.errors import RecordingError

_MOST_NAMES = 100_000
#: The begin of files that palpate may replace.
MADE = "# made by palpate"
# Identities of the files and folders that the running command reads.
_protected: set[object] = set()
# Control characters and signs that turn the direction of text: a file name or a note may contain
# them, TOML forbids some even in a comment, and a terminal or an editor would obey them.
_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
#: Signs with which Markdown begins a tag, a cell, a link or code.
_MARKDOWN = str.maketrans({sign: f"\\{sign}" for sign in "\\<|[`"})


@contextmanager
def protect(inputs: Iterable[Path]) -> Iterator[None]:
    """Refuse, inside the block, each output that is one of these files or lies in such a folder."""
    added = _identities(inputs) - _protected
    _protected.update(added)
    try:
        yield
    finally:
        _protected.difference_update(added)


def write_bytes(path: Path, content: bytes, inputs: Sequence[Path] = ()) -> None:
    """Write a file.

    Parameters
    ----------
    path : Path
        The file.
    content : bytes
        The complete content.
    inputs : sequence of Path
        Files that must not be overwritten, and folders that must not be written into.

    Raises
    ------
    RecordingError
        The file cannot be written; an existing regular file is unchanged.
    BrokenPipeError
        The reader of the pipe has closed it.
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
    write_bytes(path, encode_text(text), inputs)


def abandon_output() -> None:
    """Redirect standard output to nowhere, because its reader is gone or its disk is full.

    Otherwise Python tries to flush it again at exit and prints an error.
    """
    with suppress(OSError, ValueError, AttributeError):  # it may have no descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def as_json(whole: Mapping[str, Any]) -> str:
    """An object as the text of a JSON file, one field per line."""
    return json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def as_toml(options: Mapping[str, Any], comments: Iterable[str]) -> str:
    """Return options as the text of a TOML file, with comments below them.

    Parameters
    ----------
    options : mapping
        Values by option name, without leading dashes.
    comments : iterable of str
        One line each.
    """
    lines = [MADE, *(f"{name} = {_toml_value(value)}" for name, value in options.items())]
    lines += [""] if options else []
    lines += [f"# {_escape_signs(' '.join(comment.split()))}" for comment in comments]
    return "\n".join(lines) + "\n"


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{name} = {_toml_value(each)}' for name, each in value.items())}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(_toml_value(each) for each in value)}]"
    if isinstance(value, int | float):
        return repr(value)
    return quote(str(value))


def quote(text: str) -> str:
    """Return text in quotation marks, as JSON, TOML and YAML read it."""
    # JSON's escapes are valid in all three, except those of characters beyond 16 bits.
    return _escape_signs(json.dumps(text, ensure_ascii=False))


def escape_markdown(text: str) -> str:
    """Return a line that Markdown shows as it is, without tags, cells, links or code."""
    return " ".join(text.split()).translate(_MARKDOWN)


def encode_text(text: str) -> bytes:
    """The bytes that :func:`write_text` writes: unprintable signs are escaped."""
    # A file name that is not UTF-8 contains surrogates; JSON has the same escapes.
    return _escape_signs(text).encode("utf-8", "backslashreplace")


def _escape_signs(text: str) -> str:
    return _UNPRINTABLE.sub(lambda sign: f"\\u{ord(sign[0]):04x}", text)


def check_own(
    folder: Path,
    names: Iterable[str],
    own: Callable[[Path], bool],
    remedy: str = "choose another name or folder (-o)",
) -> None:
    """Check that palpate wrote each file that it would replace in a folder.

    Raises
    ------
    RecordingError
        ``own`` is false for one of them.
    """
    for path in (folder / name for name in names):
        if path.is_file() and not own(path):
            raise RecordingError(
                f"{path}: palpate did not write this file, or it was changed since; {remedy}"
            )


def check_marked(path: Path, mark: str = MADE) -> None:
    """Check that a file can be written, and that it is new, empty or begins with palpate's mark.

    Raises
    ------
    RecordingError
        It cannot be written, or palpate did not write it.
    """

    def own(former: Path) -> bool:
        with former.open("rb") as file:
            return file.read(len(mark)) in (b"", mark.encode())

    check_writable(path)
    check_own(path.parent, [path.name], own, "choose another name")


def check_writable(path: Path, inputs: Sequence[Path] = ()) -> None:
    """Check before any work is done that a file can be written.

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
            with _name_temporary_file(Path(os.path.realpath(path))) as temporary:
                temporary.touch(exist_ok=False)
        elif stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))


def check_outputs(outputs: Sequence[Path], inputs: Sequence[Path] = ()) -> None:
    """Check several files by :func:`check_writable`, and that no two are the same.

    Raises
    ------
    RecordingError
        One cannot be written, or two are one file.
    """
    for i, path in enumerate(outputs):
        check_writable(path, inputs)
        if any(_same_file(path, output) for output in outputs[:i]):
            raise RecordingError(f"{path}: two outputs name this file; rename one of them")


def create_new_file(path: Path) -> tuple[IO[bytes], Path]:
    """Create a file to be written piece by piece; if its name is taken, append a number.

    Returns
    -------
    tuple
        The file, and its path: ``touch-2.mcap`` where there is a ``touch.mcap``.

    Raises
    ------
    OSError
        The file cannot be created.
    """
    for number in range(1, _MOST_NAMES):
        tried = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
        try:
            return tried.open("xb"), tried
        except FileExistsError:
            continue
    raise FileExistsError(errno.EEXIST, "too many files have this name")


def make_folder(path: Path) -> None:
    """Create a folder and its parents, and check that a file can be written into it.

    Raises
    ------
    RecordingError
        The folder cannot be created or written to.
    """
    with _os_errors_as_recording_errors(path):
        _refuse_inputs(path, ())
        try:
            path.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise RecordingError(f"{path}: this is not a folder; choose another name") from None
        with _name_temporary_file(path / "any") as temporary:
            temporary.touch(exist_ok=False)


@contextmanager
def scratch_file(name: str) -> Iterator[tuple[Path, IO[bytes]]]:
    """Open a new file of this name in a temporary folder, and delete both afterwards."""
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        path = Path(folder) / name
        with path.open("wb+") as file:
            yield path, file


@contextmanager
def temporary_file(name: str, pieces: Iterable[bytes]) -> Iterator[Path]:
    """Write a temporary file for a library that reads only files, and delete it afterwards.

    Parameters
    ----------
    name : str
        Name of the file; the library may need its suffix.
    pieces : iterable of bytes
        The content, in order.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    with scratch_file(name) as (path, file):
        with _os_errors_as_recording_errors(path):
            file.writelines(pieces)
            file.flush()
        yield path


def is_standard_output(path: Path) -> bool:
    """Whether a path is this process's standard output, such as ``/dev/stdout``."""
    try:
        return _own_descriptor(path.stat()) == 1
    except (OSError, ValueError):
        return False


def _replace(target: Path, content: bytes, former: os.stat_result | None) -> None:
    if former is not None and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    with _name_temporary_file(target) as temporary:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            if former is not None:
                _make_like(file.fileno(), former)
            os.fsync(file.fileno())
        temporary.replace(target)
    _sync_folder(target.parent)


@contextmanager
def _name_temporary_file(target: Path) -> Iterator[Path]:
    """Name a new file in the same folder; delete it afterwards unless it was renamed."""
    temporary = target.parent / f".palpate-{os.urandom(8).hex()}"
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def _make_like(descriptor: int, former: os.stat_result) -> None:
    with suppress(OSError, AttributeError):  # only root may change owners; Windows has none
        os.fchown(descriptor, former.st_uid, former.st_gid)
    with suppress(AttributeError):
        os.fchmod(descriptor, stat.S_IMODE(former.st_mode))


def _sync_folder(folder: Path) -> None:
    """Flush the new name to disk too, if the system can open a folder."""
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
    """The descriptor if the file is standard output or error: reopening it would rewind it."""
    for descriptor, stream in ((1, sys.stdout), (2, sys.stderr)):
        with suppress(OSError):
            if status is not None and os.path.samestat(os.fstat(descriptor), status):
                if stream is not None:
                    stream.flush()
                return descriptor
    return None


def _status(path: Path) -> os.stat_result | None:
    """The status of the file; None if it does not exist yet."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _refuse_inputs(path: Path, inputs: Sequence[Path]) -> None:
    taken = _protected | _identities(inputs)
    target = Path(os.path.realpath(path))
    if _identities([target]) & taken:
        raise RecordingError(f"{path}: this is an input file; choose another name for the output")
    if _identities(target.parents) & taken:
        raise RecordingError(f"{path}: this is inside an input folder; choose another folder")


def _identities(paths: Iterable[Path]) -> set[object]:
    """Return device and inode of files and folders, the same for all links; else their names."""
    found: set[object] = set()
    for path in paths:
        with suppress(OSError, ValueError):  # not a file name: opening it raises the error
            status = _status(path)
            if status is None:
                found.add(os.path.realpath(path))
            elif stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode):
                found.add((status.st_dev, status.st_ino))
    return found


def _same_file(one: Path, other: Path) -> bool:
    """Whether two paths are one regular file, existing or not; hard links count."""
    try:
        if one.exists() and other.exists():
            return one.is_file() and one.samefile(other)
        return os.path.realpath(one) == os.path.realpath(other)
    except (OSError, ValueError):  # not a file name: opening it raises the error
        return False


@contextmanager
def _os_errors_as_recording_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (RecordingError, BrokenPipeError):
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {_describe_os_error(path, error)}") from None
    except ValueError as error:  # a name with a null byte or a lone surrogate
        raise RecordingError(f"{path!r}: not a valid file name: {error}") from None


def _describe_os_error(path: Path, error: OSError) -> str:
    if error.errno == errno.EISDIR:
        return "this is a folder; name a file in it"
    if error.errno == errno.ENOENT:
        folder = Path(os.path.realpath(path)).parent
        return f"the folder {folder} does not exist; create it or choose another"
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{error.strerror}; free some space or choose another place"
    reason = error.strerror or "cannot be written"
    return f"{reason}; choose a writable place"


# Tables of numbers as text.


def begin_table(notes: Mapping[str, str], names: Iterable[str]) -> io.StringIO:
    """Return a text buffer that begins with the notes and the names of the columns."""
    text = io.StringIO()
    for name, note in notes.items():
        text.write(f"# {name}: {' '.join(note.split())}\n")
    text.write(",".join(names) + "\n")
    return text


def write_formatted(
    columns: Mapping[str, tuple[Any, str]],
    path: Path,
    notes: Mapping[str, str],
) -> None:
    """Write notes and arrays as CSV, each column in a format such as ``"%.9g"``."""
    import numpy as np  # not needed for --help

    text = begin_table(notes, columns)
    table = np.column_stack([values for values, _ in columns.values()])
    np.savetxt(text, table, fmt=[form for _, form in columns.values()], delimiter=",")
    write_text(path, text.getvalue())
