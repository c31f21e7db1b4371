"""Two clocks made one: the faster is interpolated at the times of the slower."""

import numpy as np
from numpy.typing import NDArray

from palpate.errors import InvalidParameterError, RecordingError
from palpate.preparation.rows import GAP
from palpate.preparation.signals import Signals, made_signals
from palpate.preparation.streams import Stream, origin_of, running, seconds_of
from palpate.recordings import Recording
from palpate.remarks import Remark
from palpate.validation import Floats


def interpolated(
    recording: Recording,
    streams: list[Stream],
    made: dict[str, str],
    remarks: list[Remark],
    *,
    strict: bool,
) -> Signals:
    """The samples of the slowest clock, and what the others were at their times."""
    units = {stream.unit for stream in streams}
    if len(units) > 1:
        raise RecordingError(
            f"{recording.source}: the clocks are in {', '.join(sorted(units))}; give one unit with "
            "--unit time=…"
        )
    origin = origin_of(*streams)
    on_time = []
    for stream in streams:
        what = f"samples of {stream.clock}"
        time, values, part = running(recording, stream, what, remarks, strict=strict)
        if part.size and part.max() > 0:
            raise RecordingError(
                f"{recording.place(stream.clock or 'time')}: the time starts again, and the clocks "
                "cannot be brought together; record anew, or cut the file there"
            )
        on_time.append((seconds_of(time, stream.unit, origin), values, stream.clock))
    on_time.sort(key=lambda each: _step(each[0]), reverse=True)
    return _onto_the_slowest(recording, on_time, made, remarks)


def _step(time: Floats) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else np.inf


def _onto_the_slowest(
    recording: Recording,
    running: list[tuple[Floats, dict[str, NDArray[np.generic]], str | None]],
    made: dict[str, str],
    remarks: list[Remark],
) -> Signals:
    """The first stream's samples, and the others' values at their times."""
    # An orientation changes slowly: it sets no clock.
    first = next(k for k, (_, own, _) in enumerate(running) if "depth" in own or "force" in own)
    time, values, clock = running.pop(first)
    values = dict(values)
    keep = np.ones(time.size, dtype=bool)
    for other, own, name in running:
        keep &= _covered(time, other)
        for role, channel in own.items():
            values[role] = _at(time, other, np.asarray(channel))
            kind = "penetration" if role == "depth" else role
            if kind in made:
                made[kind] += f", interpolated from {name!r} at the times of {clock!r}"
    if not keep.any():
        raise RecordingError(
            f"{recording.source}: the clocks {clock!r} and {running[0][2]!r} have no time in "
            "common; look at them with palpate info"
        )
    if not keep.all():
        remarks.append(
            Remark(
                "clock",
                f"{np.count_nonzero(~keep)} of {keep.size} samples of {clock} were left out: the "
                "other clock has no sample near them",
            )
        )
    taken = {role: channel[keep] for role, channel in values.items()}
    return made_signals(time[keep], taken, np.zeros(int(keep.sum()), dtype=np.int64), remarks)


def _covered(wanted: Floats, time: Floats) -> NDArray[np.bool_]:
    """Whether each time lies between two samples of a clock that are no gap apart."""
    after = np.searchsorted(time, wanted)
    inside = (after > 0) & (after < time.size)
    exact = (after < time.size) & (time[np.minimum(after, time.size - 1)] == wanted)
    low, high = time[np.maximum(after - 1, 0)], time[np.minimum(after, time.size - 1)]
    covered: NDArray[np.bool_] = (inside & (high - low <= GAP * _step(time))) | exact
    return covered


def _at(wanted: Floats, time: Floats, values: NDArray[np.generic]) -> NDArray[np.generic]:
    if values.dtype.kind not in "fiu":
        raise InvalidParameterError("a segment must be on the clock of the position or the force")
    if values.ndim == 1:
        return np.interp(wanted, time, values.astype(np.float64))
    return np.column_stack([_at(wanted, time, column) for column in values.T])
