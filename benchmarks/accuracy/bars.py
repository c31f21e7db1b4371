"""Whether error bars hold where noise is correlated and contacts are short."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import BALL, NOISE, PVC, SYMBOLS, Floats, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import Contact, ContactGate, HuntCrossley, VariableProjection, identify
from palpate.diagnosis import Data
from palpate.diagnosis.fit import Fit, FitInput, standard_errors

MATERIALS = {
    "ball": BALL,
    "PVC": PVC,
    "metal": HuntCrossley(1e7, 5e6, 1.5),
    "gel": HuntCrossley(5e4, 1.5e5, 2.2),
    "low damping": HuntCrossley(3e4, 600.0, 1.5),
}
RATE = 1e3  # samples a second
POLES = {"AR(1) 0.9": 0.9, "AR(1) 0.98": 0.98, "AR(1) 0.95": 0.95}
LOW_PASS, PROPORTIONAL = "low-pass 50 Hz", "in proportion to force"
NOISES = ("white", "AR(1) 0.9", "AR(1) 0.98", LOW_PASS, "AR(1) 0.95", PROPORTIONAL)
PART = 0.02  # of the force
TOUCHES = "20 touches"  # the only motion of which samples at all depths count
BEFORE = 2000  # samples in which the start of a filter decays
LIGHTEST = 10.0 * NOISE  # N; below it noise, not depth, would determine contact


def bars(campaign: Campaign) -> list[Group]:
    # A column covers five materials: a mean of so many contacts.
    of_mean, of_cell, of_ratio = Limit(100.0, 90.0), Limit(100.0, 85.0), Limit(1.1)
    lines, beside = [], []
    for motion in MOTIONS:
        for kind in NOISES:
            cells = np.array(
                [
                    campaign.map(
                        f"bars, {motion}, {kind}, {material}",
                        partial(_contact, material, motion, kind),
                        range(campaign.seeds),
                    )
                    for material in MATERIALS
                ]
            )
            # materials × seeds × (K, B, n, S, C, F₀)
            errors, deviations, white, plain = np.moveaxis(cells, 2, 0)
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
                f"In %, mean of five materials, {campaign.seeds} seeds each. The lowest cell is "
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
    law = MATERIALS[material]
    x, v = MOTIONS[motion]()
    where = list(MATERIALS).index(material), list(MOTIONS).index(motion), NOISES.index(kind)
    rng = np.random.default_rng([*where, seed])
    clean = law.force(x, v)
    noise = correlated(kind, rng, len(x))
    if kind == PROPORTIONAL:
        noise *= 0.1 + PART / NOISE * np.abs(clean)
    zero = rng.normal(0.0, 2.0 * NOISE)
    f = clean + noise + zero
    depth = (LIGHTEST / law.stiffness) ** (1.0 / law.exponent) if motion != TOUCHES else 0.0
    estimator = VariableProjection(gate=ContactGate(minimum_penetration=depth))
    estimator.replay(x, v, f)
    estimate = estimator.estimate()
    contact = Contact(np.arange(len(x)) / RATE, penetration=x, velocity=v, force=f)
    result = identify(contact, estimator.replace())
    fit = Fit(FitInput(result.data or Data(contact), result.trace, result.estimate))
    numbers = [*estimate.parameters, *_felt(result.law, fit.depth), estimate.offset]
    bars = [*estimate.standard_errors, *standard_errors(fit)[1:], estimate.offset_standard_error]
    inside = x > depth
    slopes = np.column_stack([np.zeros((len(x), 3)), np.ones(len(x))])
    slopes[inside, :3] = law.parameter_gradient(x[inside], v[inside])
    size = np.linalg.norm(slopes, axis=0)
    plain = np.linalg.lstsq(slopes / size, noise, rcond=None)[0] / size
    slopes = slopes[inside]
    inverse = np.linalg.inv((slopes / size).T @ (slopes / size)) / np.outer(size, size)
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
        pole = POLES[kind]
        noise = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], noise)
    if kind == LOW_PASS:
        taps = butter(2, 50.0, fs=RATE)
        impulse = np.zeros(BEFORE)
        impulse[0] = 1.0
        noise = lfilter(*taps, noise) / np.linalg.norm(lfilter(*taps, impulse))
    return np.asarray(noise[BEFORE:])


def _sines() -> tuple[Floats, Floats]:
    motion = sines(10.0)
    return motion.penetration, motion.velocity


def _indentation() -> tuple[Floats, Floats]:
    """In and out again within a second, 10 mm deep."""
    turn = 2.0 * np.pi * np.arange(0.0, 1.0, 1.0 / RATE)
    return 5e-3 * (1.0 - np.cos(turn)), 5e-3 * 2.0 * np.pi * np.sin(turn)


def _taps() -> tuple[Floats, Floats]:
    """Thirteen taps of 8 to 10 mm in ten seconds."""
    t = np.arange(0.0, 10.0, 1.0 / RATE)
    x = -3e-3 + 12e-3 * np.sin(8.2 * t) + 1.5e-3 * np.sin(1.7 * t)
    return x, 12e-3 * 8.2 * np.cos(8.2 * t) + 1.5e-3 * 1.7 * np.cos(1.7 * t)


def _touches() -> tuple[Floats, Floats]:
    """Through the surface and out again, twenty times in ten seconds."""
    t = np.arange(0.0, 10.0, 1.0 / RATE)
    x = 3e-3 + 6e-3 * np.sin(12.5 * t) + 1e-3 * np.sin(1.7 * t)
    return x, 75e-3 * np.cos(12.5 * t) + 1.7e-3 * np.cos(1.7 * t)


MOTIONS: dict[str, Callable[[], tuple[Floats, Floats]]] = {
    "10 s of three sines": _sines,
    "13 taps": _taps,
    "1 s indentation": _indentation,
    TOUCHES: _touches,
}
