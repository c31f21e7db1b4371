"""The processes that this one started, and their peak memory."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PROC = Path("/proc")


def descendants(of: int | None = None) -> list[int]:
    """Return the descendants of a process. Default: of this one."""
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
    """Return the Dask workers among them: started by ``spawn``, and no resource tracker."""
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
    """Return the peak memory of a process, bytes; 0 if it has ended."""
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
