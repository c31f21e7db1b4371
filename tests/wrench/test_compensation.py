"""The tool's weight and inertia are subtracted sample by sample as from a whole log."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from payloads import (
    FORCE,
    PAYLOAD,
    STEP,
    TORQUE,
    conjugate,
    matrix_of,
    motion,
    turn,
    wrench_of,
)

from palpate import InvalidParameterError, PayloadCompensation, Status
from palpate.input.channels.frames import multiply, rotate


def compensated(compensation, time, wrench, orientations=None):
    """The times, forces and torques of the outputs, by updates with each sample."""
    positions, quaternions = motion(time)
    orientations = quaternions if orientations is None else orientations
    return np.array(
        [
            (compensation.time, *compensation.force, *compensation.torque)
            for sample in zip(positions, orientations, wrench, time, strict=True)
            if compensation.update(*sample) is Status.UPDATED
        ]
    )


@pytest.mark.parametrize(
    "sign, delay, frame",
    [(1.0, 0.0, "base"), (-1.0, 0.0123, "base"), (1.0, -0.047, "sensor"), (1.0, 0.0604, "base")],
)
def test_live_outputs_are_the_external_wrench_of_the_formula(sign, delay, frame):
    payload = replace(PAYLOAD, sign=sign, delay=delay)
    time = np.arange(0.0, 1.0, STEP)
    compensation = PayloadCompensation(payload=payload, frame=frame)
    rows = compensated(compensation, time, wrench_of(payload, time - delay))
    assert len(rows) > 750
    expected = np.broadcast_to([*FORCE, *TORQUE], (len(rows), 6))
    if frame == "sensor":
        q = motion(rows[:, 0])[1]
        turned = [rotate(each, conjugate(q)) @ payload.mount for each in (FORCE, TORQUE)]
        expected = np.hstack(turned)
    # A quartic over 0.1 s keeps 0.9998 of an acceleration at 2 Hz; the load varies by 6 N.
    np.testing.assert_allclose(rows[:, 1:4], expected[:, :3], atol=4e-3)
    np.testing.assert_allclose(rows[:, 4:], expected[:, 3:], atol=3e-4)


def test_outputs_equal_the_formula_of_the_filter():
    """To rounding, on poses with noise: the derivatives are of the least-squares quartic."""
    random = np.random.default_rng(1)
    time = np.arange(0.0, 0.2, STEP)
    position, quaternion = motion(time)
    position = position + 1e-4 * random.standard_normal(position.shape)
    wrench = random.standard_normal((len(time), 6))
    compensation = PayloadCompensation(payload=PAYLOAD, frame="sensor", motion_window=0.031)
    powers = (STEP * np.arange(-15, 16.0))[:, None] ** np.arange(5)
    count = 0
    for k, sample in enumerate(zip(position, quaternion, wrench, time, strict=True)):
        if compensation.update(*sample) is not Status.UPDATED:
            continue
        window = slice(k - 30, k + 1)
        acceleration = 2.0 * np.linalg.lstsq(powers, position[window], rcond=None)[0][2:3]
        q, q1, q2 = np.linalg.lstsq(powers, quaternion[window], rcond=None)[0][:3, None]
        q, q1, q2 = np.array([q, q1, 2.0 * q2]) / np.linalg.norm(q)
        spin, change = (2.0 * multiply(conjugate(q), each)[:, :3] for each in (q1, q2))
        specific = rotate([[0.0, 0.0, -9.80665]] - acceleration, conjugate(q))
        expected = wrench[k - 15] - PAYLOAD.wrench(specific, spin, change)[0] - PAYLOAD.bias
        output = np.array([*compensation.force, *compensation.torque])
        np.testing.assert_allclose(output, expected, atol=1e-8)
        np.testing.assert_allclose(compensation.position, position[k - 15], atol=1e-12)
        assert compensation.time == pytest.approx(time[k - 15], abs=1e-12)
        count += 1
    assert count == len(time) - 30
    assert compensation.delay == pytest.approx(0.015)


def test_without_a_window_the_weight_is_subtracted_without_delay():
    compensation = PayloadCompensation(payload=PAYLOAD, motion_window=0.0)
    for orientation in (turn([1, 0, 0], 2.0), turn([0, 1, 0], np.pi), turn([0, 0, 1], -3.0)):
        gravity = rotate(np.array([[0.0, 0.0, -9.80665]]), conjugate(orientation)[None])
        still = np.zeros((1, 3))
        wrench = PAYLOAD.wrench(gravity, still, still)[0] + PAYLOAD.bias
        for form in (orientation, -orientation, matrix_of(orientation)):
            compensation.reset()
            compensation.update((0.0, 0.0, 0.0), form, wrench, 0.0)
            assert compensation.update((0, 0, 0), form, wrench.tolist(), STEP) is Status.UPDATED
            np.testing.assert_allclose(compensation.force, 0.0, atol=1e-12)
            np.testing.assert_allclose(compensation.torque, 0.0, atol=1e-12)
    assert compensation.delay == 0.0


def test_quaternions_whose_sign_jumps_give_the_same_outputs():
    time = np.arange(0.0, 0.5, STEP)
    wrench, quaternions = wrench_of(PAYLOAD, time), motion(time)[1]
    jumping = quaternions * np.where(np.arange(len(time)) % 7 < 3, 1.0, -1.0)[:, None]
    expected, rows = (
        compensated(PayloadCompensation(payload=PAYLOAD), time, wrench, each)
        for each in (quaternions, jumping)
    )
    np.testing.assert_array_equal(rows, expected)


def test_lost_samples_jitter_and_another_rate_are_no_acceleration():
    random = np.random.default_rng(2)
    even = np.arange(0.0, 1.0, STEP)
    for time in (
        np.delete(even, random.integers(200, 800, 60)),
        np.delete(even, slice(500, 505)),
        even + 2e-4 * random.standard_normal(len(even)).clip(-2.0, 2.0),
        np.arange(0.0, 1.0, 2.7e-3),
        np.arange(0.0, 1.0, 0.31e-3),
    ):
        rows = compensated(PayloadCompensation(payload=PAYLOAD), time, wrench_of(PAYLOAD, time))
        assert len(rows) > 320
        np.testing.assert_allclose(np.diff(rows[:, 0]), STEP, rtol=6.0)
        # Linear interpolation of a pose over 6 ms is off by 0.1 mm.
        np.testing.assert_allclose(rows[:, 1:4] - FORCE, 0.0, atol=0.05)


def test_bad_samples_are_refused_and_change_nothing():
    time = np.arange(0.0, 0.4, STEP)
    wrench, (positions, quaternions) = wrench_of(PAYLOAD, time), motion(time)
    clean, faulty = PayloadCompensation(payload=PAYLOAD), PayloadCompensation(payload=PAYLOAD)
    nan, huge, before = (np.nan,) * 3, (1e200, 0.0, 0.0), None
    for sample in zip(positions, quaternions, wrench, time, strict=True):
        position, orientation, force, now = sample
        status = clean.update(*sample)
        if before is not None:
            for bad, expected in (
                ((nan, orientation, force, now), Status.NOT_FINITE),
                ((position, (*nan, 1.0), force, now), Status.NOT_FINITE),
                ((position, orientation, force, np.inf), Status.NOT_FINITE),
                ((position, orientation, nan, now), Status.NOT_FINITE),
                ((huge, orientation, force, now), Status.OUT_OF_RANGE),
                ((position, orientation, force, 1e50), Status.OUT_OF_RANGE),
                ((position, (0.0, 0.0, 0.0, 0.0), force, now), Status.OUT_OF_RANGE),
                ((position, 1.03 * orientation, force, now), Status.OUT_OF_RANGE),
                ((position, orientation, force, before), Status.INVALID_STEP),
            ):
                assert faulty.update(*bad) is expected
        before = now
        assert faulty.update(*sample) is status
    assert faulty.force == clean.force
    assert faulty.torque == clean.torque
    for jump in (100.0, -5.0):
        assert clean.update(*sample[:3], jump) is Status.RESTARTED
        assert clean.update(*sample[:3], jump + STEP) is Status.WAITING


def test_samples_below_a_tenth_of_the_rate_have_no_output():
    compensation = PayloadCompensation(payload=PAYLOAD)
    time = 10.1e-3 * np.arange(500)
    assert len(compensated(compensation, time, wrench_of(PAYLOAD, time))) == 0


ROWS = st.lists(st.lists(st.floats(), min_size=14, max_size=14), max_size=20)


@given(ROWS, st.sampled_from([0.0, 0.02]))
def test_any_numbers_give_a_status_and_finite_outputs(rows, window):
    compensation = PayloadCompensation(payload=PAYLOAD, motion_window=window)
    for row in rows:
        for orientation in (row[3:7], (0.0, 0.6, 0.0, 0.8)):
            status = compensation.update(row[:3], orientation, row[7:13], row[13])
            if status is Status.UPDATED:
                assert np.isfinite([*compensation.force, *compensation.torque]).all()


def test_a_tare_in_free_air_follows_a_sensor_that_was_zeroed():
    time = np.arange(0.0, 1.0, STEP)
    zeroed = np.array([-3.0, 4.0, -8.0, 0.0, 0.1, 0.2])
    wrench = wrench_of(PAYLOAD, time, np.zeros(3), np.zeros(3)) + zeroed
    compensation = PayloadCompensation(payload=PAYLOAD)
    assert not compensation.finish_tare()
    compensation.start_tare()
    assert np.abs(compensated(compensation, time[:500], wrench[:500])[:, 1:]).max() > 1.0
    assert compensation.finish_tare()
    rows = compensated(compensation, time[500:], wrench[500:])
    np.testing.assert_allclose(rows[:, 1:4], 0.0, atol=5e-3)
    np.testing.assert_allclose(rows[:, 4:], 0.0, atol=5e-4)


def test_a_restored_compensation_continues_bit_for_bit():
    time = np.arange(0.0, 0.6, STEP)
    wrench = wrench_of(PAYLOAD, time)
    whole = PayloadCompensation(payload=PAYLOAD)
    compensated(whole, time[:300], wrench[:300])
    restored = whole.copy(), pickle.loads(pickle.dumps(whole))
    expected, *rows = (compensated(each, time[300:], wrench[300:]) for each in (whole, *restored))
    assert len(expected) == 300
    for each in rows:
        np.testing.assert_array_equal(each, expected)


def test_settings_out_of_range_are_refused_by_name():
    for settings, name in (
        ({"payload": None}, "payload"),
        ({"payload": PAYLOAD, "sample_time": 0.0}, "sample_time"),
        ({"payload": PAYLOAD, "motion_window": -1.0}, "motion_window"),
        ({"payload": PAYLOAD, "frame": "tool"}, "frame"),
        ({"payload": replace(PAYLOAD, delay=1.0)}, "delay"),
        ({"payload": replace(PAYLOAD, mass=-1.0)}, "mass"),
        ({"payload": replace(PAYLOAD, sign=0.5)}, "sign"),
        ({"payload": replace(PAYLOAD, bias=np.full(6, np.nan))}, "bias"),
    ):
        with pytest.raises(InvalidParameterError, match=name):
            PayloadCompensation(**settings)
    compensation = PayloadCompensation(payload=PAYLOAD)
    with pytest.raises(TypeError, match="3 numbers"):
        compensation.update((0.0, 0.0), (0, 0, 0, 1), (0.0,) * 6, 0.0)
    with pytest.raises(TypeError, match="time"):
        compensation.update((0.0, 0.0, 0.0), (0, 0, 0, 1), (0.0,) * 6)
