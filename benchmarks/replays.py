"""A whole trace: replay() against update() in a loop, and against a C++ program."""

import subprocess
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.calls import KINDS, seconds_per_call
from benchmarks.motion import Floats, Samples, contact_samples
from benchmarks.native_programs import BuildError, native_programs
from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Case, Clock, Effort
from palpate import ContactEstimator

PASSES = 3
Arrays = tuple[Floats, Floats, Floats]


class NativeReplay:
    """Runs the C++ program; keeps each estimator's times and last law.

    ``again`` writes into memory used before, as a program would; ``anew`` into new memory, as
    Python does.
    """

    def __init__(self, arrays: Arrays, folder: Path) -> None:
        self._file = folder / "contact.bin"
        np.concatenate(arrays).tofile(self._file)
        self._program = native_programs().replay
        self.again: dict[str, list[float]] = {}
        self.anew: dict[str, list[float]] = {}
        self.laws: dict[str, list[float]] = {}

    def __call__(self) -> float:
        """Run it once; the times are in ``again`` and ``anew``."""
        command = [str(self._program), str(self._file), str(PASSES)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        for line in done.stdout.splitlines():
            name, again, anew, *law = line.split()
            self.again.setdefault(name, []).append(float(again))
            self.anew.setdefault(name, []).append(float(anew))
            self.laws[name] = [float(value) for value in law]
        return 0.0


def _replay(estimator: ContactEstimator, arrays: Arrays) -> float:
    best = float("inf")
    for _ in range(PASSES):
        estimator.reset()
        start = perf_counter()
        estimator.replay(*arrays)
        best = min(best, perf_counter() - start)
    return best / len(arrays[0])


def _update(estimator: ContactEstimator, samples: Samples) -> float:
    estimator.reset()
    return seconds_per_call(estimator.update, samples)


def _update_from_arrays(estimator: ContactEstimator, arrays: Arrays) -> float:
    """Time per sample, from the arrays that replay() takes, converted to numbers first."""
    estimator.reset()
    update = estimator.update
    start = perf_counter()
    for penetration, velocity, force in zip(*(array.tolist() for array in arrays), strict=True):
        update(penetration, velocity, force)
    return (perf_counter() - start) / len(arrays[0])


def _cases(arrays: Arrays, samples: Samples) -> dict[str, Case]:
    cases: dict[str, Case] = {}
    for kind in KINDS:
        one, other = kind(), kind()
        cases[f"{kind.__name__}.update"] = lambda e=one: _update(e, samples)  # type: ignore[misc]  # a default binds the loop's variable
        cases[f"{kind.__name__}.arrays"] = lambda e=one: _update_from_arrays(e, arrays)  # type: ignore[misc]
        cases[f"{kind.__name__}.replay"] = lambda e=other: _replay(e, arrays)  # type: ignore[misc]
    return cases


def measure_replays(clock: Clock, effort: Effort) -> Section:
    """Time both and the program alternately, per sample."""
    samples = contact_samples(effort.replay_samples)
    penetration, velocity, force = np.array(samples).T.copy()
    arrays = (penetration, velocity, force)
    cases = _cases(arrays, samples)
    notes = [
        f"{effort.replay_samples} samples; per sample, shortest of the rounds. A replay writes 8 "
        "numbers and a status a sample (KelvinVoigtRLS 6) into new memory; the system provides "
        "its pages as they are first written.",
    ]
    with tempfile.TemporaryDirectory() as folder:
        native: NativeReplay | None = None
        try:
            native = NativeReplay(arrays, Path(folder))
            cases["C++"] = native
        except BuildError as error:
            notes.append(f"no C++ program: {error}")
        best = clock.best("replays", cases, effort.replay_rounds, passes=1)
    rows = _rows(best, native)
    if native is not None:
        notes.append(_agreement(arrays, native))
    return Section("Replay of a whole trace, per sample", rows, notes)


def _rows(best: dict[str, float], native: NativeReplay | None) -> list[Row]:
    rows = []
    for kind in KINDS:
        name = kind.__name__
        update, replay = best[f"{name}.update"], best[f"{name}.replay"]
        references: list[tuple[str, float, Limit | None]] = [
            ("update() in a Python loop over ready-made numbers", update, Limit(1.0)),
            ("update() in a Python loop over the arrays", best[f"{name}.arrays"], Limit(1.0)),
        ]
        if native is not None:
            references += [
                ("C++, into existing memory", min(native.again[name]), Limit(1.5)),
                ("C++, into new memory", min(native.anew[name]), None),
            ]
        for reference, seconds, limit in references:
            words = f"{reference}: {1e9 * seconds:.3g} ns"
            rows.append(Row(f"{name}.replay", 1e9 * replay, "ns", replay / seconds, words, limit))
    return rows


def _agreement(arrays: Arrays, native: NativeReplay) -> str:
    """Return a sentence on whether both gave the same law."""
    differing = []
    for kind in KINDS:
        last = kind().replay(*arrays).parameters[-1].tolist()
        if last != native.laws[kind.__name__]:
            differing.append(kind.__name__)
    if differing:
        return f"last law differs between Python and C++: {', '.join(differing)}"
    return "The final law of each method is the same in Python and in C++, bit for bit."
