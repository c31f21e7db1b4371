"""Arrays of curves: speed, memory, two workers over one, their balance, and killed workers."""

import hashlib
import multiprocessing
import os
import random
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.common.report import Limit, Row, Section, at_least
from benchmarks.common.timing import resident
from benchmarks.curves import DEPTH, SPEED, approach_and_retract, random_curves
from palpate import Contact, HuntCrossley, fit_curves, write_contact
from palpate.fleet import running
from palpate.fleet.files import read_results
from palpate.fleet.running import Fleet, run_fleet
from palpate.fleet.tasks import Settings
from palpate.validation import Floats

SAMPLES = 1000
#: Curves that are generated and stored together: 8 MB an array.
BLOCK = 1000
FEW = 200  # samples of a short contact
TOGETHER = 500  # curves that are fitted at once
UNKNOWN = Settings(
    diagnosis="none", estimator={"surface": "estimate"}, preparation={"surface": "estimate"}
)
_WANTED = 1e5  # curves, to which the time limit applies
_START = 5.0  # s, in which a process starts and imports
_FOLDER = "PALPATE_BENCHMARK_TIMES"
_MEASURED = running.identify_and_time


def curves(first: int, count: int, samples: int = SAMPLES) -> tuple[Floats, ...]:
    """Return penetration, velocity and force of some curves, always the same."""
    made = random_curves(approach_and_retract, count, samples=samples, surface=True, seed=first)
    return made.penetration, made.velocity, made.force


def write_array(path: Path, count: int, samples: int = SAMPLES) -> None:
    """Write so many curves as a Zarr group, one block a chunk."""
    import zarr

    group = zarr.open_group(str(path), mode="w")
    group.attrs["sample_time"] = 4.0 * DEPTH / SPEED / samples  # one depth out, in, and back
    shape, chunks = (count, samples), (min(BLOCK, count), samples)
    units = {"penetration": "m", "velocity": "m/s", "force": "N"}
    arrays = {
        name: group.create_array(name, shape=shape, chunks=chunks, dtype="float64")
        for name in units
    }
    for name, array in arrays.items():
        array.attrs["units"] = units[name]
    side = int(np.ceil(np.sqrt(count)))
    column, row = np.divmod(np.arange(float(count)), side)[::-1]
    for name, values in (("x", column), ("y", row)):
        array = group.create_array(name, shape=(count,), dtype="float64")
        array[:] = 1e-6 * values
    for first in range(0, count, BLOCK):
        made = curves(first, min(BLOCK, count - first), samples)
        for array, values in zip(arrays.values(), made, strict=True):
            array[first : first + BLOCK] = values


def measure_arrays(count: int) -> Section:
    """Identify so many curves with two workers and with one, surface unknown."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch)
        write_array(path / "curves.zarr", count)
        _run(path, 2, "warm")  # the file is in memory then
        begun = time.perf_counter()
        with timing() as tasks:
            two = _run(path, 2, "two")
        whole = time.perf_counter() - begun
        one = _run(path, 1, "one")
    peak = max(each[:, 2].max() for each in tasks.values())
    unit = "s"
    limit = Limit(40.0) if count >= _WANTED else None
    busy = sum(float(times[:, 1].sum()) for times in tasks.values())
    idle = 1.0 - busy / (2.0 * two.seconds)
    rows = [
        Row(f"{count} curves × {SAMPLES} points, two workers", two.seconds, unit, limit=limit),
        Row("  with the workers' start and end", whole, unit),
        Row("  a second", count / two.seconds, "curves/s"),
        Row("  peak memory of the larger worker", peak / 1e9, "GB", limit=Limit(1.0)),
        Row("  overhead, part of the workers' time", idle, "", limit=Limit(0.05)),
        Row(
            "one worker", one.seconds, unit, one.seconds / two.seconds, "two workers",
            at_least(1.85) if count >= _WANTED else None,
        ),
    ]  # fmt: skip
    if count >= _WANTED:
        bare = speed_up()
        rows += [Row("two processes over one, the fit alone: the limit of this machine", bare, "×")]
    notes = ["penetration, velocity and force; surface unknown; diagnosis none; from the first "
             "batch to the last file on disk"]  # fmt: skip
    return Section("Zarr to Parquet", rows, notes)


def _run(path: Path, workers: int, name: str) -> Fleet:
    found = run_fleet([path / "curves.zarr"], path / name, UNKNOWN, workers=workers)
    if found.failures:
        raise RuntimeError(f"{found.failures} curves failed: {found.reasons}")
    return found


def speed_up() -> float:
    """Return the rate of two processes over that of one, of the fit alone; the best of three tries.

    No scheduler, no files, no writing: the upper limit of the speed-up by two workers.
    """
    best = [max(_rate(count, 4.0) for _ in range(3)) for count in (2, 1)]
    return best[0] / best[1]


def _rate(processes: int, seconds: float) -> float:
    begin = time.monotonic() + _START
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=spawned) as pool:
        return sum(pool.map(_fitted, [begin] * processes, [begin + seconds] * processes))


def _fitted(begin: float, end: float) -> float:
    """Return curves a second between two times of the clock that all processes share."""
    rows = curves(0, TOGETHER)
    fit_curves(*(each[:20] for each in rows), surface="estimate")
    time.sleep(max(begin - time.monotonic(), 0.0))
    begun, done = time.monotonic(), 0
    while time.monotonic() < end:
        fit_curves(*rows, surface="estimate")
        done += TOGETHER
    return done / (time.monotonic() - begun)


def timed(batch: Any, settings: Settings) -> Any:
    """Run a task as a fleet does; record processor time, wall time, the worker's peak memory."""
    begun, processor = time.perf_counter(), time.process_time()
    found = _MEASURED(batch, settings)
    spent = time.process_time() - processor, time.perf_counter() - begun
    with (Path(os.environ[_FOLDER]) / str(os.getpid())).open("a") as file:
        file.write(f"{spent[0]} {spent[1]} {resident('VmHWM')}\n")
    return found


@contextmanager
def timing() -> Iterator[dict[int, np.ndarray]]:
    """Collect processor time and wall time of each task, s, and peak memory, bytes, by worker."""
    found: dict[int, np.ndarray] = {}
    with tempfile.TemporaryDirectory() as folder:
        os.environ[_FOLDER] = folder
        running.identify_and_time = timed  # type: ignore[assignment]  # without threads, which tasks have
        try:
            yield found
        finally:
            running.identify_and_time = _MEASURED
            del os.environ[_FOLDER]
        for path in Path(folder).iterdir():
            found[int(path.name)] = np.loadtxt(path, ndmin=2)


def write_recordings(folder: Path, lengths: list[int]) -> None:
    """Write a touch of each of these lengths as text."""
    folder.mkdir()
    law, draw = HuntCrossley(K=4000.0, B=60.0, n=1.3), np.random.default_rng(3)
    for k, samples in enumerate(lengths):
        at = 1e-3 * np.arange(samples)
        depth, rate = 6e-3 * np.sin(12.6 * at) - 1e-3, 6e-3 * 12.6 * np.cos(12.6 * at)
        force = law.force(depth, rate) + draw.normal(0.0, 0.01, samples)
        touch = Contact(at, penetration=depth, velocity=rate, force=force)
        write_contact(touch, folder / f"touch-{k:05d}.csv")


def measure_balance(count: int) -> Section:
    """Identify so many short contacts on two workers, as arrays and as files."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch)
        write_array(path / "curves.zarr", count, samples=FEW)
        write_recordings(path / "files", [FEW] * count)
        # Sorted by name the long ones come last, as in a growing campaign.
        uneven = np.geomspace(200.0, 60_000.0, max(count // 20, 20)).astype(int).tolist()
        write_recordings(path / "uneven", uneven)
        rows = []
        for name, words, diagnosis, limit in (
            ("curves.zarr", f"{count} curves × {FEW}, an array", "input", 0.7),
            ("curves.zarr", f"{count} curves × {FEW}, an array", "none", None),
            ("files", f"{count} files × {FEW}", "input", 0.7),
            ("uneven", f"{len(uneven)} files × 200 to 60 000", "full", 0.7),
        ):
            with timing() as times:
                settings = Settings(diagnosis=diagnosis)  # type: ignore[arg-type]
                found = run_fleet([path / name], path / f"{name}-{diagnosis}", settings, workers=2)
            busy = sorted(each[:, 0].sum() for each in times.values())
            least = busy[0] if len(busy) == 2 else 0.0
            tasks = np.concatenate(list(times.values()))
            bound = None if limit is None else at_least(limit)
            rows += [
                Row(f"{words}, {diagnosis}: less busy over busier", least / busy[-1], "",
                    limit=bound),
                Row("  busier worker", busy[-1], "s of processor"),
                Row("  from the first task to the last row", found.seconds, "s"),
                Row(f"  the longest of {len(tasks)} tasks", tasks[:, 1].max(), "s"),
            ]  # fmt: skip
    return Section("Two workers, evenly", rows, ["processor time within the tasks"])


def measure_kills(count: int, kills: int) -> Section:
    """Run undisturbed, then until so many workers were killed, one a run; always two workers."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch)
        write_array(path / "curves.zarr", count)
        calm = run_fleet([path / "curves.zarr"], path / "calm", UNKNOWN, workers=2)
        chosen = random.Random(20)
        runs = done = differing = missing = 0
        while done < kills:
            runs += 1
            there = path / f"killed-{runs}"
            done += _disturb(path, there, calm.seconds, chosen)
            indices = read_results(there).column("index").to_pylist()
            missing += abs(len(indices) - count) + len(set(range(count)) ^ set(indices))
            differing += digests(there) != digests(path / "calm")
    rows = [
        Row(f"rows missing or twice, after {done} times kill -9", missing, "", limit=Limit(0.0)),
        Row(f"runs, of {runs}, that differ in a bit", differing, "", limit=Limit(0.0)),
    ]
    return Section("A worker killed", rows)


def digests(folder: Path) -> dict[str, str]:
    """Return the files of a fleet's results, by their content."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("part-*.parquet"))
    }


def _disturb(path: Path, there: Path, seconds: float, chosen: random.Random) -> bool:
    """Run once, kill a worker at a moment of the run, and return whether there still was one."""
    killed = []

    def kill() -> None:
        if alive := workers():
            chosen.choice(alive).kill()
            killed.append(True)

    timer = threading.Timer(chosen.uniform(0.0, seconds), kill)

    def begun(done: int, total: int) -> None:
        if done and not timer.ident:
            timer.start()

    run_fleet([path / "curves.zarr"], there, UNKNOWN, workers=2, progress=begun)
    timer.cancel()
    return bool(killed)


def workers() -> list[psutil.Process]:
    """Return the Dask workers of this process: started by ``spawn``, and no resource tracker."""
    below = psutil.process_iter(["ppid", "cmdline"])
    ours = {each.pid for each in psutil.Process().children(recursive=True)}
    return [e for e in below if e.pid in ours and "spawn_main" in " ".join(e.info["cmdline"] or ())]
