"""MATLAB: variables and structs of arrays, of version 5 (by SciPy) and 7.3 (by h5py)."""

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque
from scipy.sparse import issparse

from palpate.errors import RecordingError
from palpate.recordings import matlab73
from palpate.recordings.bounds import first_line, regular_size
from palpate.recordings.formats import Request
from palpate.recordings.matlab_classes import OBJECTS, UNIT_FIELDS, no_class, plain_numbers
from palpate.recordings.matlab_elements import Element, elements
from palpate.recordings.nested import Findings, text_of
from palpate.recordings.recording import Recording, printable

# What SciPy raises on damaged data, whichever part of it is met.
_DAMAGED = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RecursionError,
    TypeError, ValueError,
)  # fmt: skip


def read(path: Path, request: Request) -> Recording:
    """Read a MATLAB file: every variable of numbers, and those in structs.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        The file is of no version that is read, or too damaged, or holds no series of numbers.
    """
    source = printable(path)
    size = regular_size(path)
    with path.open("rb") as file:
        begin = file.read(128)
    if begin.startswith((b"MATLAB 7.3", b"\x89HDF")):
        return matlab73.read(path, request)
    if not begin.startswith(b"MATLAB 5.0"):
        raise RecordingError(
            f"{source}: this is no MATLAB file of version 5 to 7.3; save it again with "
            "save(name, '-v7') or '-v7.3'"
        )
    found = Findings()
    for element in elements(path, size, found):
        for name, value in _variables(begin, element, found).items():
            _take(value, (), name, found)
    return found.recording(source, request)


def _variables(header: bytes, element: Element, found: Findings) -> dict[str, Any]:
    """Return what SciPy makes of one element of a file, which holds one variable."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # said in our words
            held = loadmat(io.BytesIO(header + element.content), struct_as_record=False)
    except _DAMAGED as error:
        found.lose(element.name, f"cannot be read: {first_line(error)}")
        return {}
    return {name: value for name, value in held.items() if not name.startswith("__")}


def _take(value: Any, group: tuple[str, ...], name: str, found: Findings, unit: Any = None) -> None:
    """Take a value: numbers, or a struct of them; say why it is neither."""
    whole = "/".join((*group, name))
    if isinstance(value, MatlabOpaque | MatlabObject | MatlabFunction) or issparse(value):
        found.omit(whole, no_class(_class_of(value)))
    elif not isinstance(value, np.ndarray):
        found.omit(whole, "holds no numbers")
    elif value.dtype.kind == "U":
        found.note(whole, text_of(value) or "")
    elif value.dtype.kind == "O":
        _take_objects(value, group, name, found)
    elif value.dtype.kind not in "iufb":
        found.omit(whole, "holds complex numbers" if value.dtype.kind == "c" else "is no number")
    elif value.size == 1:
        found.note(whole, value.reshape(-1)[0])
    else:
        found.add(group, name, value.shape, lambda: plain_numbers(value), group_unit=unit)


def _take_objects(value: NDArray[Any], group: tuple[str, ...], name: str, found: Findings) -> None:
    """Structs, or cells."""
    items = value.reshape(-1)
    whole = "/".join((*group, name))
    if not all(hasattr(item, "_fieldnames") for item in items):
        found.omit(whole, no_class("cell"))
        return
    if items.size > OBJECTS:
        found.omit(whole, f"holds {items.size} structs, and is no series")
        return
    for k, item in enumerate(items):
        own = (*group, name if items.size == 1 else f"{name}[{k}]")
        fields = {field: getattr(item, field) for field in item._fieldnames}
        unit = next((text_of(fields[u]) for u in UNIT_FIELDS if u in fields), None)
        for field, inner in fields.items():
            _take(inner, own, field, found, unit)


def _class_of(value: Any) -> str:
    if issparse(value):
        return "sparse"
    if isinstance(value, MatlabFunction):
        return "function_handle"
    if isinstance(value, MatlabObject):
        return str(value.classname)
    record = value.reshape(-1)[0]  # the name of the field is one of SciPy's before 1.18, or since
    names = record.dtype.names
    named = record["_Class" if "_Class" in names else "s2"]
    return text_of(named) or "unknown"
