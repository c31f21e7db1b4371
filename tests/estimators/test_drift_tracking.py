"""A material that drifts is followed; nothing is tracked before the exponent is known."""

import numpy as np
import pytest
from cases import bits
from probing import (
    BALL,
    NOISE,
    PVC,
    WELL_EXCITED,
    Floats,
    Motion,
    fed,
    felt,
    held,
    joined,
    relative_error,
    switched,
    three_sines,
    white,
)
from scipy.signal import lfilter

from palpate import (
    ChangeDetector,
    DriftTracking,
    HuntCrossley,
    Status,
    VariableProjection,
)

NOT_YET = "not tracking yet"
TOO_SLOW = "the material drifts faster than the random walk allows"

# rms of the force scale; the sponge's force is 3 N, so that 0.05 N of noise weigh seven times more.
LIMITS = {"ball": 0.005, "pvc": 0.005, "sponge": 0.01}


def swinging(law: HuntCrossley, motion: Motion, seed: int) -> tuple[Floats, Floats]:
    """Force of a law whose K and B swing by ±30 % at 0.1 Hz, and the factor."""
    factor = 1.0 + 0.3 * np.sin(2.0 * np.pi * 0.1 * motion.time)
    return law.force(motion.x, motion.v) * factor + white(len(motion), seed), factor


def tracked_scale(estimator: DriftTracking, motion: Motion, force: Floats) -> Floats:
    """Force of the tracked law at 10 mm and rest after each sample."""
    stiffness, _, exponent = estimator.replay(motion.x, motion.v, force).parameters.T
    return stiffness * 10e-3**exponent


@pytest.mark.parametrize("name", WELL_EXCITED)
def test_a_swing_of_30_percent_at_a_tenth_of_a_hertz_is_followed(name: str) -> None:
    law, motion = WELL_EXCITED[name], three_sines(30.0)
    for seed in range(3):
        force, factor = swinging(law, motion, seed)
        truth = law.force(10e-3, 0.0) * factor
        settled = slice(10_000, None)  # a period of the swing to find the exponent in
        error = (tracked_scale(DriftTracking(), motion, force) / truth - 1.0)[settled]
        assert np.sqrt(np.mean(error**2)) < LIMITS[name]
        constant = fed(VariableProjection(), motion, force).estimate().law.force(10e-3, 0.0)
        assert np.sqrt(np.mean((constant / truth - 1.0)[settled] ** 2)) > 0.1


@pytest.mark.parametrize("name", WELL_EXCITED)
def test_a_material_that_does_not_drift_is_not_lost(name: str) -> None:
    law, motion = WELL_EXCITED[name], three_sines(20.0)
    estimate = fed(DriftTracking(), motion, felt(law, motion, 4)).estimate()
    assert not estimate.flags
    assert (np.abs(estimate.parameters - law.parameters) < 4 * estimate.standard_errors).all()


@pytest.mark.parametrize("correlation", [0.7, 0.9])
def test_error_bars_hold_in_correlated_noise(correlation: float) -> None:
    motion, own = three_sines(5.0), np.sqrt(1.0 - correlation**2)
    clean, truth, away = PVC.force(motion.x, motion.v), PVC.force(10e-3, 0.0), []
    for seed in range(20):
        noise = np.random.default_rng([seed, 41]).normal(0.0, NOISE, len(motion) + 500)
        noise = lfilter([own], [1.0, -correlation], noise)[500:]
        estimate = fed(DriftTracking(), motion, clean + noise).estimate()
        force, error = estimate.with_error(lambda law: float(law.force(10e-3, 0.0)))
        away.append((force - truth) / error)
    # The bars of white noise give 1.8 and 2.7.
    assert np.sqrt(np.mean(np.square(away))) < 1.6


def says_too_slow(law: HuntCrossley, walk: float, seed: int, motion: Motion) -> bool:
    """Whether a random walk of ln k, of this deviation after a second, is said to be too fast."""
    random = np.random.default_rng([seed, 14])
    scale = np.exp(np.cumsum(walk * np.sqrt(1e-3) * random.standard_normal(len(motion))))
    force = law.force(motion.x, motion.v) * scale + white(len(motion), seed)
    flags = fed(DriftTracking(), motion, force).estimate().flags
    return any(flag.startswith(TOO_SLOW) for flag in flags)


@pytest.mark.parametrize(
    "seconds, seeds", [(8.0, 3), pytest.param(15.0, 100, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", WELL_EXCITED)
def test_a_random_walk_ten_times_too_slow_is_reported(
    name: str, seconds: float, seeds: int
) -> None:
    law, motion = WELL_EXCITED[name], three_sines(seconds)
    assert np.mean([says_too_slow(law, 0.2, seed, motion) for seed in range(seeds)]) >= 0.98
    assert np.mean([says_too_slow(law, 0.02, seed, motion) for seed in range(seeds)]) <= 0.01


def test_the_random_walk_suffices_again_once_the_material_rests() -> None:
    motion = three_sines(12.0)
    steps = 0.2 * np.sqrt(1e-3) * np.random.default_rng(15).standard_normal(len(motion))
    scale = np.exp(np.cumsum(np.where(motion.time < 4.0, steps, 0.0)))
    force = PVC.force(motion.x, motion.v) * scale + white(len(motion), 15)
    estimator = fed(DriftTracking(), motion[:4000], force[:4000])
    assert any(flag.startswith(TOO_SLOW) for flag in estimator.estimate().flags)
    assert not fed(estimator, motion[4000:], force[4000:]).estimate().flags


def test_before_tracking_it_equals_variable_projection_with_a_flag() -> None:
    motion = joined(held(1.0), three_sines(2.0))
    force = felt(BALL, motion, 5)
    tracking, projecting = DriftTracking(), VariableProjection(offset=False)
    started = None
    for k, sample in enumerate(zip(motion.x, motion.v, force, strict=True)):
        tracking.update(*sample)
        projecting.update(*sample)
        if any(flag.startswith(NOT_YET) for flag in tracking.estimate().flags):
            assert started is None, "once it tracks, it tracks"
            assert k > 900 or len(tracking.estimate().flags) > 1, "it says what motion would help"
            if k % 50 == 0:
                assert np.array_equal(
                    tracking.estimate().parameters, projecting.estimate().parameters
                )
        elif started is None:
            started = k
    with pytest.raises(TypeError, match="initial"):  # nor can it be started cold
        DriftTracking(initial=BALL)
    # Not while held, and soon after the motion that identifies the exponent begins.
    assert started is not None
    assert 1000 <= started <= 1500


def test_held_still_it_keeps_its_exponent_and_a_finite_covariance() -> None:
    motion = joined(three_sines(5.0), held(60.0))
    force = felt(PVC, motion, 6)
    estimator = fed(DriftTracking(), motion[:5000], force[:5000])
    before = estimator.estimate()
    after = fed(estimator, motion[5000:], force[5000:]).estimate()
    assert np.isfinite(after.joint_covariance).all()
    # Held, only ln k walks: by what the force at that depth says, and along with n by its bar.
    assert abs(after.law.n - before.law.n) < 3.0 * before.standard_errors[2]
    assert after.law.force(10e-3, 0.0) == pytest.approx(PVC.force(10e-3, 0.0), rel=0.01)
    assert np.linalg.eigvalsh(after.covariance / np.outer(*[after.standard_errors] * 2)).min() > 0
    again = three_sines(5.0)
    recovered = fed(estimator, again, felt(PVC, again, 7)).estimate()
    assert (np.abs(recovered.parameters - PVC.parameters) < 5 * recovered.standard_errors).all()


def test_wild_forces_do_not_throw_it_off_for_long() -> None:
    motion = three_sines(10.0)
    force = felt(BALL, motion, 9)
    force[3000:6000:100] += 50.0
    # An error counts as five deviations at most: a hundredth of the samples, all to one side.
    estimate = fed(DriftTracking(), motion, force).estimate()
    assert relative_error(estimate.law, BALL).max() < 0.05


def test_dissipation_and_exponent_drift_only_where_asked() -> None:
    motion = three_sines(20.0)
    exponent = 1.0 + 0.01 * motion.time  # to 1.2, at the same force at 10 mm
    spring = BALL.K * 10e-3 * (motion.x / 10e-3) ** exponent
    force = spring * (1.0 + motion.v) + white(len(motion), 10)
    fixed, free = (
        fed(DriftTracking(stiffness_drift=0.0, exponent_drift=drift), motion, force).estimate().law
        for drift in (0.0, 0.02)
    )
    assert abs(free.n - 1.2) < 0.02
    assert abs(fixed.n - 1.2) > 0.05


def test_a_sudden_change_restarts_it_where_a_detector_is_given() -> None:
    motion = three_sines(8.0)
    force = switched(PVC, BALL, motion, 4000) + white(len(motion), 11)
    estimator = fed(
        DriftTracking(change_detector=ChangeDetector(noise=NOISE)), motion[:2000], force[:2000]
    )
    twin = estimator.copy()  # of one that tracks
    traces = [
        each.replay(motion.x[2000:], motion.v[2000:], force[2000:]) for each in (estimator, twin)
    ]
    assert bits(traces[0]) == bits(traces[1])
    (found,) = np.flatnonzero(traces[0].status == Status.RESTARTED)
    assert 2000 <= found <= 2005
    estimate = estimator.estimate()
    assert not estimate.flags
    assert (np.abs(estimate.parameters - BALL.parameters) < 5 * estimate.standard_errors).all()
