"""Bytes, time a sample and longest call of the compiled estimators of laws with memory."""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.native_programs import BuildError, native_programs
from benchmarks.report import Limit, Row, Section
from palpate import FlatSpectrum, GeneralisedHuntCrossley
from palpate.validation import Floats

DT = 1e-3
LIMITS = {"everyday": (4.0, 250.0), "full": (20.0, 1500.0)}  # kB, ns
LONGEST_CALL = 200.0  # µs
HOW = (
    "The C++ estimator alone: of each 50 samples, and of each call, the least of all passes over "
    "the same samples, so that what else the machine does is left out. Seen: with that, beside the "
    "longest of ten times as many calls of nothing in the same run."
)


def measure_cost(samples: int, passes: int) -> Section:
    """Time a sample, the longest call, and the size of one.

    Where there is no compiler the section says so, and has no rows.
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
        # What has a limit is the package's own build.
        limit = Limit(time_limit) if level == "O3" else None
        words = f"{words}, -{level}"
        rows += [
            Row(f"{words}: a sample", float(each), "ns", limit=limit),
            Row(f"{words}: of the later half", float(later), "ns"),
            Row(f"{words}: longest call", float(longest), "µs", limit=Limit(LONGEST_CALL)),
            Row(f"{words}: longest seen", float(seen), "µs"),
            Row(f"{words}: longest of nothing", float(of_nothing), "µs"),
        ]
    return rows


def _samples(count: int, uneven: bool) -> Floats:
    """Three sines after an approach, of a law that remembers, in noise."""
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
