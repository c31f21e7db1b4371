"""Messages of a recording made live: what came, and what was found; in CDR, as ROS 2 has it."""

import struct
from collections.abc import Callable
from typing import Any

from palpate.live.ring import MOST_PARAMETERS
from palpate.live.sinks.watching import PLACE
from palpate.live.verdict_on_laws import verdict_on

#: Topics; a recording is identified again from the first.
INPUT, ESTIMATE = "/input", "/estimate"
_RULE = "=" * 80
_TIME = f"""{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_NUMBERS = f"""# One measurement as it came: a number along the contact normal each, m and N.
builtin_interfaces/Time stamp
float64 position
float64 force
{_TIME}"""
_VECTORS = f"""# One measurement as it came, m and N.
builtin_interfaces/Time stamp
geometry_msgs/Vector3 position
geometry_msgs/Vector3 force
{_TIME}{_RULE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
_MATRIX = MOST_PARAMETERS**2
# What was made of the measurement has names of its own, so that nothing takes it for one.
_ESTIMATE = f"""# What the loop made of a measurement, and found.
builtin_interfaces/Time stamp    # of the measurement that the estimator took
float64 travel                   # penetration that it took, m
float64 rate                     # its velocity, m/s
float64 felt                     # its force, N
float64 predicted                # a priori, N
float64[{MOST_PARAMETERS}] parameters            # of the law, in its order, SI; NaN beyond them
float64[{_MATRIX}] covariance           # row by row
float64 offset                   # N
float64 beginning                # of the material, m
float64 margin                   # of condition 10
float64 cycle                    # update and estimate took so long, s
float64 lateness                 # done so long after the measurement was there, s
uint8 status                     # palpate.Status
uint8 preparation                # palpate.Status
uint8 state                      # free 0, contact 1, held 2, changed 3, invalid 4, lost 5, taring 6
uint16 method                    # how often the estimator was exchanged
{_TIME}"""
#: Name and definition of each topic's messages; those of the input where it has vectors.
TYPES = {
    "numbers": ("palpate_msgs/msg/Measurement", _NUMBERS),
    "vectors": ("palpate_msgs/msg/MeasurementInSpace", _VECTORS),
    "estimate": ("palpate_msgs/msg/Estimate", _ESTIMATE),
}
_HEAD = b"\0\1\0\0"  # CDR, little endian
_NUMBERS_CDR = struct.Struct("<4siI2d")
_VECTORS_CDR = struct.Struct("<4siI6d")
_ESTIMATE_CDR = struct.Struct(f"<4siI{4 + MOST_PARAMETERS + _MATRIX + 5}d3BxH")
_LATEST = 2**31  # s: what a time in ROS 2 can hold

Row = list[float]


def _slice(first: str, count: int) -> slice:
    return slice(PLACE[first], PLACE[first] + count)


_POSITION, _FORCE = PLACE["input_position_x"], PLACE["input_force_x"]
_IN_SPACE = _slice("input_position_x", 6)
_SAMPLE = _slice("penetration", 4)
_FOUND = _slice("parameter_0", MOST_PARAMETERS + _MATRIX)
_REST = [PLACE[name] for name in ("offset", "surface", "margin", "cycle", "lateness")]
_WHOLE = [PLACE[name] for name in ("status", "preparation", "state")]
_METHOD = PLACE["method"]
_ARRIVED, _TIME_OF = PLACE["arrived"], PLACE["time"]


class Encoder:
    """From rows to messages.

    Parameters
    ----------
    origin : int
        What the source counts its times from, ns.
    vectors : bool
        Whether the source has vectors.
    """

    def __init__(self, origin: int, *, vectors: bool) -> None:
        self._origin = origin
        self.measured: Callable[[Row], tuple[int, bytes] | None] = (
            self._in_space if vectors else self._number
        )

    def _number(self, row: Row) -> tuple[int, bytes] | None:
        stamp = self._stamp(row[_ARRIVED])
        if stamp is None:
            return None
        split = divmod(stamp, 1_000_000_000)
        return stamp, _NUMBERS_CDR.pack(_HEAD, *split, row[_POSITION], row[_FORCE])

    def _in_space(self, row: Row) -> tuple[int, bytes] | None:
        stamp = self._stamp(row[_ARRIVED])
        if stamp is None:
            return None
        return stamp, _VECTORS_CDR.pack(_HEAD, *divmod(stamp, 1_000_000_000), *row[_IN_SPACE])

    def found(self, row: Row) -> bytes | None:
        """What was found at a row; None where no sample was prepared."""
        stamp = self._stamp(row[_TIME_OF])
        if stamp is None:
            return None
        return _ESTIMATE_CDR.pack(
            _HEAD,
            *divmod(stamp, 1_000_000_000),
            *row[_SAMPLE],
            *row[_FOUND],
            *[row[k] for k in _REST],
            *[int(row[k]) & 0xFF for k in _WHOLE],
            int(row[_METHOD]) & 0xFFFF,
        )

    def _stamp(self, time: float) -> int | None:
        """A time of the source's clock, ns; None where it is none."""
        if not -_LATEST < time < _LATEST:
            return None
        stamp = self._origin + round(1e9 * time)
        return stamp if -_LATEST < stamp // 1_000_000_000 < _LATEST else None


def described(status: dict[str, Any]) -> dict[str, str]:
    """What is to be known of a recording beside its messages, in words."""
    law = status.get("law", {})
    units = zip(law.get("symbols", ()), law.get("units", ()), strict=True)
    tare, preparation = status.get("tare"), str(status.get("preparation", ""))
    if "tare_time=" not in preparation:
        tared = "none"
    else:
        tared = "being measured" if tare is None else f"{tare:.6g} N was taken off online"
    verdict = verdict_on(status)
    told = {"law": str(verdict["law"])} if verdict and verdict["known"] else {}
    diagnosis = status.get("diagnosis", {})
    told |= {name: str(diagnosis[name]) for name in ("verdict", "reason") if name in diagnosis}
    return {
        "source": str(status.get("source", "")),
        "method": str(status.get("method", "")),
        **told,
        "parameters": ", ".join(f"{name} [{unit or '1'}]" for name, unit in units),
        "preparation": preparation or "as usual",
        "tare": tared,
        "delay": f"{status.get('delay', 0.0):g} s from a measurement to its estimate",
    }
