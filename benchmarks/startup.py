"""The time of ``import palpate`` and of ``palpate --help``."""

import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Case, Clock, Effort


def _running(*command: str) -> Case:
    def run() -> float:
        start = perf_counter()
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
        return perf_counter() - start

    return run


def measure_startup(clock: Clock, effort: Effort) -> Section:
    """Start processes alternately; medians."""
    program = Path(sys.executable).with_name("palpate")
    everything = "import numpy; from palpate import identify"  # loads palpate's modules
    cases = {
        "bare Python": _running(sys.executable, "-c", "pass"),
        "import numpy": _running(sys.executable, "-c", "import numpy"),
        "import numpy, palpate": _running(sys.executable, "-c", everything),
        "palpate --help": _running(str(program), "--help"),
    }
    for case in cases.values():
        case()  # fills the caches of the disk and of bytecode
    rounds = clock.rounds("starting", cases, effort.start_rounds)
    times = {name: 1e3 * median(values) for name, values in rounds.items()}
    more = times["import numpy, palpate"] - times["import numpy"]
    rows = [
        Row("bare Python", times["bare Python"], "ms"),
        Row("import numpy", times["import numpy"], "ms"),
        Row("import palpate, beyond NumPy", more, "ms", limit=Limit(120.0)),
        Row("palpate --help", times["palpate --help"], "ms", limit=Limit(400.0)),
    ]
    notes = [f"Complete processes, with warm disk caches; medians of {effort.start_rounds} rounds."]
    return Section("Starting", rows, notes)
