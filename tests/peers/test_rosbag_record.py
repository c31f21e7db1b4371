"""Bags that the recorder of ROS 1 wrote, closed and killed.

Debian has it: ``apt-get install python3-rosbag python3-rospy python3-rosmaster
python3-geometry-msgs``. Everything listens on this machine only.
"""

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from palpate.errors import RecordingError
from palpate.input.recordings import open_recording
from peers.rosbag_publisher import numbers

pytestmark = [pytest.mark.peers, pytest.mark.slow]

PUBLISHER = Path(__file__).with_name("rosbag_publisher.py")
COUNT = 400
PAUSE = "0.003"  # s: the recorder's queue of a hundred then lasts, on a busy machine, for 0.3 s


@pytest.fixture(scope="module")
def ros(tmp_path_factory) -> Iterator[dict[str, str]]:
    if missing := absent("rosbag"):
        pytest.skip(f"ROS 1 is not installed: no {missing}")
    with master(tmp_path_factory.mktemp("ros")) as environment:
        yield environment


@contextmanager
def recorder(ros, folder: Path, *options: str) -> Iterator[subprocess.Popen]:
    command = ["rosbag", "record", *options, "-O", "probe.bag", "/ft", "/pose"]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=ros,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait(10)


def publish(ros, count: int = COUNT) -> None:
    subprocess.run([PYTHON, PUBLISHER, str(count), PAUSE], env=ros, check=True, timeout=60)


def assert_begins_as_published(found, least: int) -> None:
    rows = np.array(numbers(COUNT))
    names = {
        "/ft": [f"wrench.{what}.{axis}" for what in ("force", "torque") for axis in "xyz"],
        "/pose": [f"pose.position.{axis}" for axis in "xyz"]
        + [f"pose.orientation.{axis}" for axis in "xyzw"],
    }
    first = 0
    for topic, fields in names.items():
        stamps = found.channels[f"{topic}.header.stamp"]
        count = len(stamps)
        assert least <= count <= COUNT
        assert (stamps == 1_700_000_000 * 10**9 + 10**6 * np.arange(count)).all()
        for k, field in enumerate(fields, start=first):
            values = found.channels[f"{topic}.{field}"]
            assert values.tobytes() == np.ascontiguousarray(rows[:count, k]).tobytes()
        first = len(fields)
        assert (np.diff(found.channels[f"{topic}.log_time"]) >= 0).all()
    assert found.frames["/ft.wrench.force.x"] == "sensor"
    assert found.types["/pose"] == "geometry_msgs/msg/PoseStamped"


@pytest.mark.parametrize("options", [[], ["--bz2"], ["--lz4"]], ids=["plain", "bz2", "lz4"])
def test_recordings_of_rosbag_are_read_exactly(ros, tmp_path, options) -> None:
    with recorder(ros, tmp_path, *options) as process:
        publish(ros)
        os.killpg(process.pid, signal.SIGINT)
        process.wait(20)
        # The recorder that the command started closes the bag when it has written all of it.
        wait_for((tmp_path / "probe.bag").exists, "the bag")
    found = open_recording(tmp_path / "probe.bag")
    assert not found.losses
    assert_begins_as_published(found, COUNT)


@pytest.mark.parametrize("options", [[], ["--bz2"], ["--lz4"]], ids=["plain", "bz2", "lz4"])
def test_a_bag_of_a_killed_recorder_is_read_after_reindexing(ros, tmp_path, options) -> None:
    with recorder(ros, tmp_path, "--chunksize=16", *options) as process:
        publish(ros)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait(20)
    path = tmp_path / "probe.bag.active"
    with pytest.raises(RecordingError, match="was not closed by its recorder") as caught:
        open_recording(path)
    cure = str(caught.value).rpartition("with: ")[2]
    subprocess.run(cure.split(), env=ros, check=True, timeout=60, stdout=subprocess.DEVNULL)
    # A chunk of 16 kB has some 45 messages of each; what the recorder still held is gone.
    assert_begins_as_published(open_recording(path), COUNT // 2)


PYTHON = "/usr/bin/python3"  # the one that Debian's packages are for


def absent(*programs: str) -> str:
    """What of ROS 1 is missing on this machine."""
    missing = [name for name in (*programs, "rosmaster", PYTHON) if shutil.which(name) is None]
    if not missing:
        ask = [PYTHON, "-c", "import rospy, geometry_msgs.msg"]
        if subprocess.run(ask, capture_output=True, env=clean()).returncode:
            missing = ["rospy"]
    return ", ".join(missing)


def clean() -> dict[str, str]:
    """The environment, without the paths of our Python."""
    return {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}


@contextmanager
def master(home: Path) -> Iterator[dict[str, str]]:
    """A master of its own, on a free port; the environment in which it is found."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = clean() | {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(home),
    }
    with (home / "master.log").open("wb") as log:
        command = ["rosmaster", "--core", "-p", str(port)]
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        wait_for(lambda: _listens(port), "rosmaster")
        yield environment
    finally:
        process.terminate()
        process.wait(10)


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def wait_for(done, what: str) -> None:
    deadline = time.monotonic() + 20.0
    while not done():
        assert time.monotonic() < deadline, f"{what} did not come"
        time.sleep(0.02)
