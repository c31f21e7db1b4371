"""What least squares promises, for every estimator on every material."""

import numpy as np
import pytest
from cases import KINDS, exciting
from twin import TWINS

import palpate
from palpate import ConstantForgetting

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
