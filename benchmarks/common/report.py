"""Measured numbers with their limits: on a terminal, as a page of ``docs/validation``, as JSON."""

import datetime
import importlib.metadata
import os
import platform
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from cyclopts import App, Parameter
from rich.console import Console
from rich.markdown import Markdown

from palpate.writing import write_text

Value = float | str
Cells = list[str]  # of a row; a value beyond its limit is bold
LEFT = {"", "figure", "to", "limit", "within"}  # headings of columns of text
PACKAGES = (
    *("palpate", "numpy", "nanobind", "padasip", "filterpy", "statsmodels", "mcap", "rosbags"),
    *("mujoco", "drake", "opensim"),
)


@dataclass(frozen=True, slots=True)
class Limit:
    """The limits of a value: at most ``highest``, at least ``lowest``."""

    highest: float | None
    lowest: float | None = None

    def holds(self, value: Value) -> bool:
        """Return whether a value is within the limits; text never is."""
        if isinstance(value, str):
            return False
        low, high = self.lowest, self.highest
        return (high is None or value <= high) and (low is None or value >= low)

    def __str__(self) -> str:
        if self.highest is None:
            return f"≥ {self.lowest:g}"
        return f"≤ {self.highest:g}" if self.lowest is None else f"{self.lowest:g}–{self.highest:g}"


def at_least(lowest: float) -> Limit:
    """Return the limits of a value that must not be smaller."""
    return Limit(None, lowest)


@dataclass(frozen=True)
class Row:
    """One measured thing; the limit is on its ratio to a reference, or on its value without one."""

    name: str
    value: float
    unit: str
    ratio: float | None = None
    reference: str = ""
    limit: Limit | None = None

    @property
    def within(self) -> bool | None:
        """Whether the value is within the limit; None without one."""
        if self.limit is None:
            return None
        return self.limit.holds(self.value if self.ratio is None else self.ratio)

    def cells(self) -> Cells:
        """Return the row of a table."""
        ratio = "" if self.ratio is None else f"{self.ratio:.{2 if self.ratio < 100.0 else 0}f}"
        limit = "" if self.limit is None else str(self.limit)
        within = {None: "", True: "yes", False: "**NO**"}[self.within]
        measured = f"{_significant(self.value)} {self.unit}".strip()
        return [self.name, measured, ratio, self.reference, limit, within]


@dataclass(frozen=True)
class Section:
    """A table of measured things in several units."""

    title: str
    rows: Sequence[Row]
    notes: Sequence[str] = ()
    definition = ""
    headings = ("", "measured", "ratio", "to", "limit", "within")


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a group.

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

    def holds(self, column: int) -> bool:
        """Return whether a column is within its limit, or has none."""
        limit = self.limits[min(column, len(self.limits) - 1)] if self.limits else None
        return limit is None or limit.holds(self.ours[column])

    @property
    def limit(self) -> str:
        """Return the limits as text; one if all are the same."""
        words = [str(limit) if limit else "–" for limit in self.limits]
        return " / ".join(words if len(set(words)) > 1 else words[:1])

    @property
    def within(self) -> bool | None:
        """Whether all values are within their limits; None without a limit."""
        return all(map(self.holds, range(len(self.ours)))) if any(self.limits) else None


@dataclass(frozen=True)
class Group:
    """A table of values in the same columns.

    Parameters
    ----------
    title, definition : str
        Its content, and how it is measured.
    columns, beside : tuple of str
        Headings of ``ours`` and ``beside`` in every line.
    rows : list of Line
    precision : str
        Format of numbers.
    notes : list of str
        Below the table.
    """

    title: str
    definition: str
    columns: tuple[str, ...]
    rows: list[Line]
    beside: tuple[str, ...] = ()
    precision: str = ".2f"
    notes: list[str] = field(default_factory=list)

    @property
    def headings(self) -> tuple[str, ...]:
        """Those of all columns; of limits only if a line has one."""
        limit, within = (("limit",), ("within",)) if self._limited else ((), ())
        return ("figure", *limit, *self.columns, *within, *self.beside)

    @property
    def _limited(self) -> bool:
        return any(line.within is not None for line in self.rows)

    def cells(self, line: Line) -> Cells:
        """Return the row of a table."""
        ours = [self._show(value) for value in line.ours]
        ours = [text if line.holds(i) else f"**{text}**" for i, text in enumerate(ours)]
        beside = [self._show(value) for value in line.beside]
        if not self._limited:
            return [line.figure, *ours, *beside]
        within = {None: "–", True: "yes", False: "no"}[line.within]
        return [line.figure, line.limit, *ours, within, *beside]

    def _show(self, value: Value) -> str:
        if isinstance(value, str):
            return value
        if value != value:
            return "–"
        return f"{value:.2g}" if abs(value) >= 1e4 else format(value, self.precision)


Table = Section | Group
Facts = dict[str, str]


def markdown_table(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """Return the lines of a table; the first column and those of text are on the left."""
    marks = ["---" if k == 0 or name in LEFT else "--:" for k, name in enumerate(headings)]
    cells = [[str(cell).replace("|", "\\|") for cell in row] for row in rows]
    return [f"| {' | '.join(row)} |" for row in (headings, marks, *cells)]


def markdown(tables: Sequence[Table]) -> list[str]:
    """Return the lines of all tables."""
    lines = []
    for table in tables:
        if isinstance(table, Group):
            rows = [table.cells(line) for line in table.rows]
        else:
            rows = [row.cells() for row in table.rows]
        definition = [table.definition, ""] if table.definition else []
        lines += [f"## {table.title}", "", *definition, *markdown_table(table.headings, rows), ""]
        lines += [part for note in table.notes for part in (note, "")]
    return lines


def verdict(tables: Sequence[Table]) -> str:
    """Return how many rows are within their limits, and which are not."""
    rows = [row for table in tables for row in table.rows if row.within is not None]
    missed = [row.name if isinstance(row, Row) else row.figure for row in rows if not row.within]
    text = f"{len(rows) - len(missed)} of {len(rows)} within their limits"
    return f"{text}; beyond: {'; '.join(missed)}" if missed else text


def publish(
    tables: Sequence[Table],
    facts: Facts,
    title: str = "",
    path: Path | None = None,
    question: str = "",
    command: str = "",
) -> None:
    """Print all tables and the machine, and write a page of them if there is a path for it."""
    lines = [*markdown(tables), f"**{verdict(tables)}.**", "", *list_facts(facts)]
    show([question, "", *lines] if question else lines, title, path, command)


def show(
    lines: Sequence[str], title: str = "", path: Path | None = None, command: str = ""
) -> None:
    """Print Markdown; with a path write a page: the command that wrote it, a title, the lines."""
    console, text = Console(highlight=False), "\n".join(lines)
    if console.is_terminal:
        console.print(Markdown(text))
    else:
        print(text)
    if path is not None:
        head = f"<!-- Written by {command or command_line()} -->\n\n# {title}\n\n"
        write_text(path, f"{head}{text}\n")


def command_line() -> str:
    """Return the command that this process runs."""
    spec = sys.modules["__main__"].__spec__
    module = "" if spec is None else spec.name.removesuffix(".__main__")
    return shlex.join(["python", "-m", module, *sys.argv[1:]])


def run_command(main: Callable[..., None]) -> None:
    """Run a command: its options are the arguments of a function, explained by its docstring."""
    name = command_line().removesuffix(shlex.join(sys.argv[1:])).strip()
    app = App(name, version_flags=[], help_format="plaintext")
    app.default_parameter = Parameter(negative="")
    app.default(main)
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)


def describe_machine(compiler: str = "", **more: object) -> Facts:
    """Return processor, system, Python, compiler, packages and date, as text."""
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    facts = {
        "processor": f"{_processor()}, {os.cpu_count()} cores, load {load} before the run",
        "system": f"{_system()}, {platform.machine()}",
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
        "compiler": compiler,
        "packages": ", ".join(f"{name} {_version(name)}" for name in PACKAGES),
        "date": datetime.date.today().isoformat(),
        **{name: str(value) for name, value in more.items()},
    }
    return {name: value for name, value in facts.items() if value}


def list_facts(facts: Facts) -> list[str]:
    """Return the lines of a list of facts."""
    return [f"- {name}: {value}" for name, value in facts.items()]


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return platform.system()


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "absent"


def _significant(value: float) -> str:
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}" if abs(value) < 1e3 else f"{value:.0f}"
    return f"{value:.1e}"
