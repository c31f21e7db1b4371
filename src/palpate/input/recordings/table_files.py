"""Writing tables and contacts: Parquet by pyarrow, or CSV."""

import io
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from palpate.errors import InvalidParameterError, import_extra
from palpate.method.contact import Contact
from palpate.validation import Values
from palpate.writing import begin_table, write_bytes, write_formatted, write_text

_ROWS = 100_000  # rows in a batch of formatted text


def write_columns(
    columns: Mapping[str, Values],
    path: Path,
    *,
    units: Mapping[str, str] | None = None,
    notes: Mapping[str, str] | None = None,
    inputs: Sequence[Path] = (),
) -> None:
    """Write columns of equal length, completely or not at all, without rounding.

    :func:`palpate.open_recording` reads the file with its units and notes. Parquet stores a unit in
    the metadata of its column, CSV in a note.

    Parameters
    ----------
    columns : mapping
        One-dimensional arrays of numbers or text.
    path : Path
        Ends in .parquet or .csv.
    units, notes : mapping, optional
        Units of columns, and notes about the table.
    inputs : sequence of Path
        Files that must not be overwritten.

    Raises
    ------
    InvalidParameterError
        The path has another suffix.
    MissingExtraError
        The file is Parquet and pyarrow is not installed.
    RecordingError
        The path cannot be written.
    """
    ending = path.suffix.lower()
    if ending == ".parquet":
        write_bytes(path, _as_parquet(columns, units or {}, notes or {}), inputs)
    elif ending == ".csv":
        write_text(path, _as_csv(columns, units or {}, notes or {}), inputs)
    else:
        raise InvalidParameterError(f"{path}: the name of a table must end in .parquet or .csv")


def has_pyarrow() -> bool:
    """Whether pyarrow is installed, which writes Parquet."""
    return find_spec("pyarrow") is not None


def _as_parquet(
    columns: Mapping[str, Values], units: Mapping[str, str], notes: Mapping[str, str]
) -> bytes:
    pa = import_extra("pyarrow", "writing Parquet (instead of .csv)", "recordings")
    parquet = import_extra("pyarrow.parquet", "writing Parquet", "recordings")
    # pa.array would import pandas to check whether the values are its own.
    arrays = []
    for values in columns.values():
        if values.dtype.kind == "U":
            texts = [text.encode() for text in values.tolist()]
            ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
            content = pa.py_buffer(b"".join(texts))
            arrays.append(pa.StringArray.from_buffers(len(texts), pa.py_buffer(ends), content))
            continue
        numbers = [None, pa.py_buffer(np.ascontiguousarray(values))]
        kind = pa.from_numpy_dtype(values.dtype)
        arrays.append(pa.Array.from_buffers(kind, len(values), numbers))
    fields = [
        pa.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    table = pa.table(arrays, schema=pa.schema(fields, metadata=dict(notes)))
    written = io.BytesIO()
    parquet.write_table(table, written, compression="zstd")
    return written.getvalue()


def _as_csv(
    columns: Mapping[str, Values], units: Mapping[str, str], notes: Mapping[str, str]
) -> str:
    listed = ", ".join(f"{name} {unit}" for name, unit in units.items())
    text = begin_table({**notes, **({"units": listed} if units else {})}, columns)
    length = len(next(iter(columns.values())))
    for start in range(0, length, _ROWS):
        # repr is the shortest text that parses to the same number.
        cells = [
            map(str if values.dtype.kind == "U" else repr, values[start : start + _ROWS].tolist())
            for values in columns.values()
        ]
        text.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))
    return text.getvalue()


def write_contact(
    contact: Contact,
    path: str | Path,
    notes: Mapping[str, str] | None = None,
    *,
    velocity: bool = False,
) -> None:
    """Write a contact as CSV, completely or not at all, with its provenance above the header.

    Parameters
    ----------
    contact : Contact
        For example from :meth:`palpate.lab.Bench.run`. Several segments add a column ``segment``.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines, above the lines of the contact's ``provenance``.
    velocity : bool
        Write the velocity too. Default: omit it; palpate computes it when reading the file.

    Raises
    ------
    RecordingError
        The path cannot be written.

    Examples
    --------
    >>> import palpate
    >>> contact = palpate.prepare("examples/recordings/ball.csv", window=(3.0, 4.0))
    >>> palpate.write_contact(contact, "one_second.csv")
    >>> palpate.prepare("one_second.csv")
    <Contact 'one_second.csv': 1001 samples from 3 s to 4 s>
    """
    head = {**(notes or {}), **contact.provenance}
    if not velocity:
        head.pop("velocity", None)
    elif contact.velocity_filter is not None:
        head |= contact.velocity_filter.as_note()
    columns = {"time_s": (contact.time, "%.9g"), "penetration_m": (contact.penetration, "%.7g")}
    if velocity:
        columns["velocity_m_s"] = contact.velocity, "%.7g"
    columns["force_N"] = contact.force, "%.7g"
    if contact.segment[-1:].any():
        columns["segment"] = (contact.segment + 1).astype(np.float64), "%d"
    write_formatted(columns, Path(path), head)
