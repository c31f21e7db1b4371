"""JSON: an object a line, an array of objects, or an object of columns, in groups or not."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.input.recordings.nested import MOST_COLUMNS, UNIT_FIELDS, Arrays
from palpate.input.recordings.opening import Request, first_line, read_whole
from palpate.input.recordings.recording import Faults, Recording
from palpate.input.recordings.times import clock_rank, iso_nanoseconds
from palpate.validation import Values

_VALUE = 16  # bytes of a value in a list and in an array


def read(path: Path, request: Request) -> Recording:
    """Read samples, one object each, or columns; a nested object is a group with its key as name.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The file is not JSON, is cut off, or holds no columns of numbers.
    """
    arrays = Arrays(request)
    try:
        content = _parse_json(read_whole(path, request), arrays)
        if isinstance(content, list):
            _add_samples(arrays, "", content)
        elif isinstance(content, dict):
            _add_columns(arrays, "", content)
    except RecursionError:
        raise arrays.error("the JSON is nested too deeply for a table") from None
    request.release()
    return arrays.recording()


def _parse_json(content: bytes, arrays: Arrays) -> Any:
    """Parse a file as one JSON value, or line by line as a list; skip damaged lines."""
    text = content.decode("utf-8-sig", "replace")
    try:
        return json.loads(text)
    except ValueError as error:
        message = f"the file is not JSON, or is cut off ({first_line(error)}); copy it again"
    samples = []
    wrong = []
    for row, line in enumerate(text.split("\n"), start=1):
        try:
            samples += [json.loads(line)] if line.strip() else []
        except ValueError:
            wrong.append(row)
            if len(wrong) > len(samples):
                raise arrays.error(message) from None
    if wrong:
        arrays.lose(f"line {wrong[0]}", f"is not JSON, one of {len(wrong)} that palpate skipped")
    return samples


def _add_samples(arrays: Arrays, group: str, samples: Sequence[Any]) -> None:
    """Add a channel for each value in the samples; a value that a sample lacks is null."""
    columns: dict[str, list[Any]] = {}
    for row, sample in enumerate(samples):
        for name, value in _leaves(sample, "" if isinstance(sample, dict) else "column"):
            column = columns.setdefault(name, [])
            arrays.request.reserve(_VALUE * (row - len(column)))
            column += [None] * (row - len(column))
            column[row:] = [value]
        arrays.check_names(len(columns))
    arrays.request.reserve(_VALUE * sum(len(samples) - len(column) for column in columns.values()))
    for name, column in columns.items():
        _add(arrays, group, name, column + [None] * (len(samples) - len(column)))


def _leaves(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """The plain values of a sample, ``pose.position[0]``, with their names."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for k, inner in enumerate(value[:MOST_COLUMNS]):
            yield from _leaves(inner, f"{name}[{k}]")
    else:
        yield name, value


def _add_columns(arrays: Arrays, group: str, content: Mapping[str, Any]) -> None:
    units: Mapping[str, Any] = {}
    for name in UNIT_FIELDS:
        units = content[name] if isinstance(content.get(name), dict) else units
    for name, value in content.items():
        if isinstance(value, dict) and "".join(value).isdecimal():  # pandas numbers the rows
            value = list(value.values())
        if isinstance(value, list) and any(isinstance(sample, dict) for sample in value[:1]):
            _add_samples(arrays, f"{group}{name}/", value)
        elif isinstance(value, list):
            _add(arrays, group, name, value, units.get(name))
        elif isinstance(value, dict):
            _add_columns(arrays, f"{group}{name}/", value)
        else:
            arrays.note(group + name, value)


def _add(arrays: Arrays, group: str, name: str, values: list[Any], unit: object = None) -> None:
    """Add a column of numbers, times or lists of numbers; report any other contents."""
    array, is_time = _array(values)
    if array.dtype == object and (clock_rank(name) is not None or not isinstance(values[0], str)):
        arrays.omit(group + name, "holds text or lists of several lengths, not numbers")
        return
    null = [k for k, value in enumerate(values) if value is None]
    if null:
        arrays.faults[group + name] = Faults(len(null), null[0], "null")
    unit = "ns" if is_time else unit if isinstance(unit, str) else None
    arrays.add(group, name, array.shape, lambda: array, unit=unit)


def _array(values: list[Any]) -> tuple[Values, bool]:
    """The values as an array, and whether they are times in nanoseconds since 1970."""
    if all(type(value) is int and abs(value) < 1 << 63 for value in values):
        return np.array(values, np.int64), False
    try:
        return np.array(values, float), False  # null is NaN
    except (OverflowError, TypeError, ValueError):
        times = [iso_nanoseconds(value) if isinstance(value, str) else None for value in values]
    if None not in times:
        return np.array(times, np.int64), True
    objects = np.empty(len(values), object)
    objects[:] = values
    return objects, False
