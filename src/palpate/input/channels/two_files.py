"""Two files of one contact: a position and a force of two recorders, joined in one recording."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from palpate.errors import RecordingError
from palpate.input.channels.clocks import Times
from palpate.input.channels.roles import Columns, Offer, offer_of
from palpate.input.channels.signals import SINCE_LONG_AGO, Stream, origin_of, stream_of
from palpate.input.recordings import Recording
from palpate.input.recordings.units import unit_size
from palpate.validation import Floats, Values, frozen

Label = TypeVar("Label")


@frozen(eq=False)
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
    position, force : Stream
        The channels with their times, each on its own clock.
    columns : Columns
        The names of the channels in it.
    """

    recording: Recording
    clock: str
    names: tuple[str, str]
    position: Stream
    force: Stream
    columns: Columns

    @property
    def distance(self) -> float:
        """Origin of the force's clock after that of the position's, s."""
        return _start_of(self.force) - _start_of(self.position)

    @property
    def dated(self) -> bool:
        """Whether both clocks count from 1970."""
        return min(_start_of(self.position), _start_of(self.force)) > SINCE_LONG_AGO

    def moved(self, lag: float) -> Recording:
        """Return the recording with the force's clock moved back by a lag after the origins, s."""
        unit = self.position.unit
        origin = origin_of(self.position)
        seconds = self.force.seconds(origin_of(self.force)) - lag
        time: Values = seconds / unit_size("time", unit)
        if isinstance(origin, int) and unit == "ns":  # a float since 1970 has steps of 256 ns
            time = np.rint(time).astype(np.int64)
        channels = {**self.recording.channels, self.clock: time + origin}
        return replace(self.recording, channels=channels)


def _start_of(stream: Stream) -> float:
    """The origin of a clock, s."""
    return float(origin_of(stream)) * unit_size("time", stream.unit)


def signal_of(stream: Stream) -> tuple[Floats, Floats]:
    """Return times since the clock's origin [s], and values, shape (k, axes)."""
    values = np.column_stack([*stream.values.values()]).astype(float)
    return stream.seconds(origin_of(stream)), values


def pair_recordings(
    first: Recording,
    second: Recording,
    columns: Columns,
    units: Mapping[str, str],
    rate: float | None,
) -> FilePair:
    """Join the position of one file and the force of the other: the roles decide which.

    Raises
    ------
    RecordingError
        The two files do not have a position and a force, or each of them has both.
    """
    offers = [offer_of(recording, columns) for recording in (first, second)]
    for position, force in (offers, offers[::-1]):
        if position.depths and force.forces and not (position.forces and force.depths):
            channels = (position, position.depths[0]), (force, force.forces[0])
            streams = [
                stream_of(offer.recording, offer.clock_of(names), names, units, rate)
                for offer, names in channels
            ]
            return _join(position, force, streams, columns)
    files = f"{first.source} and {second.source}"
    if all(offer.depths and offer.forces for offer in offers):
        raise RecordingError(
            f"{files}: each file has a position and a force; choose with --position or --force a "
            "channel that only one file has, or identify one file without the other"
        )
    absent = "force" if any(offer.depths for offer in offers) else "position"
    raise RecordingError(
        f"{files}: no channel looks like the {absent}; name it with --{absent}; palpate info lists "
        "the channels of a file"
    )


def _join(position: Offer, force: Offer, streams: list[Stream], columns: Columns) -> FilePair:
    """One recording of the position's file without its forces, and of the other file's forces."""
    motion, push = position.recording, force.recording
    names = Path(motion.source).name or "position", Path(push.source).name or "force"
    if names[0] == names[1]:
        names = f"{names[0]} (position)", f"{names[1]} (force)"
    of_position, of_force = streams
    unused = {name for vector in position.forces for name in vector}
    forces = {name for vector in force.forces for name in vector}
    channels = {name: values for name, values in motion.channels.items() if name not in unused}
    clocks = dict(motion.clocks)
    times: dict[str, Times] = {}
    if not clocks:  # a table
        time = f"{names[0]}/{of_position.clock or 'time'}"
        channels.pop(of_position.clock or "", None)
        size = len(of_position.time)
        clocks = {name: time for name, values in channels.items() if len(values) == size}
        times[time] = of_position.time
    clock = f"{names[1]}/{of_force.clock or 'time'}"
    times[clock] = of_force.time
    recording = replace(
        motion,
        channels=channels | {name: push.channels[name] for name in forces} | times,
        units=_merge(motion.units, push.units, forces) | dict.fromkeys(times, of_position.unit),
        clocks=clocks | dict.fromkeys(forces, clock),
        frames=_merge(motion.frames, push.frames, forces),
        faults=_merge(motion.faults, push.faults, forces),
        types={**push.types, **motion.types},
        notes={**push.notes, **motion.notes},
        findings=(*motion.findings, *push.findings),
        rows=None,
        source=f"{motion.source}, {push.source}",
    )
    columns = replace(columns, time=Columns().time)
    if len(force.forces) == 1:  # else choosing among them refuses
        columns = replace(columns, force=",".join(force.forces[0]))
    return FilePair(recording, clock, names, of_position, of_force, columns)


def _merge(
    motion: Mapping[str, Label], push: Mapping[str, Label], forces: set[str]
) -> dict[str, Label]:
    """The labels of all channels of one file, and of the forces of the other."""
    return {**motion, **{name: label for name, label in push.items() if name in forces}}
