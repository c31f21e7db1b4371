"""Whether the search over the exponent finds the global minimum when a probe only goes in."""

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import Floats
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import ContactGate, HuntCrossley, VariableProjection

SPEEDS = ("constant", "half a sine", "least jerk", "fading")
NOISES = (1e-4, 5e-3, 5e-2)  # N
EXPONENTS = np.arange(0.3, 3.6, 0.002)
# Multiple of the noise variance by which the sum of squares may exceed the minimum: the priors,
# worth a sample or two each, change it by a few.
EXCESS = 10.0


def approaches(campaign: Campaign) -> list[Group]:
    lines = []
    for speed in range(len(SPEEDS)):
        cases = [(speed, seed) for seed in range(campaign.seeds)]
        missed = sum(campaign.map(f"approaches, {SPEEDS[speed]}", _missed, cases))
        lines.append(
            Line(SPEEDS[speed], (100.0 * missed / campaign.seeds,), (Limit(0.0),), (missed,))
        )
    return [
        Group(
            "Approaches that end in the wrong minimum",
            "A probe goes in once, 2 to 15 mm in 0.2 to 3 s, with four speed profiles; n from 0.5 "
            "to 3, peak force 1 to 50 N, noise of 1e-4, 0.005 or 0.05 N. Missed means that the "
            f"sum of squares is more than {EXCESS:g} σ² above the smallest over {len(EXPONENTS)} "
            "exponents, each solved for K, B and the offset by SVD.",
            ("missed, %",),
            lines,
            ("missed",),
            precision=".1f",
        )
    ]


def _missed(case: tuple[int, int]) -> bool:
    speed, seed = case
    rng = np.random.default_rng([speed, seed])
    depth, duration = rng.uniform(2e-3, 15e-3), rng.uniform(0.2, 3.0)
    x, v = _goes_in(speed, depth, duration)
    exponent, peak = rng.uniform(0.5, 3.0), np.exp(rng.uniform(0.0, np.log(50.0)))
    stiffness = peak / depth**exponent
    damping = stiffness * rng.uniform(0.02, 0.6) / (depth / duration)
    deviation = rng.choice(NOISES)
    clean = HuntCrossley(stiffness, damping, exponent).force(x, v)
    f = clean + rng.normal(0.0, deviation, len(x))
    x, v, f = x[f > 0.0], v[f > 0.0], f[f > 0.0]
    # Every sample counts, as in the reference search, to compare the two results.
    estimator = VariableProjection(gate=ContactGate(make_force=1e-9))
    estimator.replay(x, v, f)
    estimate = estimator.estimate()
    residual = f - estimate.law.force(x, v) - estimate.offset
    least = min(_sum_of_squares(float(n), x / depth, v, f) for n in EXPONENTS)
    return bool(residual @ residual - least > EXCESS * deviation**2)


def _goes_in(speed: int, depth: float, duration: float) -> tuple[Floats, Floats]:
    s = np.arange(1.0, duration * 1e3) / (duration * 1e3)
    way, rate = (
        (s, np.ones_like(s)),
        (0.5 * (1.0 - np.cos(np.pi * s)), 0.5 * np.pi * np.sin(np.pi * s)),
        (s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2),
        ((1.0 - np.exp(-3.0 * s)) / (1.0 - np.exp(-3.0)), 3.0 * np.exp(-3.0 * s) / 0.950213),
    )[speed]
    return depth * way, depth / duration * rate


def _sum_of_squares(exponent: float, way: Floats, v: Floats, f: Floats) -> float:
    power = way**exponent
    columns = np.column_stack([power, power * v, np.ones_like(way)])
    columns /= np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    left = left[:, singular > 1e-9 * singular[0]]
    residual = f - left @ (left.T @ f)
    return float(residual @ residual)
