"""Error bars hold where the noise is correlated and the contact short."""

import numpy as np
import pytest
from probing import MATERIALS, NOISE, PVC, Motion, coloured, fed, sines, three_sines
from scipy.stats import binom

from palpate import (
    ConstantForgetting,
    Contact,
    ContactGate,
    HuntCrossley,
    KelvinVoigt,
    VariableProjection,
    identify,
)
from palpate.design import Motion as Planned

# What the benchmark `bars` holds itself to for a cell; a count below it that a true 85 % has once
# in a thousand fails.
LEAST = 0.85
INDENTATION = sines(1.0, Planned(5e-3, (5e-3,), (2.0 * np.pi,)))


def covered(law: HuntCrossley, motion: Motion, memory: float, seeds: int, **settings) -> np.ndarray:
    """How often the intervals of K, B and n hold the truth."""
    deep = ContactGate(minimum_penetration=(10.0 * NOISE / law.stiffness) ** (1.0 / law.exponent))
    hits = np.zeros(3)
    for seed in range(seeds):
        estimator = VariableProjection(gate=deep, **settings)
        force = law.force(motion.x, motion.v) + coloured(len(motion), seed, memory=memory)
        estimator.replay(motion.x, motion.v, force)
        estimate = estimator.estimate()
        hits += np.abs(estimate.parameters - law.parameters) < 1.96 * estimate.standard_errors
    return hits


@pytest.mark.parametrize("memory", [0.9, 0.98])
def test_a_second_of_correlated_noise_is_covered(memory: float) -> None:
    hits = covered(PVC, INDENTATION, memory, 100)
    assert (hits >= binom.ppf(1e-3, 100, LEAST)).all()


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.9, 0.98])
@pytest.mark.parametrize("motion", [INDENTATION, three_sines(10.0)], ids=["1 s", "10 s"])
@pytest.mark.parametrize("name", MATERIALS)
def test_correlated_noise_is_covered_whatever_the_material(
    name: str, motion: Motion, memory: float
) -> None:
    hits = covered(MATERIALS[name], motion, memory, 200)
    assert (hits >= binom.ppf(1e-3, 200, LEAST)).all()


def test_bars_under_forgetting_are_those_of_the_memory() -> None:
    """The latest thousand of ten thousand samples is remembered."""
    motion = three_sines(10.0)
    force = PVC.force(motion.x, motion.v) + coloured(len(motion), 3, memory=0.9)
    whole = fed(VariableProjection(), motion, force).estimate()
    forgetting = VariableProjection(forgetting=ConstantForgetting(0.999))
    recent = fed(forgetting, motion, force).estimate()
    ratio = recent.standard_errors / whole.standard_errors
    # √(10000/1000) = 3.2, times how unlike the latest second is to ten.
    assert (ratio > 2.0).all()
    assert (ratio < 20.0).all()


@pytest.mark.parametrize(
    "method, law",
    [
        ("kelvin-voigt", KelvinVoigt(2000.0, 20.0)),
        # Where condition 10 holds, it is the least squares of ln F.
        ("single-stage", HuntCrossley(2000.0, 20.0, 1.0)),
    ],
)
def test_identification_widens_the_bars_of_the_papers_methods(
    method: str, law: HuntCrossley | KelvinVoigt
) -> None:
    motion, seeds = three_sines(5.0), 100
    own, held = np.zeros(len(law.parameters)), np.zeros(len(law.parameters))
    for seed in range(seeds):
        force = law.force(motion.x, motion.v) + coloured(len(motion), seed, memory=0.9)
        found = identify(
            Contact(motion.time, penetration=motion.x, velocity=motion.v, force=force), method
        )
        error = np.abs(found.estimate.parameters - law.parameters)
        own += error < 1.96 * found.estimate.standard_errors
        held += error < 1.96 * found.standard_errors
    assert (held >= binom.ppf(1e-3, seeds, LEAST)).all()
    # The recursion's own take the noise for white.
    assert own.min() < 70


def test_identification_leaves_the_bars_of_variable_projection_as_they_are() -> None:
    motion = three_sines(1.0)
    force = PVC.force(motion.x, motion.v) + coloured(len(motion), 1)
    found = identify(Contact(motion.time, penetration=motion.x, velocity=motion.v, force=force))
    assert np.array_equal(found.standard_errors, found.estimate.standard_errors)
