"""Workers killed at random moments: every row occurs once, and is bitwise the same."""

import hashlib
import os
import random
import signal
import tempfile
import threading
from pathlib import Path

from benchmarks.fleets.arrays import UNKNOWN
from benchmarks.fleets.curves import write_array
from benchmarks.fleets.processes import workers
from benchmarks.report import Limit, Row, Section
from palpate.fleet.files import read_results
from palpate.fleet.running import run_fleet

SEED = 20


def measure(count: int, kills: int, folder: Path | None = None) -> Section:
    """Run undisturbed, then kill a worker so many times; both with two workers."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        path = Path(scratch)
        write_array(path / "curves.zarr", count)
        calm = run_fleet([path / "curves.zarr"], path / "calm", UNKNOWN, workers=2)
        done, round_ = 0, 0
        differing = missing = 0
        while done < kills:
            there = path / f"killed-{round_}"
            done += _disturbed(path, there, calm.seconds, kills - done, seed=SEED + round_)
            table = read_results(there)
            indices = table.column("index").to_pylist()
            missing += abs(len(indices) - count) + len(set(range(count)) ^ set(indices))
            differing += digests(there) != digests(path / "calm")
            round_ += 1
    rows = [
        Row(f"rows missing or twice, after {done} times kill -9", missing, "", limit=Limit(0.0)),
        Row(f"runs, of {round_}, that differ in a bit", differing, "", limit=Limit(0.0)),
    ]
    return Section("A worker killed", rows)


def digests(folder: Path) -> dict[str, str]:
    """Return the files of a fleet's results, by their content."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("part-*.parquet"))
    }


def _disturbed(path: Path, there: Path, seconds: float, most: int, seed: int) -> int:
    """Run once, kill workers meanwhile, half a run's time apart, and return the number killed."""
    chosen, ended, killed = random.Random(seed), threading.Event(), 0

    def kill() -> None:
        nonlocal killed
        while killed < most and not ended.wait(chosen.uniform(0.0, 0.5 * seconds)):
            running = workers()
            if running and not ended.is_set():
                try:
                    os.kill(chosen.choice(running), signal.SIGKILL)
                    killed += 1
                except ProcessLookupError:
                    continue

    thread = threading.Thread(target=kill, daemon=True)

    def begun(done: int, total: int) -> None:
        if done and not thread.ident:
            thread.start()

    run_fleet([path / "curves.zarr"], there, UNKNOWN, workers=2, progress=begun)
    ended.set()
    if thread.ident:
        thread.join()
    return killed
