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
    BuildError,
    Case,
    Clock,
    Effort,
    Samples,
    clock,
    contact_arrays,
    contact_samples,
    kept_blocks,
    native_programs,
    passing_bytes,
    seconds_per_update,
)
from palpate import (
    OnlinePreparation,
    Payload,
    PayloadCompensation,
    SingleStageRLS,
    VariableProjection,
)

PASSES = 5
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


def measure_preparation(clock: Clock, effort: Effort) -> Section:
    """Time a preparation and the estimators after it, from Python and in C++."""
    samples = contact_samples(PERIOD)
    times = clock.best("preparation", _cases(samples), effort.call_rounds)
    rows = [
        Row(name, 1e9 * seconds, "ns", limit=LIMITS[name])
        if name in LIMITS
        else Row(
            name,
            1e9 * seconds,
            "ns",
            *((seconds / times[SINGLE], SINGLE) if name != SINGLE else ()),
        )
        for name, seconds in times.items()
    ]
    poses = _poses(samples)
    for count, unit in ((passing_bytes, "bytes"), (kept_blocks, "blocks")):
        update = _compensation().update
        update(*poses[0])
        own = count(lambda position, orientation, wrench, time: None, poses[1:])
        allocated = count(update, poses[1:]) - own
        rows.append(Row(f"{COMPENSATION}: allocated", allocated, unit, limit=Limit(0)))
    notes = [
        f"{PERIOD} samples of contact; shortest of the rounds, including the loop around the call."
    ]
    try:
        native = _native(effort)
    except BuildError as error:
        notes.append(f"not in C++: {error}")
        return Section("Velocity in real time", rows, notes)
    bare = native["SingleStageRLS"]
    for name, seconds in native.items():
        beside = () if name == "SingleStageRLS" else (seconds / bare, NATIVE["SingleStageRLS"])
        rows.append(Row(NATIVE[name], 1e9 * seconds, "ns", *beside))
    return Section("Velocity in real time", rows, notes)


def _cases(samples: Samples) -> dict[str, Case]:
    measured = [(x, force) for x, _, force in samples]
    stamped = [(*row, 1e-3 * k + 1e-9 * (k % 97)) for k, row in enumerate(measured)]
    single, projection, poses = SingleStageRLS(), VariableProjection(), _poses(samples)
    return {
        SINGLE: lambda: seconds_per_update(single, samples),
        "VariableProjection.update": lambda: seconds_per_update(projection, samples),
        UPDATE: lambda: _prepared(measured),
        TIMED: lambda: _prepared(stamped),
        LOOP: lambda: _loop(measured),
        COMPENSATION: lambda: _compensated(poses),
    }


def _compensation() -> PayloadCompensation:
    payload = Payload(0.5, np.array([0.0, 0.0, 0.05]), np.eye(3), np.ones(6), np.full(6, 1e-4))
    return PayloadCompensation(payload=payload)


def _poses(samples: Samples) -> list[Any]:
    return [
        ((0.0, 0.0, -x), (1.0, x, 0.0, 0.0), (0.0, 0.0, force, 0.1, 0.0, 0.0), 1e-3 * k)
        for k, (x, _, force) in enumerate(samples)
    ]


def _compensated(rows: list[Any]) -> float:
    update = _compensation().update
    start = perf_counter()
    for row in rows:
        update(*row)
    return (perf_counter() - start) / len(rows)


def _prepared(rows: list[Any]) -> float:
    update = OnlinePreparation().update
    start = perf_counter()
    for row in rows:
        update(*row)
    return (perf_counter() - start) / len(rows)


def _loop(rows: list[Any]) -> float:
    prepare, update = OnlinePreparation().update, SingleStageRLS().update
    start = perf_counter()
    for position, force in rows:
        if sample := prepare(position, force):
            update(*sample)
    return (perf_counter() - start) / len(rows)


def _native(effort: Effort) -> dict[str, float]:
    best: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "contact.bin"
        np.concatenate(contact_arrays(effort.replay_samples)).tofile(file)
        command = [str(native_programs().preparation), str(file), str(PASSES)]
        for _ in range(effort.replay_rounds // 3):
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
    with clock() as running:
        section = measure_preparation(running, Effort())
    facts = describe_machine(native_programs().compiler)
    publish([section], facts, "Preparing samples in a loop", markdown)


if __name__ == "__main__":
    run_command(main)
