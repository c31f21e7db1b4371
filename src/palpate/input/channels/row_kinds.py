"""Rows that are no sample of all channels: each is of one topic, or of one contact."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.input.channels.kinds import channel_kind
from palpate.input.recordings import Recording
from palpate.input.recordings.recording import holds_numbers
from palpate.input.recordings.units import split_name
from palpate.method.rows import count_true
from palpate.validation import Mask

# Rows of a simulator's contacts: two bodies, the place, the signed distance, the force.
#
# MuJoCo, PyBullet (``getContactPoints``) and PhysX state the distance of the two surfaces,
# negative where they overlap. The place beside it is the middle of the overlap: it moves by half of
# the penetration.

_DISTANCE = frozenset(("dist", "distance", "separation", "sdf"))
_CONTACT = frozenset(("contact", "contacts", "geom", "geoms"))
_BODIES = frozenset(("geom", "geoms", "body", "bodies", "link", "links", "collision"))
_PLACES = ("position", "nothing")  # a contact's position or normal
MOST_REPEATED = 0.02  # fraction of rows with the time of the row before; more are several contacts


def is_contact_table(recording: Recording) -> bool:
    """Whether a name shows that each row is a contact: ``geom1``, ``contact_pos_x``, ``normal_x``.

    A flag ``in_contact`` and a ``normal_force`` do not show it.
    """
    return any(map(_shows_contact, recording.channels))


def _shows_contact(name: str) -> bool:
    words = set(split_name(name))
    if words & {"geom", "geoms"}:
        return True
    return bool(words & {"contact", "contacts", "normal"}) and channel_kind(name) in _PLACES


def state_penetration(recording: Recording) -> tuple[Recording, Mapping[str, str]]:
    """Add the penetration that a contact's distance states: its negative, if it falls below zero.

    A distance counts beside a contact's place or normal. Without a mark of a contact it must fall
    below zero: that of a range sensor does not.

    Returns
    -------
    tuple
        The recording, and the penetrations by the names of their distances.
    """
    channels = dict(recording.channels)
    units = dict(recording.units)
    clocks = dict(recording.clocks)
    penetrations: dict[str, str] = {}
    marked = is_contact_table(recording)
    placed = any(channel_kind(name) == "position" and not _is_distance(name) for name in channels)
    for name, values in recording.channels.items():
        if not _is_distance(name) or values.ndim != 1 or values.dtype.kind not in "fi":
            continue
        if (marked or placed) and (values < 0.0).any():
            penetrations[name] = negative = f"-{name}"
            channels[negative] = -values
            for labels in (units, clocks):
                if name in labels:
                    labels[negative] = labels[name]
        elif marked and (values > 0.0).any():
            penetrations[name] = name
    return replace(recording, channels=channels, units=units, clocks=clocks), penetrations


def _is_distance(name: str) -> bool:
    words = set(split_name(re.split(r"[/.]", name)[-1]))
    return bool(words & _DISTANCE) and bool(words & _CONTACT or words <= {"signed", *_DISTANCE})


def refuse_several_contacts(recording: Recording, time: str | None) -> None:
    """Refuse rows of contacts between several pairs of bodies, or at several points at one time.

    Raises
    ------
    RecordingError
        The rows hold several contacts: the message says how many, and what to write instead.
    """
    columns = {name: values for name, values in recording.channels.items() if values.ndim == 1}
    bodies = {n: v for n, v in columns.items() if _is_body(n, v)}
    rows = zip(*(values.tolist() for values in bodies.values()), strict=True)
    pairs = {tuple(sorted(str(body).removesuffix(".0") for body in row)) for row in rows}
    if len(pairs) > 1:
        listed = ", ".join(" and ".join(pair) for pair in sorted(pairs)[:4])
        raise RecordingError.of(
            recording.source,
            f"the rows are contacts of {len(pairs)} pairs of bodies, by {', '.join(bodies)}: "
            f"{listed}; write a file for each pair",
        )
    stamps = columns.get(time or "", np.empty(0))
    repeated = stamps[1:] == stamps[:-1]
    aligned = [values for values in columns.values() if values.shape == stamps.shape]
    changes = [(values[1:] != values[:-1])[repeated] for values in aligned]
    several = count_true(np.logical_or.reduce(changes)) if changes else 0
    if several > MOST_REPEATED * stamps.size:
        raise RecordingError.of(
            recording.source,
            f"{several} of {stamps.size} rows repeat the time of another contact: the bodies touch "
            "at several points; write one row for each time, with the sum of the forces and the "
            "mean of the distances",
        )


def _is_body(name: str, values: NDArray[np.generic]) -> bool:
    """Whether a column holds names or whole numbers of bodies."""
    if _BODIES.isdisjoint(split_name(name)):
        return False
    return values.dtype.kind in "iuOUS" or bool((values == np.rint(values)).all())


# Rows joined from several topics: each row is a sample of one topic, with blank cells for others.
# PlotJuggler and data frames export logs in this way: one column of times for all topics.

# Fractions of the samples. Where less is known at once, the rows are joined; where more is, a
# sensor or a recorder missed samples.
LEAST_KNOWN = 0.5
LEAST_SHARED = 0.75
BLANK = ("", "null", "None")


def separate_topics(
    recording: Recording, time: str, topics: Iterable[tuple[str, ...]]
) -> Recording | None:
    """Give the channels of each topic a clock of their own, without the rows that they leave blank.

    None if the rows are not joined, that is if most rows hold a sample of every topic.

    Parameters
    ----------
    recording : Recording
        A table.
    time : str
        Its column of times.
    topics : iterable of tuple of str
        The channels of each topic.
    """
    stamps = recording.channels[time]
    filled = [names for names in topics if names]
    if any(recording.channels[name].shape != stamps.shape for names in filled for name in names):
        return None
    samples = {names: _find_samples(recording, names) for names in filled}
    if not _are_joined([*samples.values()]):
        return None
    channels = dict(recording.channels)
    units = dict(recording.units)
    faults = dict(recording.faults)
    clocks = dict(recording.clocks)
    clock_names: dict[bytes, str] = {}
    unit = recording.unit_of(time)
    for names, mask in samples.items():
        clock = clock_names.setdefault(mask.tobytes(), f"{time} of {names[0]}")
        channels[clock] = stamps[mask]
        if unit is not None and (time in units or unit != "s"):
            units[clock] = unit
        for name in names:
            channels[name] = recording.channels[name][mask]
            clocks[name] = clock
            if name in faults and faults[name].text.strip() in BLANK:
                del faults[name]
    return replace(
        recording, channels=channels, units=units, faults=faults, clocks=clocks, rows=None
    )


def _are_joined(masks: list[Mask]) -> bool:
    """Whether topics with samples in these rows were joined, not recorded together."""
    fewest = min(map(count_true, masks))
    shared = count_true(np.logical_and.reduce(masks))
    together = fewest >= LEAST_KNOWN * masks[0].size and shared >= LEAST_SHARED * fewest
    return bool(fewest) and not together


def _find_samples(recording: Recording, names: tuple[str, ...]) -> Mask:
    """Mask of the rows in which each of these channels holds a number; a label is never blank."""
    mask = np.ones(len(recording.channels[names[0]]), dtype=bool)
    for name in names:
        if holds_numbers(recording.channels[name]):
            mask &= np.isfinite(recording.numbers(name))
    return mask
