"""What is recorded is read back; of a process that is killed all but the last second."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from cases import MATERIALS
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from scripted import Scripted, T, arrivals, column, in_a_process, looped, measured

import palpate
from palpate import OnlinePreparation
from palpate.live import run
from palpate.live.choices import LiveCommand
from palpate.live.recorder import Recorder, RunFile
from palpate.live.ring import COLUMNS
from palpate.writing import opened_new

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


def test_a_recording_is_not_written_over_another(recorded, tmp_path):
    assert recorded.exists()
    for name in ("a.mcap", "a-2.mcap", "a-3.mcap"):
        file, path = opened_new(tmp_path / "a.mcap")
        file.close()
        assert path.name == name


def test_what_came_is_read_back_as_it_came(recorded):
    recording = palpate.open_recording(recorded, strict=True)
    np.testing.assert_array_equal(recording.numbers("/input.position"), POSITIONS)
    np.testing.assert_array_equal(recording.numbers("/input.force"), FORCES)
    stamps = recording.channels["/input.stamp"]
    np.testing.assert_array_equal(stamps, [round(1e9 * time) for time in LATER])


def test_a_recording_is_identified_without_a_word_about_its_channels(recorded):
    law = palpate.identify(str(recorded)).estimate.law
    assert law.stiffness_at(8e-3) == pytest.approx(MATERIALS["ball"].stiffness_at(8e-3), rel=0.02)


def test_what_was_found_is_that_of_the_loop_to_the_last_bit(recorded):
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


def test_others_read_it_too(recorded):
    with recorded.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [message for _, _, _, message in reader.iter_decoded_messages()]
        notes = {metadata.name: metadata.metadata for metadata in reader.iter_metadata()}
    inputs = [each for each in messages if hasattr(each, "force")]
    assert [each.force for each in inputs] == FORCES
    assert len(messages) - len(inputs) == len(TIMES) - 16  # a window has to be seen first
    assert notes["palpate"]["source"] == "scripted source"


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


def test_what_changes_meanwhile_stands_in_the_recording(tmp_path):
    commands = [(300, LiveCommand("estimator", {"method": "kelvin-voigt"}))]
    loop, rows = looped(arrivals(TIMES, POSITIONS, FORCES), commands=commands)
    end = {**loop.status(), "preparation": "tare_time=0.5", "tare": 0.5, "generation": 300}
    begin = {**end, "method": "variable-projection", "tare": None}
    file, path = opened_new(tmp_path / "a.mcap")
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
        assert any("ends before its end" in words for words in recording.losses)
        assert (np.diff(written) > 0).all()
        come = int.from_bytes(Path(f"{path}.count").read_bytes(), sys.byteorder)
        assert 0 < len(written) <= come
        lost.append((come - len(written)) * T)
    return lost


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="of Linux: its table of processes")
def test_of_a_recording_that_is_killed_all_but_the_last_second_is_there(tmp_path):
    assert max(killed(tmp_path, [0.31])) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(25))
def test_of_fifty_recordings_that_are_killed_too(tmp_path, batch):
    waits = np.random.default_rng(batch).uniform(0.05, 1.5, 2)
    assert max(killed(tmp_path, waits.tolist())) < 1.0
