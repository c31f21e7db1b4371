"""What a survey says of clocks and channels, against recordings made to have it."""

import numpy as np
import pytest

from palpate.recordings import Recording
from palpate.recordings.survey import survey
from palpate.recordings.times import clock_rank, clock_unit


def the_clock(times, unit: str | None = None, name: str = "time"):
    units = {} if unit is None else {name: unit}
    beside = name.replace(name.rpartition("/")[2], "x")
    channels = {name: np.asarray(times), beside: np.zeros(len(times))}
    [clock] = survey(Recording(channels, units)).clocks
    return clock


def test_a_clock_has_its_rate_by_the_median_step_and_its_span():
    clock = the_clock(2.0 + np.arange(100) * 0.01)
    assert (clock.name, clock.samples, clock.channels) == ("time", 100, ("x",))
    assert clock.rate == pytest.approx(100.0)
    assert (clock.start, clock.span) == pytest.approx((2.0, 0.99))
    assert (clock.gaps, clock.repeated, clock.backward, clock.unknown) == (0, 0, 0, 0)


def test_gaps_repeated_backward_and_unknown_times_are_counted():
    times = np.arange(100) * 0.01
    times[50:] += 0.2  # a step of 0.21 s
    times[70:] += 0.08  # a step of nine: below what is called a gap
    times[20] = times[19]
    times[30], times[31] = times[31], times[30]
    times[90] = np.nan
    clock = the_clock(times)
    assert (clock.gaps, clock.repeated, clock.backward, clock.unknown) == (1, 1, 1, 1)
    assert clock.largest_gap == pytest.approx(0.21)
    assert clock.rate == pytest.approx(100.0)


def test_nanoseconds_keep_steps_of_a_microsecond_and_a_unit_may_stand_in_the_name():
    clock = the_clock(1_763_800_000_000_000_000 + 1_000 * np.arange(50), "ns")
    # A float of such seconds has steps of 0.24 µs.
    assert clock.step == pytest.approx(1e-6, rel=1e-12)
    assert clock.start == pytest.approx(1.7638e9)
    for name in ("time_ms", "Time (ms)", "t_ms", "log/stamp_msec"):
        assert clock_unit(name) == "ms"
        assert the_clock(np.arange(10.0), name=name).rate == pytest.approx(1000.0)


def test_other_words_are_no_clock_and_without_one_samples_are_counted():
    for name in ("tension", "time_to_contact", "torque", "stamped", "x"):
        assert clock_rank(name) is None
    found = survey(Recording({"a": np.zeros(5), "b": np.zeros(7), "c": np.zeros(5)})).clocks
    counted = [(clock.name, clock.samples, clock.channels) for clock in found]
    assert counted == [("", 5, ("a", "c")), ("", 7, ("b",))]
    assert all(np.isnan(clock.rate) for clock in found)


def test_one_time_none_that_is_known_or_none_at_all_has_no_rate():
    assert np.isnan(the_clock([1.0]).rate)
    clock = the_clock([np.nan, np.inf])
    assert clock.unknown == 2
    assert np.isnan(clock.start)
    assert survey(Recording({})).channels == ()
    [channel] = survey(Recording({"x": np.empty(0)})).channels
    assert channel.samples == 0


def test_a_channel_has_its_range_and_what_is_not_known():
    values = np.array([1.0, np.nan, -3.0, np.inf])
    text = np.array(["a", "", " ", "b"], dtype=object)
    ranged, words = survey(Recording({"f": values, "w": text}, {"f": "N"})).channels
    assert (ranged.kind, ranged.unit, ranged.samples, ranged.known) == ("float64", "N", 4, 2)
    assert (ranged.minimum, ranged.maximum) == (-3.0, 1.0)
    assert (words.kind, words.known) == ("text", 2)
