"""From a file to the format that reads it: by its content, else by the suffix of its name."""

import logging
import os
import stat
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import IO

from palpate.errors import InvalidParameterError, RecordingError
from palpate.recordings.bounds import LARGEST, regular_size, unreadable
from palpate.recordings.formats import FORMATS, TEXT, Format, Request
from palpate.recordings.recording import Recording, printable
from palpate.writing import scratch_file

_LOGGER = logging.getLogger(__name__)


def open_recording(
    path: str | os.PathLike[str],
    channels: Sequence[str] | None = None,
    *,
    strict: bool = False,
    curve: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Read a file as it is.

    Parameters
    ----------
    path : str or path-like
        The file; ``-`` is standard input. Its format is known by its content, else by the suffix of
        its name; what is neither is read as text.
    channels : sequence of str, optional
        Read these only: whole names, or a topic or group with all below it, such as ``"/ft"``.
        Unless given, all that hold numbers.
    strict : bool
        Refuse a file that is damaged, where else what can be read of it is, and
        ``Recording.losses`` says what could not.
    curve : int, optional
        Which curve, from 0, of a file that holds many.
    progress : callable, optional
        Called now and then with the fraction that has been read.

    Raises
    ------
    RecordingError
        The file cannot be read, or is not of the format that it seems to be.
    MissingExtraError
        The packages that read the format are not installed: the message says how.
    """
    try:
        file = Path(path)
        wanted = None if channels is None else tuple(channels)
    except TypeError:
        raise InvalidParameterError(f"path must be a path, not {path!r}") from None
    if curve is not None and curve < 0:
        raise InvalidParameterError(f"curve must be counted from 0, not {curve}")
    begun = time.perf_counter()
    recording = _read(file, Request(wanted, strict, curve, progress))
    _log(recording, time.perf_counter() - begun)
    return recording


def _read(file: Path, request: Request) -> Recording:
    standard = str(file) == "-"
    if not standard and not _is(stat.S_ISFIFO, file):
        if not _is(stat.S_ISDIR, file):  # a bag of ROS 2 is one
            regular_size(file)
        return format_of(file).read(file, request)
    source = "standard input" if standard else printable(file)
    # The suffix stays, for the format may be known by that only.
    with scratch_file(f"recording{file.suffix}") as (copy, content):
        _copy_stream(file, source, content)
        regular_size(copy, source)
        try:
            recording = format_of(copy).read(copy, request)
        except RecordingError as error:  # the name of a copy would tell a person nothing
            raise RecordingError(str(error).replace(printable(copy), source)) from None
    return replace(recording, source=source)


def _is(kind: Callable[[int], bool], path: Path) -> bool:
    try:
        return kind(path.stat().st_mode)
    except (OSError, ValueError):  # whoever reads it says what is wrong
        return False


def _copy_stream(file: Path, source: str, content: IO[bytes]) -> None:
    """Copy what standard input (``-``) or a pipe gives until its end."""
    standard = nullcontext(getattr(sys.stdin, "buffer", None))
    try:
        with standard if str(file) == "-" else file.open("rb") as stream:
            if stream is None or stream.isatty():  # closed, that of a notebook, or a terminal
                raise RecordingError(f"{source}: nothing can be read from it here; name a file")
            while chunk := stream.read(1 << 20):
                content.write(chunk)
                if content.tell() > LARGEST:
                    raise RecordingError(
                        f"{source}: more than {LARGEST >> 30} GiB came; write it to a file, and "
                        "name that"
                    )
        content.flush()
    except OSError as error:
        raise unreadable(source, error) from None


def _log(recording: Recording, seconds: float) -> None:
    """Say what was read, and how long that took."""
    if not _LOGGER.isEnabledFor(logging.INFO):
        return
    sizes = {len(values) for values in recording.channels.values()}
    samples = " or ".join(map(str, sorted(sizes)[:3])) or "no"
    _LOGGER.info(
        "read %s: %d channels of %s samples, %.4f s",
        recording.source,
        len(recording.channels),
        samples,
        seconds,
    )
    for name, values in recording.channels.items():
        unit = recording.units.get(name) or "unit not said"
        _LOGGER.debug("channel %s: %s, %d samples, %s", name, values.dtype, len(values), unit)


def format_of(path: Path) -> Format:
    """Return the format of a file; text where it is none that is known."""
    begin = b""
    if _is(stat.S_ISDIR, path):
        path = path / "metadata.yaml"  # a bag of ROS 2 is a folder
    else:
        with path.open("rb") as file:
            begin = file.read(64)
    name = path.name.lower()
    marked = (each for each in FORMATS if begin.startswith(each.marks))
    named = (each for each in FORMATS if name.endswith(each.suffixes))
    return next(marked, None) or next(named, TEXT)
