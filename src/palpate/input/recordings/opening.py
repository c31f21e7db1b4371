"""Opening recordings by their format, and what every reader needs for it."""

import logging
import os
import stat
import struct
import sys
import time
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from rich.filesize import decimal as format_bytes

from palpate._plugins import load_plugins
from palpate.errors import InvalidParameterError, PalpateError, RecordingError, import_extra
from palpate.findings import Check
from palpate.input.recordings.cantilever import complete_force_curve
from palpate.input.recordings.recording import Faults, Recording, printable
from palpate.validation import Values, frozen, number_in, shown
from palpate.writing import scratch_file

_LOGGER = logging.getLogger(__name__)
#: Exceptions that libraries raise on a damaged file.
FAULTS = (
    ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, MemoryError, OSError,
    RuntimeError, SyntaxError, TypeError, ValueError, struct.error, tokenize.TokenError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip
#: Largest default of ``--max-size``, bytes: 500 million numbers; recordings are smaller.
MAX_SIZE = 4 << 30
# Below that the default is this multiple of the size of the file: real recordings unpack to less.
_MOST_UNPACKED = 128
_LEAST_DEFAULT = 64 << 20
DEFLATE_RATIO = 1032  # the largest
_OBJECTS_OF_TEXT = 24  # bytes of Python objects per byte of JSON: {} takes 64


def excess(what: str, size: int, most: int) -> str:
    """Say that something exceeds a cap, and which option raises the cap."""
    return (
        f"{what} {format_bytes(size)} of memory, more than {format_bytes(most)}; "
        "if that is right, pass a larger --max-size"
    )


def size_of_deflate(packed: bytes, most: int) -> int:
    """Return the unpacked size of zlib or gzip, as far as the cap; they do not state it."""
    size = 0
    while packed and size + len(packed) * DEFLATE_RATIO > most >= size:
        unpacker = zlib.decompressobj(wbits=47)
        size += len(unpacker.decompress(packed, most + 1 - size))
        packed = unpacker.unused_data
    return size


@frozen
class Request:
    """Request to a reader: channels, parts of the file and limits.

    Attributes
    ----------
    source : str
        Name of the file, for the recording and for errors.
    channels : tuple of str, optional
        Names of channels, or topics or groups, such as ``"/ft"``. Default: all that hold numbers.
    strict : bool
        Fail on unreadable parts instead of skipping them with a warning.
    curve : int, optional
        Index, from 0, of the curve to read in a file with several.
    header_row : int, optional
        Line of the header of a text table, from 1. Default: above the largest block of numbers.
    episode : int, optional
        Number of the episode to read in a data set.
    progress : callable, optional
        Called at intervals with the fraction read so far, 0 to 1.
    max_size : int
        Largest size of all arrays together, bytes. Damaged and hostile files state or unpack to far
        more than they hold.
    largest_block : int
        Largest size of a message or a compressed block, bytes.
    sheet : str, optional
        Name, or number from 1, of the sheet to read in a spreadsheet.
    """

    source: str
    channels: tuple[str, ...] | None = None
    strict: bool = False
    curve: int | None = None
    progress: Callable[[float], None] | None = None
    max_size: int = MAX_SIZE
    largest_block: int = MAX_SIZE // 64
    sheet: str | None = None
    header_row: int | None = None
    episode: int | None = None
    _reserved: list[int] = field(default_factory=lambda: [0], compare=False, repr=False)

    def error(self, message: str) -> RecordingError:
        """Return an error that names the file."""
        return RecordingError(f"{self.source}: {message}")

    @contextmanager
    def explain_damage(
        self, what: str, remedy: str, faults: tuple[type[BaseException], ...] = FAULTS
    ) -> Iterator[None]:
        """Convert an error of a library to one that names the file, the damage and the remedy."""
        try:
            yield
        except PalpateError:
            raise
        except faults as error:
            raise self.error(f"{what} ({first_line(error)}); {remedy}") from None

    def limited(self, path: Path, max_size: float | None) -> "Request":
        """Return the request with the caps for a file: those of the user, else the default ones."""
        if max_size is not None:
            return replace(self, max_size=int(max_size), largest_block=int(max_size) // 64)
        default = max(_MOST_UNPACKED * _stored_size(path), _LEAST_DEFAULT)
        return replace(self, max_size=min(default, MAX_SIZE))

    def reserve(self, size: int) -> None:
        """Count the memory of an array before it is made; raise RecordingError above the cap."""
        self._reserved[0] += size
        if self._reserved[0] > self.max_size:
            raise self.error(excess("its data need", self._reserved[0], self.max_size))

    def release(self) -> None:
        """Reset the count of memory, because a reader begins again."""
        self._reserved[0] = 0

    def check_block(self, size: int) -> None:
        """Raise ValueError for a message or a compressed block above the cap."""
        if size > self.largest_block:
            raise ValueError(excess("it needs", size, self.largest_block))

    def check_count(self, what: str, count: int, size: int) -> None:
        """Raise ValueError for more descriptions, of ``size`` bytes each, than fit in a block."""
        if count * size > self.largest_block:
            raise ValueError(excess(f"its {count} {what} need", count * size, self.largest_block))

    def wants(self, name: str) -> bool:
        """Whether a channel, or any channel of a topic or group, is requested."""
        if self.channels is None:
            return True
        return any(within(name, channel) or within(channel, name) for channel in self.channels)

    def report(self, fraction: float) -> None:
        """Report the fraction read so far to ``progress``."""
        if self.progress is not None:
            self.progress(min(max(fraction, 0.0), 1.0))


@frozen
class Format:
    """A file format.

    Attributes
    ----------
    name : str
        Name for messages.
    suffixes : tuple of str
        Suffixes of its files, in lower case.
    module : str
        Full name of the module whose ``read(path, request)`` returns a :class:`Recording`.
    marks : tuple of bytes
        First bytes of its files; they take precedence over the suffix.
    extra : str, optional
        The extra in ``pyproject.toml`` that installs the packages it needs.
    remedy : str
        How to save the file in another format, if palpate does not read this one.
    """

    name: str
    suffixes: tuple[str, ...]
    module: str
    marks: tuple[bytes, ...] = ()
    extra: str | None = None
    remedy: str = ""

    def read(self, path: Path, request: Request) -> Recording:
        """Read a file.

        Raises
        ------
        MissingExtraError
            A package that the format needs is not installed.
        RecordingError
            The file cannot be read.
        """
        if self.remedy:
            raise request.error(f"this is {self.name}, which palpate does not read; {self.remedy}")
        recording: Recording = self.reader().read(path, request)
        return recording

    def reader(self) -> Any:
        """Import and return the module."""
        if self.extra is None:
            return import_module(self.module)
        return import_extra(self.module, f"reading a {self.name} file", self.extra)


_HERE = "palpate.input.recordings"
_MESSAGES = f"{_HERE}.messages.containers"
_PACKED = ("", ".gz", ".bz2", ".xz")
_TEXTS = tuple(
    f".{kind}{end}" for end in _PACKED for kind in ("csv", "tsv", "txt", "dat", "lvm", "mot")
)
#: Endings of files that hold several force curves.
MAPS = (".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series")
_CURVES = (".jpk-force", *MAPS, ".ibw")
#: The file that stands for the folder of a ROS 2 bag.
METADATA = "metadata.yaml"
_BAGS = (".db3", ".db3.zstd", ".mcap.zstd", METADATA)
_MAT = (b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT")
TEXT = Format("text", _TEXTS, f"{_HERE}.text")
FORCE_CURVES = Format("AFM force curve", _CURVES, f"{_HERE}.afm", (b"# afmformats",), "afm")
#: All formats. To add one, write a module with ``read`` and add a row here.
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
    Format("spreadsheet", (".xlsx", ".xlsm", ".xltx"), f"{_HERE}.spreadsheet", (), "recordings"),
    Format("NumPy", (".npz", ".npy"), f"{_HERE}.numpy_files", (b"\x93NUMPY",)),
    Format("JSON", (".json", ".jsonl", ".ndjson"), f"{_HERE}.json_tables"),
    Format(
        "a TDMS file of LabVIEW",
        (),
        "",
        (b"TDSm",),
        remedy="save it as CSV, by python -c "
        '\'from nptdms import TdmsFile; TdmsFile("IN.tdms").as_dataframe().to_csv("OUT.csv")\'',
    ),
    Format(
        "an Excel file before .xlsx, or one with a password",
        (),
        "",
        (b"\xd0\xcf\x11\xe0",),
        remedy="open it in a spreadsheet program and save it as .xlsx or CSV",
    ),
]
#: Data sets of robot learning: folders, or files of several of these formats.
DATA_SETS = Format("data set", (".parquet", ".hdf5", ".h5", ".hdf", ".zip"), f"{_HERE}.datasets")


def open_recording(
    path: str | os.PathLike[str],
    channels: Sequence[str] | None = None,
    *,
    strict: bool = False,
    curve: int | None = None,
    sheet: str | int | None = None,
    header_row: int | None = None,
    episode: int | None = None,
    progress: Callable[[float], None] | None = None,
    max_size: float | None = None,
    sensitivity: float | None = None,
    spring_constant: float | None = None,
) -> Recording:
    """Read the channels of a file, unchanged.

    Parameters
    ----------
    path : str or path-like
        The file, or the folder of a data set; ``-`` is standard input. palpate recognises the
        format from the content, else from the suffix; any other file is read as text.
    channels : sequence of str, optional
        Read only these channels, topics or groups, such as ``"/ft"``. Default: all that hold
        numbers.
    strict : bool
        Fail if the file is damaged. Default: read what can be read; ``Recording.losses`` lists the
        rest.
    curve : int, optional
        Index, from 0, of the curve to read in a file with several.
    sheet : str or int, optional
        Name, or number from 1, of the sheet to read in a spreadsheet. Default: all with a table.
    header_row : int, optional
        Line of the header of a text table, from 1. Default: above the largest block of numbers.
    episode : int, optional
        Number of the episode to read in a data set. Default: all, up to 100.
    progress : callable, optional
        Called at intervals with the fraction read so far.
    max_size : float, optional
        Largest size of all arrays together, bytes; a message or a compressed block may take a 64th
        of it. Default: 128 times the size of the file, from 64 MiB to 4 GiB; a block 64 MiB.
    sensitivity : float, optional
        Deflection of the cantilever per volt, m/V, for a force curve in volts.
    spring_constant : float, optional
        That of the cantilever, N/m, for a force curve in volts or lengths.

    Returns
    -------
    Recording
        Channels as recorded, with the units and notes of the file.

    Raises
    ------
    RecordingError
        The file cannot be read, or is not in the format that its name or first bytes indicate.
    MissingExtraError
        The packages for the format are not installed: the message says how to install them.

    Examples
    --------
    >>> import palpate
    >>> recording = palpate.open_recording("examples/recordings/ball.csv")
    >>> list(recording.channels), recording.unit_of("force_N")
    (['time_s', 'penetration_m', 'force_N'], 'N')
    """
    try:
        file = Path(path)
        requested = None if channels is None else tuple(channels)
    except TypeError:
        raise InvalidParameterError(f"path must be a path, not {path!r}") from None
    if curve is not None and curve < 0:
        raise InvalidParameterError(f"curve must be an index from 0 on, not {curve}")
    if header_row is not None and header_row < 1:
        raise InvalidParameterError(f"header_row must be a line from 1 on, not {header_row}")
    if max_size is not None and not 1.0 <= max_size <= 1e18:
        raise InvalidParameterError(f"max_size must be in [1, 1e+18] bytes, not {max_size!r}")
    for name, value in (("sensitivity", sensitivity), ("spring_constant", spring_constant)):
        if value is not None:
            number_in(name, value, 0.0, 1e9, open_low=True)
    begun = time.perf_counter()
    request = Request(
        "standard input" if str(file) == "-" else printable(file),
        requested,
        strict,
        curve,
        progress,
        sheet=None if sheet is None else str(sheet),
        header_row=header_row,
        episode=episode,
    )
    # Readers name what they find damaged; this is for what none of them foresees.
    with request.explain_damage("the file is damaged", "copy it again", (Exception,)):
        recording = _read(file, request, max_size)
        recording = complete_force_curve(recording, sensitivity, spring_constant)
    _log(recording, time.perf_counter() - begun)
    return recording


def _read(file: Path, request: Request, max_size: float | None) -> Recording:
    if str(file) != "-" and not _is(stat.S_ISFIFO, file):
        if _is(stat.S_ISDIR, file):  # a ROS 2 bag is a folder, and so is a data set
            check_folder(file)
        else:
            regular_size(file)
        form = detect_format(file)
        if request.episode is not None and form is not DATA_SETS:
            raise request.error("this is no data set; drop --episode")
        return form.read(file, request.limited(file, max_size))
    # Keep the suffix: some formats are recognised only by it.
    with scratch_file(f"recording{file.suffix}") as (copy, content):
        # The default cap follows from the size of the whole.
        limited = request if max_size is None else request.limited(copy, max_size)
        _copy_stream(file, content, limited)
        regular_size(copy, request.source)
        return detect_format(copy).read(copy, request.limited(copy, max_size))


def _is(kind: Callable[[int], bool], path: Path) -> bool:
    try:
        return kind(path.stat().st_mode)
    except (OSError, ValueError):  # opening it raises the error
        return False


def _copy_stream(file: Path, content: IO[bytes], request: Request) -> None:
    """Copy standard input (``-``) or a pipe up to its end."""
    standard = nullcontext(getattr(sys.stdin, "buffer", None))
    try:
        with standard if str(file) == "-" else file.open("rb") as stream:
            if stream is None or stream.isatty():  # closed, a notebook's, or a terminal
                raise request.error("no data is piped into it; name a file instead")
            while chunk := stream.read(1 << 20):
                content.write(chunk)
                if content.tell() > request.max_size:
                    raise request.error(
                        f"more than {format_bytes(request.max_size)} arrived; pass a larger "
                        "--max-size, or write the data to a file and name that"
                    )
        content.flush()
    except OSError as error:
        raise unreadable(request.source, error) from None


def _log(recording: Recording, seconds: float) -> None:
    """Log the contents of a recording, and the time that reading took."""
    if not _LOGGER.isEnabledFor(logging.INFO):
        return
    sizes = {len(values) for values in recording.channels.values()}
    samples = " or ".join(map(str, sorted(sizes)[:3])) or "no"
    count = len(recording.channels)
    message = "read %s: %d channels of %s samples, %.4f s"
    _LOGGER.info(message, recording.source, count, samples, seconds)
    for name, values in recording.channels.items():
        unit = recording.units.get(name) or "unit unknown"
        _LOGGER.debug("channel %s: %s, %d samples, %s", name, values.dtype, len(values), unit)


def detect_format(path: Path) -> Format:
    """Return the format of a file or a folder; text if palpate does not recognise it."""
    begin = b""
    if _may_be_data_set(path) and DATA_SETS.reader().is_dataset(path):
        return DATA_SETS
    if _is(stat.S_ISDIR, path):
        path = path / METADATA  # a ROS 2 bag is a folder
    else:
        with path.open("rb") as file:
            begin = file.read(64)
    own = _match_format(path.name.lower(), begin)
    if own is None:
        load_plugins("palpate.formats", _add_format)
        own = _match_format(path.name.lower(), begin)
    return own or TEXT


def _match_format(name: str, begin: bytes) -> Format | None:
    marked = (form for form in FORMATS if begin.startswith(form.marks))
    named = (form for form in FORMATS if name.endswith(form.suffixes))
    return next(marked, None) or next(named, None)


def _add_format(added: object) -> None:
    """Add the format of another package, behind palpate's own."""
    if not isinstance(added, Format):
        raise InvalidParameterError(f"it must be a Format, not {shown(added)}")
    FORMATS.append(added)


def _may_be_data_set(path: Path) -> bool:
    return path.name.lower().endswith(DATA_SETS.suffixes) or _is(stat.S_ISDIR, path)


def whole_recording(path: Path) -> Path:
    """Return the folder of the bag or the data set that a file is part of, else the file."""
    if path.name == METADATA:
        return path.parent
    root: Path | None = DATA_SETS.reader().root_of(path) if _may_be_data_set(path) else None
    return root or path


def within(name: str, group: str) -> bool:
    """Whether a name is ``group``, or a field or an element of it."""
    return name == group or (name.startswith(group) and name[len(group)] in "./[")


def check_folder(folder: Path) -> None:
    """Raise RecordingError if a folder holds a pipe or a device, which a reader would wait for."""
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place, name)
            if not path.is_file() and path.exists():
                raise RecordingError(
                    f"{printable(path)}: this is a pipe or a device; remove it from the folder"
                )


def regular_size(path: Path, source: str = "") -> int:
    """Return the size of a regular file, which a reader can access at any position.

    Raises
    ------
    RecordingError
        The file cannot be read, is empty, or is a folder or a device.
    """
    source = source or printable(path)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise RecordingError(f"{source}: this is a folder; name a file in it instead")
        if not stat.S_ISREG(status.st_mode):
            raise RecordingError(
                f"{source}: palpate cannot read a recording from a device or socket; "
                "write it to a file"
            )
        with path.open("rb"):
            pass
    except (OSError, ValueError) as error:
        raise unreadable(source, error) from None
    if not status.st_size:
        raise RecordingError(f"{source}: the file is empty; record or copy it again")
    return status.st_size


def _stored_size(path: Path) -> int:
    """Return the size of a file with its journal, or of a folder; no more than the caps need."""
    root = path.parent if path.name == METADATA else path
    folders: Iterable[tuple[str, Any, list[str]]] = os.walk(root)
    if not _is(stat.S_ISDIR, root):
        folders = [(str(path.parent), [], [path.name, f"{path.name}-wal"])]
    stored = 0
    for folder, _, names in folders:
        for name in names:
            with suppress(OSError):
                stored += os.stat(f"{folder}/{name}").st_size  # noqa: PTH116 - a str
        if stored * _MOST_UNPACKED > MAX_SIZE:
            break
    return stored


def read_whole(path: Path, request: Request) -> bytes:
    """Return the content of a file that becomes Python objects, such as JSON, within the cap."""
    request.reserve(_OBJECTS_OF_TEXT * regular_size(path))
    return path.read_bytes()


def check_members(
    archive: IO[bytes] | Path, request: Request, largest: Callable[[str], int]
) -> None:
    """Refuse an archive that states more than the caps; zipfile unpacks no more than stated.

    Parameters
    ----------
    archive : file or Path
        The archive.
    request : Request
        Whose error it raises.
    largest : callable
        The largest size of a member by its name, bytes.
    """
    for member in zipfile.ZipFile(archive).infolist():
        if member.file_size > (most := largest(member.filename)):
            raise request.error(excess(f"{member.filename} needs", member.file_size, most))


def unreadable(source: str, error: Exception) -> Exception:
    """Return a RecordingError if the system could not read the file, else the error itself.

    The only ValueError from the system is about a zero byte in the name.
    """
    if not isinstance(error, OSError) and "embedded null" not in str(error):
        return error
    reason = getattr(error, "strerror", None) or "cannot be read"
    return RecordingError(f"{source}: {reason}; check the path")


def first_line(error: BaseException) -> str:
    """Return the first line of a library's error message, at most 160 characters."""
    lines = str(error).strip().splitlines()
    return _shorten(lines[0] if lines else type(error).__name__, 160)


def _shorten(text: str, most: int) -> str:
    """Return a text on one line, cut after some characters."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


_MOST_NOTES = 60
_NAME = 1 << 14  # bytes: 4096 names take a block
_USED = "palpate uses the rest of the file; pass --strict to fail instead"


@dataclass(slots=True)
class Draft:
    """The parts of a :class:`Recording` while a reader collects them.

    Attributes
    ----------
    request : Request
        What to read.
    """

    request: Request
    channels: dict[str, Values] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    faults: dict[str, Faults] = field(default_factory=dict)
    plots: dict[str, str] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    omissions: list[str] = field(default_factory=list)

    def error(self, message: str) -> RecordingError:
        """Return an error that names the file."""
        return self.request.error(message)

    def note(self, name: str, text: object) -> None:
        """Keep a note of the file, cut after 200 characters."""
        if len(self.notes) < _MOST_NOTES:
            self.notes[name] = _shorten(str(text), 200)

    def check_names(self, count: int) -> None:
        """Raise RecordingError for more names than a table has; each takes work in every step."""
        try:
            self.request.check_count("names", count, _NAME)
        except ValueError as error:
            raise self.error(str(error)) from None

    def omit(self, name: str, reason: str) -> None:
        """Report that something is skipped, and why."""
        self.check_names(len(self.omissions))
        self.omissions.append(f"{name}: {reason}")

    def lose(self, name: str, reason: str) -> None:
        """Report that something cannot be read, and why."""
        self.losses.append(f"{name}: {reason}")

    def done(self, rows: Sequence[int] | None = None) -> Recording:
        """Return the recording.

        Raises
        ------
        RecordingError
            Something could not be read and the request is strict.
        """
        if self.request.strict and self.losses:
            more = f" (and {len(self.losses) - 1} more)" if len(self.losses) > 1 else ""
            raise self.error(f"{self.losses[0]}{more}; drop --strict to use the rest of the file")
        losses = [Check.FILE.finding(loss, _USED, severity="with-care") for loss in self.losses]
        return Recording(
            self.channels,
            self.units,
            self.request.source,
            self.notes,
            rows,
            self.clocks,
            self.frames,
            self.types,
            self.faults,
            self.plots,
            (*losses, *map(Check.FILE.finding, self.omissions)),
        )
