"""The contents of a recording as tables or as one JSON object."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

from rich.text import Text

from palpate.cli.printing import Cell, Terminal, print_table, say, say_path
from palpate.digits import rounded
from palpate.errors import RecordingError, printable
from palpate.preparation import roles_of
from palpate.recordings.recording import Recording
from palpate.recordings.survey import ChannelSurvey, ClockSurvey, Survey
from palpate.validation import plain

#: Version of the JSON; it increases when a field is removed or changes its meaning.
SCHEMA_VERSION = 1

# Limits for a readable output: rows of a table, lines of one kind. The JSON has all.
_MOST_ROWS = 60
_MOST_LINES = 12

# Times from 2001 on, in seconds since 1970, are printed as dates.
_DATES = 1e9

_BECAUSE = "because"

#: Headings and rows of a table.
Section: TypeAlias = tuple[list[str], list[list[Cell]]]


def print_recording(recording: Recording, surveyed: Survey) -> None:
    """Print the contents of a recording; empty sections are omitted."""
    console = Terminal()
    channels, clocks = len(surveyed.channels), sum(bool(c.name) for c in surveyed.clocks)
    say_path(console, recording.source or "recording", "bold")
    say(console, f"{_count(channels, 'channel')} on {_count(clocks, 'clock')}")
    for headings, rows in (
        _types_table(recording, surveyed),
        _clocks_table(surveyed),
        _channels_table(surveyed.channels),
        (["used as", "channel", _BECAUSE], [[*map(printable, row)] for row in _roles(recording)]),
    ):
        if rows:
            console.print()
            print_table(console, headings, rows, prose=[_BECAUSE])
    if channels > _MOST_ROWS:
        say(console, f"and {channels - _MOST_ROWS} more channels: --channel NAME or --json")
    notes = [f"{name}: {words}" for name, words in recording.notes.items()]
    faults = [
        f"{name}: {f.count} of {len(recording.channels[name])} values are not numbers; the first, "
        f"at sample {f.sample}, is {f.text}"
        for name, f in recording.faults.items()
    ]
    for word, lines, style in (
        ("note", notes, "dim"),
        ("skipped", recording.omissions, "dim"),
        ("fault", faults, "yellow"),
        ("damaged", recording.losses, "red"),
    ):
        for line in lines[:_MOST_LINES]:
            say(console, printable(f"{word}: {line}"), style)
        if len(lines) > _MOST_LINES:
            say(console, f"{word}: {len(lines) - _MOST_LINES} more; see --json", style)


def as_dict(file: Path, recording: Recording, surveyed: Survey) -> dict[str, Any]:
    """Return the contents of a recording as JSON types."""
    return {
        "schema_version": SCHEMA_VERSION,
        "file": str(file),
        "types": dict(recording.types),
        "clocks": [_clock_dict(clock) for clock in surveyed.clocks],
        "channels": [_channel_dict(recording, channel) for channel in surveyed.channels],
        "roles": [
            dict(zip(("role", "channels", _BECAUSE), row, strict=True)) for row in _roles(recording)
        ],
        "notes": dict(recording.notes),
        "omissions": list(recording.omissions),
        "losses": list(recording.losses),
    }


def _clock_dict(clock: ClockSurvey) -> dict[str, Any]:
    return {**plain(asdict(clock)), "name": clock.name or None, "rate": plain(clock.rate)}


def _channel_dict(recording: Recording, channel: ChannelSurvey) -> dict[str, Any]:
    fault = recording.faults.get(channel.name)
    empty = {"unit": channel.unit or None, "frame": channel.frame or None}
    return {**plain(asdict(channel)), **empty, "faults": fault and asdict(fault)}


def _roles(recording: Recording) -> list[tuple[str, str, str]]:
    """The role, channels and reason of each choice; or why palpate cannot choose."""
    try:
        roles = roles_of(recording)
    except RecordingError as error:
        return [("cannot be chosen", "", str(error).removeprefix(f"{recording.source}: "))]
    depth = "penetration" if roles.is_penetration else "position"
    clock = recording.clocks.get(roles.depth[0]), recording.clocks.get(roles.force[0])
    time = [roles.time] if roles.time else sorted({name for name in clock if name})
    channels: dict[str, Iterable[str]] = {
        "time": time,
        depth: roles.depth,
        "force": roles.force,
        "velocity": [roles.velocity or ""],
        "orientation": roles.orientation,
        "segment": [roles.segment or ""],
    }
    usual = {"time": "clock of these channels", "orientation": "the only quaternion"}
    return [
        (role, words, roles.reasons.get(role, usual.get(role, "has this name")))
        for role, names in channels.items()
        if (words := ", ".join(names))
    ]


def _types_table(recording: Recording, surveyed: Survey) -> Section:
    names = [channel.name for channel in surveyed.channels]
    rows: list[list[Cell]] = [
        [printable(topic), printable(kind), str(sum(n.startswith(f"{topic}.") for n in names))]
        for topic, kind in recording.types.items()
    ]
    return ["topic", "type", ">channels"], rows


def _clocks_table(surveyed: Survey) -> Section:
    headings = ["clock", ">samples", ">rate", ">begins", ">span", ">gaps", ">repeated", ">backward"]
    rows: list[list[Cell]] = []
    for clock in surveyed.clocks[:_MOST_ROWS]:
        if not clock.name:
            none = Text("no clock", style="dim")
            rows.append([none, str(clock.samples), *("" for _ in headings[2:])])
            continue
        gaps = f"{clock.gaps} (≤ {_quantity(clock.largest_gap, 's')})" if clock.gaps else "–"
        times = _quantity(clock.rate, "Hz"), _moment(clock.start), _quantity(clock.span, "s")
        wrong = (str(count or "–") for count in (clock.repeated, clock.backward))
        rows.append([printable(clock.name), str(clock.samples), *times, gaps, *wrong])
    return headings, rows


def _channels_table(channels: Sequence[ChannelSurvey]) -> Section:
    shown = channels[:_MOST_ROWS]
    framed = ["frame"] * any(channel.frame for channel in shown)
    headings = ["channel", "holds", "unit", *framed, ">samples", ">unknown", ">least", ">greatest"]
    rows: list[list[Cell]] = []
    for channel in shown:
        frame = [channel.frame or "–"] * len(framed)
        words = [channel.name, channel.kind, channel.unit or "–", *frame]
        counts = channel.samples, channel.samples - channel.known or "–"
        span = (
            rounded(value, 5) if math.isfinite(value) else "–"
            for value in (channel.minimum, channel.maximum)
        )
        rows.append([*map(printable, words), *map(str, counts), *span])
    return headings, rows


def _count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _quantity(value: float, unit: str) -> str:
    return f"{rounded(value, 4)} {unit}" if math.isfinite(value) else "–"


def _moment(start: float) -> str:
    """A time in seconds, or as a date if it is one since 2001."""
    if not math.isfinite(start):
        return "–"
    if _DATES <= start < 1e10:
        return datetime.fromtimestamp(start, UTC).strftime("%Y-%m-%d %H:%M:%S")
    return f"{rounded(start, 4)} s"
