"""A contact: four channels on one clock, in segments. It prepares nothing and reads nothing."""

import dataclasses
import math

import numpy as np
import pytest
from cases import MATERIALS, exciting

from palpate import Contact, InvalidParameterError, RecordingError

SIGNALS = exciting(MATERIALS["ball"], seconds=0.5)
CHANNELS = ("time", "penetration", "velocity", "force")


def contact(**changes) -> Contact:
    return Contact(**{**vars(SIGNALS), **changes})


def at(time, segment=None) -> Contact:
    """Ones at these times."""
    ones = np.ones(len(time))
    return Contact(time, penetration=ones, velocity=ones, force=ones, segment=segment)


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
    with pytest.raises(InvalidParameterError, match="segment must be one label a sample"):
        at(range(3), segment=labels)


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


def test_a_window_may_be_open_at_either_end_and_is_refused_where_no_sample_is():
    whole = contact(source="probe.csv")
    assert len(whole.window()) == 500
    assert whole.window(start=0.4).time[0] == 0.4
    assert whole.window(stop=0.1).time[-1] == 0.1
    words = r"probe.csv: no sample between 7 s and 8 s.* 0 s to 0.499 s"
    with pytest.raises(RecordingError, match=words):
        whole.window(7.0, 8.0)
