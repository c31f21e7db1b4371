"""Bags as robots record them: joint angles, transforms, a wrench in the sensor's frame.

The layouts are those of geometry_msgs, sensor_msgs and tf2_msgs (docs.ros.org), of libfranka's
RobotState and franka_msgs/FrankaState, and of Universal Robots' RTDE guide. The robot presses a
ball along −z. Its sensor is 0.1 m from the flange, and rotated by 30° about x.
"""

from functools import lru_cache
from itertools import chain

import message_files as files
import numpy as np
import pytest
from mcap_ros2.writer import Writer as Ros2Writer
from probing import BALL
from robots import hand
from scipy.spatial.transform import Rotation

from palpate import MissingChannelError, Recording, RecordingError, identify, prepare
from palpate.input.channels import Columns
from palpate.input.channels.frames import interpolate_rotation
from palpate.input.channels.roles import choose_roles
from palpate.input.recordings import open_recording

MAKER = files.Maker()
START = 1_700_000_000_000_000_000
TF, WRENCH, POSE, JOINTS = (
    "tf2_msgs/TFMessage",
    "geometry_msgs/WrenchStamped",
    "geometry_msgs/PoseStamped",
    "sensor_msgs/JointState",
)
MOUNT = Rotation.from_euler("x", 30.0, degrees=True)  # of the sensor on the flange
DOWN = Rotation.from_euler("x", 175.0, degrees=True)  # of the flange in the base
LEVER, STAND, NONE = np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.5]), np.zeros(3)


def turns_about(axis, angles) -> Rotation:
    return Rotation.from_rotvec(np.outer(angles, np.eye(3)[axis]))


TURNED = turns_about(2, [np.pi])  # base in base_link, of a Universal Robots arm


@lru_cache
def touch():
    """Time, position of the flange, and the force in the axes of the sensor and of the base."""
    felt = hand(6.0, BALL, normal=np.array([0.0, 0.0, 1.0]))
    own = (DOWN * MOUNT).inv().apply(felt.force)
    return felt.time, felt.position - DOWN.apply(LEVER), own, felt.force


def stream(topic, kind, times, make) -> list[files.Message]:
    """The messages that ``make`` makes of a stamp and the number of the time."""
    stamps = [START + round(1e9 * float(time)) for time in times]
    return [(topic, kind, stamp, make(stamp, k)) for k, stamp in enumerate(stamps)]


def wrenches(count=None, frame="ft_sensor") -> list[files.Message]:
    time, _, own, force = touch()
    force = own if frame == "ft_sensor" else force
    force = TURNED.inv().apply(force) if frame == "turned" else force
    rows = np.hstack([force, np.zeros_like(force)])
    return stream("/ft", WRENCH, time[:count], lambda stamp, k: MAKER.wrench(stamp, rows[k], frame))


def transform(topic, parent, child, places, turns=None, times=(0.0,)) -> list[files.Message]:
    """One transform, at rest or moving."""
    quaternions = [0.0, 0.0, 0.0, 1.0] if turns is None else turns
    rows = [np.broadcast_to(each, (len(times), n)) for each, n in ((places, 3), (quaternions, 4))]
    rows = np.hstack(rows)
    pair = parent, child
    return stream(topic, TF, times, lambda stamp, k: MAKER.transforms(stamp, rows[k], pair))


def mounted() -> list[files.Message]:
    plate = transform("/tf_static", "flange", "plate", NONE)
    return plate + transform("/tf_static", "plate", "ft_sensor", LEVER, MOUNT.as_quat())


def beside_base() -> list[files.Message]:
    return transform("/tf_static", "base", "turned", STAND, TURNED.as_quat())


def on_floor() -> list[files.Message]:
    turned = turns_about(0, [0.5]).as_quat()
    return transform("/tf_static", "world", "base", STAND, turned)


def one_transform() -> list[files.Message]:
    time, place, _, _ = touch()
    return transform("/tf", "base", "flange", place[::2], DOWN.as_quat(), time[::2])


def arm() -> list[files.Message]:
    """Two moving links, the upper one at 100 Hz and the lower one at 500 Hz, on a fixed stand."""
    time, place, _, _ = touch()
    slow, fast = time[::10], time[::2]
    upper = turns_about(2, 0.05 * np.sin(0.8 * slow)).as_quat()
    upper *= np.where(np.arange(len(slow)) % 2, 1.0, -1.0)[:, None]  # q and −q are one rotation
    lower = turns_about(2, -0.05 * np.sin(0.8 * fast))
    rest = lower.apply(place[::2] - STAND), (lower * DOWN).as_quat(), fast
    found = transform("/tf_static", "base", "stand", STAND)
    found += transform("/tf", "stand", "shoulder", NONE, upper, slow)
    return found + transform("/tf", "shoulder", "flange", *rest)


def joints() -> list[files.Message]:
    names = [f"joint{k}" for k in range(1, 7)]

    def make(stamp, k):
        angles = np.sin(1e-3 * k + np.arange(6))
        return MAKER.make(JOINTS, header=MAKER.header(stamp), name=names, position=angles)

    return stream("/joint_states", JOINTS, touch()[0][::2], make)


def poses() -> list[files.Message]:
    time, place, _, _ = touch()
    rows = np.hstack([place, np.tile(DOWN.as_quat(), (len(time), 1))])[::2]
    return stream("/ee_pose", POSE, time[::2], lambda stamp, k: MAKER.pose(stamp, rows[k]))


def bag(path, *parts):
    return files.rosbag2(path, sorted(chain(*parts), key=lambda each: each[2]))


def table_of_ur(path):
    time, place, _, force = touch()
    angles, turned = np.sin(time[:, None] + np.arange(6)), np.tile(DOWN.as_rotvec(), (len(time), 1))
    columns = np.hstack([time[:, None], angles, place, turned, force, 0.0 * force])
    of = ("actual_q", "actual_TCP_pose", "actual_TCP_force")
    head = " ".join(["timestamp", *(f"{name}_{k}" for name in of for k in range(6))])
    np.savetxt(path, columns, header=head, comments="", fmt="%.9g")
    return path


def bags(folder):
    """The recordings of which the stiffness has to be right, by name."""
    every = poses(), wrenches(), joints(), arm(), mounted()
    return {
        "a pose, a wrench, joints and tf": bag(folder / "all", *every),
        "a chain of transforms and a wrench": bag(folder / "chain", wrenches(), arm(), mounted()),
        "a chain and a wrench in the base": bag(
            folder / "base", wrenches(frame="base"), arm(), mounted(), on_floor()
        ),
        "a chain and a wrench beside the base": bag(
            folder / "turned", wrenches(frame="turned"), arm(), mounted(), beside_base()
        ),
        "a pose and a wrench beside the base": bag(
            folder / "posed", wrenches(frame="turned"), poses(), beside_base()
        ),
        "one moving transform": bag(folder / "one", wrenches(), one_transform(), mounted()),
        "a table of a UR": table_of_ur(folder / "ur.csv"),
    }


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return bags(tmp_path_factory.mktemp("bags"))


def assert_right(result) -> None:
    """Stiffness within 3 standard errors, a bar of at most 3 %, and the normal is z."""
    there = result.diagnosis.working_depth
    truth = BALL.stiffness_at(there.depth)
    assert abs(there.stiffness.value - truth) < 3.0 * there.stiffness.whole_error
    assert there.stiffness.whole_error < 0.03 * truth
    assert result.contact.prepared.normal.vector == pytest.approx([0.0, 0.0, 1.0], abs=2e-3)
    assert result.diagnosis.verdict.overall == "trust"


TURN = "base > turned"
CHAIN = "base > stand > shoulder > flange > plate > ft_sensor"
SAID = {
    "a pose, a wrench, joints and tf": CHAIN,
    "a chain of transforms and a wrench": CHAIN,
    "a chain and a wrench in the base": CHAIN,
    "a chain and a wrench beside the base": CHAIN,
    "a pose and a wrench beside the base": TURN,
    "one moving transform": "base > flange > plate > ft_sensor",
    "a table of a UR": None,
}


@pytest.mark.long
@pytest.mark.parametrize("name", SAID)
def test_recordings_of_robots_need_no_option(recorded, name):
    result = identify(recorded[name])
    assert_right(result)
    said = [each.message for each in result.contact.findings if each.check == "transforms"]
    chains = {SAID[name], TURN} if "beside the base" in name else {SAID[name]} - {None}
    assert {each.partition("the chain of transforms ")[2] for each in said} == chains
    assert not any(each.check == "force frame" for each in result.contact.findings)


@pytest.mark.long
def test_the_pose_of_a_chain_is_that_of_the_sensor_in_the_fixed_frame(recorded):
    roles = choose_roles(open_recording(recorded["a chain of transforms and a wrench"]))
    place = np.column_stack([roles.recording.channels[name] for name in roles.depth])
    q = np.column_stack([roles.recording.channels[name] for name in roles.orientation])
    time = roles.recording.channels[roles.recording.clocks[roles.depth[0]]]
    k = np.searchsorted([stamp for _, _, stamp, _ in wrenches()], time)
    truth = touch()[1][k] + DOWN.apply(LEVER)
    # Half a step of the slow link's clock, 10 ms, curves by 0.05 rad (0.8 rad/s)² (5 ms)² / 2.
    assert np.abs(place - truth).max() < 0.6 * 0.05 * 0.8**2 * 0.005**2
    assert np.abs(np.abs(q @ (DOWN * MOUNT).as_quat()) - 1.0).max() < 1e-9
    assert (q[1:] * q[:-1]).sum(axis=1).min() > 0.0
    assert (roles.orientation_frame, len(k)) == ("ft_sensor", 2996)


def test_a_rotation_is_interpolated_at_even_speed():
    turns = turns_about(0, 0.2 * np.arange(13)).as_quat()
    found = interpolate_rotation(np.linspace(0.0, 1.0, 13), np.array([0.0, 1.0]), turns[[0, -1]])
    assert found == pytest.approx(turns, abs=1e-15)


@pytest.mark.long
def test_a_chain_is_chosen_by_its_two_frames(recorded):
    path = recorded["a pose, a wrench, joints and tf"]
    for position in ("/tf[base>plate]", "/tf[shoulder>plate]", "/tf[shoulder>flange]"):
        contact = prepare(path, columns=Columns(position=position))
        assert f"'{position}.transform.translation.z'" in contact.provenance["penetration"]
        # Wherever the position is, the transforms rotate the force from the sensor's frame.
        assert contact.prepared.normal.vector == pytest.approx([0.0, 0.0, 1.0], abs=2e-3)
    pose = prepare(path, columns=Columns(position="/ee_pose"))
    assert_right(identify(pose))
    assert any(
        f"rotated by the chain of transforms {CHAIN}" in each.message for each in pose.findings
    )
    assert (pose.prepared.again().penetration == pose.penetration).all()
    with pytest.raises(RecordingError, match="no chain of transforms leads from 'tool' to 'base'"):
        prepare(path, columns=Columns(position="/tf[tool>base]"))


def test_joints_without_a_pose_are_refused_with_what_to_record(tmp_path):
    path = bag(tmp_path / "joints", wrenches(300), joints()[:150], mounted())
    with pytest.raises(MissingChannelError, match="record the pose of the tool or tf") as refused:
        prepare(path)
    assert "\n" not in str(refused.value)
    # Nor are joints without names a position in space.
    nameless = {f"/arm.position[{k}]": np.sin(np.arange(9.0) + k) for k in range(6)}
    force = {f"/ft.wrench.force.{a}": np.arange(9.0) for a in "xyz"}
    types = {"/arm": "sensor_msgs/msg/JointState"}
    with pytest.raises(MissingChannelError, match="record the pose of the tool or tf"):
        choose_roles(Recording({"t": np.arange(9.0), **nameless, **force}, types=types))


def test_mcap_as_rosbag2_writes_it_is_read_alike(tmp_path):
    """With mcap-ros2-support, which does not share code with rosbags."""
    path = tmp_path / "robot.mcap"
    messages, kinds = sorted(wrenches() + arm() + mounted(), key=lambda each: each[2]), {}
    with path.open("wb") as file:
        writer = Ros2Writer(file)
        for kind in (TF, WRENCH):
            _, _, name, text = files.schema(kind.replace("/", "/msg/"))
            kinds[kind] = writer.register_msgdef(name, text.decode())
        for topic, kind, time, message in messages:
            writer.write_message(topic, kinds[kind], message, time, time)
        writer.finish()
    assert_right(identify(path))


def franka() -> dict[str, np.ndarray]:
    """Arrays of libfranka's RobotState: matrices by columns, wrenches on the robot."""
    time, place, own, force = touch()
    poses = np.zeros((len(time), 4, 4))
    poses[:, :3, :3], poses[:, :3, 3], poses[:, 3, 3] = DOWN.as_matrix(), place, 1.0
    still = np.zeros_like(force)
    desired = poses.copy()
    desired[:, 2, 3] -= 0.01 * np.sin(time)
    return {
        "q": np.sin(time[:, None] + np.arange(7)),
        "tau_J": np.cos(time[:, None] + np.arange(7)),
        "K_F_ext_hat_K": np.hstack([own, still]),
        "O_F_ext_hat_K": np.hstack([force, still]),
        "O_T_EE": poses.transpose(0, 2, 1).reshape(-1, 16),
        "O_T_EE_d": desired.transpose(0, 2, 1).reshape(-1, 16),
        "F_T_EE": np.tile(np.eye(4).ravel(), (len(time), 1)),
    }


FORMS = [("", "{}_{}"), ("", "{}[{}]"), ("/franka_states.", "/franka_states.{}[{}]")]


@pytest.mark.parametrize("above, form", FORMS, ids=["columns", "arrays", "messages"])
def test_a_state_of_a_franka_is_a_pose_and_a_wrench_in_the_base(above, form):
    arrays = [
        (name, k, array[:, k]) for name, array in franka().items() for k in range(array.shape[1])
    ]
    columns = {form.format(name, k): column for name, k, column in arrays}
    recording = Recording({"time": touch()[0], **columns}, source="franka")
    roles = choose_roles(recording)
    assert roles.force == tuple(form.format("O_F_ext_hat_K", k) for k in range(3))
    assert roles.depth == tuple(f"{above}O_T_EE.position.{axis}" for axis in "xyz")
    assert_right(identify(recording))
    # With the wrench in the axes of the tool the pose rotates it, also upside down.
    q = np.column_stack([roles.recording.channels[name] for name in roles.orientation])
    assert np.abs(q @ DOWN.as_quat()) == pytest.approx(np.ones(len(q)), abs=1e-12)
    named = choose_roles(recording, Columns(force=f"{above}K_F_ext_hat_K"))
    assert named.force == tuple(form.format("K_F_ext_hat_K", k) for k in range(3))


def test_a_rotation_vector_of_a_ur_rotates_a_force_of_the_tool(recorded):
    table = open_recording(recorded["a table of a UR"])
    sensor = MOUNT.apply(touch()[2])
    channels = dict(table.channels) | {f"sensor_f{a}": sensor[:, k] for k, a in enumerate("xyz")}
    named = Columns(force="sensor_fx,sensor_fy,sensor_fz")
    contact = prepare(Recording(channels), columns=named, force_frame="tool")
    assert contact.prepared.normal.vector == pytest.approx([0.0, 0.0, 1.0], abs=2e-3)


def test_an_option_names_a_vector_whatever_its_name_suggests():
    names = [f"action.force_torque[{k}]" for k in range(6)] + [f"goal[{k}]" for k in range(3)]
    recording = Recording({name: np.arange(5.0) for name in ["t", *names]})
    roles = choose_roles(recording, Columns(force="action.force_torque", position="goal"))
    assert (roles.force, roles.depth) == (tuple(names[:3]), tuple(names[6:]))


def few(topic, parent, child, turns=None) -> list[files.Message]:
    """A transform that moves along x."""
    k = np.arange(40)
    return transform(topic, parent, child, np.outer(k, [1e-3, 0.0, 0.0]), turns, 1e-2 * k)


NAN = np.tile([0.0, 0.0, 0.0, 1.0], (40, 1))
NAN[3:6], NAN[7] = np.nan, 0.0
REFUSED = {
    "a circle": ([("a", "b"), ("b", "ft_sensor"), ("ft_sensor", "a")], "go round in a circle"),
    "a frame that is its own parent": ([("ft_sensor", "ft_sensor")], "go round in a circle"),
    "several roots": (
        [("base", "ft_sensor"), ("world", "ft_sensor")],
        r"several chains of transforms end in 'ft_sensor'; choose one: --position "
        r"'/tf\[base>ft_sensor\]', --position '/tf\[world>ft_sensor\]'",
    ),
    "no quaternion": ([("base", "ft_sensor", 0.0 * NAN[0])], "no rotation of /tf.base>ft_sensor"),
}


@pytest.mark.parametrize("edges, words", REFUSED.values(), ids=REFUSED)
def test_transforms_without_one_fixed_frame_are_refused_in_a_line(tmp_path, edges, words):
    path = bag(tmp_path / "bag", wrenches(400), *(few("/tf", *edge) for edge in edges))
    with pytest.raises(RecordingError, match=words) as refused:
        prepare(path)
    assert "\n" not in str(refused.value)


def test_late_transforms_and_invalid_rotations_are_excluded(tmp_path):
    late = [m for m in few("/tf", "base", "arm") if m[2] >= START + 100_000_000]
    path = bag(tmp_path / "bag", wrenches(400), late, few("/tf", "arm", "ft_sensor", NAN))
    roles = choose_roles(open_recording(path))
    time = roles.recording.channels[roles.recording.clocks[roles.depth[0]]]
    assert (time[0], len(time)) == (START + 100_000_000, 30)
    [said] = [each for each in roles.findings if "excluded" in each.message]
    assert "palpate excluded 4 of 40 rows of /tf[arm>ft_sensor]" in said.message
    assert said.severity == "with-care"


@pytest.mark.long
def test_two_thousand_frames_are_one_chain():
    force = {f"/ft.wrench.force.{a}": np.arange(40.0) for a in "xyz"}
    channels = dict(force)
    for k in range(2_000):
        above = f"/tf[f{k}>f{k + 1}].transform"
        channels |= {f"{above}.translation.{a}": np.full(40, 1e-4) for a in "xyz"}
        channels |= {f"{above}.rotation.{a}": np.full(40, float(a == "w")) for a in "xyzw"}
    channels["/tf[f7>f8].transform.translation.x"] = 1e-3 * np.arange(40)
    settings = {"clocks": dict.fromkeys(channels, "t"), "frames": dict.fromkeys(force, "f2000")}
    channels["t"] = START + 10_000_000 * np.arange(40)
    roles = choose_roles(Recording(channels, **settings))
    x, y, _ = (roles.recording.channels[name] for name in roles.depth)
    assert x - x[0] == pytest.approx(1e-3 * np.arange(40), abs=1e-9)
    assert y == pytest.approx(0.2 * np.ones(40))
    assert any("f3 > … 1993 more … > f1997" in each.message for each in roles.findings)
