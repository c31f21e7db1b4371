"""Text tables, also inside a report: one sample per row; read some megabytes at a time."""

import bz2
import codecs
import gzip
import itertools
import re
import sys
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from palpate.errors import MissingChannelError
from palpate.input.recordings.opening import Draft, Request, excess, first_line
from palpate.input.recordings.plain_rows import find_plain_rows
from palpate.input.recordings.recording import Faults, Recording
from palpate.input.recordings.text_layout import (
    SPACES,
    WHOLE_THOUSANDS,
    WIDE,
    TextLayout,
    detect_layout,
    has_open_quote,
    is_other_table,
    parse_number,
    parse_vector,
    split_cells,
)
from palpate.input.recordings.times import (
    detect_epoch,
    is_nanoseconds,
    is_timelike,
    iso_nanoseconds,
    join_stamps,
    past_midnight,
    whole_time,
)
from palpate.validation import Values

try:
    import lzma
    from lzma import LZMAError
except ImportError:  # Python for the browser, or built without the library
    lzma = None  # type: ignore[assignment]
    LZMAError = EOFError  # type: ignore[assignment,misc]

CHUNK = 1 << 20
BLOCK = 4 << 20  # bytes in a parsed block
LONGEST_LINE = 4 * BLOCK
HEAD = 1 << 16  # bytes searched first for the header, before the whole first block
PROBED = 1000  # lines that show the kinds of the columns
# Bytes of text whose cells are Python objects at one time; they take some five times as much.
PIECE = 1 << 19
MOST_LINES = 50  # of a quoted cell; without a limit one stray mark would enclose the whole rest
# A line of words in a table whose rows begin with numbers: text around it, or a row of words.
_WORDS = re.compile(
    rb"\n(?:[ \t,;|]*|[ \t\"'<*#({\[=-]*(?!(?:nan|inf)(?:\W|inity))[a-z\x80-\xff][^\r\0\n]*)(?=\n)",
    re.IGNORECASE,
)
# A killed writer leaves a file whose size is a multiple of its buffer's.
BUFFER = 4096
# A last cell that is shorter than all of this many cells above it is most likely cut off.
FEW = 20
TAIL = 1 << 16  # bytes
# Images, archives and noise are a tenth control characters; text has none, except a letter with a
# flipped bit.
MOST_CONTROLS = 0.02
_CONTROLS = bytes({*range(32), 127} - set(b"\t\n\r\f\x1b"))
_PACKED: dict[bytes, Callable[[IO[bytes]], Any]] = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
}
_XZ = b"\xfd7zXZ\0"
if lzma is not None:
    _PACKED[_XZ] = lzma.open


def read(path: Path, request: Request) -> Recording:
    """Read a text table: CSV, TSV and similar, compressed or not.

    palpate detects the delimiter (comma, semicolon, tab, bar or spaces), the decimal mark, the
    encoding, the place of the table in a report, and the kind of each column. In a numeric column a
    cell without a number is NaN and counted in ``Recording.faults``. ``Recording.losses`` lists the
    rows that palpate could not read and skipped. Columns of the same name get their position:
    ``force_N (column 3)``. The channel ``segment`` numbers the blocks below the same header.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The file cannot be read, is not text, or has no header; or a row cannot be read and the
        request is strict.
    """
    table = _Table(path, request, {})
    kinds = {column.name: kind for column in table.columns if (kind := column.mistaken())}
    if kinds:  # a column began with words and continued with numbers, or vice versa
        del table  # its arrays
        request.release()
        table = _Table(path, request, kinds)
    return table.recording()


class _Text:
    """The lines of a text file, compressed or not and in any encoding, in blocks of UTF-8.

    Attributes
    ----------
    encoding : str
        Its encoding: ``"windows-1252"`` from the first bytes on that are not UTF-8.
    losses : list of str
        Sentences on the unreadable parts.
    fraction : float
        Fraction of the file read so far, 0 to 1.
    cut_off : bool
        Whether the last line had no line end; valid after the last block.
    """

    def __init__(self, path: Path, request: Request) -> None:
        self.path = path
        self.request = request
        self.size = path.stat().st_size
        self.encoding = "utf-8"
        self.losses: list[str] = []
        self.fraction = 0.0
        self.compressed = self.cut_off = False

    def blocks(self) -> Iterator[bytes]:
        r"""Yield whole lines, each with its ``\n``, without empty lines at the end."""
        text = b""
        for chunk in self._convert_to_utf8():
            text += chunk
            if len(text) < BLOCK:
                continue
            cut = self._end_of_text(text, text.rfind(b"\n") + 1)
            if cut:
                yield _strip_returns(text[:cut])
            text = text[cut:]
            if len(text) > LONGEST_LINE:
                raise self.request.error(
                    "a line, or a run of empty lines, exceeds "
                    f"{LONGEST_LINE >> 20} MiB; this is not a table"
                )
        self.cut_off = bool(text[text.rfind(b"\n") + 1 :].strip())
        text += b"\n"
        if cut := self._end_of_text(text, len(text)):
            yield _strip_returns(text[:cut])

    @staticmethod
    def _end_of_text(lines: bytes, end: int) -> int:
        """Return the end of the last line that is not blank."""
        filled = len(lines[:end].rstrip(b" \t\f\r\n"))
        return lines.find(b"\n", filled) + 1 if filled else 0

    def decode(self, block: bytes) -> str:
        """Return lines as text, decoded as UTF-8, else Windows-1252, else Latin-1."""
        if self.encoding == "utf-8":
            try:
                return block.decode()
            except UnicodeDecodeError:
                self.encoding = "windows-1252"
        if self.encoding == "windows-1252":
            try:
                return block.decode("cp1252")
            except UnicodeDecodeError:
                return block.decode("latin-1")
        return block.decode(errors="replace")  # _convert_to_utf8 encoded it

    def _convert_to_utf8(self) -> Iterator[bytes]:
        chunks = self._chunks()
        head = next(chunks, b"")
        marks = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
        if head[:2] in marks and head[2:4] != b"\0\0":  # else it is UTF-32
            self.encoding = marks[head[:2]]
            decoder = codecs.getincrementaldecoder("utf-16")("replace")
            for chunk in itertools.chain([head], chunks, [b""]):
                yield decoder.decode(chunk, final=not chunk).encode(errors="replace")
            return
        begin = head[:HEAD].rstrip(b"\0")  # a loss of power leaves zeros at the end
        controls = len(begin) - len(begin.translate(None, _CONTROLS))
        if (head and not begin) or controls > MOST_CONTROLS * len(begin):
            raise self.request.error(
                "this is neither a text file (UTF-8, Latin-1, or UTF-16 with a byte-order mark) "
                "nor in another known format; expected a table, such as CSV"
            )
        if b"\r" in begin and b"\n" not in begin:
            raise self.request.error(
                "its lines end in carriage returns alone, which palpate does not read; "
                "convert the file: tr '\\r' '\\n'"
            )
        yield head.removeprefix(codecs.BOM_UTF8)
        yield from chunks

    def _chunks(self) -> Iterator[bytes]:
        with self.path.open("rb") as raw:
            begin = raw.peek(8)
            unpack = next((_PACKED[mark] for mark in _PACKED if begin.startswith(mark)), None)
            if unpack is None and begin.startswith(_XZ):
                raise self.request.error(
                    "this file is compressed with xz, and this Python lacks the module lzma; "
                    "unpack it first: unxz"
                )
            self.compressed = unpack is not None
            size = 0
            with unpack(raw) if unpack else nullcontext(raw) as file:
                try:
                    while chunk := file.read1(CHUNK):
                        size += len(chunk)
                        self.fraction = min(raw.tell() / self.size, 1.0)
                        yield chunk
                        if size > self.request.max_size:
                            message = excess("its text takes", size, self.request.max_size)
                            raise self.request.error(message)
                except (EOFError, OSError, zlib.error, LZMAError) as error:
                    if not size:
                        raise self.request.error(
                            f"the compressed file cannot be read ({first_line(error)}); "
                            "copy it again"
                        ) from None
                    self.losses.append(
                        f"the compressed data end early or are damaged, after {size} bytes of text"
                    )


_DTYPES = {"dates": np.int64, "nanoseconds": np.int64}  # of the times


class _Column:
    """A column while it fills; a numeric cell without a number is NaN.

    Parameters
    ----------
    name : str
        Its name in the file.
    decimal : str
        The decimal mark.
    kind : str
        Kind of its cells: ``"numbers"``, ``"text"``, ``"vectors"``, ``"dates"`` or
        ``"nanoseconds"``; ``"nothing"`` if the column is not requested.
    width : int
        Numbers per cell of vectors.

    Attributes
    ----------
    dtype : type
        Type of its numbers.
    """

    def __init__(self, name: str, decimal: str, kind: str, width: int = 1) -> None:
        self.name = name
        self.decimal = decimal
        self.kind = kind
        self.width = width
        self.dtype: Any = _DTYPES.get(kind, np.float64)
        self.size = self.good = self.filled = 0
        self.pieces: list[Values] = []
        self.wrong: tuple[int, str] | None = None
        self.is_number = lru_cache(maxsize=10_000)(
            lambda cell: parse_number(cell, decimal) is not None
        )
        self.has_thousands = False

    @property
    def is_numeric(self) -> bool:
        """Whether its values are one number each."""
        return self.kind in ("numbers", *_DTYPES)

    def extend(self, values: Values, wrong: int = 0, blank: int = 0) -> None:
        """Add parsed values; ``wrong`` of them are not numbers, and ``blank`` are empty."""
        self.pieces.append(values)
        self.size += len(values)
        self.good += len(values) - wrong
        self.filled += len(values) - blank

    def take(self, cells: Sequence[str]) -> None:
        """Parse and add cells."""
        if self.kind == "nothing" or not cells:
            return
        if self.kind == "text":
            # Python objects, because one long cell would widen all others of an array of text, and
            # equal labels share memory.
            labels = np.array(list(map(sys.intern, cells)), dtype=object)
            wrong = len(cells) - sum(map(self.is_number, cells))
            self.extend(labels, wrong, sum(not cell.strip() for cell in cells))
            return
        values = list(map(self.value, cells))
        unread = [k for k, value in enumerate(values) if value is None]
        if unread and self.wrong is None:
            self.wrong = self.size + unread[0], cells[unread[0]]
        unknown = [np.nan] * self.width if self.kind == "vectors" else np.nan
        numbers = [unknown if value is None else value for value in values]
        blank = sum(not cells[k].strip() for k in unread)
        self.extend(np.array(numbers, self.dtype), len(unread), blank)

    def value(self, cell: str) -> float | list[float] | None:
        """Return the number, or the vector, in a cell; None if it has none."""
        if self.kind == "vectors":
            vector = parse_vector(cell, self.decimal)
            return vector if vector is not None and len(vector) == self.width else None
        if self.kind == "dates":
            return iso_nanoseconds(cell)
        if self.kind == "nanoseconds":
            return whole_time(cell)
        if self.has_thousands and WHOLE_THOUSANDS.fullmatch(cell.strip()):
            cell = cell.replace(",", "")
        return parse_number(cell, self.decimal)

    def mistaken(self) -> str | None:
        """The kind that the column should have had; None if its kind was right."""
        if self.kind == "text":
            return "numbers" if self.filled and 2 * self.good >= self.filled else None
        return "text" if 2 * self.good < self.filled else None

    def channels(self) -> dict[str, Values]:
        """Return the channels of the column, and empty it."""
        if self.kind == "nothing":
            return {}
        if self.kind == "numbers" and self.size and not self.filled:  # all cells are empty
            return {self.name: np.full(self.size, "", dtype=object)}
        empty = np.empty((0, self.width) if self.kind == "vectors" else 0, self.dtype)
        values = np.concatenate(self.pieces or [empty])
        self.pieces.clear()
        if self.kind == "vectors":
            return {f"{self.name}[{k}]": values[:, k].copy() for k in range(self.width)}
        if self.kind == "dates":
            values = past_midnight(values)
        return {self.name: values}

    def fault(self) -> Faults | None:
        """The cells without a number; None if all have one."""
        if self.wrong is None or not self.filled:
            return None
        return Faults(self.size - self.good, *self.wrong)


def _column_for(name: str, cells: Sequence[str], decimal: str, kind: str | None) -> _Column:
    """An empty column of the given kind, or of the kind that its first cells indicate."""
    filled = [cell for cell in cells if cell.strip()]
    width = 1
    if kind is None:
        kind = _detect_kind(name, filled, decimal) if filled else "numbers"
    if kind == "vectors":
        widths = Counter(len(parse_vector(cell, decimal) or ()) for cell in filled)
        del widths[0]
        width = max(widths, key=widths.__getitem__)
    column = _Column(name, decimal, kind, width)
    if decimal == ".":
        # If some numbers have no comma, a comma before three digits is not the decimal mark.
        commas = [cell for cell in filled if "," in cell and parse_number(cell, ".") is None]
        are_thousands = all(WHOLE_THOUSANDS.fullmatch(cell.strip()) for cell in commas)
        column.has_thousands = are_thousands and any(map(column.is_number, filled))
    return column


def _detect_kind(name: str, filled: Sequence[str], decimal: str) -> str:
    """The kind of more than half of the filled cells of a column."""

    def are_mostly(test: Callable[[str], object]) -> bool:
        return sum(map(bool, map(test, filled))) > 0.5 * len(filled)

    def is_text(cell: str) -> bool:
        return parse_number(cell, decimal) is None and not WHOLE_THOUSANDS.fullmatch(cell.strip())

    increases = filled[0] < filled[-1] and [*filled] == sorted(filled)
    if (is_timelike(name) or increases) and are_mostly(is_nanoseconds):
        return "nanoseconds"
    if not are_mostly(is_text):
        return "numbers"
    if are_mostly(lambda cell: iso_nanoseconds(cell) is not None):
        return "dates"
    return "vectors" if are_mostly(lambda cell: parse_vector(cell, decimal)) else "text"


class _Table:
    """Reads a file into columns: its layout, then its rows, block by block.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read.
    kinds : mapping
        The kind, ``"numbers"`` or ``"text"``, of columns whose first rows mislead.
    """

    def __init__(self, path: Path, request: Request, kinds: Mapping[str, str]) -> None:
        self.request = request
        self.columns: list[_Column] = []
        self.lost: dict[str, tuple[int, str]] = {}  # reason: number of rows, the first row
        self.text = _Text(path, request)
        self.rows: list[Sequence[int]] = []  # the row in the file of each sample
        self.begins = [0]  # index in ``rows`` at which each block begins
        self.skipped: dict[str, int] = {}  # kind of lines outside the table: the first of them
        self.words = b""  # trailing lines of words
        blocks = self.text.blocks()
        first = next(blocks, b"")
        head = self.text.decode(first[: first.rfind(b"\n", 0, HEAD) + 1])
        encoding = "cp1252" if self.text.encoding == "windows-1252" else "utf-8"
        self.plain = find_plain_rows(head, encoding)
        if self.plain is not None:
            first = self.plain.rewrite(first)
            blocks = map(self.plain.rewrite, blocks)
        self._begin(first, kinds)
        row = self.layout.first + 1
        rows = first.split(b"\n", self.layout.first)[-1]
        self.is_numeric = self.columns[0].kind != "text" and not _WORDS.match(b"\n" + rows[:TAIL])
        for block in itertools.chain([rows], blocks):
            row = self._add_block(block, row)
            request.report(self.text.fraction)
        if self.words:
            self._add_last_words(row - self.words.count(b"\n"))

    def _begin(self, first: bytes, kinds: Mapping[str, str]) -> None:
        """Find the layout and the kinds of the columns."""
        head = first[: first.rfind(b"\n", 0, HEAD) + 1]
        lines = self.text.decode(head).split("\n")[:-1]
        source = self.request.source
        header_row = self.request.header_row
        layout = None
        if len(lines) > (header_row or 0):
            layout = detect_layout(lines, source, header_row)
        # The notes are long, no rows follow them, or a later table may have more rows.
        if layout is None or layout.first >= len(lines) - 1 or layout.table.last < len(lines) - 1:
            lines = self.text.decode(first).split("\n")[:-1]
            layout = detect_layout(lines, source, header_row)
        self.layout: TextLayout = self.plain.add_to(layout) if self.plain else layout
        # The lines of the header, which other blocks may repeat.
        self.title, *below = first.split(b"\n", layout.first)[layout.table.header : -1] or [b""]
        units = b"|".join(re.escape(line + b"\n") for line in [*below, b""])
        header = rb"^(" + re.escape(self.title) + rb"\n(?:" + units + rb")*)"
        self.header = re.compile(header, re.MULTILINE)
        probed = lines[layout.first : layout.first + PROBED]
        records = [cells for _, cells in self._records(probed, 0, lambda *_: None)]
        for name, cells in zip(self.layout.header, self._transpose(records), strict=True):
            kind = kinds.get(name) if self.request.wants(name) else "nothing"
            self.columns.append(_column_for(name, cells, layout.decimal, kind))

    def _transpose(self, records: Sequence[list[str]]) -> list[Sequence[str]]:
        """The columns of records."""
        return list(zip(*records, strict=True)) if records else [()] * len(self.layout.header)

    def _add_block(self, block: bytes, row: int) -> int:
        """Add lines, within the cap on memory; return the number of the line below."""
        before = self._count_numbers()
        begin = len(block)
        if self.text.cut_off:
            begin = block.rfind(b"\n", 0, -1) + 1
        lines = block[:begin]
        last = block[begin:]
        self._add(lines, row)
        row += lines.count(b"\n")
        is_text = self.is_numeric and _WORDS.match(b"\n" + last)
        if last and (is_text or not self._is_cut_off(last, row, lines)):
            self._add(last, row)
            row += 1
        self.request.reserve(8 * (self._count_numbers() - before))
        # Texts take memory in addition to the pointers to them; equal texts are kept only once.
        if any(column.kind == "text" for column in self.columns):
            self.request.reserve(len(lines))
        return row

    def _count_numbers(self) -> int:
        return sum(column.size * column.width for column in self.columns if column.pieces)

    def _lose(self, what: str, row: int, cell: str = "") -> None:
        """Count a skipped row, with a reason such as "has more cells than the header"."""
        place = f"row {row} ({cell[:40]!r})" if cell else f"row {row}"
        if self.request.strict:
            raise self.request.error(f"{place} {what}; drop --strict to skip such rows")
        count, first_place = self.lost.get(what, (0, place))
        self.lost[what] = count + 1, first_place

    def _add(self, block: bytes, row: int) -> None:
        row -= self.words.count(b"\n")
        block = self.words + block
        self.words = b""
        # Blocks of rows between repeated headers.
        tables = self.header.split(block) if self.title and self.title in block else [block]
        if len(tables) > 1 and not tables[-1]:  # units may follow in the next block
            self.words = tables[-2]
            tables = tables[:-2]
        for k in range(0, len(tables), 2):
            if k:
                row += tables[k - 1].count(b"\n")
                self.begins.append(len(self.rows))
            is_last = k == len(tables) - 1 and not self.words
            self._add_table(tables[k], row, is_last=is_last)
            row += tables[k].count(b"\n")

    def _add_table(self, lines: bytes, row: int, *, is_last: bool) -> None:
        """Add lines up to the next header, or, if they are the last ones, up to the block's end."""
        rows, words = self._divide_words(lines, row)
        self._add_rows(rows, row)
        row += lines.count(b"\n") - words.count(b"\n")
        if not is_last and words.strip():
            self.skipped.setdefault("text between tables", row)
        elif len(words) > TAIL:  # a column of words
            self._add_rows(words, row)
        elif is_last:
            self.words = words

    def _divide_words(self, lines: bytes, row: int) -> tuple[bytes, bytes]:
        """The rows of the table, and the lines of words below them; skip another table."""
        if not self.is_numeric:
            return lines, b""
        text = b"\n" + lines
        begin = text.rfind(b"\n", 0, -1)
        end = len(lines)
        # A line with half of the quotation marks is the end of a cell of several lines.
        while end and _WORDS.match(text, begin) and text.count(b'"', begin, end) % 2 == 0:
            end = begin
            begin = text.rfind(b"\n", 0, begin)
        begin = stop = 0
        for line in _WORDS.finditer(text, 0, end + 1):
            if line.start() != stop:
                begin = line.start()
            stop = line.end()
            row_below = lines[stop : lines.find(b"\n", stop) + 1]
            if not row_below or _WORDS.match(text, stop):
                continue
            if is_other_table(self.text.decode(lines[begin:stop] + row_below).split("\n")[:-1]):
                self._skip_table(row + lines.count(b"\n", 0, begin))
                return lines[:begin], b""
        return lines[:end], lines[end:]

    def _skip_table(self, row: int) -> None:
        self.skipped.setdefault("another table; palpate reads the largest", row)

    def _add_last_words(self, row: int) -> None:
        """Add the last lines if they have the cells of rows; else they are text below the table."""
        lines = self.text.decode(self.words).split("\n")[:-1]
        rows = [split_cells(line, self.layout.delimiter) for line in lines if line.strip(" ,;|\t")]
        if rows and all(len(cells) == len(self.columns) for cells in rows):
            self._add_rows(self.words, row)
        elif rows:
            self.skipped.setdefault("text below the table", row)

    def _add_rows(self, block: bytes, row: int) -> None:
        while block:
            cut = len(block) if len(block) < PIECE else block.rfind(b"\n", 0, PIECE) + 1
            cut = cut or block.find(b"\n") + 1
            for _ in range(MOST_LINES):  # a quoted cell may continue on the next line
                if block.count(b'"', 0, cut) % 2 == 0:
                    break
                cut = block.find(b"\n", cut) + 1 or len(block)
            piece = block[:cut]
            block = block[cut:]
            if not self._take_at_once(piece, row):
                lines = self.text.decode(piece).split("\n")[:-1]
                self._add_records(self._records(lines, row, self._lose))
            row += piece.count(b"\n")

    def _add_records(self, records: Iterable[tuple[int, list[str]]]) -> None:
        """Add records, except those without a valid time."""
        clocks = [(k, column) for k, column in enumerate(self.columns) if column.kind in _DTYPES]
        rows: list[int] = []
        timed: list[list[str]] = []
        for row, cells in records:
            wrong = [(column, cells[k]) for k, column in clocks if column.value(cells[k]) is None]
            if wrong:
                column, cell = wrong[0]
                self._lose(f"has no valid time in column {column.name!r}", row, cell)
            else:
                rows.append(row)
                timed.append(cells)
        for column, values in zip(self.columns, self._transpose(timed), strict=True):
            column.take(values)
        self.rows.append(rows)

    def _records(
        self, lines: Sequence[str], row: int, lose: Callable[[str, int], None]
    ) -> Iterator[tuple[int, list[str]]]:
        """Return row in the file and cells of each record; the first line is row ``row``."""
        width = len(self.layout.header)
        delimiter = self.layout.delimiter
        stop = 0
        for k, line in enumerate(lines):
            if k < stop:  # within a quoted cell
                continue
            if "\0" in line:
                lose("contains zero bytes", row + k)
                continue
            if has_open_quote(line):
                below = range(k + 1, min(k + 1 + MOST_LINES, len(lines)))
                end = next(filter(lambda j: has_open_quote(lines[j]), below), k)
                line = "\n".join(lines[k : end + 1])
                # Two stray marks far apart do not enclose the rows between them.
                if end == k or len(split_cells(line, delimiter)) != width:
                    lose("has a quotation mark that is never closed", row + k)
                    continue
                stop = end + 1
            cells = split_cells(line, delimiter)
            # Padding an almost empty row of a wide table would invent many cells.
            if width > WIDE and 2 * len(cells) < width and not self.layout.clocks:
                lose("has less than half as many cells as the header", row + k)
            elif any(map(str.strip, cells[width:])):
                lose("has more cells than the header", row + k)
            else:
                yield row + k, [*cells[:width], *[""] * (width - len(cells))]

    def _take_at_once(self, piece: bytes, row: int) -> bool:
        """Parse rows by NumPy; return whether each has all cells, none of them quoted or blank."""
        has_text = not all(column.is_numeric for column in self.columns)
        delimiter = self.layout.delimiter
        if self.layout.decimal == ",":
            if has_text or b"." in piece or delimiter == ",":
                return False
            piece = piece.replace(b",", b".")
        if has_text and (b'"' in piece or b"\0" in piece):
            return False
        lines = self.text.decode(piece).split("\n")[:-1]
        kinds = [(f"{k}", c.dtype if c.is_numeric else object) for k, c in enumerate(self.columns)]
        dates = [k for k, column in enumerate(self.columns) if column.kind == "dates"]
        try:
            with warnings.catch_warnings(action="error"):  # a whole number with a decimal point
                cells = np.loadtxt(
                    lines,
                    kinds,
                    comments=None,
                    delimiter=None if delimiter == SPACES else delimiter,
                    converters=dict.fromkeys(dates, iso_nanoseconds),
                    ndmin=1,
                )
        except (TypeError, ValueError, Warning):
            return False
        if len(cells) < len(lines):  # it skips blank lines
            return False
        for column, (name, _) in zip(self.columns, kinds, strict=True):
            if column.is_numeric:
                column.extend(cells[name].copy())
            else:
                column.take(cells[name].tolist())
        self.rows.append(range(row, row + len(lines)))
        return True

    def _is_cut_off(self, line: bytes, row: int, above: bytes) -> bool:
        """Whether the last line, without a line end, is incomplete; if so, count it as skipped."""
        delimiter = self.layout.delimiter
        text = self.text.decode(line)
        cells = list[str]()
        if not has_open_quote(text):
            cells = split_cells(text[:-1], delimiter)
        is_killed = self.text.size % BUFFER == 0 and not self.text.compressed
        is_cut = len(cells) < len(self.columns) or is_killed or bool(self.text.losses)
        # Its last number may lack digits; compare its length with the numbers above.
        rows = above[-TAIL:].split(b"\n")[1:-1]
        if not is_cut and len(rows) > FEW:
            mark = None if delimiter == SPACES else delimiter.encode()
            *ends, end = (len((cells.rsplit(mark, 1) or [b""])[-1]) for cells in [*rows, line[:-1]])
            is_cut = end < min(ends)
        if is_cut:
            self._lose("is cut off by the end of the file", row)
        return is_cut

    def recording(self) -> Recording:
        """Return the recording.

        Raises
        ------
        RecordingError
            No row could be read.
        MissingChannelError
            There is no requested column.
        """
        draft = Draft(self.request, notes=dict(self.layout.notes))
        self._add_channels(draft)
        if self.request.channels and not draft.channels:
            source = self.request.source
            raise MissingChannelError(self.request.channels[0], self.layout.header, source)
        self._report_losses(draft)
        if self.text.encoding != "utf-8":
            encoding = self.text.encoding.upper().replace("WINDOWS", "Windows")
            draft.notes["encoding"] = encoding
        rows = _join_ranges(self.rows)
        place = self.layout.place
        recording = replace(draft.done(rows), settings=self.layout.settings, table=place)
        if draft.losses and not len(rows):
            where = f"; {place}" if place else ""
            raise draft.error(f"no row can be read: {draft.losses[0]}{where}")
        return recording

    def _add_channels(self, draft: Draft) -> None:
        """Add the requested columns, their units and faults, and times in whole nanoseconds."""
        channels = draft.channels
        for column in self.columns:
            fault = column.fault()
            arrays = column.channels()
            channels |= arrays
            if fault is not None:
                draft.faults |= dict.fromkeys(arrays, fault)
            unit = self.layout.units.get(column.name)
            if unit is None and column.kind in ("dates", "nanoseconds"):
                unit = "ns"
            if unit is not None:
                draft.units |= dict.fromkeys(arrays, unit)
        for name in filter(is_timelike, channels):
            epoch = detect_epoch(channels[name])
            if epoch is not None and draft.units.setdefault(name, epoch[0]) == epoch[0]:
                channels[name] = epoch[1]
        if any(name.startswith("field") for name in channels) and "%time" in channels:
            draft.units["%time"] = "ns"  # rostopic's, also of a simulation's clock
        self._separate_samples(draft)
        stamps = join_stamps(channels)
        channels |= stamps
        draft.units |= dict.fromkeys(stamps, "ns")
        for name in [name for name in channels if not self.request.wants(name)]:
            del channels[name]
            draft.units.pop(name, None)
        has_numbers = any(values.dtype != object for values in channels.values())
        if len(self.begins) > 1 and has_numbers and not draft.clocks:
            ends = [*self.begins[1:], len(self.rows)]
            blocks = [self.rows[a:b] for a, b in zip(self.begins, ends, strict=True)]
            lengths = [sum(map(len, block)) for block in blocks]
            segments = np.repeat(np.arange(1.0, len(lengths) + 1.0), lengths)
            channels.setdefault("segment", segments)

    def _separate_samples(self, draft: Draft) -> None:
        """Give each of the samples side by side its clock and its rows."""
        clocks = {name: time for name, time in self.layout.clocks.items() if name in draft.channels}
        for time in {*clocks.values()}:
            names = [name for name, clock in clocks.items() if clock == time]
            columns = [draft.channels[name] for name in names]
            known = [column == column for column in columns if column.dtype != object]
            if not known:  # names above blank cells
                clocks = {name: clock for name, clock in clocks.items() if clock != time}
                continue
            for name, column in zip(names, columns, strict=True):
                draft.channels[name] = column[np.logical_or.reduce(known)]
                if name in draft.faults and not draft.faults[name].text.strip():
                    del draft.faults[name]
        draft.clocks |= {name: time for name, time in clocks.items() if name != time}

    def _report_losses(self, draft: Draft) -> None:
        """Report the rows, lines and columns that are not in the recording."""
        for what, (count, place) in self.lost.items():
            if count == 1:
                draft.losses.append(f"{place} {what}; palpate skipped it")
            else:
                draft.losses.append(
                    f"palpate skipped {count} rows, each of which {what}; the first is {place}"
                )
        draft.losses += self.text.losses
        for line in self.layout.table.others:
            self._skip_table(line)
        for what, line in self.skipped.items():
            draft.omit(f"lines from {line} on", what)
        ignored = ", ".join(column.name for column in self.columns if column.kind == "nothing")
        if ignored:
            draft.omit("columns not requested", ignored)


def _strip_returns(lines: bytes) -> bytes:
    return re.sub(rb"\r+\n", b"\n", lines) if b"\r" in lines else lines


def _join_ranges(rows: Iterable[Sequence[int]]) -> Sequence[int]:
    """All row numbers in one sequence; a range if they are consecutive."""
    filled = [numbers for numbers in rows if len(numbers)]
    if not filled:
        return range(0)
    start = filled[0][0]
    count = sum(map(len, filled))
    if filled[-1][-1] - start + 1 == count:
        return range(start, start + count)
    joined: Any = np.concatenate([np.array(numbers, np.int64) for numbers in filled])
    return joined  # type: ignore[no-any-return]
