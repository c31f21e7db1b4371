"""Times in tables of text: of the calendar and since 1970, exact to the nanosecond."""

import numpy as np
import pytest
from recordings import written

from palpate import open_recording

# 2024-02-29 12:30:00 UTC: 19782 days from 1970 and 12.5 h.
SECONDS = (19782 * 24 + 12) * 3600 + 1800
NANOSECONDS = SECONDS * 10**9


def read(tmp_path, text):
    return open_recording(written(tmp_path / "t.csv", text))


@pytest.mark.parametrize(
    "cell, nanoseconds",
    [
        ("2024-02-29T12:30:00", 0),
        ("2024-02-29 12:30:00", 0),
        ("2024-02-29T12:30", 0),
        ("2024-02-29T12:30:00Z", 0),
        ("2024-02-29T12:30:00.25Z", 250_000_000),
        ("2024-02-29T12:30:00.123456789", 123_456_789),
        ("2024-02-29T12:30:00.1234567899Z", 123_456_789),
        ("2024-02-29T14:30:00.000000001+02:00", 1),
        ("2024-02-29T05:30:00-0700", 0),
        ('"2024-02-29 12:30:00,5"', 500_000_000),
    ],
)
def test_a_date_is_nanoseconds_since_1970(tmp_path, cell, nanoseconds):
    recording = read(tmp_path, f"when,x\n{cell},1\n{cell},2\n")
    assert recording.channels["when"].dtype == np.int64
    assert recording.channels["when"].tolist() == [NANOSECONDS + nanoseconds] * 2
    assert recording.units["when"] == "ns"


def test_a_row_without_a_time_is_left_out_and_said(tmp_path):
    rows = ["2024-02-29T12:30:00", "", "2024-02-30T12:30:00", "2024-02-29T12:30:01"]
    text = "when,x\n" + "".join(f"{cell},{k}\n" for k, cell in enumerate(rows))
    recording = read(tmp_path, text)
    assert recording.channels["x"].tolist() == [0.0, 3.0]
    assert list(recording.rows) == [2, 5]
    [loss] = recording.losses
    assert "2 rows were left out" in loss
    assert "row 3" in loss


@pytest.mark.parametrize("unit, size", [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
@pytest.mark.parametrize("name", ["time", "%time", "field.header.stamp", "Timestamp", "t"])
def test_a_whole_number_since_1970_is_exact(tmp_path, unit, size, name):
    times = [SECONDS * size + k for k in range(3)]
    text = f"{name},x\n" + "".join(f"{time},1\n" for time in times)
    recording = read(tmp_path, text)
    assert recording.channels[name].dtype == np.int64
    assert recording.channels[name].tolist() == times
    assert recording.units[name] == unit


def test_a_number_of_that_size_is_no_time_by_another_name(tmp_path):
    recording = read(tmp_path, "t,counts\n0,1700000000\n1,1700000001\n")
    assert recording.channels["counts"].dtype == np.float64
    assert recording.channels["t"].dtype == np.float64
    assert recording.units == {}


def test_fractions_of_a_second_since_1970_stay_as_written(tmp_path):
    recording = read(tmp_path, "time,x\n1700000000.25,1\n1700000000.5,1\n")
    assert recording.channels["time"].tolist() == [1700000000.25, 1700000000.5]
    assert recording.units["time"] == "s"


@pytest.mark.parametrize(
    "seconds, nanoseconds, name",
    [
        ("field.header.stamp.secs", "field.header.stamp.nsecs", "field.header.stamp"),
        ("/ft/header/stamp/sec", "/ft/header/stamp/nanosec", "/ft/header/stamp"),
        ("sec", "nsec", "stamp"),
    ],
)
def test_seconds_and_nanoseconds_make_one_stamp(tmp_path, seconds, nanoseconds, name):
    text = f"{seconds},{nanoseconds},x\n{SECONDS},999999999,1\n{SECONDS + 1},1,2\n"
    recording = read(tmp_path, text)
    assert recording.channels[name].dtype == np.int64
    assert recording.channels[name].tolist() == [NANOSECONDS + 10**9 - 1, NANOSECONDS + 10**9 + 1]
    assert recording.units[name] == "ns"
    assert seconds in recording.channels
