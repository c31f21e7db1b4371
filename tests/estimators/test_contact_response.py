"""Stiffness and damping that a controller may act on: safe to read at any time."""

import numpy as np
import pytest
from probing import (
    BALL,
    INCLUSION,
    MATERIALS,
    NOISE,
    PVC,
    SPONGE,
    Motion,
    clock,
    felt,
    joined,
    switched,
    three_sines,
    white,
)

import palpate
from palpate import (
    ChangeDetector,
    ContactEstimator,
    InvalidParameterError,
    OutlierRejection,
    SingleStageRLS,
    VariableProjection,
    ViscoelasticContact,
    lab,
)
from palpate.findings import Check

KINDS = (VariableProjection, ViscoelasticContact)


def approach(seconds: float = 0.5) -> Motion:
    """From 1 mm above the surface to 10 mm below it, smoothly."""
    u = clock(seconds) / seconds
    x = -1e-3 + 11e-3 * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return Motion(x, np.gradient(x, clock(seconds)))


def pressed(seconds: float = 2.0) -> Motion:
    return joined(approach(), three_sines(seconds))


def tapped(seconds: float) -> Motion:
    """Taps from 3 mm above the surface to 9 mm below it, 1.3 a second."""
    turns = 8.2 * clock(seconds)
    return Motion(-3e-3 + 12e-3 * np.sin(turns), 12e-3 * 8.2 * np.cos(turns))


def samples(motion: Motion, force: np.ndarray) -> zip:
    return zip(motion.x.tolist(), motion.v.tolist(), force.tolist(), strict=True)


def fed(estimator: ContactEstimator, motion: Motion, force: np.ndarray) -> ContactEstimator:
    for sample in samples(motion, force):
        estimator.update(*sample)
    return estimator


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", MATERIALS)
def test_every_estimate_in_contact_is_physically_possible(kind, name):
    """Until a number is usable it is within a factor of three, stiffness never 0 or below."""
    law, motion = MATERIALS[name], pressed()
    estimator = kind()
    for seed in range(3):
        estimator.reset()
        force, wrong = felt(law, motion, seed), 0
        for k, sample in enumerate(samples(motion, force)):
            estimator.update(*sample)
            if law.force(motion.x[k], motion.v[k]) < 5.0 * NOISE:
                continue
            now = estimator.estimate()
            stiffness = now.stiffness.value / law.stiffness_at(motion.x[k])
            damping = now.damping.value / law.damping_at(motion.x[k])
            wrong += not (1.0 / 3.0 < stiffness < 3.0 and 0.0 <= damping < 10.0)
            if now.stiffness.usable:
                assert abs(stiffness - 1.0) < 0.35
            if now.damping.usable:
                assert abs(damping - 1.0) < 0.6
        assert wrong <= 2  # of 2400: at the first forces above five standard deviations


@pytest.mark.parametrize("kind", KINDS)
def test_after_two_seconds_both_are_usable_and_their_bars_hold(kind):
    """Within three bars, and the bar of the damping is below a tenth."""
    for seed, law in enumerate(MATERIALS.values()):
        motion = pressed()
        now = fed(kind(), motion, felt(law, motion, seed)).estimate(at=8e-3)
        for number, exact in (
            (now.stiffness, law.stiffness_at(8e-3)),
            (now.damping, law.damping_at(8e-3)),
        ):
            assert number.usable
            assert abs(number.value - exact) < 3.0 * number.standard_error < 0.3 * exact
        assert now.depth == 8e-3
        assert 5.0 < now.frequency < 20.0  # the sines are at 4, 11 and 15 rad/s
        assert now.age <= 0.15  # s: a solution when the samples have grown by a sixteenth
        assert not now.flags


def test_the_law_and_its_errors_are_those_of_the_unbounded_estimate():
    motion = pressed()
    now = fed(VariableProjection(), motion, felt(PVC, motion, 1)).estimate(at=5e-3)
    stiffness, error = now.stiffness_at(5e-3)
    # The response is from the latest solution, at most a 64th of the samples older.
    assert now.stiffness.value == pytest.approx(stiffness, abs=0.25 * error)
    # Its bar also covers what the law leaves unexplained, here nothing but noise.
    assert 0.95 * error < now.stiffness.standard_error < 5.0 * error


@pytest.mark.parametrize("motion", [pressed(3.0), tapped(3.0)], ids=["pressed", "tapped"])
def test_damping_of_a_relaxing_material_is_unusable_without_memory(motion):
    """After 1 s, 3 seeds: the force that it leaves unexplained widens both bars."""
    for seed in range(3):
        force = lab.RELAXING_SPONGE.force(motion.time, 0.0 * motion.x, motion.x, motion.v)
        force += white(len(motion), seed)
        plain, usable = VariableProjection(), []
        for sample in samples(motion, force):
            plain.update(*sample)
            usable.append(plain.estimate().damping.usable)
        assert not any(usable[1000:])
        relaxing = fed(ViscoelasticContact(), motion, force).estimate()
        assert relaxing.damping.usable or "lost contact" in relaxing.flags


def test_a_lost_contact_is_not_usable_and_the_next_touch_is():
    motion = pressed()
    estimator = fed(VariableProjection(), motion, felt(BALL, motion, 2))
    known = estimator.estimate().stiffness
    assert known.usable
    for k in range(20):
        estimator.update(-1e-3, -0.02, float(white(1, k)[0]), 1e-3)
    lost = estimator.estimate(at=8e-3)
    assert Check.LOST_CONTACT in lost.flags
    assert not lost.stiffness.usable
    assert not lost.damping.usable
    assert lost.stiffness.value == pytest.approx(known.value, rel=0.01)
    assert lost.age == pytest.approx(0.020, abs=0.064)
    fed(estimator, motion[450:500], felt(BALL, motion[450:500], 3))
    again = estimator.estimate()
    assert again.stiffness.usable
    assert Check.LOST_CONTACT not in again.flags


def test_prior_knowledge_bounds_both_numbers():
    motion = approach()[:150]
    estimator = fed(VariableProjection(), motion, felt(BALL, motion, 4))
    free = estimator.estimate()
    assert not free.damping.usable
    bounded = estimator.estimate(prior=((2500.0, 3000.0), (1.0, 1.5)))
    assert bounded.stiffness.value == np.clip(free.stiffness.value, 2500.0, 3000.0)
    assert bounded.damping.value == np.clip(free.damping.value, 1.0, 1.5)
    for at, prior in (
        (0.0, None),
        (np.nan, None),
        (None, (1.0, 2.0)),
        (None, 1),
        (1e-3, ((2, 1),) * 2),
    ):
        with pytest.raises(InvalidParameterError, match=r"^(at|prior)"):
            estimator.estimate(at=at, prior=prior)


@pytest.mark.parametrize("before, after", [(PVC, INCLUSION), (INCLUSION, PVC)])
def test_after_a_change_the_stiffness_is_right_before_the_law_is(before, after):
    """Within 10 % after 3 ms, flagged, and usable again within 50 ms."""
    motion, at = three_sines(3.0), 2200
    for seed in range(3):
        force = switched(before, after, motion, at) + white(len(motion), seed)
        estimator = VariableProjection(change_detector=ChangeDetector())
        fed(estimator, motion[: at + 3], force[: at + 3])
        now = estimator.estimate()
        assert now.stiffness.value == pytest.approx(after.stiffness_at(motion.x[at + 2]), rel=0.1)
        assert Check.CHANGE in now.flags or now.restarts
        assert fed(estimator, motion[at + 3 : at + 50], force[at + 3 : at + 50]).estimate().restarts
        now = estimator.estimate()
        assert now.stiffness.usable
        assert now.stiffness.value == pytest.approx(after.stiffness_at(motion.x[at + 49]), rel=0.1)


def stuck(motion: Motion, force: np.ndarray) -> tuple[Motion, np.ndarray]:
    return motion, np.where(np.arange(len(force)) < len(force) - 60, force, force[-60])


def stuck_position(motion: Motion, force: np.ndarray) -> tuple[Motion, np.ndarray]:
    late = np.arange(len(force)) >= len(force) - 60
    return Motion(np.where(late, motion.x[-60], motion.x), motion.v), force


def saturated(motion: Motion, force: np.ndarray) -> tuple[Motion, np.ndarray]:
    return motion, np.minimum(force, force[-40])


def spiky(motion: Motion, force: np.ndarray) -> tuple[Motion, np.ndarray]:
    force[-100] += 40.0
    return motion, force


def late(motion: Motion, force: np.ndarray) -> tuple[Motion, np.ndarray]:
    return motion, np.concatenate([np.full(30, force[0]), force[:-30]])


FAULTS = {
    stuck: Check.STUCK_FORCE,
    stuck_position: Check.STUCK_FORCE,
    saturated: Check.SATURATION,
    spiky: Check.SPIKES,
    late: Check.LATE_FORCE,
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_the_loops_checks_put_their_ids_into_the_flags(fault):
    """The last samples of the whole motion press from 8 to 11 mm."""
    motion = joined(approach(), three_sines(2.0))[:2400]
    rising = np.flatnonzero(motion.v > 0.03)[-1] + 1
    motion = motion[: int(rising)]
    force = felt(BALL, motion, 5)
    estimator = VariableProjection(outlier_rejection=OutlierRejection())
    sound = fed(estimator.replace(), motion, force.copy()).estimate()
    assert sound.stiffness.usable
    assert not sound.flags
    now = fed(estimator, *fault(motion, force.copy())).estimate()
    assert FAULTS[fault] in now.flags
    if fault in (stuck, stuck_position, saturated):
        assert not now.stiffness.usable


def test_a_force_in_free_air_that_moves_is_flagged():
    air = np.full(1000, -2e-3)
    for step, flagged in ((0.0, False), (0.2, True)):
        force = white(1000, 6) + np.where(np.arange(1000) < 700, 0.0, step)
        estimator = fed(VariableProjection(), Motion(air, 0.0 * air), force)
        assert (Check.BASELINE in estimator.estimate().flags) is flagged


@pytest.mark.parametrize("kind", [SingleStageRLS, palpate.DoubleStageRLS, palpate.KelvinVoigtRLS])
def test_the_published_methods_have_the_same_numbers(kind):
    motion = pressed()
    law = palpate.HuntCrossley(K=2000.0, B=200.0, n=1.0)
    gate = palpate.ContactGate(1e-3, 1.0, 0.8)
    now = fed(kind(gate=gate), motion, felt(law, motion, 7)).estimate(at=10e-3)
    assert now.stiffness.usable
    assert now.stiffness.value == pytest.approx(2000.0, rel=0.1)


def test_an_estimate_of_a_method_in_python_has_no_response():
    estimate = palpate.Estimate.from_law(
        SPONGE, np.eye(3), status=palpate.Status.UPDATED, samples=1
    )
    assert np.isnan(estimate.stiffness.value)
    assert not estimate.stiffness.usable
