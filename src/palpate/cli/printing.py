"""Printing to the terminal: text is wrapped at its width, but numbers are never divided."""

import json
import logging
import math
import os
import re
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeAlias

from cyclopts import Parameter
from rich.cells import cell_len
from rich.console import Console, JustifyMethod
from rich.text import Text

from palpate.cli.options import OUTPUT
from palpate.errors import printable

if TYPE_CHECKING:
    from palpate.findings import Finding
    from palpate.identifying import Identification
    from palpate.input.recordings import Recording
    from palpate.output.results.view import Line, Styled, ViewSection

Cell: TypeAlias = str | Text

AsJson = Annotated[bool, Parameter(name="--json", negative="", group=OUTPUT)]

#: Width and height for a file or a pipe; COLUMNS overrides the width. rich accepts the width of a
#: dumb terminal only together with a height.
_PIPE = 100, 25
#: In a narrower column a few words of prose would take many lines.
_NARROWEST_PROSE = 28
_NARROWEST_LABEL = 8
_GAP = 2
_NOTHING = ("", "–")


class Terminal(Console):
    """A console on standard output or standard error.

    It prints in colour only on a terminal, and only without ``--no-color``, the environment's
    NO_COLOR (no-color.org) and TERM=dumb.
    """

    def __init__(self, *, stderr: bool = False, least: int = 1) -> None:
        columns = max(shutil.get_terminal_size(_PIPE).columns, least)
        width, height = (None, None) if stderr else (columns, _PIPE[1])
        super().__init__(
            stderr=stderr,
            highlight=False,
            color_system=None if os.environ.get("NO_COLOR") else "auto",
            width=width,
            height=height,
        )

    def on_broken_pipe(self) -> None:
        """Raise, so that the caller sets the exit status."""
        raise BrokenPipeError


def print_json(whole: dict[str, Any]) -> None:
    """Print one JSON object on one line, in ASCII."""
    print(json.dumps(whole, allow_nan=False))


def as_text(words: Cell) -> Text:
    """Return lines of text with control characters escaped, so that a terminal obeys none."""
    given = words if isinstance(words, Text) else Text(words)
    plain = "\n".join(map(printable, str(words).split("\n")))
    return given.copy() if plain == given.plain else Text(plain, given.style)


def say(console: Console, words: Cell, style: str = "") -> None:
    """Print text, wrapped between words; all lines but the first are indented."""
    text = as_text(words)
    text.stylize_before(style)
    for line in text.split("\n", allow_blank=True):
        width = console.width - _GAP if line.cell_len > console.width else console.width
        for k, part in enumerate(line.wrap(console, max(width, 1))):
            part.rstrip()
            console.print(Text(" " * _GAP * (k > 0)).append_text(part), soft_wrap=True)


def say_path(console: Console, words: str, style: str = "") -> None:
    """Print text to be copied, such as a file's name, on one line of any length."""
    console.print(Text(printable(words), style), soft_wrap=True)


def say_command(console: Console, text: str, style: str = "") -> None:
    r"""Print a command to be copied: broken before its options, with a \ that the shell joins."""
    joined = re.sub(" (?!--)", "\xa0", text)  # prevents a line break
    folder = textwrap.TextWrapper(max(console.width - _GAP, 1), subsequent_indent="  ")
    folder.break_long_words = folder.break_on_hyphens = False
    for line in " \\\n".join(folder.wrap(joined)).split("\n"):
        say_path(console, line.replace("\xa0", " "), style)


def print_table(
    console: Console,
    headings: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    *,
    prose: Sequence[str] = (),
) -> None:
    """Print cells side by side if they fit, else one below the other; nothing is cut off.

    Parameters
    ----------
    console : Console
        Its width counts.
    headings : sequence of str
        A heading that begins with ``>`` is for a column of numbers, flush right. The first column
        names the row. Empty columns are omitted.
    rows : sequence of sequences of str or Text
        A cell for each column; it may have several lines.
    prose : sequence of str
        Headings of the columns whose text may be wrapped; other cells are never wrapped.
    """
    texts = [list(map(as_text, row)) for row in rows]
    columns = []
    for k, cells in enumerate(zip(*texts, strict=True)):
        words = set(map(str, cells))
        if words.issubset(_NOTHING):
            continue
        folded = headings[k] in prose
        title = headings[k].removeprefix(">")
        most = _NARROWEST_PROSE if folded else math.inf
        widest = int(min(max(map(_width, words)), most))
        least = max(widest, int(min(_width(title), most)))
        columns.append(_TableColumn(cells, title, title != headings[k], folded, widest, least))
    if sum(column.least for column in columns) + _GAP * (len(columns) - 1) <= console.width:
        _print_side_by_side(console, columns)
    else:
        _print_one_below_the_other(console, columns)


class _TableColumn(NamedTuple):
    cells: Sequence[Text]
    title: str
    numeric: bool
    folded: bool
    #: Widths of the widest cell, and of the column at least; prose may be narrower.
    widest: int
    least: int


def _print_side_by_side(console: Console, columns: Sequence[_TableColumn]) -> None:
    from rich.table import Table  # here, because help needs no table and must be fast

    table = Table(box=None, pad_edge=False, padding=(0, _GAP, 0, 0), header_style="bold")
    table.show_header = any(column.title for column in columns)
    for column in columns:
        justify: JustifyMethod = "right" if column.numeric else "left"
        table.add_column(column.title, justify=justify, no_wrap=not column.folded, overflow="fold")
    for row in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*row)
    for segments in console.render_lines(table, pad=False):
        line = Text.assemble(*((segment.text, segment.style or "") for segment in segments))
        line.rstrip()
        console.print(line, soft_wrap=True)


def _print_one_below_the_other(console: Console, columns: Sequence[_TableColumn]) -> None:
    from rich.table import Table

    name, *others = columns
    labels = [_flatten(column.title) for column in others]
    widest = max((column.widest for column in others), default=0)
    room = max(console.width - widest - 2 * _GAP, _NARROWEST_LABEL)
    labelled = min(room, max(map(cell_len, labels), default=0))
    unit = f"{_flatten(name.title)} " if name.numeric else ""
    for k, title in enumerate(name.cells):
        block = Table(box=None, show_header=False, padding=(0, 0, 0, _GAP))
        block.add_column(width=labelled, overflow="fold")
        block.add_column(overflow="fold")
        for label, column in zip(labels, others, strict=True):
            if column.cells[k].plain not in _NOTHING:
                block.add_row(Text(label, "dim"), column.cells[k])
        say(console, Text(unit).append_text(title), "bold")
        console.print(block)


def _flatten(title: str) -> str:
    return title.replace("\n", ", ").strip()


def _width(text: str) -> int:
    return max(map(cell_len, text.split("\n")))


def open_with_progress(
    file: Path, channels: Sequence[str] | None, *, max_size: float | None, **options: Any
) -> "Recording":
    """Open a recording with options of :func:`palpate.open_recording`, and show a bar."""
    from palpate.input.recordings import open_recording

    with bar(f"reading {file}") as progress:
        return open_recording(file, channels, progress=progress, max_size=max_size, **options)


@contextmanager
def bar(text: str) -> Iterator[Callable[..., None]]:
    """Show the progress of a task, and the remaining time.

    It yields a function of the number done and the total (default: 1, for a fraction). Nothing is
    shown if standard error is no terminal.
    """
    if not sys.stderr.isatty():
        yield lambda done, total=1: None
        return
    from rich.markup import escape
    from rich.progress import Progress

    with Progress(console=Terminal(stderr=True), transient=True) as shown:
        task = shown.add_task(escape(printable(text)), total=None)
        yield lambda done, total=1: shown.update(task, completed=done, total=total)


# Identifications as text on a terminal, or as one JSON object.

#: Styles of marks, severities and tones.
STYLES = {
    "trust": "green", "with-care": "yellow", "do-not-trust": "red", "note": "dim",
    "soft": "dim", "warning": "yellow", "strong": "bold",
}  # fmt: skip


def print_identifications(
    files: Sequence[Path],
    results: "Sequence[Identification]",
    figure: Path | None,
    *,
    as_json: bool,
    folder: Path | None = None,
) -> None:
    """Print the identification of a file, or several identifications side by side."""
    if as_json:
        from palpate.output.results.saved import describe_contact

        print_json(describe_contact(files, results))
        return
    from palpate.output.results import view

    if len(results) > 1:
        sections = [*view.comparison_sections(results), view.preparation_section(results)]
    elif is_verbose():
        sections = [*view.identification_sections(results[0])]
    else:
        sections = [*view.short_answer(results[0], [shlex.quote(str(file)) for file in files])]
    short = len(results) == 1 and not is_verbose()
    source = results[0].contact.source or "contact"
    console = _print(Path(source).name if short else source, sections)
    if figure is not None:
        say_path(console, f"figure: {figure}")
    if folder is not None:
        say_path(console, f"report: {folder / 'report.html'}")


def print_panels() -> None:
    """Print the names of the panels of a figure, with what each shows."""
    from palpate.output.figures import PANELS
    from palpate.output.figures.identified import SEVERAL

    console = Terminal()
    shown = {name: panel.words for name, panel in PANELS.items()} | SEVERAL
    for name, text in shown.items():
        say(console, f"{name:<11} {text}")


def print_caption(result: "Identification", panels: Sequence[str] | None) -> None:
    """Print the caption that a journal sets below a figure."""
    from palpate.output.figures import caption

    say(Terminal(), f"caption: {caption(result, panels)}")


def print_diagnosis(result: "Identification") -> None:
    """Print the verdict, its numbers, and every finding with its remedy."""
    from palpate.output.results import view

    _print(result.contact.source or "contact", view.diagnosis_sections(result))


def print_hold_out(finding: "Finding") -> None:
    """Print how well the first half predicts the second."""
    say(Terminal(), f"hold-out  {finding.message}", STYLES[finding.stiffness])


def _print(title: str, sections: "Iterable[ViewSection]") -> Terminal:
    """Print sections below a title, if any."""
    console = Terminal()
    if title:
        say_path(console, title, "bold")
    for k, section in enumerate(sections):
        if k:
            console.print()
        if section.rows:
            rows = [[_cell(cell) for cell in row] for row in section.rows]
            prose = () if section.prose is None else [section.headings[section.prose]]
            print_table(console, section.headings, rows, prose=prose)
        for line in section.lines:
            say(console, _format_line(line), STYLES.get(line.tone, ""))
    return console


def is_verbose() -> bool:
    """Whether -v was passed, which sets palpate's logger to level INFO."""
    return logging.getLogger("palpate").isEnabledFor(logging.INFO)


def _cell(cell: "str | Styled") -> Cell:
    if isinstance(cell, str):
        return cell
    style = f"{STYLES[cell.mark]} link {cell.link}" if cell.link else STYLES[cell.mark]
    return Text.assemble(cell.before, (cell.text, style), cell.after)


def _format_line(line: "Line") -> Text:
    from palpate.findings import spoken  # here: it imports NumPy, which help does not need

    text = Text(f"{line.name}: " if line.name else "")
    if line.mark:
        text.append(spoken(line.mark), f"bold {STYLES[line.mark]}")
        text.append(": " if line.text[:1].islower() else ". ")
    text.append("; ".join((line.text, *line.remarks)))
    return text.append(f" ({line.remedy})", "dim") if line.remedy else text
