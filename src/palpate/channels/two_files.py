"""Two files, one clock: a position and a force of two recorders, joined in one recording.

The offset of their clocks is found in two steps. The rough offset is the lag at which the position
explains most of the force. The fine offset is the lag that a contact law explains best.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from palpate.channels.roles import Columns, Offer, offer_of
from palpate.channels.signals import SINCE_LONG_AGO, Stream, origin_of, stream_of
from palpate.contact import Contact, Delay
from palpate.digits import rounded, with_error
from palpate.errors import RecordingError
from palpate.findings import Check, Finding
from palpate.preparation.clock_offset import fine_offset, rough_offset
from palpate.preparation.delay import LONGEST_FOUND
from palpate.preparation.settings import Preparation, check_delay
from palpate.recordings import Recording
from palpate.recordings.recording import unit_size
from palpate.validation import Floats

Value = TypeVar("Value")

MOST_ROUNDS = 5  # the surface depends on the offset, and the offset on the surface
SETTLED = 0.3  # standard errors; a smaller correction is the last
SIGNIFICANT = 2.0  # standard errors; a smaller offset of clocks that both show the date is none
USUAL_ERROR = 1e-3  # s, of an offset that is passed without a standard error


@dataclass(frozen=True, slots=True, eq=False)
class FilePair:
    """A position and a force in one recording, with a clock each.

    Attributes
    ----------
    recording : Recording
        The channels of both files.
    clock : str
        Name of the force's clock in it.
    names : tuple of str
        Names of the two files, the position's first.
    streams : tuple of Stream
        Position and force with their times, each on its own clock.
    columns : Columns
        The names of the channels in it.
    """

    recording: Recording
    clock: str
    names: tuple[str, str]
    streams: tuple[Stream, Stream]
    columns: Columns

    @property
    def origins(self) -> tuple[float, float]:
        """Origins of the two clocks, s."""
        first, second = (float(origin_of(s)) * unit_size("time", s.unit) for s in self.streams)
        return first, second

    @property
    def dated(self) -> bool:
        """Whether both clocks count from 1970."""
        return min(self.origins) > SINCE_LONG_AGO

    def signals(self) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
        """Times since the clock's origin [s] and values, of position and of force."""
        times = [each.seconds(origin_of(each)) for each in self.streams]
        values = [np.column_stack([*each.values.values()]).astype(float) for each in self.streams]
        return (times[0], values[0]), (times[1], values[1])

    def moved(self, lag: float) -> Recording:
        """Return the recording with the force's clock moved back by a lag after the origins, s."""
        own, other = self.streams
        origin = origin_of(own)
        seconds = other.seconds(origin_of(other)) - lag
        time: NDArray[Any] = seconds / unit_size("time", own.unit)
        if isinstance(origin, int) and own.unit == "ns":  # a float since 1970 has steps of 256 ns
            time = np.rint(time).astype(np.int64)
        time = time + origin
        return replace(self.recording, channels={**self.recording.channels, self.clock: time})


def pair_recordings(first: Recording, second: Recording, settings: Preparation) -> FilePair:
    """Join the position of one file and the force of the other: the roles decide which.

    Raises
    ------
    RecordingError
        The two files do not have a position and a force, or each of them has both.
    """
    offers = [offer_of(each, settings.columns) for each in (first, second)]
    for motion, push in (offers, offers[::-1]):
        if motion.depths and push.forces and not (motion.forces and push.depths):
            return _joined(motion, push, settings)
    files = f"{first.source} and {second.source}"
    if all(each.depths and each.forces for each in offers):
        raise RecordingError(
            f"{files}: each file has a position and a force; choose with --position or --force a "
            "channel that only one file has, or identify one file without the other"
        )
    absent = "force" if any(each.depths for each in offers) else "position"
    words = f"no channel looks like the {absent}; name it with --{absent}"
    raise RecordingError(f"{files}: {words}; palpate info lists the channels of a file")


def _joined(motion: Offer, push: Offer, settings: Preparation) -> FilePair:
    own, other = motion.recording, push.recording
    names = Path(own.source).name or "position", Path(other.source).name or "force"
    if names[0] == names[1]:
        names = f"{names[0]} (position)", f"{names[1]} (force)"
    first, second = (
        stream_of(each.recording, each.clock_of(channels), channels, settings.units, settings.rate)
        for each, channels in ((motion, motion.depths[0]), (push, push.forces[0]))
    )
    unused = {name for each in motion.forces for name in each}
    forces = {name for each in push.forces for name in each}
    channels = {name: values for name, values in own.channels.items() if name not in unused}
    clock, clocks = f"{names[1]}/{second.clock or 'time'}", dict(own.clocks)
    units = dict(own.units)
    if not clocks:  # a table
        time, size = f"{names[0]}/{first.clock or 'time'}", len(first.time)
        channels.pop(first.clock or "", None)
        clocks = {name: time for name, values in channels.items() if len(values) == size}
        channels[time], units[time] = first.time, first.unit
    channels |= {name: other.channels[name] for name in forces}
    channels[clock], units[clock] = second.time, first.unit
    joined = replace(
        own,
        channels=channels,
        units=units | _only(other.units, forces),
        clocks=clocks | dict.fromkeys(forces, clock),
        frames={**own.frames, **_only(other.frames, forces)},
        faults={**own.faults, **_only(other.faults, forces)},
        types={**other.types, **own.types},
        notes={**other.notes, **own.notes},
        findings=(*own.findings, *other.findings),
        rows=None,
        source=f"{own.source}, {other.source}",
    )
    columns = replace(settings.columns, time=Columns().time)
    if len(push.forces) == 1:  # else choosing among them refuses
        columns = replace(columns, force=",".join(push.forces[0]))
    return FilePair(joined, clock, names, (first, second), columns)


def _only(values: Mapping[str, Value], names: set[str]) -> dict[str, Value]:
    return {name: value for name, value in values.items() if name in names}


def align(
    first: Recording,
    second: Recording,
    settings: Preparation,
    prepare: Callable[[Recording, Preparation], Contact],
) -> tuple[Recording, Preparation]:
    """Move the force's clock to the position's; return one recording, and settings for it.

    Parameters
    ----------
    first, second : Recording
        A position and a force, in any order.
    settings : Preparation
        Its delay, if any, is the whole offset of the clocks; else the offset is found.
    prepare : callable
        Makes a contact from a recording and settings.

    Raises
    ------
    RecordingError
        The files do not have a position and a force, or no offset of their clocks explains the
        force.
    """
    pair, given = pair_recordings(first, second, settings), settings.delay
    settings = replace(settings, columns=pair.columns, rate=None, delay=0.0)
    apart = pair.origins[1] - pair.origins[0]
    drift = 0.0
    if isinstance(given, str) or given == 0.0:
        lag, offset, drift = _find_lag(pair, settings, apart, prepare)
    else:
        stated = (given, USUAL_ERROR) if isinstance(given, int | float) else given
        offset = check_delay("delay", stated)
        lag = offset.seconds - apart
    insignificant = abs(offset.seconds) < SIGNIFICANT * offset.standard_error
    if pair.dated and offset.found and insignificant and not drift:
        finding = _describe_one_clock(offset)
        lag, rest, found = -apart, offset.seconds, False
    else:
        finding = _describe(pair.names[1], offset, drift)
        rest, found = drift / math.sqrt(12.0), offset.found
    error = math.hypot(offset.standard_error, rest)
    recording = pair.moved(lag)
    notes = {**recording.notes, "clocks": finding.message}
    recording = replace(recording, notes=notes, findings=(*recording.findings, finding))
    left = replace(offset, seconds=0.0, standard_error=error, found=found)
    return recording, replace(settings, delay=left if error else 0.0)


def _find_lag(
    pair: FilePair,
    settings: Preparation,
    apart: float,
    prepare: Callable[[Recording, Preparation], Contact],
) -> tuple[float, Delay, float]:
    """Find the lag of the force's clock after the origins, the offset, and the drift."""
    motion, push = pair.signals()
    lag = rough_offset(motion, push, -apart if pair.dated else None)
    if lag is None:
        raise RecordingError(
            f"{pair.recording.source}: palpate cannot find the offset of the two clocks: the "
            "position explains the force at no offset; record the same touches in both files, or "
            "pass the offset, such as --delay 37ms+-0.5ms"
        )
    reach = LONGEST_FOUND
    for _ in range(MOST_ROUNDS):
        contact = prepare(pair.moved(lag), settings)
        rest, drift = fine_offset(contact, reach)
        lag += rest.seconds
        reach = 4.0 * max(rest.standard_error + abs(rest.seconds), contact.sample_time)
        if abs(rest.seconds) < SETTLED * rest.standard_error:
            break
    return lag, replace(rest, seconds=lag + apart), drift


def _describe_one_clock(offset: Delay) -> Finding:
    """Report that two clocks that count from 1970 are taken for one."""
    size = with_error(1e3 * offset.seconds, 1e3 * offset.standard_error, unit="ms")
    words = f"both clocks count from 1970: the offset found, {size}, is not significant and was "
    return Check.CLOCK_OFFSET.finding(f"{words}not applied")


def _describe(name: str, offset: Delay, drift: float) -> Finding:
    """Report the offset of a file's clock and its drift."""
    late, error = abs(offset.seconds), offset.standard_error
    size, unit = (1e3, "ms") if late < 1.0 else (1.0, "s")
    words = with_error(late * size, error * size, unit=unit)
    if late > 1e4:  # one clock shows the date
        words = f"{late:.4f} s ± {rounded(1e3 * error, 2)} ms"
    way = "ahead" if offset.seconds > 0.0 else "behind"
    sentence = f"{name}'s clock is {words} {way}; it was moved"
    if not drift:
        return Check.CLOCK_OFFSET.finding(sentence)
    sentence += f"; it drifts by {rounded(1e3 * abs(drift), 2)} ms over the recording"
    remedy = "identify shorter parts, --start and --stop: palpate finds the offset of each"
    return Check.CLOCK_OFFSET.finding(sentence, remedy, damping="with-care")
