"""Text and tables in the width that there is: words fold, numbers stay whole, rows are stacked."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from rich.cells import cell_len
from rich.console import Console, JustifyMethod
from rich.text import Text

from palpate.errors import printable

if TYPE_CHECKING:
    from rich.table import Table

Cell: TypeAlias = str | Text

#: A column of prose that is narrower takes many lines for few words.
NARROWEST_PROSE = 28
GAP = 2
NOTHING = ("", "–")


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    heading : str
        Above it, and beside each of its cells where rows are stacked.
    right : bool
        Whether it is flush right, as numbers are.
    prose : bool
        Whether its words may be folded; anything else stays whole.
    hyphens : bool
        Whether its words may be broken at their first hyphen, where only that makes room.
    """

    heading: str
    right: bool = False
    prose: bool = False
    hyphens: bool = False


def as_text(words: Cell) -> Text:
    """Lines of text, of which the terminal shows every sign and obeys none."""
    given = words if isinstance(words, Text) else Text(words)
    plain = "\n".join(map(printable, str(words).split("\n")))
    return given.copy() if plain == given.plain else Text(plain, given.style)


def say(console: Console, words: Cell, style: str = "", *, hang: int = 2) -> None:
    """Print words, folded between them; all lines but the first are indented."""
    text = as_text(words)
    if style:
        text.stylize_before(style)
    for line in _folded(console, text, console.width, hang):
        console.print(line, soft_wrap=True)


def say_path(console: Console, words: str, style: str = "") -> None:
    """Print what is there to be copied, such as a file's name: in one line, however long."""
    console.print(Text(printable(words), style), soft_wrap=True)


def say_command(console: Console, words: str, style: str = "") -> None:
    r"""Print a command to be copied: broken before its options, with a \ that the shell joins."""
    parts = words.replace(" --", "\n--").split("\n")
    lines = [parts[0]]
    for part in parts[1:]:
        # Two for the sign that the line goes on.
        if cell_len(lines[-1]) + 1 + cell_len(part) + 2 > console.width:
            lines[-1] += " \\"
            lines.append(f"  {part}")
        else:
            lines[-1] += f" {part}"
    for line in lines:
        say_path(console, line, style)


def fits(console: Console, columns: Sequence[Column], rows: Sequence[Sequence[Cell]]) -> bool:
    """Whether a table's rows have room side by side."""
    return _least_width(columns, _as_texts(rows)) <= console.width


def print_table(
    console: Console,
    columns: Sequence[Column],
    rows: Sequence[Sequence[Cell]],
    *,
    compact: bool = False,
) -> None:
    """Print rows side by side where that fits, else one below the other; nothing is cut off.

    Parameters
    ----------
    console : Console
        Its width counts.
    columns : sequence of Column
        The first names the row.
    rows : sequence of sequences of str or Text
        A cell for each column; it may have several lines.
    compact : bool
        Whether what is stacked stands in as few lines as possible, as where there are many rows.
    """
    if not rows:
        return
    cells = _as_texts(rows)
    for shape in (_whole, _without_the_empty, _broken):
        shaped = shape(columns, cells)
        if _least_width(*shaped) <= console.width:
            console.print(_table(*shaped))
            return
    (_print_compact if compact else _print_stacked)(console, columns, cells)


Shaped: TypeAlias = tuple[Sequence[Column], Sequence[Sequence[Text]]]


def _whole(columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> Shaped:
    return columns, rows


def _without_the_empty(columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> Shaped:
    """Without columns in which nothing is said."""
    said = [k for k in range(len(columns)) if any(row[k].plain not in NOTHING for row in rows)]
    return [columns[k] for k in said], [[row[k] for k in said] for row in rows]


def _broken(columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> Shaped:
    """With what has a hyphen in two lines, where it is wider than the column has to be."""
    columns, rows = _without_the_empty(columns, rows)
    cells = [list(row) for row in rows]
    for k, column in enumerate(columns):
        if column.hyphens:
            broken = [_in_two_lines(row[k]) for row in cells]
            least = max(_width(words) for words in (column.heading, *(b.plain for b in broken)))
            for row, lines in zip(cells, broken, strict=True):
                row[k] = lines if row[k].cell_len > least else row[k]
    return columns, cells


def _in_two_lines(cell: Text) -> Text:
    place = cell.plain.find("-") + 1
    return Text("\n").join([cell[:place], cell[place:]]) if place else cell


def _as_texts(rows: Sequence[Sequence[Cell]]) -> list[list[Text]]:
    return [[as_text(cell) for cell in row] for row in rows]


def _table(columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> "Table":
    from rich.table import Table  # here, so that help, which has none, comes at once

    table = Table(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style="bold")
    for column in columns:
        justify: JustifyMethod = "right" if column.right else "left"
        if column.prose:
            table.add_column(column.heading, justify=justify, overflow="fold")
        else:
            table.add_column(column.heading, justify=justify, no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table


def _least_width(columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> int:
    """The width below which a number would be cut, or prose be a ribbon."""
    total = GAP * (len(columns) - 1)
    for k, column in enumerate(columns):
        widest = max(_width(column.heading), *(_width(row[k].plain) for row in rows))
        total += min(widest, NARROWEST_PROSE) if column.prose else widest
    return total


def _width(words: str) -> int:
    return max(map(cell_len, words.split("\n")))


def _print_stacked(
    console: Console, columns: Sequence[Column], rows: Sequence[Sequence[Text]]
) -> None:
    """A block of lines for each row: its name, then a heading and its cell in each line."""
    label = max((_width(_flat(column.heading)) for column in columns[1:]), default=0) + GAP
    widest = max((_width(cell.plain) for row in rows for cell in row[1:]), default=0)
    if label + widest + GAP > console.width:
        label = 0  # the heading has a line of its own
    for name, *cells in rows:
        _print_name(console, columns[0], name)
        for column, cell in zip(columns[1:], cells, strict=True):
            if cell.plain in NOTHING:
                continue
            heading = _flat(column.heading)
            if not label:
                say(console, f"  {heading}", "dim")
                heading = ""
            for line in cell.split("\n"):
                words = Text("  " if label else "    ").append(heading.ljust(label), "dim")
                say(console, words.append_text(line), hang=label + 2 * GAP)
                heading = ""


def _print_compact(
    console: Console, columns: Sequence[Column], rows: Sequence[Sequence[Text]]
) -> None:
    """A line or two for each row: its name, then headings and cells, broken between them."""
    for name, *cells in rows:
        _print_name(console, columns[0], name)
        line = Text("  ")
        for column, cell in zip(columns[1:], cells, strict=True):
            if cell.plain in NOTHING:
                continue
            item = Text(f"{_flat(column.heading)} ", "dim").append_text(_one_line(cell))
            gap = GAP if len(line.plain) > GAP else 0
            if gap and line.cell_len + gap + item.cell_len > console.width:
                say(console, line, hang=GAP * 2)
                line, gap = Text("  "), 0
            line.append(" " * gap).append_text(item)
        say(console, line, hang=GAP * 2)


def _print_name(console: Console, column: Column, name: Text) -> None:
    words = Text(f"{_flat(column.heading)} " if column.right else "")
    console.print(words.append_text(_one_line(name)), style="bold", soft_wrap=True)


def _flat(words: str) -> str:
    return words.replace("\n", ", ").strip()


def _one_line(cell: Text) -> Text:
    return Text(" ").join(cell.split("\n")) if "\n" in cell.plain else cell


def _folded(console: Console, text: Text, width: int, hang: int) -> list[Text]:
    """Lines of at most a width; of those after the first a part is the indent."""
    lines: list[Text] = []
    for paragraph in text.split("\n", allow_blank=True):
        if paragraph.cell_len <= width:
            lines.append(paragraph)
            continue
        first, *_ = paragraph.wrap(console, width)
        rest = paragraph[len(first.plain) :] if first.plain else paragraph
        first.rstrip()
        lines.append(first)
        for line in _trimmed(rest).wrap(console, max(width - hang, 1)):
            line.rstrip()
            lines.append(Text(" " * hang).append_text(line))
    return lines


def _trimmed(text: Text) -> Text:
    skipped = len(text.plain) - len(text.plain.lstrip())
    return text[skipped:]
