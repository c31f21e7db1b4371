"""``palpate live``: what it prints, and what it refuses, in one line."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scripted import measured

import palpate
from palpate.live.console import percent, seconds, summary

BARE = ("--no-page", "--no-diagnosis")


def started(*arguments, **options):
    """``palpate live`` of its own, without page and diagnosis."""
    command = [sys.executable, "-m", "palpate", "live", *map(str, arguments), *BARE]
    return subprocess.Popen(command, **options)


def piped(*arguments):
    pipe = subprocess.PIPE
    return started(*arguments, stdout=pipe, stderr=pipe, text=True)


@pytest.fixture
def recording(tmp_path):
    times, positions, forces = measured(2.0)
    path = tmp_path / "touch.csv"
    rows = np.column_stack([times, positions, forces])
    np.savetxt(path, rows, delimiter=",", header="time_s,penetration_m,force_N", comments="")
    return path


@pytest.mark.parametrize(
    "arguments, words",
    [
        ("nowhere.csv", "SOURCE must be a recording's path, or one of lab:ball"),
        ("lab:ball,waltz", "motion must be one of"),
        ("lab:ball --method magic", "magic"),
        ("lab:ball --exponent 90", "exponent"),
        ("lab:ball --exponent 1.5 --method kelvin-voigt", "the law of kelvin-voigt has none"),
        (
            "lab:ball --law auto --method single-stage",
            "law auto and method single-stage do not go together",
        ),
        ("lab:ball --law magic", "law must be one of hunt-crossley, auto, any"),
        ("lab:ball --direction down", "--direction must be three numbers"),
        ("lab:ball --rate 20", "--rate must be from 100 to 10000 samples a second, not 20"),
        ("lab:ball --speed 2", "--speed has no effect: lab:ball is no recording"),
        ("lab:ball --publish fax:1", "--publish must be one of"),
        ("lab:ball --record no/such/folder/a.mcap", "no/such/folder"),
    ],
)
def test_what_cannot_be_done_is_one_line(arguments, words, run):
    status, out, error = run("live", *arguments.split(), *BARE)
    assert status == 2
    assert out == ""
    assert words in error
    assert error.count("\n") == 1


def test_a_recording_is_replayed_printed_and_recorded(recording, tmp_path):
    copy = tmp_path / "copy.mcap"
    process = piped(recording, "--record", copy, "--speed", 1.6)  # a line at once and one later
    out, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (0, "")
    lines = out.splitlines()
    assert any(each.startswith(f"{recording}: 2000 samples, 19") for each in lines)
    assert any(each.startswith("update, estimate") for each in lines)
    assert "0 lost before the loop" in out
    assert re.search(r"contact · (20\d\d|199\d).* N/m, .* N·s/m at .* mm", out)
    assert f"recorded 2000 rows to {copy}" in out


@pytest.mark.parametrize("output", [pytest.param("closed", marks=pytest.mark.slow), "full"])
def test_an_output_that_takes_nothing_ends_nothing_in_tears(recording, tmp_path, output):
    copy = tmp_path / "copy.mcap"
    arguments = f"{recording} --record {copy} --no-page --no-diagnosis --speed 20"
    where = {"closed": ">&-", "full": "> /dev/full"}[output]
    done = subprocess.run(
        f"{sys.executable} -m palpate live {arguments} {where}",
        shell=True, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert len(palpate.open_recording(copy).numbers("/input.force")) == 2000


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="no children are listed there")
def test_a_recorder_that_is_killed_ends_in_an_error(recording, tmp_path):
    copy = tmp_path / "copy.mcap"
    process = piped(recording, "--record", copy)
    until = time.monotonic() + 60.0
    while not (copy.exists() and copy.stat().st_size) and time.monotonic() < until:
        time.sleep(0.01)
    for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
        if any(each.resolve() == copy for each in Path(f"/proc/{child}/fd").iterdir()):
            os.kill(int(child), signal.SIGKILL)
    out, error = process.communicate(timeout=60)
    assert process.returncode == 2
    assert error.startswith(f"palpate: {copy}: the recorder failed")
    assert error.count("\n") == 1
    assert "2000 samples" in out  # the loop itself went on
    assert palpate.open_recording(copy).numbers("/input.force").size < 2000


def test_times_and_fractions_are_written_for_a_person():
    assert [seconds(each) for each in (6.3e-6, 4.2e-4, 2.0, None)] == [
        "6.3 µs", "420 µs", "2 s", "–",
    ]  # fmt: skip
    # What is not all is never rounded to all.
    assert [percent(each) for each in (1.0, 0.999_934, 0.9, None)] == [
        "100 %", "99.9934 %", "90 %", "–",
    ]  # fmt: skip


def test_the_summary_says_what_each_sink_dropped():
    said = {"page": {"dropped": 3}, "recorder": {"said": "done"}}
    lines = list(summary({"source": "robot"}, said))
    assert "rows dropped: 3 by the page, 0 by the recorder" in lines
    assert lines[-1] == "done"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="of Linux: it reads /proc")
def test_nothing_is_lost_with_page_recording_and_diagnosis(monkeypatch):
    """The benchmark of the loop, for some seconds: what does not depend on other work."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2]))
    from benchmarks.live import measure

    rows = {row.name.strip(): row.value for row in measure(0.2, realtime=False, method=None).rows}
    assert rows["lost before the estimator"] == 0
    assert rows["refused"] == 0
    assert rows["samples taken"] > 10_000
    for process in ("loop", "page", "recorder", "lab", "diagnosis", "browser"):
        assert rows[process] > 0.0
