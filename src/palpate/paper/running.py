"""All experiments and seeds on all cores; what is finished stays on disk, whatever happens then."""

import hashlib
import json
import math
import multiprocessing
import os
import platform
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import palpate
from palpate.figures.slimming import slim
from palpate.figures.style import as_svg, recoloured
from palpate.paper.experiment import Experiment, Outcome
from palpate.paper.page import figures_of, write_page
from palpate.paper.report import Report, Section, versions, write_data
from palpate.writing import make_folder, write_text

#: Called with what has just been finished, and how many of how many outcomes and figures are.
Progress = Callable[[str, int, int], None]
#: Experiments, and a seed to measure, or outcomes to draw.
Task = tuple[tuple[Experiment, ...], int | list[Outcome]]
#: What a task gives for each: one seed, a figure for a light and for a dark background, or words.
Result = Outcome | tuple[str, str] | str
# What judges and reports measures nothing: a claim is reworded and judged anew without a run.
NOT_MEASURING = ("cli", "reports", *(f"paper/{name}.py" for name in ("judg", "page", "report")))


@cache
def code() -> str:
    """Return a hash of the code that measures, for a checkout changes without its version."""
    root = Path(str(palpate.__file__)).parent
    ours = {path.relative_to(root).as_posix(): path for path in root.rglob("*")}
    found = hashlib.sha256()
    for name, path in sorted(ours.items()):
        if path.suffix in (".py", ".so", ".pyd") and not name.startswith(NOT_MEASURING):
            found.update(path.read_bytes())
    return found.hexdigest()[:16]


def provenance(experiment: Experiment) -> dict[str, Any]:
    """Return what has to match for an outcome to be reused: versions, machine and settings."""
    made_by = {**versions(), "code": code(), "machine": platform.machine()}
    return {"versions": made_by, "settings": repr(experiment)}


def path_of(folder: Path, name: str, seed: int) -> Path:
    """Where the outcome of an experiment and a seed lies."""
    return folder / "outcomes" / f"{name}-seed{seed}.json"


def write_outcome(folder: Path, experiment: Experiment, outcome: Outcome) -> None:
    """Write an outcome, whole or not at all; what is not finite is null."""

    def plain(value: float) -> float | None:
        return value if math.isfinite(value) else None

    whole = {
        "experiment": experiment.name,
        "provenance": provenance(experiment),
        "seed": outcome.seed,
        "numbers": {name: plain(value) for name, value in outcome.numbers.items()},
        "curves": {name: list(map(plain, curve)) for name, curve in outcome.curves.items()},
    }
    text = json.dumps(whole, ensure_ascii=False, allow_nan=False)
    write_text(path_of(folder, experiment.name, outcome.seed), text + "\n")


def read_outcome(folder: Path, experiment: Experiment, seed: int) -> Outcome | None:
    """Return an outcome written earlier by the same versions and settings; None else."""

    def known(value: float | None) -> float:
        return math.nan if value is None else float(value)

    try:
        whole = json.loads(path_of(folder, experiment.name, seed).read_text(encoding="utf-8"))
        if (whole["provenance"], whole["seed"]) == (provenance(experiment), seed):
            numbers = {name: known(value) for name, value in whole["numbers"].items()}
            curves = {name: list(map(known, curve)) for name, curve in whole["curves"].items()}
            return Outcome(seed, numbers, curves)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass  # absent or damaged: it is made anew
    return None


def _remark(experiment: Experiment, seeds: int) -> str:
    """What a figure is of; it stands at its end."""
    made = hashlib.sha256(repr(provenance(experiment)).encode()).hexdigest()[:16]
    return f"<!-- {seeds} seeds, {made} -->\n"


def write_figures(
    folder: Path, experiment: Experiment, seeds: int, drawings: tuple[str, str]
) -> None:
    """Write an experiment's figure for both backgrounds."""
    for path, drawing in zip(figures_of(folder, experiment.name), drawings, strict=True):
        write_text(path, drawing + _remark(experiment, seeds))


def figures_are_current(folder: Path, experiment: Experiment, seeds: int) -> bool:
    """Whether both figures are there, of as many seeds by the same versions and settings."""
    end, paths = _remark(experiment, seeds), figures_of(folder, experiment.name)
    try:
        return all(path.read_text(encoding="utf-8").endswith(end) for path in paths)
    except (OSError, ValueError):
        return False


def perform(experiments: Sequence[Experiment], given: int | list[Outcome]) -> list[Result]:
    """Run one seed of experiments that press the same, or draw their outcomes, in a worker."""
    return [_tried(experiment, given) for experiment in experiments]


def _tried(experiment: Experiment, given: int | list[Outcome]) -> Result:
    try:
        if isinstance(given, int):
            return experiment.run(given)
        # Not into files, for a worker that is stopped could not take its half of one away.
        light = slim(as_svg(experiment.figure(given)))
        return light, recoloured(light)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})"


@contextmanager
def processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end at once when this one is interrupted."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_prepare_worker)
    try:
        # A pool starts a process where a submission finds none idle: all of them here, so that no
        # interrupt is lost later.
        with _ignoring_interrupts():
            for _ in range(count):
                pool.submit(int)
        yield pool
    except BaseException:
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """Start processes that ignore Ctrl-C, which a terminal sends to them too."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _prepare_worker() -> None:
    """End when the process that started this one is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


@dataclass(slots=True)
class PaperRun:
    """Experiments under way, in the order of the report, of so many seeds: 0, 1, …"""

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
            found = (read_outcome(self.folder, each, seed) for seed in range(self.seeds))
            self.outcomes |= {(each.name, outcome.seed): outcome for outcome in found if outcome}
            if figures_are_current(self.folder, each, self.seeds):
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
            outcomes = self._of(each)
            if len(outcomes) == self.seeds and each.name not in self.drawn:
                yield (each,), outcomes

    def _settle(
        self,
        experiments: Sequence[Experiment],
        given: int | list[Outcome],
        future: Future[list[Result]],
        progress: Progress,
    ) -> None:
        """Write down what a task gave."""
        try:
            results = future.result()
        except Exception as error:  # a worker that died
            results = [f"{type(error).__name__}: {error}"] * len(experiments)
        for experiment, result in zip(experiments, results, strict=True):
            what = f"{experiment.name}, {f'seed {given}' if isinstance(given, int) else 'figure'}"
            if isinstance(result, str):
                self.failures.append(f"{what}: {result}")
            elif isinstance(result, Outcome):
                # Known before it is written: an interrupt may come while the disk takes its time,
                # and the page then counts every outcome that is there.
                self.outcomes[experiment.name, result.seed] = result
                write_outcome(self.folder, experiment, result)
            else:
                write_figures(self.folder, experiment, self.seeds, result)
                self.drawn.add(experiment.name)
            total = len(self.experiments) * (self.seeds + 1)
            progress(what, len(self.outcomes) + len(self.drawn), total)

    def _of(self, experiment: Experiment) -> list[Outcome]:
        every = (self.outcomes.get((experiment.name, seed)) for seed in range(self.seeds))
        return [outcome for outcome in every if outcome]

    def report(self) -> Report:
        """Return what is finished, and the names of what is not."""
        sections, missing = [], []
        for each in self.experiments:
            outcomes, drawn = self._of(each), each.name in self.drawn
            if len(outcomes) < self.seeds:
                missing.append(f"{each.name} ({len(outcomes)} of {self.seeds} seeds)")
                continue
            sections.append(Section(each, outcomes, drawn))
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
        Processes; default: as many as there are cores.
    progress, begun : callable, optional
        Called after each outcome and figure; and once before any, with what is reused.

    Raises
    ------
    RecordingError
        The folder cannot be written to; raised before the work starts.
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
        write_page(report, folder)
        write_data(report, folder)
    if run.failures:
        more = f" (and {len(run.failures) - 1} more)" if len(run.failures) > 1 else ""
        words = f"{run.failures[0]}{more}; the rest is in {folder / 'report.html'}"
        raise palpate.PalpateError(words)
    return report
