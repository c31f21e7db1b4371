"""Materials that change: suddenly, with false alarms and delays of the detector, and slowly."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks.common.probing import (
    BALL,
    GEL,
    INCLUSION,
    MATERIALS,
    MEAN_DEPTH,
    NOISE,
    PVC,
    SPONGE,
    autoregressive,
    change_material,
    clock,
    noise,
    sines,
    switched,
    taps,
    waves,
)
from benchmarks.common.recordings import recorded
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.workers import Workers
from palpate import (
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    DriftTracking,
    HuntCrossley,
    RecordingError,
    SelfPerturbation,
    SingleStageRLS,
    Status,
    Trace,
    VariableProjection,
    ViscoelasticContact,
    identify,
    lab,
)
from palpate.findings import Check
from palpate.method.estimators import ContactEstimator
from palpate.validation import Floats

DURATION = 12.0  # s
FLOOR = 2.0 * NOISE
WINDOW = 5  # samples that |e| is averaged over
STIFFER = replace(PVC, K=1.1e5, B=2.2e5)
LARGE_CHANGES = {
    "PVC → inclusion": (PVC, INCLUSION),
    "inclusion → PVC": (INCLUSION, PVC),
    "PVC, 10 % stiffer": (PVC, STIFFER),
}
# With the robot: from, to, and the limit of the overshoot.
ROBOT_CHANGES = {
    "PVC → inclusion": (lab.PVC, lab.INCLUSION, Limit(15.0)),
    "inclusion → PVC": (lab.INCLUSION, lab.PVC, Limit(15.0)),
    "ball → sponge": (lab.BALL, lab.SPONGE, Limit(15.0)),
    "sponge → ball": (lab.SPONGE, lab.BALL, None),
}
SETTLED = 60  # samples after a change
# From, to: another exponent.
ANOTHER_EXPONENT = {"ball → PVC": (BALL, PVC), "PVC → ball": (PVC, BALL)}


ERROR, MODEL, ALARM, ALARMS = range(4)  # columns of a run
Runs = dict[str, tuple[Floats, Floats]]  # with the detector and by the single stage


def changes(workers: Workers) -> list[Group]:
    """A changing material.

    How fast does the estimate follow a sudden change of the material?
    """
    runs = {
        name: (
            np.array(workers.repeat(name, partial(_run, name, False))),
            np.array(workers.repeat(f"{name}, single-stage", partial(_run, name, True))),
        )
        for name in LARGE_CHANGES
    }
    error = (
        "Samples until the mean of |e| over the next 5 ms is first below 2σ = 0.1 N, with the "
        "one-step prediction error e = F − F̂."
    )
    model = "Samples until |F_true − F̂| is below 2σ = 0.1 N and stays so to the end."
    return [
        _recovery(runs, ERROR, "the force error has recovered", error, (Limit(10.0),)),
        _recovery(runs, MODEL, "the model error has recovered for good", model, ()),
        _overshoots(workers),
        _exponents(workers),
    ]


def _recovery(runs: Runs, column: int, what: str, meaning: str, limits: tuple[Limit, ...]) -> Group:
    lines = []
    for name, (detecting, single) in runs.items():
        median, late, worst = _percentiles(detecting[:, column])
        once = 100.0 * float(np.mean(detecting[:, ALARMS] == 1.0))
        beside = (median, worst, *_percentiles(detecting[:, ALARM])[1:], once)
        lines.append(Line(name, (late,), limits, (*beside, *_percentiles(single[:, column]))))
    alarms = ("alarm 95th", "alarm worst", "one alarm, % of runs")
    return Group(
        f"Milliseconds until {what} after a change",
        f"{meaning} Change at a random time from 5 to 10 s of 12; three sines, 0.05 N of noise; "
        "`VariableProjection(change_detector=ChangeDetector())`, compared with "
        "`SingleStageRLS(perturbation=SelfPerturbation())`.",
        ("95th percentile",),
        lines,
        ("median", "worst", *alarms, "SPRLS median", "SPRLS 95th", "SPRLS worst"),
        precision=".1f",
        notes=[f"{len(single)} seeds. A run without recovery counts as the remaining time."],
    )


def _percentiles(values: Floats) -> list[float]:
    """Median, 95th percentile and largest."""
    three: list[float] = np.percentile(values, [50.0, 95.0, 100.0]).tolist()
    return three


def _run(name: str, single_stage: bool, seed: int) -> list[float]:
    rng, (x, v) = np.random.default_rng(seed), sines(DURATION)
    at = int(rng.integers(5000, 10_000))
    before, after = LARGE_CHANGES[name]
    true = switched(before, after, x, v, at)
    f = true + noise(rng, len(x))
    if single_stage:
        trace = SingleStageRLS(perturbation=SelfPerturbation()).replay(x, v, f)
    else:
        trace = VariableProjection(change_detector=ChangeDetector()).replay(x, v, f)
    return _recovered(trace, true, f, at)


def _recovered(trace: Trace, true: Floats, f: Floats, at: int) -> list[float]:
    """Return milliseconds from a change to each recovery and to the alarm, and all alarms."""
    error = np.abs(f - trace.predicted_force)[at:]
    mean = np.convolve(error, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    back = np.flatnonzero(mean < FLOOR)
    wrong = np.flatnonzero(np.abs(true - trace.predicted_force)[at:] > FLOOR)
    alarms = np.flatnonzero(trace.status == Status.RESTARTED)
    late = alarms[alarms >= at] - at
    left = len(f) - at
    return [
        float(back[0] if back.size else left),
        float(wrong[-1] + 1 if wrong.size else 0),
        float(late[0] if late.size else left),
        float(len(alarms)),
    ]


def _overshoots(workers: Workers) -> Group:
    seeds = range(max(2, workers.seeds // 3))
    lines = []
    for name, (_, _, limit) in ROBOT_CHANGES.items():
        runs = np.array(workers.map(f"robot, {name}", partial(_overshoot, name), seeds))
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
    before, after, _ = ROBOT_CHANGES[name]
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


def _exponents(workers: Workers) -> Group:
    lines = []
    for name in ANOTHER_EXPONENT:
        times = workers.repeat(f"exponent, {name}", partial(_exponent_known, name))
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
    rng, (before, after) = np.random.default_rng(seed), ANOTHER_EXPONENT[name]
    at, x, v, true = change_material(rng, before, after, 9000, 3000)
    estimator = VariableProjection(change_detector=ChangeDetector())
    trace = estimator.replay(x, v, true + noise(rng, len(x)))
    away = np.flatnonzero(np.abs(trace.parameters[at:, 2] - after.n) > 0.05)
    return float(away[-1] + 1 if away.size else 0)


WATCHED_MATERIALS = {"ball": BALL, "PVC": PVC, "sponge": SPONGE, "gel": GEL}
MOTIONS = ("three sines", "six sines at random", "taps")
WATCHED = 480.0  # s
RATE = 1e3  # samples a second
CORRELATED = {f"AR(1) {pole:g}": pole for pole in (0.5, 0.9, 0.95, 0.98, 0.99)}
FILTERED = {f"low-pass {cut:g} Hz": cut for cut in (50.0, 100.0, 8.0)}
SENSORS, MAXWELL = "sensor chain", "Maxwell branch of K/4, 1 s"
BURSTS, SLOW = "bursts of 4 σ", "low-pass 8 Hz"
PROPORTIONAL, FRICTION = "1 % of the force", "friction of 1 % of the force"
UNCHANGED = {
    **dict.fromkeys(("white", *CORRELATED, *FILTERED, SENSORS), Limit(1.0)),
    **dict.fromkeys((SLOW, BURSTS, PROPORTIONAL, FRICTION), Limit(2.0)),
    MAXWELL: Limit(10.0),
}
# What changes, and by how much: stiffness, damping, exponent; the latter at the force 10 mm deep.
CHANGES = {
    "K + 5 %": (1.05, 1.0, 1.0),
    "B + 50 %": (1.0, 1.5, 1.0),
    "B + 20 %": (1.0, 1.2, 1.0),
    "B − 20 %": (1.0, 0.8, 1.0),
    "B + 10 %": (1.0, 1.1, 1.0),
    "n + 3 %": (1.0, 1.0, 1.03),
    "K + 10 %": (1.1, 1.0, 1.0),  # only in slow noise
}
# ms, of the 95th percentile
BARS = {"K + 5 %": 10.0, "B + 50 %": 200.0, "B + 10 %": 1500.0}
# %, of the sponge too
MISSED = {"K + 5 %": 0.0, "B + 20 %": 0.0, "B − 20 %": 0.0, "n + 3 %": 10.0}
LOOKED = 3.0  # s after a change
# What is looked for in slow noise, and in which.
SLOW_CHANGES = ("K + 5 %", "K + 10 %", "B + 10 %", "B + 20 %", "B + 50 %", "n + 3 %")
SLOW_NOISE = ("AR(1) 0.9", "AR(1) 0.95", "AR(1) 0.98", "AR(1) 0.99")
ROBOT = {material.name: material for material in (lab.BALL, lab.PVC, lab.SPONGE)}
ROBOT_RUN = 60.0  # s


def alarms(workers: Workers) -> list[Group]:
    """The change detector.

    How often does the change detector raise a false alarm, and how late does it find small changes?
    """
    return [
        _false(workers, VariableProjection),
        _robot(workers),
        _recordings(workers),
        _delays(workers),
        _slow_noise(workers, VariableProjection),
        _false(workers, ViscoelasticContact),
        _slow_noise(workers, ViscoelasticContact),
    ]


def _detecting(kind: type[ContactEstimator], **settings: object) -> ContactEstimator:
    """Return an estimator for 1 kHz with a change detector."""
    if kind is ViscoelasticContact:
        settings["sample_time"] = 1.0 / RATE
    return kind().replace(change_detector=ChangeDetector(), **settings)


def _described(kind: type[ContactEstimator]) -> str:
    default = ", the default of `palpate live`" if kind is ViscoelasticContact else ""
    return f"`{kind.__name__}(change_detector=ChangeDetector())`{default}."


def _false(workers: Workers, kind: type[ContactEstimator]) -> Group:
    repeats = max(1, workers.seeds // 200)
    cases = [
        (material, motion, seed)
        for material in WATCHED_MATERIALS
        for motion in range(len(MOTIONS))
        for seed in range(repeats)
    ]
    lines = []
    for name, limit in UNCHANGED.items():
        counts = workers.map(f"alarms, {name}", partial(_restarts, name, kind), cases)
        hours = len(cases) * WATCHED / 3600.0
        lines.append(Line(name, (sum(counts) / hours,), (limit,), (sum(counts), max(counts))))
    return Group(
        f"False alarms by kind of noise, {kind.__name__}",
        f"The material does not change: four materials by three motions, {WATCHED:g} s each, "
        f"{len(cases) * WATCHED / 3600.0:.1f} h per line; 0.05 N of noise (rms), contact above "
        "0.25 N and down to 0.15 N. Sensor chain: force in steps of 1/8 N, penetration in steps "
        "of 20 µm, velocity by a centred filter of 15 ms. Bursts: 50 to 100 ms of four times the "
        f"noise, one a second on average. {_described(kind)}",
        ("per hour",),
        lines,
        ("alarms", "most in one run"),
        precision=".3g",
    )


def _restarts(name: str, kind: type[ContactEstimator], case: tuple[str, int, int]) -> int:
    material, motion, seed = case
    rng = np.random.default_rng([list(WATCHED_MATERIALS).index(material), motion, seed])
    x, v = _motion(motion, rng)
    law = WATCHED_MATERIALS[material]
    f = law.force(x, v)
    if name == MAXWELL:
        elastic = 0.25 * law.K * np.maximum(x, 0.0) ** law.n
        relaxing = lfilter([1.0, -1.0], [1.0, -(1.0 - 1.0 / RATE)], elastic - elastic[0])
        f = np.where(x > 0.0, np.maximum(f + relaxing, 0.0), 0.0)
    if name == FRICTION:
        f = f * (1.0 + 0.01 * np.tanh(v / 1e-3))
    f = f + (
        0.01 * f * rng.normal(size=len(x)) if name == PROPORTIONAL else _noise(name, rng, len(x))
    )
    if name == SENSORS:
        f, x = np.round(8.0 * f) / 8.0, np.round(5e4 * x) / 5e4
        ages = np.arange(7, -8, -1) / RATE
        v = np.convolve(x, ages / (ages @ ages), mode="same")
        x, v, f = x[7:-7], v[7:-7], f[7:-7]
    estimator = _detecting(kind, gate=ContactGate(make_force=0.25, break_force=0.15))
    for sample in zip(x.tolist(), v.tolist(), f.tolist(), strict=True):
        estimator.update(*sample)
    return estimator.estimate().restarts


def _motion(motion: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    if motion == 0:
        return sines(WATCHED)
    t = np.arange(0.0, WATCHED, 1.0 / RATE)
    if motion == 2:
        return taps(t)
    return waves(t, 8e-3, [1.1e-3] * 6, rng.uniform(2.0, 20.0, 6), rng.uniform(0.0, 6.3, 6))


def _noise(name: str, rng: np.random.Generator, count: int) -> Floats:
    made = rng.normal(0.0, NOISE, count)
    if name in CORRELATED:
        made = autoregressive(made, CORRELATED[name])
    if name == BURSTS:
        grown = np.ones(count)
        for start in np.flatnonzero(rng.uniform(size=count) < 1.0 / RATE):
            grown[start : start + int(rng.integers(50, 101))] = 4.0
        made = grown * made
    if name in FILTERED:
        made = lfilter(*butter(2, FILTERED[name], fs=RATE), made)
        made *= NOISE / made.std()
    return np.asarray(made)


def _robot(workers: Workers) -> Group:
    seeds = range(max(1, workers.seeds // 50))
    lines = []
    for name in ROBOT:
        counts = workers.map(f"alarms, robot, {name}", partial(_robot_alarms, name), seeds)
        hours = len(counts) * ROBOT_RUN / 3600.0
        lines.append(Line(name, (float(sum(counts)),), (Limit(0.0),), (hours,)))
    return Group(
        "False alarms with the robot",
        f"The material does not change: the lab's robot and sensors, three sines, {ROBOT_RUN:g} s "
        "a run. `identify(contact, VariableProjection(change_detector=ChangeDetector()))`.",
        ("alarms",),
        lines,
        ("hours",),
        precision=".3g",
    )


def _robot_alarms(name: str, seed: int) -> int:
    measured = lab.Bench(ROBOT[name], lab.THREE_SINES).run(seed, seconds=ROBOT_RUN)
    return identify(measured.contact, _watching()).changes.size


def _recordings(workers: Workers) -> Group:
    files = recorded()
    counts = workers.map("alarms, recordings", _recorded_alarms, files)
    known = [(file, count) for file, count in zip(files, counts, strict=True) if count is not None]
    found = ", ".join(f"{file.stem} {count}" for file, count in known if count)
    total = float(sum(count for _, count in known))
    notes = [f"Alarms: {found}." if found else "No alarms."] if known else ["No recordings here."]
    return Group(
        "Alarms in recordings",
        "Real contacts of skin, heels, polymers, silicone, a robot's phantom and cells, whole "
        "files; none is known to change. `identify(contact, "
        "VariableProjection(change_detector=ChangeDetector()))`.",
        ("alarms",),
        [Line(f"{len(known)} recordings", (total,), (Limit(2.0),), ())] if known else [],
        (),
        precision=".3g",
        notes=notes,
    )


def _recorded_alarms(file: Path) -> int | None:
    try:
        return identify(file, _watching()).changes.size
    except RecordingError:
        return None


def _watching() -> VariableProjection:
    return VariableProjection(change_detector=ChangeDetector())


def _delays(workers: Workers) -> Group:
    lines = []
    for change in (each for each in CHANGES if each in MISSED or each in BARS):
        for material in ("ball", "PVC", "sponge"):
            find = partial(_delay, change, material)
            delays = np.array(workers.repeat(f"{change}, {material}", find))
            median, late = np.percentile(delays, [50.0, 95.0])
            missed = 100.0 * float(np.mean(delays >= 1e3 * LOOKED))
            strict = material != "sponge" and change in BARS
            late_limit = Limit(BARS[change]) if strict else None
            missed_limit = Limit(MISSED.get(change, 3.0)) if strict or change in MISSED else None
            limits = (late_limit, missed_limit) if late_limit or missed_limit else ()
            lines.append(
                Line(f"{change}, {material}", (float(late), missed), limits, (float(median),))
            )
    return Group(
        "Milliseconds until a small change is found",
        "Change at a random time from 5 to 10 s; three sines, 0.05 N of white noise, "
        f"{workers.seeds} seeds; {LOOKED:g} s are examined, and a missed change counts as that "
        "time. `VariableProjection(change_detector=ChangeDetector())`.",
        ("95th percentile", "missed, %"),
        lines,
        ("median",),
        precision=".3g",
    )


def _slow_noise(workers: Workers, kind: type[ContactEstimator]) -> Group:
    """What the detector misses where the noise is correlated: it takes slow changes for noise."""
    lines, seeds = [], range(max(2, workers.seeds // 2))
    for change in SLOW_CHANGES:
        for material in ("ball", "PVC", "sponge"):
            missed, medians = list[float](), list[float]()
            for name in SLOW_NOISE:
                find = partial(_delay, change, material, name=name, kind=kind)
                label = f"{change}, {material}, {name}"
                delays = np.array(workers.map(label, find, seeds))
                missed.append(100.0 * float(np.mean(delays >= 1e3 * LOOKED)))
                medians.append(float(np.median(delays)))
            lines.append(Line(f"{change}, {material}", tuple(missed), (), tuple(medians)))
    return Group(
        f"Percent of changes missed in slow noise, {kind.__name__}",
        f"Changes as above, {len(seeds)} seeds, with 0.05 N (rms) of AR(1) noise in place of white "
        f"noise; a change counts as missed after {LOOKED:g} s. {_described(kind)}",
        tuple(f"{name}: missed, %" for name in SLOW_NOISE),
        lines,
        tuple(f"{name}: median, ms" for name in SLOW_NOISE),
        precision=".3g",
    )


def _delay(
    what: str,
    material: str,
    seed: int,
    name: str = "white",
    kind: type[ContactEstimator] = VariableProjection,
) -> float:
    rng = np.random.default_rng(seed)
    before, (stiffer, harder, steeper) = WATCHED_MATERIALS[material], CHANGES[what]
    exponent = steeper * before.n
    same_force = MEAN_DEPTH ** (before.n - exponent)
    after = HuntCrossley(
        K=stiffer * same_force * before.K, B=harder * same_force * before.B, n=exponent
    )
    at, x, v, true = change_material(rng, before, after, 10_000, round(LOOKED * RATE))
    f = true + _noise(name, rng, len(x))
    status = _detecting(kind).replay(x, v, f).status
    found = np.flatnonzero(status[at:] == Status.RESTARTED)
    return float(found[0]) if found.size else 1e3 * LOOKED


DRIFTING, WITHOUT = 40.0, 2000  # s; excluded samples
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "drift tracking": DriftTracking,
    "projection": lambda: VariableProjection(offset=False),
    "λ = 0.998": lambda: VariableProjection(offset=False, forgetting=ConstantForgetting(0.998)),
    "λ = 0.99": lambda: VariableProjection(offset=False, forgetting=ConstantForgetting(0.99)),
}


def drift(workers: Workers) -> list[Group]:
    """A drifting material.

    How well does `DriftTracking` follow a stiffness that drifts slowly?
    """
    lines = []
    for material in MATERIALS:
        runs = np.array(workers.repeat(f"drift, {material}", partial(_errors, material)))
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
            notes=[f"{workers.seeds} seeds."],
        ),
        _too_slow(workers),
        _bars(workers),
    ]


# Deviation of ln K after a second, 1/√s, and correlation of the noise: the first must be flagged,
# the second is what `DriftTracking()` assumes.
WALKS = ((0.2, 0.0), (0.02, 0.0), (0.04, 0.0), (0.1, 0.0), (0.02, 0.9))


def _too_slow(workers: Workers) -> Group:
    lines = []
    for material in MATERIALS:
        runs = workers.repeat(f"walk, {material}", partial(_flagged, material))
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
        notes=[f"{workers.seeds} seeds."],
    )


CORRELATIONS = (0.0, 0.5, 0.7, 0.9, 0.98)


def _bars(workers: Workers) -> Group:
    lines = []
    for material in MATERIALS:
        runs = workers.repeat(f"bars, {material}", partial(_held, material))
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
        notes=[f"{workers.seeds} seeds."],
    )


def _held(material: str, seed: int) -> list[bool]:
    law, (x, v) = MATERIALS[material], sines(12.0)
    held = []
    for correlation in CORRELATIONS:
        method = DriftTracking()
        random = np.random.default_rng([seed, 2])
        error = autoregressive(noise(random, len(x)), correlation)
        method.replay(x, v, law.force(x, v) + error, at=[])
        found = method.estimate().with_error(lambda law: float(law.force(MEAN_DEPTH, 0.0)))
        held.append(abs(found[0] - float(law.force(MEAN_DEPTH, 0.0))) < 1.96 * found[1])
    return held


def _flagged(material: str, seed: int) -> list[bool]:
    law, (x, v) = MATERIALS[material], sines(20.0)
    found = []
    for walk, correlation in WALKS:
        random = np.random.default_rng([seed, 1])
        steps = walk * np.sqrt(1e-3) * random.standard_normal(len(x))
        error = autoregressive(noise(random, len(x)), correlation)
        f = np.exp(np.cumsum(steps)) * law.force(x, v) + error
        method = DriftTracking()
        method.replay(x, v, f)
        findings = method.estimate().findings
        found.append(any(each.check is Check.TRACKING for each in findings))
    return found


def _errors(material: str, seed: int) -> list[float]:
    """Return the relative rms error of the force scale by each method, %."""
    law, (x, v) = MATERIALS[material], sines(DRIFTING)
    scale = 1.0 + 0.3 * np.sin(2.0 * np.pi * 0.1 * clock(DRIFTING))
    f = scale * law.force(x, v) + noise(np.random.default_rng(seed), len(x))
    true = scale * law.K * MEAN_DEPTH**law.n
    errors = []
    for make in METHODS.values():
        found = make().replay(x, v, f).parameters
        relative = found[:, 0] * MEAN_DEPTH ** found[:, 2] / true - 1.0
        errors.append(100.0 * float(np.sqrt(np.mean(relative[WITHOUT:] ** 2))))
    return errors
