"""The change detector: false alarms, and its delay for small changes."""

from functools import partial
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import (
    BALL,
    MEAN_DEPTH,
    NOISE,
    PVC,
    SPONGE,
    Floats,
    sines,
)
from benchmarks.accuracy.recordings import recorded
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import (
    ChangeDetector,
    ContactGate,
    HuntCrossley,
    RecordingError,
    Status,
    VariableProjection,
    ViscoelasticContact,
    identify,
    lab,
)
from palpate.estimators import ContactEstimator

GEL = HuntCrossley(5e4, 1.5e5, 2.2)
MATERIALS = {"ball": BALL, "PVC": PVC, "sponge": SPONGE, "gel": GEL}
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


def alarms(campaign: Campaign) -> list[Group]:
    return [
        _false(campaign, VariableProjection),
        _robot(campaign),
        _recordings(campaign),
        _delays(campaign),
        _slow_noise(campaign, VariableProjection),
        _false(campaign, ViscoelasticContact),
        _slow_noise(campaign, ViscoelasticContact),
    ]


def _detecting(kind: type[ContactEstimator], **settings: object) -> ContactEstimator:
    """Return an estimator for 1 kHz with a change detector."""
    if kind is ViscoelasticContact:
        settings["sample_time"] = 1.0 / RATE
    return kind().replace(change_detector=ChangeDetector(), **settings)


def _described(kind: type[ContactEstimator]) -> str:
    default = ", the default of `palpate live`" if kind is ViscoelasticContact else ""
    return f"`{kind.__name__}(change_detector=ChangeDetector())`{default}."


def _false(campaign: Campaign, kind: type[ContactEstimator]) -> Group:
    repeats = max(1, campaign.seeds // 200)
    cases = [
        (material, motion, seed)
        for material in MATERIALS
        for motion in range(len(MOTIONS))
        for seed in range(repeats)
    ]
    lines = []
    for name, limit in UNCHANGED.items():
        counts = campaign.map(f"alarms, {name}", partial(_restarts, name, kind), cases)
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
    rng = np.random.default_rng([list(MATERIALS).index(material), motion, seed])
    x, v = _motion(motion, rng)
    law = MATERIALS[material]
    f = law.force(x, v)
    if name == MAXWELL:
        elastic = 0.25 * law.stiffness * np.maximum(x, 0.0) ** law.exponent
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
        sampled = sines(WATCHED)
        return sampled.penetration, sampled.velocity
    t = np.arange(0.0, WATCHED, 1.0 / RATE)
    if motion == 1:
        mean, amplitudes = 8e-3, np.full(6, 1.1e-3)
        rates, phases = rng.uniform(2.0, 20.0, 6), rng.uniform(0.0, 6.3, 6)
    else:
        mean, amplitudes = -3e-3, np.array([12e-3, 1.5e-3])
        rates, phases = np.array([8.2, 1.7]), np.zeros(2)
    angles = np.outer(t, rates) + phases
    return mean + np.sin(angles) @ amplitudes, np.cos(angles) @ (amplitudes * rates)


def _noise(name: str, rng: np.random.Generator, count: int) -> Floats:
    noise = rng.normal(0.0, NOISE, count)
    if name in CORRELATED:
        pole = CORRELATED[name]
        noise = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], noise)
    if name == BURSTS:
        grown = np.ones(count)
        for start in np.flatnonzero(rng.uniform(size=count) < 1.0 / RATE):
            grown[start : start + int(rng.integers(50, 101))] = 4.0
        noise = grown * noise
    if name in FILTERED:
        noise = lfilter(*butter(2, FILTERED[name], fs=RATE), noise)
        noise *= NOISE / noise.std()
    return np.asarray(noise)


def _robot(campaign: Campaign) -> Group:
    seeds = range(max(1, campaign.seeds // 50))
    lines = []
    for name in ROBOT:
        counts = campaign.map(f"alarms, robot, {name}", partial(_robot_alarms, name), seeds)
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


def _recordings(campaign: Campaign) -> Group:
    files = recorded()
    counts = campaign.map("alarms, recordings", _recorded_alarms, files)
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


def _delays(campaign: Campaign) -> Group:
    lines = []
    for change in (each for each in CHANGES if each in MISSED or each in BARS):
        for material in ("ball", "PVC", "sponge"):
            delays = np.array(
                campaign.map(
                    f"{change}, {material}",
                    partial(_delay, change, material),
                    range(campaign.seeds),
                )
            )
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
        f"{campaign.seeds} seeds; {LOOKED:g} s are examined, and a missed change counts as that "
        "time. `VariableProjection(change_detector=ChangeDetector())`.",
        ("95th percentile", "missed, %"),
        lines,
        ("median",),
        precision=".3g",
    )


def _slow_noise(campaign: Campaign, kind: type[ContactEstimator]) -> Group:
    """What the detector misses where the noise is correlated: it takes slow changes for noise."""
    lines, seeds = [], range(max(2, campaign.seeds // 2))
    for change in SLOW_CHANGES:
        for material in ("ball", "PVC", "sponge"):
            missed, medians = list[float](), list[float]()
            for noise in SLOW_NOISE:
                find = partial(_delay, change, material, noise=noise, kind=kind)
                label = f"{change}, {material}, {noise}"
                delays = np.array(campaign.map(label, find, seeds))
                missed.append(100.0 * float(np.mean(delays >= 1e3 * LOOKED)))
                medians.append(float(np.median(delays)))
            lines.append(Line(f"{change}, {material}", tuple(missed), (), tuple(medians)))
    return Group(
        f"Percent of changes missed in slow noise, {kind.__name__}",
        f"Changes as above, {len(seeds)} seeds, with 0.05 N (rms) of AR(1) noise in place of white "
        f"noise; a change counts as missed after {LOOKED:g} s. {_described(kind)}",
        tuple(f"{noise}: missed, %" for noise in SLOW_NOISE),
        lines,
        tuple(f"{noise}: median, ms" for noise in SLOW_NOISE),
        precision=".3g",
    )


def _delay(
    change: str,
    material: str,
    seed: int,
    noise: str = "white",
    kind: type[ContactEstimator] = VariableProjection,
) -> float:
    rng = np.random.default_rng(seed)
    at = int(rng.integers(5000, 10_000))
    stop = at + round(LOOKED * RATE)
    motion = sines(10.0 + LOOKED)
    x, v = motion.penetration[:stop], motion.velocity[:stop]
    before, (stiffer, harder, steeper) = MATERIALS[material], CHANGES[change]
    exponent = steeper * before.exponent
    same_force = MEAN_DEPTH ** (before.exponent - exponent)
    after = HuntCrossley(
        stiffer * same_force * before.stiffness, harder * same_force * before.damping, exponent
    )
    f = np.where(np.arange(stop) < at, before.force(x, v), after.force(x, v))
    f = f + _noise(noise, rng, stop)
    status = _detecting(kind).replay(x, v, f).status
    found = np.flatnonzero(status[at:] == Status.RESTARTED)
    return float(found[0]) if found.size else 1e3 * LOOKED
