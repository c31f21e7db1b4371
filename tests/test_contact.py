"""A contact: four channels on one clock, in segments."""

import dataclasses
import math

import numpy as np
import pytest
from cases import MATERIALS, exciting

from palpate import Contact, InvalidParameterError, RecordingError
from palpate.preparation.velocity import velocity_of

SIGNALS = exciting(MATERIALS["ball"], seconds=0.5)


def contact(**changes) -> Contact:
    given = dataclasses.asdict(SIGNALS)
    return Contact(**{**given, **changes})


def test_it_holds_what_it_was_given():
    made = contact(source="probe.csv", made={"force": "tared"})
    for name in ("time", "penetration", "velocity", "force"):
        assert np.array_equal(getattr(made, name), getattr(SIGNALS, name))
    assert len(made) == len(SIGNALS)
    assert made.source == "probe.csv"
    assert made.made == {"force": "tared"}
    assert list(made.segments()) == [slice(0, len(SIGNALS))]


def test_it_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        contact().force = np.zeros(3)


def test_whole_numbers_and_lists_are_taken():
    made = Contact([0, 1, 2], [1, 2, 3], [1, 1, 1], [5, 6, 7])
    assert made.force.dtype == np.float64
    assert made.penetration.tolist() == [1.0, 2.0, 3.0]


def test_velocity_that_is_not_given_comes_from_the_penetration():
    made = contact(velocity=None)
    assert np.array_equal(made.velocity, velocity_of(SIGNALS.time, SIGNALS.penetration))
    assert "Savitzky" in made.made["velocity"]
    longer = contact(velocity=None, velocity_window=0.05)
    expected = velocity_of(SIGNALS.time, SIGNALS.penetration, 0.05)
    assert np.array_equal(longer.velocity, expected)


def test_velocity_is_never_taken_across_a_segments_border():
    parts = [slice(0, 100), slice(100, 101), slice(101, 103), slice(103, 500)]
    labels = np.concatenate([np.full(p.stop - p.start, k) for k, p in enumerate(parts)])
    jump = SIGNALS.penetration + 1e-3 * labels
    made = contact(velocity=None, penetration=jump, segment=labels)
    for part in parts:
        assert np.array_equal(made.velocity[part], velocity_of(SIGNALS.time[part], jump[part]))
    across = contact(velocity=None, penetration=jump)
    assert np.max(np.abs(across.velocity)) > 5.0 * np.max(np.abs(made.velocity))


@pytest.mark.parametrize(
    "labels",
    [["a", "a", "b", "b", "a"], [1, 1, 0, 0, 1], [0.5, 0.5, 2.5, 2.5, 0.5]],
    ids=["words", "numbers", "fractions"],
)
def test_another_segment_begins_where_the_label_changes(labels):
    made = Contact(range(5), np.ones(5), np.ones(5), np.ones(5), segment=labels)
    assert list(made.segments()) == [slice(0, 2), slice(2, 4), slice(4, 5)]


def test_each_segment_may_have_a_clock_of_its_own():
    made = Contact(
        [5.0, 5.1, 5.2, 0.0, 0.3, 0.6, 0.9], np.ones(7), np.ones(7), np.ones(7),
        segment=[0, 0, 0, 1, 1, 1, 1],
    )  # fmt: skip
    assert made.sample_time == pytest.approx(0.3, rel=1e-12)
    expected = [0.3, 0.1, 0.1, 0.3, 0.3, 0.3, 0.3]
    np.testing.assert_allclose(made.time_steps, expected, rtol=1e-12)  # rounding of 5.1 − 5.0


def test_the_sample_time_of_a_lone_sample_is_a_millisecond():
    assert Contact([0.0], [1.0], [1.0], [1.0]).sample_time == 1e-3
    assert len(Contact([], [], [], [])) == 0


BAD_TIMES = {
    "backwards": ([0.0, 0.1, 0.05, 0.2], "sample 2 is 0.05 s after 0.1 s"),
    "repeated": ([0.0, 0.1, 0.1, 0.2], "sample 2 is 0.1 s after 0.1 s"),
    "not known": ([0.0, math.nan, 0.1, 0.2], "sample 1 is nan s after 0.0 s"),
    "not known from the start": ([math.nan, 0.0, 0.1, 0.2], "sample 0 is nan s$"),
    "endless twice": ([0.0, 0.1, math.inf, math.inf], "sample 2 is inf s after 0.1 s"),
    "endless": ([0.0, 0.1, 0.2, math.inf], "sample 3 is inf s after 0.2 s"),
}


@pytest.mark.parametrize("time, words", BAD_TIMES.values(), ids=BAD_TIMES)
def test_time_that_does_not_increase_is_refused_by_sample(time, words):
    with pytest.raises(InvalidParameterError, match=words) as caught:
        Contact(time, np.ones(4), np.ones(4), np.ones(4))
    assert str(caught.value).startswith("time must be finite and increase within a segment")


@pytest.mark.parametrize("name", ["time", "penetration", "velocity", "force", "segment"])
def test_arrays_of_different_length_are_refused_by_name(name):
    values = np.arange(7.0)
    with pytest.raises(InvalidParameterError, match="same length") as caught:
        contact(**{name: values})
    assert f"{name} has 7" in str(caught.value)


@pytest.mark.parametrize("name", ["time", "penetration", "velocity", "force"])
@pytest.mark.parametrize("bad", [["a"] * 500, np.ones((500, 1)), np.ones(500) * 1j])
def test_arrays_of_another_type_are_refused_by_name(name, bad):
    with pytest.raises(InvalidParameterError, match=f"^{name} must be"):
        contact(**{name: bad})


def test_a_force_has_to_be_given():
    with pytest.raises(InvalidParameterError, match="force must be given"):
        Contact([0.0], [1.0])


def test_a_window_keeps_the_samples_between_two_times():
    labels = np.arange(500) // 200
    whole = contact(segment=labels, source="probe.csv", made={"force": "tared"})
    part = whole.window(0.1, 0.25)
    keep = (SIGNALS.time >= 0.1) & (SIGNALS.time <= 0.25)
    for name in ("time", "penetration", "velocity", "force"):
        assert np.array_equal(getattr(part, name), getattr(SIGNALS, name)[keep])
    assert [p.stop - p.start for p in part.segments()] == [100, 51]
    assert part.source == "probe.csv"
    assert part.made["force"] == "tared"
    assert "0.1 s to 0.25 s" in part.made["window"]


def test_a_window_may_be_open_at_either_end():
    whole = contact()
    assert len(whole.window()) == 500
    assert whole.window(start=0.4).time[0] == 0.4
    assert whole.window(stop=0.1).time[-1] == 0.1


def test_a_window_leaves_the_velocity_as_it_is():
    whole = contact(velocity=None)
    assert np.array_equal(whole.window(0.1, 0.2).velocity, whole.velocity[100:201])


def test_a_window_without_a_sample_is_refused_with_the_times_there_are():
    with pytest.raises(RecordingError, match=r"probe.csv: no sample between 7 s and 8 s") as caught:
        contact(source="probe.csv").window(7.0, 8.0)
    assert "0 s to 0.499 s" in str(caught.value)
