"""Settings of the preparation of a contact, and their checks."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, get_args

from palpate.errors import InvalidParameterError
from palpate.input.channels.roles import Columns
from palpate.input.preparation.options import Options, SurfaceRule
from palpate.input.recordings.units import UNITS, unit_size
from palpate.method.contact import Delay
from palpate.method.settings import ForceFrame
from palpate.validation import check_choice, frozen, instance, number_in, pair_in, shown, vector_in

FLIPPED = ("force", "penetration")
LONGEST_DELAY = 10.0  # s
LARGEST = {"tool_weight": 1e6, "mass": 1e6, "rate": 1e9, "spot": 1e6}  # N, kg, Hz and m


@frozen(kw_only=True)
class Preparation(Options):
    """Settings for making a contact from a recording; see :func:`palpate.prepare` for each.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.
    """

    columns: Columns = field(default_factory=Columns)
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the window, s; infinite without one."""
        low, high = self.window or (None, None)
        return -math.inf if low is None else low, math.inf if high is None else high

    def __post_init__(self) -> None:
        instance("columns", self.columns, Columns)
        units = {"penetration" if k == "position" else k: unit for k, unit in self.units.items()}
        object.__setattr__(self, "units", units)
        for channel, unit in units.items():
            _check_unit(channel, unit)
        object.__setattr__(self, "flip", check_flip(self.flip))
        for name, largest in LARGEST.items():
            value = getattr(self, name)
            if value is not None:
                number_in(name, value, 0.0, largest, open_low=name in ("rate", "spot"))
        self._check_times()
        self._check_axes()
        if self.payload is not None:
            self._check_payload()
        if self.tip_offset is not None:
            vector_in("tip_offset", self.tip_offset, 10.0)
        if self.no_time and (self.rate is not None or self.delay or self.mass):
            raise InvalidParameterError("no_time excludes rate, delay and mass: leave one out")

    def _check_times(self) -> None:
        """Check tare, delay and window."""
        if isinstance(self.tare, str):
            if self.tare != "find":
                allowed = "'find' or two times (start, stop) in s"
                raise InvalidParameterError(f"tare must be {allowed}, not {shown(self.tare)}")
        elif self.tare is not None:
            object.__setattr__(self, "tare", tuple(pair_in("tare", self.tare, -1e12, 1e12)))
        if not isinstance(self.delay, str):
            check_delay("delay", self.delay)
        elif self.delay != "find":
            allowed = "'find', a time in s, or a time and its standard error"
            raise InvalidParameterError(f"delay must be {allowed}, not {shown(self.delay)}")
        if self.window is not None:
            low, high = self.window
            ends = -1e12 if low is None else low, 1e12 if high is None else high
            pair_in("window", ends, -1e12, 1e12)

    def _check_axes(self) -> None:
        """Check surface, normal and frame."""
        if self.surface is not None and not isinstance(self.surface, str):
            number_in("surface", self.surface, -1e6, 1e6)
        elif self.surface not in (None, *get_args(SurfaceRule)):
            allowed = "a number in m, threshold, baseline, fit or estimate"
            raise InvalidParameterError(f"surface must be {allowed}, not {shown(self.surface)}")
        if self.normal is not None:
            from palpate.input.preparation.normal import parse_normal

            parse_normal(self.normal)
        if self.force_frame is not None:
            check_choice("force_frame", self.force_frame, get_args(ForceFrame))

    def _check_payload(self) -> None:
        """Check the payload, and that no other option says something else of the tool."""
        from palpate.input.wrench.payload import Payload

        instance("payload", self.payload, Payload)
        excluded = {
            "tool_weight": self.tool_weight is not None,
            "mass": self.mass is not None,
            "an interval of tare": isinstance(self.tare, tuple),
            "no_time": self.no_time,
            "force_frame base": self.force_frame == "base",
        }
        for name, passed in excluded.items():
            if passed:
                raise InvalidParameterError(f"payload excludes {name}: leave one of them out")


def _check_unit(channel: str, unit: Any) -> None:
    if channel not in UNITS:
        raise InvalidParameterError(f"units must name {', '.join(UNITS)}, not {shown(channel)}")
    if not isinstance(unit, str) or not unit_size(channel, unit):
        names = list(UNITS[channel])
        allowed = f"one of {', '.join(names)} or a multiple such as 0.0098{names[0]}"
        raise InvalidParameterError(f"unit of the {channel} must be {allowed}, not {shown(unit)}")


def check_delay(
    name: str, value: float | tuple[float, float] | Delay, sample_time: float = math.nan
) -> Delay:
    """Return a delay, s, alone or with its standard error; by default that is half a sample."""
    if isinstance(value, Delay):
        return value
    seconds, *errors = value if isinstance(value, tuple) else (value,)
    if len(errors) > 1:
        allowed = "a time in s, or a time and its standard error"
        raise InvalidParameterError(f"{name} must be {allowed}, not {shown(value)}")
    number_in(name, seconds, -LONGEST_DELAY, LONGEST_DELAY)
    if not errors:
        return Delay(seconds, 0.5 * sample_time)
    error = number_in(f"standard error of the {name}", errors[0], 0.0, LONGEST_DELAY)
    return Delay(seconds, error)


def check_flip(flip: Sequence[str]) -> tuple[str, ...]:
    """Check and return the channels whose sign is reversed."""
    names = (flip,) if isinstance(flip, str) else tuple(flip)
    for channel in names:
        if channel not in FLIPPED:
            raise InvalidParameterError(
                f"flip must name {' or '.join(FLIPPED)}, not {shown(channel)}"
            )
    return names
