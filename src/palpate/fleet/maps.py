"""What a fleet found, over where it was found."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.flags import NEGATIVE_STIFFNESS
from palpate.fleet.at_depth import AT_DEPTH
from palpate.fleet.rows import at_depth
from palpate.force_laws import FORCE_LAWS
from palpate.results.summary import depth_in_words
from palpate.validation import Floats, number_in, shown

if TYPE_CHECKING:
    import pyarrow as pa

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
    failures : int
        Places without a number.
    shallow : int
        Of these, places that were not pressed to the depth.
    mistrusted : numpy.ndarray of bool, shape (k,)
        Places whose number is not to be trusted, by verdict, findings or flags; or, but for the
        damping, is less than its error.
    doubts : tuple of str
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
    failures: int
    shallow: int
    mistrusted: NDArray[np.bool_]
    doubts: tuple[str, ...]

    @property
    def where(self) -> str:
        """At which depth, in words."""
        if self.quantity == "exponent":
            return "of the whole contact"
        if self.depth is not None:
            return f"at {depth_in_words(self.depth)}"
        low, high = map(depth_in_words, self.depths)
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
        words = []
        failures = self.failures - self.shallow
        if failures:
            words.append(f"{failures} {'place has' if failures == 1 else 'places have'} no number")
        if self.shallow:
            were = "place was" if self.shallow == 1 else "places were"
            words.append(f"{self.shallow} {were} not pressed so deep")
        left = self.rows - len(self.value)
        if left:
            words.append(f"{left} {'row has' if left == 1 else 'rows have'} no place")
        hidden = len(self.places) - len(np.unique(self.places, axis=0))
        if hidden and len(self.axes) > 1:
            words.append(f"{hidden} {'lies' if hidden == 1 else 'lie'} on others")
        return [*words, *self.doubts]


def map_of(
    results: "pa.Table",
    by: Sequence[str],
    *,
    of: Quantity = "stiffness",
    depth: float | None = None,
) -> Map:
    """Return what a fleet found over one or two columns of its results.

    Parameters
    ----------
    results : pyarrow.Table
        As :func:`palpate.fleet.results.read_results` returns it.
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
        short = np.isfinite(value) & ~(_numbers(results, "largest_depth") >= depth)
        value, error = np.where(short, np.nan, value), np.where(short, np.nan, error)
    mistrusted = mistrusted_of(results, of)
    if of != "damping":  # which is often next to none, and then known no better than it is large
        mistrusted |= error > np.abs(value)
    there: NDArray[np.bool_] = np.all(np.isfinite(places), axis=1)
    fields = [results.schema.field(name) for name in axes]
    units = tuple((field.metadata or {}).get(b"unit", b"").decode() for field in fields)
    deep = depths[there & np.isfinite(depths)]
    span = (float(deep.min()), float(deep.max())) if deep.size else (np.nan, np.nan)
    return Map(
        of,
        "" if of == "exponent" else AT_DEPTH[of],
        value[there],
        error[there],
        axes,
        units,
        places[there],
        depth,
        span,
        results.num_rows,
        int(np.count_nonzero(~np.isfinite(value[there]))),
        int(np.count_nonzero(short[there])),
        mistrusted[there],
        _doubts(results, there),
    )


def mistrusted_of(results: "pa.Table", of: str) -> NDArray[np.bool_]:
    """Say of each row whether its number is not to be trusted, by verdict, findings or flags."""
    verdict = f"verdict_{of}" if of in ("stiffness", "damping") else "verdict"
    marks = (f"{of} not", f"{of} at the edge", NEGATIVE_STIFFNESS)
    columns = (results.column(name).to_pylist() for name in (verdict, "findings", "flags"))
    return np.array(
        [
            mark == "do-not-trust"
            or (mark is None and any(words.startswith("do-not-trust") for words in findings or ()))
            or any(words.startswith(marks) for words in flags or ())
            for mark, findings, flags in zip(*columns, strict=True)
        ],
        dtype=bool,
    )


def _doubts(results: "pa.Table", there: NDArray[np.bool_]) -> tuple[str, ...]:
    """What the checks say of how many places, the worst and the most frequent first."""
    kinds: Counter[tuple[str, str]] = Counter()
    unchecked = 0
    columns = (results.column(name).to_pylist() for name in ("checked", "findings"))
    for checked, findings, inside in zip(*columns, there.tolist(), strict=True):
        if inside:
            unchecked += checked == "none"
            kinds.update({_kind(words) for words in findings or ()})
    said = sorted(
        (severity, -count, check)
        for (severity, check), count in kinds.items()
        if severity != "note"
    )
    words = [f"{severity}, {check}: {-count} of the places" for severity, count, check in said]
    return (*words, *(["the data were not checked"] if unchecked else []))


def _kind(words: str) -> tuple[str, str]:
    severity, check, *_ = words.split(": ")
    return severity, check


def _numbers(results: "pa.Table", name: str) -> Floats:
    if name not in results.schema.names:
        raise InvalidParameterError(
            f"by: there is no column {name!r}; there are {', '.join(results.schema.names)}"
        )
    try:
        cells = results.column(name).to_pylist()
        values: Floats = np.array([np.nan if v is None else v for v in cells], dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidParameterError(f"by: the column {name} holds no numbers") from None
    return values


def _values(results: "pa.Table", of: str, depth: float | None) -> tuple[Floats, Floats, Floats]:
    depths = _numbers(results, "depth")
    if of == "exponent":
        if "exponent" not in results.schema.names:
            raise InvalidParameterError("of: this law has no exponent; draw its stiffness")
        return _numbers(results, of), _numbers(results, f"{of}_standard_error"), depths
    name = f"{of}_at_depth"
    if depth is None:
        error = _numbers(results, f"{name}_standard_error")
        moved = _numbers(results, f"{name}_systematic")
        known = np.isfinite(moved)
        return _numbers(results, name), np.where(known, np.hypot(error, moved), error), depths
    number_in("depth", depth, 0.0, 1e6, open_low=True)
    law = FORCE_LAWS[(results.schema.metadata or {})[b"law"].decode()]
    parameters = np.stack([_numbers(results, each) for each in law.names()], axis=1)
    value, error = np.full(len(parameters), np.nan), np.full(len(parameters), np.nan)
    matrices = results.column("covariance").to_pylist()
    for k, (row, matrix) in enumerate(zip(parameters, matrices, strict=True)):
        if matrix is None or not np.isfinite(row).all():
            continue
        size = len(row)
        found = at_depth(law(*row.tolist()), np.reshape(matrix, (size, size)), depth)
        value[k], error[k] = found[name], found[f"{name}_standard_error"]
    return value, error, depths
