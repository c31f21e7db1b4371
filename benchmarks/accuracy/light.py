"""Light contact, contact lost below the surface on the way out, and tares."""

import math
import zlib
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.bounds import rms
from benchmarks.common.probing import BALL, GEL, PVC, SPONGE, SYMBOLS, feed, waves
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.workers import Workers
from palpate import Estimate, HuntCrossley, Scale, VariableProjection
from palpate.lab.design.precision import cramer_rao_bound
from palpate.validation import Floats

SECONDS = 10.0
LEVELS = (0.005, 0.05, 0.2)  # N
LEVEL = 0.05  # N, if there is only one
FIRST_SEED = 20_000  # none of these was used while the rule was developed


MATERIALS = {
    "ball": BALL,
    "PVC": PVC,
    "sponge": SPONGE,
    "metal": HuntCrossley(K=1e7, B=5e6, n=1.5),
    "gel": GEL,
    "low damping": HuntCrossley(K=3e4, B=600.0, n=1.5),
}
Motion = tuple[Floats, Floats]  # penetration and velocity


def pressed(name: str, kind: str) -> Motion:
    """Return penetration and velocity of a motion: 10 mm deep, in metal 0.2 mm."""
    depth = 0.2e-3 if name == "metal" else 10e-3
    x, v = path(kind)
    return depth * x, depth * v


@lru_cache(maxsize=8)
def path(kind: str) -> Motion:
    """Return one of the motions, which all leave the material, in units of the depth; 1 kHz."""
    t: Floats = 1e-3 * np.arange(round(1e3 * SECONDS), dtype=np.float64)
    if kind == "chirp":  # 0.5 to 3 Hz
        rates = 2.0 * math.pi * (0.5 + 2.5 * t / SECONDS)
        phase = 2.0 * math.pi * (0.5 * t + 1.25 * t**2 / SECONDS)
        return 0.4 - 0.6 * np.cos(phase), 0.6 * rates * np.sin(phase)
    if kind == "random":
        random = np.random.default_rng(5)
        turns = 2.0 * math.pi * random.uniform(0.3, 3.0, 12)
        return waves(t, 0.35, [0.13] * 12, turns, random.uniform(0.0, 2.0 * math.pi, 12))
    if kind == "taps":  # at 1.3 Hz, of three depths
        reach = 0.15 + np.array([0.4, 0.7, 1.0])[(1.3 * t).astype(int) % 3]
        rate = 2.6 * math.pi
        turn = rate * t
        return -0.15 + 0.5 * reach * (1.0 - np.cos(turn)), 0.5 * reach * rate * np.sin(turn)
    turn = 2.0 * math.pi * t[t < 1.0]  # "indentation", in and out in one second
    return -0.2 + 0.6 * (1.0 - np.cos(turn)), 1.2 * math.pi * np.sin(turn)


def estimated(x: Floats, v: Floats, f: Floats, tare: float | None = None) -> Estimate:
    """Return the final estimate of variable projection, in the units of `identify`."""
    touching = (x > 0.0) & (f > 0.0)
    scale = Scale(*(float(np.abs(signal[touching]).max()) for signal in (x, v, f)))
    estimator = VariableProjection(scale=scale, offset_deviation=tare)
    (estimate,) = feed(estimator, x, v, f, [len(x)])
    return estimate


def _noise(line: str, seed: int, samples: int, level: float = LEVEL) -> Floats:
    """Return white noise, N, separate for each line of a table, so that lines are independent."""
    random = np.random.default_rng([FIRST_SEED + seed, zlib.crc32(line.encode())])
    return random.normal(0.0, level, samples)


def light(workers: Workers) -> list[Group]:
    """Light contact, lost contact and tares.

    Is the result right where the probe leaves the material, where contact is lost above the
    surface, and where the tare is wrong?
    """
    return [*_efficiency(workers), _lost(workers), _offsets(workers)]


def _efficiency(workers: Workers) -> list[Group]:
    lines, figures = [], []
    for name, law in MATERIALS.items():
        for kind in ("chirp", "random", "taps"):
            for level in LEVELS:
                label = f"{name}, {kind}, {level:g} N"
                found = workers.repeat(f"light, {label}", partial(_errors, name, kind, level))
                bound = cramer_rao_bound(law, *pressed(name, kind), level, offset=True)[:3]
                ratio = rms([errors for errors, _ in found]) / bound
                covered = np.mean([held for _, held in found], axis=0)
                figures.append(ratio)
                shares = tuple((100.0 * covered).tolist())
                lines.append(Line(label, tuple(ratio.tolist()), (Limit(1.3),), shares))
    scatter = (2.0 * workers.seeds) ** -0.5
    definition = (
        "Ten seconds of motions that leave the material, including the free air between touches: "
        "true x and v, white noise, no tare. The bound uses all samples and treats the offset as "
        "a nuisance parameter. Last columns: the percentage of 95 % intervals that contain the "
        "truth."
    )
    notes = [
        f"{workers.seeds} seeds from {FIRST_SEED}; each ratio is known to ±{scatter:.1%} (one "
        "standard error)."
    ]
    summary = (
        "Median of all figures, and of the worst of K, B and n of each line, which exceeds the "
        "bound by chance."
    )
    middle, worst = float(np.median(figures)), float(np.median(np.max(figures, axis=1)))
    median = Line("median of the table above", (middle,), (Limit(1.05),), (worst,))
    title = "Light contact: RMSE over the Cramér–Rao bound"
    beside = tuple(f"coverage {symbol}" for symbol in SYMBOLS)
    return [
        Group(title, definition, SYMBOLS, lines, beside, notes=notes),
        Group("Summary", summary, ("all",), [median], ("worst of K, B, n",), precision=".3f"),
    ]


def _errors(name: str, kind: str, level: float, seed: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Return errors of K, B and n, and whether the intervals contain the truth."""
    law, (x, v) = MATERIALS[name], pressed(name, kind)
    f = law.force(x, v) + _noise(f"{name} {kind} {level}", seed, x.size, level)
    estimate = estimated(x, v, f)
    errors = estimate.parameters - law.parameters
    return errors, np.abs(errors) < 1.96 * estimate.standard_errors


def _lost(workers: Workers) -> Group:
    lines = []
    for name, kind in (("ball", "taps"), ("ball", "indentation"), ("PVC", "indentation")):
        for below in (0.1, 0.3):
            for air in (True, False):
                words = "with" if air else "without"
                label = f"{name}, {kind}, below {below:.0%}, {words} free air"
                found = workers.repeat(label, partial(_after_loss, name, kind, below, air))
                limit = Limit(1.0) if (name, kind) == ("ball", "taps") else None
                lines.append(Line(label, tuple((100.0 * rms(found)).tolist()), (limit, None)))
    return Group(
        "Contact that is lost above the surface",
        "A material that recovers slowly: on the way out there is no force below 10 or 30 % of "
        "the maximum depth. 0.05 N of white noise. Errors, %, rms.",
        SYMBOLS,
        lines,
        precision=".2f",
        notes=[f"{workers.seeds} seeds from {FIRST_SEED}."],
    )


def _after_loss(name: str, kind: str, below: float, air: bool, seed: int) -> Floats:
    """Return relative errors of K, B and n."""
    law, (x, v) = MATERIALS[name], pressed(name, kind)
    own = _noise(f"{name} {kind} {below}", seed, x.size)
    f = np.where(_recovering(x, v, below), 0.0, law.force(x, v)) + own
    seen = np.full(x.size, True) if air else x > 0.0
    estimate = estimated(x[seen], v[seen], f[seen])
    return estimate.parameters / law.parameters - 1.0


def _recovering(x: Floats, v: Floats, below: float) -> NDArray[np.bool_]:
    """Return where the material has not recovered yet."""
    reached = [0.0]
    for depth in x.tolist():
        reached.append(max(reached[-1], depth) if depth > 0.0 else 0.0)
    return np.asarray((v < 0.0) & (x > 0.0) & (x < below * np.array(reached[1:])))


#: Force offset, N (None: what a good tare leaves), and stated uncertainty of the tare, N.
OFFSETS = {
    "untared, 5 N": (5.0, None),
    "a wrong tare, 5 N off and stated to 5 mN": (5.0, 5e-3),
    "a good tare, to 5 mN": (None, 5e-3),
}


def _offsets(workers: Workers) -> Group:
    lines = []
    for words, (offset, tare) in OFFSETS.items():
        for name in ("ball", "PVC"):
            for where in ("through the surface", "deep"):
                label = f"{words}, {name}, {where}"
                found = workers.repeat(label, partial(_with_offset, name, where, offset, tare))
                error, covered, flagged = 100.0 * np.array(found).T
                limits = Limit(100.0, 90.0), Limit(100.0, 98.0) if tare and offset else Limit(2.0)
                values = float(np.mean(covered)), float(np.mean(flagged))
                lines.append(Line(label, values, limits, (float(rms(error)),)))
    return Group(
        "Offsets and tares",
        "A random motion, through the surface with free air, or deep within (a fifth of the stroke "
        "around 60 % of the depth, never in free air); 0.05 N of white noise. Percentage of 95 % "
        "intervals that contain K, percentage flagged, and rms error of K, %.",
        ("K covered", "flagged"),
        lines,
        ("K, % rms",),
        precision=".1f",
        notes=[f"{workers.seeds} seeds from {FIRST_SEED}; a good tare leaves N(0, (5 mN)²)."],
    )


def _with_offset(
    name: str, where: str, offset: float | None, tare: float | None, seed: int
) -> tuple[float, float, float]:
    """Return the error of K, whether its interval contains it, and whether the tare is flagged."""
    law, (x, v) = MATERIALS[name], pressed(name, "random")
    if where == "deep":
        x, v = 6e-3 + 0.2 * (x - 3.5e-3), 0.2 * v
    own = _noise(f"{name} {where} {offset} {tare}", seed, x.size + 1)
    left = own[-1] * (tare or 0.0) / LEVEL if offset is None else offset
    f = law.force(x, v) + left + own[:-1]
    estimate = estimated(x, v, f, tare)
    error = float(estimate.parameters[0] - law.K)
    covered = abs(error) < 1.96 * float(estimate.standard_errors[0])
    flagged = any(flag.startswith("offset") for flag in estimate.flags)
    return error / law.K, float(covered), float(flagged)
