"""Many recordings or seeds on every core."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from rich.console import Console
from rich.progress import track

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers:
    """Processes that run one function of many items; each with one thread.

    Parameters
    ----------
    count : int, optional
        Number of processes. Default: one per core.
    seeds : int
        Number of seeds that :meth:`repeat` runs.
    """

    def __init__(self, count: int | None = None, seeds: int = 0) -> None:
        self.seeds = seeds
        self._count = count or os.cpu_count() or 1
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        self._pool = ProcessPoolExecutor(self._count, mp_context=get_context("spawn"))

    def each(
        self, label: str, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[Result]:
        """Yield function(item) for every item, in their order, with progress on standard error."""
        size = max(1, min(16, len(items) // (8 * self._count)))
        results = self._pool.map(function, items, chunksize=size)
        console = Console(stderr=True)
        yield from track(results, label, len(items), console=console, transient=True)

    def map(
        self, label: str, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> list[Result]:
        """Return function(item) for every item, in their order."""
        return list(self.each(label, function, items))

    def repeat(self, label: str, function: Callable[[int], Result]) -> list[Result]:
        """Return function(seed) for every seed."""
        return self.map(label, function, range(self.seeds))


def in_new_process(function: Callable[..., Result], *arguments: object) -> Result:
    """Return function(*arguments) of a new process, whose peak memory is that of this call."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()
