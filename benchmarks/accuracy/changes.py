"""Row 7: how soon the force is right again after the material changed, and false alarms."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import (
    INCLUSION,
    NOISE,
    PVC,
    SAMPLE_TIME,
    Floats,
    Motion,
    feed,
    noise,
    sines,
)
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import (
    ChangeDetector,
    HuntCrossley,
    SelfPerturbation,
    SingleStageRLS,
    Status,
    Trace,
    VariableProjection,
)

DURATION = 12.0  # s
FLOOR = 2.0 * NOISE
WINDOW = 5  # samples that |e| is averaged over
STIFFER = HuntCrossley(1.1e5, 2.2e5, 2.0)
CHANGES = {
    "PVC → inclusion": (PVC, INCLUSION),
    "inclusion → PVC": (INCLUSION, PVC),
    "PVC, 10 % stiffer": (PVC, STIFFER),
}
WATCHED = 600.0  # s
RELAXING = HuntCrossley(300.0, 300.0, 1.0)
BRANCH, RELAXATION = 0.5, 1.0  # of the stiffness; s


@dataclass(frozen=True, slots=True)
class Recovery:
    """Milliseconds after a change; ``alarms`` counts all of the run."""

    error: float
    model: float
    alarm: float
    alarms: int


Runs = dict[str, tuple[list[Recovery], list[Recovery]]]


def changes(campaign: Campaign) -> list[Group]:
    seeds = range(campaign.seeds)
    runs = {
        name: (
            campaign.map(f"7 {name}", partial(_run, name, False), seeds),
            campaign.map(f"7 {name}, single-stage", partial(_run, name, True), seeds),
        )
        for name in CHANGES
    }
    return [
        _recovery(runs, "a", "the force error is back", "error"),
        _recovery(runs, "b", "the model's own error is back for good", "model"),
        _false_alarms(campaign),
    ]


def _recovery(runs: Runs, letter: str, what: str, attribute: str) -> Group:
    meaning = {
        "a": "Samples until the mean of |e| over the next 5 ms is first below 2σ = 0.1 N, "
        "e = F − F̂ a priori.",
        "b": "Samples until |F_true − F̂| is below 2σ = 0.1 N and stays so to the end.",
    }[letter]
    lines = []
    for name, (with_detector, single) in runs.items():
        ours = _percentiles(with_detector, attribute)
        alarm = _percentiles(with_detector, "alarm")
        once = 100.0 * np.mean([run.alarms == 1 for run in with_detector])
        limit = (Limit(10.0),) if letter == "a" else ()
        beside = (ours[0], ours[2], alarm[1], alarm[2], float(once))
        lines.append(Line(name, (ours[1],), limit, (*beside, *_percentiles(single, attribute))))
    return Group(
        f"7{letter}. Milliseconds until {what} after a change",
        f"{meaning} Change at a random time from 5 to 10 s of 12; three sines, 0.05 N of noise; "
        "`VariableProjection(change_detector=ChangeDetector())`, beside "
        "`SingleStageRLS(perturbation=SelfPerturbation())`.",
        ("95th percentile",),
        lines,
        (
            "median",
            "worst",
            "alarm 95th",
            "alarm worst",
            "one alarm, % of runs",
            "SPRLS median",
            "SPRLS 95th",
            "SPRLS worst",
        ),
        precision=".1f",
        notes=[f"{len(single)} seeds. Never within the run counts as the time that was left."],
    )


def _percentiles(runs: list[Recovery], attribute: str) -> tuple[float, float, float]:
    values = [getattr(run, attribute) for run in runs]
    median, late, worst = np.percentile(values, [50.0, 95.0, 100.0])
    return float(median), float(late), float(worst)


def _run(name: str, single_stage: bool, seed: int) -> Recovery:
    rng, motion = np.random.default_rng(seed), sines(DURATION)
    x, v = motion.penetration, motion.velocity
    at = int(rng.integers(5000, 10_000))
    before, after = CHANGES[name]
    true = np.where(np.arange(len(x)) < at, before.force(x, v), after.force(x, v))
    f = true + noise(rng, len(x))
    if single_stage:
        trace = SingleStageRLS(perturbation=SelfPerturbation()).replay(x, v, f)
    else:
        trace = VariableProjection(change_detector=ChangeDetector()).replay(x, v, f)
    return _recovered(trace, true, f, at)


def _recovered(trace: Trace, true: Floats, f: Floats, at: int) -> Recovery:
    error = np.abs(f - trace.predicted_force)[at:]
    mean = np.convolve(error, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    back = np.flatnonzero(mean < FLOOR)
    wrong = np.flatnonzero(np.abs(true - trace.predicted_force)[at:] > FLOOR)
    alarms = np.flatnonzero(trace.status == Status.RESTARTED)
    late = alarms[alarms >= at] - at
    left = len(f) - at
    return Recovery(
        float(back[0] if back.size else left),
        float(wrong[-1] + 1 if wrong.size else 0),
        float(late[0] if late.size else left),
        len(alarms),
    )


def _false_alarms(campaign: Campaign) -> Group:
    lines = []
    for name, function, limits in (
        ("PVC", _alarms_in_class, (Limit(0.0),)),
        ("Maxwell sponge, outside the class", _alarms_out_of_class, ()),
    ):
        counts = campaign.map(f"7c {name}", function, range(campaign.seeds))
        total, hours = float(sum(counts)), len(counts) * WATCHED / 3600.0
        lines.append(Line(name, (total,), limits, (total / hours / 6.0, float(max(counts)))))
    maxwell = f"K = 300, B = 300, n = 1 plus a Maxwell branch of {BRANCH:g} K and {RELAXATION:g} s"
    return Group(
        "7c. False alarms",
        f"Nothing changes for 10 minutes of three sines, 0.05 N of noise, {campaign.seeds} seeds "
        f"({campaign.seeds * WATCHED / 3600.0:.0f} h); `ChangeDetector()`. The Maxwell sponge is "
        f"{maxwell}.",
        ("alarms",),
        lines,
        ("per 10 min", "most in one run"),
        precision=".3g",
    )


def _alarms_in_class(seed: int) -> int:
    motion = sines(WATCHED)
    return _alarms(motion, PVC.force(motion.penetration, motion.velocity), seed)


def _alarms_out_of_class(seed: int) -> int:
    motion = sines(WATCHED)
    elastic = RELAXING.stiffness * motion.penetration**RELAXING.exponent
    force = RELAXING.force(motion.penetration, motion.velocity) + _maxwell(BRANCH * elastic)
    return _alarms(motion, force, seed)


def _maxwell(elastic: Floats) -> Floats:
    """dF/dt = d(elastic)/dt − F/τ, begun at rest, exact for an elastic force linear in a step."""
    keep = float(np.exp(-SAMPLE_TIME / RELAXATION))
    gain = RELAXATION / SAMPLE_TIME * (1.0 - keep)
    force, branch = float(elastic[0]), [float(elastic[0])]
    for step in np.diff(elastic).tolist():
        force = keep * force + gain * step
        branch.append(force)
    return np.array(branch)


def _alarms(motion: Motion, force: Floats, seed: int) -> int:
    estimator = VariableProjection(change_detector=ChangeDetector())
    f = force + noise(np.random.default_rng(seed), len(force))
    (estimate,) = feed(estimator, motion.penetration, motion.velocity, f, [len(f)])
    return estimate.restarts
