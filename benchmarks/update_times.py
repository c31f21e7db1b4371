"""Time ``update`` of every estimator in this interpreter, or compared with another palpate's.

``python benchmarks/update_times.py`` prints nanoseconds, the shortest of some passes, as JSON.
``python benchmarks/update_times.py --beside OTHER/bin/python`` runs alternately in both
interpreters, under the same load, and prints the ratios of this palpate to the other.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from time import perf_counter_ns

import numpy as np

import palpate

NAMES = (
    "KelvinVoigtRLS",
    "ExtendedKelvinVoigtRLS",
    "SingleStageRLS",
    "DoubleStageRLS",
    "VariableProjection",
    "DriftTracking",
)


def samples() -> list[tuple[float, float, float]]:
    """A PVC phantom under the paper's three sines, 4 s at 1 kHz, with 0.05 N of noise."""
    time = 1e-3 * np.arange(4000)
    motion = ((1.0e-3, 4.0), (1.8e-3, 11.0), (1.8e-3, 15.0))
    x = 10e-3 + sum(a * np.sin(w * time) for a, w in motion)
    v = sum(a * w * np.cos(w * time) for a, w in motion)
    noise = np.random.default_rng(0).standard_normal(time.size)
    force = palpate.HuntCrossley(1e5, 2e5, 2.0).force(x, v) + 0.05 * noise
    return list(zip(x.tolist(), v.tolist(), force.tolist(), strict=True))


def watching() -> dict[str, dict[str, object]]:
    """The detectors of an estimator; an earlier palpate has no outlier rejection."""
    detector = {"change_detector": palpate.ChangeDetector()}
    kinds: dict[str, dict[str, object]] = {"": {}, ", detector": dict(detector)}
    if hasattr(palpate, "OutlierRejection"):
        kinds[", both"] = {**detector, "outlier_rejection": palpate.OutlierRejection()}
    return kinds


def update_times(passes: int = 7) -> dict[str, float]:
    """Return nanoseconds an update, warm, the shortest of the passes."""
    rows = samples()
    times = {}
    for name in NAMES:
        for words, settings in watching().items():
            best = np.inf
            for _ in range(passes):
                update = getattr(palpate, name)(**settings).update
                for sample in rows[:2000]:
                    update(*sample)
                start = perf_counter_ns()
                for x, v, force in rows:
                    update(x, v, force)
                best = min(best, (perf_counter_ns() - start) / len(rows))
            times[name + words] = best
    return times


def beside(other: str, rounds: int) -> None:
    """Print this palpate's times over the other's, the shortest of the rounds each."""
    best: dict[str, dict[str, float]] = {sys.executable: {}, other: {}}
    for _ in range(rounds):
        for python, least in best.items():
            done = subprocess.run(
                [python, str(Path(__file__).resolve())], capture_output=True, text=True, check=True
            )
            for name, time in json.loads(done.stdout).items():
                least[name] = min(least.get(name, np.inf), time)
    for name, time in best[sys.executable].items():
        bare = best[other][name.partition(",")[0]]
        print(f"{name:36} {time:6.1f} ns / {bare:6.1f} ns bare = {time / bare:.3f}", end="")
        if name in best[other] and "," in name:
            print(f"; / {best[other][name]:6.1f} ns = {time / best[other][name]:.3f}", end="")
        print()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Time update() of every estimator.")
    parser.add_argument("--beside", metavar="PYTHON", help="interpreter with another palpate")
    parser.add_argument("--rounds", type=int, default=5, help="turns of each interpreter")
    given = parser.parse_args()
    if given.beside:
        beside(given.beside, given.rounds)
    else:
        print(json.dumps(update_times()))
