"""What a user corrects in a recording: units, signs, tare, delay and surface; it is all said."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.tare import deviation_left
from palpate.recordings.units import UNITS, size_of
from palpate.validation import number, number_in, pair_in, shown

FLIPPED = ("force", "penetration")
LONGEST_DELAY = 10.0  # s


@dataclass(frozen=True, slots=True)
class Corrections:
    """What is done to the channels before anything is worked out of them.

    Parameters
    ----------
    units : mapping
        The unit that a channel is in, such as ``{"penetration": "mm"}``.
    flip : sequence of str
        Channels whose sign is turned: ``"force"``, ``"penetration"``; a velocity turns with the
        penetration.
    tare : tuple of float, optional
        (start, stop), s: the mean force between them is taken off.
    delay : float
        How late the force is, s, positive: it is read that much earlier.
    surface : float
        Where the material begins, m, in the recording's penetration.
    """

    units: Mapping[str, str] = field(default_factory=dict)
    flip: Sequence[str] = ()
    tare: tuple[float, float] | None = None
    delay: float = 0.0
    surface: float = 0.0

    def __post_init__(self) -> None:
        for channel, unit in self.units.items():
            if channel not in UNITS:
                raise InvalidParameterError(
                    f"units must be of {', '.join(UNITS)}, not of {shown(channel)}"
                )
            if not isinstance(unit, str) or not size_of(channel, unit):
                known = ", ".join(UNITS[channel])
                raise InvalidParameterError(
                    f"unit of the {channel} must be one of {known}, or a multiple such as "
                    f"0.0098{_si(channel)}, not {shown(unit)}"
                )
        for channel in self.flip:
            if channel not in FLIPPED:
                raise InvalidParameterError(
                    f"flip must name some of {', '.join(FLIPPED)}, not {shown(channel)}"
                )
        if self.tare is not None:
            pair_in("tare", self.tare, -1e12, 1e12)
        number_in("delay", self.delay, -LONGEST_DELAY, LONGEST_DELAY)
        number_in("surface", self.surface, -1e6, 1e6)

    def rescaled(self, values: dict[str, Any], made: dict[str, str]) -> None:
        """Bring channels to SI, turn signs and move the surface, in place; say so in ``made``."""
        for channel, unit in self.units.items():
            if channel in values and unit != _si(channel):
                values[channel] = np.asarray(values[channel], dtype=float) * size_of(channel, unit)
                add(made, channel, f"in {unit}")
        for channel in self.flip:
            for turned in (channel, "velocity") if channel == "penetration" else (channel,):
                if turned in values:
                    values[turned] = -np.asarray(values[turned], dtype=float)
                    add(made, turned, "its sign turned")

        if self.surface and "penetration" in values:
            values["penetration"] = np.asarray(values["penetration"], dtype=float) - self.surface
            add(made, "penetration", f"counted from {self.surface:g} m")

    def tared(self, contact: Contact) -> Contact:
        """Take the mean force between two times off.

        Raises
        ------
        RecordingError
            There is no sample between them.
        """
        if self.tare is None:
            return contact
        start, stop = self.tare
        free = (contact.time >= start) & (contact.time <= stop) & np.isfinite(contact.force)
        if not free.any():
            where = f"{contact.source}: " if contact.source else ""
            raise RecordingError(
                f"{where}no sample between {start:g} s and {stop:g} s to tare the force with"
            )
        zero = float(contact.force[free].mean())
        left = deviation_left(contact.force, free)
        made = dict(contact.provenance)
        add(made, "force", f"less its mean from {start:g} s to {stop:g} s, {zero:.3g} N")
        return replace(contact, force=contact.force - zero, provenance=made, tare_deviation=left)

    def in_step(self, contact: Contact) -> Contact:
        """Read the force earlier by its delay, between samples by a straight line.

        The force, not the penetration: a smoothed penetration is another motion. Samples whose
        force is then not known, at an end of a segment, are left out.
        """
        late = number("delay", self.delay)
        if late == 0.0 or not len(contact):
            return contact
        force, keep = contact.force.copy(), np.zeros(len(contact), dtype=bool)
        for part in contact.segments():
            time = contact.time[part]
            wanted = time + late
            force[part] = np.interp(wanted, time, contact.force[part])
            keep[part] = (wanted >= time[0]) & (wanted <= time[-1])
        made = dict(contact.provenance)
        add(made, "force", f"read {abs(late) * 1e3:g} ms {'earlier' if late > 0 else 'later'}")
        return replace(contact, force=force, provenance=made).taken(keep)


def _si(channel: str) -> str:
    return next(iter(UNITS[channel]))


def add(made: dict[str, str], channel: str, words: str) -> None:
    """Add to what is said of a channel."""
    made[channel] = f"{made[channel]}, {words}" if channel in made else words
