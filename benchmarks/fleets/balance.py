"""Load balance: processor time of the less busy of two workers over the other."""

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fleets.curves import write_array
from benchmarks.report import Limit, Row, Section
from palpate import Contact, HuntCrossley, write_contact
from palpate.fleet import running
from palpate.fleet.running import run_fleet
from palpate.fleet.tasks import Settings

SAMPLES = 200
_FOLDER = "PALPATE_BENCHMARK_TIMES"
_MEASURED = running.identify_and_time


def timed(batch: Any, settings: Settings) -> Any:
    """Run a task as a fleet does, and record its worker's processor time and wall time."""
    begun, processor = time.perf_counter(), time.process_time()
    found = _MEASURED(batch, settings)
    spent = time.process_time() - processor, time.perf_counter() - begun
    with (Path(os.environ[_FOLDER]) / str(os.getpid())).open("a") as file:
        file.write(f"{spent[0]} {spent[1]}\n")
    return found


@contextmanager
def timing() -> Iterator[dict[int, np.ndarray]]:
    """Collect processor time and wall time of each task, s, by its worker."""
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
    law, random = HuntCrossley(4000.0, 60.0, 1.3), np.random.default_rng(3)
    for k, samples in enumerate(lengths):
        at = 1e-3 * np.arange(samples)
        depth, rate = 6e-3 * np.sin(12.6 * at) - 1e-3, 6e-3 * 12.6 * np.cos(12.6 * at)
        force = law.force(depth, rate) + random.normal(0.0, 0.01, samples)
        touch = Contact(at, penetration=depth, velocity=rate, force=force)
        write_contact(touch, folder / f"touch-{k:05d}.csv")


def measure(count: int, folder: Path | None = None) -> Section:
    """Identify so many short contacts on two workers, as arrays and as files."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        path = Path(scratch)
        write_array(path / "curves.zarr", count, samples=SAMPLES)
        write_recordings(path / "files", [SAMPLES] * count)
        # Sorted by name the long ones come last, as in a growing campaign.
        uneven = np.geomspace(200.0, 60_000.0, max(count // 20, 20)).astype(int).tolist()
        write_recordings(path / "uneven", uneven)
        rows = []
        for name, words, diagnosis, limit in (
            ("curves.zarr", f"{count} curves × {SAMPLES}, an array", "input", 0.7),
            ("curves.zarr", f"{count} curves × {SAMPLES}, an array", "none", None),
            ("files", f"{count} files × {SAMPLES}", "input", 0.7),
            ("uneven", f"{len(uneven)} files × 200 to 60 000", "full", 0.7),
        ):
            with timing() as times:
                settings = Settings(diagnosis=diagnosis)  # type: ignore[arg-type]
                found = run_fleet([path / name], path / f"{name}-{diagnosis}", settings, workers=2)
            busy = sorted(each[:, 0].sum() for each in times.values())
            least = busy[0] if len(busy) == 2 else 0.0
            tasks = np.concatenate(list(times.values()))
            bound = None if limit is None else Limit(limit, at_least=True)
            rows += [
                Row(f"{words}, {diagnosis}: less busy over busier", least / busy[-1], "",
                    limit=bound),
                Row("  busier worker", busy[-1], "s of processor"),
                Row("  from the first task to the last row", found.seconds, "s"),
                Row(f"  the longest of {len(tasks)} tasks", tasks[:, 1].max(), "s"),
            ]  # fmt: skip
    return Section("Two workers, evenly", rows, ["processor time within the tasks"])
