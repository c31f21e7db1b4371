"""What the rows of a fleet say together: repeats, flags, outliers, failures, and what was slow."""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.fleet.rows import AT_DEPTH, at_depth
from palpate.fleet.tasks import Table
from palpate.force_laws import FORCE_LAWS
from palpate.identification.identified import NEGATIVE_STIFFNESS
from palpate.results.view import depth_of
from palpate.validation import Floats, number_in, shown

#: At the working depth, whose repeats are held against their errors.
JUDGED = ("stiffness", "damping")
# Beyond so many σ of χ² repeats do not agree: one group in 700 by chance.
DISAGREES = 3.0
# Robust standard deviations from the median of the logarithms: none of 10⁶ by chance.
OUTLIER = 5.0
_NUMBER = re.compile(r"[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, slots=True)
class Repeats:
    """Contacts with one thing, and whether they agree.

    Attributes
    ----------
    name : str
        What they have in common: a folder, or a place.
    count : int
        How many have numbers.
    total : int
        How many there are.
    mean, error : float
        Weighted by their errors, and its standard error, SI: as wide as their scatter asks for,
        where that is more than they say.
    ratio : float
        √(χ²/ν): their scatter over what their errors say.
    z : float
        Of χ², by Wilson and Hilferty's cube root.
    """

    name: str
    count: int
    total: int
    mean: float
    error: float
    ratio: float
    z: float

    @property
    def agree(self) -> bool:
        """Whether the scatter is what their errors say."""
        return self.z < DISAGREES


def numbers(table: Table, name: str) -> Floats:
    """A column of numbers; NaN where there is none."""
    cells = table.column(name).to_pylist()
    return np.array([math.nan if cell is None else cell for cell in cells], dtype=np.float64)


def _errors(table: Table, name: str) -> Floats:
    """What repeats of a quantity at depth, and what the findings would move where that is known."""
    error, moved = (numbers(table, f"{name}_{kind}") for kind in ("standard_error", "systematic"))
    return np.where(np.isfinite(moved), np.hypot(error, moved), error)


def _each(table: Table, *names: str) -> Iterator[tuple[Any, ...]]:
    """These columns, row by row."""
    return zip(*(table.column(name).to_pylist() for name in names), strict=True)


def names_of(table: Table) -> list[str]:
    """What each row is called: its source, and the number of its contact and of its place."""
    found = []
    for source, index, part in _each(table, "source", "index", "part"):
        words = source or "contact"
        words += "" if index is None else f" [{index}]"
        found.append(words + ("" if part is None else f", place {part}"))
    return found


def repeats_of(table: Table, quantity: str) -> list[Repeats]:
    """Hold contacts with one thing against their own errors: χ² = Σ (v − v̄)²/σ².

    One thing is one place, to the last bit, where places are known; else one folder of recordings.
    Contacts of an array without places have nothing that says that they are repeats.

    Parameters
    ----------
    table : pyarrow.Table
        Of results.
    quantity : str
        One of ``JUDGED``.
    """
    value = numbers(table, f"{quantity}_at_depth")
    error = _errors(table, f"{quantity}_at_depth")
    usable = np.isfinite(value) & np.isfinite(error) & (error > 0.0)
    groups: dict[str, list[int]] = defaultdict(list)
    totals: Counter[str] = Counter()
    for row, name in enumerate(_things(table)):
        totals[name] += 1
        if name and usable[row]:
            groups[name].append(row)
    return [
        _judged(name, totals[name], value[rows], error[rows])
        for name, rows in groups.items()
        if len(rows) > 1
    ]


def _things(table: Table) -> list[str]:
    """What each row is a contact with; empty where nothing says it."""
    found = []
    for source, index, *place in _each(table, "source", "index", *"xyz"):
        known = [f"{axis} {1e3 * v:.9g} mm" for axis, v in zip("xyz", place, strict=True) if v == v]
        folder = "" if index is not None or not source else _folder(source)
        found.append(", ".join(known) or folder)
    return found


def _folder(source: str) -> str:
    folder = str(PurePosixPath(source.replace("\\", "/")).parent)
    return "this folder" if folder == "." else folder


def _judged(name: str, total: int, value: Floats, error: Floats) -> Repeats:
    weight = 1.0 / error**2
    mean = float(weight @ value / weight.sum())
    freedom = len(value) - 1
    chi_square = float(weight @ (value - mean) ** 2)
    spread = 2.0 / (9.0 * freedom)
    z = ((chi_square / freedom) ** (1.0 / 3.0) - (1.0 - spread)) / math.sqrt(spread)
    ratio = math.sqrt(chi_square / freedom)
    spread_error = max(ratio, 1.0) * float(weight.sum() ** -0.5)
    return Repeats(name, len(value), total, mean, spread_error, ratio, z)


def kinds_of(sentences: Iterable[Sequence[str] | None]) -> list[tuple[str, int, str]]:
    """Sentences by what they say but for their numbers: kind, in how many rows, and an example."""
    return _counted(
        kind for row in sentences for kind in {_without_numbers(w): w for w in row or ()}.items()
    )


def reasons_of(table: Table) -> list[tuple[str, int, str]]:
    """Why rows have no numbers: in words without names and numbers, how many, and the first."""
    errors = zip(names_of(table), _each(table, "source", "error"), strict=True)
    return _counted(
        (_without_numbers(error.replace(f"{source}: ", "") if source else error), name)
        for name, (source, error) in errors
        if error is not None
    )


def _counted(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, int, str]]:
    """Kinds, how many there are of each, and its first example; the most frequent first."""
    examples: dict[str, list[str]] = defaultdict(list)
    for kind, example in pairs:
        examples[kind].append(example)
    found = [(kind, len(each), each[0]) for kind, each in examples.items()]
    return sorted(found, key=lambda kind: -kind[1])


def _without_numbers(words: str) -> str:
    return _NUMBER.sub("…", words)


@dataclass(frozen=True, slots=True)
class Outlier:
    """A row that is far from the others.

    Attributes
    ----------
    name, quantity : str
        Of the row, and what is far.
    value, error : float
        SI.
    distance : float
        In robust standard deviations of the logarithms.
    """

    name: str
    quantity: str
    value: float
    error: float
    distance: float


def outliers_of(table: Table) -> list[Outlier]:
    """Rows whose stiffness or damping is beyond five robust deviations, the farthest first.

    The rule of all outliers, the median departure over 0.6745 for σ: of ln v, for materials differ
    by factors, with the row's own error beside the deviation. A value that is not positive is none
    of these.
    """
    found: list[Outlier] = []
    names = names_of(table)
    for quantity in JUDGED:
        value = numbers(table, f"{quantity}_at_depth")
        error = numbers(table, f"{quantity}_at_depth_standard_error")
        usable = np.isfinite(value) & (value > 0.0)
        if np.count_nonzero(usable) < 8:  # of fewer nobody can say which is out
            continue
        with np.errstate(all="ignore"):
            size, own = np.log(value), np.where(np.isfinite(error), error / value, 0.0)
        middle = float(np.median(size[usable]))
        deviation = 1.4826 * float(np.median(np.abs(size[usable] - middle)))
        with np.errstate(all="ignore"):
            distance = np.abs(size - middle) / np.hypot(deviation, own)
        found += [
            Outlier(names[k], quantity, float(value[k]), float(error[k]), float(distance[k]))
            for k in np.flatnonzero(usable & (distance > OUTLIER)).tolist()
        ]
    return sorted(found, key=lambda each: -each.distance)


def slowest(times: Table, most: int = 10) -> list[tuple[str, float, int]]:
    """The sources that took longest: name, seconds, and how many rows."""
    found: dict[str, list[float]] = defaultdict(list)
    for source, seconds in _each(times, "source", "seconds"):
        found[source or "contact"].append(seconds)
    whole = [(name, sum(each), len(each)) for name, each in found.items()]
    return sorted(whole, key=lambda each: -each[1])[:most]


# What a fleet found, over where it was found.

Quantity = Literal["stiffness", "damping", "force", "exponent"]
_OWN = ("x", "y", "z", "index", "part")


@dataclass(frozen=True, slots=True, eq=False)
class Map:
    """Values over one or two coordinates.

    Attributes
    ----------
    quantity, unit : str
        What it is, and its SI unit.
    value, error : numpy.ndarray, shape (k,)
        At each place, and its standard error; NaN where it is not known.
    axes : tuple of str
        Of the coordinates.
    units : tuple of str
        Of these; empty of a number of a contact.
    places : numpy.ndarray, shape (k, 1 or 2)
        Coordinates.
    depth : float or None
        At which all are; None where each is at its own working depth.
    depths : tuple of float
        The least and the largest depth, m.
    rows : int
        Of the results, of which some may have no place.
    shallow : int
        Places without a number because they were not pressed to the depth.
    mistrusted : numpy.ndarray of bool, shape (k,)
        Places whose number is not to be trusted, by verdict, findings or flags; or, but for the
        damping, is less than its error.
    warnings : tuple of str
        What is said of how many of the places, in words, beside notes.
    """

    quantity: str
    unit: str
    value: Floats
    error: Floats
    axes: tuple[str, ...]
    units: tuple[str, ...]
    places: Floats
    depth: float | None
    depths: tuple[float, float]
    rows: int
    shallow: int
    mistrusted: NDArray[np.bool_]
    warnings: tuple[str, ...]

    @property
    def where(self) -> str:
        """At which depth, in words."""
        if self.quantity == "exponent":
            return "of the whole contact"
        if self.depth is not None:
            return f"at {depth_of(self.depth)}"
        low, high = map(depth_of, self.depths)
        span = low if low == high else f"{low} to {high}"
        return f"at the working depth of each contact, {span}"

    @property
    def summary(self) -> str:
        """What the map says, in a line."""
        known = self.value[np.isfinite(self.value)]
        if not known.size:
            nothing = f"no {self.quantity} {self.where} at any of {len(self.value)} places"
            return "; ".join([nothing, *self._beside])
        error = float(np.nanmedian(self.error)) if np.isfinite(self.error).any() else np.nan
        low, high = (rounded(float(v), 3) for v in np.percentile(known, (5.0, 95.0)))
        middle = with_error(float(np.median(known)), error, unit=self.unit)
        words = (
            f"{self.quantity} {self.where}: median {middle} (of one place), 5 to 95 % of "
            f"{known.size} places {low} to {high} {self.unit}".rstrip()
        )
        return "; ".join([words, *self._beside])

    @property
    def _beside(self) -> list[str]:
        """What to know beside the numbers."""
        hidden = len(self.places) - len(np.unique(self.places, axis=0))
        unknown = int(np.isnan(self.value).sum()) - self.shallow
        counts = (
            (unknown, "place has", "places have", "no number"),
            (self.shallow, "place was", "places were", "not pressed so deep"),
            (self.rows - len(self.value), "row has", "rows have", "no place"),
            (hidden if len(self.axes) > 1 else 0, "lies", "lie", "on others"),
        )
        words = [
            f"{count} {one if count == 1 else several} {what}"
            for count, one, several, what in counts
            if count
        ]
        return [*words, *self.warnings]


def map_of(
    results: Table,
    by: Sequence[str],
    *,
    of: Quantity = "stiffness",
    depth: float | None = None,
) -> Map:
    """Return what a fleet found over one or two columns of its results.

    Parameters
    ----------
    results : pyarrow.Table
        As :func:`palpate.fleet.files.read_results` returns it.
    by : sequence of str
        One or two of ``x``, ``y``, ``z``, ``index``, ``part``, or any column of numbers.
    of : str
        ``"stiffness"``, ``"damping"`` or ``"force"`` at depth, or ``"exponent"``.
    depth : float, optional
        One for all, m, > 0; the working depth of each contact unless given.

    Raises
    ------
    InvalidParameterError
        There is no such column, or it holds no number.
    """
    axes = tuple(name.strip() for name in by)
    if not 1 <= len(axes) <= 2 or len(set(axes)) < len(axes):
        raise InvalidParameterError(f"by must be one or two columns, not {shown(', '.join(by))}")
    places = np.stack([_numbers(results, name) for name in axes], axis=1)
    for axis, values in zip(axes, places.T, strict=True):
        if not np.isfinite(values).any():
            known = [name for name in _OWN if np.isfinite(_numbers(results, name)).any()]
            raise InvalidParameterError(
                f"by: no row has a number in {axis}; {', '.join(known) or 'none'} of the places do"
            )
    value, error, depths = _values(results, of, depth)
    short = np.zeros(len(value), dtype=bool)
    if depth is not None and of != "exponent":  # beyond, the law is extrapolated
        short = np.isfinite(value) & ~(numbers(results, "largest_depth") >= depth)
        value, error = np.where(short, np.nan, value), np.where(short, np.nan, error)
    mistrusted = mistrusted_of(results, of)
    if of != "damping":  # which is often next to none, and then known no better than it is large
        mistrusted |= error > np.abs(value)
    there: NDArray[np.bool_] = np.all(np.isfinite(places), axis=1)
    fields = [results.schema.field(name) for name in axes]
    units = tuple((field.metadata or {}).get(b"unit", b"").decode() for field in fields)
    deep = depths[there & np.isfinite(depths)]
    span = (float(deep.min()), float(deep.max())) if deep.size else (np.nan, np.nan)
    unit, warnings = "" if of == "exponent" else AT_DEPTH[of], _warnings(results, there)
    shallow, mistrusted = int(np.count_nonzero(short[there])), mistrusted[there]
    value, error, places, rows = value[there], error[there], places[there], results.num_rows
    at = depth, span
    return Map(
        of, unit, value, error, axes, units, places, *at, rows, shallow, mistrusted, warnings
    )


def mistrusted_of(results: Table, of: str) -> NDArray[np.bool_]:
    """Say of each row whether its number is not to be trusted, by verdict, findings or flags."""
    verdict = f"verdict_{of}" if of in ("stiffness", "damping") else "verdict"
    marks = (f"{of} not", f"{of} at the edge", NEGATIVE_STIFFNESS.message)
    return np.array(
        [
            mark == "do-not-trust"
            or (mark is None and any(words.startswith("do-not-trust") for words in findings or ()))
            or any(words.startswith(marks) for words in flags or ())
            for mark, findings, flags in _each(results, verdict, "findings", "flags")
        ],
        dtype=bool,
    )


def _warnings(results: Table, there: NDArray[np.bool_]) -> tuple[str, ...]:
    """What the checks say of how many places, the worst and the most frequent first."""
    inside = results.filter(there)
    kinds: Counter[tuple[str, ...]] = Counter()
    for findings in inside.column("findings").to_pylist():
        kinds.update({tuple(words.split(": ")[:2]) for words in findings or ()})
    ordered = sorted(kinds.items(), key=lambda kind: (kind[0][0], -kind[1], kind[0][1]))
    words = [
        f"{severity}, {check}: {count} of the places"
        for (severity, check), count in ordered
        if severity != "note"
    ]
    unchecked = "none" in inside.column("checked").to_pylist()
    return (*words, *(["the data were not checked"] if unchecked else []))


def _numbers(results: Table, name: str) -> Floats:
    if name not in results.schema.names:
        raise InvalidParameterError(
            f"by: there is no column {name!r}; there are {', '.join(results.schema.names)}"
        )
    try:
        return numbers(results, name)
    except (TypeError, ValueError):
        raise InvalidParameterError(f"by: the column {name} holds no numbers") from None


def _values(results: Table, of: str, depth: float | None) -> tuple[Floats, Floats, Floats]:
    depths = numbers(results, "depth")
    if of == "exponent":
        if "exponent" not in results.schema.names:
            raise InvalidParameterError("of: this law has no exponent; draw its stiffness")
        return numbers(results, of), numbers(results, f"{of}_standard_error"), depths
    name = f"{of}_at_depth"
    if depth is None:
        return numbers(results, name), _errors(results, name), depths
    number_in("depth", depth, 0.0, 1e6, open_low=True)
    law = FORCE_LAWS[(results.schema.metadata or {})[b"law"].decode()]
    found = np.full((results.num_rows, 2), np.nan)
    for k, (matrix, *row) in enumerate(_each(results, "covariance", *law.names())):
        if matrix is not None and np.isfinite(row).all():
            there = at_depth(law(*row), np.reshape(matrix, (len(row), len(row))), depth)
            found[k] = there[name], there[f"{name}_standard_error"]
    return found[:, 0], found[:, 1], depths
