"""What runs in the processes of a run of the paper, and how they end."""

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from palpate.figures.slimming import slim
from palpate.paper import EXPERIMENTS
from palpate.paper import outcomes as on_disk
from palpate.paper.experiment import Experiment, Outcome, Table
from palpate.paper.sessions import share_sessions


@dataclass(frozen=True, slots=True)
class Failure:
    """What went wrong in a worker, in words."""

    words: str


@dataclass(frozen=True, slots=True)
class Drawing:
    """SVG; not files, for a worker that is stopped could not take its half of one away."""

    light: str
    dark: str
    tables: tuple[Table, ...]


@contextmanager
def processes(count: int, sessions: Path) -> Iterator[ProcessPoolExecutor]:
    """Processes that end at once when this one is interrupted."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        count, mp_context=context, initializer=_prepare_worker, initargs=(sessions,)
    )
    try:
        # A pool starts a process where a submission finds none idle: all of them here, so that no
        # interrupt is lost later.
        with _deaf_to_interrupts():
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
def _deaf_to_interrupts() -> Iterator[None]:
    """Start processes that ignore Ctrl-C, which a terminal sends to them too."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _prepare_worker(sessions: Path) -> None:
    """Share sessions, and end when the process that started this one is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    share_sessions(sessions)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def portable(experiment: Experiment) -> Experiment | str:
    """An experiment of the paper goes to a worker by its name, for its judges cannot be pickled."""
    ours = type(experiment).__module__.startswith("palpate.paper.")
    known = ours and EXPERIMENTS.get(experiment.name) is experiment
    return experiment.name if known else experiment


def _arrived(sent: Experiment | str) -> Experiment:
    return EXPERIMENTS[sent] if isinstance(sent, str) else sent


def measured(sent: Experiment | str, seed: int) -> str | Failure:
    """Run one seed of an experiment; its outcome as text."""
    try:
        experiment = _arrived(sent)
        outcome = experiment.run(seed)
        missing = {claim.key for claim in experiment.claims} ^ set(outcome.findings)
        if missing:
            return Failure(f"claims and findings differ in {', '.join(sorted(missing))}")
        return on_disk.as_text(experiment, outcome)
    except Exception as error:
        return _failure(error)


def drawn(sent: Experiment | str, outcomes: list[Outcome]) -> Drawing | Failure:
    """Draw an experiment of all seeds, for both backgrounds."""
    from palpate.figures.style import as_svg

    try:
        experiment = _arrived(sent)
        light, dark = (slim(as_svg(experiment.draw(outcomes, dark=dark))) for dark in (False, True))
        return Drawing(light, dark, experiment.tables(outcomes))
    except Exception as error:
        return _failure(error)


def _failure(error: Exception) -> Failure:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return Failure(f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})")
