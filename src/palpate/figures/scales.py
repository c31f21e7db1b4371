"""Units with the prefix that makes their numbers readable."""

import math
from dataclasses import dataclass

import numpy as np

from palpate.digits import PLAIN
from palpate.validation import Floats

_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f"}
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Scale:
    """What SI values are multiplied by to be drawn, and the unit of what is drawn.

    Parameters
    ----------
    factor : float
        Drawn value over SI value.
    unit : str
        Of the drawn value.
    """

    factor: float
    unit: str

    def label(self, name: str) -> str:
        """Return what an axis is called."""
        return f"{name} [{self.unit}]" if self.unit else name


def scale_of(largest: float, unit: str) -> Scale:
    """Choose a unit in which the largest value is from 1 to below 1000.

    Parameters
    ----------
    largest : float
        Size of the largest value, in the SI unit.
    unit : str
        N, m, m/s or what begins with N; another unit, and none, stay as they are.
    """
    if not (math.isfinite(largest) and largest > 0.0) or unit[:1] not in ("N", "m"):
        return Scale(1.0, unit)
    power = 3 * math.floor(math.log10(largest * (1.0 + 1e-9)) / 3.0)
    if unit.startswith("m"):
        power = min(power, 0)  # nobody counts penetration in kilometres
    if power in _PREFIXES:
        return Scale(10.0**-power, _PREFIXES[power] + unit)
    if abs(power) > 300:  # its inverse would not be finite
        return Scale(1.0, unit)
    return Scale(10.0**-power, f"10{str(power).translate(_POWERS)} {unit}")


def scale_as_written(value: float, unit: str) -> Scale:
    """Choose the power of ten that :func:`palpate.digits.with_error` writes a value with."""
    power = math.floor(math.log10(abs(value))) if math.isfinite(value) and value else 0
    if power in PLAIN or abs(power) > 300:
        return Scale(1.0, unit)
    return Scale(10.0**-power, f"10{str(power).translate(_POWERS)} {unit}".strip())


def largest(values: Floats) -> float:
    """Size of the largest value that is finite; 0 without any."""
    size = np.abs(values)
    return float(np.max(size, where=np.isfinite(size), initial=0.0))
