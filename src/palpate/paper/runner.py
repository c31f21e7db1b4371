"""All experiments and seeds on all cores; what is finished stays, whatever happens then."""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from palpate.errors import PalpateError
from palpate.paper import outcomes as on_disk
from palpate.paper.experiment import Experiment, Outcome, Table
from palpate.paper.report.contents import Report, Section
from palpate.paper.report.verdicts import judge
from palpate.paper.report.writing import write_report
from palpate.paper.workers import (
    Drawing,
    Failure,
    drawn,
    measured,
    portable,
    processes,
)
from palpate.writing import make_folder, write_text

#: Told what has just been finished, and how many of how many tasks are.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class _Task:
    """One seed of an experiment, or its figure where ``seed`` is None."""

    experiment: Experiment
    seed: int | None

    def __str__(self) -> str:
        what = "figure" if self.seed is None else f"seed {self.seed}"
        return f"{self.experiment.name}, {what}"


@dataclass(slots=True)
class PaperRun:
    """Experiments under way.

    Parameters
    ----------
    experiments : sequence of Experiment
        What to run, in the order of the report.
    seeds : int
        How many: 0, 1, …
    folder : Path
        Where everything is written.
    """

    experiments: Sequence[Experiment]
    seeds: int
    folder: Path
    outcomes: dict[tuple[str, int], Outcome] = field(default_factory=dict)
    tables: dict[str, tuple[Table, ...]] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    reused: int = 0

    def take_over(self) -> None:
        """Read the outcomes that an earlier run by the same code has left."""
        for seed in range(self.seeds):
            for experiment in self.experiments:
                outcome = on_disk.read(self.folder, experiment, seed)
                if outcome is not None:
                    self.outcomes[experiment.name, seed] = outcome
        for experiment in self.experiments:
            tables = on_disk.read_tables(self.folder, experiment, self.seeds)
            if tables is not None and self._complete(experiment):
                self.tables[experiment.name] = tables
        self.reused = len(self.outcomes)

    def work(self, pool: ProcessPoolExecutor, workers: int, progress: Progress) -> None:
        """Do all that is missing; a failure is noted, and the rest goes on."""
        total = len(self.experiments) * (self.seeds + 1)
        done = self.reused + len(self.tables)
        waiting = deque(self._at_hand())
        pending: dict[Future[Any], _Task] = {}
        while waiting or pending:
            # No more than keeps the workers busy, so that a figure is drawn as soon as it can be.
            while waiting and len(pending) <= workers:
                task = waiting.popleft()
                pending[_submitted(pool, task, self._of(task.experiment))] = task
            finished = wait(pending, return_when=FIRST_COMPLETED).done
            # In the order of the work, so that what was finished first is written down first.
            for future in [each for each in pending if each in finished]:
                task = pending.pop(future)
                done += 1
                settled = self._settled(task, future)
                if settled and task.seed is not None and self._complete(task.experiment):
                    waiting.appendleft(_Task(task.experiment, None))
                progress(str(task), done, total)

    def _at_hand(self) -> Iterator[_Task]:
        """One experiment after the other, so that an interrupted run has finished some."""
        for experiment in self.experiments:
            if self._complete(experiment) and experiment.name not in self.tables:
                yield _Task(experiment, None)
            for seed in range(self.seeds):
                if (experiment.name, seed) not in self.outcomes:
                    yield _Task(experiment, seed)

    def _settled(self, task: _Task, future: Future[Any]) -> bool:
        """Write down what a task gave; False where it failed."""
        try:
            result = future.result()
        except Exception as error:  # a worker that died
            result = Failure(f"{type(error).__name__}: {error}")
        if isinstance(result, Failure):
            self.failures.append(f"{task}: {result.words}")
            return False
        if task.seed is None:
            self._keep(task.experiment, result)
        else:
            # Known before it is written: an interrupt may come while the disk takes its time, and
            # the page then counts every outcome that is there.
            self.outcomes[task.experiment.name, task.seed] = on_disk.from_text(result)
            on_disk.write(self.folder, task.experiment.name, task.seed, result)
        return True

    def _keep(self, experiment: Experiment, drawing: Drawing) -> None:
        light, dark = on_disk.figures_of(self.folder, experiment.name)
        write_text(light, drawing.light)
        write_text(dark, drawing.dark)
        on_disk.write_tables(self.folder, experiment, self.seeds, drawing.tables)
        self.tables[experiment.name] = drawing.tables
        self.write()

    def _of(self, experiment: Experiment) -> list[Outcome]:
        every = (self.outcomes.get((experiment.name, seed)) for seed in range(self.seeds))
        return [outcome for outcome in every if outcome is not None]

    def _complete(self, experiment: Experiment) -> bool:
        return len(self._of(experiment)) == self.seeds

    def report(self) -> Report:
        """Return what is finished, and the names of what is not."""
        sections, unfinished = [], []
        for experiment in self.experiments:
            name, outcomes = experiment.name, self._of(experiment)
            if name in self.tables:
                judgements = judge(experiment, outcomes)
                sections.append(Section(experiment, tuple(outcomes), self.tables[name], judgements))
            else:
                unfinished.append(f"{name} ({len(outcomes)} of {self.seeds} seeds)")
        return Report(tuple(sections), self.seeds, tuple(unfinished), tuple(self.failures))

    def write(self) -> None:
        """Write the page, the JSON and the table of claims of what is finished."""
        write_report(self.report(), self.folder)


def _submitted(pool: ProcessPoolExecutor, task: _Task, outcomes: list[Outcome]) -> Future[Any]:
    sent = portable(task.experiment)
    try:
        if task.seed is not None:
            return pool.submit(measured, sent, task.seed)
        return pool.submit(drawn, sent, outcomes)
    except BrokenExecutor as error:  # another worker died
        failed: Future[Any] = Future()
        failed.set_exception(error)
        return failed


def run_paper(
    experiments: Sequence[Experiment],
    *,
    seeds: int,
    folder: Path,
    workers: int | None = None,
    progress: Progress = lambda words, done, total: None,
    begun: Callable[[PaperRun], None] = lambda run: None,
) -> Report:
    """Run experiments over seeds, write everything to a folder, and resume what it holds.

    Parameters
    ----------
    experiments : sequence of Experiment
        In the order of the report.
    seeds : int
        How many, ≥ 1.
    folder : Path
        Made if it is not there.
    workers : int, optional
        Processes; as many as there are cores unless given.
    progress, begun : callable, optional
        Told after each task; and once before any, with what was taken over.

    Raises
    ------
    RecordingError
        The folder cannot be written to; said before the work starts.
    PalpateError
        Some experiments failed; the others are in the report all the same.
    """
    for wanted in (folder, folder / "outcomes"):
        make_folder(wanted)
    run = PaperRun(experiments, seeds, folder)
    run.take_over()
    begun(run)
    count = workers or os.cpu_count() or 1
    # Sessions are for this run only: another may be of other code.
    with (
        TemporaryDirectory(prefix="palpate-") as sessions,
        processes(count, Path(sessions)) as pool,
    ):
        try:
            run.work(pool, count, progress)
        finally:
            run.write()
    if run.failures:
        more = f" (and {len(run.failures) - 1} more)" if len(run.failures) > 1 else ""
        raise PalpateError(f"{run.failures[0]}{more}; the rest is in {folder / 'report.html'}")
    return run.report()
