"""Outliers: their effect on the estimate, and good samples that are rejected."""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.signal import savgol_filter

from benchmarks.common.probing import (
    BALL,
    GEL,
    INCLUSION,
    NOISE,
    PVC,
    SPONGE,
    change_material,
    clock,
    noise,
    sines,
    taps,
)
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.workers import Workers
from palpate import (
    ChangeDetector,
    Contact,
    ContactGate,
    HuntCrossley,
    OutlierRejection,
    Status,
    VariableProjection,
    identify,
)
from palpate.input.preparation.velocity import velocity_of
from palpate.validation import Floats

SECONDS = 10.0
BAR = 2.0  # %, rms of K and B
NEEDLESS = 0.05  # % of good samples
MATERIALS = {"ball": BALL, "PVC": PVC}
FOUR = {**MATERIALS, "sponge": SPONGE, "gel": GEL}
FAULTS = {
    "nothing wrong": None,
    "positions lost, 0.1 %": BAR,
    "positions lost, 0.1 %, smeared": BAR,
    "velocity spikes of 1 m/s, 0.1 %": BAR,
    "force spikes of 50 N, 1 %": BAR,
    "clipped at 95 %": BAR,
    "clipped at 80 %": BAR,
}
CHANGES = {
    "ball, K + 5 %": (BALL, replace(BALL, K=1.05 * BALL.K), 20.0),
    "PVC, K + 5 %": (PVC, replace(PVC, K=1.05 * PVC.K), 20.0),
    "PVC → inclusion": (PVC, INCLUSION, 20.0),
    "ball → sponge": (BALL, SPONGE, 20.0),
}
AFTER = 2.0  # s


def outliers(workers: Workers) -> list[Group]:
    """Outliers.

    What do outliers cost with and without rejection, and does the rejection exclude good samples?
    """
    return [_errors(workers), _needless(workers), _changes(workers)]


def _errors(workers: Workers) -> Group:
    lines = []
    for name, law in MATERIALS.items():
        for fault, bar in FAULTS.items():
            run = partial(_error, law, fault)
            runs = np.array(workers.repeat(f"{name}, {fault}", run))
            rms = np.sqrt(np.mean(runs[:, :4] ** 2, axis=0))
            limits = () if bar is None else (Limit(bar),)
            left_out = float(np.mean(runs[:, 4]))
            beside = (float(rms[2]), float(rms[3]), left_out)
            lines.append(Line(f"{name}, {fault}", (float(rms[0]), float(rms[1])), limits, beside))
    return Group(
        "Error of K and B, rms, %",
        f"`identify` with its defaults, {SECONDS:g} s of three sines at 1 kHz, 0.05 N of noise on "
        f"the force, {workers.seeds} seeds. A lost position reads 0 (0.1 % of the samples; the "
        "penetration has 1 µm of noise, and `prepare` computes the velocity from it without the "
        "lost ones). Smeared: a filter of 15 ms computes the velocity from all positions, as in "
        "some control loops. The probe is in contact from the first sample on, so a position lost "
        "among the first corrupts fifteen velocities, with the leverage of many seconds. Velocity "
        "spikes are added to 0.1 % of the samples and force spikes to 1 %, of either sign; "
        "clipped: at that fraction of the largest force.",
        ("K", "B"),
        lines,
        ("K, no rejection", "B, no rejection", "rejected, %"),
    )


def _error(law: HuntCrossley, fault: str, seed: int) -> tuple[float, ...]:
    """Return errors of K and B, %, with and without the rejection, and the rejected samples, %."""
    contact = _faulty(law, fault, seed)
    errors: list[float] = []
    for rejection in (None, False):
        result = identify(contact, VariableProjection(outlier_rejection=rejection))
        errors += (100.0 * (result.law.parameters[:2] / law.parameters[:2] - 1.0)).tolist()
        if rejection is None:
            left_out = 100.0 * float(np.mean(result.trace.rejected))
    return (*errors, left_out)


def _faulty(law: HuntCrossley, fault: str, seed: int) -> Contact:
    rng = np.random.default_rng([seed, 4])
    time, (x, v) = clock(SECONDS), (signal.copy() for signal in sines(SECONDS))
    force = law.force(x, v) + noise(rng, time.size)
    if fault.startswith("positions"):
        x = x + 1e-6 * rng.standard_normal(time.size)
        x[rng.random(time.size) < 1e-3] = 0.0
        smeared = fault.endswith("smeared")
        v = savgol_filter(x, 15, 2, 1, 1e-3) if smeared else velocity_of(time, x)
    elif fault.startswith("velocity"):
        hit = rng.random(time.size) < 1e-3
        v[hit] += rng.choice([-1.0, 1.0], np.count_nonzero(hit))
    elif fault.startswith("force"):
        hit = rng.random(time.size) < 1e-2
        force[hit] += 50.0 * rng.choice([-1.0, 1.0], np.count_nonzero(hit))
    elif fault.startswith("clipped"):
        force = np.minimum(force, float(fault[-4:-2]) / 100.0 * force.max())
    return Contact(time, penetration=x, velocity=v, force=force)


def _needless(workers: Workers) -> Group:
    cases = [
        (material, motion, seed)
        for material in FOUR
        for motion in MOTIONS
        for seed in range(max(1, workers.seeds // 50))
    ]
    lines = []
    for name, (step, force_step, noisy) in SENSORS.items():
        counts = workers.map(f"needless, {name}", partial(_count, step, force_step, noisy), cases)
        left_out, samples = np.sum(counts, axis=0)
        lines.append(Line(name, (100.0 * left_out / samples,), (Limit(NEEDLESS),), (samples,)))
    return Group(
        "Good samples rejected, %",
        "Ball, PVC, sponge and a gel by three sines, taps from free air and held strokes, "
        f"{len(cases) // 12} seeds of {SECONDS:g} s; contact above 0.25 N and down to 0.15 N; "
        "where penetration and force are rounded to these steps, the velocity is computed from "
        "the rounded penetration.",
        ("rejected",),
        lines,
        ("samples",),
        precision=".3g",
    )


def _held() -> tuple[Floats, Floats]:
    """8 mm in and out within 0.3 s each, smoothly, and held between."""
    time = clock(SECONDS)
    x, v = np.full(time.size, 1e-3), np.zeros(time.size)
    for begin, way in ((0.0, 8e-3), (1.6, -8e-3)):
        u = np.clip((time % 2.0 - begin) / 0.3, 0.0, 1.0)
        x += way * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        v += way / 0.3 * 30.0 * (u * (1.0 - u)) ** 2
    return x, v


MOTIONS = {
    "three sines": lambda: sines(SECONDS),
    "taps": lambda: taps(clock(SECONDS)),
    "held": _held,
}

# Steps of penetration and force, m and N, and noise, N.
SENSORS = {
    "no noise": (0.0, 0.0, 0.0),
    "0.05 N of noise": (0.0, 0.0, NOISE),
    "20 µm and ⅛ N, noise": (20e-6, 0.125, NOISE),
    "20 µm and ⅛ N, no noise": (20e-6, 0.125, 0.0),
}


def _count(step: float, force_step: float, noisy: float, case: tuple[str, str, int]) -> list[int]:
    material, motion, seed = case
    rng = np.random.default_rng([list(FOUR).index(material), list(MOTIONS).index(motion), seed])
    x, v = MOTIONS[motion]()
    force = FOUR[material].force(x, v) + noisy * rng.standard_normal(x.size)
    if step:
        x, force = step * np.round(x / step), force_step * np.round(force / force_step)
        v = velocity_of(clock(SECONDS), x, 15e-3)
    estimator = VariableProjection(
        outlier_rejection=OutlierRejection(), gate=ContactGate(make_force=0.25, break_force=0.15)
    )
    status = estimator.replay(x, v, force).status
    return [int(np.count_nonzero(status == Status.REJECTED)), x.size]


def _changes(workers: Workers) -> Group:
    lines = []
    for name, (before, after, bar) in CHANGES.items():
        run = partial(_delay, before, after)
        delays, left_out = np.transpose(workers.repeat(f"change, {name}", run))
        median, late = np.percentile(delays, [50.0, 95.0])
        most = float(left_out.max())
        missed = 100.0 * float(np.mean(delays >= 1e3 * AFTER))
        limits = (Limit(bar), Limit(0.0))
        lines.append(Line(name, (float(late), missed), limits, (float(median), most)))
    return Group(
        "Milliseconds until a change of the material is found",
        f"Change at a random time from 5 to 8 s, 0.05 N of noise, {workers.seeds} seeds; "
        f"{AFTER:g} s are examined. `VariableProjection(change_detector=ChangeDetector(), "
        "outlier_rejection=OutlierRejection())`.",
        ("95th percentile", "missed, %"),
        lines,
        ("median", "most samples rejected"),
        precision=".3g",
    )


def _delay(before: HuntCrossley, after: HuntCrossley, seed: int) -> tuple[float, float]:
    rng = np.random.default_rng([seed, 5])
    at, x, v, force = change_material(rng, before, after, 8000, round(1e3 * AFTER))
    estimator = VariableProjection(
        change_detector=ChangeDetector(), outlier_rejection=OutlierRejection()
    )
    status = estimator.replay(x, v, force + noise(rng, len(x))).status
    found = np.flatnonzero(status[at:] == Status.RESTARTED)
    left_out = float(np.count_nonzero(status == Status.REJECTED))
    return (float(found[0]) if found.size else 1e3 * AFTER), left_out
