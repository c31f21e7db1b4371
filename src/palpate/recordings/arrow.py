"""Parquet, Feather and Arrow, read by pyarrow: each column of numbers or text is a channel."""

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.ipc as ipc
import pyarrow.parquet as parquet
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.recordings.nested import MOST_COLUMNS, UNIT_FIELDS, read_text
from palpate.recordings.opening import FAULTS, Draft, Request, excess, first_line
from palpate.recordings.recording import Faults, Recording
from palpate.recordings.times import EPOCHS

# Exceptions that pyarrow raises on a damaged file.
_DAMAGED = (*FAULTS, pa.ArrowException)
# Metadata that is not readable text.
_NO_NOTES = (b"pandas", b"ARROW:schema", b"ARROW:extension:name", b"geo", b"huggingface")
_ROWS_AT_ONCE = 1024
_COLUMNS_AT_ONCE = 64
_DICTIONARY, _BATCH = 2, 3  # MessageHeader of the Arrow format
_BEGIN = b"ARROW1\0\0"
_CONTINUED = 0xFFFFFFFF  # before the length of a message, except in files of old versions


def read(path: Path, request: Request) -> Recording:
    """Read a Parquet, Feather (version 2) or Arrow file: every column of numbers or text.

    An incomplete Arrow file is read up to its last complete batch.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read; from Parquet only these columns are read.

    Raises
    ------
    RecordingError
        The file has another format, is cut off or too damaged, or has no requested column.
    """
    with path.open("rb") as file:
        begin = file.read(len(_BEGIN))
    draft = Draft(request)
    remedy = "copy it again or let the recorder close its file"
    with request.explain_damage("the file is cut off or damaged", remedy, _DAMAGED):
        if begin.startswith(b"PAR1"):
            with open_parquet(path) as table:
                # Do not access the metadata of columns here: if they are damaged, pyarrow ends the
                # process.
                rows, schema = table.metadata.num_rows, table.schema_arrow
                wanted = sum(request.wants(_name(form.name)) for form in schema)
                if not 0 <= 8 * rows * max(wanted, 1) <= request.max_size:
                    words = excess("its columns need", 8 * rows * wanted, request.max_size)
                    raise draft.error(words)
                return read_columns(schema, _ParquetColumns(table, schema, request).read, draft)
        if begin != _BEGIN:
            raise draft.error(
                "this is not a Parquet, Feather (version 2) or Arrow file; check what wrote it"
            )
        with pa.OSFile(str(path)) as file:
            content = file.read_buffer()
        _reserve(memoryview(content), request)
        batches = _batches(pa.BufferReader(content), draft.losses)
        return read_columns(batches.schema, lambda n: batches.select([n]), draft)


def open_parquet(path: Path) -> parquet.ParquetFile:
    """Open Parquet; repeated words stay in a dictionary until their size is known."""
    table = parquet.ParquetFile(path, page_checksum_verification=True)
    words = [form.name for form in table.schema_arrow if _is_text(form.type)]
    if not words:
        return table
    table.close()
    return parquet.ParquetFile(path, page_checksum_verification=True, read_dictionary=words)


class _ParquetColumns:
    """Reads columns, some at a time: for each call pyarrow looks at all columns of the file."""

    def __init__(self, table: parquet.ParquetFile, schema: pa.Schema, request: Request) -> None:
        self._table, self._request = table, request
        several = Counter(schema.names)
        self._plain = [
            form.name
            for form in schema
            if request.wants(_name(form.name)) and several[form.name] == 1
            if pa.types.is_primitive(form.type) or pa.types.is_decimal(form.type)
        ]
        self._places = {name: place for place, name in enumerate(self._plain)}
        size = 8 * max(table.metadata.num_rows, 1)
        most = min(max(request.largest_block // size, 1), _COLUMNS_AT_ONCE)
        self._count = most if len(self._plain) > _COLUMNS_AT_ONCE else 1
        self._read: pa.Table | None = None
        self._last = 0  # the place after the last column that was read

    def read(self, name: str) -> pa.Table:
        """Read a column; text and lists may have any length."""
        place = self._places.get(name)
        if place is None:
            return read_in_parts(self._table, [name], _ROWS_AT_ONCE, self._request)
        if self._read is None or not self._last - self._count <= place < self._last:
            self._last = place + self._count
            try:
                self._read = self._table.read(columns=self._plain[place : self._last])
            except _DAMAGED:  # of one of them
                self._read = None
                return self._table.read(columns=[name])
        return self._read.select([name])


def check_integers(schema: pa.Schema, names: list[str]) -> None:
    """Raise ValueError for a column that does not hold integers."""
    for name in names:
        if not pa.types.is_integer(kind := schema.field(name).type):
            raise ValueError(f"column {name!r} holds {kind}, not integers")


def read_in_parts(
    table: parquet.ParquetFile, names: list[str], rows: int, request: Request
) -> pa.Table:
    """Read columns of Parquet some rows at a time; raise ValueError if they exceed the cap."""
    batches, size = [], 0
    for batch in table.iter_batches(rows, columns=names):
        batches.append(batch)
        size += batch.nbytes
        if size > request.max_size:
            raise ValueError(excess("it needs", size, request.max_size))
    return pa.Table.from_batches(batches) if batches else table.read(columns=names)


def _reserve(data: memoryview, request: Request) -> None:
    """Count the stated sizes of an Arrow file's compressed buffers, before unpacking any."""
    at = len(_BEGIN)
    with suppress(struct.error):  # cut off or damaged: the reader of the batches reports it
        while size := _word("I", data, at):
            if size == _CONTINUED:
                at, size = at + 4, _word("I", data, at + 4)
            at = _reserve_message(data, at + 4, at + 4 + size, request)


def _reserve_message(data: memoryview, metadata: int, body: int, request: Request) -> int:
    """Count the buffers of a message, parsed as in the Arrow format's Message.fbs; return its end.

    A compressed buffer begins with its size; -1 means that it is stored as it is.
    """

    def field(table: int, number: int) -> int:  # where a field of a flatbuffers table is; or 0
        virtual = table - _word("i", data, table)
        inside = 4 + 2 * number < _word("H", data, virtual)
        offset = _word("H", data, virtual + 4 + 2 * number) if inside else 0
        return table + offset if offset else 0

    def follow(at: int) -> int:
        return at + _word("I", data, at)

    message = follow(metadata)
    kind, length = field(message, 1), field(message, 3)
    end = body + max(_word("q", data, length) if length else 0, 0)
    if kind and data[kind] in (_DICTIONARY, _BATCH):
        batch = follow(field(message, 2))
        if data[kind] == _DICTIONARY:
            batch = follow(field(batch, 1))
        if field(batch, 3):  # compressed
            buffers = follow(field(batch, 2))
            ends = data[buffers + 4 : body][: 16 * _word("I", data, buffers)]
            for start, size in struct.iter_unpack("<qq", ends):
                if size > 0:
                    request.reserve(max(_word("q", data, body + start), size))
    return end


def _word(form: str, data: memoryview, at: int) -> int:
    return int(struct.unpack_from(f"<{form}", data, at)[0])


def _batches(file: pa.NativeFile, losses: list[str]) -> pa.Table:
    """The batches of an Arrow file, up to the first damaged one."""
    try:
        table = ipc.open_file(file).read_all()
        table.validate(full=True)
    except _DAMAGED as error:
        losses.append(f"the file is cut off or damaged ({first_line(error)})")
    else:
        return table
    file.seek(len(_BEGIN))
    reader, found = ipc.open_stream(file), []
    try:
        for batch in reader:
            batch.validate(full=True)
            found.append(batch)
    except _DAMAGED:
        pass
    losses.append(f"only the first {sum(batch.num_rows for batch in found)} samples are read")
    return pa.Table.from_batches(found, reader.schema)


def read_columns(schema: pa.Schema, table_of: Callable[[str], pa.Table], draft: Draft) -> Recording:
    """Return the columns of a schema that are requested; ``table_of`` reads one of them."""
    request = draft.request
    wanted = [form for form in schema if request.wants(_name(form.name))]
    if not wanted and len(schema):
        asked, there = ", ".join(request.channels or ()), ", ".join(map(_name, schema.names[:20]))
        raise draft.error(f"no column {asked}; available: {there}")
    for k, form in enumerate(wanted):
        about = form.metadata or {}
        stated = (about.get(name.encode()) for name in UNIT_FIELDS)
        unit = read_text(next(filter(None, stated), None))
        try:
            table = table_of(form.name)
            table.validate(full=True)
            if table.num_columns != 1:
                raise ValueError("several columns have its name")
            for name, values in _leaves(_name(form.name), table.column(0)):
                if not request.wants(name):
                    continue
                if pa.types.is_dictionary(values.type):
                    request.reserve(_size_of_words(values))
                request.reserve(8 * len(values))
                draft.channels[name], own_unit, fault = _values(name, values)
                if own_unit or unit:
                    draft.units[name] = str(own_unit or unit)
                if fault is not None:
                    draft.faults[name] = fault
        except RecordingError:
            raise
        except _NoChannelError as error:
            draft.omissions.append(str(error))
        except _DAMAGED as error:
            draft.losses.append(f"column {_name(form.name)!r} cannot be read: {first_line(error)}")
        request.report((k + 1) / len(wanted))
    if not draft.channels:
        reasons = [*draft.losses, *draft.omissions, "it has no columns of numbers"]
        raise draft.error(f"no column can be read: {reasons[0]}")
    for title, words in (schema.metadata or {}).items():
        if title not in _NO_NOTES:
            draft.note(str(read_text(title)), read_text(words))
    return draft.done()


def _size_of_words(values: pa.ChunkedArray) -> int:
    """Size of a dictionary-encoded text column after decoding."""
    if not _is_text(values.type.value_type):
        return 0
    lengths = (compute.binary_length(each.dictionary).take(each.indices) for each in values.chunks)
    return sum(compute.sum(each.cast(pa.int64())).as_py() or 0 for each in lengths)


def _is_text(kind: pa.DataType) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _values(name: str, values: pa.ChunkedArray) -> tuple[NDArray[Any], str | None, Faults | None]:
    """Numbers or text, the unit that their type states, and the null values."""
    kind, unit = values.type, None
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
        values = values.cast(kind)
    if _is_text(kind):
        return values.fill_null("").to_numpy(), None, None
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind):
        values, unit = _nanoseconds(values)
    elif pa.types.is_decimal(kind):
        values = values.cast(pa.float64())
    elif not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)):
        raise _NoChannelError(f"column {name!r} holds {kind}, not numbers")
    if not values.null_count:
        return values.to_numpy(), unit, None
    fault = Faults(values.null_count, compute.index(values.is_null(), True).as_py(), "null")
    if not pa.types.is_floating(values.type):
        values = values.cast(pa.float64(), safe=False)
    return values.to_numpy(), unit, fault


class _NoChannelError(ValueError):
    """A column is not a channel: the message describes its contents."""


def _leaves(name: str, column: pa.ChunkedArray) -> Iterator[tuple[str, pa.ChunkedArray]]:
    """The columns of plain values in a column of structs or of lists of equal length."""
    kind = column.type
    if pa.types.is_struct(kind):
        for inner, part in zip(kind, column.flatten(), strict=True):
            yield from _leaves(f"{name}.{inner.name}", part)
        return
    if not (
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    ):
        yield name, column
        return
    ends = compute.min_max(compute.list_value_length(column)).as_py()
    least, most = ends["min"], ends["max"]
    if most is None or least != most:
        raise _NoChannelError(f"column {name!r} holds lists of {least} to {most} values")
    if most > MOST_COLUMNS:
        raise _NoChannelError(f"column {name!r} holds lists of {most} values, not a time series")
    for k in range(most):
        yield from _leaves(f"{name}[{k}]", compute.list_element(column, k))


def _nanoseconds(values: pa.ChunkedArray) -> tuple[pa.ChunkedArray, str]:
    """Times as integer nanoseconds, or in their own unit if these would overflow."""
    unit = values.type.unit
    whole = pa.int32() if values.type.bit_width == 32 else pa.int64()
    counts = values.cast(whole).cast(pa.int64())
    try:
        return compute.multiply_checked(counts, 10**9 // EPOCHS[unit]), "ns"
    except pa.ArrowInvalid:
        return counts, unit


def _name(column: str) -> str:
    """The name of a channel; pandas invents a name for an index without one."""
    return "index" if column.startswith("__index_level_") else column
