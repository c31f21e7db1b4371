"""The information of a motion, against derivatives and fits that know nothing of its formulas."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime, least_squares

from palpate import ExtendedKelvinVoigt, HuntCrossley, InvalidParameterError, KelvinVoigt, lab
from palpate.design.excitation import cramer_rao_bound, fisher_information, sensitivity
from palpate.design.motion import PAPER_MOTION

LAWS = [
    KelvinVoigt(900.0, 12.0),
    ExtendedKelvinVoigt(500.0, 4e4, 9.0),
    lab.BALL.law,
    lab.PVC.law,
    HuntCrossley(300.0, 3000.0, 1.3),
]
SOFT = HuntCrossley(300.0, 900.0, 1.3)
PERIOD = 2.0 * np.pi  # of sines of 4, 11 and 15 rad/s


def paper_motion(duration=5.0, step=1e-2):
    return PAPER_MOTION.sampled(duration, step)[1:]


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_a_sensitivity_is_the_derivative_of_the_force(law):
    x, v = paper_motion()

    def force(parameters):
        return type(law)(*parameters).force(x, v)

    numerical = approx_fprime(law.parameters, force, 1.5e-8 * law.parameters)
    error = np.abs(sensitivity(law, x, v) - numerical).max(axis=0)
    # Forward differences err by about the square root of the floats' epsilon.
    assert np.all(error < 1e-6 * np.abs(numerical).max(axis=0))


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_the_surface_counts_by_the_derivative_of_the_force_by_its_place(law):
    x, v = paper_motion()
    step = 1e-7
    slope = (law.force(x - step, v) - law.force(x + step, v)) / (2.0 * step)
    information = fisher_information(law, x, v, 0.1, surface=True)
    assert information[-1, -1] == pytest.approx(np.sum(slope**2) / 0.1**2, rel=1e-6)
    expected = sensitivity(law, x, v).T @ slope / 0.1**2
    assert information[-1, :-1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_the_bound_goes_with_the_noise_and_the_square_root_of_whole_periods(law, offset):
    x, v = paper_motion(PERIOD, 1e-3)
    one = cramer_rao_bound(law, x, v, 0.02, offset=offset).standard_errors
    five = cramer_rao_bound(law, x, v, 0.1, offset=offset).standard_errors
    assert five == pytest.approx(5.0 * one, rel=1e-9)
    nine = cramer_rao_bound(law, *paper_motion(9 * PERIOD, 1e-3), 0.02, offset=offset)
    # A period is 6283.2 samples: the last one is cut by a fifth of a sample.
    assert nine.standard_errors == pytest.approx(one / 3.0, rel=1e-3)


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_not_knowing_more_never_lowers_a_bound(law):
    def bound(offset, surface):
        found = cramer_rao_bound(law, *paper_motion(), 0.05, offset=offset, surface=surface)
        return found.standard_errors[: len(law.as_dict())]

    slack = 1.0 + 1e-9  # rounding
    for one in (False, True):
        assert np.all(bound(True, one) * slack >= bound(False, one))
        assert np.all(bound(one, True) * slack >= bound(one, False))


@pytest.mark.parametrize("law", LAWS[2:], ids=repr)
def test_a_held_probe_and_samples_out_of_contact_tell_nothing(law):
    bound = cramer_rao_bound(law, np.full(1000, 0.01), np.zeros(1000), 0.05)
    assert np.isinf(bound.standard_errors).all()
    assert bound["exponent"] == np.inf
    rows = sensitivity(law, np.array([-1e-3, 0.0, 1e-3]), np.full(3, 0.1))
    assert not rows[:2].any()
    assert rows[2].all()


def test_least_squares_meets_the_bound():
    x, v = paper_motion(4.0)
    noise, runs = 0.02, 150
    clean = SOFT.force(x, v)
    units = np.append(SOFT.parameters, 1.0)

    def residual(scaled, force):
        stiffness, damping, exponent, offset = scaled * units
        return x**exponent * (stiffness + damping * v) + offset - force

    draw = np.random.default_rng(20120628)
    errors = []
    for _ in range(runs):
        force = clean + noise * draw.standard_normal(x.size)
        errors.append(least_squares(residual, [1.0, 1.0, 1.0, 0.0], args=(force,)).x * units)
    spread = np.std(np.array(errors), axis=0)
    bound = cramer_rao_bound(SOFT, x, v, noise, offset=True).standard_errors
    # A standard deviation of 150 draws is itself uncertain by 1/√300 = 6 %: three times that.
    assert spread / bound == pytest.approx(np.ones(4), abs=0.18)


def test_wrong_arguments_are_named():
    x, v = paper_motion()
    hole = np.where(np.arange(x.size) == 3, np.nan, x)
    for call, words in (
        (lambda: fisher_information(SOFT, x, v, 0.0), r"noise .* not 0"),
        (lambda: sensitivity(SOFT, hole, v), "penetration must be finite, not nan at sample 3"),
        (
            lambda: cramer_rao_bound(SOFT, x, np.full_like(v, np.inf), 0.1, surface=True),
            "velocity must be finite, not inf at sample 0",
        ),
        (lambda: sensitivity(SOFT, x, v[1:]), "same length"),
        (
            lambda: cramer_rao_bound(SOFT, x, v, 0.1)["offset"],
            "name must be one of stiffness, damp",
        ),
        (lambda: sensitivity("ball", x, v), "law must be a ForceLaw"),
    ):
        with pytest.raises(InvalidParameterError, match=words):
            call()
