"""What runs in the processes of a run of the paper, and how they end."""

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from palpate.figures.slimming import slim
from palpate.figures.style import as_svg, recoloured
from palpate.paper.experiment import Experiment, Outcome


@dataclass(frozen=True, slots=True)
class Failure:
    """What went wrong in a worker, in words."""

    words: str


#: A seed to measure, or outcomes to draw.
Given = int | list[Outcome]
#: What a task gives: one seed, or a figure for a light and for a dark background.
Result = Outcome | tuple[str, str] | Failure


def perform(experiments: Sequence[Experiment], given: Given) -> list[Result]:
    """Run one seed of experiments that press the same, or draw their outcomes."""
    return [_tried(experiment, given) for experiment in experiments]


def _tried(experiment: Experiment, given: Given) -> Result:
    try:
        if isinstance(given, int):
            return experiment.run(given)
        # Not into files, for a worker that is stopped could not take its half of one away.
        light = slim(as_svg(experiment.figure(given)))
        return light, recoloured(light)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        return Failure(f"{type(error).__name__}: {error} ({place})")


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
