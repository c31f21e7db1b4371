"""Which channel is which, time as it was stamped, and two clocks made one."""

import dataclasses
import pickle
import re
import shlex

import h5py
import numpy as np
import pandas
import pytest
from robots import hand, topics_of

import palpate
from palpate import MissingChannelError, Recording, RecordingError, prepare
from palpate.input.channels import Columns
from palpate.input.channels.clocks import gaps, select_increasing_rows
from palpate.input.channels.roles import choose_roles
from palpate.input.channels.signals import build_signals
from palpate.input.channels.vectors import find_vectors

SPACE = {"position": ("px_m", "py_m", "pz_m"), "force": ("fx_N", "fy_N", "fz_N")}


def recording(*names: str, **units: str) -> Recording:
    return Recording({name: np.arange(5.0) for name in names}, units=units, source="r.csv")


WRITTEN = "time_s penetration_m force_N velocity_m_s segment"
BRACKETS = "Time [s];Displacement (mm);Force [mN]"
COMMANDED = "time_s position_command_m position_m force_N"
ARRAYS = "time " + " ".join([f"pos[{k}]" for k in range(3)] + [f"wrench[{k}]" for k in range(6)])
MESSAGE = ["wrench.force", "wrench.torque", "pose.position"]
GAZEBO = ["s0.wrenches0.force", "s0.total_wrench.force", "s0.contact_positions0"]
TABLES = {
    "the names that palpate writes": (WRITTEN, "penetration_m", "force_N"),
    "a script's own": ("t depth_mm Fz", "depth_mm", "Fz"),
    "units in brackets": (BRACKETS, "Displacement (mm)", "Force [mN]"),
    "a testing machine's": ("Time/s;Indentation/mm;Load/N", "Indentation/mm", "Load/N"),
    "a robot's, in space": ("time px_m py_m pz_m fx_N fy_N fz_N q0 q1 q2 q3", *SPACE.values()),
    "what was commanded beside it": (COMMANDED, "position_m", "force_N"),
    "a wrench with its torque": ("t x y z Fx Fy Fz Mx My Mz", tuple("xyz"), ("Fx", "Fy", "Fz")),
    "arrays": (
        ARRAYS,
        tuple(f"pos[{k}]" for k in range(3)),
        tuple(f"wrench[{k}]" for k in range(3)),
    ),
    "a flattened message": (
        " ".join(["%time", *(f"field.{each}.{axis}" for each in MESSAGE for axis in "xyz")]),
        tuple(f"field.pose.position.{axis}" for axis in "xyz"),
        tuple(f"field.wrench.force.{axis}" for axis in "xyz"),
    ),
    "contacts of Gazebo": (
        " ".join(["%time", *(f"{each}.{axis}" for each in GAZEBO for axis in "xyz"), "s0.depths0"]),
        "s0.depths0",
        tuple(f"s0.total_wrench.force.{axis}" for axis in "xyz"),
    ),
    "a velocity of it": ("t;Penetration;Velocity of deformation;Force", "Penetration", "Force"),
}


@pytest.mark.parametrize("names, depth, force", TABLES.values(), ids=TABLES)
def test_the_channels_are_known_by_their_names(names, depth, force):
    split = names.split(";") if ";" in names else names.split()
    roles = choose_roles(recording(*split))
    assert roles.depth == (depth if isinstance(depth, tuple) else (depth,))
    assert roles.force == (force if isinstance(force, tuple) else (force,))
    assert roles.time == split[0]
    counted = ("penetration", "depth", "Indentation", "Penetration", "s0.depth")
    assert roles.is_penetration == roles.depth[0].startswith(counted)


def test_a_unit_tells_what_a_name_does_not_and_reasons_are_given():
    roles = choose_roles(recording("t", "a", "b", a="mm", b="mN"))
    assert (roles.depth, roles.force) == (("a",), ("b",))
    roles = choose_roles(recording("time", *SPACE["position"], "force_N"))
    assert roles.reasons["position"].startswith("the only position in space")
    assert roles.reasons["force"] == "has this name"


def test_several_that_could_be_it_are_named_with_the_option():
    names = [f"{topic}.wrench.force.{axis}" for topic in ("/left", "/right") for axis in "xyz"]
    both = recording("time", "x", "y", "z", *names)
    words = r"2 channels could be the force: /left\.wrench\.force\.x,y,z, .*--force"
    with pytest.raises(RecordingError, match=words):
        choose_roles(both)
    for name in ("/left", "/left.wrench", "/left.wrench.force", ",".join(names[:3])):
        assert choose_roles(both, Columns(force=name)).force == tuple(names[:3])


def test_two_positions_beside_one_force_are_ambiguous():
    channels = {f"/{name}.z_m": np.arange(5.0) for name in ("arm", "camera")}
    channels |= {"/ft.force_N": np.arange(5.0)}
    clocks = {name: f"{name}.stamp" for name in channels}
    channels |= {clock: np.arange(5) for clock in clocks.values()}
    with pytest.raises(RecordingError, match="2 channels could be the position"):
        choose_roles(Recording(channels, clocks=clocks))


def test_the_orientation_comes_from_the_topic_of_the_position():
    places = [f"{topic}.pose.position.{axis}" for topic in ("/camera", "/arm") for axis in "xyz"]
    turns = [name.replace("position", "orientation") for name in places]
    turns += [f"{topic}.pose.orientation.w" for topic in ("/camera", "/arm")]
    force = [f"/ft.wrench.force.{axis}" for axis in "xyz"]
    both = recording("time", *places, *turns, *force)
    for name in ("/arm", "/arm.pose.position"):
        own = choose_roles(both, Columns(position=name)).orientation
        assert own == tuple(f"/arm.pose.orientation.{axis}" for axis in "xyzw")
    given = choose_roles(both, Columns(position="/arm", orientation="/camera")).orientation
    assert given == tuple(f"/camera.pose.orientation.{axis}" for axis in "xyzw")


def test_a_missing_name_is_refused_with_those_that_exist():
    with pytest.raises(MissingChannelError, match="no column '/ft'"):
        choose_roles(recording("t", "z", "Fz"), Columns(force="/ft"))
    with pytest.raises(RecordingError, match="must name one channel or three"):
        choose_roles(recording("t", "z", "Fz"), Columns(force="t,z"))
    # A few numbered or lettered channels are no vector.
    for names in (["a1", "a2", "a3", "a4", "a5"], ["x", "y"], ["q0", "q1"], []):
        assert find_vectors(names) == []


def test_without_a_time_the_rate_has_to_be_given():
    bare = Recording({"depth": np.linspace(0, 1e-3, 50), "Fz": np.linspace(0, 2.0, 50)})
    with pytest.raises(RecordingError, match=r"no channel looks like the time; .*--rate"):
        prepare(bare)
    assert prepare(bare, rate=500.0).time[-1] == 49 / 500.0


RAMP = np.linspace(-1e-3, 9e-3, 200)


STEPS = 1e-3 * np.arange(200)


def table(time) -> Recording:
    depth = RAMP[: len(time)]
    channels = {"time_s": time, "penetration_m": depth, "force_N": 50 * depth}
    return Recording(channels, source="r.csv")


def test_samples_without_increasing_time_are_skipped_and_counted():
    time = STEPS.copy()
    time[50], time[80], time[120] = time[49], 0.0791 - 0.001, np.nan
    contact = prepare(table(time))
    assert len(contact) == 197
    [finding] = contact.findings
    assert finding.message == (
        "palpate skipped 3 of 200 samples: 1 without a time, 1 with the previous time, "
        "1 with an earlier time"
    )
    assert finding.severity == "note"
    with pytest.raises(RecordingError, match=r"sample 50: 0.049 s repeats the previous time"):
        prepare(table(time), strict=True)
    # Many of them call for care.
    many = STEPS.copy()
    many[10::20] = many[9::20]
    contact = prepare(table(many))
    assert len(contact) == 190
    assert contact.findings[0].severity == "with-care"
    # A time that a flipped bit made is none.
    time = STEPS.copy()
    time[[0, 90]] = -1.6e190, 4e200
    contact = prepare(table(time))
    assert len(contact) == 198
    assert "2 without a time" in contact.findings[0].message
    with pytest.raises(RecordingError, match=r"sample 0: -1\.6e"):
        prepare(table(time), strict=True)
    with pytest.raises(RecordingError, match="no sample has a valid time"):
        prepare(table(np.full(200, 1e190)))


def test_a_recorder_that_was_started_again_begins_another_contact():
    time = np.concatenate([STEPS[:120], STEPS[:80]])
    contact = prepare(table(time))
    assert [part.start for part in contact.segments()] == [0, 120]
    assert "the recorder restarted once" in contact.findings[0].message
    with pytest.raises(RecordingError, match=r"sample 120: 0 s runs back from 0.119 s"):
        prepare(table(time), strict=True)
    with pytest.raises(RecordingError, match="the time runs backward"):
        prepare(table(STEPS[::-1]))


def test_a_gap_parts_contacts_and_a_change_of_rate_does_not():
    part = np.zeros(300, dtype=np.int64)
    steps = np.where(np.arange(299) < 150, 1e-4, 5e-3)
    assert not gaps(np.concatenate([[0], np.cumsum(steps)]), part).any()
    steps = np.full(299, 1e-3)
    steps[[60, 200]] = 0.05
    assert np.flatnonzero(gaps(np.concatenate([[0], np.cumsum(steps)]), part)).tolist() == [61, 201]
    contact = prepare(table(np.concatenate([STEPS[:100], 2.0 + STEPS[:100]])))
    assert [part.start for part in contact.segments()] == [0, 100]
    assert "a gap in time, 1.9 s" in contact.findings[0].message


def test_whole_nanoseconds_stay_exact():
    stamp = 1_700_000_000_000_000_000 + 1_000_000 * np.arange(200) + np.arange(200) % 3
    channels = {"stamp": stamp, "penetration_m": RAMP, "force_N": RAMP}
    contact = prepare(Recording(channels, units={"stamp": "ns"}))
    np.testing.assert_array_equal(contact.time, 1e-9 * (stamp - stamp[0]))
    assert select_increasing_rows(stamp).skipped == 0


@pytest.mark.parametrize("every", [1, 4])
def test_the_faster_clock_is_interpolated_at_the_slower(every):
    recorded = topics_of(hand(2.0), every=every)
    signals = build_signals(recorded, choose_roles(recorded))
    assert np.median(np.diff(signals.time)) == pytest.approx(every * 1e-3)
    assert every == 1 or "at the times of '/pose" in signals.made["force"]
    # A straight line between two samples 1 ms apart is off by ẍ Δt²/8 at most: some 40 nm here.
    truth = hand(2.0)
    along = np.interp(signals.time, truth.time, truth.position[:, 2])
    assert np.median(np.abs(signals.depth[:, 2] - along)) < 2e-6


def changed(recorded: Recording, **channels) -> Recording:
    return dataclasses.replace(recorded, channels={**recorded.channels, **channels})


def test_no_sample_is_made_up_in_a_gap_of_the_other_clock():
    recorded = topics_of(hand(2.0))
    keep = (np.arange(2000) < 600) | (np.arange(2000) >= 900)
    ft = {name: each[keep] for name, each in recorded.channels.items() if name.startswith("/ft")}
    cut = changed(recorded, **ft)
    signals = build_signals(cut, choose_roles(cut))
    inside = (signals.time > 0.6005) & (signals.time < 0.899)
    assert not inside.any()
    assert np.unique(signals.part).size == 2


def test_clocks_without_a_common_time_are_refused():
    recorded, name = topics_of(hand(1.0)), "/pose.header.stamp"
    apart = changed(recorded, **{name: recorded.channels[name] + 10_000_000_000})
    with pytest.raises(RecordingError, match="do not overlap"):
        prepare(apart)
    short = {"time_s": np.arange(5.0), "penetration_m": np.arange(4.0), "force_N": np.arange(5.0)}
    with pytest.raises(RecordingError, match="'time_s' has 5, 'depth' has 4"):
        prepare(Recording(short))


# Three columns of a kind are a vector, or three of something else.

HANDS = np.random.default_rng(5).normal(0.0, 1e-3, (7, 400))


def touch(length: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, penetration and force of a touch of F = 6000 x^1.3 + 3000 x^1.3 v."""
    time = 0.01 * np.arange(length)
    depth = -4e-3 + 12e-3 * np.sin(0.25 * np.pi * time) ** 2
    power = np.maximum(depth, 0.0) ** 1.3
    noise = np.random.default_rng(length).normal(0.0, 0.005, length)
    return time, depth, power * (6000.0 + 3000.0 * np.gradient(depth, time)) + noise


def side_by_side(*names: str) -> Recording:
    """Columns of one table; a name says whether it is a time, a force or a depth in m."""
    time, depth, force = touch()
    values = {"t": time, "f": force, "d": depth}
    return Recording({name: values[kind] for kind, _, name in (n.partition(":") for n in names)})


RUNS = [f"d:Position {k} (m)" for k in (1, 2, 3)] + [f"f:Force {k} (N)" for k in (1, 2, 3)]
CELLS = [f"f:force_{k}" for k in (1, 2, 3)]
NUMBERED = [f"d:position_{k}" for k in (1, 2, 3)] + CELLS
FLAT = [f"d:position_{k}" for k in range(3)] + [f"f:force_{k}" for k in range(3)]
COUNTED = [name.replace("_", "_trial_") for name in FLAT]
PARTS = [name for name in RUNS if "2" not in name]
ROWS = [f"{kind}[{k}]" for kind in ("d:depth", "f:force") for k in range(3)]
LOAD = [f"f:load_cells[{k}]" for k in range(3)]
MARKERS = [f"d:marker{k}_z" for k in (1, 2, 3)]
FIRST = "--position 'Position 1 (m)' --force 'Force 1 (N)'"
SIDE_BY_SIDE = {
    "runs": (RUNS, FIRST, 3),
    "runs that are numbered from one": (NUMBERED, "--position position_1 --force force_1", 3),
    "trials": (COUNTED, "--position position_trial_0 --force force_trial_0", 0),
    "the first and the third run": (PARTS, FIRST, 0),
    "trials by unit": (["d:depth", "f:trial_1_N", "f:trial_2_N"], "--force trial_1_N", 0),
    "load cells": (["d:depth", *CELLS], "--force force_1", 3),
    "an array of cells": (["d:depth", *LOAD], "--force 'load_cells[0]'", 0),
    "four cells": (["d:depth", *(f"f:force[{k}]" for k in range(4))], "--force 'force[0]'", 0),
    "markers": ([*MARKERS, "f:force"], "--position marker1_z", 0),
    "fingers": (["d:depth", "f:finger1_force", "f:finger2_force"], "--force finger1_force", 0),
    "arrays and a total": ([*FLAT, "f:total force"], "--position position_0 --force force_0", 0),
    "rows of an array": (ROWS, "--penetration 'depth[0]' --force 'force[0]'", 3),
}


def columns_of(options: str) -> Columns:
    words = shlex.split(options)
    return Columns(**{name[2:]: value for name, value in zip(words[::2], words[1::2], strict=True)})


@pytest.mark.parametrize("names, options, axes", SIDE_BY_SIDE.values(), ids=SIDE_BY_SIDE)
def test_ambiguous_columns_are_refused_with_usable_options(names, options, axes):
    table = side_by_side("t:time", *names)
    with pytest.raises(RecordingError, match=rf"choose one, such as {re.escape(options)}") as asked:
        prepare(table)
    law = palpate.identify(prepare(table, columns=columns_of(options))).law
    assert law.K == pytest.approx(6000.0, rel=0.02)
    vector = re.search(r"for x, y and z of one vector, ([^;]*)", str(asked.value))
    assert (vector is not None) == (axes == 3)
    if vector is not None:
        assert len(prepare(table, columns=columns_of(vector[1])))


def test_the_time_of_a_run_is_the_one_with_its_number():
    names = [
        f"{kind}:{name}{k}" for k in (1, 2) for kind, name in (("t", "t"), ("d", "x"), ("f", "F"))
    ]
    chosen = choose_roles(side_by_side(*names), Columns(position="x2", force="F2"))
    assert chosen.time == "t2"


def test_a_velocity_gives_the_rate_of_a_table_without_a_time():
    time, depth, force = touch()
    velocity = np.gradient(depth, time)
    table = Recording({"Penetration": depth, "Velocity of deformation": velocity, "Force": force})
    law = palpate.identify(prepare(table)).law
    assert (law.K, law.B) == pytest.approx((6000.0, 3000.0), rel=0.02)
    still = Recording({**table.channels, "Velocity of deformation": velocity[::-1].copy()})
    with pytest.raises(RecordingError, match="no channel looks like the time; name it"):
        prepare(still)


def test_errors_name_a_mass_and_a_time_in_words():
    _, depth, force = touch()
    with pytest.raises(
        RecordingError, match=r"is the force, in gf, pass --force 'Scale \(grams\)'"
    ):
        prepare(Recording({"Travel (mm)": depth, "Scale (grams)": force}))
    when = np.array(["about noon"] * depth.size, dtype=object)
    with pytest.raises(RecordingError, match="time: 'time' holds 'about noon', neither a number"):
        prepare(Recording({"time": when, "x_mm": depth, "F_N": force}))


FLATTENED = {
    "of pandas": ("position_{}", 3, "force_{}", 3),
    "with units": ("pos_{}_m", 3, "force_{}_N", 3),
    "of poses and wrenches": ("observation.ee_pose_{}", 7, "observation.wrench_{}", 6),
    "of rostopic": ("field.position{}", 3, "field.force{}", 3),
}


@pytest.mark.parametrize("position, m, force, n", FLATTENED.values(), ids=FLATTENED)
def test_flattened_arrays_are_vectors_with_a_note(position, m, force, n):
    time, depth, normal_force = touch()
    places = {position.format(k): HANDS[k] * 0.0 for k in range(m)}
    forces = {force.format(k): HANDS[k] * 0.0 for k in range(n)}
    places[position.format(2)], forces[force.format(2)] = -depth, normal_force
    frame = pandas.DataFrame({"time": time, **places, **forces})
    result = palpate.identify(frame)
    assert result.law.K == pytest.approx(6000.0, rel=0.01)
    [note] = [each for each in result.contact.findings if "for x, y and z" in each.message]
    assert note.severity == "note"
    stated = Columns(position=",".join([*places][:3]), force=",".join([*forces][:3]))
    assert not any("for x, y" in each.message for each in prepare(frame, columns=stated).findings)


@pytest.mark.parametrize("names", ["test_{}/{}", "data/run_{}/obs/{}"])
def test_each_group_of_a_file_is_a_contact(tmp_path, names):
    path = tmp_path / "groups.hdf5"
    with h5py.File(path, "w") as file:
        for k in range(3):
            for name, values in zip(("time", "displacement", "force"), touch(400 - k), strict=True):
                file[names.format(k, name)] = values
    contact = prepare(path)
    assert [part.stop - part.start for part in contact.segments()] == [400, 399, 398]
    assert palpate.identify(contact).law.K == pytest.approx(6000.0, rel=0.01)
    remedy = next(each.remedy for each in contact.findings if "3 groups" in each.message)
    assert len(prepare(path, columns=columns_of(remedy.partition(": ")[2]))) == 400


def test_groups_counted_as_tests_are_contacts_with_a_rate_too(tmp_path):
    _, depth, force = touch()
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        for k in range(2):
            file[f"test_{k}/displacement"], file[f"test_{k}/force"] = depth, force
    contact = prepare(tmp_path / "a.hdf5", rate=100.0)
    assert [part.stop - part.start for part in contact.segments()] == [400, 400]


def test_the_signal_and_the_axes_of_nexus_name_force_and_position(tmp_path):
    """NeXus manual, NXdata: the attributes ``signal`` and ``axes`` of the group, since 2014."""
    time, depth, force = touch()
    with h5py.File(tmp_path / "a.nxs.h5", "w") as file:
        data = file.create_group("entry/data")
        data.attrs.update(NX_class="NXdata", signal="channel_1", axes=["channel_2"])
        data["time"], data["channel_1"], data["channel_2"] = time, force, depth
        data["force_raw"], data["position_of_stage"] = 2.0 * force, 3.0 * depth
    roles = choose_roles(palpate.open_recording(tmp_path / "a.nxs.h5"))
    assert (roles.depth, roles.force) == (("entry/data/channel_2",), ("entry/data/channel_1",))


def test_an_unnamed_state_is_refused_with_the_option(tmp_path):
    time, depth, force = touch()
    path, still = tmp_path / "a.hdf5", np.zeros((len(time), 7))
    with h5py.File(path, "w") as file:
        file["timestamp"] = time
        file["state"], file["force"], file["action"] = still, still[:, :6], still
        file["state"][:, 2], file["force"][:, 2] = -depth, force
    with pytest.raises(MissingChannelError) as asked:
        prepare(path)
    [option] = re.findall(r"name its channel, such as (--position \S+);", str(asked.value))
    assert palpate.identify(prepare(path, columns=columns_of(option))).law.K == (
        pytest.approx(6000.0, rel=0.01)
    )


def test_fingers_on_one_clock_are_not_separate_contacts(tmp_path):
    time, depth, force = touch()
    path = tmp_path / "hand.hdf5"
    with h5py.File(path, "w") as file:
        file["time"] = time
        for k in range(2):
            file[f"finger_{k}/position"], file[f"finger_{k}/force"] = depth, force
    with pytest.raises(RecordingError, match="--position finger_0/position --force finger_0/force"):
        prepare(path)


def test_parts_of_a_vector_have_one_length():
    time, depth, force = touch()
    places = {"pos/x": HANDS[0], "pos/y": HANDS[1, :399], "pos/z": -depth[:397]}
    parts = Recording({"time": time, **places, "force": force})
    with pytest.raises(RecordingError, match=r"choose one, such as --position pos/x$"):
        prepare(parts)
    with pytest.raises(RecordingError, match="'pos/x' has 400, 'pos/y' has 399, 'pos/z' has 397"):
        prepare(parts, columns=Columns(position="pos/x,pos/y,pos/z"))
    with pytest.raises(RecordingError, match="'depth' has 399, 'force' has 400"):
        prepare(Recording({"depth": depth[:399], "force": force}), rate=100.0)


# What a channel measures.

KINDS = {
    "pos_z force_z": ("pos_z", "force_z"),
    "actual_TCP_pose_z actual_TCP_force_z": ("actual_TCP_pose_z", "actual_TCP_force_z"),
    "ee_z f_ee_z": ("ee_z", "f_ee_z"),
    "z_mm force_t": ("z_mm", "force_t"),
    "pos_z acc_z gyro_z force": ("pos_z", "force"),
    "pos_mm joint_1 joint_position_2 Fz": ("pos_mm", "Fz"),
    "Displacement_mm Displacement_V Load_N": ("Displacement_mm", "Load_N"),
    "Weg_mm Kraft_N": ("Weg_mm", "Kraft_N"),
    "posición_mm fuerza_N": ("posición_mm", "fuerza_N"),
    "pos_z contact_normal_z force_n force_t1": ("pos_z", "force_n"),
}


@pytest.mark.parametrize("names, depth_and_force", KINDS.items(), ids=KINDS)
def test_the_strongest_word_of_a_name_counts(names, depth_and_force):
    roles = choose_roles(recording("Time_S", *names.split()))
    assert (*roles.depth, *roles.force) == depth_and_force
    assert roles.time == "Time_S"


def test_a_capital_unit_of_time_is_read():
    time, depth, force = touch()
    table = Recording({"TIME_MS": 1e3 * time, "DISPLACEMENT_MM": 1e3 * depth, "FORCE_N": force})
    assert palpate.identify(table).law.B == pytest.approx(3000.0, rel=0.05)


JOINTS = {f"/joint_states.position[{name}]": touch()[1] for name in ("joint_1", "elbow", "wrist")}
WRENCH = {f"/ft.wrench.force.{axis}": HANDS[k] for k, axis in enumerate("xyz")}
CAMERA = {f"/tf_static[base>camera].transform.translation.{a}": HANDS[0, :1] for a in "xyz"}
TOOL = {f"/tf[base>tool].transform.translation.{a}": HANDS[k] for k, a in enumerate("xyz")}
FIXED = {f"/tf[base>camera].transform.translation.{axis}": np.ones(400) for axis in "xyz"}
TYPES = {"/joint_states": "sensor_msgs/msg/JointState", "/tf": "tf2_msgs/msg/TFMessage"}


def test_joints_and_fixed_frames_are_not_the_probe():
    robot = Recording({"t": touch()[0], **JOINTS, **WRENCH, **CAMERA, **TOOL, **FIXED}, types=TYPES)
    assert choose_roles(robot).depth == tuple(TOOL)
    still = Recording({"t": touch()[0], **JOINTS, **WRENCH, **CAMERA}, types=TYPES)
    with pytest.raises(MissingChannelError, match="a force and an angle, and no position"):
        choose_roles(still)
    # A joint that slides is one, and so is any that is named: its brackets hold no unit.
    for name in ("joint_1", "elbow"):
        joint = Columns(position=f"/joint_states.position[{name}]")
        assert len(
            prepare(Recording({**still.channels, "force": touch()[2]}, types=TYPES), columns=joint)
        )
    slide = {
        "t": touch()[0],
        "/joint_states.position[linear_axis]": touch()[1],
        "force": touch()[2],
    }
    assert choose_roles(Recording(slide, types=TYPES)).depth == (
        "/joint_states.position[linear_axis]",
    )


MISSING = {
    "tiempo fuerza accel_x accel_y accel_z": "a force and an acceleration, and no position; record",
    "time force": "there is a force, and no position; record the position",
    "time px py pz": "there is a position, and no force; record the force",
    "time_s strain_pct stress_kPa": "a stress and a strain, and no position and no force; multiply",
    "time joint_1 joint_2 Fz": "there is a force and an angle, and no position",
    "time temperature": "there is no position and no force; record both",
    "t_s Weg_mm Channel[p]": "no force; palpate does not know the unit p of 'Channel[p]'",
}


@pytest.mark.parametrize("names, words", MISSING.items(), ids=MISSING)
def test_a_result_states_recorded_and_missing_quantities(names, words):
    with pytest.raises(MissingChannelError) as caught:
        choose_roles(recording(*names.split()))
    message = str(caught.value)
    assert words in message
    assert message.endswith(f"available: {', '.join(names.split())}")
    assert "penetration_m" not in message
    assert "force_N" not in message
    assert str(pickle.loads(pickle.dumps(caught.value))) == message


def test_a_unit_that_is_not_known_is_the_reason():
    table = {"Zeit [s]": touch()[0], "Weg [mm]": touch()[1], "Kraft [p]": touch()[2]}
    with pytest.raises(RecordingError, match="cannot convert the unit p of the force"):
        prepare(Recording(table))


POSE = *(f"/tcp/pose/position/{a}" for a in "xyz"), *(f"/tcp/pose/orientation/{a}" for a in "xyzw")
WRENCHES = {
    "/ft/wrench/force/{}": "/ft/wrench/torque/{}",
    "robot.ft.force.{}": "robot.ft.torque.{}",
    "observation.effort.F{}": "observation.effort.M{}",
    "observation.effort.f_{}": "observation.effort.torque_{}",
}


@pytest.mark.parametrize("force, torque", WRENCHES.items(), ids=WRENCHES)
def test_the_torque_is_that_of_the_sensor_of_the_force(force, torque):
    wrench = [form.format(axis) for form in (force, torque) for axis in "xyz"]
    others = [f"/joints/torque/{axis}" for axis in "xyz"]
    roles = choose_roles(recording("t", *POSE, *others, *wrench))
    assert (*roles.force, *roles.torque) == (*wrench,)


def test_a_force_and_torque_in_one_array_are_a_wrench():
    for name in ("observation.force_torque[{}]", "ft_raw_wrench[{}]", "forceTorque[{}]"):
        wrench = tuple(name.format(k) for k in range(6))
        read = recording("t", *POSE, *(f"actual_TCP_pose[{k}]" for k in range(3, 6)), *wrench)
        roles = choose_roles(read)
        assert (roles.force, roles.torque) == (wrench[:3], wrench[3:])
        assert build_signals(read, roles).force.shape == (5, 3)  # and no raw counts


RAW = ("{} (counts)", "{} [ADC]", "{} raw", "adc_{}", "raw_{}")


@pytest.mark.parametrize("form", RAW)
@pytest.mark.parametrize("kind, unit", [("force", "0.01N"), ("penetration", "0.01m")])
def test_raw_counts_are_refused_with_the_option_that_calibrates_them(form, kind, unit):
    names = {"penetration": "depth_m", "force": "load_N"}
    names[kind] = form.format({"penetration": "depth", "force": "load"}[kind])
    read = recording("time_s", *names.values())
    with pytest.raises(RecordingError, match=rf"--unit {kind}=0\.0098") as caught:
        prepare(read)
    assert repr(names[kind]) in str(caught.value)
    assert getattr(prepare(read, units={kind: unit}), kind)[-1] == pytest.approx(0.04)


def test_raw_messages_are_not_raw_counts():
    names = "/ft_raw.wrench.force.z", "depth_m", "time_s"
    read = dataclasses.replace(recording(*names), types={"/ft_raw": "geometry_msgs/msg/Wrench"})
    assert prepare(read).force[-1] == 4.0


def test_channels_in_volts_are_ignored_and_said():
    contact = prepare(recording("Time (s)", "Depth (nm)", "Load (µN)", "Depth (V)", "Load (V)"))
    assert contact.penetration[-1] == pytest.approx(4e-9)
    assert "palpate ignores 'Depth (V)', 'Load (V)'" in str(contact.findings)


def test_a_name_without_its_unit_names_a_channel():
    read = recording("t [s]", "Stempel_pos [mm]", "Stempel_soll [mm]", "Kraft [N]", "a [N]", "a")
    chosen = choose_roles(read, Columns(penetration="Stempel_pos", force="Kraft"))
    assert (chosen.depth, chosen.force) == (("Stempel_pos [mm]",), ("Kraft [N]",))
    assert choose_roles(read, Columns(penetration="Stempel_pos", force="a")).force == ("a",)
    with pytest.raises(MissingChannelError, match="no column 'Stempel'"):
        choose_roles(read, Columns(penetration="Stempel"))
