"""All experiments and seeds on all cores; what is finished stays, whatever happens then."""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from palpate.errors import PalpateError
from palpate.paper import outcomes as on_disk
from palpate.paper.experiment import Experiment, Outcome
from palpate.paper.report.contents import Report, Section
from palpate.paper.report.writing import write_report
from palpate.paper.workers import Failure, Result, drawn, measured, processes
from palpate.writing import make_folder

#: Told what has just been finished, and how many of how many outcomes and figures are.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class _Task:
    """One seed of experiments that press the same, or one's figure where ``seed`` is None."""

    experiments: tuple[Experiment, ...]
    seed: int | None


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
    drawn: set[str] = field(default_factory=set)
    failures: list[str] = field(default_factory=list)
    reused: int = 0

    def resume(self) -> None:
        """Read the outcomes that an earlier run by the same code has left."""
        for experiment in self.experiments:
            for seed in range(self.seeds):
                outcome = on_disk.read(self.folder, experiment, seed)
                if outcome is not None:
                    self.outcomes[experiment.name, seed] = outcome
            if on_disk.figures_are_current(self.folder, experiment, self.seeds):
                self.drawn.add(experiment.name)
        self.reused = len(self.outcomes)

    def work(self, workers: int, progress: Progress) -> None:
        """Do all that is missing; a failure is noted, and the rest goes on."""
        waiting = deque(self._missing())
        if not waiting:
            return
        with processes(min(workers, len(waiting))) as pool:
            pending: dict[Future[list[Result]], _Task] = {}
            while waiting or pending:
                # No more than keeps the workers busy: a figure is drawn as soon as it can be.
                while waiting and len(pending) <= workers:
                    task = waiting.popleft()
                    pending[self._submitted(pool.submit, task)] = task
                finished = wait(pending, return_when=FIRST_COMPLETED).done
                # In the order of the work: what was finished first is written down first.
                for future in [each for each in pending if each in finished]:
                    waiting.extendleft(self._settled(pending.pop(future), future, progress))

    def _missing(self) -> Iterator[_Task]:
        """One group after the other, so that an interrupted run has finished some experiments."""
        groups = sorted(self.experiments, key=lambda each: each.group)
        for _, together in groupby(groups, key=lambda each: each.group):
            members = tuple(together)
            yield from (_Task((each,), None) for each in members if self._can_be_drawn(each))
            for seed in range(self.seeds):
                left = tuple(each for each in members if (each.name, seed) not in self.outcomes)
                if left:
                    yield _Task(left, seed)

    def _submitted(
        self, submit: Callable[..., Future[list[Result]]], task: _Task
    ) -> Future[list[Result]]:
        try:
            if task.seed is not None:
                return submit(measured, task.experiments, task.seed)
            return submit(drawn, task.experiments[0], self._of(task.experiments[0]))
        except BrokenExecutor as error:  # another worker died
            failed: Future[list[Result]] = Future()
            failed.set_exception(error)
            return failed

    def _settled(
        self, task: _Task, future: Future[list[Result]], progress: Progress
    ) -> list[_Task]:
        """Write down what a task gave; return what can be drawn now."""
        try:
            results = future.result()
        except Exception as error:  # a worker that died
            failure = Failure(f"{type(error).__name__}: {error}")
            results = [failure for _ in task.experiments]
        figures = []
        for experiment, result in zip(task.experiments, results, strict=True):
            name = experiment.name
            what = f"{name}, {'figure' if task.seed is None else f'seed {task.seed}'}"
            if isinstance(result, Failure):
                self.failures.append(f"{what}: {result.words}")
            elif isinstance(result, Outcome):
                # Known before it is written: an interrupt may come while the disk takes its time,
                # and the page then counts every outcome that is there.
                self.outcomes[name, result.seed] = result
                on_disk.write(self.folder, experiment, result)
                if self._can_be_drawn(experiment):
                    figures.append(_Task((experiment,), None))
            else:
                on_disk.write_figures(self.folder, experiment, self.seeds, result)
                self.drawn.add(name)
            progress(what, len(self.outcomes) + len(self.drawn), self.total)
        return figures

    @property
    def total(self) -> int:
        """Outcomes and figures of a whole run."""
        return len(self.experiments) * (self.seeds + 1)

    def _of(self, experiment: Experiment) -> list[Outcome]:
        every = (self.outcomes.get((experiment.name, seed)) for seed in range(self.seeds))
        return [outcome for outcome in every if outcome is not None]

    def _can_be_drawn(self, experiment: Experiment) -> bool:
        return experiment.name not in self.drawn and len(self._of(experiment)) == self.seeds

    def report(self) -> Report:
        """Return what is finished, and the names of what is not."""
        sections, unfinished = [], []
        for experiment in self.experiments:
            outcomes = self._of(experiment)
            if experiment.name in self.drawn and len(outcomes) == self.seeds:
                sections.append(Section.of(experiment, outcomes))
            else:
                words = f"{experiment.name} ({len(outcomes)} of {self.seeds} seeds)"
                unfinished.append(words)
        return Report(tuple(sections), self.seeds, tuple(unfinished), tuple(self.failures))


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
        Told after each outcome and figure; and once before any, with what is reused.

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
    run.resume()
    begun(run)
    try:
        run.work(workers or os.cpu_count() or 1, progress)
    finally:
        report = run.report()
        write_report(report, folder)
    if run.failures:
        more = f" (and {len(run.failures) - 1} more)" if len(run.failures) > 1 else ""
        raise PalpateError(f"{run.failures[0]}{more}; the rest is in {folder / 'report.html'}")
    return report
