"""A recording: channels as they were recorded, with units and origin."""

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import InvalidParameterError, MissingChannelError, RecordingError
from palpate.errors import printable as visible
from palpate.findings import Check, Finding
from palpate.force_laws import ForceLaw, law_from
from palpate.input.recordings.units import find_unit, find_unit_in_name, plain_unit
from palpate.validation import Floats, Values, frozen, reject_masks, shown

# With an apostrophe or a narrow space, or with a comma that cannot be the decimal mark.
_THOUSANDS = re.compile(
    r"\s*[+-]?[1-9]\d{0,2}"
    r"((['\u2019\u00a0\u2009\u202f]\d{3})+(\.\d*)?|(,\d{3})+\.\d*|(,\d{3}){2,})\s*"
)
MOST_TEXT = 0.5  # largest fraction of text values in a channel of numbers


@frozen
class Faults:
    """Values of a numeric channel that are not numbers.

    Attributes
    ----------
    count : int
        How many.
    sample : int
        Index of the first.
    text : str
        Its text.
    """

    count: int
    sample: int
    text: str


@frozen(eq=False)
class Recording:
    """Channels as recorded, with units and origin; :func:`palpate.prepare` makes a contact of it.

    Parameters
    ----------
    channels : mapping
        Name to array of numbers or text; unknown numbers are NaN.
    units : mapping
        Name to unit, if known: ``"s"``, ``"m"``, ``"m/s"``, ``"N"``.
    source : str
        The name of the file.
    notes : mapping
        Texts of the file about itself, by name.
    rows : sequence of int, optional
        The row of the file for each sample, for messages; None for files without rows.
    clocks : mapping
        Name of a channel to name of the channel with its times. Channels on one clock have equal
        length. Channels not listed are on the clock of the file, which :func:`palpate.prepare`
        finds by its name or takes from its arguments.
    frames : mapping
        Name to coordinate frame, if the file states it.
    types : mapping
        The type of a topic or group of channels, by the beginning of their names:
        ``{"/ft": "geometry_msgs/msg/WrenchStamped"}``.
    faults : mapping
        Name of a numeric channel to its values that are not numbers; these are NaN.
    plots : mapping
        Name of a channel to ``"signal"`` or ``"axis"``, if the file states how to plot it.
    findings : sequence of Finding
        Parts of the file that could not be read (``with-care``); and, as notes, parts skipped
        because they hold no numbers or were not requested.
    settings : mapping
        Settings that the file states, SI: ``"rate"`` of the samples, ``"tip radius"``, ``"spring
        constant"``, ``"specimen height"``, ``"specimen diameter"``, ``"specimen area"``.
    table : str
        For messages: where in a text the reader found the table; empty for other files.
    episode : int, optional
        Number of the episode of a data set that this is.
    episodes : sequence of Recording
        The episodes of a data set, if several were read; the channels are those of the first.

    Raises
    ------
    InvalidParameterError
        A channel is not an array, or a mask hides some of it.

    Notes
    -----
    A channel has one value per sample. A vector is several channels, whose names end with ``.x``,
    ``.y``, ``.z`` (and ``.w``), as in messages, or with ``[0]``, ``[1]``, ``[2]``, as in arrays.
    Times may be integer nanoseconds (unit ``"ns"``): a float of seconds since 1970 is not exact.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> channels = {"t": np.arange(3) / 1000, "z": np.array([0.0, 1.0, 2.0]), "Fz": np.ones(3)}
    >>> recording = palpate.Recording(channels, units={"t": "s", "z": "mm", "Fz": "N"})
    >>> recording.numbers("z").tolist(), recording.unit_of("z")
    ([0.0, 1.0, 2.0], 'mm')
    """

    channels: Mapping[str, Values]
    units: Mapping[str, str] = field(default_factory=dict)
    source: str = ""
    notes: Mapping[str, str] = field(default_factory=dict)
    rows: Sequence[int] | None = None
    clocks: Mapping[str, str] = field(default_factory=dict)
    frames: Mapping[str, str] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)
    faults: Mapping[str, Faults] = field(default_factory=dict)
    plots: Mapping[str, str] = field(default_factory=dict)
    findings: Sequence[Finding] = ()
    settings: Mapping[str, float] = field(default_factory=dict)
    table: str = ""
    episode: int | None = None
    episodes: "Sequence[Recording]" = ()

    def __post_init__(self) -> None:
        channels = {}
        for name, values in self.channels.items():
            reject_masks(f"channel {name!r}", values)
            try:
                channels[name] = np.asarray(values)
            except (TypeError, ValueError):
                raise InvalidParameterError(
                    f"channel {name!r} must be an array, not {type(values).__name__}"
                ) from None
        object.__setattr__(self, "channels", channels)

    def __repr__(self) -> str:
        sizes = {len(np.atleast_1d(values)) for values in self.channels.values()} or {0}
        samples = " to ".join(map(str, sorted({min(sizes), max(sizes)})))
        head = f"<Recording {shown(Path(self.source).name, 30)}: {len(self.channels)} channels,"
        names = visible(", ".join(map(str, self.channels)))
        return f"{head} {samples} samples\n  {names[:76]}{'…' * (len(names) > 76)}>"

    @property
    def losses(self) -> tuple[str, ...]:
        """Sentences on the parts of the file that could not be read."""
        return tuple(f.message for f in self._on_file if f.severity != "note")

    @property
    def omissions(self) -> tuple[str, ...]:
        """Sentences on the parts skipped because they hold no numbers or were not requested."""
        return tuple(f.message for f in self._on_file if f.severity == "note")

    @property
    def _on_file(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.check == Check.FILE]

    def channel(self, name: str) -> Values:
        """Return a channel as it was recorded.

        Raises
        ------
        MissingChannelError
            There is no channel of this name.
        """
        if name not in self.channels:
            raise MissingChannelError(name, list(self.channels), self.source)
        return self.channels[name]

    def unit_of(self, name: str) -> str | None:
        """Return the unit of a channel, from the file, else from its name; None if unknown.

        Brackets in the name of an element of a message contain a joint or a frame, not a unit.
        """
        if unit := self.units.get(name):
            return plain_unit(unit)
        return None if name.endswith("]") and self._is_in_topic(name) else find_unit(name)

    def states_unit(self, name: str) -> bool:
        """Whether the file states the unit: in a row, an attribute or brackets, not as a suffix."""
        if self._is_in_topic(name):  # the type of a message only says which unit is usual
            return False
        unit, is_stated = find_unit_in_name(name)
        # Text lists suffixes too.
        return is_stated or (name in self.units and plain_unit(self.units[name]) != unit)

    def assumes_unit(self, name: str) -> bool:
        """Whether this is a file that states the unit nowhere; messages and arrays are in SI."""
        return bool(self.source) and self.unit_of(name) is None and not self._is_in_topic(name)

    def _is_in_topic(self, name: str) -> bool:
        return any(name.startswith(topic) for topic in self.types)

    def numbers(self, name: str, *, strict: bool = False) -> Floats:
        """Return a channel as numbers.

        Parameters
        ----------
        name : str
            The channel.
        strict : bool
            Fail on a value that is not a number; else it becomes NaN, unless most values are text.

        Raises
        ------
        MissingChannelError
            There is no channel of this name.
        RecordingError
            The channel does not hold one number per sample: the message says where.
        """
        values = self.channel(name)
        if values.ndim != 1:
            problem = f"must have one number per sample, but has the shape {values.shape}"
            raise self.error(name, problem)
        remedy = "drop --strict to exclude such values" if strict else "choose another channel"
        if strict and name in self.faults:
            fault = self.faults[name]
            raise self.error(name, f"{_describe_fault(fault.text)}; {remedy}", fault.sample)
        if values.dtype.kind in "fiub":
            return np.ascontiguousarray(values, dtype=np.float64)
        if values.dtype.kind not in "OUS":
            raise self.error(name, f"must hold numbers, but holds {values.dtype}")
        numbers = [_read_number(value) for value in values]
        wrong = [sample for sample, number in enumerate(numbers) if number is None]
        if wrong and (strict or len(wrong) > MOST_TEXT * values.size):
            problem = f"{_describe_fault(values[wrong[0]])}; {remedy}"
            raise self.error(name, problem, wrong[0])
        return np.array(numbers, dtype=np.float64)  # None is NaN

    def error(self, name: str, problem: str, sample: int | None = None) -> RecordingError:
        """Return the error for a channel or one of its samples; it names file, column and row."""
        place = f"column {name!r}"
        if sample is not None and self.rows is not None:
            place += f", row {self.rows[sample]}"
        elif sample is not None:
            place += f", sample {sample}"
        return RecordingError.of(self.source, f"{place}: {problem}")


def _read_number(value: Any) -> float | None:
    try:
        return number_in_text(value) if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return None


def number_in_text(text: str) -> float:
    """Return the number in a cell; raise ValueError for any other text.

    Thousands may be separated if this is unambiguous: ``1,063.208``, ``1'063``.
    """
    if "_" in text:  # float() accepts 1_000
        raise ValueError
    try:
        return float(text)
    except ValueError:
        if not _THOUSANDS.fullmatch(text):
            raise
    return float(re.sub(r"[^\d.+-]", "", text))


def holds_numbers(values: Values) -> bool:
    """Whether most of the first texts of a channel are numbers."""
    filled = [value for value in values[:1000].tolist() if str(value).strip()]
    return 2 * sum(_read_number(value) is not None for value in filled) > len(filled)


def printable(path: str | Path) -> str:
    """Return a path as encodable text, with bytes that are not UTF-8 in hexadecimal."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def _describe_fault(value: Any) -> str:
    if isinstance(value, str):
        value = value.strip()
        if not value:
            return "the value is missing"
    return f"{shown(value, 45)} is not a number"


def read_truth(notes: Mapping[str, str]) -> ForceLaw | None:
    """Return the force law of the note ``truth``; None if it is absent or invalid.

    Parameters
    ----------
    notes : mapping
        The notes of a recording. ``truth`` is JSON: the ``kind`` and parameters of the law.
    """
    try:
        return law_from(dict(json.loads(notes["truth"])))
    except (KeyError, ValueError, TypeError, RecursionError):
        return None
