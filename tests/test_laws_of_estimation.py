"""What least squares promises, for every estimator on every material."""

import numpy as np
import pytest
from cases import KINDS, MATERIALS, OWN_MATERIAL, exciting

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
    return kind(
        **{
            "scale": SCALE,
            "initial_covariance": PRIOR,
            "forgetting": ConstantForgetting(1.0),
            **settings,
        }
    )


def test_kelvin_voigt_without_forgetting_is_batch_least_squares(noisy):
    estimator = plain(palpate.KelvinVoigtRLS)
    estimator.replay(*noisy.arrays)
    x, v, force = in_scaled_units(noisy)
    unit = np.array([SCALE.penetration, SCALE.velocity]) / SCALE.force
    start = estimator.settings["initial"].parameters * unit
    theta = batch(np.column_stack([x, v]), force, start, np.full(2, PRIOR))
    np.testing.assert_allclose(estimator.estimate().parameters, theta / unit, rtol=TOLERANCE)


def test_extended_kelvin_voigt_without_forgetting_is_batch_least_squares(noisy):
    estimator = plain(palpate.ExtendedKelvinVoigtRLS)
    estimator.replay(*noisy.arrays)
    x, v, force = in_scaled_units(noisy)
    unit = np.array([SCALE.penetration, SCALE.penetration**2, SCALE.velocity]) / SCALE.force
    start = estimator.settings["initial"].parameters * unit
    theta = batch(np.column_stack([x, x**2, v]), force, start, np.full(3, PRIOR))
    np.testing.assert_allclose(estimator.estimate().parameters, theta / unit, rtol=TOLERANCE)


def test_the_single_stage_without_forgetting_is_batch_least_squares_of_the_logarithm(noisy):
    estimator = plain(palpate.SingleStageRLS)
    estimator.replay(*noisy.arrays)
    x, v, force = in_scaled_units(noisy)
    rows = np.column_stack([np.ones_like(x), v, np.log(x)])
    law = estimator.settings["initial"]
    start = np.array([np.log(law.stiffness * SCALE.penetration / SCALE.force), 0.0, law.exponent])
    theta = batch(rows, np.log(force), start, np.full(3, PRIOR))
    stiffness = np.exp(theta[0]) * SCALE.force / SCALE.penetration ** theta[2]
    expected = [stiffness, stiffness * theta[1] / SCALE.velocity, theta[2]]
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
    estimator = palpate.DoubleStageRLS(
        initial=start,
        initial_covariance=(1e-20, 1e-20, PRIOR),
        forgetting=ConstantForgetting(1.0),
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
    theta = np.linalg.lstsq(np.column_stack([x, v]) * weight[:, None], force * weight, rcond=None)[
        0
    ]
    unit = np.array([SCALE.penetration, SCALE.velocity]) / SCALE.force
    # The start is left out here: 0.99^1000 / P₀ of it is left, 4e-8, before division by the data's.
    np.testing.assert_allclose(estimator.estimate().parameters, theta / unit, rtol=1e-6)


PERTURBATIONS = [None, SelfPerturbation()]


@pytest.mark.parametrize("perturbation", PERTURBATIONS, ids=["unperturbed", "self-perturbed"])
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


@pytest.mark.parametrize("name", KINDS)
def test_the_truth_as_a_start_stays_put_on_clean_data(name):
    truth = OWN_MATERIAL[name]
    if name == "single-stage":  # ln(1 + b v) is b v to first order only: without damping, exact
        truth = palpate.HuntCrossley(truth.stiffness, 0.0, truth.exponent)
    signals = exciting(truth)
    estimator = KINDS[name](initial=truth)
    trace = estimator.replay(*signals.arrays)
    # F is rounded at ε F; the largest gain, that of the first samples, makes some 1e2 of it.
    reference = np.where(truth.parameters == 0.0, truth.parameters[0], truth.parameters)
    assert np.max(np.abs(trace.parameters - truth.parameters) / reference) < 1e-12
    np.testing.assert_allclose(trace.predicted_force, signals.force, rtol=1e-12)


@pytest.mark.parametrize("name", [n for n in KINDS if n != "double-stage"])
def test_clean_data_of_its_own_law_give_the_truth_back(name):
    truth = OWN_MATERIAL[name]
    if name == "single-stage":
        truth = palpate.HuntCrossley(truth.stiffness, 0.0, truth.exponent)
    estimator = KINDS[name](scale=SCALE, forgetting=ConstantForgetting(1.0))
    estimator.replay(*exciting(truth, seconds=2.0).arrays)
    # What is left is the start's weight, 1/(P₀ Σφ²), up to 1/(1e3 × 20) for the single stage.
    reference = np.where(truth.parameters == 0.0, truth.parameters[0], truth.parameters)
    error = np.abs(estimator.estimate().parameters - truth.parameters) / reference
    assert error.max() < 1e-3


def test_a_faded_forgetting_ends_as_plain_least_squares():
    """λ → 1: ten time constants after contact a sample is never forgotten again."""
    signals = exciting(MATERIALS["linear"], seconds=3.0, noise=0.05, seed=9)
    fading = palpate.KelvinVoigtRLS(forgetting=FadingForgetting(0.99, 5.0))
    fading.replay(*signals[:2000].arrays)
    errors = fading.estimate().standard_errors
    fading.replay(*signals[2000:].arrays)
    # Σφφᵀ grows by about half; with λ = 0.99 the errors would stay where they are.
    assert np.all(fading.estimate().standard_errors < 0.95 * errors)
