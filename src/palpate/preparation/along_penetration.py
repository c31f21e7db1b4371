"""A contact of a penetration and a compression: corrected, tared, counted from the surface."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.clocks import Signals, measurable
from palpate.preparation.roles import Columns, Roles
from palpate.preparation.settings import Normal, Preparation
from palpate.preparation.surfaces import (
    Surface,
    add,
    baseline_between,
    baseline_of,
    deviation_left,
    free_samples,
    never_free,
    surface_of,
)
from palpate.preparation.velocity import lost_positions, velocity_of, window_samples
from palpate.recordings import Recording
from palpate.recordings.recording import UNITS, size_of
from palpate.stages import stage, timed
from palpate.validation import Floats
from palpate.validation import signals as checked_signals

_LOGGER = logging.getLogger(__name__)

# m. Of the estimator's own search for the surface: nearer than this to zero it needs no help.
SEARCHED = 2e-3


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """One place of the material, and the times at which the probe was there.

    Attributes
    ----------
    start, stop : float
        s.
    position : numpy.ndarray, shape (3,)
        The median one, m, in the frame of the recording.
    normal : Normal or None
        Of the contact there; None where the position is along one axis.
    surface : Surface
        Along that normal.
    """

    start: float
    stop: float
    position: Floats
    normal: Normal | None
    surface: Surface

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers."""
        return {
            "position": self.position.tolist(),
            "normal": None if self.normal is None else self.normal.vector.tolist(),
            "surface": self.surface.position,
            "surface_deviation": self.surface.deviation,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """The way from a recording to a contact.

    Attributes
    ----------
    recording : Recording
        The channels as they were recorded.
    settings : Preparation
        What was asked for.
    zero : numpy.ndarray, optional
        What was taken off the force, N: one number; or three, in the axes of the sensor.
    drift : float
        How far that goes over the recording, N.
    normal : Normal, optional
        Of the whole, where the probe moves in space.
    surface : Surface, optional
        Where one was found; in the penetration of the recording, or along the normal.
    window : float, optional
        Length of the velocity filter, s, where the velocity was worked out.
    places : tuple of Place
        Where the probe travels: one for each segment of the contact.
    way : callable, optional
        What makes a contact of the recording by the settings.
    """

    recording: Recording
    settings: Preparation
    zero: Floats | None = None
    drift: float = 0.0
    normal: Normal | None = None
    surface: Surface | None = None
    window: float | None = None
    places: tuple[Place, ...] = ()
    way: Callable[[Recording, Preparation], Contact] | None = field(default=None, repr=False)

    def again(self) -> Contact:
        """Make the contact again: the same, to the last bit.

        Raises
        ------
        RecordingError
            It was made of arrays, not of a recording.
        """
        if self.way is None:
            raise RecordingError("a contact of arrays has no recording to be made of again")
        return self.way(self.recording, self.settings)


def along_penetration(
    recording: Recording, roles: Roles, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact of a penetration and a force that is a compression."""
    time, depth, force, part = signals.time, signals.depth, signals.force, signals.part
    values = {"time": time, "penetration": depth, "force": force, "segment": part}
    own = {} if signals.velocity is None else {"velocity": signals.velocity}
    return _prepared(recording, {**values, **own}, dict(signals.made), settings)


def contact_of_arrays(given: Mapping[str, ArrayLike], settings: Preparation) -> Contact:
    """Make a contact of arrays.

    Raises
    ------
    InvalidParameterError
        One is missing, of another type or length, or time does not increase within a segment.
    """
    missing = [name for name in ("time", "penetration", "force") if name not in given]
    if missing:
        raise InvalidParameterError(
            f"{missing[0]} must be given, as an array, or a recording in place of all arrays"
        )
    made, values = dict[str, str](), dict(given)
    for channel, unit in settings.units.items():
        if channel in values and unit != next(iter(UNITS[channel])):
            values[channel] = np.asarray(values[channel], dtype=float) * size_of(channel, unit)
            add(made, channel, f"in {unit}")
    contact = _prepared(None, values, made, settings)
    usual = Columns()
    raw = Recording({getattr(usual, name): np.asarray(each) for name, each in given.items()})
    return replace(contact, prepared=replace(contact.prepared, recording=raw))


@timed("velocity by the filter")
def velocities_of(
    time: Floats, depth: Floats, runs: Sequence[slice], window: float | None
) -> tuple[Floats, int]:
    """The velocity, a run at a time, and how many lost positions were left out of it."""
    parts = [velocity_of(time[run], depth[run], window) for run in runs]
    lost = sum(lost_positions(depth[run]) for run in runs)
    return np.concatenate([np.empty(0), *parts]), lost


def describe_filter(lost: int) -> str:
    """Say how a velocity was worked out."""
    words = "centred quadratic Savitzky–Golay filter"
    return words + (f", without {lost} lost position{'s' if lost > 1 else ''}" if lost else "")


def velocity_filter(contact: Contact, window: float | None) -> float:
    """Length of the filter that a velocity is worked out with, s."""
    return window_samples(contact.sample_time, window) * contact.sample_time


def _prepared(
    recording: Recording | None,
    values: dict[str, ArrayLike],
    made: dict[str, str],
    settings: Preparation,
) -> Contact:
    _correct(values, made, settings)
    measured = {name: values[name] for name in ("time", "penetration", "force")}
    time, penetration, force = checked_signals(**measured)
    penetration, force = measurable(penetration), measurable(force)
    contact = Contact(
        time,
        penetration=penetration,
        velocity=values.get("velocity", np.zeros_like(time)),
        force=force,
        segment=values.get("segment"),
        provenance=made,
        source="" if recording is None else recording.source,
    )
    length = None
    if "velocity" not in values:
        length = velocity_filter(contact, settings.velocity_window)
        runs, window = list(contact.segments()), settings.velocity_window
        velocity, lost = velocities_of(time, penetration, runs, window)
        words = {**contact.provenance, "velocity": describe_filter(lost)}
        contact = replace(contact, velocity=velocity, provenance=words)
    done = Prepared(recording or Recording({}), settings, window=length)
    contact, done = _tared(contact, done)
    contact, done = _surface_found(contact, done)
    contact = replace(in_step(contact, settings.delay), prepared=done)
    low, high = settings.window or (None, None)
    return contact if low is None and high is None else contact.window(low, high)


def _correct(values: dict[str, ArrayLike], made: dict[str, str], settings: Preparation) -> None:
    """Turn signs, and move a surface that was given to 0, in place; a velocity turns too."""
    for channel in settings.flip:
        for turned in (channel, "velocity") if channel == "penetration" else (channel,):
            if turned in values:
                values[turned] = -np.asarray(values[turned], dtype=float)
                add(made, turned, "its sign turned")
    surface = settings.surface
    if surface and not isinstance(surface, str):
        values["penetration"] = np.asarray(values["penetration"], dtype=float) - surface
        add(made, "penetration", f"counted from {surface:g} m")


def in_step(contact: Contact, late: float) -> Contact:
    """Read the force earlier by its delay, s, between samples by a straight line.

    The force, not the penetration: a smoothed penetration is another motion. Samples whose force is
    then not known, at an end of a segment, are left out.
    """
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


def _tared(contact: Contact, done: Prepared) -> tuple[Contact, Prepared]:
    """Take the zero of the force off: its mean between two times, or what is found."""
    times, source = done.settings.tare, contact.source
    if times is None:
        return contact, done
    if isinstance(times, tuple | list):
        found = baseline_between(contact.time, contact.force, times, source)
    else:
        with stage(_LOGGER, "times out of contact"):
            free = free_samples(-contact.penetration, contact.force)
        if free is None:
            raise never_free(source)
        found = baseline_of(contact.time, contact.force, free)
    made, findings = dict(contact.provenance), list(contact.findings)
    found.say(made, findings)
    force = contact.force - found.zero
    left, said = deviation_left(force, found.free), tuple(findings)
    contact = replace(contact, force=force, provenance=made, tare_deviation=left, findings=said)
    return contact, replace(done, zero=found.mean, drift=found.drift)


def _surface_found(contact: Contact, done: Prepared) -> tuple[Contact, Prepared]:
    rule = done.settings.surface
    if not isinstance(rule, str):
        return contact, done
    with stage(_LOGGER, "surface"):
        found = surface_of(contact.penetration, contact.velocity, contact.force, rule)
    if rule == "estimate" and (found.assumed or abs(found.position) <= SEARCHED):
        return contact, done  # the estimator finds it from here
    made, findings = dict(contact.provenance), list(contact.findings)
    found.say(made, findings)
    counted = replace(
        contact,
        penetration=contact.penetration - found.position,
        provenance=made,
        surface_deviation=(found.deviation or None) if rule != "estimate" else None,
        findings=tuple(findings),
    )
    return counted, replace(done, surface=found)


# The contacts of a probe that travels: one at each place.

OF_THE_WHOLE = ("episodes", "surface", "orientation")


def at_places(contact: Contact) -> Iterator[tuple[Place, Contact]]:
    """Return each place and the contact there, with its own surface; none where it is one place.

    Within an episode the orientation hardly changes: only the whole has to be warned of that.
    """
    places = () if contact.prepared is None else contact.prepared.places
    parts = list(contact.segments())
    common = tuple(finding for finding in contact.findings if finding.check not in OF_THE_WHOLE)
    for place in places:
        times = ((place.start <= contact.time[part.start] <= place.stop, part) for part in parts)
        part = next((part for inside, part in times if inside), None)
        if part is None:  # left out by a window
            continue
        own = replace(
            contact.taken(part),
            surface_deviation=place.surface.deviation or None,
            findings=(*common, *place.surface.assumption()),
        )
        yield place, own
