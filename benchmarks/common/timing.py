"""Time and memory of calls, on one contact: the lab's rubber ball under the paper's three sines.

Every case is timed once a round, so that a slow second affects all of them.
"""

import gc
import importlib.util
import resource
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress

from benchmarks.common.report import Limit, Row, Section
from palpate import ContactEstimator, lab
from palpate.validation import Floats

#: Runs a case once and returns the seconds that one item of it took.
Case = Callable[[], float]
Samples = list[tuple[float, float, float]]
Update = Callable[[float, float, float], Any]
PERIOD = 5000  # samples
BLOCK = 65_536
CALLS = 100_000  # in which allocations are counted
STATUS = Path("/proc/self/status")
NATIVE = Path(__file__).parents[1] / "native"
BUILD = NATIVE.parents[1] / "build" / "benchmarks"


@dataclass(frozen=True)
class Effort:
    """The size of each measurement."""

    call_rounds: int = 80
    replay_rounds: int = 30
    peer_rounds: int = 12
    start_rounds: int = 15
    replay_samples: int = 100_000
    memory_minutes: tuple[int, int] = (15, 60)

    @classmethod
    def quick(cls) -> "Effort":
        """Short runs that show the order of magnitude."""
        return cls(8, 4, 2, 3, 20_000, (1, 4))


class Clock:
    """Runs cases in rounds, and shows its progress on standard error."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def rounds(self, title: str, cases: Mapping[str, Case], rounds: int) -> dict[str, list[float]]:
        """Return the seconds an item of each case, for each round."""
        times: dict[str, list[float]] = {name: [] for name in cases}
        task = self._progress.add_task(title, total=rounds)
        for _ in range(rounds):
            for name, case in cases.items():
                gc.collect()
                gc.disable()  # as timeit does, for all cases
                try:
                    times[name].append(case())
                finally:
                    gc.enable()
            self._progress.advance(task)
            self._progress.refresh()
        return times

    def best(
        self, title: str, cases: Mapping[str, Case], rounds: int, *, passes: int = 2
    ) -> dict[str, float]:
        """Return the shortest of the rounds, because other processes only ever add time.

        A case runs ``passes`` times in its turn, because the one before left the caches cold.
        """
        warm = {name: _least(case, passes) for name, case in cases.items()}
        return {name: min(times) for name, times in self.rounds(title, warm, rounds).items()}


def _least(case: Case, passes: int) -> Case:
    return lambda: min(case() for _ in range(passes))


@contextmanager
def clock() -> Iterator[Clock]:
    """Open a clock; it draws nothing while a case runs."""
    console = Console(stderr=True)
    with Progress(console=console, auto_refresh=False, transient=True) as progress:
        yield Clock(progress)


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


def seconds_per_update(estimator: ContactEstimator, samples: Samples) -> float:
    """Update a new estimate with every sample."""
    estimator.reset()
    return seconds_per_call(estimator.update, samples)


def resident(entry: str) -> int:
    """Resident memory, bytes: now ("VmRSS") or at most so far ("VmHWM")."""
    if not STATUS.exists():
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    # On Linux ru_maxrss survives exec, and would show the parent's peak.
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith(entry))
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
            # Minus what the counting itself allocates, a number or two.
            own = passing_bytes(_nothing, samples), kept_blocks(_nothing, samples)
            passing = max(passing, passing_bytes(update, samples) - own[0])
            kept = max(kept, kept_blocks(update, samples) - own[1])
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


def _nothing(penetration: float, velocity: float, force: float) -> None:
    pass


class BuildError(Exception):
    """The native programs could not be built, for the reason in the message."""


@dataclass(frozen=True)
class NativePrograms:
    """The native references: a C++ replay, a C++ loop and an empty compiled method."""

    replay: Path
    preparation: Path
    empty_method: Any
    compiler: str


@cache
def native_programs() -> NativePrograms:
    """Configure and build with CMake, optimised as the extension is.

    Raises
    ------
    BuildError
        There is no CMake, compiler or nanobind, or the build failed.
    """
    nanobind = _output([sys.executable, "-m", "nanobind", "--cmake_dir"])
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "nanobind_DIR": nanobind,
        "Python_EXECUTABLE": sys.executable,
    }
    given = [f"-D{name}={value}" for name, value in settings.items()]
    _output(["cmake", "-S", str(NATIVE), "-B", str(BUILD), *given])
    _output(["cmake", "--build", str(BUILD), "--config", "Release"])
    modules = sorted(BUILD.glob("empty_method*.so")) + sorted(BUILD.glob("empty_method*.pyd"))
    if not modules:
        raise BuildError("the build made no empty_method module")
    spec = importlib.util.spec_from_file_location("empty_method", modules[0])
    if spec is None or spec.loader is None:
        raise BuildError(f"{modules[0].name} cannot be imported")
    method = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(method)
    compiler = (BUILD / "compiler.txt").read_text().strip()
    return NativePrograms(BUILD / "replay", BUILD / "preparation", method, compiler)


def compiler() -> str:
    """Return the compiler of the native programs, or why there are none."""
    try:
        return native_programs().compiler
    except BuildError as error:
        print(f"without the C++ program: {error}", file=sys.stderr)
        return f"none ({error})"


def _output(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise BuildError(f"{command[0]} is not installed") from None
    except subprocess.CalledProcessError as error:
        last = (error.stderr or error.stdout).strip().splitlines()[-1:]
        raise BuildError(f"{' '.join(command[:3])} failed: {' '.join(last)}") from None
    return done.stdout.strip()
