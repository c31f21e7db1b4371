"""Simulated probing for the tests of variable projection: materials, motions, sensors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from palpate import ContactEstimator, HuntCrossley

SAMPLE_TIME = 1e-3
NOISE = 0.05  # N, the noise band of the paper's sensor

BALL = HuntCrossley(2000.0, 2000.0, 1.0)
SPONGE = HuntCrossley(300.0, 3000.0, 1.0)
PVC = HuntCrossley(1e5, 2e5, 2.0)
INCLUSION = HuntCrossley(3e5, 3e5, 2.0)
WELL_EXCITED = {"ball": BALL, "pvc": PVC, "sponge": SPONGE}
MATERIALS = {**WELL_EXCITED, "inclusion": INCLUSION}

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Penetration [m] and velocity [m/s] every ``SAMPLE_TIME``."""

    x: Floats
    v: Floats

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, part: slice) -> "Motion":
        return Motion(self.x[part], self.v[part])

    @property
    def time(self) -> Floats:
        return SAMPLE_TIME * np.arange(len(self))


def sines(seconds: float, amplitudes: dict[float, float], middle: float = 10e-3) -> Motion:
    """A sum of sines, {rad/s: m}, around a middle depth."""
    t = SAMPLE_TIME * np.arange(round(seconds / SAMPLE_TIME))
    x = middle + sum(a * np.sin(w * t) for w, a in amplitudes.items())
    v = sum(a * w * np.cos(w * t) for w, a in amplitudes.items())
    return Motion(np.asarray(x), np.asarray(v))


def three_sines(seconds: float) -> Motion:
    """The paper's motion."""
    return sines(seconds, {4.0: 1e-3, 11.0: 1.8e-3, 15.0: 1.8e-3})


def tapping(seconds: float, surface: float = 0.0, deepest: float = 12e-3) -> Motion:
    """Strokes of two depths between the free, 3 mm above the surface, and the material."""
    t = SAMPLE_TIME * np.arange(round(seconds / SAMPLE_TIME))
    w = 2.0 * np.pi * 0.7
    middle, swing = 0.5 * (deepest - 3e-3), 0.5 * (deepest + 3e-3)
    envelope = 1.0 - 0.25 * np.sin(0.37 * w * t) ** 2
    x = middle - swing * envelope * np.cos(w * t)
    return Motion(surface + x, np.gradient(x, SAMPLE_TIME))


def held(seconds: float, depth: float = 10e-3) -> Motion:
    count = round(seconds / SAMPLE_TIME)
    return Motion(np.full(count, depth), np.zeros(count))


def joined(*motions: Motion) -> Motion:
    return Motion(
        np.concatenate([part.x for part in motions]), np.concatenate([part.v for part in motions])
    )


def white(samples: int, seed: int, deviation: float = NOISE) -> Floats:
    return np.random.default_rng(seed).normal(0.0, deviation, samples)


def coloured(samples: int, seed: int, deviation: float = NOISE, memory: float = 0.98) -> Floats:
    """AR(1) noise of this deviation; ``memory`` is its correlation from sample to sample."""
    innovations = white(samples, seed, deviation * np.sqrt(1.0 - memory**2))
    noise = np.empty(samples)
    last = white(1, seed + 10_000, deviation)[0]
    for k, innovation in enumerate(innovations):
        noise[k] = last = memory * last + innovation
    return noise


def felt(law: HuntCrossley, motion: Motion, seed: int, offset: float = 0.0) -> Floats:
    """Force [N] that a sensor with white noise shows."""
    return law.force(motion.x, motion.v) + offset + white(len(motion), seed)


def relaxing(motion: Motion, stiffness: float = 300.0) -> Floats:
    """A sponge with a Maxwell branch (half its stiffness, 1 s), which no law here contains."""
    law = HuntCrossley(stiffness, stiffness, 1.0)
    branch = np.empty(len(motion))
    stretched = 0.5 * stiffness * motion.x[0]
    for k, v in enumerate(motion.v):
        branch[k] = stretched
        stretched += SAMPLE_TIME * (0.5 * stiffness * v - stretched)
    return law.force(motion.x, motion.v) + branch


def switched(before: HuntCrossley, after: HuntCrossley, motion: Motion, at: int) -> Floats:
    """Force [N], without noise, of a material that is another from sample ``at`` on."""
    first, second = before.force(motion.x, motion.v), after.force(motion.x, motion.v)
    return np.where(np.arange(len(motion)) < at, first, second)


def offline(
    motion: Motion, force: Floats, start: HuntCrossley, *, offset: bool, priors: bool = False
) -> HuntCrossley:
    """The same least squares by SciPy, started at the truth.

    In (ln k, b, n, F₀) with k the force at 10 mm: in (K, B, n) SciPy loses six digits. ``priors``
    adds the weak ones that variable projection documents: n ~ N(1.3, 1), 20 mm/s · b ~ N(0, 1) and
    F₀ ~ N(0, (20 σ)²).
    """
    depth = np.log(motion.x / 10e-3)
    k = np.log(start.stiffness) + start.exponent * np.log(10e-3)
    guess = [k, start.dissipation, start.exponent, *([0.0] if offset else [])]

    def residuals(p: Floats) -> Floats:
        fitted = np.exp(p[0] + p[2] * depth) * (1.0 + p[1] * motion.v)
        errors = fitted + (p[3] if offset else 0.0) - force
        if not priors:
            return errors
        weak = [NOISE * (p[2] - 1.3), NOISE * 20e-3 * p[1], *(p[3:] / 20.0)]
        return np.concatenate([errors, weak])

    fit = least_squares(residuals, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    stiffness = np.exp(fit.x[0] - fit.x[2] * np.log(10e-3))
    return HuntCrossley(stiffness, fit.x[1] * stiffness, fit.x[2])


def relative_error(law: HuntCrossley, truth: HuntCrossley) -> Floats:
    """Of (K, B, n)."""
    return np.abs(law.parameters / truth.parameters - 1.0)


def correlation(covariance: Floats) -> Floats:
    """A covariance scaled to a unit diagonal."""
    deviations = np.sqrt(np.diag(covariance))
    return covariance / np.outer(deviations, deviations)


def fed(estimator: ContactEstimator, motion: Motion, force: Floats) -> ContactEstimator:
    """The same estimator after these samples; without a trace, which would solve at every one."""
    for sample in zip(motion.x.tolist(), motion.v.tolist(), force.tolist(), strict=True):
        estimator.update(*sample)
    return estimator
