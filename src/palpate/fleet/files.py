"""Read contacts from files, folders and Zarr groups; write results to Parquet."""

import glob
import io
import json
import math
import os
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate._core import __version__
from palpate.errors import FleetError, RecordingError
from palpate.fleet.arrays import Curves
from palpate.fleet.tasks import Batch, ContactSource, Settings, Table, needed, sources_digest
from palpate.input.recordings import datasets, opening, units
from palpate.input.recordings.recording import printable
from palpate.validation import Floats, frozen
from palpate.writing import as_json, make_folder, write_bytes, write_text

_ZARR_ENDINGS = (".zarr", ".zarr.zip")
_MARKS = ("zarr.json", ".zgroup", ".zarray")
#: Arrays of a group, and the channel whose units each may have.
_CHANNELS = {name: name for name in ("penetration", "force", "velocity", "time")}
_CHANNELS |= dict.fromkeys("xyz", "penetration")
_CLOCK = "sample_time"


def is_array(name: str) -> bool:
    """Whether a name is a Zarr group, from its ending or from the files in the folder."""
    if name.rstrip("/").lower().endswith(_ZARR_ENDINGS):
        return True
    return any(os.path.isfile(f"{name}/{mark}") for mark in _MARKS)  # noqa: PTH113 - a str


def describe_array(name: str) -> ContactSource:
    """Describe the contacts of a Zarr group.

    Raises
    ------
    RecordingError
        The group cannot be opened, or lacks ``penetration`` and ``force`` of curves × samples.
    """
    group = _open_group(name)
    shape, chunks = _shape(group, name)
    if not shape[0]:
        raise RecordingError(f"{name}: no contacts; the arrays penetration and force have no rows")
    return ContactSource(name, "zarr", shape[0], shape[1], chunks[0], source_stamp(name)[0])


def source_stamp(name: str) -> tuple[str, int]:
    """Return text that changes when a source is modified, and the size in bytes of its files."""
    try:
        status = [os.stat(name)]  # noqa: PTH116 - a str
        for folder, _, inside in os.walk(name):
            status += [os.stat(f"{folder}/{each}") for each in inside]  # noqa: PTH116
    except OSError as error:  # the source's row reports it
        return str(error.strerror), 0
    regular = [each for each in status if not stat.S_ISDIR(each.st_mode)]
    size = sum(each.st_size for each in regular)
    latest = max(each.st_mtime_ns for each in status)
    return f"{len(regular)} {size} {latest}", size


def read_curves(name: str, first: int, count: int) -> Curves:
    """Read a range of contacts of a Zarr group, in SI.

    Parameters
    ----------
    name : str
        Name of the group. It holds ``penetration`` and ``force``, curves × samples; optionally
        ``velocity``; ``time``, shared or per curve, or an attribute ``sample_time``, s; and
        optionally ``x``, ``y`` and ``z``, one value per curve. The attribute ``units`` of an array
        names its unit (default: SI).
    first, count : int
        First contact and number of contacts.

    Raises
    ------
    RecordingError
        The group cannot be read.
    """
    group = _open_group(name)
    (_, samples), _ = _shape(group, name)
    rows = slice(first, first + count)
    try:
        channels = {
            channel: _read_in_si(group[channel], kind, rows, name)
            for channel, kind in _CHANNELS.items()
            if channel in group
        }
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(f"{name}: cannot be read: {opening.first_line(error)}") from None
    time = channels.get("time")
    if time is None:
        step = group.attrs.get(_CLOCK)
        if isinstance(step, bool) or not isinstance(step, int | float) or not 0.0 < step < math.inf:
            raise RecordingError(
                f"{name}: the times of its samples are missing; add an array time to the group, or "
                f"an attribute {_CLOCK} in s"
            )
        time = float(step) * np.arange(float(samples))
    if time.shape[-1] != samples:
        raise RecordingError(f"{name}: time has {time.shape[-1]} samples but force has {samples}")
    return Curves(
        time,
        channels["penetration"],
        channels["force"],
        channels.get("velocity"),
        source=name,
        index=np.arange(first, first + len(channels["force"]), dtype=np.int64),
        places={axis: channels[axis] for axis in "xyz" if axis in channels},
    )


def disk_name(name: str) -> str:
    """Return a file's name on disk: tables contain UTF-8 only, file names may have any bytes."""
    if "\\x" not in name or os.path.lexists(name):
        return name
    raw = re.sub(
        rb"\\x([0-9a-f]{2})",
        lambda match: bytes.fromhex(match[1].decode()),
        os.fsencode(name),
    )
    return os.fsdecode(raw)


def _open_group(name: str) -> Any:
    groups = needed("palpate.input.recordings.zarr_groups", "an array of contacts")
    path = Path(disk_name(name))
    try:
        opening.check_folder(path)
        return groups.open_group(path, opening.Request(name))
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(
            f"{name}: cannot be opened as a Zarr group: {opening.first_line(error)}"
        ) from None


def _shape(group: Any, name: str) -> tuple[tuple[int, int], tuple[int, int]]:
    known = set(group.array_keys())
    for channel in ("penetration", "force"):
        if channel not in known:
            raise RecordingError(
                f"{name}: has no array {channel!r}; it needs penetration and force, curves × "
                f"samples, and has {', '.join(sorted(known)) or 'no arrays'}"
            )
    shape = tuple(group["force"].shape)
    if len(shape) != 2 or tuple(group["penetration"].shape) != shape:
        raise RecordingError(
            f"{name}: penetration and force must have the same shape, curves × samples, not "
            f"{tuple(group['penetration'].shape)} and {shape}"
        )
    for channel in known & set(_CHANNELS):
        array = group[channel]
        expected = shape[:1] if channel in "xyz" else shape
        if array.dtype.kind not in "fiu":
            raise RecordingError(
                f"{name}: {channel} has type {array.dtype}; real numbers are required"
            )
        if channel != "time" and tuple(array.shape) != expected:
            raise RecordingError(
                f"{name}: {channel} must have the shape {expected}, not {array.shape}"
            )
    return (shape[0], shape[1]), tuple(group["force"].chunks)


def _read_in_si(array: Any, kind: str, rows: slice, name: str) -> Floats:
    attributes: Mapping[str, Any] = array.attrs
    unit = attributes.get("units", attributes.get("unit"))
    known = units.UNITS[kind]
    word = next(iter(known)) if unit is None else units.plain_unit(str(unit))
    if word not in known:
        allowed = ", ".join(known)
        raise RecordingError(f"{name}: {array.basename} has unit {word}; allowed are {allowed}")
    stored = array[:] if kind == "time" and array.ndim == 1 else array[rows]
    values: Floats = np.asarray(stored, dtype=np.float64)
    # Unpack as netCDF and xarray do: missing values, then the factor, then the offset.
    for missing in ("_FillValue", "missing_value"):
        if isinstance(attributes.get(missing), int | float):
            values = np.where(values == attributes[missing], np.nan, values)
    factor = attributes.get("scale_factor", 1.0)
    offset = attributes.get("add_offset", 0.0)
    for kind, value in (("scale_factor", factor), ("add_offset", offset)):
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise RecordingError(f"{name}: its attribute {kind} is not a number: {value!r}")
    if (factor, offset) != (1.0, 0.0):
        values = values * factor + offset
    return values if known[word] == 1.0 else values * known[word]


# The folder of a fleet's results: one Parquet file per batch, written completely or not at all.

MANIFEST = "_fleet.json"
#: Run times have a separate folder: everything else is the same in two runs.
TIMES = "_seconds"
#: Version of the columns; it rises when one is removed or changes its meaning.
SCHEMA = 2
REPORT = "report.html"
#: The data card of a data set of robot learning, and its page.
CARD = "card.md"
CARD_PAGE = "card.html"
# The name of a file of results contains its range of contacts, first and end.
_PART = re.compile(r"part-(\d{8,})-(\d{8,})\.parquet$")


@frozen
class Results:
    """The folder of one fleet's results.

    Attributes
    ----------
    folder : Path
        Path of the folder.
    contacts : int
        Number of contacts of the whole fleet.
    """

    folder: Path
    contacts: int

    @classmethod
    def begin(cls, folder: Path, settings: Settings, sources: Sequence[ContactSource]) -> "Results":
        """Make the folder, or continue in the folder of an earlier run with the same arguments.

        Raises
        ------
        FleetError
            The folder holds another run's results, or other files.
        RecordingError
            The folder cannot be made or written to.
        """
        make_folder(folder)
        manifest: dict[str, Any] = {
            "palpate": settings.version,
            "schema": SCHEMA,
            "settings": settings.plain(),
            "sources": sources_digest(sources),
            "contacts": sum(source.contacts for source in sources),
        }
        path = folder / MANIFEST
        if path.exists():
            if differs := next(_differences(read_manifest(folder), manifest), ""):
                raise FleetError(
                    f"{folder}: holds the results of a run with {differs}; choose another folder "
                    "with -o, or remove this one"
                )
        else:
            _check_empty(folder)
            write_text(path, as_json(manifest))
        make_folder(folder / TIMES)
        return cls(folder, manifest["contacts"])

    def done(self) -> list[tuple[int, int]]:
        """Return the range of contacts (first, end) of each file of results."""
        return [part for part, _ in _parts(self.folder)]

    def error_kinds(self) -> list[str | None]:
        """Return the class of error of each row so far; None for a row with numbers.

        Raises
        ------
        FleetError
            The results cannot be read.
        """
        if not _parts(self.folder):
            return []
        kinds: list[str | None] = _read_parts(self.folder, ["error_kind"])["error_kind"].to_pylist()
        return kinds

    def write(self, batch: Batch, table: Table, seconds: Floats) -> None:
        """Write the rows of a batch, its times first, each file completely or not at all.

        Raises
        ------
        RecordingError
            A file cannot be written.
        """
        pa = needed("pyarrow", "a table of contacts")
        parquet = needed("pyarrow.parquet", "a table of contacts")
        times = pa.table({"source": table["source"], "index": table["index"], "seconds": seconds})
        for folder, each in ((self.folder / TIMES, times), (self.folder, table)):
            written = io.BytesIO()
            parquet.write_table(each, written, compression="zstd")
            name = f"part-{batch.first:08d}-{batch.end:08d}.parquet"
            write_bytes(folder / name, written.getvalue())


def read_results(folder: Path) -> Table:
    """Read the rows of a fleet, in the order of the sources.

    Raises
    ------
    FleetError
        The folder holds no results, or some are missing.
    """
    total = read_manifest(folder)["contacts"]
    table = _read_parts(folder)
    missing = total - sum(end - first for (first, end), _ in _parts(folder))
    if missing:
        raise FleetError(
            f"{folder}: {missing} of {total} contacts are missing; repeat the palpate fleet "
            "command to identify them"
        )
    return table


def read_seconds(folder: Path) -> Table:
    """Read the time that each row took: columns ``source``, ``index`` and ``seconds``."""
    return _read_parts(folder, place=TIMES)


def _read_parts(folder: Path, columns: list[str] | None = None, place: str = ".") -> Table:
    pa = needed("pyarrow", "a table of contacts")
    parquet = needed("pyarrow.parquet", "a table of contacts")
    parts = [folder / place / path.name for _, path in _parts(folder)]
    if not parts:
        raise FleetError(f"{folder}: holds no results yet")
    try:
        return pa.concat_tables([parquet.read_table(part, columns=columns) for part in parts])
    except (OSError, pa.ArrowException) as error:
        raise FleetError(f"{folder}: cannot be read: {opening.first_line(error)}") from None


def _parts(folder: Path) -> list[tuple[tuple[int, int], Path]]:
    """Return the files of results with their ranges, in order; each contact occurs once."""
    matches = [(match, folder / name) for name in _names(folder) if (match := _PART.match(name))]
    parts: list[tuple[tuple[int, int], Path]] = []
    for part, path in sorted(((int(match[1]), int(match[2])), path) for match, path in matches):
        if not parts or part[0] >= parts[-1][0][1]:  # two concurrent runs may both have written it
            parts.append((part, path))
    return parts


def _names(folder: Path) -> list[str]:
    try:
        return [path.name for path in folder.iterdir()]
    except OSError as error:
        raise RecordingError(f"{printable(folder)}: {error.strerror or error}") from None


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the description of the run that wrote a folder of results.

    Raises
    ------
    FleetError
        The folder holds no results of a fleet.
    """
    path = folder / MANIFEST
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        if not {"palpate", "settings", "sources", "contacts"} <= set(manifest):
            raise ValueError("it lacks entries that palpate writes")
        if (version := manifest.get("schema", 1)) != SCHEMA:
            raise FleetError(
                f"{path}: the results have schema {version}, but palpate {__version__} reads "
                f"schema {SCHEMA}; run palpate fleet again, with another -o"
            )
    except FileNotFoundError:
        raise FleetError(
            f"{folder}: holds no results of palpate fleet; pass the folder of its option -o"
        ) from None
    except (OSError, ValueError, TypeError) as error:
        raise FleetError(
            f"{path}: cannot be read: {error}; choose another folder with -o"
        ) from None
    return dict(manifest)


def _differences(earlier: Mapping[str, Any], current: Mapping[str, Any]) -> Iterator[str]:
    """Yield the differences between another run and this one."""
    if earlier["palpate"] != current["palpate"]:
        yield f"palpate {earlier['palpate']}, but this is {current['palpate']}"
    before, now = (run["settings"] for run in (earlier, current))
    for name in sorted({*before, *now}):
        one, other = (
            json.dumps(settings.get(name), ensure_ascii=False) for settings in (before, now)
        )
        if one != other:
            yield f"{name} {one}, but this run has {other}"
    if earlier["sources"] != current["sources"]:
        contacts = earlier["contacts"]
        yield f"{contacts} contacts of other sources, or of these before they changed"


def _check_empty(folder: Path) -> None:
    for name in sorted(_names(folder)):
        if not name.startswith("."):
            raise FleetError(
                f"{folder}: holds {name}, which palpate fleet did not write; choose another folder "
                "with -o"
            )


# Expand the names on the command line to sources: files, globs, folders, arrays.

# In a folder of recordings a .json mostly holds settings or results.
_ENDINGS = tuple(end for each in opening.FORMATS for end in each.suffixes if end != ".json")


def list_sources(
    names: Sequence[str | os.PathLike[str]],
    leave_out: Path | None = None,
) -> list[ContactSource]:
    """List the sources to identify, in an order that depends only on the names.

    Parameters
    ----------
    names : sequence of str or path-like
        Files, patterns with ``*``, folders (searched recursively) and Zarr groups.
    leave_out : Path, optional
        Folder to skip, such as the folder of the results.

    Raises
    ------
    RecordingError
        A name leads to no recording, or an array holds no contacts.
    """
    sources: dict[str, ContactSource] = {}
    for name in names:
        text = os.fspath(name)
        results = "" if leave_out is None else os.path.realpath(leave_out)
        listed = list(_local(text, results))
        if not listed:
            raise RecordingError(
                f"{printable(text)}: no recording found; recordings end in {', '.join(_ENDINGS)}"
            )
        for source in listed:  # list a file once even if it is named twice
            identity = os.path.realpath(source.name)
            sources.setdefault(identity, replace(source, name=printable(source.name)))
    return list(sources.values())


def _local(text: str, results: str) -> Iterator[ContactSource]:
    path = Path(text)
    if glob.has_magic(text) and not path.exists():
        for each in sorted(glob.glob(text, recursive=True)):  # noqa: PTH207 - ** in absolute paths
            yield from _list_path(Path(each), (results,))
        return
    if not path.exists():
        page = "docs/how-to/many-contacts.md"
        remote = f"; copy the objects to a disk first: {page}" if "://" in text else ""
        raise RecordingError(f"{printable(text)}: no such file or folder{remote}")
    if os.path.realpath(path) == results:
        raise RecordingError(f"{printable(path)}: is the results folder; choose another with -o")
    yield from _list_path(path, (results,), named=True)


def _list_path(
    path: Path,
    outside: tuple[str, ...],
    *,
    named: bool = False,
) -> Iterator[ContactSource]:
    """Yield the sources at a path; a file that the user named counts whatever its ending.

    An unreadable source found in a folder is listed, and its row gets the error; an unreadable
    array that the user named raises it. Folders of results and cyclic links are skipped.
    """
    name = str(path)
    here = os.path.realpath(path)
    if datasets.is_dataset(path):
        yield _episodes(name, path)
    elif is_array(name):
        yield describe_array(name) if named else _list_array(name)
    elif not path.is_dir():
        # A read from a pipe could wait forever.
        readable = path.name.lower().endswith(_ENDINGS) and (path.is_file() or not path.exists())
        if named or readable:
            yield _file(name, path)
    elif (path / opening.METADATA).is_file():  # a bag of ROS 2 is a folder
        yield _file(name, path)
    elif here not in outside and not (path / MANIFEST).is_file():
        for each in sorted(_names(path)):
            if not each.startswith((".", "_")):
                yield from _list_path(path / each, (*outside, here))


def _list_array(name: str) -> ContactSource:
    """Describe an array found in a folder; its row reports an unreadable one."""
    try:
        return describe_array(name)
    except RecordingError:
        return ContactSource(name, "zarr", 1)


def _episodes(name: str, path: Path) -> ContactSource:
    """Describe the episodes of a data set; an unreadable one is a file, whose row reports it."""
    stamp, size = source_stamp(str(path))
    try:
        data = datasets.describe_data_set(path)
    except RecordingError:
        data = None
    if data is None:
        return ContactSource(name, "file", stamp=stamp, size=size)
    count = len(data.lengths)
    samples = sum(data.lengths.values())
    return ContactSource(name, "episodes", count, max(samples // count, 0), stamp=stamp)


def _file(name: str, path: Path) -> ContactSource:
    stamp, size = source_stamp(str(path))
    several = path.name.lower().endswith(opening.MAPS)
    curves = _count_curves(path) if several else None
    return ContactSource(name, "map" if several else "file", curves, stamp=stamp, size=size)


def _count_curves(path: Path) -> int | None:
    """Return the number of curves of a map; None if it cannot be read, which its row reports."""
    reader = opening.FORCE_CURVES.reader()
    try:
        count: int = reader.count_curves(path)
    except RecordingError:
        return None
    return count
