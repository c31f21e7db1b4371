"""Twenty seconds of probing under a sensor: errors against the Cramér–Rao bound, and coverage."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.accuracy.probing import MATERIALS, NOISE, Floats, feed, noise, sines
from palpate import Scale, SingleStageRLS, VariableProjection
from palpate.design.precision import cramer_rao_bound
from palpate.preparation.velocity import velocity_of

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


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Errors of K, B and n at each time, shape (4, 3), and whether the 95 % intervals hold."""

    errors: Floats
    covered: Floats
    single_stage: Floats


def run(trial: Trial, seed: int) -> Outcome:
    """One seed of a trial."""
    law = MATERIALS[trial.material]
    x, v, f = _measured(trial, np.random.default_rng(seed))
    estimator = VariableProjection(
        offset=trial.sensor != "true",
        offset_deviation=trial.offset_deviation,
        surface_deviation=trial.surface_deviation,
        # An error of the surface looks like an offset, scaled by the stiffness.
        scale=Scale(10e-3, 20e-3, law.force(10e-3, 0.0)) if trial.surface_deviation else None,
    )
    errors, covered = np.empty((2, len(ENDS), 3))
    single = np.full((len(ENDS), 3), np.nan)
    for i, estimate in enumerate(feed(estimator, x, v, f, ENDS)):
        errors[i] = estimate.parameters - law.parameters
        covered[i] = np.abs(errors[i]) < 1.96 * estimate.standard_errors
    if trial.single_stage:
        for i, estimate in enumerate(feed(SingleStageRLS(), x, v, f, ENDS)):
            single[i] = estimate.parameters - law.parameters
    return Outcome(errors, covered, single)


def bounds(trial: Trial) -> Floats:
    """Return the Cramér–Rao bound of K, B and n at each time, shape (4, 3)."""
    law, motion = MATERIALS[trial.material], sines(TIMES[-1])
    return np.array(
        [
            cramer_rao_bound(
                law,
                motion.penetration[:end],
                motion.velocity[:end],
                NOISE,
                offset=trial.sensor != "true",
            )[:3]
            for end in ENDS
        ]
    )


def rms(errors: Sequence[Floats]) -> Floats:
    """Root mean square over seeds."""
    result: Floats = np.sqrt(np.mean(np.square(errors), axis=0))
    return result


def _measured(trial: Trial, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Return x, v and F as the sensor delivers them."""
    law = MATERIALS[trial.material]
    if trial.sensor == "chain":
        return _chain(trial.material, rng)
    motion = sines(TIMES[-1])
    f = law.force(motion.penetration, motion.velocity) + noise(rng, len(motion.time))
    if trial.sensor == "offset":
        f = f + rng.normal(0.0, 0.1)
    return motion.penetration, motion.velocity, f


def _chain(material: str, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """The paper's rig: quantised force and position, bias subtracted, velocity computed."""
    margin = 0.05  # s before and after, so that the filter is centred throughout
    motion = sines(TIMES[-1] + 2.0 * margin, start=-margin)
    inside = slice(round(margin * 1e3), round(margin * 1e3) + ENDS[-1])
    bias = rng.uniform(-1.0, 1.0)
    pause = _quantised(bias + noise(rng, PAUSE), FORCE_STEP).mean()
    true = MATERIALS[material].force(motion.penetration[inside], motion.velocity[inside])
    f = _quantised(true + bias + noise(rng, ENDS[-1]), FORCE_STEP) - pause
    phase = rng.uniform(-0.5, 0.5) * ENCODER_STEP  # of the encoder's steps relative to the surface
    x = _quantised(motion.penetration + phase, ENCODER_STEP)
    v = velocity_of(motion.time, x, VELOCITY_WINDOW)
    return x[inside], v[inside], f


def _quantised(signal: Floats, step: float) -> Floats:
    result: Floats = np.round(signal / step) * step
    return result
