"""Save and load a result: options as TOML, numbers as JSON, the trace as columns.

``docs/reference/results.md`` documents the fields of ``result.json``, which ``--json`` prints too.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from palpate._core import Status, __version__
from palpate.digits import format_quantity
from palpate.errors import InvalidParameterError, RecordingError, import_extra
from palpate.findings import MARKS, Finding, worst
from palpate.force_laws import ForceLaw, law_from
from palpate.identification.diagnosis import Episode, Quantity, Verdict, Where, WorkingDepth
from palpate.identification.ranking import rank
from palpate.input.preparation.touch import find_touches
from palpate.input.recordings import open_recording
from palpate.input.recordings.recording import Recording
from palpate.method.contact import Contact, Delay, VelocityFilter
from palpate.method.estimators import LawVerdict
from palpate.method.estimators.estimate import Trace
from palpate.method.rows import count_true
from palpate.validation import Floats, Values, finite_or_none, frozen, or_nan, plain

if TYPE_CHECKING:
    import pandas
    import xarray

    from palpate.identification.identified import Identified


def how_made(contact: Contact, files: Sequence[Path]) -> list[str]:
    """Return the files of a contact and its preparation as comment lines."""
    made = contact.provenance
    if len(files) > 1:  # the first file's notes also occur without its name
        made = {name: words for name, words in made.items() if " of " in name} or made
    lines = [f"of {file}" for file in files]
    lines += [f"{channel}: {words}" for channel, words in made.items()]
    return lines + [f"{finding.check}: {finding.message}" for finding in contact.findings]


# A contact and its trace as named columns, one row for each sample.

_CONTACT = {"time": "s", "penetration": "m", "velocity": "m/s", "force": "N"}
#: Names in a file, which a reader recognises without options.
FILE_NAMES = {name: f"{name}_{unit.replace('/', '_')}" for name, unit in _CONTACT.items()}


def trace_columns(result: "Identified") -> tuple[dict[str, Values], dict[str, str]]:
    """Return contact, predictions and the law after each sample as columns, and their units.

    Columns by name, of equal length: ``time``, ``penetration``, ``velocity``, ``force``,
    ``segment``, ``predicted_force`` (one-step prediction), ``fitted_force`` (final law), ``status``
    and ``validity_margin`` (condition 10), then each parameter of the law and its
    ``…_standard_error``, SI; NaN where a thinned trace has none.
    """
    contact = result.contact
    trace = result.trace
    law = result.law
    columns: dict[str, Values] = {name: getattr(contact, name) for name in _CONTACT}
    columns |= {
        "segment": contact.segment,
        "predicted_force": trace.predicted_force,
        "fitted_force": result.fitted_force,
        "status": _status_names()[trace.status],
        "validity_margin": trace.validity_margin,
    }
    units = {**_CONTACT, "predicted_force": "N", "fitted_force": "N"}
    for k, (name, unit) in enumerate(zip(law.names(), law.units, strict=True)):
        both = {name: trace.parameters, f"{name}_standard_error": trace.standard_errors}
        columns |= {column: trace.everywhere(rows[:, k]) for column, rows in both.items()}
        units |= dict.fromkeys(both, unit) if unit else {}
    return columns, units


Column = TypeVar("Column")


def toml_text(columns: Mapping[str, Column]) -> dict[str, Column]:
    """Return the columns by their names in a file."""
    return {FILE_NAMES.get(name, name): column for name, column in columns.items()}


def contact_and_trace(
    recording: Recording,
    law: type[ForceLaw],
    whole: Mapping[str, Any],
) -> tuple[Contact, Trace]:
    """Return contact and trace from columns of :func:`trace_columns` read from a file.

    Raises
    ------
    RecordingError
        A column is missing or holds invalid values.
    """
    filtered = whole["velocity_filter"]
    delay = whole["delay"]
    time, penetration, velocity, force = map(recording.numbers, FILE_NAMES.values())
    names = law.names()
    texts = recording.channels.get("status", np.empty(0, dtype=str)).astype(str)
    known = {str(name): value for value, name in enumerate(_status_names())}
    if not set(texts.tolist()) <= set(known):
        raise RecordingError(f"{recording.source}: column 'status' holds an unknown status")
    parameters = np.column_stack([recording.numbers(name) for name in names])
    errors = np.column_stack([recording.numbers(f"{name}_standard_error") for name in names])
    after = np.flatnonzero(np.isfinite(parameters).all(axis=1))  # true for each estimate
    trace = Trace(
        parameters[after],
        errors[after],
        recording.numbers("predicted_force"),
        recording.numbers("validity_margin"),
        np.array([known[text] for text in texts.tolist()], dtype=np.uint8),
        time[after],
        None if len(after) == len(time) else after,
    )
    if len(trace) != len(time):
        raise RecordingError(f"{recording.source}: column 'status' is missing")
    contact = Contact(
        time,
        penetration=penetration,
        velocity=velocity,
        force=force,
        segment=recording.numbers("segment"),
        source=whole["file"],
        delay=delay and Delay(**delay),
        findings=[*map(Finding.from_dict, whole["findings"])],
        velocity_filter=filtered and VelocityFilter(**filtered),
        **{name: whole[name] for name in _STATED},
    )
    return contact, trace


#: Fields of a contact that ``result.json`` contains unchanged.
_STATED = ("provenance", "tare_deviation", "surface_deviation", "timeless")


def _status_names() -> NDArray[np.str_]:
    """Return the names of the statuses in lower case, indexed by their numbers."""
    names = {int(status.value): status.name.lower() for status in Status}
    return np.array([names.get(k, "") for k in range(max(names) + 1)])


#: Increment it if a field is removed or changes its meaning.
SCHEMA_VERSION = 4


def describe_contact(files: Sequence[Path], results: "Sequence[Identified]") -> dict[str, Any]:
    """Return the results of files, by one method or several, as plain numbers and text.

    Parameters
    ----------
    files : sequence of Path
        Files of the contact; may be empty.
    results : sequence of Identification
        Identifications of one contact, one for each method.
    """
    first = results[0]
    gates = (result.gate for result in results if result.estimator.settings.get("gate"))
    # Not every method has a gate.
    gate = next(gates, first.gate)
    scale = first.scale
    contact = first.contact
    ranking = asdict(rank({result.method: result for result in results})) if results[1:] else {}
    return {
        "schema_version": SCHEMA_VERSION,
        "palpate_version": __version__,
        "file": ", ".join(map(str, files)) or contact.source,
        **({"files": [str(file) for file in files]} if len(files) > 1 else {}),
        "samples": len(contact),
        "touches": [touch.as_dict() for touch in find_touches(contact)],
        **{name: plain(getattr(contact, name)) for name in _STATED},
        "stated_units": sorted(contact.stated_units),
        "assumed_units": sorted(contact.assumed_units),
        "findings": plain(contact.findings),
        "velocity_filter": plain(contact.velocity_filter),
        "delay": contact.delay and asdict(contact.delay),
        "gate": asdict(gate),
        "scale": asdict(scale),
        "results": [result_dict(result) for result in results],
        **({"ranking": ranking} if ranking else {}),
    }


def result_dict(result: "Identified") -> dict[str, Any]:
    """Return the result of one method, with None for undefined values."""
    law = result.law
    estimate = result.estimate
    trace = result.trace
    estimated: dict[str, float] = {}
    for name in ("offset", "surface"):
        value = getattr(estimate, name)
        error = getattr(estimate, f"{name}_standard_error")
        # The number is also written if its error bar is undefined, or is 0 for samples without
        # noise.
        if value != 0.0 or error > 0.0:
            estimated |= {name: value, f"{name}_standard_error": error}
    return {
        "method": result.method,
        "frequency": finite_or_none(result.frequency),
        "relaxed_stiffness": plain(result.relaxed_stiffness()) if law.remembers else None,
        **result.diagnosis.as_dict(),
        "episodes": _episodes(result),
        "law": law.description(),
        "standard_errors": dict(zip(law.as_dict(), result.standard_errors.tolist(), strict=True)),
        **({"fixed": list(result.fixed)} if result.fixed else {}),
        "correlations": [[*map(finite_or_none, row)] for row in result.correlations.tolist()],
        **estimated,
        **derived_dict(result),
        "prediction_rmse_percent": finite_or_none(result.prediction_rmse_percent),
        "fit_rmse_percent": finite_or_none(result.fit_rmse_percent),
        "violated_fraction": finite_or_none(result.violated_fraction),
        "changes": result.changes.tolist(),
        "contact_samples": count_true(trace.taken),
        "rejected_samples": count_true(trace.rejected),
        "flags": list(result.flags),
    }


def _episodes(result: "Identified") -> list[dict[str, Any]]:
    """Return each segment with its own law and verdict, or as the search for changes found it."""
    if result.segments:
        return [_episode(segment) for segment in result.segments]
    return [
        {**episode.as_dict(), "verdict": part.diagnosis.verdict.as_dict() if part else None}
        for episode in result.diagnosis.episodes
        for part in (result.segment_of(episode),)
    ]


def _episode(segment: "Identified") -> dict[str, Any]:
    """Return one segment or place of a longer contact."""
    diagnosis = segment.diagnosis
    time = segment.contact.time
    episode = Episode(
        float(time[0]),
        float(time[-1]),
        segment.law,
        diagnosis.working_depth,
    ).as_dict()
    if segment.place is not None:
        episode |= {"kind": "place", "place": segment.place.as_dict()}
    return {**episode, "verdict": diagnosis.verdict.as_dict(), **derived_dict(segment)}


def derived_dict(result: "Identified") -> dict[str, Any]:
    """Return the derived quantities as plain numbers and text."""
    modulus = {}
    if result.query.tip is not None:
        modulus = {"elastic_modulus": result.elastic_modulus().as_dict()}
    elif result.query.specimen is not None:
        modulus = {"compression_modulus": result.compression_modulus().as_dict()}
    derived: dict[str, Any] = dict.fromkeys(("restitution", "energy", "passivity"))
    derived["small_oscillation"] = None
    if not result.contact.timeless:
        derived["restitution"] = result.restitution().as_dict()
        derived |= {"energy": result.energy.as_dict(), "passivity": result.passivity.as_dict()}
        with suppress(InvalidParameterError):  # a probe held still, or out of a segment's band
            oscillation = result.dynamic_stiffness(result.query.frequency)
            derived["small_oscillation"] = oscillation.as_dict()
    return {**derived, **modulus}


# Loading a saved result.

RESULT = "result.json"
TRACES = ("trace.parquet", "trace.csv")  # the second without pyarrow


@frozen(eq=False)
class SavedResult:
    """A result that :meth:`Identification.save` or ``palpate identify -o`` wrote.

    Parameters
    ----------
    folder : Path
        Folder of the result.
    method : str
        Name of the estimator.
    law : ForceLaw
        The contact model, SI.
    standard_errors, correlations : numpy.ndarray, shapes (p,) and (p, p)
        Standard errors and correlations of the law's parameters, in their order.
    verdict : Verdict
        Marks of stiffness and damping.
    findings : tuple of Finding
        The most severe first.
    working_depths : tuple of WorkingDepth
        Force, stiffness and damping, with both error bars.
    contact : Contact
        The identified contact; :func:`palpate.identify` accepts it again.
    trace : Trace
        Every sample, with the estimates that were saved.
    fitted_force : numpy.ndarray, shape (k,)
        Force of the final law, and offset if estimated, at every sample, N.
    fixed : tuple of str
        Parameters of the law that were fixed, and not identified.
    frequency : float
        ω of the motion, at which stiffness and damping hold, rad/s; NaN for a probe held still.
    relaxed_stiffness : Quantity, optional
        Relaxed stiffness at the working depth, N/m; None if the law does not relax.
    law_verdict : LawVerdict, optional
        The selected law and the evidence; None if no laws were compared.
    description : dict
        The content of ``result.json``, documented in ``docs/reference/results.md``.

    Examples
    --------
    >>> import palpate
    >>> palpate.identify("examples/recordings/ball.csv").save("ball")
    >>> saved = palpate.load_result("ball")
    >>> saved.method, saved.verdict.overall, len(saved.contact)
    ('variable-projection', 'trust', 7000)
    """

    folder: Path
    method: str
    law: Any
    standard_errors: Floats
    correlations: Floats
    verdict: Verdict
    findings: tuple[Finding, ...]
    working_depths: tuple[WorkingDepth, ...]
    contact: Contact = field(repr=False)
    trace: Trace = field(repr=False)
    fitted_force: Floats = field(repr=False)
    fixed: tuple[str, ...]
    frequency: float
    relaxed_stiffness: Quantity | None
    law_verdict: LawVerdict | None
    description: Mapping[str, Any] = field(repr=False)

    def __repr__(self) -> str:
        at = self.working_depths[0]
        where = f"at {format_quantity(at.depth, 'm')}"
        return f"<SavedResult {self.folder}, by {self.method}, {where}: {at.numbers}>"


def load_result(path: str | Path) -> SavedResult:
    """Load a result of ``palpate identify -o`` or :meth:`Identification.save`.

    Parameters
    ----------
    path : str or Path
        The folder, or its ``result.json``.

    Returns
    -------
    SavedResult
        Law, numbers, contact and trace as saved.

    Raises
    ------
    RecordingError
        There is no result, it is damaged, the trace next to it is from another run, or it has
        another schema.

    Examples
    --------
    >>> import palpate
    >>> palpate.identify("examples/recordings/ball.csv").save("ball")
    >>> print(palpate.load_result("ball").working_depths[0].stiffness)  # N/m
    2000.7 ± 0.8 (trust)
    """
    named = Path(path)
    if named.suffix != ".json" and named.is_file():
        raise RecordingError(
            f"{named}: this is a recording, not a result; run palpate identify {named} -o FOLDER "
            "and pass that folder"
        )
    file = named if named.suffix == ".json" and not named.is_dir() else named / RESULT
    whole = _read_json(file)
    try:
        [found] = whole["results"]
        name = whole["trace"]
        if name not in TRACES:
            raise ValueError(f"{name!r} is not a trace of palpate")
        law = law_from(found["law"])
        recording = open_recording(file.parent / name)
        if whole["trace_digest"] != trace_digest(file.parent / name):
            raise RecordingError(
                f"{file}: {name} has changed or is from another run; save the result again"
            )
        contact, trace = contact_and_trace(recording, type(law), whole)
        errors = found["standard_errors"]
        laws = found["law_verdict"]
        relaxed = found["relaxed_stiffness"]
        return SavedResult(
            folder=file.parent,
            method=found["method"],
            law=law,
            # JSON's null is NaN.
            standard_errors=np.array([errors[name] for name in law.names()], dtype=np.float64),
            correlations=np.array(found["correlations"], dtype=np.float64),
            verdict=_verdict(found["verdict"], found["working_depth"]),
            findings=tuple(Finding.from_dict(each) for each in found["findings"]),
            working_depths=tuple(_working_depth(each) for each in found["working_depths"]),
            contact=contact,
            trace=trace,
            fitted_force=recording.numbers("fitted_force"),
            fixed=tuple(map(str, found.get("fixed", ()))),
            frequency=or_nan(found["frequency"]),
            relaxed_stiffness=None if relaxed is None else _quantity(relaxed),
            law_verdict=LawVerdict.from_dict(laws) if laws else None,
            description=whole,
        )
    except RecordingError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise RecordingError(f"{file}: the result is damaged ({reason}); identify again") from None


def trace_digest(trace: Path) -> dict[str, Any]:
    """Return length and SHA-256 of a trace's file, which identify it."""
    with trace.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
        return {"bytes": file.tell(), "sha256": found}


def _read_json(file: Path) -> dict[str, Any]:
    try:
        whole = json.loads(file.read_bytes())
    except OSError as error:
        raise RecordingError(
            f"{file}: {error.strerror or 'cannot be read'}; palpate identify FILE -o FOLDER writes "
            "a result"
        ) from None
    except (ValueError, RecursionError):
        raise RecordingError(f"{file}: not JSON: cut off, or not a result of palpate") from None
    version = whole.get("schema_version") if isinstance(whole, dict) else None
    if version is None:
        raise RecordingError(f"{file}: not a result of palpate: it has no schema_version")
    if version != SCHEMA_VERSION:
        raise RecordingError(
            f"{file}: the result has schema {version}, but palpate {__version__} reads schema "
            f"{SCHEMA_VERSION}; identify again"
        )
    if "trace" not in whole:
        raise RecordingError(
            f"{file}: printed by --json, without samples; palpate identify FILE -o FOLDER writes a "
            "result that can be loaded"
        )
    return dict(whole)


def _verdict(words: Mapping[str, Any], at: Mapping[str, Any]) -> Verdict:
    """Return the verdict; an unknown mark is an error, because it would count as trust."""
    for mark in words.values():
        if mark not in MARKS:
            raise ValueError(f"{mark!r} is not a verdict of palpate")
    given = at["damping"]["value"] is not None
    return Verdict(**words, overall=worst(*words.values()) if given else words["stiffness"])


def _working_depth(words: Mapping[str, Any]) -> WorkingDepth:
    quantities = (_quantity(words[name]) for name in ("force", "stiffness", "damping"))
    return WorkingDepth(or_nan(words["depth"]), *quantities, speed=words.get("speed", 0.0))


def _quantity(words: Mapping[str, Any]) -> Quantity:
    value, error, moved = (
        or_nan(words[part]) for part in ("value", "standard_error", "systematic")
    )
    place = words.get("at")
    at = place and Where(*map(or_nan, (place["depth"], place["frequency"], place["speed"])))
    return Quantity(
        value,
        error,
        moved,
        mark=words.get("mark"),
        reason=words.get("reason", ""),
        at=at,
    )


# A contact and its trace for pandas and xarray.


def to_pandas(result: "Identified") -> "pandas.DataFrame":
    """Return the columns of :func:`trace_columns`, indexed by time; units in ``attrs``."""
    pandas = import_extra("pandas", "to_pandas", "notebook")
    columns, units = trace_columns(result)
    frame = pandas.DataFrame(columns).set_index("time")
    frame.attrs["units"] = units
    if result.fixed:
        frame.attrs["fixed"] = list(result.fixed)
    return frame


def to_xarray(result: "Identified") -> "xarray.Dataset":
    """Return samples along ``time`` and parameters along ``parameter``; units as attributes."""
    module = import_extra("xarray", "to_xarray", "notebook")
    law = result.law
    trace = result.trace
    (columns, units) = trace_columns(result)
    for each in law.names():
        del columns[each], columns[f"{each}_standard_error"]
    time = columns.pop("time")
    names = np.array(law.names())
    variables: dict[str, Any] = {
        name: ("time", values, {"units": units[name]} if name in units else {})
        for name, values in columns.items()
    }
    for name in ("parameters", "standard_errors"):
        variables[name] = (("time", "parameter"), trace.everywhere(getattr(trace, name)))
    variables["covariance"] = (("parameter", "other_parameter"), result.covariance)
    found: xarray.Dataset = module.Dataset(
        variables,
        coords={
            "time": ("time", time, {"units": "s"}),
            "parameter": names,
            "other_parameter": names,
            "unit": ("parameter", list(law.units)),
        },
        attrs={
            "law": law.kind,
            "method": result.method,
            "source": result.contact.source,
            **({"fixed": list(result.fixed)} if result.fixed else {}),
        },
    )
    return found
