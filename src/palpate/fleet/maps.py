"""Statistics over the rows of a fleet: verdicts, repeats, outliers, failures, times, and maps."""

import json
import math
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from palpate.digits import format_quantity, rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.findings import Check, spoken
from palpate.fleet.rows import AT_DEPTH, values_for_depth
from palpate.fleet.tasks import Table
from palpate.force_laws import FORCE_LAWS, law_from
from palpate.validation import Floats, Mask, frozen, number_in, shown

#: Quantities at working depth whose repeats are compared with their errors.
JUDGED = ("stiffness", "damping")
# Repeats disagree if χ² departs by more than this many σ: by chance one group in 700 does.
DISAGREES = 3.0
# Distance of an outlier from the median of the logarithms, in robust standard deviations: by chance
# fewer than one in 10⁶.
OUTLIER = 5.0
#: A value of the columns ``flags`` and ``findings``.
Cell: TypeAlias = Mapping[str, str | None]
_NUMBER = re.compile(r"[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?")


@frozen
class Repeats:
    """Repeated contacts with one object, and whether they agree.

    Attributes
    ----------
    name : str
        Their common folder or place.
    count : int
        Number of contacts with values.
    total : int
        Number of contacts.
    mean, error : float
        Weighted mean and its standard error, SI; the error is scaled by ``ratio`` if that exceeds
        1.
    ratio : float
        √(χ²/ν): scatter relative to the standard errors.
    z : float
        Standard score of χ² from the Wilson–Hilferty transformation.
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
        """Whether the scatter is consistent with the standard errors."""
        return self.z < DISAGREES


def numbers(table: Table, name: str) -> Floats:
    """Return a column as numbers; NaN for null."""
    cells = table.column(name).to_pylist()
    return np.array([math.nan if cell is None else cell for cell in cells], dtype=np.float64)


def whole_errors(table: Table, name: str) -> Floats:
    """Return the statistical error of a quantity, combined with the systematic one if known."""
    error, systematic = (
        numbers(table, f"{name}_{kind}") for kind in ("standard_error", "systematic")
    )
    return np.where(np.isfinite(systematic), np.hypot(error, systematic), error)


def _column_rows(table: Table, *names: str) -> Iterator[tuple[Any, ...]]:
    """Return an iterator over rows of these columns."""
    return zip(*(table.column(name).to_pylist() for name in names), strict=True)


def names_of(table: Table) -> list[str]:
    """Return a name per row: its source, and the number of its contact and of its place."""
    names = []
    for source, index, part in _column_rows(table, "source", "index", "part"):
        name = source or "contact"
        name += "" if index is None else f" [{index}]"
        names.append(name + ("" if part is None else f", place {part}"))
    return names


#: From the most to the least severe; rows without a verdict have one of the last two.
VERDICTS = ["failed", "do-not-trust", "with-care", "flagged", "trust", "no-finding", "not-checked"]
#: The reason for a missing verdict, by the requested checks.
NO_VERDICT = {
    "none": "palpate checked neither the data nor the fits; add --diagnosis input or full",
    "input": "palpate checked the data but not the fits; for verdicts add --diagnosis full",
}


class RowVerdict(NamedTuple):
    """Mark of a quantity in a row, and the error, finding or flag that is its reason."""

    mark: str
    reason: str = ""
    #: Rows with the same reason have one kind: the id of a check, or an error without its numbers.
    kind: str = ""


def verdicts_of(table: Table, of: str) -> list[RowVerdict]:
    """Return the mark of a quantity in each row and its reason.

    A row without a mark has that of its findings or flags instead.
    """
    verdicts = []
    columns = "source", "error", f"verdict_{of}", "checked", "findings", "flags"
    for source, error, mark, checked, findings, flags in _column_rows(table, *columns):
        reasons = [
            RowVerdict(mark_by(finding, of), describe_finding(finding), finding["check"] or "")
            for finding in problems_of(findings, of)
        ]
        untrusted = _untrusted_by(of)
        for flag in flags or ():
            severity = "do-not-trust" if flag["check"] in untrusted else "flagged"
            reasons.append(RowVerdict(severity, describe_flag(flag), flag["check"]))
        if error is not None:
            text = error.removeprefix(f"{source}: ")
            reasons = [RowVerdict("failed", text, _mask_numbers(text))]
        default = RowVerdict("not-checked" if checked == "none" else "no-finding")
        worst = min(reasons, key=_severity, default=default)
        verdicts.append(worst._replace(mark=mark or worst.mark))
    return verdicts


def mark_by(finding: Cell, of: str) -> str:
    """Return the mark that a finding alone gives a quantity: the damping, or what needs K′."""
    return finding["damping" if of == "damping" else "stiffness"] or "trust"


def problems_of(findings: Sequence[Cell] | None, of: str) -> list[Cell]:
    """Return the findings that lower the mark of a quantity."""
    return [finding for finding in findings or () if mark_by(finding, of) != "trust"]


def describe_finding(finding: Cell) -> str:
    """Return the check and the message of a finding."""
    return f"{finding['check']}: {finding['message']}"


def describe_flag(flag: Cell) -> str:
    """Return the message of a flag, and what to do."""
    return f"{flag['message']} ({flag['remedy']})" if flag["remedy"] else f"{flag['message']}"


def _severity(verdict: Sequence[str]) -> int:
    return VERDICTS.index(verdict[0])


def reasons_of_verdicts(
    names: Sequence[str],
    verdicts: Mapping[str, Sequence[RowVerdict]],
) -> list[tuple[str, str]]:
    """Return a mark and a line per reason against trust, the most severe and frequent first.

    ``verdicts`` has the marks of each quantity; a reason that concerns several is there once.
    """
    groups: dict[tuple[str, str, str], list[str]] = defaultdict(list)
    for name, *row in zip(names, *verdicts.values(), strict=True):
        concerned: dict[RowVerdict, list[str]] = defaultdict(list)
        for of, verdict in zip(verdicts, row, strict=True):
            concerned[verdict].append(quantity_name(of))
        for (mark, reason, kind), quantities in concerned.items():
            if reason and mark in VERDICTS[:4]:
                whose = "" if mark in ("failed", "flagged") else f"{', '.join(quantities)} "
                what = f"{whose}{spoken(mark)}"
                groups[mark, what, kind].append(f"{what}: {name}: {reason}")
    ordered = sorted(groups.items(), key=lambda group: (_severity(group[0]), -len(group[1])))
    return [
        (mark, lines[0] + f" (and {len(lines) - 1} more)" * (len(lines) > 1))
        for (mark, _, _), lines in ordered
    ]


def list_quantities(table: Table) -> tuple[str, ...]:
    """Return the quantities of the rows: the modulus, if a tip was stated, and those judged."""
    return (*("modulus" for name in table.schema.names if name == "modulus"), *JUDGED)


def quantity_unit(quantity: str) -> str:
    """Return the unit of a quantity."""
    return "Pa" if quantity == "modulus" else AT_DEPTH.get(quantity, "")


def quantity_name(quantity: str) -> str:
    """Return the name of a quantity, as text."""
    return "Young's modulus" if quantity == "modulus" else quantity


def format_values(table: Table, quantity: str) -> list[str]:
    """Return a quantity at working depth for each row, with its total standard error and unit."""
    return [
        with_error(value, error, unit=quantity_unit(quantity)) if math.isfinite(value) else "–"
        for value, error in zip(
            numbers(table, quantity),
            whole_errors(table, quantity),
            strict=True,
        )
    ]


def repeats_of(table: Table, quantity: str) -> list[Repeats]:
    """Compare the scatter of repeated contacts with their errors: χ² = Σ (v − v̄)²/σ².

    Repeats are contacts at exactly the same place, or, if there are no places, recordings in the
    same folder. Contacts of an array without places are not repeats.

    Parameters
    ----------
    table : pyarrow.Table
        Rows of results.
    quantity : str
        ``"modulus"``, ``"stiffness"`` or ``"damping"``.
    """
    value = numbers(table, quantity)
    error = whole_errors(table, quantity)
    usable = np.isfinite(value) & np.isfinite(error) & (error > 0.0)
    groups: dict[str, list[int]] = defaultdict(list)
    totals: Counter[str] = Counter()
    for row, name in enumerate(_objects(table)):
        totals[name] += 1
        if name and usable[row]:
            groups[name].append(row)
    return [
        _compare_repeats(name, totals[name], value[rows], error[rows])
        for name, rows in groups.items()
        if len(rows) > 1
    ]


def _objects(table: Table) -> list[str]:
    """Return the place or folder that identifies the object of each row; empty if unknown."""
    objects = []
    for source, index, *place in _column_rows(table, "source", "index", *"xyz"):
        known = [f"{axis} {1e3 * v:.9g} mm" for axis, v in zip("xyz", place, strict=True) if v == v]
        folder = "" if index is not None or not source else _folder(source)
        objects.append(", ".join(known) or folder)
    return objects


def _folder(source: str) -> str:
    folder = str(PurePosixPath(source.replace("\\", "/")).parent)
    return "this folder" if folder == "." else folder


def _compare_repeats(name: str, total: int, value: Floats, error: Floats) -> Repeats:
    weight = 1.0 / error**2
    mean = float(weight @ value / weight.sum())
    freedom = len(value) - 1
    chi_square = float(weight @ (value - mean) ** 2)
    spread = 2.0 / (9.0 * freedom)
    z = ((chi_square / freedom) ** (1.0 / 3.0) - (1.0 - spread)) / math.sqrt(spread)
    ratio = math.sqrt(chi_square / freedom)
    spread_error = max(ratio, 1.0) * float(weight.sum() ** -0.5)
    return Repeats(name, len(value), total, mean, spread_error, ratio, z)


# A lag of the rig: to first order a force that is early by τ adds K′τ to the damping of each file.

_LEAST_FILES = 4
_LEAST_SPAN = 2.0  # of the stiffness: for one material the ratio may as well be its damping
_LEAST_ERROR = 0.02  # of a lag, which a few files may agree on by chance
_SAME = 0.1  # standard deviation of the ratios, relative to their median
_ONE_FREQUENCY = 1.5  # span below which a constant loss tangent looks like a constant delay


@frozen
class RigLag:
    """The ratio of damping to stiffness, if it is the same for all files of a rig.

    Attributes
    ----------
    time, spread : float
        Median of B′/K′, and its standard deviation over the files, s.
    files : int
        Number of files.
    span : float
        Largest stiffness over the smallest.
    frequencies : float
        Largest frequency over the smallest; NaN if unknown.
    """

    time: float
    spread: float
    files: int
    span: float
    frequencies: float

    def __str__(self) -> str:
        time = with_error(1e3 * abs(self.time), 1e3 * self.spread, unit="ms")
        way = "early" if self.time > 0.0 else "late"
        text = (
            f"damping over stiffness is the same in {self.files} files whose stiffness spans a "
            f"factor of {rounded(self.span, 2)}, {time}: the force is probably {way} by as much"
        )
        if not self.frequencies > _ONE_FREQUENCY:
            text += ", or all materials have one loss tangent"
        error = max(self.spread, _LEAST_ERROR * abs(self.time))
        option = f"--delay {rounded(-1e3 * self.time, 3)}ms+-{rounded(1e3 * error, 2)}ms"
        return f"{text}; touch a steel spring (palpate skew), or try {option}"


def rig_lag_of(table: Table) -> RigLag | None:
    """Return the lag that a fleet's files suggest, with one contact per file; None if they do not.

    It needs at least four files with a positive stiffness, spanning a factor of two, whose B′/K′
    agree within 10 % (standard deviation over median). Files whose damping is less accurate than
    that are excluded.
    """
    names = np.array([source or "" for source in table.column("source").to_pylist()])
    stiffness, damping = (numbers(table, name) for name in JUDGED)
    error = numbers(table, "damping_standard_error")
    with np.errstate(invalid="ignore"):
        known = (stiffness > 0.0) & (names != "") & (error <= _SAME * np.abs(damping))
    alone = [index is None and part is None for index, part in _column_rows(table, "index", "part")]
    known &= np.array(alone, dtype=bool)
    if len(set(names[known].tolist())) < _LEAST_FILES:
        return None
    stiffness = stiffness[known]
    frequency = numbers(table, "frequency")[known]
    ratio = damping[known] / stiffness
    time = float(np.median(ratio))
    spread = float(np.std(ratio, ddof=1))
    span = float(stiffness.max() / stiffness.min())
    if not (spread <= _SAME * abs(time) and span >= _LEAST_SPAN):
        return None
    frequencies = float(frequency.max() / frequency.min())
    return RigLag(time, spread, len(ratio), span, frequencies)


def kinds_of(
    rows: Iterable[Sequence[Cell] | None],
    describe: Callable[[Cell], str],
) -> list[tuple[str, int, str]]:
    """Group findings or flags by their check: text without numbers, number of rows, an example."""
    kinds = _count_kinds(
        (check, describe(finding))
        for row in rows
        for check, finding in {each["check"] or "": each for each in reversed(row or ())}.items()
    )
    return [(_mask_numbers(example), count, example) for _, count, example in kinds]


def reasons_of(table: Table) -> list[tuple[str, int, str]]:
    """Group errors that differ only in names and numbers: kind, number of rows, first row."""
    errors = zip(names_of(table), _column_rows(table, "source", "error"), strict=True)
    return _count_kinds(
        (_mask_numbers(error.replace(f"{source}: ", "") if source else error), name)
        for name, (source, error) in errors
        if error is not None
    )


def _count_kinds(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, int, str]]:
    """Return kinds with their count and first example, the most frequent first."""
    examples: dict[str, list[str]] = defaultdict(list)
    for kind, example in pairs:
        examples[kind].append(example)
    kinds = [(kind, len(each), each[0]) for kind, each in examples.items()]
    return sorted(kinds, key=lambda kind: -kind[1])


def _mask_numbers(text: str) -> str:
    return _NUMBER.sub("…", text)


@frozen
class Outlier:
    """A row with a value far from the others.

    Attributes
    ----------
    name, quantity : str
        The row's name, and the quantity.
    value, error : float
        Value and standard error, SI.
    distance : float
        Distance from the median, in robust standard deviations of the logarithms.
    """

    name: str
    quantity: str
    value: float
    error: float
    distance: float


def outliers_of(table: Table) -> list[Outlier]:
    """Return rows whose stiffness or damping is beyond five robust deviations, farthest first.

    The deviation σ refers to ln v, because materials differ by factors: it is the median absolute
    deviation over 0.6745, and the row's own error is added in quadrature. Values that are not
    positive are ignored.
    """
    outliers = []
    names = names_of(table)
    for quantity in list_quantities(table):
        value = numbers(table, quantity)
        error = numbers(table, f"{quantity}_standard_error")
        usable = np.isfinite(value) & (value > 0.0)
        if np.count_nonzero(usable) < 8:  # fewer do not show which is the outlier
            continue
        with np.errstate(all="ignore"):
            size = np.log(value)
            relative_error = np.where(np.isfinite(error), error / value, 0.0)
        middle = float(np.median(size[usable]))
        deviation = 1.4826 * float(np.median(np.abs(size[usable] - middle)))
        with np.errstate(all="ignore"):
            distance = np.abs(size - middle) / np.hypot(deviation, relative_error)
        outliers += [
            Outlier(names[k], quantity, float(value[k]), float(error[k]), float(distance[k]))
            for k in np.flatnonzero(usable & (distance > OUTLIER)).tolist()
        ]
    return sorted(outliers, key=lambda each: -each.distance)


def slowest(times: Table, most: int = 10) -> list[tuple[str, float, int]]:
    """Return the sources that took longest: name, time in s, and number of rows."""
    seconds_of: dict[str, list[float]] = defaultdict(list)
    for source, seconds in _column_rows(times, "source", "seconds"):
        seconds_of[source or "contact"].append(seconds)
    whole = [(name, sum(each), len(each)) for name, each in seconds_of.items()]
    return sorted(whole, key=lambda each: -each[1])[:most]


# Results over position.

MapQuantity: TypeAlias = Literal["modulus", "stiffness", "damping", "force", "exponent"]
_OF_THE_CONTACT = "modulus", "exponent"  # of no single depth
_COORDINATES = ("x", "y", "z", "index", "part")


@frozen(eq=False)
class Map:
    """Values over one or two coordinates.

    Attributes
    ----------
    quantity, unit : str
        Name of the quantity, and its SI unit.
    value, error : numpy.ndarray, shape (k,)
        Value and standard error at each place; NaN if unknown.
    axes : tuple of str
        Names of the coordinates.
    units : tuple of str
        Units of the coordinates; empty for ``index`` and ``part``.
    places : numpy.ndarray, shape (k, 1 or 2)
        Coordinates, in these units.
    depth : float or None
        Common depth of all values, m; None if each is at its own working depth.
    depths : tuple of float
        Smallest and largest working depth, m.
    frequencies : str
        Frequencies of the motions, as text, if the values depend on them; else empty.
    rows : int
        Number of rows, including those without a place.
    shallow : int
        Number of places without a value because the probe did not reach the depth.
    mistrusted : numpy.ndarray of bool, shape (k,)
        Places whose value the verdict, findings or flags do not trust, or (except damping) whose
        value is smaller than its error.
    warnings : tuple of str
        Findings that lower the mark of the quantity, with their numbers of places.
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
    frequencies: str
    rows: int
    shallow: int
    mistrusted: Mask
    warnings: tuple[str, ...]

    @property
    def name(self) -> str:
        """The name of the quantity, as text."""
        return quantity_name(self.quantity)

    @property
    def where(self) -> str:
        """The depth of the values, as text."""
        if self.quantity in _OF_THE_CONTACT:
            return "over the whole contact"
        if self.depth is not None:
            return f"at {format_quantity(self.depth, 'm', 4)}{self.frequencies}"
        low, high = (format_quantity(depth, "m", 4) for depth in self.depths)
        span = low if low == high else f"{low} to {high}"
        return f"at the working depth of each contact, {span}{self.frequencies}"

    @property
    def title(self) -> str:
        """The quantity, where it holds, and its median with the error of one place."""
        known = self.value[np.isfinite(self.value)]
        if not known.size:
            return f"none of {len(self.value)} places has a {self.name} {self.where}"
        error = float(np.nanmedian(self.error)) if np.isfinite(self.error).any() else np.nan
        middle = with_error(float(np.median(known)), error, unit=self.unit)
        return f"{self.name} {self.where}: median {middle}"

    @property
    def lines(self) -> list[str]:
        """Median and range of the values, and counts of places to treat with care."""
        known = self.value[np.isfinite(self.value)]
        if not known.size:
            return [self.title, *self._remarks]
        low, high = (rounded(float(v), 3) for v in np.percentile(known, (5.0, 95.0)))
        words = (
            f"{self.title} (error of one place), 5th to 95th "
            f"percentile of {known.size} places {low} to {high} {self.unit}".rstrip()
        )
        return [words, *self._remarks]

    @property
    def summary(self) -> str:
        """The lines joined into one."""
        return "; ".join(self.lines)

    @property
    def _remarks(self) -> list[str]:
        """Counts of places without a value, and warnings."""
        hidden = len(self.places) - len(np.unique(self.places, axis=0))
        unknown = int(np.isnan(self.value).sum()) - self.shallow
        counts = (
            (unknown, "place has", "places have", "no value"),
            (self.shallow, "place was", "places were", "not pressed to this depth"),
            (self.rows - len(self.value), "row has", "rows have", "no position"),
            (hidden if len(self.axes) > 1 else 0, "place repeats", "places repeat", "a position"),
        )
        phrases = [
            f"{count} {one if count == 1 else several} {what}"
            for count, one, several, what in counts
            if count
        ]
        return [*phrases, *self.warnings]


def map_of(
    results: Table,
    by: Sequence[str],
    *,
    of: MapQuantity | None = None,
    depth: float | None = None,
) -> Map:
    """Return the values of a fleet's results over one or two of their columns.

    Parameters
    ----------
    results : pyarrow.Table
        As :func:`palpate.fleet.files.read_results` returns it.
    by : sequence of str
        One or two of ``x``, ``y``, ``z``, ``index``, ``part``, or of the other numeric columns.
    of : str
        ``"modulus"`` (default, if the rows have it), ``"stiffness"`` (else the default),
        ``"damping"`` or ``"force"`` at depth, or ``"exponent"``.
    depth : float, optional
        Common depth, m, > 0. Default: the working depth of each contact.

    Raises
    ------
    InvalidParameterError
        A column does not exist or holds no numbers.
    """
    of = of or ("modulus" if "modulus" in list_quantities(results) else "stiffness")
    axes = tuple(name.strip() for name in by)
    if not 1 <= len(axes) <= 2 or len(set(axes)) < len(axes):
        raise InvalidParameterError(f"by: pass one or two columns, not {shown(', '.join(by))}")
    places = np.stack([_numbers(results, name) for name in axes], axis=1)
    for axis, values in zip(axes, places.T, strict=True):
        if not np.isfinite(values).any():
            known = [name for name in _COORDINATES if np.isfinite(_numbers(results, name)).any()]
            raise InvalidParameterError(
                f"by: column {axis} is empty; columns with values: {', '.join(known) or 'none'}"
            )
    value, error, depths = _values(results, of, depth)
    too_shallow = np.zeros(len(value), dtype=bool)
    if depth is not None and of not in _OF_THE_CONTACT:  # deeper, the law is extrapolated
        too_shallow = np.isfinite(value) & ~(numbers(results, "largest_depth") >= depth)
        value = np.where(too_shallow, np.nan, value)
        error = np.where(too_shallow, np.nan, error)
    mistrusted = mistrusted_of(results, of)
    if of != "damping":  # a damping near zero has an error as large as itself
        mistrusted |= error > np.abs(value)
    placed: Mask = np.all(np.isfinite(places), axis=1)
    fields = [results.schema.field(name) for name in axes]
    units = tuple((field.metadata or {}).get(b"unit", b"").decode() for field in fields)
    deep = depths[placed & np.isfinite(depths)]
    span = (float(deep.min()), float(deep.max())) if deep.size else (np.nan, np.nan)
    unit = quantity_unit(of)
    warnings = _warnings(results, placed, of)
    shallow = int(np.count_nonzero(too_shallow[placed]))
    mistrusted = mistrusted[placed]
    value = value[placed]
    error = error[placed]
    places = places[placed]
    rows = results.num_rows
    at = depth, span, describe_frequencies(results.filter(placed), of)
    return Map(
        of,
        unit,
        value,
        error,
        axes,
        units,
        places,
        *at,
        rows,
        shallow,
        mistrusted,
        warnings,
    )


def describe_frequencies(results: Table, of: str) -> str:
    """Describe the motions' frequencies, after a comma, if a quantity depends on them.

    The damping always does, the stiffness if the material relaxes.
    """
    frequency = numbers(results, "frequency")
    name = "relaxed_stiffness"
    relaxes = name in results.schema.names and np.isfinite(numbers(results, name)).any()
    known = frequency[np.isfinite(frequency)]
    if not known.size or not (of == "damping" or (of == "stiffness" and relaxes)):
        return ""
    ends = dict.fromkeys(rounded(float(f) / math.tau, 2) for f in (known.min(), known.max()))
    return f", {' to '.join(ends)} Hz"


def mistrusted_of(results: Table, of: str) -> Mask:
    """Return a mask of the rows that the verdict, findings or flags do not trust."""
    verdict = f"verdict_{of if of in (*JUDGED, 'modulus') else 'stiffness'}"
    return np.array(
        [
            mark == "do-not-trust"
            or (mark is None and any(mark_by(f, of) == "do-not-trust" for f in findings or ()))
            or any(f["check"] in _untrusted_by(of) for f in flags or ())
            for mark, findings, flags in _column_rows(results, verdict, "findings", "flags")
        ],
        dtype=bool,
    )


def _untrusted_by(of: str) -> tuple[Check, ...]:
    """Return the checks whose flags make a quantity not to be trusted."""
    own = {"exponent": (Check.EXPONENT, Check.EXPONENT_RANGE), "damping": (Check.DAMPING,)}
    return Check.NEGATIVE_STIFFNESS, *own.get(of, ())


def _warnings(results: Table, placed: Mask, of: str) -> tuple[str, ...]:
    """Return the findings on a quantity and their numbers of places, the most severe first."""
    inside = results.filter(placed)
    kinds: Counter[tuple[str, str]] = Counter()
    for findings in inside.column("findings").to_pylist():
        kinds.update({(mark_by(f, of), f["check"] or "") for f in problems_of(findings, of)})
    ordered = sorted(kinds.items(), key=lambda kind: (kind[0][0], -kind[1], kind[0][1]))
    phrases = [
        f"{spoken(mark)}, {check}: at {count} of {inside.num_rows} places"
        for (mark, check), count in ordered
    ]
    unchecked = "none" in inside.column("checked").to_pylist()
    return (*phrases, *(["data not checked"] if unchecked else []))


def _numbers(results: Table, name: str) -> Floats:
    if name not in results.schema.names:
        raise InvalidParameterError(
            f"by: there is no column {name!r}; columns: {', '.join(results.schema.names)}"
        )
    try:
        return numbers(results, name)
    except (TypeError, ValueError):
        raise InvalidParameterError(f"by: the column {name} holds no numbers") from None


def _values(results: Table, of: str, depth: float | None) -> tuple[Floats, Floats, Floats]:
    depths = numbers(results, "depth")
    if of in _OF_THE_CONTACT:
        column = "n" if of == "exponent" else of
        if column not in results.schema.names:
            why = "run the fleet with --tip" if of == "modulus" else "this law has none"
            raise InvalidParameterError(f"of: the results have no {of}: {why}")
        if of == "modulus":
            return numbers(results, of), whole_errors(results, of), depths
        return numbers(results, column), numbers(results, f"{column}_standard_error"), depths
    if depth is None:
        return numbers(results, of), whole_errors(results, of), depths
    number_in("depth", depth, 0.0, 1e6, open_low=True)
    law = FORCE_LAWS[(results.schema.metadata or {})[b"law"].decode()]
    quantities = np.full((results.num_rows, 2), np.nan)
    whole: list[str] = [""] * results.num_rows
    if law.relaxes:
        whole = [result or "" for result in results["law"].to_pylist()]
    frequencies = numbers(results, "frequency").tolist()
    for k, (matrix, *row) in enumerate(_column_rows(results, "covariance", *law.names())):
        if matrix is not None and np.isfinite(row).all():
            law_of_row = law_from(json.loads(whole[k])) if whole[k] else law.from_parameters(row)
            covariance = np.reshape(matrix, (len(row), len(row)))
            response = values_for_depth(law_of_row, covariance, depth, frequencies[k])
            quantities[k] = response[of], response[f"{of}_standard_error"]
    return quantities[:, 0], quantities[:, 1], depths
