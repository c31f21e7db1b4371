"""Units that a recording may be in, by their size in SI, and as the names of columns say them."""

import math
import re

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
