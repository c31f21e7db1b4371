"""Force curves of atomic force microscopes, alone or in maps, by afmformats."""

import logging
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from afmformats import errors, load_data
from afmformats.afm_data import column_units, known_columns
from afmformats.formats.fmt_jpk.jpk_reader import ArchiveCache, JPKReader
from afmformats.meta import META_FIELDS, MetaDataMissingError
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.recordings.opening import Draft, Request, first_line, regular_size
from palpate.recordings.recording import Recording, printable

# afmformats' own errors derive from BaseException.
_FAULTS = (
    ArithmeticError, AttributeError, AssertionError, EOFError, LookupError, NotImplementedError,
    OSError, RuntimeError, TypeError, ValueError, zipfile.BadZipFile, zlib.error,
    errors.AFMFileFormatError, MetaDataMissingError,
)  # fmt: skip

# A calibrated height beside the force, and when it was; the rest of some fifty is the instrument's.
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

# What it says of a failure goes to us as an error, and to nobody else.
logging.getLogger("afmformats").addHandler(logging.NullHandler())


def read(path: Path, request: Request) -> Recording:
    """Read one force curve: time, heights, force and segment, calibrated by what the file says.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for; ``curve`` where the file holds several.

    Raises
    ------
    RecordingError
        The file is damaged or lacks its calibration, or holds several curves and none was chosen.
    """
    source = printable(path)
    regular_size(path)
    with _explained(source):
        if path.name.lower().endswith(_JPK):
            with _opened(path, source) as reader:
                return _curve(reader, source, request)
        curves = load_data(path, callback=request.report)
        chosen = curves[_chosen(len(curves), source, request)]
        return _recording(chosen.columns, chosen.__getitem__, chosen.metadata, source, request)


def count_curves(path: Path) -> int:
    """Return how many force curves a map of JPK holds.

    Raises
    ------
    RecordingError
        It cannot be read.
    """
    source = printable(path)
    with _opened(path, source) as reader, _explained(source):
        return len(reader)


def read_curves(path: Path, numbers: Sequence[int]) -> Iterator[Recording | RecordingError]:
    """Read several force curves of a map of JPK, which is opened once.

    Parameters
    ----------
    path : Path
        The file.
    numbers : sequence of int
        Which, from 0.

    Yields
    ------
    Recording or RecordingError
        One a number; why not, where it cannot be read.

    Raises
    ------
    RecordingError
        Nothing of the file can be read.
    """
    source = printable(path)
    with _opened(path, source) as reader:
        for number in numbers:
            try:
                with _explained(source):
                    yield _curve(reader, source, Request(curve=number))
            except RecordingError as error:
                yield error


@contextmanager
def _explained(source: str) -> Iterator[None]:
    """Say what a fault of the reader means."""
    try:
        yield
    except RecordingError:
        raise
    except errors.MissingMetaDataError as error:
        missing = ", ".join(map(str, error.meta_keys))
        raise RecordingError(
            f"{source}: the file lacks its calibration ({missing}); calibrate the cantilever and "
            "save the curve with it"
        ) from None
    except _FAULTS as error:
        raise RecordingError(
            f"{source}: the force curve cannot be read ({first_line(error)}); the file is damaged, "
            "or its instrument writes what afmformats does not read"
        ) from None


_JPK = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series")


@contextmanager
def _opened(path: Path, source: str) -> Iterator[JPKReader]:
    """Open a file of JPK."""
    regular_size(path)
    with _explained(source):
        reader = JPKReader(path)
    try:
        yield reader
    finally:
        if archive := ArchiveCache.open_archives.pop(path, None):  # it may be written anew
            archive.close()


def _curve(reader: JPKReader, source: str, request: Request) -> Recording:
    """Read one curve of an open file."""
    number = _chosen(len(reader), source, request)
    metadata = reader.get_metadata(index=number)
    columns = [name for name in known_columns if name not in ("index", "tip position")]
    column = lambda name: reader.get_data(column=name, index=number)  # noqa: E731
    return _recording(columns, column, metadata, source, request)


def _chosen(count: int, source: str, request: Request) -> int:
    """Which of so many curves is asked for."""
    if not count:
        raise RecordingError(f"{source}: there is no curve in it; look at what wrote it")
    number = request.curve or 0
    if (request.curve is None and count > 1) or not 0 <= number < count:
        what = f"holds {count} curves" if request.curve is None else f"there is no curve {number}"
        words = f"{what}; choose one with --curve N, from 0 to {count - 1}"
        raise RecordingError(f"{source}: {words}")
    return number


def _recording(
    names: list[str],
    column: Callable[[str], NDArray[Any]],
    metadata: Mapping[str, Any],
    source: str,
    request: Request,
) -> Recording:
    """Return the columns of a curve, which has to have a force."""
    draft = Draft(source, request)
    channels = draft.channels
    for name in names:
        if not request.wants(name) and name != "time":
            continue
        try:
            channels[name] = np.asarray(column(name))
        except errors.AFMFileFormatError:  # a height that this instrument does not measure
            draft.omit(name, "this file has none")
        except _FAULTS as error:
            draft.lose(name, f"cannot be read: {first_line(error)}")
    lengths = {name: len(values) for name, values in channels.items()}
    if not set(lengths) - {"time", "segment"}:
        why = draft.losses or draft.omissions
        raise draft.error(f"no column of the curve can be read: {why}")
    least, most = min(lengths.values()), max(lengths.values())
    if least < most:
        draft.losses.append(f"its columns hold from {least} to {most} samples: cut")
        channels |= {name: values[:least] for name, values in channels.items()}
    draft.notes = _notes(metadata, channels.get("segment"))
    _add_tip(draft, metadata)
    request.report(1.0)
    draft.units = {name: unit for name in channels if (unit := column_units.get(name))}
    draft.clocks = {name: "time" for name in channels if name != "time" and "time" in channels}
    return draft.done()


def _add_tip(draft: Draft, metadata: Mapping[str, Any]) -> None:
    """Where the tip is: the height of the cantilever's base and its deflection, z + F/k.

    The base is no probe. Taken for one, the cantilever's compliance is identified as the sample's.
    """
    channels = draft.channels
    stiffness = float(metadata.get("spring constant", np.nan))
    height = next((name for name in _HEIGHTS if name in channels), None)
    known = height is not None and "force" in channels and np.isfinite(stiffness)
    if "tip position" in channels or not known or not draft.request.wants("tip position"):
        return
    channels["tip position"] = channels[str(height)] + channels["force"] / stiffness
    draft.notes["tip position"] = f"{height} + force / spring constant"


def _notes(metadata: Mapping[str, Any], segment: NDArray[Any] | None) -> dict[str, str]:
    notes = {"time": "from the length of each segment; an instrument records no time of a sample"}
    for name in _NOTES:
        if name in metadata:
            notes[name] = f"{metadata[name]} {_UNITS.get(name, '')}".strip()
    if segment is not None and segment.size:
        count = int(segment.max()) + 1
        notes["segments"] = _SEGMENTS.get(count, f"{count}")
    return notes
