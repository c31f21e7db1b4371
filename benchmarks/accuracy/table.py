"""The result of a part of the benchmark: values with their limits."""

from dataclasses import asdict, dataclass, field
from typing import Any

Value = float | str


@dataclass(frozen=True, slots=True)
class Limit:
    """The limits of a value: at most ``highest``, at least ``lowest``."""

    highest: float
    lowest: float | None = None

    def holds(self, value: Value) -> bool:
        """Return whether a value is within the limit; text never is."""
        if isinstance(value, str):
            return False
        return value <= self.highest and (self.lowest is None or value >= self.lowest)

    def __str__(self) -> str:
        if self.lowest is None:
            return f"≤ {self.highest:g}"
        return f"{self.lowest:g}–{self.highest:g}"


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a table.

    Parameters
    ----------
    figure : str
        What is measured.
    ours : tuple
        Values, one a column of the group.
    limits : tuple of Limit or None
        Their limits; if there are fewer than values, the last holds for the rest. Empty: none.
    beside : tuple
        For comparison: bounds, other methods.
    """

    figure: str
    ours: tuple[Value, ...]
    limits: tuple[Limit | None, ...] = ()
    beside: tuple[Value, ...] = ()

    def limit_of(self, column: int) -> Limit | None:
        """Return the limit of a column."""
        return self.limits[min(column, len(self.limits) - 1)] if self.limits else None

    def holds(self, column: int) -> bool:
        """Return whether a column is within its limit, or has none."""
        limit = self.limit_of(column)
        return limit is None or limit.holds(self.ours[column])

    @property
    def limit(self) -> str:
        """Return the limits as text; one if all are the same."""
        words = [str(limit) if limit else "–" for limit in self.limits]
        return " / ".join(words if len(set(words)) > 1 else words[:1])

    @property
    def within(self) -> str:
        """Return whether all values are within their limits, as one word."""
        if not any(self.limits):
            return "–"
        return "yes" if all(self.holds(i) for i in range(len(self.ours))) else "no"


@dataclass(frozen=True, slots=True)
class Group:
    """One table.

    Parameters
    ----------
    title, definition : str
        Its content, and how it is measured.
    columns, beside : tuple of str
        Headings of ``ours`` and ``beside`` in every line.
    lines : list of Line
    precision : str
        Format of numbers.
    notes : list of str
        Below the table.
    """

    title: str
    definition: str
    columns: tuple[str, ...]
    lines: list[Line]
    beside: tuple[str, ...] = ()
    precision: str = ".2f"
    notes: list[str] = field(default_factory=list)

    @property
    def judged(self) -> bool:
        """Return whether any of its lines has a limit."""
        return any(any(line.limits) for line in self.lines)

    def show(self, value: Value) -> str:
        """Return a value as the tables print it."""
        if isinstance(value, str):
            return value
        if value != value:
            return "–"
        return f"{value:.2g}" if abs(value) >= 1e4 else format(value, self.precision)

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and text."""
        lines = [{**asdict(line), "within": line.within} for line in self.lines]
        return {**asdict(self), "lines": lines}
