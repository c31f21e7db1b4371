"""Parquet: tables of columns, by pyarrow."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as parquet

from palpate.errors import RecordingError
from palpate.recordings.arrow_columns import DAMAGED, Columns, name_of, notes_of
from palpate.recordings.bounds import first_line, in_words, most_unpacked, regular_size
from palpate.recordings.formats import Request
from palpate.recordings.recording import Recording, printable

_END = b"PAR1"


def read(path: Path, request: Request) -> Recording:
    """Read a Parquet file: every column of numbers or text.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for; only those columns are read.

    Raises
    ------
    RecordingError
        The file is no Parquet, is cut off or too damaged, or has no column that is asked for.
    """
    source = printable(path)
    size = regular_size(path)
    _check_end(path, size, source)
    try:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            _check_claims(file.metadata, size, source)
            return _columns(file, source, request)
    except DAMAGED as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(
            f"{source}: the file is damaged and cannot be read ({first_line(error)}); copy it again"
        ) from None


def _check_end(path: Path, size: int, source: str) -> None:
    """What is where stands at the end of the file: without it nothing can be found."""
    with path.open("rb") as file:
        begin = file.read(4)
        file.seek(max(size - 4, 0))
        end = file.read(4)
    if begin != _END:
        raise RecordingError(f"{source}: this is no Parquet file; check what wrote it")
    if end != _END or size < 12:
        raise RecordingError(
            f"{source}: the file is cut off: its directory, which stands at its end, is missing; "
            "copy it again, or let the recorder close its file"
        )


def _check_claims(metadata: parquet.FileMetaData, size: int, source: str) -> None:
    """Whether the values that the file claims can be in it."""
    # What describes a column is not asked for here: pyarrow ends the process where that is damaged.
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    claimed = 8 * metadata.num_rows * max(metadata.num_columns, 1)
    unpacked = sum(group.total_byte_size for group in groups)
    if not 0 <= max(claimed, unpacked) <= most_unpacked(size):
        raise RecordingError(
            f"{source}: the file claims {in_words(max(claimed, unpacked))} of values, and has "
            f"{in_words(size)}; it is damaged, or no recording"
        )


def _columns(file: parquet.ParquetFile, source: str, request: Request) -> Recording:
    columns = Columns(request)
    schema = file.schema_arrow
    wanted = [form for form in schema if request.wants(name_of(form.name))]
    if not wanted and len(schema):
        names = ", ".join(name_of(name) for name in schema.names[:20])
        asked = ", ".join(request.channels or ())
        raise RecordingError(f"{source}: none of the columns {asked}; there are {names}")
    for k, form in enumerate(wanted):
        column = _column(file, form, columns.losses)
        if column is not None:
            columns.take(form, column)
        request.report((k + 1) / len(wanted))
    notes = notes_of(schema.metadata)
    if step := _range_index(schema.metadata):
        notes["index"] = step
    return columns.recording(source, notes)


def _column(file: parquet.ParquetFile, form: pa.Field, losses: list[str]) -> pa.ChunkedArray | None:
    """A column; where a part of it is damaged, nulls stand for that part."""
    try:
        return _checked(file.read(columns=[form.name]))
    except DAMAGED:
        pass
    parts, lost, words = [], 0, ""
    for k in range(file.metadata.num_row_groups):
        rows = file.metadata.row_group(k).num_rows
        try:
            parts.append(_checked(file.read_row_group(k, columns=[form.name])))
        except DAMAGED as error:
            lost, words = lost + rows, first_line(error)
            parts.append(pa.chunked_array([pa.nulls(rows, form.type)]))
    name = name_of(form.name)
    if lost == file.metadata.num_rows:
        losses.append(f"column {name!r} cannot be read: {words}")
        return None
    losses.append(
        f"column {name!r}: {lost} of {file.metadata.num_rows} rows cannot be read and are left "
        f"unknown: {words}"
    )
    return pa.chunked_array([chunk for part in parts for chunk in part.chunks], form.type)


def _checked(table: pa.Table) -> pa.ChunkedArray:
    """The one column of a table, of which every offset lies within it."""
    if table.num_columns != 1:
        raise ValueError("its name is not the only one of its kind")
    table.validate(full=True)
    return table.column(0)


def _range_index(metadata: dict[bytes, bytes] | None) -> str | None:
    """What pandas says of an index of equal steps, which it writes as no column."""
    try:
        described = json.loads((metadata or {})[b"pandas"])
        [index] = described["index_columns"]
        if index["kind"] == "range" and (index["name"] is not None or index["step"] != 1):
            return f"from {index['start']} in steps of {index['step']}, by pandas"
    except (KeyError, TypeError, ValueError):
        pass
    return None
