"""From a recording, a frame or arrays to a contact."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.contact import Contact, first_wrong_time
from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.corrections import Corrections
from palpate.preparation.velocity import lost_positions, velocity_of
from palpate.recordings import Recording, open_recording
from palpate.validation import instance, signals

_SI = {"time": "s", "penetration": "m", "velocity": "m/s", "force": "N"}


@dataclasses.dataclass(frozen=True, slots=True)
class Columns:
    """Which column is which; ``velocity`` and ``segment`` may be absent under their default names.

    Parameters
    ----------
    time, penetration, force, velocity : str
        Columns in s, m, N and m/s.
    segment : str
        A label that changes where a separate contact begins.
    """

    time: str = "time_s"
    penetration: str = "penetration_m"
    force: str = "force_N"
    velocity: str = "velocity_m_s"
    segment: str = "segment"


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
    recording: Recorded | None = None,
    *,
    columns: Columns | None = None,
    time: ArrayLike | None = None,
    penetration: ArrayLike | None = None,
    force: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    segment: ArrayLike | None = None,
    velocity_window: float | None = None,
    source: str | None = None,
    provenance: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    flip: Sequence[str] = (),
    tare: tuple[float, float] | None = None,
    delay: float = 0.0,
    surface: float = 0.0,
) -> Contact:
    """Make a contact of a recording, a file, a pandas or polars frame, or of arrays.

    Where there is no velocity it is worked out from the penetration, a segment at a time, by
    :func:`palpate.preparation.velocity.velocity_of`.

    Parameters
    ----------
    recording : Recording, path or frame, optional
        What was recorded, in SI. None: the arrays say it.
    columns : Columns, optional
        Names of the recording's columns.
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
        Units of channels that are not in SI, such as ``{"penetration": "mm", "force": "mN"}``.
    flip : sequence of str
        Channels whose sign is turned: ``"force"``, ``"penetration"``, or both.
    tare : tuple of float, optional
        (start, stop), s: the mean force between them is taken off; a time without contact.
    delay : float
        How late the force is, s; negative where it is early. It is read that much earlier.
    surface : float
        Where the material begins, m, in the penetration as corrected.

    Returns
    -------
    Contact
        Its ``provenance`` holds the recording's notes and says how each channel was made.

    Raises
    ------
    RecordingError
        The recording cannot be read, lacks a column, holds something other than numbers, has no
        sample, or its time does not increase within a segment.
    MissingChannelError
        The recording has no column of a name that was looked for, or was asked for.
    InvalidParameterError
        Arrays are missing, of another type or of different lengths, or their time does not increase
        within a segment; or a correction is not one of those.
    """
    corrections = Corrections(units or {}, flip, tare, delay, surface)
    arrays = {"time": time, "penetration": penetration, "force": force, "velocity": velocity}
    arrays["segment"] = segment
    given = {name: values for name, values in arrays.items() if values is not None}
    if recording is None:
        channels = _of_arrays(given)
    elif given:
        raise InvalidParameterError(
            f"{next(iter(given))} must not be given beside a recording; name its column in columns"
        )
    else:
        names = Columns() if columns is None else columns
        instance("columns", names, Columns)
        channels = _of_recording(as_recording(recording), names, corrections)
    corrections.rescaled(channels.values, channels.provenance)
    contact = _contact_of(channels, velocity_window)
    contact = corrections.in_step(corrections.tared(contact))
    done = contact.provenance
    notes = {f"note on {key}" if key in done else key: v for key, v in channels.notes.items()}
    return dataclasses.replace(
        contact,
        source=channels.source if source is None else source,
        provenance={**notes, **(provenance or {}), **done},
    )


def as_recording(recorded: Recorded) -> Recording:
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
        return open_recording(recorded)
    try:
        names = list(recorded.columns)
        channels = {str(name): _array(recorded[name]) for name in names}
    except (AttributeError, TypeError, KeyError, ValueError):
        raise InvalidParameterError(
            "recording must be a Recording, a path, or a pandas or polars DataFrame, not "
            f"{type(recorded).__name__}"
        ) from None
    return Recording(channels)


@dataclasses.dataclass(frozen=True, slots=True)
class _Channels:
    values: dict[str, ArrayLike]  # by the names that Contact gives them
    provenance: dict[str, str]
    source: str = ""
    notes: Mapping[str, str] = dataclasses.field(default_factory=dict)


def _of_arrays(given: dict[str, ArrayLike]) -> _Channels:
    missing = [name for name in ("time", "penetration", "force") if name not in given]
    if missing:
        raise InvalidParameterError(
            f"{missing[0]} must be given, as an array, or a recording in place of all arrays"
        )
    return _Channels(given, {})


def _of_recording(recording: Recording, columns: Columns, corrections: Corrections) -> _Channels:
    names = dataclasses.asdict(columns)
    for channel in ("velocity", "segment"):
        if names[channel] == getattr(Columns(), channel) not in recording.channels:
            del names[channel]
    segment = names.pop("segment", None)
    values: dict[str, ArrayLike] = {}
    made = {}
    for channel, name in names.items():
        numbers = recording.numbers(name)
        unit = recording.units.get(name, _SI[channel])
        if unit != _SI[channel] and channel not in corrections.units:
            raise RecordingError(
                f"{recording.place(name)}: the {channel} is in {unit}; convert it to {_SI[channel]}"
            )
        made[channel] = f"column {name!r}"
        values[channel] = numbers
    made.pop("time")
    if segment is not None:
        values["segment"] = recording.channel(segment)
    _check_time(recording, columns.time, values)
    return _Channels(values, made, recording.source, recording.notes)


def _contact_of(channels: _Channels, window: float | None) -> Contact:
    """The contact, with a velocity where there is none."""
    measured = {name: channels.values[name] for name in ("time", "penetration", "force")}
    time, penetration, force = signals(**measured)
    contact = Contact(
        time,
        penetration=penetration,
        velocity=channels.values.get("velocity", np.zeros_like(time)),
        force=force,
        segment=channels.values.get("segment"),
        provenance=channels.provenance,
    )
    if "velocity" in channels.values:
        return contact
    segments = list(contact.segments())
    parts = [velocity_of(time[part], penetration[part], window) for part in segments]
    words = "centred quadratic Savitzky–Golay filter"
    if lost := sum(lost_positions(penetration[part]) for part in segments):
        words += f", without {lost} lost position{'s' if lost > 1 else ''}"
    return dataclasses.replace(
        contact,
        velocity=np.concatenate([np.empty(0), *parts]),
        provenance={**channels.provenance, "velocity": words},
    )


def _check_time(recording: Recording, name: str, values: dict[str, ArrayLike]) -> None:
    time = np.asarray(values["time"])
    if not time.size:
        where = f"{recording.source}: " if recording.source else ""
        raise RecordingError(f"{where}there are columns but no samples")
    sample = first_wrong_time(time, values.get("segment"))
    if sample is None:
        return
    what = "is not finite"
    if np.isfinite(time[sample]):
        before = time[sample - 1]
        what = f"runs back from {before:g} s"
        if time[sample] >= before:
            what = "repeats the time before it" if time[sample] == before else "is hardly later"
    raise RecordingError(
        f"{recording.place(name, sample)}: {time[sample]:g} s {what}; time must increase within a "
        "segment"
    )


def _array(column: Any) -> NDArray[Any]:
    values: NDArray[Any] = np.asanyarray(column)
    if values.dtype == object and hasattr(column, "isna"):  # what pandas calls NA is no number
        return np.where(column.isna(), np.nan, values)
    return values
