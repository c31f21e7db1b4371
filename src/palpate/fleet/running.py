"""Run a fleet on Dask workers, on this machine or on a cluster: batches in, rows out."""

import asyncio
import itertools
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import numpy as np

from palpate._core import __version__
from palpate.errors import FleetError, InvalidParameterError
from palpate.fleet.arrays import (
    Given,
    fits_whole_curves,
    identify_curves,
    identify_each,
)
from palpate.fleet.files import Results, disk_name, list_sources, read_curves
from palpate.fleet.rows import Row, table_of_rows
from palpate.fleet.tasks import Batch, Settings, Table, batches, cores, needed
from palpate.input.preparation import prepare
from palpate.input.recordings import datasets, open_recording, opening
from palpate.method.contact import Contact
from palpate.spelling import options_in_advice
from palpate.validation import Floats, whole_in

#: A source and the number of the contact in it; None if the source is a single contact.
Named = tuple[str, int | None]
_NAMES = ("source", "index")
_SAMPLES = ("time", "penetration", "velocity", "force", "segment")


@options_in_advice()
def identify_batch(batch: Table, settings: Settings, *, threads: int = 1) -> Table:
    """Identify a batch of contacts.

    A pure function of its arguments and of the files they name: any engine may run it anywhere,
    and repeat it.

    Parameters
    ----------
    batch : pyarrow.Table or RecordBatch
        One row per contact. Either the columns ``source``, ``kind`` and ``index`` locate it, as in
        :attr:`palpate.fleet.tasks.Batch.table`; or the list columns ``time``, ``penetration``,
        ``force`` and optionally ``velocity`` hold its samples, SI, and ``source`` and ``index``
        (optional) name it.
    settings : Settings
        The settings of preparation and identification.
    threads : int
        Number of threads for contacts of equal length. Default: 1.

    Returns
    -------
    pyarrow.Table
        One row per contact in the order of the batch, or one per place where the probe travels;
        columns as in :func:`palpate.fleet.rows.table_schema`. A contact that fails is a row with
        its error.

    Raises
    ------
    FleetError
        The settings were made by another version of palpate.
    InvalidParameterError
        The batch lacks a required column.
    """
    return identify_and_time(batch, settings, threads=threads)[0]


def identify_and_time(
    batch: Table,
    settings: Settings,
    *,
    threads: int = 1,
) -> tuple[Table, Floats]:
    """Return the table of :func:`identify_batch` and the time that each row took, s."""
    if settings.version != __version__:
        raise FleetError(
            f"a worker has palpate {__version__}, but the run was started by palpate "
            f"{settings.version}; install the same version everywhere"
        )
    pa = needed("pyarrow", "a table of contacts")
    names = set(batch.schema.names)
    if {"penetration", "force", "time"} <= names:
        return identify_each(_contacts_in_batch(batch, settings), settings)
    if not {"source", "kind", "index"} <= names:
        raise InvalidParameterError(
            "a batch must have the columns source, kind and index, or time, penetration and force, "
            f"not {', '.join(sorted(names))}"
        )
    parts = [_identify_rows(kind, rows, settings, threads) for kind, rows in _runs(batch)]
    if not parts:
        return table_of_rows([], settings), np.empty(0)
    return pa.concat_tables([table for table, _ in parts]), np.concatenate([s for _, s in parts])


def _runs(batch: Table) -> Iterator[tuple[str, list[Named]]]:
    """Group adjacent rows that are read together: rows of one array or map, or any files."""
    columns = (batch.column(name).to_pylist() for name in ("kind", "source", "index"))
    rows = zip(*columns, strict=True)
    for (kind, _), group in itertools.groupby(
        rows,
        key=lambda row: (row[0], None if row[0] == "file" else row[1]),
    ):
        yield kind, [(source, index) for _, source, index in group]


def _identify_rows(
    kind: str,
    named: list[Named],
    settings: Settings,
    threads: int,
) -> tuple[Table, Floats]:
    if kind != "zarr":
        return identify_each(_read_contacts(kind, named, settings), settings, curves=kind == "map")
    source = named[0][0]
    numbers = [index or 0 for _, index in named]
    first = min(numbers)
    count = max(numbers) - min(numbers) + 1
    try:
        curves = read_curves(source, first, count)
        table, seconds = identify_curves(curves, settings, threads=threads)
    except Exception as error:
        return identify_each([(_name(each), error) for each in named], settings)
    rows = np.subtract(numbers, first)
    return table.take(rows), seconds[rows]


def _name(named: Named) -> Row:
    return dict(zip(_NAMES, named, strict=True))


def _read_contacts(kind: str, named: list[Named], settings: Settings) -> Iterator[Given]:
    """Read the contacts from their files; maps and data sets are opened once for all their rows."""
    for some in [named] if kind in ("map", "episodes") else ([each] for each in named):
        left = deque(some)
        source = some[0][0]
        most = settings.max_size
        try:
            path = Path(disk_name(source))
            numbers = [index or 0 for _, index in some]
            if kind == "episodes":
                for number, recording in datasets.read_episodes(path, numbers, most):
                    yield {**_name(left.popleft()), "index": number}, recording
                continue
            if kind == "map":
                recordings = opening.FORCE_CURVES.reader().read_curves(path, numbers, most)
            else:
                recordings = iter([open_recording(path, curve=some[0][1], max_size=most)])
            for recording in recordings:
                yield _name(left.popleft()), recording
        except Exception as error:
            yield from [(_name(each), error) for each in left]


def _contacts_in_batch(batch: Table, settings: Settings) -> Iterator[Given]:
    """Yield the contacts whose samples are in the batch itself."""
    columns = {name: batch.column(name) for name in batch.schema.names}

    def contact(k: int, source: str | None) -> Contact:
        samples = {name: columns[name][k] for name in _SAMPLES if name in columns}
        arrays: dict[str, Any] = {
            name: np.asarray(each.values) for name, each in samples.items() if each.is_valid
        }
        return prepare(source=source or "", **arrays, **settings.preparation)

    for k in range(batch.num_rows):
        known = {name: columns[name][k].as_py() for name in _NAMES if name in columns}
        yield known, partial(contact, k, known.get("source"))


# A fleet runs on processes of this machine, or on the workers of a scheduler.

#: The longest wait for a scheduler's answer, s.
PATIENCE = 10.0
_LONGEST_START = 60.0  # s, for the first worker; it takes 2 to 5 s on an idle machine
LOOPBACK = "127.0.0.1"
#: States in which a nanny no longer starts a worker.
_GONE = ("failed", "closed")
#: One thread per worker: threads of the numeric libraries would only compete for the same cores.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Of numpy and others about damaged numbers; the rows have palpate's own words.
_NO_WARNINGS = {"PYTHONWARNINGS": "ignore"}


@contextmanager
def open_client(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    dashboard: bool = False,
) -> Iterator[Any]:
    """Yield a Dask client of the scheduler, or of local processes that end with the context.

    Parameters
    ----------
    workers : int, optional
        Number of local processes. Default: one per core.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.7:8786``. Default: local processes.
    dashboard : bool
        Serve the Dask dashboard of local processes, on this machine only. Default: False.

    Raises
    ------
    FleetError
        The scheduler does not answer, has no workers, or a worker has another version of palpate.
    MissingExtraError
        Dask is not installed.
    """
    distributed = needed("distributed", "a fleet")
    if scheduler is None:
        with _local(distributed, workers or cores(), dashboard=dashboard) as client:
            yield client
        return
    try:
        _check_address(scheduler)
        client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError) as error:
        raise FleetError(
            f"{scheduler}: no Dask scheduler answers ({opening.first_line(error)}); start one with "
            "`dask scheduler`, or omit --scheduler to use the cores of this machine"
        ) from None
    with client:
        _check_workers(client, scheduler)
        yield client


def _check_address(scheduler: str) -> None:
    """Connect to a scheduler once: Dask's client prints a traceback if the scheduler is absent."""
    comm = needed("distributed.comm", "a fleet")
    keys = needed("distributed.security", "a fleet").Security().get_connection_args("client")

    async def reach() -> None:
        connection = await comm.connect(scheduler, timeout=PATIENCE, **keys)
        await connection.close()

    with ThreadPoolExecutor(1) as executor:  # the caller may run an event loop already
        executor.submit(asyncio.run, reach()).result()


@contextmanager
def _local(distributed: Any, workers: int, *, dashboard: bool) -> Iterator[Any]:
    dask = needed("dask", "a fleet")
    # A task whose workers were stopped from outside is not lost: `_answer` finds the contact that
    # ends workers, because it runs each alone.
    settings = {
        "distributed.scheduler.dashboard.tasks.task-stream-length": 100,
        "distributed.nanny.pre-spawn-environ": _ONE_THREAD | _NO_WARNINGS,
        "distributed.admin.log-format": "%(message)s",
        "distributed.deploy.lost-worker-timeout": "2 s",
        "distributed.scheduler.worker-saturation": 2.0,
    }
    needed("cryptography", "a fleet")
    others = set(multiprocessing.active_children())
    with dask.config.set(settings):
        with holding_interrupts():
            # The workers start afterwards, so that an interrupt does not wait for them.
            cluster = distributed.LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                memory_limit=1.0 / workers,
                processes=True,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:{8787 if dashboard else 0}",
                worker_dashboard_address=None,
                silence_logs=60,
                scheduler_kwargs={"dashboard": dashboard},
                # Whoever connects can run any code: only this run has the key, in memory.
                security=distributed.Security.temporary(),
            )
        try:
            with (
                _keep_workers(cluster, workers),
                distributed.Client(cluster, set_as_default=False) as client,
            ):
                _await_workers(cluster, workers)
                yield client
        except BaseException:
            cluster.shutdown_on_close = False  # else Dask waits again when the interpreter ends
            for worker in set(multiprocessing.active_children()) - others:
                worker.kill()  # one that still starts would delay the end of the cluster
            raise
        finally:
            with suppress(Exception):
                cluster.close(timeout=PATIENCE)


def _await_workers(cluster: Any, workers: int) -> None:
    """Wait for the first worker, and a shorter time for all of them.

    Raises
    ------
    FleetError
        No worker started.
    """
    begun = time.monotonic()
    started = cluster.scheduler.workers
    while len(started) < workers:
        if time.monotonic() - begun > (PATIENCE if started else _LONGEST_START):
            break
        time.sleep(0.01)
    if not started:
        raise FleetError(
            f"no worker process started within {_LONGEST_START:g} s: they ended, or the machine is "
            "too busy; repeat the command to continue, with fewer --workers if memory is short"
        )


@contextmanager
def _keep_workers(cluster: Any, workers: int) -> Iterator[None]:
    """Request the workers repeatedly: a nanny does not always restart a worker that ended.

    This happens if a worker ends just as it receives a task, or before it has started: its nanny
    fails but still counts as a worker. With no worker left, the run would wait forever.
    """
    ended = threading.Event()

    def ask() -> None:
        while not ended.wait(_ASK_AGAIN):
            failed = [
                name for name, each in dict(cluster.workers).items() if each.status.name in _GONE
            ]
            if failed:
                with suppress(Exception):  # its replacement may end as early
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
def holding_interrupts() -> Iterator[None]:
    """Delay Ctrl-C until the end of the block; processes that start in it never get the signal.

    A terminal sends Ctrl-C to those processes too, but this process ends them in order. They
    inherit the signal mask of their thread; the handler covers threads of the caller that do not
    block the signal.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held = False
    blocks = sys.platform != "win32"

    def hold(*_: Any) -> None:
        nonlocal held
        held = True

    before = signal.signal(signal.SIGINT, hold)
    try:
        if blocks:
            resource_tracker.ensure_running()  # its own start would unblock the signal
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            if blocks:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            signal.raise_signal(signal.SIGINT)


def _check_workers(client: Any, scheduler: str) -> None:
    """Raise for the first worker that lacks a package or has another version of palpate."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise FleetError(
            f"{scheduler}: the scheduler has no workers; start some with `dask worker {scheduler}`"
        ) from None

    def version() -> str:  # nested, so that Dask sends its code: a worker may lack palpate
        try:
            import pyarrow  # noqa: F401 - checks only that the import works

            from palpate._core import __version__
        except ImportError as error:
            return f"no {error.name}"
        return f"palpate {__version__}"

    try:
        versions = client.run(version)
    except Exception as error:
        raise FleetError(
            f"{scheduler}: its workers do not answer: {opening.first_line(error)}"
        ) from None
    for worker, answer in sorted(versions.items()):
        if answer != f"palpate {__version__}":
            raise FleetError(
                f"{scheduler}: worker {worker} has {answer}, but this is palpate {__version__}; "
                "install the same version with the extra fleet everywhere"
            )


# The run: send batches to the workers and write their rows, until every contact has its row.

#: Called with the number of contacts done and their total.
Progress = Callable[[int, int], None]
# Batches sent per worker: with a batch waiting beyond the current one it never waits for the next.
_AHEAD = 3
_ASK_AGAIN = 5.0  # s
_PARTS = 16
_ENDED = "the worker process ended while it identified this contact: a crash, or not enough memory"


@dataclass(slots=True)
class Fleet:
    """The counts of a fleet's run.

    Attributes
    ----------
    folder : Path
        Folder of the results.
    contacts : int
        Number of contacts in all sources.
    reused : int
        Contacts that an earlier run had identified.
    failures : int
        Rows with an error in place of numbers, including rows of earlier runs.
    identified : int
        Rows with numbers, including rows of earlier runs.
    rows : int
        Rows that this run wrote.
    seconds : float
        Time from the first batch to the last, s.
    reasons : dict
        Number of failed rows by class of error.
    """

    folder: Path
    contacts: int
    reused: int = 0
    failures: int = 0
    identified: int = 0
    rows: int = 0
    seconds: float = 0.0
    reasons: dict[str, int] = field(default_factory=dict)


def run_fleet(
    sources: Sequence[str | os.PathLike[str]],
    folder: Path,
    settings: Settings | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    dashboard: bool = False,
    progress: Progress = lambda done, total: None,
) -> Fleet:
    """Identify all contacts of some sources on Dask and write one row per contact to a folder.

    Each batch is written as soon as it is done; an interrupted run continues where it stopped.

    Parameters
    ----------
    sources : sequence of str or path-like
        Files, patterns, folders, data sets of robot learning, Zarr arrays or force maps.
    folder : Path
        Folder for the results, a Parquet dataset.
    settings : Settings, optional
        How contacts are prepared and identified. Default: ``Settings()``.
    workers : int, optional
        Number of local processes. Default: one per core.
    scheduler : str, optional
        Address of a Dask scheduler. Default: local processes.
    dashboard : bool
        Serve the Dask dashboard of local processes. Default: False.
    progress : callable, optional
        Called with the number of contacts done and their total.

    Raises
    ------
    RecordingError
        A source does not exist or holds no recording.
    FleetError
        The folder holds another run's results, the scheduler does not answer, or a worker has
        another version of palpate.
    MissingExtraError
        A required package is not installed.
    """
    settings = settings or Settings()
    if workers is not None:
        whole_in("workers", workers, 1, 10_000)
    needed("distributed", "a fleet")
    listed = list_sources(sources, leave_out=folder)
    results = Results.begin(folder, settings, listed)
    finished = results.done()
    total = results.contacts
    done = sum(end - first for first, end in finished)
    fleet = Fleet(folder, total, done)
    progress(done, total)
    _count(fleet, results.error_kinds())
    if done == total:
        return fleet
    curves = dict.fromkeys(("zarr", "map"), settings.tip is not None)
    curves["zarr"] |= fits_whole_curves(settings)
    work = [
        source.seconds(settings.diagnosis, whole_curve=curves.get(source.kind, False))
        for source in listed
    ]
    with open_client(workers=workers, scheduler=scheduler, dashboard=dashboard) as client:
        begun = time.perf_counter()
        waiting = batches(listed, work, workers or sum(client.nthreads().values()) or 1, finished)
        for batch, (table, seconds) in _run_batches(client, waiting, settings):
            results.write(batch, table, seconds)
            _count(fleet, table["error_kind"].to_pylist())
            fleet.rows += table.num_rows
            done += batch.end - batch.first
            progress(done, total)
        fleet.seconds = time.perf_counter() - begun
    return fleet


def _count(fleet: Fleet, kinds: Sequence[str | None]) -> None:
    """Add rows to the counts for their class of error; None counts as identified."""
    failed = [kind for kind in kinds if kind is not None]
    fleet.failures += len(failed)
    fleet.identified += len(kinds) - len(failed)
    for kind in failed:
        fleet.reasons[kind] = fleet.reasons.get(kind, 0) + 1


def _run_batches(
    client: Any,
    waiting: Sequence[Batch],
    settings: Settings,
) -> Iterator[tuple[Batch, Any]]:
    """Yield batches and their results as they finish, with few batches sent ahead per worker."""
    distributed = needed("distributed", "a fleet")
    left = deque(waiting)
    running: dict[str, Batch] = {}
    coming = distributed.as_completed(loop=client.loop)
    asked = -math.inf
    most = 0
    while left or running:
        if time.monotonic() - asked > _ASK_AGAIN:  # the number of workers may change
            asked = time.monotonic()
            most = _AHEAD * (sum(client.nthreads().values()) or 1)
        while left and len(running) < most:
            batch = left.popleft()
            future = client.submit(identify_and_time, batch.table, settings, pure=False)
            running[future.key] = batch
            coming.add(future)
        future = next(coming)
        batch = running.pop(future.key)
        yield batch, _answer(client, future, batch.table, settings)


def _answer(
    client: Any,
    future: Any,
    table: Table,
    settings: Settings,
    *,
    alone: bool = False,
) -> tuple[Table, Floats]:
    """Return a task's result; if it ended its workers, identify it in ever smaller parts.

    Dask gives up a task after four workers have ended, because of one contact or by chance. The
    parts run one after another, so that a contact that ends its worker while it runs alone is known
    to be the cause; it becomes a row with its error.
    """
    distributed = needed("distributed", "a fleet")
    pa = needed("pyarrow", "a table of contacts")
    try:
        return future.result()  # type: ignore[no-any-return]
    except distributed.KilledWorker:
        if alone and table.num_rows == 1:
            [named] = table.select(_NAMES).to_pylist()
            return identify_each([(named, FleetError(_ENDED))], settings)
    except FleetError:
        raise
    except Exception as error:
        text = f"{type(error).__name__}: {opening.first_line(error)}"
        raise FleetError(f"a worker failed: {text}") from None
    size = -(-table.num_rows // _PARTS)
    answers = []
    for first in range(0, table.num_rows, size):
        part = table.slice(first, size)
        task = client.submit(identify_and_time, part, settings, pure=False)
        answers.append(_answer(client, task, part, settings, alone=True))
    tables, seconds = zip(*answers, strict=True)
    return pa.concat_tables(tables), np.concatenate(seconds)
