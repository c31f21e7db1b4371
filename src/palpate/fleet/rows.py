"""A contact, and what was identified of it, as a row of the table."""

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis import Data, Finding
from palpate.estimate import Estimate
from palpate.fleet.at_depth import AT_DEPTH
from palpate.fleet.settings import Settings
from palpate.force_laws import ForceLaw
from palpate.identification import Identified
from palpate.preparation.places import at_places
from palpate.preparation.prepared import Place
from palpate.validation import Floats

Row = dict[str, Any]


def rows_of(contact: Contact, settings: Settings) -> Iterator[Row]:
    """Identify a contact: a row, or one for each place of a probe that travels.

    Raises
    ------
    PalpateError
        It cannot be identified, and is of one place; a place that cannot is a row with its reason.
    """
    prepared = contact.prepared
    if prepared is None or not prepared.places:
        yield row_of(contact, settings)
        return
    for part, (place, there) in enumerate(at_places(contact)):
        row: Row = {"part": part, **_where(place)}
        try:
            row |= row_of(there, settings)
        except Exception as error:
            row |= failure(error)
        yield row


def row_of(contact: Contact, settings: Settings) -> Row:
    """Identify a contact of one place by the recursion.

    Raises
    ------
    PalpateError
        It cannot be identified.
    """
    data = Data(contact)
    result = Identified.of(data, settings.estimator_for(contact), trace=False)
    estimate, law = result.estimate, result.law
    row: Row = {"fit": "recursion", "samples": len(contact)}
    row |= _parameters(law, result.covariance)
    if estimate.offset_standard_error > 0.0:
        row |= {"offset": estimate.offset, "offset_standard_error": estimate.offset_standard_error}
    if estimate.surface_standard_error > 0.0:
        row["surface"] = estimate.surface
        row["surface_standard_error"] = estimate.surface_standard_error
    left = contact.force[result.trace.taken] - result.fitted_force[result.trace.taken]
    row["residual"] = float(np.sqrt(np.mean(left**2))) if left.size else math.nan
    row["taken"] = int(np.count_nonzero(result.trace.taken))
    row["largest_depth"] = result.largest_depth
    row["flags"] = list(result.flags)
    row["prepared"] = json.dumps(dict(contact.provenance), ensure_ascii=False)
    if settings.diagnosis == "full":
        return row | _diagnosed(result)
    if settings.diagnosis == "input":
        row["findings"] = [in_words(finding) for finding in data.findings]
    return row | (at_depth(law, result.covariance, result.depths[0]) if result.depths else {})


def failure(error: BaseException) -> Row:
    """Return what a row says of a contact that could not be identified."""
    words = " ".join(str(error).split()) or type(error).__name__
    return {"error": words, "error_kind": type(error).__name__}


def in_words(finding: Finding) -> str:
    """Return a finding in a line: severity, check, sentence."""
    return f"{finding.severity}: {finding.check}: {finding.sentence}"


def at_depth(law: ForceLaw, covariance: Floats, depth: float) -> Row:
    """Force, stiffness and damping at a depth, with errors by the delta method: √(gᵀ C g)."""
    known = Estimate.from_law(law, covariance, status=Status.UPDATED, samples=1)
    with np.errstate(all="ignore"):
        values, errors = known.with_errors(
            lambda of: (of.force(depth, 0.0), of.stiffness_at(depth), of.damping_at(depth))
        )
    row: Row = {"depth": depth}
    for name, value, error in zip(AT_DEPTH, values.tolist(), errors.tolist(), strict=True):
        row |= {f"{name}_at_depth": value, f"{name}_at_depth_standard_error": error}
    return row


def place_in_notes(notes: "dict[str, str]") -> Row:
    """Where an instrument says that a curve was taken: its stage's position, m."""
    row: Row = {}
    for axis in "xy":
        with suppress(ValueError, IndexError, KeyError):
            number, *unit = notes[f"position {axis}"].split()
            if unit == ["m"]:
                row[axis] = float(number)
    return row


def _where(place: Place) -> Row:
    return dict(zip("xyz", place.position.tolist(), strict=True))


def _parameters(law: ForceLaw, covariance: Floats) -> Row:
    row: Row = {"covariance": covariance.reshape(-1).tolist()}
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diag(covariance))
    parts = zip(law.names(), law.parameters.tolist(), errors.tolist(), strict=True)
    for name, value, error in parts:
        row |= {name: value, f"{name}_standard_error": error}
    return row


def _diagnosed(result: Identified) -> Row:
    found = result.diagnosis
    there, marks = found.working_depth, found.verdict
    row: Row = {
        "depth": there.depth,
        "findings": [in_words(finding) for finding in found.findings],
        "verdict": marks.overall,
        "verdict_stiffness": marks.stiffness,
        "verdict_damping": marks.damping,
    }
    for name in AT_DEPTH:
        quantity = getattr(there, name)
        row[f"{name}_at_depth"] = quantity.value
        row[f"{name}_at_depth_standard_error"] = quantity.standard_error
        row[f"{name}_at_depth_systematic"] = quantity.systematic
    return row
