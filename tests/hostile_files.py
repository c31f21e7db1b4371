"""The files of the hostile corpus: good recordings cut, flipped, claimed, packed and odd."""

import gzip
import importlib.util
import os
import random
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import containers
import h5py
import numpy as np
from containers import COLUMNS
from recordings import HEADER, rows_of, text_of

from palpate.recordings import FORMATS


@dataclass(frozen=True)
class Variant:
    """One file: how it is made, and whether a change of it may stay unseen.

    ``exact``: what is read has to equal the clean file, or be said to be less. Of the others the
    numbers themselves are changed, for which no format here has a checksum, or rows are gone from
    text, which then is another good file.
    """

    name: str
    suffix: str
    make: Callable[[Path], object]
    clean: Path | None = None
    exact: bool = False


def as_text(path: Path, columns=COLUMNS, delimiter: str = ",") -> None:
    rows = [
        [repr(value) for value in row]
        for row in zip(*(c.tolist() for c in columns.values()), strict=True)
    ]
    path.write_text(text_of(rows, list(columns), delimiter))


def as_gzip(path: Path, columns=COLUMNS) -> None:
    rows = rows_of() if columns is COLUMNS else []
    path.write_bytes(gzip.compress(text_of(rows, HEADER).encode(), mtime=0))


def as_struct(path: Path, columns=COLUMNS) -> None:
    containers.write_mat5(path, {"trial": dict(columns)})


def as_groups(path: Path, columns=COLUMNS) -> None:
    containers.write_hdf5(path, {f"robot/{name}": values for name, values in columns.items()})


def as_map(path: Path, columns=COLUMNS) -> None:
    counts = np.arange(200) * 7 % 3001
    containers.write_jpk(path, [(counts, counts[::-1])])


WRITERS: dict[str, tuple[str, Callable]] = {
    "text": (".csv", as_text),
    "gzip": (".csv.gz", as_gzip),
    "parquet": (".parquet", containers.write_parquet),
    "parquet-zstd": (
        ".parquet",
        lambda p, c=COLUMNS: containers.write_parquet(p, c, compression="zstd", row_group_size=100),
    ),
    "feather": (".feather", lambda p, c=COLUMNS: containers.write_feather(p, c, chunksize=100)),
    "feather-zstd": (
        ".feather",
        lambda p, c=COLUMNS: containers.write_feather(p, c, compression="zstd", chunksize=100),
    ),
    "hdf5": (".h5", containers.write_hdf5),
    "hdf5-gzip": (
        ".h5",
        lambda p, c=COLUMNS: containers.write_hdf5(p, c, compression="gzip", chunks=True),
    ),
    "hdf5-groups": (".h5", as_groups),
    "matlab5": (".mat", containers.write_mat5),
    "matlab5-packed": (
        ".mat",
        lambda p, c=COLUMNS: containers.write_mat5(p, c, do_compression=True),
    ),
    "matlab5-struct": (".mat", as_struct),
    "matlab73": (".mat", containers.write_mat73),
    "force-map": (".jpk-force-map", as_map),
}  # fmt: skip
if importlib.util.find_spec("rosbags"):
    import hostile_messages as messages

    WRITERS |= {
        "mcap": (".mcap", messages.as_mcap),
        "rosbag1": (".bag", messages.as_rosbag1),
        "rosbag2-sqlite": (".db3", messages.as_sqlite),
    }

TOPICS = ("mcap", "rosbag1", "rosbag2-sqlite")

TEXT = ("text", "gzip")


def corpus(folder: Path) -> list[Variant]:
    """Return every variant of every format that can be opened here."""
    found: list[Variant] = []
    for name, (suffix, write) in WRITERS.items():
        if not can_open(suffix):
            continue
        clean = folder / f"clean-{name}{suffix}"
        write(clean)
        found += damaged(name, suffix, clean)
        if name not in ("gzip", "force-map"):
            found += odd(name, suffix, write)
    return found + list(bombs()) + list(no_files())


def can_open(suffix: str) -> bool:
    """Whether a format has this suffix, and its packages are there."""
    known = [each for each in FORMATS if suffix.endswith(each.suffixes)]
    needs = {"afm": "afmformats", "recordings": "h5py"}
    return any(each.extra is None or importlib.util.find_spec(needs[each.extra]) for each in known)


def damaged(base: str, suffix: str, clean: Path) -> Iterator[Variant]:
    """The bytes of a clean file, changed."""
    whole = clean.read_bytes()
    size = len(whole)

    def variant(name: str, content: bytes, *, exact: bool = False) -> Variant:
        return Variant(
            f"{base}: {name}", suffix, lambda path: path.write_bytes(content), clean,
            exact=exact and base not in TEXT,
        )  # fmt: skip

    for cut in (0, 1, 8, size // 20, size // 3, size * 2 // 3, size * 9 // 10, size - 1):
        yield variant(f"cut after {cut} bytes", whole[:cut], exact=True)
    for seed in range(8):
        chance = random.Random(f"{base} {seed}")
        content = bytearray(whole)
        for _ in range((1, 1, 8, 64)[seed % 4]):
            content[chance.randrange(size)] ^= 1 << chance.randrange(8)
        yield variant(f"bits flipped, seed {seed}", bytes(content))
        at = chance.randrange(size)
        claim = (10**10).to_bytes(8, ("little", "big")[seed % 2])
        yield variant(f"10 GB claimed at byte {at}", whole[:at] + claim + whole[at + 8 :])
    chance = random.Random(base)
    at, length = chance.randrange(size // 2), size // 8
    yield variant("a block of zeros", whole[:at] + bytes(length) + whole[at + length :])
    yield variant("a block of noise", whole[:at] + chance.randbytes(length) + whole[at + length :])
    yield variant("a block missing", whole[:at] + whole[at + length :])
    swapped = bytearray(whole[: size // 2 * 2])
    swapped[::2], swapped[1::2] = swapped[1::2], swapped[::2]
    yield variant("the order of bytes turned", bytes(swapped))
    yield variant("noise behind", whole + chance.randbytes(1000))
    yield variant("noise before", chance.randbytes(1000) + whole)
    yield variant("twice", whole + whole)
    yield variant("noise alone", chance.randbytes(size))


def odd(base: str, suffix: str, write: Callable) -> Iterator[Variant]:
    """Good files of odd recordings."""
    count = len(COLUMNS["time_s"])
    holes = {name: values.copy() for name, values in COLUMNS.items()}
    for values in holes.values():
        values[100:300] = np.nan
    order = np.random.default_rng(1).permutation(count)
    kinds = {
        "no force": {k: v for k, v in COLUMNS.items() if k != "force_N"},
        "no time": {k: v for k, v in COLUMNS.items() if k != "time_s"},
        "runs of NaN": holes,
        "nothing but NaN": {k: np.full(count, np.nan) for k in COLUMNS},
        "infinite": {k: np.full(count, np.inf) for k in COLUMNS},
        "stamps reversed": {**COLUMNS, "time_s": COLUMNS["time_s"][::-1].copy()},
        "stamps repeated": {**COLUMNS, "time_s": np.repeat(COLUMNS["time_s"][::4], 4)[:count]},
        "stamps all the same": {**COLUMNS, "time_s": np.zeros(count)},
        "stamps in no order": {**COLUMNS, "time_s": COLUMNS["time_s"][order]},
        "no samples": {k: v[:0] for k, v in COLUMNS.items()},
        "one sample": {k: v[:1] for k, v in COLUMNS.items()},
        "the largest numbers": {k: np.full(count, 1.7e308) for k in COLUMNS},
        "odd names": {
            **COLUMNS,
            "$x_{1}$\u202e ☃": COLUMNS["force_N"],
            "a" * 60: COLUMNS["force_N"],
        },
    }
    for name, columns in kinds.items():
        if name == "odd names" and "matlab" in base:
            continue  # MATLAB's names are letters, digits and underscores
        if base in TOPICS and not (columns.keys() == COLUMNS.keys() and finite(columns["time_s"])):
            continue  # a stamp of a message is a number
        yield Variant(f"{base}: {name}", suffix, lambda path, c=columns: write(path, c))


def finite(times: np.ndarray) -> bool:
    return bool((np.abs(times) < 1e9).all())


def bombs() -> Iterator[Variant]:
    """Small files that unpack to, or claim, very much more."""
    many = 10**8  # bytes
    zeros = {"z": np.zeros(many // 8)}
    made: dict[str, tuple[str, Callable[[Path], object]]] = {
        "parquet": (".parquet", lambda p: containers.write_parquet(p, zeros, compression="zstd")),
        "feather": (".feather", lambda p: containers.write_feather(p, zeros, compression="zstd")),
        "matlab": (".mat", lambda p: containers.write_mat5(p, zeros, do_compression=True)),
        "hdf5": (".h5", bomb_of_hdf5),
        "hdf5 of one piece": (
            ".h5",
            lambda p: containers.write_hdf5(p, zeros, compression="gzip", chunks=(2 << 20,)),
        ),
        "hdf5 never written": (".h5", hollow_hdf5),
        "force map": (".jpk-force-map", bomb_of_zip),
        "gzip": (".csv.gz", lambda p: p.write_bytes(gzip.compress(b"a,b\n" + b"0,0\n" * 10**7))),
    }  # fmt: skip
    for name, (suffix, make) in made.items():
        if can_open(suffix):
            yield Variant(f"bomb: {name}", suffix, make)


def bomb_of_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        made = file.create_dataset("z", (10**9,), "f8", chunks=(10**6,), compression="gzip")
        made[: 10**6] = 0.0


def hollow_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for k in range(200):  # each is small enough to be allowed alone
            made = file.create_dataset(f"z{k}", (8 << 20,), "f8", chunks=(1 << 10,))
            made[:1] = 1.0


def bomb_of_zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.properties", "type=force-scan-map\n" * 10**7)
        archive.writestr("index/", "")
        archive.writestr("index/0/", "")


def no_files() -> Iterator[Variant]:
    """What has the name of a recording and is none."""

    def locked(path: Path) -> None:
        path.write_bytes(b"0,1\n")
        path.chmod(0)

    for suffix in sorted({suffix for each in FORMATS for suffix in each.suffixes}):
        yield Variant(f"folder{suffix}", suffix, lambda path: path.mkdir())
        yield Variant(f"absent{suffix}", suffix, lambda path: None)
        yield Variant(f"loop{suffix}", suffix, lambda path: path.symlink_to(path))
        if os.getuid():  # root reads everything
            yield Variant(f"unreadable{suffix}", suffix, locked)
    # A pipe that nobody writes into is waited for; one is enough.
    yield Variant("pipe.h5", ".h5", os.mkfifo)
