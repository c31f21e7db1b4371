"""Error bars hold where the noise is correlated and the contact short."""

import numpy as np
import pytest
from probing import MATERIALS, NOISE, PVC, Motion, coloured, contact_of, fed, sines, three_sines
from scipy.stats import binom

from palpate import (
    ConstantForgetting,
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


@pytest.mark.parametrize(
    "law, motion, memory, seeds",
    [
        *((PVC, INDENTATION, memory, 100) for memory in (0.9, 0.98)),
        *(
            pytest.param(law, motion, memory, 200, marks=pytest.mark.slow)
            for law in MATERIALS.values()
            for motion in (INDENTATION, three_sines(10.0))
            for memory in (0.0, 0.9, 0.98)
        ),
    ],
)
def test_correlated_noise_is_covered(law, motion: Motion, memory: float, seeds: int) -> None:
    deep = ContactGate(minimum_penetration=(10.0 * NOISE / law.stiffness) ** (1.0 / law.exponent))
    hits = np.zeros(3)  # of the intervals of K, B and n
    for seed in range(seeds):
        force = law.force(motion.x, motion.v) + coloured(len(motion), seed, memory=memory)
        estimate = fed(VariableProjection(gate=deep), motion, force).estimate()
        hits += np.abs(estimate.parameters - law.parameters) < 1.96 * estimate.standard_errors
    assert (hits >= binom.ppf(1e-3, seeds, LEAST)).all()


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
        found = identify(contact_of(motion, force), method)
        error = np.abs(found.estimate.parameters - law.parameters)
        own += error < 1.96 * found.estimate.standard_errors
        held += error < 1.96 * found.standard_errors
    assert (held >= binom.ppf(1e-3, seeds, LEAST)).all()
    # The recursion's own take the noise for white.
    assert own.min() < 70


def test_identification_leaves_the_bars_of_variable_projection_as_they_are() -> None:
    motion = three_sines(1.0)
    force = PVC.force(motion.x, motion.v) + coloured(len(motion), 1)
    found = identify(contact_of(motion, force))
    assert np.array_equal(found.standard_errors, found.estimate.standard_errors)
