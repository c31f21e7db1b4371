"""Bags of ROS 2: a folder with ``metadata.yaml``, or a file of one, in SQLite or MCAP."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import zstandard
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from palpate.errors import RecordingError
from palpate.recordings.formats import Request
from palpate.recordings.messages import mcap, sqlite
from palpate.recordings.messages.collection import Collection, one_line
from palpate.recordings.messages.compression import ALLOWANCE, RATIO
from palpate.recordings.messages.files import name_of, opened
from palpate.recordings.recording import Recording
from palpate.writing import temporary_file

METADATA = "metadata.yaml"
# A bag of a hundred topics in a hundred files has some 100 kB; the parser takes seconds a megabyte.
_LONGEST_METADATA = 1 << 20
_PACKED = (".zstd", ".zst")
_STORAGES = (".db3", ".mcap")
_PIECE = 1 << 20


def read(path: Path, request: Request) -> Recording:
    """Read a bag of ROS 2: every topic whose messages hold numbers.

    Parameters
    ----------
    path : Path
        Its folder, the metadata in it, or one of its files.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        It cannot be read, or holds no numbers; or, where strict, is damaged.
    """
    collection = Collection(path, request)
    folder = path.parent if path.name == METADATA else path
    if not folder.is_dir():
        _read_file(path, collection, (0.0, 1.0))
        return collection.recording()
    try:
        files, count = _files(folder, collection)
    except OSError as error:
        raise collection.error(error.strerror or "cannot be read", "check the folder") from None
    if not files:
        raise collection.error("the folder holds no bag of ROS 2", "give the file of a recording")
    for k, file in enumerate(files):
        try:
            _read_file(file, collection, (k / len(files), (k + 1) / len(files)))
        except RecordingError as error:
            if len(files) == 1 or request.strict:
                raise
            collection.lost(f"one of its files cannot be read: {error}")
    if count is not None and collection.messages < count:
        collection.lost(
            f"{METADATA} counts {count} messages, of which {collection.messages} were found"
        )
    return collection.recording()


@dataclass(frozen=True, slots=True)
class _Metadata:
    files: list[str]
    distribution: str
    count: int | None


def _files(folder: Path, collection: Collection) -> tuple[list[Path], int | None]:
    """The files of a bag, in their order, and how many messages it says that they hold."""
    there = [each for each in folder.iterdir() if _storage(each.name) in _STORAGES]
    # Whatever is there packed and unpacked is read once.
    there = [each for each in there if each.with_suffix("") not in there]
    there.sort(key=lambda each: [int(n) for n in re.findall(r"\d+", each.name.split(".")[0])[-1:]])
    if not there and not (folder / METADATA).is_file():
        return [], None
    metadata = _metadata(folder, collection)
    if metadata is None:
        return there, None
    if metadata.distribution:
        collection.notes["ROS distribution"] = metadata.distribution
    files = []
    for name in metadata.files:
        # Older versions have the folder in it. Whatever it says, nothing outside is read.
        candidates = (folder / Path(name).name, folder / f"{Path(name).name}.zstd")
        found = next((each for each in candidates if each in there), None)
        if found is None:
            collection.lost(f"its file {one_line(name)} is missing")
        elif found not in files:
            files.append(found)
    if not files:
        return there, metadata.count
    others = [name_of(each) for each in there if each not in files]
    if others:
        collection.omissions.append(f"not of this bag by its metadata: {', '.join(others[:5])}")
    return files, metadata.count


def _metadata(folder: Path, collection: Collection) -> _Metadata | None:
    path = folder / METADATA
    if not path.is_file():
        collection.lost(f"{METADATA} is missing, as where the recorder was killed")
        return None
    try:
        if path.stat().st_size > _LONGEST_METADATA:
            raise ValueError
        information = YAML(typ="safe").load(path.read_text("utf-8"))["rosbag2_bagfile_information"]
        files = [str(each) for each in information["relative_file_paths"]]
        distribution = one_line(str(information.get("ros_distro") or ""))
        count = information.get("message_count")
    except (OSError, ValueError, YAMLError, KeyError, TypeError, RecursionError, AttributeError):
        collection.lost(f"{METADATA} cannot be understood: the files beside it are read")
        return None
    return _Metadata(files, distribution, count if isinstance(count, int) else None)


def _storage(name: str) -> str:
    for suffix in _PACKED:
        name = name.removesuffix(suffix)
    return Path(name).suffix


def _read_file(path: Path, collection: Collection, part: tuple[float, float]) -> None:
    with _unpacked(path, collection) as plain:
        if _storage(path.name) == ".mcap":
            mcap.read_into(plain, collection, part)
        else:
            sqlite.read_into(plain, collection, part)


@contextmanager
def _unpacked(path: Path, collection: Collection) -> Iterator[Path]:
    """A file as it is, or the copy that a packed one unpacks to."""
    if not path.name.endswith(_PACKED):
        yield path
        return
    with opened(path, collection) as file:
        name = Path(path.name).stem
        with temporary_file(name, _pieces(file, path, collection)) as plain:
            yield plain


def _pieces(file: BinaryIO, path: Path, collection: Collection) -> Iterator[bytes]:
    """What a packed file unpacks to, as far as it does."""
    left = max(ALLOWANCE, RATIO * path.stat().st_size)
    try:
        with zstandard.ZstdDecompressor().stream_reader(file) as stream:
            while piece := stream.read(_PIECE):
                left -= len(piece)
                if left < 0:
                    collection.lost(f"{name_of(path)} unpacks to more than {RATIO} times its size")
                    return
                yield piece
    except zstandard.ZstdError as error:
        collection.lost(f"{name_of(path)} does not unpack to its end: {error}")
