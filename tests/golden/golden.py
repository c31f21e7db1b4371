#!/usr/bin/env python3
"""What palpate answers, to hold every later commit against.

    golden.py check [tests/golden/answers.json] [--only TEXT]    run every case, print what differs; exit 1 if anything does
    golden.py record [tests/golden/answers.json]                 run every case, write the answers

Runs the `palpate` beside the interpreter that runs this (or $PALPATE), two processes at a time. A full check takes
three minutes on two idle cores. Install `.[all]` first. MuJoCo's version moves numbers of exports.

Compared: exit status, verdicts, the set of findings above a note, the chosen law, every episode, exports' statements,
fleet rows, planned motions, whole-curve fits, the state of each estimator after 4000 updates. Numbers with a standard
error agree to 0.05 of it (others to 1e-6, those of exports and plans to 1e-3), error bars to 3 %.

Each issue ends with `golden.py record tests/golden/answers.json`, the differences and their reasons in the closing
note; the next issue is held against that file.
"""

import argparse, gzip, json, math, os, pathlib, subprocess, sys, tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
DATA = HERE.parents[2] / "shared" / "data"  # next to the checkout
PALPATE = os.environ.get("PALPATE") or str(pathlib.Path(sys.executable).with_name("palpate"))


def contact(K=2500.0, B=2000.0, n=1.2, rate=1000, seconds=8.0, noise=0.03, seed=7, free=2.0):
    """A probe that approaches, presses and oscillates: time, penetration, force."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * rate)) / rate
    u = np.clip((t - free) / 0.6, 0, 1)
    rise = u**3 * (10 - 15 * u + 6 * u * u)
    x = (
        -0.004
        + (0.0135 + 1e-3 * np.sin(4 * t) + 1.8e-3 * np.sin(11 * t) + 1.8e-3 * np.sin(15 * t)) * rise
    )
    v = np.gradient(x, t)
    f = np.where(x > 0, np.maximum(x, 0) ** n * (K + B * v), 0.0)
    return t, x, f + rng.normal(0, noise, t.size)


def late(f, samples):
    return np.concatenate([np.full(samples, f[0]), f[:-samples]]) if samples > 0 else f


def synthetic(folder):
    """Files with one thing wrong each, and the same contact in the formats that others' libraries write."""
    t, x, f = contact()
    rng = np.random.default_rng(11)

    def csv(name, t, x, f, header="time_s,penetration_m,force_N"):
        np.savetxt(
            folder / f"{name}.csv",
            np.column_stack([t, x, f]),
            delimiter=",",
            header=header,
            comments="",
            fmt="%.9g",
        )
        return folder / f"{name}.csv"

    yield "clean", [csv("clean", t, x, f)]
    yield "lag 5 ms", [csv("lag5", t, x, late(f, 5))]
    yield "lag 5 ms, told", [folder / "lag5.csv", "--delay", "5ms"]
    yield "surface 1 mm off", [csv("surface", t, x + 1e-3, f)]
    yield "surface 1 mm off, estimated", [folder / "surface.csv", "--surface", "estimate"]
    yield "clipped", [csv("clipped", t, x, np.minimum(f, 0.8 * f.max()))]
    yield "offset 2 N", [csv("offset", t, x, f + 2.0)]
    yield "offset 2 N, tared", [folder / "offset.csv", "--tare", "0:1.5"]
    yield "drift 1 N", [csv("drift", t, x, f + t / t[-1])]
    spikes = f.copy()
    spikes[rng.choice(t.size, 60, replace=False)] += 40.0
    yield "spikes", [csv("spikes", t, x, spikes)]
    lost = x.copy()
    lost[rng.choice(t.size, 8, replace=False)] = 0.0
    yield "lost positions", [csv("lost", t, lost, f)]
    t2, x2, f2 = contact(K=5000.0, seed=8, free=0.0)
    yield (
        "material changes",
        [
            csv(
                "change",
                np.concatenate([t, t[-1] + 1e-3 + t2]),
                np.concatenate([x, x2]),
                np.concatenate([f, f2]),
            )
        ],
    )
    yield "material changes, --changes", [folder / "change.csv", "--changes"]
    h, tau, past = 0.0, 0.4, 0.0
    branch = np.empty_like(f)
    for i, p in enumerate(np.maximum(x, 0) ** 1.2 * 1200):
        h = math.exp(-1e-3 / tau) * h + p - past
        past = p
        branch[i] = h
    yield "memory", [csv("memory", t, x, f + branch)]
    yield "memory, --law auto", [folder / "memory.csv", "--law", "auto"]
    yield "memory, --law any", [folder / "memory.csv", "--law", "any"]
    yield "memory, --law hunt-crossley", [folder / "memory.csv", "--law", "hunt-crossley"]
    yield "reversed", [csv("reversed", t, x, -f)]
    yield "reversed, flipped", [folder / "reversed.csv", "--flip-force"]
    yield "mm and ms", [csv("mm", t * 1e3, x * 1e3, f, "t_ms,depth_mm,Fz_N")]
    yield "coarse force", [csv("coarse", t, x, np.round(f / 0.25) * 0.25)]
    keep = rng.random(t.size) > 0.1
    yield "dropped samples", [csv("dropped", t[keep], x[keep], f[keep])]
    one_way = x[:2600]
    yield "one way", [csv("oneway", t[:2600], one_way, f[:2600])]
    yield "never touches", [csv("free", t[:1800], x[:1800], f[:1800])]
    yield "a column that is not there", [csv("bad", t, x, f, "a,b,c"), "--force", "nothing"]
    (folder / "empty.csv").write_text("")
    yield "empty", [folder / "empty.csv"]
    (folder / "cut.csv").write_bytes((folder / "clean.csv").read_bytes()[:150_001])
    yield "cut in a number", [folder / "cut.csv"]
    for method in (
        "single-stage",
        "double-stage",
        "kelvin-voigt",
        "extended-kelvin-voigt",
        "drift-tracking",
    ):
        yield f"clean by {method}", [folder / "clean.csv", "--method", method]
    yield from formats(folder, t, x, f)


def formats(folder, t, x, f):
    """The clean contact as other people's libraries write it."""
    import h5py, pyarrow as pa, pyarrow.parquet as pq
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_typestore
    from scipy.io import savemat

    columns = {"time_s": t, "penetration_m": x, "force_N": f}
    savemat(folder / "a.mat", columns)
    yield "MATLAB 5", [folder / "a.mat"]
    savemat(folder / "b.mat", columns, do_compression=True)
    yield "MATLAB 5, compressed", [folder / "b.mat"]
    pq.write_table(pa.table(columns), folder / "a.parquet")
    yield "Parquet", [folder / "a.parquet"]
    with h5py.File(folder / "a.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    yield "HDF5", [folder / "a.h5"]
    with gzip.open(folder / "clean.csv.gz", "wb") as file:
        file.write((folder / "clean.csv").read_bytes())
    yield "gzip", [folder / "clean.csv.gz"]
    normal = np.array([0.3, -0.2, 0.933])
    normal /= np.linalg.norm(normal)
    rng = np.random.default_rng(5)
    poses = [np.array([0.4, 0.1, 0.2]) - normal * depth for depth in x[::2]]
    wrenches = [normal * force + np.array([0.4, -1.1, 1.3]) + rng.normal(0, 0.03, 3) for force in f]
    epoch = 1_700_000_000

    def fill(writer, store, serialize, ros1):
        T = store.types

        def head(s):
            stamp = T["builtin_interfaces/msg/Time"](int(s), round((s % 1) * 1e9))
            return (
                T["std_msgs/msg/Header"](0, stamp, "tool")
                if ros1
                else T["std_msgs/msg/Header"](stamp, "tool")
            )

        vector = T["geometry_msgs/msg/Vector3"]
        pose, wrench = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
        to_pose, to_force = (
            writer.add_connection(topic, kind, typestore=store)
            for topic, kind in (("/tcp_pose", pose), ("/ft_sensor", wrench))
        )
        for s, p in zip(t[::2], poses):
            message = T[pose](
                head(epoch + s),
                T["geometry_msgs/msg/Pose"](
                    T["geometry_msgs/msg/Point"](*p),
                    T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                ),
            )
            writer.write(to_pose, round((epoch + s) * 1e9), serialize(message, pose))
        for s, g in zip(t, wrenches):
            message = T[wrench](
                head(epoch + s), T["geometry_msgs/msg/Wrench"](vector(*g), vector(0.0, 0.0, 0.0))
            )
            writer.write(to_force, round((epoch + s) * 1e9), serialize(message, wrench))

    store2, store1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
    for name, plugin in (("bag-mcap", StoragePlugin.MCAP), ("bag-sqlite", StoragePlugin.SQLITE3)):
        with Writer2(folder / name, version=9, storage_plugin=plugin) as writer:
            fill(writer, store2, store2.serialize_cdr, False)
        yield f"ROS 2 {name}", [folder / name]
    with Writer1(folder / "one.bag") as writer:
        fill(writer, store1, store1.serialize_ros1, True)
    yield "ROS 1 bag", [folder / "one.bag"]
    mcap = next((folder / "bag-mcap").glob("*.mcap"))
    (folder / "cut.mcap").write_bytes(mcap.read_bytes()[: int(mcap.stat().st_size * 0.7)])
    yield "MCAP of a killed recorder", [folder / "cut.mcap"]
    (folder / "junk.mcap").write_bytes(mcap.read_bytes()[:64] + rng.bytes(5000))
    yield "MCAP that is none", [folder / "junk.mcap"]


def cases(folder):
    for name, arguments in synthetic(folder):
        yield f"synthetic: {name}", ["identify", *map(str, arguments), "--json"]
    yield "synthetic: compare", ["compare", str(folder / "clean.csv"), "--json"]
    yield (
        "plan: design",
        ["design", "--K", "2000", "--B", "2000", "--n", "1.2", "--noise", "0.05", "--json"],
    )
    for name in ("clean", "oneaxis", "memory"):
        if (folder / f"{name}.csv").exists():
            for engine in ("mujoco", "drake", "opensim", "usd"):
                yield (
                    f"export: {name} to {engine}",
                    ["@export", str(folder / f"{name}.csv"), engine],
                )
    yield "fleet: synthetic files", ["@fleet", str(folder)]
    yield "arrays: whole curves and estimators", ["@arrays"]
    for path in sorted(DATA.glob("*.csv")):
        yield f"real: {path.stem}", ["identify", str(path), "--json"]
        if path.stem[0] in "ACFG":
            yield f"real, auto: {path.stem}", ["identify", str(path), "--law", "auto", "--json"]
        if "raw" not in path.stem:  # the law of the paper, whatever the default is
            yield (
                f"real, hunt-crossley: {path.stem}",
                ["identify", str(path), "--law", "hunt-crossley", "--json"],
            )
    for path in sorted((DATA / "afm_maps").glob("*"))[:3]:
        if path.is_file() and "README" not in path.name:
            yield f"AFM: {path.name}", ["identify", str(path), "--curve", "1", "--json"]


def essence(code, text):
    """What of an answer is compared: strings and [value, standard error, systematic] triples."""
    kept = {"exit": code}
    if not text.strip().startswith("{"):
        return kept
    for k, result in enumerate(json.loads(text).get("results", [])):
        key = f"{k} {result['method']}"
        if result.get("verdict"):
            kept[f"{key} verdict"] = "/".join(
                str(result["verdict"].get(part)) for part in ("stiffness", "damping")
            )
        kept[f"{key} findings"] = sorted(
            {x["check"] for x in result.get("findings", []) if x["severity"] != "note"}
        )
        if result.get("law_verdict"):
            kept[f"{key} chosen law"] = result["law_verdict"].get("law")
        errors = result.get("standard_errors") or {}
        for name, value in (result.get("law") or {}).items():
            if isinstance(value, (int, float)):
                kept[f"{key} {name}"] = [value, errors.get(name), 0.0]
        for number, depth in enumerate(result.get("working_depths", [])):
            for name in ("force", "stiffness", "damping", "relaxed_stiffness"):
                if part := depth.get(name):
                    kept[f"{key} {name} at depth {number}"] = [
                        part["value"],
                        part["standard_error"],
                        part["systematic"],
                    ]
        for e, episode in enumerate(result.get("episodes", [])[:6]):
            at = episode.get("working_depth") or {}
            for name in ("stiffness", "damping"):
                if at.get(name):
                    kept[f"{key} episode {e} {name}"] = [
                        at[name]["value"],
                        at[name]["standard_error"],
                        at[name]["systematic"],
                    ]
    return kept


ARRAYS = """
import json, warnings; warnings.simplefilter("ignore")
import numpy as np, palpate
rng = np.random.default_rng(3); t = np.arange(800) * 1e-3; out = {}
x = np.array([np.where(t < .2, -1e-3 * (.2 - t) / .2, d * np.sin(np.pi * (t - .2) / .6)) for d in rng.uniform(3e-3, 5e-3, 12)]); v = np.gradient(x, 1e-3, axis=1)
f = np.array(palpate.HuntCrossley(K=2000, B=400, n=1.5).force(x, v)) + rng.normal(0, 1e-3, x.shape)
for surface, shift in ((None, 0.0), ("estimate", 3e-4)):
    fits = palpate.fit_curves(x + shift, v, f, surface=surface)
    for name in ("K", "B", "n"): out[f"curves {surface} {name}"] = np.asarray(getattr(fits, name)).tolist()
s = np.arange(4000) * 1e-3; p = (10 + np.sin(4 * s) + 1.8 * np.sin(11 * s) + 1.8 * np.sin(15 * s)) * 1e-3; w = np.gradient(p, 1e-3)
g = 2000 * p**1.2 * (1 + w) + rng.normal(0, 0.02, s.size)
for name in ("SingleStageRLS", "DoubleStageRLS", "KelvinVoigtRLS", "ExtendedKelvinVoigtRLS", "VariableProjection", "DriftTracking"):
    for detector in (False, True):
        e = getattr(palpate, name)(**({"change_detector": palpate.ChangeDetector(), "outlier_rejection": palpate.OutlierRejection()} if detector else {}))
        for a, b, c in zip(p, w, g): e.update(a, b, c)
        out[f"{name} {detector}"] = list(map(float, e.estimate().law.parameters))
print(json.dumps(out))
"""


def numbers(value, key="", out=None):
    """Every number of nested JSON by its path."""
    out = {} if out is None else out
    if isinstance(value, dict):
        for k, v in value.items():
            numbers(v, f"{key}.{k}", out)
    elif isinstance(value, list):
        for k, v in enumerate(value):
            numbers(v, f"{key}[{k}]", out)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        out[key] = value
    return out


def composed(arguments):
    """The cases that take several commands, or Python."""
    run = lambda *a: subprocess.run(
        [PALPATE, *map(str, a)], capture_output=True, text=True, timeout=900
    )
    with tempfile.TemporaryDirectory() as folder:
        if arguments[0] == "@arrays":
            done = subprocess.run(
                [str(pathlib.Path(PALPATE).with_name("python")), "-c", ARRAYS],
                capture_output=True,
                text=True,
                timeout=900,
            )
            return {"exit": done.returncode, **numbers(json.loads(done.stdout or "{}"))}
        if arguments[0] == "@export":
            run("identify", arguments[1], "-o", f"{folder}/r")
            done = run(
                "export",
                f"{folder}/r",
                "--to",
                arguments[2],
                "--mass",
                "1",
                "--no-replay",
                "-o",
                f"{folder}/e",
            )
            statement = pathlib.Path(folder, "e/statement.json")
            found = json.loads(statement.read_text()) if statement.exists() else {}
            return {
                "exit": done.returncode,
                "form": found.get("form"),
                **numbers({k: found.get(k) for k in ("error_percent", "drop", "law")}),
            }
        import pyarrow.parquet as pq

        good = pathlib.Path(folder, "in")
        good.mkdir()
        for name in ("clean", "surface", "memory", "drift", "mm", "coarse"):
            (good / f"{name}.csv").write_bytes(
                pathlib.Path(arguments[1], f"{name}.csv").read_bytes()
            )
        done = run("fleet", good, "-o", f"{folder}/rows", "--workers", "1", "--diagnosis", "full")
        rows = [
            r
            for part in sorted(pathlib.Path(folder, "rows").rglob("*.parquet"))
            for r in pq.read_table(part).to_pylist()
        ]
        name = lambda r: (
            pathlib.Path(
                str(next((r[k] for k in r if "file" in k or "source" in k or k == "id"), ""))
            ).name
        )
        return {
            "exit": done.returncode,
            "rows": len(rows),
            **numbers(
                {name(r): {k: v for k, v in r.items() if k in ("K", "B", "n")} for r in rows}
            ),
        }


def answer(arguments):
    if arguments[0].startswith("@"):
        return composed(arguments)
    done = subprocess.run(
        [PALPATE, *arguments],
        capture_output=True,
        text=True,
        timeout=900,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    if "Traceback (most recent" in done.stderr:
        return {"exit": "traceback"}
    if arguments[0] == "design":
        return {"exit": done.returncode, **numbers(json.loads(done.stdout or "{}"))}
    return essence(done.returncode, done.stdout)


def differs(old, new):
    if isinstance(old, list) and old and not isinstance(old[0], str):
        if not isinstance(new, list) or len(new) != 3:
            return True
        (a, s, y), (b, r, z) = old, new
        if a is None or b is None:
            return a is not b
        slack = max(0.05 * (s or 0.0), 1e-6 * abs(a))
        if not abs(a - b) <= slack and not (math.isnan(a) and math.isnan(b)):
            return True
        return any(
            abs((p or 0.0) - (q or 0.0)) > 0.03 * abs(p or 0.0) + 1e-6 * abs(a)
            for p, q in ((s, r), (y, z))
        )
    if (
        isinstance(old, (int, float))
        and isinstance(new, (int, float))
        and not isinstance(old, bool)
    ):
        return abs(old - new) > 1e-3 * abs(old) + 1e-12
    return old != new


def main():
    ask = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    ask.add_argument("what", choices=["record", "check"])
    ask.add_argument("file", nargs="?", default="tests/golden/answers.json")
    ask.add_argument("--only", default="")
    given = ask.parse_args()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        todo = [
            (name, arguments)
            for name, arguments in cases(pathlib.Path(folder))
            if given.only in name
        ]
        found = dict(zip([name for name, _ in todo], pool.map(lambda case: answer(case[1]), todo)))
    if given.what == "record":
        pathlib.Path(given.file).write_text(json.dumps(found, indent=1, ensure_ascii=False))
        print(len(found), "answers written")
        return 0
    before, count = json.loads(pathlib.Path(given.file).read_text()), 0
    for name in sorted(before.keys() - found.keys()) if not given.only else ():
        print(f"{name}: not run (are ../data and the extras there?)")
        count += 1
    for name, new in found.items():
        old = before.get(name)
        if old is None:
            print(f"{name}: not in the answers")
            count += 1
            continue
        for key in sorted(old.keys() | new.keys()):
            if key not in old or key not in new or differs(old[key], new[key]):
                print(f"{name}: {key}: was {old.get(key, 'absent')}, is {new.get(key, 'absent')}")
                count += 1
    print(f"{len(found)} cases, {count} differences")
    return bool(count)


if __name__ == "__main__":
    sys.exit(main())
