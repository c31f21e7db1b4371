"""The pure function of a fleet: a table of what to identify in, a table of what it is out."""

import itertools
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate._core import __version__
from palpate.contact import Contact
from palpate.errors import FleetError, InvalidParameterError, PalpateError, RecordingError
from palpate.fleet.arrays import identify_curves, row_of_curve, searches_whole_curves
from palpate.fleet.columns import table_of_rows
from palpate.fleet.extras import needed
from palpate.fleet.rows import Row, failure, place_in_notes, rows_of
from palpate.fleet.settings import Settings
from palpate.fleet.stored import curves_of, on_this_machine
from palpate.preparation import prepare
from palpate.recordings import Recording, open_recording
from palpate.recordings.recording import printable
from palpate.validation import Floats

if TYPE_CHECKING:
    import pyarrow as pa

#: A source, and which of its contacts; None where it is one.
Named = tuple[str, int | None]
_SAMPLES = ("time", "penetration", "velocity", "force", "segment")


def identify_batch(
    batch: "pa.Table | pa.RecordBatch", settings: Settings, *, threads: int = 1
) -> "pa.Table":
    """Identify a batch of contacts.

    It depends on nothing but its arguments and what these name, and changes nothing: any engine may
    run it, anywhere, again.

    Parameters
    ----------
    batch : pyarrow.Table or RecordBatch
        A row a contact. Either ``source``, ``kind`` and ``index`` say where it is, as
        :meth:`palpate.fleet.tasks.Batch.table` has it; or lists ``time``, ``penetration``,
        ``force`` and, if it was measured, ``velocity``, SI, are its samples, and ``source`` and
        ``index`` are its names, where they are there.
    settings : Settings
        How they are prepared and identified.
    threads : int
        That share contacts of equal length.

    Returns
    -------
    pyarrow.Table
        :func:`palpate.fleet.columns.columns_of` says what it holds: a row a contact, in their
        order; of a recording of a probe that travels a row a place. What fails is a row with its
        reason.

    Raises
    ------
    FleetError
        The settings are of another version of palpate.
    InvalidParameterError
        The batch has other columns.
    """
    return timed_batch(batch, settings, threads=threads)[0]


def timed_batch(
    batch: "pa.Table | pa.RecordBatch", settings: Settings, *, threads: int = 1
) -> "tuple[pa.Table, Floats]":
    """Identify a batch as :func:`identify_batch` does; and the seconds that each row took."""
    _check_version(settings)
    pa = needed("pyarrow", "a table of contacts")
    names = set(batch.schema.names)
    if {"penetration", "force", "time"} <= names:
        return _with_samples(batch, settings)
    if not {"source", "kind", "index"} <= names:
        raise InvalidParameterError(
            "a batch must have the columns source, kind and index, or time, penetration and force, "
            f"not {', '.join(sorted(names))}"
        )
    found = [_identified(kind, rows, settings, threads) for kind, rows in _runs(batch)]
    if not found:
        return table_of_rows([], settings), np.empty(0)
    return pa.concat_tables([table for table, _ in found]), np.concatenate([s for _, s in found])


def lost(batch: "pa.Table", settings: Settings, reason: str) -> "pa.Table":
    """Return the rows of a batch whose contacts could not be worked on at all."""
    rows = [
        {"source": source, "index": index, "error": reason, "error_kind": "FleetError"}
        for source, index in zip(
            batch["source"].to_pylist(), batch["index"].to_pylist(), strict=True
        )
    ]
    return table_of_rows(rows, settings)


def _check_version(settings: Settings) -> None:
    if settings.version != __version__:
        raise FleetError(
            f"a worker has palpate {__version__}, and palpate {settings.version} asks; "
            "install one version everywhere"
        )


def _runs(batch: "pa.Table | pa.RecordBatch") -> Iterator[tuple[str, list[Named]]]:
    """Rows next to each other that are read together: of one array or map, or any files."""
    columns = (batch.column(name).to_pylist() for name in ("kind", "source", "index"))
    rows = zip(*columns, strict=True)
    for (kind, _), group in itertools.groupby(
        rows, key=lambda row: (row[0], None if row[0] == "file" else row[1])
    ):
        yield kind, [(source, index) for _, source, index in group]


def _identified(
    kind: str, named: list[Named], settings: Settings, threads: int
) -> "tuple[pa.Table, Floats]":
    if kind == "map":
        return _of_map(named[0][0], [index for _, index in named], settings)
    if kind == "zarr":
        return _of_array(named[0][0], [index or 0 for _, index in named], settings, threads)
    rows: list[Row] = []
    seconds: list[float] = []
    for source, index in named:
        begun = time.perf_counter()
        new = _of_file(source, index, settings)
        rows += new
        seconds += [(time.perf_counter() - begun) / len(new)] * len(new)
    return table_of_rows(rows, settings), np.array(seconds)


def _of_array(
    source: str, numbers: Sequence[int], settings: Settings, threads: int
) -> "tuple[pa.Table, Floats]":
    first, count = min(numbers), max(numbers) - min(numbers) + 1
    begun = time.perf_counter()
    try:
        table = identify_curves(curves_of(source, first, count), settings, threads=threads)
        wanted = [number - first for number in numbers]
        table = table if wanted == list(range(count)) else table.take(wanted)
    except Exception as error:
        rows = [{"source": source, "index": each, **failure(error)} for each in numbers]
        table = table_of_rows(rows, settings)
    spent = time.perf_counter() - begun
    return table, np.full(table.num_rows, spent / max(table.num_rows, 1))


def _of_map(
    source: str, indices: "list[int | None]", settings: Settings
) -> "tuple[pa.Table, Floats]":
    """Curves of one file, which is opened once."""
    from palpate.recordings.afm import read_curves

    rows: list[Row] = []
    seconds: list[float] = []
    numbers = [0 if index is None else index for index in indices]
    try:
        with on_this_machine(source) as path:
            begun = time.perf_counter()
            for index, read in zip(indices, read_curves(path, numbers), strict=True):
                named: Row = {"source": source, "index": index}
                new = _of_recording(read, named, settings, curve=True)
                rows += new
                spent, begun = time.perf_counter() - begun, time.perf_counter()
                seconds += [spent / len(new)] * len(new)
    except Exception as error:  # of the file as a whole
        for index in indices[len(seconds) :]:
            rows.append({"source": source, "index": index, **failure(error)})
            seconds.append(0.0)
    return table_of_rows(rows, settings), np.array(seconds)


def _of_file(source: str, index: int | None, settings: Settings) -> list[Row]:
    named: Row = {"source": source, "index": index}
    try:
        with on_this_machine(source) as path:
            try:
                recording: Recording | PalpateError = open_recording(path, curve=index)
            except PalpateError as error:
                recording = error
                if "://" in source:  # the name of a copy would tell a person nothing
                    recording = RecordingError(str(error).replace(printable(path), source))
            return _of_recording(recording, named, settings)
    except Exception as error:
        return [{**named, **failure(error)}]


def _of_recording(
    recording: "Recording | BaseException", named: Row, settings: Settings, *, curve: bool = False
) -> list[Row]:
    """Prepare and identify: a row, or one for each place; or why not."""
    if isinstance(recording, BaseException):
        return [{**named, **failure(recording)}]
    named = {**named, **place_in_notes(dict(recording.notes))}
    try:
        contact: Contact = prepare(recording, **settings.preparation)
        if curve and searches_whole_curves(settings):
            rows = [{**named, **row_of_curve(contact, settings)}]
        else:
            rows = [{**named, **row} for row in rows_of(contact, settings)]
    except Exception as error:
        return [{**named, **failure(error)}]
    if not rows:
        words = "the probe travels, and no place of it is in the window that was asked for"
        return [{**named, **failure(FleetError(words))}]
    return rows


def _with_samples(
    batch: "pa.Table | pa.RecordBatch", settings: Settings
) -> "tuple[pa.Table, Floats]":
    """Identify contacts whose samples are in the batch itself."""
    names = set(batch.schema.names)
    rows: list[Row] = []
    seconds = []
    for k in range(batch.num_rows):
        begun = time.perf_counter()
        named: Row = {
            name: batch.column(name)[k].as_py() for name in ("source", "index") if name in names
        }
        new: list[Row]
        try:
            arrays: dict[str, Any] = {
                name: np.asarray(batch.column(name)[k].values)
                for name in _SAMPLES
                if name in names and batch.column(name)[k].is_valid
            }
            contact = prepare(source=named.get("source") or "", **arrays, **settings.preparation)
            new = [{**named, **row} for row in rows_of(contact, settings)]
        except Exception as error:
            new = [{**named, **failure(error)}]
        rows += new
        spent = time.perf_counter() - begun
        seconds += [spent / len(new)] * len(new)
    return table_of_rows(rows, settings), np.array(seconds)
