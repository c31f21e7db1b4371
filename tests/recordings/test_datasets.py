"""Data sets of robot learning, written by the libraries of their recorders (dataset_files.py)."""

import json
import re
import shutil

import h5py
import numpy as np
import pytest
from dataset_files import (
    episode,
    episodes,
    pose_and_wrench,
    write_force_umi,
    write_lerobot_2,
    write_lerobot_3,
    write_libero,
    write_replay_buffer,
    write_robomimic,
)

import palpate
from palpate import Columns, HuntCrossley, RecordingError, open_recording
from palpate.errors import NoContactError

SIX = episodes()
FREE = [k for k, each in enumerate(SIX) if each.law is None]


def write_zip(path, given):
    write_replay_buffer(path, given, zip_file=True)


def write_zipped_folder(path, given):
    """As ``zip -r store.zip store.zarr`` does."""
    store = path.with_suffix(".zarr")
    write_replay_buffer(store, given)
    shutil.make_archive(path.with_suffix(""), "zip", path.parent, store.name)
    shutil.rmtree(store)


def write_lerobot_3_without_episodes(path, given):
    write_lerobot_3(path, given)
    shutil.rmtree(path / "meta/episodes")


LAYOUTS = {
    "LeRobot v2.1": ("pressing", write_lerobot_2),
    "LeRobot v3.0": ("pressing", write_lerobot_3),
    "robomimic": ("pressing.hdf5", write_robomimic),
    "LIBERO": ("pressing.hdf5", write_libero),
    "UMI": ("pressing.zarr", write_replay_buffer),
    "UMI in a zip": ("pressing.zarr.zip", write_zip),
    "LeRobot v3.0 without meta/episodes": ("pressing", write_lerobot_3_without_episodes),
    "UMI in a folder in a zip": ("pressing.zip", write_zipped_folder),
}


@pytest.fixture(scope="module", params=LAYOUTS)
def stored(request, tmp_path_factory):
    name, write = LAYOUTS[request.param]
    given = episodes(rate=20.0) if request.param == "LIBERO" else SIX
    path = tmp_path_factory.mktemp("sets") / name
    write(path, given)
    return path, given


def check_law(contact, each, *, mark="trust"):
    result = palpate.identify(contact)
    working_depth = result.diagnosis.working_depth
    _, stiffness, damping = each.law.at_rest(working_depth.depth)
    for found, true in ((working_depth.stiffness, stiffness), (working_depth.damping, damping)):
        bar = np.hypot(found.standard_error, found.systematic)
        assert abs(found.value - true) < 3.0 * bar
    assert abs(working_depth.stiffness.value / stiffness - 1.0) < 0.03
    assert result.diagnosis.verdict.stiffness == mark


@pytest.mark.long
def test_episodes_need_no_option_and_free_air_is_no_contact(stored):
    path, given = stored
    for number in (1, 5, *FREE):
        each = given[number]
        recording = open_recording(path, episode=number)
        assert recording.episode == number
        if each.law is None:
            with pytest.raises(
                NoContactError, match=f"episode {number}: no contact found: the force is"
            ):
                palpate.identify(recording)
        else:
            check_law(recording, each)


@pytest.mark.long
def test_all_episodes_are_contacts_with_one_object(stored):
    path, given = stored
    contact = palpate.prepare(path)
    touching = [each for each in given if each.law is not None]
    assert len(contact) == sum(each.samples for each in touching)
    assert len(np.unique(contact.segment)) >= len(touching)
    [finding] = [each for each in contact.findings if "episodes" in each.message]
    assert "4 of 6 episodes" in finding.message
    assert "no contact in 2, 4" in finding.message


@pytest.mark.long
def test_info_lists_the_episodes(stored, run):
    path, _ = stored
    code, out, _ = run("info", path)
    lines = out.splitlines()
    assert code == 0
    assert "6 episodes" in lines[0]
    assert lines[1:7] == [f"episode {k}: 300 samples" for k in range(6)]
    _, out, _ = run("info", path, "--json")
    assert json.loads(out)["data_set"]["lengths"]["5"] == 300


def test_an_episode_that_is_not_there_is_named(stored):
    with pytest.raises(RecordingError, match="has no episode 6; it has 6, from 0 on"):
        open_recording(stored[0], episode=6)


def test_one_file_of_a_lerobot_data_set_holds_its_own_episodes(tmp_path):
    write_lerobot_2(tmp_path / "two", SIX)
    write_lerobot_3(tmp_path / "three", SIX, in_a_file=4)
    check_law(open_recording(tmp_path / "two/data/chunk-000/episode_000003.parquet"), SIX[3])
    file = tmp_path / "three/data/chunk-000/file-001.parquet"
    check_law(open_recording(file, episode=5), SIX[5])
    with pytest.raises(RecordingError, match="has no episode 3; it has 2, from 4 on"):
        open_recording(file, episode=3)


def test_force_umi_names_the_one_option_that_it_needs(tmp_path):
    write_force_umi(tmp_path / "umi", SIX)
    for number, each in enumerate(SIX):
        file = tmp_path / f"umi/episode_{number}.hdf5"
        with pytest.raises(RecordingError, match="such as --position state"):
            palpate.prepare(file)
        if each.law is not None:
            check_law(palpate.prepare(file, columns=Columns(position="state")), each)


# Layouts of HDF5: arrays of a pose (7 numbers) and a wrench (6), with the options that they need.
CLOCKS = {"robot/pose": 0, "robot/wrench": 1, "timestamps/pose": 2, "timestamps/wrench": 2}
ASKED = {
    "two arms": (lambda a: np.stack([a, a[::-1]], 1), "end/pose[0]", "end/wrench[0]"),
    "windows": (lambda a: np.stack([a[:-1], a[1:]], 1), "end/pose[1]", "end/wrench[1]"),
    "one state": (None, "state[0],state[1],state[2]", "state[7],state[8],state[9]"),
}


def test_a_group_of_clocks_has_the_names_of_their_arrays(tmp_path):
    each = SIX[0]
    arrays = [pose_of_seven(each), wrench_of(each), 1.76e9 + each.time]
    with h5py.File(tmp_path / "clocks.h5", "w") as file:
        for name, number in CLOCKS.items():
            file[name] = arrays[number]
        file["robot/gripper"] = np.zeros(90)
        file["timestamps/gripper"] = 1.76e9 + 0.1 * np.arange(90)
    recording = open_recording(tmp_path / "clocks.h5")
    assert recording.clocks["robot/gripper"] == "timestamps/gripper"
    check_law(recording, each)


@pytest.mark.parametrize("layout", ASKED)
def test_several_vectors_in_a_sample_ask_which_one(tmp_path, layout):
    join, position, force = ASKED[layout]
    each = SIX[0]
    pose, wrench, time = pose_of_seven(each), wrench_of(each), 1.76e9 + each.time
    with h5py.File(tmp_path / "set.h5", "w") as file:
        if join is None:
            file["state"] = np.hstack([pose, wrench])
        else:
            file["end/pose"], file["end/wrench"] = join(pose), join(wrench)
            time = time[-len(file["end/pose"]) :]
            file["ee_rotation"] = np.tile(np.eye(3), (time.size, 1, 1))  # no vectors
        file["timestamp"] = time
    with pytest.raises(RecordingError, match=f"such as --position '{re.escape(position[:-2])}"):
        palpate.prepare(tmp_path / "set.h5")
    columns = Columns(position=position, force=force)
    check_law(palpate.prepare(tmp_path / "set.h5", columns=columns), each)


def pose_of_seven(each):
    return np.hstack([each.position, np.tile([1.0, 0.0, 0.0, 0.0], (each.samples, 1))])


def wrench_of(each):
    return pose_and_wrench(each)["observation.wrench"]


def state_with_names(each):
    pose, wrench = pose_and_wrench(each).values()
    return {"observation.state": np.hstack([pose, np.ones((each.samples, 2)), wrench])}


LABELS = ["x", "y", "z", "roll", "pitch", "yaw", "gripper", "gripper"]
LABELS += ["fx", "fy", "fz", "tx", "ty", "tz"]
FLAT = [*(f"pose_{a}.pos" for a in "xyz"), "a.quat", "b.quat", "c.quat", "gripper.pos", "on"]
FLAT += [f"wrench_{a}.{kind}" for kind in ("force", "torque") for a in "xyz"]
NESTED = {"pose": {"position": ["x", "y", "z"], "turn": ["r", "p", "y"]}, "hand": ["open", "on"]}
NESTED |= {"wrench": [["fx", "fy", "fz"], ["tx", "ty", "tz"]]}
NAMES = {"list": LABELS, "dict": {"motors": LABELS}, "flat": FLAT, "nested": NESTED}


@pytest.mark.parametrize("labels", NAMES.values(), ids=NAMES)
def test_a_state_has_the_names_of_its_description(tmp_path, labels):
    names = [("observation.state", labels)]
    write_lerobot_2(tmp_path / "named", SIX[:2], state=state_with_names, names=names)
    check_law(open_recording(tmp_path / "named", episode=1), SIX[1])


def test_a_commanded_pose_is_no_position(tmp_path):
    write_lerobot_2(tmp_path / "set", SIX[:1], state=lambda each: {"wrench": each.force})
    with pytest.raises(RecordingError, match="no position"):
        palpate.prepare(tmp_path / "set")
    commanded = palpate.prepare(tmp_path / "set", columns=Columns(position="action"))
    check_law(commanded, SIX[0], mark="with-care")


def test_a_command_equal_to_a_measurement_drops_no_channel(tmp_path):
    def state(each):
        pose, wrench = pose_and_wrench(each).values()
        whole = np.hstack([pose, np.ones((each.samples, 2))])
        return {"observation.state": whole, "action.position": pose[:, :3], "wrench": wrench}

    names = [("observation.state", [*"xyz", "roll", "pitch", "yaw", "gripper", "on"])]
    write_lerobot_2(tmp_path / "set", SIX[:1], state=state, names=names)
    check_law(open_recording(tmp_path / "set", episode=0), SIX[0])


def test_a_copy_without_all_files_loses_only_their_episodes(tmp_path):
    write_lerobot_2(tmp_path / "set", SIX)
    (tmp_path / "set/data/chunk-000/episode_000003.parquet").unlink()
    check_law(open_recording(tmp_path / "set", episode=5), SIX[5])
    with pytest.raises(RecordingError, match=r"episode 3: its file .* is missing"):
        open_recording(tmp_path / "set", episode=3)


DAMAGE = {
    "meta/info.json": ('{"codebase_version": "v3.0", "fps"', "description .* is damaged"),
    "data/chunk-000/file-000.parquet": ("PAR1", "cannot be read"),
    "meta/episodes/chunk-000/file-000.parquet": ("PAR1", "description .* is damaged"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_refused_in_a_line(tmp_path, name):
    write_lerobot_3(tmp_path / "set", SIX)
    text, words = DAMAGE[name]
    (tmp_path / "set" / name).write_text(text)
    with pytest.raises(RecordingError, match=words):
        open_recording(tmp_path / "set", episode=0)


def test_rows_of_another_episode_are_refused(tmp_path):
    write_lerobot_3(tmp_path / "set", SIX)
    write_lerobot_3(tmp_path / "other", SIX[3:] + SIX[:3], in_a_file=3)
    file = "data/chunk-000/file-001.parquet"
    (tmp_path / "set" / file).write_bytes((tmp_path / "other" / file).read_bytes())
    with pytest.raises(RecordingError, match="not have its rows where the description says"):
        open_recording(tmp_path / "set", episode=4)


def test_more_than_a_hundred_episodes_are_for_a_fleet(tmp_path):
    write_robomimic(tmp_path / "many.hdf5", [SIX[0]] * 101)
    with pytest.raises(RecordingError, match=r"holds 101 episodes, .* palpate fleet"):
        palpate.identify(tmp_path / "many.hdf5")


def test_a_file_that_is_no_data_set_has_no_episodes(tmp_path):
    (tmp_path / "touch.csv").write_text("time,x,f\n0,0,0\n1,1,1\n")
    with pytest.raises(RecordingError, match="no data set; drop --episode"):
        open_recording(tmp_path / "touch.csv", episode=0)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [10, 30, 50, 100])
def test_the_damping_is_within_two_standard_errors(tmp_path, rate):
    random, given = np.random.default_rng(3), []
    for seed in range(50):
        stiffness, shape = 10.0 ** random.uniform(2.3, 3.6), random.choice([1.0, 1.3, 1.5])
        k = stiffness * 4e-3 ** (1.0 - shape)
        law = HuntCrossley(K=k, B=random.uniform(5.0, 40.0) * k, n=shape)
        options = {"rate": float(rate), "samples": 10 * rate, "noise": 6e-5 * stiffness}
        given.append(episode(seed + 10_000, law, **options))
    write_lerobot_3(tmp_path / "set", given, rate=rate, in_a_file=50)
    distances = []
    for number, each in enumerate(given):
        result = palpate.identify(open_recording(tmp_path / "set", episode=number))
        found = result.diagnosis.working_depth
        true_depth = 0.3 - each.position[:, 2]  # without free air the surface is assumed
        shift = np.median(result.contact.penetration - true_depth[: len(result.contact)])
        damping = each.law.at_rest(found.depth - shift)[2]
        bar = np.hypot(found.damping.standard_error, found.damping.systematic)
        distances.append((found.damping.value - damping) / bar)
    assert np.mean(np.abs(distances) < 2.0) >= 0.93
