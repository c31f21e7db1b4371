"""Making a contact from a recording, a data frame or arrays."""

import inspect
import logging
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, replace
from operator import attrgetter
from typing import Any, ParamSpec, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from palpate.errors import InvalidParameterError, NoContactError
from palpate.findings import Check, Finding
from palpate.input.channels.roles import Columns, Roles, choose_roles, contact_groups
from palpate.input.channels.signals import Signals, build_signals
from palpate.input.preparation.from_penetration import (
    contact_from_arrays,
    contact_from_penetration,
    drop_velocity,
)
from palpate.input.preparation.options import Options
from palpate.input.preparation.settings import Preparation
from palpate.input.recordings import Recording, open_recording
from palpate.input.recordings.opening import within
from palpate.input.recordings.units import is_wanted
from palpate.method.contact import Contact, VelocityFilter
from palpate.stages import stage
from palpate.validation import Integers, Values, frozen

_LOGGER = logging.getLogger(__name__)


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
    | Values
)


@frozen(kw_only=True)
class PrepareArguments(Options):
    """The arguments of :func:`prepare`: a recording or arrays, and how to prepare them.

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
    source : str, optional
        Name of the origin. Default: the source of the recording.
    provenance : mapping, optional
        Notes on how the arrays were obtained; notes of palpate under the same key replace them.
    units : mapping, optional
        Units of channels, such as ``{"penetration": "mm", "force": "mN"}``. Default: from the
        recording, else from the names of the channels, else SI.
    """

    recording: "Recorded | None" = field(default=None, kw_only=False)
    companion: "Recorded | None" = None
    columns: Columns | None = None
    time: "ArrayLike | None" = None
    penetration: "ArrayLike | None" = None
    force: "ArrayLike | None" = None
    velocity: "ArrayLike | None" = None
    segment: "ArrayLike | None" = None
    position: "ArrayLike | None" = None
    source: str | None = None
    provenance: "Mapping[str, str] | None" = None
    units: "Mapping[str, str] | None" = None

    @property
    def arrays(self) -> dict[str, ArrayLike]:
        """The arrays that were passed."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        return {name: array for name, array in arrays.items() if array is not None}

    @property
    def settings(self) -> Preparation:
        """How to prepare them; None stands for a default."""
        options = {option.name: getattr(self, option.name) for option in fields(Preparation)}
        return Preparation(**{k: value for k, value in options.items() if value is not None})


_ARRAYS = ("time", "penetration", "force", "velocity", "segment", "position")
_Parameters = ParamSpec("_Parameters")


def _with_parameters_of(
    holder: Callable[_Parameters, PrepareArguments],
) -> Callable[[Callable[..., Contact]], Callable[_Parameters, Contact]]:
    """Give a function the parameters of a class, for type checkers, ``help`` and ``inspect``."""

    def declare(function: Callable[..., Contact]) -> Callable[_Parameters, Contact]:
        parameters = inspect.signature(holder).parameters.values()
        ordered = sorted(
            parameters, key=lambda parameter: parameter.name in Options.__annotations__
        )
        described: Any = function
        described.__signature__ = inspect.Signature(ordered, return_annotation=Contact)
        texts = [
            (kind.__doc__ or "").partition("-\n")[2].rstrip()
            for kind in (PrepareArguments, Options)
        ]
        described.__doc__ = (function.__doc__ or "").replace("    {parameters}", "\n".join(texts))
        return described  # type: ignore[no-any-return]

    return declare


@_with_parameters_of(PrepareArguments)
def prepare(*values: Any, **options: Any) -> Contact:
    """Make a contact from a recording, a file, a pandas or polars data frame, or arrays.

    palpate uses a penetration as recorded. For a position it subtracts the force offset measured in
    free air, projects position and force on the contact normal, and finds the surface; it cuts the
    recording of a travelling probe into one segment per place. If there is no velocity, it computes
    one per segment by :func:`palpate.input.preparation.velocity.velocity_of`. ``provenance``,
    ``findings`` and ``prepared`` of the contact describe the steps, problems and assumptions.

    Parameters
    ----------
    {parameters}

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

    Examples
    --------
    >>> import palpate
    >>> contact = palpate.prepare("examples/recordings/ball.csv", window=(2.5, None))
    >>> contact
    <Contact 'ball.csv': 4500 samples from 2.5 s to 6.999 s>
    >>> round(float(contact.penetration.max()), 4)  # m
    0.0125
    """
    call = PrepareArguments(*values, **options)
    recording = call.recording
    settings = call.settings
    arrays = call.arrays
    if call.companion is not None:  # two files become one recording
        if recording is None or arrays or call.no_time:
            raise InvalidParameterError("a companion excludes arrays and no_time: leave them out")
        from palpate.input.preparation.clock_offset import align

        first = as_recording(recording, strict=call.strict)
        second = as_recording(call.companion, strict=call.strict)
        recording, settings = align(first, second, settings, prepare_contact)
    if recording is not None and arrays:
        name = next(iter(arrays))
        problem = f"pass a recording or arrays, not both: name the channel {name} in columns"
        raise InvalidParameterError(problem)
    if recording is not None:
        contact = prepare_contact(as_recording(recording, strict=call.strict), settings)
    elif call.position is not None:
        settings = replace(settings, columns=Columns(force="force", position="position"))
        contact = prepare_contact(_recording_of_arrays(arrays, settings), settings)
    else:
        contact = contact_from_arrays(arrays, settings)
    if call.source is None and call.provenance is None:
        return contact
    return replace(
        contact,
        source=contact.source if call.source is None else call.source,
        provenance={**(call.provenance or {}), **contact.provenance},
    )


PrepareArguments.__init__.__qualname__ = "prepare"  # the name in Python's errors


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
        return _prepare_episodes(recording, settings)
    if groups := contact_groups(recording, settings.columns):
        return _prepare_groups(recording, groups, settings)
    return _prepare_one(recording, settings)


def _prepare_one(recorded: Recording, settings: Preparation) -> Contact:
    """Make a contact from a recording of one contact."""
    roles = choose_roles(recorded, settings.columns)
    recording = roles.recording
    _log_roles(roles)
    _require_pose(roles, settings)
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
        if recording.episode is not None:
            _require_touch(recording, signals)
        pressing = roles.is_penetration and signals.force.ndim == 1
        with stage(_LOGGER, f"prepared {'the penetration' if pressing else 'a position'}"):
            if pressing:
                contact = contact_from_penetration(recording, signals, settings)
            else:
                from palpate.input.preparation.from_position import PositionRoute

                contact = PositionRoute(recording, roles, settings, signals).prepare()
        if settings.no_time:
            contact = drop_velocity(contact)
    for channel, steps in contact.provenance.items():
        _LOGGER.info("%s: %s", channel, steps)
    velocity_filter = contact.velocity_filter
    if velocity_filter is None and roles.velocity == Columns().velocity:
        velocity_filter = VelocityFilter.from_notes(recording.notes)  # palpate may have written it
    findings = [
        finding
        for finding in recording.findings
        if finding.severity != "note" or finding.check == Check.CLOCK_OFFSET
    ]
    findings += roles.findings
    findings += _report_commanded_channels(roles)
    findings += _report_unused_settings(settings, roles, pressing=pressing)
    return replace(
        contact,
        source=recording.source,
        prepared=replace(contact.prepared, recording=recorded, way=prepare_contact),
        provenance=_join_notes(recording.notes, contact.provenance),
        velocity_filter=velocity_filter,
        stated_units=signals.stated_units,
        assumed_units=signals.assumed_units,
        findings=(*findings, *signals.findings, *contact.findings),
    )


def _join_notes(notes: Mapping[str, str], steps: Mapping[str, str]) -> dict[str, str]:
    """Return the notes of a recording, and how each channel was obtained."""
    renamed = {f"note on {key}" if key in steps else key: note for key, note in notes.items()}
    return {**renamed, **steps}


def _require_pose(roles: Roles, settings: Preparation) -> None:
    """Raise for an option that needs a pose and a force in space, of a recording without them."""
    if len(roles.force) == len(roles.depth) == 3 and roles.orientation:
        return
    for option, value in (("--payload", settings.payload), ("--tip-offset", settings.tip_offset)):
        if value is not None:
            from palpate.input.preparation.force_frame import no_pose

            raise no_pose(roles.recording.source, option)


def _require_touch(recording: Recording, signals: Signals) -> None:
    from palpate.input.preparation.touch import never_touches

    if never_touches(signals.force, signals.depth):
        problem = "no contact found: the force is constant within its noise"
        raise NoContactError.of(recording.source, problem)


def _prepare_groups(recording: Recording, groups: Sequence[str], settings: Preparation) -> Contact:
    """Make a contact of each group of a file, with one object."""
    contacts = list[Contact]()
    for group in groups:
        names = {name for name in recording.channels if within(name, group)}
        names |= {recording.clocks[name] for name in names if name in recording.clocks}
        source = f"{recording.source}:{group}" if recording.source else group
        channels = {name: recording.channels[name] for name in names}
        of_group = replace(recording, channels=channels, source=source, findings=())
        contacts.append(prepare_contact(of_group, settings))
    listed = ", ".join(groups[:6])
    problem = f"palpate takes {len(groups)} groups for contacts with one object: {listed}"
    remedy = f"if they are several objects, choose one: --position {groups[0]} --force {groups[0]}"
    return _report_joined(recording, contacts, problem, remedy)


def _prepare_episodes(recording: Recording, settings: Preparation) -> Contact:
    """Make a contact of each episode of a data set that touches, with one object."""
    contacts = list[Contact]()
    free = list[str]()
    for episode in recording.episodes:
        try:
            contacts.append(prepare_contact(episode, settings))
        except NoContactError:
            free.append(str(episode.episode))
    count = len(recording.episodes)
    if not contacts:
        raise NoContactError(f"{recording.source}: none of {count} episodes touches anything")
    problem = f"palpate takes {len(contacts)} of {count} episodes for contacts with one object"
    if free:
        more = ", …" if len(free) > 12 else ""
        problem += f"; no contact in {', '.join(free[:12])}{more}"
    remedy = "if they are several objects, choose one with --episode, or use palpate fleet"
    return _report_joined(replace(recording, findings=()), contacts, problem, remedy)


def _report_joined(
    recording: Recording, contacts: Sequence[Contact], problem: str, remedy: str
) -> Contact:
    """Join the contacts of a recording, and report that they are taken for one object."""
    contact = join_contacts(contacts)
    report = Check.CHANNELS.finding(problem, remedy)
    findings = (*recording.findings, report, *contact.findings)
    return replace(contact, source=recording.source, findings=findings)


def _log_roles(roles: Roles) -> None:
    """Log which channels have which role."""
    times = () if roles.time is None else (roles.time,)
    for role, names in {"time": times, **roles.by_role}.items():
        if role == "depth":
            role = "penetration" if roles.is_penetration else "position"
        if names:
            reason = roles.reasons.get(role)
            listed = ", ".join(names)
            _LOGGER.info("%s is %s", role, f"{listed} ({reason})" if reason else listed)


def _report_commanded_channels(roles: Roles) -> list[Finding]:
    """Warn of a commanded position or force: the robot may not have followed it."""
    findings = list[Finding]()
    for kind, names in (("position", roles.depth), ("force", roles.force)):
        if is_wanted(names[0]):
            problem = f"channel {names[0]!r} looks like a commanded {kind}, not a measured one"
            if kind == "position":
                problem += ": the robot's own compliance is in the numbers"
            findings.append(
                Check.CHANNELS.finding(
                    problem,
                    f"record the measured {kind} and name its channel with --{kind}",
                    mark="with-care",
                )
            )
    return findings


def _report_unused_settings(
    settings: Preparation, roles: Roles, *, pressing: bool
) -> list[Finding]:
    """Report the settings that had no effect."""
    axes = {len(roles.depth), len(roles.force)}
    flat = pressing or 1 in axes
    unused = {
        "--normal": settings.normal is not None and (pressing or axes == {1}),
        "--force-frame": settings.force_frame is not None and flat,
        "--tool-weight": settings.tool_weight is not None and flat,
    }
    names = " and ".join(name for name, idle in unused.items() if idle)
    if not names:
        return []
    return [
        Check.OPTIONS.finding(
            f"{names} had no effect: position and force do not both have three axes",
            f"drop {names}",
        )
    ]


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
    from palpate.input.recordings.tables_in_memory import recording_of_table

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
    start = contacts[0]
    if len(contacts) == 1:
        return start
    labels = list[Integers]()
    number = 0
    for contact in contacts:
        labels.append(contact.segment + number)
        number = int(labels[-1].max(initial=number)) + 1
    names = ("time", "penetration", "velocity", "force")
    channels: dict[str, Any] = {
        name: np.concatenate([getattr(c, name) for c in contacts]) for name in names
    }
    provenance = {
        f"{name} of {contact.source}": steps
        for contact in contacts
        for name, steps in contact.provenance.items()
    }
    findings = [
        replace(finding, message=f"{contact.source}: {finding.message}")
        for contact in contacts
        for finding in contact.findings
    ]
    # If palpate computed the velocity of only some contacts, their filter counts for all.
    filters = [c.velocity_filter for c in contacts if c.velocity_filter is not None]
    delays = [contact.delay for contact in contacts if contact.delay is not None]
    return replace(
        start,
        **channels,
        segment=np.concatenate(labels),
        source=", ".join(contact.source for contact in contacts),
        provenance={**start.provenance, **provenance},
        tare_deviation=_widest([contact.tare_deviation for contact in contacts]),
        surface_deviation=_widest([contact.surface_deviation for contact in contacts]),
        delay=max(delays, key=attrgetter("standard_error"), default=None),
        findings=tuple(findings),
        prepared=None,
        velocity_filter=max(filters, key=attrgetter("degree", "samples"), default=None),
        stated_units=frozenset.intersection(*(contact.stated_units for contact in contacts)),
        assumed_units=frozenset.union(*(contact.assumed_units for contact in contacts)),
        timeless=any(contact.timeless for contact in contacts),
    )


def _widest(deviations: Sequence[float | None]) -> float | None:
    """The largest deviation; None if one is unknown."""
    known = [deviation for deviation in deviations if deviation is not None]
    return max(known) if len(known) == len(deviations) else None
