"""From a file to the format that reads it: by its content, else by the suffix of its name."""

import logging
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from palpate.errors import InvalidParameterError, RecordingError
from palpate.recordings.formats import FORMATS, TEXT, Format, Request
from palpate.recordings.recording import Recording, printable
from palpate.recordings.sources import on_disk

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
    strict = request.strict
    with on_disk(file) as (copy, source, lost):
        if lost and strict:
            raise RecordingError(f"{source}: {lost[0]}")
        if copy == file:
            return format_of(file).read(file, request)
        try:
            recording = format_of(copy).read(copy, request)
        except RecordingError as error:  # the name of a copy would tell a person nothing
            raise RecordingError(str(error).replace(printable(copy), source)) from None
        return replace(recording, source=source, losses=[*recording.losses, *lost])


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
    if os.path.isdir(path):  # noqa: PTH112 - Path.is_dir raises where a folder above is closed
        path = path / "metadata.yaml"  # a bag of ROS 2 is a folder
    begin = _beginning(path)
    for each in FORMATS:
        if any(begin.startswith(mark) for mark in each.marks):
            return each
    name = path.name.lower()
    return next((each for each in FORMATS if name.endswith(each.suffixes)), TEXT)


def _beginning(path: Path) -> bytes:
    """The first bytes of a regular file; none of anything else, which may be read but once."""
    try:
        if not path.is_file():
            return b""
        with path.open("rb") as file:
            return file.read(1024)
    except (OSError, ValueError):  # whoever reads it says what is wrong
        return b""
