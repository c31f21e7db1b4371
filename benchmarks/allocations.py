"""Memory that one update() allocates: none, neither kept nor temporary."""

import sys
import tracemalloc
from collections.abc import Callable, Sequence
from typing import Any

from benchmarks.calls import KINDS
from benchmarks.motion import contact_samples
from benchmarks.report import Limit, Row, Section
from palpate import ContactEstimator

CALLS = 100_000


def passing_bytes(update: Callable[..., Any], samples: Sequence[Any]) -> int:
    """Return the peak of the bytes held during the calls, minus those held before."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        for sample in samples:
            update(*sample)
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


def kept_blocks(update: Callable[..., Any], samples: Sequence[Any]) -> int:
    """Return the blocks of the interpreter's memory in use after the calls, minus those before."""
    before = sys.getallocatedblocks()
    for sample in samples:
        update(*sample)
    return sys.getallocatedblocks() - before


def _nothing(penetration: float, velocity: float, force: float) -> None:
    pass


def count_allocations(kinds: Sequence[type[ContactEstimator]] = KINDS) -> Section:
    """Count for some estimators, in contact and out of it; the larger counts."""
    contact = contact_samples(CALLS)
    free = [(-penetration, velocity, 0.0) for penetration, velocity, _ in contact]
    rows = []
    for kind in kinds:
        update = kind().update
        update(*contact[0])
        passing, kept = 0, 0
        for samples in (contact, free):
            # Minus what the counting itself allocates, a number or two.
            own = passing_bytes(_nothing, samples), kept_blocks(_nothing, samples)
            passing = max(passing, passing_bytes(update, samples) - own[0])
            kept = max(kept, kept_blocks(update, samples) - own[1])
        name = f"{kind.__name__}.update"
        rows.append(Row(f"{name}: passing", passing, "bytes", limit=Limit(0)))
        rows.append(Row(f"{name}: kept", kept, "blocks", limit=Limit(0)))
    notes = [
        f"{CALLS} calls in contact and {CALLS} out of it. Passing: tracemalloc's peak during "
        "the calls, minus its value at the start. Kept: sys.getallocatedblocks() after the calls "
        "minus before.",
    ]
    return Section("Allocations of update()", rows, notes)
