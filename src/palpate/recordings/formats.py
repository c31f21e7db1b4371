"""The formats that can be read: how a file of each is known, and the module that reads it."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from palpate.errors import MissingExtraError
from palpate.recordings.recording import Recording


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of a reader.

    Attributes
    ----------
    channels : tuple of str, optional
        Read these only: whole names, or what names begin with, such as ``"/ft"``. None: all that
        hold numbers.
    strict : bool
        Refuse what cannot be read, where else it would be left out and said.
    curve : int, optional
        Which curve of a file that holds many, from 0.
    progress : callable, optional
        Called now and then with the fraction that has been read, 0 to 1.
    """

    channels: tuple[str, ...] | None = None
    strict: bool = False
    curve: int | None = None
    progress: Callable[[float], None] | None = None

    def wants(self, name: str) -> bool:
        """Whether a channel, or any below a topic or a group, is asked for."""
        return self.channels is None or any(
            _within(name, wanted) or _within(wanted, name) for wanted in self.channels
        )

    def report(self, fraction: float) -> None:
        """Say how much has been read, to whoever asked."""
        if self.progress is not None:
            self.progress(min(max(fraction, 0.0), 1.0))


class Reader(Protocol):
    """A module that reads a format."""

    def read(self, path: Path, request: Request) -> Recording:
        """Read a file as it is."""


@dataclass(frozen=True, slots=True)
class Format:
    """A format of files.

    Attributes
    ----------
    name : str
        For a person.
    suffixes : tuple of str
        What names of its files end with, in lower case.
    module : str
        Its whole name; its ``read`` is a :class:`Reader`'s.
    marks : tuple of bytes
        What its files begin with: content comes before the suffix.
    extra : str, optional
        Of ``pyproject.toml``, where it takes packages that palpate alone does not need.
    """

    name: str
    suffixes: tuple[str, ...]
    module: str
    marks: tuple[bytes, ...] = ()
    extra: str | None = None

    def read(self, path: Path, request: Request) -> Recording:
        """Read a file by its module.

        Raises
        ------
        MissingExtraError
            A package that it takes is not installed.
        """
        try:
            reader = cast(Reader, import_module(self.module))
            return reader.read(path, request)
        except ModuleNotFoundError as error:
            if self.extra is None or (error.name or "").startswith("palpate"):
                raise
            raise MissingExtraError(
                f"{self.name} files are read with the package {error.name}, which is not "
                f"installed: pip install '.[{self.extra}]' in a checkout of palpate"
            ) from None


_TEXTS = ("csv", "tsv", "txt", "dat")
TEXT = Format(
    "text",
    tuple(f".{kind}{end}" for end in ("", ".gz", ".bz2", ".xz") for kind in _TEXTS),
    "palpate.recordings.text",
)

_MESSAGES = "palpate.recordings.messages"

FORCE_CURVES = Format(
    "AFM force curve",
    (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".ibw"),
    "palpate.recordings.afm",
    (b"# afmformats",),
    "afm",
)

FEATHER = Format(
    "Feather",
    (".feather", ".arrow"),
    "palpate.recordings.arrow",
    (b"ARROW1", b"FEA1"),
    "recordings",
)

HDF5 = Format(
    "HDF5",
    (".h5", ".hdf5", ".hdf"),
    "palpate.recordings.hdf5",
    (b"\x89HDF\r\n\x1a\n",),
    "recordings",
)

MATLAB = Format(
    "MATLAB",
    (".mat",),
    "palpate.recordings.matlab",
    (b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT"),
    "recordings",
)

PARQUET = Format(
    "Parquet", (".parquet", ".pq"), "palpate.recordings.arrow", (b"PAR1",), "recordings"
)

MCAP = Format("MCAP", (".mcap",), f"{_MESSAGES}.containers", (b"\x89MCAP0\r\n",), "recordings")

ROS1_BAG = Format(
    "ROS 1 bag", (".bag", ".bag.active"), f"{_MESSAGES}.containers", (b"#ROSBAG V",), "recordings"
)

ROS2_BAG = Format(
    "ROS 2 bag",
    (".db3", ".db3.zstd", ".mcap.zstd", "metadata.yaml"),
    f"{_MESSAGES}.containers",
    (b"SQLite format 3\0",),
    "recordings",
)

#: Every format. To add one: a module with ``read``, and its row.
FORMATS: list[Format] = [
    TEXT,
    MCAP,
    ROS1_BAG,
    ROS2_BAG,
    FORCE_CURVES,
    FEATHER,
    HDF5,
    MATLAB,
    PARQUET,
]


def _within(name: str, whole: str) -> bool:
    """Whether a channel is that one, or a field or an element of it."""
    return name == whole or (name.startswith(whole) and name[len(whole)] in "./[")
