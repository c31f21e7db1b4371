"""One way through a text file: its layout, then its rows, block by block, into columns."""

import csv
import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from palpate.recordings.formats import Request
from palpate.recordings.recording import printable
from palpate.recordings.sources import Source
from palpate.recordings.text import encoding
from palpate.recordings.text.cells import cells_of, unclosed
from palpate.recordings.text.columns import Column, Ignored, column_for
from palpate.recordings.text.encoding import Text
from palpate.recordings.text.layout import SPACES, Layout, layout_of
from palpate.recordings.text.parsing import Parser
from palpate.recordings.text.rows import Losses, Records, Rows

HEAD = 1 << 18  # bytes in which the header is looked for, before all of the first block is
PROBED = 1000  # lines that say what the columns hold
# Of these many bytes and rows each cell is an object for a while, some five times its text.
PIECE = 1 << 19
ROWS = 4096
# Whoever is killed while writing leaves what buffers of this size have handed over.
BUFFER = 4096
# A last cell that is shorter than all of so many above it most likely lacks its end.
FEW = 20
TAIL = 1 << 16  # bytes


class Filling:
    """A file that is read into columns.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.
    kinds : mapping
        What columns hold, ``"numbers"`` or ``"text"``, where their first rows do not say it.
    """

    def __init__(self, path: Path, request: Request, kinds: Mapping[str, str]) -> None:
        self.source = printable(path)
        self.columns: list[Column] = []
        self.rows = Rows()
        self.losses = Losses(self.source, request.strict)
        self.text = Text(iter(()), self.source)
        self._file = Source(path)
        self._request = request
        self._kinds = kinds
        self._left: list[str] = []  # lines of a quotation that has not ended yet

    def run(self) -> Layout:
        """Read all of it.

        Raises
        ------
        RecordingError
            It cannot be read, or something is lost and ``strict`` is asked for.
        """
        self.text.chunks = iter(self._file)
        blocks = self.text.blocks()
        first = next(blocks, b"")
        layout = self._begin(first)
        offset = 0
        for _ in range(layout.first):
            offset = first.find(b"\n", offset) + 1
        row = layout.first + 1
        for block in itertools.chain([first[offset:]], blocks):
            last = b""
            if self.text.cut_off and block:
                begin = block.rfind(b"\n", 0, -1) + 1
                block, last = block[:begin], block[begin:]
            self._add(block, row)
            row += block.count(b"\n")
            if last and not self._is_cut_off(last, row, block):
                self._add(last, row)
                row += 1
            self._request.report(self._file.fraction)
        self._add_lines([], row, final=True)
        for sentence in (*self._file.losses, *self.text.losses):
            self.losses.say(sentence)
        return layout

    def _begin(self, first: bytes) -> Layout:
        """Find the layout, and what the columns hold."""
        head = first[: first.rfind(b"\n", 0, HEAD) + 1]
        lines = self.text.decode(head).split("\n")[:-1]
        layout = layout_of(lines, self.source) if lines else None
        if layout is None or layout.first >= len(lines) - 1:  # long notes; or nothing below them
            lines = self.text.decode(first).split("\n")[:-1]
            layout = layout_of(lines, self.source)
        width = len(layout.header)
        self._decimal, self._delimiter = layout.decimal, layout.delimiter
        self._records = Records(layout.delimiter, width, self.losses)
        trial = Records(layout.delimiter, width, Losses(self.source, strict=False))
        probed = lines[layout.first : layout.first + PROBED]
        cells = [found for _, found in trial.of(probed, 0)]
        for name, found in zip(layout.header, _turned(cells, width), strict=True):
            if self._request.wants(name):
                kind = self._kinds.get(name)
                self.columns.append(column_for(name, found, layout.decimal, kind))
            else:
                self.columns.append(Ignored(name, layout.decimal))
        large = self._file.size > (HEAD if self._file.compressed else encoding.BLOCK)
        self._parser = Parser(layout.delimiter, layout.decimal, self.columns, large=large)
        return layout

    def _add(self, block: bytes, row: int) -> None:
        arrays = None if self._left or not block else self._parser.parsed_at_once(block)
        if arrays is not None:
            for column, values in zip(self.columns, arrays, strict=True):
                column.extend(values)
            self.rows.add(row, len(arrays[0]))
            return
        while block:
            cut = len(block) if len(block) < PIECE else block.rfind(b"\n", 0, PIECE) + 1
            cut = cut or block.find(b"\n") + 1
            piece, block = block[:cut], block[cut:]
            self._add_piece(piece, row)
            row += piece.count(b"\n")

    def _add_piece(self, piece: bytes, row: int) -> None:
        cells = None if self._left else self._parser.divided_at_once(piece, self.text)
        if cells is not None:
            self._add_cells(range(row, row + len(cells[0])), cells)
        else:
            self._add_lines(self.text.decode(piece).split("\n")[:-1], row)

    def _add_lines(self, lines: list[str], row: int, *, final: bool = False) -> None:
        row -= len(self._left)
        lines = self._left + lines
        records = self._records.of(lines, row, final=final)
        while chunk := list(itertools.islice(records, ROWS)):
            rows, cells = zip(*chunk, strict=True)
            self._add_cells(rows, _turned(cells, len(self.columns)))
        self._left = self._records.left

    def _add_cells(self, rows: Sequence[int], columns: Sequence[Sequence[str]]) -> None:
        keep = np.ones(len(rows), dtype=bool)
        for column, found in zip(self.columns, columns, strict=True):
            for k in column.refused(found):
                if keep[k]:
                    self.losses.add(f"holds no time in column {column.name!r}", rows[k])
                keep[k] = False
        if not keep.all():
            columns = [list(itertools.compress(found, keep)) for found in columns]
            rows = list(itertools.compress(rows, keep))
        for column, found in zip(self.columns, columns, strict=True):
            column.take(found)
        if isinstance(rows, range):
            self.rows.add(rows.start, len(rows))
        else:
            for row in rows:
                self.rows.add(row, 1)

    def _is_cut_off(self, line: bytes, row: int, before: bytes) -> bool:
        """Whether the last line, which has no end, was not written whole; that is said."""
        text = self.text.decode(line)
        cells = list[str]()
        with suppress(csv.Error):  # an end of line within it
            cells = [] if unclosed(text) else cells_of(text[:-1], self._delimiter)
        killed = self._file.size % BUFFER == 0 and not self._file.compressed
        cut = len(cells) < len(self.columns) or killed or bool(self._file.losses)
        # Its last number may lack digits, which only others of its kind can tell.
        above = before[-TAIL:].split(b"\n")[1:-1]
        if not cut and len(above) > FEW:
            mark = None if self._delimiter == SPACES else self._delimiter.encode()
            ends = [len((each.rsplit(mark, 1) or [b""])[-1]) for each in above]
            cut = len((line[:-1].rsplit(mark, 1) or [b""])[-1]) < min(ends)
        if cut:
            self.losses.add("is cut off, for the file ends within it", row)
        return cut


def _turned(cells: Sequence[list[str]], width: int) -> list[Sequence[str]]:
    """The columns of some rows."""
    return list(zip(*cells, strict=True)) if cells else [()] * width
