"""Force, stiffness and damping at any depth, with the error bars of the diagnosis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases import contact_of, exciting

import palpate
from palpate.errors import InvalidParameterError
from palpate.input.recordings.recording import read_truth

HARD = palpate.HuntCrossley(K=228e3, B=2e3, n=2.0)
EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


@pytest.fixture(scope="module")
def late():
    """A force that is 3 ms late: the verdict is no trust, and the damping is off."""
    signals = exciting(HARD, seconds=4.0, noise=0.02, seed=3)
    return palpate.identify(contact_of(replace(signals, force=np.roll(signals.force, 3))))


@pytest.mark.parametrize("method", ["single-stage", "drift-tracking"])
def test_error_bars_hold_for_methods_off_the_least_squares(method):
    found = palpate.identify(EXAMPLES / "tapping.csv", method)
    truth = read_truth(found.contact.provenance)
    for there in found.working_depths:
        x = there.depth
        real = truth.force(x, 0.0), truth.stiffness_at(x), truth.damping_at(x)
        for each, value in zip((there.force, there.stiffness, there.damping), real, strict=True):
            bar = np.hypot(each.standard_error, each.systematic)
            assert abs(each.value - value) < 3.0 * bar  # 34 of them where only noise counts


def test_a_depth_independent_damper_has_a_bounded_error():
    found = palpate.identify(EXAMPLES / "tapping.csv", "extended-kelvin-voigt")
    checks = {finding.check for finding in found.diagnosis.findings}
    assert "damping with depth" in checks
    assert "damping form" not in checks  # its slope K₁ + 2 K₂ x is the damper itself where K₂ = 0
    damping = found.diagnosis.working_depth.damping
    # The method has half the damping of this material, and its misfit is in the bar.
    assert damping.systematic < 10.0 * abs(damping.value)


def test_the_working_depths_are_the_median_and_the_90th_percentile(ball):
    taken = ball.contact.penetration[ball.trace.taken]
    depths = [depth.depth for depth in ball.working_depths]
    # A gate leaves the lightest samples out of them: a thousandth of the depth.
    assert depths == pytest.approx(np.percentile(taken, [50, 90]), rel=2e-3)
    assert ball.diagnosis.working_depth is ball.working_depths[0]


def test_numbers_at_many_depths_are_those_of_a_diagnosis_at_each(late):
    depths = np.array([[4e-3, 8e-3], [9e-3, 12e-3]])
    found = late.at(depths)
    assert found.depth.shape == found.stiffness.value.shape == (2, 2)
    for place, depth in np.ndenumerate(depths):
        alone = late.at_depth(depth).diagnosis.working_depth
        for name in ("force", "stiffness", "damping"):
            many, one = getattr(found, name), getattr(alone, name)
            for part in ("value", "standard_error", "systematic"):
                assert getattr(many, part)[place] == pytest.approx(getattr(one, part), rel=1e-12)
    assert found.damping.systematic.min() > 0.0
    for name in ("stiffness", "damping"):  # one depth gives plain numbers
        plain = getattr(late, f"{name}_at")(8e-3).value
        assert isinstance(plain, float)
        assert plain == pytest.approx(getattr(late.law, f"{name}_at")(8e-3))
    assert late.force_at(8e-3).value == pytest.approx(late.law.force(8e-3, 0.0))


@pytest.mark.parametrize("depth", [0.0, -1e-3, np.nan, "deep", [1e-3, np.inf], 1j])
def test_a_depth_is_a_number_above_zero(ball, depth):
    with pytest.raises(InvalidParameterError, match="depth must be"):
        ball.at(depth)


def test_a_working_depth_that_was_not_reached_is_said(ball):
    there = ball.at_depth(50e-3).diagnosis
    assert there.verdict.stiffness == there.verdict.damping == "with-care"
    assert "50 mm, is outside the recorded depths" in there.reason
    assert ball.at_depth(9e-3).diagnosis.verdict.overall == "trust"


def test_the_covariance_has_the_standard_errors_and_keeps_the_correlations(ball):
    np.testing.assert_allclose(np.sqrt(np.diag(ball.covariance)), ball.standard_errors)
    own = ball.estimate.covariance / np.outer(*[ball.estimate.standard_errors] * 2)
    np.testing.assert_allclose(ball.correlations, own)
    assert ball.correlations[0, 2] > 0.9  # K and n of a power law


@pytest.mark.parametrize("method", palpate.ESTIMATORS)
def test_an_estimate_knows_stiffness_and_damping_with_their_errors(method):
    signals = exciting(HARD, seconds=2.0, noise=0.05, seed=4)
    estimator = palpate.ESTIMATORS[method]()
    estimator.replay(*signals.arrays)
    estimate, depth = estimator.estimate(), 9e-3
    size = np.where(estimate.parameters == 0.0, 1.0, np.abs(estimate.parameters))
    covariance = estimate.covariance / np.outer(size, size)
    random = np.random.default_rng(0)
    draws = random.multivariate_normal(estimate.parameters / size, covariance, 4000)
    nothing = palpate.ESTIMATORS[method]().estimate()
    for name in ("stiffness_at", "damping_at"):
        value, error = getattr(estimate, name)(depth)
        assert value == getattr(estimate.law, name)(depth)
        laws = [estimate.law.from_parameters(size * draw) for draw in draws]
        spread = np.std([getattr(law, name)(depth) for law in laws])
        assert error == pytest.approx(spread, rel=0.05)  # 4000 draws know it to 1 %
        value, error = getattr(nothing, name)(1e-3)  # one of nothing can be asked too
        assert value == getattr(nothing.law, name)(1e-3)
        assert not error < 0.0


def test_the_velocity_filter_is_in_the_error_of_the_damping():
    stiff = palpate.HuntCrossley(K=5e5, B=2e5, n=1.5)
    signals = exciting(stiff, seconds=6.0, noise=0.02, seed=5)
    arrays = {"time": signals.time, "penetration": signals.penetration, "force": signals.force}
    contact = palpate.prepare(**arrays, velocity_window=15e-3)
    there = palpate.identify(contact).diagnosis.working_depth
    off = there.damping.value - stiff.damping_at(there.depth)
    assert off > 3.0 * there.damping.standard_error
    assert off < 2.0 * np.hypot(there.damping.standard_error, there.damping.systematic)


def test_tare_errors_are_in_the_bars_of_methods_without_offset():
    signals = exciting(HARD, seconds=4.0, noise=0.02, seed=6)
    contact = contact_of(replace(signals, force=signals.force + 0.05))
    there = palpate.identify(contact, "double-stage").diagnosis.working_depth
    truths = HARD.force(there.depth, 0.0), HARD.stiffness_at(there.depth)
    for quantity, true in zip((there.force, there.stiffness), truths, strict=True):
        whole = np.hypot(quantity.standard_error, quantity.systematic)
        assert abs(quantity.value - true) < 3.0 * whole
        assert abs(quantity.value - true) > 3.0 * quantity.standard_error
