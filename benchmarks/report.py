"""Rows, sections and limits, and how they are printed and written."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.console import Console
from rich.table import Table

HEADINGS = ("measured", "ratio", "to", "limit", "within")


@dataclass(frozen=True)
class Limit:
    """A bound on a row's ratio, or on its value where it has no ratio."""

    bound: float
    at_least: bool = False

    def kept_by(self, value: float) -> bool:
        """Return whether a value is within it."""
        return value >= self.bound if self.at_least else value <= self.bound

    def __str__(self) -> str:
        return f"{'≥' if self.at_least else '≤'} {self.bound:g}"


@dataclass(frozen=True)
class Row:
    """One measured thing."""

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
        return self.limit.kept_by(self.value if self.ratio is None else self.ratio)

    def cells(self) -> list[str]:
        """Return the row as text, under ``HEADINGS``."""
        return [
            self.name,
            f"{_significant(self.value)} {self.unit}".strip(),
            "" if self.ratio is None else f"{self.ratio:.{2 if self.ratio < 100.0 else 0}f}",
            self.reference,
            "" if self.limit is None else str(self.limit),
            {None: "", True: "yes", False: "NO"}[self.within],
        ]


@dataclass(frozen=True)
class Section:
    """Rows that belong together, with notes on them."""

    title: str
    rows: Sequence[Row]
    notes: Sequence[str] = ()


def print_sections(sections: Sequence[Section], machine: dict[str, str], console: Console) -> None:
    """Print every section as a table, and the machine at the end."""
    for section in sections:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
        table.add_column(section.title, overflow="fold")
        for heading in HEADINGS:
            right = heading in ("measured", "ratio")
            table.add_column(heading, justify="right" if right else "left")
        for row in section.rows:
            style = "bold red" if row.within is False else None
            table.add_row(*row.cells(), style=style)
        console.print(table)
        for note in section.notes:
            console.print(f"  {note}", style="dim", soft_wrap=True)
        console.print()
    console.print(verdict(sections), style="bold")
    for name, value in machine.items():
        console.print(f"{name}: {value}", soft_wrap=True)


def verdict(sections: Sequence[Section]) -> str:
    """Return how many rows are within their limits, and which are not."""
    judged = [row for section in sections for row in section.rows if row.within is not None]
    missed = [row.name for row in judged if not row.within]
    text = f"{len(judged) - len(missed)} of {len(judged)} within their limits"
    return f"{text}; beyond: {'; '.join(missed)}" if missed else text


def as_markdown(sections: Sequence[Section], machine: dict[str, str]) -> str:
    """Return the tables as Markdown."""
    lines = []
    for section in sections:
        lines += [f"### {section.title}", ""]
        lines += ["|  | " + " | ".join(HEADINGS) + " |", "|---|--:|--:|---|---|---|"]
        lines += ["| " + " | ".join(row.cells()) + " |" for row in section.rows]
        lines += ["", *(f"{note}\n" for note in section.notes)]
    lines += [f"**{verdict(sections)}.**", ""]
    lines += [f"- {name}: {value}" for name, value in machine.items()]
    return "\n".join(lines) + "\n"


def page(title: str, module: str, sections: Sequence[Section], machine: dict[str, str]) -> str:
    """Return a page of ``docs/validation``: the command that wrote it, a title, the tables."""
    command = shlex.join(["python", "-m", module, *sys.argv[1:]])
    tables = as_markdown(sections, machine).replace("### ", "## ")
    return f"<!-- Written by {command} -->\n\n# {title}\n\n{tables}"


def as_dict(sections: Sequence[Section], machine: dict[str, str]) -> dict[str, Any]:
    """Return everything as plain numbers and text."""
    return {
        "machine": machine,
        "sections": [
            {
                "title": section.title,
                "rows": [{**asdict(row), "within": row.within} for row in section.rows],
                "notes": list(section.notes),
            }
            for section in sections
        ],
    }


def _significant(value: float) -> str:
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}" if abs(value) < 1e3 else f"{value:.0f}"
    return f"{value:.1e}"
