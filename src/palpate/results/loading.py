"""A result that was saved, read back."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.diagnosis import MARKS, Finding, Quantity, Verdict, WorkingDepth
from palpate.errors import RecordingError
from palpate.estimators import LawVerdict
from palpate.force_laws import FORCE_LAWS, law_from
from palpate.recordings import open_recording
from palpate.remarks import Remark
from palpate.results.columns import contact_and_trace
from palpate.results.description import SCHEMA_VERSION
from palpate.trace import Trace
from palpate.validation import Floats, or_nan

RESULT = "result.json"
TRACES = ("trace.parquet", "trace.csv")  # the second where there is no pyarrow


@dataclass(frozen=True, slots=True, eq=False)
class SavedResult:
    """What :meth:`Identification.save` or ``palpate identify -o`` wrote.

    Attributes
    ----------
    folder : Path
        Where it lies.
    method : str
        Name of the estimator.
    law : ForceLaw
        The contact model, SI.
    standard_errors, correlations : numpy.ndarray, shapes (p,) and (p, p)
        Of the law's parameters, in their order.
    verdict : Verdict
        How far to trust it.
    findings : tuple of Finding
        The gravest first.
    working_depths : tuple of WorkingDepth
        Force, stiffness and damping, with both error bars.
    contact : Contact
        What was identified; :func:`palpate.identify` takes it again.
    trace : Trace
        Every sample; thinned as it was saved.
    fixed : tuple of str
        The law's parameters that were given, and not identified.
    law_verdict : LawVerdict, optional
        Which law it is, and by what evidence; None where no laws were compared.
    description : dict
        The whole of ``result.json``; ``docs/results.md`` says what is in it.
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
    fixed: tuple[str, ...]
    law_verdict: LawVerdict | None
    description: Mapping[str, Any] = field(repr=False)


def load_result(path: str | Path) -> SavedResult:
    """Read back what ``palpate identify -o`` or :meth:`Identification.save` wrote.

    Parameters
    ----------
    path : str or Path
        The folder, or its ``result.json``.

    Raises
    ------
    RecordingError
        There is no result, it is damaged, another run wrote the trace beside it, or another version
        of palpate wrote it in a way that this one does not know.
    """
    named = Path(path)
    if named.suffix != ".json" and named.is_file():
        raise RecordingError(
            f"{named}: this is a recording, not a result; run palpate identify {named} -o FOLDER, "
            "and give that folder"
        )
    file = named if named.suffix == ".json" and not named.is_dir() else named / RESULT
    whole = _described(file)
    try:
        [found], name = whole["results"], whole["trace"]
        if name not in TRACES:
            raise ValueError(f"no trace of palpate is called {name!r}")
        law = law_from(found["law"])
        recording = open_recording(file.parent / name)
        if whole.get("trace_digest", digest := digest_of(file.parent / name)) != digest:
            raise RecordingError(
                f"{file}: {name} beside it is another run's, or was changed; save the result again"
            )
        contact, trace = contact_and_trace(recording, FORCE_LAWS[law.kind])
        return SavedResult(
            folder=file.parent,
            method=found["method"],
            law=law,
            standard_errors=_numbers([found["standard_errors"][name] for name in law.names()]),
            correlations=_numbers(found["correlations"]),
            verdict=_verdict(found["verdict"]),
            findings=tuple(_finding(each) for each in found["findings"]),
            working_depths=tuple(_working_depth(each) for each in found["working_depths"]),
            contact=_as_it_was(contact, whole),
            trace=trace,
            fixed=tuple(map(str, found.get("fixed", ()))),
            law_verdict=_law_verdict(found.get("law_verdict")),
            description=whole,
        )
    except RecordingError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise RecordingError(f"{file}: the result is damaged ({reason}); identify again") from None


def digest_of(trace: Path) -> dict[str, Any]:
    """Return what tells one trace from another: the length of the file and its SHA-256."""
    with trace.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
        return {"bytes": file.tell(), "sha256": found}


def _described(file: Path) -> dict[str, Any]:
    try:
        whole = json.loads(file.read_bytes())
    except OSError as error:
        raise RecordingError(
            f"{file}: {error.strerror or 'cannot be read'}; palpate identify FILE -o FOLDER writes "
            "a result"
        ) from None
    except (ValueError, RecursionError):
        raise RecordingError(f"{file}: no JSON; it is cut off, or no result of palpate") from None
    version = whole.get("schema_version") if isinstance(whole, dict) else None
    if version is None:
        raise RecordingError(f"{file}: no result of palpate: it has no schema_version")
    if version != SCHEMA_VERSION:
        raise RecordingError(
            f"{file}: written by palpate {whole.get('palpate_version', 'of another version')} as "
            f"schema {version}, and this one reads {SCHEMA_VERSION}; install that version, or "
            "identify again"
        )
    if "trace" not in whole:
        raise RecordingError(
            f"{file}: printed by --json, which has no samples; palpate identify FILE -o FOLDER "
            "writes a result that can be read back"
        )
    return dict(whole)


def _as_it_was(contact: Contact, whole: Mapping[str, Any]) -> Contact:
    """The contact with what was known of it."""
    return Contact(
        contact.time,
        penetration=contact.penetration,
        velocity=contact.velocity,
        force=contact.force,
        segment=contact.segment,
        source=whole["file"],
        provenance=whole["provenance"],
        tare_deviation=whole["tare_deviation"],
        surface_deviation=whole["surface_deviation"],
        remarks=[Remark(**remark) for remark in whole["remarks"]],
    )


def _law_verdict(words: Mapping[str, Any] | None) -> LawVerdict | None:
    """The verdict on laws; None of a result that has none, or only names it, as earlier ones."""
    return LawVerdict.from_dict(words) if words and "damping" in words else None


def _verdict(words: Mapping[str, Any]) -> Verdict:
    """The verdict; a mark that is none would pass for trust."""
    verdict = Verdict(**words)
    for mark in verdict.as_dict().values():
        if mark not in MARKS:
            raise ValueError(f"no verdict of palpate is {mark!r}")
    return verdict


def _finding(words: Mapping[str, Any]) -> Finding:
    numbers = ("z", "moves_stiffness_percent", "moves_damping_percent")
    return Finding(**{**words, **{name: or_nan(words[name]) for name in numbers}})


def _working_depth(words: Mapping[str, Any]) -> WorkingDepth:
    quantities = {
        name: Quantity(**{part: or_nan(value) for part, value in words[name].items()})
        for name in ("force", "stiffness", "damping")
    }
    return WorkingDepth(or_nan(words["depth"]), **quantities)


def _numbers(values: Any) -> Floats:
    """Numbers, of which JSON's null is NaN."""
    return np.array(values, dtype=np.float64)
