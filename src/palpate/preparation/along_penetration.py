"""Preparation of a contact from a penetration and a compression: signs, tare, surface."""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from palpate.contact import Contact, VelocityFilter
from palpate.errors import InvalidParameterError
from palpate.findings import Check, Finding
from palpate.preparation.clocks import Signals, measurable, settle_stamps
from palpate.preparation.delay import remove_delay
from palpate.preparation.held import find_fresh_samples
from palpate.preparation.inertia import subtract_inertia
from palpate.preparation.load_transfer import exclude_load_transfer
from palpate.preparation.prepared import Place, Prepared
from palpate.preparation.roles import Columns, Roles
from palpate.preparation.settings import Preparation
from palpate.preparation.surfaces import (
    add,
    baseline_between,
    deviation_left,
    estimate_baseline,
    find_surface,
    free_samples,
    never_free,
)
from palpate.preparation.velocity import estimate_velocities
from palpate.recordings import Recording
from palpate.recordings.units import UNITS, unit_size
from palpate.stages import stage
from palpate.validation import signals as checked_signals

_LOGGER = logging.getLogger(__name__)
# m. The estimator's own search finds a surface nearer than this to zero without help.
SEARCHED = 2e-3


def along_penetration(
    recording: Recording, roles: Roles, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact from a penetration and a compression."""
    time, depth, force, part = signals.time, signals.depth, signals.force, signals.part
    values = {"time": time, "penetration": depth, "force": force, "segment": part}
    own = {} if signals.velocity is None else {"velocity": signals.velocity}
    return _prepare_channels(recording, {**values, **own}, dict(signals.made), settings)


def contact_of_arrays(given: Mapping[str, ArrayLike], settings: Preparation) -> Contact:
    """Make a contact from arrays.

    Raises
    ------
    InvalidParameterError
        An array is missing or has another type or length, or time does not increase in a segment.
    """
    if settings.no_time:
        if "time" in given or "velocity" in given:
            raise InvalidParameterError("no_time excludes a time and a velocity: leave them out")
        given = {**given, "time": np.arange(np.size(given.get("force", ())), dtype=float)}
    elif settings.rate is not None:
        if "time" in given:
            raise InvalidParameterError("pass time or rate, not both: time is measured, rate even")
        given = {**given, "time": np.arange(np.size(given.get("force", ()))) / settings.rate}
    missing = [name for name in ("time", "penetration", "force") if name not in given]
    if missing:
        rate = ", or the sample rate as rate" if missing[0] == "time" else ""
        words = f"{missing[0]} is missing: pass it as an array{rate}"
        raise InvalidParameterError(f"{words}, or pass a recording instead of arrays")
    made, values = dict[str, str](), dict(given)
    for channel, unit in settings.units.items():
        if channel in values and unit != next(iter(UNITS[channel])):
            values[channel] = np.asarray(values[channel], dtype=float) * unit_size(channel, unit)
            add(made, channel, f"in {unit}")
    findings = () if settings.strict else _settle_arrays(values)
    contact = _prepare_channels(None, values, made, settings)
    if settings.no_time:
        contact = drop_velocity(contact)
    usual = Columns()
    raw = Recording({getattr(usual, name): np.asarray(each) for name, each in given.items()})
    return replace(
        contact,
        prepared=replace(contact.prepared, recording=raw),
        findings=(*findings, *contact.findings),
        stated_units=frozenset(settings.units) | ({"time"} if settings.rate else frozenset()),
    )


def drop_velocity(contact: Contact) -> Contact:
    """Return the contact of a curve without time: at rest everywhere, so that no damping fits."""
    words = {name: note for name, note in contact.provenance.items() if name != "velocity"}
    still = np.zeros_like(contact.velocity)
    return replace(contact, velocity=still, velocity_filter=None, provenance=words, timeless=True)


def _settle_arrays(values: dict[str, ArrayLike]) -> tuple[Finding, ...]:
    """Drop rows that were written twice and spread a coarse clock, in place.

    Arrays of the wrong type or length stay as they are: the contact refuses them.
    """
    arrays = {name: np.asarray(each) for name, each in values.items()}
    time, others = arrays["time"], [each for name, each in arrays.items() if name != "time"]
    size = time.shape if time.ndim == 1 and time.dtype.kind in "iuf" else None
    if any(each.shape != size or np.ma.is_masked(values[name]) for name, each in arrays.items()):
        return ()
    stamps, keep, findings = settle_stamps(time, others)
    if findings:
        values |= {name: each[keep] for name, each in (arrays | {"time": stamps}).items()}
    return tuple(findings)


def describe_filter(used: VelocityFilter, lost: int) -> str:
    """Describe how the velocity was computed."""
    words = "centred quadratic Savitzky–Golay filter"
    if used.penalty is not None:
        words = f"smoothing spline, as noisy as a parabola through {used.samples} samples"
    return words + (f", without {lost} dropout{'s' if lost > 1 else ''}" if lost else "")


def _prepare_channels(
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
    late = settings.delay
    held = None if settings.no_time else find_fresh_samples(time, penetration, force, force)
    if held is not None:
        contact = contact.taken(held.before)
        contact = replace(contact, force=held.taken(force), findings=(held.finding,))
        late = late or held.late
    if "velocity" not in values:
        runs, window = list(contact.segments()), settings.velocity_window
        with stage(_LOGGER, "velocity by the filter"):
            motion = contact.time, contact.penetration
            velocity, used, lost = estimate_velocities(*motion, runs, window)
        words = {**contact.provenance, "velocity": describe_filter(used, lost)}
        contact = replace(contact, velocity=velocity, velocity_filter=used, provenance=words)
    if held is not None:
        contact = contact.taken(held.after)
    done = Prepared(recording or Recording({}), settings)
    contact, done = _subtract_offset(contact, done)
    contact, done = _surface_found(contact, done)
    contact = subtract_inertia(remove_delay(contact, late), settings.mass)
    contact = replace(contact, prepared=done)
    low, high = settings.window or (None, None)
    return contact if low is None and high is None else contact.window(low, high)


def _correct(values: dict[str, ArrayLike], made: dict[str, str], settings: Preparation) -> None:
    """Reverse signs and subtract a given surface position, in place."""
    for channel in settings.flip:
        for turned in (channel, "velocity") if channel == "penetration" else (channel,):
            if turned in values:
                values[turned] = -np.asarray(values[turned], dtype=float)
                add(made, turned, "sign reversed")
    surface = settings.surface
    if surface and not isinstance(surface, str):
        values["penetration"] = np.asarray(values["penetration"], dtype=float) - surface
        add(made, "penetration", f"relative to {surface:g} m")


def _subtract_offset(contact: Contact, done: Prepared) -> tuple[Contact, Prepared]:
    """Subtract the force offset: its mean between two times or in detected free air."""
    times, source = done.settings.tare, contact.source
    if times is None:
        return contact, done
    if isinstance(times, tuple | list):
        found = baseline_between(contact.time, contact.force, times, source)
    else:
        with stage(_LOGGER, "free air"):
            free = free_samples(contact.time, -contact.penetration, contact.force)
        if free is None:
            raise never_free(source)
        found = estimate_baseline(contact.time, contact.force, free)
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
        found = find_surface(contact.penetration, contact.velocity, contact.force, rule)
    if rule == "estimate" and (found.assumed or abs(found.position) <= SEARCHED):
        return contact, done  # the estimator finds the surface itself
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


OF_THE_WHOLE = (Check.EPISODES, Check.SURFACE, Check.ORIENTATION)


def divide_by_place(contact: Contact, *, rejecting: bool) -> Iterator[tuple[Place, Contact]]:
    """Yield each place and the contact there, with its own surface; nothing for a single place.

    ``rejecting``: exclude load transfer first, because all touches together show it more clearly
    than the touches at one place.
    Findings on the whole recording are dropped: within one place the orientation hardly changes.
    """
    places = () if contact.prepared is None else contact.prepared.places
    if rejecting and places:
        contact = exclude_load_transfer(contact)
    parts = list(contact.segments())
    common = tuple(finding for finding in contact.findings if finding.check not in OF_THE_WHOLE)
    for place in places:
        there = np.zeros(len(contact), dtype=bool)
        for part in parts:
            there[part] = place.start <= contact.time[part.start] <= place.stop
        if not there.any():  # outside the time window
            continue
        own = replace(
            contact.taken(there),
            surface_deviation=place.surface.deviation or None,
            findings=(*common, *place.surface.assumption()),
        )
        yield place, own
