"""What least squares promises, for every estimator on every material."""

import dataclasses

import numpy as np
import pytest
from cases import KINDS, MATERIALS, OWN_MATERIAL, exciting
from twin import TWINS

import palpate
from palpate import ConstantForgetting, FadingForgetting, SelfPerturbation

# Units in which every entry of φ is near 1, and a weak prior.
SCALE = palpate.Scale(15e-3, 50e-3, 30.0)
PRIOR = 1e3
# The recursion squares the condition number of the data (about 1e2 here, times the prior's
# √P₀ = 32), so it is left with 16 − 2·3.5 digits.
TOLERANCE = 1e-9


def in_scaled_units(signals):
    return (
        signals.penetration / SCALE.penetration,
        signals.velocity / SCALE.velocity,
        signals.force / SCALE.force,
    )


def batch(rows, outputs, start, prior):
    """Least squares of the rows and, as further rows, the start."""
    deviation = np.sqrt(prior)
    rows = np.vstack([rows, np.diag(1.0 / deviation)])
    return np.linalg.lstsq(rows, np.concatenate([outputs, start / deviation]), rcond=None)[0]


def plain(kind, **settings):
    """Without forgetting."""
    without = ConstantForgetting(1.0)
    return kind(**{"scale": SCALE, "initial_covariance": PRIOR, "forgetting": without, **settings})


@pytest.mark.parametrize("name", ["kelvin-voigt", "extended-kelvin-voigt", "single-stage"])
def test_without_forgetting_an_estimator_is_batch_least_squares(name, noisy):
    estimator = plain(KINDS[name])
    estimator.replay(*noisy.arrays)
    x, v, force = in_scaled_units(noisy)
    columns, outputs = {
        "kelvin-voigt": ([x, v], force),
        "extended-kelvin-voigt": ([x, x**2, v], force),
        "single-stage": ([np.ones_like(x), v, np.log(x)], np.log(force)),
    }[name]
    units = SCALE.penetration, SCALE.velocity, SCALE.force
    start = TWINS[name].to_theta(estimator.settings["initial"].parameters, units)
    theta = batch(np.column_stack(columns), outputs, start, np.full(len(start), PRIOR))
    expected = TWINS[name].to_law(theta, units)
    np.testing.assert_allclose(estimator.estimate().parameters, expected, rtol=TOLERANCE)


def test_the_first_stage_at_a_known_exponent_is_batch_least_squares(noisy):
    exponent = 1.3
    estimator = plain(
        palpate.DoubleStageRLS,
        initial=palpate.HuntCrossley(1.0, 0.0, exponent),
        initial_covariance=(PRIOR, PRIOR, 1e-20),
    )
    estimator.replay(*noisy.arrays)
    x, v, force = in_scaled_units(noisy)
    unit = np.array([1.0, SCALE.velocity]) * SCALE.penetration**exponent / SCALE.force
    rows = np.column_stack([x**exponent, x**exponent * v])
    theta = batch(rows, force, np.array([1.0, 0.0]) * unit, np.full(2, PRIOR))
    law = estimator.estimate().law
    np.testing.assert_allclose([law.stiffness, law.damping], theta / unit, rtol=TOLERANCE)
    assert law.exponent == pytest.approx(exponent, rel=1e-12)  # 1e3 rows weigh 1e-17 against it


def test_the_second_stage_at_a_known_stiffness_is_batch_least_squares(material):
    start = palpate.HuntCrossley(1500.0, 900.0, 1.2)
    signals = exciting(material, noise=0.05, seed=7)
    covariance = (1e-20, 1e-20, PRIOR)
    estimator = plain(
        palpate.DoubleStageRLS, initial=start, initial_covariance=covariance, scale=None
    )
    estimator.replay(*signals.arrays)
    rate = start.stiffness + start.damping * signals.velocity
    rows = np.log(signals.penetration)[:, None]
    exponent = batch(rows, np.log(signals.force / rate), [start.exponent], np.array([PRIOR]))
    assert estimator.estimate().law.exponent == pytest.approx(exponent[0], rel=TOLERANCE)


def test_the_last_sample_weighs_most_where_the_past_is_forgotten():
    signals = exciting(MATERIALS["linear"], noise=0.05, seed=8)
    factor = 0.99
    estimator = plain(palpate.KelvinVoigtRLS, forgetting=ConstantForgetting(factor))
    estimator.replay(*signals.arrays)
    x, v, force = in_scaled_units(signals)
    weight = factor ** (0.5 * np.arange(len(signals) - 1, -1, -1))
    rows = np.column_stack([x, v]) * weight[:, None]
    theta = np.linalg.lstsq(rows, force * weight, rcond=None)[0]
    unit = np.array([SCALE.penetration, SCALE.velocity]) / SCALE.force
    # The start is left out here: 0.99^1000 / P₀ of it is left, 4e-8, before division by the data's.
    np.testing.assert_allclose(estimator.estimate().parameters, theta / unit, rtol=1e-6)


@pytest.mark.parametrize("perturbation", [None, SelfPerturbation()], ids=["calm", "perturbed"])
def test_the_covariance_is_always_symmetric_and_positive_definite(kind, broken, perturbation):
    estimator = kind(scale=SCALE, perturbation=perturbation, forgetting=ConstantForgetting(0.98))
    for k, row in enumerate(broken.rows):
        estimator.update(*row)
        if k % 25:
            continue
        covariance = estimator.estimate().covariance
        assert np.array_equal(covariance, covariance.T)
        deviation = np.sqrt(np.diag(covariance))
        assert np.all(deviation > 0.0)
        assert np.linalg.eigvalsh(covariance / np.outer(deviation, deviation)).min() > 0.0


def truth_of(name):
    """Of a single stage ln(1 + b v) is b v to first order only: without damping, exact."""
    truth = OWN_MATERIAL[name]
    return dataclasses.replace(truth, damping=0.0) if name == "single-stage" else truth


def off(parameters, truth):
    """How far off, as a part of each; of a damping that is 0, of the stiffness."""
    reference = np.where(truth.parameters == 0.0, truth.parameters[0], truth.parameters)
    return np.max(np.abs(parameters - truth.parameters) / reference)


@pytest.mark.parametrize("name", KINDS)
def test_the_truth_stays_put_as_a_start_and_comes_back_from_any_other(name):
    truth = truth_of(name)
    signals = exciting(truth, seconds=2.0)
    trace = KINDS[name](initial=truth).replay(*signals.arrays)
    # F is rounded at ε F; the largest gain, that of the first samples, makes some 1e2 of it.
    assert off(trace.parameters, truth) < 1e-12
    np.testing.assert_allclose(trace.predicted_force, signals.force, rtol=1e-12)
    estimator = KINDS[name](scale=SCALE, forgetting=ConstantForgetting(1.0))
    estimator.replay(*signals.arrays)
    # What is left is the start's weight, 1/(P₀ Σφ²), up to 1/(1e3 × 20) for the single stage.
    if name != "double-stage":
        assert off(estimator.estimate().parameters, truth) < 1e-3


def test_a_faded_forgetting_ends_as_plain_least_squares():
    """λ → 1: ten time constants after contact a sample is never forgotten again."""
    signals = exciting(MATERIALS["linear"], seconds=3.0, noise=0.05, seed=9)
    fading = palpate.KelvinVoigtRLS(forgetting=FadingForgetting(0.99, 5.0))
    fading.replay(*signals[:2000].arrays)
    errors = fading.estimate().standard_errors
    fading.replay(*signals[2000:].arrays)
    # Σφφᵀ grows by about half; with λ = 0.99 the errors would stay where they are.
    assert np.all(fading.estimate().standard_errors < 0.95 * errors)
