"""What was identified, as plain numbers and words: the object that ``--json`` prints.

``docs/results.md`` says what each field means.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate._core import __version__
from palpate.diagnosis import Episode
from palpate.errors import InvalidParameterError
from palpate.preparation.touches import touches_of
from palpate.ranking import rank
from palpate.validation import Floats, defined

if TYPE_CHECKING:
    from palpate.identification import Identified
    from palpate.settings import ContactGate

#: A field that goes, or means another thing, makes it the next.
SCHEMA_VERSION = 1


def described(files: Sequence[Path], results: "Sequence[Identified]") -> dict[str, Any]:
    """Return what files gave, by one method or by several.

    Parameters
    ----------
    files : sequence of Path
        Where the contact came from; may be empty.
    results : sequence of Identification
        Of one contact, a method each.
    """
    first = results[0]
    gate, scale, contact = _gate(results), first.scale, first.contact
    return {
        "schema_version": SCHEMA_VERSION,
        "palpate_version": __version__,
        "file": ", ".join(map(str, files)) or contact.source,
        **({"files": [str(file) for file in files]} if len(files) > 1 else {}),
        "samples": len(contact),
        "touches": [touch.as_dict() for touch in touches_of(contact)],
        "provenance": dict(contact.provenance),
        "remarks": [asdict(remark) for remark in contact.remarks],
        "tare_deviation": contact.tare_deviation,
        "surface_deviation": contact.surface_deviation,
        "gate": asdict(gate),
        "scale": asdict(scale),
        "results": [of_one(result) for result in results],
        **({"ranking": _ranking(results)} if len(results) > 1 else {}),
    }


def of_one(result: "Identified") -> dict[str, Any]:
    """Return what one method gave; what is not defined is None."""
    law, estimate, trace = result.law, result.estimate, result.trace
    beside: dict[str, float] = {}
    for name in ("offset", "surface"):
        value, error = getattr(estimate, name), getattr(estimate, f"{name}_standard_error")
        # An error bar that is undefined, or 0 of samples without noise, has its number too.
        if value != 0.0 or error > 0.0:
            beside |= {name: value, f"{name}_standard_error": error}
    return {
        "method": result.method,
        **result.diagnosis.as_dict(),
        "episodes": _episodes(result),
        "law": {"kind": law.kind, **law.as_dict()},
        "standard_errors": dict(zip(law.as_dict(), result.standard_errors.tolist(), strict=True)),
        **({"fixed": list(result.fixed)} if result.fixed else {}),
        "correlations": _correlations(result.correlations),
        **beside,
        **derived(result),
        **({"law_verdict": result.law_verdict.as_dict()} if result.law_verdict else {}),
        "prediction_rmse_percent": defined(result.prediction_rmse_percent),
        "fit_rmse_percent": defined(result.fit_rmse_percent),
        "violated_fraction": defined(result.violated_fraction),
        "changes": result.changes.tolist(),
        "contact_samples": int(np.count_nonzero(trace.taken)),
        "rejected_samples": int(np.count_nonzero(trace.rejected)),
        "flags": list(result.flags),
    }


def _episodes(result: "Identified") -> list[dict[str, Any]]:
    """Each stretch by its own law; or as the change was found, with the verdict on it alone."""
    if result.stretches:
        return [_episode(stretch) for stretch in result.stretches]
    return [
        {**episode.as_dict(), "verdict": part.diagnosis.verdict.as_dict() if part else None}
        for episode in result.diagnosis.episodes
        for part in (result.stretch(episode),)
    ]


def _episode(stretch: "Identified") -> dict[str, Any]:
    """One of the episodes of a longer contact."""
    found, time = stretch.diagnosis, stretch.contact.time
    own = Episode(float(time[0]), float(time[-1]), stretch.law, found.working_depth)
    there: dict[str, Any] = {}
    if stretch.place is not None:
        there = {"kind": "place", "place": stretch.place.as_dict()}
    return {
        **own.as_dict(),
        "verdict": found.verdict.as_dict(),
        **there,
        **derived(stretch),
    }


def _gate(results: "Sequence[Identified]") -> "ContactGate":
    """Return the gate of those methods that need one."""
    gated = (result.gate for result in results if result.estimator.settings.get("gate"))
    return next(gated, results[0].gate)


def _ranking(results: "Sequence[Identified]") -> dict[str, Any]:
    ranking = rank({result.method: result for result in results})
    return {
        "recommended": ranking.recommended,
        "order": list(ranking.order),
        "failing": list(ranking.failing),
        "exclusions": list(ranking.exclusions),
    }


def _correlations(matrix: Floats) -> list[list[float | None]]:
    return [[defined(value) for value in row] for row in matrix.tolist()]


def derived(result: "Identified") -> dict[str, Any]:
    """Return what follows from a law as plain numbers and words, a key each."""
    modulus = {}
    if result.wanted.tip is not None:
        modulus = {"elastic_modulus": result.elastic_modulus().as_dict()}
    felt: dict[str, Any] | None = None
    with suppress(InvalidParameterError):  # of a probe held still, or beyond the band of a part
        felt = result.dynamic_stiffness(result.wanted.frequency).as_dict()
    return {
        "restitution": result.restitution().as_dict(),
        "energy": result.energy.as_dict(),
        "passivity": result.passivity.as_dict(),
        "small_oscillation": felt,
        **modulus,
    }
