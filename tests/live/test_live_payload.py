"""A live run subtracts the tool's weight and inertia, and names what it needs for that."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from payloads import PAYLOAD, multiply, turn, wrench_of
from scripted import Scripted, T, arrivals, column, looped
from wire_robots import POSE, WRENCH

from palpate import (
    HuntCrossley,
    InvalidParameterError,
    OnlinePreparation,
    PayloadCompensation,
    VariableProjection,
)
from palpate.live import run
from palpate.live.choices import LiveCommand, State
from palpate.live.ros import MessageReader
from palpate.live.sources import Arrival, Counts, SourceOptions
from palpate.live.wires import Pairing, Stamped
from palpate.live.zeromq import PacketError, packed, unpacked

LAW = HuntCrossley(K=2000.0, B=2000.0, n=1.0)
DOWN = [0.0, 0.0, -1.0]


def touching(time):
    """A tool in free air for 1.5 s, which then presses along −z and turns by 15° meanwhile."""
    part = np.clip(time - 1.5, 0.0, 1.0)
    blend = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    depth = -5e-3 + 14e-3 * blend + 2e-3 * np.sin(11.0 * time) + 1e-3 * np.sin(23.0 * time)
    position = np.column_stack([0.02 * np.sin(3.0 * time), 0.0 * time, -depth])
    swing = turn([0, 1, 0], 0.26 * blend * np.sin(2.0 * time))
    tilt = multiply(swing, turn([1, 0, 0], 0.2 * blend))
    return position, multiply(np.broadcast_to([1.0, 0.0, 0.0, 0.0], tilt.shape), tilt)


def measured_touch(seconds=6.0, bias=0.0):
    """What pose and sensor read, and the contact force."""
    time = np.arange(0.0, seconds, T)
    position, orientation = touching(time)
    velocity = -(touching(time + 1e-5)[0] - touching(time - 1e-5)[0])[:, 2] / 2e-5
    force = np.outer(LAW.force(-position[:, 2], velocity), [0.0, 0.0, 1.0])
    wrench = wrench_of(PAYLOAD, time, force, 0.0 * force, touching) + bias
    noise = np.random.default_rng(3).normal(0.0, 0.02, (len(time), 3))
    rows = zip(
        time.tolist(),
        map(tuple, position.tolist()),
        map(tuple, (wrench[:, :3] + noise).tolist()),
        time.tolist(),
        map(tuple, orientation.tolist()),
        strict=True,
    )
    return [Arrival(*row) for row in rows], force[:, 2]


def preparation(**settings):
    return OnlinePreparation(direction=DOWN, flip=["force"], **settings)


def parameters(loop):
    return loop.estimator.estimate().parameters


def known_tool():
    return PayloadCompensation(payload=PAYLOAD)


def test_a_tool_that_turns_is_identified_as_without_weight():
    script, force = measured_touch()
    loop, rows = looped(script, preparation(), VariableProjection(), compensation=known_tool())
    kept = np.isfinite(column(rows, "force"))
    expected = force[np.rint(column(rows, "time")[kept] / T).astype(int)]
    assert np.abs(column(rows, "force")[kept] - expected).std() < 0.03
    np.testing.assert_allclose(
        loop.estimator.estimate().parameters, [2000.0, 2000.0, 1.0], rtol=0.03
    )
    bare, _ = looped(script, preparation(), VariableProjection())
    assert abs(parameters(bare)[0] / 2000.0 - 1.0) > 0.2
    status = loop.status()
    assert status["delay"] == pytest.approx(0.05 + 0.009)
    assert status["payload"] == "less the weight and inertia of 0.7 kg"
    assert bare.status()["payload"] == ""


def test_a_tare_turns_with_the_sensor():
    script, force = measured_touch(bias=np.array([4.0, -3.0, 6.0, 0.0, 0.0, 0.0]))
    for commands in ((), [(300, LiveCommand("tare", {"seconds": 0.8}))]):
        tool = known_tool()
        settings = {} if commands else {"tare_time": 1.0}
        loop, rows = looped(
            script, preparation(**settings), VariableProjection(), commands, compensation=tool
        )
        states = column(rows, "state")
        assert State.TARING in states
        assert states[-1] == State.CONTACT
        kept = np.isfinite(column(rows, "force")) & (column(rows, "time") > 1.4)
        expected = force[np.rint(column(rows, "time")[kept] / T).astype(int)]
        assert np.abs(column(rows, "force")[kept] - expected).max() < 0.15
        assert loop.tare_refused == ""
        assert loop.status()["payload"].endswith("and the bias in free air")


def test_a_tare_in_contact_is_refused_and_leaves_the_bias():
    script, force = measured_touch()
    command = [(4000, LiveCommand("tare", {"seconds": 0.5}))]
    loop, rows = looped(script, preparation(), commands=command, compensation=known_tool())
    assert any("tare refused" in each for each in loop.said)
    assert column(rows, "force")[-1] == pytest.approx(force[-60], abs=0.1)


def test_poses_that_are_none_are_faults_and_change_nothing():
    script, _ = measured_touch(3.0)
    good, _ = looped(script, preparation(), VariableProjection(), compensation=known_tool())
    faulty = []
    for k, arrival in enumerate(script):
        faulty.append(arrival)
        if k % 500 == 499:
            later = arrival._replace(time=arrival.time + 0.3 * T)
            faulty.append(later._replace(orientation=(0.0, 0.0, 0.0, 0.0)))
            faulty.append(later._replace(orientation=(math.nan,) * 4))
            faulty.append(later._replace(force=(math.nan,) * 3))
    loop, _ = looped(faulty, preparation(), VariableProjection(), compensation=known_tool())
    assert loop.counts.refused == 18
    assert any("is not a unit quaternion" in each for each in loop.said)
    np.testing.assert_array_equal(
        loop.estimator.estimate().parameters, good.estimator.estimate().parameters
    )


def test_a_source_without_orientations_is_a_clear_line():
    script = arrivals([0.0], [(0.0, 0.0, 0.0)], [(0.0, 0.0, 0.0)])
    with pytest.raises(InvalidParameterError, match="no orientation, which --payload needs"):
        looped(script, preparation(), compensation=known_tool())


def test_a_run_takes_a_payload():
    script, _ = measured_touch(3.0)
    doubtful = replace(PAYLOAD, mount_mark="with-care")
    found = run(Scripted(script), VariableProjection(), preparation=preparation(), payload=doubtful)
    assert found["payload"].endswith("0.7 kg")
    assert any("payload with care" in each for each in found["said"])
    assert found["counts"]["learned"] > 1000


def test_impossible_commands_are_refused_in_one_line(refused, tmp_path):
    path = tmp_path / "tool.toml"
    PAYLOAD.save(path)
    robot, bare = "zmq:tcp://127.0.0.1:5999", ("--no-page", "--no-diagnosis")
    assert "pass --direction" in refused("live", robot, "--payload", path, *bare)
    words = ("--payload", path, "--direction", "0,0,-1")
    assert "address of a robot" in refused("live", "lab:ball", *words, *bare)
    words = ("--payload", tmp_path / "no.toml", "--direction", "0,0,-1")
    assert "No such file" in refused("live", robot, *words, *bare)


# --- orientations on the wire

POSED = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.0, 0.6, 0.0, 0.8)


def test_a_packet_has_an_orientation_if_it_is_needed():
    for data in (
        packed(7, 1.5, *POSED),
        json.dumps(
            {"number": 7, "time": 1.5}
            | dict(zip(("position", "force", "orientation"), POSED, strict=True))
        ).encode(),
    ):
        packet = unpacked(data, vectors=True, orientation=True)
        assert (packet.position, packet.force, packet.orientation) == POSED
        assert unpacked(data, vectors=True).orientation is None
        assert packet.number == 7
    for data in (packed(7, 1.5, *POSED[:2]), json.dumps({"time": 0, "position": [1, 2, 3],
                 "force": [1, 2, 3], "orientation": [1, 2, 3]}).encode()):  # fmt: skip
        with pytest.raises(PacketError, match="without orientation"):
            unpacked(data, vectors=True, orientation=True)


def test_ros_messages_have_an_orientation_beside_the_position(maker):
    pose = maker.pose(5, [*POSED[0], *POSED[2]])
    data = bytes(maker.store.serialize_cdr(pose, POSE))
    reader = MessageReader("/pose", POSE, ["pose.position"], vectors=True, orientation=True)
    assert reader.read(data).values == ((*POSED[0], *POSED[2]),)
    with pytest.raises(InvalidParameterError, match="no orientation, which --payload needs"):
        MessageReader("/w", WRENCH, ["wrench.force"], vectors=True, orientation=True)


def test_orientations_are_interpolated_whatever_their_sign():
    pairing = Pairing(10, Counts())
    pairing.follow(Stamped(0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), 0.0), anew=False)
    pairing.lead(Stamped(5, (1.0, 1.0, 1.0), 0.0), anew=False)
    after = Stamped(10, (1.0, 0.0, 0.0, 0.0, -0.1, 0.0, -0.99), 0.0)
    [pair] = pairing.follow(after, anew=False)
    assert pair.follower == pytest.approx((0.5, 0.0, 0.0, 0.0, 0.05, 0.0, 0.995))


@pytest.fixture
def maker():
    from message_files import Maker

    return Maker()


@pytest.mark.parametrize("wire", ["zmq", "dds", "zenoh"])
def test_a_wire_delivers_orientations(wire):
    from wire_robots import ROBOTS, collect

    robot = ROBOTS[wire]()
    source = robot.source(SourceOptions(vectors=True, orientation=True))
    try:
        for k in range(20):
            if wire == "zmq":
                robot.junk(packed(k, 1.7e9 + 1e-3 * k, *POSED))
            else:
                robot.send(k)
        found = collect(source, 20)
        assert len(found) == 20
        expected = POSED[2] if wire == "zmq" else (0.0, 0.0, 0.0, 1.0)
        assert {each.orientation for each in found} == {expected}
        assert all(len(each.position) == 3 for each in found)
    finally:
        source.close()
        robot.close()
