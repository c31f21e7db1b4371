"""Damaged and hostile files: mutations of every format, and files that were once a defect.

    python tests/attacks.py --files 2000
    python tests/attacks.py --files 2000 --only npy,npz --seed 7

Each file goes to ``palpate info`` and ``palpate identify --json`` in a process of its own. A
defect is a traceback, a line on standard error that palpate did not write, an error of more than
one line, no answer in time, too much memory, or a wrong stiffness that is marked *trust*. Every
defect is printed with its seed, and ``--keep FOLDER`` keeps its file.
"""

import argparse
import atexit
import contextlib
import functools
import io
import json
import math
import os
import random
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import zipfile
from collections import Counter
from pathlib import Path

import dataset_files
import message_files
import numpy as np
import pandas
from cases import MATERIALS, exciting
from containers import (
    HEIGHT_SCALE,
    SENSITIVITY,
    VOLTS,
    write_feather,
    write_hdf5,
    write_jpk,
    write_mat5,
    write_mat73,
    write_parquet,
)

import palpate
import palpate.cli
import palpate.cli.application

SIGNALS = exciting(MATERIALS["ball"], seconds=2.0, noise=0.02, seed=1)
COLUMNS = {"time_s": SIGNALS.time, "penetration_m": SIGNALS.penetration, "force_N": SIGNALS.force}
FRAME = pandas.DataFrame(COLUMNS)
palpate.cli.application.application()  # imports all commands
EPISODE = ["--episode", "0"]
OPTIONS = {"a.jpk-force-map": ["--curve", "0", "--tip", "sphere:radius=5um"]}
OPTIONS |= dict.fromkeys(
    ("lerobot-2", "lerobot-3", "robomimic.hdf5", "libero.hdf5", "replay.zarr", "replay.zarr.zip"),
    EPISODE,
)
SECONDS, MEGABYTES = 60.0, 300.0  # a busy machine is slow; peaks are with the imports, 150 MB
#: A stiffness that is marked *trust* is wrong beyond 4 of its standard errors and 5 %.
BARS, SHARE = 4.0, 0.05


def _messages():
    count = len(SIGNALS)
    stamps = message_files.BEGIN + message_files.STEP * np.arange(count)
    wrenches, poses = np.zeros((count, 6)), np.zeros((count, 7))
    wrenches[:, 2], poses[:, 2], poses[:, 6] = SIGNALS.force, -SIGNALS.penetration, 1.0
    return message_files.Values(stamps, wrenches, poses)


def _rosbag2(path, **more):
    messages = message_files.wrenches_and_poses(_messages(), frame="base")
    return message_files.rosbag2(path, messages, **more)


def _sqlite(path):
    folder = _rosbag2(path.parent / "to be moved")
    next(folder.glob("*.db3")).rename(path)
    shutil.rmtree(folder)


def _jpk(path):
    depth = 4e-6 * np.sin(np.pi * np.linspace(0.0, 1.0, 400)) - 1e-6
    deflection = np.where(depth > 0.0, 0.05 * np.maximum(depth, 0.0) ** 1.5 * 1e3, 0.0) * 1e-2
    counts = [
        np.round(each).astype(int)
        for each in (-depth / HEIGHT_SCALE / VOLTS, deflection / SENSITIVITY / VOLTS)
    ]
    return write_jpk(path, [tuple(counts)] * 3)


def _episodes():
    return dataset_files.episodes(count=2, free=())


def _force_umi(path):
    folder = path.parent / "to be moved"
    dataset_files.write_force_umi(folder, _episodes()[:1])
    (folder / path.name).rename(path)
    folder.rmdir()


#: A whole recording in each format and layout, by the name of its file or folder.
WHOLE = {
    "a.csv": lambda path: FRAME.to_csv(path, index=False),
    "a.tsv": lambda path: FRAME.to_csv(path, index=False, sep="\t", encoding="utf-16"),
    "a.csv.gz": lambda path: FRAME.to_csv(path, index=False),
    "a.parquet": lambda path: write_parquet(path, COLUMNS),
    "a.feather": lambda path: write_feather(path, COLUMNS),
    "a.h5": lambda path: write_hdf5(path, COLUMNS, compression="gzip", chunks=(200,)),
    "a.mat": lambda path: write_mat5(path, COLUMNS, do_compression=True),
    "new.mat": lambda path: write_mat73(path, COLUMNS),
    "a.xlsx": lambda path: FRAME.to_excel(path, index=False),
    "a.npz": lambda path: np.savez(path, **COLUMNS),
    "packed.npz": lambda path: np.savez_compressed(path, **COLUMNS),
    "a.npy": lambda path: np.save(path, FRAME.to_records(index=False)),
    "a.json": lambda path: path.write_text(json.dumps(FRAME.to_dict("list"))),
    "a.jsonl": lambda path: FRAME.to_json(path, orient="records", lines=True, double_precision=12),
    "a.bag": lambda path: message_files.rosbag1(
        path, message_files.wrenches_and_poses(_messages(), ros1=True, frame="base")
    ),
    "a.db3": _sqlite,
    "bag": _rosbag2,
    "a.mcap": lambda path: message_files.wrench_mcap(path, _messages(), chunk_size=20_000),
    "a.jpk-force-map": _jpk,
    "a.tdms": lambda path: path.write_bytes(b"TDSm" + bytes(200)),
    "lerobot-2": lambda path: dataset_files.write_lerobot_2(path, _episodes()),
    "lerobot-3": lambda path: dataset_files.write_lerobot_3(path, _episodes()),
    "robomimic.hdf5": lambda path: dataset_files.write_robomimic(path, _episodes()),
    "libero.hdf5": lambda path: dataset_files.write_libero(path, _episodes()),
    "episode_0.hdf5": _force_umi,
    "replay.zarr": lambda path: dataset_files.write_replay_buffer(path, _episodes()),
    "replay.zarr.zip": lambda path: dataset_files.write_replay_buffer(
        path, _episodes(), zip_file=True
    ),
}  # fmt: skip


# Mutations.


def _flip(content, chance):
    for _ in range(chance.choice((1, 1, 3, 8))):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)


def _insert(content, chance):
    at = _place(content, chance)
    content[at:at] = chance.randbytes(chance.choice((1, 2, 7, 8, 64, 1000)))


def _delete(content, chance):
    at = _place(content, chance)
    del content[at : at + chance.choice((1, 2, 7, 8, 64, 1000))]


def _cut(content, chance):
    del content[chance.randrange(len(content)) :]


def _overwrite(content, chance):
    at, size = _place(content, chance), chance.choice((1, 4, 8, 100))
    filling = chance.choice((bytes(size), b"\xff" * size, chance.randbytes(size)))
    content[at : at + size] = filling


def _number(content, chance):
    at = _place(content, chance)
    form = chance.choice(("<i", ">i", "<q", ">q"))
    size = 8 * struct.calcsize(form)
    number = chance.choice((-1, 0, 1, 2 ** (size - 1) - 1, -(2 ** (size - 1)), 1 << 30, 1 << 20))
    content[at : at + size // 8] = struct.pack(form, number)


def _repeat(content, chance):
    at, size = _place(content, chance), chance.choice((8, 64, 1000))
    content[at:at] = content[at : at + size]


def _word(content, chance):
    words = (b"nan", b"1e308", b"-1e300", b"-", b"\0", b'"', b"\n", b"{", b"[", b"'", b"[red]",
             b"<script>", b"\x1b[2J", b"1" * 400, b"../../", b"\xff\xfe", b"9" * 20)  # fmt: skip
    at = _place(content, chance)
    content[at : at + chance.choice((0, 1, 4))] = chance.choice(words)


def _place(content, chance):
    """A place in a file: often in its first or last 300 bytes, where formats say what it holds."""
    where = chance.random()
    if where < 0.3:
        return chance.randrange(min(300, len(content)))
    return chance.randrange(max(len(content) - 300, 0) if where < 0.5 else 0, len(content))


MUTATIONS = (_flip, _insert, _delete, _cut, _overwrite, _number, _repeat, _word)


def _mutated(content: bytes, chance: random.Random, mutations) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        if changed:
            chance.choice(mutations)(changed, chance)
    return bytes(changed)


def _mutated_inside(content: bytes, chance: random.Random, mutations) -> bytes:
    """Mutate a file in a zip, whose check sums are right again then."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(made, "w") as new:
        members = [each for each in old.infolist() if each.file_size]
        chosen = chance.choice(members).filename
        for each in old.infolist():
            inner = old.read(each)
            inner = _mutated(inner, chance, mutations) if each.filename == chosen else inner
            new.writestr(each, inner)
    return made.getvalue()


def mutate(path: Path, chance: random.Random, mutations=MUTATIONS) -> str:
    """Mutate a file, or one file of a folder; return its name."""
    files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
    chosen = chance.choice([each for each in files if each.stat().st_size])
    content = chosen.read_bytes()
    inside = zipfile.is_zipfile(chosen) and chance.random() < 0.6
    chosen.write_bytes((_mutated_inside if inside else _mutated)(content, chance, mutations))
    return chosen.relative_to(path.parent).as_posix()


# What palpate makes of a file, in a process of its own.


class Outcome:
    """What two commands did with a file: ``defects`` and the result of ``identify``, if any."""

    def __init__(self, path: Path, seconds: float = SECONDS) -> None:
        self.defects, self.results = [], None
        begun, folder, ended = time.monotonic(), Path(tempfile.mkdtemp()), False
        child = os.fork()
        if not child:
            _answer(path, folder)
        while not ended and time.monotonic() < begun + seconds:
            ended = os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
            time.sleep(0.0 if ended else 0.005)
        if not ended:
            os.kill(child, signal.SIGKILL)
            self.defects.append(f"no answer in {seconds:g} s")
        status, used = os.wait4(child, 0)[1:]
        self.seconds, self.megabytes = time.monotonic() - begun, used.ru_maxrss / 1024.0
        if ended and status:
            self.defects.append(f"ended by {status}")
        for command in ("info", "identify"):
            self._look_at(command, folder)
        shutil.rmtree(folder)

    def _look_at(self, command: str, folder: Path) -> None:
        with contextlib.suppress(OSError):
            said = (folder / f"{command}.err").read_text("utf-8", "replace")
            lines = said.splitlines()
            if "Traceback" in said or (lines and lines[-1].startswith("!")):
                self.defects.append(f"{command}: traceback: {lines[-1]}")
            elif [each for each in lines if not each.startswith("palpate: ")] or len(lines) > 1:
                self.defects.append(f"{command}: on standard error: {said[:200]!r}")
        with contextlib.suppress(OSError, ValueError):
            if command == "identify":
                whole = json.loads((folder / "identify.out").read_text("utf-8", "replace"))
                self.results = whole["results"]
        with contextlib.suppress(OSError):
            if "\x1b" in (folder / f"{command}.out").read_text("utf-8", "replace"):
                self.defects.append(f"{command}: prints an escape")


def _answer(path: Path, folder: Path) -> None:
    """Run the commands in this process, a child, and end it."""
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
    options = OPTIONS.get(path.name, [])
    for command in (["info", str(path)], ["identify", str(path), "--json", *options]):
        for descriptor, end in ((1, "out"), (2, "err")):
            file = os.open(folder / f"{command[0]}.{end}", os.O_WRONLY | os.O_CREAT)
            os.dup2(file, descriptor)
        sys.stdout, sys.stderr = (os.fdopen(os.dup(k), "w", encoding="utf-8") for k in (1, 2))
        sys.argv = ["palpate", *command]
        try:
            palpate.cli.main()
        except SystemExit:
            pass
        except BaseException as error:
            print(f"!{type(error).__name__}: {error}", file=sys.stderr)
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(0)


def wrong_with_trust(outcome: Outcome, expected) -> str:
    """Say which stiffness that is marked *trust* is wrong; an empty text if none is."""
    for found, right in zip(outcome.results or (), expected or (), strict=False):
        depth = found["working_depth"]
        if found["verdict"]["stiffness"] != "trust" or depth is None:
            continue
        stiffness, bar = _stiffness(found)
        truth = _stiffness(right)[0]
        if abs(stiffness - truth) > max(BARS * bar, SHARE * abs(truth)):
            return f"wrong with trust: {stiffness:.5g} ± {bar:.2g} N/m for {truth:.5g}"
    return ""


def _stiffness(result) -> tuple[float, float]:
    stiffness = result["working_depth"]["stiffness"]
    return stiffness["value"], math.hypot(stiffness["standard_error"], stiffness["systematic"])


@functools.cache
def whole(name: str) -> tuple[Path, list | None]:
    """Write a whole recording; return its place and what ``identify`` makes of it."""
    folder = Path(tempfile.mkdtemp(prefix="palpate-attacks-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    WHOLE[name](folder / name)
    with contextlib.suppress(palpate.PalpateError):  # so that no child imports the reader again
        palpate.identify(folder / name)
    return folder / name, Outcome(folder / name).results


def attack(name: str, seed: int, keep: Path | None = None, mutations=MUTATIONS) -> Outcome:
    """Mutate a whole recording, and return what palpate makes of it."""
    path, expected = whole(name)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / name
        (shutil.copytree if path.is_dir() else shutil.copy)(path, copy)
        changed = mutate(copy, random.Random(f"{seed} {name}"), mutations)
        outcome = Outcome(copy)
        if wrong := wrong_with_trust(outcome, expected):
            outcome.defects.append(wrong)
        if outcome.megabytes > MEGABYTES:
            outcome.defects.append(f"{outcome.megabytes:.0f} MB")
        outcome.defects = [f"{changed}, seed {seed}: {each}" for each in outcome.defects]
        if keep is not None and outcome.defects:
            (shutil.copytree if copy.is_dir() else shutil.copy)(copy, keep / f"{seed}-{name}")
    return outcome


# Files that were once a defect. Each must be refused on one line, or read within the memory and the
# time of a mutated file; those that only claim more than they hold are in recordings/test_bombs.py.


def _zarr(path, ends):
    folder = path / "meta/episode_ends"
    folder.mkdir(parents=True)
    (path / ".zgroup").write_text('{"zarr_format": 2}')
    array = {"zarr_format": 2, "shape": [len(ends)], "chunks": [len(ends)], "dtype": "<i8",
             "compressor": None, "fill_value": 0, "order": "C", "filters": None}  # fmt: skip
    (folder / ".zarray").write_text(json.dumps(array))
    (folder / "0").write_bytes(np.array(ends).tobytes())


def _lerobot(path, change):
    dataset_files.write_lerobot_3(path, _episodes())
    change(path)


def _many_words(path):
    words = ["x" * 4000] * 200_000
    write_parquet(path / "meta/episodes/chunk-000/file-000.parquet", {"episode_index": words})


def _pipe(path):
    for file in path.glob("data/chunk-000/*"):
        file.unlink()
        os.mkfifo(file)


def _robomimic(path, rate):
    dataset_files.write_robomimic(path, _episodes(), rate=rate)


def _packed(path, old, new, member=None):
    """Rewrite a zip with bytes of its members replaced; the members that end in ``member``."""
    whole = {}
    with zipfile.ZipFile(path) as archive:
        for each in archive.namelist():
            whole[each] = archive.read(each)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in whole.items():
            changed = content.replace(old, new) if name.endswith(member or "") else content
            archive.writestr(name, changed)


def _without_sheets(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")


def _odd_bracket(path):
    np.savez(path, **COLUMNS)
    _packed(path, b"'descr': '<f8'", b"'descr': ['<f8", "time_s.npy")


def _one_damaged_curve(path):
    _jpk(path)
    with zipfile.ZipFile(path) as archive:
        whole = {each: archive.read(each) for each in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in whole.items():
            damaged = name.startswith("index/1/") and name.endswith("measuredHeight.dat")
            archive.writestr(name, b"" if damaged else content)


def _loop(path):
    path.mkdir()
    (path / "metadata.yaml").symlink_to("metadata.yaml")
    (path / "again").symlink_to(path)


CASES = {
    "negative.zarr": lambda path: _zarr(path, [5, -3]),
    "none.zarr.zip": lambda path: path.write_bytes(b"no zip"),
    "cut.zarr.zip": lambda path: path.write_bytes(b"PK\x05\x06" + bytes(18) + b"more"),
    "words-lerobot": lambda path: _lerobot(path, _many_words),
    "pipe-lerobot": lambda path: _lerobot(path, _pipe),
    "fps-lerobot": lambda path: dataset_files.write_lerobot_2(path, _episodes(), rate=-1e300),
    "nan.hdf5": lambda path: _robomimic(path, math.nan),
    "huge.hdf5": lambda path: _robomimic(path, -1e300),
    "tiny.hdf5": lambda path: _robomimic(path, 1e-300),
    "deep.json": lambda path: path.write_text("[" * 100_000),
    "bracket.npz": _odd_bracket,
    "map.jpk-force-map": lambda path: write_jpk(path, [(np.zeros(40_000_000),) * 2]),
    "damaged.jpk-force-map": _one_damaged_curve,
    "no-sheets.xlsx": _without_sheets,
    "columns.parquet": lambda path: write_parquet(
        path, {f"c{k}": np.arange(20.0) for k in range(4000)}
    ),
    "loop": _loop,
}  # fmt: skip


def attack_by_case(name: str) -> Outcome:
    """Write a case and return what palpate makes of it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        if not (child := os.fork()):  # what this process takes counts for its children
            CASES[name](path)
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
        outcome = Outcome(path)
        if outcome.megabytes > MEGABYTES:
            outcome.defects.append(f"{outcome.megabytes:.0f} MB")
    return outcome


def _report_case(name: str) -> int:
    outcome = attack_by_case(name)
    for each in outcome.defects:
        print(f"  {name}: {each}", flush=True)
    return min(len(outcome.defects), 1)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 30))
    parser.add_argument("--only", default=",".join(WHOLE), help="names or suffixes of WHOLE")
    parser.add_argument("--inserted", action="store_true", help="only insert bytes")
    parser.add_argument("--cases", action="store_true", help="the known cases instead")
    parser.add_argument("--keep", type=Path, help="keep files with a defect in this folder")
    given = parser.parse_args()
    if given.cases:
        return max([_report_case(name) for name in CASES])
    names = [name for name in WHOLE if name.endswith(tuple(given.only.split(",")))]
    mutations = (_insert,) if given.inserted else MUTATIONS
    print(f"seed {given.seed}", flush=True)
    peak, slowest, kinds = ("", 0.0), ("", 0.0), Counter()
    for k in range(given.files):
        name = names[k % len(names)]
        outcome = attack(name, given.seed + k, given.keep, mutations)
        peak = max(peak, (name, outcome.megabytes), key=lambda each: each[1])
        slowest = max(slowest, (name, outcome.seconds), key=lambda each: each[1])
        kinds["identified" if outcome.results else "refused"] += 1
        for each in outcome.defects:
            kinds["defects"] += 1
            print(f"  {each}", flush=True)
        if (k + 1) % 100 == 0:
            print(f"{k + 1} files: {dict(kinds)}", flush=True)
    print(f"{given.files} files: {dict(kinds)}; peak {peak[1]:.0f} MB ({peak[0]}), "
          f"slowest {slowest[1]:.1f} s ({slowest[0]})")  # fmt: skip
    return min(kinds["defects"], 1)


if __name__ == "__main__":
    sys.exit(main())
