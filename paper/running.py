"""Run all experiments and seeds on all cores; each result is saved as soon as it is finished."""

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
from concurrent import futures
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import palpate
from palpate.fleet.running import holding_interrupts
from palpate.output.figures.style import as_svg, recolour_for_dark
from palpate.writing import check_own, make_folder, write_text
from paper.choices import Choice, choosing, draws
from paper.experiment import Experiment, Outcome
from paper.report import Report, figures_of, versions, write_report

#: Called with the finished task, and the number of finished outcomes and figures and their total.
Progress = Callable[[str, int, int], None]
#: A seed to measure, or outcomes to draw; and a task with its experiments.
Given = int | list[Outcome]
Task = tuple[tuple[Experiment, ...], Given]
#: The result of a task: an outcome, a figure for light and dark backgrounds, or an error message.
Result = Outcome | tuple[str, str] | str
# The packages whose code measures, and their modules that do not affect measurements: changing
# those does not invalidate outcomes.
ROOTS = (Path(str(palpate.__file__)).parent, Path(__file__).parent)
NOT_MEASURING = (
    "palpate/cli", "palpate/output/reports",
    "paper/__main__.py", "paper/command.py", "paper/judging.py", "paper/recordings.py",
    "paper/report.py",
)  # fmt: skip


def run_paper(
    experiments: Sequence[Experiment],
    *,
    seeds: int,
    folder: Path,
    workers: int | None = None,
    progress: Progress = lambda words, done, total: None,
    begun: Callable[[Report], None] = lambda report: None,
) -> Report:
    """Run experiments over seeds, write all results to a folder, and resume an earlier run there.

    ``progress`` is called after each outcome and figure, ``begun`` once at the start with the
    reused results. ``workers`` is the number of processes (default: one per core).

    Raises
    ------
    RecordingError
        The folder cannot be written to; raised before the work starts.
    PalpateError
        Some experiments failed; the report contains the others.
    """
    begun_before = (folder / "outcomes").is_dir()
    drawings = [path.name for each in experiments for path in figures_of(folder, each.name)]
    pages = ["report.html", "report.json", "claims.md"]
    check_own(folder, [*pages, *drawings], lambda _: begun_before)
    for wanted in (folder, folder / "outcomes"):
        make_folder(wanted)
    report = Report(experiments, seeds, folder)
    _resume(report)
    begun(report)
    try:
        _work(report, workers or os.cpu_count() or 1, progress)
    finally:
        write_report(report)
    if failures := report.failures:
        more = f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
        words = f"{failures[0]}{more}; the other results are in {folder / 'report.html'}"
        raise palpate.PalpateError(words)
    return report


def _resume(report: Report) -> None:
    """Read the outcomes of an earlier run by the same code."""
    for each in report.experiments:
        found = (read_outcome(report.folder, each, seed) for seed in range(report.seeds))
        report.outcomes |= {(each.name, outcome.seed): outcome for outcome in found if outcome}
        if figures_are_current(report.folder, each, report.seeds):
            report.rendered.add(each.name)


def _work(report: Report, workers: int, progress: Progress) -> None:
    """Run all missing tasks; record failures and continue."""
    tasks = [*_measurements(report), *_drawings(report, report.experiments)]
    if not tasks:
        return
    with processes(min(workers, len(tasks))) as pool:
        pending = {pool.submit(perform, *task): task for task in tasks}
        while pending:
            # In the order of submission, so that results are written in that order.
            finished = futures.wait(pending, return_when=futures.FIRST_COMPLETED).done
            for future in [each for each in pending if each in finished]:
                experiments, given = pending.pop(future)
                try:
                    results = future.result()
                except Exception as error:  # the worker ended
                    results = [f"{type(error).__name__}: {error}"] * len(experiments)
                for experiment, result in zip(experiments, results, strict=True):
                    _settle(report, experiment, given, result, progress)
                # The pool may be broken after a worker ended, which is recorded as a failure.
                with suppress(futures.BrokenExecutor):
                    for task in _drawings(report, experiments) if isinstance(given, int) else ():
                        pending[pool.submit(perform, *task)] = task


def _measurements(report: Report) -> Iterator[Task]:
    """Yield each seed of each group, group by group, without existing outcomes."""
    for group in sorted({each.group for each in report.experiments}):
        members = [each for each in report.experiments if each.group == group]
        for seed in range(report.seeds):
            if left := tuple(e for e in members if (e.name, seed) not in report.outcomes):
                yield left, seed


def _drawings(report: Report, experiments: Iterable[Experiment]) -> Iterator[Task]:
    """Yield the experiments that have all seeds but no figure."""
    for each in experiments:
        if report.is_complete(each) and each.name not in report.rendered:
            yield (each,), report.outcomes_of(each)


def _settle(
    report: Report, experiment: Experiment, given: Given, result: Result, progress: Progress
) -> None:
    """Save the result of a task for one experiment."""
    what = f"{experiment.name}, {f'seed {given}' if isinstance(given, int) else 'figure'}"
    if isinstance(result, str):
        report.failures.append(f"{what}: {result}")
    elif isinstance(result, Outcome):
        # Recorded before it is written: after an interrupt during writing, the page still counts
        # this outcome.
        report.outcomes[experiment.name, result.seed] = result
        write_outcome(report.folder, experiment, result)
    else:
        write_figures(report.folder, experiment, report.seeds, result)
        report.rendered.add(experiment.name)
    total = len(report.experiments) * (report.seeds + 1)
    progress(what, len(report.outcomes) + len(report.rendered), total)


# Work in a worker process, and the pool of workers.


def perform(experiments: Sequence[Experiment], given: Given) -> list[Result]:
    """Run one seed of experiments that share recordings, or draw their outcomes, in a worker."""
    results: list[Result] = []
    for each in experiments:
        try:
            if isinstance(given, int):
                results.append(each.run(given))
                continue
            # Returned, not written: a stopped worker would leave half a file.
            light = as_svg(each.figure(given))
            results.append((light, recolour_for_dark(light)))
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(last.filename).name}:{last.lineno}"
            results.append(f"{type(error).__name__}: {error} ({place})")
    return results


@contextmanager
def processes(count: int) -> Iterator[futures.ProcessPoolExecutor]:
    """Yield a pool of processes that end at once when this one is interrupted."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = futures.ProcessPoolExecutor(count, mp_context=context, initializer=_prepare_worker)
    try:
        # A pool starts a process when a submission finds none idle. Start all of them here, while
        # interrupts are held back, so that none is lost later.
        with holding_interrupts():
            for _ in range(count):
                pool.submit(int)
        yield pool
    except BaseException:
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _prepare_worker() -> None:
    """Make this process end when its parent has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


# The search over what the paper leaves open.


def judge_draws(
    experiments: Sequence[Experiment],
    *,
    count: int,
    seeds: int,
    workers: int | None = None,
    progress: Progress = lambda words, done, total: None,
) -> dict[str, str]:
    """Return whether each claim holds in each of ``count`` draws: "1", "0", or "-" if unknown.

    Draw k repeats the noise of seed k modulo ``seeds``; those of a seed share its recordings.
    """
    answers: dict[int, dict[str, str]] = {}
    with processes(workers or os.cpu_count() or 1) as pool:
        tasks = [
            pool.submit(_judge_draws, experiments, seed, range(seed, count, seeds), count)
            for seed in range(seeds)
        ]
        for done in futures.as_completed(tasks):
            answers |= done.result()
            progress("draws", len(answers), count)
    names = {name for each in answers.values() for name in each}
    every = [answers[k] for k in range(count)]
    return {name: "".join(each.get(name, "-") for each in every) for name in sorted(names)}


def _judge_draws(
    experiments: Sequence[Experiment], seed: int, which: Iterable[int], count: int
) -> dict[int, dict[str, str]]:
    return {k: judge_draw(experiments, seed, draws(count)[k]) for k in which}


def judge_draw(experiments: Sequence[Experiment], seed: int, choice: Choice) -> dict[str, str]:
    """Return whether each claim that can be checked holds with other values of what is open."""
    answers: dict[str, str] = {}
    with choosing(choice):
        for each in experiments:
            checked = {
                c.key: each.judges[c.key] for c in each.claims if each.judges[c.key].searched
            }
            if not checked:
                continue
            try:
                numbers, _ = each.measure(seed)
            except palpate.PalpateError:  # no sample in contact, for example
                continue
            for key, judge in checked.items():
                holds = judge({name: float(value) for name, value in numbers.items()}).holds
                answers[f"{each.name}.{key}"] = "-" if holds is None else str(int(holds))
    return answers


# Files: outcomes and figures, with the version of the code that made them.


@cache
def code() -> str:
    """Return a hash of the measuring code, since a checkout changes without a new version."""
    found = hashlib.sha256()
    for root in ROOTS:
        for path in sorted(p for p in root.rglob("*") if p.suffix in (".py", ".so", ".pyd")):
            if not path.relative_to(root.parent).as_posix().startswith(NOT_MEASURING):
                found.update(path.read_bytes())
    return found.hexdigest()[:16]


def provenance(experiment: Experiment) -> dict[str, Any]:
    """Return versions, machine and settings, which must match for an outcome to be reused."""
    made_by = {**versions(), "code": code(), "machine": platform.machine()}
    return {"versions": made_by, "settings": repr(experiment)}


def path_of(folder: Path, name: str, seed: int) -> Path:
    """Return the path of the outcome of an experiment and a seed."""
    return folder / "outcomes" / f"{name}-seed{seed}.json"


def write_outcome(folder: Path, experiment: Experiment, outcome: Outcome) -> None:
    """Write an outcome, completely or not at all; non-finite numbers become null."""
    whole = {
        "experiment": experiment.name,
        "provenance": provenance(experiment),
        "seed": outcome.seed,
        "numbers": {name: _or_null(value) for name, value in outcome.numbers.items()},
        "curves": {name: list(map(_or_null, curve)) for name, curve in outcome.curves.items()},
    }
    text = json.dumps(whole, ensure_ascii=False, allow_nan=False)
    write_text(path_of(folder, experiment.name, outcome.seed), text + "\n")


def read_outcome(folder: Path, experiment: Experiment, seed: int) -> Outcome | None:
    """Return an outcome written earlier by the same versions and settings, else None."""
    try:
        whole = json.loads(path_of(folder, experiment.name, seed).read_text(encoding="utf-8"))
        if (whole["provenance"], whole["seed"]) == (provenance(experiment), seed):
            numbers = {name: _or_nan(value) for name, value in whole["numbers"].items()}
            curves = {name: list(map(_or_nan, curve)) for name, curve in whole["curves"].items()}
            return Outcome(seed, numbers, curves)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass  # absent or damaged: measure again
    return None


def _or_null(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _remark(experiment: Experiment, seeds: int) -> str:
    """Return the comment at the end of a figure that identifies its seeds and settings."""
    made = hashlib.sha256(repr(provenance(experiment)).encode()).hexdigest()[:16]
    return f"<!-- {seeds} seeds, {made} -->\n"


def write_figures(
    folder: Path, experiment: Experiment, seeds: int, rendered: Sequence[str]
) -> None:
    """Write an experiment's figure for both backgrounds."""
    for path, drawing in zip(figures_of(folder, experiment.name), rendered, strict=True):
        write_text(path, drawing + _remark(experiment, seeds))


def figures_are_current(folder: Path, experiment: Experiment, seeds: int) -> bool:
    """Whether both figures exist for these seeds, versions and settings."""
    end, paths = _remark(experiment, seeds), figures_of(folder, experiment.name)
    try:
        return all(path.read_text(encoding="utf-8").endswith(end) for path in paths)
    except (OSError, ValueError):
        return False
