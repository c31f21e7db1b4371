"""What a fleet is asked to do: its settings, its sources, and tasks of about equal work."""

import dataclasses
import hashlib
import itertools
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from palpate import errors
from palpate._core import __version__
from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.estimators import ContactEstimator, estimator_named
from palpate.force_laws import ForceLaw
from palpate.preparation import Columns
from palpate.preparation.gates import gate_asked_for
from palpate.preparation.settings import Preparation
from palpate.validation import shown

#: A table of pyarrow, which has no types, and is imported where one is made.
Table: TypeAlias = Any
#: Import a package of the extra ``fleet``, or say what needs it.
needed = partial(errors.needed, extra="fleet")


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# What is to be identified: contacts by the source and the number of each, in batches.

# What a contact takes, s, and each of its samples, on a core of 2.4 GHz: the medians of touches of
# 200 to 10 000 samples. A search for the surface takes three times as long as the recursion alone;
# what a task takes may be wrong by that, for all of the tasks are.
_RECURSION = {"none": (3e-3, 1e-6), "input": (5e-3, 1e-6), "full": (25e-3, 12e-6)}
_WHOLE_CURVE = {"none": (1e-4, 1e-7), "input": (6e-4, 5e-7)}
# To read and prepare a file: s, s a byte, and bytes a sample (29 of text with four channels).
_READING, _READING_A_BYTE, _BYTES_A_SAMPLE = 6e-3, 15e-9, 30.0
# A task costs the scheduler and the folder of the results some 10 ms.
_SHORTEST, _LONGEST = 0.05, 1.0  # s
# A worker holds two tasks at the end, while the other may have none: an eighth of its work.
_TASKS_A_WORKER = 16
# Of arrays in one task: 48 MB as penetration, velocity and force.
_SAMPLES = 2_000_000


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
    size : int
        Of a file, bytes.
    """

    name: str
    kind: str
    count: int | None = None
    samples: int = 0
    chunk: int = 1
    stamp: str = ""
    size: int = 0

    @property
    def contacts(self) -> int:
        """How many there are, as far as can be known before it is read."""
        return 1 if self.count is None else self.count

    def seconds(self, diagnosis: str, *, whole_curve: bool) -> float:
        """About how long each of its contacts takes."""
        by_method = _WHOLE_CURVE if whole_curve else _RECURSION
        contact, sample = by_method[diagnosis]
        if self.kind == "zarr":
            return contact + sample * self.samples
        size = self.size / max(self.contacts, 1)
        return _READING + _READING_A_BYTE * size + contact + sample * size / _BYTES_A_SAMPLE


@dataclass(frozen=True, slots=True)
class Batch:
    """What is identified by one task, and becomes one file of the results.

    Attributes
    ----------
    first : int
        Which contact of the fleet it begins with.
    table : pyarrow.Table
        As :func:`palpate.fleet.running.identify_batch` takes it: a row a contact.
    seconds : float
        About how long it takes.
    """

    first: int
    table: Table
    seconds: float

    @property
    def end(self) -> int:
        """Which contact of the fleet it ends before."""
        return self.first + int(self.table.num_rows)


def tasks_table(names: Sequence[str], kinds: Sequence[str], indices: Sequence[int | None]) -> Table:
    """Return a table of what is to be identified: ``source``, ``kind`` and ``index``."""
    pa = needed("pyarrow", "a table of contacts")
    kinds_of_columns = {"source": pa.string(), "kind": pa.string(), "index": pa.int64()}
    columns = zip(kinds_of_columns.items(), (names, kinds, indices), strict=True)
    return pa.table({name: pa.array(values, kind) for (name, kind), values in columns})


def batches(
    sources: Sequence[ContactSource],
    seconds: Sequence[float],
    workers: int = 1,
    done: Iterable[tuple[int, int]] = (),
) -> list[Batch]:
    """Cut sources into batches of about equal work, the longest first.

    Parameters
    ----------
    sources : sequence of ContactSource
        What there is.
    seconds : sequence of float
        About how long a contact of each takes.
    workers : int
        That share them.
    done : iterable of (int, int)
        Contacts that need not be identified, from the one up to the other: without them the
        batches of the rest are the same.
    """
    counts = [source.contacts for source in sources]
    work = np.repeat(seconds, counts)
    longest = min(max(float(work.sum()) / (_TASKS_A_WORKER * workers), _SHORTEST), _LONGEST)
    waiting = np.ones(work.size, dtype=bool)
    edges = {work.size, *_cuts(sources, seconds, longest)}
    for first, end in done:
        waiting[first:end] = False
        edges |= {first, end}
    each = [source for source in sources for _ in range(source.contacts)]
    index = [k for s in sources for k in ([None] if s.count is None else range(s.count))]
    whole = tasks_table([s.name for s in each], [s.kind for s in each], index)
    found = [  # copies: of a slice Arrow would send the whole
        Batch(first, whole.take(np.arange(first, end)), float(work[first:end].sum()))
        for first, end in itertools.pairwise(sorted(edges))
        if waiting[first]
    ]
    return sorted(found, key=lambda batch: -batch.seconds)


def _cuts(
    sources: Iterable[ContactSource], seconds: Iterable[float], longest: float
) -> Iterator[int]:
    """Where batches begin; chunks that are stored together stay together where they can."""
    at, load = 0, 0.0
    yield at
    for source, each in zip(sources, seconds, strict=True):
        first = 0
        while first < source.contacts:
            fit = int((longest - load) / each)
            if source.samples:
                fit = min(fit, _SAMPLES // source.samples)
            if fit > source.chunk:
                fit -= (first + fit) % source.chunk
            fit = min(max(fit, load == 0.0), source.contacts - first)
            first, at, load = first + fit, at + fit, load + fit * each
            if first < source.contacts or load >= longest:
                yield at
                load = 0.0


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
        usual = estimator_named(self.method)()
        for whose, given, known in (
            (self.method, self.estimator, set(usual.settings)),
            ("a preparation", self.preparation, {f.name for f in dataclasses.fields(Preparation)}),
        ):
            for name in given:
                if name not in known:
                    raise InvalidParameterError(f"{whose} has no setting {name}")
        usual.replace(**self.estimator)
        Preparation(**self.preparation)

    @property
    def law(self) -> type[ForceLaw]:
        """The force law that the method identifies."""
        return estimator_named(self.method)().law_type

    @property
    def searches_surface(self) -> bool:
        """Whether the estimator is to find the surface."""
        return self.estimator.get("surface") == "estimate"

    def estimator_for(self, contact: Contact) -> ContactEstimator:
        """Return a fresh estimator, with a gate for this contact where one is asked for."""
        made = estimator_named(self.method)().replace(**self.estimator)
        asked = self.minimum_penetration, self.minimum_force
        gate = gate_asked_for(contact, *asked, alone=made.chooses_samples)
        return made if gate is None else made.replace(gate=gate)

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
        usual = dataclasses.asdict(Columns())
        return {k: each for k, each in dataclasses.asdict(value).items() if each != usual[k]}
    return dict(value) if isinstance(value, Mapping) else repr(value)
