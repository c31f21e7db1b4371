"""``palpate info`` on every kind of file, and the survey of clocks and channels behind it."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from containers import COLUMNS, write_hdf5, write_jpk, write_parquet
from recordings import recording

from palpate.input.recordings import Faults, Recording
from palpate.input.recordings.survey import survey
from palpate.input.recordings.times import clock_rank, clock_unit
from palpate.output.figures.strips import MOST_STRIPS, draw_strips


def test_warnings_are_printed_without_control_characters(printed, tmp_path):
    path = write_hdf5(tmp_path / "a.h5", {"red\x1b[31m": np.arange(9.0), "time\r": np.arange(9.0)})
    with h5py.File(path, "r+") as file:
        file.create_dataset("huge", shape=(10**10,), dtype="f8", chunks=(1000,))
        file["words"] = ["a", "b"]
        file.attrs["subject"] = "phantom [3]"
        file.attrs["by"] = "me\x1b]0;title\x07"
    out = printed("info", path)
    assert not any(sign in out for sign in "\x1b\x07\r")
    assert "red\\x1b[31m" in out
    assert "note: subject: phantom [3]" in out
    assert "skipped: words: holds text" in out
    assert "damaged: huge: none of its 10000000000 values was written" in out


def test_the_json_has_all_that_the_tables_have(printed, tmp_path):
    columns = {**COLUMNS, "gap": np.where(np.arange(600) < 2, np.nan, 1.0)}
    out = printed("info", write_parquet(tmp_path / "a.parquet", columns), "--json")
    found = json.loads(out)
    [clock] = found["clocks"]
    assert (clock["name"], clock["rate"]) == ("time_s", pytest.approx(1000.0))
    by_name = {channel["name"]: channel for channel in found["channels"]}
    assert by_name["gap"]["known"] == 598
    assert by_name["force_N"]["maximum"] == COLUMNS["force_N"].max()
    assert found["losses"] == []


@pytest.mark.parametrize("name", ["time_s", "rosbagTimestamp", "Prüfzeit [s]"])
def test_the_clock_is_the_time_that_identify_takes(run, tmp_path, name):
    columns = {"z_mm": COLUMNS["penetration_m"] * 1e3, "fz_N": COLUMNS["force_N"]}
    path = write_parquet(tmp_path / "a.parquet", {name: COLUMNS["time_s"], **columns})
    found = json.loads(run("info", path, "--json")[1])
    [clock] = found["clocks"]
    assert (clock["name"], clock["rate"]) == (name, pytest.approx(1000.0))
    assert found["channels"][0]["role"] == "time"


def test_channels_may_be_chosen(run, tmp_path):
    path = write_hdf5(
        tmp_path / "a.h5", {f"g{k}/{n}": np.arange(9.0) for k in range(3) for n in ("time", "f")}
    )
    found = json.loads(run("info", path, "--channel", "g1", "--channel", "g2/f", "--json")[1])
    names = {channel["name"] for channel in found["channels"]}
    assert names == {"g1/time", "g1/f", "g2/time", "g2/f"}


def test_a_force_map_lists_its_curves(run, printed, tmp_path):
    curves = [(np.arange(200) * k, np.arange(200)) for k in range(1, 12)]
    path = write_jpk(tmp_path / "map.jpk-force-map", curves)
    lines = printed("info", path).splitlines()
    assert lines[1] == "force map of 11 curves; --curve N shows one"
    assert len(lines) == 12
    assert lines[3].split()[0] == "0"
    assert lines[-1] == "and 3 more; see --json"
    listed = json.loads(run("info", path, "--json")[1])["curves"]
    assert [curve["samples"] for curve in listed] == [200] * 11
    assert listed[0]["peak_force"] == pytest.approx(99.5 * 6e-8 * 0.02 * 3e-4)
    out = printed("info", path, "--curve", 1)
    assert "height (measured)" in out
    assert "spring constant: 0.02 N/m" in out


def test_info_prints_the_role_of_each_channel(printed, tmp_path):
    names = ["time_s", "depth_mm", "load_N", "goal_pos", "fz_V", "torque", "still_force", "state"]
    names += [f"a rather long name of a channel that nobody uses, number {k}" for k in range(38)]
    table = np.arange(40.0)[:, None] * np.ones(46)
    table[:, 6] = 3.0
    path = tmp_path / "r.csv"
    np.savetxt(path, table, delimiter="\t", header="\t".join(names), comments="")
    out = printed("info", path).splitlines()
    assert len(out) < 46 + 10
    rows = {
        name: next(line for line in out[::-1] if line.startswith(f"{name} ")) for name in names[:8]
    }
    for name, words in {
        "time_s": "time ", "depth_mm": "penetration ", "load_N": "force ",
        "goal_pos": "commanded", "fz_V": "in V, no force",
        "torque": "a torque", "still_force": "never changes", "state": "unknown quantity",
    }.items():  # fmt: skip
        assert words in rows[name]


def test_many_channels_are_cut_off_and_said(run, tmp_path):
    path = write_hdf5(tmp_path / "a.h5", {f"c{k:03}": np.arange(9.0) for k in range(100)})
    assert "and 40 more channels: --channel NAME or --json" in run("info", path)[1]


def test_a_strip_chart_has_a_strip_for_each_channel_that_varies(run, printed, tmp_path):
    columns = {**COLUMNS, "still": np.ones(600)}
    path, chart = write_parquet(tmp_path / "a.parquet", columns), tmp_path / "a.svg"
    content = path.read_bytes()
    assert printed("info", path, "--figure", chart, "--dark").endswith(f"figure: {chart}\n")
    ElementTree.parse(chart)
    for words in ("a.parquet: 2 of 4 channels vary", "since the first time_s [s]"):
        assert words in chart.read_text()
    drawn_over = tmp_path / "b.svg"
    drawn_over.hardlink_to(path)
    assert run("info", path, "--figure", drawn_over)[0] == 2
    assert path.read_bytes() == content


def strips_of(channels):
    made = Recording(channels)
    return draw_strips(made, survey(made))


def test_a_chart_says_how_many_channels_it_leaves_out():
    figure = strips_of({f"$c{k}$": np.arange(9.0) for k in range(40)})
    assert len(figure.axes) == MOST_STRIPS
    assert "first 24 of 40 varying channels" in figure.get_suptitle()
    assert figure.axes[0].get_title(loc="left") == "$c0$"
    figure = strips_of({"f": np.zeros(5), "w": np.array(["a"] * 5, dtype=object)})
    assert figure.axes == []
    assert "0 of 2 channels" in figure.get_suptitle()


def test_a_spike_of_one_sample_in_a_million_is_drawn():
    values = np.zeros(10**6)
    values[123_456] = 5.0
    [axes] = strips_of({"time": np.arange(10**6) * 1e-3, "f": values}).axes
    [line] = axes.lines
    assert line.get_ydata().max() == 5.0
    assert len(line.get_xdata()) < 5000
    assert line.get_xdata()[np.argmax(line.get_ydata())] == pytest.approx(123.456, abs=1.3)


def test_lines_break_at_gaps_and_unknown_values():
    time = np.arange(100.0)
    time[50:] += 100.0
    values = np.arange(100.0)
    values[10] = np.nan
    [line] = strips_of({"time": time, "f": values}).axes[0].lines
    assert np.isnan(line.get_ydata()).sum() == 2


def test_faults_types_and_frames_are_printed(run, tmp_path, monkeypatch):
    made = Recording(
        {"/ft.f": np.array([1.0, np.nan]), "/ft.log_time": np.array([0, 10**9])},
        {"/ft.log_time": "ns"},
        source="probe.csv",
        clocks={"/ft.f": "/ft.log_time"},
        frames={"/ft.f": "tool"},
        types={"/ft": "geometry_msgs/msg/WrenchStamped"},
        faults={"/ft.f": Faults(1, 1, "abc")},
    )
    monkeypatch.setattr("palpate.input.recordings.open_recording", lambda *a, **k: made)
    out = run("info", recording(tmp_path))[1]
    fault = "fault: /ft.f: 1 of 2 values are not numbers; the first, at sample 1, is abc"
    assert all(words in out for words in ("geometry_msgs/msg/WrenchStamped", "tool", fault))


def test_the_description_that_is_shown_is_the_one_that_is_printed(run, tmp_path, monkeypatch):
    root = Path(__file__).parents[2]
    page = (root / "docs" / "reference" / "files" / "hdf5.md").read_text()
    (tmp_path / "examples").symlink_to(root / "examples")
    monkeypatch.chdir(tmp_path)
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], {})
    shown = re.search(r"```text\n(.*?)```", page, re.DOTALL)[1]
    assert run("info", "probing.h5", "--figure", "probing.svg")[1].split() == shown.split()


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


def test_nanosecond_times_keep_microsecond_steps():
    clock = the_clock(1_763_800_000_000_000_000 + 1_000 * np.arange(50), "ns")
    # A float of such seconds has steps of 0.24 µs.
    assert clock.step == pytest.approx(1e-6, rel=1e-12)
    assert clock.start == pytest.approx(1.7638e9)
    for name in ("time_ms", "Time (ms)", "t_ms", "log/stamp_msec"):
        assert clock_unit(name) == "ms"
        assert the_clock(np.arange(10.0), name=name).rate == pytest.approx(1000.0)
    # Testing machines and lecturers' tables state minutes.
    assert the_clock(np.arange(10.0), "min").step == pytest.approx(60.0)


def test_without_a_clock_samples_are_counted():
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
