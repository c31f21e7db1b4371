"""The processes that this one started: which they are, and how much memory each has had."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PROC = Path("/proc")


def descendants(of: int | None = None) -> list[int]:
    """Processes that one, unless given this one, started, and that these started."""
    children: dict[int, list[int]] = {}
    for entry in _PROC.iterdir():
        if entry.name.isdecimal():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, IndexError, ValueError):  # it has just ended
                continue
            children.setdefault(parent, []).append(int(entry.name))
    found, look = [], [of or os.getpid()]
    while look:
        for child in children.get(look.pop(), []):
            found.append(child)
            look.append(child)
    return found


def workers() -> list[int]:
    """Those of them that are workers of Dask: made by ``spawn``, and no tracker of resources."""
    found = []
    for process in descendants():
        try:
            line = (_PROC / str(process) / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if any(b"spawn_main" in word for word in line):
            found.append(process)
    return found


def peak(process: int) -> int:
    """The most memory that a process has had, bytes; 0 of one that has ended."""
    try:
        for line in (_PROC / str(process) / "status").read_text().splitlines():
            if line.startswith("VmHWM"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    return 0


@contextmanager
def watching() -> Iterator[dict[int, int]]:
    """Keep the peak memory of each worker, bytes, by its number."""
    found: dict[int, int] = {}
    ended = threading.Event()

    def look() -> None:
        while not ended.wait(0.25):
            for process in workers():
                found[process] = max(found.get(process, 0), peak(process))

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    try:
        yield found
    finally:
        ended.set()
        thread.join()
