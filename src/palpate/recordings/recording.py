"""A recording: channels as they were recorded, with units and a known true law, if stated."""

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.errors import InvalidParameterError, MissingChannelError, RecordingError
from palpate.errors import printable as visible
from palpate.findings import Check, Finding
from palpate.force_laws import ForceLaw, law_from
from palpate.recordings.times import SECONDS, is_timelike
from palpate.validation import Floats, reject_masks, shown

# With an apostrophe or a narrow space, or with a comma that cannot be the decimal mark.
_THOUSANDS = re.compile(
    r"\s*[+-]?[1-9]\d{0,2}"
    r"((['\u2019\u00a0\u2009\u202f]\d{3})+(\.\d*)?|(,\d{3})+\.\d*|(,\d{3}){2,})\s*"
)
MOST_TEXT = 0.5  # largest fraction of text values in a channel of numbers


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True, eq=False)
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
    settings : mapping
        Settings that the file states, SI: ``"rate"`` of the samples, ``"tip radius"``, ``"spring
        constant"``, ``"specimen height"``, ``"specimen diameter"``, ``"specimen area"``.
    episode : int, optional
        Number of the episode of a data set that this is.
    episodes : sequence of Recording
        The episodes of a data set, if several were read; the channels are those of the first.
    table : str
        For messages: where in a text the reader found the table; empty for other files.
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

    Raises
    ------
    InvalidParameterError
        A channel is not an array, or a mask hides some of it.

    Notes
    -----
    A channel has one value per sample. A vector is several channels, whose names end with ``.x``,
    ``.y``, ``.z`` (and ``.w``), as in messages, or with ``[0]``, ``[1]``, ``[2]``, as in arrays.
    Times may be integer nanoseconds (unit ``"ns"``): a float of seconds since 1970 is not exact.
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
        return [each for each in self.findings if each.check == Check.FILE]

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

    def unit_of(self, name: str) -> str | None:
        """Return the unit of a channel, from the file, else from its name; None if unknown.

        Brackets in the name of an element of a message contain a joint or a frame, not a unit.
        """
        own = self.units.get(name)
        is_element = name.endswith("]") and self._is_in_topic(name)
        return plain_unit(own) if own else None if is_element else find_unit(name)

    def states_unit(self, name: str) -> bool:
        """Whether the file states the unit: in a row, an attribute or brackets, not as a suffix."""
        if self._is_in_topic(name):  # the type of a message only says which unit is usual
            return False
        own, (unit, stated) = self.units.get(name), find_unit_in_name(name)
        return stated or (own is not None and plain_unit(own) != unit)  # text lists suffixes too

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
            words = f"must have one number per sample, but has the shape {values.shape}"
            raise RecordingError(f"{self.place(name)}: {words}")
        if strict and name in self.faults:
            fault = self.faults[name]
            words = f"{_fault(fault.text)}; drop --strict to exclude such values"
            raise RecordingError(f"{self.place(name, fault.sample)}: {words}")
        if values.dtype.kind in "fiub":
            return np.ascontiguousarray(values, dtype=np.float64)
        if values.dtype.kind not in "OUS":
            raise RecordingError(f"{self.place(name)}: must hold numbers, but holds {values.dtype}")
        found = [_read_number(value) for value in values]
        wrong = [sample for sample, number in enumerate(found) if number is None]
        if wrong and (strict or len(wrong) > MOST_TEXT * values.size):
            remedy = "drop --strict to exclude such values" if strict else "choose another channel"
            words = f"{_fault(values[wrong[0]])}; {remedy}"
            raise RecordingError(f"{self.place(name, wrong[0])}: {words}")
        return np.array([np.nan if number is None else number for number in found])

    def place(self, name: str, sample: int | None = None) -> str:
        """The location of a channel or one of its samples, as text: file, column and row."""
        words = f"{self.source}: " * bool(self.source) + f"column {name!r}"
        if sample is None:
            return words
        return words + (f", sample {sample}" if self.rows is None else f", row {self.rows[sample]}")


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
    if _THOUSANDS.fullmatch(text):
        text = re.sub(r"[^\d.+-]", "", text)
    return float(text)


def holds_numbers(values: NDArray[Any]) -> bool:
    """Whether most of the first texts of a channel are numbers."""
    filled = [value for value in values[:1000].tolist() if str(value).strip()]
    return 2 * sum(_read_number(value) is not None for value in filled) > len(filled)


def printable(path: str | Path) -> str:
    """Return a path as encodable text, with bytes that are not UTF-8 in hexadecimal."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def _fault(value: Any) -> str:
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


# Units of recordings: their size in SI, and how names of columns state them.

GRAVITY = 9.80665  # m/s², the standard value, which converts a mass to its weight

#: Units of each quantity, with their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "penetration": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9,
                    "in": 25.4e-3, "mil": 25.4e-6},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6,
                 "in/s": 25.4e-3},
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "nN": 1e-9,
              "pN": 1e-12, "daN": 10.0, "dN": 0.1, "cN": 1e-2, "kgf": GRAVITY, "gf": 1e-3 * GRAVITY,
              "lbf": 0.45359237 * GRAVITY, "ozf": 0.45359237 / 16.0 * GRAVITY},
}  # fmt: skip
#: Units of mass, with the weight of one, N: balances and load cells show forces as masses.
WEIGHTS = {"kg": GRAVITY, "g": 1e-3 * GRAVITY, "mg": 1e-6 * GRAVITY,
           "lb": UNITS["force"]["lbf"], "oz": UNITS["force"]["ozf"]}  # fmt: skip
#: Units of torque, with their size in SI; a contact has no torque channel.
TORQUE_UNITS = {"Nm": 1.0, "N·m": 1.0, "N*m": 1.0, "Ncm": 1e-2, "mNm": 1e-3, "Nmm": 1e-3}

KNOWN = frozenset([*(unit for units in UNITS.values() for unit in units), *TORQUE_UNITS])
#: The unit of all channels of a report without units; palpate does not assume a unit.
UNSTATED = "not stated"
#: Other entries of a row of units.
OTHER_UNITS = frozenset(["-", "–", "1", "%", "deg", "°", "rad", "rad/s", "V", "mV", "A", "mA", "Hz",
                         "°C", "C", "K", "Pa", "kPa", "MPa", "g", "kg", "m/s^2", "m/s²", "counts",
                         "bool", "text", "N/m", "N/mm", "mg", "lb", "oz"])  # fmt: skip
# A name that ends with one of these has a unit of another quantity.
_FOREIGN = frozenset(["counts", "MPa", "mpa", "kPa", "kpa", "Pa", "bar", "psi", "V", "mV", "mv",
                      "pct", "percent", "%"])  # fmt: skip
# ``force_min`` is the least force and ``t_h`` a name: after a name these are not units.
_BARE = (KNOWN | WEIGHTS.keys() | _FOREIGN) - {"min", "h"}
# ``pos_in_base`` and ``plug_in`` are not in inches; ``_in`` is a unit only after these words.
_LENGTHS = frozenset(["deflection", "depth", "disp", "displacement", "extension", "height",
                      "indentation", "penetration", "pos", "position", "stroke", "travel", "x", "y",
                      "z"])  # fmt: skip
# In brackets these are not units: ``force_N (column 3)``, ``state[2]``, ``Force (filtered)``.
_NO_UNIT = re.compile(
    r"(column )?\d*|[xyzw]|filtered|measured|actual|tared|abs|rel|tool|base|world|sensor|tcp"
    r"|.*>.*|.*joint.*|[a-z]\w*_\w*",  # a transform or a joint
    re.I,
)
_SPELT = {
    "sec": "s", "seconds": "s", "m s-1": "m/s", "N.m": "N·m", '"': "in", "inch": "in",
    "inches": "in", "mils": "mil", "lbs": "lb", "pounds": "lb",
    "ounces": "oz", "gram": "g", "grams": "g", "gram-force": "gf", "kilogram-force": "kgf",
    "pound-force": "lbf", "second": "s",
    **{f"{prefix}met{end}{s}": f"{unit}m" for end in ("er", "re") for s in ("", "s")
       for prefix, unit in (("", ""), ("milli", "m"), ("micro", "µ"), ("nano", "n"))},
    **{f"{prefix}newton{s}": f"{unit}N" for s in ("", "s")
       for prefix, unit in (("", ""), ("milli", "m"), ("micro", "µ"), ("kilo", "k"))},
    # Case does not matter here; in MN and mN, or Nm and nm, it does.
    **{unit.lower(): unit for unit in ("kN", "kgf", "gf", "lbf", "ozf", "kg", "lb", "oz", "mm",
                                       "cm", "in", "mil")},
}  # fmt: skip
_BRACKETED = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")
_AFTER_A_COMMA = re.compile(r".*\S(?:,\s*|\s+in\s+)(\S+)\s*")
_AFTER_A_SLASH = re.compile(r"[^/\s]+\s*/\s*([^/\s]+(?:/s)?)")
_SCALED = re.compile(r"\s*(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)?\s*(.*)")


def plain_unit(text: str) -> str:
    """Return a unit as :data:`UNITS` spells it: without brackets, with one letter mu."""
    text = text.strip()
    if len(text) > 1 and text[0] + text[-1] in ("[]", "()", "<>"):
        text = text[1:-1].strip()
    text = text.replace("\N{GREEK SMALL LETTER MU}", "\N{MICRO SIGN}")
    return text if text in KNOWN else _SPELT.get(text, _SPELT.get(text.lower(), text))


def unit_size(kind: str, unit: str) -> float:
    """Return the size in SI of a unit of some quantity; 0 if it is not one.

    A number may precede the unit: ``0.0098N``. A mass counts as its weight.
    """
    found = _SCALED.fullmatch(unit)
    units = UNITS[kind] | (WEIGHTS if kind == "force" else {})
    if found is None or plain_unit(found[2]) not in units:
        return 0.0
    size = float(found[1] or 1.0) * units[plain_unit(found[2])]
    return size if size < math.inf else 0.0


def unit_in_name(name: str) -> str | None:
    """Return the unit at the end of a column's name: ``force_N``, ``Fx [mN]``, ``t/s``.

    None without a unit, or with a unit that palpate does not know.
    """
    unit = find_unit(name)
    return unit if unit in KNOWN or unit in WEIGHTS else None


def find_unit(name: str) -> str | None:
    """Return the unit at the end of a column's name, even if palpate cannot convert it.

    In brackets any text counts; without them only a text that is unlikely to be part of the name.
    """
    return find_unit_in_name(name)[0]


def find_unit_in_name(name: str) -> tuple[str | None, bool]:
    """Return the unit as :func:`find_unit`, and whether it is stated, not a suffix like ``_N``."""
    while bracketed := _BRACKETED.fullmatch(name):
        unit = plain_unit(bracketed[2] or bracketed[3] or "")
        if not _NO_UNIT.fullmatch(unit):
            return _lower_time_unit(name, unit), True
        name = bracketed[1]
    if (behind := _AFTER_A_COMMA.fullmatch(name)) and plain_unit(behind[1]) in _BARE:
        return _lower_time_unit(name, plain_unit(behind[1])), True  # ``Fz, gf``, ``Kraft in N``
    words = re.split(r"[_\s]+", name)
    for count in (2, 1):  # velocity_m_s before any other that ends with _s
        unit = _lower_time_unit(name, plain_unit("/".join(words[-count:])))
        is_word = unit == "in" and words[-2:][0].lower() not in _LENGTHS
        if len(words) > count and unit in _BARE and not is_word:
            return unit, False
    divided = _AFTER_A_SLASH.fullmatch(name)
    unit = plain_unit(divided[1]) if divided else ""
    return (unit, True) if unit in _BARE and unit != "in" else (None, False)


def _lower_time_unit(name: str, unit: str) -> str:
    """Return the unit, in lower case if it is a unit of time, as in ``Time_MS``."""
    return unit.lower() if unit.lower() in SECONDS and is_timelike(name) else unit
