"""Rows joined from several topics: each row is a sample of one topic, with blank cells for others.

PlotJuggler and data frames export logs in this way: one column of times for all topics.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from palpate.recordings import Recording
from palpate.recordings.recording import holds_numbers

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
    whole = [names for names in topics if names]
    if any(recording.channels[name].shape != stamps.shape for names in whole for name in names):
        return None
    known = {names: _find_samples(recording, names) for names in whole}
    fewest = min(map(np.count_nonzero, known.values()))
    shared = np.count_nonzero(np.logical_and.reduce([*known.values()]))
    one_topic = fewest >= LEAST_KNOWN * stamps.size and shared >= LEAST_SHARED * fewest
    if one_topic or not fewest:
        return None
    channels, units = dict(recording.channels), dict(recording.units)
    faults, clocks = dict(recording.faults), dict(recording.clocks)
    named: dict[bytes, str] = {}
    unit = recording.unit_of(time)
    for names, mask in known.items():
        clock = named.setdefault(mask.tobytes(), f"{time} of {names[0]}")
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


def _find_samples(recording: Recording, names: tuple[str, ...]) -> NDArray[np.bool_]:
    """Mask of the rows in which each of these channels holds a number; a label is never blank."""
    known = np.ones(len(recording.channels[names[0]]), dtype=bool)
    for name in names:
        if holds_numbers(recording.channels[name]):
            known &= np.isfinite(recording.numbers(name))
    return known
