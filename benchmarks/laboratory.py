"""``python -m benchmarks.laboratory``: errors of identification on recordings of known truth.

Every material of the laboratory that a Hunt–Crossley law describes, pressed by the twin pantograph,
measured by the paper's sensors, identified with the default method; and some of other laws, with
memory and without, by the viscoelastic one. ``docs/validation/laboratory.md`` keeps it.
"""

import sys
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np

from benchmarks.common.probing import truth
from benchmarks.common.report import Group, Line, describe_machine, publish, run_command
from benchmarks.common.workers import Workers
from palpate import (
    GeneralisedHuntCrossley,
    SingleRelaxation,
    ViscoelasticContact,
    identify,
    lab,
)
from palpate.validation import Floats

MATERIALS = ("ball", "sponge", "pvc", "inclusion")
HALF_SPACE = GeneralisedHuntCrossley(K=8000.0, n=1.5, B=60.0, p=0.5)
SINGLE = GeneralisedHuntCrossley(
    K=8000.0, n=1.5, B=4e3, p=1.5, M=4e3, relaxation=SingleRelaxation(0.1)
)
REMEMBERING: dict[str, GeneralisedHuntCrossley] = {
    "half-space": HALF_SPACE,
    "one relaxation time": SINGLE,
    "tissue": cast(GeneralisedHuntCrossley, lab.TISSUE.law),
}

QUESTION = (
    "How often does the truth lie within three standard errors (s.e.) when the laboratory's "
    "materials are pressed for 10 s along three sines? Normal errors do in 99.7 %, each."
)


def main(*, seeds: int = 20, workers: int | None = None, markdown: Path | None = None) -> None:
    """Measure how often the truth lies within three standard errors.

    Parameters
    ----------
    seeds
        Seeds of noise, bias and encoder phases, 2 or more.
    workers
        Worker processes. Default: one per core.
    markdown
        Write the tables to this file too.
    """
    if seeds < 2:
        sys.exit(f"--seeds {seeds} is fewer than 2")
    processes = Workers(workers, seeds)
    groups = [
        _group(processes, "Encoders of 20 000 counts a turn, as in the paper", 20_000.0),
        _group(processes, "Encoders without steps", 0.0),
        _remembering(processes),
    ]
    publish(groups, describe_machine(seeds=seeds), "The laboratory", markdown, QUESTION)


def _group(workers: Workers, title: str, counts: float) -> Group:
    lines = []
    for name in MATERIALS:
        runs = workers.repeat(name, partial(errors, name, counts))
        relative, standardised = np.swapaxes(np.array(runs), 0, 1)
        inside = float(np.mean(np.abs(standardised).max(axis=1) < 3.0))
        ours = (100.0 * inside, float(np.abs(standardised).max()))
        lines.append(Line(name, ours, (), tuple(100.0 * np.sqrt(np.mean(relative**2, axis=0)))))
    return Group(
        title,
        "`Bench(material, THREE_SINES).run(seed)`, 10 s, `identify` with its defaults. "
        "Normal errors with known deviations would lie within 3 s.e. in 99.7 %, each.",
        ("K, B and n within 3 s.e., %", "largest error, s.e."),
        lines,
        ("K rms, %", "B rms, %", "n rms, %"),
    )


def errors(name: str, counts: float, seed: int) -> Floats:
    """Return the relative errors of K, B and n, and the same in standard errors; shape (2, 3)."""
    robot = lab.TwinPantograph(counts_per_turn=counts)
    bench = lab.Bench(lab.MATERIALS[name], lab.THREE_SINES, robot)
    result = identify(bench.run(seed).contact)
    true = truth(name).parameters
    errors = result.law.parameters - true
    return np.array([errors / true, errors / result.estimate.standard_errors])


def _remembering(workers: Workers) -> Group:
    lines = []
    for name in REMEMBERING:
        runs = np.array(workers.repeat(name, partial(dynamic_errors, name)))
        inside, largest = float(np.mean(runs[:, 2] < 3.0)), float(runs[:, 2].max())
        rms = np.sqrt(np.mean(runs[:, :2] ** 2, axis=0))
        lines.append(Line(name, (100.0 * inside, largest), (), tuple(100.0 * rms)))
    return Group(
        "Other laws, and memory",
        "`--method viscoelastic`. K′ and B′ are those of an oscillation of the motion's frequency.",
        ("all numbers within 3 s.e., %", "largest error, s.e."),
        lines,
        ("K′ rms, %", "B′ rms, %"),
    )


def dynamic_errors(name: str, seed: int) -> tuple[float, float, float]:
    """Return the relative errors of K′ and B′, and the largest error of all numbers in s.e."""
    law = REMEMBERING[name]
    bench = lab.Bench(lab.Homogeneous(law), lab.THREE_SINES)
    estimator = ViscoelasticContact()
    result = identify(bench.run(seed).contact, estimator)
    found = cast(ViscoelasticContact, result.estimator).dynamic_stiffness()
    exact = law.dynamic_stiffness(found.depth, found.frequency)
    estimate = result.estimate
    known = estimate.standard_errors > 0.0
    errors = np.abs(estimate.parameters - law.parameters)[known] / estimate.standard_errors[known]
    return (
        found.stiffness / exact.real - 1.0,
        found.frequency * found.damping / exact.imag - 1.0,
        float(errors.max()),
    )


if __name__ == "__main__":
    run_command(main)
