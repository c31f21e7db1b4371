"""What a contact was made of, so that it can be made again identically, and what was found."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.contact import Contact, Remark
from palpate.digits import rounded
from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.clocks import Signals, measurable
from palpate.preparation.roles import Roles
from palpate.preparation.settings import Normal, Preparation, add
from palpate.preparation.surfaces import (
    Surface,
    SurfaceRule,
    baseline_of,
    deviation_left,
    free_samples,
    surface_of,
)
from palpate.preparation.velocity import lost_positions, velocity_of, window_samples
from palpate.recordings import Recording
from palpate.stages import stage, timed
from palpate.validation import Floats
from palpate.validation import signals as checked_signals


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


# A recording of a penetration and a compression, or arrays of them: as they are, corrected.

_LOGGER = logging.getLogger(__name__)

# m. Of the estimator's own search for the surface: nearer than this to zero it needs no help.
SEARCHED = 2e-3


def along_penetration(
    recording: Recording, roles: Roles, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact of a penetration and a force that is a compression."""
    values: dict[str, ArrayLike] = {
        "time": signals.time,
        "penetration": signals.depth,
        "force": signals.force,
        "segment": signals.part,
    }
    if signals.velocity is not None:
        values["velocity"] = signals.velocity
    return _prepared(recording, values, dict(signals.made), replace(settings, units={}), settings)


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
    made: dict[str, str] = {}
    names = {"time": "time_s", "penetration": "penetration_m", "force": "force_N"}
    names |= {"velocity": "velocity_m_s", "segment": "segment"}
    contact = _prepared(None, dict(given), made, settings, settings)
    raw = Recording({names[name]: np.asarray(values) for name, values in given.items()})
    done = contact.prepared
    return replace(contact, prepared=None if done is None else replace(done, recording=raw))


@timed("velocity by the filter")
def with_velocity(contact: Contact, window: float | None) -> Contact:
    """Work the velocity out, a segment at a time."""
    runs = list(contact.segments())
    velocity, lost = velocities_of(contact.time, contact.penetration, runs, window)
    made = {**contact.provenance, "velocity": filter_words(lost)}
    return replace(contact, velocity=velocity, provenance=made)


def velocities_of(
    time: Floats, depth: Floats, runs: Sequence[slice], window: float | None
) -> tuple[Floats, int]:
    """The velocity, a run at a time, and how many lost positions were left out of it."""
    parts = [velocity_of(time[run], depth[run], window) for run in runs]
    lost = sum(lost_positions(depth[run]) for run in runs)
    return np.concatenate([np.empty(0), *parts]), lost


def filter_words(lost: int) -> str:
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
    corrected: Preparation,
    settings: Preparation,
) -> Contact:
    corrections = corrected.corrections()
    corrections.rescaled(values, made)
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
        contact = with_velocity(contact, settings.velocity_window)
    contact = corrections.tared(contact)
    done = Prepared(recording or Recording({}), settings, window=length)
    contact, done = _tare_found(contact, done)
    contact, done = _surface_found(contact, done)
    contact = replace(corrections.in_step(contact), prepared=done)
    low, high = settings.window or (None, None)
    return contact if low is None and high is None else contact.window(low, high)


def _tare_found(contact: Contact, done: Prepared) -> tuple[Contact, Prepared]:
    if done.settings.tare != "find":
        return contact, done
    with stage(_LOGGER, "times out of contact"):
        free = free_samples(-contact.penetration, contact.force)
    if free is None:
        where = f"{contact.source}: " if contact.source else ""
        raise RecordingError(
            f"{where}the probe is never seen out of contact, so that no zero of the force can be "
            "found; give a time without contact, --tare 0:2"
        )
    found = baseline_of(contact.time, contact.force, free)
    made = dict(contact.provenance)
    count = int(np.count_nonzero(found.free))
    add(
        made,
        "force",
        f"less {rounded(float(found.mean[0]), 3)} N, its mean over {count} free samples",
    )
    remarks = list(contact.remarks)
    if found.drift:
        add(made, "force", f"and its drift of {rounded(found.drift, 3)} N")
        words = f"the zero of the force drifts by {rounded(found.drift, 3)} N, which was taken off"
        remarks.append(Remark("tare", words, "let the sensor warm up"))
    force = contact.force - found.zero
    left = deviation_left(force, found.free)
    contact = replace(
        contact, force=force, provenance=made, tare_deviation=left, remarks=tuple(remarks)
    )
    return contact, replace(done, zero=found.mean, drift=found.drift)


def _surface_found(contact: Contact, done: Prepared) -> tuple[Contact, Prepared]:
    rule = done.settings.surface
    if not isinstance(rule, str):
        return contact, done
    with stage(_LOGGER, "surface"):
        found = surface_of(contact.penetration, contact.velocity, contact.force, rule)
    if rule == "estimate" and (found.assumed or abs(found.position) <= SEARCHED):
        return contact, done  # the estimator finds it from here
    return counted_from(contact, found, rule), replace(done, surface=found)


def counted_from(contact: Contact, surface: Surface, rule: SurfaceRule) -> Contact:
    """Count the penetration from a surface that was found; say so, and how well it is known."""
    made = dict(contact.provenance)
    words = f"counted from {rounded(surface.position, 6)} m, {surface.words}"
    if surface.deviation is not None:
        words += f" (± {rounded(surface.deviation, 2)} m)"
    add(made, "penetration", words)
    deviation = surface.deviation if rule != "estimate" else None
    return replace(
        contact,
        penetration=contact.penetration - surface.position,
        provenance=made,
        surface_deviation=deviation if deviation else None,
        remarks=(*contact.remarks, *assumption(surface)),
    )


def assumption(surface: Surface) -> list[Remark]:
    """Say that a surface is assumed, where it is."""
    if not surface.assumed:
        return []
    return [
        Remark(
            "surface",
            "the probe is never seen out of contact: where the surface lies is an assumption, the "
            "shallowest sample; K, B and n are for it, stiffness and damping at working depth hold "
            "all the same",
            "record from before the touch, or give --surface",
            "with-care",
        )
    ]


# The contacts of a probe that travels: one at each place.

OF_THE_WHOLE = ("episodes", "surface", "orientation")


def at_places(contact: Contact) -> Iterator[tuple[Place, Contact]]:
    """Return each place and the contact there, with its own surface; none where it is one place.

    Within an episode the orientation hardly changes: only the whole has to be warned of that.
    """
    places = () if contact.prepared is None else contact.prepared.places
    parts = list(contact.segments())
    common = tuple(remark for remark in contact.remarks if remark.step not in OF_THE_WHOLE)
    for place in places:
        times = ((place.start <= contact.time[part.start] <= place.stop, part) for part in parts)
        part = next((part for inside, part in times if inside), None)
        if part is None:  # left out by a window
            continue
        own = replace(
            contact.taken(part),
            surface_deviation=place.surface.deviation or None,
            remarks=(*common, *assumption(place.surface)),
        )
        yield place, own
