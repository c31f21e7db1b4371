"""NumPy's .npz and .npy: arrays by their names, fields of structured arrays, columns of tables."""

import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from palpate.input.recordings.nested import Arrays
from palpate.input.recordings.opening import FAULTS, Request, first_line
from palpate.input.recordings.recording import Recording
from palpate.validation import Values

#: The name of the array in a .npy, which has none.
COLUMN = "column"
_MAGIC = b"\x93NUMPY"


def read(path: Path, request: Request) -> Recording:
    """Read the arrays of a .npz, or the one of a .npy, whose columns are ``column[0]`` and so on.

    Arrays of Python objects are not loaded: unpickling runs code.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The file is damaged or holds no arrays of numbers.
    """
    arrays = Arrays(request)
    with request.explain_damage("the file is no archive of arrays, or is cut off", "copy it again"):
        for name, load in _arrays(path, arrays):
            try:
                _add(arrays, name, load())
            except FAULTS as error:
                arrays.lose(name, _why(error))
    request.release()
    return arrays.recording()


def _arrays(path: Path, arrays: Arrays) -> Iterator[tuple[str, Callable[[], Values]]]:
    """Names and loaders of the arrays; a file unpacks no more than it states, or is refused."""
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) == _MAGIC:
            yield COLUMN, partial(_map_array, path)
            return
        archive = zipfile.ZipFile(file)
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            if arrays.request.wants(name):
                arrays.request.reserve(member.file_size)
                yield name, partial(_read_array, archive, member)


def _map_array(path: Path) -> Values:
    """Map the array of a .npy. Only further arrays may follow it."""
    array: Values = np.load(path, mmap_mode="r", allow_pickle=False)
    with path.open("rb") as file:
        file.seek(array.offset + array.nbytes)  # type: ignore[attr-defined]
        _check_end(file.read(len(_MAGIC)))
    return array


def _read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Values:
    """Read an array of a .npz up to the end of its part, where zipfile checks the checksum."""
    with archive.open(member) as content:
        array: Values = np.lib.format.read_array(content, allow_pickle=False)
        _check_end(content.read(len(_MAGIC)))
    return array


def _check_end(content: bytes) -> None:
    if content not in (b"", _MAGIC):
        raise ValueError("the file is longer than its array: bytes were inserted; copy it again")


def _add(arrays: Arrays, name: str, array: Values) -> None:
    unit = None
    kind = array.dtype.kind
    if kind in "mM":
        array = array.astype(f"{kind}8[ns]", copy=False).view(np.int64)
        unit = "ns"
    if array.dtype.names:
        for field in array.dtype.names:
            _add(arrays, field if name == COLUMN else f"{name}.{field}", array[field])
    elif array.dtype.kind not in "iufb" and array.ndim:
        arrays.omit(name, "holds text or complex numbers")
    elif not array.ndim:
        arrays.note(name, array[()])
    else:
        arrays.add("", name, array.shape, lambda: np.array(array), unit=unit)


def _why(error: BaseException) -> str:
    reason = first_line(error)
    if "allow_pickle" in reason or "Python objects" in reason:
        return "holds Python objects, which palpate does not unpickle; save plain arrays of numbers"
    return f"cannot be read: {reason}"
