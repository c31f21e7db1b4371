"""Parquet, Feather and Arrow, read by pyarrow: each column of numbers or text is a channel."""

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.ipc as ipc
import pyarrow.parquet as parquet

from palpate.errors import RecordingError
from palpate.input.recordings.nested import MOST_COLUMNS, UNIT_FIELDS, read_text
from palpate.input.recordings.opening import FAULTS, Draft, Request, excess, first_line
from palpate.input.recordings.recording import Faults, Recording
from palpate.input.recordings.times import EPOCHS

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
                count = sum(request.wants(_name(name)) for name in table.schema_arrow.names)
                size = 8 * table.metadata.num_rows * max(count, 1)
                if not 0 <= size <= request.max_size:
                    raise draft.error(excess("its columns need", size, request.max_size))
                columns = _ParquetColumns(table, request)
                return read_columns(table.schema_arrow, columns.read, draft)
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
    texts = [form.name for form in table.schema_arrow if _is_text(form.type)]
    if not texts:
        return table
    table.close()
    return parquet.ParquetFile(path, page_checksum_verification=True, read_dictionary=texts)


class _ParquetColumns:
    """Reads columns, some at a time: for each call pyarrow looks at all columns of the file."""

    def __init__(self, table: parquet.ParquetFile, request: Request) -> None:
        self._table = table
        self._request = request
        counts = Counter(table.schema_arrow.names)
        self._plain = [
            form.name
            for form in table.schema_arrow
            if request.wants(_name(form.name)) and counts[form.name] == 1
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
    batches = []
    size = 0
    for batch in table.iter_batches(rows, columns=names):
        batches.append(batch)
        size += batch.nbytes
        if size > request.max_size:
            raise ValueError(excess("it needs", size, request.max_size))
    return pa.Table.from_batches(batches) if batches else table.read(columns=names)


def _reserve(data: memoryview, request: Request) -> None:
    """Count the stated sizes of an Arrow file's compressed buffers, before unpacking any."""
    position = len(_BEGIN)
    with suppress(struct.error):  # cut off or damaged: the reader of the batches reports it
        while size := _word("I", data, position):
            if size == _CONTINUED:
                position += 4
                size = _word("I", data, position)
            position += 4
            position = _reserve_message(data, position, position + size, request)


def _reserve_message(data: memoryview, metadata: int, body: int, request: Request) -> int:
    """Count the buffers of a message, parsed as in the Arrow format's Message.fbs; return its end.

    A compressed buffer begins with its size; -1 means that it is stored as it is.
    """

    def field(table: int, number: int) -> int:  # where a field of a flatbuffers table is; or 0
        virtual = table - _word("i", data, table)
        inside = 4 + 2 * number < _word("H", data, virtual)
        offset = _word("H", data, virtual + 4 + 2 * number) if inside else 0
        return table + offset if offset else 0

    def follow(position: int) -> int:
        return position + _word("I", data, position)

    message = follow(metadata)
    kind = field(message, 1)
    length = field(message, 3)
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


def _word(form: str, data: memoryview, position: int) -> int:
    return int(struct.unpack_from(f"<{form}", data, position)[0])


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
    reader = ipc.open_stream(file)
    batches = []
    with suppress(*_DAMAGED):
        for batch in reader:
            batch.validate(full=True)
            batches.append(batch)
    table = pa.Table.from_batches(batches, reader.schema)
    losses.append(f"only the first {table.num_rows} samples are read")
    return table


def read_columns(schema: pa.Schema, table_of: Callable[[str], pa.Table], draft: Draft) -> Recording:
    """Return the columns of a schema that are requested; ``table_of`` reads one of them."""
    request = draft.request
    forms = [form for form in schema if request.wants(_name(form.name))]
    if not forms and len(schema):
        available = ", ".join(map(_name, schema.names[:20]))
        raise draft.error(f"no column {', '.join(request.channels or ())}; available: {available}")
    for k, form in enumerate(forms):
        name = _name(form.name)
        try:
            _add_column(name, table_of(form.name), _stated_unit(form), draft)
        except RecordingError:
            raise
        except _NoChannelError as error:
            draft.omissions.append(str(error))
        except _DAMAGED as error:
            draft.losses.append(f"column {name!r} cannot be read: {first_line(error)}")
        request.report((k + 1) / len(forms))
    if not draft.channels:
        reasons = [*draft.losses, *draft.omissions, "it has no columns of numbers"]
        raise draft.error(f"no column can be read: {reasons[0]}")
    for title, text in (schema.metadata or {}).items():
        if title not in _NO_NOTES:
            draft.note(str(read_text(title)), read_text(text))
    return draft.done()


def _stated_unit(form: pa.Field) -> str | None:
    metadata = form.metadata or {}
    return read_text(next(filter(None, (metadata.get(key.encode()) for key in UNIT_FIELDS)), None))


def _add_column(name: str, table: pa.Table, unit: str | None, draft: Draft) -> None:
    """Add the channels of a column: one, or one for each plain value in it."""
    table.validate(full=True)
    if table.num_columns != 1:
        raise ValueError("several columns have its name")
    for channel, values in _leaves(name, table.column(0)):
        if not draft.request.wants(channel):
            continue
        if pa.types.is_dictionary(values.type):
            draft.request.reserve(_size_of_texts(values))
        draft.request.reserve(8 * len(values))
        _add_channel(channel, values, unit, draft)


def _size_of_texts(values: pa.ChunkedArray) -> int:
    """Size of a dictionary-encoded text column after decoding."""
    if not _is_text(values.type.value_type):
        return 0
    lengths = (
        compute.binary_length(chunk.dictionary).take(chunk.indices) for chunk in values.chunks
    )
    return sum(compute.sum(length.cast(pa.int64())).as_py() or 0 for length in lengths)


def _is_text(kind: pa.DataType) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _add_channel(name: str, values: pa.ChunkedArray, unit: str | None, draft: Draft) -> None:
    """Add numbers or text; null values are faults."""
    if pa.types.is_dictionary(values.type):
        values = values.cast(values.type.value_type)
    kind = values.type
    if _is_text(kind):
        values = values.fill_null("")
    elif pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind):
        values, unit = _nanoseconds(values)
    elif pa.types.is_decimal(kind):
        values = values.cast(pa.float64())
    elif not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)):
        raise _NoChannelError(f"column {name!r} holds {kind}, not numbers")
    if values.null_count:
        first = compute.index(values.is_null(), True).as_py()
        draft.faults[name] = Faults(values.null_count, first, "null")
        if not pa.types.is_floating(values.type):
            values = values.cast(pa.float64(), safe=False)
    draft.channels[name] = values.to_numpy()
    if unit:
        draft.units[name] = unit


class _NoChannelError(ValueError):
    """A column is not a channel: the message describes its contents."""


def _leaves(name: str, column: pa.ChunkedArray) -> Iterator[tuple[str, pa.ChunkedArray]]:
    """The columns of plain values in a column of structs or of lists of equal length."""
    kind = column.type
    if pa.types.is_struct(kind):
        for inner, field in zip(kind, column.flatten(), strict=True):
            yield from _leaves(f"{name}.{inner.name}", field)
        return
    if not (
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    ):
        yield name, column
        return
    least, most = compute.min_max(compute.list_value_length(column)).as_py().values()
    if most is None or least != most:
        raise _NoChannelError(f"column {name!r} holds lists of {least} to {most} values")
    if most > MOST_COLUMNS:
        raise _NoChannelError(f"column {name!r} holds lists of {most} values, not a time series")
    for k in range(most):
        yield from _leaves(f"{name}[{k}]", compute.list_element(column, k))


def _nanoseconds(values: pa.ChunkedArray) -> tuple[pa.ChunkedArray, str]:
    """Times as integer nanoseconds, or in their own unit if these would overflow."""
    unit = values.type.unit
    integer = pa.int32() if values.type.bit_width == 32 else pa.int64()
    counts = values.cast(integer).cast(pa.int64())
    try:
        return compute.multiply_checked(counts, 10**9 // EPOCHS[unit]), "ns"
    except pa.ArrowInvalid:
        return counts, unit


def _name(column: str) -> str:
    """The name of a channel; pandas invents a name for an index without one."""
    return "index" if column.startswith("__index_level_") else column
