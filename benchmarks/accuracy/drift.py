"""A material whose force scale drifts."""

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import MATERIALS, MEAN_DEPTH, noise, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import ConstantForgetting, DriftTracking, VariableProjection
from palpate.estimators import ContactEstimator

DURATION, SETTLED = 40.0, 2000  # s; samples left out
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "drift tracking": DriftTracking,
    "projection": lambda: VariableProjection(offset=False),
    "λ = 0.998": lambda: VariableProjection(offset=False, forgetting=ConstantForgetting(0.998)),
    "λ = 0.99": lambda: VariableProjection(offset=False, forgetting=ConstantForgetting(0.99)),
}


def drift(campaign: Campaign) -> list[Group]:
    lines = []
    for material in MATERIALS:
        runs = np.array(
            campaign.map(f"drift, {material}", partial(_errors, material), range(campaign.seeds))
        )
        ours, *others = np.sqrt(np.mean(runs**2, axis=0)).tolist()
        lines.append(Line(material, (ours,), (Limit(0.2),), (float(runs[:, 0].max()), *others)))
    return [
        Group(
            "Drift",
            "The whole force drifts by ±30 % at 0.1 Hz for 40 s of three sines, 0.05 N of noise. "
            "Relative rms error of the force scale K x_rⁿ at x_r = 10 mm, %, from 2 s on; "
            "`DriftTracking()` beside `VariableProjection(offset=False)` without and with constant "
            "forgetting.",
            ("rms",),
            lines,
            ("worst seed", *(f"VP, {name}" for name in ("no forgetting", *list(METHODS)[2:]))),
            precision=".3f",
            notes=[f"{campaign.seeds} seeds."],
        )
    ]


def _errors(material: str, seed: int) -> list[float]:
    """Relative rms error of the force scale by each method, %."""
    law, motion = MATERIALS[material], sines(DURATION)
    x, v = motion.penetration, motion.velocity
    scale = 1.0 + 0.3 * np.sin(2.0 * np.pi * 0.1 * motion.time)
    f = scale * law.force(x, v) + noise(np.random.default_rng(seed), len(x))
    true = scale * law.stiffness * MEAN_DEPTH**law.exponent
    errors = []
    for make in METHODS.values():
        found = make().replay(x, v, f).parameters
        relative = found[:, 0] * MEAN_DEPTH ** found[:, 2] / true - 1.0
        errors.append(100.0 * float(np.sqrt(np.mean(relative[SETTLED:] ** 2))))
    return errors
