"""The contents of a recording in numbers: clocks with rates and gaps, channels with ranges."""

from collections.abc import Iterable, Sequence

import numpy as np

from palpate.input.recordings.recording import Recording
from palpate.input.recordings.times import clock_rank, clock_unit
from palpate.input.recordings.units import UNITS
from palpate.method.rows import count_true, median
from palpate.stages import log_stage
from palpate.validation import Floats, Values, frozen

#: Least length of a gap in median steps; shorter ones are single missed samples and jitter.
GAP = 10.0


@frozen
class ClockSurvey:
    """One clock and its channels.

    Attributes
    ----------
    name : str
        The channel with the times; empty for channels without a clock.
    samples : int
        Number of times, or of samples.
    unknown : int
        Number of times that are NaN or infinite.
    start, stop : float
        The earliest and the latest time, s.
    step : float
        The median step, s; NaN for fewer than two times.
    gaps : int
        Number of steps of more than 10 median steps.
    largest_gap : float
        The longest gap, s; 0 without gaps.
    repeated : int
        Number of times equal to the previous one.
    backward : int
        Number of times earlier than the previous one.
    channels : tuple of str
        The channels on this clock.
    """

    name: str
    samples: int
    channels: tuple[str, ...]
    unknown: int = 0
    start: float = np.nan
    stop: float = np.nan
    step: float = np.nan
    gaps: int = 0
    largest_gap: float = 0.0
    repeated: int = 0
    backward: int = 0

    @property
    def rate(self) -> float:
        """Samples per second, from the median step; NaN if that is unknown."""
        return 1.0 / self.step if self.step > 0.0 else np.nan

    @property
    def span(self) -> float:
        """Time from the earliest to the latest sample, s."""
        return self.stop - self.start


@frozen
class ChannelSurvey:
    """One channel.

    Attributes
    ----------
    name : str
        Its name in the recording.
    kind : str
        The type of its numbers, such as ``"float64"``, or ``"text"``.
    unit : str
        Its unit, if the file states one.
    frame : str
        Its coordinate frame, if the file states one.
    samples : int
        Number of samples.
    known : int
        Number of finite values, or of texts that are not empty.
    minimum, maximum : float
        The range of the finite values, in the unit of the channel; NaN for text.
    """

    name: str
    kind: str
    unit: str
    frame: str
    samples: int
    known: int
    minimum: float = np.nan
    maximum: float = np.nan


@frozen
class Survey:
    """All clocks and channels of a recording."""

    clocks: tuple[ClockSurvey, ...]
    channels: tuple[ChannelSurvey, ...]


@log_stage("survey")
def survey(recording: Recording, time: str | None = None) -> Survey:
    """Survey a recording.

    Parameters
    ----------
    recording : Recording
        From :func:`palpate.input.recordings.open_recording`.
    time : str, optional
        The clock of a table in which no name suggests one, such as the channel that
        preparation takes for the time.
    """
    candidates = named_clocks(recording)
    if not candidates and time is not None:
        candidates = [(0, 0, time)]
    members: dict[tuple[str, int], list[str]] = {}
    for name, values in recording.channels.items():
        clock = channel_clock(recording, name, candidates)
        members.setdefault((clock, len(values)), []).append(name)
    # A time column is on its own clock; it does not count as one of the clock's channels.
    clocks = [
        _clock(recording, clock, count, (n for n in names if n != clock))
        for (clock, count), names in members.items()
    ]
    channels = tuple(_channel(recording, name) for name in recording.channels)
    return Survey(tuple(clocks), channels)


def named_clocks(recording: Recording) -> list[tuple[int, int, str]]:
    """Return the columns of a table whose names suggest times, with rank and place."""
    return [
        (rank, k, clock)
        for k, (clock, values) in enumerate(recording.channels.items())
        if (rank := clock_rank(clock)) is not None
        and values.dtype.kind in "fiu"
        and clock not in recording.clocks
    ]


def channel_clock(
    recording: Recording, name: str, candidates: Sequence[tuple[int, int, str]]
) -> str:
    """Return the name of the channel with the times of a channel; empty without one.

    In a table, whose columns name no clock, it is one of the candidates of :func:`named_clocks`.
    """
    if clock := recording.clocks.get(name):
        return clock
    if name in recording.clocks.values():
        return name
    count = len(recording.channels[name])
    ranked = [
        (rank, k, clock)
        for rank, k, clock in candidates
        if len(recording.channels[clock]) == count
        # Both are in one group, or the times are in a group above.
        and name.startswith(clock[: max(clock.rfind("/"), clock.rfind(".")) + 1])
    ]
    return min(ranked)[2] if ranked else ""


def seconds(recording: Recording, clock: str) -> Floats:
    """Return the times of a clock relative to its first finite time, s; differences are exact.

    Parameters
    ----------
    recording : Recording
        The recording with the clock.
    clock : str
        The channel with the times.
    """
    return _since(recording.channels[clock]) * unit_of_clock(recording, clock)[1]


def unit_of_clock(recording: Recording, clock: str) -> tuple[str, float]:
    """Return the unit of a clock, from the file or its name, and its length in seconds."""
    unit = recording.units.get(clock) or clock_unit(clock) or "s"
    return unit, UNITS["time"].get(unit, 1.0)


def _since(values: Values) -> Floats:
    """Return times relative to the first, subtracted before rounding to a float."""
    if values.dtype.kind == "u":
        values = values.astype(np.int64)
    finite = values[np.isfinite(values)]
    return np.asarray(values - finite[0] if finite.size else values, dtype=np.float64)


def _clock(recording: Recording, name: str, count: int, channels: Iterable[str]) -> ClockSurvey:
    members = tuple(channels)
    if not name:
        return ClockSurvey("", count, members)
    values = recording.channels[name]
    _, factor = unit_of_clock(recording, name)
    times = _since(values)  # in its own unit, in which steps of integers are exact
    finite = np.isfinite(times)
    times = times[finite]
    if not times.size:
        return ClockSurvey(name, count, members, unknown=count)
    zero = float(values[finite][0]) * factor
    steps = np.diff(times)
    forward = steps[steps > 0.0]
    step = median(forward) if forward.size else np.nan
    gaps = forward[forward > GAP * step]
    return ClockSurvey(
        name,
        count,
        members,
        unknown=count - times.size,
        start=zero + float(times.min()) * factor,
        stop=zero + float(times.max()) * factor,
        step=step * factor,
        gaps=gaps.size,
        largest_gap=float(gaps.max(initial=0.0)) * factor,
        repeated=count_true(steps == 0.0),
        backward=count_true(steps < 0.0),
    )


def _channel(recording: Recording, name: str) -> ChannelSurvey:
    values = recording.channels[name]
    unit = recording.units.get(name, "")
    frame = recording.frames.get(name, "")
    if values.dtype.kind not in "fiub":
        filled = sum(1 for value in values.flat if str(value).strip())
        return ChannelSurvey(name, "text", unit, frame, len(values), filled)
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    ends = (float(finite.min()), float(finite.max())) if finite.size else ()
    return ChannelSurvey(name, str(values.dtype), unit, frame, len(values), finite.size, *ends)
