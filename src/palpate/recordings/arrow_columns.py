"""Columns of Arrow tables as channels: nulls, lists, structs, times and text."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa
import pyarrow.compute as compute
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.recordings.bounds import first_line, refuse_losses
from palpate.recordings.formats import Request
from palpate.recordings.nested import MOST_COLUMNS, text_of
from palpate.recordings.recording import Faults, Recording

#: What Arrow raises on a damaged file, whichever part of it is met.
DAMAGED = (pa.ArrowException, ArithmeticError, OSError, LookupError, TypeError, ValueError)

_NANOSECONDS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
_UNITS = (b"unit", b"units", b"Unit", b"Units")
# Of the file's own description: what is no word to a person.
_NO_NOTES = (b"pandas", b"ARROW:schema", b"ARROW:extension:name", b"geo", b"huggingface")
_INDEX = "__index_level_"


@dataclass(slots=True)
class Columns:
    """Channels as they are taken from a table, and what is to be said of them."""

    request: Request
    channels: dict[str, NDArray[Any]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    faults: dict[str, Faults] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    omissions: list[str] = field(default_factory=list)

    def take(self, form: pa.Field, column: pa.ChunkedArray) -> None:
        """Take a column of a table, or say why it is no channel."""
        name = name_of(form.name)
        unit = next((text_of(form.metadata[u]) for u in _UNITS if u in (form.metadata or {})), None)
        try:
            for leaf, values in _leaves(name, column):
                if not self.request.wants(leaf):
                    continue
                made, own_unit = self._values(leaf, values)
                self.channels[leaf] = made
                if own_unit or unit:
                    self.units[leaf] = own_unit or str(unit)
        except _NoChannelError as error:
            self.omissions.append(str(error))
        except DAMAGED as error:
            self.losses.append(f"column {name!r} cannot be read: {first_line(error)}")

    def recording(self, source: str, notes: Mapping[str, str]) -> Recording:
        """Return all channels.

        Raises
        ------
        RecordingError
            There are none, or the request is strict and something is lost.
        """
        if not self.channels:
            reasons = [*self.losses, *self.omissions, "it has no columns of numbers"]
            raise RecordingError(f"{source}: nothing in it can be read: {reasons[0]}")
        refuse_losses(source, self.losses, self.request)
        return Recording(
            self.channels,
            units=self.units,
            source=source,
            notes=notes,
            faults=self.faults,
            losses=tuple(self.losses),
            omissions=tuple(self.omissions),
        )

    def _values(self, name: str, values: pa.ChunkedArray) -> tuple[NDArray[Any], str | None]:
        """Numbers or text, and the unit that the type itself states."""
        kind = values.type
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
            values = values.cast(kind)
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            texts = values.fill_null("") if values.null_count else values
            return texts.to_numpy(), None
        unit = None
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind):
            values, unit = _nanoseconds(values)
        elif pa.types.is_decimal(kind):
            values = values.cast(pa.float64())
        elif not (
            pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)
        ):
            raise _NoChannelError(f"column {name!r} holds {kind}, and no numbers")
        if not values.null_count:
            return values.to_numpy(), unit
        first = int(compute.index(compute.is_null(values), True).as_py())
        self.faults[name] = Faults(values.null_count, first, "null")
        if not pa.types.is_floating(values.type):
            values = values.cast(pa.float64(), safe=False)
        return values.to_numpy(), unit


class _NoChannelError(ValueError):
    """A column holds no channel: the message says what it holds."""


def name_of(column: str) -> str:
    """Return the name of a channel; an index of pandas without one has a made-up name."""
    return "index" if column.startswith(_INDEX) else column


def notes_of(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return what a file says of itself, as far as that is short."""
    notes = {}
    for name, words in (metadata or {}).items():
        if name not in _NO_NOTES and len(words) <= 200:
            notes[str(text_of(name))] = str(text_of(words))
    return notes


def _leaves(name: str, column: pa.ChunkedArray) -> Iterator[tuple[str, pa.ChunkedArray]]:
    """Structs and lists as the columns that they are made of."""
    kind = column.type
    if pa.types.is_struct(kind):
        names = [kind.field(k).name for k in range(kind.num_fields)]
        for inner, part in zip(names, column.flatten(), strict=True):
            yield from _leaves(f"{name}.{inner}", part)
    elif _is_list(kind):
        for k, part in enumerate(_elements(name, column)):
            yield from _leaves(f"{name}[{k}]", part)
    else:
        yield name, column


def _is_list(kind: pa.DataType) -> bool:
    tests = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    return any(test(kind) for test in tests)


def _elements(name: str, column: pa.ChunkedArray) -> Sequence[pa.ChunkedArray]:
    """The first of each list, the second of each, and so on, where all are of one length."""
    ends = compute.min_max(compute.list_value_length(column)).as_py()
    least, most = ends["min"], ends["max"]
    if most is None or least != most:
        raise _NoChannelError(f"column {name!r} holds lists of {least} to {most} values")
    if most > MOST_COLUMNS:
        raise _NoChannelError(f"column {name!r} holds lists of {most} values, and is no series")
    return [compute.list_element(column, k) for k in range(most)]


def _nanoseconds(values: pa.ChunkedArray) -> tuple[pa.ChunkedArray, str]:
    """Times as whole nanoseconds, or in their own unit where these would not fit."""
    unit = values.type.unit
    whole = pa.int32() if values.type.bit_width == 32 else pa.int64()
    counts = values.cast(whole).cast(pa.int64())
    ends = compute.min_max(counts).as_py()
    largest = max(abs(ends["min"] or 0), abs(ends["max"] or 0))
    if largest * _NANOSECONDS[unit] >= 1 << 63:
        return counts, unit
    return compute.multiply(counts, _NANOSECONDS[unit]), "ns"
