"""A source that delivers what a test wrote down, and sinks that behave badly."""

import itertools
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from cases import MATERIALS, exciting

from palpate import OnlinePreparation
from palpate.live.loop import Loop
from palpate.live.ring import CAPACITY, COLUMNS, ESTIMATE, RowReader, Writer
from palpate.live.running import default_estimator
from palpate.live.sources import Arrival, Counts, EndOfSourceError

T = 1e-3
PLACE = {name: k for k, name in enumerate(COLUMNS)}


class Silence(float):
    """So long, in s, nothing comes."""


class Scripted:
    """Delivers arrivals, and silences between them; its own clock stands in for the machine's.

    The clock is not waited for, so that a minute of silence takes no time.
    """

    name = "scripted source"
    sample_time = T

    def __init__(self, script):
        self._script = iter(script)
        self.counts = Counts()
        self.opened = self.closed = False
        self.silent = 0.0

    def open(self):
        self.opened = True

    def take(self, timeout):
        while self.silent <= 0.0:
            entry = next(self._script, None)
            if entry is None:
                raise EndOfSourceError
            if not isinstance(entry, Silence):
                return entry
            self.silent = float(entry)
        self.silent -= timeout
        return None

    def ask(self, options):
        return f"asked for {options}"

    def close(self):
        self.closed = True


def pressed(seconds=2.0):
    """The ball under three sines, with 0.05 N of noise."""
    return exciting(MATERIALS["ball"], seconds=seconds, noise=0.05)


def measured(seconds=2.0):
    """The same as lists: times, positions and forces."""
    signals = pressed(seconds)
    return signals.time.tolist(), signals.penetration.tolist(), signals.force.tolist()


def arrivals(times, positions, forces, *, there=None):
    """Each there at its time, by the machine's clock too."""
    rows = zip(times, positions, forces, times if there is None else there, strict=True)
    return [Arrival(*row) for row in rows]


@contextmanager
def rings(capacity=CAPACITY):
    """Where a loop writes samples and estimates, and who reads them."""
    samples, estimates = Writer(capacity), Writer(capacity, len(ESTIMATE))
    yield samples, estimates, RowReader(samples.memory, estimates.memory)


def looped(
    script,
    preparation=None,
    estimator=None,
    commands=(),
    *,
    source=None,
    every_sample=True,
    compensation=None,
):
    """The loop and the rows that it wrote; ``commands`` are taken after so many samples each."""
    source = source or Scripted(script)
    waiting = sorted(commands, key=lambda each: each[0])

    def asked():
        if waiting and loop.counts.taken >= waiting[0][0]:
            return waiting.pop(0)[1]
        return None

    with rings(1 << 15) as (samples, estimates, reader):
        estimator = estimator or default_estimator()
        loop = Loop(source, preparation or OnlinePreparation(), estimator, samples, estimates)
        loop.commands, loop.every_sample = asked, every_sample
        loop.compensation = compensation
        loop.run()
        return loop, reader.take()[0]


def column(rows, name):
    return rows[:, PLACE[name]]


class Endless:
    """A sample every millisecond, in real time, until it is ended or has sent so many."""

    name = "endless source"
    sample_time = T

    def __init__(self, samples=math.inf):
        self.counts, self._samples = Counts(), samples

    def open(self):
        self._began = time.monotonic()
        self._rows = itertools.count()

    def take(self, timeout):
        k = next(self._rows)
        if k >= self._samples:
            raise EndOfSourceError
        due = self._began + k * T
        time.sleep(max(due - time.monotonic(), 0.0))
        swing = math.sin(0.03 * k)
        return Arrival(k * T, 1e-2 + 1e-3 * swing, 20.0 + 2.0 * swing, due)

    def ask(self, options):
        return ""

    def close(self):
        pass


class Looking:
    """A sink that writes down what it saw, and that it ended in order."""

    def __init__(self, path, name="looking"):
        self.path, self.name = path, name

    def run(self, watching, commands):
        rows = 0
        self.path.with_suffix(".began").touch()
        while watching.wait(0.02):
            rows += len(watching.take())
            watching.tell({"rows": rows})
        rows += len(watching.take())
        self.path.write_text(f"{rows} {watching.dropped} {watching.status()['stopped']}")


class Hanging:
    name = "hanging"

    def __init__(self, path):
        self.path = path

    def run(self, watching, commands):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        self.path.write_text(str(os.getpid()))
        while True:
            time.sleep(10.0)


def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def in_a_process(code, **options):
    """Run Python's code beside the tests, which finds what they find."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen([sys.executable, "-c", code], env=environment, text=True, **options)


class Failing:
    name = "failing"

    def run(self, watching, commands):
        raise SystemExit(1)
