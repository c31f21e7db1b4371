"""Force curves of atomic force microscopes, single or in maps, read by afmformats."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from afmformats import errors, load_data
from afmformats.afm_data import column_units, known_columns
from afmformats.formats.fmt_jpk.jpk_reader import ArchiveCache, JPKReader
from afmformats.meta import META_FIELDS, MetaDataMissingError

from palpate.errors import RecordingError
from palpate.input.recordings.opening import (
    FAULTS,
    MAX_SIZE,
    Draft,
    Request,
    check_members,
    first_line,
    regular_size,
)
from palpate.input.recordings.recording import Recording, printable
from palpate.validation import Values

# afmformats' own errors derive from BaseException.
_FAULTS = (*FAULTS, errors.AFMFileFormatError, MetaDataMissingError)

# The metadata kept as notes; the other fifty or so concern the instrument only.
_NOTES = (
    "spring constant", "sensitivity", "setpoint", "speed approach", "speed retract",
    "rate approach", "rate retract", "position x", "position y", "grid index x", "grid index y",
    "date", "instrument", "software", "imaging mode",
)  # fmt: skip
_UNITS = {name: about[1] for fields in META_FIELDS.values() for name, about in fields.items()}
_HEIGHTS = ("height (measured)", "height (piezo)")
_SEGMENTS = {
    1: "one",
    2: "0 approach, 1 retract",
    3: "0 approach, 1 pause, 2 retract",
    4: "0 approach, 1 and 2 pauses, 3 retract",
}

# Silences its log: palpate reports its failures as errors.
logging.getLogger("afmformats").addHandler(logging.NullHandler())


def read(path: Path, request: Request) -> Recording:
    """Read one force curve: time, heights, force and segment, with the calibration of the file.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read; ``curve`` is required for a file with several curves.

    Raises
    ------
    RecordingError
        The file is damaged or not calibrated, or holds several curves and none was chosen.
    """
    regular_size(path)
    with _explained(request):
        if path.name.lower().endswith(_JPK):
            with _opened(path, request) as reader:
                return _curve(reader, request)
        curves = load_data(path, callback=request.report)
        chosen = curves[_chosen(len(curves), request)]
        return _recording(chosen.columns, chosen.__getitem__, chosen.metadata, request)


def count_curves(path: Path) -> int:
    """Return the number of force curves in a JPK map.

    Raises
    ------
    RecordingError
        The file cannot be read.
    """
    request = Request(printable(path))
    with _opened(path, request) as reader, _explained(request):
        return len(reader)


def read_curves(
    path: Path, numbers: Sequence[int], max_size: float | None
) -> Iterator[Recording | RecordingError]:
    """Read several force curves of a JPK map, opening it once.

    Parameters
    ----------
    path : Path
        The file.
    numbers : sequence of int
        Indices of the curves, from 0.
    max_size : float, optional
        Largest size of the arrays of a curve, bytes. Default: that of
        :func:`palpate.open_recording`.

    Yields
    ------
    Recording or RecordingError
        For each index, the curve or the error that prevents reading it.

    Raises
    ------
    RecordingError
        The file cannot be read at all.
    """
    request = Request(printable(path)).limited(path, max_size)
    with _opened(path, request) as reader:
        for number in numbers:
            request.release()
            try:
                with _explained(request):
                    yield _curve(reader, replace(request, curve=number))
            except RecordingError as error:
                yield error


@contextmanager
def _explained(request: Request) -> Iterator[None]:
    """Convert an error of afmformats to a RecordingError."""
    remedy = "the file is damaged or afmformats does not support its instrument"
    with request.explain_damage("the force curve cannot be read", remedy, _FAULTS):
        try:
            yield
        except errors.MissingMetaDataError as error:
            raise request.error(
                f"the file is not calibrated (it lacks: {', '.join(map(str, error.meta_keys))}); "
                "calibrate the cantilever and save the curve again"
            ) from None


_OBJECTS_OF_PROPERTIES = 16  # bytes of Python objects per byte of a list of properties
_NUMBERS_OF_BYTES = 16  # bytes per byte of a column of 16 bits, in three copies
_JPK = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series")


@contextmanager
def _opened(path: Path, request: Request) -> Iterator[JPKReader]:
    """Open a JPK file."""
    regular_size(path)
    with _explained(request):
        check_members(path, request, partial(_largest_part, request))
        reader = JPKReader(path)
    try:
        yield reader
    finally:
        if archive := ArchiveCache.open_archives.pop(path, None):  # the file may change later
            archive.close()


def _largest_part(request: Request, name: str) -> int:
    """Largest size of a part of a JPK file, which becomes text or numbers of 64 bits."""
    if name.endswith(".properties"):
        return request.largest_block // _OBJECTS_OF_PROPERTIES
    return request.max_size // _NUMBERS_OF_BYTES if name.endswith(".dat") else MAX_SIZE


def _curve(reader: JPKReader, request: Request) -> Recording:
    """Read one curve of an open file."""
    number = _chosen(len(reader), request)
    metadata = reader.get_metadata(index=number)
    columns = [name for name in known_columns if name not in ("index", "tip position")]
    request.reserve(8 * len(columns) * int(metadata.get("point count", 0)))  # it makes the times
    column = lambda name: reader.get_data(column=name, index=number)  # noqa: E731
    return _recording(columns, column, metadata, request)


def _chosen(count: int, request: Request) -> int:
    """The index of the requested curve."""
    if not count:
        raise request.error("the file holds no curve; check the program that wrote it")
    number = request.curve or 0
    if (request.curve is None and count > 1) or not 0 <= number < count:
        why = f"it holds {count} curves" if request.curve is None else f"there is no curve {number}"
        raise request.error(f"{why}; choose one with --curve N, from 0 to {count - 1}")
    return number


def _recording(
    names: list[str],
    column: Callable[[str], Values],
    metadata: Mapping[str, Any],
    request: Request,
) -> Recording:
    """Return the columns of a curve as a recording."""
    draft = Draft(request)
    channels = draft.channels
    for name in names:
        if not request.wants(name) and name != "time":
            continue
        try:
            channels[name] = np.asarray(column(name))
        except errors.AFMFileFormatError:  # this instrument does not measure that height
            draft.omit(name, "not in this file")
        except _FAULTS as error:
            draft.lose(name, f"cannot be read: {first_line(error)}")
    lengths = {name: len(values) for name, values in channels.items()}
    if not set(lengths) - {"time", "segment"}:
        why = draft.losses or draft.omissions
        raise draft.error(f"no column of the curve can be read: {why}")
    least = min(lengths.values())
    most = max(lengths.values())
    if least < most:
        draft.losses.append(f"its columns have {least} to {most} samples: all are cut to {least}")
        channels |= {name: values[:least] for name, values in channels.items()}
    draft.notes = _notes(metadata, channels.get("segment"))
    _add_tip(draft, metadata)
    request.report(1.0)
    draft.units = {name: unit for name in channels if (unit := column_units.get(name))}
    draft.clocks = {name: "time" for name in channels if name != "time" and "time" in channels}
    return draft.done()


def _add_tip(draft: Draft, metadata: Mapping[str, Any]) -> None:
    """Add the position of the tip, from the height of the cantilever's base: z + F/k.

    If the base were the probe, the compliance of the cantilever would be attributed to the sample.
    """
    channels = draft.channels
    stiffness = float(metadata.get("spring constant", np.nan))
    height = next((name for name in _HEIGHTS if name in channels), None)
    if height is None or "force" not in channels or not np.isfinite(stiffness):
        return
    if "tip position" in channels or not draft.request.wants("tip position"):
        return
    channels["tip position"] = channels[height] + channels["force"] / stiffness
    draft.notes["tip position"] = f"{height} + force / spring constant"


def _notes(metadata: Mapping[str, Any], segment: Values | None) -> dict[str, str]:
    notes = {"time": "from the length of each segment: instruments record no time of samples"}
    for name in _NOTES:
        if name in metadata:
            notes[name] = f"{metadata[name]} {_UNITS.get(name, '')}".strip()
    if segment is not None and segment.size:
        count = int(segment.max()) + 1
        notes["segments"] = _SEGMENTS.get(count, f"{count}")
    return notes
