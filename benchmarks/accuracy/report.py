"""Tables for a terminal, Markdown and JSON."""

import json
import os
import platform
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

import palpate
from benchmarks.accuracy.table import Group, Line


def circumstances(seeds: int) -> dict[str, Any]:
    """The machine, the date and the seeds."""
    return {
        "cpu": f"{_cpu()}, {os.cpu_count()} cores",
        "system": _system(),
        "python": platform.python_version(),
        "palpate": palpate.__version__,
        "numpy": version("numpy"),
        "date": datetime.now(UTC).date().isoformat(),
        "seeds": seeds,
    }


def console() -> Console:
    """Return the console for tables; wide enough for all columns if it is not a terminal."""
    there = Console(highlight=False)
    return there if there.is_terminal else Console(highlight=False, width=150)


def print_group(group: Group, console: Console) -> None:
    table = Table(title=Text(group.title, style="bold"), title_justify="left")
    table.add_column("figure", no_wrap=True)
    if group.judged:
        table.add_column("limit", no_wrap=True)
    for heading in group.columns:
        table.add_column(heading, justify="right")
    if group.judged:
        table.add_column("within")
    for heading in group.beside:
        table.add_column(heading, justify="right", style="dim")
    for line in group.lines:
        ours = [
            Text(group.show(value), style="" if line.holds(i) else "bold red")
            for i, value in enumerate(line.ours)
        ]
        beside = [group.show(value) for value in line.beside]
        before, after = _around(group, line)
        table.add_row(*before, *ours, *after, *beside)
    console.print(table)
    for text in (group.definition, *group.notes):
        console.print(Text(text.replace("`", ""), style="dim"))
    console.print()


def markdown(groups: list[Group], facts: dict[str, Any]) -> str:
    """Return everything as Markdown; a value beyond its limit is bold."""
    parts = [part for group in groups for part in _markdown_group(group)]
    return "\n".join([*parts, words(facts), ""])


def page(
    title: str, question: str, command: str, groups: list[Group], facts: dict[str, Any]
) -> str:
    """Return a separate page: its command, a question, the answer in a line, the tables."""
    tables = markdown(groups, facts).replace("### ", "## ")
    return f"<!-- Written by {command} -->\n\n# {title}\n\n{question} {_answer(groups)}\n\n{tables}"


def _answer(groups: list[Group]) -> str:
    within = [line.within for group in groups for line in group.lines]
    kept, lines = within.count("yes"), within.count("yes") + within.count("no")
    if not lines:
        return "Nothing was measured."
    if kept == lines:
        return f"All {lines} lines are within their limit."
    return f"Lines within their limit: {kept} of {lines}; bold values are beyond it."


def words(facts: dict[str, Any]) -> str:
    return (
        f"{facts['cpu']}; {facts['system']}; Python {facts['python']}, NumPy {facts['numpy']}, "
        f"palpate {facts['palpate']}; {facts['date']}; {facts['seeds']} seeds, more where a table "
        "says so."
    )


def as_json(groups: list[Group], facts: dict[str, Any]) -> str:
    content = {**facts, "groups": [group.as_dict() for group in groups]}
    return json.dumps(content, ensure_ascii=False, indent=1, default=float) + "\n"


def _markdown_group(group: Group) -> list[str]:
    limit, within = (["limit"], ["within"]) if group.judged else ([], [])
    headings = ["figure", *limit, *group.columns, *within, *group.beside]
    words = {"figure", "limit", "within"}
    marks = ["---" if heading in words else "--:" for heading in headings]
    rows = [_cells(group, line) for line in group.lines]
    table = [f"| {' | '.join(row)} |" for row in (headings, marks, *rows)]
    notes = [part for note in group.notes for part in (note, "")]
    return [f"### {group.title}", "", group.definition, "", *table, "", *notes]


def _cells(group: Group, line: Line) -> list[str]:
    ours = [
        group.show(value) if line.holds(i) else f"**{group.show(value)}**"
        for i, value in enumerate(line.ours)
    ]
    before, after = _around(group, line)
    cells = [*before, *ours, *after, *map(group.show, line.beside)]
    return [cell.replace("|", "\\|") for cell in cells]


def _around(group: Group, line: Line) -> tuple[list[str], list[str]]:
    """Return the cells before and after a line's own values; limits only if the group has any."""
    if not group.judged:
        return [line.figure], []
    return [line.figure, line.limit], [line.within]


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return f"{platform.system()} {platform.release()}"
