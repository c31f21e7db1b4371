"""JSON: an object a line, an array of objects, or an object of columns, in groups or not."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.nested import MOST_COLUMNS, UNIT_FIELDS, Findings
from palpate.recordings.opening import Request, first_line, read_whole
from palpate.recordings.recording import Faults, Recording
from palpate.recordings.times import clock_rank, iso_nanoseconds

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
    found = Findings(request)
    try:
        whole = _parse_json(read_whole(path, request), found)
        if isinstance(whole, list):
            _add_samples(found, (), whole)
        elif isinstance(whole, dict):
            _add_columns(found, (), whole)
    except RecursionError:
        raise found.error("the JSON is nested too deeply for a table") from None
    request.release()
    return found.recording()


def _parse_json(content: bytes, found: Findings) -> Any:
    """Parse a file as one JSON value, or line by line as a list; skip damaged lines."""
    text = content.decode("utf-8-sig", "replace")
    try:
        return json.loads(text)
    except ValueError as error:
        words = f"the file is not JSON, or is cut off ({first_line(error)}); copy it again"
    samples, wrong = [], []
    for row, line in enumerate(text.split("\n"), start=1):
        try:
            samples += [json.loads(line)] if line.strip() else []
        except ValueError:
            wrong.append(row)
            if len(wrong) > len(samples):
                raise found.error(words) from None
    if wrong:
        found.lose(f"line {wrong[0]}", f"is not JSON, one of {len(wrong)} that palpate skipped")
    return samples


def _add_samples(found: Findings, group: tuple[str, ...], samples: Sequence[Any]) -> None:
    """Add a channel for each value in the samples; a value that a sample lacks is null."""
    columns: dict[str, list[Any]] = {}
    for row, sample in enumerate(samples):
        for name, value in _leaves(sample, "" if isinstance(sample, dict) else "column"):
            column = columns.setdefault(name, [])
            found.request.reserve(_VALUE * (row - len(column)))
            column += [None] * (row - len(column))
            column[row:] = [value]
        found.check_names(len(columns))
    found.request.reserve(_VALUE * sum(len(samples) - len(each) for each in columns.values()))
    for name, column in columns.items():
        _add(found, group, name, column + [None] * (len(samples) - len(column)))


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


def _add_columns(found: Findings, group: tuple[str, ...], whole: Mapping[str, Any]) -> None:
    units: Mapping[str, Any] = {}
    for name in UNIT_FIELDS:
        units = whole[name] if isinstance(whole.get(name), dict) else units
    for name, value in whole.items():
        if isinstance(value, dict) and "".join(value).isdecimal():  # pandas numbers the rows
            value = list(value.values())
        if isinstance(value, list) and any(isinstance(each, dict) for each in value[:1]):
            _add_samples(found, (*group, name), value)
        elif isinstance(value, list):
            _add(found, group, name, value, units.get(name))
        elif isinstance(value, dict):
            _add_columns(found, (*group, name), value)
        else:
            found.note("/".join((*group, name)), value)


def _add(
    found: Findings, group: tuple[str, ...], name: str, values: list[Any], unit: object = None
) -> None:
    """Add a column of numbers, times or lists of numbers; report any other contents."""
    whole = "/".join((*group, name))
    array, is_time = _array(values)
    if array.dtype == object and (clock_rank(name) is not None or not isinstance(values[0], str)):
        found.omit(whole, "holds text or lists of several lengths, not numbers")
        return
    null = [k for k, value in enumerate(values) if value is None]
    if null:
        found.faults[whole] = Faults(len(null), null[0], "null")
    unit = "ns" if is_time else unit if isinstance(unit, str) else None
    found.add(group, name, array.shape, lambda: array, unit=unit)


def _array(values: list[Any]) -> tuple[NDArray[Any], bool]:
    """The values as an array, and whether they are times in nanoseconds since 1970."""
    if all(type(value) is int and abs(value) < 1 << 63 for value in values):
        return np.array(values, np.int64), False
    try:
        return np.array(values, float), False  # null is NaN
    except (OverflowError, TypeError, ValueError):
        times = [iso_nanoseconds(value) if isinstance(value, str) else None for value in values]
    if None not in times:
        return np.array(times, np.int64), True
    words = np.empty(len(values), object)
    words[:] = values
    return words, False
