"""Identifications as a person reads them on a terminal, or as one JSON object."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.text import Text

from palpate.cli.printing import Cell, Terminal, print_json, print_table, say, say_path
from palpate.identifying import Identification
from palpate.results import view
from palpate.results.view import Line, ViewSection

_STYLES = {
    "trust": "green", "with-care": "yellow", "do-not-trust": "red", "note": "dim",
    "soft": "dim", "warning": "yellow", "strong": "bold",
}  # fmt: skip


def print_identifications(
    files: Sequence[Path],
    results: Sequence[Identification],
    figure: Path | None,
    *,
    as_json: bool,
    folder: Path | None = None,
) -> None:
    """Print what a file gave: its identification, or several side by side."""
    if as_json:
        from palpate.results.saved import described

        print_json(described(files, results))
        return
    if len(results) > 1:
        sections = [*view.of_comparison(results), view.preparation(results)]
    else:
        sections = [*view.of_identification(results[0])]
    console = _print(results[0], sections)
    if figure is not None:
        say_path(console, f"figure: {figure}")
    if folder is not None:
        say_path(console, f"report: {folder / 'report.html'}")


def print_diagnosis(result: Identification) -> None:
    """Print the verdict, the numbers that it is about, and every finding with its remedy."""
    _print(result, view.of_diagnosis(result))


def _print(result: Identification, sections: Iterable[ViewSection]) -> Terminal:
    """Print sections below the name of the recording."""
    console = Terminal()
    say_path(console, result.contact.source or "contact", "bold")
    for k, section in enumerate(sections):
        if k:
            console.print()
        if section.rows:
            rows = [[_cell(cell) for cell in row] for row in section.rows]
            prose = () if section.prose is None else [section.headings[section.prose]]
            print_table(console, section.headings, rows, prose=prose)
        for line in section.lines:
            say(console, _words(line), _STYLES.get(line.tone, ""))
    return console


def _cell(cell: view.Cell) -> Cell:
    return cell if isinstance(cell, str) else Text(cell.words, _STYLES[cell.mark])


def _words(line: Line) -> Text:
    words = Text(f"{line.name}: " if line.name else "")
    if line.mark:
        words.append(f"{line.mark} ", f"bold {_STYLES[line.mark]}")
    words.append("; ".join((line.words, *line.remarks)))
    return words.append(f" ({line.remedy})", "dim") if line.remedy else words
