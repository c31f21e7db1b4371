"""Special contacts: bad starts, a one-way approach, an unknown surface, a held contact."""

from collections import Counter
from functools import partial

import numpy as np

from benchmarks.accuracy.bounds import rms
from benchmarks.common.probing import (
    BALL,
    MATERIALS,
    NOISE,
    SYMBOLS,
    approach_and_probe,
    feed,
    noise,
    sines,
)
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.workers import Workers
from palpate import ContactGate, DoubleStageRLS, HuntCrossley, SingleStageRLS, VariableProjection
from palpate.lab.design.precision import cramer_rao_bound
from palpate.method.estimators import ContactEstimator
from palpate.validation import Floats

STARTS = [
    HuntCrossley(K=float(stiffness), B=0.0, n=float(exponent))
    for stiffness in np.logspace(-1.0, 5.0, 21)
    for exponent in np.linspace(0.5, 3.0, 6)
]
PAPER: dict[str, type[SingleStageRLS] | type[DoubleStageRLS]] = {
    "single-stage": SingleStageRLS,
    "double-stage": DoubleStageRLS,
}
SPEEDS = ("constant", "half a sine", "least jerk", "fading")  # of an approach
NOISES = (1e-4, 5e-3, 5e-2)  # N
EXPONENTS = np.arange(0.3, 3.6, 0.002)
# Multiple of the noise variance by which the sum of squares may exceed the minimum: the priors,
# worth a sample or two each, change it by a few.
EXCESS = 10.0
DURATION, UNKNOWN = 20.0, 2e-3  # s including the approach, and m, of an unknown surface
BEFORE, HOLD, AFTER = 10_000, 100_000, 10_000  # samples
DEPTH = 10.5e-3  # m
LOOK = 100  # samples between two estimates


def starts(workers: Workers) -> list[Group]:
    """Starting values.

    Can bad starting values spoil the result?
    """
    noises = max(1, workers.seeds // 20)
    lines = []
    for name in MATERIALS:
        missed = sum(workers.repeat(f"starts, {name}", partial(_without_start, name)))
        figure = f"variable projection, {name} (takes no start)"
        lines.append(Line(figure, (100.0 * missed / workers.seeds,), (Limit(0.0),)))
    cases = [(start, seed) for start in STARTS for seed in range(noises)]
    for method in PAPER:
        missed = sum(workers.map(f"starts, {method}", partial(_with_start, method), cases))
        figure = f"{method}, ball, {len(STARTS)} starts × {noises} seeds"
        lines.append(Line(figure, (100.0 * missed / len(cases),)))
    definition = (
        "K, B and n not all within 5 % of the truth after 20 s of three sines, true x and v, "
        "0.05 N of noise. Starting values of the paper's methods: 21 K from 0.1 to 1e5, "
        "log-spaced, by 6 n from 0.5 to 3, B = 0, the default covariance. Variable projection "
        "has no starting values, so none can fail; its line is the percentage of seeds that "
        "miss."
    )
    title, columns = "Starting values that do not converge", ("not converged, %",)
    return [Group(title, definition, columns, lines, precision=".1f")]


def _without_start(material: str, seed: int) -> bool:
    return _far(VariableProjection(offset=False), MATERIALS[material], seed)


def _with_start(method: str, case: tuple[HuntCrossley, int]) -> bool:
    start, seed = case
    return _far(PAPER[method](initial=start), BALL, seed)


def _far(estimator: ContactEstimator, law: HuntCrossley, seed: int) -> bool:
    x, v = sines(20.0)
    f = law.force(x, v) + noise(np.random.default_rng(seed), len(x))
    (estimate,) = feed(estimator, x, v, f, [len(x)])
    return bool(np.any(np.abs(estimate.parameters / law.parameters - 1.0) > 0.05))


def approaches(workers: Workers) -> list[Group]:
    """A one-way approach.

    Does the search find the global minimum where a probe only goes in?
    """
    lines = []
    for k, speed in enumerate(SPEEDS):
        missed = sum(workers.repeat(f"approaches, {speed}", partial(_missed, k)))
        lines.append(Line(speed, (100.0 * missed / workers.seeds,), (Limit(0.0),), (missed,)))
    definition = (
        "A probe goes in once, 2 to 15 mm in 0.2 to 3 s, with four speed profiles; n from 0.5 "
        "to 3, peak force 1 to 50 N, noise of 1e-4, 0.005 or 0.05 N. Missed means that the "
        f"sum of squares is more than {EXCESS:g} σ² above the smallest over {len(EXPONENTS)} "
        "exponents, each solved for K, B and the offset by SVD."
    )
    title, columns = "Approaches that end in the wrong minimum", ("missed, %",)
    return [Group(title, definition, columns, lines, ("missed",), precision=".1f")]


def _missed(speed: int, seed: int) -> bool:
    rng = np.random.default_rng([speed, seed])
    depth, duration = rng.uniform(2e-3, 15e-3), rng.uniform(0.2, 3.0)
    x, v = _approach(speed, depth, duration)
    exponent, peak = rng.uniform(0.5, 3.0), np.exp(rng.uniform(0.0, np.log(50.0)))
    stiffness = peak / depth**exponent
    damping = stiffness * rng.uniform(0.02, 0.6) / (depth / duration)
    deviation = rng.choice(NOISES)
    clean = HuntCrossley(K=stiffness, B=damping, n=exponent).force(x, v)
    f = clean + rng.normal(0.0, deviation, len(x))
    x, v, f = x[f > 0.0], v[f > 0.0], f[f > 0.0]
    # Every sample counts, as in the reference search, to compare the two results.
    estimator = VariableProjection(gate=ContactGate(make_force=1e-9))
    estimator.replay(x, v, f)
    estimate = estimator.estimate()
    residual = f - estimate.law.force(x, v) - estimate.offset
    least = min(_sum_of_squares(float(n), x / depth, v, f) for n in EXPONENTS)
    return bool(residual @ residual - least > EXCESS * deviation**2)


def _approach(speed: int, depth: float, duration: float) -> tuple[Floats, Floats]:
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
    residual = f - columns @ np.linalg.lstsq(columns, f, rcond=1e-9)[0]
    return float(residual @ residual)


def contact_point(workers: Workers) -> list[Group]:
    """An unknown surface.

    How accurate are K and the surface when the surface is known to ±2 mm only?
    """
    lines, notes = [], [f"{workers.seeds} seeds."]
    for material, law in MATERIALS.items():
        runs = workers.repeat(material, partial(_surface_errors, material))
        errors = np.array([error for error, _ in runs])
        flagged = sum(bool(flags) for _, flags in runs)
        if flagged:
            notes.append(f"{material}: {flagged} of {len(runs)} estimates carry a flag.")
        x, v = approach_and_probe(DURATION)
        bound = cramer_rao_bound(law, x, v, NOISE, offset=True, surface=True)
        bounds = (100.0 * bound[0] / law.K, 1e6 * bound[-1])
        for i, (what, highest) in enumerate((("K, %", 1.5), ("surface, µm", 40.0))):
            worst, late = np.percentile(np.abs(errors[:, i]), [100.0, 95.0])
            size = float(rms(errors[:, i]))
            limits = (Limit(highest),) if material == "PVC" else ()
            beside = (size, bounds[i], size / bounds[i])
            figure = f"{material}, error of {what}"
            lines.append(Line(figure, (float(late), float(worst)), limits, beside))
    definition = (
        "True x and v, shifted by up to ±2 mm, 0.05 N of noise; one second of approach "
        "from 3 mm above the surface, then three sines to 20 s; `VariableProjection("
        'surface="estimate")`. The bound treats offset and surface as nuisance parameters.'
    )
    columns, others = ("95th percentile", "worst"), ("rms", "bound", "rms / bound")
    return [Group("Unknown contact point", definition, columns, lines, others, ".3f", notes)]


def _surface_errors(material: str, seed: int) -> tuple[tuple[float, float], tuple[str, ...]]:
    """Return errors of K [%] and of the surface [µm], and the flags."""
    law, rng = MATERIALS[material], np.random.default_rng(seed)
    x, v = approach_and_probe(DURATION)
    shift = rng.uniform(-UNKNOWN, UNKNOWN)
    f = law.force(x, v) + noise(rng, len(x))
    estimator = VariableProjection(surface="estimate")
    (estimate,) = feed(estimator, x + shift, v, f, [len(x)])
    stiffness = 100.0 * (float(estimate.parameters[0]) / law.K - 1.0)
    return (stiffness, 1e6 * (estimate.surface - shift)), estimate.flags


def holding(workers: Workers) -> list[Group]:
    """A held contact.

    Does the estimate drift while the probe holds still for 100 s?
    """
    lines, notes = [], [f"{workers.seeds} seeds."]
    for material in MATERIALS:
        runs = workers.repeat(f"holding, {material}", partial(_changes, material))
        hold = np.max([run[0] for run in runs], axis=0)
        after = np.max([run[1] for run in runs], axis=0)
        lines.append(Line(material, tuple(hold.tolist()), (Limit(1.0),), tuple(after.tolist())))
        flags = Counter(flag for run in runs for flag in run[2])
        held = "; ".join(f"“{flag}” ({count})" for flag, count in flags.most_common())
        notes.append(f"{material}, flags of a contact held from the start: {held}.")
    definition = (
        "Three sines for 10 s, 100 s held at 10.5 mm, three sines for 10 s; 0.05 N of noise, "
        "`VariableProjection()`. Largest change of a parameter since the hold began, %, "
        "checked every 0.1 s; last columns: the same after the hold."
    )
    beside = tuple(f"after: {symbol}" for symbol in SYMBOLS)
    return [Group("Held for 100 s", definition, SYMBOLS, lines, beside, ".3f", notes)]


def _changes(material: str, seed: int) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Return the largest changes during and after the hold [%], and the flags of a held contact."""
    law, rng = MATERIALS[material], np.random.default_rng(seed)
    x, v = sines((BEFORE + AFTER) * 1e-3)
    x, v = np.insert(x, BEFORE, np.full(HOLD, DEPTH)), np.insert(v, BEFORE, np.zeros(HOLD))
    f = law.force(x, v) + noise(rng, len(x))
    ends = range(BEFORE, len(x) + 1, LOOK)
    known = np.array([e.parameters for e in feed(VariableProjection(), x, v, f, ends)])
    moves = 100.0 * np.abs(known / known[0] - 1.0)
    looks = HOLD // LOOK
    held = slice(BEFORE, BEFORE + HOLD)
    (estimate,) = feed(VariableProjection(), x[held], v[held], f[held], [HOLD])
    return moves[: looks + 1].max(axis=0), moves[looks + 1 :].max(axis=0), estimate.flags
