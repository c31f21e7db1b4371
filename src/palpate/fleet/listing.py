"""From what a person names to the sources there are: files, globs, folders, arrays, objects."""

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from palpate.errors import MissingExtraError, RecordingError
from palpate.fleet.extras import line_of, needed
from palpate.fleet.results import MANIFEST
from palpate.fleet.stored import described_array, is_array, stamp_of
from palpate.fleet.tasks import Source
from palpate.recordings.formats import FORCE_CURVES, FORMATS
from palpate.recordings.recording import printable

#: Endings of files that hold several force curves.
_MAPS = (".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series")
_ENDINGS = tuple(ending for each in FORMATS for ending in each.suffixes)
_BAG = "metadata.yaml"


def sources_of(
    names: Sequence[str | os.PathLike[str]], leave_out: Path | None = None
) -> list[Source]:
    """List what there is to identify, in an order that depends on the names alone.

    Parameters
    ----------
    names : sequence of str or path-like
        Files, patterns with ``*``, folders, which are gone through, Zarr arrays, and addresses such
        as ``s3://bucket/folder``.
    leave_out : Path, optional
        A folder that is not gone into, such as that of the results.

    Raises
    ------
    RecordingError
        There is nothing of a name, or an array is none of contacts.
    MissingExtraError
        What reads the storage is not installed.
    """
    found: dict[str, Source] = {}
    for name in names:
        text = os.fspath(name)
        kind = _remote if "://" in text else _local
        listed = [(_identity(source.name), source) for source in kind(text, leave_out)]
        if not listed:
            raise RecordingError(
                f"{printable(text)}: there is no recording here; recordings end in "
                f"{', '.join(_ENDINGS)}"
            )
        for identity, source in listed:
            found.setdefault(identity, replace(source, name=printable(source.name)))
    return list(found.values())


def _identity(name: str) -> str:
    """The same for every name of one file, which is one contact however it is named."""
    return name if "://" in name else os.path.realpath(name)


def _local(text: str, leave_out: Path | None) -> Iterator[Source]:
    path = Path(text)
    if glob.has_magic(text) and not path.exists():
        for each in sorted(glob.glob(text, recursive=True)):  # noqa: PTH207 - ** of absolute paths
            yield from _at(Path(each), leave_out)
        return
    if not path.exists():
        raise RecordingError(f"{printable(path)}: there is no such file or folder")
    if leave_out is not None and _same(path, leave_out):
        raise RecordingError(f"{printable(path)}: is the folder of the results; choose another")
    yield from _at(path, leave_out, named=True)


def _at(
    path: Path, leave_out: Path | None, above: tuple[str, ...] = (), *, named: bool = False
) -> Iterator[Source]:
    """What a path holds; a file that was named is one whatever its name ends with.

    What cannot be read is a source too, of which a row will say that, unless it was named.
    """
    name = str(path)
    if path.is_dir() and not is_array(name):
        yield from _in_folder(path, leave_out, above)
    elif is_array(name):
        yield described_array(name) if named else _found_array(name)
    elif named or (path.name.lower().endswith(_ENDINGS) and (path.is_file() or _dangling(path))):
        yield _file(name, path)


def _in_folder(path: Path, leave_out: Path | None, above: tuple[str, ...]) -> Iterator[Source]:
    here = os.path.realpath(path)
    if (path / _BAG).is_file():  # a bag of ROS 2 is a folder
        yield Source(str(path), "file", stamp=stamp_of(str(path)))
        return
    results = leave_out is not None and _same(path, leave_out)
    if results or here in above or (path / MANIFEST).is_file():  # results, of whichever run
        return
    try:
        inside = sorted(path.iterdir())
    except OSError as error:
        raise RecordingError(f"{printable(path)}: {error.strerror or error}") from None
    for each in inside:
        if not each.name.startswith((".", "_")):
            yield from _at(each, leave_out, (*above, here))


def _found_array(name: str) -> Source:
    """An array that was found on the way: what is wrong with it is for its row to say."""
    try:
        return described_array(name)
    except RecordingError:
        return Source(name, "zarr", 1)


def _dangling(path: Path) -> bool:
    """Whether it is a link to what is not there; a pipe would be waited for without end."""
    return path.is_symlink() and not path.exists()


def _file(name: str, path: Path) -> Source:
    stamp = stamp_of(str(path))
    if path.name.lower().endswith(_MAPS):
        return Source(name, "map", _curves_in(path), stamp=stamp)
    return Source(name, "file", stamp=stamp)


def _curves_in(path: Path) -> int | None:
    """How many curves a map holds; None where it cannot be read, which its row will say."""
    try:
        from palpate.recordings.afm import count_curves
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"{FORCE_CURVES.name} files are read with the package {error.name}, which is not "
            f"installed: pip install 'palpate[{FORCE_CURVES.extra}]'"
        ) from None
    try:
        return count_curves(path)
    except RecordingError:
        return None


def _same(one: Path, other: Path) -> bool:
    return os.path.realpath(one) == os.path.realpath(other)


def _remote(text: str, leave_out: Path | None) -> Iterator[Source]:
    """What is at an address; the results are on disk, and never within."""
    if is_array(text):
        yield described_array(text)
        return
    fsspec = needed("fsspec", "object storage")
    try:
        files, root = fsspec.core.url_to_fs(text)
        protocol = text.partition("://")[0]
        entries = _entries(files, root)
    except ImportError as error:
        raise MissingExtraError(f"{text}: {error}; it goes beside 'palpate[fleet]'") from None
    except Exception as error:
        raise RecordingError(f"{text}: cannot be listed: {line_of(error)}") from None
    arrays = _arrays_among(entries)
    for name in sorted(arrays):
        yield _found_array(f"{protocol}://{name}")
    for name, about in entries:
        if any(name.startswith(f"{array}/") for array in arrays):
            continue
        if name == root.rstrip("/") or name.lower().endswith(_ENDINGS):
            stamp = f"{about.get('size')} {about.get('ETag') or about.get('mtime') or ''}"
            yield Source(f"{protocol}://{name}", "file", stamp=stamp)


def _entries(files: Any, root: str) -> list[tuple[str, dict[str, Any]]]:
    if glob.has_magic(root):
        found: dict[str, dict[str, Any]] = files.glob(root, detail=True)
    else:
        found = files.find(root, detail=True)
    return sorted(
        (name, about) for name, about in found.items() if about.get("type") != "directory"
    )


def _arrays_among(entries: Iterable[tuple[str, dict[str, Any]]]) -> set[str]:
    """Folders of objects that are groups of Zarr, and in no other such."""
    marks = (".zgroup", "zarr.json")
    found = {name.rpartition("/")[0] for name, _ in entries if name.endswith(marks)}
    return {
        name
        for name in found
        if not any(name.startswith(f"{other}/") for other in found if other != name)
    }
