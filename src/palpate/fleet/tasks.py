"""The settings and sources of a fleet, and its division into tasks of about equal work."""

import dataclasses
import hashlib
import itertools
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from palpate import errors
from palpate._core import __version__
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw
from palpate.identification.quantities.derived import QueryOptions
from palpate.identification.quantities.elastic_modulus import Tip
from palpate.identification.replaying import resolve_estimator
from palpate.input.channels import Columns
from palpate.input.preparation.gate import requested_gate
from palpate.input.preparation.settings import Preparation
from palpate.method.contact import Contact
from palpate.method.estimators import ContactEstimator, VariableProjection, ViscoelasticContact
from palpate.validation import frozen, shown

#: A pyarrow table; pyarrow has no type stubs and is imported only where a table is made.
Table: TypeAlias = Any
#: Imports a package of the extra ``fleet``, or raises an error that names the feature that needs
#: it.
needed = partial(errors.import_extra, extra="fleet")


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# The contacts to identify, as source and number, in batches.

# Time per contact and per sample, s, on a core of 2.4 GHz: medians over touches of 200 to 10 000
# samples. A surface search takes three times as long as the recursion alone; this does not matter,
# because it scales all tasks alike.
_RECURSION = {"none": (3e-3, 1e-6), "input": (5e-3, 1e-6), "full": (25e-3, 12e-6)}
_WHOLE_CURVE = {"none": (1e-4, 1e-7), "input": (6e-4, 5e-7), "full": (6e-4, 5e-7)}
# To read and prepare a file: s, s per byte, and bytes per sample (29 in text with four channels).
_READING = 6e-3
_READING_A_BYTE = 15e-9
_BYTES_A_SAMPLE = 30.0
# Each task costs some 10 ms for scheduling and for writing its results.
_SHORTEST = 0.05
_LONGEST = 1.0  # s
# At the end one worker may hold two tasks while another has none: an eighth of its work.
_TASKS_A_WORKER = 16
# Samples of arrays in one task: 48 MB of penetration, velocity and force.
_SAMPLES = 2_000_000


@frozen
class ContactSource:
    """A file, force map or array that holds contacts.

    Attributes
    ----------
    name : str
        Path or address.
    kind : str
        ``"file"``, ``"map"``, ``"zarr"`` or ``"episodes"``, a data set of robot learning.
    count : int or None
        Number of contacts; None for a single contact without a number.
    samples : int
        Samples per contact, if known. Default: 0.
    chunk : int
        Number of contacts that are stored together and best read together. Default: 1.
    stamp : str
        Text that changes when the source is modified. Default: "".
    size : int
        Size of a file, bytes. Default: 0.
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
        """Number of contacts; 1 if it is not known before the source is read."""
        return 1 if self.count is None else self.count

    def seconds(self, diagnosis: str, *, whole_curve: bool) -> float:
        """Return the estimated time per contact, s."""
        by_method = _WHOLE_CURVE if whole_curve else _RECURSION
        contact, sample = by_method[diagnosis]
        if self.kind == "zarr":
            return contact + sample * self.samples
        size = self.size / max(self.contacts, 1)
        samples = self.samples or size / _BYTES_A_SAMPLE
        return _READING + _READING_A_BYTE * size + contact + sample * samples


@frozen
class Batch:
    """The contacts that one task identifies; their rows become one file of the results.

    Attributes
    ----------
    first : int
        Number of its first contact in the fleet.
    table : pyarrow.Table
        Input of :func:`palpate.fleet.running.identify_batch`: one row per contact.
    seconds : float
        Estimated time, s.
    """

    first: int
    table: Table
    seconds: float

    @property
    def end(self) -> int:
        """Number of the fleet's contact after its last one."""
        return self.first + int(self.table.num_rows)


def tasks_table(names: Sequence[str], kinds: Sequence[str], indices: Sequence[int | None]) -> Table:
    """Return a table of contacts to identify, with columns ``source``, ``kind`` and ``index``."""
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
        The sources to divide.
    seconds : sequence of float
        Estimated time per contact of each source, s.
    workers : int
        Number of workers. Default: 1.
    done : iterable of (int, int)
        Ranges (first, end) of contacts that are already identified. Default: none. They do not
        change the batches of the others.
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
    result = [  # copies: Arrow would serialise the whole table for a slice
        Batch(first, whole.take(np.arange(first, end)), float(work[first:end].sum()))
        for first, end in itertools.pairwise(sorted(edges))
        if waiting[first]
    ]
    return sorted(result, key=lambda batch: -batch.seconds)


def _cuts(
    sources: Iterable[ContactSource],
    seconds: Iterable[float],
    longest: float,
) -> Iterator[int]:
    """Yield the first contact of each batch; a stored chunk stays in one batch if possible."""
    position = 0
    load = 0.0
    yield position
    for source, each in zip(sources, seconds, strict=True):
        first = 0
        while first < source.contacts:
            fit = int((longest - load) / each)
            if source.samples:
                fit = min(fit, _SAMPLES // source.samples)
            if fit > source.chunk:
                fit -= (first + fit) % source.chunk
            fit = min(max(fit, load == 0.0), source.contacts - first)
            first = first + fit
            position = position + fit
            load = load + fit * each
            if first < source.contacts or load >= longest:
                yield position
                load = 0.0


def sources_digest(sources: Iterable[ContactSource]) -> str:
    """Return a digest that identifies these sources and their present content."""
    digest = hashlib.sha256()
    for source in sources:
        parts = (source.name, source.kind, source.count, source.samples, source.chunk, source.stamp)
        digest.update("\t".join(map(str, parts)).encode("utf-8", "backslashreplace") + b"\n")
    return digest.hexdigest()[:16]


# The settings of preparation and identification; every row has their digest.

DiagnosisDepth = Literal["none", "input", "full"]
#: Most contacts that have a full diagnosis by default: some five minutes on two cores.
MOST_DIAGNOSED = 10_000


def default_diagnosis(sources: Sequence[ContactSource]) -> DiagnosisDepth:
    """Return full for up to 10 000 recordings and episodes; for curves, which are fast, input."""
    recordings = all(source.kind in ("file", "episodes") for source in sources)
    few = sum(source.contacts for source in sources) <= MOST_DIAGNOSED
    return "full" if recordings and few else "input"


#: The default method of :func:`palpate.identify`.
AUTO = "auto"


@frozen(kw_only=True)
class Settings:
    """The settings that prepare and identify each contact.

    Parameters
    ----------
    method : str
        Name of the method. Default: "auto", as in :func:`palpate.identify` without a method, which
        selects the law; for whole curves of arrays and force maps it is Hunt–Crossley.
    estimator : mapping
        Settings of the method that differ from its defaults, such as ``{"surface": "estimate"}``.
    preparation : mapping
        Options for :func:`palpate.prepare`. Default: none.
    diagnosis : str
        ``"none"``; ``"input"`` (default) checks the data, which takes as long as the
        identification; ``"full"`` gives each contact a verdict and takes some fifty times as long.
    tip : Tip, optional
        The tip of the probe, for Young's modulus. Of force curves only the approach is then used:
        :func:`palpate.identification.quantities.indentation.fit_approach`. Default: none, and no
        modulus.
    poisson_ratio : float, optional
        Poisson's ratio of the material, in (−1, 0.5]. Default: 0.5, assumed.
    minimum_penetration, minimum_force : float, optional
        Smallest penetration, m, and force, N, in contact. Default: chosen from the data.
    max_size : float, optional
        Limit of :func:`palpate.open_recording`, bytes. Default: its default.
    version : str
        Version of palpate that made the settings; a worker with another version refuses them.

    Raises
    ------
    InvalidParameterError
        A setting is unknown or outside its range, or the method does not exist.
    """

    method: str = AUTO
    estimator: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    preparation: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    diagnosis: DiagnosisDepth = "input"
    tip: Tip | None = None
    poisson_ratio: float | None = None
    minimum_penetration: float | None = None
    minimum_force: float | None = None
    max_size: float | None = None
    version: str = dataclasses.field(default_factory=lambda: __version__)

    def __post_init__(self) -> None:
        if self.diagnosis not in get_args(DiagnosisDepth):
            raise InvalidParameterError(
                f"diagnosis must be none, input or full, not {shown(self.diagnosis)}"
            )
        usual = self.kind()
        for whose, given, known in (
            (f"method {self.method}", self.estimator, set(usual.settings)),
            ("preparation", self.preparation, {f.name for f in dataclasses.fields(Preparation)}),
        ):
            for name in given:
                if name not in known:
                    allowed = ", ".join(sorted(known))
                    raise InvalidParameterError(f"{whose} has no setting {name}; it has {allowed}")
        usual.replace(**self.estimator)
        QueryOptions(tip=self.tip, poisson_ratio=self.poisson_ratio)  # which checks them
        Preparation(**self.preparation)

    @property
    def law(self) -> type[ForceLaw]:
        """The force law that the method identifies."""
        return self.kind().law_type

    @property
    def kind(self) -> type[ContactEstimator]:
        """The estimator's class; by default variable projection if only it has these settings."""
        if self.method != AUTO:
            return type(resolve_estimator(self.method))
        able = set(self.estimator) <= set(ViscoelasticContact().settings)
        return ViscoelasticContact if able else VariableProjection

    @property
    def of_curves(self) -> "Settings":
        """The same settings, with Hunt–Crossley for whole curves if no method was chosen."""
        if self.method != AUTO or not set(self.estimator) <= set(VariableProjection().settings):
            return self
        return dataclasses.replace(self, method=VariableProjection.method)

    @property
    def searches_surface(self) -> bool:
        """Whether the estimator searches for the surface."""
        return self.estimator.get("surface") == "estimate"

    def estimator_for(self, contact: Contact) -> ContactEstimator:
        """Return a new estimator, with a contact gate if a minimum was set."""
        kind = self.kind
        if self.method == AUTO and contact.timeless:
            kind = VariableProjection
        estimator = kind().replace(**self.estimator)
        asked = self.minimum_penetration, self.minimum_force
        gate = requested_gate(contact, *asked, alone=estimator.chooses_samples)
        return estimator if gate is None else estimator.replace(gate=gate)

    def plain(self) -> dict[str, Any]:
        """Return the settings as JSON values."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        settings: dict[str, Any] = json.loads(json.dumps(values, default=_plain, sort_keys=True))
        return settings

    @property
    def digest(self) -> str:
        """Digest that identifies these settings and the version of palpate."""
        text = json.dumps(self.plain(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    if isinstance(value, Columns):
        usual = dataclasses.asdict(Columns())
        return {k: each for k, each in dataclasses.asdict(value).items() if each != usual[k]}
    return dict(value) if isinstance(value, Mapping) else repr(value)
