"""Whether error bars hold where noise is correlated and contacts are short."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import BALL, NOISE, PVC, SYMBOLS, Floats, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import ContactGate, HuntCrossley, VariableProjection

MATERIALS = {
    "ball": BALL,
    "PVC": PVC,
    "metal": HuntCrossley(1e7, 5e6, 1.5),
    "gel": HuntCrossley(5e4, 1.5e5, 2.2),
    "low damping": HuntCrossley(3e4, 600.0, 1.5),
}
RATE = 1e3  # samples a second
POLES = {"AR(1) 0.9": 0.9, "AR(1) 0.98": 0.98}
LOW_PASS = "low-pass 50 Hz"
NOISES = ("white", *POLES, LOW_PASS)
BEFORE = 2000  # samples in which a filter forgets how it began
LIGHTEST = 10.0 * NOISE  # N; below it noise, not depth, would say what is contact


def bars(campaign: Campaign) -> list[Group]:
    # A column is of five materials: as a mean of so many contacts.
    of_mean, of_cell = Limit(100.0, 90.0), Limit(100.0, 85.0)
    lines = []
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
            errors, deviations, white = np.moveaxis(cells, 2, 0)  # materials × seeds × (K, B, n)
            covered = 100.0 * (np.abs(errors) < 1.96 * deviations).mean(axis=1)
            wider = float(np.median(deviations / white))
            needed = float(np.median(np.sqrt((errors**2).mean(axis=1)) / np.median(white, axis=1)))
            lines.append(
                Line(
                    f"{kind}, {motion}",
                    (*covered.mean(axis=0), float(covered.min())),
                    (of_mean, of_mean, of_mean, of_cell),
                    (wider, needed),
                )
            )
    return [
        Group(
            "Coverage of the 95 % interval, whatever the noise",
            f"True x and v, noise of {NOISE:g} N (rms) and an unknown offset, five materials; "
            f"contact from the depth at which the spring gives {LIGHTEST:g} N; "
            "`VariableProjection()`. Beside it the standard error and the error (rms), over the "
            "standard error that white noise would leave (Cramér–Rao).",
            (*SYMBOLS, "lowest cell"),
            lines,
            ("bar / white", "error / white"),
            precision=".3g",
            notes=[
                f"%, mean of five materials, {campaign.seeds} seeds each. The lowest cell is the "
                "least of fifteen, a material and a parameter each."
            ],
        )
    ]


def _contact(material: str, motion: str, kind: str, seed: int) -> Floats:
    """Errors of K, B and n, their standard errors, and those of white noise; shape (3, 3)."""
    law = MATERIALS[material]
    x, v = MOTIONS[motion]()
    where = list(MATERIALS).index(material), list(MOTIONS).index(motion), NOISES.index(kind)
    rng = np.random.default_rng([*where, seed])
    f = law.force(x, v) + correlated(kind, rng, len(x)) + rng.normal(0.0, 2.0 * NOISE)
    depth = (LIGHTEST / law.stiffness) ** (1.0 / law.exponent)
    estimator = VariableProjection(gate=ContactGate(minimum_penetration=depth))
    estimator.replay(x, v, f)
    estimate = estimator.estimate()
    inside = x > depth
    slopes = law.parameter_gradient(x[inside], v[inside])
    slopes = np.column_stack([slopes, np.ones(len(slopes))])
    size = np.linalg.norm(slopes, axis=0)
    white = NOISE * np.sqrt(np.diag(np.linalg.inv((slopes / size).T @ (slopes / size)))) / size
    return np.array([estimate.parameters - law.parameters, estimate.standard_errors, white[:3]])


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


MOTIONS: dict[str, Callable[[], tuple[Floats, Floats]]] = {
    "10 s of three sines": _sines,
    "13 taps": _taps,
    "1 s indentation": _indentation,
}
