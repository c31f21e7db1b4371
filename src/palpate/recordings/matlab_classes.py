"""MATLAB's classes: those of numbers, and what to do about each of the others."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Structs in an array of them; more are a table of another kind.
OBJECTS = 256

#: Fields of a struct that state the unit of the others.
UNIT_FIELDS = ("unit", "units", "Unit", "Units")

#: MATLAB's classes of plain numbers.
NUMBERS = frozenset(
    {"double", "single", "logical"}.union(
        f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64)
    )
)

_CURES = {
    "timeseries": "s = struct('time', ts.Time, 'data', ts.Data)",
    "timetable": "s = table2struct(timetable2table(tt), 'ToScalar', true), with its times as "
    "seconds(tt.Time - tt.Time(1))",
    "table": "s = table2struct(t, 'ToScalar', true)",
    "datetime": "s = posixtime(d)",
    "duration": "s = seconds(d)",
}


def no_class(name: str) -> str:
    """Say that a class holds no array that can be read, and how to save it."""
    if name in ("cell", "string", "function_handle", "char"):
        words = {"function_handle": "a function", "char": "text", "string": "text"}
        return f"holds {words.get(name, 'cells')}, and no series of numbers"
    if name == "complex":
        return "holds complex numbers"
    if name == "sparse":
        return "is a sparse matrix, and no series"
    cure = _CURES.get(name, "a struct of arrays")
    return f"is of MATLAB's class {name}, which only MATLAB can read; save {cure} instead"


def plain_numbers(values: NDArray[Any]) -> NDArray[Any]:
    """Return whole numbers of up to 32 bits as floats, which hold them exactly.

    MATLAB saves whole numbers of class double in as few bytes as hold them, and differences of
    small or unsigned ones would overflow.
    """
    small = values.dtype.kind == "b" or (values.dtype.kind in "iu" and values.dtype.itemsize < 8)
    return values.astype(np.float64) if small else values
