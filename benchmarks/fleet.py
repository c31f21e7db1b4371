"""Many contacts at once: speed and safety.

``python -m benchmarks.fleet`` takes some ten minutes, two cores and 6 GB of disk, in ``TMPDIR``;
``--short`` a minute, with fewer of everything. ``--only`` chooses among arrays, balance, kills,
files, force-curves, nanite; for the last, ``--nanite`` names the Python of an environment that has
it.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.fleets import arrays, force_curves, nanite
from benchmarks.reading import write_mcap
from benchmarks.whole_identification import messages
from palpate import HuntCrossley
from palpate.fleet.files import read_results
from palpate.fleet.running import run_fleet
from palpate.fleet.tasks import Settings

Part = Literal["arrays", "balance", "kills", "files", "force-curves", "nanite"]
SECONDS = 1.0
_FILES = 200  # that are generated; the others are copies, equivalent for reading


def write_files(folder: Path, count: int, damaged: int) -> None:
    """Write so many files, some of which, at equal distances, are cut or overwritten."""
    folder.mkdir()
    made = []
    spoilt = set(np.linspace(0, count - 1, damaged).astype(int).tolist())
    for k in range(count):
        path = folder / f"touch-{k:05d}.mcap"
        if k < _FILES:  # an approach and a press of a stiffness of its own
            law = HuntCrossley(K=np.random.default_rng(k).uniform(1000.0, 4000.0), B=2000.0, n=1.0)
            write_mcap(path, messages(SECONDS / 60.0, k, law))
            made.append(path.read_bytes())
        content = made[k % _FILES]
        if k in spoilt:  # zeros, or only the first bytes: unreadable
            content = bytes(len(content)) if k % 2 else content[:40]
        path.write_bytes(content)


def read_by_rosbags(path: Path, store: object) -> int:
    """Read and decode all messages by rosbags; return 0 for a file that it cannot read."""
    from rosbags.rosbag2.storage_mcap import McapReader

    reader = McapReader(path)
    try:
        reader.open()
        count = sum(
            store.deserialize_cdr(data, connection.msgtype) is not None  # type: ignore[attr-defined]
            for connection, _, data in reader.messages(reader.connections, None, None)
        )
    except Exception:  # any error from damage; it has closed the file then
        return 0
    reader.close()
    return count


def measure_files(count: int, damaged: int) -> Section:
    """Identify all of them with one worker, and read them by rosbags in this process."""
    from rosbags.typesys import Stores, get_typestore

    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch)
        write_files(path / "touches", count, damaged)
        store = get_typestore(Stores.ROS2_HUMBLE)
        begun = time.perf_counter()
        for each in sorted((path / "touches").iterdir()):
            read_by_rosbags(each, store)
        alone = time.perf_counter() - begun
        found = run_fleet(
            [path / "touches"], path / "results", Settings(diagnosis="none"), workers=1
        )
        table = read_results(path / "results")
    reasons = [error for error in table.column("error").to_pylist() if error]
    sources = table.column("source").to_pylist()
    rows = [
        Row(f"rows of {count} files", len(set(sources)), "", limit=at_least(count)),
        Row(f"rows with a reason, of {damaged} damaged", len(reasons), "",
            limit=Limit(damaged) if len(reasons) >= damaged else at_least(damaged)),
        Row("identified, one worker", count / found.seconds, "files/s",
            alone / found.seconds, "rosbags, reading and decoding alone",
            at_least(0.8)),
        Row("read and decoded by rosbags, one process", count / alone, "files/s"),
    ]  # fmt: skip
    return Section("Small recordings of messages", rows, [f"{SECONDS:g} s of wrench and pose each"])


def main(
    *,
    short: bool = False,
    only: Annotated[list[Part] | None, Parameter(consume_multiple=True)] = None,
    nanite_python: Annotated[str, Parameter("--nanite")] = "python",
    markdown: Path | None = None,
) -> None:
    """Measure the requested parts, and print them.

    Parameters
    ----------
    short
        Fewer of everything.
    only
        Some of the parts. Default: all.
    nanite_python
        Python that has nanite.
    markdown
        Write the tables to this file too.
    """
    parts: dict[Part, Callable[[], Section]] = {
        "arrays": lambda: arrays.measure_arrays(2_000 if short else 100_000),
        "balance": lambda: arrays.measure_balance(2_000),
        "kills": lambda: arrays.measure_kills(*((6_000, 2) if short else (40_000, 20))),
        "files": lambda: measure_files(*((40, 4) if short else (10_000, 100))),
        "force-curves": force_curves.measure,
        "nanite": lambda: nanite.measure(nanite_python),
    }
    sections = [parts[name]() for name in parts if name in (only or parts)]
    publish(sections, describe_machine(), "Fleets", markdown)


if __name__ == "__main__":
    run_command(main)
