"""Starts from which the final law is not within 5 % of the truth."""

from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import BALL, MATERIALS, feed, noise, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import DoubleStageRLS, HuntCrossley, SingleStageRLS, VariableProjection
from palpate.estimators import ContactEstimator

STARTS = [
    HuntCrossley(float(stiffness), 0.0, float(exponent))
    for stiffness in np.logspace(-1.0, 5.0, 21)
    for exponent in np.linspace(0.5, 3.0, 6)
]
PAPER: dict[str, type[SingleStageRLS] | type[DoubleStageRLS]] = {
    "single-stage": SingleStageRLS,
    "double-stage": DoubleStageRLS,
}


def starts(campaign: Campaign) -> list[Group]:
    noises = max(1, campaign.seeds // 20)
    lines = []
    for name in MATERIALS:
        missed = sum(campaign.map(f"starts, {name}", partial(_ours, name), range(campaign.seeds)))
        figure = f"variable projection, {name} (takes no start)"
        lines.append(Line(figure, (100.0 * missed / campaign.seeds,), (Limit(0.0),)))
    cases = [(start, seed) for start in STARTS for seed in range(noises)]
    for method in PAPER:
        missed = sum(campaign.map(f"starts, {method}", partial(_paper, method), cases))
        figure = f"{method}, ball, {len(STARTS)} starts × {noises} seeds"
        lines.append(Line(figure, (100.0 * missed / len(cases),)))
    return [
        Group(
            "Starting values that do not converge",
            "K, B and n not all within 5 % of the truth after 20 s of three sines, true x and v, "
            "0.05 N of noise. Starting values of the paper's methods: 21 K from 0.1 to 1e5, "
            "log-spaced, by 6 n from 0.5 to 3, B = 0, the default covariance. Variable projection "
            "has no starting values, so none can fail; its line is the percentage of seeds that "
            "miss.",
            ("not converged, %",),
            lines,
            precision=".1f",
        )
    ]


def _ours(material: str, seed: int) -> bool:
    return _missed(VariableProjection(offset=False), MATERIALS[material], seed)


def _paper(method: str, case: tuple[HuntCrossley, int]) -> bool:
    start, seed = case
    return _missed(PAPER[method](initial=start), BALL, seed)


def _missed(estimator: ContactEstimator, law: HuntCrossley, seed: int) -> bool:
    motion = sines(20.0)
    x, v = motion.penetration, motion.velocity
    f = law.force(x, v) + noise(np.random.default_rng(seed), len(x))
    (estimate,) = feed(estimator, x, v, f, [len(x)])
    return bool(np.any(np.abs(estimate.parameters / law.parameters - 1.0) > 0.05))
