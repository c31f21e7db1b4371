"""``python -m benchmarks.online_preparation``: the cost of velocity in real time."""

import subprocess
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command
from benchmarks.common.timing import (
    PERIOD,
    Case,
    Samples,
    allocated,
    best_times,
    contact_arrays,
    contact_samples,
    kept_blocks,
    native_programs,
    passing_bytes,
    seconds_per_row,
    seconds_per_update,
)
from palpate import (
    OnlinePreparation,
    Payload,
    PayloadCompensation,
    SingleStageRLS,
    VariableProjection,
)

PASSES, ROUNDS = 5, 80
UPDATE, TIMED = "OnlinePreparation.update", "OnlinePreparation.update, time given"
COMPENSATION = "PayloadCompensation.update"
LIMITS = {COMPENSATION: Limit(1000.0)}  # ns
LOOP, SINGLE = "OnlinePreparation and SingleStageRLS", "SingleStageRLS.update"
NATIVE = {
    "even": "VelocityFilter<15>::update",
    "uneven": "VelocityFilter<15>::update, uneven clock",
    "prepared": "OnlinePreparation<15>::update",
    "compensated": "PayloadCompensation<255>::update, window of 101",
    "KelvinVoigtRLS": "KelvinVoigtRLS::update",
    "SingleStageRLS": "SingleStageRLS::update",
    "VariableProjection": "VariableProjection::update",
}


def measure_preparation() -> Section:
    """Time a preparation and the estimators after it, from Python and in C++."""
    samples = contact_samples(PERIOD)
    times = best_times("preparation", _cases(samples), ROUNDS)
    rows = [_row(name, seconds, times[SINGLE], SINGLE) for name, seconds in times.items()]
    poses = _poses(samples)
    for count, unit in ((passing_bytes, "bytes"), (kept_blocks, "blocks")):
        update = _compensation().update
        update(*poses[0])
        passing = allocated(count, update, poses[1:])
        rows.append(Row(f"{COMPENSATION}: allocated", passing, unit, limit=Limit(0)))
    native = _native()
    bare, reference = native["SingleStageRLS"], NATIVE["SingleStageRLS"]
    rows += [_row(NATIVE[name], seconds, bare, reference) for name, seconds in native.items()]
    notes = [
        f"{PERIOD} samples of contact; shortest of the rounds, including the loop around the call."
    ]
    return Section("Velocity in real time", rows, notes)


def _row(name: str, seconds: float, beside: float, reference: str) -> Row:
    """Nanoseconds of a call, over those of the reference."""
    if name in (reference, COMPENSATION):
        return Row(name, 1e9 * seconds, "ns", limit=LIMITS.get(name))
    return Row(name, 1e9 * seconds, "ns", seconds / beside, reference)


def _cases(samples: Samples) -> dict[str, Case]:
    measured = [(x, force) for x, _, force in samples]
    stamped = [(*row, 1e-3 * k + 1e-9 * (k % 97)) for k, row in enumerate(measured)]
    single, projection, poses = SingleStageRLS(), VariableProjection(), _poses(samples)
    return {
        SINGLE: lambda: seconds_per_update(single, samples),
        "VariableProjection.update": lambda: seconds_per_update(projection, samples),
        UPDATE: lambda: seconds_per_row(OnlinePreparation().update, measured),
        TIMED: lambda: seconds_per_row(OnlinePreparation().update, stamped),
        LOOP: lambda: _loop(measured),
        COMPENSATION: lambda: seconds_per_row(_compensation().update, poses),
    }


def _compensation() -> PayloadCompensation:
    payload = Payload(0.5, np.array([0.0, 0.0, 0.05]), np.eye(3), np.ones(6), np.full(6, 1e-4))
    return PayloadCompensation(payload=payload)


def _poses(samples: Samples) -> list[Any]:
    return [
        ((0.0, 0.0, -x), (1.0, x, 0.0, 0.0), (0.0, 0.0, force, 0.1, 0.0, 0.0), 1e-3 * k)
        for k, (x, _, force) in enumerate(samples)
    ]


def _loop(rows: list[Any]) -> float:
    prepare, update = OnlinePreparation().update, SingleStageRLS().update
    start = perf_counter()
    for position, force in rows:
        if sample := prepare(position, force):
            update(*sample)
    return (perf_counter() - start) / len(rows)


def _native() -> dict[str, float]:
    best: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "contact.bin"
        np.concatenate(contact_arrays(100_000)).tofile(file)
        command = [str(native_programs().preparation), str(file), str(PASSES)]
        for _ in range(10):
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            for line in done.stdout.splitlines():
                name, seconds = line.split()
                best[name] = min(best.get(name, np.inf), float(seconds))
    return best


def main(*, markdown: Path | None = None) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    markdown
        Write the table to this file too.
    """
    facts = describe_machine(native_programs().compiler)
    publish([measure_preparation()], facts, "Preparing samples in a loop", markdown)


if __name__ == "__main__":
    run_command(main)
