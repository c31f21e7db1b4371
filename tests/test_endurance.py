"""Long without excitation: forgetting must not wind the covariance up (methods, section 3)."""

import numpy as np
import pytest
from cases import KINDS, ONE_SINE, OWN_MATERIAL, exciting

import palpate
from palpate import ConstantForgetting

pytestmark = pytest.mark.long

CHUNK = 1_000_000
NOISE = 1e-3  # of each signal's size


def assert_definite(estimator) -> None:
    estimate = estimator.estimate()
    deviation = estimate.standard_errors
    assert np.linalg.eigvalsh(estimate.covariance / np.outer(deviation, deviation)).min() > 0.0


@pytest.mark.parametrize("chunks", [1, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_millions_of_samples_held_at_constant_penetration_stay_sound(kind, noise, chunks):
    """At 10 mm and 20 N; the noise is relative, on velocity to 50 mm/s."""
    white = noise * np.random.default_rng(0).standard_normal((3, CHUNK))
    signals = 10e-3 * (1.0 + white[0]), 50e-3 * white[1], 20.0 * (1.0 + white[2])
    estimator = kind(forgetting=ConstantForgetting(0.99))
    for _ in range(chunks):
        trace = estimator.replay(*signals)
        assert np.isfinite(trace.parameters).all()
        assert np.isfinite(trace.standard_errors).all()
        assert trace.taken.all()
        assert_definite(estimator)
        # Whatever else it lost, the law still passes through the point it is held at.
        assert estimator.predict(10e-3, 0.0) == pytest.approx(20.0, rel=5.0 * NOISE)
    assert estimator.estimate().samples == chunks * CHUNK
    if noise == 0.0:  # nothing but the guard can have saved it: 709 / 0.01 samples overflow
        assert estimator.estimate().guarded > 0.9 * chunks * CHUNK


@pytest.mark.parametrize("name", KINDS)
def test_endless_forgetting_on_one_sine_stays_finite(name):
    law = OWN_MATERIAL[name]
    signals = exciting(law, seconds=100.0, noise=0.01, seed=1, motion=ONE_SINE)
    estimator = KINDS[name](
        forgetting=ConstantForgetting(0.95), scale=palpate.Scale(15e-3, 0.05, 30)
    )
    trace = estimator.replay(*signals.arrays)
    assert np.isfinite(trace.parameters).all()
    assert np.isfinite(trace.standard_errors).all()
    assert_definite(estimator)
    # 20 samples' memory and up to 3 parameters: the prediction error is the noise and its
    # √(p/20) more, beside at most 2 % of 11 N of the logarithm's own.
    error = (trace.predicted_force - signals.force)[1000:]
    assert np.sqrt(np.mean(error**2)) < 0.25
