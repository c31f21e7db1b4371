"""A material whose force scale drifts."""

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import MATERIALS, MEAN_DEPTH, noise, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import ConstantForgetting, DriftTracking, VariableProjection
from palpate.estimators import ContactEstimator
from palpate.validation import Floats

DURATION, SETTLED = 40.0, 2000  # s; excluded samples
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
            "`DriftTracking()` compared with `VariableProjection(offset=False)`, without and with "
            "constant forgetting.",
            ("rms",),
            lines,
            ("worst seed", *(f"VP, {name}" for name in ("no forgetting", *list(METHODS)[2:]))),
            precision=".3f",
            notes=[f"{campaign.seeds} seeds."],
        ),
        _too_slow(campaign),
        _bars(campaign),
    ]


# Deviation of ln K after a second, 1/√s, and correlation of the noise: the first must be flagged,
# the second is what `DriftTracking()` assumes.
WALKS = ((0.2, 0.0), (0.02, 0.0), (0.04, 0.0), (0.1, 0.0), (0.02, 0.9))


def _too_slow(campaign: Campaign) -> Group:
    lines = []
    for material in MATERIALS:
        runs = campaign.map(f"walk, {material}", partial(_flagged, material), range(campaign.seeds))
        fast, assumed, *others = (100.0 * np.mean(np.array(runs), axis=0)).tolist()
        lines.append(
            Line(material, (fast, assumed), (Limit(100.0, 98.0), Limit(1.0)), tuple(others))
        )
    return Group(
        "A walk that is too slow",
        "ln K walks at random for 20 s of three sines, 0.05 N of noise. Percentage of runs after "
        "which `DriftTracking()`, with its walk of 0.02/√s, flags that the walk is too slow. On a "
        "soft material AR(1) 0.9 noise looks like a drift that the filter cannot follow.",
        ("walk of 0.2/√s", "of 0.02/√s"),
        lines,
        ("of 0.04/√s", "of 0.1/√s", "of 0.02/√s, AR(1) 0.9"),
        precision=".1f",
        notes=[f"{campaign.seeds} seeds."],
    )


CORRELATIONS = (0.0, 0.5, 0.7, 0.9, 0.98)


def _bars(campaign: Campaign) -> Group:
    lines = []
    for material in MATERIALS:
        runs = campaign.map(f"bars, {material}", partial(_held, material), range(campaign.seeds))
        held = (100.0 * np.mean(np.array(runs), axis=0)).tolist()
        lines.append(Line(material, tuple(held), (Limit(100.0, 85.0),)))
    return Group(
        "Coverage in correlated noise",
        "Nothing drifts for 12 s of three sines, AR(1) noise of 0.05 N rms. Percentage of 95 % "
        "intervals of `DriftTracking()` that contain the force scale K x_rⁿ, by the coefficient "
        "of the noise.",
        tuple(f"{correlation:g}" for correlation in CORRELATIONS),
        lines,
        precision=".1f",
        notes=[f"{campaign.seeds} seeds."],
    )


def _held(material: str, seed: int) -> list[bool]:
    law, motion = MATERIALS[material], sines(12.0)
    x, v = motion.penetration, motion.velocity
    held = []
    for correlation in CORRELATIONS:
        method = DriftTracking()
        random = np.random.default_rng([seed, 2])
        method.replay(x, v, law.force(x, v) + _noise(random, len(x), correlation), at=[])
        found = method.estimate().with_error(lambda law: float(law.force(MEAN_DEPTH, 0.0)))
        held.append(abs(found[0] - float(law.force(MEAN_DEPTH, 0.0))) < 1.96 * found[1])
    return held


def _flagged(material: str, seed: int) -> list[bool]:
    law, motion = MATERIALS[material], sines(20.0)
    x, v = motion.penetration, motion.velocity
    found = []
    for walk, correlation in WALKS:
        random = np.random.default_rng([seed, 1])
        steps = walk * np.sqrt(1e-3) * random.standard_normal(len(x))
        f = np.exp(np.cumsum(steps)) * law.force(x, v) + _noise(random, len(x), correlation)
        method = DriftTracking()
        method.replay(x, v, f)
        found.append(any("faster than the walk" in flag for flag in method.estimate().flags))
    return found


def _noise(random: np.random.Generator, count: int, correlation: float) -> Floats:
    """AR(1) of 0.05 N rms."""
    made, state = np.empty(count), 0.0
    for k, fresh in enumerate(noise(random, count).tolist()):
        state = correlation * state + np.sqrt(1.0 - correlation**2) * fresh
        made[k] = state
    return made


def _errors(material: str, seed: int) -> list[float]:
    """Return the relative rms error of the force scale by each method, %."""
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
