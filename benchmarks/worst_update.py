"""``python -m benchmarks.worst_update``: instructions of the dearest update over the median one.

A native program takes samples of many kinds, probing, taps, light contact, a held probe, noise,
jumps, a coarse sensor, and another material every five seconds; it times every update from a copy
of the estimator's state and keeps the indices of the dearest. Valgrind then counts the
instructions of these and of 199 others. Needs a C++ compiler and valgrind with its headers.
"""

import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "benchmarks" / "native" / "worst_update.cpp"
#: The methods, and the limits of their ratios.
METHODS = {"single-stage": 1.5, "default": 4.0, "relaxing": 6.0}


def count_instructions(
    program: Path, method: str, samples: int, folder: Path
) -> tuple[list[int], int]:
    """Return the instructions of the chosen updates of a method, and its size, bytes."""
    run = [str(program), method, str(samples)]
    chosen = subprocess.run(run, check=True, capture_output=True, text=True).stdout.split("\n")
    (size,) = (int(line.split()[1]) for line in chosen if line.startswith("size"))
    indices = [line for line in chosen if line.isdigit()]
    counts = folder / method
    tool = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--combine-dumps=yes"]
    command = [*tool, f"--callgrind-out-file={counts}", *run, *indices]
    subprocess.run(command, check=True, capture_output=True)
    text = "".join(path.read_text() for path in sorted(folder.glob(f"{method}*")))
    found = [int(each) for each in re.findall(r"^totals: (\d+)", text, re.MULTILINE)]
    return [each for each in found if each], size


def main(*, samples: int = 1_000_000) -> None:
    """Count, and print a table.

    Parameters
    ----------
    samples
        Samples of each method.
    """
    compiler = os.environ.get("CXX", "c++")
    missing = [each for each in (compiler, "valgrind") if shutil.which(each) is None]
    if missing:
        sys.exit(f"worst_update needs {' and '.join(missing)}")
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = folder / "worst_update"
        options = ["-std=c++20", "-O3", "-DNDEBUG", f"-I{ROOT / 'include'}"]
        subprocess.run([compiler, *options, str(SOURCE), "-o", str(program)], check=True)
        for method, limit in METHODS.items():
            counts, size = count_instructions(program, method, samples, folder)
            worst, middle = max(counts), statistics.median(counts)
            rows += [
                Row(f"{method}: worst update", worst, "", worst / middle, "median", Limit(limit)),
                Row(f"{method}: median update", middle, ""),
                Row(f"{method}: memory", size, "bytes"),
            ]
    publish([Section("Instructions of an update", rows)], describe_machine(samples=samples))


if __name__ == "__main__":
    run_command(main)
