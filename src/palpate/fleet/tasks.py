"""What is to be identified: contacts by the source and the number of each, in batches."""

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from palpate.fleet.extras import needed

if TYPE_CHECKING:
    import pyarrow as pa

# A task costs the scheduler a millisecond or two: a batch takes a fifth of a second or more by the
# quickest way there is, and a few seconds by the usual ones, so that all of them end together.
FILES = 32
CURVES_OF_A_FILE = 32
# Of an array: a second of fitting, 48 MB as penetration, velocity and force.
SAMPLES = 2_000_000


@dataclass(frozen=True, slots=True)
class Source:
    """Something that holds contacts.

    Attributes
    ----------
    name : str
        Its path or address.
    kind : str
        ``"file"``, ``"map"`` or ``"zarr"``.
    count : int or None
        How many contacts it holds, by their numbers; None where it is a contact by itself.
    samples : int
        Of each, where that is known; else 0.
    chunk : int
        Contacts that are stored together, and best read together.
    stamp : str
        What would change if it was written again.
    """

    name: str
    kind: str
    count: int | None = None
    samples: int = 0
    chunk: int = 1
    stamp: str = ""

    @property
    def contacts(self) -> int:
        """How many there are, as far as can be known before it is read."""
        return 1 if self.count is None else self.count


@dataclass(frozen=True, slots=True)
class Piece:
    """Contacts of one source that are next to each other."""

    source: Source
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class Batch:
    """What is identified by one task, and becomes one file of the results."""

    number: int
    pieces: tuple[Piece, ...]

    @property
    def contacts(self) -> int:
        """How many there are."""
        return sum(piece.count for piece in self.pieces)

    def table(self) -> "pa.Table":
        """Return it as :func:`palpate.fleet.batch.identify_batch` takes it: a row a contact."""
        names: list[str] = []
        kinds: list[str] = []
        indices: list[int | None] = []
        for piece in self.pieces:
            names += [piece.source.name] * piece.count
            kinds += [piece.source.kind] * piece.count
            single = piece.source.count is None
            indices += [None] if single else list(range(piece.first, piece.first + piece.count))
        return tasks_table(names, kinds, indices)


def tasks_table(
    names: Sequence[str], kinds: Sequence[str], indices: Sequence[int | None]
) -> "pa.Table":
    """Return a table of what is to be identified: ``source``, ``kind`` and ``index``."""
    pa = needed("pyarrow", "a table of contacts")
    return pa.table(
        {
            "source": pa.array(names, pa.string()),
            "kind": pa.array(kinds, pa.string()),
            "index": pa.array(indices, pa.int64()),
        }
    )


def batches(sources: Iterable[Source]) -> list[Batch]:
    """Cut sources into batches; by the sources alone, so that a run that goes on cuts the same."""
    found: list[tuple[Piece, ...]] = []
    files: list[Piece] = []
    for source in sources:
        if source.count is None:
            files.append(Piece(source, 0, 1))
            if len(files) == FILES:
                found.append(tuple(files))
                files = []
            continue
        if files:
            found.append(tuple(files))
            files = []
        found += [(piece,) for piece in _pieces(source)]
    if files:
        found.append(tuple(files))
    return [Batch(number, pieces) for number, pieces in enumerate(found)]


def _pieces(source: Source) -> Iterator[Piece]:
    size = CURVES_OF_A_FILE
    if source.kind == "zarr":
        size = max(SAMPLES // max(source.samples, 1), 1)
        if size > source.chunk:
            size -= size % source.chunk
    count = source.contacts
    for first in range(0, count, size):
        yield Piece(source, first, min(size, count - first))


def digest_of(sources: Iterable[Source]) -> str:
    """A short name for exactly these sources, as they are now."""
    found = hashlib.sha256()
    for each in sources:
        parts = (each.name, each.kind, each.count, each.samples, each.chunk, each.stamp)
        found.update("\t".join(map(str, parts)).encode("utf-8", "backslashreplace") + b"\n")
    return found.hexdigest()[:16]
