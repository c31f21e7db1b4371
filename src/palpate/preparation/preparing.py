"""From a recording, a frame or arrays to a contact."""

import dataclasses
import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.findings import Finding
from palpate.preparation.along_penetration import along_penetration, contact_of_arrays
from palpate.preparation.clocks import signals_of
from palpate.preparation.roles import Columns, Roles, is_wanted, roles_of
from palpate.preparation.settings import ForceFrame, Preparation
from palpate.preparation.spatial import along_normal
from palpate.preparation.surfaces import RADIUS, SurfaceRule
from palpate.recordings import Recording, open_recording
from palpate.stages import stage

_LOGGER = logging.getLogger(__name__)


class Frame(Protocol):
    """What is needed of a table in memory; those of pandas and polars have it."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """Return a column."""


#: What a contact can be prepared from: a recording, a file, or a pandas or polars frame.
Recorded: TypeAlias = Recording | str | os.PathLike[str] | Frame


def prepare(
    recording: "Recorded | None" = None,
    *,
    columns: Columns | None = None,
    time: "ArrayLike | None" = None,
    penetration: "ArrayLike | None" = None,
    force: "ArrayLike | None" = None,
    velocity: "ArrayLike | None" = None,
    segment: "ArrayLike | None" = None,
    velocity_window: float | None = None,
    source: str | None = None,
    provenance: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    flip: Sequence[str] = (),
    tare: tuple[float, float] | Literal["find"] | None = None,
    delay: float = 0.0,
    surface: float | SurfaceRule | None = None,
    normal: str | Sequence[float] | None = None,
    force_frame: ForceFrame | None = None,
    tool_weight: float | None = None,
    rate: float | None = None,
    spot: float = RADIUS,
    window: tuple[float | None, float | None] | None = None,
    strict: bool = False,
) -> Contact:
    """Make a contact of a recording, a file, a pandas or polars frame, or of arrays.

    A recording of a penetration is taken as it is. One of a position has its force tared where the
    probe is seen out of contact, both are projected on the contact normal, and the surface is
    found; a probe that travels is cut into episodes at one place each, which are the segments of
    the contact. ``provenance``, ``findings`` and ``prepared`` have what is done, found and assumed.
    Where there is no velocity it is worked out, a segment at a time, by
    :func:`palpate.preparation.velocity.velocity_of`.

    Parameters
    ----------
    recording : Recording, path or frame, optional
        What was recorded. None: the arrays say it.
    columns : Columns, optional
        Names of the recording's channels; what is not named is looked for.
    time, penetration, force : array_like, shape (k,), optional
        s, m (positive inside the material) and N (compression positive), in place of a recording.
    velocity : array_like, shape (k,), optional
        m/s, positive while penetrating, beside those arrays.
    segment : array_like, shape (k,), optional
        A label a sample beside those arrays; where it changes, another contact begins.
    velocity_window : float, optional
        Length of the velocity filter, s, where there is no velocity; 15 samples but at most 15 ms
        unless given.
    source : str, optional
        Where it came from; the recording's own source unless given.
    provenance : mapping, optional
        How the arrays were made. What is done here is added, and has the last word.
    units : mapping, optional
        Units of channels, such as ``{"penetration": "mm", "force": "mN"}``; unless given they are
        those that the recording or the channels' names say, else SI.
    flip : sequence of str
        Channels whose sign is turned: ``"force"``, ``"penetration"``, or both.
    tare : tuple of float or "find", optional
        (start, stop), s: the mean force between them is taken off; a time without contact. Or
        ``"find"``: such times are found, and a drift between them is taken off too. A recording of
        a position has that done where it can be.
    delay : float
        How late the force is, s; negative where it is early. It is read that much earlier.
    surface : float or str, optional
        Where the material begins: m, in the penetration as corrected; or found, by
        :func:`palpate.preparation.surfaces.surface_of`: ``"threshold"``, ``"baseline"``, ``"fit"``;
        or ``"estimate"``, which begins so where the surface is not near zero, and leaves the rest
        to the estimator. Unless given, 0 of a penetration, and ``"fit"`` of a position.
    normal : str or sequence of float, optional
        Out of the material, in the position's frame: ``"z"``, ``"-z"`` or three numbers; unless
        given, the force-weighted mean direction of the force.
    force_frame : "tool" or "base", optional
        A force in the tool's frame is turned by the orientation; unless given, as the recording's
        frames say, else the force is taken to be in the position's frame.
    tool_weight : float, optional
        N, along −z of the position's frame; taken off.
    rate : float, optional
        Samples a second, where the recording has no time.
    spot : float
        How far the probe may go across the normal within an episode, m; ``math.inf`` for none.
    window : tuple of float, optional
        (start, stop), s, either of them None: only these samples.
    strict : bool
        Refuse values that are no number and times that do not increase; else the samples are left
        out, and ``findings`` say so.

    Returns
    -------
    Contact
        Its ``provenance`` holds the recording's notes and says how each channel was made.

    Raises
    ------
    RecordingError
        The recording cannot be read, lacks a channel, holds something other than numbers, has no
        sample, or its time runs backward.
    MissingChannelError
        The recording has no channel of a name that was asked for, or none that could be it.
    InvalidParameterError
        Arrays are missing, of another type or of different lengths, or their time does not increase
        within a segment; or a setting is outside its range.
    """
    asked = {name: value for name, value in locals().items() if name in Preparation.__slots__}
    settings = Preparation(**{**asked, "columns": columns or Columns(), "units": units or {}})
    arrays = {"time": time, "penetration": penetration, "force": force, "velocity": velocity}
    arrays["segment"] = segment
    given = {name: values for name, values in arrays.items() if values is not None}
    if recording is None:
        contact = contact_of_arrays(given, settings)
    elif given:
        raise InvalidParameterError(
            f"{next(iter(given))} must not be given beside a recording; name its column in columns"
        )
    else:
        contact = prepared_contact(as_recording(recording, strict=strict), settings)
    if source is None and provenance is None:
        return contact
    return dataclasses.replace(
        contact,
        source=contact.source if source is None else source,
        provenance={**(provenance or {}), **contact.provenance},
    )


def prepared_contact(recording: Recording, settings: Preparation) -> Contact:
    """Make a contact of a recording, by settings that :func:`prepare` collects.

    Raises
    ------
    RecordingError, MissingChannelError
        As :func:`prepare`.
    """
    roles = roles_of(recording, settings.columns)
    _log_roles(roles)
    with np.errstate(all="ignore"):  # a flipped bit makes 1e300 N, which is then no contact
        with stage(_LOGGER, "one clock, units and bad rows"):
            signals = signals_of(
                recording, roles, settings.units, rate=settings.rate, strict=settings.strict
            )
        pressing = roles.is_penetration and signals.force.ndim == 1
        way = along_penetration if pressing else along_normal
        with stage(_LOGGER, f"prepared {'the penetration' if pressing else 'a position'}"):
            contact = way(recording, roles, signals, settings)
    done = contact.provenance
    for channel, words in done.items():
        _LOGGER.info("%s: %s", channel, words)
    notes = {f"note on {key}" if key in done else key: v for key, v in recording.notes.items()}
    return dataclasses.replace(
        contact,
        source=recording.source,
        prepared=dataclasses.replace(contact.prepared, way=prepared_contact),
        provenance={**notes, **done},
        findings=(
            *(each for each in recording.findings if each.severity != "note"),
            *_commanded(roles),
            *_unused(settings, roles, pressing=pressing),
            *signals.findings,
            *contact.findings,
        ),
    )


def _log_roles(roles: Roles) -> None:
    """Say which channels were taken for what."""
    times = () if roles.time is None else (roles.time,)
    for role, names in {"time": times, **roles.by_role}.items():
        if role == "depth":
            role = "penetration" if roles.is_penetration else "position"
        if names:
            why = roles.reasons.get(role)
            words = f"{', '.join(names)} ({why})" if why else ", ".join(names)
            _LOGGER.info("%s is %s", role, words)


def _commanded(roles: Roles) -> list[Finding]:
    """Say that a channel is what was wanted: the robot, and the material, may not have done it."""
    found = []
    for kind, names in (("position", roles.depth), ("force", roles.force)):
        if is_wanted(names[0]):
            words = f"the {kind} {names[0]!r} is, by its name, what was commanded, not measured"
            remedy = f"record what the robot did, and name it with --{kind}"
            found.append(Finding.of_both("with-care", "channels", words, remedy))
    return found


def _unused(settings: Preparation, roles: Roles, *, pressing: bool) -> list[Finding]:
    """Say which settings found nothing to act on."""
    flat = pressing or len(roles.depth) == 1 or len(roles.force) == 1
    options = {
        "--normal": (settings.normal, pressing or len(roles.depth) == len(roles.force) == 1),
        "--force-frame": (settings.force_frame, flat),
        "--tool-weight": (settings.tool_weight, flat),
    }
    idle = [name for name, (value, unused) in options.items() if unused and value is not None]
    words = f"{' and '.join(idle)} did nothing: position and force are not both in space"
    finding = Finding("options", words, "leave it out, or name three channels of each")
    return [finding] if idle else []


def as_recording(recorded: Recorded, *, strict: bool = False) -> Recording:
    """Return what was recorded as a :class:`Recording`: a file is opened, a frame taken as it is.

    Raises
    ------
    InvalidParameterError
        It is nothing of the kind.
    RecordingError
        The file cannot be read.
    """
    if isinstance(recorded, Recording):
        return recorded
    if isinstance(recorded, str | os.PathLike):
        return open_recording(recorded, strict=strict)
    try:
        channels = {str(name): _array(recorded[name]) for name in list(recorded.columns)}
    except (AttributeError, TypeError, KeyError, ValueError):
        raise InvalidParameterError(
            "recording must be a Recording, a path, or a pandas or polars DataFrame, not "
            f"{type(recorded).__name__}"
        ) from None
    return Recording(channels)


def _array(column: Any) -> NDArray[Any]:
    values: NDArray[Any] = np.asanyarray(column)
    if values.dtype == object and hasattr(column, "isna"):  # what pandas calls NA is no number
        return np.where(column.isna(), np.nan, values)
    return values


# Several contacts with one object, as one.


def joined(contacts: Sequence[Contact]) -> Contact:
    """Return several contacts with one object as one, in which each is a segment or more.

    Parameters
    ----------
    contacts : sequence of Contact
        In the order in which they are identified; each keeps its own clock.

    Raises
    ------
    InvalidParameterError
        There is none.
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
    # A velocity is worked out in all of them, or in none: its checks ask for one of them.
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
        findings=tuple(
            replace(finding, message=f"{contact.source}: {finding.message}")
            for contact in contacts
            for finding in contact.findings
        ),
        prepared=None,
    )


def _widest(deviations: Sequence[float | None]) -> float | None:
    """The largest; None where one of them is not known."""
    known = [each for each in deviations if each is not None]
    return max(known) if len(known) == len(deviations) else None
