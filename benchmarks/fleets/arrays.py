"""From Zarr to Parquet: speed, memory, and two workers over one."""

import tempfile
import time
from pathlib import Path

from benchmarks.fleets import alone
from benchmarks.fleets.balance import timing
from benchmarks.fleets.curves import SAMPLES, write_array
from benchmarks.fleets.processes import watching
from benchmarks.report import Limit, Row, Section
from palpate.fleet.running import Fleet, run_fleet
from palpate.fleet.tasks import Settings

UNKNOWN = Settings(
    diagnosis="none", estimator={"surface": "estimate"}, preparation={"surface": "estimate"}
)
_WANTED = 1e5  # curves, to which the time limit applies


def measure(count: int, folder: Path | None = None) -> Section:
    """Identify so many curves with two workers and with one, surface unknown."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        path = Path(scratch)
        write_array(path / "curves.zarr", count)
        _timed(path, 2, "warm")  # the file is in memory then
        with timing() as tasks:
            two, whole, peak = _timed(path, 2, "two")
        one, _, _ = _timed(path, 1, "one")
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
            Limit(1.85, at_least=True) if count >= _WANTED else None,
        ),
    ]  # fmt: skip
    if count >= _WANTED:
        bare = alone.ratio()
        rows += [Row("two processes over one, the fit alone: the limit of this machine", bare, "×")]
    notes = ["penetration, velocity and force; surface unknown; diagnosis none; from the first "
             "batch to the last file on disk"]  # fmt: skip
    return Section("Zarr to Parquet", rows, notes)


def _timed(path: Path, workers: int, name: str) -> tuple[Fleet, float, int]:
    with watching() as peaks:
        begun = time.perf_counter()
        found = run_fleet([path / "curves.zarr"], path / name, UNKNOWN, workers=workers)
        whole = time.perf_counter() - begun
    if found.failures:
        raise RuntimeError(f"{found.failures} curves failed: {found.reasons}")
    return found, whole, max(peaks.values(), default=0)
