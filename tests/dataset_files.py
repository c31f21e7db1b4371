"""Data sets of robot learning, as their recorders write them, with episodes of known laws.

LeRobot v2.1 and v3.0: https://huggingface.co/docs/lerobot/lerobot-dataset-v3. robomimic:
https://robomimic.github.io/docs/datasets/overview.html. LIBERO:
https://github.com/Lifelong-Robot-Learning/LIBERO (scripts/create_dataset.py). UMI and diffusion
policy: https://github.com/real-stanford/diffusion_policy (common/replay_buffer.py). ForceUMI:
https://github.com/Elycyx/ForceUMI (README.md, "Data Format").
"""

import json
from dataclasses import dataclass

import numpy as np

from palpate import HuntCrossley

STIFFNESS = (400.0, 900.0, 1500.0, 800.0)


@dataclass(frozen=True)
class Episode:
    """Samples of a probe that touches a few times along −z; in free air without a law."""

    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    law: HuntCrossley | None

    @property
    def samples(self):
        return len(self.time)


def episode(
    seed, law, *, rate=30.0, samples=300, lowest=0.4, highest=0.9, noise=0.05, late=0.0, offset=0.0
):
    random = np.random.default_rng(seed)
    time = np.arange(samples) / rate
    turns = 2.0 * np.pi * random.uniform(lowest, highest, 2)
    phases = random.uniform(0.0, 2.0 * np.pi, 2)
    sizes = np.array([4.4e-3, 3.6e-3])

    def motion(time):
        angles = turns * time[:, None] + phases
        begun = np.clip(time, 0.0, 1.0)  # from 10 mm above the surface
        begun, starting = begun**2 * (3.0 - 2.0 * begun), 6.0 * begun * (1.0 - begun)
        away = 1e-2 + 1.6e-3 + np.sin(angles) @ sizes
        depth = away * begun - (1e-2 if law is not None else 6e-2)
        return depth, (np.cos(angles) @ (sizes * turns)) * begun + away * starting

    position = np.tile([0.5, 0.1, 0.3], (samples, 1)) + random.normal(0.0, 1e-5, (samples, 3))
    force = offset + random.normal(0.0, noise, (samples, 3))
    position[:, 2] -= motion(time)[0]
    if law is not None:
        depth, velocity = motion(time - late)
        force[:, 2] += np.where(depth > 0.0, np.maximum(law.force(depth, velocity), 0.0), 0.0)
    return Episode(time, position, force, law)


def episodes(count=6, free=(2, 4), **options):
    """So many episodes with Hunt–Crossley laws of known stiffness, two of them in free air."""
    laws = (HuntCrossley(K=k, B=10.0 * k, n=1.0) for k in np.resize(STIFFNESS, count).tolist())
    offsets = {4: 3.0}  # not tared
    return [
        episode(seed, None if seed in free else law, offset=offsets.get(seed, 0.0), **options)
        for seed, law in enumerate(laws)
    ]


def _wrench(each):
    return np.hstack([each.force, np.zeros((each.samples, 3))]).astype(np.float32)


def _pose(each):
    turning = np.full((each.samples, 3), [3.1, 0.0, 0.2])
    return np.hstack([each.position, turning]).astype(np.float32)


def _joints(each):
    return np.cumsum(each.position - each.position[0], axis=0)[:, [0, 1, 2, 0, 1, 2, 2]]


# LeRobot


def _frames(each, number, first, state):
    import pyarrow as pa

    def lists(values):
        return pa.array(values.astype(np.float32).tolist(), pa.list_(pa.float32()))

    count = each.samples
    columns = {name: lists(values) for name, values in state(each).items()}
    columns["action"] = lists(_pose(each) + np.float32(1e-3))
    columns["timestamp"] = pa.array(each.time.astype(np.float32))
    columns["frame_index"] = pa.array(np.arange(count))
    columns["episode_index"] = pa.array(np.full(count, number))
    columns["index"] = pa.array(np.arange(first, first + count))
    columns["task_index"] = pa.array(np.zeros(count, np.int64))
    return pa.table(columns)


def _info(each, state, rate, version):
    features = {
        name: {"dtype": "float32", "shape": [values.shape[1]], "names": None}
        for name, values in {**state(each), "action": _pose(each)}.items()
    }
    features["observation.images.front"] = {"dtype": "video", "shape": [480, 640, 3]}
    for name in ("timestamp", "frame_index", "episode_index", "index", "task_index"):
        features[name] = {"dtype": "int64", "shape": [1], "names": None}
    return {"codebase_version": version, "fps": rate, "chunks_size": 1000, "features": features}


def pose_and_wrench(each):
    return {"observation.ee_pose": _pose(each), "observation.wrench": _wrench(each)}


def write_lerobot_2(folder, given, *, rate=30, state=pose_and_wrench, names=()):
    import pyarrow.parquet as parquet

    (folder / "meta").mkdir(parents=True)
    info, first, lines = _info(given[0], state, rate, "v2.1"), 0, []
    info["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    for name, labels in names:
        info["features"][name]["names"] = labels
    for number, each in enumerate(given):
        chunk = folder / f"data/chunk-{number // 1000:03d}"
        chunk.mkdir(parents=True, exist_ok=True)
        table = _frames(each, number, first, state)
        parquet.write_table(table, chunk / f"episode_{number:06d}.parquet")
        lines.append({"episode_index": number, "tasks": ["press"], "length": each.samples})
        first += each.samples
    (folder / "meta/info.json").write_text(json.dumps(info))
    (folder / "meta/episodes.jsonl").write_text("".join(f"{json.dumps(x)}\n" for x in lines))


def write_lerobot_3(folder, given, *, rate=30, state=pose_and_wrench, in_a_file=4):
    """As the recorder does: several episodes in a file, here all in one group of rows."""
    import pyarrow as pa
    import pyarrow.parquet as parquet

    for name in ("data/chunk-000", "meta/episodes/chunk-000"):
        (folder / name).mkdir(parents=True)
    first, rows = 0, []
    for begin in range(0, len(given), in_a_file):
        tables = []
        for number in range(begin, min(begin + in_a_file, len(given))):
            each = given[number]
            tables.append(_frames(each, number, first, state))
            place = {"data/chunk_index": 0, "data/file_index": begin // in_a_file}
            ends = {"dataset_from_index": first, "dataset_to_index": first + each.samples}
            rows.append({"episode_index": number, "length": each.samples, **place, **ends})
            first += each.samples
        file = folder / f"data/chunk-000/file-{begin // in_a_file:03d}.parquet"
        parquet.write_table(pa.concat_tables(tables), file)
    parquet.write_table(
        pa.Table.from_pylist(rows), folder / "meta/episodes/chunk-000/file-000.parquet"
    )
    info = json.dumps(_info(given[0], state, rate, "v3.0"))
    (folder / "meta/info.json").write_text(info)


# HDF5


def write_robomimic(file, given, *, rate=30):
    import h5py

    arguments = {"env_name": "Press", "type": 1, "env_kwargs": {"control_freq": rate}}
    with h5py.File(file, "w") as made:
        data = made.create_group("data")
        data.attrs["env_args"] = json.dumps(arguments)
        data.attrs["total"] = sum(each.samples for each in given)
        for number, each in enumerate(given):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["num_samples"] = each.samples
            demo.attrs["model_file"] = "<mujoco/>"
            demo["actions"] = np.hstack([_pose(each), np.zeros((each.samples, 1))])
            demo["states"] = np.zeros((each.samples, 32))
            demo["rewards"] = demo["dones"] = np.zeros(each.samples)
            for group, lead in (("obs", 0), ("next_obs", 1)):
                ahead = np.minimum(np.arange(each.samples) + lead, each.samples - 1)
                demo[f"{group}/robot0_eef_pos"] = each.position[ahead]
                demo[f"{group}/robot0_eef_quat"] = np.tile([1.0, 0, 0, 0], (each.samples, 1))
                demo[f"{group}/robot0_joint_pos"] = _joints(each)[ahead]
                demo[f"{group}/robot0_gripper_qpos"] = np.full((each.samples, 2), 0.02)
                demo[f"{group}/robot0_ee_force"] = each.force[ahead]
                demo[f"{group}/agentview_image"] = np.zeros((each.samples, 8, 8, 3), np.uint8)


def write_libero(file, given, *, rate=20):
    import h5py

    with h5py.File(file, "w") as made:
        data = made.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_kwargs": {"control_freq": rate}})
        data.attrs["problem_info"] = json.dumps({"language_instruction": "press"})
        data.attrs["bddl_file_name"] = "press.bddl"
        for number, each in enumerate(given):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["num_samples"] = each.samples
            demo["actions"] = np.zeros((each.samples, 7))
            demo["robot_states"] = np.hstack([_pose(each), np.zeros((each.samples, 3))])
            demo["obs/agentview_rgb"] = np.zeros((each.samples, 8, 8, 3), np.uint8)
            demo["obs/ee_pos"] = each.position
            demo["obs/ee_ori"] = _pose(each)[:, 3:]
            demo["obs/ee_states"] = np.hstack([each.position, _pose(each)[:, 3:]])
            demo["obs/gripper_states"] = np.full((each.samples, 2), 0.02)
            demo["obs/joint_states"] = _joints(each)
            demo["obs/ee_force"] = each.force


def write_force_umi(folder, given):
    import h5py

    folder.mkdir()
    for number, each in enumerate(given):
        with h5py.File(folder / f"episode_{number}.hdf5", "w") as file:
            kept = {"compression": "gzip"}
            gripper = np.ones((each.samples, 1), np.float32)
            pictures = np.zeros((each.samples, 8, 8, 3), np.uint8)
            file.create_dataset("image", data=pictures, **kept)
            file.create_dataset("state", data=np.hstack([_pose(each), gripper]), **kept)
            file.create_dataset("action", data=np.hstack([_pose(each), gripper]), **kept)
            file.create_dataset("force", data=_wrench(each), **kept)
            file.create_dataset("timestamp", data=1.76e9 + each.time, **kept)
            file.attrs["fps"] = 30.0


# Zarr


def write_replay_buffer(path, given, *, zip_file=False):
    """Names of diffusion policy's real robot, with UMI's of the end effector."""
    import zarr

    store = zarr.storage.ZipStore(path, mode="w") if zip_file else path
    root = zarr.open_group(store, mode="w", zarr_format=2)
    arrays = {
        "robot0_eef_pos": [each.position for each in given],
        "robot0_eef_rot_axis_angle": [_pose(each)[:, 3:] for each in given],
        "robot0_demo_start_pose": [np.tile(_pose(each)[0], (each.samples, 1)) for each in given],
        "robot0_gripper_width": [np.full((each.samples, 1), 0.04) for each in given],
        "robot0_eef_wrench": [_wrench(each) for each in given],
        "camera0_rgb": [np.zeros((each.samples, 8, 8, 3), np.uint8) for each in given],
        "action": [_pose(each) for each in given],
        "timestamp": [1.76e9 + 100.0 * k + each.time for k, each in enumerate(given)],
    }
    for name, parts in arrays.items():
        whole = np.concatenate(parts)
        root.create_array(f"data/{name}", data=whole, chunks=(100, *whole.shape[1:]))
    ends = np.cumsum([each.samples for each in given])
    root.create_array("meta/episode_ends", data=ends)
    if zip_file:
        store.close()
