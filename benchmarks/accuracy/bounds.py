"""Errors against the Cramér–Rao bound, times of convergence, and coverage of the intervals."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import butter, lfilter

from benchmarks.common.probing import (
    BALL,
    GEL,
    MATERIALS,
    NOISE,
    ONE_SINE,
    PVC,
    SAMPLE_TIME,
    SYMBOLS,
    THREE_SINES,
    autoregressive,
    clock,
    feed,
    noise,
    sines,
    taps,
    waves,
)
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.workers import Workers
from palpate import (
    Contact,
    ContactGate,
    HuntCrossley,
    Scale,
    SingleStageRLS,
    VariableProjection,
    identify,
)
from palpate.identification.diagnosis import Data
from palpate.identification.diagnosis.fit import Fit, FitInput, standard_errors
from palpate.input.preparation.velocity import velocity_of
from palpate.lab.design import Motion
from palpate.lab.design.precision import cramer_rao_bound, inverse_information, jacobian
from palpate.validation import Floats

TIMES = (0.5, 1.0, 5.0, 20.0)  # s
ENDS = tuple(round(1e3 * time) for time in TIMES)

FORCE_STEP = 1.0 / 8.0  # N
ENCODER_STEP = 20e-6  # m
VELOCITY_WINDOW = 15e-3  # s
PAUSE = 2000  # samples in which the force bias is measured
# The bias that remains after the pause: that of the mean of a quantised signal, and its scatter.
OFFSET_LEFT = FORCE_STEP / math.pi * math.exp(
    -2.0 * math.pi**2 * NOISE**2 / FORCE_STEP**2
) + math.hypot(NOISE, FORCE_STEP / math.sqrt(12.0)) / math.sqrt(PAUSE)
# As `identify` derives it from the encoder's steps.
SURFACE_LEFT = 2.0 * ENCODER_STEP / math.sqrt(12.0)


@dataclass(frozen=True, slots=True)
class Trial:
    """A material, a sensor and the estimator's prior knowledge.

    ``sensor`` is "true" (true x and v, white noise), "offset" (the same and a constant force) or
    "chain" (the paper's rig).
    """

    material: str
    sensor: str = "true"
    offset_deviation: float | None = None
    surface_deviation: float | None = None
    single_stage: bool = True


# What is known beforehand under the paper's sensors, as a part of a title and as settings.
CHAINS = {
    ("offset unknown", "`VariableProjection()`"): Trial("ball", "chain"),
    (
        "offset known from the pause",
        f"`offset_deviation={OFFSET_LEFT:.4f}`, the uncertainty after the pause",
    ): Trial("ball", "chain", OFFSET_LEFT),
    (
        "offset known from the pause, the surface to the encoder's step",
        "The same, and `surface_deviation` as `identify` derives it from the encoder's steps",
    ): Trial("ball", "chain", OFFSET_LEFT, SURFACE_LEFT),
}


def ideal(workers: Workers) -> list[Group]:
    """Errors over the Cramér–Rao bound: no force offset.

    How close are the errors to the smallest possible? The Cramér–Rao bound is 1: no unbiased
    method is below it, except by chance.
    """
    definition = (
        "True x and v, white noise of 0.05 N, three sines; `VariableProjection(offset=False)` "
        "and `SingleStageRLS()`."
    )
    return [_errors(workers, "no offset", definition, Trial("ball"), 5 * workers.seeds)]


def unknown_offset(workers: Workers) -> list[Group]:
    """Errors over the Cramér–Rao bound: unknown offset.

    How close are the errors to the smallest possible when the force offset is unknown?
    """
    definition = (
        "True x and v, white noise of 0.05 N, three sines, and for each seed a force offset "
        "from N(0, (0.1 N)²); `VariableProjection()`. The bound treats the offset as a "
        "nuisance parameter."
    )
    return [
        _errors(workers, "unknown offset", definition, Trial("ball", "offset"), 5 * workers.seeds)
    ]


def sensor_chain(workers: Workers) -> list[Group]:
    """Errors over the Cramér–Rao bound: the paper's sensors.

    How close are the errors to the smallest possible with the paper's sensors: rounded force,
    encoder steps, filtered velocity?
    """
    return [
        _errors(
            workers,
            f"the paper's sensor chain, {words}",
            f"{settings}. Force in steps of 1/8 N after 0.05 N of noise, a bias measured in a 2 s "
            "pause and removed, a 20 µm encoder at random alignment to the surface, velocity "
            "by a Savitzky–Golay filter of 15 ms. The bound assumes white noise of 0.05 N and an "
            "unknown offset. Quantisation of the force alone multiplies it by 1.23. It includes "
            "no prior knowledge of the offset, so ratios below 1 are possible.",
            trial,
            workers.seeds,
            lambda time: Limit(1.3 if time <= 5.0 else 1.5),
        )
        for (words, settings), trial in CHAINS.items()
    ]


def _errors(
    workers: Workers,
    what: str,
    definition: str,
    trial: Trial,
    seeds: int,
    limit: Callable[[float], Limit] = lambda _: Limit(1.15),
) -> Group:
    lines = []
    for name, (errors, _, single_stage) in _outcomes(workers, trial, seeds):
        bound = bounds(replace(trial, material=name))
        ours, single = rms(errors) / bound, rms(single_stage) / bound
        lines += [
            Line(f"{name}, {time:g} s", tuple(ours[i]), (limit(time),), tuple(single[i]))
            for i, time in enumerate(TIMES)
        ]
    scatter = (2.0 * seeds) ** -0.5
    notes = [f"{seeds} seeds; each ratio is known to ±{scatter:.1%} (one standard error)."]
    beside = tuple(f"single-stage {symbol}" for symbol in SYMBOLS)
    title = f"RMSE over the Cramér–Rao bound, {what}"
    return Group(title, definition, SYMBOLS, lines, beside, notes=notes)


def _outcomes(workers: Workers, trial: Trial, seeds: int) -> Iterator[tuple[str, Floats]]:
    """Yield materials and their runs, shape (3, seeds, 4, 3)."""
    for name in MATERIALS:
        function = partial(run, replace(trial, material=name))
        runs = workers.map(f"{trial.sensor}, {name}", function, range(seeds))
        yield name, np.swapaxes(runs, 0, 1)


def coverage(workers: Workers) -> list[Group]:
    """Coverage of the 95 % intervals.

    How often do the 95 % intervals contain the truth, in white noise and with the paper's sensors?
    """
    white = "True x and v, white noise of 0.05 N, an unknown offset; `VariableProjection()`."
    # Above 95, because a bar is never below that of white noise, and is wider because the noise
    # is not known to be white.
    limits = (Limit(99.0, 93.0),)
    title, trial = "Coverage of the 95 % interval", Trial("ball", "offset")
    groups = [_coverage(workers, title, white, trial, 5 * workers.seeds, limits)]
    for (words, settings), trial in CHAINS.items():
        title = f"Coverage under the paper's sensor chain, {words}"
        definition = (
            f"The paper's sensor chain. {settings}. An encoder's steps and a surface up to half a "
            "step away are not in the model, so 95 % is not guaranteed here."
        )
        groups.append(_coverage(workers, title, definition, trial, workers.seeds))
    return groups


def _coverage(
    workers: Workers,
    title: str,
    definition: str,
    trial: Trial,
    seeds: int,
    limits: tuple[Limit, ...] = (),
) -> Group:
    lines = []
    for name, runs in _outcomes(workers, replace(trial, single_stage=False), seeds):
        fraction = 100.0 * np.mean(runs[1], axis=0)
        lines += [
            Line(f"{name}, {time:g} s", tuple(fraction[i]), limits)
            for i, time in enumerate(TIMES)
            if time >= 1.0
        ]
    spread = 196.0 * (0.95 * 0.05 / seeds) ** 0.5
    low, high = 95.0 - spread, min(95.0 + spread, 100.0)
    notes = [
        f"%, {seeds} seeds: a true 95 % shows as {low:.1f} to {high:.1f} % in 19 of 20 cells"
        " (binomial)."
    ]
    return Group(title, definition, SYMBOLS, lines, precision=".1f", notes=notes)


def run(trial: Trial, seed: int) -> Floats:
    """Errors of K, B and n at each time, whether the 95 % intervals hold, single-stage errors."""
    law = MATERIALS[trial.material]
    x, v, f = _measured(trial, np.random.default_rng(seed))
    estimator = VariableProjection(
        offset=trial.sensor != "true",
        offset_deviation=trial.offset_deviation,
        surface_deviation=trial.surface_deviation,
        # An error of the surface looks like an offset, scaled by the stiffness.
        scale=Scale(10e-3, 20e-3, law.force(10e-3, 0.0)) if trial.surface_deviation else None,
    )
    errors, covered, single = results = np.full((3, len(ENDS), 3), np.nan)
    for i, estimate in enumerate(feed(estimator, x, v, f, ENDS)):
        errors[i] = estimate.parameters - law.parameters
        covered[i] = np.abs(errors[i]) < 1.96 * estimate.standard_errors
    if trial.single_stage:
        for i, estimate in enumerate(feed(SingleStageRLS(), x, v, f, ENDS)):
            single[i] = estimate.parameters - law.parameters
    return results


def bounds(trial: Trial) -> Floats:
    """Return the Cramér–Rao bound of K, B and n at each time, shape (4, 3)."""
    law, (x, v) = MATERIALS[trial.material], sines(TIMES[-1])
    offset = trial.sensor != "true"
    return np.array(
        [cramer_rao_bound(law, x[:end], v[:end], NOISE, offset=offset)[:3] for end in ENDS]
    )


def rms(errors: ArrayLike) -> Floats:
    """Root mean square over seeds."""
    result: Floats = np.sqrt(np.mean(np.square(errors), axis=0))
    return result


def _measured(trial: Trial, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Return x, v and F as the sensor delivers them."""
    law = MATERIALS[trial.material]
    if trial.sensor == "chain":
        return _chain(trial.material, rng)
    x, v = sines(TIMES[-1])
    f = law.force(x, v) + noise(rng, len(x))
    if trial.sensor == "offset":
        f = f + rng.normal(0.0, 0.1)
    return x, v, f


def _chain(material: str, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """The paper's rig: quantised force and position, bias subtracted, velocity computed."""
    margin = 0.05  # s before and after, so that the filter is centred throughout
    duration = TIMES[-1] + 2.0 * margin
    depth, speed = sines(duration, start=-margin)
    inside = slice(round(margin * 1e3), round(margin * 1e3) + ENDS[-1])
    bias = rng.uniform(-1.0, 1.0)
    pause = _quantised(bias + noise(rng, PAUSE), FORCE_STEP).mean()
    true = MATERIALS[material].force(depth[inside], speed[inside])
    f = _quantised(true + bias + noise(rng, ENDS[-1]), FORCE_STEP) - pause
    phase = rng.uniform(-0.5, 0.5) * ENCODER_STEP  # of the encoder's steps relative to the surface
    x = _quantised(depth + phase, ENCODER_STEP)
    v = velocity_of(clock(duration) - margin, x, VELOCITY_WINDOW)
    return x[inside], v[inside], f


def _quantised(signal: Floats, step: float) -> Floats:
    result: Floats = np.round(signal / step) * step
    return result


DURATION = 20.0  # s
WITHIN = 0.05


#: What is known of the offset: the deviation it is drawn from, N, and the estimator's settings.
VARIANTS: dict[str, tuple[float, dict[str, Any]]] = {
    "no offset": (0.0, {"offset": False}),
    "offset known to 3 mN": (3e-3, {"offset_deviation": 3e-3}),
    "offset unknown": (0.1, {}),
}
METHOD = (
    "Worst over the seeds, s; true x and v, 0.05 N of noise, {duration:g} s. No offset: "
    "`offset=False`. Known to 3 mN: `offset_deviation=3e-3`, with an offset drawn from it. "
    "Unknown: `VariableProjection()`, with an offset drawn from N(0, (0.1 N)²). Last columns: the "
    "median, and the time from which twice the Cramér–Rao bound is below 5 %. The worst of 200 "
    "normal errors is near 2.8 bounds, so no unbiased method has its worst there. The default "
    "prior on the offset, twenty times the noise, is not in the bound: early on it contributes "
    "more than the samples."
)
BESIDE = (
    *(f"median {symbol}" for symbol in SYMBOLS),
    *(f"2 × bound {symbol}" for symbol in SYMBOLS),
)


def three_sines(workers: Workers) -> list[Group]:
    """Convergence time: three sines.

    How long until K, B and n are within 5 % and stay there?
    """
    limits = Limit(0.1), Limit(0.3), Limit(0.1)
    lines = [_line(workers, "ball", THREE_SINES, variant, limits) for variant in VARIANTS]
    return [_convergence("three sines", "", lines, f"{workers.seeds} seeds.")]


def one_sine(workers: Workers) -> list[Group]:
    """Convergence time: one sine.

    How long until K, B and n are within 5 % and stay there, with a single sine?
    """
    lines = [
        _line(workers, material, ONE_SINE, variant, (Limit(0.5),))
        for material in MATERIALS
        for variant in VARIANTS
    ]
    note = f"{workers.seeds} seeds. The paper's single stage: 500 s."
    return [_convergence("one sine", "x₀ + 1.8 sin 11t mm. ", lines, note)]


def _convergence(motion: str, along: str, lines: list[Line], note: str) -> Group:
    title, definition = f"Time into ±5 %, {motion}", along + METHOD.format(duration=DURATION)
    return Group(title, definition, SYMBOLS, lines, BESIDE, precision=".3f", notes=[note])


def _line(
    workers: Workers, material: str, motion: Motion, variant: str, limits: tuple[Limit, ...]
) -> Line:
    label = f"{material}, {variant}"
    times = np.array(workers.repeat(label, partial(_times, material, motion, variant)))
    beside = (*np.median(times, axis=0).tolist(), *_bound(material, motion, variant))
    return Line(label, tuple(times.max(axis=0).tolist()), limits, beside)


def _times(material: str, motion: Motion, variant: str, seed: int) -> Floats:
    """Return the seconds until K, B and n stay within 5 %; the duration if they do not."""
    law, rng = MATERIALS[material], np.random.default_rng(seed)
    x, v = sines(DURATION, motion)
    deviation, settings = VARIANTS[variant]
    f = law.force(x, v) + rng.normal(0.0, deviation) + noise(rng, len(x))
    trace = VariableProjection(**settings).replay(x, v, f)
    return last_outside(np.abs(trace.parameters / law.parameters - 1.0) > WITHIN)


def last_outside(outside: NDArray[np.bool_]) -> Floats:
    """Return the seconds until no sample of a column is outside any more."""
    reversed_first = np.argmax(outside[::-1], axis=0)
    samples = np.where(outside.any(axis=0), len(outside) - reversed_first, 0)
    return np.asarray(samples * SAMPLE_TIME, dtype=np.float64)


def _bound(material: str, motion: Motion, variant: str) -> tuple[float, ...]:
    """Return the seconds until twice the bound stays below 5 %."""
    law, settings = MATERIALS[material], VARIANTS[variant][1]
    columns = jacobian(law, *sines(DURATION, motion), offset=settings.get("offset", True))
    columns[:, :3] *= law.parameters
    information = np.cumsum(columns[:, :, None] * columns[:, None, :], axis=0) / NOISE**2
    if "offset_deviation" in settings:
        information[:, -1, -1] += settings["offset_deviation"] ** -2
    first = 10  # fewest samples for a valid inverse
    covariance = np.linalg.inv(information[first:])
    errors = np.sqrt(np.abs(np.diagonal(covariance, axis1=1, axis2=2)[:, :3]))
    late = last_outside(2.0 * errors > WITHIN) + first * SAMPLE_TIME
    return tuple(late.tolist())


FIVE = {
    "ball": BALL,
    "PVC": PVC,
    "metal": HuntCrossley(K=1e7, B=5e6, n=1.5),
    "gel": GEL,
    "low damping": HuntCrossley(K=3e4, B=600.0, n=1.5),
}
RATE = 1e3  # samples a second
POLES = {"AR(1) 0.9": 0.9, "AR(1) 0.98": 0.98, "AR(1) 0.95": 0.95}
LOW_PASS, PROPORTIONAL = "low-pass 50 Hz", "in proportion to force"
NOISES = ("white", "AR(1) 0.9", "AR(1) 0.98", LOW_PASS, "AR(1) 0.95", PROPORTIONAL)
PART = 0.02  # of the force
TOUCHES = "20 touches"  # the only motion of which samples at all depths count
BEFORE = 2000  # samples in which the start of a filter decays
LIGHTEST = 10.0 * NOISE  # N; below it noise, not depth, would determine contact


def bars(workers: Workers) -> list[Group]:
    """Coverage with correlated noise.

    How often do the 95 % intervals contain the truth where noise is correlated and contacts are
    short?
    """
    # A column covers five materials: a mean of so many contacts.
    of_mean, of_cell, of_ratio = Limit(100.0, 90.0), Limit(100.0, 85.0), Limit(1.1)
    lines, beside = [], []
    for motion in MOTIONS:
        for kind in NOISES:
            runs = [
                workers.repeat(f"{motion}, {kind}, {name}", partial(_contact, name, motion, kind))
                for name in FIVE
            ]
            # materials × seeds × (K, B, n, S, C, F₀)
            errors, deviations, white, plain = np.moveaxis(np.array(runs), 2, 0)
            if motion == TOUCHES:
                both = [np.sqrt((each[..., [2, 5]] ** 2).mean(axis=1)) for each in (errors, plain)]
                ratio = np.median(both[0] / both[1], axis=0)
                beside.append(Line(kind, tuple(ratio.tolist()), (of_ratio,)))
            errors, deviations, white = errors[..., :5], deviations[..., :5], white[..., :5]
            covered = 100.0 * (np.abs(errors) < 1.96 * deviations).mean(axis=1)
            ratios = np.sqrt((errors**2).mean(axis=1)) / np.median(white, axis=1)
            lines.append(
                Line(
                    f"{kind}, {motion}",
                    (float(covered.min()), *covered.mean(axis=0)),
                    (of_cell, of_mean),
                    tuple(
                        float(np.median(each[..., some]))
                        for some in (slice(3), slice(3, 5))
                        for each in (deviations / white, ratios)
                    ),
                )
            )
    return [
        Group(
            "Coverage of the 95 % interval by kind of noise",
            f"True x and v, noise of {NOISE:g} N (rms) or {PART:.0%} of the force, and an unknown "
            "offset, five materials; contact from the depth at which the spring force is "
            f"{LIGHTEST:g} N, of {TOUCHES} from the surface on; "
            "`VariableProjection()`, and the diagnosis's S and C at working depth. The last "
            "columns are the standard error and the rms error over the Cramér–Rao bound for white "
            "noise: of K, B and n, and of S and C.",
            ("lowest cell", *SYMBOLS, "S", "C"),
            lines,
            (
                "standard error / bound",
                "error / bound",
                "standard error / bound, S, C",
                "error / bound, S, C",
            ),
            precision=".3g",
            notes=[
                f"In %, mean of five materials, {workers.seeds} seeds each. The lowest cell is "
                "the smallest of twenty-five: five materials by five quantities."
            ],
        ),
        Group(
            "Touches through the surface, over plain least squares",
            f"The rms error of n and of the force offset of {TOUCHES} over that of unweighted "
            "least squares of all samples, free air included, with an unknown offset, to first "
            "order; median of five materials.",
            ("n", "offset"),
            beside,
            precision=".2f",
        ),
    ]


def _contact(material: str, motion: str, kind: str, seed: int) -> Floats:
    """Return errors of K, B, n, S, C and F₀, their s.e. and those of white noise, shape (4, 6).

    Last are the errors of plain least squares of all samples; of S and C 0.
    """
    law = FIVE[material]
    x, v = MOTIONS[motion]()
    where = list(FIVE).index(material), list(MOTIONS).index(motion), NOISES.index(kind)
    rng = np.random.default_rng([*where, seed])
    clean = law.force(x, v)
    noise = correlated(kind, rng, len(x))
    if kind == PROPORTIONAL:
        noise *= 0.1 + PART / NOISE * np.abs(clean)
    zero = rng.normal(0.0, 2.0 * NOISE)
    f = clean + noise + zero
    depth = (LIGHTEST / law.K) ** (1.0 / law.n) if motion != TOUCHES else 0.0
    estimator = VariableProjection(gate=ContactGate(minimum_penetration=depth))
    estimator.replay(x, v, f)
    estimate = estimator.estimate()
    contact = Contact(np.arange(len(x)) / RATE, penetration=x, velocity=v, force=f)
    result = identify(contact, estimator.replace())
    fit = Fit(FitInput(result.data or Data(contact), result.trace, result.estimate))
    numbers = [*estimate.parameters, *_felt(result.law, fit.depth), estimate.offset]
    bars = [*estimate.standard_errors, *standard_errors(fit)[1:], estimate.offset_standard_error]
    inside = x > depth
    slopes = jacobian(law, np.where(inside, x, 0.0), v, offset=True)
    size = np.linalg.norm(slopes, axis=0)
    plain = np.linalg.lstsq(slopes / size, noise, rcond=None)[0] / size
    inverse = inverse_information(slopes[inside].T @ slopes[inside])
    k, b, n = law.parameters
    power, log = fit.depth**n, np.log(fit.depth)
    by_stiffness = [n * power / fit.depth, 0.0, k * power / fit.depth * (1.0 + n * log), 0.0]
    by_damping = [0.0, power, b * power * log, 0.0]
    gradients = np.vstack([np.eye(3, 4), by_stiffness, by_damping, np.eye(4)[3]])
    white = NOISE * np.sqrt(np.einsum("ij,jk,ik->i", gradients, inverse, gradients))
    truth = [*law.parameters, *_felt(law, fit.depth), zero]
    of_plain = np.insert(plain, 3, [0.0, 0.0])
    return np.array([np.subtract(numbers, truth), bars, white, of_plain])


def _felt(law: HuntCrossley, depth: float) -> tuple[float, float]:
    return law.stiffness_at(depth), law.damping_at(depth)


def correlated(kind: str, rng: np.random.Generator, count: int) -> Floats:
    """Noise of :data:`NOISE` rms, N."""
    noise = rng.normal(0.0, NOISE, count + BEFORE)
    if kind in POLES:
        noise = autoregressive(noise, POLES[kind])
    if kind == LOW_PASS:
        taps = butter(2, 50.0, fs=RATE)
        impulse = np.zeros(BEFORE)
        impulse[0] = 1.0
        noise = lfilter(*taps, noise) / np.linalg.norm(lfilter(*taps, impulse))
    return np.asarray(noise[BEFORE:])


CLOCK = clock(10.0)
MOTIONS: dict[str, Callable[[], tuple[Floats, Floats]]] = {
    "10 s of three sines": lambda: sines(10.0),
    "13 taps": lambda: taps(CLOCK),
    # In and out again within a second, 10 mm deep.
    "1 s indentation": lambda: waves(CLOCK[:1000], 5e-3, [5e-3], [2.0 * np.pi], -0.5 * np.pi),
    # Through the surface and out again.
    TOUCHES: lambda: waves(CLOCK, 3e-3, (6e-3, 1e-3), (12.5, 1.7)),
}
