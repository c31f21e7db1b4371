"""Payload, mount, zero and clock of a wrist sensor, from logs of a simulator of its own."""

import math
from dataclasses import replace

import numpy as np
import pytest
from robot_logs import FAULTS, IDEAL, STILL, VERTICAL, Setup, identify, random_setup, simulate
from scipy.spatial.transform import Rotation

import palpate
from palpate import Recording, RecordingError, prepare
from palpate.input.preparation.force_frame import compensate_log
from palpate.input.preparation.settings import Preparation
from palpate.input.recordings.units import GRAVITY
from palpate.input.wrench.fit import regressors, rotation, skew
from palpate.input.wrench.motion import motion_of
from palpate.input.wrench.payload import Payload


def without(recording: Recording, word: str) -> Recording:
    """The recording without the channels whose name contains a word."""
    channels = {name: each for name, each in recording.channels.items() if word not in name}
    clocks = {name: each for name, each in recording.clocks.items() if word not in name}
    return replace(recording, channels=channels, clocks=clocks)


def test_the_motion_of_a_flange_that_swings_is_that_of_its_equations():
    time = np.arange(0.0, 2.0, 2e-3)
    swing, turn = 0.02 * np.sin(6.0 * time), 0.5 * np.sin(5.0 * time)
    position = np.column_stack([swing, 0.0 * time, 0.0 * time])
    orientation = Rotation.from_rotvec(np.outer(turn, [0.0, 1.0, 0.0])).as_quat()
    found = motion_of(time, position, orientation).at(time)[100:-100]
    turn, time = turn[100:-100], time[100:-100]
    specific = np.column_stack([0.72 * np.sin(6.0 * time), 0.0 * time, -GRAVITY + 0.0 * time])
    in_flange = Rotation.from_rotvec(np.outer(-turn, [0.0, 1.0, 0.0])).apply(specific)
    np.testing.assert_allclose(found[:, :3], in_flange, atol=5e-3)
    np.testing.assert_allclose(found[:, 4], 2.5 * np.cos(5.0 * time), atol=5e-3)
    np.testing.assert_allclose(found[:, 7], -12.5 * np.sin(5.0 * time), atol=0.1)


def test_the_wrench_of_a_payload_is_that_of_the_regressors():
    g = np.random.default_rng(1)
    mount = rotation(np.array([0.3, -0.5, 0.2]))
    np.testing.assert_allclose(mount, Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix())
    centre, lever, inertia = g.normal(size=3), g.normal(size=3), g.normal(size=6)
    tool = Payload(1.3, centre, mount, np.zeros(6), inertia=inertia, lever=lever)
    motion = g.normal(size=(20, 9))
    w = motion[:, 3:6]
    products = np.column_stack([w * w, w[:, :1] * w[:, 1:], w[:, 1] * w[:, 2]])
    values = np.concatenate([[1.3], 1.3 * centre, inertia, 1.3 * lever])
    expected = regressors(np.hstack([motion, products]), mount, lever) @ values
    found = tool.wrench(motion[:, :3], w, motion[:, 6:9])
    np.testing.assert_allclose(found, expected, atol=1e-12)
    np.testing.assert_allclose(skew(w) @ centre, np.cross(w, centre), atol=1e-12)


def assert_found(setup: Setup) -> None:
    found = identify(setup)
    # By a half more than the limits of the 95th percentile of random set-ups.
    limits = {"mass, %": 0.75, "centre, mm": 0.75, "mount, °": 0.75, "clock, ms": 1.0, "S, %": 1.0}
    for name, limit in limits.items():
        assert abs(found.absolute[name]) < limit, name
    assert max(map(abs, found.in_errors.values())) < 5.0
    assert found.mark != "do-not-trust"


LONG = pytest.mark.long


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=LONG), pytest.param(9, marks=LONG)])
def test_payload_delay_and_stiffness_match_the_simulator(seed):
    assert_found(random_setup(seed, touch_tilt=0.0, friction=0.0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_payload_delay_and_stiffness_match_for_more_seeds(seed):
    assert_found(random_setup(seed, touch_tilt=0.0, friction=0.0))


#: The others differ from these in one number, or are of the edge of what is identified.
TYPICAL = (
    "mount 30° about x, no weight",
    "weight 4 N, tool never turns",
    "drift 0.2 N, wander 0.05 N",
    "delay 50 ms",
    "zeroed in contact",
)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=LONG if n in TYPICAL else pytest.mark.slow) for n in FAULTS]
)
def test_a_fault_is_taken_out_or_not_trusted(name):
    found = identify(Setup(seed=5, **FAULTS[name]))
    assert abs(found.absolute["S, %"]) < 1.0 or found.mark == "do-not-trust"
    assert abs(found.in_errors["C"]) < 3.0 or found.damping_mark == "do-not-trust"


@pytest.mark.long
@pytest.mark.parametrize("name", ["zeroed in contact", "zeroed in free air", "zeroed in one touch"])
def test_a_zeroed_sensor_is_reported(name):
    log = simulate(Setup(seed=5, **FAULTS[name]))
    contact = prepare(log.recording)
    said = [each.message for each in contact.findings if each.check == "zeroed sensor"]
    assert len(said) == 1
    assert f"at {FAULTS[name]['zeroed'] * log.duration:.1f}" in said[0]


@pytest.fixture(scope="module")
def ideal():
    """A log without a fault."""
    return simulate(Setup(seed=7, presses=2, **IDEAL)).recording


@pytest.fixture(scope="module")
def turning(ideal):
    return prepare(ideal)


@pytest.mark.long
def test_a_payload_of_another_log_serves_one_without_turns(turning):
    assert "zeroed sensor" not in {each.check for each in turning.findings}
    tool = turning.prepared.payload
    assert tool.mark == "trust"
    assert (tool.axes, round(math.degrees(tool.turn), -1)) == (2, 100.0)
    still = Setup(seed=8, **(IDEAL | STILL))
    served = prepare(simulate(still).recording, payload=tool).prepared.payload
    assert (served.mass, served.mass_error) == (pytest.approx(tool.mass), tool.mass_error)
    assert np.all(np.abs(served.bias - still.bias) < 5.0 * served.bias_error)
    found = identify(still, payload=tool)
    assert abs(found.absolute["S, %"]) < 1.0
    assert abs(found.absolute["mount, °"]) < 0.2
    for name, value in {"tool_weight": 4.0, "tare": (0.0, 1.0), "no_time": True}.items():
        with pytest.raises(palpate.InvalidParameterError, match=f"payload excludes .*{name}"):
            Preparation(payload=tool, **{name: value})


@pytest.mark.long
@pytest.mark.parametrize("mass", [2.0, pytest.param(4.0, marks=LONG)])  # kg
def test_a_known_heavy_tool_serves_a_log(mass, tmp_path):
    setup = Setup(seed=17, mass=mass, centre=(0.01, -0.01, 0.13), **IDEAL)
    path = tmp_path / "tool.toml"
    tool = compensate_log(simulate(setup).recording, Preparation()).payload
    assert tool.lever == pytest.approx(
        Rotation.from_rotvec(np.radians(setup.mount)).as_matrix().T @ setup.sensor, abs=1e-3
    )
    tool.save(path)
    served = replace(setup, seed=18, bias=(0.0,) * 6, axes=1)
    found = identify(served, payload=Payload.load(path))
    assert abs(found.absolute["S, %"]) < 1.0
    assert found.mark != "do-not-trust"


def test_a_known_tool_without_a_pose_or_a_wrench_is_refused(ideal):
    flat = Recording({name: np.arange(100.0) for name in ("t", "z_m", "F_N")})
    tool = Payload(0.4, np.zeros(3), np.eye(3), np.zeros(6))
    for recording in (without(ideal, "orientation"), flat):
        for name, value in {"payload": tool, "tip_offset": (0.0, 0.0, 0.1)}.items():
            words = f"--{name.replace('_', '-')} needs a force in space and a pose"
            with pytest.raises(RecordingError, match=words):
                prepare(recording, **{name: value})


def test_a_log_without_contact_has_a_payload():
    log = simulate(Setup(seed=12, presses=0, **IDEAL))
    found = compensate_log(log.recording, Preparation()).payload
    assert found.mass == pytest.approx(0.4, rel=5e-3)
    with pytest.raises(RecordingError, match="a payload needs a force in space and a pose"):
        compensate_log(without(log.recording, "orientation"), Preparation())


@pytest.mark.long
@pytest.mark.parametrize("frequency, blur", [(1.0, 0.0), (2.4, 2e-5), (5.0, 3e-5)])  # Hz, m
def test_vertical_motion_tells_the_mass_but_not_the_mount(frequency, blur):
    time, omega = np.arange(0.0, 12.0, 2e-3), 2.0 * math.pi * frequency
    height = 0.7 / omega**2 * np.sin(omega * time)
    still = np.zeros((len(time), 3))
    mount = Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()
    tool = Payload(0.4, np.array([0.0, 0.0, 0.05]), mount, np.array([3.0, -5.0, 8.0, 0, 0, 0]))
    felt = still.copy()
    felt[:, 2] = -GRAVITY + 0.7 * np.sin(omega * time)
    wrench = tool.wrench(felt, still, still) + tool.bias
    random = np.random.default_rng(3)
    wrench += random.normal(0.0, [0.02] * 3 + [1e-3] * 3, wrench.shape)
    height += random.normal(0.0, blur, len(height))
    columns = np.column_stack([time, still[:, :2], height, still, still[:, 0] + 1.0, wrench])
    names = ["time", *(f"pose.position.{axis}" for axis in "xyz")]
    names += [f"pose.orientation.{axis}" for axis in "xyzw"]
    names += [f"wrench.{what}.{axis}" for what in ("force", "torque") for axis in "xyz"]
    recording = Recording(dict(zip(names, columns.T.copy(), strict=True)))
    found = compensate_log(recording, Preparation(force_frame="tool")).payload
    assert (found.mass_mark, found.mount_mark) == ("with-care", "do-not-trust")
    assert abs(found.mass - 0.4) < 2.0 * found.mass_error
    assert (found.delay_mark, found.mass_error < 0.05 * 0.4) == ("with-care", True)
    assert abs(found.delay) < 2.0 * found.delay_error < 4e-3
    assert found.mount == pytest.approx(np.eye(3), abs=1e-6)
    assert found.mount_error.max() > 0.1


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, pytest.param(6, marks=LONG)])
def test_quick_presses_are_not_trusted_without_the_mass_of_the_tool(seed):
    """The noise of the pose hides the inertia in free air; in contact it is a tenth of S."""
    quiet = random_setup(seed, **VERTICAL)
    noisy = replace(quiet, pose_noise=3e-5, pose_rate=125.0)
    words = "whose inertia may change the stiffness by"
    for setup, unknown in ((quiet, False), (noisy, True)):
        findings = prepare(simulate(setup).recording).findings
        severities = [each.severity for each in findings if words in each.message]
        assert severities == ["with-care"] * unknown


def test_turns_about_one_axis_tell_the_centre_of_mass():
    """The acceleration of the sensor is not that of the pose: without it the error is 0.25 mm."""
    setup = random_setup(305, touch_tilt=0.0, friction=0.0, axes=1)
    found = compensate_log(simulate(setup).recording, Preparation()).payload
    off = found.centre - setup.centre
    assert np.abs(off).max() < 1e-4
    assert np.abs(off / found.centre_error).max() < 3.0


@pytest.mark.long
@pytest.mark.parametrize("fault", ["gain", "crosstalk", "cable"])
def test_a_force_that_is_no_weight_is_reported(ideal, turning, fault):
    channels = dict(ideal.channels)
    force = np.column_stack([channels[f"/ft.force.{axis}"] for axis in "xyz"])
    if fault == "cable":  # a spring from the base, which pulls by up to 0.4 N
        height = np.interp(
            channels["wrench.time"], channels["pose.time"], channels["/pose.position.y"]
        )
        force[:, 1] += 0.4 * (height - height.min()) / np.ptp(height)
    else:
        force @= (
            np.diag([1.04, 1.0, 0.97]) if fault == "gain" else np.eye(3) + 0.03 * np.eye(3, k=1)
        )
    channels |= {f"/ft.force.{axis}": force[:, k].copy() for k, axis in enumerate("xyz")}
    words = "a cable, or the gain or crosstalk of the sensor"
    contact = prepare(replace(ideal, channels=channels))
    assert any(words in each.message for each in contact.findings)
    assert not any(words in each.message for each in turning.findings)


def test_a_flange_that_turns_in_free_air_does_not_move_the_surface():
    """The tool turns where it touches later; its flange is then lower than in contact."""
    setup = Setup(seed=3, presses=1, touch_tilt=0.0, friction=0.0, free_height=0.03)
    for options in {}, {"tip_offset": setup.tip}:
        assert abs(identify(setup, **options).absolute["S, %"]) < 2.0


@pytest.mark.long
def test_a_flange_that_turns_in_contact_asks_for_the_tip():
    setup = Setup(seed=3, presses=1, touch_tilt=0.0, friction=0.0, pivot=6.0)
    recording = simulate(setup).recording

    def asked(**options):
        findings = prepare(recording, **options).findings
        return [each.message for each in findings if each.remedy and "--tip-offset" in each.remedy]

    [words] = asked()
    assert "the tool turns by 3° in contact" in words
    assert not asked(tip_offset=setup.tip)
    assert abs(identify(setup, tip_offset=setup.tip).absolute["S, %"]) < 2.0


@pytest.mark.long
def test_a_tools_weight_acts_or_is_refused(ideal):
    with pytest.raises(RecordingError, match=r"fits a tool weight of 3\.92.* not --tool-weight 5N"):
        prepare(ideal, tool_weight=5.0)
    assert prepare(ideal, tool_weight=3.92).prepared.payload.mass_mark == "trust"
    still = simulate(Setup(seed=9, **(IDEAL | STILL)))
    with pytest.raises(RecordingError, match=r"--tool-weight 3\.92N has no effect: in the frame"):
        prepare(still.recording, tool_weight=3.92)


@pytest.mark.long
def test_without_a_torque_the_mass_is_found(ideal):
    tool = prepare(without(ideal, "torque")).prepared.payload
    assert tool.mass == pytest.approx(0.4, rel=5e-3)
    assert (
        math.degrees(float(np.linalg.norm(tool.centre_error))) > 1.0
        or tool.centre_error.min() > 0.01
    )
    named = prepare(ideal, columns=palpate.Columns(torque="/ft.torque"))
    assert named.prepared.payload.centre == pytest.approx(Setup().centre, abs=5e-4)


@pytest.mark.long
def test_bit_errors_in_a_log_do_not_change_its_payload(ideal, turning):
    found = turning.prepared.payload
    channels = {name: values.copy() for name, values in ideal.channels.items()}
    channels["/ft.force.x"][5000], channels["/ft.torque.y"][6000] = 1e29, np.nan
    channels["/pose.position.x"][3000] = -1e29
    for axis in "xyzw":
        channels[f"/pose.orientation.{axis}"][4000] = 0.0
    damaged = prepare(replace(ideal, channels=channels)).prepared.payload
    assert damaged.mass == pytest.approx(found.mass, rel=1e-4)
    assert damaged.delay == pytest.approx(found.delay, abs=2e-5)


def test_a_log_without_free_air_has_no_payload():
    log = simulate(Setup(seed=11, **(IDEAL | STILL)))
    pressed = np.flatnonzero(log.penetration > 2e-4)
    first = pressed[: int(np.argmax(np.diff(pressed) > 1))] / 2000.0
    contact = prepare(log.recording, window=(first[0], first[-1]))
    assert contact.prepared.payload is None
    tool = Payload(0.4, np.zeros(3), np.eye(3), np.zeros(6))
    with pytest.raises(RecordingError, match="--payload needs a second of free air"):
        prepare(log.recording, window=(first[0], first[-1]), payload=tool)
    assert "no tare" in {each.check for each in contact.findings}
