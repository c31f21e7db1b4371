"""Numbers with a unit on the command line: 3mm, 5ms, 0:2."""

import math
import re
from collections.abc import Mapping

from palpate.errors import InvalidParameterError
from palpate.recordings.units import UNITS

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*?)\s*$")


#: In rad/s; a bare number is in Hz.
FREQUENCIES = {
    "Hz": 2.0 * math.pi,
    "rad/s": 1.0,
    "mHz": 2e-3 * math.pi,
    "kHz": 2e3 * math.pi,
}


def quantity(option: str, text: str, channel: str | Mapping[str, float]) -> float:
    """A number with a unit of a channel, in SI; without a unit it is in SI already.

    Or with one of other units, by their sizes, the first where there is none.
    """
    found = _NUMBER.match(text)
    units = UNITS[channel] if isinstance(channel, str) else channel
    si = next(iter(units))
    if found is None or (found[2] or si) not in units:
        raise InvalidParameterError(
            f"{option} must be a number and one of {', '.join(units)}, such as 3{list(units)[1]}, "
            f"not {text!r}"
        )
    return float(found[1]) * units[found[2] or si]


def span(option: str, text: str) -> tuple[float, float]:
    """Two times, START:STOP, s."""
    start, colon, stop = text.partition(":")
    if not colon:
        raise InvalidParameterError(f"{option} must be START:STOP in seconds, not {text!r}")
    return quantity(option, start, "time"), quantity(option, stop, "time")


def units_of(option: str, pairs: tuple[str, ...]) -> dict[str, str]:
    """Channels and their units, CHANNEL=UNIT each, or several with commas between them."""
    units = {}
    for pair in (each for given in pairs for each in given.split(",")):
        channel, sign, unit = pair.partition("=")
        if not sign:
            raise InvalidParameterError(
                f"{option} must be CHANNEL=UNIT, such as penetration=mm, not {pair!r}"
            )
        units[channel] = unit
    return units
