"""``python -m benchmarks.live --minutes 10``: a loop at 1 kHz with page, recording, diagnosis.

``--law auto`` or ``any`` adds the selection of the law. ``--busy 4`` runs four programs beside it
that never wait: ``python -m benchmarks.live --minutes 5 --busy 4``.
"""

import json
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.common.workers import in_new_process
from palpate import VariableProjection
from palpate.input.preparation.online import OnlinePreparation
from palpate.live import run
from palpate.live.diagnosing import Diagnosing
from palpate.live.laboratory import Laboratory
from palpate.live.loop import Histogram
from palpate.live.page import Page
from palpate.live.realtime import ask_for_realtime, run_first
from palpate.live.recorder import Recorder
from palpate.live.running import default_estimator
from palpate.live.sinks import Sink, Watching
from palpate.live.view import verdict_on
from palpate.method.estimators import ContactEstimator
from palpate.method.estimators.by_law import estimator_by_law

TARE = 1.6  # s, of the 2 s for which the laboratory pauses
_EVERY = 1.0  # s between two measurements of the processes
# The processes that serve the loop; laboratory and diagnosis are counted separately.
SERVING = ("loop", "page", "recorder")


class Browser:
    """Receives every frame of the page, as a browser's socket does, in a separate process."""

    name = "browser"

    def __init__(self, port: int) -> None:
        self._port = port

    def run(self, watching: Watching, commands: Connection) -> None:
        """Read until the page closes."""
        from websockets.exceptions import ConnectionClosed
        from websockets.sync.client import connect
        from websockets.typing import Origin

        here = f"127.0.0.1:{self._port}"
        until = time.monotonic() + 20.0
        while time.monotonic() < until:
            try:
                origin = Origin(f"http://{here}")
                with connect(f"ws://{here}/socket", origin=origin) as socket:
                    for _ in socket:
                        pass
            except (ConnectionClosed, OSError):
                time.sleep(0.2)


class Looking:
    """Records each second the core time and memory of every process of the run."""

    name = "looking"

    def __init__(self, path: Path) -> None:
        self._path = path

    def run(self, watching: Watching, commands: Connection) -> None:
        """Measure until the loop stops; then write the record."""
        loop = os.getppid()
        looks: list[dict[str, Any]] = []
        while watching.wait(_EVERY):
            looks.append({"time": time.monotonic(), **_processes(loop)})
        self._path.write_text(json.dumps(looks))


def _processes(loop: int) -> dict[str, tuple[float, int]]:
    """Return seconds of a core and bytes of memory, by process."""
    found = {"loop": _figures(psutil.Process(loop))}
    for child in psutil.Process(loop).children():
        name = child.name().removeprefix("live ")
        if name not in ("python", "python3"):  # the tracker of shared memory
            found[name] = _figures(child)
    return found


def _figures(process: psutil.Process) -> tuple[float, int]:
    times = process.cpu_times()
    return times.user + times.system, process.memory_info().rss


def spin() -> None:
    """Keep a core busy until the process is ended."""
    while True:
        sum(range(1000))


@contextmanager
def keep_busy(count: int) -> Iterator[None]:
    """Run so many programs that never wait."""
    programs = [get_context("spawn").Process(target=spin, daemon=True) for _ in range(count)]
    for program in programs:
        program.start()
    try:
        yield
    finally:
        for program in programs:
            program.terminate()
            program.join()


def idle(seconds: float, *, realtime: bool) -> tuple[Histogram, Histogram]:
    """Measure a loop that only waits, with nothing else running.

    Returns
    -------
    tuple of Histogram
        How late it woke; and the time of a fixed piece of work about as long as an update.
    """
    lateness, work = Histogram(1e-3), Histogram(20e-6)
    with run_first():
        if realtime:
            ask_for_realtime()
        due = time.monotonic()
        for _ in range(round(1000.0 * seconds)):
            due += 1e-3
            time.sleep(max(due - time.monotonic(), 0.0))
            began = time.perf_counter()
            sum(range(100))
            work.add(time.perf_counter() - began)
            lateness.add(time.monotonic() - due)
    return lateness, work


def measure(
    minutes: float, *, realtime: bool, method: ContactEstimator | None, busy: int = 0
) -> Section:
    """Run the loop, and return its counts and its resources.

    Parameters
    ----------
    minutes : float
        How long.
    realtime : bool
        Ask for a fixed priority.
    method : ContactEstimator, optional
        Default: that of ``palpate live``.
    busy : int
        How many programs that never wait run meanwhile. Default: none.
    """
    waiting = partial(idle, min(60.0 * minutes, 60.0), realtime=realtime)
    machines = in_new_process(waiting)
    with tempfile.TemporaryDirectory() as folder:
        looks, page = Path(folder) / "looks.json", Page(port=0)
        recording = Path(folder) / "run.mcap"
        sinks: list[Sink] = [
            page,
            Recorder(recording),
            Diagnosing(),
            Browser(page.port),
            Looking(looks),
        ]
        preparation = OnlinePreparation(sample_time=1e-3, tare_time=TARE)
        with keep_busy(busy):
            status = run(
                Laboratory("ball"), method, sinks, preparation=preparation, realtime=realtime,
                seconds=60.0 * minutes,
            )  # fmt: skip
        size = recording.stat().st_size
        seen = json.loads(looks.read_text())
        return _section(minutes, status, seen, size, machines, busy)


def _section(
    minutes: float,
    status: dict[str, Any],
    looks: list[dict[str, Any]],
    size: int,
    machines: tuple[Histogram, Histogram],
    busy: int,
) -> Section:
    alone, work = (each.as_dict() for each in machines)
    counts, cycle, lateness = status["counts"], status["cycle"], status["lateness"]
    load = os.getloadavg()[1]
    shares, grown = _shares(looks), _growth(looks)
    serving = sum(shares.get(name, 0.0) for name in SERVING)
    rows = [
        Row("samples taken", counts["taken"], ""),
        Row("lost before the estimator", counts["lost"], "", limit=Limit(0.0)),
        Row("refused", counts["refused"], "", limit=Limit(0.0)),
        Row("load average of the last five minutes", load, ""),
        Row("late, by more than 1 ms", 100.0 * (1.0 - lateness["within"]), "%",
            limit=Limit(5.0 if busy else 0.1)),
        Row("done after their time, p99", 1e3 * lateness["p99"], "ms", limit=Limit(10.0)),
        Row("done within 1 ms of their time", 100.0 * lateness["within"], "%"),
        Row("  a loop that only waits, alone", 100.0 * alone["within"], "%"),
        Row("done after their time, p99.9", 1e3 * lateness["p99.9"], "ms"),
        Row("  a loop that only waits, alone", 1e3 * alone["p99.9"], "ms"),
        Row("done after their time, latest", 1e3 * lateness["max"], "ms"),
        Row("update and estimate, p50", 1e6 * cycle["p50"], "µs"),
        Row("update and estimate, p99.9", 1e6 * cycle["p99.9"], "µs", limit=Limit(20.0)),
        Row("update and estimate, longest", 1e6 * cycle["max"], "µs"),
        Row("  a fixed piece of work, alone, p50", 1e6 * work["p50"], "µs"),
        Row("  a fixed piece of work, alone, p99.9", 1e6 * work["p99.9"], "µs"),
        Row("loop, page and recorder", 100.0 * serving, "% of a core", limit=Limit(20.0)),
        *(Row(f"  {name}", 100.0 * share, "% of a core") for name, share in shares.items()),
        *(Row(f"memory, {name}", bytes_ / 1e6, "MB more than after the first minute")
          for name, bytes_ in grown.items()),
        Row("recorded", size / 1e6 / minutes, "MB a minute"),
    ]  # fmt: skip
    notes = [
        f"{minutes:g} minutes beside {busy} busy programs; "
        "laboratory, diagnosis and browser are counted separately."
    ]
    if verdict := verdict_on(status):
        notes.extend(verdict.lines())
    notes += [f"message: {words}" for words in status["said"]]
    return Section("Live at 1 kHz", rows, notes)


def _shares(looks: list[dict[str, Any]]) -> dict[str, float]:
    """Return the share of a core, from the first measurement to the last, without the start."""
    shares = {}
    for name in sorted({name for look in looks for name in look} - {"time", "looking"}):
        seen = [(look["time"], look[name][0]) for look in looks if name in look]
        began = [each for each in seen if each[0] >= seen[0][0] + 5.0] or seen
        (start, before), (stop, after) = began[0], began[-1]
        shares[name] = (after - before) / max(stop - start, 1e-9)
    return shares


def _growth(looks: list[dict[str, Any]]) -> dict[str, float]:
    """Return the memory at the end minus that after a minute, or half of a shorter run."""
    first = looks[0]["time"] + min(60.0, 0.5 * (looks[-1]["time"] - looks[0]["time"]))
    later = [look for look in looks if look["time"] >= first]
    tenth = max(len(later) // 10, 1)
    return {
        name: float(
            np.median([look[name][1] for look in later[-tenth:] if name in look])
            - np.median([look[name][1] for look in later[:tenth] if name in look])
        )
        for name in _shares(looks)
    }


def main(
    *,
    minutes: float = 10.0,
    realtime: bool = False,
    plain: bool = False,
    law: str | None = None,
    busy: int = 0,
    markdown: Path | None = None,
) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    minutes
        How long.
    realtime
        As ``palpate live --realtime``.
    plain
        Variable projection without rejection and detection.
    law
        As ``palpate live --law``, such as auto.
    busy
        How many programs that never wait run meanwhile.
    markdown
        Write the table to this file too.
    """
    facts = describe_machine()
    method: ContactEstimator | None = VariableProjection() if plain else None
    if law is not None:
        kind, settings = estimator_by_law(law)
        method = default_estimator(kind, **settings)
    section = measure(minutes, realtime=realtime, method=method, busy=busy)
    publish([section], facts, "Live at 1 kHz", markdown)


if __name__ == "__main__":
    run_command(main)
