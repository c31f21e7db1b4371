"""HDF5: groups of arrays, each with its own clock; and MATLAB 7.3, which is HDF5."""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from palpate.errors import RecordingError
from palpate.input.recordings.nested import (
    NUMBERS,
    OBJECTS,
    UNIT_FIELDS,
    Arrays,
    no_class,
    plain_numbers,
    read_text,
)
from palpate.input.recordings.opening import (
    DEFLATE_RATIO,
    FAULTS,
    FORCE_CURVES,
    Request,
    excess,
    first_line,
    size_of_deflate,
)
from palpate.input.recordings.recording import Recording

_LONGEST_TEXT = 4096
_MOST_LINKS = 16  # soft links one behind the other

_FRAMES = ("frame_id", "frame")
# NeXus: attributes of a group NXdata that name the arrays to plot, and the arrays for the axes.
_PLOTTED = {"signal": "signal", "axes": "axis"}
_RATE = re.compile(r"(sampl\w*[ _]?)?(rate|freq\w*)([ _]\w+)?$|fs$", re.IGNORECASE)


def read(path: Path, request: Request) -> Recording:
    """Read an HDF5 file: every array of numbers, with the clock of its group.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What to read.

    Raises
    ------
    RecordingError
        The file is not HDF5, is too damaged, or holds no time series.
    """
    with open_file(path, request.source) as file:
        if not _is_afm(file):
            walk = Walk(Arrays(request))
            walk.group(file, "")
            for name, text in walk.attributes(file):
                walk.arrays.note(name, text)
            return walk.arrays.recording()
    return FORCE_CURVES.read(path, request)  # afmformats opens the file itself


@contextmanager
def open_file(path: Path, source: str) -> Iterator[h5py.File]:
    """Open a file for reading.

    Raises
    ------
    RecordingError
        The file is not HDF5, is cut off, or its structure is damaged.
    """
    try:
        file = h5py.File(path, "r", locking=False)
    except FAULTS as error:
        raise RecordingError(f"{source}: {_why(error)}") from None
    with file:
        yield file


class _ElsewhereError(ValueError):
    """A link leads to another file."""

    def __init__(self) -> None:
        super().__init__("links to another file; open that file")


def member_of(group: Any, path: str | bytes, depth: int = 0) -> Any:
    """Return a member of a group. Links to other files are refused, also behind soft links.

    Raises
    ------
    KeyError
        There is no such member.
    ValueError
        The member, or a group on the way to it, is in another file.
    """
    names = path.encode() if isinstance(path, str) else path
    place = group.file if names.startswith(b"/") else group
    for name in names.split(b"/"):
        if name in (b"", b"."):
            continue
        link = place.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise _ElsewhereError
        if isinstance(link, h5py.SoftLink):
            if depth == _MOST_LINKS:
                raise ValueError("its links form a circle")
            place = member_of(place, link.path, depth + 1)
        else:
            place = place[name]
    return place


def _why(error: BaseException) -> str:
    reason = first_line(error)
    if "signature not found" in reason:
        return "this is not an HDF5 file; check its suffix and the program that wrote it"
    return (
        f"the file is cut off or damaged, and HDF5 cannot read it ({reason}); "
        "copy it again or let the recorder close its file"
    )


def _is_afm(file: h5py.File) -> bool:
    """Whether the file holds force curves that afmformats exported."""
    try:
        exported = read_text(file.attrs.get("software")) == "afmformats" and "0" in list(file)
        return exported and not _leads_elsewhere(file)  # afmformats follows every link
    except FAULTS:
        return False


def _leads_elsewhere(group: h5py.Group) -> bool:
    """Whether a curve or a column of the curves is a link, which leads to any file."""
    links = (h5py.ExternalLink, h5py.SoftLink)
    if any(isinstance(group.get(name, getlink=True), links) for name in group):
        return True
    return any(_leads_elsewhere(part) for part in group.values() if isinstance(part, h5py.Group))


class Walk:
    """Lists the arrays of a file, group by group, without reading them."""

    def __init__(self, arrays: Arrays) -> None:
        self.arrays = arrays
        self._seen: set[Any] = set()

    def group(self, group: h5py.Group, path: str) -> None:
        """Add the arrays of a group and its subgroups."""
        try:
            self._seen.add(h5py.h5o.get_info(group.id).addr)
            names = list(group)
            for attribute, axis in _PLOTTED.items():  # axes are one name or several
                for name in np.atleast_1d(group.attrs.get(attribute, ())).tolist():
                    self.arrays.plots[path + (read_text(name) or "")] = axis
        except FAULTS as error:
            self.arrays.lose(path[:-1] or "the file", f"cannot be read: {first_line(error)}")
            return
        for name in names:
            self.member(group, path, name)

    def member(self, group: h5py.Group, path: str, link: str | bytes) -> None:
        """Add an array or the arrays of a subgroup."""
        name = read_text(link) or ""  # a name that is not UTF-8 is bytes
        channel = path + name
        try:
            item = member_of(group, link)
            address = h5py.h5o.get_info(item.id).addr
            if address in self._seen:
                return
            self._seen.add(address)
            if isinstance(item, h5py.Dataset):
                self.dataset(item, path, name)
            elif isinstance(item, h5py.Group):
                self._notes(item, channel)
                self.group(item, f"{channel}/")
        except _ElsewhereError as error:
            self.arrays.omit(channel, str(error))
        except FAULTS as error:
            self.arrays.lose(channel, f"cannot be read: {first_line(error)}")

    def dataset(self, item: h5py.Dataset, path: str, name: str) -> None:
        """Add an array, or report why it cannot be a channel."""
        channel = path + name
        kind = item.dtype.kind
        shape = item.shape
        if shape == () and kind in "iufbOS" and item.dtype.itemsize <= _LONGEST_TEXT:
            self.arrays.note(channel, read_text(item[()]) or item[()])
        elif shape is None or not all(shape) or kind not in "iufbV" or item.dtype.subdtype:
            self.arrays.omit(channel, _no_numbers(item))
        elif item.external or item.is_virtual:
            self.arrays.omit(channel, "is assembled from other files; open those files")
        elif self._fits(item, channel):
            self._notes(item, channel)
            fields = item.dtype.names
            if not fields:
                read = lambda: np.asarray(item[()])  # noqa: E731
                stated = dict(self.attributes(item))
                unit = next(filter(None, map(stated.get, UNIT_FIELDS)), None)
                self.arrays.add(path, name, shape, read, unit=unit)
            elif set(fields) == {"real", "imag"}:
                self.arrays.omit(channel, "holds complex numbers")
            else:
                self._fields(item, channel)

    def _fields(self, item: h5py.Dataset, name: str) -> None:
        """Add each field of a table with named fields as a channel."""
        for field in item.dtype.names:
            kind = item.dtype[field]
            base, inner = kind.subdtype or (kind, ())
            if base.kind not in "iufb":
                self.arrays.omit(f"{name}.{field}", "holds no numbers")
                continue
            read = lambda field=field: np.asarray(item.fields(field)[()])  # noqa: E731
            self.arrays.add(f"{name}.", field, (*item.shape, *inner), read)

    def _fits(self, item: h5py.Dataset, name: str) -> bool:
        """Whether an array is stored and small enough to read; report missing parts."""
        max_size = self.arrays.request.max_size
        stored = item.id.get_storage_size()
        written, pieces = _pieces(item) if stored else (0, 1)
        piece = math.prod(item.chunks or (0,)) * item.dtype.itemsize
        most = max(item.size * item.dtype.itemsize, self.arrays.request.largest_block)
        loss = ""
        if not stored:
            loss = f"none of its {item.size} values was written"
        elif 2 * written < pieces:  # most of it is missing
            loss = f"only {written} of its {pieces} chunks were written"
        elif stored > 1.125 * pieces * piece + 1024 * pieces and item.chunks:
            loss = "its chunks are longer than they state"
        elif piece > most:
            loss = excess("a chunk needs", piece, most)
        elif (unpacked := _largest_chunk(item, max_size)) > max(piece, max_size):
            loss = excess("a chunk needs", unpacked, max_size)
        if not loss and written < pieces:
            missing = f"{pieces - written} of its {pieces} chunks were never written"
            self.arrays.lose(name, f"{missing}; they read as {item.fillvalue}")
        elif loss:
            self.arrays.lose(name, loss)
        return not loss

    def _notes(self, item: Any, name: str) -> None:
        """Keep the sample rate and the frame in the attributes of a group or an array."""
        for attribute, text in self.attributes(item):
            if attribute in _FRAMES:
                self.arrays.group_frames[name] = text
            elif _RATE.match(attribute):
                self.arrays.note(f"{name} {attribute}", text)

    def attributes(self, item: Any) -> Iterator[tuple[str, str]]:
        """Yield the attributes that are one text or one number."""
        try:
            for name in item.attrs:
                value = item.attrs[name]
                text = read_text(value)
                if text is None and np.ndim(value) == 0 and np.asarray(value).dtype.kind in "iufb":
                    text = str(value)
                if text is not None:
                    yield read_text(name) or "", text
        except FAULTS:  # attributes are optional; reading the arrays reports the damage
            return


def _pieces(item: h5py.Dataset) -> tuple[int, int]:
    """Return the number of written chunks of an array, and the number of all its chunks."""
    if item.chunks is None:
        return 1, 1
    sides = zip(item.shape, item.chunks, strict=True)
    return item.id.get_num_chunks(), math.prod(-(-side // piece) for side, piece in sides)


def _largest_chunk(item: h5py.Dataset, most: int) -> int:
    """Return the size of the largest chunk that may unpack to more than the cap, as far as the cap.

    HDF5 unpacks all that a chunk holds, whatever its stated size.
    """
    filters = item.id.get_create_plist()
    kinds = [filters.get_filter(k)[0] for k in range(filters.get_nfilters())]
    packings = kinds.count(h5py.h5z.FILTER_DEFLATE)
    if packings > 1 or item.id.get_storage_size() * DEFLATE_RATIO <= most:
        return most + 1 if packings > 1 else 0
    largest = 0
    for k in range(item.id.get_num_chunks() if packings else 0):
        chunk = item.id.get_chunk_info(k)
        if chunk.size * DEFLATE_RATIO > most:
            packed = item.id.read_direct_chunk(chunk.chunk_offset)[1]
            largest = max(largest, size_of_deflate(packed, most))
    return largest


def _no_numbers(item: h5py.Dataset) -> str:
    if item.shape is None or (item.shape and not all(item.shape)):
        return "is empty"
    kinds = {"O": "text or references", "S": "text", "c": "complex values"}
    return f"holds {kinds.get(item.dtype.kind, 'other values')}, not numbers"


# MATLAB 7.3: HDF5 with MATLAB's attributes, and with every array transposed.


def read_matlab(path: Path, request: Request) -> Recording:
    """Read a MATLAB 7.3 file.

    Raises
    ------
    RecordingError
        The file is too damaged, or holds no time series.
    """
    with open_file(path, request.source) as file:
        walk = _Variables(Arrays(request))
        walk.group(file, "")
        return walk.arrays.recording()


class _Variables(Walk):
    """Lists the variables of a file by their MATLAB class."""

    def group(self, group: h5py.Group, path: str) -> None:
        """Add a struct; skip sparse matrices and MATLAB's internal groups, which look like one."""
        if path.startswith(("#refs#/", "#subsystem#/")):
            return
        if "MATLAB_sparse" in group.attrs:
            self.arrays.omit(path[:-1], no_class("sparse"))
        else:
            super().group(group, path)

    def dataset(self, item: h5py.Dataset, path: str, name: str) -> None:
        """Add a variable or a field, depending on the class."""
        channel = path + name
        kind = read_text(item.attrs.get("MATLAB_class"))
        if "MATLAB_empty" in item.attrs:
            self.arrays.omit(channel, "is empty")
        elif item.dtype.kind == "O" and kind is None:
            self._structs(item, path, name)
        elif kind == "char":
            self.arrays.note(channel, _char(item) or "")
        elif kind not in NUMBERS:
            self.arrays.omit(channel, no_class(kind or "unknown"))
        elif item.dtype.names:
            self.arrays.omit(channel, no_class("complex"))
        elif item.dtype.kind not in "iufb" or item.external or item.is_virtual:
            self.arrays.omit(channel, "is not a plain array of numbers")
        elif item.size == 1:
            self.arrays.note(channel, item[()].reshape(-1)[0])
        elif self._fits(item, channel):
            turned = lambda: plain_numbers(item[()].T)  # noqa: E731
            unit = _unit_beside(item) if path else None
            self.arrays.add(path, name, item.shape[::-1], turned, group_unit=unit)

    def _structs(self, item: h5py.Dataset, path: str, name: str) -> None:
        """Add a field of an array of structs: a reference per struct."""
        if item.size > OBJECTS:
            self.arrays.omit(path + name, f"holds {item.size} structs, not a time series")
            return
        for k, reference in enumerate(item[()].T.reshape(-1)):
            struct = f"{path[:-1] or name}[{k}]/"
            try:
                value = item.file[reference]
                if isinstance(value, h5py.Dataset):
                    self.dataset(value, struct, name)
                else:
                    self.group(value, f"{struct}{name}/")
            except FAULTS as error:
                self.arrays.lose(struct + name, f"cannot be read: {first_line(error)}")


def _char(item: h5py.Dataset) -> str | None:
    if item.dtype.kind not in "iu" or item.size > _LONGEST_TEXT:
        return None
    return "".join(chr(code) for code in item[()].T.reshape(-1))


def _unit_beside(item: h5py.Dataset) -> str | None:
    """The unit in a field ``unit`` of the same struct."""
    for name in UNIT_FIELDS:
        unit = member_of(item.parent, name) if name in list(item.parent) else None
        if isinstance(unit, h5py.Dataset) and read_text(unit.attrs.get("MATLAB_class")) == "char":
            return _char(unit)
    return None
