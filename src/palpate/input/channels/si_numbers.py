"""Channels as numbers in SI units: which unit each has, and what is excluded."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.findings import Check, Finding
from palpate.input.channels.clocks import report_excluded
from palpate.input.channels.frames import align_signs
from palpate.input.channels.kinds import is_raw
from palpate.input.channels.roles import Names, Roles
from palpate.input.recordings import Recording
from palpate.input.recordings.units import (
    GRAVITY,
    TORQUE_UNITS,
    UNITS,
    UNSTATED,
    WEIGHTS,
    unit_size,
)
from palpate.method.rows import count_true
from palpate.validation import Floats

#: Largest plausible value in SI units, also of a :class:`Scale`. Sums of eighth powers stay finite
#: below it: LAPACK prints to standard output when it meets an infinity.
LARGEST = 1e30


def measurable(values: Floats) -> Floats:
    """Replace implausibly large values by NaN."""
    beyond = np.abs(values) > LARGEST
    return np.where(beyond, np.nan, values) if beyond.any() else values


@dataclass(slots=True)
class ChannelReader:
    """Reads channels in SI units, and notes each conversion and each excluded sample.

    Attributes
    ----------
    recording : Recording
        The recording.
    units : mapping
        The requested units of ``time``, ``penetration``, ``force`` and ``velocity``.
    strict : bool
        Fail on values that are not numbers and on times that do not increase.
    made : dict
        How each channel was obtained, as text.
    findings : list of Finding
        Reports of excluded samples and of assumptions.
    stated, assumed : set of str
        Quantities whose unit the file states, and those for which palpate assumes SI.
    """

    recording: Recording
    units: Mapping[str, str]
    strict: bool = False
    made: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    stated: set[str] = field(default_factory=set)
    assumed: set[str] = field(default_factory=set)

    def read_roles(self, roles: Roles) -> dict[str, NDArray[np.generic]]:
        """Return the channels of each role as one array, in SI units."""
        values: dict[str, NDArray[np.generic]] = {}
        for role, names in roles.by_role.items():
            if names and role != "segment":
                values[role] = self._read_role(role, names, roles)
        if roles.segment is not None:
            values["segment"] = self.recording.channel(roles.segment)
        return values

    def _read_role(self, role: str, names: Names, roles: Roles) -> Floats:
        kind = "penetration" if role == "depth" else role
        columns = [self._read(name) for name in names]
        columns = [c * size for c, size in zip(columns, self._sizes(kind, names), strict=True)]
        lengths = {name: column.size for name, column in zip(names, columns, strict=True)}
        option = "position" if role == "depth" else role
        self.check_lengths("the channels of one vector", lengths, f"choose one with --{option}")
        stacked = np.column_stack(columns)
        usable = np.isfinite(stacked).all(axis=1)
        if role in ("depth", "force") and usable.size and not usable.any():
            raise self.recording.error(
                names[0],
                f"no sample has a number in [-{LARGEST:g}, {LARGEST:g}]; check its unit, or choose "
                f"another with --{kind if roles.is_penetration else option}",
            )
        if role == "orientation":
            return align_signs(stacked)  # interpolation needs it
        return columns[0] if len(columns) == 1 else stacked

    def _sizes(self, kind: str, names: Names) -> list[float]:
        """The sizes of the units of channels, in SI."""
        if kind == "torque":
            stated = (self.recording.unit_of(name) or "" for name in names)
            return [TORQUE_UNITS.get(unit, 1.0) for unit in stated]
        if kind not in UNITS:
            return [1.0] * len(names)
        requested = self.units.get(kind)
        first = requested or self._choose_unit(names[0], kind)
        units = [requested or self._choose_unit(name, kind, first) for name in names]
        self._note_units(kind, names, first)
        return [unit_size(kind, unit) for unit in units]

    def _note_units(self, kind: str, names: Names, unit: str) -> None:
        """Note how a channel was obtained, and whether its unit is stated or assumed."""
        requested = bool(self.units.get(kind))
        listed = ", ".join(map(repr, names))
        column = "column" if len(names) == 1 else "columns"
        in_si = unit == _si_unit(kind)
        self.made[kind] = f"{column} {listed}" if in_si else f"{column} {listed}, in {unit}"
        if requested or not in_si or all(map(self.recording.states_unit, names)):
            self.stated.add(kind)
        if self.recording.assumes_unit(names[0]):
            self.assumed.add(kind)
        if not requested and unit in WEIGHTS:
            message = f"{listed} is in {unit}, a mass: palpate multiplies it by {GRAVITY} m/s²"
            remedy = "pass --unit force=N if the values are forces in N"
            self.findings.append(Check.UNITS.finding(message, remedy))

    def _read(self, name: str) -> Floats:
        """Return a channel as numbers; exclude and report the samples that are not numbers."""
        recording = self.recording
        numbers = recording.numbers(name, strict=self.strict)
        column = measurable(numbers)
        if self.strict and column is not numbers:
            sample = int(np.nanargmax(np.abs(numbers)))
            problem = f"{numbers[sample]:g} is beyond {LARGEST:g}; drop --strict to exclude such "
            raise recording.error(name, f"{problem}values", sample)
        usable = np.isfinite(column)
        if count := count_true(~usable):
            text = str(recording.channels[name][int(np.argmin(usable))])
            text = recording.faults[name].text if name in recording.faults else text
            samples = "1 sample" if count == 1 else f"{count} samples"
            message = f"palpate excluded {samples} of {name!r} without a usable number"
            message += f": {text.strip()[:40]!r}"
            finding = report_excluded(message, "the recorder", count, column.size)
            self.findings.append(finding)
        return column

    def unit_of_time(self, clock: str) -> str:
        """Return the unit of a clock."""
        requested = self.units.get("time")
        unit = requested or self._choose_unit(clock, "time")
        if requested or unit != _si_unit("time") or self.recording.states_unit(clock):
            self.stated.add("time")
        return unit

    def _choose_unit(self, name: str, kind: str, default: str | None = None) -> str:
        """The unit from the recording or the channel's name; else the default, else SI."""
        recording = self.recording
        stated = recording.unit_of(name)
        si = _si_unit(kind)
        convertible = stated is not None and bool(unit_size(kind, stated))
        remedy = f"its unit, such as --unit {kind}={si}, or the size of one count, such as --unit "
        remedy += f"{kind}=0.0098{si}"
        if kind in ("penetration", "force") and is_raw(recording, name):
            reason = "these are raw counts, by the name"
        elif stated == UNSTATED:
            reason = f"the file states no unit of the {kind} ({recording.table})"
            remedy = "the units, such as --unit penetration=um,force=mN"
        elif stated is not None and convertible:
            return stated
        elif stated is None or (kind == "time" and not recording.units.get(name)):
            return default or si  # ``time (UTC)`` states a time zone, not a unit
        else:
            listed = ", ".join(UNITS[kind])
            reason = f"palpate cannot convert the unit {stated} of the {kind} (known: {listed})"
        raise recording.error(name, f"{reason}; pass {remedy}")

    def check_lengths(self, what: str, lengths: Mapping[str, int], remedy: str) -> None:
        """Refuse channels of different lengths."""
        if len({*lengths.values()}) > 1:
            listed = ", ".join(f"{name!r} has {size}" for name, size in lengths.items())
            message = f"{what} must have the same length: {listed}; {remedy}"
            raise RecordingError.of(self.recording.source, message)


def _si_unit(kind: str) -> str:
    return next(iter(UNITS[kind]))
