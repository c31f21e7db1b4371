"""A fleet on its workers: tasks in, rows out, on the processors here or on a cluster."""

import asyncio
import itertools
import math
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from palpate._core import __version__
from palpate.contact import Contact
from palpate.errors import FleetError, InvalidParameterError, PalpateError, RecordingError
from palpate.fleet.arrays import (
    Given,
    fits_whole_curves,
    identify_curves,
    identify_each,
    searches_whole_curves,
)
from palpate.fleet.files import Results, curves_of, on_this_machine, sources_of
from palpate.fleet.rows import Row, table_of_rows
from palpate.fleet.tasks import Batch, Settings, Table, batches, cores, needed
from palpate.preparation import prepare
from palpate.recordings import open_recording
from palpate.recordings.opening import FORCE_CURVES, first_line
from palpate.recordings.recording import printable
from palpate.validation import Floats, whole_in

#: A source, and which of its contacts; None where it is one.
Named = tuple[str, int | None]
_NAMES = ("source", "index")
_SAMPLES = ("time", "penetration", "velocity", "force", "segment")


def identify_batch(batch: Table, settings: Settings, *, threads: int = 1) -> Table:
    """Identify a batch of contacts.

    It depends on nothing but its arguments and what these name, and changes nothing: any engine may
    run it, anywhere, again.

    Parameters
    ----------
    batch : pyarrow.Table or RecordBatch
        A row a contact. Either ``source``, ``kind`` and ``index`` say where it is, as
        :meth:`palpate.fleet.tasks.Batch.table` has it; or lists ``time``, ``penetration``,
        ``force`` and, if it was measured, ``velocity``, SI, are its samples, and ``source`` and
        ``index`` are its names, where they are there.
    settings : Settings
        How they are prepared and identified.
    threads : int
        That share contacts of equal length.

    Returns
    -------
    pyarrow.Table
        :func:`palpate.fleet.rows.schema_of` says what it holds: a row a contact, in their
        order; of a recording of a probe that travels a row a place. What fails is a row with its
        reason.

    Raises
    ------
    FleetError
        The settings are of another version of palpate.
    InvalidParameterError
        The batch has other columns.
    """
    return timed_batch(batch, settings, threads=threads)[0]


def timed_batch(batch: Table, settings: Settings, *, threads: int = 1) -> tuple[Table, Floats]:
    """Identify a batch as :func:`identify_batch` does; and the seconds that each row took."""
    if settings.version != __version__:
        raise FleetError(
            f"a worker has palpate {__version__}, and palpate {settings.version} asks; "
            "install one version everywhere"
        )
    pa = needed("pyarrow", "a table of contacts")
    names = set(batch.schema.names)
    if {"penetration", "force", "time"} <= names:
        return identify_each(_held(batch, settings), settings)
    if not {"source", "kind", "index"} <= names:
        raise InvalidParameterError(
            "a batch must have the columns source, kind and index, or time, penetration and force, "
            f"not {', '.join(sorted(names))}"
        )
    found = [_identified(kind, rows, settings, threads) for kind, rows in _runs(batch)]
    if not found:
        return table_of_rows([], settings), np.empty(0)
    return pa.concat_tables([table for table, _ in found]), np.concatenate([s for _, s in found])


def _runs(batch: Table) -> Iterator[tuple[str, list[Named]]]:
    """Rows next to each other that are read together: of one array or map, or any files."""
    columns = (batch.column(name).to_pylist() for name in ("kind", "source", "index"))
    rows = zip(*columns, strict=True)
    for (kind, _), group in itertools.groupby(
        rows, key=lambda row: (row[0], None if row[0] == "file" else row[1])
    ):
        yield kind, [(source, index) for _, source, index in group]


def _identified(
    kind: str, named: list[Named], settings: Settings, threads: int
) -> tuple[Table, Floats]:
    if kind != "zarr":
        return identify_each(_in_files(kind, named), settings, searching=kind == "map")
    source, numbers = named[0][0], [index or 0 for _, index in named]
    first, count = min(numbers), max(numbers) - min(numbers) + 1
    try:
        curves = curves_of(source, first, count)
        table, seconds = identify_curves(curves, settings, threads=threads)
    except Exception as error:
        return identify_each([(_name(each), error) for each in named], settings)
    rows = np.subtract(numbers, first)
    return table.take(rows), seconds[rows]


def _name(named: Named) -> Row:
    return dict(zip(_NAMES, named, strict=True))


def _in_files(kind: str, named: list[Named]) -> Iterator[Given]:
    """Contacts of files; of a map, which is opened once, they are all of one."""
    for some in [named] if kind == "map" else ([each] for each in named):
        left, source = deque(some), some[0][0]
        path = Path(source)
        try:
            with on_this_machine(source) as path:
                if kind == "map":
                    numbers = [index or 0 for _, index in some]
                    found = FORCE_CURVES.reader().read_curves(path, numbers)
                else:
                    found = iter([open_recording(path, curve=some[0][1])])
                for recording in found:
                    yield _name(left.popleft()), recording
        except Exception as error:
            why = error
            if "://" in source and isinstance(error, PalpateError):
                # The name of a copy would tell a person nothing.
                why = RecordingError(str(error).replace(printable(path), source))
            yield from [(_name(each), why) for each in left]


def _held(batch: Table, settings: Settings) -> Iterator[Given]:
    """Contacts whose samples are in the batch itself."""
    columns = {name: batch.column(name) for name in batch.schema.names}

    def contact(k: int, source: str | None) -> Contact:
        samples = {name: columns[name][k] for name in _SAMPLES if name in columns}
        arrays: dict[str, Any] = {
            name: np.asarray(each.values) for name, each in samples.items() if each.is_valid
        }
        return prepare(source=source or "", **arrays, **settings.preparation)

    for k in range(batch.num_rows):
        named = {name: columns[name][k].as_py() for name in _NAMES if name in columns}
        yield named, partial(contact, k, named.get("source"))


# Where a fleet runs: processes of this machine, or the workers of a scheduler.

#: s that a scheduler has to answer.
PATIENCE = 10.0
LOOPBACK = "127.0.0.1"
#: States of a nanny that starts no worker any more.
_GONE = ("failed", "closed")
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
    if scheduler is None:
        with _local(distributed, workers or cores(), dashboard=dashboard) as client:
            yield client
        return
    try:
        _check_address(scheduler)
        client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError) as error:
        raise FleetError(
            f"{scheduler}: no scheduler of Dask answers ({first_line(error)}); start one by dask "
            "scheduler, or leave --scheduler out to use the cores of this machine"
        ) from None
    with client:
        _check_workers(client, scheduler)
        yield client


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
    # A worker that is stopped from outside is no reason to give its work up at the fourth time:
    # what kills workers is found by giving it to one alone.
    settings = {
        "distributed.scheduler.dashboard.tasks.task-stream-length": 100,
        "distributed.nanny.pre-spawn-environ": _ONE_THREAD,
        "distributed.admin.log-format": "%(message)s",
        "distributed.deploy.lost-worker-timeout": "2 s",
        "distributed.scheduler.worker-saturation": 2.0,
    }
    with dask.config.set(settings):
        with ignoring_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:{8787 if dashboard else 0}",
                worker_dashboard_address=None,
                silence_logs=60,
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
        return f"palpate {__version__}"

    try:
        found = client.run(version)
    except Exception as error:
        raise FleetError(f"{scheduler}: its workers cannot be asked: {first_line(error)}") from None
    for worker, answer in sorted(found.items()):
        if answer != f"palpate {__version__}":
            raise FleetError(
                f"{scheduler}: the worker {worker} has {answer}, and palpate {__version__} "
                "asks; install one version, with the extra fleet, everywhere"
            )


# A fleet, run: batches to the workers, their rows to the folder, until all of them are there.

#: Called with how many contacts are done, and of how many.
Progress = Callable[[int, int], None]
# Batches a worker has or waits with: with one more than it works on it never waits for the next.
_AHEAD = 3
_ASK_AGAIN = 5.0  # s
_PARTS = 16
_ENDED = (
    "the workers that identified it ended without a word: a crash, or more memory than there is"
)


@dataclass(slots=True)
class Fleet:
    """What a run of a fleet came to.

    Attributes
    ----------
    folder : Path
        Of the results.
    contacts : int
        Of all sources.
    reused : int
        Of these, what was there from an earlier run.
    failures : int
        Rows with a reason in place of numbers, those of earlier runs too.
    identified : int
        Rows with numbers, those of earlier runs too.
    rows : int
        That this run wrote.
    seconds : float
        From the first batch to the last.
    reasons : dict
        How many rows failed with each class of error.
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
    """Identify all contacts of some sources on Dask, and write a row for each to a folder.

    A batch is written when it is done; a run that was interrupted goes on where it was.

    Parameters
    ----------
    sources : sequence of str or path-like
        Files, patterns, folders, Zarr arrays, force maps, or addresses such as ``s3://bucket/all``.
    folder : Path
        For the results, a dataset of Parquet.
    settings : Settings, optional
        How contacts are prepared and identified.
    workers : int, optional
        Processes on this machine; one a core unless given.
    scheduler : str, optional
        Address of a scheduler of one's own, in place of processes here.
    dashboard : bool
        Let the scheduler show its page on this machine.
    progress : callable, optional
        Called with the contacts that are done, and with all.

    Raises
    ------
    RecordingError
        There is nothing of a name.
    FleetError
        The folder is another run's; the scheduler is not there; or a worker has another palpate.
    MissingExtraError
        What it takes is not installed.
    """
    settings = settings or Settings()
    if workers is not None:
        whole_in("workers", workers, 1, 10_000)
    needed("distributed", "a fleet")
    listed = sources_of(sources, leave_out=folder)
    results = Results.begin(folder, settings, listed)
    there, total = results.done(), results.contacts
    done = sum(end - first for first, end in there)
    fleet = Fleet(folder, total, done)
    progress(done, total)
    _count(fleet, results.error_kinds())
    if done == total:
        return fleet
    curves = {"zarr": fits_whole_curves(settings), "map": searches_whole_curves(settings)}
    work = [
        source.seconds(settings.diagnosis, whole_curve=curves.get(source.kind, False))
        for source in listed
    ]
    with client_of(workers=workers, scheduler=scheduler, dashboard=dashboard) as client:
        begun = time.perf_counter()
        waiting = batches(listed, work, workers or sum(client.nthreads().values()) or 1, there)
        for batch, (table, seconds) in _worked(client, waiting, settings):
            results.write(batch, table, seconds)
            _count(fleet, table["error_kind"].to_pylist())
            fleet.rows += table.num_rows
            done += batch.end - batch.first
            progress(done, total)
        fleet.seconds = time.perf_counter() - begun
    return fleet


def _count(fleet: Fleet, kinds: Sequence[str | None]) -> None:
    """Count rows by why they have no numbers; None where they have."""
    failed = [kind for kind in kinds if kind is not None]
    fleet.failures += len(failed)
    fleet.identified += len(kinds) - len(failed)
    for kind in failed:
        fleet.reasons[kind] = fleet.reasons.get(kind, 0) + 1


def _worked(
    client: Any, waiting: Sequence[Batch], settings: Settings
) -> Iterator[tuple[Batch, Any]]:
    """Yield what comes back, in whatever order; no more is out than the workers need."""
    distributed = needed("distributed", "a fleet")
    left = deque(waiting)
    out: dict[str, Batch] = {}
    coming = distributed.as_completed(loop=client.loop)
    asked, most = -math.inf, 0
    while left or out:
        if time.monotonic() - asked > _ASK_AGAIN:  # workers may come and go
            asked, most = time.monotonic(), _AHEAD * (sum(client.nthreads().values()) or 1)
        while left and len(out) < most:
            batch = left.popleft()
            future = client.submit(timed_batch, batch.table, settings, pure=False)
            out[future.key] = batch
            coming.add(future)
        future = next(coming)
        batch = out.pop(future.key)
        yield batch, _answer(client, future, batch.table, settings)


def _answer(
    client: Any, future: Any, table: Table, settings: Settings, *, alone: bool = False
) -> tuple[Table, Floats]:
    """What a task gave; where it ended its workers, what its ever smaller parts give.

    Four workers have ended over the whole: by one of its contacts, or by chance, and then the parts
    are done. One after another, so that each that ends is known to have done it itself: it is a row
    with its reason.
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
        words = f"{type(error).__name__}: {first_line(error)}"
        raise FleetError(f"a worker cannot work: {words}") from None
    size = -(-table.num_rows // _PARTS)
    answers = []
    for first in range(0, table.num_rows, size):
        part = table.slice(first, size)
        task = client.submit(timed_batch, part, settings, pure=False)
        answers.append(_answer(client, task, part, settings, alone=True))
    tables, seconds = zip(*answers, strict=True)
    return pa.concat_tables(tables), np.concatenate(seconds)
