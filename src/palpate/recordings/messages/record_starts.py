"""Where records begin that follow one another, each of which says its own size."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.recordings.messages.layout import Bytes

Starts: TypeAlias = NDArray[np.int64]

_FIRST_TRY = 16  # records, before a pattern is looked for
_NEXT_TRY = 512  # after one was looked for and not found
_LONGEST_PATTERN = 8


def record_starts(
    data: bytes,
    position: int,
    size_at: Callable[[bytes, int], int],
    heads_at: Callable[[bytes, int], list[tuple[int, int]]],
) -> tuple[Starts, int]:
    """Return where the whole records of a block begin, one after another, and where they end.

    Messages that come in turn (a wrench, a pose, a wrench, …) are found many at a time: a pattern
    of sizes that has come twice is tried on all that follows.

    Parameters
    ----------
    data : bytes
        The block.
    position : int
        Where the first one begins.
    size_at : callable
        The size of the record that begins at a place; 0 where it is not whole.
    heads_at : callable
        Which bytes of the record at a place say its kind and size: from where in it, and how many.
    """
    view = np.frombuffer(data, np.uint8)
    pieces: list[Starts] = []
    starts: list[int] = []
    next_try = _FIRST_TRY
    while size := size_at(data, position):
        starts.append(position)
        position += size
        if len(starts) == next_try:
            run = _run(view, np.array([*starts[-_FIRST_TRY:], position]), data, heads_at)
            next_try += _NEXT_TRY
            if len(run):
                pieces += [np.array(starts, np.int64), run]
                position = int(run[-1]) + size_at(data, int(run[-1]))
                starts, next_try = [], _FIRST_TRY
    pieces.append(np.array(starts, np.int64))
    return np.concatenate(pieces), position


def _run(
    view: Bytes,
    bounds: Starts,
    data: bytes,
    heads_at: Callable[[bytes, int], list[tuple[int, int]]],
) -> Starts:
    """Records that go on as the last ones did, in a pattern of up to eight sizes."""
    sizes = np.diff(bounds)
    period = next((p for p in range(1, _LONGEST_PATTERN + 1) if (sizes[p:] == sizes[:-p]).all()), 0)
    end = int(bounds[-1])
    stride = int(sizes[-period:].sum())
    rounds = (len(view) - end) // stride
    if not (period and rounds):  # the block ends before the pattern comes again
        return np.empty(0, np.int64)
    offsets = bounds[-1 - period : -1] - bounds[-1 - period]
    same = np.ones(rounds, bool)
    for offset in offsets.tolist():
        model = end - stride + offset
        for begin, count in heads_at(data, model):
            want = view[model + begin : model + begin + count]
            place = end + offset + begin
            found = np.ndarray((rounds, count), np.uint8, view, place, (stride, 1))
            same &= (found == want).all(axis=1)
    whole = rounds if same.all() else int(np.argmin(same))
    rows: Starts = end + stride * np.arange(whole, dtype=np.int64)[:, None] + offsets
    return rows.ravel()
