"""``palpate live`` and its sessions: what is printed and refused; sinks end in order."""

import gc
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scripted import Endless, Failing, Hanging, Looking, in_a_process, measured

import palpate
from palpate.live import run, running
from palpate.live.console import summary
from palpate.live.view import percent, seconds

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
def test_what_cannot_be_done_is_one_line(arguments, words, refused):
    assert words in refused("live", *arguments.split(), *BARE)


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


def test_sinks_see_every_row_and_end_in_order_and_the_memory_is_given_back(tmp_path):
    sinks = [Looking(tmp_path / "one", "one"), Looking(tmp_path / "two", "two")]
    status = run(Endless(500), None, sinks)
    taken = status["counts"]["taken"]
    for name in ("one", "two"):
        assert (tmp_path / name).read_text() == f"{taken} 0 True"
    assert taken == 500
    assert status["counts"]["lost"] == 0
    names = (tmp_path / "one.began").read_text().split()
    assert len(names) == 5
    assert not any((Path("/dev/shm") / name.lstrip("/")).exists() for name in names)


@pytest.mark.slow
def test_a_sink_that_hangs_is_ended_and_one_that_ends_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "PATIENCE", 0.3)
    status = run(Endless(), None, [Hanging(tmp_path / "pid"), Failing()], seconds=1.0)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
    assert any("failing has ended" in words for words in status["said"])


def session(path):
    """A run in a process of its own, in front of its terminal; it prints how many it took."""
    code = f"""
from pathlib import Path
from scripted import Endless, Looking
from palpate.live import run
print(run(Endless(), None, [Looking(Path({str(path)!r}))])["counts"]["taken"])
"""
    pipe = subprocess.PIPE
    return in_a_process(code, stdout=pipe, stderr=pipe, start_new_session=True)


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_ctrl_c_ends_the_loop_and_its_sinks_in_order(tmp_path, number):
    path = tmp_path / "seen"
    process = session(path)
    until = time.monotonic() + 60.0
    while not path.with_suffix(".began").exists() and time.monotonic() < until:
        time.sleep(0.02)
    time.sleep(0.1)
    process.send_signal(number)
    out, error = process.communicate(timeout=20)
    assert (process.returncode, error) == (0, "")
    assert path.read_text() == f"{int(out)} 0 True"


def ended_by_ctrl_c(process):
    """What it wrote to its standard error, and how often Ctrl-C had to come again."""
    for again in range(4):
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all in front of it
        try:
            return process.communicate(timeout=15)[1], again
        except subprocess.TimeoutExpired:
            continue
    os.killpg(process.pid, signal.SIGKILL)
    raise AssertionError(f"Ctrl-C did not end it: {process.communicate()[1]}")


def test_ctrl_c_while_the_sinks_begin_is_quiet_too(tmp_path):
    for wait in (0.4, 0.7):  # importing, and starting
        process = session(tmp_path / "seen")
        time.sleep(wait)
        error, again = ended_by_ctrl_c(process)
        # Python itself loses one that comes within a callback of an import, and says so.
        assert again <= error.count("Exception ignored in: <function _get_module_lock")
        # Of the script itself, which has no main that says nothing; Python chains another to one
        # that comes while a class is made.
        assert error.count("Traceback") <= 1 + error.count("was the direct cause")
        assert "spawn_main" not in error


class Interrupting(Looking):
    """Ctrl-C comes when its process has been started, and before anything else is."""

    def handed_over(self):
        os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_between_two_sinks_that_are_started_leaves_nobody_behind(tmp_path):
    before = signal.getsignal(signal.SIGINT)
    sinks = [Interrupting(tmp_path / "one", "one"), Looking(tmp_path / "two", "two")]
    assert run(Endless(), None, sinks)["counts"]["taken"] == 0
    assert (tmp_path / "one").read_text() == "0 0 True"
    assert not (tmp_path / "two").exists()
    assert multiprocessing.active_children() == []
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.slow
def test_an_error_of_the_source_ends_the_sinks_too(tmp_path):
    class Broken(Endless):
        def open(self):
            raise OSError("the cable is out")

    with pytest.raises(OSError, match="cable"):
        run(Broken(), None, [Looking(tmp_path / "seen")])
    assert (tmp_path / "seen").read_text() == "0 0 True"


REALTIME = """
import ctypes, os, resource
from palpate.live.realtime import ask_for_realtime
for limit in (resource.RLIMIT_MEMLOCK, resource.RLIMIT_RTPRIO):
    resource.setrlimit(limit, (0, 0))
if os.getuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
print(*ask_for_realtime(), sep=chr(10))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="of Linux")
def test_what_realtime_is_not_allowed_is_said():
    out, _ = in_a_process(REALTIME, stdout=subprocess.PIPE).communicate()
    first, second = out.splitlines()
    assert re.match("no fixed priority: .*rtprio", first)
    assert re.match("memory is not locked: .*memlock", second)


def test_the_collector_is_out_of_the_loop_and_back_afterwards():
    seen = []

    class Asking(Endless):
        def take(self, timeout):
            seen.append(gc.isenabled())
            return super().take(timeout)

    assert gc.isenabled()
    run(Asking(5))
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
    assert not any(seen)


def test_two_sinks_of_one_name_are_refused(tmp_path):
    with pytest.raises(palpate.InvalidParameterError, match="different names, not one, one"):
        run(Endless(5), None, [Looking(tmp_path, "one"), Looking(tmp_path, "one")])
