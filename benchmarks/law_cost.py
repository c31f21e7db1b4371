"""Memory, time a sample and longest call of the compiled estimators of laws with memory."""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.native_programs import BuildError, native_programs
from benchmarks.report import Limit, Row, Section
from palpate import FlatSpectrum, GeneralisedHuntCrossley
from palpate.validation import Floats

DT = 1e-3
LIMITS = {"common": (4.0, 250.0), "full": (20.0, 1500.0)}  # kB, ns
LONGEST_CALL = 200.0  # µs
HOW = (
    "The C++ estimator alone: for each 50 samples, and each call, the minimum of all passes over "
    "the same samples, which excludes the machine's other work. Seen: including it, with the "
    "longest of ten times as many empty calls in the same run for comparison."
)


def measure_cost(samples: int, passes: int) -> Section:
    """Measure the time a sample, the longest call, and the size of one.

    Without a compiler the section has a note and no rows.
    """
    title = f"Cost, {samples} samples, {passes} passes"
    try:
        programs = native_programs().laws
    except BuildError as error:
        return Section(title, [], (f"Not measured: {error}",))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for uneven in (False, True):
            path = Path(folder) / "samples"
            _samples(samples, uneven).tofile(path)
            for level, program in programs.items():
                command = [str(program), str(path), str(passes)]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                rows += _rows(done.stdout, uneven, level)
    return Section(title, rows, (HOW,))


def _rows(printed: str, uneven: bool, level: str) -> list[Row]:
    rows = []
    for line in printed.splitlines():
        name, size, each, later, longest, seen, of_nothing = line.split()
        tier = name.partition(",")[0]
        bytes_limit, time_limit = LIMITS[tier]
        words = name.replace(",", ", ") + (", uneven steps" if uneven else "")
        if level == "O3" and not uneven and name == tier:
            rows.append(
                Row(f"{tier}: bytes of one", float(size) / 1e3, "kB", limit=Limit(bytes_limit))
            )
        # The limits are for the package's own build.
        limit = Limit(time_limit) if level == "O3" else None
        words = f"{words}, -{level}"
        rows += [
            Row(f"{words}: a sample", float(each), "ns", limit=limit),
            Row(f"{words}: of the later half", float(later), "ns"),
            Row(f"{words}: longest call", float(longest), "µs", limit=Limit(LONGEST_CALL)),
            Row(f"{words}: longest seen", float(seen), "µs"),
            Row(f"{words}: longest empty call", float(of_nothing), "µs"),
        ]
    return rows


def _samples(count: int, uneven: bool) -> Floats:
    """Return three sines after an approach, of a law with memory, with noise."""
    rng = np.random.default_rng(1)
    steps = DT * (rng.uniform(0.5, 1.5, count) if uneven else np.ones(count))
    time = np.cumsum(steps) - 0.4
    x = 10e-3 + 1e-3 * np.sin(4 * time) + 1.8e-3 * (np.sin(11 * time) + np.sin(15 * time))
    v = 4e-3 * np.cos(4 * time) + 1.8e-3 * (11 * np.cos(11 * time) + 15 * np.cos(15 * time))
    x = np.where(time < 0.0, 10e-3 + 30e-3 * time, x)
    v = np.where(time < 0.0, 30e-3, v)
    law = GeneralisedHuntCrossley(1e4, 1.5, 4e4, 1.5, 5e3, FlatSpectrum(DT, 4.096))
    force = law.force_along(x, v, steps) + 0.1 * rng.standard_normal(count)
    return np.concatenate([x, v, force, steps])
