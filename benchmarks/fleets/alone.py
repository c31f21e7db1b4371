"""The limit of the machine: the fit alone, in processes that share nothing but its cores.

No scheduler, no files, no writing: the upper limit of the speed-up by two workers.
"""

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor

from benchmarks.fleets.curves import curves

_CURVES = 500
_SECONDS = 4.0
_START = 5.0  # s, in which a process starts and imports


def ratio(processes: int = 2, *, seconds: float = _SECONDS) -> float:
    """Return the rate of so many processes at once, over that of one; the best of three tries."""
    best = [max(_rate(count, seconds) for _ in range(3)) for count in (processes, 1)]
    return best[0] / best[1]


def _rate(processes: int, seconds: float) -> float:
    begin = time.monotonic() + _START
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=spawned) as pool:
        return sum(pool.map(_fitted, [begin] * processes, [begin + seconds] * processes))


def _fitted(begin: float, end: float) -> float:
    """Return curves a second between two times of the clock that all processes share."""
    from palpate.estimators.batch_fit import fit_curves

    rows = curves(0, _CURVES)
    fit_curves(*(each[:20] for each in rows), surface="estimate")
    time.sleep(max(begin - time.monotonic(), 0.0))
    begun, done = time.monotonic(), 0
    while time.monotonic() < end:
        fit_curves(*rows, surface="estimate")
        done += _CURVES
    return done / (time.monotonic() - begun)
