"""Variable projection is least squares in the force domain, at its bound, from no start."""

import numpy as np
import pytest
from probing import (
    BALL,
    MATERIALS,
    NOISE,
    PVC,
    SAMPLE_TIME,
    WELL_EXCITED,
    fed,
    felt,
    held,
    joined,
    offline,
    relative_error,
    sines,
    three_sines,
    white,
)
from scipy.stats import binom

from palpate import (
    ConstantForgetting,
    ContactGate,
    DriftTracking,
    HuntCrossley,
    Scale,
    Status,
    VariableProjection,
)
from palpate.lab import design
from palpate.lab.design.precision import cramer_rao_bound

LAWS_TRIED = 20


def some_law(seed: int) -> HuntCrossley:
    """n 0.5 to 3.2, 1 to 30 N at 10 mm, b 0.2 to 8 s/m: the lab's materials and far beyond."""
    rng = np.random.default_rng(seed)
    exponent = rng.uniform(0.5, 3.2)
    stiffness = 10.0 ** rng.uniform(0.0, 1.5) / 10e-3**exponent
    return HuntCrossley(K=stiffness, B=rng.uniform(0.2, 8.0) * stiffness, n=exponent)


@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("seed", range(LAWS_TRIED))
def test_the_answer_is_that_of_offline_least_squares(seed: int, offset: bool) -> None:
    law, motion = some_law(seed), three_sines(1.0)
    force = felt(law, motion, seed, offset=0.1 if offset else 0.0)
    estimate = fed(VariableProjection(offset=offset, noise=NOISE), motion, force).estimate()
    for priors, limit in (
        # The prior of n moves it by (n − 1.3) se², at most 2 se² where se ≤ 0.02.
        (False, 0.05),
        # With the priors all that differs is 6-point interpolation, some 1e-5 of a parameter.
        (True, 5e-3),
    ):
        reference = offline(motion, force, law, offset=offset, priors=priors)
        apart = np.abs(estimate.parameters - reference.parameters)
        assert (apart <= limit * estimate.standard_errors).all()


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("seconds", [0.5, 5.0])
def test_clean_data_give_the_truth_without_initial_values(material: str, seconds: float) -> None:
    law, motion = MATERIALS[material], three_sines(seconds)
    force = law.force(motion.x, motion.v)
    known = fed(VariableProjection(offset=False), motion, force).estimate()
    # Cancellation in J and the interpolation of the sums.
    assert relative_error(known.law, law).max() <= 3e-6
    free = fed(VariableProjection(noise=1e-3), motion, force).estimate()
    # The same interpolation, where an unknown offset leaves J a hundred times flatter along n; it
    # is a fiftieth of the error bar of 1 mN of noise.
    assert relative_error(free.law, law).max() <= 1e-4


def test_misleading_first_samples_do_not_lose_the_global_search() -> None:
    motion = three_sines(3.0)
    force = felt(PVC, motion, 1)
    force[:40] = BALL.force(motion.x, motion.v)[:40]
    estimator = fed(VariableProjection(), motion[:40], force[:40])
    assert estimator.estimate().law.n < 1.5
    fed(estimator, motion[40:], force[40:])
    # 40 wrong samples of 3000 stay in the sums: a bias, of this size in the offline fit too.
    assert estimator.estimate().law.n == pytest.approx(
        offline(motion, force, PVC, offset=True).n, rel=1e-3
    )


def test_many_late_samples_do_not_lose_the_global_search() -> None:
    law, time = HuntCrossley(K=2e4, B=1e5, n=2.0), np.arange(560) * 0.5e-3
    x = 0.5e-3 + 0.2e-3 * np.sin(40.0 * time)
    x[-5:] = np.linspace(0.5e-3, 5e-3, 5)  # the last solution before these is of the others
    v = np.gradient(x, time)
    force = law.force(x, v) + white(x.size, 2, 0.01)
    answers = []
    for exponents in ((0.3, 3.6), (1.5, 3.0)):
        estimator = VariableProjection(exponent_range=exponents, gate=ContactGate(1e-4, 1e-4, 1e-4))
        estimator.replay(x, v, force, np.full(x.size, 0.5e-3))
        answers.append(estimator.estimate().law.n)
    assert answers == pytest.approx([2.0, 2.0], abs=0.02)


def test_the_offset_is_recovered_and_does_not_bias_the_law() -> None:
    motion = three_sines(5.0)
    for offset in (-0.4, 0.3):
        estimate = fed(VariableProjection(), motion, felt(PVC, motion, 3, offset)).estimate()
        # Four standard errors: one in 2000 such numbers is beyond; the seed is fixed.
        assert abs(estimate.offset - offset) < 4.0 * estimate.offset_standard_error
        assert 0.0 < estimate.offset_standard_error < 0.05
        assert (np.abs(estimate.parameters - PVC.parameters) < 4 * estimate.standard_errors).all()


def test_a_tight_prior_holds_the_force_offset() -> None:
    motion = three_sines(1.0)
    force = felt(BALL, motion, 4)
    wide = fed(VariableProjection(noise=NOISE), motion, force).estimate()
    tight = fed(VariableProjection(noise=NOISE, offset_deviation=1e-4), motion, force).estimate()
    assert abs(tight.offset) < 3e-4
    assert tight.offset_standard_error <= 1.001e-4
    assert (tight.standard_errors < 0.5 * wide.standard_errors).all()
    none = fed(VariableProjection(offset=False), motion, force).estimate()
    assert none.offset == none.offset_standard_error == 0.0
    assert not none.joint_covariance[3].any()


def test_a_given_noise_sets_the_error_bars() -> None:
    motion = three_sines(5.0)
    force = felt(PVC, motion, 5)
    given = fed(VariableProjection(noise=NOISE), motion, force).estimate()
    twice = fed(VariableProjection(noise=2.0 * NOISE), motion, force).estimate()
    found = fed(VariableProjection(), motion, force).estimate()
    # No level of the residual is noisier than twice what it is: they are those of white noise. The
    # prior's part of the information is below 1e-3.
    bound = cramer_rao_bound(PVC, motion.x, motion.v, NOISE, offset=True)[:3]
    assert twice.standard_errors == pytest.approx(2.0 * bound, rel=0.02)
    # The residual's deviation over 5000 samples is known to 1 %; four times that.
    assert found.standard_errors == pytest.approx(given.standard_errors, rel=0.04)
    assert (given.standard_errors > 0.99 * bound).all()


def test_forgetting_follows_a_slow_change_and_no_forgetting_does_not() -> None:
    motion = three_sines(20.0)
    growth = 1.0 + 0.3 * motion.time / 20.0
    force = BALL.force(motion.x, motion.v) * growth + white(len(motion), 8)
    at_end = BALL.force(10e-3, 0.0) * growth[-1]

    def error(forgetting: ConstantForgetting | None) -> float:
        estimator = VariableProjection(offset=False, forgetting=forgetting)
        return abs(fed(estimator, motion, force).estimate().law.force(10e-3, 0.0) / at_end - 1.0)

    # One second of memory lags by 1 s of 1.5 %/s, and half of the 20 s by 10 s of it.
    assert error(ConstantForgetting(0.999)) < 0.02
    assert error(None) > 0.05


@pytest.mark.parametrize("name", WELL_EXCITED)
@pytest.mark.parametrize("offset", [False, True])
def test_holding_still_moves_no_parameter(name: str, offset: bool) -> None:
    law = WELL_EXCITED[name]
    motion = joined(three_sines(20.0), held(100.0), three_sines(1.0))
    force = felt(law, motion, 13)
    estimator = fed(VariableProjection(offset=offset), motion[:20_000], force[:20_000])
    before = estimator.estimate()
    for second in range(0, 101_000, 1000):
        part = slice(20_000 + second, 21_000 + second)
        fed(estimator, motion[part], force[part])
        moved = np.abs(estimator.estimate().parameters - before.parameters)
        assert (moved < 0.01 * before.parameters).all()
        # What one depth does say can move it along by its error bar, not more.
        assert (moved < 3.0 * before.standard_errors).all()
    assert not estimator.estimate().flags
    assert estimator.estimate().samples == round(121.0 / SAMPLE_TIME)


def test_an_estimate_without_samples_is_flagged() -> None:
    for estimator in (VariableProjection(), VariableProjection(noise=1e30), DriftTracking()):
        assert estimator.estimate().flags
    for sample in ((9e7, 0.0, 1.0), (10e-3, 1e9, 1.0), (10e-3, 0.0, 1e9)):
        estimator = VariableProjection(exponent_range=(5.0, 10.0))
        assert estimator.update(*sample) == Status.OUT_OF_RANGE


SEEDS = 150
# The RMSE of 150 normal errors scatters by 1/√300 = 6 % around the bound: the limit of 1.15 is 2.6
# of that, for an estimator at the bound. The seeds are fixed.
RATIO = 1.15


def errors_of(law: HuntCrossley, seconds: float, seeds: range, **settings) -> tuple:
    """Errors of (K, B, n) and their standard errors, a row a seed."""
    motion = three_sines(seconds)
    estimates = [
        fed(VariableProjection(**settings), motion, felt(law, motion, seed)).estimate()
        for seed in seeds
    ]
    errors = np.array([estimate.parameters - law.parameters for estimate in estimates])
    return errors, np.array([estimate.standard_errors for estimate in estimates])


@pytest.mark.long
@pytest.mark.parametrize(
    "seconds, seeds, limit",
    [
        *((seconds, range(SEEDS), RATIO) for seconds in (1.0, 5.0)),
        # 1000 seeds scatter by 2.2 %: three of that above the bound.
        *(
            pytest.param(seconds, range(1000, 2000), 1.07, marks=pytest.mark.slow)
            for seconds in (0.5, 1.0, 5.0, 20.0)
        ),
    ],
)
@pytest.mark.parametrize("settings", [{"offset": False}, {}, {"noise": NOISE}], ids=str)
@pytest.mark.parametrize("name", WELL_EXCITED)
def test_errors_reach_the_cramer_rao_bound(name, settings, seconds, seeds, limit) -> None:
    law, motion = WELL_EXCITED[name], three_sines(seconds)
    bound = cramer_rao_bound(law, motion.x, motion.v, NOISE, offset=settings.get("offset", True))
    errors, deviations = errors_of(law, seconds, seeds, **settings)
    assert (np.sqrt(np.mean(errors**2, axis=0)) <= limit * bound[:3]).all()
    inside = np.count_nonzero(np.abs(errors) < 1.96 * deviations, axis=0)
    # Beyond them a true 95 % would be one time in 500 on each side.
    assert (inside >= binom.ppf(0.002, len(seeds), 0.95)).all()
    # A bar that allows for correlation pays for not knowing that there is none: 98 % in a second.
    assert (inside <= binom.ppf(0.998, len(seeds), 0.985)).all()
    # Never below white, by how much the variances of blocks scatter, and by t₀.₉₇₅(ν)/1.96.
    ratio = np.median(deviations, axis=0) / bound[:3]
    assert (ratio > 0.99).all()
    assert (ratio < 1.25).all() or seconds < 5.0


@pytest.mark.parametrize("unit", [1e-4, 1e-3, 3e-3, 30e-3, 0.1, 1.0])
@pytest.mark.parametrize("exponent", [0.6, 1.0, 2.0, 3.2])
def test_the_answer_is_the_same_in_any_unit_of_depth(unit: float, exponent: float) -> None:
    stiffness, motion = 20.0 / 10e-3**exponent, three_sines(4.0)
    force = felt(HuntCrossley(K=stiffness, B=stiffness, n=exponent), motion, 5)
    usual, other = (
        fed(VariableProjection(scale=Scale(depth, 0.02, 1.0)), motion, force).estimate()
        for depth in (10e-3, unit)
    )
    # With depths of a tenth or a hundredth of the unit the sums change by a third to a half from
    # one exponent to the next; interpolated as they are, K came out 13 % to 2000 % too large.
    apart = np.abs(other.parameters - usual.parameters) / usual.standard_errors
    assert apart.max() < 0.01
    np.testing.assert_allclose(other.standard_errors, usual.standard_errors, rtol=1e-3)


def test_a_light_touch_is_identified_in_the_default_units() -> None:
    law = HuntCrossley(K=5e3, B=5e3, n=1.3)
    motion = sines(4.0, design.Motion(1e-3, (0.1e-3, 0.18e-3, 0.18e-3), (4.0, 11.0, 15.0)))
    force = law.force(motion.x, motion.v) + white(len(motion), 6, 1e-4)
    estimate = fed(VariableProjection(), motion, force).estimate()
    assert (np.abs(estimate.parameters - law.parameters) < 4.0 * estimate.standard_errors).all()
    assert estimate.standard_errors[2] < 0.01
