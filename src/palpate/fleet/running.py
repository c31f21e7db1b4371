"""A fleet, run: batches to the workers, their rows to the folder, until all of them are there."""

import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.errors import FleetError
from palpate.fleet.batch import lost, timed_batch
from palpate.fleet.clusters import client_of
from palpate.fleet.extras import needed
from palpate.fleet.listing import sources_of
from palpate.fleet.results import Results
from palpate.fleet.settings import Settings
from palpate.fleet.tasks import Batch, batches
from palpate.validation import Floats, whole_in

if TYPE_CHECKING:
    import pyarrow as pa

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
    busy : float
        What the batches took together, s of one worker.
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
    busy: float = 0.0
    reasons: dict[str, int] = field(default_factory=dict)


def run_fleet(
    sources: Sequence[str | os.PathLike[str]],
    folder: Path,
    settings: Settings | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    dashboard: bool = False,
    progress: Progress | None = None,
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
    cut = batches(listed)
    results = Results.begin(folder, settings, listed, cut)
    waiting = results.waiting()
    total = sum(batch.contacts for batch in cut)
    fleet = Fleet(folder, total, total - sum(batch.contacts for batch in waiting))
    report = progress or (lambda done, total: None)
    report(fleet.reused, total)
    _count(fleet, results.error_kinds())
    if not waiting:
        return fleet
    with client_of(workers=workers, scheduler=scheduler, dashboard=dashboard) as client:
        begun = time.perf_counter()
        done = fleet.reused
        for batch, (table, seconds) in _worked(client, waiting, settings):
            results.write(batch, table, seconds)
            _count(fleet, table["error_kind"].to_pylist())
            fleet.rows += table.num_rows
            fleet.busy += float(seconds.sum())
            done += batch.contacts
            report(done, total)
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
            future = client.submit(timed_batch, batch.table(), settings, pure=False)
            out[future.key] = batch
            coming.add(future)
        future = next(coming)
        batch = out.pop(future.key)
        yield batch, _answer(client, future, batch, settings)


def _answer(client: Any, future: Any, batch: Batch, settings: Settings) -> Any:
    """What a task gave; where it ended its workers, that of its parts."""
    distributed = needed("distributed", "a fleet")
    try:
        return future.result()
    except distributed.KilledWorker:
        return _in_parts(client, batch.table(), settings)
    except FleetError:
        raise
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise FleetError(f"a worker cannot work: {type(error).__name__}: {words}") from None


def _in_parts(client: Any, table: "pa.Table", settings: Settings) -> Any:
    """Find the contact that ends workers, in ever smaller parts: it is a row with its reason.

    Four workers have ended over the whole: by it, or by chance, and then the parts are done.
    """
    distributed = needed("distributed", "a fleet")
    pa = needed("pyarrow", "a table of contacts")
    size = -(-table.num_rows // _PARTS)
    parts = [table.slice(first, size) for first in range(0, table.num_rows, size)]
    tables: list[Any] = []
    seconds: list[Floats] = []
    for part in parts:  # one after another: each that ends is known to have done it itself
        try:
            found, took = client.submit(timed_batch, part, settings, pure=False).result()
        except distributed.KilledWorker:
            if part.num_rows > 1:
                found, took = _in_parts(client, part, settings)
            else:
                found, took = lost(part, settings, _ENDED), np.zeros(1)
        tables.append(found)
        seconds.append(took)
    return pa.concat_tables(tables), np.concatenate(seconds)
