"""The formats that can be read: how a file of each is known, and the module that reads it."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

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
            within(name, wanted) or within(wanted, name) for wanted in self.channels
        )

    def report(self, fraction: float) -> None:
        """Say how much has been read, to whoever asked."""
        if self.progress is not None:
            self.progress(min(max(fraction, 0.0), 1.0))


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
        Its whole name; its ``read(path, request)`` returns a :class:`Recording`.
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
            recording: Recording = import_module(self.module).read(path, request)
            return recording
        except ModuleNotFoundError as error:
            if self.extra is None or (error.name or "").startswith("palpate"):
                raise
            raise MissingExtraError(
                f"{self.name} files are read with the package {error.name}, which is not "
                f"installed: pip install '.[{self.extra}]' in a checkout of palpate"
            ) from None


_HERE = "palpate.recordings"
_MESSAGES = f"{_HERE}.messages.containers"
_PACKED = ("", ".gz", ".bz2", ".xz")
_TEXTS = tuple(f".{kind}{end}" for end in _PACKED for kind in ("csv", "tsv", "txt", "dat"))
_CURVES = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".ibw")
_BAGS = (".db3", ".db3.zstd", ".mcap.zstd", "metadata.yaml")
_MAT = (b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT")

TEXT = Format("text", _TEXTS, f"{_HERE}.text")
FORCE_CURVES = Format("AFM force curve", _CURVES, f"{_HERE}.afm", (b"# afmformats",), "afm")

#: Every format. To add one: a module with ``read``, and its row.
FORMATS: list[Format] = [
    TEXT,
    Format("MCAP", (".mcap",), _MESSAGES, (b"\x89MCAP0\r\n",), "recordings"),
    Format("ROS 1 bag", (".bag", ".bag.active"), _MESSAGES, (b"#ROSBAG V",), "recordings"),
    Format("ROS 2 bag", _BAGS, _MESSAGES, (b"SQLite format 3\0",), "recordings"),
    FORCE_CURVES,
    Format("Feather", (".feather", ".arrow"), f"{_HERE}.arrow", (b"ARROW1", b"FEA1"), "recordings"),
    Format(
        "HDF5", (".h5", ".hdf5", ".hdf"), f"{_HERE}.hdf5", (b"\x89HDF\r\n\x1a\n",), "recordings"
    ),
    Format("MATLAB", (".mat",), f"{_HERE}.matlab", _MAT, "recordings"),
    Format("Parquet", (".parquet", ".pq"), f"{_HERE}.arrow", (b"PAR1",), "recordings"),
]


def within(name: str, whole: str) -> bool:
    """Return whether a channel is that one, or a field or an element of it."""
    return name == whole or (name.startswith(whole) and name[len(whole)] in "./[")
