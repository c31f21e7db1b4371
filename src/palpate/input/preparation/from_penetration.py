"""A contact from a penetration and a compression, of a recording or of arrays: signs, surface."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Finding
from palpate.input.channels.clocks import settle_stamps
from palpate.input.channels.roles import Columns
from palpate.input.channels.si_numbers import measurable
from palpate.input.channels.signals import Signals
from palpate.input.preparation.held import find_fresh_samples
from palpate.input.preparation.resolution import deviation_of_mean
from palpate.input.preparation.settings import Preparation
from palpate.input.preparation.velocity import (
    describe_filter,
    estimate_velocities,
    subtract_inertia,
)
from palpate.input.recordings import Recording
from palpate.input.recordings.units import UNITS, unit_size
from palpate.method.contact import Contact, add_step
from palpate.stages import stage
from palpate.validation import Floats
from palpate.validation import signals as checked_signals

if TYPE_CHECKING:
    from palpate.input.preparation.normal import Normal
    from palpate.input.preparation.places import Place
    from palpate.input.preparation.surface import Surface
    from palpate.input.preparation.tare import Baseline
    from palpate.input.wrench.payload import Payload

_LOGGER = logging.getLogger(__name__)
# m. The estimator's own search finds a surface nearer than this to zero without help.
SEARCHED = 2e-3


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """How a contact was made from a recording.

    Attributes
    ----------
    recording : Recording
        The channels as they were recorded.
    settings : Preparation
        The requested settings.
    zero : numpy.ndarray, optional
        The subtracted mean force offset, N: one number, or three in the axes of the sensor.
    drift : float
        Change of the force offset over the recording, N.
    normal : Normal, optional
        Contact normal of the whole recording, if the probe moves in space.
    surface : Surface, optional
        The surface found, in the penetration of the recording or along the normal.
    payload : Payload, optional
        Tool, mount, bias and clock of a sensor that turns with the tool.
    places : tuple of Place
        For a travelling probe, the place of each segment of the contact.
    way : callable, optional
        The function that makes the contact from the recording and the settings.
    """

    recording: Recording
    settings: Preparation
    zero: Floats | None = None
    drift: float = 0.0
    normal: "Normal | None" = None
    surface: "Surface | None" = None
    payload: "Payload | None" = None
    places: "tuple[Place, ...]" = ()
    way: Callable[[Recording, Preparation], Contact] | None = field(default=None, repr=False)

    def again(self) -> Contact:
        """Make the contact again, bit for bit the same.

        Raises
        ------
        RecordingError
            The contact was made from arrays, not from a recording.
        """
        if self.way is None:
            raise RecordingError("this contact was made from arrays and has no recording")
        return self.way(self.recording, self.settings)


def contact_from_penetration(
    recording: Recording, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact from a penetration and a compression."""
    channels: dict[str, ArrayLike] = {
        "time": signals.time,
        "penetration": signals.depth,
        "force": signals.force,
        "segment": signals.part,
    }
    if signals.velocity is not None:
        channels["velocity"] = signals.velocity
    return _prepare_channels(recording, channels, dict(signals.made), settings)


def contact_from_arrays(arrays: Mapping[str, ArrayLike], settings: Preparation) -> Contact:
    """Make a contact from arrays.

    Raises
    ------
    InvalidParameterError
        An array is missing or has another type or length, or time does not increase in a segment.
    """
    arrays = _add_time(arrays, settings)
    missing = [name for name in ("time", "penetration", "force") if name not in arrays]
    if missing:
        rate = ", or the sample rate as rate" if missing[0] == "time" else ""
        problem = f"{missing[0]} is missing: pass it as an array{rate}"
        raise InvalidParameterError(f"{problem}, or pass a recording instead of arrays")
    made = dict[str, str]()
    channels = dict(arrays)
    for channel, unit in settings.units.items():
        if channel in channels and unit != next(iter(UNITS[channel])):
            size = unit_size(channel, unit)
            channels[channel] = np.asarray(channels[channel], dtype=float) * size
            add_step(made, channel, f"in {unit}")
    findings = () if settings.strict else _settle_arrays(channels)
    contact = _prepare_channels(None, channels, made, settings)
    if settings.no_time:
        contact = drop_velocity(contact)
    names = Columns()
    raw = {getattr(names, name): np.asarray(values) for name, values in arrays.items()}
    stated = {*settings.units, *(["time"] if settings.rate else [])}
    return replace(
        contact,
        prepared=replace(contact.prepared, recording=Recording(raw)),
        findings=(*findings, *contact.findings),
        stated_units=frozenset(stated),
    )


def _add_time(arrays: Mapping[str, ArrayLike], settings: Preparation) -> Mapping[str, ArrayLike]:
    """Return the arrays with the time of a rate, or the numbers of the samples."""
    count = np.size(arrays.get("force", ()))
    if settings.no_time:
        if "time" in arrays or "velocity" in arrays:
            raise InvalidParameterError("no_time excludes a time and a velocity: leave them out")
        return {**arrays, "time": np.arange(count, dtype=float)}
    if settings.rate is None:
        return arrays
    if "time" in arrays:
        raise InvalidParameterError("pass time or rate, not both: time is measured, rate even")
    return {**arrays, "time": np.arange(count) / settings.rate}


def drop_velocity(contact: Contact) -> Contact:
    """Return the contact of a curve without time: at rest everywhere, so that no damping fits."""
    steps = {name: step for name, step in contact.provenance.items() if name != "velocity"}
    rest = np.zeros_like(contact.velocity)
    return replace(contact, velocity=rest, velocity_filter=None, provenance=steps, timeless=True)


def _settle_arrays(channels: dict[str, ArrayLike]) -> tuple[Finding, ...]:
    """Drop rows that were written twice and spread a coarse clock, in place.

    Arrays of the wrong type or length stay as they are: the contact refuses them.
    """
    arrays = {name: np.asarray(values) for name, values in channels.items()}
    time = arrays["time"]
    if time.ndim != 1 or time.dtype.kind not in "iuf":
        return ()
    for name, array in arrays.items():
        if array.shape != time.shape or np.ma.is_masked(channels[name]):
            return ()
    others = [array for name, array in arrays.items() if name != "time"]
    stamps, keep, findings = settle_stamps(time, others)
    if findings:
        arrays["time"] = stamps
        channels |= {name: array[keep] for name, array in arrays.items()}
    return tuple(findings)


def _prepare_channels(
    recording: Recording | None,
    channels: dict[str, ArrayLike],
    made: dict[str, str],
    settings: Preparation,
) -> Contact:
    _correct(channels, made, settings)
    time, penetration, force = checked_signals(
        time=channels["time"], penetration=channels["penetration"], force=channels["force"]
    )
    penetration = measurable(penetration)
    force = measurable(force)
    contact = Contact(
        time,
        penetration=penetration,
        velocity=channels.get("velocity", np.zeros_like(time)),
        force=force,
        segment=channels.get("segment"),
        provenance=made,
        source="" if recording is None else recording.source,
    )
    delay = settings.delay
    held = None if settings.no_time else find_fresh_samples(time, penetration, force, force)
    if held is not None:
        contact = contact.taken(held.before)
        contact = replace(contact, force=held.taken(force), findings=(held.finding,))
        delay = delay or held.late
    if "velocity" not in channels:
        contact = _add_velocity(contact, settings.velocity_window)
    if held is not None:
        contact = contact.taken(held.after)
    prepared = Prepared(recording or Recording({}), settings)
    contact, prepared = _subtract_offset(contact, prepared)
    contact, prepared = _move_to_surface(contact, prepared)
    if delay:
        from palpate.input.preparation.delay import remove_delay

        contact = remove_delay(contact, delay)
    contact = subtract_inertia(contact, settings.mass)
    contact = replace(contact, prepared=prepared)
    low, high = settings.window or (None, None)
    return contact if low is None and high is None else contact.window(low, high)


def _add_velocity(contact: Contact, window: float | None) -> Contact:
    """Return the contact with the velocity of its penetration, by a filter."""
    with stage(_LOGGER, "velocity by the filter"):
        velocity, velocity_filter, dropouts = estimate_velocities(
            contact.time, contact.penetration, list(contact.segments()), window
        )
    steps = {**contact.provenance, "velocity": describe_filter(velocity_filter, dropouts)}
    return replace(contact, velocity=velocity, velocity_filter=velocity_filter, provenance=steps)


def _correct(channels: dict[str, ArrayLike], made: dict[str, str], settings: Preparation) -> None:
    """Reverse signs and subtract a given surface position, in place."""
    for flipped in settings.flip:
        for channel in (flipped, "velocity") if flipped == "penetration" else (flipped,):
            if channel in channels:
                channels[channel] = -np.asarray(channels[channel], dtype=float)
                add_step(made, channel, "sign reversed")
    surface = settings.surface
    if surface and not isinstance(surface, str):
        channels["penetration"] = np.asarray(channels["penetration"], dtype=float) - surface
        add_step(made, "penetration", f"relative to {surface:g} m")


def _subtract_offset(contact: Contact, prepared: Prepared) -> tuple[Contact, Prepared]:
    """Subtract the force offset: its mean between two times or in detected free air."""
    tare = prepared.settings.tare
    if tare is None:
        return contact, prepared
    from palpate.input.preparation.tare import find_baseline

    with stage(_LOGGER, "free air"):
        height = -contact.penetration
        baseline = find_baseline(contact.time, height, contact.force, tare, contact.source)
    force = contact.force - baseline.zero
    deviation = deviation_of_mean(force, baseline.free)
    contact = _report(replace(contact, force=force, tare_deviation=deviation), baseline)
    return contact, replace(prepared, zero=baseline.mean, drift=baseline.drift)


def _move_to_surface(contact: Contact, prepared: Prepared) -> tuple[Contact, Prepared]:
    """Subtract the position of the surface, if a rule finds it."""
    rule = prepared.settings.surface
    if not isinstance(rule, str):
        return contact, prepared
    from palpate.input.preparation.surface import find_surface

    with stage(_LOGGER, "surface"):
        surface = find_surface(contact.penetration, contact.velocity, contact.force, rule)
    by_estimator = rule == "estimate"
    if by_estimator and (surface.assumed or abs(surface.position) <= SEARCHED):
        return contact, prepared  # the estimator finds the surface itself
    depth = contact.penetration - surface.position
    deviation = None if by_estimator else surface.deviation or None
    contact = replace(contact, penetration=depth, surface_deviation=deviation)
    return _report(contact, surface), replace(prepared, surface=surface)


def _report(contact: Contact, step: "Baseline | Surface") -> Contact:
    """Return the contact with the description and the findings of a step."""
    made = dict(contact.provenance)
    findings = list(contact.findings)
    step.report(made, findings)
    return replace(contact, provenance=made, findings=tuple(findings))
