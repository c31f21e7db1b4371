"""Time and memory of calls, on one contact: the lab's rubber ball under the paper's three sines.

Every case is timed once a round, so that a slow second affects all of them.
"""

import gc
import importlib.util
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any, TypeVar

import numpy as np

from benchmarks.common.report import Limit, Row, Section
from palpate import ContactEstimator, lab
from palpate.validation import Floats

#: Runs a case once and returns the seconds that one item of it took.
Case = Callable[[], float]
Samples = list[tuple[float, float, float]]
Update = Callable[[float, float, float], Any]
Result = TypeVar("Result")
PERIOD = 5000  # samples
BLOCK = 65_536
CALLS = 100_000  # in which allocations are counted
NATIVE = Path(__file__).parents[1] / "native"
BUILD = NATIVE.parents[1] / "build" / "benchmarks"


def time_rounds(title: str, cases: Mapping[str, Case], rounds: int) -> dict[str, list[float]]:
    """Return the seconds an item of each case, for each round; a round runs every case once."""
    print(f"{title} …", file=sys.stderr)
    times: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(rounds):
        for name, case in cases.items():
            gc.collect()
            gc.disable()  # as timeit does, for all cases
            try:
                times[name].append(case())
            finally:
                gc.enable()
    return times


def best_times(title: str, cases: Mapping[str, Case], rounds: int) -> dict[str, float]:
    """Return the shortest of the rounds, because other processes only ever add time.

    A case runs twice in its turn, because the one before left the caches cold.
    """
    warm: dict[str, Case] = {
        name: lambda case=case: min(case(), case())  # type: ignore[misc]
        for name, case in cases.items()
    }
    return {name: min(times) for name, times in time_rounds(title, warm, rounds).items()}


def least_seconds(work: Callable[[], Result]) -> tuple[float, Result]:
    """Return the least time of this thread on its processor for some work, and what it gave."""
    best = np.inf
    for _ in range(7):
        start = thread_time()
        result = work()
        best = min(best, thread_time() - start)
    return float(best), result


def contact_arrays(samples: int) -> tuple[Floats, Floats, Floats]:
    """Return penetration, velocity and force at 1 kHz, always in contact; 0.05 N of noise.

    Filled block by block, so that this needs no further memory.
    """
    random = np.random.default_rng(1)
    x, v, force = np.empty(samples), np.empty(samples), np.empty(samples)
    for start in range(0, samples, BLOCK):
        part = slice(start, min(start + BLOCK, samples))
        t = 1e-3 * np.arange(part.start, part.stop)
        x[part], v[part] = lab.THREE_SINES.motion.at(t)
        clean = lab.BALL.law.force(x[part], v[part])
        force[part] = clean + 0.05 * random.standard_normal(t.size)
    return x, v, force


def contact_samples(samples: int) -> Samples:
    """Return the same as plain floats, sample by sample: 5 s of contact, repeated.

    So few that they stay in the cache, as the current sample of a control loop does.
    """
    columns = (array.tolist() for array in contact_arrays(min(samples, PERIOD)))
    period = list(zip(*columns, strict=True))
    return (period * -(-samples // len(period)))[:samples]


def seconds_per_call(update: Update, samples: Samples) -> float:
    """Call it with every sample."""
    start = perf_counter()
    for penetration, velocity, force in samples:
        update(penetration, velocity, force)
    return (perf_counter() - start) / len(samples)


def seconds_per_row(update: Callable[..., Any], rows: Sequence[Any]) -> float:
    """Call it with every row, however many numbers it has."""
    start = perf_counter()
    for row in rows:
        update(*row)
    return (perf_counter() - start) / len(rows)


def seconds_per_update(estimator: ContactEstimator, samples: Samples) -> float:
    """Update a new estimate with every sample."""
    estimator.reset()
    return seconds_per_call(estimator.update, samples)


def resident(entry: str) -> int:
    """Resident memory of this process, bytes: now ("VmRSS") or at most so far ("VmHWM")."""
    lines = Path("/proc/self/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith(entry))
    return 1024 * int(line.split()[1])


def count_allocations(kinds: Sequence[type[ContactEstimator]]) -> Section:
    """Count the memory that one update allocates, in contact and out of it; the larger counts."""
    contact = contact_samples(CALLS)
    free = [(-penetration, velocity, 0.0) for penetration, velocity, _ in contact]
    rows = []
    for kind in kinds:
        update = kind().update
        update(*contact[0])
        passing, kept = 0, 0
        for samples in (contact, free):
            passing = max(passing, allocated(passing_bytes, update, samples))
            kept = max(kept, allocated(kept_blocks, update, samples))
        name = f"{kind.__name__}.update"
        rows.append(Row(f"{name}: passing", passing, "bytes", limit=Limit(0)))
        rows.append(Row(f"{name}: kept", kept, "blocks", limit=Limit(0)))
    notes = [
        f"{CALLS} calls in contact and {CALLS} out of it. Passing: tracemalloc's peak during "
        "the calls, minus its value at the start. Kept: sys.getallocatedblocks() after the calls "
        "minus before.",
    ]
    return Section("Allocations of update()", rows, notes)


def passing_bytes(update: Callable[..., Any], samples: Sequence[Any]) -> int:
    """Return the peak of the bytes held during the calls, minus those held before."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        for sample in samples:
            update(*sample)
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


def kept_blocks(update: Callable[..., Any], samples: Sequence[Any]) -> int:
    """Return the blocks of the interpreter's memory in use after the calls, minus those before."""
    before = sys.getallocatedblocks()
    for sample in samples:
        update(*sample)
    return sys.getallocatedblocks() - before


def allocated(count: Callable[..., int], update: Callable[..., Any], rows: Sequence[Any]) -> int:
    """Return what the calls allocate, minus what the counting does, a number or two."""
    return count(update, rows) - count(_nothing, rows)


def _nothing(x: object, v: object, force: object, time: object = None) -> None:
    """Take a row of three or four without a tuple, which would count."""


@dataclass(frozen=True)
class NativePrograms:
    """The native references: a C++ replay, a C++ loop and an empty compiled method."""

    replay: Path
    preparation: Path
    empty_method: Any
    compiler: str


@cache
def native_programs() -> NativePrograms:
    """Configure and build with CMake, optimised as the extension is."""
    import nanobind  # of the extra develop, which the tests of curves do without

    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "nanobind_DIR": nanobind.cmake_dir(),
        "Python_EXECUTABLE": sys.executable,
    }
    given = [f"-D{name}={value}" for name, value in settings.items()]
    for command in (
        ["cmake", "-S", str(NATIVE), "-B", str(BUILD), *given],
        ["cmake", "--build", str(BUILD), "--config", "Release"],
    ):
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    (module,) = [*BUILD.glob("empty_method*.so"), *BUILD.glob("empty_method*.pyd")]
    spec = importlib.util.spec_from_file_location("empty_method", module)
    assert spec is not None
    assert spec.loader is not None
    method = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(method)
    compiler = (BUILD / "compiler.txt").read_text().strip()
    return NativePrograms(BUILD / "replay", BUILD / "preparation", method, compiler)
