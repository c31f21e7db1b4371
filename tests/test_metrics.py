"""RMSE% and condition 10, as the paper takes them."""

import math

import numpy as np
import pytest

from palpate import InvalidParameterError, Status, Trace
from palpate.metrics import prediction_rmse_percent, rmse_percent, violated_fraction


def trace_of(status, predicted, margin=1.0) -> Trace:
    size = len(status)
    return Trace(
        np.zeros((size, 2)),
        np.zeros((size, 2)),
        np.asarray(predicted, dtype=float),
        np.broadcast_to(np.asarray(margin, dtype=float), (size,)),
        np.asarray(status, dtype=np.uint8),
    )


@pytest.mark.parametrize("unit", [1, 1e-9])
@pytest.mark.parametrize(
    "measured, predicted, expected",
    [
        ([3.0, 4.0], [3.0, 4.0], 0.0),
        ([3.0, 4.0], [0.0, 0.0], 100.0),
        ([3.0, 4.0], [6.0, 8.0], 100.0),
        ([3.0, 4.0], [3.3, 4.4], 10.0),
        ([-3.0, 4.0], [-3.0, 3.5], 10.0),
        ([1, 1, 1, 1], [1, 1, 1, 2], 50.0),
        ([], [], math.nan),
        ([0.0, 0.0], [0.0, 0.0], math.nan),
    ],
)
def test_rmse_percent_is_the_error_as_a_share_of_the_force(measured, predicted, expected, unit):
    found = rmse_percent([unit * f for f in measured], [unit * f for f in predicted])
    # Two squares, a root: a few roundings.
    assert found == pytest.approx(expected, rel=1e-13, nan_ok=True)


def test_rmse_percent_refuses_arrays_of_different_length():
    with pytest.raises(InvalidParameterError, match="measured has 2, predicted has 3"):
        rmse_percent([1.0, 2.0], [1.0, 2.0, 3.0])


def test_the_prediction_error_leaves_out_the_first_fifth_of_a_second_of_contact():
    steps = np.full(8, 0.1)
    status = [Status.WAITING] * 2 + [Status.UPDATED] * 6
    force = np.full(8, 2.0)
    # Contact time after each sample taken: 0.1, 0.2, 0.3 … s; the first two are start-up.
    predicted = np.array([9.0, 9.0, 99.0, 99.0, 2.2, 1.8, 2.2, 1.8])
    trace = trace_of(status, predicted)
    steps[2:] = 0.0999  # so that no rounding of 0.2 decides
    assert prediction_rmse_percent(trace, force, steps) == pytest.approx(10.0, rel=1e-12)


def test_the_prediction_error_counts_contact_and_not_the_time_between():
    status = [Status.UPDATED, Status.HELD, Status.HELD, Status.UPDATED, Status.GUARDED]
    steps = np.array([0.15, 5.0, 5.0, 0.15, 0.15])
    trace = trace_of(status, [9.0, 9.0, 9.0, 1.1, 0.9])
    assert prediction_rmse_percent(trace, np.ones(5), steps) == pytest.approx(10.0, rel=1e-12)
    short = trace_of([Status.UPDATED] * 10, np.ones(10))
    assert math.isnan(prediction_rmse_percent(short, np.ones(10), np.full(10, 0.01)))


def test_the_violated_fraction_is_of_the_samples_taken():
    status = [Status.WAITING, Status.UPDATED, Status.GUARDED, Status.UPDATED, Status.HELD]
    trace = trace_of(status, np.ones(5), [-1.0, 0.5, -0.5, 0.0, -1.0])
    assert violated_fraction(trace) == pytest.approx(2.0 / 3.0, rel=1e-15)  # 0 is at the limit
    assert math.isnan(violated_fraction(trace_of([Status.WAITING] * 3, np.ones(3))))


@pytest.mark.parametrize("status", Status)
def test_taken_is_what_entered_the_estimate(status):
    trace = trace_of([status], [1.0])
    assert trace.taken.tolist() == [status in (Status.UPDATED, Status.GUARDED, Status.RESTARTED)]
