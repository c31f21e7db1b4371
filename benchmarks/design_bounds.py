"""Errors of variable projection over those that ``palpate design`` predicts, as a Markdown table.

python -m benchmarks.design_bounds [--seeds 100]
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.common.probing import BALL, PVC, SPONGE
from benchmarks.common.report import markdown_table, run_command, show
from palpate import VariableProjection
from palpate.lab.design import Design, design
from palpate.lab.design.precision import PredictedPrecision
from palpate.validation import Floats

# The laboratory's, with exponents between the nodes of the method's grid, 0.3 + 0.1 j.
MATERIALS = {
    "ball": replace(BALL, n=1.05),
    "sponge": replace(SPONGE, n=1.15),
    "PVC": replace(PVC, n=1.85),
}
SENSORS = ((0.05, 0.0), (0.05, 0.125), (0.01, 0.125))  # N
DURATIONS = (1.0, 5.0, 20.0)  # s
WHAT = (
    "Errors of `VariableProjection` over those that `palpate design` expects: the least and the "
    "largest ratio of K, B and n of ball, sponge and PVC, with an unknown offset."
)


def ratios(plan: Design, predicted: PredictedPrecision, duration: float, seeds: int) -> Floats:
    """RMSE over the predicted error of K, B and n, with a force offset of up to 0.1 N in each run.

    The offset is positive, so that the gate excludes no sample for a negative force.
    """
    _, x, v = predicted.motion.sampled(duration, plan.sample_time)
    clean, errors = plan.law.force(x, v), []
    for seed in range(seeds):
        draw = np.random.default_rng(seed)
        force = clean + draw.uniform(0.0, 0.1) + plan.noise * draw.standard_normal(x.size)
        if plan.resolution:
            force = np.round(force / plan.resolution) * plan.resolution
        estimator = VariableProjection(offset=True)
        estimator.replay(x, v, force)
        errors.append(estimator.estimate().parameters / plan.law.parameters - 1.0)
    rmse = np.sqrt(np.mean(np.square(errors), axis=0))
    found: Floats = np.divide(rmse, predicted.expected_errors[predicted.durations.index(duration)])
    return found


def main(*, seeds: int = 100, markdown: Path | None = None) -> None:
    """Measure, and print the table.

    Parameters
    ----------
    seeds
        Runs of each design.
    markdown
        Write the page to this file too.
    """
    rows = []
    for noise, step in SENSORS:
        plans = [
            design(law, noise=noise, resolution=step, durations=DURATIONS)
            for law in MATERIALS.values()
        ]
        for name in ("planned", "better"):
            cells = []
            for duration in DURATIONS:
                found = [ratios(p, getattr(p, name), duration, seeds) for p in plans]
                cells.append(f"{np.min(found):.2f}–{np.max(found):.2f}")
            rows.append([f"{noise:g} N, steps of {step:g} N", name, *cells])
    headings = ["sensor", "motion", *(f"{duration:g} s" for duration in DURATIONS)]
    show([WHAT, "", *markdown_table(headings, rows)], "Designed motions", markdown)


if __name__ == "__main__":
    run_command(main)
