"""A session: sinks in processes of their own, which end in order, and hold nobody."""

import gc
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scripted import Endless, Failing, Hanging, Looking, in_a_process

import palpate
from palpate.live import run, running

SHM = Path("/dev/shm")


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
    assert not any((SHM / name.lstrip("/")).exists() for name in names)


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
    status = run(Endless(), None, sinks)
    assert status["counts"]["taken"] == 0
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
