"""Blocks of plain numbers to arrays at once, by pyarrow where it is installed, else by NumPy."""

import io
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.text.columns import Column
from palpate.recordings.text.encoding import Text
from palpate.recordings.text.layout import SPACES

# What a block of plain numbers is made of, beside the delimiter: nan and inf too. Of what else
# these bytes spell, the parsers make no number.
_PLAIN = b"0123456789+-.eE nNaAfFiI"


class Parser:
    """Parses blocks in which every row is whole and every cell a number.

    Parameters
    ----------
    delimiter, decimal : str
        See :class:`~palpate.recordings.text.layout.Layout`.
    columns : sequence of Column
        What the cells are of.
    large : bool
        Whether there is so much that pyarrow is worth the time to import it.
    """

    def __init__(
        self, delimiter: str, decimal: str, columns: Sequence[Column], *, large: bool
    ) -> None:
        self._delimiter, self._decimal = delimiter, decimal
        self._dtypes = [column.dtype for column in columns]
        self._parse = _by_arrow if large and _pyarrow_csv() is not None else _by_numpy

    def parsed_at_once(self, block: bytes) -> list[NDArray[Any]] | None:
        """Return the columns of some lines; None where they are not so plain."""
        if any(dtype is None for dtype in self._dtypes):  # NumPy says that None is float64
            return None
        delimiter = self._delimiter
        if block.startswith(b'"'):
            block, delimiter = _unquoted(block, delimiter, len(self._dtypes))
        if self._decimal == ",":
            if b"." in block or delimiter == ",":
                return None
            block = block.replace(b",", b".")
        if delimiter == SPACES:
            lines = block.split(b"\n")[:-1]
            block = b"".join([b",".join(line.split()) + b"\n" for line in lines])
            delimiter = ","
        rows = block.count(b"\n")
        pattern = delimiter.encode() * (len(self._dtypes) - 1) + b"\n"
        if block.translate(None, _PLAIN) != pattern * rows:
            return None
        try:
            arrays = self._parse(block, delimiter, self._dtypes)
        except ValueError:  # pyarrow's own is one
            return None
        return arrays if len(arrays[0]) == rows else None  # both pass over blank lines

    def divided_at_once(self, lines: bytes, text: Text) -> list[list[str]] | None:
        """Return the cells of each column; None where a row is not whole, or a cell is quoted."""
        mark = self._delimiter.encode()
        if self._delimiter == SPACES or b'"' in lines or b"\0" in lines or b"\r" in lines:
            return None
        width, rows = len(self._dtypes), lines.count(b"\n")
        others = bytes(set(range(256)) - {*mark, *b"\n"})
        if lines.translate(None, others) != (mark * (width - 1) + b"\n") * rows:
            return None
        cells = text.decode(lines).replace("\n", self._delimiter).split(self._delimiter)
        return [cells[k : rows * width : width] for k in range(width)]


def _unquoted(block: bytes, delimiter: str, width: int) -> tuple[bytes, str]:
    """Rows without quotation marks, and what is between their cells then, where all have them.

    As they are where that is not so, or not sure.
    """
    rows, between = block.count(b"\n"), b'"%b"' % delimiter.encode()
    sure = (
        delimiter != SPACES
        and b";" not in block.replace(between, b"")
        and block.count(b'"') == 2 * width * rows
        and block.count(between) == (width - 1) * rows
        and block.count(b'"\n"') == rows - 1
        and block.endswith(b'"\n')
    )
    return (block.replace(between, b";").replace(b'"', b""), ";") if sure else (block, delimiter)


def _by_arrow(block: bytes, delimiter: str, dtypes: Sequence[Any]) -> list[NDArray[Any]]:
    arrow, csv = import_module("pyarrow"), _pyarrow_csv()
    names = [str(k) for k in range(len(dtypes))]
    types = [arrow.float64() if dtype.kind == "f" else arrow.int64() for dtype in dtypes]
    table = csv.read_csv(
        arrow.BufferReader(block),
        csv.ReadOptions(column_names=names, block_size=len(block) + 1, use_threads=False),
        csv.ParseOptions(delimiter=delimiter, quote_char=False),
        csv.ConvertOptions(column_types=dict(zip(names, types, strict=True)), null_values=[]),
    )
    return [column.to_numpy() for column in table.columns]


def _by_numpy(block: bytes, delimiter: str, dtypes: Sequence[Any]) -> list[NDArray[Any]]:
    same = len(set(dtypes)) == 1
    table = np.loadtxt(
        io.TextIOWrapper(io.BytesIO(block), "ascii"),
        delimiter=delimiter,
        dtype=dtypes[0] if same else [(f"f{k}", dtype) for k, dtype in enumerate(dtypes)],
        ndmin=2 if same else 1,
        comments=None,
    )
    if same:
        return list(table.T)
    return [table[f"f{k}"] for k in range(len(dtypes))]


@cache
def _pyarrow_csv() -> Any:
    """The module, or None where it is not installed."""
    try:
        return import_module("pyarrow.csv")
    except ImportError:
        return None
