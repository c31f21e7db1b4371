"""Tables of named columns, and contacts, written: Parquet by pyarrow, or CSV."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.writing import write_bytes, write_text

_ROWS = 100_000  # of text that are made at once


def write_columns(
    columns: Mapping[str, NDArray[Any]],
    path: Path,
    *,
    units: Mapping[str, str] | None = None,
    notes: Mapping[str, str] | None = None,
    inputs: Sequence[Path] = (),
) -> None:
    """Write columns of equal length, whole or not at all; every number comes back as it was.

    :func:`palpate.open_recording` reads it, with units and notes. A unit is in the description of
    its column in Parquet, and in a note in CSV.

    Parameters
    ----------
    columns : mapping
        One-dimensional arrays of numbers or text.
    path : Path
        Ends in .parquet or .csv.
    units, notes : mapping, optional
        Units of columns, and what else is to be said.
    inputs : sequence of Path
        Files that must not be written over.

    Raises
    ------
    InvalidParameterError
        The path has another ending.
    MissingExtraError
        Parquet is asked for, and pyarrow is not installed.
    RecordingError
        The path cannot be written.
    """
    ending = path.suffix.lower()
    if ending == ".parquet":
        write_bytes(path, _as_parquet(columns, units or {}, notes or {}), inputs)
    elif ending == ".csv":
        write_text(path, _as_csv(columns, units or {}, notes or {}), inputs)
    else:
        raise InvalidParameterError(f"{path}: a table's name must end in .parquet or .csv")


def has_parquet() -> bool:
    """Whether pyarrow, which writes Parquet, is installed."""
    try:
        import pyarrow.parquet  # noqa: F401 - whether it can be imported is the question
    except ImportError:
        return False
    return True


def _as_parquet(
    columns: Mapping[str, NDArray[Any]], units: Mapping[str, str], notes: Mapping[str, str]
) -> bytes:
    try:
        import pyarrow as pa
        import pyarrow.parquet as parquet
    except ImportError:
        raise MissingExtraError(
            "Parquet needs pyarrow: pip install 'palpate[recordings]', or write .csv"
        ) from None
    arrays = [pa.array(values) for values in columns.values()]
    fields = [
        pa.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    table = pa.table(arrays, schema=pa.schema(fields, metadata=dict(notes)))
    written = io.BytesIO()
    parquet.write_table(table, written, compression="zstd")
    return written.getvalue()


def _as_csv(
    columns: Mapping[str, NDArray[Any]], units: Mapping[str, str], notes: Mapping[str, str]
) -> str:
    text = io.StringIO()
    units_note = {"units": ", ".join(f"{name} {unit}" for name, unit in units.items())}
    for name, words in {**notes, **(units_note if units else {})}.items():
        text.write(f"# {name}: {' '.join(words.split())}\n")
    text.write(",".join(columns) + "\n")
    length = len(next(iter(columns.values())))
    for start in range(0, length, _ROWS):
        # repr: the shortest text that is the same number again.
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
    """Write a contact as CSV, whole or not at all, with what is known of it above the header.

    Parameters
    ----------
    contact : Contact
        For instance of :meth:`palpate.lab.Bench.run`. Several segments get a column.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines for its head, before those of the contact's ``provenance``.
    velocity : bool
        Write the velocity too. Most rigs record none, and it is worked out when it is needed.

    Raises
    ------
    RecordingError
        The path cannot be written.
    """
    head = {**(notes or {}), **contact.provenance}
    if not velocity:
        head.pop("velocity", None)
    columns = {"time_s": (contact.time, "%.9g"), "penetration_m": (contact.penetration, "%.7g")}
    if velocity:
        columns["velocity_m_s"] = contact.velocity, "%.7g"
    columns["force_N"] = contact.force, "%.7g"
    if contact.segment[-1:].any():
        columns["segment"] = (contact.segment + 1).astype(np.float64), "%d"
    text = io.StringIO()
    for name, words in head.items():
        text.write(f"# {name}: {' '.join(words.split())}\n")
    text.write(",".join(columns) + "\n")
    table = np.column_stack([values for values, _ in columns.values()])
    np.savetxt(text, table, fmt=[form for _, form in columns.values()], delimiter=",")
    write_text(Path(path), text.getvalue())
