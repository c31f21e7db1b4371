"""Extra memory of a long replay, beyond its inputs and the trace it returns.

``python -m benchmarks.memory SAMPLES`` prints the bytes of one replay; the section below runs it
in separate processes.
"""

import json
import resource
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np

from benchmarks.motion import contact_arrays
from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Effort
from palpate import SingleStageRLS

STATUS = Path("/proc/self/status")


def resident(entry: str) -> int:
    """Resident memory, bytes: now ("VmRSS") or at most so far ("VmHWM")."""
    if not STATUS.exists():
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    # On Linux ru_maxrss survives exec, and would show the parent's peak.
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith(entry))
    return 1024 * int(line.split()[1])


def extra_bytes(samples: int) -> dict[str, int]:
    """Replay, and return how far the peak lies above the start and the trace."""
    SingleStageRLS().replay(*contact_arrays(1000))
    arrays = contact_arrays(samples)
    before = resident("VmRSS")
    trace = SingleStageRLS().replay(*arrays)
    grown = resident("VmHWM") - before
    columns = (getattr(trace, field.name) for field in fields(trace))
    size = sum(column.nbytes for column in columns if isinstance(column, np.ndarray))
    inputs = sum(array.nbytes for array in arrays)
    return {"inputs": inputs, "trace": size, "extra": grown - size}


def _in_a_process(samples: int) -> dict[str, int]:
    command = [sys.executable, "-m", "benchmarks.memory", str(samples)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    result: dict[str, int] = json.loads(done.stdout)
    return result


def measure_memory(effort: Effort) -> Section:
    """Compare a short and a long replay at 1 kHz."""
    megabyte = 1e6
    rows, extras = [], []
    for minutes in effort.memory_minutes:
        sizes = _in_a_process(minutes * 60_000)
        extras.append(sizes["extra"] / megabyte)
        name = f"{minutes} min at 1 kHz"
        rows.append(Row(f"{name}: inputs", sizes["inputs"] / megabyte, "MB"))
        rows.append(Row(f"{name}: trace returned", sizes["trace"] / megabyte, "MB"))
        rows.append(Row(f"{name}: extra at the peak", extras[-1], "MB", limit=Limit(8.0)))
    growth = extras[1] - extras[0]
    rows.append(
        Row("extra of the longer minus that of the shorter", growth, "MB", limit=Limit(1.0))
    )
    notes = ["Peak resident memory of a separate process, SingleStageRLS.replay."]
    return Section("Memory of a long replay", rows, notes)


if __name__ == "__main__":
    print(json.dumps(extra_bytes(int(sys.argv[1]))))
