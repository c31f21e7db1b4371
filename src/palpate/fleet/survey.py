"""What the rows of a fleet say together: repeats, flags, outliers, failures, and what was slow."""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

import numpy as np

from palpate.validation import Floats

if TYPE_CHECKING:
    import pyarrow as pa

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


def numbers(table: "pa.Table", name: str) -> Floats:
    """A column of numbers; NaN where there is none."""
    cells = table.column(name).to_pylist()
    return np.array([math.nan if cell is None else cell for cell in cells], dtype=np.float64)


def names_of(table: "pa.Table") -> list[str]:
    """What each row is called: its source, and the number of its contact and of its place."""
    columns = (table.column(name).to_pylist() for name in ("source", "index", "part"))
    found = []
    for source, index, part in zip(*columns, strict=True):
        words = source or "contact"
        words += "" if index is None else f" [{index}]"
        found.append(words + ("" if part is None else f", place {part}"))
    return found


def repeats_of(table: "pa.Table", quantity: str) -> list[Repeats]:
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
    error = numbers(table, f"{quantity}_at_depth_standard_error")
    moved = numbers(table, f"{quantity}_at_depth_systematic")
    error = np.where(np.isfinite(moved), np.hypot(error, moved), error)
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


def _things(table: "pa.Table") -> list[str]:
    """What each row is a contact with; empty where nothing says it."""
    places = np.stack([numbers(table, axis) for axis in "xyz"], axis=1)
    found = []
    for source, index, place in zip(
        table.column("source").to_pylist(),
        table.column("index").to_pylist(),
        places.tolist(),
        strict=True,
    ):
        known = [f"{axis} {1e3 * v:.9g} mm" for axis, v in zip("xyz", place, strict=True) if v == v]
        if known:
            found.append(", ".join(known))
        else:
            found.append("" if index is not None or not source else _folder(source))
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
    counts: Counter[str] = Counter()
    first: dict[str, str] = {}
    for row in sentences:
        for kind in {_kind(words): words for words in row or ()}.items():
            counts[kind[0]] += 1
            first.setdefault(*kind)
    return [(kind, count, first[kind]) for kind, count in counts.most_common()]


def _kind(words: str) -> str:
    return _NUMBER.sub("…", words)


def reasons_of(table: "pa.Table") -> list[tuple[str, int, str]]:
    """Why rows have no numbers: in words without names and numbers, how many, and the first."""
    counts: Counter[str] = Counter()
    first: dict[str, str] = {}
    columns = (table.column(name).to_pylist() for name in ("source", "error"))
    for name, (source, error) in zip(names_of(table), zip(*columns, strict=True), strict=True):
        if error is not None:
            kind = _kind(error.replace(f"{source}: ", "")) if source else _kind(error)
            counts[kind] += 1
            first.setdefault(kind, name)
    return [(kind, count, first[kind]) for kind, count in counts.most_common()]


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


def outliers_of(table: "pa.Table") -> list[Outlier]:
    """Rows whose stiffness or damping is beyond five robust deviations, the farthest first.

    Of ln v, for materials differ by factors, with the row's own error beside the deviation; a value
    that is not positive is none of these.
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


def slowest(times: "pa.Table", most: int = 10) -> list[tuple[str, float, int]]:
    """The sources that took longest: name, seconds, and how many rows."""
    total: dict[str, float] = defaultdict(float)
    rows: Counter[str] = Counter()
    for source, seconds in zip(
        times.column("source").to_pylist(), times.column("seconds").to_pylist(), strict=True
    ):
        total[source or "contact"] += seconds
        rows[source or "contact"] += 1
    order = sorted(total, key=lambda name: -total[name])
    return [(name, total[name], rows[name]) for name in order[:most]]


def verdicts_of(table: "pa.Table") -> Mapping[str, int]:
    """How many rows have each verdict; empty without a full diagnosis."""
    cells = table.column("verdict").to_pylist()
    return Counter(cell for cell in cells if cell is not None)
