"""Numbers with the digits that their error allows.

The rule is the Particle Data Group's, which the package ``uncertainties`` follows too: of the first
three digits of the error, 100 to 354 are written with two digits, 355 to 949 with one, and 950 to
999 are rounded up to 1000, with two. The value ends at the same decimal.
"""

import math
from collections.abc import Callable
from decimal import Decimal

_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: From 10⁻³ to below 10⁵ a number is written without a power of ten.
PLAIN = range(-3, 5)


def with_error(value: float, *errors: float, unit: str = "") -> str:
    """Write a number and its errors: ``4300 ± 1600``, ``(1.000 ± 0.008)·10⁵``.

    Parameters
    ----------
    value : float
        The number.
    errors : float
        Its errors, such as the statistical and the systematic one. Errors that are not positive
        are omitted; one that is not finite is written "± unknown". The largest decides the digits;
        a smaller one keeps at least one digit.
    unit : str
        Appended, if any, unless the number is unknown.
    """
    if not math.isfinite(value):
        return "unknown"
    known = [error for error in errors if math.isfinite(error) and error > 0.0]
    words = _together(value, known) if known else rounded(value, 4)
    if not all(map(math.isfinite, errors)):
        words += " ± unknown"
    return f"{words} {unit}".rstrip()


def parameter(value: float, error: float, *, unit: str = "", fixed: bool = False) -> str:
    """Write a law's parameter as :func:`with_error`; a fixed one as ``1.5 (fixed)``.

    Parameters
    ----------
    value, error : float
        A number and its standard error.
    unit : str
        Appended, if any.
    fixed : bool
        Whether it was fixed, not identified.
    """
    if fixed and math.isfinite(value):
        return f"{rounded(value, 6)} {unit}".rstrip() + " (fixed)"
    return with_error(value, error, unit=unit)


def interval(value: float, error: float) -> str:
    """Write value ± 1.96 error, a 95 % interval, with the digits of the error: ``2500 to 6000``.

    Parameters
    ----------
    value, error : float
        A number and its standard error.
    """
    if not (math.isfinite(value) and math.isfinite(error) and error > 0.0):
        return "unknown"
    ends = (value - 1.96 * error, value + 1.96 * error)
    largest, place = _last_place(error)
    power = max(map(_power, (value, largest, *ends)))
    return _join_numbers(" to ", [(end, _format_to_place) for end in ends], place, power)


def rounded(value: float, digits: int) -> str:
    """Write a number without an error with ``digits`` significant digits; a long one: ``1.2·10⁵``.

    Parameters
    ----------
    value : float
        The number.
    digits : int
        At least 1. A whole number below 10⁵ keeps all its digits.
    """
    if not math.isfinite(value):
        return "unknown"
    if value == 0.0:
        return "0"
    power = _power(float(f"{value:.{digits - 1}e}"))
    if power in PLAIN:
        return _trim_zeros(f"{value:.{max(digits - 1 - power, 0)}f}")
    return _trim_zeros(f"{_divide_by_power(value, power):.{digits - 1}f}") + _ten_to(power)


def _together(value: float, errors: list[float]) -> str:
    largest, place = _last_place(max(errors))
    power = max(_power(value), _power(largest)) if value else _power(largest)
    return _join_numbers(
        " ± ",
        [(value, _format_to_place), *((error, _error) for error in errors)],
        place,
        power,
    )


def _join_numbers(
    between: str, numbers: list[tuple[float, Callable[[float, int], str]]], place: int, power: int
) -> str:
    """Numbers, each as its function writes it down to a decimal; outside of PLAIN by one power."""
    if power in PLAIN:
        return between.join(write(number, place) for number, write in numbers)
    parts = (write(_divide_by_power(number, power), place - power) for number, write in numbers)
    return f"({between.join(parts)}){_ten_to(power)}"


def _last_place(error: float) -> tuple[float, int]:
    """Return the rounded error, and the power of ten of its last digit."""
    power = _power(error)
    leading = int(100.0 * _divide_by_power(error, power))
    if leading <= 354:
        return error, power - 1
    if leading <= 949:
        return error, power
    return 10.0 ** (power + 1), power  # 950 is written 1000, with two digits


def _error(error: float, place: int) -> str:
    """Format an error to a decimal place; an error of at most half its unit keeps one digit."""
    return _format_to_place(error, min(place, _power(float(f"{error:.0e}"))))


def _format_to_place(value: float, place: int) -> str:
    if place <= 0:
        text = f"{value:.{-place}f}"
    else:
        text = f"{round(value / 10.0**place) * 10**place:d}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def _divide_by_power(value: float, power: int) -> float:
    """Return value/10ᵖ, also if 10ᵖ is outside the range of a double."""
    mantissa, exponent = f"{value:.16e}".split("e")
    return float(f"{mantissa}e{int(exponent) - power}")


def _power(value: float) -> int:
    # From the shortest decimal form: with all its digits, 1e-6 begins with 9.99.
    return Decimal(repr(float(value))).adjusted() if value else 0


def _trim_zeros(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def _ten_to(power: int) -> str:
    return f"·10{str(power).translate(_POWERS)}"


def format_quantity(value: float, unit: str, digits: int = 3) -> str:
    """Format a quantity with an SI prefix: 0.0008 m is 0.8 mm."""
    for prefix, size in {"k": 1e3, "": 1.0, "m": 1e-3, "µ": 1e-6, "n": 1e-9, "p": 1e-12}.items():
        if abs(value) >= 0.1 * size:
            return f"{rounded(value / size, digits)} {prefix}{unit}"
    return f"{rounded(value, digits)} {unit}"


def format_time(seconds: float) -> str:
    """Format a time; a thousand seconds or more keep the unit s."""
    return format_quantity(seconds, "s") if seconds < 1.0 else f"{rounded(seconds, 3)} s"


def format_hertz(frequency: float) -> str:
    """Format a frequency [rad/s] in Hz."""
    return f"{rounded(frequency / math.tau, 3)} Hz"


def percent(part: float, *, sign: bool = False) -> str:
    """Format a part as a percentage in two digits: ``7.4 %``, ``0.35 %``, ``120 %``.

    Ten times and more is ``over 1000 %``; with ``sign`` a positive part begins with a plus.
    """
    if abs(part) >= 10.0:
        return "over 1000 %"
    figures = f"{100.0 * part:.0f}" if abs(part) >= 1.0 else rounded(100.0 * part, 2)
    return f"{'+' * (sign and part > 0.0)}{figures} %"


def rough_percent(part: float) -> str:
    """Format a part as whole per cents, from *under 1 %* to *over 200 %*."""
    if 0.01 <= part < 2.0:
        return f"{100.0 * part:.0f} %"
    return "under 1 %" if part < 2.0 else "over 200 %"
