"""Rows of a simulator's contacts: two bodies, the place, the signed distance, the force.

MuJoCo, PyBullet (``getContactPoints``) and PhysX state the distance of the two surfaces,
negative where they overlap. The place beside it is the middle of the overlap: it moves by half of
the penetration.
"""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from palpate.errors import RecordingError
from palpate.preparation.channel_kinds import channel_kind
from palpate.recordings import Recording
from palpate.recordings.units import split_name

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
    place = words & {"contact", "contacts", "normal"} and channel_kind(name) in _PLACES
    return bool(words & {"geom", "geoms"} or place)


def state_penetration(recording: Recording) -> tuple[Recording, Mapping[str, str]]:
    """Add the penetration that a contact's distance states: its negative, if it falls below zero.

    A distance counts beside a contact's place or normal. Without a mark of a contact it must fall
    below zero: that of a range sensor does not.

    Returns
    -------
    tuple
        The recording, and the penetrations by the names of their distances.
    """
    channels, units = dict(recording.channels), dict(recording.units)
    clocks, penetrations = dict(recording.clocks), dict[str, str]()
    marked = is_contact_table(recording)
    placed = any(channel_kind(name) == "position" for name in channels)
    for name, values in recording.channels.items():
        if not _is_distance(name) or values.ndim != 1 or values.dtype.kind not in "fi":
            continue
        if (marked or placed) and (values < 0.0).any():
            penetrations[name] = negative = f"-{name}"
            channels[negative] = -values
            for each in (units, clocks):
                if name in each:
                    each[negative] = each[name]
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
    bodies = {n: v for n, v in columns.items() if not _BODIES.isdisjoint(split_name(n))}
    names = [n for n, v in bodies.items() if v.dtype.kind in "iuOUS" or (v == np.rint(v)).all()]
    rows = zip(*(bodies[n].tolist() for n in names), strict=True)
    pairs = {tuple(sorted(str(body).removesuffix(".0") for body in row)) for row in rows}
    if len(pairs) > 1:
        listed = ", ".join(" and ".join(pair) for pair in sorted(pairs)[:4])
        words = f"the rows are contacts of {len(pairs)} pairs of bodies, by {', '.join(names)}: "
        words += f"{listed}; write a file for each pair"
        raise RecordingError.of(recording.source, words)
    stamps = columns.get(time or "", np.empty(0))
    again = stamps[1:] == stamps[:-1]
    moved = [(v[1:] != v[:-1])[again] for v in columns.values() if v.shape == stamps.shape]
    several = np.count_nonzero(np.logical_or.reduce(moved)) if moved else 0
    if several > MOST_REPEATED * stamps.size:
        words = f"{several} of {stamps.size} rows repeat the time of another contact: the bodies "
        words += "touch at several points; write one row for each time, with the sum of the "
        words += "forces and the mean of the distances"
        raise RecordingError.of(recording.source, words)
