"""Many seeds on every core, with a progress bar that can be interrupted."""

import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from types import TracebackType
from typing import Self, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

Item = TypeVar("Item")
Result = TypeVar("Result")


class Campaign:
    """Runs functions of a seed in worker processes.

    Parameters
    ----------
    seeds : int
        How many seeds a row uses, unless it says otherwise.
    workers : int, optional
        Processes; the cores unless given.
    """

    def __init__(self, seeds: int, workers: int | None = None) -> None:
        self.seeds = seeds
        self._workers = workers or os.cpu_count() or 1
        self._pool = ProcessPoolExecutor(
            self._workers, mp_context=get_context("spawn"), initializer=_leave_interrupts
        )
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=Console(stderr=True),
        )

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._progress.stop()
        self._pool.shutdown(wait=kind is None, cancel_futures=True)
        if kind is not None:
            # Workers ignore an interrupt so that it is reported once; nothing waits for theirs.
            for process in list((self._pool._processes or {}).values()):
                process.terminate()

    def map(
        self, label: str, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> list[Result]:
        """Return function(item) for every item, in their order."""
        size = max(1, min(16, len(items) // (8 * self._workers)))
        task = self._progress.add_task(label, total=len(items))
        chunks: dict[Future[list[Result]], int] = {}
        for start in range(0, len(items), size):
            future = self._pool.submit(_each, function, items[start : start + size])
            chunks[future] = start
        done: dict[int, list[Result]] = {}
        for future in as_completed(chunks):
            done[chunks[future]] = future.result()
            self._progress.advance(task, len(done[chunks[future]]))
        self._progress.remove_task(task)
        return [result for start in sorted(done) for result in done[start]]


def _each(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    return [function(item) for item in items]


def _leave_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
