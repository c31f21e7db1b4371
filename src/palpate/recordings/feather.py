"""Feather and Arrow files: batches of columns, by pyarrow."""

from pathlib import Path

import pyarrow as pa
import pyarrow.ipc as ipc

from palpate.errors import RecordingError
from palpate.recordings.arrow_columns import DAMAGED, Columns, name_of, notes_of
from palpate.recordings.arrow_messages import unpacked_size
from palpate.recordings.bounds import first_line, in_words, most_unpacked, regular_size
from palpate.recordings.formats import Request
from palpate.recordings.recording import Recording, printable

_BEGIN = b"ARROW1\0\0"


def read(path: Path, request: Request) -> Recording:
    """Read a Feather (version 2) or Arrow file: every column of numbers or text.

    What a recorder that was stopped has written is read up to its last whole batch.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        The file is no Feather, or too damaged, or has no column that is asked for.
    """
    source = printable(path)
    size = regular_size(path)
    _check(path, size, source)
    columns = Columns(request)
    try:
        with pa.OSFile(str(path)) as file:
            schema, batches = _batches(file, columns.losses)
            names = [name_of(name) for name in schema.names]
    except DAMAGED as error:
        raise RecordingError(
            f"{source}: the file is damaged and cannot be read ({first_line(error)}); copy it again"
        ) from None
    wanted = [k for k, name in enumerate(names) if request.wants(name)]
    if not wanted and names:
        asked = ", ".join(request.channels or ())
        there = ", ".join(names[:20])
        raise RecordingError(f"{source}: none of the columns {asked}; there are {there}")
    for done, k in enumerate(wanted):
        form = schema.field(k)
        chunks = [batch.column(k) for batch in batches]
        columns.take(form, pa.chunked_array(chunks, form.type))
        request.report((done + 1) / len(wanted))
    return columns.recording(source, notes_of(schema.metadata))


def _check(path: Path, size: int, source: str) -> None:
    """Whether this is such a file, and can hold what it claims."""
    with path.open("rb") as file:
        begin = file.read(8)
        if begin.startswith(b"FEA1"):
            raise RecordingError(
                f"{source}: this is Feather of version 1; write it again with a pandas or "
                "pyarrow of today"
            )
        if begin != _BEGIN:
            raise RecordingError(f"{source}: this is no Feather file; check what wrote it")
        claimed = unpacked_size(file, size)
    if claimed > most_unpacked(size):
        raise RecordingError(
            f"{source}: the file claims {in_words(claimed)} of values, and has {in_words(size)}; "
            "it is damaged, or no recording"
        )


def _batches(file: pa.NativeFile, losses: list[str]) -> tuple[pa.Schema, list[pa.RecordBatch]]:
    """All whole batches; where the directory at the end is gone, one after the other."""
    batches: list[pa.RecordBatch] = []
    try:
        reader = ipc.open_file(file)
        count = reader.num_record_batches
    except DAMAGED:
        file.seek(len(_BEGIN))
        reader, count = ipc.open_stream(file), None
        losses.append("the file is cut off: its directory, which stands at its end, is missing")
    try:
        while count is None or len(batches) < count:
            batch = reader.read_next_batch() if count is None else reader.get_batch(len(batches))
            batch.validate(full=True)
            batches.append(batch)
    except StopIteration:
        pass
    except DAMAGED as error:
        rows = sum(batch.num_rows for batch in batches)
        losses.append(f"nothing is read after sample {rows}: {first_line(error)}")
    return reader.schema, batches
