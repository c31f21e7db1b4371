"""What a recording holds, as tables that a person reads, or as one JSON object."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

from rich.console import Console
from rich.text import Text

from palpate.cli.printing import Cell, Terminal, print_table, say, say_path
from palpate.digits import rounded
from palpate.errors import RecordingError, printable
from palpate.preparation import roles_of
from palpate.recordings.recording import Recording
from palpate.recordings.survey import ChannelSurvey, ClockSurvey, Survey

#: Of the JSON; a field that goes, or means another thing, makes it the next.
SCHEMA_VERSION = 1

# A person reads no more rows of a table, nor lines of one kind; the JSON has all.
_MOST_ROWS = 60
_MOST_LINES = 12

# Times from 2001 on are dates: as seconds since 1970 nobody reads them.
_DATES = 1e9

_BECAUSE = "because"

#: Headings and rows of a table.
Section: TypeAlias = tuple[list[str], list[list[Cell]]]


def print_recording(recording: Recording, surveyed: Survey) -> None:
    """Print what a recording holds: each section where there is something for it."""
    console = Terminal()
    channels, clocks = len(surveyed.channels), sum(bool(c.name) for c in surveyed.clocks)
    say_path(console, recording.source or "recording", "bold")
    say(console, f"{_count(channels, 'channel')} on {_count(clocks, 'clock')}")
    _print_section(console, _types_table(recording, surveyed))
    _print_section(console, _clocks_table(surveyed))
    _print_section(console, _channels_table(surveyed.channels))
    _print_section(console, _roles_table(recording))
    if channels > _MOST_ROWS:
        say(console, f"and {channels - _MOST_ROWS} more channels: --channel NAME or --json")
    notes = [f"{name}: {words}" for name, words in recording.notes.items()]
    _print_lines(console, "note", notes, "dim")
    _print_lines(console, "not read", recording.omissions, "dim")
    faults = [
        f"{name}: {f.count} of {len(recording.channels[name])} values are no number, the first "
        f"at sample {f.sample}: {f.text}"
        for name, f in recording.faults.items()
    ]
    _print_lines(console, "fault", faults, "yellow")
    _print_lines(console, "lost", recording.losses, "red")


def as_dict(file: Path, recording: Recording, surveyed: Survey) -> dict[str, Any]:
    """Return what a recording holds as plain numbers and words."""
    return {
        "schema_version": SCHEMA_VERSION,
        "file": str(file),
        "types": dict(recording.types),
        "clocks": [_clock_dict(clock) for clock in surveyed.clocks],
        "channels": [_channel_dict(recording, channel) for channel in surveyed.channels],
        "roles": [
            {"role": role, "channels": names, "because": reason}
            for role, names, reason in _roles(recording)
        ],
        "notes": dict(recording.notes),
        "omissions": list(recording.omissions),
        "losses": list(recording.losses),
    }


def _clock_dict(clock: ClockSurvey) -> dict[str, Any]:
    known = {name: _known(value) for name, value in asdict(clock).items()}
    return {**known, "name": clock.name or None, "rate": _known(clock.rate)}


def _channel_dict(recording: Recording, channel: ChannelSurvey) -> dict[str, Any]:
    known = {name: _known(value) for name, value in asdict(channel).items()}
    fault = recording.faults.get(channel.name)
    empty = {"unit": channel.unit or None, "frame": channel.frame or None}
    return {**known, **empty, "faults": fault and asdict(fault)}


def _roles_table(recording: Recording) -> Section:
    """Which channels would be taken for what, and why; or why they cannot be chosen."""
    return ["taken as", "channel", _BECAUSE], [
        list(map(printable, role)) for role in _roles(recording)
    ]


def _roles(recording: Recording) -> list[tuple[str, str, str]]:
    try:
        roles = roles_of(recording)
    except RecordingError as error:
        where = f"{recording.source}: "
        return [("cannot be chosen", "", str(error).removeprefix(where))]
    depth = "penetration" if roles.is_penetration else "position"
    clock = recording.clocks.get(roles.depth[0]), recording.clocks.get(roles.force[0])
    time = [roles.time] if roles.time else sorted({name for name in clock if name})
    channels = {
        "time": time,
        depth: list(roles.depth),
        "force": list(roles.force),
        "velocity": [roles.velocity] if roles.velocity else [],
        "orientation": list(roles.orientation),
        "segment": [roles.segment] if roles.segment else [],
    }
    usual = {"time": "the clock of its channels", "orientation": "the only one of four"}
    return [
        (role, ", ".join(names), roles.reasons.get(role, usual.get(role, "it has this name")))
        for role, names in channels.items()
        if names
    ]


def _types_table(recording: Recording, surveyed: Survey) -> Section:
    rows: list[list[Cell]] = []
    for topic, kind in recording.types.items():
        count = sum(channel.name.startswith(f"{topic}.") for channel in surveyed.channels)
        rows.append([printable(topic), printable(kind), str(count)])
    return ["topic", "type", ">channels"], rows


def _clocks_table(surveyed: Survey) -> Section:
    headings = ["clock", ">samples", ">rate", ">begins", ">span", ">gaps", ">repeated", ">backward"]
    rows: list[list[Cell]] = []
    for clock in surveyed.clocks[:_MOST_ROWS]:
        if not clock.name:
            none = Text("none: samples only", style="dim")
            rows.append([none, str(clock.samples), *("" for _ in headings[2:])])
            continue
        gaps = f"{clock.gaps} (≤ {_quantity(clock.largest_gap, 's')})" if clock.gaps else "–"
        rows.append(
            [
                printable(clock.name),
                str(clock.samples),
                _quantity(clock.rate, "Hz"),
                _moment(clock.start),
                _quantity(clock.span, "s"),
                gaps,
                str(clock.repeated or "–"),
                str(clock.backward or "–"),
            ]
        )
    return headings, rows


def _channels_table(channels: Sequence[ChannelSurvey]) -> Section:
    shown = channels[:_MOST_ROWS]
    framed = ["frame"] * any(channel.frame for channel in shown)
    headings = ["channel", "holds", "unit", *framed, ">samples", ">unknown", ">least", ">greatest"]
    rows: list[list[Cell]] = []
    for channel in shown:
        frame = [channel.frame or "–"] * len(framed)
        words = [channel.name, channel.kind, channel.unit or "–", *frame]
        unknown = channel.samples - channel.known
        rows.append(
            [
                *map(printable, words),
                str(channel.samples),
                str(unknown or "–"),
                _number(channel.minimum),
                _number(channel.maximum),
            ]
        )
    return headings, rows


def _print_section(console: Console, section: Section) -> None:
    headings, rows = section
    if rows:
        console.print()
        print_table(console, headings, rows, prose=[_BECAUSE])


def _print_lines(console: Console, word: str, lines: Sequence[str], style: str) -> None:
    for line in lines[:_MOST_LINES]:
        say(console, printable(f"{word}: {line}"), style)
    if len(lines) > _MOST_LINES:
        say(console, f"{word}: {len(lines) - _MOST_LINES} more; see --json", style)


def _count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _number(value: float) -> str:
    return rounded(value, 5) if math.isfinite(value) else "–"


def _quantity(value: float, unit: str) -> str:
    return f"{rounded(value, 4)} {unit}" if math.isfinite(value) else "–"


def _moment(start: float) -> str:
    """A time as seconds, or as a date of today's years."""
    if not math.isfinite(start):
        return "–"
    if _DATES <= start < 1e10:
        return datetime.fromtimestamp(start, UTC).strftime("%Y-%m-%d %H:%M:%S")
    return f"{rounded(start, 4)} s"
