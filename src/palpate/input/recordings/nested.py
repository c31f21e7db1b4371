"""Arrays in groups: their channels and their clocks."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np

from palpate.input.recordings.opening import FAULTS, Draft, first_line, within
from palpate.input.recordings.recording import Recording
from palpate.input.recordings.times import clock_rank, detect_epoch_unit
from palpate.validation import Values, frozen

#: An array with more columns than this is an image or another kind of table.
MOST_COLUMNS = 256

# Most arms of a robot, or samples within a frame of a camera, in an array of three dimensions.
_MOST_PARTS = 8
# Most numbers of each: a pose with a wrench, or the joints of a hand.
_MOST_NUMBERS = 32

# Names of the clock of a single array.
_OWN_CLOCKS = ("{}_time", "{}_time_s", "{}_t", "{}_timestamps", "{}_stamps", "time_{}", "t_{}")

#: Largest number of structs in an array; more are another kind of table.
OBJECTS = 256

#: Fields of a struct that state the unit of its other fields.
UNIT_FIELDS = ("unit", "units", "Unit", "Units")

#: MATLAB's classes of plain numbers.
NUMBERS = frozenset(
    {"double", "single", "logical"}.union(
        f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64)
    )
)

# How to save the MATLAB classes that only MATLAB can read.
_CURES = {
    "timeseries": "s = struct('time', ts.Time, 'data', ts.Data)",
    "timetable": "s = table2struct(timetable2table(tt), 'ToScalar', true), with the times as "
    "seconds(tt.Time - tt.Time(1))",
    "table": "s = table2struct(t, 'ToScalar', true)",
    "datetime": "s = posixtime(d)",
    "duration": "s = seconds(d)",
}
_NO_SERIES = {
    "cell": "holds cells, not a time series",
    **dict.fromkeys(("char", "string"), "holds text, not a time series"),
    "function_handle": "holds a function, not a time series",
    "complex": "holds complex numbers",
    "sparse": "is a sparse matrix, not a time series",
}


@frozen
class Leaf:
    """An array of numbers in a file of groups, not read yet.

    Attributes
    ----------
    group : str
        The begin of its full name: its groups, from the outermost, each with a separator.
    name : str
        The rest of its full name.
    shape : tuple of int
        One or two lengths; if two, neither is 1.
    read : callable
        Returns the numbers, in this shape.
    unit : str, optional
        Its unit, if the file states it.
    """

    group: str
    name: str
    shape: tuple[int, ...]
    read: Callable[[], Values]
    unit: str | None = None

    @property
    def channel(self) -> str:
        """Its full name."""
        return self.group + self.name

    @property
    def in_clocks(self) -> bool:
        """Whether it is in a group of clocks, such as ``timestamps``, and may have any name."""
        groups = (part for part in self.group.split("/") if len(part) > 2)
        return len(self.shape) == 1 and any(clock_rank(part) is not None for part in groups)

    @property
    def rank(self) -> int | None:
        """How likely this is a clock, 0 the most likely; None if it is not."""
        return clock_rank(self.name) if len(self.shape) == 1 else None


@dataclass(slots=True)
class Arrays(Draft):
    """The arrays and notes of a file of groups, listed before any array is read."""

    leaves: dict[str, Leaf] = field(default_factory=dict)
    group_frames: dict[str, str] = field(default_factory=dict)
    _namesakes: dict[str, list[Leaf]] = field(default_factory=dict)

    def add(
        self,
        group: str,
        name: str,
        shape: tuple[int, ...],
        read: Callable[[], Values],
        *,
        unit: str | None = None,
        group_unit: str | None = None,
    ) -> None:
        """Add an array, or report why it cannot be a channel."""
        channel = group + name
        self.check_names(len(self.leaves))
        lengths = tuple(length for length in shape if length != 1)
        sides = " by ".join(map(str, shape))
        if not all(shape):
            self.omit(channel, "holds no samples")
        elif _is_of_parts(lengths):
            whole = cache(partial(self._read_parts, read, lengths))
            for k in range(lengths[1]):
                part = lambda k=k: whole()[:, k]  # noqa: E731
                self.add(group, f"{name}[{k}]", (lengths[0], lengths[2]), part, unit=unit)
        elif len(lengths) > 2:
            self.omit(channel, f"has {len(lengths)} dimensions, {sides}: not a time series")
        elif len(lengths) == 2 and min(lengths) > MOST_COLUMNS:
            self.omit(channel, f"is a matrix or an image, {sides}: not a time series")
        else:
            lengths = lengths or (1,)
            squeezed = lambda: _plain(read()).reshape(lengths)  # noqa: E731
            if len(lengths) == 2 or clock_rank(name) is None:  # a clock has no such unit
                unit = unit or group_unit
            self.leaves[channel] = Leaf(group, name, lengths, squeezed, unit)

    def recording(self) -> Recording:
        """Read the requested channels, each with its clock.

        Raises
        ------
        RecordingError
            There is nothing to read, or the file is damaged and the request is strict.
        """
        ranked: dict[str, list[Leaf]] = {}
        for leaf in self.leaves.values():
            if leaf.rank is not None:
                ranked.setdefault(leaf.group, []).append(leaf)
        outside = {leaf.name for leaf in self.leaves.values() if not leaf.in_clocks}
        for leaf in self.leaves.values():
            if leaf.in_clocks and leaf.rank is None and leaf.name in outside:
                self._namesakes.setdefault(leaf.name, []).append(leaf)
        clocks = {
            name: self._find_clock(leaf, ranked)
            for name, leaf in self.leaves.items()
            if self.request.wants(name)
        }
        needed = {*clocks, *(clock.channel for clock in clocks.values() if clock is not None)}
        for k, name in enumerate(filter(needed.__contains__, self.leaves)):
            self._read(self.leaves[name], clocks.get(name))
            self.request.report((k + 1) / len(needed))
        if not self.channels:
            raise self.error(self._nothing())
        self.clocks = {name: clock for name, clock in self.clocks.items() if clock in self.channels}
        for group, frame in self.group_frames.items():
            self.frames |= {name: frame for name in self.channels if within(name, group)}
        return self.done()

    def _find_clock(self, leaf: Leaf, ranked: Mapping[str, list[Leaf]]) -> Leaf | None:
        """Return the clock named after an array, else the one in its group or in a group above.

        A clock in a group of clocks has the name of its array: ``timestamps/pose`` of ``arm/pose``.
        """
        namesakes = self._namesakes.get(leaf.name, [])
        if leaf in namesakes:
            return None
        for namesake in namesakes:
            if _fits(namesake, leaf):
                return namesake
        for form in _OWN_CLOCKS:
            clock = self.leaves.get(leaf.group + form.format(leaf.name))
            if clock is not None and _fits(clock, leaf):
                return clock
        for group in _enclosing_groups(leaf.group):
            fitting = [clock for clock in ranked.get(group, ()) if _fits(clock, leaf)]
            if fitting:
                best = min(fitting, key=lambda clock: clock.rank or 0)
                return None if best is leaf else best
        return None

    def _read(self, leaf: Leaf, clock: Leaf | None) -> None:
        # Numbers of up to 32 bits may become floats of 64.
        self.request.reserve(8 * math.prod(leaf.shape))
        try:
            values = leaf.read()
        except FAULTS as error:
            self.lose(leaf.channel, f"cannot be read: {first_line(error)}")
            return
        unit = leaf.unit
        if leaf.rank is not None or leaf in self._namesakes.get(leaf.name, []):
            values = _whole_times(values)
            unit = unit or detect_epoch_unit(values)
            if unit and not leaf.unit:
                self.note(leaf.channel, f"{unit} since 1970 (assumed from its values)")
        for name, column in _columns(leaf, values, clock):
            if values.ndim == 2 and not self.request.wants(name):
                continue
            self.channels[name] = column
            if unit:
                self.units[name] = unit
            if clock is not None:
                self.clocks[name] = clock.channel

    def _read_parts(self, read: Callable[[], Values], lengths: tuple[int, ...]) -> Values:
        self.request.reserve(8 * math.prod(lengths))
        return _plain(read()).reshape(lengths)

    def _nothing(self) -> str:
        if self.losses:
            return f"no array can be read: {self.losses[0]}"
        if self.request.channels is not None and self.leaves:
            names = ", ".join([*self.leaves][:20])
            return f"no channel {', '.join(self.request.channels)}; available: {names}"
        why = f" ({self.omissions[0]})" if self.omissions else ""
        return f"the file holds no arrays of numbers{why}; check the program that wrote it"


def read_text(value: object) -> str | None:
    """Return the text of an attribute or a field; None if it is not text."""
    while isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "backslashreplace")
    return str(value).strip() if isinstance(value, str) else None


def _enclosing_groups(group: str) -> Iterator[str]:
    """A group, the groups above it, and the file, which is empty text."""
    yield group
    while group:
        group = group[: group.rfind("/", 0, -1) + 1]
        yield group


def _is_of_parts(lengths: tuple[int, ...]) -> bool:
    """Whether an array has a few vectors for each sample; a square of them is a rotation."""
    if len(lengths) != 3:
        return False
    samples, parts, numbers = lengths
    return parts <= _MOST_PARTS and parts != numbers <= _MOST_NUMBERS < samples


def _fits(clock: Leaf, leaf: Leaf) -> bool:
    return len(clock.shape) == 1 and clock.shape[0] in leaf.shape


def _columns(leaf: Leaf, values: Values, clock: Leaf | None) -> Iterable[tuple[str, Values]]:
    """Yield the channels of an array: one, or one per column if it has two dimensions.

    Samples run along the dimension that is as long as the clock; without a clock, along the longer
    dimension; in a square array, along the first.
    """
    if values.ndim == 1:
        yield leaf.channel, values
        return
    rows, columns = values.shape
    along_second = columns > rows if clock is None else rows != clock.shape[0]
    table = values.T if along_second else values
    for k in range(table.shape[1]):
        yield f"{leaf.channel}[{k}]", table[:, k]


def _plain(values: Values) -> Values:
    """The values in native byte order, as numbers that NumPy computes with."""
    values = np.asarray(values)
    if values.dtype.kind == "f" and values.dtype.itemsize > 8:  # long double
        return values.astype(np.float64)
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _whole_times(values: Values) -> Values:
    """Integer times with a sign: differences of unsigned ones wrap around."""
    if values.dtype.kind in "iu":
        fits = values.dtype.itemsize < 8 or values.dtype.kind == "i" or not (values >> 63).any()
        return values.astype(np.int64 if fits else np.float64, copy=False)
    return values


def no_class(name: str) -> str:
    """Explain why a MATLAB class cannot be read, and how to save it instead."""
    if name in _NO_SERIES:
        return _NO_SERIES[name]
    cure = _CURES.get(name, "it as a struct of arrays")
    return f"has the class {name}, which only MATLAB can read; save {cure} instead"


def plain_numbers(values: Values) -> Values:
    """Return integers of up to 32 bits as floats, which represent them exactly.

    MATLAB saves integers of class double in as few bytes as possible, and differences of small or
    unsigned ones would overflow.
    """
    small = values.dtype.kind == "b" or (values.dtype.kind in "iu" and values.dtype.itemsize < 8)
    return values.astype(np.float64) if small else values
