"""The time of an update and an estimate, over the single-stage update of the same run."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import BALL, noise, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import ChangeDetector, OutlierRejection, SingleStageRLS, VariableProjection
from palpate.estimators import ContactEstimator

REPEATS = 60
EARLY = 2000  # samples
Samples = list[tuple[float, float, float]]


def timing(campaign: Campaign) -> list[Group]:
    """Runs in this process, with the workers idle."""
    motion = sines(10.0)
    force = BALL.force(motion.penetration, motion.velocity)
    force = force + noise(np.random.default_rng(0), len(force))
    samples = list(
        zip(motion.penetration.tolist(), motion.velocity.tolist(), force.tolist(), strict=True)
    )
    makers: dict[str, Callable[[], ContactEstimator]] = {
        "single-stage": SingleStageRLS,
        "default": VariableProjection,
        "detector": lambda: VariableProjection(change_detector=ChangeDetector()),
        "rejection": lambda: VariableProjection(outlier_rejection=OutlierRejection()),
        "both": lambda: VariableProjection(
            change_detector=ChangeDetector(), outlier_rejection=OutlierRejection()
        ),
    }
    best = {name: [np.inf, np.inf, np.inf] for name in makers}
    for _ in range(REPEATS):  # interleaved, so that all run under the same load
        for name, make in makers.items():
            estimator = make()
            update, estimate = _update_ns(estimator, samples), _estimate_ns(estimator)
            early = _update_ns(make(), samples[:EARLY])
            best[name] = np.minimum(best[name], [update, estimate, early]).tolist()
    return [_group(best), _watching(best)]


def _group(best: dict[str, list[float]]) -> Group:
    unit, _, early = best["single-stage"]
    rows = (
        ("update", "default", 0, Limit(2.5)),
        ("estimate", "default", 1, Limit(10.0)),
        ("update with a ChangeDetector", "detector", 0, None),
    )
    lines = [
        Line(figure, (best[name][i] / unit,), (limit,), (best[name][i], unit))
        for figure, name, i, limit in rows
    ]
    first = best["default"][2]
    lines.insert(1, Line("update, first 2 s", (first / early,), (Limit(2.5),), (first, early)))
    return Group(
        "Calls from Python, relative to a single-stage update",
        "A call from Python of `VariableProjection`, relative to `SingleStageRLS.update()`: the "
        f"minimum of {REPEATS} interleaved repeats of 10 000 updates (2000 for the first 2 s, when "
        "the global search runs more often) and 2000 estimates on the ball; loops in a function, "
        "bound methods in locals.",
        ("ratio",),
        lines,
        ("ns", "single-stage update ns"),
    )


def _watching(best: dict[str, list[float]]) -> Group:
    bare = best["default"][0]
    rows = (
        ("with a ChangeDetector", "detector", None),
        ("with an OutlierRejection", "rejection", None),
        ("with both", "both", Limit(1.4)),
    )
    return Group(
        "Change detection and outlier rejection, relative to a plain update",
        "`VariableProjection.update()` from Python, in the same runs.",
        ("ratio",),
        [
            Line(words, (best[name][0] / bare,), (limit,), (best[name][0],))
            for words, name, limit in rows
        ],
        ("ns",),
    )


def _update_ns(estimator: ContactEstimator, samples: Samples) -> float:
    update, clock = estimator.update, time.perf_counter_ns
    start = clock()
    for x, v, f in samples:
        update(x, v, f)
    return (clock() - start) / len(samples)


def _estimate_ns(estimator: ContactEstimator, calls: int = 2_000) -> float:
    estimate: Callable[[], Any] = estimator.estimate
    clock = time.perf_counter_ns
    start = clock()
    for _ in range(calls):
        estimate()
    return (clock() - start) / calls
