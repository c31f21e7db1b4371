"""Units, their size in SI, and what the name of a channel says: its unit, its words, a command."""

import math
import re
import unicodedata

from palpate.input.recordings.times import SECONDS, is_timelike

GRAVITY = 9.80665  # m/s², the standard value, which converts a mass to its weight

#: Units of each quantity, with their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {**SECONDS, "min": 60.0, "h": 3600.0},
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
    "millis": "ms", "milliseconds": "ms", "micros": "us", "microseconds": "us",
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
    scaled = _SCALED.fullmatch(unit)
    if scaled is None:
        return 0.0
    units = UNITS[kind] | (WEIGHTS if kind == "force" else {})
    size = float(scaled[1] or 1.0) * units.get(plain_unit(scaled[2]), 0.0)
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
    if (unit := plain_unit(name)) in ("ms", "us") and len(name) > 2:  # Arduino's millis()
        return unit, True
    pieces = re.split(r"[_\s]+", name)
    for count in (2, 1):  # velocity_m_s before any other that ends with _s
        unit = _lower_time_unit(name, plain_unit("/".join(pieces[-count:])))
        is_word = unit == "in" and pieces[-2:][0].lower() not in _LENGTHS
        if len(pieces) > count and unit in _BARE and not is_word:
            return unit, False
    divided = _AFTER_A_SLASH.fullmatch(name)
    unit = plain_unit(divided[1]) if divided else ""
    return (unit, True) if unit in _BARE and unit != "in" else (None, False)


def _lower_time_unit(name: str, unit: str) -> str:
    """Return the unit, in lower case if it is a unit of time, as in ``Time_MS``."""
    return unit.lower() if unit.lower() in SECONDS and is_timelike(name) else unit


# The words of a name.

#: Words for commanded, not measured, channels.
WANTED = frozenset(
    ("command", "commands", "commanded", "cmd", "desired", "des", "target", "targets", "setpoint",
     "reference", "ref", "goal", "goals", "action", "actions", "planned", "demand", "demanded")
)  # fmt: skip
# libfranka's names of desired and commanded values.
_DESIRED = re.compile(r"O_d?d?[TP]_EE_[cd](?![^\W\d_])", re.I)
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


def is_wanted(name: str) -> bool:
    """Whether the name suggests a commanded, not a measured, channel."""
    return not WANTED.isdisjoint(split_name(name)) or bool(_DESIRED.search(name))


def split_name(name: str) -> list[str]:
    """The words of a name in lower case, without its unit and accents: ``Fz [mN]`` is fz."""
    bare = unicodedata.normalize("NFKD", divide_unit(name)[0])
    return [word.lower() for word in _WORD.findall(re.sub(r"[\u0300-\u036f]", "", bare))]


def divide_unit(name: str) -> tuple[str, str | None]:
    """The name without the unit at its end, and this unit."""
    unit = find_unit(name)
    if unit is not None:
        name = re.sub(rf"[\[(_/, ]*{re.escape(unit)}[\])\s]*$", "", name, flags=re.IGNORECASE)
    return name, unit
