"""Tables in memory: data frames, columns, rows, structured arrays, Arrow tables, xarray."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from palpate.recordings.recording import Recording
from palpate.recordings.times import iso_nanoseconds, past_midnight
from palpate.validation import Values

# A table with these names is palpate's own, or as clear: its other columns are results.
_OWN = ("time", "penetration", "velocity", "force")


def recording_of_table(table: Any) -> Recording | None:
    """Return a table as a recording, with the units that it states; None if it is no table."""
    try:
        columns = {str(name): (column, unit) for name, column, unit in _columns(table)}
    except (AttributeError, TypeError, LookupError, ValueError):
        return None
    if not columns:
        return None
    if {"penetration", "force"} <= columns.keys():
        columns = {name: columns[name] for name in _OWN if name in columns}
    arrays = {}
    units = {}
    for name, (column, stated_unit) in columns.items():
        numbers, pint_unit = _without_unit(column)
        arrays[name] = _array(numbers)
        if unit := stated_unit or pint_unit:
            units[name] = str(unit)
    return Recording(arrays, units=units)


def _columns(table: Any) -> Iterator[tuple[Any, Any, str | None]]:
    """Return an iterator over name, values and unit of each column."""
    if hasattr(table, "data_vars"):
        return _columns_of_xarray(table)
    if hasattr(table, "column_names"):
        return _columns_of_arrow(table)
    if isinstance(table, Mapping):
        return ((name, column, None) for name, column in table.items())
    if isinstance(table, np.ndarray):
        return ((name, table[name], None) for name in table.dtype.names or ())
    if isinstance(table, Sequence):
        names = table[0].keys()
        return ((name, [row[name] for row in table], None) for name in names)
    return _columns_of_frame(table)


def _columns_of_xarray(table: Any) -> Iterator[tuple[Any, Any, str | None]]:
    [along] = {variable.dims for variable in table.data_vars.values() if variable.ndim == 1}
    for name, variable in {**table.coords, **table.data_vars}.items():
        if variable.dims == along:
            unit = variable.attrs.get("units", variable.attrs.get("unit"))
            yield name, variable.to_numpy(), unit


def _columns_of_arrow(table: Any) -> Iterator[tuple[Any, Any, str | None]]:
    for name in table.column_names:
        notes = table.schema.field(name).metadata or {}
        unit = notes.get(b"units", notes.get(b"unit", b"")).decode()
        yield name, table.column(name).to_numpy(), unit or None


def _columns_of_frame(table: Any) -> Iterator[tuple[Any, Any, str | None]]:
    """Columns of pandas or polars; an index that has a name, or of times, is one of them."""
    units = getattr(table, "attrs", {}).get("units", {})
    index = getattr(table, "index", None)
    if index is not None and (index.name is not None or index.dtype.kind in "mMf"):
        name = "time" if index.name is None else index.name
        yield name, index.to_numpy(), units.get(name)
    for name in list(table.columns):
        yield name, table[name], units.get(name)


def _without_unit(column: Any) -> tuple[Any, str | None]:
    """Return the numbers of a column of pint, and their unit."""
    column = getattr(column, "pint", column)  # of a data frame with its units in the types
    if hasattr(column, "magnitude") and hasattr(column, "units"):
        return np.asarray(column.magnitude), f"{column.units:~}"
    return column, None


def _array(column: Any) -> Values:
    values: Values = np.asanyarray(column)
    if values.dtype.kind in "OU" and len(values) and isinstance(values[0], str):
        times = [iso_nanoseconds(str(value)) for value in values]
        if None not in times:
            return past_midnight(np.array(times, np.int64)).astype("m8[ns]")
    if values.dtype == object and hasattr(column, "isna"):  # pandas' NA is not a number
        return np.where(column.isna(), np.nan, values)
    return values
