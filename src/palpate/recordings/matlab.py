"""MATLAB: variables and structs of arrays, of version 5 and of 7.3."""

from pathlib import Path

import numpy as np

from palpate.errors import RecordingError
from palpate.recordings.bounds import regular_size
from palpate.recordings.formats import Request
from palpate.recordings.matlab_classes import OBJECTS, UNIT_FIELDS, no_class, plain_numbers
from palpate.recordings.matlab_elements import Other, Struct, Value, variables
from palpate.recordings.nested import Findings
from palpate.recordings.recording import Recording, printable


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
        from palpate.recordings import matlab73  # needs h5py, and version 5 does not

        return matlab73.read(path, request)
    if not begin.startswith(b"MATLAB 5.0"):
        raise RecordingError(
            f"{source}: this is no MATLAB file of version 5 to 7.3; save it again with "
            "save(name, '-v7') or '-v7.3'"
        )
    found = Findings()
    for name, value in variables(path, size, found):
        if name:  # MATLAB keeps what belongs to its objects in one without a name
            _take(value, (), name, found)
    return found.recording(source, request)


def _take(
    value: Value, group: tuple[str, ...], name: str, found: Findings, unit: str | None = None
) -> None:
    """Take a value: numbers, or a struct of them; say why it is neither."""
    whole = "/".join((*group, name))
    if isinstance(value, str):
        found.note(whole, value)
    elif isinstance(value, Other):
        found.omit(whole, no_class(value.kind))
    elif isinstance(value, Struct):
        _take_structs(value, group, name, found)
    elif value.size == 1:
        found.note(whole, value.reshape(-1)[0])
    else:
        numbers = np.asarray(value)
        found.add(group, name, numbers.shape, lambda: plain_numbers(numbers), group_unit=unit)


def _take_structs(value: Struct, group: tuple[str, ...], name: str, found: Findings) -> None:
    if len(value.items) > OBJECTS:
        whole = "/".join((*group, name))
        found.omit(whole, f"holds {len(value.items)} structs, and is no series")
        return
    for k, fields in enumerate(value.items):
        own = (*group, name if len(value.items) == 1 else f"{name}[{k}]")
        texts = [fields[u] for u in UNIT_FIELDS if isinstance(fields.get(u), str)]
        for field, inner in fields.items():
            _take(inner, own, field, found, texts[0].strip() if texts else None)
