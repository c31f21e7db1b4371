"""The ROS 2 package ``ros/``: its node's logic and its controller, driven without ROS."""

import os
import re
import struct
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import zmq
from message_files import Maker
from rosbags.typesys import get_types_from_msg

import palpate
from benchmarks.live_wires import FAULTY_FROM, faulty_robot
from palpate.findings import LOOP_CHECKS
from palpate.live import ros, schema

ROOT = Path(__file__).parents[2] / "ros"
sys.path.append(str(ROOT / "palpate_ros"))
from palpate_ros import gain, identifier  # noqa: E402

KIND = "palpate_msgs/msg/ContactEstimate"
POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
START = 1_700_000_000_000_000_000  # ns
# What the diagnostics say of each fault: level, first words; and the controller's last action.
HEARD = {
    "stuck": (2, "stuck force", "stop: do not trust"),
    "late": (2, "late force", "stop: do not trust"),
    "saturated": (2, "saturation", "stop: do not trust"),
    "lost contact": (0, "lost contact", "hold: lost contact"),
    "unplugged": (3, "no pose and no wrench", "stop: no estimate for"),
    "clock stands": (3, "no pose has a wrench at its stamp", "stop: no estimate for"),
}


@pytest.fixture(scope="module")
def maker():
    made = Maker()
    text = (ROOT / "palpate_msgs" / "msg" / "ContactEstimate.msg").read_text(encoding="utf-8")
    own = get_types_from_msg(text, KIND)
    made.store.register({name: each for name, each in own.items() if "palpate" in name})
    return made


def messages(maker, fault, until):
    """Poses and wrenches as CDR, each with the time at which it arrives, s."""
    depth, force = faulty_robot(fault)
    stop = FAULTY_FROM if fault == "unplugged" else until
    for k in range(round(1e3 * stop)):
        stamp = START + k * 1_000_000
        if fault == "clock stands":
            stamp = min(stamp, START + round(FAULTY_FROM * 1e9))
        pose = maker.pose(stamp, [0.0, 0.0, -depth[k], 0.0, 0.0, 0.0, 1.0])
        wrench = maker.wrench(stamp, [0.0, 0.0, -force[k], 0.0, 0.0, 0.0])
        for kind, whole in ((POSE, pose), (WRENCH, wrench)):
            yield 1e-3 * k, kind, bytes(maker.store.serialize_cdr(whole, kind))


def encode(maker, values):
    """As rclpy would."""
    types = maker.store.types
    stamp = types["builtin_interfaces/msg/Time"](0, 0)
    header = types["std_msgs/msg/Header"](stamp, "base_link")
    arrays = {name: np.array(values[name]) for name in ("parameters", "standard_errors")}
    whole = types[KIND](header=header, **{**values, **arrays})
    return bytes(maker.store.serialize_cdr(whole, KIND, little_endian=True))


@pytest.mark.long
@pytest.mark.parametrize("fault", HEARD)
def test_what_a_faulty_robot_does_reaches_the_diagnostics_and_the_controller(maker, fault):
    until = FAULTY_FROM + 1.5
    node = identifier.ContactIdentifier(identifier.Settings(wrench_frame="base"))
    controller = gain.GainController()
    for now, kind, data in messages(maker, fault, until):
        if FAULTY_FROM - 2e-3 < now < FAULTY_FROM:
            before = node.diagnose(now)
        take = node.take_pose if kind == POSE else node.take_wrench
        for values in take(maker.store.deserialize_cdr(data, kind), now):
            controller.take(SimpleNamespace(**values), now)
    controller.watch(until)
    found = node.diagnose(until)
    level, words, action = HEARD[fault]
    assert (before.level, before.message) == (0, "in contact")
    assert before.values["stiffness_usable"] == "True"
    assert (found.level, found.message.startswith(words)) == (level, True), found
    assert controller.action.startswith(action)
    assert (controller.gain > 0.0) is (fault == "lost contact")
    if fault in ("lost contact", "unplugged", "clock stands"):
        assert float(found.values["age"]) == pytest.approx(1.5, abs=0.3)
        assert found.values["stiffness_usable"] == "False"
    # A listener of the wires reads what the node sends.
    last = ros.read_estimate(encode(maker, values))
    assert last["number"] == node.counts["taken"] - 1
    assert last["flags"] == found.values["flags"]


def test_the_node_and_the_message_have_the_checks_and_version_of_the_wires():
    assert identifier.SCHEMA == gain.SCHEMA == schema.SCHEMA
    assert {str(check): bit for bit, check in LOOP_CHECKS.items()} == identifier.CHECKS
    faults = [identifier.CHECKS[check] for check in identifier.FAULTS]
    assert sum(faults) == gain.FAULTY
    assert identifier.CHECKS["lost contact"] == gain.LOST_CONTACT
    for source in ROOT.rglob("*.py"):
        compile(source.read_text(encoding="utf-8"), source, "exec")
    parameters = (ROOT / "palpate_ros" / "config" / "palpate.yaml").read_text(encoding="utf-8")
    named = set(re.findall(r"^    (\w+):", parameters, re.MULTILINE))
    known = {each.name for each in fields(identifier.Settings)}
    assert named - known == {"source", "base_frame", "tool_frame", "bandwidth", "oldest"}
    assert known <= named
    with pytest.raises(palpate.InvalidParameterError, match="wrench_frame must be tool or base"):
        identifier.ContactIdentifier(identifier.Settings(wrench_frame="world"))


GOOD = {
    **{field.name: 0 for field in schema.ESTIMATE_FIELDS},
    **dict.fromkeys(("method", "law", "selected_law", "parameter_names", "flags"), ""),
    **{"schema": 4, "stiffness_mark": -1, "age": 0.01, "stiffness": 2000.0},
    **{"stiffness_usable": True, "parameters": [], "standard_errors": []},
}
REACTIONS = [
    ({}, "follow"),
    ({"schema": 5}, "stop: the message has schema 5, this controller reads 4"),
    ({"checks": 16, "stiffness_mark": 0}, "hold: lost contact"),
    ({"stiffness_mark": 0}, "stop: do not trust"),
    ({"checks": 8, "flags": "late force"}, "stop: do not trust"),
    ({"age": np.nan}, "stop: the estimate is"),
    ({"age": 0.7}, "stop: the estimate is"),
    ({"stiffness": np.nan}, "hold: not usable"),
    ({"stiffness_usable": False, "stiffness": 4000.0}, "hold: not usable"),
]


@pytest.mark.parametrize("change, action", REACTIONS)
def test_the_controller_reacts_to_each_reason_not_to_act(change, action):
    controller = gain.GainController(bandwidth=10.0)
    controller.take(SimpleNamespace(**GOOD), 0.0)
    controller.take(SimpleNamespace(**{**GOOD, **change}), 0.001)
    assert controller.action.startswith(action)
    least = 10.0 / np.nan_to_num(change.get("stiffness", 2000.0), nan=2000.0)
    assert controller.gain == (0.0 if action.startswith("stop") else least)
    controller.watch(1.0)
    assert (controller.gain, controller.action) == (0.0, "stop: no estimate for 1.0 s")


@pytest.mark.long
def test_the_controller_in_cpp_reacts_as_that_of_ros(tmp_path):
    """Also to packets that are none."""
    if not Path("/usr/include/zmq.h").is_file():
        pytest.skip("no libzmq3-dev")
    source = ROOT.parent / "examples" / "cpp" / "wire_controller.cpp"
    compiler = os.environ.get("CXX", "c++")
    program = tmp_path / "controller"
    subprocess.run([compiler, "-std=c++20", source, "-lzmq", "-o", program], check=True)
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    port = publisher.bind_to_random_port("tcp://127.0.0.1")
    command = [program, f"tcp://127.0.0.1:{port}", "6"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        publisher.recv()  # it has subscribed
        for change, action in REACTIONS[1:]:
            for values, words in (({**GOOD, **change}, action), (GOOD, "follow")):
                data = schema.pack_estimate(values)
                publisher.send_multipart([b"estimate", data])
                assert running.stdout.readline().startswith(words.partition(" the estimate")[0])
        for junk in (b"", b"\4", struct.pack("<I", 4), b"{" * 5000, b"\0" * 288):
            publisher.send_multipart([b"estimate", junk])
            publisher.send_multipart([b"estimate", schema.pack_estimate(GOOD)])
            assert running.stdout.readline().startswith("stop: the message ")
            assert running.stdout.readline() == "follow: usable\n"
        assert running.stdout.read().splitlines() == ["stop: no estimate arrives", "gain 0"]
    publisher.close(0)
    assert running.returncode == 0
