"""Data sets of robot learning: LeRobot, robomimic and LIBERO, diffusion policy and UMI.

The layouts are those of https://huggingface.co/docs/lerobot/lerobot-dataset-v3 (and its version
2.1), https://robomimic.github.io/docs/datasets/overview.html and
https://github.com/real-stanford/diffusion_policy (``ReplayBuffer``).
"""

import json
import math
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cache, partial
from operator import itemgetter
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from palpate.errors import RecordingError, import_extra
from palpate.input.recordings.nested import Arrays
from palpate.input.recordings.opening import (
    FAULTS,
    Draft,
    Request,
    check_folder,
    excess,
    first_line,
    read_whole,
    regular_size,
    whole_recording,
)
from palpate.input.recordings.recording import Recording, printable
from palpate.input.recordings.units import is_wanted
from palpate.validation import Values

#: Most episodes that :func:`read` reads together; each is a contact with one object.
MOST_EPISODES = 100

_ENDS = "meta/episode_ends"
# Its members in an archive of the store, or of the folder of the store.
_STORE = re.compile(rf"((?:[^/]+/)?){_ENDS}/")
# Columns of LeRobot that count rows, and types of features that are no numbers.
_COUNTERS = frozenset(("index", "frame_index", "episode_index", "task_index"))
_NO_NUMBERS = frozenset(("image", "video", "string", "audio"))
_NUMBERED = re.compile(r"(\d+)(?:-of-\d+)?\.parquet$")
_MOST_ROWS = 8192  # read at once
_LONGEST_LINE = 1 << 20  # of episodes.jsonl
_EPISODE = 256  # bytes of its description: 262144 take a block, twice the largest data sets


class DataSet(Protocol):
    """The episodes of a data set, read one at a time.

    Attributes
    ----------
    name : str
        Its layout, such as ``"LeRobot v3.0"``.
    rate : float or None
        Samples per second, if the data set states it.
    lengths : dict
        Number of each episode, in order, to its number of samples; -1 if that is unknown.
    """

    name: str
    rate: float | None
    lengths: dict[int, int]

    def channels(self, number: int, request: Request) -> Recording:
        """Read the channels of an episode."""


def describe_data_set(path: Path, max_size: float | None = None) -> DataSet | None:
    """Return a data set without its channels, closed; None if the path is none.

    Raises
    ------
    RecordingError
        The data set cannot be read.
    """
    if not is_dataset(path):
        return None
    with open_data_set(path, Request(printable(path)).limited(path, max_size)) as data:
        return data


def is_dataset(path: Path) -> bool:
    """Whether a folder or a file is a data set, or a file of a LeRobot data set."""
    return root_of(path) is not None or _is_replay(path) or _has_demonstrations(path)


@contextmanager
def open_data_set(path: Path, request: Request) -> Iterator[DataSet]:
    """Open a data set for reading.

    Raises
    ------
    RecordingError
        Its description is damaged, or it holds no episodes.
    """
    check_folder(whole_recording(path))
    with ExitStack() as files:
        with request.explain_damage("the description of the data set is damaged", "copy it again"):
            if (root := root_of(path)) is not None:
                data: DataSet = _LeRobot(root, None if root == path else path, request)
            elif _is_replay(path):
                data = _ReplayBuffer(path, request)
            else:
                file = files.enter_context(_import_hdf5().open_file(path, request.source))
                data = _Demonstrations(file, request)
        request.release()
        if not data.lengths:
            raise request.error("the data set holds no episodes; copy it again")
        yield data


def read(path: Path, request: Request) -> Recording:
    """Read an episode of a data set, or all of them, each a contact with one object.

    Parameters
    ----------
    path : Path
        The folder or the file.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The data set is damaged, has no episode of this number, or more than 100.
    """
    with open_data_set(path, request) as data:
        numbers = list(data.lengths)
        if request.episode is not None:
            if request.episode not in data.lengths:
                raise request.error(
                    f"has no episode {request.episode}; it has {len(numbers)}, from {numbers[0]} on"
                )
            numbers = [request.episode]
        elif len(numbers) > MOST_EPISODES:
            raise request.error(
                f"holds {len(numbers)} episodes, more than {MOST_EPISODES} of one object; "
                "choose one with --episode, or identify each with palpate fleet"
            )
        episodes = []
        for k, number in enumerate(numbers):
            named = replace(request, source=f"{request.source}, episode {number}")
            episodes.append(_episode(data, number, named))
            request.report((k + 1) / len(numbers))
    if len(episodes) == 1:
        return episodes[0]
    return replace(episodes[0], source=request.source, episodes=tuple(episodes))


def read_episodes(
    path: Path, numbers: Sequence[int], max_size: float | None
) -> Iterator[tuple[int, Recording | RecordingError]]:
    """Read episodes of a data set one at a time, opening it once.

    Parameters
    ----------
    path : Path
        The folder or the file.
    numbers : sequence of int
        Places of the episodes in the data set, from 0.
    max_size : float, optional
        Largest size of the arrays of an episode, bytes. Default: that of
        :func:`palpate.open_recording`.

    Yields
    ------
    tuple
        The number of each episode, and its recording or the error that prevents reading it.

    Raises
    ------
    RecordingError
        The data set cannot be read at all.
    """
    request = Request(printable(path)).limited(path, max_size)
    with open_data_set(path, request) as data:
        episodes = list(data.lengths)
        for place in numbers:
            number = episodes[place]
            request.release()
            try:
                yield number, _episode(data, number, request)
            except RecordingError as error:
                yield number, error


def _episode(data: DataSet, number: int, request: Request) -> Recording:
    """Read an episode, without channels that repeat another one."""
    with request.explain_damage("the episode cannot be read", "copy the data set again"):
        recording = data.channels(number, request)
    channels = _without_repeats(recording.channels)
    return replace(
        recording,
        channels=channels,
        clocks={name: clock for name, clock in recording.clocks.items() if name in channels},
        settings={} if data.rate is None else {"rate": data.rate},
        notes={**recording.notes, "data set": data.name},
        episode=number,
    )


def _without_repeats(channels: Mapping[str, Values]) -> dict[str, Values]:
    """Leave out columns that another array repeats: ``ee_states`` begins with ``ee_pos``.

    The smaller array remains, because its name says more. Constant columns do not count, nor do
    commands: a command that was followed exactly repeats what was measured.
    """
    measured = [name for name in channels if not is_wanted(name)]
    sizes = Counter(map(_stem, measured))
    stems: dict[bytes, str] = {}
    repeated = set()
    for name in sorted(measured, key=lambda name: sizes[_stem(name)]):
        values = channels[name]
        if values.dtype.kind == "f" and (values != values[:1]).any():
            content = values.astype(np.float64).tobytes()
            if stems.setdefault(content, _stem(name)) != _stem(name):
                repeated.add(name)
    return {name: values for name, values in channels.items() if name not in repeated}


def _stem(name: str) -> str:
    """The array of a column: ``ee_pos`` of ``ee_pos[0]``, ``observation.state`` of its ``.x``."""
    return name.rpartition("[")[0] or name.rpartition(".")[0] or name


# LeRobot: a folder of Parquet files with a description.


def root_of(path: Path) -> Path | None:
    """The folder of the LeRobot data set that a path is, or whose file it is."""
    with suppress(OSError, ValueError, IndexError):
        if path.is_dir():
            return path if (path / "meta/info.json").is_file() else None
        if path.suffix.lower() == ".parquet":
            root = path.absolute().parents[2]
            return root if (root / "meta/info.json").is_file() else None
    return None


def _check_rate(name: str, stated: Any) -> float:
    rate = float(stated)
    if not 1e-6 < rate < 1e9:
        raise ValueError(f"its {name} is {rate}")
    return rate


class _LeRobot:
    """LeRobot v2: a Parquet file for each episode; v3: files with many."""

    def __init__(self, root: Path, only: Path | None, request: Request) -> None:
        self._arrow = import_extra(
            "palpate.input.recordings.arrow", "a LeRobot data set", "recordings"
        )
        info = json.loads(read_whole(root / "meta/info.json", request))
        self._features = dict(info["features"])
        self.name = f"LeRobot {info['codebase_version']}"
        self.rate: float | None = _check_rate("fps", info["fps"])
        self._places: dict[int, tuple[Path, int]] = {}  # file of each episode, its first row there
        self._decoded: tuple[Path, Any] | None = None  # the last file, with its rows
        self._note = ""
        if any(root.glob("meta/episodes/*/*.parquet")):
            self.lengths = self._from_metadata(root, request)
        elif files := sorted(root.glob("data/*/file-*.parquet")):
            self._note = "is missing: the episodes are those of the column episode_index"
            self.lengths = self._from_rows(files, request)
        else:
            self.lengths = self._from_names(root, request)
        if only is not None:
            file = only.absolute()
            inside = {number for number, at in self._places.items() if at[0].absolute() == file}
            self.lengths = {n: length for n, length in self.lengths.items() if n in inside}

    def _from_names(self, root: Path, request: Request) -> dict[int, int]:
        lengths: dict[int, int] = {}
        description = root / "meta/episodes.jsonl"
        if description.is_file():
            with description.open("rb") as lines:
                while line := lines.readline(_LONGEST_LINE):
                    if line.strip():
                        episode = json.loads(line)
                        lengths[int(episode["episode_index"])] = int(episode["length"])
                        request.check_count("episodes", len(lengths), _EPISODE)
        for file in sorted(root.glob("data/*/*.parquet")):
            if match := _NUMBERED.search(file.name):
                self._places[int(match[1])] = file, 0
        for number in lengths:  # a file that was not copied is an error of its episode
            self._places.setdefault(number, (root / f"data/episode_{number:06d}.parquet", 0))
        return {number: lengths.get(number, -1) for number in sorted(self._places)}

    def _from_rows(self, files: Sequence[Path], request: Request) -> dict[int, int]:
        """Find the episodes by the numbers in their rows."""
        lengths: dict[int, int] = {}
        for path in files:
            regular_size(path)
            with self._arrow.open_parquet(path) as file:
                self._arrow.check_integers(file.schema_arrow, ["episode_index"])
                table = self._arrow.read_in_parts(file, ["episode_index"], _MOST_ROWS, request)
            numbers = table["episode_index"].to_numpy()
            begins = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1))
            request.check_count("episodes", len(lengths) + begins.size, _EPISODE)
            ends = np.append(begins[1:], numbers.size)
            for number, begin, end in zip(numbers[begins], begins, ends, strict=True):
                if int(number) in lengths:
                    raise ValueError(f"episode {number} is in two places")
                lengths[int(number)] = int(end - begin)
                self._places[int(number)] = path, int(begin)
        return lengths

    def _from_metadata(self, root: Path, request: Request) -> dict[int, int]:
        columns = ["episode_index", "data/chunk_index", "data/file_index", "dataset_from_index"]
        columns.append("length")
        rows: list[tuple[int, ...]] = []
        for path in sorted(root.glob("meta/episodes/*/*.parquet")):
            regular_size(path)
            with self._arrow.open_parquet(path) as file:
                count = len(rows) + file.metadata.num_rows
                request.check_count("episodes", count, _EPISODE)
                self._arrow.check_integers(file.schema_arrow, columns)
                table = self._arrow.read_in_parts(file, columns, _MOST_ROWS, request)
            rows += zip(*(table[name].to_pylist() for name in columns), strict=True)
        rows.sort(key=itemgetter(0))
        places = [
            (f"data/chunk-{chunk:03d}/file-{number:03d}.parquet", begin)
            for _, chunk, number, begin, _ in rows
        ]
        starts = dict(sorted(places, reverse=True))  # row of the set in which each file begins
        files = {name: root / name for name in starts}
        for row, (name, begin) in zip(rows, places, strict=True):
            self._places[row[0]] = files[name], begin - starts[name]
        return {row[0]: row[-1] for row in rows}

    def channels(self, number: int, request: Request) -> Recording:
        """Read the rows of an episode; columns of vectors get the names of the description."""
        table = self._rows(number, request)
        if "episode_index" in table.schema.names:
            if table["episode_index"].unique().to_pylist() != [number]:
                raise request.error(
                    f"{self._places[number][0].name} does not have its rows where the description "
                    "says; copy the data set again"
                )
            table = table.drop_columns(["episode_index"])
        draft = Draft(request)
        if self._note:
            draft.omit("meta/episodes", self._note)
        recording: Recording = self._arrow.read_columns(
            table.schema, lambda name: table.select([name]), draft
        )
        named: dict[str, Any] = {
            part: {self._label(name): value for name, value in getattr(recording, part).items()}
            for part in ("channels", "units", "faults")
        }
        return replace(recording, **named)

    def _rows(self, number: int, request: Request) -> Any:
        """Read the rows of an episode; a file with several episodes is decoded once."""
        path, start = self._places[number]
        if self._decoded is None or self._decoded[0] != path:
            try:
                with self._arrow.open_parquet(path) as file:
                    names = [n for n in file.schema_arrow.names if self._is_wanted(n, request)]
                    table = self._arrow.read_in_parts(file, names, _MOST_ROWS, request)
            except FileNotFoundError:
                raise request.error(
                    f"its file {path.name} is missing; copy the whole data set"
                ) from None
            self._decoded = path, table
        table = self._decoded[1]
        count = self.lengths[number]
        if count < 0:
            return table.slice(start)
        if table.num_rows < start + count:
            raise request.error(
                f"{path.name} has fewer rows than the description says; copy it again"
            )
        return table.slice(start, count)

    def _is_wanted(self, name: str, request: Request) -> bool:
        if name in _COUNTERS:
            return name == "episode_index"
        numbers = self._features.get(name, {}).get("dtype") not in _NO_NUMBERS
        return numbers and request.wants(name)

    def _label(self, channel: str) -> str:
        """The name of a column of a vector: ``observation.state.x`` for the first one."""
        stem, _, place = channel.removesuffix("]").rpartition("[")
        feature = self._features.get(stem, {})
        labels = _leaves(feature.get("names"))
        if not feature or len(labels) != math.prod(feature.get("shape") or [len(labels)]):
            return channel
        label = labels[int(place)]
        return channel if labels.count(label) > 1 else f"{stem}.{label}"


def _leaves(names: Any, above: str = "") -> list[str]:
    """The names of columns in a nested description; the only key of a mapping is no part of them.

    ``{"motors": ["x", "y"]}`` gives x and y, ``{"pos": ["x"], "ft": ["x"]}`` pos.x and ft.x.
    """
    if isinstance(names, dict):
        return [
            leaf
            for key, inner in names.items()
            for leaf in _leaves(inner, f"{above}{key}." if len(names) > 1 else above)
        ]
    if isinstance(names, list):
        return [leaf for inner in names for leaf in _leaves(inner, above)]
    return [f"{above}{names}"] if isinstance(names, str) else [above.removesuffix(".")]


# robomimic and LIBERO: HDF5 with a group for each demonstration.


def _has_demonstrations(path: Path) -> bool:
    if not path.name.lower().endswith((".hdf5", ".h5", ".hdf")) or not path.is_file():
        return False
    with suppress(Exception):  # opening it raises the error
        hdf5 = _import_hdf5()
        with hdf5.open_file(path, "") as file:
            return bool(_demonstrations(hdf5.member_of(file, "data")))
    return False


def _import_hdf5() -> Any:
    return import_extra("palpate.input.recordings.hdf5", "reading an HDF5 file", "recordings")


def _demonstrations(group: Any) -> dict[int, str]:
    """The names of demonstrations by their numbers: ``demo_7``."""
    matches = (re.fullmatch(r"demo_(\d+)", name) for name in group)
    names = {int(match[1]): match[0] for match in matches if match}
    return dict(sorted(names.items()))


class _Demonstrations:
    """A group ``data`` with the groups ``demo_0``, ``demo_1`` …, each with a group ``obs``."""

    def __init__(self, file: Any, request: Request) -> None:
        self._hdf5 = _import_hdf5()
        self._data = self._hdf5.member_of(file, "data")
        self._names = _demonstrations(self._data)
        stated = dict(self._hdf5.Walk(Arrays(request)).attributes(self._data))
        self.name = "LIBERO" if {"bddl_file_name", "problem_info"} & stated.keys() else "robomimic"
        arguments = json.loads(stated.get("env_args") or "{}")
        inner = arguments.get("env_kwargs") or {}
        rate = inner.get("control_freq") or arguments.get("control_freq")
        self.rate = _check_rate("control_freq", rate) if rate else None
        self.lengths = {
            number: int(self._hdf5.member_of(self._data, name).attrs.get("num_samples", -1))
            for number, name in self._names.items()
        }

    def channels(self, number: int, request: Request) -> Recording:
        """Read the observations and the actions, without the observations that follow each."""
        group = self._hdf5.member_of(self._data, self._names[number])
        walk = self._hdf5.Walk(Arrays(request))
        if "obs" in list(group):
            walk.group(self._hdf5.member_of(group, "obs"), "")
        for name in group:
            if name not in ("obs", "next_obs"):
                walk.member(group, "", name)
        arrays: Arrays = walk.arrays
        return arrays.recording()


# Diffusion policy and UMI: a Zarr group with all episodes after one another.


def _is_replay(path: Path) -> bool:
    return _store_inside(path) is not None


def _store_inside(path: Path) -> str | None:
    """Return where in a folder or an archive the store begins; None if it holds none."""
    with suppress(*FAULTS):
        if path.is_dir():
            return "" if (path / _ENDS).is_dir() else None
        if path.name.lower().endswith(".zip"):
            with zipfile.ZipFile(path) as archive:
                stores = (_STORE.match(name) for name in archive.namelist())
                return next((store[1] for store in stores if store), None)
    return None


class _ReplayBuffer:
    """Arrays ``data/…`` of all samples, and ``meta/episode_ends``."""

    rate: float | None = None

    def __init__(self, path: Path, request: Request) -> None:
        groups = import_extra("palpate.input.recordings.zarr_groups", "a Zarr data set", "fleet")
        inside = _store_inside(path) or ""
        self._array = cache(groups.open_group(path, request, inside).__getitem__)
        ends = self._array(_ENDS)
        if ends.dtype.kind not in "iu" or ends.ndim != 1:
            raise ValueError(f"its episode_ends are {ends.dtype} of {ends.ndim} dimensions")
        request.check_count("episodes", ends.shape[0], _EPISODE)
        request.check_block(ends.chunks[0] * ends.dtype.itemsize)
        self._ends = np.asarray(ends[:], dtype=np.int64)
        starts = np.concatenate([[0], self._ends])[:-1]
        if (self._ends <= starts).any():
            raise ValueError("its episode_ends do not increase")
        self.name = "Zarr replay buffer"
        self.lengths = dict(enumerate((self._ends - starts).tolist()))
        if path.is_dir():
            members = [
                f"data/{array.name}/" for array in (path / "data").iterdir() if array.is_dir()
            ]
        else:
            with zipfile.ZipFile(path) as archive:
                members = [name.removeprefix(inside) for name in archive.namelist()]
        self._names = sorted(set(re.findall(r"^data/([^/\n]*)/", "\n".join(members), re.MULTILINE)))

    def channels(self, number: int, request: Request) -> Recording:
        """Read the samples of an episode; pictures are skipped unread."""
        arrays = Arrays(request)
        end = int(self._ends[number])
        rows = slice(end - self.lengths[number], end)
        for name in self._names:
            try:  # the codecs of pictures are mostly unknown
                array = self._array(f"data/{name}")
                shape = (rows.stop - rows.start, *array.shape[1:])
            except FAULTS as error:
                arrays.omit(name, f"cannot be opened: {first_line(error)}")
                continue
            chunk = math.prod(array.chunks) * array.dtype.itemsize
            if chunk > request.largest_block:
                arrays.lose(name, excess("a chunk needs", chunk, request.largest_block))
            elif array.dtype.kind not in "iufb" or array.shape[0] < end:
                arrays.omit(name, "holds no number for each sample")
            else:
                arrays.add("", name, shape, partial(array.__getitem__, rows))
        return arrays.recording()
