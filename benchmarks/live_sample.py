"""``python -m benchmarks.live_sample``: CPU time of one sample in the live loop.

In all: take, prepare, update, judge, record, and the status four times a second. From a source
that never waits; and at 1 kHz, where the loop sleeps before each sample and wakes with cold caches,
compared with a loop that only sleeps.
"""

import time
from collections.abc import Sequence
from functools import partial
from multiprocessing.connection import Connection

import numpy as np

from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command
from benchmarks.common.timing import contact_arrays
from palpate.live import run
from palpate.live.running import default_estimator
from palpate.live.sinks import Watching
from palpate.live.sources import Arrival, Counts, EndOfSourceError
from palpate.method.estimators.by_law import estimator_by_law

T = 1e-3  # s
#: µs: with an estimate 50 times a second, and with one at every sample.
LIMITS = {False: 40.0, True: 80.0}


def arrivals(count: int) -> list[Arrival]:
    """Three sines on a ball, with 0.05 N of noise."""
    x, _, force = contact_arrays(count)
    times = T * np.arange(count)
    columns = (each.tolist() for each in (times, x, force, times))
    return [Arrival(*row) for row in zip(*columns, strict=True)]


class Source:
    """Delivers samples at once, or one each millisecond; measures the CPU time of its process."""

    name, sample_time = "samples", T

    def __init__(self, samples: Sequence[Arrival], *, paced: bool) -> None:
        self.counts, self._samples, self._paced = Counts(), iter(samples), paced
        self.took = 0.0

    def open(self) -> None:
        """Begin to measure."""
        self._began, self._due = time.process_time(), time.monotonic()

    def take(self, timeout: float) -> Arrival:
        """Return the next sample; after the last, stop the clock."""
        if self._paced:
            self._due += T
            time.sleep(max(self._due - time.monotonic(), 0.0))
        for sample in self._samples:
            return sample._replace(there=self._due) if self._paced else sample
        self.took = time.process_time() - self._began
        raise EndOfSourceError

    def ask(self, options: dict[str, object]) -> str:
        """Nothing."""
        return ""

    def close(self) -> None:
        """Nothing."""


class Every:
    """Requests the estimate at every sample, as a publisher or a recorder does, in its process."""

    name, every_sample = "every", True

    def run(self, watching: Watching, commands: Connection) -> None:
        """Take all rows."""
        while watching.wait(0.25):
            watching.take()


def cost(count: int, law: str | None, *, every: bool, paced: bool) -> float:
    """Return the least CPU time a sample of five runs (paced: one), µs."""
    kind, settings = estimator_by_law(law)
    took = []
    for _ in range(1 if paced else 5):
        source = Source(arrivals(count), paced=paced)
        status = run(source, default_estimator(kind, **settings), [Every()] if every else [])
        assert status["counts"]["learned"] > 0.9 * count
        took.append(1e6 * source.took / count)
    return min(took)


def asleep(count: int) -> float:
    """Return the CPU time of sleeping alone, µs each."""
    source = Source(arrivals(count), paced=True)
    source.open()
    for _ in range(count):
        source.take(1.0)
    return 1e6 * (time.process_time() - source._began) / count


def measure(count: int) -> Section:
    """Measure both sources, one that never waits and one at 1 kHz, with both kinds of estimator."""
    rows = []
    for law, name in ((None, "variable projection"), ("auto", "--law auto")):
        for every, how in ((False, "50 estimates a second"), (True, "one at every sample")):
            of = partial(cost, count, law, every=every)
            limit = Limit(LIMITS[every])
            rows.append(Row(f"{name}, {how}", of(paced=False), "µs", limit=limit))
            rows.append(Row("  at 1 kHz, asleep between", of(paced=True), "µs"))
    rows.append(Row("a loop that only sleeps at 1 kHz", asleep(count), "µs"))
    return Section("A sample of the live loop, CPU time", rows, [f"{count} samples each."])


def main(*, samples: int = 10_000) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    samples
        Of each run.
    """
    publish([measure(samples)], describe_machine())


if __name__ == "__main__":
    run_command(main)
