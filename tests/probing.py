"""Simulated probing for the tests of variable projection: the laboratory's, without its robot."""

from dataclasses import dataclass, replace

import numpy as np
from cases import THREE_SINES, Floats
from scipy.optimize import least_squares

from palpate import Contact, ContactEstimator, HuntCrossley, lab
from palpate.lab import design

SAMPLE_TIME = lab.Sensors().sample_time
NOISE = lab.Sensors().force_noise  # N

BALL, SPONGE, PVC, INCLUSION = (
    lab.MATERIALS[name].law for name in ("ball", "sponge", "pvc", "inclusion")
)
WELL_EXCITED = {"ball": BALL, "pvc": PVC, "sponge": SPONGE}
MATERIALS = {**WELL_EXCITED, "inclusion": INCLUSION}
STROKES = replace(lab.TAPPING, rate=0.7, pause=0.0)


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


def clock(seconds: float) -> Floats:
    return SAMPLE_TIME * np.arange(round(seconds / SAMPLE_TIME))


def sines(seconds: float, motion: design.Motion) -> Motion:
    """A planned motion, in the material from its first sample on."""
    return Motion(*motion.at(clock(seconds)))


def three_sines(seconds: float) -> Motion:
    """The paper's motion."""
    return sines(seconds, THREE_SINES)


def held(seconds: float, depth: float = 10e-3) -> Motion:
    return sines(seconds, design.Motion(depth))


def tapping(seconds: float, surface: float = 0.0) -> Motion:
    """Strokes of three depths from 3 mm above the surface."""
    command = STROKES.at(clock(seconds))
    return Motion(surface + command.penetration, command.velocity)


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


def contact_of(motion: Motion, force: Floats, **more) -> Contact:
    return Contact(motion.time, penetration=motion.x, velocity=motion.v, force=force, **more)


def relaxing(motion: Motion) -> Floats:
    """Force [N], without noise, of the lab's relaxing sponge, which no law here contains."""
    place = np.zeros(len(motion))
    return lab.RELAXING_SPONGE.force(motion.time, place, motion.x, motion.v)


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
    k = np.log(start.K) + start.n * np.log(10e-3)
    guess = [k, start.dissipation, start.n, *([0.0] if offset else [])]

    def residuals(p: Floats) -> Floats:
        fitted = np.exp(p[0] + p[2] * depth) * (1.0 + p[1] * motion.v)
        errors = fitted + (p[3] if offset else 0.0) - force
        if not priors:
            return errors
        weak = [NOISE * (p[2] - 1.3), NOISE * 20e-3 * p[1], *(p[3:] / 20.0)]
        return np.concatenate([errors, weak])

    fit = least_squares(residuals, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    stiffness = np.exp(fit.x[0] - fit.x[2] * np.log(10e-3))
    return HuntCrossley(K=stiffness, B=fit.x[1] * stiffness, n=fit.x[2])


def relative_error(law: HuntCrossley, truth: HuntCrossley) -> Floats:
    """Of (K, B, n)."""
    return np.abs(law.parameters / truth.parameters - 1.0)


def fed(estimator: ContactEstimator, motion: Motion, force: Floats) -> ContactEstimator:
    """The same estimator after these samples; without a trace, which would solve at every one."""
    estimator.replay(motion.x, motion.v, force, at=())
    return estimator
