"""The pure function of a fleet: a table of what to identify in, a table of what it is out."""

import itertools
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import palpate
from palpate.contact import Contact
from palpate.errors import FleetError, InvalidParameterError, PalpateError, RecordingError
from palpate.fleet.arrays import identify_curves
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
    parts, seconds = [], []
    for source, kind, indices in _runs(batch):
        begun = time.perf_counter()
        table, took = _identified(source, kind, indices, settings, threads)
        if took is None:
            spent = time.perf_counter() - begun
            took = np.full(table.num_rows, spent / max(table.num_rows, 1))
        parts.append(table)
        seconds.append(took)
    if not parts:
        return table_of_rows([], settings), np.empty(0)
    return pa.concat_tables(parts), np.concatenate(seconds)


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
    if settings.version != palpate.__version__:
        raise FleetError(
            f"a worker has palpate {palpate.__version__}, and palpate {settings.version} asks; "
            "install one version everywhere"
        )


def _runs(batch: "pa.Table") -> "Iterator[tuple[str, str, list[int | None]]]":
    """Rows next to each other that are of one source."""
    columns = (batch.column(name).to_pylist() for name in ("source", "kind", "index"))
    rows = zip(*columns, strict=True)
    for (source, kind), group in itertools.groupby(rows, key=lambda row: row[:2]):
        yield source, kind, [row[2] for row in group]


def _identified(
    source: str, kind: str, indices: "list[int | None]", settings: Settings, threads: int
) -> "tuple[pa.Table, Floats | None]":
    if kind == "zarr":
        numbers = [index or 0 for index in indices]
        return _of_array(source, numbers, settings, threads), None
    if kind == "map":
        return _of_map(source, indices, settings)
    rows: list[Row] = []
    for index in indices:
        rows += _of_file(source, index, settings)
    return table_of_rows(rows, settings), None


def _of_array(source: str, numbers: Sequence[int], settings: Settings, threads: int) -> "pa.Table":
    first, count = min(numbers), max(numbers) - min(numbers) + 1
    try:
        curves = curves_of(source, first, count)
        table = identify_curves(curves, settings, threads=threads)
    except Exception as error:
        rows = [{"source": source, "index": each, **failure(error)} for each in numbers]
        return table_of_rows(rows, settings)
    wanted = [number - first for number in numbers]
    return table if wanted == list(range(count)) else table.take(wanted)


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
                new = _of_recording(read, named, settings)
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
    recording: "Recording | BaseException", named: Row, settings: Settings
) -> list[Row]:
    """Prepare and identify: a row, or one for each place; or why not."""
    if isinstance(recording, BaseException):
        return [{**named, **failure(recording)}]
    named = {**named, **place_in_notes(dict(recording.notes))}
    try:
        contact: Contact = prepare(recording, **settings.preparation)
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
