"""A contact: four channels on one clock; the arrays that ``replay`` takes; what is contact."""

import dataclasses
import math

import numpy as np
import pytest
from cases import MATERIALS, bits, exciting

from palpate import Columns, Contact, InvalidParameterError, Recording, RecordingError, Trace

SIGNALS = exciting(MATERIALS["ball"], seconds=0.5)
CHANNELS = ("time", "penetration", "velocity", "force")


def contact(**changes) -> Contact:
    return Contact(**{**vars(SIGNALS), **changes})


def at(time, segment=None) -> Contact:
    ones = np.ones(len(time))
    return Contact(time, penetration=ones, velocity=ones, force=ones, segment=segment)


def test_reprs_fit_a_screen():
    source = f"/data/{'long/' * 30}{'probe' * 20}.csv"
    channels = {"time_s": np.zeros(600), "fz\x1b[31m": np.zeros(600)}
    many = channels | {f"joint_{k}.position": np.zeros(10**4) for k in range(900)}
    texts = {
        repr(Recording(channels, source="runs/probe.csv")): (
            "<Recording 'probe.csv': 2 channels, 600 samples\n  time_s, fz\\x1b[31m>"
        ),
        repr(Recording(many, source=source)): "902 channels, 600 to 10000 samples",
        repr(Recording({})): "<Recording '': 0 channels, 0 samples",
        repr(contact(source="runs/probe.csv")): "<Contact 'probe.csv': 500 samples from 0 s to",
        repr(contact(source=source, segment=np.arange(500) // 2)): "250 segments>",
        repr(Columns()): "Columns()",
        repr(Columns(force="/ft", position="/pose")): "Columns(force='/ft', position='/pose')",
    }
    for text, words in texts.items():
        assert words in text
        assert len(text.splitlines()) <= 2
        assert all(len(line) <= 80 and line.isprintable() for line in text.splitlines())


def test_it_holds_what_it_was_given_and_is_frozen():
    held = contact(source="probe.csv", provenance={"force": "tared"})
    for name in CHANNELS:
        assert np.array_equal(getattr(held, name), getattr(SIGNALS, name))
    assert len(held) == len(SIGNALS)
    assert held.source == "probe.csv"
    assert held.provenance == {"force": "tared"}
    assert contact().provenance == {}
    assert list(held.segments()) == [slice(0, len(SIGNALS))]
    with pytest.raises(dataclasses.FrozenInstanceError):
        held.force = np.zeros(3)
    lifted = dataclasses.replace(contact(segment=np.arange(500) // 200), force=SIGNALS.force + 1.0)
    assert np.array_equal(lifted.force, SIGNALS.force + 1.0)
    assert [part.start for part in lifted.segments()] == [0, 200, 400]
    whole = Contact([0, 1, 2], penetration=[1, 2, 3], velocity=[1, 1, 1], force=[5, 6, 7])
    assert whole.force.dtype == np.float64
    assert whole.penetration.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    "labels",
    [
        ["a", "a", "b", "b", "a"],
        [1, 1, 0, 0, 1],
        [0.5, 0.5, 2.5, 2.5, 0.5],
        [math.nan, math.nan, 2.0, 2.0, math.nan],
    ],
    ids=["words", "numbers", "fractions", "missing"],
)
def test_another_segment_begins_where_the_label_changes(labels):
    parts = list(at(range(5), segment=labels).segments())
    assert parts == [slice(0, 2), slice(2, 4), slice(4, 5)]


@pytest.mark.parametrize("labels", [[[0], [0, 1], 2], [0, [1, 2], 3]], ids=str)
def test_labels_of_no_sense_are_refused(labels):
    with pytest.raises(
        InvalidParameterError, match="segment must be an array of one label per sample"
    ):
        at(range(3), segment=labels)
    with pytest.raises(InvalidParameterError, match="time has 3, segment has 2"):
        at(range(3), segment=[0, 1])


BAD_TIMES = {
    "backwards": ([0.0, 0.1, 0.05, 0.2], "sample 2 is 0.05 s after 0.1 s"),
    "hardly later": ([0.0, 5e-324, 0.1, 0.2], "sample 1 is 5e-324 s after 0.0 s"),
    "not known from the start": ([math.nan, 0.0, 0.1, 0.2], "sample 0 is nan s$"),
    "endless": ([0.0, 0.1, 0.2, math.inf], "sample 3 is inf s after 0.2 s"),
}


@pytest.mark.parametrize("time, words", BAD_TIMES.values(), ids=BAD_TIMES)
def test_time_that_does_not_increase_is_refused_by_sample(time, words):
    with pytest.raises(InvalidParameterError, match=words) as caught:
        at(time)
    assert str(caught.value).startswith("time must be finite and increase within a segment")


def test_a_window_keeps_the_samples_between_two_times():
    labels = np.arange(500) // 200
    whole = contact(segment=labels, source="probe.csv", provenance={"force": "tared"})
    part = whole.window(0.1, 0.25)
    keep = (SIGNALS.time >= 0.1) & (SIGNALS.time <= 0.25)
    for name in CHANNELS:
        assert np.array_equal(getattr(part, name), getattr(SIGNALS, name)[keep])
    assert [p.stop - p.start for p in part.segments()] == [100, 51]
    assert part.source == "probe.csv"
    assert part.provenance["force"] == "tared"
    assert "0.1 s to 0.25 s" in part.provenance["window"]
    assert len(whole.window()) == 500
    assert whole.window(start=0.4).time[0] == 0.4
    assert whole.window(stop=0.1).time[-1] == 0.1
    words = r"probe.csv: there is no sample between 7 s and 8 s.* 0 s to 0.499 s"
    with pytest.raises(RecordingError, match=words):
        whole.window(7.0, 8.0)


TOUCH = exciting(MATERIALS["ball"], seconds=0.2, noise=0.05)
GOOD = {
    "penetration": np.array([1.0, 2.0, 3.0]) * 1e-3,
    "velocity": np.array([0.0, 0.1, 0.2]),
    "force": np.array([1.0, 2.0, 3.0]),
}


def single(channels):
    return [channel.astype(np.float32) for channel in channels]


NARROW = [channel.astype(np.float64) for channel in single(TOUCH.arrays)]
WHOLE = [np.arange(1, 9), np.arange(8) % 3, 5 * np.arange(1, 9)]
FLOATS = [1.0 * channel for channel in WHOLE]
SPELLINGS = {
    "lists": (TOUCH.arrays, [channel.tolist() for channel in TOUCH.arrays]),
    "strided views": (TOUCH.arrays, np.column_stack([*TOUCH.arrays, TOUCH.time]).T[:3]),
    "single precision": (NARROW, single(TOUCH.arrays)),
    "big endian": (TOUCH.arrays, [channel.astype(">f8") for channel in TOUCH.arrays]),
    "one time step": ([*TOUCH.arrays, np.full(200, 2e-3)], [*TOUCH.arrays, 2e-3]),
    "one step of NumPy": ([*TOUCH.arrays, np.full(200, 2e-3)], [*TOUCH.arrays, np.array(2e-3)]),
    "whole numbers": (
        [*FLOATS, np.ones(8)],
        [WHOLE[0], WHOLE[1].astype(np.int8), WHOLE[2].astype(np.uint16), 1],
    ),
}


@pytest.mark.parametrize("plain, spelled", SPELLINGS.values(), ids=SPELLINGS)
def test_samples_may_be_numbers_of_any_type(kind, plain, spelled):
    for channel in (each for each in spelled if isinstance(each, np.ndarray)):
        channel.flags.writeable = False
    trace = kind().replay(*spelled)
    assert bits(trace) == bits(kind().replay(*plain))
    assert trace.taken.any()


def test_a_trace_is_as_long_as_its_signals_and_cut_like_an_array(kind):
    trace = kind().replay(*TOUCH.arrays)
    assert len(trace) == len(TOUCH)
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


def test_a_prediction_is_the_present_law_and_0_out_of_contact(kind, noisy):
    estimator = kind()
    for row in noisy.rows[:50]:
        estimator.update(*row)
        assert estimator.predict(8e-3, -0.02) == estimator.estimate().law.force(8e-3, -0.02)
        assert estimator.predict(-1e-3, 0.05) == 0.0
