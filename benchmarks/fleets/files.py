"""Small recordings of messages, some damaged, compared with reading them by rosbags alone."""

import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.common.report import Limit, Row, Section, at_least
from benchmarks.reading import write_mcap
from benchmarks.whole_identification import messages
from palpate import HuntCrossley
from palpate.fleet.files import read_results
from palpate.fleet.running import run_fleet
from palpate.fleet.tasks import Settings

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
            law = HuntCrossley(np.random.default_rng(k).uniform(1000.0, 4000.0), 2000.0, 1.0)
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


def measure(count: int, damaged: int) -> Section:
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
