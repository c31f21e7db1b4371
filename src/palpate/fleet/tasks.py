"""The packages of the extra, imported where they are used."""

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, get_args

from palpate._core import __version__
from palpate.contact import Contact
from palpate.errors import InvalidParameterError, MissingExtraError
from palpate.estimators import ContactEstimator, estimator_named
from palpate.force_laws import ForceLaw
from palpate.preparation import Columns, choose_gate
from palpate.preparation.settings import Preparation
from palpate.settings import ContactGate
from palpate.validation import shown

if TYPE_CHECKING:
    import pyarrow as pa


def needed(name: str, what: str) -> Any:
    """Import a package of the extra ``fleet``.

    Parameters
    ----------
    name : str
        Of the module.
    what : str
        What takes it, for the message.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise MissingExtraError(f"{what} needs {package}: pip install 'palpate[fleet]'") from None


def line_of(error: Exception) -> str:
    """Return what a library says of an error, on one line."""
    return " ".join(str(error).split()) or type(error).__name__


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# What is to be identified: contacts by the source and the number of each, in batches.

# A task costs the scheduler a millisecond or two: a batch takes a fifth of a second or more by the
# quickest way there is, and a few seconds by the usual ones, so that all of them end together.
FILES = 32
CURVES_OF_A_FILE = 32
# Of an array: a second of fitting, 48 MB as penetration, velocity and force.
SAMPLES = 2_000_000


@dataclass(frozen=True, slots=True)
class ContactSource:
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

    source: ContactSource
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
        """Return it as :func:`palpate.fleet.running.identify_batch` takes it: a row a contact."""
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


def batches(sources: Iterable[ContactSource]) -> list[Batch]:
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


def _pieces(source: ContactSource) -> Iterator[Piece]:
    size = CURVES_OF_A_FILE
    if source.kind == "zarr":
        size = max(SAMPLES // max(source.samples, 1), 1)
        if size > source.chunk:
            size -= size % source.chunk
    count = source.contacts
    for first in range(0, count, size):
        yield Piece(source, first, min(size, count - first))


def digest_of(sources: Iterable[ContactSource]) -> str:
    """A short name for exactly these sources, as they are now."""
    found = hashlib.sha256()
    for each in sources:
        parts = (each.name, each.kind, each.count, each.samples, each.chunk, each.stamp)
        found.update("\t".join(map(str, parts)).encode("utf-8", "backslashreplace") + b"\n")
    return found.hexdigest()[:16]


# How the contacts of a fleet are prepared and identified: one value, which every row names.

DiagnosisDepth = Literal["none", "input", "full"]


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """How each contact is prepared and identified.

    Parameters
    ----------
    method : str
        Of the estimator.
    estimator : mapping
        Its settings, where they are not the usual ones, such as ``{"surface": "estimate"}``.
    preparation : mapping
        What :func:`palpate.prepare` is given beside a recording.
    diagnosis : str
        ``"none"``; ``"input"``, the checks of the data, which cost as much as the identification;
        or ``"full"``, with a verdict for each, which costs some fifty times that.
    minimum_penetration, minimum_force : float, optional
        Contact is deeper, m, and firmer, N, than this.
    version : str
        Of the palpate that asks; a worker of another refuses.

    Raises
    ------
    InvalidParameterError
        One is outside its range, or there is no such method.
    """

    method: str = "variable-projection"
    estimator: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    preparation: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    diagnosis: DiagnosisDepth = "input"
    minimum_penetration: float | None = None
    minimum_force: float | None = None
    version: str = dataclasses.field(default_factory=lambda: __version__)

    def __post_init__(self) -> None:
        if self.diagnosis not in get_args(DiagnosisDepth):
            raise InvalidParameterError(
                f"diagnosis must be none, input or full, not {shown(self.diagnosis)}"
            )
        given = estimator_named(self.method)()
        unknown = [name for name in self.estimator if name not in given.settings]
        if unknown:
            raise InvalidParameterError(f"{self.method} has no setting {unknown[0]}")
        given.replace(**self.estimator)
        names = {field.name for field in dataclasses.fields(Preparation)}
        other = [name for name in self.preparation if name not in names]
        if other:
            raise InvalidParameterError(f"a preparation has no setting {other[0]}")
        Preparation(**self.preparation)

    @property
    def law(self) -> type[ForceLaw]:
        """The force law that the method identifies."""
        law: type[ForceLaw] = estimator_named(self.method)().law_type
        return law

    @property
    def searches_surface(self) -> bool:
        """Whether the estimator is to find the surface."""
        return self.estimator.get("surface") == "estimate"

    def estimator_for(self, contact: Contact) -> ContactEstimator:
        """Return a fresh estimator, with a gate for this contact where one is asked for."""
        made = estimator_named(self.method)().replace(**self.estimator)
        if self.minimum_penetration is None and self.minimum_force is None:
            return made
        if made.chooses_samples:  # nothing beside what is asked for
            force = self.minimum_force or 0.0
            gate = ContactGate(self.minimum_penetration or 0.0, force, force)
        else:
            gate = choose_gate(
                contact,
                minimum_penetration=self.minimum_penetration,
                minimum_force=self.minimum_force,
            )
        return made.replace(gate=gate)

    def plain(self) -> dict[str, Any]:
        """Return them as JSON has it."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        made: dict[str, Any] = json.loads(json.dumps(values, default=_plain, sort_keys=True))
        return made

    @property
    def digest(self) -> str:
        """A short name for exactly these settings, and this version."""
        text = json.dumps(self.plain(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    if isinstance(value, Columns):
        usual = Columns()
        return {
            field.name: getattr(value, field.name)
            for field in dataclasses.fields(value)
            if getattr(value, field.name) != getattr(usual, field.name)
        }
    if isinstance(value, Mapping):
        return dict(value)
    return repr(value)
