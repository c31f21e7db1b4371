"""A recording: channels as they were recorded, and nothing done to them."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.errors import InvalidParameterError, MissingChannelError, RecordingError
from palpate.validation import Floats, unmasked

MOST_TEXT = 0.5  # of a channel's values: with more it is no channel of numbers


@dataclass(frozen=True, slots=True)
class Faults:
    """Cells of a channel of numbers that hold none.

    Attributes
    ----------
    count : int
        How many.
    sample : int
        The first one.
    text : str
        What that holds.
    """

    count: int
    sample: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Channels as recorded, with their units and their origin; :func:`palpate.prepare` goes on.

    Parameters
    ----------
    channels : mapping
        An array of numbers or of text for each name; NaN where a number is not known.
    units : mapping
        The unit of each channel, where it is known: ``"s"``, ``"m"``, ``"m/s"``, ``"N"``.
    source : str
        Where it came from: a file's name.
    notes : mapping
        What the file says of itself, in words.
    rows : sequence of int, optional
        The row of the file that each sample stands in, for messages; None where there are none.
    clocks : mapping
        The channel that holds the times of a channel, where that has a clock of its own; channels
        on one clock have one length. Those that are not named are on the clock of the file, whose
        channel the names or :func:`palpate.prepare` tell.
    frames : mapping
        The coordinate frame that a channel is in, where the file says it.
    types : mapping
        The type of a topic or of a group of channels, by what their names begin with:
        ``{"/ft": "geometry_msgs/msg/WrenchStamped"}``.
    faults : mapping
        Cells of a channel of numbers that hold none, which are NaN.
    losses : sequence of str
        What of the file could not be read, in sentences.
    omissions : sequence of str
        What was not read because it holds no numbers, or was not asked for.

    Raises
    ------
    InvalidParameterError
        A channel is no array, or a mask hides some of it.

    Notes
    -----
    A channel has one value a sample. A vector is several channels, whose names end with ``.x``,
    ``.y``, ``.z`` (and ``.w``), as messages have it, or with ``[0]``, ``[1]``, ``[2]``, as arrays.
    Times may be whole nanoseconds (unit ``"ns"``): seconds since 1970 in a float are not exact.
    """

    channels: Mapping[str, NDArray[Any]]
    units: Mapping[str, str] = field(default_factory=dict)
    source: str = ""
    notes: Mapping[str, str] = field(default_factory=dict)
    rows: Sequence[int] | None = None
    clocks: Mapping[str, str] = field(default_factory=dict)
    frames: Mapping[str, str] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)
    faults: Mapping[str, Faults] = field(default_factory=dict)
    losses: Sequence[str] = ()
    omissions: Sequence[str] = ()

    def __post_init__(self) -> None:
        channels = {}
        for name, values in self.channels.items():
            unmasked(f"channel {name!r}", values)
            try:
                channels[name] = np.asarray(values)
            except (TypeError, ValueError):
                raise InvalidParameterError(
                    f"channel {name!r} must be an array, not {type(values).__name__}"
                ) from None
        object.__setattr__(self, "channels", channels)

    def channel(self, name: str) -> NDArray[Any]:
        """Return a channel as it was recorded.

        Raises
        ------
        MissingChannelError
            There is no channel of this name.
        """
        if name not in self.channels:
            raise MissingChannelError(name, list(self.channels), self.source)
        return self.channels[name]

    def numbers(self, name: str, *, strict: bool = False) -> Floats:
        """Return a channel as numbers.

        Parameters
        ----------
        name : str
            The channel.
        strict : bool
            Refuse a value that is no number; else it is NaN, unless hardly any is one.

        Raises
        ------
        MissingChannelError
            There is no channel of this name.
        RecordingError
            It holds something other than one number a sample: the message says where.
        """
        values = self.channel(name)
        if values.ndim != 1:
            raise RecordingError(
                f"{self.place(name)}: one number a sample is needed, and this has the shape "
                f"{values.shape}"
            )
        if strict and name in self.faults:
            fault = self.faults[name]
            raise RecordingError(f"{self.place(name, fault.sample)}: {_fault(fault.text)}")
        if values.dtype.kind in "fiub":
            return np.ascontiguousarray(values, dtype=np.float64)
        if values.dtype.kind in "OUS":
            return self._numbers_of_text(name, values, strict=strict)
        raise RecordingError(
            f"{self.place(name)}: numbers are needed, and this holds {values.dtype}"
        )

    def place(self, name: str, sample: int | None = None) -> str:
        """Where a channel, or a sample of it, is found: file, column and row, in words."""
        words = f"{self.source}: " if self.source else ""
        words += f"column {name!r}"
        if sample is None:
            return words
        if self.rows is None:
            return f"{words}, sample {sample}"
        return f"{words}, row {self.rows[sample]}"

    def _numbers_of_text(self, name: str, values: NDArray[Any], *, strict: bool) -> Floats:
        found = [_number_of(value) for value in values]
        wrong = [sample for sample, number in enumerate(found) if number is None]
        if wrong and (strict or len(wrong) > MOST_TEXT * values.size):
            raise RecordingError(f"{self.place(name, wrong[0])}: {_fault(values[wrong[0]])}")
        return np.array([np.nan if number is None else number for number in found])


def _number_of(value: Any) -> float | None:
    try:
        return number_in_text(value) if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return None


def number_in_text(text: str) -> float:
    """Return the number that a cell holds; a ValueError where it holds none."""
    if "_" in text:  # to Python 1_000 is a number
        raise ValueError
    return float(text)


def printable(path: str | Path) -> str:
    """Return a path as text that can be encoded: bytes that are no UTF-8 in hexadecimal."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def _fault(value: Any) -> str:
    blank = isinstance(value, str) and not value.strip()
    return "the value is missing" if blank else f"{_shown(value)} is not a number"


def _shown(value: Any) -> str:
    """Any value on a line, cut off after some 40 characters."""
    text = repr(value.strip()[:40] if isinstance(value, str) else value)
    return text if len(text) < 200 else f"{text[:40]}…"
