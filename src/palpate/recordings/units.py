"""Units of channels: their sizes in SI, and those that a column's name tells."""

import re

#: Units of each channel, by their size in SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9},
    "penetration": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6},
    "force": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "nN": 1e-9},
}
_KNOWN = {unit for units in UNITS.values() for unit in units}
_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column's name ends with: ``force_N``, ``Fx [mN]``, ``t/s``."""
    found = _BRACKETS.search(name)
    if found is not None:
        return found[1] if found[1] in _KNOWN else None
    if name.endswith(("_m_s", "_mm_s", "_um_s")):
        return name.rsplit("_", 2)[1] + "/s"
    last = re.split(r"[_/ ]", name)[-1]
    return last if last != name and last in _KNOWN else None
