"""Interleaved timing: every case once a round, so that a slow second affects all of them."""

import gc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import Progress

#: Runs a case once and returns the seconds that one item of it took.
Case = Callable[[], float]


@dataclass(frozen=True)
class Effort:
    """The size of each measurement."""

    call_rounds: int = 80
    replay_rounds: int = 30
    peer_rounds: int = 12
    start_rounds: int = 15
    replay_samples: int = 100_000
    memory_minutes: tuple[int, int] = (15, 60)

    @classmethod
    def quick(cls) -> "Effort":
        """Short runs that show the order of magnitude."""
        return cls(8, 4, 2, 3, 20_000, (1, 4))


class Clock:
    """Runs cases in rounds, and shows its progress on standard error."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def rounds(self, title: str, cases: Mapping[str, Case], rounds: int) -> dict[str, list[float]]:
        """Return the seconds an item of each case, for each round."""
        times: dict[str, list[float]] = {name: [] for name in cases}
        task = self._progress.add_task(title, total=rounds)
        for _ in range(rounds):
            for name, case in cases.items():
                gc.collect()
                gc.disable()  # as timeit does, for all cases
                try:
                    times[name].append(case())
                finally:
                    gc.enable()
            self._progress.advance(task)
            self._progress.refresh()
        return times

    def best(
        self, title: str, cases: Mapping[str, Case], rounds: int, *, passes: int = 2
    ) -> dict[str, float]:
        """Return the shortest of the rounds, because other processes only ever add time.

        A case runs ``passes`` times in its turn, because the one before left the caches cold.
        """
        warm = {name: _least(case, passes) for name, case in cases.items()}
        return {name: min(times) for name, times in self.rounds(title, warm, rounds).items()}


def _least(case: Case, passes: int) -> Case:
    return lambda: min(case() for _ in range(passes))


@contextmanager
def clock() -> Iterator[Clock]:
    """Open a clock; it draws nothing while a case runs."""
    console = Console(stderr=True)
    with Progress(console=console, auto_refresh=False, transient=True) as progress:
        yield Clock(progress)
