"""Recordings opened, by the formats that can be read, and contacts written."""

import io
import logging
import os
import stat
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, RecordingError, needed
from palpate.findings import Finding
from palpate.recordings.recording import Faults, Recording, printable
from palpate.writing import scratch_file, write_bytes, write_text

_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of a reader.

    Attributes
    ----------
    channels : tuple of str, optional
        Read these only: whole names, or what names begin with, such as ``"/ft"``. None: all that
        hold numbers.
    strict : bool
        Refuse what cannot be read, where else it would be left out and said.
    curve : int, optional
        Which curve of a file that holds many, from 0.
    progress : callable, optional
        Called now and then with the fraction that has been read, 0 to 1.
    """

    channels: tuple[str, ...] | None = None
    strict: bool = False
    curve: int | None = None
    progress: Callable[[float], None] | None = None

    def wants(self, name: str) -> bool:
        """Whether a channel, or any below a topic or a group, is asked for."""
        return self.channels is None or any(
            within(name, wanted) or within(wanted, name) for wanted in self.channels
        )

    def report(self, fraction: float) -> None:
        """Say how much has been read, to whoever asked."""
        if self.progress is not None:
            self.progress(min(max(fraction, 0.0), 1.0))


@dataclass(frozen=True, slots=True)
class Format:
    """A format of files.

    Attributes
    ----------
    name : str
        For a person.
    suffixes : tuple of str
        What names of its files end with, in lower case.
    module : str
        Its whole name; its ``read(path, request)`` returns a :class:`Recording`.
    marks : tuple of bytes
        What its files begin with: content comes before the suffix.
    extra : str, optional
        Of ``pyproject.toml``, where it takes packages that palpate alone does not need.
    """

    name: str
    suffixes: tuple[str, ...]
    module: str
    marks: tuple[bytes, ...] = ()
    extra: str | None = None

    def read(self, path: Path, request: Request) -> Recording:
        """Read a file by its module.

        Raises
        ------
        MissingExtraError
            A package that it takes is not installed.
        """
        recording: Recording = self.reader().read(path, request)
        return recording

    def reader(self) -> Any:
        """Return its module."""
        if self.extra is None:
            return import_module(self.module)
        return needed(self.module, f"a file of {self.name}", self.extra)


_HERE = "palpate.recordings"
_MESSAGES = f"{_HERE}.messages.containers"
_PACKED = ("", ".gz", ".bz2", ".xz")
_TEXTS = tuple(f".{kind}{end}" for end in _PACKED for kind in ("csv", "tsv", "txt", "dat"))
_CURVES = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".ibw")
_BAGS = (".db3", ".db3.zstd", ".mcap.zstd", "metadata.yaml")
_MAT = (b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT")

TEXT = Format("text", _TEXTS, f"{_HERE}.text")
FORCE_CURVES = Format("AFM force curve", _CURVES, f"{_HERE}.afm", (b"# afmformats",), "afm")

#: Every format. To add one: a module with ``read``, and its row.
FORMATS: list[Format] = [
    TEXT,
    Format("MCAP", (".mcap",), _MESSAGES, (b"\x89MCAP0\r\n",), "recordings"),
    Format("ROS 1 bag", (".bag", ".bag.active"), _MESSAGES, (b"#ROSBAG V",), "recordings"),
    Format("ROS 2 bag", _BAGS, _MESSAGES, (b"SQLite format 3\0",), "recordings"),
    FORCE_CURVES,
    Format("Feather", (".feather", ".arrow"), f"{_HERE}.arrow", (b"ARROW1", b"FEA1"), "recordings"),
    Format(
        "HDF5", (".h5", ".hdf5", ".hdf"), f"{_HERE}.hdf5", (b"\x89HDF\r\n\x1a\n",), "recordings"
    ),
    Format("MATLAB", (".mat",), f"{_HERE}.matlab", _MAT, "recordings"),
    Format("Parquet", (".parquet", ".pq"), f"{_HERE}.arrow", (b"PAR1",), "recordings"),
]


# From a file to the format that reads it: by its content, else by the suffix of its name.


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
    words = f"{len(recording.channels)} channels of {samples} samples"
    _LOGGER.info("read %s: %s, %.4f s", recording.source, words, seconds)
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


# What every reader asks of a file, and how it says that something is lost.

#: What a file, or a part of it, may unpack to or claim, bytes: beyond that no recording goes, and
#: a damaged size does.
LARGEST = 8 << 30


def within(name: str, whole: str) -> bool:
    """Return whether a channel is that one, or a field or an element of it."""
    return name == whole or (name.startswith(whole) and name[len(whole)] in "./[")


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


def first_line(error: BaseException) -> str:
    """Return what a library says of an error, on one line of bounded length."""
    lines = str(error).strip().splitlines()
    words = " ".join((lines[0] if lines else type(error).__name__).split())
    return words if len(words) <= 160 else f"{words[:159]}…"


_USED = "what could be read is used; --strict refuses the file"


@dataclass(slots=True)
class Draft:
    """What a reader has gathered of a file until it is a recording; that says what each is.

    Attributes
    ----------
    source : str
        The file's name.
    request : Request
        What is asked for.
    """

    source: str
    request: Request
    channels: dict[str, NDArray[Any]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    faults: dict[str, Faults] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    omissions: list[str] = field(default_factory=list)

    def error(self, words: str) -> RecordingError:
        """Return an error that names the file."""
        return RecordingError(f"{self.source}: {words}")

    def omit(self, name: str, reason: str) -> None:
        """Say that something is not read, and why."""
        self.omissions.append(f"{name}: {reason}")

    def lose(self, name: str, reason: str) -> None:
        """Say that something cannot be read, and why."""
        self.losses.append(f"{name}: {reason}")

    def done(self, rows: Sequence[int] | None = None) -> Recording:
        """Return the recording.

        Raises
        ------
        RecordingError
            Something is lost, and the request is strict.
        """
        if self.request.strict and self.losses:
            more = f" (and {len(self.losses) - 1} more)" if len(self.losses) > 1 else ""
            rest = "without --strict the rest of the file is read"
            raise self.error(f"{self.losses[0]}{more}; {rest}")
        mappings = ("units", "notes", "clocks", "frames", "types", "faults")
        own: dict[str, Any] = {name: getattr(self, name) for name in mappings}
        lost = [Finding("file", words, _USED, "with-care") for words in self.losses]
        findings = (*lost, *(Finding("file", words) for words in self.omissions))
        return Recording(self.channels, source=self.source, rows=rows, findings=findings, **own)


# Tables of named columns, and contacts, written: Parquet by pyarrow, or CSV.

_ROWS = 100_000  # of text that are made at once


def write_columns(
    columns: Mapping[str, NDArray[Any]],
    path: Path,
    *,
    units: Mapping[str, str] | None = None,
    notes: Mapping[str, str] | None = None,
    inputs: Sequence[Path] = (),
) -> None:
    """Write columns of equal length, whole or not at all; every number comes back as it was.

    :func:`palpate.open_recording` reads it, with units and notes. A unit is in the description of
    its column in Parquet, and in a note in CSV.

    Parameters
    ----------
    columns : mapping
        One-dimensional arrays of numbers or text.
    path : Path
        Ends in .parquet or .csv.
    units, notes : mapping, optional
        Units of columns, and what else is to be said.
    inputs : sequence of Path
        Files that must not be written over.

    Raises
    ------
    InvalidParameterError
        The path has another ending.
    MissingExtraError
        Parquet is asked for, and pyarrow is not installed.
    RecordingError
        The path cannot be written.
    """
    ending = path.suffix.lower()
    if ending == ".parquet":
        write_bytes(path, _as_parquet(columns, units or {}, notes or {}), inputs)
    elif ending == ".csv":
        write_text(path, _as_csv(columns, units or {}, notes or {}), inputs)
    else:
        raise InvalidParameterError(f"{path}: a table's name must end in .parquet or .csv")


def has_parquet() -> bool:
    """Whether pyarrow, which writes Parquet, is installed."""
    return find_spec("pyarrow") is not None


def _as_parquet(
    columns: Mapping[str, NDArray[Any]], units: Mapping[str, str], notes: Mapping[str, str]
) -> bytes:
    pa = needed("pyarrow", "Parquet, in place of which .csv may be written,", "recordings")
    parquet = needed("pyarrow.parquet", "Parquet", "recordings")
    # Not by pa.array, which imports pandas to ask it whether the values are its own.
    arrays = []
    for values in columns.values():
        if values.dtype.kind == "U":
            words = [word.encode() for word in values.tolist()]
            ends = np.cumsum([0, *map(len, words)], dtype=np.int32)
            text = pa.py_buffer(ends), pa.py_buffer(b"".join(words))
            arrays.append(pa.StringArray.from_buffers(len(words), *text))
            continue
        numbers = [None, pa.py_buffer(np.ascontiguousarray(values))]
        arrays.append(
            pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), numbers)
        )
    fields = [
        pa.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    table = pa.table(arrays, schema=pa.schema(fields, metadata=dict(notes)))
    written = io.BytesIO()
    parquet.write_table(table, written, compression="zstd")
    return written.getvalue()


def _as_csv(
    columns: Mapping[str, NDArray[Any]], units: Mapping[str, str], notes: Mapping[str, str]
) -> str:
    listed = ", ".join(f"{name} {unit}" for name, unit in units.items())
    text = _head({**notes, **({"units": listed} if units else {})}, columns)
    length = len(next(iter(columns.values())))
    for start in range(0, length, _ROWS):
        # repr: the shortest text that is the same number again.
        cells = [
            map(str if values.dtype.kind == "U" else repr, values[start : start + _ROWS].tolist())
            for values in columns.values()
        ]
        text.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))
    return text.getvalue()


def _head(notes: Mapping[str, str], names: Iterable[str]) -> io.StringIO:
    """Text that begins with notes, and the names of the columns."""
    text = io.StringIO()
    for name, words in notes.items():
        text.write(f"# {name}: {' '.join(words.split())}\n")
    text.write(",".join(names) + "\n")
    return text


def write_contact(
    contact: Contact,
    path: str | Path,
    notes: Mapping[str, str] | None = None,
    *,
    velocity: bool = False,
) -> None:
    """Write a contact as CSV, whole or not at all, with what is known of it above the header.

    Parameters
    ----------
    contact : Contact
        For instance of :meth:`palpate.lab.Bench.run`. Several segments get a column.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines for its head, before those of the contact's ``provenance``.
    velocity : bool
        Write the velocity too. Most rigs record none, and it is worked out when it is needed.

    Raises
    ------
    RecordingError
        The path cannot be written.
    """
    head = {**(notes or {}), **contact.provenance}
    if not velocity:
        head.pop("velocity", None)
    columns = {"time_s": (contact.time, "%.9g"), "penetration_m": (contact.penetration, "%.7g")}
    if velocity:
        columns["velocity_m_s"] = contact.velocity, "%.7g"
    columns["force_N"] = contact.force, "%.7g"
    if contact.segment[-1:].any():
        columns["segment"] = (contact.segment + 1).astype(np.float64), "%d"
    write_formatted(columns, Path(path), head)


def write_formatted(
    columns: Mapping[str, tuple[NDArray[np.float64], str]], path: Path, notes: Mapping[str, str]
) -> None:
    """Write numbers as CSV below notes, each column with a form such as ``"%.9g"``."""
    text = _head(notes, columns)
    table = np.column_stack([values for values, _ in columns.values()])
    np.savetxt(text, table, fmt=[form for _, form in columns.values()], delimiter=",")
    write_text(path, text.getvalue())
