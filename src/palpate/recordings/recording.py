"""A recording: channels as they were recorded; the units and the truth that it may state."""

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
from palpate.findings import Finding
from palpate.force_laws import ForceLaw, law_from
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
    findings : sequence of Finding
        What of the file could not be read, which calls for care; and, as notes, what was not read
        because it holds no numbers, or was not asked for.

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
    findings: Sequence[Finding] = ()

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

    @property
    def losses(self) -> tuple[str, ...]:
        """What of the file could not be read, in sentences."""
        return tuple(each.message for each in self.findings if each.severity != "note")

    @property
    def omissions(self) -> tuple[str, ...]:
        """What was not read because it holds no numbers, or was not asked for."""
        return tuple(each.message for each in self.findings if each.severity == "note")

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
            words = f"one number a sample is needed, and this has the shape {values.shape}"
            raise RecordingError(f"{self.place(name)}: {words}")
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
        words = f"{self.source}: " * bool(self.source) + f"column {name!r}"
        if sample is None:
            return words
        return words + (f", sample {sample}" if self.rows is None else f", row {self.rows[sample]}")

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


def truth_of(notes: Mapping[str, str]) -> ForceLaw | None:
    """Return the force law of the note ``truth``; None where there is none that can be read.

    Parameters
    ----------
    notes : mapping
        What a recording says of itself. ``truth`` is JSON: the law's ``kind`` and parameters.
    """
    try:
        return law_from(dict(json.loads(notes["truth"])))
    except (KeyError, ValueError, TypeError, RecursionError):
        return None


# Units that a recording may be in, by their size in SI, and as the names of columns say them.

GRAVITY = 9.80665  # m/s², the standard one, which turns a mass into its weight

#: Units of each channel, by their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "penetration": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9,
                    "in": 25.4e-3, "mil": 25.4e-6},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6,
                 "in/s": 25.4e-3},
    "force": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "nN": 1e-9, "pN": 1e-12,
              "daN": 10.0, "dN": 0.1, "cN": 1e-2, "kgf": GRAVITY, "gf": 1e-3 * GRAVITY,
              "lbf": 0.45359237 * GRAVITY, "ozf": 0.45359237 / 16.0 * GRAVITY},
}  # fmt: skip
#: Units of mass, by the weight of one, N: what a balance or a load cell shows as a force.
WEIGHTS = {"kg": GRAVITY, "g": 1e-3 * GRAVITY, "mg": 1e-6 * GRAVITY,
           "lb": UNITS["force"]["lbf"], "oz": UNITS["force"]["ozf"]}  # fmt: skip
#: Units of a torque, by their size in SI; no channel of a contact is one.
TORQUE_UNITS = {"Nm": 1.0, "N·m": 1.0, "N*m": 1.0, "Ncm": 1e-2, "mNm": 1e-3, "Nmm": 1e-3}

KNOWN = frozenset([*(unit for units in UNITS.values() for unit in units), *TORQUE_UNITS])
#: What else stands in a row of units.
OTHER_UNITS = frozenset(["-", "–", "1", "%", "deg", "°", "rad", "rad/s", "V", "mV", "A", "mA", "Hz",
                         "°C", "C", "K", "Pa", "kPa", "MPa", "g", "kg", "m/s^2", "m/s²", "counts",
                         "bool", "text", "N/m", "N/mm", "mg", "lb", "oz"])  # fmt: skip
# At the end of a name these say that it is in no unit of a contact.
_FOREIGN = frozenset(["counts", "MPa", "mpa", "kPa", "kpa", "Pa", "bar", "psi", "V", "mV", "mv",
                      "pct", "percent", "%"])  # fmt: skip
# ``force_min`` is the least force and ``t_h`` some time: at the end of a name these are no units.
_BARE = (KNOWN | WEIGHTS.keys() | _FOREIGN) - {"min", "h"}
# ``pos_in_base`` and ``plug_in`` are no inches.
_LENGTHS = frozenset(["deflection", "depth", "disp", "displacement", "extension", "height",
                      "indentation", "penetration", "pos", "position", "stroke", "travel", "x", "y",
                      "z"])  # fmt: skip
# In brackets these are no units either: ``force_N (column 3)``, ``state[2]``, ``Force (filtered)``.
_NO_UNIT = re.compile(
    r"(column )?\d*|[xyzw]|filtered|measured|actual|tared|abs|rel|tool|base|world|sensor|tcp", re.I
)
_SPELT = {
    "sec": "s", "seconds": "s", "m s-1": "m/s", "N.m": "N·m", '"': "in", "inch": "in",
    "inches": "in", "mils": "mil", "newton": "N", "newtons": "N", "lbs": "lb", "pounds": "lb",
    "ounces": "oz", "gram": "g", "grams": "g", "gram-force": "gf", "kilogram-force": "kgf",
    "pound-force": "lbf", "metres": "m", "meters": "m", "millimetres": "mm", "millimeters": "mm",
    # Their case says nothing; that of MN and mN, of Nm and nm, does.
    **{unit.lower(): unit for unit in ("kN", "kgf", "gf", "lbf", "ozf", "kg", "lb", "oz", "mm",
                                       "cm", "in", "mil")},
}  # fmt: skip
_BRACKETED = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")
_AFTER_A_SLASH = re.compile(r"[^/\s]+\s*/\s*([^/\s]+(?:/s)?)")
_SCALED = re.compile(r"\s*(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)?\s*(.*)")


def plain_unit(text: str) -> str:
    """Return a unit as :data:`UNITS` spells it: no brackets, no spaces, one letter mu."""
    text = text.strip()
    if len(text) > 1 and text[0] + text[-1] in ("[]", "()", "<>"):
        text = text[1:-1].strip()
    text = text.replace("\N{GREEK SMALL LETTER MU}", "\N{MICRO SIGN}")
    return text if text in KNOWN else _SPELT.get(text, _SPELT.get(text.lower(), text))


def size_of(kind: str, unit: str) -> float:
    """Return the size of a channel's unit in SI; 0 where it has no such unit.

    Before it may stand a number: ``0.0098N``. A mass counts as its weight.
    """
    found = _SCALED.fullmatch(unit)
    units = UNITS[kind] | (WEIGHTS if kind == "force" else {})
    if found is None or plain_unit(found[2]) not in units:
        return 0.0
    size = float(found[1] or 1.0) * units[plain_unit(found[2])]
    return size if size < math.inf else 0.0


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column's name ends with: ``force_N``, ``Fx [mN]``, ``t/s``.

    None where it has none, or none that palpate knows.
    """
    unit = stated_unit(name)
    return unit if unit in KNOWN or unit in WEIGHTS else None


def stated_unit(name: str) -> str | None:
    """Return the unit that a column's name ends with, also one that palpate cannot convert.

    In brackets that is whatever stands there; else only what is hardly a word of the name.
    """
    while bracketed := _BRACKETED.fullmatch(name):
        unit = plain_unit(bracketed[2] or bracketed[3] or "")
        if not _NO_UNIT.fullmatch(unit):
            return unit
        name = bracketed[1]
    words = re.split(r"[_\s]+", name)
    for count in (2, 1):  # velocity_m_s before any other that ends with _s
        unit = plain_unit("/".join(words[-count:]))
        is_word = unit == "in" and words[-2:][0].lower() not in _LENGTHS
        if len(words) > count and unit in _BARE and not is_word:
            return unit
    divided = _AFTER_A_SLASH.fullmatch(name)
    unit = plain_unit(divided[1]) if divided else ""
    return unit if unit in _BARE and unit != "in" else None
