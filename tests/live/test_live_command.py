"""``palpate live``, its sessions and recordings: what is printed and refused; what is read back."""

import gc
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cases import MATERIALS
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from scripted import (
    Endless,
    Failing,
    Hanging,
    Looking,
    Scripted,
    T,
    arrivals,
    column,
    in_a_process,
    looped,
    measured,
)

import palpate
from palpate import OnlinePreparation
from palpate.live import run, running
from palpate.live.choices import LiveCommand
from palpate.live.console import summary
from palpate.live.recorder import Recorder, RunFile
from palpate.live.ring import COLUMNS
from palpate.live.view import seconds, share
from palpate.writing import create_new_file

BARE = ("--no-page", "--no-diagnosis")


def started(*arguments, **options):
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
        ("nowhere.csv", "SOURCE must be the path of a recording, or one of lab:ball"),
        ("lab:ball,waltz", "motion must be one of"),
        ("lab:ball --method magic", "magic"),
        ("lab:ball --exponent 90", "exponent"),
        ("lab:ball --exponent 1.5 --method kelvin-voigt", "kelvin-voigt cannot fix an exponent"),
        (
            "lab:ball --law auto --method single-stage",
            "method single-stage does not identify law auto, only the hunt-crossley law",
        ),
        ("lab:ball --law magic", "law must be one of hunt-crossley, auto, half"),
        ("lab:ball --direction down", "--direction must be three numbers"),
        ("lab:ball --tare soon", "--tare must be a number"),
        ("lab:ball --seconds -1", "--seconds must be in"),
        ("lab:ball --rate 20", "--rate must be in [100, 10000] Hz, not 20"),
        ("lab:ball --speed 2", "lab:ball is not a recording: omit --speed"),
        ("lab:ball --publish fax:1", "--publish must begin with one of"),
        ("lab:ball --record no/such/folder/a.mcap", "no/such/folder"),
    ],
)
def test_impossible_live_options_are_refused_in_one_line(arguments, words, refused):
    assert words in refused("live", *arguments.split(), *BARE)


@pytest.mark.long
def test_a_recording_is_replayed_printed_and_recorded(recording, tmp_path):
    copy = tmp_path / "copy.mcap"
    process = piped(recording, "--record", copy, "--speed", 1.6)  # a line at once and one later
    out, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (0, "")
    lines = out.splitlines()
    assert any(each.startswith(f"{recording}: 2000 samples, 19") for each in lines)
    assert any(each.startswith("update, estimate") for each in lines)
    assert "0 lost before the loop" in out
    assert re.search(
        r"contact · stiffness (20\d\d|199\d).* N/m at .* mm.*; damping .* N·s/m at .* mm.*Hz", out
    )
    assert f"recorded 2000 rows to {copy}" in out


@pytest.mark.long
@pytest.mark.parametrize("output", [pytest.param("closed", marks=pytest.mark.slow), "full"])
def test_a_blocked_output_ends_nothing(recording, tmp_path, output):
    copy = tmp_path / "copy.mcap"
    arguments = f"{recording} --record {copy} --no-page --no-diagnosis --speed 20"
    where = {"closed": ">&-", "full": "> /dev/full"}[output]
    done = subprocess.run(
        f"{sys.executable} -m palpate live {arguments} {where}",
        shell=True, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert len(palpate.open_recording(copy).numbers("/input.force")) == 2000


@pytest.mark.long
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
        "6.3 µs", "0.42 ms", "2 s", "–",
    ]  # fmt: skip
    # What is not all is never rounded to all.
    assert [share(each) for each in (1.0, 0.999_934, 0.9, None)] == [
        "100 %", "99.9934 %", "90 %", "–",
    ]  # fmt: skip


def test_the_summary_says_what_each_sink_dropped():
    said = {"page": {"dropped": 3}, "recorder": {"said": "done"}}
    lines = list(summary({"source": "robot"}, said))
    assert "rows dropped: 3 by the page, 0 by the recorder" in lines
    assert lines[-1] == "done"


def test_the_summary_has_the_last_message_that_held_no_sample():
    counts = {"malformed": 2, "last_fault": "force is not\x1b a number"}
    lines = list(summary({"source": "zmq", "counts": counts}, {}))
    assert "0 lost before the loop, 2 malformed" in lines
    [last] = [line for line in lines if line.startswith("the last one refused: force is not")]
    assert "\x1b" not in last


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


@pytest.mark.long
def test_sinks_see_every_row_and_free_their_memory(tmp_path):
    sinks = [Looking(tmp_path / "one", "one"), Looking(tmp_path / "two", "two")]
    status = run(Endless(500), None, sinks)
    taken = status["counts"]["taken"]
    for name in ("one", "two"):
        assert (tmp_path / name).read_text() == f"{taken} 0 True"
    assert taken == 500
    assert status["counts"]["lost"] == 0


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


@pytest.mark.long
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


# An interrupted import is in tests/test_under_attack.py too.
@pytest.mark.long
@pytest.mark.parametrize("wait", [pytest.param(0.4, marks=pytest.mark.slow), 0.7])
def test_ctrl_c_while_the_sinks_begin_is_quiet_too(tmp_path, wait):
    """Ctrl-C comes while the process imports, or while it starts the sinks."""
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


@pytest.mark.long
def test_ctrl_c_while_sinks_start_leaves_no_process(tmp_path):
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
def test_refused_realtime_rights_are_reported():
    out, _ = in_a_process(REALTIME, stdout=subprocess.PIPE).communicate()
    first, second = out.splitlines()
    assert re.match("no fixed priority: .*rtprio", first)
    assert re.match("memory is not locked: .*memlock", second)


def test_the_loop_runs_first_and_without_the_collector_until_it_ends():
    seen = []
    niceness = partial(os.getpriority, os.PRIO_PROCESS, 0)
    before = niceness(), sys.getswitchinterval()

    class Asking(Endless):
        def take(self, timeout):
            seen.append((gc.isenabled(), niceness() <= before[0], sys.getswitchinterval()))
            return super().take(timeout)

    assert gc.isenabled()
    run(Asking(5))
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
    assert set(seen) == {(False, True, 5e-4)}
    assert (niceness(), sys.getswitchinterval()) == before


def test_two_sinks_of_one_name_are_refused(tmp_path):
    with pytest.raises(palpate.InvalidParameterError, match="different names, not one, one"):
        run(Endless(5), None, [Looking(tmp_path, "one"), Looking(tmp_path, "one")])


TIMES, POSITIONS, FORCES = measured(1.5)
LATER = [1.0 + time for time in TIMES]


def paced(times, positions, forces):
    """A source in real time, as the recorder is."""

    def come():
        began = time.monotonic()
        for arrival in arrivals(times, positions, forces):
            due = began + arrival.time - times[0]
            time.sleep(max(due - time.monotonic(), 0.0))
            yield arrival._replace(there=due)

    return Scripted(come())


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A second and a half that was recorded from the beginning on; and what the loop did itself."""
    folder = tmp_path_factory.mktemp("recorded")
    path = folder / "touch.mcap"
    path.write_bytes(b"somebody's")
    source = paced(LATER, POSITIONS, FORCES)
    run(source, None, [Recorder(path)], preparation=OnlinePreparation())
    assert path.read_bytes() == b"somebody's"
    return folder / "touch-2.mcap"


@pytest.mark.long
def test_a_recording_is_not_written_over_another(recorded, tmp_path):
    assert recorded.exists()
    for name in ("a.mcap", "a-2.mcap", "a-3.mcap"):
        file, path = create_new_file(tmp_path / "a.mcap")
        file.close()
        assert path.name == name


def test_a_recording_is_read_back_as_it_arrived(recorded):
    recording = palpate.open_recording(recorded, strict=True)
    np.testing.assert_array_equal(recording.numbers("/input.position"), POSITIONS)
    np.testing.assert_array_equal(recording.numbers("/input.force"), FORCES)
    stamps = recording.channels["/input.stamp"]
    np.testing.assert_array_equal(stamps, [round(1e9 * time) for time in LATER])


def test_channels_of_a_recording_are_recognised(recorded):
    law = palpate.identify(str(recorded)).estimate.law
    assert law.stiffness_at(8e-3) == pytest.approx(MATERIALS["ball"].stiffness_at(8e-3), rel=0.02)


def test_a_saved_verdict_equals_that_of_the_loop(recorded):
    _, rows = looped(arrivals(LATER, POSITIONS, FORCES))
    rows = rows[np.isfinite(column(rows, "time"))]
    recording = palpate.open_recording(recorded)
    pairs = {
        "travel": "penetration", "rate": "velocity", "felt": "force", "offset": "offset",
        "predicted": "predicted_force", "beginning": "surface", "margin": "margin",
        "state": "state", "status": "status", "parameters[2]": "parameter_2",
        "covariance[5]": "covariance_5",
    }  # fmt: skip
    for name, of_row in pairs.items():
        found = recording.channels[f"/estimate.{name}"]
        np.testing.assert_array_equal(found, column(rows, of_row), name)


def test_other_libraries_read_the_file(recorded):
    with recorded.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [message for _, _, _, message in reader.iter_decoded_messages()]
        notes = [each.metadata for each in reader.iter_metadata() if each.name == "palpate"]
    inputs = [each for each in messages if hasattr(each, "force")]
    assert [each.force for each in inputs] == FORCES
    assert len(messages) - len(inputs) == len(TIMES) - 16  # a window has to be seen first
    assert notes[0]["source"] == "scripted source"  # later ones say what changed


@pytest.mark.long
def test_vectors_are_recorded_as_they_came(tmp_path):
    positions = [(0.4, 0.1, -x) for x in POSITIONS[:400]]
    source = paced(TIMES[:400], positions, [(0.0, 1.0, f) for f in FORCES[:400]])
    path = tmp_path / "space.mcap"
    preparation = OnlinePreparation(direction=[0, 0, -1], flip=["force"])
    run(source, None, [Recorder(path)], preparation=preparation)
    recording = palpate.open_recording(path)
    # What has to be said to identify it again.
    assert "flip=['force']" in recording.notes["palpate.preparation"]
    assert "direction=[0, 0, -1]" in recording.notes["palpate.preparation"]
    found = np.column_stack([recording.numbers(f"/input.position.{axis}") for axis in "xyz"])
    np.testing.assert_array_equal(found, positions)


def test_changes_during_a_run_are_recorded(tmp_path):
    commands = [(300, LiveCommand("estimator", {"method": "kelvin-voigt"}))]
    loop, rows = looped(arrivals(TIMES, POSITIONS, FORCES), commands=commands)
    end = {**loop.status(), "preparation": "tare_time=0.5", "tare": 0.5, "generation": 300}
    begin = {**end, "method": "variable-projection", "tare": None}
    file, path = create_new_file(tmp_path / "a.mcap")
    recording = RunFile(path, file)
    recording.write(rows[:400].tolist(), begin, 0)
    rows[400:, COLUMNS.index("method")] = 300.0
    recording.write(rows[400:].tolist(), end, 0)
    recording.finish()
    found = palpate.open_recording(path)
    assert found.notes["palpate.tare"] == "being measured"
    assert found.notes["palpate.method by row 1500, estimator 300"] == "kelvin-voigt"
    assert found.notes["palpate.tare by row 1500, estimator 300"].startswith("0.5 N")
    assert found.channels["/estimate.method"][-1] == 300


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no disk that is always full")
def test_a_disk_that_is_full_ends_the_recording_in_words():
    _, rows = looped(arrivals(TIMES, POSITIONS, FORCES))
    full = Path("/dev/full")
    recording = RunFile(full, full.open("wb"))  # which closes it
    words = recording.write(rows.tolist(), {}, 0)
    assert recording.failed
    assert words.startswith("/dev/full: No space left on device")


SESSION = """
import mmap
from pathlib import Path
from scripted import Endless
from palpate.live import run
from palpate.live.recorder import Recorder

class Counted(Endless):
    # How many have come stands in a file, which outlives a kill.
    def open(self):
        super().open()
        file = open({path!r} + ".count", "wb+")
        file.write(bytes(8))
        file.flush()
        self.come = memoryview(mmap.mmap(file.fileno(), 8)).cast("q")
    def take(self, timeout):
        arrival = super().take(timeout)
        self.come[0] += 1
        return arrival

run(Counted(), None, [Recorder(Path({path!r}))])
"""


def sinks_of(process):
    """Its children, but for the one that gives shared memory back."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    commands = {int(each): Path(f"/proc/{each}/cmdline").read_bytes() for each in children}
    return [each for each, command in commands.items() if b"resource_tracker" not in command]


def killed(folder, seconds):
    """Record in processes of their own, kill all of each after some time; how much was lost, s.

    Of what had come to the loop: how long that was held up on a busy machine is no loss.
    """
    processes = []
    for k, wait in enumerate(seconds):
        path = folder / f"{k}.mcap"
        # Its tracker says on standard error what it gives back.
        process = in_a_process(SESSION.format(path=str(path)), stderr=subprocess.DEVNULL)
        processes.append((process, path, wait))
    lost = []
    for process, path, wait in processes:
        while not path.exists() or not path.stat().st_size:
            time.sleep(0.01)
        time.sleep(wait)
        for each in (process.pid, *sinks_of(process.pid)):
            os.kill(each, signal.SIGKILL)
        process.wait()
        recording = palpate.open_recording(path)
        written = recording.numbers("/input.stamp")
        assert any("the file is cut off" in words for words in recording.losses)
        assert (np.diff(written) > 0).all()
        come = int.from_bytes(Path(f"{path}.count").read_bytes(), sys.byteorder)
        assert 0 < len(written) <= come
        lost.append((come - len(written)) * T)
    return lost


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="of Linux: its table of processes")
def test_a_killed_recorder_loses_at_most_a_second(tmp_path):
    assert max(killed(tmp_path, [0.31])) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(25))
def test_fifty_killed_recorders_lose_at_most_a_second(tmp_path, batch):
    waits = np.random.default_rng(batch).uniform(0.05, 1.5, 2)
    assert max(killed(tmp_path, waits.tolist())) < 1.0
