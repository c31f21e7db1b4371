"""Arrays in groups: which channels they are, and which array is the clock of which."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.opening import Draft, first_line, within
from palpate.recordings.recording import Recording
from palpate.recordings.times import clock_rank, epoch_unit_of

#: An array with more columns than this is an image or a table of another kind.
MOST_COLUMNS = 256

# What the clock of one array alone is called.
_OWN_CLOCKS = ("{}_time", "{}_time_s", "{}_t", "{}_timestamps", "{}_stamps", "time_{}", "t_{}")

_MOST_NOTES = 60

#: Structs in an array of them; more are a table of another kind.
OBJECTS = 256

#: Fields of a struct that state the unit of the others.
UNIT_FIELDS = ("unit", "units", "Unit", "Units")

#: MATLAB's classes of plain numbers.
NUMBERS = frozenset(
    {"double", "single", "logical"}.union(
        f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64)
    )
)

# What MATLAB's classes that only it can read are to be saved as.
_CURES = {
    "timeseries": "s = struct('time', ts.Time, 'data', ts.Data)",
    "timetable": "s = table2struct(timetable2table(tt), 'ToScalar', true), with its times as "
    "seconds(tt.Time - tt.Time(1))",
    "table": "s = table2struct(t, 'ToScalar', true)",
    "datetime": "s = posixtime(d)",
    "duration": "s = seconds(d)",
}
_NO_SERIES = {
    "cell": "holds cells, and no series of numbers",
    **dict.fromkeys(("char", "string"), "holds text, and no series of numbers"),
    "function_handle": "holds a function, and no series of numbers",
    "complex": "holds complex numbers",
    "sparse": "is a sparse matrix, and no series",
}
# What a library raises where it meets damage.
_FAULTS = (ArithmeticError, LookupError, OSError, RuntimeError, TypeError, ValueError)


@dataclass(frozen=True, slots=True)
class Leaf:
    """An array of numbers in a file of groups, not read yet.

    Attributes
    ----------
    group : tuple of str
        The groups that it is in, from the top.
    name : str
        Its own name.
    channel : str
        Its whole name.
    shape : tuple of int
        One or two lengths; of two none is 1.
    read : callable
        Returns the numbers, in this shape.
    unit : str, optional
        As the file says it.
    """

    group: tuple[str, ...]
    name: str
    channel: str
    shape: tuple[int, ...]
    read: Callable[[], NDArray[Any]]
    unit: str | None = None

    @property
    def rank(self) -> int | None:
        """How surely this is a clock, 0 the most; None if it is none."""
        return clock_rank(self.name) if len(self.shape) == 1 else None


@dataclass(slots=True)
class Findings(Draft):
    """What is found in a file of groups, before any number of it is read."""

    leaves: dict[tuple[tuple[str, ...], str], Leaf] = field(default_factory=dict)
    group_frames: dict[str, str] = field(default_factory=dict)

    def note(self, name: str, words: object) -> None:
        """Keep what the file says of itself, as far as that is short."""
        if len(self.notes) < _MOST_NOTES:
            text = " ".join(str(words).split())
            self.notes[name] = text if len(text) <= 200 else f"{text[:199]}…"

    def add(
        self,
        group: tuple[str, ...],
        name: str,
        shape: tuple[int, ...],
        read: Callable[[], NDArray[Any]],
        *,
        unit: str | None = None,
        group_unit: str | None = None,
        dot: bool = False,
    ) -> None:
        """Take an array; or say why it can be no channel."""
        channel = "/".join(group) + ("." if dot else "/") * bool(group) + name
        lengths, sides = tuple(each for each in shape if each != 1), " by ".join(map(str, shape))
        if not all(shape):
            self.omit(channel, "holds no samples")
        elif len(lengths) > 2:
            self.omit(channel, f"has {len(lengths)} dimensions, {sides}, and is no series")
        elif len(lengths) == 2 and min(lengths) > MOST_COLUMNS:
            self.omit(channel, f"is a matrix or an image, {sides}, and is no series")
        else:
            lengths = lengths or (1,)
            squeezed = lambda: _plain(read()).reshape(lengths)  # noqa: E731
            if len(lengths) == 2 or clock_rank(name) is None:  # it is the unit of what is measured
                unit = unit or group_unit
            self.leaves[group, name] = Leaf(group, name, channel, lengths, squeezed, unit)

    def recording(self) -> Recording:
        """Read the channels that are asked for, each with its clock.

        Raises
        ------
        RecordingError
            There is nothing to read, or it is damaged and the request is strict.
        """
        ranked: dict[tuple[str, ...], list[Leaf]] = {}
        for leaf in self.leaves.values():
            if leaf.rank is not None:
                ranked.setdefault(leaf.group, []).append(leaf)
        request, every = self.request, self.leaves.values()
        asked = [leaf for leaf in every if request.wants(leaf.channel)]
        wanted = {leaf.channel: self._clock_of(leaf, ranked) for leaf in asked}
        needed = {*wanted, *(clock.channel for clock in wanted.values() if clock is not None)}
        chosen = [leaf for leaf in every if leaf.channel in needed]
        for k, leaf in enumerate(chosen):
            self._read(leaf, wanted.get(leaf.channel))
            request.report((k + 1) / len(chosen))
        if not self.channels:
            raise self.error(self._nothing())
        self.clocks = {name: clock for name, clock in self.clocks.items() if clock in self.channels}
        self.frames = {
            channel: frame
            for channel in self.channels
            for name, frame in self.group_frames.items()
            if within(channel, name)
        }
        return self.done()

    def _clock_of(self, leaf: Leaf, ranked: Mapping[tuple[str, ...], list[Leaf]]) -> Leaf | None:
        """The times of an array: of its own name, else of its group, else of those above."""
        for form in _OWN_CLOCKS:
            own = self.leaves.get((leaf.group, form.format(leaf.name)))
            if own is not None and _fits(own, leaf):
                return own
        for depth in range(len(leaf.group), -1, -1):
            fitting = [each for each in ranked.get(leaf.group[:depth], ()) if _fits(each, leaf)]
            if fitting:
                best = min(fitting, key=lambda each: each.rank or 0)
                return None if best is leaf else best
        return None

    def _read(self, leaf: Leaf, clock: Leaf | None) -> None:
        try:
            values = leaf.read()
        except _FAULTS as error:
            self.lose(leaf.channel, f"cannot be read: {first_line(error)}")
            return
        unit = leaf.unit
        if leaf.rank is not None:
            values = _whole_times(values)
            unit = unit or epoch_unit_of(values)
            if unit and not leaf.unit:
                self.note(leaf.channel, f"taken as {unit} since 1970, by its size")
        for name, column in _columns(leaf, values, clock):
            if values.ndim == 2 and not self.request.wants(name):
                continue
            self.channels[name] = column
            if unit:
                self.units[name] = unit
            if clock is not None:
                self.clocks[name] = clock.channel

    def _nothing(self) -> str:
        if self.losses:
            return f"nothing in it can be read: {self.losses[0]}"
        if self.request.channels is not None and self.leaves:
            names = ", ".join([leaf.channel for leaf in self.leaves.values()][:20])
            return f"none of the channels {', '.join(self.request.channels)}; there are {names}"
        why = f" ({self.omissions[0]})" if self.omissions else ""
        return f"there are no arrays of numbers in it{why}; look at what wrote it"


def text_of(value: object) -> str | None:
    """Return the text that an attribute or a field holds, if it is one."""
    while isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "backslashreplace")
    return str(value).strip() if isinstance(value, str) else None


def _fits(clock: Leaf, leaf: Leaf) -> bool:
    return len(clock.shape) == 1 and clock.shape[0] in leaf.shape


def _columns(
    leaf: Leaf, values: NDArray[Any], clock: Leaf | None
) -> Iterable[tuple[str, NDArray[Any]]]:
    """An array of one dimension is a channel; of two, one for each column.

    Samples go along the side that is as long as the clock; without one along the longer, and in a
    square along the first.
    """
    if values.ndim == 1:
        yield leaf.channel, values
        return
    rows, columns = values.shape
    along_second = columns > rows if clock is None else rows != clock.shape[0]
    table = values.T if along_second else values
    for k in range(table.shape[1]):
        yield f"{leaf.channel}[{k}]", table[:, k]


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """In this machine's order of bytes, as numbers that NumPy computes with."""
    values = np.asarray(values)
    if values.dtype.kind == "f" and values.dtype.itemsize > 8:  # long double
        return values.astype(np.float64)
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _whole_times(values: NDArray[Any]) -> NDArray[Any]:
    """Whole times with a sign: differences of unsigned ones wrap around."""
    if values.dtype.kind in "iu":
        fits = values.dtype.itemsize < 8 or values.dtype.kind == "i" or not (values >> 63).any()
        return values.astype(np.int64 if fits else np.float64, copy=False)
    return values


def no_class(name: str) -> str:
    """Say that a class holds no array that can be read, and how to save it."""
    if name in _NO_SERIES:
        return _NO_SERIES[name]
    cure = _CURES.get(name, "a struct of arrays")
    return f"is of MATLAB's class {name}, which only MATLAB can read; save {cure} instead"


def plain_numbers(values: NDArray[Any]) -> NDArray[Any]:
    """Return whole numbers of up to 32 bits as floats, which hold them exactly.

    MATLAB saves whole numbers of class double in as few bytes as hold them, and differences of
    small or unsigned ones would overflow.
    """
    small = values.dtype.kind == "b" or (values.dtype.kind in "iu" and values.dtype.itemsize < 8)
    return values.astype(np.float64) if small else values
