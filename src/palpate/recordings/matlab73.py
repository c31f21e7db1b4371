"""MATLAB's version 7.3: HDF5 with its own attributes, and with every array turned over."""

from pathlib import Path

import h5py

from palpate.recordings.bounds import first_line
from palpate.recordings.formats import Request
from palpate.recordings.hdf5 import DAMAGED, Walk, opened
from palpate.recordings.nested import (
    NUMBERS,
    OBJECTS,
    UNIT_FIELDS,
    no_class,
    plain_numbers,
    text_of,
)
from palpate.recordings.recording import Recording, printable

_LONGEST_CHAR = 4096


def read_matlab(path: Path, request: Request) -> Recording:
    """Read a MATLAB file of version 7.3.

    Raises
    ------
    RecordingError
        It is too damaged, or holds no series of numbers.
    """
    source = printable(path)
    with opened(path, source) as file:
        walk = _Variables()
        walk.group(file, ())
        return walk.found.recording(source, request)


class _Variables(Walk):
    """What a file holds, by MATLAB's classes."""

    def group(self, group: h5py.Group, path: tuple[str, ...]) -> None:
        """Take a struct; sparse matrices look like one, and the objects' own groups too."""
        if path and path[0] in ("#refs#", "#subsystem#"):
            return
        if "MATLAB_sparse" in group.attrs:
            self.found.omit("/".join(path), no_class("sparse"))
        else:
            super().group(group, path)

    def dataset(self, item: h5py.Dataset, path: tuple[str, ...], name: str) -> None:
        """Take a variable or a field, by its class."""
        whole = "/".join((*path, name))
        kind = text_of(item.attrs.get("MATLAB_class"))
        if "MATLAB_empty" in item.attrs:
            self.found.omit(whole, "is empty")
        elif item.dtype.kind == "O" and kind is None:
            self._structs(item, path, name)
        elif kind == "char":
            self.found.note(whole, _char(item) or "")
        elif kind not in NUMBERS:
            self.found.omit(whole, no_class(kind or "unknown"))
        elif item.dtype.names:
            self.found.omit(whole, no_class("complex"))
        elif item.dtype.kind not in "iufb" or item.external or item.is_virtual:
            self.found.omit(whole, "is no plain array of numbers")
        elif item.size == 1:
            self.found.note(whole, item[()].reshape(-1)[0])
        elif self._fits(item, whole):
            turned = lambda: plain_numbers(item[()].T)  # noqa: E731
            unit = _unit_beside(item) if path else None
            self.found.add(path, name, item.shape[::-1], turned, group_unit=unit)

    def _structs(self, item: h5py.Dataset, path: tuple[str, ...], name: str) -> None:
        """A field of an array of structs: references to one value of each."""
        whole = "/".join((*path, name))
        if item.size > OBJECTS:
            self.found.omit(whole, f"holds {item.size} structs, and is no series")
            return
        for k, reference in enumerate(item[()].T.reshape(-1)):
            own = (*path[:-1], f"{path[-1]}[{k}]") if path else (f"{name}[{k}]",)
            try:
                value = item.file[reference]
                if isinstance(value, h5py.Dataset):
                    self.dataset(value, own, name)
                else:
                    self.group(value, (*own, name))
            except DAMAGED as error:
                self.found.lose("/".join((*own, name)), f"cannot be read: {first_line(error)}")


def _char(item: h5py.Dataset) -> str | None:
    if item.dtype.kind not in "iu" or item.size > _LONGEST_CHAR:
        return None
    return "".join(chr(code) for code in item[()].T.reshape(-1))


def _unit_beside(item: h5py.Dataset) -> str | None:
    """What a field unit of the same struct says."""
    for name in UNIT_FIELDS:
        unit = item.parent.get(name)
        if isinstance(unit, h5py.Dataset) and text_of(unit.attrs.get("MATLAB_class")) == "char":
            return _char(unit)
    return None
