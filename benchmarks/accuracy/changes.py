"""The delay until the force is right again after a change of the material."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import (
    BALL,
    INCLUSION,
    NOISE,
    PVC,
    Floats,
    noise,
    sines,
)
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import (
    ChangeDetector,
    SelfPerturbation,
    SingleStageRLS,
    Status,
    Trace,
    VariableProjection,
    identify,
    lab,
)

DURATION = 12.0  # s
FLOOR = 2.0 * NOISE
WINDOW = 5  # samples that |e| is averaged over
STIFFER = replace(PVC, stiffness=1.1e5, damping=2.2e5)
CHANGES = {
    "PVC → inclusion": (PVC, INCLUSION),
    "inclusion → PVC": (INCLUSION, PVC),
    "PVC, 10 % stiffer": (PVC, STIFFER),
}
# With the robot: from, to, and the limit of the overshoot.
ROBOT = {
    "PVC → inclusion": (lab.PVC, lab.INCLUSION, Limit(15.0)),
    "inclusion → PVC": (lab.INCLUSION, lab.PVC, Limit(15.0)),
    "ball → sponge": (lab.BALL, lab.SPONGE, Limit(15.0)),
    "sponge → ball": (lab.SPONGE, lab.BALL, None),
}
SETTLED = 60  # samples after a change
# From, to: another exponent.
ANOTHER_EXPONENT = {"ball → PVC": (BALL, PVC), "PVC → ball": (PVC, BALL)}


@dataclass(frozen=True, slots=True)
class Recovery:
    """Milliseconds after a change; ``alarms`` counts those of the whole run."""

    error: float
    model: float
    alarm: float
    alarms: int


Runs = dict[str, tuple[list[Recovery], list[Recovery]]]


def changes(campaign: Campaign) -> list[Group]:
    seeds = range(campaign.seeds)
    runs = {
        name: (
            campaign.map(name, partial(_run, name, False), seeds),
            campaign.map(f"{name}, single-stage", partial(_run, name, True), seeds),
        )
        for name in CHANGES
    }
    return [
        _recovery(runs, "a", "the force error has recovered", "error"),
        _recovery(runs, "b", "the model error has recovered for good", "model"),
        _overshoots(campaign),
        _exponents(campaign),
    ]


def _recovery(runs: Runs, letter: str, what: str, attribute: str) -> Group:
    meaning = {
        "a": "Samples until the mean of |e| over the next 5 ms is first below 2σ = 0.1 N, with "
        "the one-step prediction error e = F − F̂.",
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
        f"Milliseconds until {what} after a change",
        f"{meaning} Change at a random time from 5 to 10 s of 12; three sines, 0.05 N of noise; "
        "`VariableProjection(change_detector=ChangeDetector())`, compared with "
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
        notes=[f"{len(single)} seeds. A run without recovery counts as the remaining time."],
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


def _overshoots(campaign: Campaign) -> Group:
    seeds = range(max(2, campaign.seeds // 3))
    lines = []
    for name, (_, _, limit) in ROBOT.items():
        runs = np.array(campaign.map(f"robot, {name}", partial(_overshoot, name), seeds))
        (median, _), (late, alarm) = np.percentile(runs, [50.0, 95.0], axis=0)
        limits = (limit,) if limit else ()
        lines.append(Line(name, (float(late),), limits, (float(median), float(alarm))))
    return Group(
        "Overshoot of the stiffness after a change with the robot, %",
        "The largest K̂/K − 1 from 60 ms to 3 s after a change at a random time from 6 to 8 s; "
        f"the lab's robot and sensors, three sines, {len(seeds)} seeds. `identify(contact, "
        "VariableProjection(change_detector=ChangeDetector()))`. A centred velocity filter shows "
        "the change some milliseconds early.",
        ("95th percentile",),
        lines,
        ("median", "alarm 95th, ms"),
        precision=".1f",
    )


def _overshoot(name: str, seed: int) -> tuple[float, float]:
    before, after, _ = ROBOT[name]
    time = float(np.random.default_rng(seed).uniform(6.0, 8.0))
    material = lab.TimeVaryingMaterial((before, after), (time,))
    measured = lab.Bench(material, lab.THREE_SINES).run(seed, seconds=time + 3.0)
    estimator = VariableProjection(change_detector=ChangeDetector())
    result = identify(measured.contact, estimator, trace="full")
    at = int(np.searchsorted(measured.contact.time, time))
    stiffness = result.trace.parameters[at + SETTLED :, 0]
    alarms = np.flatnonzero(result.trace.status == Status.RESTARTED) - at
    found = alarms[alarms > -SETTLED]
    truth = after.law.parameters[0]
    return float(100.0 * (stiffness.max() / truth - 1.0)), float(found[0] if found.size else 3000)


def _exponents(campaign: Campaign) -> Group:
    lines = []
    for name in ANOTHER_EXPONENT:
        times = campaign.map(
            f"exponent, {name}", partial(_exponent_known, name), range(campaign.seeds)
        )
        median, late = np.percentile(times, [50.0, 95.0])
        lines.append(Line(name, (float(late),), (), (float(median),)))
    return Group(
        "Milliseconds until a changed exponent is known",
        "Until n̂ is within 0.05 of the truth and stays there to the end of 3 s. The estimator "
        "keeps the old exponent until the samples reject it. Change at a random time from 5 to 9 "
        "s; three sines, 0.05 N of noise. `VariableProjection(change_detector=ChangeDetector())`.",
        ("95th percentile",),
        lines,
        ("median",),
        precision=".1f",
    )


def _exponent_known(name: str, seed: int) -> float:
    rng, motion = np.random.default_rng(seed), sines(DURATION)
    at = int(rng.integers(5000, 9000))
    x, v = motion.penetration[: at + 3000], motion.velocity[: at + 3000]
    before, after = ANOTHER_EXPONENT[name]
    true = np.where(np.arange(len(x)) < at, before.force(x, v), after.force(x, v))
    estimator = VariableProjection(change_detector=ChangeDetector())
    trace = estimator.replay(x, v, true + noise(rng, len(x)))
    away = np.flatnonzero(np.abs(trace.parameters[at:, 2] - after.exponent) > 0.05)
    return float(away[-1] + 1 if away.size else 0)
