"""Which arrays ``replay`` takes, and how it refuses the others."""

import numpy as np
import pytest
from cases import MATERIALS, bits, exciting

from palpate import InvalidParameterError, Status, Trace

SIGNALS = exciting(MATERIALS["ball"], seconds=0.2, noise=0.05)
GOOD = {
    "penetration": np.array([1.0, 2.0, 3.0]) * 1e-3,
    "velocity": np.array([0.0, 0.1, 0.2]),
    "force": np.array([1.0, 2.0, 3.0]),
}


def test_whole_numbers_are_numbers(kind):
    x, v, force = np.arange(1, 9), np.arange(8) % 3, 5 * np.arange(1, 9)
    whole, floats = kind(), kind()
    trace = whole.replay(x, v.astype(np.int8), force.astype(np.uint16), dt=1)
    assert bits(trace) == bits(floats.replay(x * 1.0, v * 1.0, force * 1.0, dt=1.0))
    assert trace.taken.all()


@pytest.mark.parametrize("step", [2e-3, np.float64(2e-3), np.array(2e-3)])
def test_one_time_step_is_that_of_every_sample(kind, step):
    one, each = kind(), kind()
    expected = bits(each.replay(*SIGNALS.arrays, np.full(len(SIGNALS), 2e-3)))
    assert bits(one.replay(*SIGNALS.arrays, step)) == expected


def test_lists_and_strided_views_are_arrays(kind):
    plain, lists, views = kind(), kind(), kind()
    expected = bits(plain.replay(*SIGNALS.arrays))
    assert bits(lists.replay(*(channel.tolist() for channel in SIGNALS.arrays))) == expected
    table = np.column_stack([*SIGNALS.arrays, SIGNALS.time])
    assert bits(views.replay(table[:, 0], table[:, 1], table[:, 2])) == expected


def test_single_precision_is_widened(kind):
    narrow, wide = kind(), kind()
    channels = [channel.astype(np.float32) for channel in SIGNALS.arrays]
    expected = bits(wide.replay(*(channel.astype(np.float64) for channel in channels)))
    assert bits(narrow.replay(*channels)) == expected


def test_big_endian_numbers_are_numbers(kind):
    ours, theirs = kind(), kind()
    swapped = [channel.astype(">f8") for channel in SIGNALS.arrays]
    assert bits(theirs.replay(*swapped)) == bits(ours.replay(*SIGNALS.arrays))


def test_the_callers_arrays_are_left_as_they_are(kind):
    copies = [channel.copy() for channel in SIGNALS.arrays]
    for channel in copies:
        channel.flags.writeable = False
    kind().replay(*copies)
    for channel, original in zip(copies, SIGNALS.arrays, strict=True):
        assert np.array_equal(channel, original)


def test_no_samples_are_an_empty_trace(kind):
    estimator = kind()
    trace = estimator.replay([], [], [])
    assert len(trace) == 0
    assert trace.parameters.shape == (0, len(kind.law_type.symbols))
    assert estimator.estimate().samples == 0


@pytest.mark.parametrize("name", GOOD)
def test_arrays_of_different_length_are_refused_by_name_and_length(kind, name):
    arrays = {**GOOD, name: np.ones(5)}
    estimator = kind()
    before = estimator._state()
    with pytest.raises(InvalidParameterError, match="same length") as caught:
        estimator.replay(**arrays)
    for other, array in arrays.items():
        assert f"{other} has {array.size}" in str(caught.value)
    assert estimator._state() == before


@pytest.mark.parametrize("steps", [np.ones(1), np.ones(2), np.ones(4), np.ones(0)])
def test_time_steps_of_another_length_are_refused(kind, steps):
    with pytest.raises(InvalidParameterError, match=f"penetration has 3, dt has {steps.size}"):
        kind().replay(**GOOD, dt=steps)


WRONG_TYPES = {
    "text": ["a", "b", "c"],
    "digits as text": ["1", "2", "3"],
    "complex": np.ones(3) + 1j,
    "objects": [None, 1.0, 2.0],
    "dates": np.array(["2012-01-01"] * 3, dtype="datetime64[D]"),
    "ragged": [[1.0], [1.0, 2.0], 1.0],
    "a dictionary": {"x": 1.0},
}


@pytest.mark.parametrize("values", WRONG_TYPES.values(), ids=WRONG_TYPES)
def test_an_array_of_another_type_is_refused_by_name(kind, values):
    for name in (*GOOD, "dt"):
        words = f"^{name} must be an array of real numbers"
        with pytest.raises(InvalidParameterError, match=words):
            kind().replay(**{**GOOD, name: values})


@pytest.mark.parametrize("shape", [(), (3, 1), (1, 3), (1, 3, 1)], ids=str)
def test_an_array_of_another_dimension_is_refused_by_name(kind, shape):
    values = np.ones(shape)
    for name in GOOD:
        words = f"^{name} must be one-dimensional, not {values.ndim}-dimensional"
        with pytest.raises(InvalidParameterError, match=words):
            kind().replay(**{**GOOD, name: values})


def test_samples_that_are_not_finite_do_not_stop_a_replay(kind):
    holes = [channel.copy() for channel in SIGNALS.arrays]
    for place, bad in enumerate([np.nan, np.inf, -np.inf]):
        holes[place][40 + place] = bad
    trace = kind().replay(*holes)
    refused = np.flatnonzero(~trace.taken)
    assert refused.tolist() == [40, 41, 42]
    assert np.all(trace.status[refused] == Status.NOT_FINITE)
    assert np.isnan(trace.predicted_force[refused]).all()
    assert np.array_equal(trace.parameters[40:43], np.tile(trace.parameters[39], (3, 1)))


def test_a_trace_is_as_long_as_its_signals_and_cut_like_an_array(kind):
    trace = kind().replay(*SIGNALS.arrays)
    assert len(trace) == len(SIGNALS)
    part = trace[10:20]
    assert isinstance(part, Trace)
    assert len(part) == 10
    assert np.array_equal(part.parameters, trace.parameters[10:20])
    assert np.shares_memory(part.parameters, trace.parameters)
    assert np.array_equal(trace.validity, trace.validity_margin > 0.0)
