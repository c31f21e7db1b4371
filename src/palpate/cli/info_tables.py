"""The contents of a recording as tables or as one JSON object."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from rich.cells import cell_len
from rich.text import Text

from palpate.cli.printing import Cell, Terminal, print_json, print_table, say, say_path
from palpate.digits import format_quantity, rounded
from palpate.errors import RecordingError, printable
from palpate.input.recordings.datasets import DataSet
from palpate.input.recordings.recording import Recording
from palpate.input.recordings.survey import ChannelSurvey, ClockSurvey, Survey
from palpate.validation import plain

#: Version of the JSON; it increases when a field is removed or changes its meaning.
SCHEMA_VERSION = 2

# Limits for a readable output: rows of a table, lines of one kind. The JSON has all.
_MOST_ROWS = 60
_MOST_LINES = 12
_MOST_CURVES = 8
_MOST_EPISODES = 8
_NAME = 36  # characters
_NARROW = 60  # characters; below, several lines a channel keep its numbers

# Times from 2001 on, in seconds since 1970, are printed as dates.
_DATES = 1e9

#: Headings and rows of a table.
Section: TypeAlias = tuple[list[str], list[list[Cell]]]


#: Each channel's role, empty without one, and the reason.
Uses = Mapping[str, tuple[str, str]]


def print_recording(recording: Recording, surveyed: Survey, uses: Uses, refusal: str) -> None:
    """Print the contents of a recording; empty sections are omitted.

    ``uses`` and ``refusal`` are what ``explain_roles`` returns.
    """
    console = Terminal()
    channels = len(surveyed.channels)
    clocks = sum(bool(c.name) for c in surveyed.clocks)
    say_path(console, recording.source or "recording", "bold")
    times = f"on {_count(clocks, 'clock')}" if clocks else "without times"
    say(console, f"{_count(channels, 'channel')} {times}")
    for headings, rows in (_types_table(recording, surveyed), _clocks_table(surveyed)):
        if rows:
            console.print()
            print_table(console, headings, rows)
    if channels:
        console.print()
        _say_channels(console, uses, surveyed.channels)
    if channels > _MOST_ROWS:
        say(console, f"and {channels - _MOST_ROWS} more channels: --channel NAME or --json")
    notes = [f"{name}: {words}" for name, words in recording.notes.items()]
    faults = [
        f"{name}: {f.count} of {len(recording.channels[name])} values are not numbers; the first, "
        f"at sample {f.sample}, is {f.text}"
        for name, f in recording.faults.items()
    ]
    for word, lines, style in (
        ("roles", [refusal] if refusal else [], "yellow"),
        ("table", [recording.table] if recording.table else [], "dim"),
        ("note", notes, "dim"),
        ("skipped", recording.omissions, "dim"),
        ("fault", faults, "yellow"),
        ("damaged", recording.losses, "red"),
    ):
        for line in lines[:_MOST_LINES]:
            say(console, printable(f"{word}: {line}"), style)
        if len(lines) > _MOST_LINES:
            say(console, f"{word}: {len(lines) - _MOST_LINES} more; see --json", style)


def print_curves(file: Path, max_size: float | None, *, as_json: bool) -> None:
    """Print a line for each of the first curves of a force map, or all curves as JSON."""
    from palpate.input.recordings.opening import FORCE_CURVES

    reader = FORCE_CURVES.reader()
    count = reader.count_curves(file)
    numbers = range(count if as_json else min(count, _MOST_CURVES))
    curves = [
        _describe_curve(number, curve)
        for number, curve in enumerate(reader.read_curves(file, numbers, max_size))
    ]
    if as_json:
        return print_json({"schema_version": SCHEMA_VERSION, "file": str(file), "curves": curves})
    console = Terminal()
    say_path(console, str(file), "bold")
    say(console, f"force map of {_count(count, 'curve')}; --curve N shows one")
    units = {"x": "m", "y": "m", "travel": "m", "peak_force": "N"}
    rows = [
        [str(curve["curve"])]
        + [format_quantity(v, units[k]) if (v := curve.get(k)) is not None else "–" for k in units]
        + [str(curve.get("samples", "–")), curve.get("error", "")]
        for curve in curves
    ]
    print_table(
        console,
        [">curve", ">x", ">y", ">travel", ">peak force", ">samples", "error"],
        rows,
    )
    if count > len(curves):
        say(console, f"and {count - len(curves)} more; see --json")


def _describe_curve(number: int, curve: Recording | RecordingError) -> dict[str, Any]:
    """Return place, travel, peak force above the median, and samples of a force curve."""
    from palpate.fleet.rows import place_in_notes

    if isinstance(curve, RecordingError):
        return {"curve": number, "error": str(curve)}
    lost = [name for name in ("tip position", "force") if not np.size(curve.channels.get(name, ()))]
    if lost:
        return {"curve": number, "error": "; ".join([f"no {lost[0]}", *curve.losses])}
    position, force = (np.asarray(curve.channels[name]) for name in ("tip position", "force"))
    return {
        "curve": number,
        **place_in_notes(curve.notes),
        "travel": float(np.ptp(position)),
        "peak_force": float(force.max() - np.median(force)),
        "samples": position.size,
    }


def print_episodes(data: DataSet) -> None:
    """Print how many episodes a data set has, and the lengths of the first ones."""
    console = Terminal()
    lengths = data.lengths
    rate = "" if data.rate is None else f" at {rounded(data.rate, 4)} Hz"
    say(console, f"{data.name}: {_count(len(lengths), 'episode')}{rate}", "bold")
    for number, length in [*lengths.items()][:_MOST_EPISODES]:
        say(
            console,
            f"episode {number}: " + (f"{length} samples" if length >= 0 else "length not stated"),
        )
    if len(lengths) > _MOST_EPISODES:
        more = len(lengths) - _MOST_EPISODES
        say(console, f"and {more} more; palpate fleet identifies each")
    console.print()


def as_dict(
    file: Path,
    recording: Recording,
    surveyed: Survey,
    uses: Uses,
    refusal: str,
    data: DataSet | None = None,
) -> dict[str, Any]:
    """Return the contents of a recording as JSON types, with the episodes of a data set."""
    of_set = {} if data is None else {"name": data.name, "rate": data.rate, "lengths": data.lengths}
    return {
        **({"data_set": of_set} if of_set else {}),
        "schema_version": SCHEMA_VERSION,
        "file": str(file),
        "types": dict(recording.types),
        "clocks": [_clock_dict(clock) for clock in surveyed.clocks],
        "channels": [
            _channel_dict(recording, channel)
            | dict(zip(("role", "because"), uses[channel.name], strict=True))
            for channel in surveyed.channels
        ],
        "roles_refused": refusal or None,
        "table": recording.table or None,
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


def _say_channels(
    console: Terminal,
    uses: Uses,
    channels: Sequence[ChannelSurvey],
) -> None:
    """Print one line a channel, cut off at the width of the terminal unless that is narrow."""
    rows: list[tuple[str, ...]] = [
        ("channel", "used as", "unit", "frame", "least", "greatest", "because")
    ]
    for channel in channels[:_MOST_ROWS]:
        role, reason = uses[channel.name]
        unknown = channel.samples - channel.known
        because = [reason if channel.known else "empty", *[f"{unknown} unknown"] * bool(unknown)]
        span = (
            rounded(value, 5) if math.isfinite(value) else "–"
            for value in (channel.minimum, channel.maximum)
        )
        words = channel.name, role or "–", channel.unit or "–", channel.frame, *span
        rows.append((*map(printable, words), printable("; ".join(because))))
    if console.width < _NARROW:
        return print_table(console, rows[0], rows[1:])
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    widths[0] = min(widths[0], _NAME)  # a longer name moves the rest of its line
    if not any(channel.frame for channel in channels):
        widths[3] = 0
    for k, row in enumerate(rows):
        cells = [
            f"{cell:>{width}}" if place in (4, 5) else f"{cell:<{width}}"
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
            if width
        ]
        line = Text("  ".join(cells).rstrip(), "" if k else "bold")
        line.truncate(console.width, overflow="ellipsis")
        console.print(line, soft_wrap=True)


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
