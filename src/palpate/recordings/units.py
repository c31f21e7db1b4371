"""Units that a recording may be in, by their size in SI, and as the names of columns say them."""

import re

#: Units of each channel, by their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "penetration": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6},
    "force": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "nN": 1e-9},
}
#: Units of a torque, by their size in SI; no channel of a contact is one.
TORQUE_UNITS = {"Nm": 1.0, "N·m": 1.0, "N*m": 1.0, "Ncm": 1e-2, "mNm": 1e-3, "Nmm": 1e-3}

KNOWN = frozenset([*(unit for units in UNITS.values() for unit in units), *TORQUE_UNITS])
# ``force_min`` is the least force and ``t_h`` some time: at the end of a name these are no units.
NEVER_BARE = frozenset(["min", "h"])
_BRACKETED = re.compile(r".*\S\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")
_AFTER_A_SLASH = re.compile(r"[^/\s]+\s*/\s*([^/\s]+(?:/s)?)")


def plain_unit(text: str) -> str:
    """Return a unit as :data:`UNITS` spells it: no brackets, no spaces, one letter mu."""
    text = text.strip()
    if len(text) > 1 and text[0] + text[-1] in ("[]", "()", "<>"):
        text = text[1:-1].strip()
    text = text.replace("\N{GREEK SMALL LETTER MU}", "\N{MICRO SIGN}")
    return {"sec": "s", "seconds": "s", "m s-1": "m/s", "N.m": "N·m"}.get(text, text)


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column's name ends with: ``force_N``, ``Fx [mN]``, ``t/s``.

    None where it has none, or none that palpate knows.
    """
    if bracketed := _BRACKETED.fullmatch(name):
        unit = plain_unit(bracketed[1] or bracketed[2] or "")
        return unit if unit in KNOWN else None
    if divided := _AFTER_A_SLASH.fullmatch(name):
        unit = plain_unit(divided[1])
        return unit if unit in KNOWN - NEVER_BARE else None
    words = name.split("_")
    for count in (2, 1):  # velocity_m_s before any other that ends with _s
        unit = plain_unit("/".join(words[-count:]))
        if len(words) > count and unit in KNOWN - NEVER_BARE:
            return unit
    return None
