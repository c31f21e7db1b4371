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


def single(channels):
    return [channel.astype(np.float32) for channel in channels]


NARROW = [channel.astype(np.float64) for channel in single(SIGNALS.arrays)]
WHOLE = [np.arange(1, 9), np.arange(8) % 3, 5 * np.arange(1, 9)]
FLOATS = [1.0 * channel for channel in WHOLE]
SPELLINGS = {
    "lists": (SIGNALS.arrays, [channel.tolist() for channel in SIGNALS.arrays]),
    "strided views": (SIGNALS.arrays, np.column_stack([*SIGNALS.arrays, SIGNALS.time]).T[:3]),
    "single precision": (NARROW, single(SIGNALS.arrays)),
    "big endian": (SIGNALS.arrays, [channel.astype(">f8") for channel in SIGNALS.arrays]),
    "one time step": ([*SIGNALS.arrays, np.full(200, 2e-3)], [*SIGNALS.arrays, 2e-3]),
    "one step of NumPy": ([*SIGNALS.arrays, np.full(200, 2e-3)], [*SIGNALS.arrays, np.array(2e-3)]),
    "whole numbers": (
        [*FLOATS, np.ones(8)],
        [WHOLE[0], WHOLE[1].astype(np.int8), WHOLE[2].astype(np.uint16), 1],
    ),
}


@pytest.mark.parametrize("plain, spelled", SPELLINGS.values(), ids=SPELLINGS)
def test_numbers_are_numbers_however_they_are_spelled_and_left_as_they_are(kind, plain, spelled):
    for channel in (each for each in spelled if isinstance(each, np.ndarray)):
        channel.flags.writeable = False
    trace = kind().replay(*spelled)
    assert bits(trace) == bits(kind().replay(*plain))
    assert trace.taken.any()


def test_a_trace_is_as_long_as_its_signals_and_cut_like_an_array(kind):
    trace = kind().replay(*SIGNALS.arrays)
    assert len(trace) == len(SIGNALS)
    part = trace[10:20]
    assert isinstance(part, Trace)
    assert len(part) == 10
    assert np.array_equal(part.parameters, trace.parameters[10:20])
    assert np.shares_memory(part.parameters, trace.parameters)
    assert np.array_equal(trace.validity, trace.validity_margin > 0.0)
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
    for size in (0, 1, 2, 4):
        with pytest.raises(InvalidParameterError, match=f"penetration has 3, dt has {size}"):
            estimator.replay(**GOOD, dt=np.ones(size))
    assert estimator._state() == before


NO_NUMBERS = "must be an array of real numbers"
WRONG = {
    "text": (["a", "b", "c"], NO_NUMBERS),
    "digits as text": (["1", "2", "3"], NO_NUMBERS),
    "complex": (np.ones(3) + 1j, NO_NUMBERS),
    "objects": ([None, 1.0, 2.0], NO_NUMBERS),
    "dates": (np.array(["2012-01-01"] * 3, dtype="datetime64[D]"), NO_NUMBERS),
    "ragged": ([[1.0], [1.0, 2.0], 1.0], NO_NUMBERS),
    "a dictionary": ({"x": 1.0}, NO_NUMBERS),
    **{
        str(shape): (np.ones(shape), f"must be one-dimensional, not {len(shape)}-dimensional")
        for shape in ((), (3, 1), (1, 3), (1, 3, 1))
    },
}


@pytest.mark.parametrize("values, words", WRONG.values(), ids=WRONG)
def test_an_array_of_another_type_or_dimension_is_refused_by_name(kind, values, words):
    for name in (*GOOD, "dt") if words == NO_NUMBERS else GOOD:
        with pytest.raises(InvalidParameterError, match=f"^{name} {words}"):
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
