"""Nodes of ROS 1 that are rospy's own: samples to palpate, estimates back."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from palpate import OnlinePreparation
from palpate.errors import PalpateError
from peers.ros1 import PYTHON, absent, master
from peers.rosbag_publisher import numbers

pytestmark = [pytest.mark.peers, pytest.mark.slow]
HERE = Path(__file__).parent
COUNT = 2_000


@pytest.fixture
def ros(tmp_path, monkeypatch) -> Iterator[dict[str, str]]:
    if missing := absent():
        pytest.skip(f"ROS 1 is not installed: no {missing}")
    with master(tmp_path) as environment:
        for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME"):
            monkeypatch.setenv(name, environment[name])
        yield environment


def test_rospy_publishes_samples_and_hears_estimates(ros) -> None:
    from palpate.live import run
    from palpate.live.sinks.opening import open_publisher
    from palpate.live.sources import SourceOptions, open_source

    listener = subprocess.Popen(
        [PYTHON, HERE / "rospy_listener.py"],
        env=ros,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    robot = None
    try:
        assert listener.stdout.readline() == "listening\n"
        source = open_source("ros1:/pose,/ft", SourceOptions(vectors=True))
        sink = open_publisher("ros1:/palpate")
        # When the listener has met the publisher, which begins with the loop.
        command = ["sh", "-c", f"sleep 4; exec {PYTHON} {HERE}/rosbag_publisher.py {COUNT} 0.001"]
        robot = subprocess.Popen(command, env=ros)
        preparation = OnlinePreparation(direction=[0, 0, 1])
        status = run(source, sinks=[sink], preparation=preparation, seconds=12.0)
        assert robot.wait(10) == 0
        heard, _ = listener.communicate(timeout=10)
    finally:
        for process in filter(None, (listener, robot)):
            process.kill()
            process.wait()
    counts = status["counts"]
    assert counts["taken"] == COUNT
    assert [counts[name] for name in ("lost", "malformed", "unpaired")] == [0, 0, 0]
    said = json.loads(heard)
    named = dict(zip(said["names"].split(","), said["values"], strict=True))
    assert said["estimates"] == COUNT
    assert named["time"] == pytest.approx(1_700_000_000 + 1e-3 * (COUNT - 1), abs=1e-6)
    assert said["types"]["status"] == "diagnostic_msgs/DiagnosticArray"
    assert said["status"] > 5


def test_numbers_come_to_the_last_bit(ros) -> None:
    from palpate.live.sources import SourceOptions, open_source

    source = open_source("ros1:/pose,/ft", SourceOptions(vectors=True))
    source.open()
    robot = subprocess.Popen([PYTHON, HERE / "rosbag_publisher.py", "200", "0.001"], env=ros)
    try:
        found = [arrival for _ in range(400) if (arrival := source.take(0.05)) is not None]
        assert robot.wait(10) == 0
    finally:
        robot.kill()
        source.close()
    rows = numbers(200)
    assert [each.force for each in found] == [tuple(row[:3]) for row in rows]
    assert [each.position for each in found] == [tuple(row[6:9]) for row in rows]


def test_without_a_master_there_is_one_clear_line(ros, monkeypatch) -> None:
    from palpate.live.sources import open_source

    source = open_source("ros1:/pose,/ft?master=http://127.0.0.1:1")
    with pytest.raises(PalpateError, match=r"no master of ROS answers at http://127.0.0.1:1"):
        source.open()
