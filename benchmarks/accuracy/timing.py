"""The time of an update and an estimate, over the single-stage update of the same run."""

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np

from benchmarks.common.campaign import Campaign
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.timing import contact_samples, seconds_per_call
from palpate import ChangeDetector, OutlierRejection, SingleStageRLS, VariableProjection
from palpate.estimators import ContactEstimator

REPEATS = 60
EARLY = 2000  # samples
ESTIMATES = 2000
MAKERS: dict[str, Callable[[], ContactEstimator]] = {
    "single-stage": SingleStageRLS,
    "default": VariableProjection,
    "detector": lambda: VariableProjection(change_detector=ChangeDetector()),
    "rejection": lambda: VariableProjection(outlier_rejection=OutlierRejection()),
    "both": lambda: VariableProjection(
        change_detector=ChangeDetector(), outlier_rejection=OutlierRejection()
    ),
}


def timing(campaign: Campaign) -> list[Group]:
    """What a sample costs.

    What does a sample cost? Every ratio is relative to the paper's single-stage update in the same
    run.
    """
    samples = contact_samples(10_000)
    best = {name: [np.inf, np.inf, np.inf] for name in MAKERS}
    for _ in range(REPEATS):  # interleaved, so that all run under the same load
        for name, make in MAKERS.items():
            estimator = make()
            update = 1e9 * seconds_per_call(estimator.update, samples)
            early = 1e9 * seconds_per_call(make().update, samples[:EARLY])
            times = (update, _estimate_ns(estimator), early)
            best[name] = np.minimum(best[name], times).tolist()
    (unit, _, early_unit), (bare, estimate, early) = best["single-stage"], best["default"]
    watched = best["detector"][0]
    lines = [
        Line("update", (bare / unit,), (Limit(2.5),), (bare, unit)),
        Line("update, first 2 s", (early / early_unit,), (Limit(2.5),), (early, early_unit)),
        Line("estimate", (estimate / unit,), (Limit(10.0),), (estimate, unit)),
        Line("update with a ChangeDetector", (watched / unit,), (), (watched, unit)),
    ]
    rows = (
        ("with a ChangeDetector", "detector", None),
        ("with an OutlierRejection", "rejection", None),
        ("with both", "both", Limit(1.4)),
    )
    watching = [
        Line(words, (best[name][0] / bare,), (limit,), (best[name][0],))
        for words, name, limit in rows
    ]
    return [
        Group(
            "Calls from Python, relative to a single-stage update",
            "A call from Python of `VariableProjection`, relative to `SingleStageRLS.update()`: "
            f"the minimum of {REPEATS} interleaved repeats of 10 000 updates (2000 for the first "
            f"2 s, when the global search runs more often) and {ESTIMATES} estimates on the ball; "
            "loops in a function, bound methods in locals.",
            ("ratio",),
            lines,
            ("ns", "single-stage update ns"),
        ),
        Group(
            "Change detection and outlier rejection, relative to a plain update",
            "`VariableProjection.update()` from Python, in the same runs.",
            ("ratio",),
            watching,
            ("ns",),
        ),
    ]


def _estimate_ns(estimator: ContactEstimator) -> float:
    estimate = estimator.estimate
    start = perf_counter_ns()
    for _ in range(ESTIMATES):
        estimate()
    return (perf_counter_ns() - start) / ESTIMATES
