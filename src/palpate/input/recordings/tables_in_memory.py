"""Tables in memory: data frames, columns, rows, structured arrays, Arrow tables, xarray."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate.input.recordings.recording import Recording
from palpate.input.recordings.times import iso_nanoseconds, past_midnight
from palpate.validation import Values

# A table with these names is palpate's own, or as clear: its other columns are results.
_OWN = ("time", "penetration", "velocity", "force")


def recording_of_table(table: Any) -> Recording | None:
    """Return a table as a recording, with the units that it states; None if it is no table."""
    try:
        arrays, stated_units = _columns(table)
        columns = {str(name): (array, stated_units.get(name)) for name, array in arrays.items()}
    except (AttributeError, TypeError, LookupError, ValueError):
        return None
    if not columns:
        return None
    if {"penetration", "force"} <= columns.keys():
        columns = {name: columns[name] for name in _OWN if name in columns}
    channels = {}
    units = {}
    for name, (column, stated_unit) in columns.items():
        numbers, pint_unit = _without_unit(column)
        channels[name] = _array(numbers)
        if unit := stated_unit or pint_unit:
            units[name] = str(unit)
    return Recording(channels, units)


def _columns(table: Any) -> tuple[dict[Any, Any], Mapping[Any, Any]]:
    """Return the columns of a table by their names, and the units that it states."""
    if hasattr(table, "data_vars"):
        return _columns_of_xarray(table)
    if hasattr(table, "column_names"):
        return _columns_of_arrow(table)
    if isinstance(table, Mapping):
        return dict(table), {}
    if isinstance(table, np.ndarray):
        return {name: table[name] for name in table.dtype.names or ()}, {}
    if isinstance(table, Sequence):
        names = table[0].keys()
        return {name: [row[name] for row in table] for name in names}, {}
    columns = {name: table[name] for name in list(table.columns)}
    index = getattr(table, "index", None)
    # An index of pandas that has a name, or of times, is a column.
    if index is not None and (index.name is not None or index.dtype.kind in "mMf"):
        name = "time" if index.name is None else index.name
        columns = {name: index.to_numpy()} | columns
    return columns, getattr(table, "attrs", {}).get("units", {})


def _columns_of_xarray(table: Any) -> tuple[dict[Any, Any], Mapping[Any, Any]]:
    variables = {**table.coords, **table.data_vars}
    [along] = {variable.dims for variable in table.data_vars.values() if variable.ndim == 1}
    columns = {name: item for name, item in variables.items() if item.dims == along}
    units = {
        name: item.attrs.get("units", item.attrs.get("unit")) for name, item in columns.items()
    }
    return {name: item.to_numpy() for name, item in columns.items()}, units


def _columns_of_arrow(table: Any) -> tuple[dict[Any, Any], Mapping[Any, Any]]:
    units = {}
    for name in table.column_names:
        metadata = table.schema.field(name).metadata or {}
        units[name] = metadata.get(b"units", metadata.get(b"unit", b"")).decode()
    return {name: table.column(name).to_numpy() for name in units}, units


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
