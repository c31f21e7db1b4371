"""Many seeds on every core, or on a cluster, with a progress bar that can be interrupted."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, as_completed
from contextlib import ExitStack
from types import TracebackType
from typing import Any, Self, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from palpate.fleet.running import open_client
from palpate.fleet.tasks import cores

Item = TypeVar("Item")
Result = TypeVar("Result")


class Campaign:
    """Runs functions of a seed on Dask workers, as a fleet does.

    Parameters
    ----------
    seeds : int
        Number of seeds of a row, unless the row sets its own.
    workers : int, optional
        Number of processes. Default: one per core.
    scheduler : str, optional
        Address of a Dask scheduler whose workers can import the benchmarks.
    """

    def __init__(
        self, seeds: int, workers: int | None = None, scheduler: str | None = None
    ) -> None:
        self.seeds = seeds
        self._workers = workers or cores()
        self._scheduler = scheduler
        self._stack = ExitStack()
        self._pool: Any = None
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=Console(stderr=True),
        )

    def __enter__(self) -> Self:
        client = open_client(workers=self._workers, scheduler=self._scheduler)
        self._pool = self._stack.enter_context(client).get_executor(pure=False)
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._progress.stop()
        self._pool.shutdown(wait=kind is None)
        self._stack.close()

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
