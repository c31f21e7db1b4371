"""Making a contact from a recording, a data frame or arrays."""

import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from operator import attrgetter
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.channels.roles import Columns, Roles, choose_roles, contact_groups
from palpate.channels.signals import build_signals
from palpate.contact import Contact, VelocityFilter
from palpate.errors import InvalidParameterError, NoContactError
from palpate.findings import Check, Finding
from palpate.preparation.along_penetration import (
    along_penetration,
    contact_of_arrays,
    drop_velocity,
)
from palpate.preparation.payload import Payload
from palpate.preparation.settings import ForceFrame, Preparation, never_touches
from palpate.preparation.spatial import along_normal, no_pose
from palpate.preparation.surfaces import RADIUS, SurfaceRule
from palpate.recordings import Recording, open_recording
from palpate.recordings.names import is_wanted
from palpate.recordings.opening import within
from palpate.recordings.tables_in_memory import recording_of_table
from palpate.stages import stage
from palpate.validation import arguments

_LOGGER = logging.getLogger(__name__)


_ARRAYS = ("time", "penetration", "force", "velocity", "segment", "position")


class Frame(Protocol):
    """The interface of a data frame that palpate needs; pandas and polars provide it."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """Return a column."""


#: How to pass arrays.
BY_NAME = "pass arrays by their names: palpate.identify(time=t, penetration=x, force=F)"
#: Sources of a contact: a recording, a file, or a table: a data frame, a dict of columns, rows, a
#: structured array, an Arrow table or an xarray data set.
Recorded: TypeAlias = (
    Recording
    | str
    | os.PathLike[str]
    | Frame
    | Mapping[str, Any]
    | Sequence[Mapping[str, Any]]
    | NDArray[Any]
)


def prepare(
    recording: "Recorded | None" = None,
    *,
    companion: "Recorded | None" = None,
    columns: Columns | None = None,
    time: "ArrayLike | None" = None,
    penetration: "ArrayLike | None" = None,
    force: "ArrayLike | None" = None,
    velocity: "ArrayLike | None" = None,
    segment: "ArrayLike | None" = None,
    position: "ArrayLike | None" = None,
    velocity_window: float | None = None,
    source: str | None = None,
    provenance: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    flip: Sequence[str] = (),
    tare: tuple[float, float] | Literal["find"] | None = None,
    delay: float | tuple[float, float] | Literal["find"] = 0.0,
    surface: float | SurfaceRule | None = None,
    normal: str | Sequence[float] | None = None,
    force_frame: ForceFrame | None = None,
    tool_weight: float | None = None,
    payload: Payload | None = None,
    tip_offset: Sequence[float] | None = None,
    mass: float | None = None,
    rate: float | None = None,
    no_time: bool = False,
    spot: float = RADIUS,
    window: tuple[float | None, float | None] | None = None,
    strict: bool = False,
) -> Contact:
    """Make a contact from a recording, a file, a pandas or polars data frame, or arrays.

    palpate uses a penetration as recorded. For a position it subtracts the force offset measured in
    free air, projects position and force on the contact normal, and finds the surface; it cuts the
    recording of a travelling probe into one segment per place. If there is no velocity, it computes
    one per segment by :func:`palpate.preparation.velocity.velocity_of`. ``provenance``,
    ``findings`` and ``prepared`` of the contact describe the steps, problems and assumptions.

    Parameters
    ----------
    recording : Recording, path or data frame, optional
        The recording. Default: made from the arrays.
    companion : Recording, path or data frame, optional
        A second recording of the same contact by another recorder: one gives the position, the
        other the force. palpate finds the offset of their clocks and moves the force to the
        position's clock; a ``delay`` is the whole offset, which is then not searched.
    columns : Columns, optional
        Names of the recording's channels. Default: auto-detect.
    time, penetration, force : array_like, shape (k,), optional
        s, m (positive inside the material) and N (compression positive), instead of a recording.
    velocity : array_like, shape (k,), optional
        m/s, positive while penetrating, in addition to these arrays.
    segment : array_like, shape (k,), optional
        One label per sample, in addition to these arrays; a new label starts a new contact.
    position : array_like, shape (k,) or (k, 3), optional
        m, the position of the probe along one axis or in space, in place of a penetration; then
        ``force`` may have the same shape.
    velocity_window : float, optional
        Length of the velocity filter, s, if there is no velocity. Default: 15 samples, at most 15
        ms, at least 5 samples.
    source : str, optional
        Name of the origin. Default: the source of the recording.
    provenance : mapping, optional
        Notes on how the arrays were obtained; notes of palpate under the same key replace them.
    units : mapping, optional
        Units of channels, such as ``{"penetration": "mm", "force": "mN"}``. Default: from the
        recording, else from the names of the channels, else SI.
    flip : sequence of str
        Channels whose sign is reversed: ``"force"``, ``"penetration"``, or both.
    tare : tuple of float or "find", optional
        (start, stop), s: an interval without contact, whose mean force is subtracted. ``"find"``:
        detect free air, and subtract its mean force and a significant drift. Default: None for a
        penetration; for a position as ``"find"``, if there is free air.
    delay : float, tuple of float or "find"
        Delay of the force, s, negative if it is early; the force is shifted earlier by it. With its
        standard error: (delay, error); default: half a sample. ``"find"``: the shift by which a
        Hunt–Crossley law fits best (:func:`palpate.preparation.delay.find_delay`). The damping's
        error bar includes the error of the delay.
    surface : float or str, optional
        Position of the surface, m, in the corrected penetration; or how
        :func:`palpate.preparation.surfaces.find_surface` finds it: ``"threshold"``, ``"baseline"``
        or ``"fit"``; or ``"estimate"``: the estimator finds it, from a first value by ``"fit"`` if
        zero is far from it. Default: 0 for a penetration, ``"fit"`` for a position.
    normal : str or sequence of float, optional
        Direction out of the material, in the frame of the position: ``"z"``, ``"-z"`` or three
        numbers. Default: the mean direction of the force, weighted by magnitude.
    force_frame : "tool" or "base", optional
        Frame of the force: palpate rotates a force in the tool's frame by the orientation. Default:
        from the recording, else the frame of the position.
    tool_weight : float, optional
        Weight of the tool to subtract, N, along −z of the position's frame. With an orientation
        palpate finds the weight itself, and fails if the log contradicts this one.
    payload : Payload, optional
        Tool and mount of the sensor, as found from another log; palpate then finds only the bias
        and the clock.
    tip_offset : sequence of float, optional
        From the origin of the pose, such as a flange, to the tip, in the axes of the pose, m.
        Default: the pose is that of the tip, or the tool does not turn in contact.
    mass : float, optional
        Mass between force sensor and material, kg; its inertia is subtracted from the force.
    rate : float, optional
        Sample rate, Hz, of a recording or arrays without time.
    no_time : bool
        Identify the stiffness alone, of a curve without time or of one whose time is ignored:
        ``time`` counts the samples, as does ``window``. Default: False.
    spot : float
        Farthest travel of the probe across the normal within one place, m; ``math.inf`` never cuts.
    window : tuple of float, optional
        (start, stop), s: use only these samples. Either may be None.
    strict : bool
        Fail on values that are not numbers and on times that do not increase. Default: exclude
        these samples and report them in ``findings``.

    Returns
    -------
    Contact
        Its ``provenance`` has the notes of the recording and how each channel was obtained.

    Raises
    ------
    RecordingError
        The recording cannot be read, lacks a channel, holds something other than numbers, has no
        samples, or its time runs backward.
    MissingChannelError
        The recording has no channel of a requested name, or none that could have the role.
    InvalidParameterError
        Arrays are missing or differ in type or length, their time does not increase within a
        segment, or a setting is outside its range.
    """
    options = {name: value for name, value in arguments(locals()).items() if value is not None}
    own = {each.name for each in fields(Preparation)}
    settings = Preparation(**{name: value for name, value in options.items() if name in own})
    given = {name: options[name] for name in _ARRAYS if name in options}
    if companion is not None:  # two files become one recording
        if recording is None or given or no_time:
            raise InvalidParameterError("a companion excludes arrays and no_time: leave them out")
        from palpate.preparation.clock_offset import align

        first = as_recording(recording, strict=strict)
        second = as_recording(companion, strict=strict)
        recording, settings = align(first, second, settings, prepare_contact)
    if recording is None and position is not None:
        settings = replace(settings, columns=Columns(force="force", position="position"))
        contact = prepare_contact(_recording_of_arrays(given, settings), settings)
    elif recording is None:
        contact = contact_of_arrays(given, settings)
    elif given:
        raise InvalidParameterError(
            f"pass a recording or arrays, not both: name the channel {next(iter(given))} in columns"
        )
    else:
        contact = prepare_contact(as_recording(recording, strict=strict), settings)
    if source is None and provenance is None:
        return contact
    return replace(
        contact,
        source=contact.source if source is None else source,
        provenance={**(provenance or {}), **contact.provenance},
    )


def _recording_of_arrays(given: Mapping[str, ArrayLike], settings: Preparation) -> Recording:
    """Return a recording of a position and a force, along one axis or in space."""
    clocks = [settings.rate is not None, settings.no_time, "time" in given]
    excluded = not given.keys().isdisjoint(("penetration", "velocity"))
    if excluded or "force" not in given or sum(clocks) != 1:
        raise InvalidParameterError(
            "a position needs a force and one of time, rate and no_time, and excludes a "
            "penetration and a velocity"
        )
    arrays = {name: np.asanyarray(values) for name, values in given.items()}
    shapes = {array.shape[1:] for array in arrays.values()}
    if not shapes <= {(), (3,)} or len({array.shape[:1] for array in arrays.values()}) != 1:
        raise InvalidParameterError(
            "time, position and force must have one row for each sample, with one number or three"
        )
    channels = {name: array for name, array in arrays.items() if array.ndim == 1}
    for name in arrays.keys() - channels.keys():
        channels |= {f"{name}[{k}]": arrays[name][:, k] for k in range(3)}
    return Recording(channels)


def prepare_contact(recording: Recording, settings: Preparation) -> Contact:
    """Make a contact from a recording with the settings of :func:`prepare`.

    Raises
    ------
    RecordingError, MissingChannelError
        As :func:`prepare`.
    """
    if recording.episodes:
        return _contacts_of_episodes(recording, settings)
    if groups := contact_groups(recording, settings.columns):
        return _contacts_of_groups(recording, groups, settings)
    recorded, roles = recording, choose_roles(recording, settings.columns)
    recording = roles.recording
    _log_roles(roles)
    in_space = len(roles.force) == len(roles.depth) == 3 and roles.orientation
    for option, value in (("--payload", settings.payload), ("--tip-offset", settings.tip_offset)):
        if value is not None and not in_space:
            raise no_pose(recording.source, option)
    with np.errstate(all="ignore"):  # a flipped bit gives 1e300 N, which the gate excludes
        with stage(_LOGGER, "one clock, units and bad rows"):
            signals = build_signals(
                recording,
                roles,
                settings.units,
                rate=1.0 if settings.no_time else settings.rate,
                strict=settings.strict,
                no_time=settings.no_time,
            )
        if recording.episode is not None and never_touches(signals.force, signals.depth):
            words = "no contact found: the force is constant within its noise"
            raise NoContactError.of(recording.source, words)
        pressing = roles.is_penetration and signals.force.ndim == 1
        way = along_penetration if pressing else along_normal
        with stage(_LOGGER, f"prepared {'the penetration' if pressing else 'a position'}"):
            contact = way(recording, roles, signals, settings)
        if settings.no_time:
            contact = drop_velocity(contact)
    done = contact.provenance
    for channel, words in done.items():
        _LOGGER.info("%s: %s", channel, words)
    used = contact.velocity_filter
    if used is None and roles.velocity == Columns().velocity:  # palpate may have written it
        used = VelocityFilter.from_notes(recording.notes)
    notes = {f"note on {key}" if key in done else key: v for key, v in recording.notes.items()}
    return replace(
        contact,
        source=recording.source,
        prepared=replace(contact.prepared, recording=recorded, way=prepare_contact),
        provenance={**notes, **done},
        velocity_filter=used,
        stated_units=signals.stated_units,
        assumed_units=signals.assumed_units,
        findings=(
            *(
                each
                for each in recording.findings
                if each.severity != "note" or each.check == Check.CLOCK_OFFSET
            ),
            *roles.findings,
            *_report_commanded_channels(roles),
            *_report_unused_settings(settings, roles, pressing=pressing),
            *signals.findings,
            *contact.findings,
        ),
    )


def _contacts_of_groups(
    recording: Recording, groups: Sequence[str], settings: Preparation
) -> Contact:
    """Make a contact of each group of a file, with one object."""
    contacts = []
    for group in groups:
        names = [name for name in recording.channels if within(name, group)]
        clocks = {clock for name in names if (clock := recording.clocks.get(name)) is not None}
        source = f"{recording.source}:{group}" if recording.source else group
        channels = {name: recording.channels[name] for name in {*names, *clocks}}
        part = replace(recording, channels=channels, source=source, findings=())
        contacts.append(prepare_contact(part, settings))
    listed = ", ".join(groups[:6])
    words = f"palpate takes {len(groups)} groups for contacts with one object: {listed}"
    remedy = f"if they are several objects, choose one: --position {groups[0]} --force {groups[0]}"
    contact = join_contacts(contacts)
    findings = (*recording.findings, Check.CHANNELS.finding(words, remedy), *contact.findings)
    return replace(contact, source=recording.source, findings=findings)


def _contacts_of_episodes(recording: Recording, settings: Preparation) -> Contact:
    """Make a contact of each episode of a data set that touches, with one object."""
    contacts, without = [], []
    for episode in recording.episodes:
        try:
            contacts.append(prepare_contact(episode, settings))
        except NoContactError:
            without.append(str(episode.episode))
    count = len(recording.episodes)
    if not contacts:
        raise NoContactError(f"{recording.source}: none of {count} episodes touches anything")
    words = f"palpate takes {len(contacts)} of {count} episodes for contacts with one object"
    if without:
        words += f"; no contact in {', '.join(without[:12])}{', …' * (len(without) > 12)}"
    remedy = "if they are several objects, choose one with --episode, or use palpate fleet"
    contact = join_contacts(contacts)
    findings = (Check.CHANNELS.finding(words, remedy), *contact.findings)
    return replace(contact, source=recording.source, findings=findings)


def _log_roles(roles: Roles) -> None:
    """Log which channels have which role."""
    times = () if roles.time is None else (roles.time,)
    for role, names in {"time": times, **roles.by_role}.items():
        if role == "depth":
            role = "penetration" if roles.is_penetration else "position"
        if names:
            why = roles.reasons.get(role)
            words = f"{', '.join(names)} ({why})" if why else ", ".join(names)
            _LOGGER.info("%s is %s", role, words)


def _report_commanded_channels(roles: Roles) -> list[Finding]:
    """Warn of a commanded position or force: the robot may not have followed it."""
    found = []
    for kind, names in (("position", roles.depth), ("force", roles.force)):
        if is_wanted(names[0]):
            words = f"channel {names[0]!r} looks like a commanded {kind}, not a measured one"
            if kind == "position":
                words += ": the robot's own compliance is in the numbers"
            remedy = f"record the measured {kind} and name its channel with --{kind}"
            found.append(Check.CHANNELS.finding(words, remedy, mark="with-care"))
    return found


def _report_unused_settings(
    settings: Preparation, roles: Roles, *, pressing: bool
) -> list[Finding]:
    """Report the settings that had no effect."""
    flat = pressing or len(roles.depth) == 1 or len(roles.force) == 1
    options = {
        "--normal": (settings.normal, pressing or len(roles.depth) == len(roles.force) == 1),
        "--force-frame": (settings.force_frame, flat),
        "--tool-weight": (settings.tool_weight, flat),
    }
    idle = [name for name, (value, unused) in options.items() if unused and value is not None]
    words = f"{' and '.join(idle)} had no effect: position and force do not both have three axes"
    finding = Check.OPTIONS.finding(words, f"drop {' and '.join(idle)}")
    return [finding] if idle else []


def as_recording(recorded: Recorded, *, strict: bool = False) -> Recording:
    """Return a recording, the contents of a file, or a table as a :class:`Recording`.

    Raises
    ------
    InvalidParameterError
        The argument has another type.
    RecordingError
        The file cannot be read.
    """
    if isinstance(recorded, Recording):
        return recorded
    if isinstance(recorded, str | os.PathLike):
        return open_recording(recorded, strict=strict)
    table = recording_of_table(recorded)
    if table is None:
        allowed = "a Recording, a path, or a table such as a pandas or polars DataFrame or a dict"
        words = f"recording must be {allowed}, not {type(recorded).__name__}; {BY_NAME}"
        raise InvalidParameterError(words)
    return table


# Joining several contacts with one object.


def join_contacts(contacts: Sequence[Contact]) -> Contact:
    """Join several contacts with one object to one contact, in separate segments.

    Parameters
    ----------
    contacts : sequence of Contact
        The contacts in order of identification; each keeps its own clock.

    Raises
    ------
    InvalidParameterError
        The sequence is empty.
    """
    if not contacts:
        raise InvalidParameterError("contacts must hold at least one")
    first = contacts[0]
    if len(contacts) == 1:
        return first
    labels, number = [], 0
    for contact in contacts:
        labels.append(contact.segment + number)
        number = int(labels[-1].max(initial=number)) + 1
    provenance = {
        f"{name} of {contact.source}": words
        for contact in contacts
        for name, words in contact.provenance.items()
    }
    # If palpate computed the velocity of only some contacts, their filter counts for all.
    filters = [each.velocity_filter for each in contacts if each.velocity_filter is not None]
    return replace(
        first,
        **{
            name: np.concatenate([getattr(contact, name) for contact in contacts])
            for name in ("time", "penetration", "velocity", "force")
        },
        segment=np.concatenate(labels),
        source=", ".join(contact.source for contact in contacts),
        provenance={**first.provenance, **provenance},
        tare_deviation=_widest([contact.tare_deviation for contact in contacts]),
        surface_deviation=_widest([contact.surface_deviation for contact in contacts]),
        delay=max(
            (contact.delay for contact in contacts if contact.delay is not None),
            key=attrgetter("standard_error"),
            default=None,
        ),
        moving_mass=first.moving_mass,
        findings=tuple(
            replace(finding, message=f"{contact.source}: {finding.message}")
            for contact in contacts
            for finding in contact.findings
        ),
        prepared=None,
        velocity_filter=max(filters, key=attrgetter("degree", "samples"), default=None),
        stated_units=frozenset.intersection(*(contact.stated_units for contact in contacts)),
        assumed_units=frozenset.union(*(contact.assumed_units for contact in contacts)),
        timeless=any(contact.timeless for contact in contacts),
    )


def _widest(deviations: Sequence[float | None]) -> float | None:
    """The largest deviation; None if one is unknown."""
    known = [each for each in deviations if each is not None]
    return max(known) if len(known) == len(deviations) else None
