"""Where a fleet runs: processes of this machine, or the workers of a scheduler."""

import asyncio
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import Any

from palpate._core import __version__
from palpate.errors import FleetError
from palpate.fleet.extras import cores, line_of, needed

#: s that a scheduler has to answer.
PATIENCE = 10.0
LOOPBACK = "127.0.0.1"
_ASK_AGAIN = 5.0  # s
#: States of a nanny that starts no worker any more.
_GONE = ("failed", "closed")
_DASHBOARD = f"{LOOPBACK}:8787"
#: One thread a worker: arithmetic that starts threads of its own would only wait for them.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


@contextmanager
def client_of(
    *, workers: int | None = None, scheduler: str | None = None, dashboard: bool = False
) -> Iterator[Any]:
    """A client of a scheduler that was named, or of processes that are gone afterwards.

    Parameters
    ----------
    workers : int, optional
        Processes on this machine; one a core unless given.
    scheduler : str, optional
        Address of a scheduler of Dask, such as ``tcp://10.0.0.7:8786``, in place of processes here.
    dashboard : bool
        Let the scheduler here show its page, on this machine alone.

    Raises
    ------
    FleetError
        There is no such scheduler, it has no workers, or one of them has another palpate.
    MissingExtraError
        Dask is not installed.
    """
    distributed = needed("distributed", "a fleet")
    if scheduler is not None:
        with _named(distributed, scheduler) as client:
            _check_workers(client, scheduler)
            yield client
        return
    with _local(distributed, workers or cores(), dashboard=dashboard) as client:
        yield client


@contextmanager
def _named(distributed: Any, scheduler: str) -> Iterator[Any]:
    try:
        _check_address(scheduler)
        client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError) as error:
        raise FleetError(
            f"{scheduler}: no scheduler of Dask answers ({line_of(error)}); start one by dask "
            "scheduler, or leave --scheduler out to use the cores of this machine"
        ) from None
    try:
        yield client
    finally:
        client.close()


def _check_address(scheduler: str) -> None:
    """Reach a scheduler once: a client that is made of what does not answer ends in a traceback."""
    comm = needed("distributed.comm", "a fleet")
    keys = needed("distributed.security", "a fleet").Security().get_connection_args("client")

    async def reach() -> None:
        found = await comm.connect(scheduler, timeout=PATIENCE, **keys)
        await found.close()

    with ThreadPoolExecutor(1) as apart:  # from an event loop of the caller's
        apart.submit(asyncio.run, reach()).result()


@contextmanager
def _local(distributed: Any, workers: int, *, dashboard: bool) -> Iterator[Any]:
    dask = needed("dask", "a fleet")
    address = _DASHBOARD if dashboard else f"{LOOPBACK}:0"
    # A worker that is stopped from outside is no reason to give its work up at the fourth time:
    # what kills workers is found by giving it to one alone.
    settings = {
        "distributed.scheduler.dashboard.tasks.task-stream-length": 100,
        "distributed.nanny.pre-spawn-environ": _ONE_THREAD,
        "distributed.admin.log-format": "%(message)s",
        "distributed.deploy.lost-worker-timeout": "2 s",
        "distributed.scheduler.worker-saturation": 2.0,
    }
    quiet = os.environ.get("PALPATE_DASK_LOGS") is None
    with dask.config.set(settings):
        with ignoring_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=LOOPBACK,
                dashboard_address=address,
                worker_dashboard_address=None,
                silence_logs=60 if quiet else 30,
                scheduler_kwargs={"dashboard": dashboard},
            )
        try:
            with (
                _kept_at(cluster, workers),
                distributed.Client(cluster, set_as_default=False) as client,
            ):
                yield client
        finally:
            with suppress(TimeoutError):
                cluster.close(timeout=PATIENCE)


@contextmanager
def _kept_at(cluster: Any, workers: int) -> Iterator[None]:
    """Ask for the workers again and again: one that ends may not be started anew by its nanny.

    Seen where a worker ended in the moment at which it was given a task, and where it ended before
    it had started: that nanny has failed, and counts as a worker none the less. With none left, the
    rest would wait for ever.
    """
    ended = threading.Event()

    def ask() -> None:
        while not ended.wait(_ASK_AGAIN):
            failed = [
                name for name, each in dict(cluster.workers).items() if each.status.name in _GONE
            ]
            if failed:
                with suppress(Exception):  # one that is started instead may end as early
                    cluster.sync(cluster.scale_down, failed)
            with suppress(Exception):
                cluster.scale(workers)

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def ignoring_interrupts() -> Iterator[None]:
    """Start processes that ignore Ctrl-C, which a terminal sends to them too."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _check_workers(client: Any, scheduler: str) -> None:
    """Refuse workers that would fail, or answer differently, by the first of them."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise FleetError(
            f"{scheduler}: the scheduler has no workers; start some by dask worker {scheduler}"
        ) from None

    def version() -> str:  # within, so that it is sent as it is: a worker may lack palpate
        try:
            import pyarrow  # noqa: F401 - whether it can be imported is the question

            from palpate._core import __version__
        except ImportError as error:
            return f"no {error.name}"
        return __version__

    try:
        found = client.run(version)
    except Exception as error:
        raise FleetError(f"{scheduler}: its workers cannot be asked: {line_of(error)}") from None
    for worker, answer in sorted(found.items()):
        if answer != __version__:
            has = answer if answer.startswith("no ") else f"palpate {answer}"
            raise FleetError(
                f"{scheduler}: the worker {worker} has {has}, and palpate {__version__} "
                "asks; install one version, with the extra fleet, everywhere"
            )
