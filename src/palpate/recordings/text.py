"""Text tables, also inside a report: one sample per row; read some megabytes at a time."""

import bz2
import codecs
import csv
import gzip
import io
import itertools
import lzma
import re
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from palpate.errors import MissingChannelError, RecordingError
from palpate.recordings.opening import Draft, Request, excess, first_line
from palpate.recordings.recording import Faults, Recording
from palpate.recordings.table_files import has_pyarrow
from palpate.recordings.text_layout import (
    SPACES,
    WHOLE_THOUSANDS,
    WIDE,
    TextLayout,
    detect_layout,
    has_open_quote,
    is_other_table,
    pad_cells,
    parse_number,
    split_cells,
    vector_in,
)
from palpate.recordings.times import (
    detect_epoch,
    is_nanoseconds,
    is_timelike,
    iso_nanoseconds,
    join_stamps,
    past_midnight,
    plain_iso_times,
    whole_time,
)

CHUNK = 1 << 20
BLOCK = 4 << 20  # bytes in a parsed block
LONGEST_LINE = 4 * BLOCK
HEAD = 1 << 16  # bytes searched first for the header, before the whole first block
PROBED = 1000  # lines that show the kinds of the columns
# Bytes of text whose cells are Python objects at one time; they take some five times as much.
PIECE = 1 << 19
LARGE = 5 << 20  # bytes of a file for which pyarrow is worth the time to import it
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
    b"\xfd7zXZ\0": lzma.open,
}
# Bytes of a block of plain numbers, besides the delimiter; nan and inf too. The parsers reject any
# other word of these letters.
_PLAIN = b"0123456789+-.eE nNaAfFiI"


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
        self.path, self.request = path, request
        self.size = path.stat().st_size
        self.encoding = "utf-8"
        self.losses: list[str] = []
        self.fraction = 0.0
        self.compressed = self.cut_off = False

    def blocks(self) -> Iterator[bytes]:
        r"""Yield whole lines, each with its ``\n``, without empty lines at the end."""
        rest = b""
        for chunk in self._convert_to_utf8():
            rest += chunk
            if len(rest) < BLOCK:
                continue
            cut = self._end_of_text(rest, rest.rfind(b"\n") + 1)
            if cut:
                yield _strip_returns(rest[:cut])
            rest = rest[cut:]
            if len(rest) > LONGEST_LINE:
                what = f"a line, or a run of empty lines, exceeds {LONGEST_LINE >> 20} MiB"
                raise self.request.error(f"{what}; this is not a table")
        self.cut_off = bool(rest[rest.rfind(b"\n") + 1 :].strip())
        rest += b"\n"
        if cut := self._end_of_text(rest, len(rest)):
            yield _strip_returns(rest[:cut])

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
            what = "its lines end in carriage returns alone, which palpate does not read"
            raise self.request.error(f"{what}; convert the file: tr '\\r' '\\n'")
        yield head.removeprefix(codecs.BOM_UTF8)
        yield from chunks

    def _chunks(self) -> Iterator[bytes]:
        with self.path.open("rb") as raw:
            begin = raw.peek(8)
            unpack = next((each for mark, each in _PACKED.items() if begin.startswith(mark)), None)
            self.compressed = unpack is not None
            made = 0
            with unpack(raw) if unpack else nullcontext(raw) as file:
                try:
                    while chunk := file.read1(CHUNK):
                        made += len(chunk)
                        self.fraction = min(raw.tell() / self.size, 1.0)
                        yield chunk
                        if made > self.request.max_size:
                            most = self.request.max_size
                            raise self.request.error(excess("its text takes", made, most))
                except RecordingError:
                    raise
                except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
                    if not made:
                        words = f"the compressed file cannot be read ({first_line(error)})"
                        raise self.request.error(f"{words}; copy it again") from None
                    self.losses.append(
                        f"the compressed data end early or are damaged, after {made} bytes of text"
                    )


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
    dtype : dtype, optional
        Type of the array into which NumPy can parse all cells together; None if it cannot.
    """

    def __init__(self, name: str, decimal: str, kind: str, width: int = 1) -> None:
        self.name, self.decimal, self.kind, self.width = name, decimal, kind, width
        at_once = {"numbers": np.float64, "nothing": np.float64, "nanoseconds": np.int64}
        self.dtype: Any = np.dtype(at_once[kind]) if kind in at_once else None
        self.size = self.good = self.filled = 0
        self.pieces: list[NDArray[Any]] = []
        self.wrong: tuple[int, str] | None = None
        remembered = lru_cache(maxsize=10_000)
        self._is_number = remembered(lambda cell: parse_number(cell, decimal) is not None)
        self.has_thousands = False

    def rows_to_skip(self, cells: Sequence[str]) -> list[int]:
        """Indices of the rows to skip, because they have no valid time."""
        if self.kind not in ("dates", "nanoseconds") or plain_iso_times(cells) is not None:
            return []
        return [k for k, cell in enumerate(cells) if self._value(cell) is None]

    def extend(self, values: NDArray[Any], wrong: int = 0, blank: int = 0) -> None:
        """Add parsed values; ``wrong`` of them are not numbers, and ``blank`` are empty."""
        if self.kind != "nothing":
            self.pieces.append(values)
        self.size += len(values)
        self.good += len(values) - wrong
        self.filled += len(values) - blank

    def take(self, cells: Sequence[str]) -> None:
        """Parse and add cells."""
        if self.kind == "nothing":
            return
        if self.kind == "text":
            # Python objects, because one long cell would widen all others of an array of text, and
            # equal labels share memory.
            words = np.array(list(map(sys.intern, cells)), dtype=object)
            wrong = len(cells) - sum(map(self._is_number, cells))
            self.extend(words, wrong, sum(not cell.strip() for cell in cells))
        elif (values := self._convert_at_once(cells)) is not None:
            self.extend(values)
        else:
            unknown = [np.nan] * self.width if self.kind == "vectors" else np.nan
            found = list(map(self._value, cells))
            unread = [k for k, value in enumerate(found) if value is None]
            if unread and self.wrong is None:
                self.wrong = self.size + unread[0], cells[unread[0]]
            dtype = np.int64 if self.kind in ("dates", "nanoseconds") else np.float64
            values = np.array([unknown if each is None else each for each in found], dtype)
            self.extend(values, len(unread), sum(not cells[k].strip() for k in unread))

    def _convert_at_once(self, cells: Sequence[str]) -> NDArray[Any] | None:
        if self.kind == "dates":
            return plain_iso_times(cells)
        if self.kind != "numbers" or self.decimal == "," or "_" in "".join(cells):
            return None
        try:
            return np.array(list(map(float, cells)), dtype=np.float64)
        except ValueError:
            return None

    def _value(self, cell: str) -> float | list[float] | None:
        if self.kind == "vectors":
            found = vector_in(cell, self.decimal)
            return found if found is not None and len(found) == self.width else None
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

    def channels(self) -> dict[str, NDArray[Any]]:
        """Return the channels of the column, and empty it."""
        if self.kind == "nothing":
            return {}
        if self.kind == "numbers" and self.size and not self.filled:  # all cells are empty
            return {self.name: np.full(self.size, "", dtype=object)}
        empty = np.empty((0, self.width) if self.kind == "vectors" else 0, self.dtype or float)
        whole = np.concatenate(self.pieces or [empty])
        self.pieces.clear()
        if self.kind == "vectors":
            return {f"{self.name}[{k}]": whole[:, k].copy() for k in range(self.width)}
        if self.kind == "dates":
            whole = past_midnight(whole)
        return {self.name: whole}

    def fault(self) -> Faults | None:
        """The cells without a number; None if all have one."""
        if self.wrong is None or not self.filled:
            return None
        return Faults(self.size - self.good, *self.wrong)


def _column_for(name: str, cells: Sequence[str], decimal: str, kind: str | None) -> _Column:
    """An empty column of the given kind, or of the kind that its first cells indicate."""
    filled = [cell for cell in cells if cell.strip()]
    most = 0.5 * len(filled)
    if kind is None and filled:
        numbers = sum(
            parse_number(cell, decimal) is not None or bool(WHOLE_THOUSANDS.fullmatch(cell.strip()))
            for cell in filled
        )
        if is_timelike(name) and sum(map(is_nanoseconds, filled)) > most:
            return _Column(name, ".", "nanoseconds")
        kind = "numbers"
        if numbers < most:
            if sum(iso_nanoseconds(cell) is not None for cell in filled) > most:
                return _Column(name, ".", "dates")
            vectors = [len(found) for cell in filled if (found := vector_in(cell, decimal))]
            if len(vectors) > most:
                return _Column(name, decimal, "vectors", max(set(vectors), key=vectors.count))
            kind = "text"
    column = _Column(name, decimal, kind or "numbers")
    commas = [cell for cell in filled if "," in cell and parse_number(cell, ".") is None]
    # If some numbers have no comma, a comma before three digits is not the decimal mark.
    plain = sum(parse_number(cell, ".") is not None for cell in filled)
    whole = all(WHOLE_THOUSANDS.fullmatch(each.strip()) for each in commas)
    column.has_thousands = decimal == "." and plain > 0 and whole
    return column


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
        self._begin(first, kinds)
        row, counted = self.layout.first + 1, 0
        rows = first.split(b"\n", self.layout.first)[-1]
        self.is_numeric = self.columns[0].kind != "text" and not _WORDS.match(b"\n" + rows[:TAIL])
        for block in itertools.chain([rows], blocks):
            last = b""
            if self.text.cut_off and block:
                begin = block.rfind(b"\n", 0, -1) + 1
                block, last = block[:begin], block[begin:]
            self._add(block, row)
            row += block.count(b"\n")
            words = self.is_numeric and _WORDS.match(b"\n" + last)
            if last and (words or not self._is_cut_off(last, row, block)):
                self._add(last, row)
                row += 1
            request.report(self.text.fraction)
            made = sum(column.size * column.width for column in self.columns if column.pieces)
            # Texts take memory in addition to the pointers to them; equal texts are kept only once.
            has_text = any(column.kind == "text" for column in self.columns)
            request.reserve(8 * (made - counted) + has_text * len(block))
            counted = made
        if self.words:
            self._add_last_words(row - self.words.count(b"\n"))

    def _begin(self, first: bytes, kinds: Mapping[str, str]) -> None:
        """Find the layout and the kinds of the columns."""
        head = first[: first.rfind(b"\n", 0, HEAD) + 1]
        lines = self.text.decode(head).split("\n")[:-1]
        source, named = self.request.source, self.request.header_row
        layout = detect_layout(lines, source, named) if len(lines) > (named or 0) else None
        # The notes are long, no rows follow them, or a later table may have more rows.
        if layout is None or layout.first >= len(lines) - 1 or layout.table.last < len(lines) - 1:
            lines = self.text.decode(first).split("\n")[:-1]
            layout = detect_layout(lines, source, named)
        self.layout: TextLayout = layout
        # The lines of the header, which other blocks may repeat.
        self.title, *below = first.split(b"\n", layout.first)[layout.table.header : -1] or [b""]
        units = b"|".join(re.escape(line + b"\n") for line in [*below, b""])
        again = rb"^(" + re.escape(self.title) + rb"\n(?:" + units + rb")*)"
        self.header = re.compile(again, re.MULTILINE)
        some = lines[layout.first : layout.first + PROBED]
        probed = list(self._records(some, 0, lambda *_: None))
        cells = _transpose([found for _, found in probed], len(layout.header))
        for name, found in zip(layout.header, cells, strict=True):
            kind = kinds.get(name) if self.request.wants(name) else "nothing"
            self.columns.append(_column_for(name, found, layout.decimal, kind))

    def _lose(self, what: str, row: int, cell: str = "") -> None:
        """Count a skipped row, with a reason such as "has more cells than the header"."""
        place = f"row {row}" + f" ({cell[:40]!r})" * bool(cell)
        if self.request.strict:
            raise self.request.error(f"{place} {what}; drop --strict to skip such rows")
        count, first = self.lost.get(what, (0, place))
        self.lost[what] = count + 1, first

    def _add(self, block: bytes, row: int) -> None:
        arrays = self._parse_at_once(block) if block and not self.words else None
        if arrays is not None:
            for column, values in zip(self.columns, arrays, strict=True):
                column.extend(values)
            self.rows.append(range(row, row + len(arrays[0])))
            return
        row -= self.words.count(b"\n")
        block, self.words = self.words + block, b""
        # Blocks of rows between repeated headers.
        parts = self.header.split(block) if self.title and self.title in block else [block]
        if len(parts) > 1 and not parts[-1]:  # units may follow in the next block
            self.words = parts[-2]
            parts = parts[:-2]
        for k in range(0, len(parts), 2):
            if k:
                row += parts[k - 1].count(b"\n")
                self.begins.append(len(self.rows))
            rows, words = self._divide_words(parts[k], row)
            self._add_rows(rows, row)
            row += parts[k].count(b"\n")
            if (k < len(parts) - 1 or self.words) and words.strip():
                self.skipped.setdefault("text between tables", row - words.count(b"\n"))
            elif len(words) > TAIL:  # a column of words
                self._add_rows(words, row - words.count(b"\n"))
            elif k == len(parts) - 1 and not self.words:
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
            end, begin = begin, text.rfind(b"\n", 0, begin)
        begin = stop = 0
        for found in _WORDS.finditer(text, 0, end + 1):
            begin, stop = begin if found.start() == stop else found.start(), found.end()
            below = lines[stop : lines.find(b"\n", stop) + 1]
            if not below or _WORDS.match(text, stop):
                continue
            words = self.text.decode(lines[begin:stop] + below).split("\n")[:-1]
            if is_other_table(words):
                self.skipped.setdefault(
                    "another table; palpate reads the largest", row + lines.count(b"\n", 0, begin)
                )
                return lines[:begin], b""
        return lines[:end], lines[end:]

    def _add_last_words(self, row: int) -> None:
        """Add the last lines if they have the cells of rows; else they are text below the table."""
        lines = self.text.decode(self.words).split("\n")[:-1]
        cells = [split_cells(line, self.layout.delimiter) for line in lines if line.strip(" ,;|\t")]
        if cells and all(len(each) == len(self.columns) for each in cells):
            self._add_rows(self.words, row)
        elif cells:
            self.skipped.setdefault("text below the table", row)

    def _add_rows(self, block: bytes, row: int) -> None:
        while block:
            cut = len(block) if len(block) < PIECE else block.rfind(b"\n", 0, PIECE) + 1
            cut = cut or block.find(b"\n") + 1
            for _ in range(MOST_LINES):  # a quoted cell may continue on the next line
                if block.count(b'"', 0, cut) % 2 == 0:
                    break
                cut = block.find(b"\n", cut) + 1 or len(block)
            piece, block = block[:cut], block[cut:]
            cells = self._divide_at_once(piece)
            if cells is not None:
                self._add_cells(range(row, row + len(cells[0])), cells)
            else:
                lines = self.text.decode(piece).split("\n")[:-1]
                records = list(self._records(lines, row, self._lose))
                if records:
                    rows, found = zip(*records, strict=True)
                    self._add_cells(rows, _transpose(found, len(self.columns)))
            row += piece.count(b"\n")

    def _add_cells(self, rows: Sequence[int], columns: Sequence[Sequence[str]]) -> None:
        keep = np.ones(len(rows), dtype=bool)
        for column, found in zip(self.columns, columns, strict=True):
            for k in column.rows_to_skip(found):
                if keep[k]:
                    self._lose(f"has no valid time in column {column.name!r}", rows[k], found[k])
                keep[k] = False
        if not keep.all():
            columns = [list(itertools.compress(found, keep)) for found in columns]
            rows = list(itertools.compress(rows, keep))
        for column, found in zip(self.columns, columns, strict=True):
            column.take(found)
        self.rows.append(rows)

    def _records(
        self, lines: Sequence[str], row: int, lose: Callable[[str, int], None]
    ) -> Iterator[tuple[int, list[str]]]:
        """Return row in the file and cells of each record; the first line is row ``row``."""
        width, delimiter = len(self.layout.header), self.layout.delimiter
        k = 0
        while k < len(lines):
            line, at = lines[k], row + k
            k += 1
            if "\0" in line:
                lose("contains zero bytes", at)
                continue
            if has_open_quote(line):
                end = next((j for j in range(k, min(k + MOST_LINES, len(lines)))
                            if has_open_quote(lines[j])), None)  # fmt: skip
                line = "" if end is None else "\n".join(lines[k - 1 : end + 1])
                # Two stray marks far apart do not enclose the rows between them.
                if end is None or len(split_cells(line, delimiter)) != width:
                    lose("has a quotation mark that is never closed", at)
                    continue
                k = end + 1
            cells = split_cells(line, delimiter)
            fitting = cells if len(cells) == width else pad_cells(cells, width)
            # Padding an almost empty row of a wide table would invent many cells.
            if width > WIDE and 2 * len(cells) < width:
                lose("has less than half as many cells as the header", at)
            elif fitting is None:
                lose("has more cells than the header", at)
            else:
                yield at, fitting

    def _parse_at_once(self, block: bytes) -> list[NDArray[Any]] | None:
        """The columns of lines of plain numbers; None if they hold anything else."""
        dtypes = [column.dtype for column in self.columns]
        if any(dtype is None for dtype in dtypes):
            return None
        delimiter = self.layout.delimiter
        if self.layout.decimal == ",":
            if b"." in block or delimiter == ",":
                return None
            block = block.replace(b",", b".")
        if delimiter == SPACES:
            lines = block.split(b"\n")[:-1]
            block = b"".join([b",".join(line.split()) + b"\n" for line in lines])
            delimiter = ","
        rows = block.count(b"\n")
        pattern = delimiter.encode() * (len(dtypes) - 1) + b"\n"
        if block.translate(None, _PLAIN) != pattern * rows:
            return None
        large = self.text.size > (HEAD if self.text.compressed else LARGE)
        parse = _parse_with_arrow if large and has_pyarrow() else _parse_with_numpy
        try:
            arrays = parse(block, delimiter, dtypes)
        except ValueError:  # pyarrow's own is one
            return None
        return arrays if len(arrays[0]) == rows else None  # both parsers skip blank lines

    def _divide_at_once(self, lines: bytes) -> list[list[str]] | None:
        """The cells of each column; None if a row is incomplete or a cell is quoted."""
        delimiter, width = self.layout.delimiter, len(self.columns)
        if delimiter == SPACES or b'"' in lines or b"\0" in lines or b"\r" in lines:
            return None
        rows = lines.count(b"\n")
        others = bytes(set(range(256)) - {*delimiter.encode(), *b"\n"})
        if lines.translate(None, others) != (delimiter.encode() * (width - 1) + b"\n") * rows:
            return None
        cells = self.text.decode(lines).replace("\n", delimiter).split(delimiter)
        return [cells[k : rows * width : width] for k in range(width)]

    def _is_cut_off(self, line: bytes, row: int, before: bytes) -> bool:
        """Whether the last line, without a line end, is incomplete; if so, count it as skipped."""
        text = self.text.decode(line)
        cells = list[str]()
        with suppress(csv.Error):  # a line end within a cell
            cells = [] if has_open_quote(text) else split_cells(text[:-1], self.layout.delimiter)
        killed = self.text.size % BUFFER == 0 and not self.text.compressed
        cut = len(cells) < len(self.columns) or killed or bool(self.text.losses)
        # Its last number may lack digits; compare its length with the numbers above.
        above = before[-TAIL:].split(b"\n")[1:-1]
        if not cut and len(above) > FEW:
            mark = None if self.layout.delimiter == SPACES else self.layout.delimiter.encode()
            ends = [len((each.rsplit(mark, 1) or [b""])[-1]) for each in above]
            cut = len((line[:-1].rsplit(mark, 1) or [b""])[-1]) < min(ends)
        if cut:
            self._lose("is cut off by the end of the file", row)
        return cut

    def recording(self) -> Recording:
        """Return the recording."""
        draft = Draft(self.request, notes=dict(self.layout.notes))
        channels, units = draft.channels, draft.units
        for column in self.columns:
            fault, made = column.fault(), column.channels()
            channels |= made
            if fault is not None:
                draft.faults |= dict.fromkeys(made, fault)
            if column.name in self.layout.units:
                units |= dict.fromkeys(made, self.layout.units[column.name])
            elif column.kind in ("dates", "nanoseconds"):
                units[column.name] = "ns"
        for name, values in channels.items():
            found = detect_epoch(values) if is_timelike(name) else None
            if found is not None and units.setdefault(name, found[0]) == found[0]:
                channels[name] = found[1]
        joined = join_stamps(channels)
        channels |= joined
        units |= dict.fromkeys(joined, "ns")
        for name in [each for each in channels if not self.request.wants(each)]:
            del channels[name]
            units.pop(name, None)
        has_numbers = any(values.dtype != object for values in channels.values())
        if len(self.begins) > 1 and has_numbers and "segment" not in channels:
            ends = [*self.begins[1:], len(self.rows)]
            parts = (self.rows[a:b] for a, b in zip(self.begins, ends, strict=True))
            lengths = [sum(map(len, part)) for part in parts]
            channels["segment"] = np.repeat(np.arange(1.0, len(lengths) + 1.0), lengths)
        if self.request.channels and not channels:
            source = self.request.source
            raise MissingChannelError(self.request.channels[0], self.layout.header, source)
        draft.losses = [
            f"{first} {what}; palpate skipped it"
            if count == 1
            else f"palpate skipped {count} rows, each of which {what}; the first is {first}"
            for what, (count, first) in self.lost.items()
        ]
        draft.losses += self.text.losses
        for line in self.layout.table.others:
            self.skipped.setdefault("another table; palpate reads the largest", line)
        for what, line in self.skipped.items():
            draft.omit(f"lines from {line} on", what)
        if ignored := ", ".join(each.name for each in self.columns if each.kind == "nothing"):
            draft.omit("columns not requested", ignored)
        if self.text.encoding != "utf-8":
            encoding = self.text.encoding.upper().replace("WINDOWS", "Windows")
            draft.notes["encoding"] = encoding
        rows = _concatenate_numbers(self.rows)
        settings, place = self.layout.settings, self.layout.place
        recording = replace(draft.done(rows), settings=settings, table=place)
        if draft.losses and not len(rows):
            where = f"; {place}" * bool(place)
            raise draft.error(f"no row can be read: {draft.losses[0]}{where}")
        return recording


def _strip_returns(lines: bytes) -> bytes:
    return re.sub(rb"\r+\n", b"\n", lines) if b"\r" in lines else lines


def _transpose(cells: Sequence[list[str]], width: int) -> list[Sequence[str]]:
    """The columns of rows."""
    return list(zip(*cells, strict=True)) if cells else [()] * width


def _concatenate_numbers(rows: Sequence[Sequence[int]]) -> Sequence[int]:
    """All row numbers in one sequence; a range if they are consecutive."""
    rows = [each for each in rows if len(each)]
    if not rows:
        return range(0)
    first, count = rows[0][0], sum(map(len, rows))
    if rows[-1][-1] - first + 1 == count:
        return range(first, first + count)
    joined: Any = np.concatenate([np.array(each, np.int64) for each in rows])
    return joined  # type: ignore[no-any-return]


def _parse_with_arrow(block: bytes, delimiter: str, dtypes: Sequence[Any]) -> list[NDArray[Any]]:
    arrow, csv = import_module("pyarrow"), import_module("pyarrow.csv")
    names = [str(k) for k in range(len(dtypes))]
    types = [arrow.float64() if dtype.kind == "f" else arrow.int64() for dtype in dtypes]
    table = csv.read_csv(
        arrow.BufferReader(block),
        csv.ReadOptions(column_names=names, block_size=len(block) + 1, use_threads=False),
        csv.ParseOptions(delimiter=delimiter, quote_char=False),
        csv.ConvertOptions(column_types=dict(zip(names, types, strict=True)), null_values=[]),
    )
    return [column.to_numpy() for column in table.columns]


def _parse_with_numpy(block: bytes, delimiter: str, dtypes: Sequence[Any]) -> list[NDArray[Any]]:
    table = np.loadtxt(
        io.TextIOWrapper(io.BytesIO(block), "ascii"),
        delimiter=delimiter,
        dtype=[(f"f{k}", dtype) for k, dtype in enumerate(dtypes)],
        ndmin=1,
        comments=None,
    )
    return [table[name].copy() for name in table.dtype.names or ()]
