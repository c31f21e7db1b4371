"""All experiments and seeds on all cores; what is finished stays, whatever happens then."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from palpate.errors import PalpateError
from palpate.paper import outcomes as on_disk
from palpate.paper.experiment import Experiment, Outcome
from palpate.paper.report.contents import Report, Section
from palpate.paper.report.writing import write_report
from palpate.paper.workers import Failure, Given, Result, perform, processes
from palpate.writing import check_own, make_folder

#: Told what has just been finished, and how many of how many outcomes and figures are.
Progress = Callable[[str, int, int], None]
#: Experiments, and what to do with them.
Task = tuple[tuple[Experiment, ...], Given]


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
        for each in self.experiments:
            found = (on_disk.read(self.folder, each, seed) for seed in range(self.seeds))
            self.outcomes |= {(each.name, outcome.seed): outcome for outcome in found if outcome}
            if on_disk.figures_are_current(self.folder, each, self.seeds):
                self.drawn.add(each.name)
        self.reused = len(self.outcomes)

    def work(self, workers: int, progress: Progress) -> None:
        """Do all that is missing; a failure is noted, and the rest goes on."""
        tasks = [*self._measurements(), *self._drawings(self.experiments)]
        if not tasks:
            return
        with processes(min(workers, len(tasks))) as pool:
            pending = {pool.submit(perform, *task): task for task in tasks}
            while pending:
                # In the order of the work: what was finished first is written down first.
                finished = wait(pending, return_when=FIRST_COMPLETED).done
                for future in [each for each in pending if each in finished]:
                    experiments, given = pending.pop(future)
                    self._settle(experiments, given, future, progress)
                    with suppress(BrokenExecutor):  # a worker died: what it did is among failures
                        for task in self._drawings(experiments) if isinstance(given, int) else ():
                            pending[pool.submit(perform, *task)] = task

    def _measurements(self) -> Iterator[Task]:
        """Each seed of each group, one group after the other, without what is there already."""
        for group in sorted({each.group for each in self.experiments}):
            members = [each for each in self.experiments if each.group == group]
            for seed in range(self.seeds):
                left = tuple(each for each in members if (each.name, seed) not in self.outcomes)
                if left:
                    yield left, seed

    def _drawings(self, experiments: Iterable[Experiment]) -> Iterator[Task]:
        """Those of the experiments of which every seed is there, and no figure."""
        for each in experiments:
            if self._complete(each) and each.name not in self.drawn:
                yield (each,), self._of(each)

    def _settle(
        self,
        experiments: tuple[Experiment, ...],
        given: Given,
        future: Future[list[Result]],
        progress: Progress,
    ) -> None:
        """Write down what a task gave."""
        try:
            results = future.result()
        except Exception as error:  # a worker that died
            results = [Failure(f"{type(error).__name__}: {error}")] * len(experiments)
        for experiment, result in zip(experiments, results, strict=True):
            what = f"{experiment.name}, {f'seed {given}' if isinstance(given, int) else 'figure'}"
            if isinstance(result, Failure):
                self.failures.append(f"{what}: {result.words}")
            elif isinstance(result, Outcome):
                # Known before it is written: an interrupt may come while the disk takes its time,
                # and the page then counts every outcome that is there.
                self.outcomes[experiment.name, result.seed] = result
                on_disk.write(self.folder, experiment, result)
            else:
                on_disk.write_figures(self.folder, experiment, self.seeds, result)
                self.drawn.add(experiment.name)
            total = len(self.experiments) * (self.seeds + 1)
            progress(what, len(self.outcomes) + len(self.drawn), total)

    def _of(self, experiment: Experiment) -> list[Outcome]:
        every = (self.outcomes.get((experiment.name, seed)) for seed in range(self.seeds))
        return [outcome for outcome in every if outcome]

    def _complete(self, experiment: Experiment) -> bool:
        return len(self._of(experiment)) == self.seeds

    def report(self) -> Report:
        """Return what is finished, and the names of what is not."""
        sections, missing = [], []
        for each in self.experiments:
            outcomes, drawn = self._of(each), each.name in self.drawn
            if len(outcomes) < self.seeds:
                missing.append(f"{each.name} ({len(outcomes)} of {self.seeds} seeds)")
                continue
            sections.append(Section.of(each, outcomes, drawn))
            missing += [] if drawn else [f"{each.name} (no figure)"]
        return Report(tuple(sections), self.seeds, tuple(missing), tuple(self.failures))


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
    begun_before = (folder / "outcomes").is_dir()
    drawings = [path.name for each in experiments for path in on_disk.figures_of(folder, each.name)]
    pages = ["report.html", "report.json", "claims.md"]
    check_own(folder, [*pages, *drawings], lambda _: begun_before)
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
