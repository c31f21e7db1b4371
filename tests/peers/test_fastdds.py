"""ROS 2's usual middleware, eProsima Fast DDS, as a robot: samples to palpate, estimates back.

Debian has it: ``apt-get install fastddsgen libfastrtps-dev``. Its program is generated from ROS's
types and compiled here; everything stays on this machine.
"""

import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from palpate.input.preparation.online import OnlinePreparation
from palpate.live.schema import SCHEMA

pytestmark = [pytest.mark.peers, pytest.mark.slow]

SOURCES = Path(__file__).with_name("fastdds")
DOMAIN = 60 + os.getpid() % 40
JUNK = 1_000


@pytest.fixture(scope="module")
def program(tmp_path_factory) -> Path:
    """The robot."""
    pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install '.[live]'")
    compiler = os.environ.get("CXX", "c++")
    missing = [each for each in ("fastddsgen", compiler) if shutil.which(each) is None]
    if not missing and not Path("/usr/include/fastrtps").is_dir():
        missing = ["libfastrtps-dev"]
    if missing:
        pytest.skip(f"Fast DDS is not installed: no {', '.join(missing)}")
    folder = tmp_path_factory.mktemp("fastdds")
    for name in ("Probe.idl", "peer.cpp"):
        shutil.copy(SOURCES / name, folder)
    run = {"cwd": folder, "check": True, "timeout": 300, "capture_output": True}
    subprocess.run(["fastddsgen", "-replace", "Probe.idl"], **run)
    files = ["peer.cpp", "Probe.cxx", "ProbePubSubTypes.cxx"]
    libraries = ["-lfastrtps", "-lfastcdr", "-lpthread"]
    subprocess.run([compiler, "-std=c++17", *files, "-o", "peer", *libraries], **run)
    return folder / "peer"


def session(program: Path, count: int, junk: int) -> tuple[dict, list[str]]:
    """What the loop counted, and what the robot heard of it."""
    from palpate.live import run
    from palpate.live.sources import SourceOptions, open_source
    from palpate.live.wires import open_publisher

    command = [program, str(DOMAIN), str(count), str(junk)]
    robot = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    begin = threading.Timer(4.0, lambda: (robot.stdin.write("begin\n"), robot.stdin.flush()))
    try:
        source = open_source(f"dds:/pose,/wrench?domain={DOMAIN}", SourceOptions(vectors=True))
        begin.start()
        status = run(
            source,
            sinks=[open_publisher(f"dds:/palpate?domain={DOMAIN}")],
            preparation=OnlinePreparation(direction=[0, 0, -1]),
            seconds=6.0 + 1e-3 * count,
        )
        heard, _ = robot.communicate("end\n", timeout=30)
    finally:
        begin.cancel()
        robot.kill()
        robot.wait()
    return status, heard.splitlines()


def test_a_robot_on_fast_dds_sends_samples_and_hears_estimates(program) -> None:
    status, (estimates, names, said) = session(program, 3_000, 0)
    counts = status["counts"]
    assert counts["taken"] == 3_000
    assert not counts["last_fault"]
    assert [counts[name] for name in ("lost", "malformed", "unpaired", "refused")] == [0, 0, 0, 0]
    heard, version, time, *values = estimates.split()
    named = dict(zip(names.split(), map(float, values), strict=False))
    assert (int(heard), int(version)) == (3_000, SCHEMA)
    # The robot's material: F = 500 N/m · x.
    assert named["K"] == pytest.approx(500.0, rel=1e-3)
    assert named["n"] == pytest.approx(1.0, abs=1e-3)
    assert float(time) == pytest.approx(1_700_000_002.999, abs=1e-6)
    assert int(said.split()[0]) > 5
    assert said.split()[1] == "palpate"


def test_messages_that_are_none_cost_no_sample(program) -> None:
    """Cyclone DDS drops them, and writes a line for each to standard error."""
    status, _ = session(program, 2_000, JUNK)
    assert status["counts"]["taken"] == 2_000
    assert status["counts"]["lost"] == 0


def test_the_node_of_ros_identifies_what_fast_dds_sends(program) -> None:
    """Its callbacks get the messages that rosbags decodes, as rclpy's executor would call them."""
    from cyclonedds.core import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from message_files import typestore

    from palpate.live.dds import participant, raw_type

    sys.path.append(str(Path(__file__).parents[2] / "ros" / "palpate_ros"))
    from palpate_ros.identifier import ContactIdentifier, Settings

    node = ContactIdentifier(Settings(wrench_frame="base"))
    member = participant(DOMAIN, None)
    qos = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(5_000))
    topics = {"pose": "PoseStamped", "wrench": "WrenchStamped"}
    kinds = {name: f"geometry_msgs/msg/{kind}" for name, kind in topics.items()}
    readers = {
        name: DataReader(member, Topic(member, f"rt/{name}", raw_type(kind)), qos=qos)
        for name, kind in kinds.items()
    }
    command = [program, str(DOMAIN), "3000", "0"]
    estimates = []
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as robot:
        time.sleep(4.0)
        robot.stdin.write("begin\n")
        robot.stdin.flush()
        until = time.monotonic() + 10.0
        while len(estimates) < 3_000 and time.monotonic() < until:
            for name, reader in readers.items():
                for each in reader.take(256):
                    if each.sample_info.valid_data:
                        message = typestore().deserialize_cdr(each.raw, kinds[name])
                        take = node.take_pose if name == "pose" else node.take_wrench
                        estimates += take(message, time.monotonic())
            time.sleep(0.001)
        robot.kill()
    assert node.counts["taken"] == len(estimates) == 3_000
    assert node.counts["unpaired"] == node.counts["refused"] == node.counts["repeated"] == 0
    assert estimates[-1]["parameters"][0] == pytest.approx(500.0, rel=1e-3)
    assert node.diagnose(time.monotonic() + 1.0).level == 3  # the robot has left
