"""A master of ROS 1 for tests: Debian's, on this machine only.

``apt-get install python3-rosbag python3-rospy python3-rosmaster python3-geometry-msgs``.
"""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
