"""Contacts that are stored as arrays, curves × samples, by Zarr; and files in object storage."""

import hashlib
import math
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from palpate.errors import RecordingError
from palpate.fleet.curves import Curves
from palpate.fleet.extras import line_of, needed
from palpate.fleet.tasks import Source
from palpate.recordings.units import UNITS, plain_unit
from palpate.validation import Floats
from palpate.writing import temporary_file

_ENDINGS = (".zarr", ".zarr.zip")
_MARKS = ("zarr.json", ".zgroup", ".zarray")
_CHANNELS = {
    "penetration": "penetration",
    "force": "force",
    "velocity": "velocity",
    "time": "time",
    "x": "penetration",
    "y": "penetration",
    "z": "penetration",
}
_CLOCK = "sample_time"
_PIECE = 1 << 20  # bytes of an object that are fetched at once


def is_array(name: str) -> bool:
    """Whether a name is that of arrays by Zarr: by its ending, or by what is in the folder."""
    if name.rstrip("/").lower().endswith(_ENDINGS):
        return True
    return "://" not in name and any(os.path.isfile(f"{name}/{mark}") for mark in _MARKS)  # noqa: PTH113 - of text


def described_array(name: str) -> Source:
    """Return what a group of arrays holds.

    Raises
    ------
    RecordingError
        It cannot be opened, or is no ``penetration`` and ``force`` of curves × samples.
    """
    group = _opened(name)
    shape, chunks = _shape(group, name)
    if not shape[0]:
        raise RecordingError(f"{name}: holds no contact: penetration and force have no row")
    return Source(name, "zarr", shape[0], shape[1], chunks[0], stamp_of(name))


def stamp_of(name: str) -> str:
    """What would change if something was written again: how many files, sizes, latest time."""
    if "://" in name:
        fsspec = needed("fsspec", "object storage")
        files, root = fsspec.core.url_to_fs(name)
        known = files.find(root, detail=True).values()
        marks = sorted(
            f"{about['name']} {about.get('size')} {about.get('ETag') or about.get('mtime') or ''}"
            for about in known
        )
        return hashlib.sha256("\n".join(marks).encode()).hexdigest()[:16]
    try:
        status = [os.stat(name)]  # noqa: PTH116 - of text
        for folder, _, inside in os.walk(name):
            status += [os.stat(f"{folder}/{each}") for each in inside]  # noqa: PTH116
    except OSError as error:  # its row will say it
        return str(error.strerror)
    whole = [each for each in status if not stat.S_ISDIR(each.st_mode)]
    size, latest = sum(each.st_size for each in whole), max(each.st_mtime_ns for each in status)
    return f"{len(whole)} {size} {latest}"


def curves_of(name: str, first: int, count: int) -> Curves:
    """Read some of the contacts of a group of arrays, in SI.

    Parameters
    ----------
    name : str
        Of the group. It holds ``penetration`` and ``force``, curves × samples; ``velocity``, where
        it was measured; ``time``, for all curves or for each, or an attribute ``sample_time``, s;
        and ``x``, ``y`` and ``z``, one a curve. An attribute ``units`` of an array names its unit;
        SI unless given.
    first, count : int
        Which.

    Raises
    ------
    RecordingError
        They cannot be read.
    """
    group = _opened(name)
    (_, samples), _ = _shape(group, name)
    rows = slice(first, first + count)
    try:
        found = {
            channel: _in_si(group[channel], kind, rows, name)
            for channel, kind in _CHANNELS.items()
            if channel in group
        }
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(f"{name}: cannot be read: {line_of(error)}") from None
    time = found.get("time")
    if time is None:
        time = _even_clock(group, samples, name)
    if time.shape[-1] != samples:
        raise RecordingError(f"{name}: time has {time.shape[-1]} samples, force {samples}")
    return Curves(
        time,
        found["penetration"],
        found["force"],
        found.get("velocity"),
        source=name,
        index=np.arange(first, first + len(found["force"]), dtype=np.int64),
        places={axis: found[axis] for axis in "xyz" if axis in found},
    )


@contextmanager
def on_this_machine(name: str) -> Iterator[Path]:
    """A source as a file here: itself, or a copy of an object, which is gone afterwards.

    Raises
    ------
    RecordingError
        The object cannot be fetched.
    """
    if "://" not in name:
        yield Path(_on_disk(name))
        return
    fsspec = needed("fsspec", "object storage")
    with temporary_file(PurePosixPath(name).name, _fetched(fsspec, name)) as path:
        yield path


def _on_disk(name: str) -> str:
    """The name of a file as its folder has it: tables take UTF-8, a folder takes any bytes."""
    if "\\x" not in name or os.path.lexists(name):
        return name
    raw = re.sub(
        rb"\\x([0-9a-f]{2})", lambda found: bytes.fromhex(found[1].decode()), os.fsencode(name)
    )
    return os.fsdecode(raw)


def _fetched(fsspec: Any, name: str) -> Iterator[bytes]:
    try:
        with fsspec.open(name, "rb").open() as file:
            while piece := file.read(_PIECE):
                yield piece
    except Exception as error:
        raise RecordingError(f"{name}: cannot be fetched: {line_of(error)}") from None


def _opened(name: str) -> Any:
    zarr = needed("zarr", "an array of contacts")
    try:
        return zarr.open_group(_on_disk(name), mode="r")
    except Exception as error:
        raise RecordingError(
            f"{name}: is no group of arrays by Zarr that can be opened: {line_of(error)}"
        ) from None


def _shape(group: Any, name: str) -> tuple[tuple[int, int], tuple[int, int]]:
    known = set(group.array_keys())
    for channel in ("penetration", "force"):
        if channel not in known:
            raise RecordingError(
                f"{name}: has no array {channel!r}; penetration and force are needed, curves × "
                f"samples, and there are {', '.join(sorted(known)) or 'none at all'}"
            )
    shape = tuple(group["force"].shape)
    if len(shape) != 2 or tuple(group["penetration"].shape) != shape:
        raise RecordingError(
            f"{name}: penetration and force must be of one shape, curves × samples, not "
            f"{tuple(group['penetration'].shape)} and {shape}"
        )
    for channel in known & set(_CHANNELS):
        if group[channel].dtype.kind not in "fiu":
            raise RecordingError(
                f"{name}: {channel} is an array of {group[channel].dtype}, not of real numbers"
            )
    for channel in ("velocity", "x", "y", "z"):
        wanted = shape if channel == "velocity" else shape[:1]
        if channel in known and tuple(group[channel].shape) != wanted:
            raise RecordingError(
                f"{name}: {channel} must be of the shape {wanted}, not {group[channel].shape}"
            )
    return (shape[0], shape[1]), tuple(group["force"].chunks)


def _in_si(array: Any, kind: str, rows: slice, name: str) -> Floats:
    attributes: Mapping[str, Any] = array.attrs
    unit = attributes.get("units", attributes.get("unit"))
    known = UNITS[kind]
    word = next(iter(known)) if unit is None else plain_unit(str(unit))
    if word not in known:
        raise RecordingError(f"{name}: {array.basename} is in {word}, not in {', '.join(known)}")
    taken = array[:] if kind == "time" and array.ndim == 1 else array[rows]
    values: Floats = np.asarray(taken, dtype=np.float64)
    # As netCDF and xarray pack numbers: what is missing, then a factor, then an offset.
    for missing in ("_FillValue", "missing_value"):
        if isinstance(attributes.get(missing), int | float):
            values = np.where(values == attributes[missing], np.nan, values)
    factor, offset = (_packing(attributes, kind, name) for kind in ("scale_factor", "add_offset"))
    if (factor, offset) != (1.0, 0.0):
        values = values * factor + offset
    return values if known[word] == 1.0 else values * known[word]


def _packing(attributes: Mapping[str, Any], kind: str, name: str) -> float:
    value = attributes.get(kind, 1.0 if kind == "scale_factor" else 0.0)
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise RecordingError(f"{name}: its attribute {kind} is no number: {value!r}")
    return float(value)


def _even_clock(group: Any, samples: int, name: str) -> Floats:
    step = group.attrs.get(_CLOCK)
    if isinstance(step, bool) or not isinstance(step, int | float) or not 0.0 < step < math.inf:
        raise RecordingError(
            f"{name}: when its samples were taken is not said; give the group an array time, or an "
            f"attribute {_CLOCK}, s"
        )
    clock: Floats = float(step) * np.arange(float(samples))
    return clock
